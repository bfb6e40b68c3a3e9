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
    let mut settings = EvidenceSettings {
        program: PathBuf::new(),
        data: std::env::var_os("TRUED_DATA").map_or(root.join("data"), PathBuf::from),
        out: root.join("docs"),
        work: target.join("evidence"),
        only: None,
        challenge: None,
        limit_s: LIMIT_S,
    };
    let mut rest = arguments.iter();
    while let Some(option) = rest.next() {
        let value = rest.next().ok_or_else(|| format!("{option}: expected a value behind it"))?;
        let number = || format!("{option} {value}: expected a number above zero");
        match *option {
            "--data" => settings.data = PathBuf::from(value),
            "--out" => settings.out = PathBuf::from(value),
            "--only" => settings.only = Some((*value).to_owned()),
            "--trued" => settings.program = PathBuf::from(value),
            "--challenge" => settings.challenge = Some(value.parse().map_err(|_| number())?),
            "--limit" => settings.limit_s = value.parse().map_err(|_| number())?,
            _ => {
                return Err(format!(
                    "{option}: expected --data, --only, --challenge, --limit, --trued or --out"
                ));
            }
        }
    }
    if settings.program.as_os_str().is_empty() {
        let cargo = std::env::var_os("CARGO").unwrap_or("cargo".into());
        let build = ["build", "--release", "--quiet", "--package", "trued"];
        let status = Command::new(cargo).args(build).status().map_err(|why| why.to_string())?;
        if !status.success() {
            return Err("cargo build --release --package trued failed".to_owned());
        }
        settings.program = target.join("release").join("trued");
    }
    let met = generate(&settings)?;
    println!("written to {}", settings.out.join("evidence.md").display());
    Ok(met)
}
