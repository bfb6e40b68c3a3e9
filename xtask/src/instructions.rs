//! Instructions of the hot path, stage by stage, counted by callgrind and compared with stored
//! counts: on a shared machine, times vary by ten per cent, instruction counts do not.
//!
//! Another version of the compiler changes the counts by a few per cent; they must then be stored
//! again.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

/// The stored counts, one stage a line.
const STORED: &str = "corrector/benches/instructions.txt";
/// Largest accepted growth.
const GROWTH: f64 = 1.10;
/// Numbers of runs whose difference is counted, so that start and end of the program are excluded.
const RUNS: [u64; 2] = [100, 1100];

/// Prints a row per stage; returns whether none has grown. `--store` writes the counts instead.
pub(crate) fn run(arguments: &[&str]) -> Result<bool, String> {
    let program = program()?;
    let stages = output(Command::new(&program))?;
    let stored = std::fs::read_to_string(STORED).unwrap_or_default();
    let known = |stage: &str| -> Option<f64> {
        stored.lines().find_map(|line| line.strip_prefix(stage)?.trim().parse().ok())
    };
    let (mut text, mut sound) = (String::new(), true);
    println!("{:<12} {:>12} {:>10} {:>7}", "stage", "instructions", "stored", "ratio");
    for stage in stages.lines() {
        let [few, many] = RUNS.map(|times| count_instructions(&program, stage, times));
        let each = (many? - few?) / (RUNS[1] - RUNS[0]);
        let known = known(stage);
        let ratio = known.map_or(f64::NAN, |known| each as f64 / known);
        let stored = known.map_or_else(|| "none".to_owned(), |known| known.to_string());
        println!("{stage:<12} {each:>12} {stored:>10} {ratio:>7.3}");
        sound &= known.is_some() && ratio <= GROWTH;
        writeln!(text, "{stage} {each}").map_err(|why| why.to_string())?;
    }
    if arguments.contains(&"--store") {
        std::fs::write(STORED, text).map_err(|why| format!("{STORED}: {why}"))?;
        return Ok(true);
    }
    if !sound {
        println!(
            "a stage grew by more than a tenth, or is not stored: find out why, or `cargo xtask instructions --store`"
        );
    }
    Ok(sound)
}

/// Builds the stages and returns the program's path.
fn program() -> Result<String, String> {
    let bench = ["bench", "--package", "corrector", "--bench", "counted", "--no-run"];
    let built = Command::new("cargo").args(bench).output().map_err(|why| why.to_string())?;
    let stderr = String::from_utf8_lossy(&built.stderr);
    let built = stderr.lines().find(|line| line.trim_start().starts_with("Executable"));
    let path = built.and_then(|line| line.split_once('(')?.1.strip_suffix(')'));
    let path = path.filter(|path| Path::new(path).exists());
    path.map(str::to_owned)
        .ok_or_else(|| format!("cargo {} built nothing:\n{stderr}", bench.join(" ")))
}

fn count_instructions(program: &str, stage: &str, times: u64) -> Result<u64, String> {
    let mut valgrind = Command::new("valgrind");
    valgrind.args(["--tool=callgrind", "--callgrind-out-file=/dev/null", program, stage]);
    let done = valgrind.arg(times.to_string()).output();
    let done = done.map_err(|why| {
        format!("valgrind: {why}; expected it installed (Debian: apt-get install valgrind)")
    })?;
    let stderr = String::from_utf8_lossy(&done.stderr);
    let count =
        stderr.lines().find_map(|line| line.split_once("Collected : ")?.1.trim().parse().ok());
    count.ok_or_else(|| format!("valgrind counted nothing for {stage}:\n{stderr}"))
}

fn output(mut command: Command) -> Result<String, String> {
    let done = command.output().map_err(|why| why.to_string())?;
    Ok(String::from_utf8_lossy(&done.stdout).into_owned())
}
