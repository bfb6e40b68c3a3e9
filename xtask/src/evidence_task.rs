//! `cargo xtask evidence`: options, and the program under test, built in release mode unless one is given.

use std::path::{Path, PathBuf};
use std::process::Command;

use xtask::evidence::{EvidenceSettings, generate};

/// Default time limit of one run, s.
const LIMIT_S: f64 = 3600.0;

/// Writes `docs/evidence.md`; returns whether every limit is met.
pub(crate) fn run(arguments: &[&str]) -> Result<bool, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."));
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or(root.join("target"), PathBuf::from);
    let mut asked = EvidenceSettings {
        program: PathBuf::new(),
        data: std::env::var_os("TRUED_DATA").map_or(root.join("data"), PathBuf::from),
        out: root.join("docs"),
        work: target.join("evidence"),
        only: None,
        challenge: None,
        limit_s: LIMIT_S,
    };
    let mut rest = arguments.iter();
    while let Some(word) = rest.next() {
        let value = rest.next().ok_or_else(|| format!("{word}: expected a value behind it"))?;
        let number = || format!("{word} {value}: expected a number above zero");
        match *word {
            "--data" => asked.data = PathBuf::from(value),
            "--out" => asked.out = PathBuf::from(value),
            "--only" => asked.only = Some((*value).to_owned()),
            "--trued" => asked.program = PathBuf::from(value),
            "--challenge" => asked.challenge = Some(value.parse().map_err(|_| number())?),
            "--limit" => asked.limit_s = value.parse().map_err(|_| number())?,
            _ => {
                return Err(format!(
                    "{word}: expected --data, --only, --challenge, --limit, --trued or --out"
                ));
            }
        }
    }
    if asked.program.as_os_str().is_empty() {
        let cargo = std::env::var_os("CARGO").unwrap_or("cargo".into());
        let build = ["build", "--release", "--quiet", "--package", "trued"];
        let status = Command::new(cargo).args(build).status().map_err(|why| why.to_string())?;
        if !status.success() {
            return Err("cargo build --release --package trued failed".to_owned());
        }
        asked.program = target.join("release").join("trued");
    }
    let met = generate(&asked)?;
    println!("written to {}", asked.out.join("evidence.md").display());
    Ok(met)
}
