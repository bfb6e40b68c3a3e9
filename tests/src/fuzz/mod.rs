//! Properties that must hold for arbitrary bytes, one function per parser: `fn(&[u8])`.
//!
//! Shared by `tests/fuzz` (stable, bounded, in CI) and the programs in `fuzz/` (`cargo fuzz`). A
//! function returns for any bytes; if the result violates a property, it panics with a description.
//! Deterministic, without files and clocks.

mod answers;
mod bridges;
mod files;
mod messages;

/// One parser, or one chain of them.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Its name, also that of its folder in `fuzz/seeds`.
    pub name: &'static str,
    /// Takes any bytes.
    pub run: fn(&[u8]),
    /// Other files of the tree that are examples of its input: folder and ending.
    pub examples: &'static [(&'static str, &'static str)],
    /// Relative number of inputs in CI, of 100: slow targets have fewer.
    pub share: u64,
}

/// Every target.
pub const ALL: &[Target] = &[
    Target { name: "model", run: files::model, examples: &[("deploy/presets", "toml")], share: 40 },
    Target { name: "cell", run: files::cell, examples: &[("deploy", "toml")], share: 100 },
    Target { name: "cut", run: files::cut, examples: &[], share: 100 },
    Target { name: "manifest", run: files::manifest, examples: &[], share: 100 },
    Target { name: "about", run: files::about, examples: &[], share: 100 },
    Target {
        name: "mapping",
        run: files::mapping,
        examples: &[("deploy/mappings", "toml")],
        share: 100,
    },
    Target { name: "recording", run: files::recording, examples: &[], share: 100 },
    Target { name: "black_box", run: files::black_box, examples: &[], share: 100 },
    Target {
        name: "waves",
        run: files::waves,
        examples: &[
            ("recording/src/waves/fixtures", "uff"),
            ("recording/src/waves/fixtures", "wav"),
        ],
        share: 100,
    },
    Target {
        name: "urdf",
        run: files::urdf,
        examples: &[("recording/tests/urdf", "urdf")],
        share: 40,
    },
    Target { name: "commands", run: messages::commands, examples: &[], share: 100 },
    Target { name: "force", run: messages::force, examples: &[], share: 40 },
    Target { name: "messages", run: messages::all_others, examples: &[], share: 100 },
    Target { name: "rsi", run: bridges::rsi, examples: &[], share: 100 },
    Target { name: "egm", run: bridges::egm, examples: &[], share: 100 },
    Target { name: "bridge", run: bridges::config, examples: &[("deploy", "toml")], share: 100 },
    Target { name: "answer", run: answers::answer, examples: &[], share: 40 },
    Target { name: "request", run: answers::request, examples: &[], share: 20 },
];

/// Runs the target with that name.
///
/// # Panics
/// If a property is violated, or there is no such target.
pub fn run(name: &str, bytes: &[u8]) {
    let target = ALL.iter().find(|target| target.name == name);
    (target.expect("a target of the house").run)(bytes);
}
