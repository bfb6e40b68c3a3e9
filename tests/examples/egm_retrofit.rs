//! An EGM cell retrofitted with a bridge: tool error of the robot without and with it.
//!
//! `cargo run --release -p tests --example egm_retrofit [SEED]`
#![expect(clippy::print_stdout, reason = "it shows something")]

use std::process::ExitCode;
use tests::retrofit;

/// In front of the arguments, this program is `trued`.
const AS_TRUED: &str = "as-trued";

fn main() -> ExitCode {
    let mut arguments = std::env::args_os();
    let program = arguments.next().unwrap_or_default();
    let first = arguments.next();
    if first.as_deref().is_some_and(|first| first == AS_TRUED) {
        return trued::run(std::iter::once(program).chain(arguments));
    }
    let seed = first.and_then(|seed| seed.to_str()?.parse().ok()).unwrap_or(7);
    let myself = std::env::current_exe().unwrap_or_default();
    let done = retrofit::run(&myself.to_string_lossy(), &[AS_TRUED], seed);
    let [without, with] = done.mean_and_largest_m();
    println!("tool error, mm        mean   largest");
    println!("without the bridge   {:.3}     {:.3}", 1e3 * without.0, 1e3 * without.1);
    println!("with the bridge      {:.3}     {:.3}", 1e3 * with.0, 1e3 * with.1);
    println!(
        "{} cycles, {} without an answer, {} answered late",
        done.errors_m.len(),
        done.missed,
        done.late
    );
    done.counted.iter().for_each(|line| println!("{line}"));
    ExitCode::SUCCESS
}
