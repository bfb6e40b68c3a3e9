//! Feed adapted to force: effect of the override on a cut, in virtual time with the daemon's own
//! cycle and with real processes.
//!
//! `cargo test -p tests --test it feed:: -- --nocapture` prints the figures.

use crate::TRUED;
use corrector::Mode;
use shm_schema::{FeedReason, FeedState};
use std::time::{Duration, Instant};
use tests::cell_loop::path;
use tests::place::TestDirectory;
use tests::process::Process;
use tests::simulation::feed::{Event, FeedScenario, STIFFNESS_N_M, Sensor, Tick, run};
use tests::simulation::run::Run;
use trued_client::{Client, Health, Setpoint, WrenchFrame, monotonic_ns};

const LIMIT: Duration = Duration::from_secs(20);

/// A cell with a limit of 40 N: 0.08 mm of deflection of its robot.
const TABLES: &str = "[cycle]\nperiod_ms = 4\nstale_ms = 20\n[wrench]\nsource = \"force\"\n\
                      [force]\nrate_Hz = 1000\n";

fn feed(mode: &str, keys: &str) -> String {
    format!("{TABLES}[feed]\nmode = \"{mode}\"\nlatency_ms = 60\nair_percent = 30\n{keys}\n")
}

fn plan() -> FeedScenario {
    FeedScenario {
        tables: feed("adapt", "force_limit_N = 40"),
        mode: "full",
        constant: 1.0,
        ticks: 60_000,
        events: Vec::new(),
        seed: 1,
        bounds: [0.1, 2.0, 0.2],
        is_full_model: false,
    }
}

fn state_at(run: &Run<Tick>, tick: usize) -> (FeedState, FeedReason) {
    (run.ticks[tick].state, run.ticks[tick].reason)
}

/// The time of a constant slow feed with this largest deviation, s.
fn constant(worst_m: f64, uncontrolled_m: f64) -> Run<Tick> {
    run(FeedScenario {
        tables: TABLES.to_owned(),
        constant: worst_m / uncontrolled_m,
        bounds: [1.0, 2.0, 0.2],
        ..plan()
    })
}

#[test]
fn a_depth_that_varies_two_to_one_bends_the_robot_by_a_tenth_of_a_millimetre_at_most() {
    let programmed =
        run(FeedScenario { tables: TABLES.to_owned(), bounds: [1.0, 2.0, 0.2], ..plan() });
    let uncontrolled_m = programmed.worst_m();
    println!("programmed feed: {:.3} mm, {:.1} s", 1e3 * uncontrolled_m, programmed.time_s());
    assert!(programmed.is_through() && (uncontrolled_m - 5e-4).abs() < 1e-5, "{uncontrolled_m}");
    for seed in 1..=3 {
        let adapted = run(FeedScenario { seed, ..plan() });
        assert_eq!(adapted.broken, None, "seed {seed}");
        assert!(adapted.is_through());
        let worst_m = adapted.worst_m();
        let slow = constant(worst_m, uncontrolled_m);
        assert!(slow.is_through() && (slow.worst_m() - worst_m).abs() < 1e-6);
        println!(
            "seed {seed}: adapted {:.3} mm, {:.1} s; a constant feed of that deviation {:.1} s",
            1e3 * worst_m,
            adapted.time_s(),
            slow.time_s()
        );
        assert!(worst_m < 1e-4, "seed {seed}: {worst_m:e}");
        assert!(adapted.time_s() < 0.9 * slow.time_s(), "faster than a constant feed");
    }
}

#[test]
fn in_shadow_mode_and_where_it_only_observes_the_programmed_feed_goes_out() {
    for (tables, mode) in [
        (feed("observe", "force_limit_N = 40"), "full"),
        (feed("adapt", "force_limit_N = 40"), "shadow"),
    ] {
        let run = run(FeedScenario { tables, mode, ..plan() });
        assert_eq!(run.broken, None);
        assert!(run.ticks.iter().all(|tick| tick.feed_override == 1.0), "{mode}");
        assert_eq!(state_at(&run, 2000), (FeedState::Observing, FeedReason::None));
    }
}

#[test]
fn a_deflection_limit_is_kept_by_the_compliance_of_the_model() {
    let tables = feed("adapt", "deflection_limit_mm = 0.08");
    let run = run(FeedScenario { tables, is_full_model: true, ticks: 8000, ..plan() });
    assert_eq!(run.broken, None);
    let tick = run.ticks[7999];
    assert_eq!(state_at(&run, 7999), (FeedState::Adapting, FeedReason::None));
    assert!(tick.limit_n > 10.0 && tick.limit_n < 500.0, "{tick:?}");
    assert!((tick.force_n - tick.limit_n).abs() < 0.05 * tick.limit_n, "{tick:?}");
}

