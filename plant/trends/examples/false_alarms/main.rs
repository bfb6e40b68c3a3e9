//! How often a fleet in which nothing changes raises an alarm: `cargo run --release --example false_alarms -- FLEETS RECORDINGS`.

mod fleet;

use fleet::{ROBOTS, fleet};
use trends::{Settings, evaluate};

fn main() {
    let counts: Vec<usize> =
        std::env::args().skip(1).filter_map(|argument| argument.parse().ok()).collect();
    let (fleets, recordings) =
        (counts.first().copied().unwrap_or(100), counts.get(1).copied().unwrap_or(50));
    let settings = Settings::default();
    let (mut alarmed, mut alerts, mut searched) = (0, 0, 0);
    for seed in 0..fleets {
        let answer = evaluate(&fleet(seed as u64, recordings), &settings);
        let reported = answer.alerts.len() + answer.decreases.len();
        alarmed += usize::from(reported > 0);
        alerts += reported;
        searched += answer.series;
    }
    let out = format!(
        "{fleets} fleets of {ROBOTS} robots, {recordings} recordings each, {} series a fleet: {alarmed} fleets with a reported change ({:.1} %), {alerts} changes\n",
        searched / fleets.max(1),
        100.0 * alarmed as f64 / fleets.max(1) as f64
    );
    let _ = std::io::Write::write_all(&mut std::io::stdout(), out.as_bytes());
}
