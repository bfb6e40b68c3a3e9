//! Measurement in the loop: effect of the trim on the tool, in virtual time with the daemon's own
//! cycle and with real processes.
//!
//! `cargo test -p tests --test it trim:: -- --nocapture` prints the figures.

use crate::TRUED;
use corrector::Mode;
use glam::DVec3;
use physics::{Inputs, JOINTS_MAX, Memories, Model};
use recording::model::RobotModel;
use std::time::Duration;
use tests::cell_loop::{CellLoop, JOINTS};
use tests::place::TestDirectory;
use tests::process::Process;
use tests::simulation::instrument::{Event, SimulatedErrors, Tick, run};
use tests::simulation::run::Run;
use trued_client::{Answer, Health, Instrument, Status, TrimReason, TrimState, monotonic_ns};

const LIMIT: Duration = Duration::from_secs(20);

/// What the cell states of the instrument.
fn measured(mode: &str) -> String {
    format!(
        "[measured]\nmode = \"{mode}\"\nrate_Hz = 100\nlatency_ms = 20\nreaction_ms = 10\n\
         noise_mm = 0.02\nlimit_mm = 3\n"
    )
}

fn state_at(run: &Run<Tick>, tick: usize) -> (TrimState, TrimReason) {
    (run.ticks[tick].state, run.ticks[tick].reason)
}

#[test]
fn an_instrument_as_it_is_takes_the_static_error_below_30_um_within_two_seconds() {
    for seed in 1..=5 {
        // The correction of the model alone has ramped in by then; the trim begins with it.
        let run = run(&measured("trim"), SimulatedErrors::stated(), 12_000, Vec::new(), seed);
        assert_eq!(run.broken, None, "seed {seed}");
        let (first, after) = (run.ticks[0].off_m.length(), run.worst_m(2000..12_000));
        println!(
            "seed {seed}: {:.3} mm at first, {:.4} mm at most from 2 s to 12 s",
            1e3 * first,
            1e3 * after
        );
        assert!(after < 3e-5, "seed {seed}: {after:e}");
        assert_eq!(state_at(&run, 11_999).0, TrimState::Trimming);
        let [came, refused] = run.ticks[11_999].counts;
        assert!(came > 1000 && refused > 5, "{came} came, {refused} were refused");
    }
}

#[test]
fn the_error_along_a_path_is_halved_at_least_beyond_the_model() {
    for period_s in [16.0, 8.0, 6.0] {
        let truth = SimulatedErrors { swing_rad: 0.3, period_s, ..SimulatedErrors::stated() };
        let of = |mode| {
            let run = run(&measured(mode), truth, 30_000, Vec::new(), 7);
            assert_eq!(run.broken, None, "{mode}");
            run.rms_m(4000..30_000)
        };
        let (model, trimmed) = (of("observe"), of("trim"));
        println!(
            "swing of 0.6 rad in {period_s} s: {:.4} mm RMS by the model, {:.4} mm with the trim",
            1e3 * model,
            1e3 * trimmed
        );
        assert!(trimmed < 0.5 * model, "{period_s} s: {trimmed:e} {model:e}");
    }
}

#[test]
fn delays_up_to_twice_the_stated_ones_do_not_oscillate() {
    // An instrument without its own stamps: the daemon uses the values stated by the cell.
    for (latency_ms, reaction_ms) in [(0, 0), (10, 5), (20, 10), (40, 20), (50, 20)] {
        let truth = SimulatedErrors {
            latency_ms,
            reaction_ms,
            stamps: false,
            noise_m: 0.0,
            jumps: 0.0,
            ..SimulatedErrors::stated()
        };
        // The beam is interrupted until the model's own correction has ramped in: with a wrong
        // delay its motion would cause an error.
        let events = vec![(0, Event::Blind(true)), (1500, Event::Blind(false))];
        let run = run(&measured("trim"), truth, 8000, events, 3);
        assert_eq!(run.broken, None);
        let z: Vec<f64> = run.ticks[1500..].iter().map(|tick| tick.off_m.z).collect();
        let overshoot = z.iter().fold(0.0_f64, |most, z| most.max(-z));
        let lowest = z.iter().position(|z| -z >= overshoot).unwrap_or(0);
        let back = z[lowest..].iter().fold(0.0_f64, |most, z| most.max(*z));
        println!(
            "{latency_ms} + {reaction_ms} ms: overshoot {:.4} mm, back {:.4} mm",
            1e3 * overshoot,
            1e3 * back
        );
        assert!(overshoot < 6e-5 && (overshoot < 1e-6 || back < 1e-5), "{overshoot:e} {back:e}");
        assert!(run.worst_m(6000..8000) < 1e-5);
    }
}