#[test]
fn whatever_befalls_the_sensor_the_override_holds_then_goes_to_the_one_for_a_lost_force() {
    for (sensor, reason) in [
        (Sensor::Silent, FeedReason::Stale),
        (Sensor::Stale, FeedReason::Stale),
        (Sensor::Faulty, FeedReason::SensorFault),
        (Sensor::Nan, FeedReason::NotFinite),
        (Sensor::Absurd, FeedReason::NotFinite),
    ] {
        let events = vec![(4000, Event::Sensor(sensor)), (5000, Event::Sensor(Sensor::Good))];
        let run = run(FeedScenario { events, ticks: 8000, ..plan() });
        assert_eq!(run.broken, None, "{sensor:?}");
        let before = run.ticks[3999].feed_override;
        assert!(before > 0.2, "{before}");
        // A wrench is stale after 100 ms, and the override is held for 200 ms.
        assert_eq!(state_at(&run, 4030), (FeedState::Holding, reason), "{sensor:?}");
        assert!((run.ticks[4030].feed_override - before).abs() < 0.05, "{sensor:?}");
        assert_eq!(state_at(&run, 4999), (FeedState::Lost, reason), "{sensor:?}");
        assert_eq!(run.ticks[4999].feed_override, 0.1, "{sensor:?}");
        assert_eq!(state_at(&run, 7999), (FeedState::Adapting, FeedReason::None), "{sensor:?}");
        assert!(run.ticks[7999].feed_override > 0.12, "it comes back");
    }
}

#[test]
fn single_blocks_that_are_ten_times_as_large_make_it_slower_and_never_faster() {
    let events = vec![(4000, Event::Sensor(Sensor::Spiky))];
    let spiky = run(FeedScenario { events, ticks: 6000, ..plan() });
    assert_eq!(spiky.broken, None);
    let plain = run(FeedScenario { ticks: 6000, ..plan() });
    assert!(spiky.ticks[5999].at_m <= plain.ticks[5999].at_m);
    assert!(spiky.worst_m() <= 1e-4);
}

#[test]
fn restart_mode_bypass_reload_and_a_stop_make_no_step() {
    let events = vec![
        (3000, Event::Restart(25)),
        (4000, Event::Restart(500)),
        (6000, Event::Reload),
        (6500, Event::Mode(Mode::Shadow)),
        (6700, Event::Mode(Mode::Full)),
        (7500, Event::Bypass(true)),
        (7700, Event::Bypass(false)),
        (9000, Event::Stop(true)),
        (10_000, Event::Stop(false)),
        (11_000, Event::Mode(Mode::Limited)),
    ];
    let run = run(FeedScenario { events, ticks: 13_000, ..plan() });
    assert_eq!(run.broken, None);
    let adapting = (FeedState::Adapting, FeedReason::None);
    assert_eq!(state_at(&run, 2999), adapting);
    assert_eq!(run.ticks[4400].feed_override, 0.1, "without a daemon it goes where it is safe");
    assert_eq!(state_at(&run, 5999), adapting);
    assert_eq!(state_at(&run, 6690).0, FeedState::Observing);
    assert!(run.ticks[6690].feed_override > run.ticks[6500].feed_override, "on its way to 1");
    assert_eq!(state_at(&run, 7690).0, FeedState::Observing);
    assert_eq!(state_at(&run, 9900).1, FeedReason::AtRest);
    let around = [run.ticks[9050].feed_override, run.ticks[9990].feed_override];
    assert!((around[0] - around[1]).abs() < 1e-3, "it stands with the robot: {around:?}");
    assert_eq!(state_at(&run, 12_999), adapting);
    let force_n = run.ticks[12_999].force_n;
    assert!((force_n - 40.0).abs() < 6.0 && force_n / STIFFNESS_N_M < 1e-4, "{force_n}");
}

/// Commands with that force at 1 kHz until the override is as wanted; the last one.
fn go_on(client: &mut Client, force_n: Option<f64>, is_so: impl Fn(f64) -> bool) -> Option<f64> {
    let start = Instant::now();
    while start.elapsed() < LIMIT {
        let q = path(monotonic_ns());
        let mut setpoint = Setpoint::new(&q);
        if let Some(n) = force_n {
            setpoint = setpoint.wrench([n, 0.0, 0.0, 0.0, 0.0, 0.0], WrenchFrame::Tool);
        }
        let _ = client.send(&setpoint);
        let target = client.target_for(&q, monotonic_ns()).expect("a command of numbers");
        assert_eq!(target.feed_override(), client.last_feed_override());
        if is_so(target.feed_override()) {
            return Some(target.feed_override());
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    None
}

#[test]
fn a_client_of_a_real_daemon_slows_with_the_force_and_continues_alone_when_the_daemon_is_killed() {
    let tables = "[wrench]\nsource = \"command\"\n[feed]\nmode = \"adapt\"\nforce_limit_N = 100\n\
                  lost_percent = 40\nup_percent_s = 100\nlatency_ms = 20\n";
    let place = TestDirectory::new("full", tables);
    let mut daemon = Process::daemon(TRUED, &place);
    assert!(daemon.wait_for_output("ready", LIMIT), "{:?}", daemon.lines());
    let mut client = Client::connect_to(&place.cell(), LIMIT).unwrap();
    assert_eq!(go_on(&mut client, None, |_| true), Some(0.4), "no force is known");
    assert!(go_on(&mut client, Some(1.0), |o| o == 1.0).is_some(), "in the air");
    // A force that does not follow the feed lowers the override to the floor.
    assert!(go_on(&mut client, Some(300.0), |o| o == 0.1).is_some(), "in the cut");
    let floor = |client: &mut Client| client.status().map(|s| (s.feed_reason(), s.health()));
    let until = Instant::now() + Duration::from_secs(1);
    assert!(go_on(&mut client, Some(300.0), |_| Instant::now() > until).is_some());
    let expected = Some((Ok(FeedReason::AtFloor), Ok(Health::Degraded)));
    assert_eq!(floor(&mut client), expected, "{:?}", client.status().map(|status| status.message));
    daemon.kill();
    assert!(go_on(&mut client, Some(300.0), |o| o == 0.4).is_some(), "without a daemon");
}
