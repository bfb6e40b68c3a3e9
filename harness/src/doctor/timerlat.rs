//! How late the kernel wakes a thread, and what the worst delay was made of: by `rtla timerlat`, the kernel's own tool.
//!
//! The kernel's timerlat tracer wakes a thread of priority FIFO 95 on each core every millisecond and measures its delay; beyond a limit it stops and attributes the delay to
//! interrupts that were masked, interrupts, soft interrupts, and other threads (`rtla-timerlat-top(1)`). The output of the tool is parsed; if it is missing or refused,
//! the check is unknown. Needs root.

use std::process::Command;

use super::Check;

const NAME: &str = "wake-up latency";

/// Settings of the measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TimerlatSettings {
    /// Duration, s: 1 to 86 400. Rarer delays are not detected.
    pub duration_s: u32,
    /// The delay at which the tracer stops and analyses, µs: 5 to 1000. Default 100: a tenth of a
    /// cycle of 1 ms.
    pub limit_us: u32,
}

impl TimerlatSettings {
    /// Default of [`Self::limit_us`].
    pub const LIMIT_US: u32 = 100;
}

/// Output of the tool.
#[derive(Debug, Clone, PartialEq)]
struct TimerlatResult {
    /// The largest delay of a thread on any core, µs, and that core.
    worst_us: f64,
    core: u32,
    /// Parts of the delay beyond the limit, the largest first; empty if the limit was kept.
    parts: Vec<DelayPart>,
}

/// One part of a delay.
#[derive(Debug, Clone, PartialEq)]
struct DelayPart {
    /// The tool's name for it, for example `IRQ handler delay`.
    what: String,
    percent: f64,
    /// Name and number of the thread or interrupt, for example `kworker/3:1:2711`; the first of several.
    who: Option<String>,
}

/// Measures on all cores.
#[must_use]
pub(super) fn measure(settings: TimerlatSettings) -> Check {
    let mut command = Command::new("rtla");
    command.args(["timerlat", "top", "-q"]);
    command.arg("-d").arg(format!("{}s", settings.duration_s));
    command.arg("-T").arg(settings.limit_us.to_string());
    match command.output() {
        Err(why) if why.kind() == std::io::ErrorKind::NotFound => {
            Check::unknown(NAME, "rtla is not installed", "Debian: apt install rtla")
        }
        Err(why) => Check::unknown(NAME, format!("rtla: {why}"), "run it manually"),
        Ok(done) => {
            let output = String::from_utf8_lossy(&done.stdout);
            let why = String::from_utf8_lossy(&done.stderr);
            judge(&output, &why, settings)
        }
    }
}

fn judge(output: &str, why: &str, settings: TimerlatSettings) -> Check {
    let Some(found) = parse(output) else {
        let why = [why, output].concat();
        let why = why.trim().lines().next().unwrap_or("rtla printed no output").to_owned();
        let fix = "rtla needs root, a kernel with CONFIG_TIMERLAT_TRACER and tracefs mounted";
        return Check::unknown(NAME, why, fix);
    };
    let TimerlatResult { worst_us, core, parts } = found;
    let limit = settings.limit_us;
    let Some(largest) = parts.first() else {
        let found =
            format!("at most {worst_us:.0} µs in {} s, on core {core}", settings.duration_s);
        return if worst_us <= f64::from(limit) {
            Check::pass(NAME, found)
        } else {
            Check::fix(NAME, format!("{found}; limit {limit} µs"), "see `rtla timerlat top`")
        };
    };
    let shares: Vec<String> = parts.iter().map(DelayPart::text).collect();
    let found = format!("{worst_us:.0} µs on core {core}, limit {limit} µs: {}", shares.join(", "));
    Check::fix(NAME, found, remedy(&largest.what))
}

impl DelayPart {
    fn text(&self) -> String {
        let who = self.who.as_ref().map(|who| format!(" ({who})")).unwrap_or_default();
        format!("{:.0} % {}{who}", self.percent, self.what)
    }
}

/// A remedy for a part, by its name in the tool.
fn remedy(what: &str) -> &'static str {
    if what.starts_with("IRQ handler") {
        "a thread masks interrupts or the core left a deep idle state: isolate the core, disable idle states with long exit latency"
    } else if what.starts_with("NMI") {
        "switch the NMI watchdog off: sysctl kernel.nmi_watchdog=0"
    } else if what.starts_with("Softirq") {
        "isolate the core (isolcpus, rcu_nocbs) and move its interrupts to others"
    } else if what.starts_with("IRQ interference") {
        "move the interrupts to other cores (/proc/irq/*/smp_affinity, stop irqbalance)"
    } else if what.starts_with("Blocking") || what.starts_with("Thread") {
        "isolate the core (isolcpus), so that this thread runs elsewhere"
    } else {
        "see `rtla timerlat top` and the kernel's documentation of timerlat"
    }
}

/// Parses the table of cores and the analysis after it.
fn parse(output: &str) -> Option<TimerlatResult> {
    let mut worst: Option<(f64, u32)> = None;
    for (core, largest_us) in output.lines().filter_map(row) {
        if worst.is_none_or(|(us, _)| largest_us > us) {
            worst = Some((largest_us, core));
        }
    }
    let mut parts: Vec<DelayPart> = Vec::new();
    let analysis =
        output.lines().skip_while(|line| !line.contains("hit stop tracing, analyzing it"));
    for line in analysis {
        if let Some(total_us) = total(line) {
            // The sample that stopped the tracer may be missing in the table.
            worst = worst.map(|(us, core)| (f64::max(us, total_us), core));
            break;
        }
        if let Some(core) = stopped_core(line) {
            worst = Some((worst.map_or(0.0, |(us, _)| us), core));
        } else if let Some(part) = part(line) {
            parts.push(part);
        } else if let (Some(who), Some(last)) = (who(line), parts.last_mut()) {
            last.who.get_or_insert(who);
        }
    }
    parts.sort_by(|a, b| b.percent.total_cmp(&a.percent));
    worst.map(|(worst_us, core)| TimerlatResult { worst_us, core, parts })
}

