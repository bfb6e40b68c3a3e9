//! The vibration monitor's figures: detection, false alarms, cost. Prints one JSON object.
//!
//! `cargo run --release -p spectrum --example watch_figures -- [detection] [curve=HOURS]
//! [transients] [noise=HOURS] [starts] [cost] [seed=N]`; without a name, all of them, with one hour of noise each. Noise is
//! given as rms within 0 to 500 Hz; all times include filters, hop and blocks of 2 ms.

mod cost;
mod curve;
mod detection;
mod noise;
mod rig;
mod transients;

use std::io::Write;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |key: &str| {
        arguments
            .iter()
            .find_map(|argument| argument.strip_prefix(key)?.strip_prefix('=')?.parse::<f64>().ok())
    };
    let named = |key: &str| {
        arguments.iter().any(|argument| argument == key || argument.starts_with(&format!("{key}=")))
    };
    let all = !["detection", "curve", "transients", "noise", "starts", "cost"]
        .iter()
        .any(|key| named(key));
    let seed = number("seed").unwrap_or(1.0) as u64;
    let mut parts = vec![format!("\"schema\": \"trued.watch_figures/1\", \"seed\": {seed}")];
    if all || named("detection") {
        parts.push(format!("\"detection\": {}", detection::table(seed)?));
    }
    if all || named("curve") {
        let hours = number("curve").unwrap_or(1.0);
        parts.push(format!("\"curve\": {}", curve::table(seed, hours)?));
    }
    if all || named("transients") {
        parts.push(format!("\"transients\": {}", transients::table(seed)?));
    }
    if all || named("noise") {
        parts.push(format!("\"noise\": {}", noise::table(seed, number("noise").unwrap_or(1.0))?));
    }
    if all || named("starts") {
        parts.push(format!("\"starts\": {}", noise::starts_table(seed)?));
    }
    if all || named("cost") {
        parts.push(format!("\"cost\": {}", cost::table()?));
    }
    writeln!(std::io::stdout(), "{{ {} }}", parts.join(",\n  "))?;
    Ok(())
}
