//! The kernel's information on the machine, as texts; interpreted in `checks`.

use std::fs;
use std::path::{Path, PathBuf};

/// An idle state of a core.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct IdleState {
    /// Its name.
    pub name: String,
    /// Exit latency, µs.
    pub latency_us: String,
    /// `1` if it is disabled.
    pub disable: String,
}

/// Information on one core.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Core {
    /// Its number.
    pub number: usize,
    /// Frequency governor; `None` without one.
    pub governor: Option<String>,
    /// Hyperthreads of the same core, itself included.
    pub siblings: Option<String>,
    /// Its idle states.
    pub idle: Vec<IdleState>,
    /// Share of each period that the kernel's fair server may take from real-time threads, ns: in
    /// debugfs, readable by root only.
    pub fair_runtime_ns: Option<String>,
}

/// All information; `None` if the machine has no such file.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct KernelInfo {
    /// `/proc/version`.
    pub version: Option<String>,
    /// `/sys/kernel/realtime`.
    pub realtime: Option<String>,
    /// Cores that are online.
    pub cores: Vec<Core>,
    /// `isolcpus`, as a list.
    pub isolated: Option<String>,
    /// `nohz_full`, as a list.
    pub nohz_full: Option<String>,
    /// `/proc/sys/kernel/sched_rt_runtime_us`.
    pub rt_runtime_us: Option<String>,
    /// `/proc/self/limits`.
    pub limits: Option<String>,
    /// `/proc/self/status`.
    pub status: Option<String>,
    /// `/proc/mounts`.
    pub mounts: Option<String>,
    /// Free bytes of `/dev/shm`.
    pub shm_free_bytes: Option<u64>,
    /// The clock source in use.
    pub clock_source: Option<String>,
    /// The available clock sources.
    pub clock_sources: Option<String>,
    /// `/proc/swaps`.
    pub swaps: Option<String>,
    /// `/proc/cpuinfo`.
    pub cpuinfo: Option<String>,
    /// Product name of the machine.
    pub product: Option<String>,
}

impl KernelInfo {
    /// Reads all of them below `root`, which is `/` except in tests.
    #[must_use]
    pub fn read(root: &Path) -> Self {
        let text = |path: &str| read(&root.join(path));
        let shm = root.join("dev/shm");
        let free = rustix::fs::statvfs(&shm).ok().map(|fs| fs.f_bavail.saturating_mul(fs.f_frsize));
        Self {
            version: text("proc/version"),
            realtime: text("sys/kernel/realtime"),
            cores: cores(root),
            isolated: text("sys/devices/system/cpu/isolated"),
            nohz_full: text("sys/devices/system/cpu/nohz_full"),
            rt_runtime_us: text("proc/sys/kernel/sched_rt_runtime_us"),
            limits: text("proc/self/limits"),
            status: text("proc/self/status"),
            mounts: text("proc/mounts"),
            shm_free_bytes: free,
            clock_source: text("sys/devices/system/clocksource/clocksource0/current_clocksource"),
            clock_sources: text(
                "sys/devices/system/clocksource/clocksource0/available_clocksource",
            ),
            swaps: text("proc/swaps"),
            cpuinfo: text("proc/cpuinfo"),
            product: text("sys/class/dmi/id/product_name"),
        }
    }
}

fn read(path: &Path) -> Option<String> {
    // The kernel's output is not always valid text.
    fs::read(path).ok().map(|bytes| String::from_utf8_lossy(&bytes).trim().to_owned())
}

fn cores(root: &Path) -> Vec<Core> {
    let dir = root.join("sys/devices/system/cpu");
    let fair = root.join("sys/kernel/debug/sched/fair_server");
    let core = |(number, path): (usize, PathBuf)| Core {
        fair_runtime_ns: read(&fair.join(format!("cpu{number}/runtime"))),
        ..core(number, &path)
    };
    let mut cores: Vec<Core> = numbered(&dir, "cpu").into_iter().map(core).collect();
    let online = read(&dir.join("online")).and_then(|text| super::parse::list(&text));
    if let Some(online) = online {
        cores.retain(|core| online.contains(&core.number));
    }
    cores
}

fn core(number: usize, path: &Path) -> Core {
    let idle = numbered(&path.join("cpuidle"), "state").into_iter().map(|(_, state)| IdleState {
        name: read(&state.join("name")).unwrap_or_default(),
        latency_us: read(&state.join("latency")).unwrap_or_default(),
        disable: read(&state.join("disable")).unwrap_or_default(),
    });
    Core {
        number,
        governor: read(&path.join("cpufreq/scaling_governor")),
        siblings: read(&path.join("topology/thread_siblings_list")),
        idle: idle.collect(),
        fair_runtime_ns: None,
    }
}

/// Entries like `cpu7`, by their number.
fn numbered(dir: &Path, head: &str) -> Vec<(usize, PathBuf)> {
    let entries = fs::read_dir(dir).into_iter().flatten().flatten();
    let mut found: Vec<_> = entries
        .filter_map(|entry| {
            let name = entry.file_name().into_string().ok()?;
            Some((name.strip_prefix(head)?.parse().ok()?, entry.path()))
        })
        .collect();
    found.sort();
    found
}
