//! Figures of the calibration on simulated robots: errors on the thesis' robot, coverage of confidence intervals, effect of outliers. Prints one JSON
//! object.
//!
//! `cargo run --release -p diagnosis --example calibrate_figures -- [robot[=SEEDS]] [coverage[=CAMPAIGNS]] [selected[=CAMPAIGNS]]
//! [outliers[=CAMPAIGNS]]`; without a name, all of them.
#![expect(clippy::print_stdout, reason = "an example that prints")]

mod coverage;
mod outliers;
mod rig;
mod robot;

use serde_json::{Map, Value};
use std::error::Error;

type Part = fn(u64) -> Result<Value, Box<dyn Error>>;
const PARTS: [(&str, Part, u64); 4] = [
    ("robot", robot::figures, 5),
    ("coverage", coverage::fixed, 1000),
    ("selected", coverage::selected, 200),
    ("outliers", outliers::figures, 20),
];

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let mut results = Map::new();
    for (name, figures, count) in PARTS {
        let count_in = |argument: &str| match argument.split_once('=') {
            Some((key, count)) if key == name => count.parse().ok(),
            _ => (argument == name).then_some(count),
        };
        let wanted = arguments.iter().find_map(|argument| count_in(argument));
        if let Some(count) = wanted.or(arguments.is_empty().then_some(count)) {
            results.insert(name.to_owned(), figures(count)?);
        }
    }
    println!("{:#}", Value::Object(results));
    Ok(())
}
