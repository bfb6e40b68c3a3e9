//! Requirements of a robot's cycle on the machine, check by check. Pure.

use super::parse::{self, ResourceLimit};
use super::{Check, Core, KernelInfo};

/// Longest exit latency of an idle state that is negligible for a cycle of 1 ms, µs.
const IDLE_LATENCY_US_MAX: u64 = 10;
/// Default priority of the daemon.
const PRIORITY: u64 = 80;
/// Memory that the daemon locks, with margin, bytes.
const LOCKED_BYTES: u64 = 256 << 20;
/// Free space that a cell needs in `/dev/shm`, with margin, bytes.
const SHM_BYTES: u64 = 64 << 20;
/// Capabilities by their number.
const CAP_IPC_LOCK: u32 = 14;
const CAP_SYS_NICE: u32 = 23;

/// All checks, in a fixed order.
#[must_use]
pub fn run_checks(texts: &KernelInfo) -> Vec<Check> {
    vec![
        kernel(texts),
        governor(&texts.cores),
        idle(&texts.cores),
        isolated(texts),
        throttling(texts),
        priority(texts),
        locked(texts),
        shared_memory(texts),
        clock(texts),
        siblings(&texts.cores),
        swap(texts),
    ]
}

/// The kernel version that introduced the fair server.
const FAIR_SERVER_SINCE: (u32, u32) = (6, 12);

fn kernel(texts: &KernelInfo) -> Check {
    let name = "real-time kernel";
    let version = texts.version.as_deref();
    let release = version.and_then(parse::release).unwrap_or("unknown kernel");
    match parse::is_preempt_rt(texts.realtime.as_deref(), version) {
        Some(true) => Check::pass(name, format!("{release}, PREEMPT_RT")),
        Some(false) => Check::fix(
            name,
            format!("{release}, not PREEMPT_RT"),
            "boot a PREEMPT_RT kernel (Debian: apt install linux-image-rt-amd64)",
        ),
        None => Check::unknown(name, release, "check `uname -v` for PREEMPT_RT"),
    }
}

fn governor(cores: &[Core]) -> Check {
    let name = "frequency governor";
    let governed: Vec<_> =
        cores.iter().filter_map(|c| Some((c.number, c.governor.as_deref()?))).collect();
    let slow: Vec<_> = governed.iter().filter(|(_, governor)| *governor != "performance").collect();
    match (governed.as_slice(), slow.as_slice()) {
        ([], _) => Check::unknown(
            name,
            "the kernel does not control the frequency (virtual machine, or controlled by the firmware)",
            "set the host or the firmware to its performance mode",
        ),
        (_, []) => Check::pass(name, "performance on all cores"),
        (_, [(core, governor), ..]) => Check::fix(
            name,
            format!("{governor} on core {core} and {} others", slow.len() - 1),
            "cpupower frequency-set --governor performance",
        ),
    }
}

fn idle(cores: &[Core]) -> Check {
    let name = "idle states";
    let states: Vec<_> =
        cores.iter().flat_map(|core| core.idle.iter().map(|s| (core.number, s))).collect();
    let mut deep = Vec::new();
    for (core, state) in &states {
        let Ok(latency_us) = state.latency_us.parse::<u64>() else {
            let found = format!("unknown exit latency of `{}` on core {core}", state.name);
            return Check::unknown(name, found, "check `cpupower idle-info`");
        };
        if state.disable != "1" && latency_us > IDLE_LATENCY_US_MAX {
            deep.push((core, state, latency_us));
        }
    }
    match (states.as_slice(), deep.first()) {
        ([], _) => Check::unknown(
            name,
            "the kernel manages no idle states; a hypervisor may still halt the core",
            "keep the cycle's core busy: cycle.wait = \"spin\" on an isolated core",
        ),
        (_, None) => Check::pass(name, "none with a long exit latency"),
        (_, Some((core, state, latency_us))) => Check::fix(
            name,
            format!("`{}` on core {core} has an exit latency of {latency_us} µs", state.name),
            format!("cpupower idle-set --disable-by-latency {}", IDLE_LATENCY_US_MAX + 1),
        ),
    }
}

