//! Simulated milling cuts, analysed by the vibration monitor: `cargo run --release -p world
//! --example cuts -- [COUNT] [SEED] [each]`.
//!
//! Each cut begins with a second of air; every second one is drawn below the limit of stability at
//! its speed, the others above. Results: alarms in stable cuts, the delay from onset to alarm of a
//! chatter, and how often the strongest line with an alarm has the frequency of the chatter. The
//! monitor was tuned on seeds 1 to 24, 1000 to 1026 and 3000 to 3199; published figures use other
//! seeds. `each` prints a line for every cut.

mod alarms;
mod process;
mod record;

use alarms::CutAlarms;
use record::{Record, Truth};
use std::error::Error;
use std::io::Write;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let mut numbers = arguments.iter().filter_map(|argument| argument.parse::<u64>().ok());
    let (count, seed) = (numbers.next().unwrap_or(40), numbers.next().unwrap_or(2000));
    let each = arguments.iter().any(|argument| argument == "each");
    let mut account = Results::default();
    let mut out = std::io::stdout().lock();
    for k in 0..count {
        let record = Record::of(seed + k, k % 2 == 1);
        let cut_alarms = CutAlarms::of(&record)?;
        account.add(&record, &cut_alarms);
        if each {
            writeln!(
                out,
                "{} {}: {record}; {cut_alarms}",
                seed + k,
                if k % 2 == 1 { "above" } else { "below" }
            )?;
        }
    }
    writeln!(out, "{}", account.sorted_json())?;
    Ok(())
}

/// Results over all cuts.
#[derive(Default)]
struct Results {
    stable: usize,
    stable_alarmed: usize,
    stable_forced: usize,
    chatters: usize,
    delays_s: Vec<f64>,
    own_frequency: usize,
    one_event: usize,
    marginal: usize,
}

impl Results {
    fn add(&mut self, record: &Record, cut_alarms: &CutAlarms) {
        match record.truth {
            Truth::Stable => {
                self.stable += 1;
                self.stable_alarmed += usize::from(!cut_alarms.alarms.is_empty());
                self.stable_forced += usize::from(cut_alarms.forced);
            }
            Truth::Chatter { onset_s, frequency_hz } => {
                self.chatters += 1;
                let first_s = cut_alarms.alarms.iter().map(|line| line.alarm_s).reduce(f64::min);
                self.delays_s.push(first_s.map_or(f64::INFINITY, |s| s - onset_s));
                let is_own_frequency =
                    |hz: f64| (hz - frequency_hz).abs() < (0.01 * frequency_hz).max(2.0);
                self.own_frequency +=
                    usize::from(cut_alarms.strongest_hz().is_some_and(is_own_frequency));
                self.one_event += usize::from(cut_alarms.alarms.len() == 1);
            }
            Truth::Marginal => self.marginal += 1,
        }
    }

    fn sorted_json(&mut self) -> String {
        self.delays_s.sort_by(f64::total_cmp);
        let quantile = |part: f64| {
            let last = self.delays_s.len().saturating_sub(1) as f64;
            self.delays_s.get((part * last).round() as usize).copied().unwrap_or(f64::NAN)
        };
        let found = self.delays_s.iter().filter(|s| s.is_finite()).count();
        format!(
            "{{\"stable\": {}, \"stable_alarmed\": {}, \"stable_forced_on_a_mode\": {}, \"chatters\": {}, \"found\": {found}, \
             \"delay_s\": {{\"p50\": {:.3}, \"p90\": {:.3}}}, \"own_frequency\": {}, \"one_event\": {}, \"neither\": {}}}",
            self.stable,
            self.stable_alarmed,
            self.stable_forced,
            self.chatters,
            quantile(0.5),
            quantile(0.9),
            self.own_frequency,
            self.one_event,
            self.marginal
        )
    }
}
