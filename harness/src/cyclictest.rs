//! `cyclictest` beside the bench, where it is installed: how late the kernel wakes a thread, by the tool that everybody knows.
//!
//! Promises: where it is missing that is said, never passed over. Never: a figure of our own in its name.

use std::process::Command;

use serde::Serialize;

use crate::manners::Manners;
use crate::plan::Policy;

/// What it said, µs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Cyclictest {
    /// The least.
    pub min_us: u64,
    /// The mean.
    pub mean_us: u64,
    /// The worst.
    pub max_us: u64,
    /// Wake-ups.
    pub n: u64,
}

/// Runs it on the core of these manners; why not, where not.
pub(crate) fn run(manners: Manners, seconds: f64) -> Result<Cyclictest, String> {
    let loops = (seconds * 1000.0).max(100.0) as u64;
    let mut command = Command::new("cyclictest");
    command.args(["--quiet", "--interval=1000", "--threads=1"]);
    command.arg(format!("--loops={loops}")).arg(format!("--affinity={}", manners.core));
    if manners.policy == Policy::Fifo {
        command.arg("--mlockall").arg(format!("--priority={}", manners.priority));
    }
    let done = command.output().map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => "not installed; on Debian: apt install rt-tests".to_owned(),
        _ => e.to_string(),
    })?;
    let said = String::from_utf8_lossy(&done.stdout);
    parse(&said).ok_or_else(|| {
        let why = String::from_utf8_lossy(&done.stderr);
        format!("ended with {}, which said nothing that can be read: {}", done.status, why.trim())
    })
}

/// Reads a line like `T: 0 ( 123) P:80 I:1000 C:  1000 Min:  2 Act:  5 Avg:  4 Max:  19`.
fn parse(said: &str) -> Option<Cyclictest> {
    let line = said.lines().rev().find(|line| line.trim_start().starts_with("T:"))?;
    let after = |key: &str| {
        let rest = line.split(key).nth(1)?.trim_start();
        rest.split_whitespace().next()?.parse().ok()
    };
    Some(Cyclictest {
        min_us: after("Min:")?,
        mean_us: after("Avg:")?,
        max_us: after("Max:")?,
        n: after(" C:")?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_line_is_read() {
        let said = "# /dev/cpu_dma_latency set to 0us\n\
                    T: 0 ( 4711) P:80 I:1000 C:   5000 Min:      3 Act:    9 Avg:   12 Max:    1042\n";
        let found = Cyclictest { min_us: 3, mean_us: 12, max_us: 1042, n: 5000 };
        assert_eq!(parse(said), Some(found));
    }

    #[test]
    fn anything_else_is_no_figure() {
        for said in ["", "T: 0", "Min: 3", "T: 0 ( 1) P: 0 I:1000 C: x Min: 1 Act: 1 Avg: 1 Max: 1"]
        {
            assert_eq!(parse(said), None, "{said}");
        }
    }
}
