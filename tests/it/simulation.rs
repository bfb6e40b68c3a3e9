//! The daemon's logic under random faults in virtual time. `TRUED_SIM_CYCLES` sets the length (1e7
//! in CI), `TRUED_SEED` repeats a run; otherwise the seed is random.

use tests::simulation::{bridges, run};
use trued_client::monotonic_ns;

const CYCLES: u64 = 200_000;

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().and_then(|n| n.parse().ok())
}

#[test]
fn random_faults_in_virtual_time_break_no_invariant() {
    let seed = number("TRUED_SEED").unwrap_or_else(monotonic_ns);
    let cycles = number("TRUED_SIM_CYCLES").unwrap_or(CYCLES);
    let again = format!("TRUED_SIM_CYCLES={cycles} TRUED_SEED={seed}");
    println!("{again}");
    let summary = run(seed, cycles);
    println!(
        "{} cycles, {} ticks, {} storms: {:#?}",
        summary.cycles, summary.ticks, summary.storms, summary.counts
    );
    assert_eq!(summary.broken, None, "{again}");
    for kind in [
        "corrected/none",
        "rejected/stale",
        "ramping/time_jump",
        "rejected/out_of_limits",
        "rejected/out_of_order",
        "rejected/duplicate",
        "rejected/not_finite",
        "bypassed/bypass",
        "client: Corrected",
        "client: Ramping",
        "client: LastCorrection",
        "client: Plain",
    ] {
        assert!(summary.counts.contains_key(kind), "{kind} was never seen: {:?}", summary.counts);
    }
}

#[test]
fn the_same_seed_is_the_same_run_to_the_bit() {
    let [one, two, other] = [7, 7, 8].map(|seed| run(seed, 10_000));
    assert_eq!(one, two);
    assert_ne!(one.hash, other.hash);
}

/// Both bridges, with the same oracle.
fn bridge_faults(run: impl Fn(u64, u64) -> bridges::Summary) {
    let seed = number("TRUED_SEED").unwrap_or_else(monotonic_ns);
    let targets = number("TRUED_SIM_CYCLES").unwrap_or(CYCLES);
    let again = format!("TRUED_SIM_CYCLES={targets} TRUED_SEED={seed}");
    println!("{again}");
    let summary = run(seed, targets);
    println!("{summary:?}");
    assert_eq!(summary.broken, None, "{again}");
    assert!(summary.runs > 10 && summary.storms > 10 && summary.largest > 1e-3, "{summary:?}");
}

#[test]
fn egm_in_virtual_time_sends_no_step_whatever_becomes_of_its_datagrams() {
    bridge_faults(bridges::egm);
}

#[test]
fn rsi_in_virtual_time_sends_no_step_whatever_becomes_of_its_telegrams() {
    bridge_faults(|seed, targets| bridges::rsi(seed, targets, false));
}

#[test]
fn relative_rsi_in_virtual_time_sends_no_step_whatever_becomes_of_its_telegrams() {
    bridge_faults(|seed, targets| bridges::rsi(seed, targets, true));
}
