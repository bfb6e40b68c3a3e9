//! Name and version of the program, for written files; results as JSON objects that name both.

use std::sync::OnceLock;

use serde::Serialize;

/// What the first lines of a page or a drawing of trued contain; `report::MADE_BY` is the same.
pub const MADE_BY: &str = "<!-- made by trued -->";

/// As `trued 0.2.0`, or `trued 0.2.0 (0123456789ab)` with the commit that it was built from, where the build stated it (environment variable `TRUED_COMMIT`).
#[must_use]
pub fn version() -> &'static str {
    static VERSION: OnceLock<String> = OnceLock::new();
    VERSION.get_or_init(|| {
        let commit = option_env!("TRUED_COMMIT").filter(|commit| !commit.is_empty());
        let commit = commit.map(|commit| format!(" ({commit})")).unwrap_or_default();
        format!("trued {}{commit}", env!("CARGO_PKG_VERSION"))
    })
}

/// A result as JSON: the name of its format (`schema`) and [`version`] first, then the keys of `body`, which is a struct or a map. Numbers that are not
/// finite become `null`. Without a newline at the end.
///
/// # Errors
/// `body` is no object.
pub fn json(format: &str, body: &impl Serialize) -> Result<String, serde_json::Error> {
    #[derive(Serialize)]
    struct Named<'a, T> {
        schema: &'a str,
        version: &'a str,
        #[serde(flatten)]
        body: &'a T,
    }
    serde_json::to_string_pretty(&Named { schema: format, version: version(), body })
}
