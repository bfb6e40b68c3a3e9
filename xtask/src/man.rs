//! Man pages and shell completions, from the program's own command line: `target/package`.
//!
//! Everything is generated; the same command line gives the same files.

use std::fs;
use std::io::Result;
use std::path::{Path, PathBuf};

use clap::Command;
use clap_complete::Shell;
use clap_mangen::Man;

const USAGE: &str = "cargo xtask man [--out=DIR]";

/// Writes the pages to `DIR/man` and the completions to `DIR/completions`; `DIR` is `target/package` unless given.
pub(crate) fn run(arguments: &[&str]) -> std::result::Result<bool, String> {
    let out = match arguments {
        [] => Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/package"),
        [argument] => argument.strip_prefix("--out=").map(PathBuf::from).ok_or(USAGE)?,
        _ => return Err(USAGE.to_owned()),
    };
    let pages = write(&out).map_err(|why| format!("{}: {why}", out.display()))?;
    println!("{pages} pages and 3 completions in {}", out.display());
    Ok(true)
}

fn write(out: &Path) -> Result<usize> {
    let (man, completions) = (out.join("man"), out.join("completions"));
    for folder in [&man, &completions] {
        if folder.exists() {
            // The page of a removed command is removed too.
            fs::remove_dir_all(folder)?;
        }
        fs::create_dir_all(folder)?;
    }
    let mut command = trued::command();
    for shell in [Shell::Bash, Shell::Zsh, Shell::Fish] {
        clap_complete::generate_to(shell, &mut command, "trued", &completions)?;
    }
    command.build();
    page(&command, "trued", &man)
}

/// A page for a command and for each below it, as `trued-model-show.1`.
fn page(command: &Command, name: &str, folder: &Path) -> Result<usize> {
    let mut text = Vec::new();
    let title: &'static str = Box::leak(name.to_owned().into_boxed_str());
    let titled = command.clone().name(title);
    Man::new(titled).manual("trued").render(&mut text)?;
    fs::write(folder.join(format!("{name}.1")), text)?;
    let below = command.get_subcommands().filter(|below| !below.is_hide_set());
    below
        .map(|below| page(below, &format!("{name}-{}", below.get_name()), folder))
        .sum::<Result<usize>>()
        .map(|n| n + 1)
}