fn isolated(texts: &KernelInfo) -> Check {
    let name = "isolated cores";
    let fix = "boot with isolcpus=N nohz_full=N rcu_nocbs=N for the cycle's core N, and set realtime.core = N";
    match texts.isolated.as_deref().map(parse::list) {
        Some(Some(cores)) if cores.is_empty() => Check::fix(name, "none", fix),
        Some(Some(cores)) => {
            let ticking = texts.nohz_full.as_deref().and_then(parse::list).unwrap_or_default();
            let quiet = cores.iter().all(|core| ticking.contains(core));
            let tick = if quiet { "without tick" } else { "with the kernel's tick" };
            Check::pass(name, format!("{cores:?}, {tick}"))
        }
        Some(None) | None => Check::unknown(name, "not reported by the kernel", fix),
    }
}

/// Since Linux 6.12 the fair server stalls spinning threads; before, throttling did, which
/// `sched_rt_runtime_us` configures.
fn throttling(texts: &KernelInfo) -> Check {
    let name = "real-time throttling";
    let release =
        texts.version.as_deref().and_then(parse::release).and_then(parse::version_numbers);
    if release.is_some_and(|release| release >= FAIR_SERVER_SINCE) {
        return fair_server(texts, name);
    }
    match texts.rt_runtime_us.as_deref().map(str::parse::<i64>) {
        Some(Ok(-1)) if release.is_some() => Check::pass(name, "off"),
        Some(Ok(runtime_us)) if release.is_some() => Check::fix(
            name,
            format!(
                "real-time threads are limited to {runtime_us} µs per period; spinning threads are stalled"
            ),
            "use cycle.wait = \"sleep\", or isolate the core and run: sysctl kernel.sched_rt_runtime_us=-1",
        ),
        _ => {
            Check::unknown(name, "not reported by the kernel", "sysctl kernel.sched_rt_runtime_us")
        }
    }
}

fn fair_server(texts: &KernelInfo, name: &'static str) -> Check {
    let isolated = texts.isolated.as_deref().and_then(parse::list).unwrap_or_default();
    let is_off = |core: &Core| core.fair_runtime_ns.as_deref() == Some("0");
    let disabled: Vec<_> =
        texts.cores.iter().filter(|core| is_off(core)).map(|c| c.number).collect();
    if !disabled.is_empty() {
        Check::pass(name, format!("the kernel's fair server is off on {disabled:?}"))
    } else if !isolated.is_empty() {
        let found = format!(
            "no other thread runs on {isolated:?}, so the kernel's fair server stalls nothing there"
        );
        Check::pass(name, found)
    } else {
        Check::fix(
            name,
            "spinning threads are stalled for 50 ms per second if other threads need the core (the kernel's fair server, independent of sched_rt_runtime_us since 6.12)",
            "use cycle.wait = \"sleep\", or isolate its core N, or run: echo 0 > /sys/kernel/debug/sched/fair_server/cpuN/runtime",
        )
    }
}

fn priority(texts: &KernelInfo) -> Check {
    let name = "real-time priority";
    let may = texts.status.as_deref().and_then(|s| parse::has_capability(s, CAP_SYS_NICE));
    let limit = texts.limits.as_deref().and_then(|l| parse::limit(l, "Max realtime priority"));
    match (may, limit) {
        (Some(true), _) => Check::pass(name, "any (CAP_SYS_NICE)"),
        (_, Some(limit)) if limit.is_at_least(PRIORITY) => {
            Check::pass(name, format!("up to {}", limit_text(limit, "")))
        }
        (_, Some(limit)) => Check::fix(
            name,
            format!("up to {}, the daemon needs {PRIORITY}", limit_text(limit, "")),
            format!(
                "LimitRTPRIO={PRIORITY} in the unit, or rtprio {PRIORITY} in /etc/security/limits.d"
            ),
        ),
        (_, None) => Check::unknown(name, "not reported by the kernel", "ulimit -r"),
    }
}

