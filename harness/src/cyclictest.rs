//! `cyclictest` between the bench's own chunks, if installed: wake-up latency of the kernel, measured by the standard tool.
//!
//! If it is missing, this is reported.

use std::process::Command;

use crate::error::BenchError;
use crate::latencies::Latencies;
use crate::plan::Policy;
use crate::thread_settings::ThreadSettings;

/// Wake-ups per chunk, and the time between them, µs.
const LOOPS: u32 = 30;
const INTERVAL_US: u32 = 1000;
/// Later wake-ups count as this one, the latest of their chunk, µs.
const HISTOGRAM_US: u32 = 2000;

/// Checks whether it runs with these settings; the error says why not.
pub(crate) fn runs(thread_settings: ThreadSettings) -> Result<(), String> {
    run(thread_settings, 1).map(drop)
}

/// One chunk of wake-ups on the core of these settings.
pub(crate) fn chunk(thread_settings: ThreadSettings) -> Result<Latencies, BenchError> {
    run(thread_settings, LOOPS).map_err(|why| BenchError::part("cyclictest", why))
}

fn run(thread_settings: ThreadSettings, loops: u32) -> Result<Latencies, String> {
    let mut command = Command::new("cyclictest");
    command.args(["--quiet", "--threads=1"]);
    command.arg(format!("--interval={INTERVAL_US}")).arg(format!("--loops={loops}"));
    command.arg(format!("--histogram={HISTOGRAM_US}"));
    command.arg(format!("--affinity={}", thread_settings.core));
    if thread_settings.policy == Policy::Fifo {
        command.arg("--mlockall").arg(format!("--priority={}", thread_settings.priority));
    }
    let done = command.output().map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => "not installed; on Debian: apt install rt-tests".to_owned(),
        _ => e.to_string(),
    })?;
    parse(&String::from_utf8_lossy(&done.stdout)).ok_or_else(|| {
        let why = String::from_utf8_lossy(&done.stderr);
        format!("ended with {} and unreadable output: {}", done.status, why.trim())
    })
}

/// Parses its histogram: lines like `000017 000003` (µs, count), and its summary of later ones.
fn parse(output: &str) -> Option<Latencies> {
    let mut found = Latencies::default();
    let mut add = |us: u64, times: u64| (0..times).for_each(|_| found.record(1000 * us));
    for line in output.lines().filter(|line| !line.starts_with('#')) {
        let Some((us, times)) = line.split_once(char::is_whitespace) else { continue };
        add(us.trim().parse().ok()?, times.trim().parse().ok()?);
    }
    let after = |key: &str| -> Option<u64> {
        let line = output.lines().find_map(|line| line.strip_prefix(key))?;
        line.trim().parse().ok()
    };
    add(after("# Max Latencies:")?, after("# Histogram Overflows:")?);
    (found.count() > 0).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAID: &str = "# /dev/cpu_dma_latency set to 0us\n# Histogram\n000000 000000\n000016 000002\n\
        000017 000005\n\n# Total: 000000007\n# Min Latencies: 00016\n# Avg Latencies: 00017\n\
        # Max Latencies: 02345\n# Histogram Overflows: 00001\n# Histogram Overflow at cycle number:\n\
        # Thread 0: 00003\n";

    #[test]
    fn its_histogram_is_read_and_what_is_beyond_counts_as_its_latest() {
        let found = parse(SAID).expect("a histogram");
        assert_eq!(found.count(), 8);
        assert!((16_000..17_000).contains(&found.at(0.2)), "{}", found.at(0.2));
        assert!((17_000..18_000).contains(&found.at(0.5)), "{}", found.at(0.5));
        assert!(found.at(1.0) >= 2_340_000, "{}", found.at(1.0));
    }

    #[test]
    fn anything_else_is_no_figure() {
        for output in ["", "T: 0", "000001 x\n", "# Max Latencies: 1\n# Histogram Overflows: 0\n"] {
            assert!(parse(output).is_none(), "{output}");
        }
    }
}