/// A row of the table: a core and the largest delay of its thread, µs.
fn row(line: &str) -> Option<(u32, f64)> {
    let mut columns = line.split('|');
    let core = columns.next()?.split_whitespace().next()?.parse().ok()?;
    let largest = columns.nth(1)?.split_whitespace().nth(3)?;
    Some((core, largest.parse().ok()?))
}

/// The core of `## CPU 23 hit stop tracing, analyzing it ##`.
fn stopped_core(line: &str) -> Option<u32> {
    line.trim().strip_prefix("## CPU ")?.split_whitespace().next()?.parse().ok()
}

/// A line such as `IRQ handler delay:     27.49 us (65.52 %)`.
fn part(line: &str) -> Option<DelayPart> {
    let (what, value) = line.trim().rsplit_once(':')?;
    let percent = value.split_once('(')?.1.trim_end_matches([')', ' ', '%']).trim();
    let what = what.trim().to_owned();
    Some(DelayPart { what, percent: percent.parse().ok()?, who: None })
}

/// The sum of all parts, µs: `Thread latency:    41.96 us (100%)`.
fn total(line: &str) -> Option<f64> {
    line.trim().strip_prefix("Thread latency:")?.split_whitespace().next()?.parse().ok()
}

/// Thread or interrupt of a part: a line with a name and a time without a share, such as `objtool:49256       3.79 us`.
fn who(line: &str) -> Option<String> {
    let mut fields = line.split_whitespace();
    let (name, us, unit) = (fields.next()?, fields.next()?, fields.next()?);
    let is_one = unit == "us" && us.parse::<f64>().is_ok() && !name.ends_with(':');
    (is_one && fields.next().is_none()).then(|| name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::State;

    /// The example of `rtla-timerlat-top(1)` in the kernel's documentation, four cores of it.
    const STOPPED: &str = "                                   Timer Latency
  0 00:00:12   |          IRQ Timer Latency (us)        |         Thread Timer Latency (us)
CPU COUNT      |      cur       min       avg       max |      cur       min       avg       max
  1 #12322     |        0         0         1        15 |       10         3         9        31
  2 #12322     |        3         0         1        12 |       10         3         9        23
 12 #12321     |        1         0         0        13 |        5         3         8        23
 23 #12320     |       28         0         1        28 |       41         3        11        41
rtla timerlat hit stop tracing
## CPU 23 hit stop tracing, analyzing it ##
IRQ handler delay:                                        27.49 us (65.52 %)
IRQ latency:                                              28.13 us
Timerlat IRQ duration:                                     9.59 us (22.85 %)
Blocking thread:                                           3.79 us (9.03 %)
                       objtool:49256                       3.79 us
  Blocking thread stacktrace
              -> timerlat_irq
              -> vfs_write
------------------------------------------------------------------------
  Thread latency:                                          41.96 us (100%)

The system has exit from idle latency!
  Max timerlat IRQ latency from idle: 17.48 us in cpu 4
";

    fn settings(limit_us: u32) -> TimerlatSettings {
        TimerlatSettings { duration_s: 12, limit_us }
    }

    #[test]
    fn the_worst_delay_is_reported_with_its_core_its_parts_and_who_took_them() {
        let found = parse(STOPPED).expect("a table");
        assert_eq!((found.worst_us, found.core), (41.96, 23));
        let parts: Vec<(&str, f64)> =
            found.parts.iter().map(|part| (part.what.as_str(), part.percent)).collect();
        let expected = [
            ("IRQ handler delay", 65.52),
            ("Timerlat IRQ duration", 22.85),
            ("Blocking thread", 9.03),
        ];
        assert_eq!(parts, expected);
        assert_eq!(found.parts[2].who.as_deref(), Some("objtool:49256"));
        let check = judge(STOPPED, "", settings(40));
        assert_eq!(check.state, State::Fix);
        assert!(check.found.starts_with("42 µs on core 23, limit 40 µs: 66 % IRQ handler delay"));
        assert!(check.fix.contains("masks interrupts"), "{}", check.fix);
    }

    #[test]
    fn the_remedy_is_for_the_largest_part_wherever_it_stands() {
        let less = STOPPED.replace("(65.52 %)", "(1.52 %)").replace("(9.03 %)", "(70.03 %)");
        let check = judge(&less, "", settings(40));
        assert!(check.found.contains("70 % Blocking thread (objtool:49256), 23 %"), "{check:?}");
        assert!(check.fix.contains("isolate the core"), "{check:?}");
    }

    #[test]
    fn a_limit_that_was_kept_passes_with_the_largest_delay_of_all_cores() {
        let table = STOPPED.split("rtla timerlat").next().expect("the table");
        let check = judge(table, "", settings(100));
        assert_eq!((check.state, check.fix.as_str()), (State::Pass, ""));
        assert_eq!(check.found, "at most 41 µs in 12 s, on core 23");
    }

    #[test]
    fn a_tool_that_may_not_measure_is_reported_as_unknown_with_its_own_words() {
        for (output, why) in [("", "Sorry, you need to be root to use rtla timerlat"), ("", "")] {
            let check = judge(output, why, settings(100));
            assert_eq!(check.state, State::Unknown);
            assert!(check.found.contains(why) && !check.fix.is_empty(), "{check:?}");
        }
    }
}