fn locked(texts: &KernelInfo) -> Check {
    let name = "locked memory";
    let may = texts.status.as_deref().and_then(|s| parse::has_capability(s, CAP_IPC_LOCK));
    let limit = texts.limits.as_deref().and_then(|l| parse::limit(l, "Max locked memory"));
    match (may, limit) {
        (Some(true), _) => Check::pass(name, "unlimited (CAP_IPC_LOCK)"),
        (_, Some(limit)) if limit.is_at_least(LOCKED_BYTES) => {
            Check::pass(name, limit_text(limit, " bytes"))
        }
        (_, Some(limit)) => Check::fix(
            name,
            format!("{}, the daemon locks all its memory", limit_text(limit, " bytes")),
            "LimitMEMLOCK=infinity in the unit, or memlock unlimited in /etc/security/limits.d",
        ),
        (_, None) => Check::unknown(name, "not reported by the kernel", "ulimit -l"),
    }
}

fn limit_text(limit: ResourceLimit, unit: &str) -> String {
    match limit {
        ResourceLimit::Unlimited => "unlimited".to_owned(),
        ResourceLimit::At(number) => format!("{number}{unit}"),
    }
}

fn shared_memory(texts: &KernelInfo) -> Check {
    let name = "shared memory";
    let fix = "mount a tmpfs at /dev/shm with 64 MB or more free";
    let kind = texts.mounts.as_deref().and_then(|mounts| parse::mounted_as(mounts, "/dev/shm"));
    match (kind, texts.shm_free_bytes) {
        (Some("tmpfs"), Some(free)) if free >= SHM_BYTES => {
            Check::pass(name, format!("/dev/shm, tmpfs, {} MB free", free >> 20))
        }
        (Some("tmpfs"), Some(free)) => {
            Check::fix(name, format!("/dev/shm, {} MB free", free >> 20), fix)
        }
        (Some(kind), _) => Check::fix(name, format!("/dev/shm is {kind}, not tmpfs"), fix),
        (None, _) => Check::fix(name, "nothing is mounted at /dev/shm", fix),
    }
}

fn clock(texts: &KernelInfo) -> Check {
    let name = "clock source";
    let others = texts.clock_sources.as_deref().unwrap_or_default();
    match texts.clock_source.as_deref() {
        Some(source @ ("tsc" | "arch_sys_counter")) => Check::pass(name, source),
        Some(source) if others.split_whitespace().any(|other| other == "tsc") => Check::fix(
            name,
            format!("{source}: reading the time is slow"),
            "boot with clocksource=tsc tsc=reliable, if the hardware supports it",
        ),
        Some(source) if !source.is_empty() => Check::fix(
            name,
            format!("{source}: reading the time is slow, and there is no tsc"),
            "check `dmesg` for why the tsc was rejected; on a virtual machine, configure an invariant tsc",
        ),
        _ => Check::unknown(name, "not reported by the kernel", "`dmesg | grep clocksource`"),
    }
}

fn siblings(cores: &[Core]) -> Check {
    let name = "hyperthreads";
    let mut shared = Vec::new();
    for core in cores {
        match core.siblings.as_deref().map(parse::list) {
            Some(Some(threads)) if threads.len() > 1 => shared.push(threads),
            Some(Some(threads)) if threads.len() == 1 => {}
            _ => {
                let found = format!("unknown siblings of core {}", core.number);
                return Check::unknown(name, found, "lscpu --extended");
            }
        }
    }
    match shared.first() {
        None if cores.is_empty() => Check::unknown(name, "no core is listed", "lscpu --extended"),
        None => Check::pass(name, "none reported"),
        Some(threads) => Check::fix(
            name,
            format!("{threads:?} share one physical core and slow each other down"),
            "keep the sibling of the cycle's core idle (isolate both), or disable SMT: echo off > /sys/devices/system/cpu/smt/control",
        ),
    }
}

fn swap(texts: &KernelInfo) -> Check {
    let name = "swap";
    match texts.swaps.as_deref().map(parse::swaps) {
        Some(Some(0)) => Check::pass(name, "none"),
        Some(Some(n)) => Check::fix(
            name,
            format!("{n} in use: memory that is not locked may be swapped out"),
            "swapoff -a, and remove it from /etc/fstab; or lock memory: realtime.lock_memory = true",
        ),
        _ => Check::unknown(name, "not reported by the kernel", "swapon --show"),
    }
}

#[cfg(test)]
mod tests;
