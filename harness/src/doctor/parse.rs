//! Parsers of the kernel's texts. Pure; invalid text gives `None`.

/// Cores of a list like `0-3,8`; empty text is an empty list.
pub(crate) fn list(text: &str) -> Option<Vec<usize>> {
    /// Larger than the number of cores of any machine: a larger range is invalid.
    const MOST: usize = 8192;
    let text = text.trim();
    if text.is_empty() || text == "(null)" {
        return Some(Vec::new());
    }
    let mut cores = Vec::new();
    for part in text.split(',') {
        let (from, to) = part.split_once('-').unwrap_or((part, part));
        let (from, to): (usize, usize) = (from.trim().parse().ok()?, to.trim().parse().ok()?);
        if from > to || to >= MOST {
            return None;
        }
        cores.extend(from..=to);
    }
    cores.sort_unstable();
    cores.dedup();
    Some(cores)
}

/// A limit as the kernel lists it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ResourceLimit {
    At(u64),
    Unlimited,
}

impl ResourceLimit {
    pub(crate) fn is_at_least(self, wanted: u64) -> bool {
        match self {
            Self::Unlimited => true,
            Self::At(limit) => limit >= wanted,
        }
    }
}

/// The soft limit of that name in `/proc/self/limits`.
pub(crate) fn limit(limits: &str, name: &str) -> Option<ResourceLimit> {
    let rest = limits.lines().find_map(|line| line.strip_prefix(name))?;
    match rest.split_whitespace().next()? {
        "unlimited" => Some(ResourceLimit::Unlimited),
        number => number.parse().ok().map(ResourceLimit::At),
    }
}

/// Whether `/proc/self/status` lists this capability as effective.
pub(crate) fn has_capability(status: &str, bit: u32) -> Option<bool> {
    let set = status.lines().find_map(|line| line.strip_prefix("CapEff:"))?;
    u64::from_str_radix(set.trim(), 16).ok().map(|set| set >> bit & 1 == 1)
}

/// Whether this kernel is `PREEMPT_RT`.
pub(crate) fn is_preempt_rt(realtime: Option<&str>, version: Option<&str>) -> Option<bool> {
    let has_preempt_rt = |text: &str| text.split_whitespace().any(|token| token == "PREEMPT_RT");
    match (realtime.map(str::trim), version) {
        (Some("1"), _) => Some(true),
        (_, Some(version)) if version.starts_with("Linux version ") => {
            Some(has_preempt_rt(version))
        }
        _ => None,
    }
}

/// The release in `/proc/version`.
pub(crate) fn release(version: &str) -> Option<&str> {
    version.strip_prefix("Linux version ")?.split_whitespace().next()
}

/// Major and minor number of a kernel's release.
pub(crate) fn version_numbers(release: &str) -> Option<(u32, u32)> {
    let mut numbers = release.split(['.', '-']).map(|number| number.parse().ok());
    Some((numbers.next()??, numbers.next()??))
}

/// Whether `/proc/cpuinfo` shows a hypervisor.
pub(crate) fn is_virtual(cpuinfo: &str) -> Option<bool> {
    let flags = cpuinfo.lines().find(|line| line.starts_with("flags"))?;
    Some(flags.split_whitespace().any(|flag| flag == "hypervisor"))
}

/// Name of the processor.
pub(crate) fn processor(cpuinfo: &str) -> Option<&str> {
    let line = cpuinfo.lines().find(|line| line.starts_with("model name"))?;
    line.split_once(':').map(|(_, name)| name.trim())
}

/// Number of swap files or partitions.
pub(crate) fn swaps(swaps: &str) -> Option<usize> {
    let mut lines = swaps.lines();
    lines.next().filter(|head| head.starts_with("Filename"))?;
    Some(lines.filter(|line| !line.trim().is_empty()).count())
}

/// The type of the file system mounted at this place.
pub(crate) fn mounted_as<'a>(mounts: &'a str, place: &str) -> Option<&'a str> {
    mounts.lines().rev().find_map(|line| {
        let mut fields = line.split_whitespace().skip(1);
        (fields.next() == Some(place)).then(|| fields.next()).flatten()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_cores_are_read() {
        assert_eq!(list("0-3,8"), Some(vec![0, 1, 2, 3, 8]));
        assert_eq!(list(" 2,1,2 \n"), Some(vec![1, 2]));
        assert_eq!(list(""), Some(vec![]));
        for nonsense in ["3-1", "a", "0-", "0-99999999999", "1,,2", "-"] {
            assert_eq!(list(nonsense), None, "{nonsense}");
        }
    }

    #[test]
    fn limits_are_read_by_name_and_nonsense_is_none() {
        let limits = "Limit                     Soft Limit           Hard Limit           Units     \n\
                      Max locked memory         8388608              8388608              bytes     \n\
                      Max realtime priority     0                    0                    \n\
                      Max realtime timeout      unlimited            unlimited            us        \n";
        assert_eq!(limit(limits, "Max locked memory"), Some(ResourceLimit::At(8_388_608)));
        assert_eq!(limit(limits, "Max realtime timeout"), Some(ResourceLimit::Unlimited));
        assert_eq!(limit(limits, "Max pending signals"), None);
        assert_eq!(limit("Max locked memory  plenty", "Max locked memory"), None);
        assert_eq!(limit("", "Max locked memory"), None);
    }

    #[test]
    fn capabilities_are_bits_of_a_hexadecimal_number() {
        let status = "Name:\ttrued\nCapEff:\t0000000000804000\n";
        assert_eq!(has_capability(status, 14), Some(true));
        assert_eq!(has_capability(status, 23), Some(true));
        assert_eq!(has_capability(status, 0), Some(false));
        assert_eq!(has_capability("CapEff:\tall\n", 14), None);
        assert_eq!(has_capability("", 14), None);
    }

    #[test]
    fn a_real_time_kernel_is_known_by_either_text() {
        let ordinary = Some("Linux version 6.18.44 (a@b) #1 SMP PREEMPT_DYNAMIC @0");
        let real_time = Some("Linux version 6.12.1-rt (a@b) #1 SMP PREEMPT_RT Debian");
        assert_eq!(is_preempt_rt(None, ordinary), Some(false));
        assert_eq!(is_preempt_rt(None, real_time), Some(true));
        assert_eq!(is_preempt_rt(Some("1\n"), ordinary), Some(true));
        assert_eq!(is_preempt_rt(Some("\u{fffd}"), None), None);
        assert_eq!(is_preempt_rt(None, Some("FreeBSD")), None);
    }

    #[test]
    fn swaps_mounts_and_processors_are_read_and_nonsense_is_none() {
        assert_eq!(swaps("Filename Type Size Used Priority\n"), Some(0));
        assert_eq!(swaps("Filename Type\n/dev/sda2 partition 1 0 -2\n"), Some(1));
        assert_eq!(swaps("\u{0}"), None);
        let mounts = "tmpfs /dev/shm tmpfs rw 0 0\n/dev/sda1 / ext4 rw 0 0\n";
        assert_eq!(mounted_as(mounts, "/dev/shm"), Some("tmpfs"));
        assert_eq!(mounted_as("garbage", "/dev/shm"), None);
        let cpuinfo = "model name\t: EPYC\nflags\t\t: fpu hypervisor avx\n";
        assert_eq!((is_virtual(cpuinfo), processor(cpuinfo)), (Some(true), Some("EPYC")));
        assert_eq!((is_virtual(""), processor("model name")), (None, None));
    }
}
