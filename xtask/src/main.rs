//! Development tasks. Every figure quoted in a document comes from one of these commands.
//!
//! Not part of the product: nothing depends on it.
#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a chore talks to the person who ran it"
)]

mod batch;
mod calibrate;
mod comparisons;
mod evidence_task;
mod instructions;
mod man;
mod sbom;
mod schemas;
mod seeds;
mod soak;
mod speed;
mod vibration_figures;

use std::process::ExitCode;

const HELP: &str = "\
cargo xtask batch [COUNT]   batch diagnosis of COUNT (200) generated recordings: one digest whatever the shards and the kills, throughput beside single diagnoses; exit 1 above its bar
cargo xtask seeds [COUNT] [--full] [--debug]   the demo over COUNT seeds (20): tool error without, with, after the diagnosis; whether what is hidden was named right
cargo xtask calibrate [CAMPAIGNS] [--out=DIR]   the calibration: the thesis' virtual robot, coverage of intervals over CAMPAIGNS (1000), outliers, time
cargo xtask evidence [--data DIR] [--only SET] [--challenge CASES] [--limit SECONDS] [--trued PROGRAM]   docs/evidence.md and its plots, from the recordings in DIR ($TRUED_DATA); runs that are kept under target/evidence and whose program and input are unchanged are not repeated
cargo xtask instructions [--store]   the hot path's stages: instructions by callgrind beside those stored; more than a tenth more fails
cargo xtask languages   a round trip through C and C++ beside one through Rust, by turns in one run; exit 1 above its bar
cargo xtask man [--out=DIR]   man pages and shell completions of the program, for the package
cargo xtask peers   one correction beside Pinocchio's forward kinematics, Jacobian and gravity (from the package registry), by turns in one run; exit 1 above its bar
cargo xtask sbom [--out=DIR]   what is linked into program and C library, as CycloneDX, for the packages
cargo xtask schemas   the JSON Schemas of all files and results, under schemas/
cargo xtask soak [--minutes N] [--seed S]   faults at random over real processes for N (60) minutes: what was late, what broke, the daemon's memory
cargo xtask speed [position|torque|force]   processor time of a diagnosis of 1e5 and 1e6 rows, Parquet in, report out; exit 1 above its bar
cargo xtask watch [HOURS] [--from=JSON] [--out=DIR]   the vibration monitor: detection, false alarms in HOURS (10) of noise per axis, transients, cost
";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done = match arguments.as_slice() {
        ["languages"] => comparisons::languages(),
        ["peers"] => comparisons::peers(),
        ["batch", rest @ ..] => batch::run(rest),
        ["seeds", rest @ ..] => seeds::run(rest),
        ["calibrate", rest @ ..] => calibrate::run(rest),
        ["evidence", rest @ ..] => evidence_task::run(rest),
        ["instructions", rest @ ..] => instructions::run(rest),
        ["man", rest @ ..] => man::run(rest),
        ["sbom", rest @ ..] => sbom::run(rest),
        ["schemas"] => schemas::run(),
        ["soak", rest @ ..] => soak::run(rest),
        ["speed", rest @ ..] => speed::run(rest),
        ["watch", rest @ ..] => vibration_figures::run(rest),
        _ => {
            print!("{HELP}");
            return ExitCode::from(2);
        }
    };
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(why) => {
            eprintln!("xtask: {why}");
            ExitCode::from(3)
        }
    }
}
