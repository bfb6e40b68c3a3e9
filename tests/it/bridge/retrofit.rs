//! The whole way: application → bridge → daemon → bridge → a virtual EGM robot that mills.

use super::count;
use crate::TRUED;
use tests::retrofit::run;

#[test]
fn a_retrofitted_cell_mills_nearer_to_its_path() {
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
    assert!(with.0 < 0.25 * without.0, "{with:?} after {without:?}: {:#?}", done.counted);
    assert!(with.1 < 0.6 * without.1, "{with:?} after {without:?}");
    assert!(count(&done.counted, "force samples") > 500, "{:#?}", done.counted);
}
