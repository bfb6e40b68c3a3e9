//! The whole way: application → bridge → daemon → bridge → a virtual EGM robot that mills.

use super::count;
use crate::TRUED;
use tests::retrofit::run;

/// How often it is tried: where this machine stands still for longer than a correction is fresh, the correction ramps out, and the
/// robot errs as without it.
const ROUNDS: usize = 3;

#[test]
fn a_retrofitted_cell_mills_nearer_to_its_path() {
    for round in 1..=ROUNDS {
        let done = run(TRUED, &[], 7);
        let [without, with] = done.mean_and_largest_m();
        println!(
            "mean {:.3} to {:.3} mm, largest {:.3} to {:.3} mm, {} of {} answered late on this machine",
            1e3 * without.0,
            1e3 * with.0,
            1e3 * without.1,
            1e3 * with.1,
            done.late,
            done.errors_m.len()
        );
        assert_eq!(done.missed, 0, "{:#?}", done.counted);
        assert!(count(&done.counted, "force samples") > 500, "{:#?}", done.counted);
        if with.0 < 0.25 * without.0 && with.1 < 0.6 * without.1 {
            return;
        }
        assert!(round < ROUNDS, "{with:?} after {without:?}: {:#?}", done.counted);
    }
}
