//! Name and version of the program, for written files.

use std::sync::OnceLock;

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
