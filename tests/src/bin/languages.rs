//! Compares a round trip through C and C++ with one through Rust, alternately in one run: `cargo
//! xtask languages`.
//!
//! The daemon spins on one core, the program on another. The lowest median of each language counts,
//! because other load only adds to it. A language without a compiler on this machine is SKIPPED,
//! with a message. Exit code 1 above the limit.
#![expect(clippy::print_stdout, reason = "its account is what it is for")]
#![expect(clippy::expect_used, reason = "a comparison that cannot go on ends loudly")]

use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::Duration;
use tests::clients::{Language, Prefix, figures, has, root, run, skipped};
use tests::place::{CELL, TestDirectory};
use tests::process::Process;

/// Largest ratio of a round trip to one through Rust.
const BAR: f64 = 1.1;
const ROUNDS: usize = 15;
const TARGETS: &str = "20000";
const LIMIT: Duration = Duration::from_secs(20);
/// Tables of the examples' cell besides its robot.
const TABLES: &str = "[force]\nrate_Hz = 10000.0\nchannels = 3\n[vibration]\nenabled = true\n[cycle]\nperiod_ms = 0.1\nwait = \"spin\"\n";

fn main() -> ExitCode {
    let built = std::env::current_exe().expect("a path");
    let prefix = Prefix::install("languages");
    let mut programs = vec![("Rust".to_owned(), built.with_file_name("every-call"))];
    for language in [Language::C, Language::Cpp] {
        match ["pkg-config", language.compiler()].iter().find(|program| !has(program)) {
            Some(missing) => {
                let what = format!("a round trip through {language:?}");
                skipped(&root().join("target/tmp"), &what, &format!("no `{missing}`"));
            }
            None => {
                programs.push((format!("{language:?}"), prefix.build(language, "every_call")));
            }
        }
    }
    let cores = Cores::here();
    let trued = built.with_file_name("trued-under-test");
    let mut turns = vec![Vec::new(); programs.len()];
    for _ in 0..ROUNDS {
        for (turns, (_, program)) in turns.iter_mut().zip(&programs) {
            turns.push(round_trip_us(&trued, program, &cores));
        }
    }
    let minimum = |turns: &[f64]| turns.iter().copied().fold(f64::INFINITY, f64::min);
    let rust = minimum(&turns[0]);
    println!("round trip, µs: lowest median of {ROUNDS} runs of {TARGETS} targets, by turns");
    let mut holds = true;
    for ((language, _), turns) in programs.iter().zip(&mut turns) {
        let ratio = minimum(turns) / rust;
        holds &= ratio <= BAR;
        turns.sort_by(f64::total_cmp);
        let (minimum, median) = (turns[0], turns[ROUNDS / 2]);
        println!(
            "{language:<5} {minimum:7.3}  {ratio:5.3} times Rust  (middle of the runs {median:.3})"
        );
    }
    println!("bar {BAR}: {}", if holds { "held" } else { "MISSED" });
    ExitCode::from(u8::from(!holds))
}

/// Two cores, one for each side; with a single core, that one for both.
struct Cores {
    daemon: CpuSet,
    client: CpuSet,
}

impl Cores {
    fn here() -> Self {
        let all = sched_getaffinity(None).expect("an affinity");
        let mut free = (0..CpuSet::MAX_CPU).filter(|core| all.is_set(*core));
        let mut next = || {
            free.next().map_or(all, |core| {
                let mut one = CpuSet::new();
                one.set(core);
                one
            })
        };
        Self { daemon: next(), client: next() }
    }
}

/// The median of a program's round trips, µs, with a separate spinning daemon: the client's part is
/// compared.
fn round_trip_us(trued: &Path, program: &PathBuf, cores: &Cores) -> f64 {
    let place = TestDirectory::new("full", TABLES);
    let config = place.file("cell.toml");
    sched_setaffinity(None, &cores.daemon).expect("a core of this process");
    let mut start = Command::new(trued);
    start.args(["run", "--lockstep", "--config"]).arg(config);
    let daemon = Process::spawn(&mut start, &place);
    assert!(daemon.wait_for_output("ready", LIMIT), "{:?}", daemon.lines());
    sched_setaffinity(None, &cores.client).expect("a core of this process");
    let mut command = Command::new(program);
    command.env(shm_schema::RUNTIME_DIR_ENV, place.root()).args([CELL, TARGETS]);
    figures(&run(&mut command))["round_trip_us_p50"].parse().expect("a number of microseconds")
}
