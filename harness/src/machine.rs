//! Description of the machine of a bench run, and its implications for the figures.
//!
//! Values that the machine does not provide are reported as unknown. Figures are not corrected for
//! the machine.

use serde::Serialize;

use crate::doctor::{KernelInfo, parse};
use crate::plan::Policy;

/// The machine.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Machine {
    /// Release of the kernel.
    pub kernel: String,
    /// Whether it is `PREEMPT_RT`.
    pub preempt_rt: bool,
    /// Whether there is a hypervisor.
    #[serde(rename = "virtual")]
    pub is_virtual: bool,
    /// Cores that are online.
    pub cpus: usize,
    /// The strictest policy measured.
    pub scheduling: Policy,
    /// Name of the processor.
    pub processor: String,
    /// The frequency governor of the daemon's core.
    pub governor: String,
    /// Isolated cores.
    pub isolated: Vec<usize>,
    /// The clock source.
    pub clock_source: String,
    /// The client's core and the daemon's.
    pub cores: [usize; 2],
    /// Processor time taken by the hypervisor while the bench ran, in hundredths of a second; all
    /// cores.
    pub stolen_ticks: u64,
    /// Implications for the figures.
    pub means: Vec<String>,
}

/// The isolated cores.
pub(crate) fn isolated(texts: &KernelInfo) -> Vec<usize> {
    texts.isolated.as_deref().and_then(parse::list).unwrap_or_default()
}

/// Hundredths of a second taken so far, from `/proc/stat`.
pub(crate) fn stolen_ticks() -> u64 {
    std::fs::read_to_string("/proc/stat").ok().and_then(|stat| steal(&stat)).unwrap_or(0)
}

fn steal(stat: &str) -> Option<u64> {
    let all = stat.lines().find_map(|line| line.strip_prefix("cpu "))?;
    all.split_whitespace().nth(7)?.parse().ok()
}

impl Machine {
    /// From the kernel's texts.
    pub(crate) fn of(texts: &KernelInfo, scheduling: Policy, cores: [usize; 2]) -> Self {
        let unknown = || "unknown".to_owned();
        let version = texts.version.as_deref();
        let cpuinfo = texts.cpuinfo.as_deref();
        let governor = texts.cores.iter().find(|core| core.number == cores[1]);
        let mut machine = Self {
            kernel: version.and_then(parse::release).map_or_else(unknown, str::to_owned),
            preempt_rt: parse::is_preempt_rt(texts.realtime.as_deref(), version) == Some(true),
            is_virtual: cpuinfo.and_then(parse::is_virtual) == Some(true),
            cpus: texts.cores.len(),
            scheduling,
            processor: cpuinfo.and_then(parse::processor).map_or_else(unknown, str::to_owned),
            governor: governor.and_then(|core| core.governor.clone()).unwrap_or_else(unknown),
            isolated: isolated(texts),
            clock_source: texts.clock_source.clone().unwrap_or_else(unknown),
            cores,
            stolen_ticks: 0,
            means: Vec::new(),
        };
        machine.means = machine.meaning();
        machine
    }

    fn meaning(&self) -> Vec<String> {
        let mut means = Vec::new();
        let mut say = |text: &str| means.push(text.to_owned());
        if self.is_virtual {
            say(
                "Virtual machine: the host preempts and moves its cores, so quantiles from 99.9 % and the maximum depend on the host. \
                 Ratios of medians within one run are valid; for everything else, measure on the robot's own computer.",
            );
        }
        if !self.preempt_rt {
            say(
                "No PREEMPT_RT kernel: the maximum latency is not bounded, however small the measured one is.",
            );
        }
        if self.scheduling == Policy::Other {
            say("Not measured under SCHED_FIFO: any other process may delay a cycle.");
        }
        if !self.cores.iter().all(|core| self.isolated.contains(core)) {
            say(
                "The cores are not isolated: other threads run on them, and the kernel stalls spinning threads in their favour.",
            );
        }
        if self.governor != "performance" {
            say(
                "The frequency governor is not known to be `performance`: the clock may slow down when idle.",
            );
        }
        if self.cpus <= 2 {
            say(
                "No other core is available: the benchmark's helper threads, the log and the load share the two measured cores.",
            );
        }
        means
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stolen_time_is_the_eighth_number() {
        assert_eq!(steal("cpu  1 2 3 4 5 6 7 88 9 10\ncpu0 1 2 3 4 5 6 7 8\n"), Some(88));
        assert_eq!(steal("cpu  1 2 3\n"), None);
        assert_eq!(steal(""), None);
    }

    #[test]
    fn a_machine_that_says_nothing_is_not_called_good() {
        let machine = Machine::of(&KernelInfo::default(), Policy::Other, [0, 1]);
        assert!(!machine.preempt_rt && machine.governor == "unknown");
        assert!(machine.means.len() >= 4, "{:?}", machine.means);
    }
}