#[test]
fn loss_return_jump_mode_bypass_and_reload_make_no_step() {
    let events = vec![
        (4000, Event::Blind(true)),
        (7000, Event::Blind(false)),
        (10_000, Event::Mode(Mode::Shadow)),
        (12_000, Event::Mode(Mode::Full)),
        (15_000, Event::Bypass(true)),
        (17_000, Event::Bypass(false)),
        (20_000, Event::Shift(1e-3)),
        (24_000, Event::Arm),
        (27_000, Event::Reload),
        (30_000, Event::Mode(Mode::Limited)),
        (33_000, Event::Mode(Mode::Full)),
    ];
    let truth =
        SimulatedErrors { swing_rad: 0.1, period_s: 16.0, jumps: 0.0, ..SimulatedErrors::stated() };
    let run = run(&measured("trim"), truth, 36_000, events, 11);
    assert_eq!(run.broken, None);
    let trimming = (TrimState::Trimming, TrimReason::None);
    for (tick, wanted) in [
        (3999, trimming),
        (4300, (TrimState::Holding, TrimReason::NoMeasurement)),
        (6999, (TrimState::Waiting, TrimReason::NoMeasurement)),
        (9999, trimming),
        (11_999, (TrimState::Observing, TrimReason::None)),
        (14_999, trimming),
        (16_999, (TrimState::Observing, TrimReason::None)),
        (19_999, trimming),
        (20_400, (TrimState::Holding, TrimReason::Jumped)),
        (23_999, (TrimState::Waiting, TrimReason::Jumped)),
        (26_999, trimming),
        (29_999, trimming),
        (35_999, trimming),
    ] {
        assert_eq!(state_at(&run, tick), wanted, "tick {tick}");
    }
    let without = run.ticks[6999].off_m.length();
    assert!(run.ticks[9999].off_m.length() < 0.2 * without, "it comes back");
    let trim_m = run.ticks[11_999].trim_m;
    assert_eq!(trim_m, DVec3::ZERO, "nothing is trimmed in shadow mode");
}

#[test]
fn observing_finds_the_error_and_sends_what_the_model_alone_would() {
    let truth = SimulatedErrors::stated();
    let observed = run(&measured("observe"), truth, 4000, Vec::new(), 5);
    let plain = run("", truth, 4000, Vec::new(), 5);
    assert_eq!((observed.broken.as_ref(), plain.broken.as_ref()), (None, None));
    for (observed, plain) in observed.ticks.iter().zip(&plain.ticks) {
        assert_eq!(observed.off_m, plain.off_m, "bit for bit");
    }
    assert_eq!(state_at(&plain, 3999), (TrimState::Off, TrimReason::None));
    assert_eq!(state_at(&observed, 3999), (TrimState::Observing, TrimReason::None));
    let Tick { found_m, off_m, .. } = observed.ticks[3999];
    assert!((found_m - off_m).length() < 3e-5, "{found_m} {off_m}");
}

/// Where the model puts the tool, base frame, m.
fn tool(model: &Model, target: &[f64; JOINTS]) -> DVec3 {
    let mut q = [0.0; JOINTS_MAX];
    q[..JOINTS].copy_from_slice(target);
    let (inputs, mut memories) = (Inputs::at_rest(q), Memories::default());
    model.settle(&inputs, &mut memories);
    model.evaluate(&inputs, &memories).real.base_from_tool.origin
}

