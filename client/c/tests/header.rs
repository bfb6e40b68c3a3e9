//! `trued.h` is what the sources say: committed, and never behind.
//!
//! `TRUED_BLESS=1 cargo test -p trued-client-c --test header` writes it anew.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::path::Path;

fn generated() -> String {
    let manifest_dir = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(manifest_dir.join("cbindgen.toml")).unwrap();
    let bindings =
        cbindgen::Builder::new().with_crate(manifest_dir).with_config(config).generate().unwrap();
    let mut text = Vec::new();
    bindings.write(&mut text);
    String::from_utf8(text).unwrap()
}

#[test]
fn the_committed_header_is_what_the_sources_say() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("include/trued.h");
    let fresh = generated();
    if std::env::var_os("TRUED_BLESS").is_some() {
        std::fs::write(&path, &fresh).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    let stale = fresh.lines().zip(committed.lines()).find(|(fresh, committed)| fresh != committed);
    assert!(
        committed == fresh,
        "trued.h is stale, first at {stale:?}: TRUED_BLESS=1 cargo test -p trued-client-c --test header"
    );
}
