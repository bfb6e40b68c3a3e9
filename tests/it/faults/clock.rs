//! Changes of the clock that stamps the commands. The daemon uses `CLOCK_MONOTONIC`, which cannot
//! be set; the wall clock is used for names of files and epochs only (tested in
//! `daemon/src/retention.rs`).

use super::{PROGRAMS, wait_for};
use std::time::{Duration, Instant};
use tests::cell_loop::CellLoop;
use tests::place::TestDirectory;
use tests::process::Process;
use tests::served_cell::AWAIT_LIMIT;
use trued_client::Source;

const HOUR_NS: i64 = 3_600_000_000_000;

#[test]
fn a_clock_that_is_set_costs_at_most_the_second_that_it_went_back_and_no_step() {
    let place = TestDirectory::new("full", "");
    let daemon = Process::daemon(PROGRAMS.trued, &place);
    assert!(daemon.wait_for_output("ready", AWAIT_LIMIT), "{:?}", daemon.lines());
    let mut cell = CellLoop::join(&place.cell(), Duration::from_millis(5)).unwrap();
    let corrects = |_: &mut CellLoop, tick: &tests::cell_loop::Tick| {
        tick.source == Source::Corrected && tick.largest() > 1e-4
    };
    assert!(cell.tick_until(AWAIT_LIMIT, corrects));
    for set_ns in [HOUR_NS, -HOUR_NS, -300_000_000, 300_000_000, -2 * HOUR_NS / 3600] {
        cell.clock_set_ns += set_ns;
        // The command in transit when the clock was set.
        cell.tick();
        let start = Instant::now();
        let taken =
            |_: &mut CellLoop, tick: &tests::cell_loop::Tick| tick.answered && !tick.refused;
        assert!(cell.tick_until(AWAIT_LIMIT, taken), "{set_ns}: {:?}", cell.client.newest());
        let time = start.elapsed();
        println!("set by {set_ns} ns: taken after {time:?}");
        assert!(cell.tick_until(AWAIT_LIMIT, corrects), "{set_ns}: {:?}", cell.client.newest());
    }
    assert_eq!(cell.broken, Vec::<String>::new());
    drop(cell);
    assert!(wait_for(AWAIT_LIMIT, || place
        .remaining_names()
        .iter()
        .all(|name| name != "cell.lock")));
}