/// The instrument moves: the daemon accepts it only after `arm`, not after some time or a change of
/// mode.
fn a_jump_is_followed_once_it_is_armed(
    cell: &mut CellLoop,
    instrument: &mut Instrument,
    model: &Model,
    error_m: DVec3,
) {
    let moved_m = error_m + DVec3::X * 3e-3;
    let mut measures_until = |cell: &mut CellLoop, limit, is_so: &dyn Fn(&Status) -> bool| {
        cell.tick_until(limit, |cell, tick| {
            if cell.ticks.is_multiple_of(10) {
                let point_m = tool(model, &tick.target) + moved_m;
                let sent = instrument.send(point_m.to_array(), Some(monotonic_ns()));
                sent.expect("a daemon that takes it");
            }
            cell.client.status().is_some_and(|status| is_so(&status))
        })
    };
    let has_jumped = |status: &Status| status.trim_reason() == Ok(TrimReason::Jumped);
    assert!(measures_until(cell, LIMIT, &has_jumped));
    for mode in [trued_client::Mode::Limited, trued_client::Mode::Full] {
        let answer = cell.client.mode(mode, LIMIT).expect("an answer");
        assert_eq!(answer.answer(), Ok(Answer::Done));
        let half_a_second = Duration::from_millis(500);
        let believes = |status: &Status| !has_jumped(status);
        assert!(!measures_until(cell, half_a_second, &believes), "mode {mode}");
    }
    let answer = cell.client.arm(true, LIMIT).expect("an answer");
    assert_eq!(answer.answer(), Ok(Answer::Done));
    let trims = |status: &Status| status.trim_state() == Ok(TrimState::Trimming);
    assert!(measures_until(cell, LIMIT, &trims));
}

#[test]
fn a_running_daemon_trims_by_the_points_that_a_client_publishes_and_lets_go_without_them() {
    let tables = "[measured]\nmode = \"trim\"\nrate_Hz = 100\nlatency_ms = 30\nreaction_ms = 0\n\
                  noise_mm = 0.1\njump_mm = 1\n[recorder]\ndir = \"box\"\n";
    let place = TestDirectory::new("full", tables);
    let daemon = Process::daemon(TRUED, &place);
    assert!(daemon.wait_for_output("ready", LIMIT), "{:?}", daemon.lines());
    let mut cell = CellLoop::join(&place.cell(), Duration::from_millis(5)).unwrap();
    let mut instrument = Instrument::connect_to(&place.cell(), LIMIT).unwrap();
    let second = Instrument::connect_to(&place.cell(), Duration::from_millis(100));
    assert!(second.is_err(), "one instrument per cell");
    let model = RobotModel::read(&place.file("model.toml")).unwrap().physics;
    let error_m = DVec3::Z * 5e-4;
    let trims = |cell: &mut CellLoop| {
        let status = cell.client.status().expect("a status");
        let is_near = (DVec3::from_array(status.trim_m) + error_m).length() < 2e-4;
        is_near && status.trim_state() == Ok(TrimState::Trimming)
    };
    let trimmed = cell.tick_until(LIMIT, |cell, tick| {
        if cell.ticks.is_multiple_of(10) {
            let point_m = tool(&model, &tick.target) + error_m;
            instrument
                .send(point_m.to_array(), Some(monotonic_ns()))
                .expect("a daemon that takes it");
        }
        trims(cell)
    });
    assert!(
        trimmed,
        "{:?}",
        cell.client.status().map(|s| (s.trim_m, s.trim_found_m, s.trim_reason))
    );
    a_jump_is_followed_once_it_is_armed(&mut cell, &mut instrument, &model, error_m);
    let is_lost = cell.tick_until(LIMIT, |cell, _| {
        let status = cell.client.status().expect("a status");
        status.trim_state() == Ok(TrimState::Waiting) && status.trim_m == [0.0; 3]
    });
    assert!(is_lost, "the beam is broken");
    let status = cell.client.status().expect("a status");
    assert_eq!(status.trim_reason(), Ok(TrimReason::NoMeasurement));
    assert_eq!(status.health(), Ok(Health::Degraded), "{}", status.message);
    assert!(
        status.message.as_str().contains("no tool measurements received"),
        "{}",
        status.message
    );
    assert_eq!(cell.broken, Vec::<String>::new());
}
