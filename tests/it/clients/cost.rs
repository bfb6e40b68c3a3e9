//! A round trip through C and C++ costs what one through Rust costs.

use super::{EVERY_CALL, TABLES, beside, compiled, lockstep};
use std::path::Path;
use tests::clients::{Prefix, figures, run};

/// The bar, and how often it is tried to come below it: the machine may be busy.
const MOST: f64 = 1.1;
const ROUNDS: usize = 8;
const TARGETS: &str = "4000";

/// The middle of a program's round trips, µs, with a daemon that spins: what is compared is the client's part.
fn round_trip_us(program: &Path) -> f64 {
    let (place, _daemon) = lockstep(&format!("{TABLES}wait = \"spin\"\n"));
    figures(&run(beside(&place, program).arg(TARGETS)))["round_trip_us_p50"].parse().unwrap()
}

#[test]
fn a_round_trip_through_c_and_cpp_costs_at_most_a_tenth_more_than_through_rust() {
    let prefix = Prefix::install("cost");
    let programs = compiled(&prefix, "every_call");
    let mut rust = f64::INFINITY;
    let mut others = vec![f64::INFINITY; programs.len()];
    for round in 1..=ROUNDS {
        rust = rust.min(round_trip_us(Path::new(EVERY_CALL)));
        for (least, (_, program)) in others.iter_mut().zip(&programs) {
            *least = least.min(round_trip_us(program));
        }
        let dearest = others.iter().fold(0.0, |most: f64, us| most.max(us / rust));
        println!(
            "round {round}: Rust {rust:.3} us, others {others:.3?} us, at most {dearest:.3} times"
        );
        if dearest <= MOST {
            return;
        }
    }
    panic!("Rust {rust} us, {programs:?} {others:?} us, expected at most {MOST} times");
}
