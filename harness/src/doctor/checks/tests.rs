//! The checks on texts of suitable and unsuitable machines, empty texts and nonsense.

use super::*;
use crate::doctor::{IdleState, State};

fn text(text: &str) -> Option<String> {
    Some(text.to_owned())
}

fn good() -> KernelInfo {
    let core = |number| Core {
        number,
        governor: text("performance"),
        siblings: text(&number.to_string()),
        idle: vec![
            IdleState { name: "POLL".into(), latency_us: "0".into(), disable: "0".into() },
            IdleState { name: "C6".into(), latency_us: "133".into(), disable: "1".into() },
        ],
        fair_runtime_ns: text(if number < 2 { "50000000" } else { "0" }),
    };
    KernelInfo {
        version: text("Linux version 6.12.1-rt1 (a@b) #1 SMP PREEMPT_RT"),
        realtime: text("1"),
        cores: (0..4).map(core).collect(),
        isolated: text("2-3"),
        nohz_full: text("2-3"),
        rt_runtime_us: text("-1"),
        limits: text("Max locked memory  unlimited unlimited bytes\nMax realtime priority  99 99"),
        status: text("CapEff:\t0000000000000000"),
        mounts: text("tmpfs /dev/shm tmpfs rw 0 0"),
        shm_free_bytes: Some(1 << 30),
        clock_source: text("tsc"),
        clock_sources: text("tsc hpet"),
        swaps: text("Filename Type Size Used Priority"),
        cpuinfo: text("model name : x\nflags : fpu"),
        product: None,
    }
}

fn state_of(texts: &KernelInfo, name: &str) -> (State, String) {
    let check =
        run_checks(texts).into_iter().find(|check| check.name == name).expect("such a check");
    assert_eq!(check.fix.is_empty(), check.state == State::Pass, "{check:?}");
    (check.state, check.found + ": " + &check.fix)
}

#[test]
fn a_machine_made_for_it_passes_every_check() {
    let checks = run_checks(&good());
    assert_eq!(checks.len(), 11);
    assert!(checks.iter().all(|check| check.state == State::Pass), "{checks:#?}");
}

#[test]
fn each_fault_is_found_by_its_own_check_alone_and_has_a_fix() {
    type Spoil = fn(&mut KernelInfo);
    let faults: [(&str, Spoil); 12] = [
        ("real-time kernel", |t| {
            t.realtime = None;
            t.version = text("Linux version 6.18.44 (a@b) #1 SMP PREEMPT_DYNAMIC");
        }),
        ("frequency governor", |t| t.cores[3].governor = text("powersave")),
        ("idle states", |t| t.cores[2].idle[1].disable = "0".into()),
        ("isolated cores", |t| t.isolated = text("")),
        ("real-time throttling", |t| {
            t.version = text("Linux version 6.1.0-18-rt (a@b) #1 SMP PREEMPT_RT");
            t.rt_runtime_us = text("950000");
        }),
        ("real-time priority", |t| {
            t.limits = text("Max locked memory unlimited\nMax realtime priority 0 0");
        }),
        ("locked memory", |t| {
            t.limits = text("Max locked memory 8388608\nMax realtime priority 99 99");
        }),
        ("shared memory", |t| t.shm_free_bytes = Some(1 << 20)),
        ("shared memory", |t| t.mounts = text("/dev/sda1 /dev/shm ext4 rw 0 0")),
        ("clock source", |t| t.clock_source = text("hpet")),
        ("hyperthreads", |t| t.cores[1].siblings = text("1,3")),
        ("swap", |t| t.swaps = text("Filename Type\n/swapfile file 1 0 -2")),
    ];
    for (name, spoil) in faults {
        let mut texts = good();
        spoil(&mut texts);
        assert_eq!(state_of(&texts, name).0, State::Fix, "{name}");
        let others = run_checks(&texts).into_iter().filter(|check| check.name != name);
        assert!(others.into_iter().all(|check| check.state == State::Pass), "{name}");
    }
}

#[test]
fn since_the_fair_server_the_old_bound_tells_nothing() {
    let mut texts = good();
    texts.rt_runtime_us = text("950000");
    assert_eq!(state_of(&texts, "real-time throttling").0, State::Pass, "off on cores 2 and 3");
    texts.cores.iter_mut().for_each(|core| core.fair_runtime_ns = None);
    assert_eq!(state_of(&texts, "real-time throttling").0, State::Pass, "isolated cores");
    (texts.isolated, texts.rt_runtime_us) = (text(""), text("-1"));
    assert_eq!(state_of(&texts, "real-time throttling").0, State::Fix);
}

#[test]
fn missing_information_is_unknown_and_never_passes() {
    let checks = run_checks(&KernelInfo::default());
    assert!(checks.iter().all(|check| check.state != State::Pass), "{checks:#?}");
}

#[test]
fn nonsense_is_never_good_and_never_a_panic() {
    for nonsense in ["", "\u{fffd}\u{0}", "-", "99999999999999999999999", "1-", "\n\n:\n"] {
        let contents = || text(nonsense);
        let idle = IdleState {
            name: nonsense.into(),
            latency_us: nonsense.into(),
            disable: nonsense.into(),
        };
        let (governor, siblings, fair_runtime_ns) = (contents(), contents(), contents());
        let core = Core { number: 0, governor, siblings, idle: vec![idle], fair_runtime_ns };
        let texts = KernelInfo {
            version: contents(),
            realtime: contents(),
            cores: vec![core],
            isolated: contents(),
            nohz_full: contents(),
            rt_runtime_us: contents(),
            limits: contents(),
            status: contents(),
            mounts: contents(),
            shm_free_bytes: None,
            clock_source: contents(),
            clock_sources: contents(),
            swaps: contents(),
            cpuinfo: contents(),
            product: contents(),
        };
        let good = run_checks(&texts).into_iter().find(|check| check.state == State::Pass);
        assert_eq!(good, None, "{nonsense:?}");
    }
}

#[test]
fn capabilities_stand_for_limits() {
    let mut texts = good();
    texts.limits = text("Max locked memory 8388608\nMax realtime priority 0 0");
    texts.status = text("CapEff:\t000001ffffffffff");
    assert_eq!(state_of(&texts, "real-time priority").0, State::Pass);
    assert_eq!(state_of(&texts, "locked memory").0, State::Pass);
}
