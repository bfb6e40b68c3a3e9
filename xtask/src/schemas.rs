//! `cargo xtask schemas`: the JSON Schemas under `schemas/`, generated from the program's types. `tests/it/schemas.rs` fails if they are out of date.

use std::fs;
use std::io::Result;
use std::path::Path;

/// Regenerates them; existing files are removed.
pub(crate) fn run() -> std::result::Result<bool, String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../schemas");
    let count = write(&folder).map_err(|why| format!("{}: {why}", folder.display()))?;
    println!("{count} schemas written to schemas/");
    Ok(true)
}

fn write(folder: &Path) -> Result<usize> {
    if folder.exists() {
        fs::remove_dir_all(folder)?;
    }
    fs::create_dir_all(folder.join("results"))?;
    let all = trued::schemas::all();
    for (name, schema) in &all {
        fs::write(folder.join(name), format!("{schema:#}\n"))?;
    }
    Ok(all.len())
}
