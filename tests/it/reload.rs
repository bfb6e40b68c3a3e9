//! Change of the model while the cycle runs: no missed answer, no step of the correction, no
//! invalid model.

use crate::TRUED;
use shm_schema::{Cell, Status};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};
use tests::cell_loop::{CellLoop, Tick};
use tests::place::{MODEL, TestDirectory};
use tests::process::Process;
use trued_client::{Answer, Monitor, Response, Source};

const LIMIT: Duration = Duration::from_secs(10);
const SWAPS: u64 = 40;

/// Result of a second of the loop.
pub(crate) struct ObservedTicks {
    pub(crate) ticks: u64,
    pub(crate) unanswered: u64,
    epochs: u64,
    pub(crate) broken: Vec<String>,
    last: Option<Tick>,
    /// The last tick with a full correction; the machine may delay others.
    corrected: Option<(u64, Tick)>,
}

/// Runs the loop in another thread while `meanwhile` sends requests to the daemon.
pub(crate) fn beside<R>(
    shared_cell: &Cell,
    meanwhile: impl FnOnce(&mut Monitor) -> R,
) -> (ObservedTicks, R) {
    let mut cell = CellLoop::join(shared_cell, LIMIT).unwrap();
    assert!(cell.tick_until(LIMIT, |_, tick| tick.largest() > 1e-3), "the correction comes in");
    let over = Arc::new(AtomicBool::new(false));
    let end = over.clone();
    let runner = std::thread::spawn(move || {
        let (ticks, unanswered, epochs, broken) = (0, 0, 0, Vec::new());
        let mut observed =
            ObservedTicks { ticks, unanswered, epochs, broken, last: None, corrected: None };
        let (mut epoch, since) = (0, Instant::now());
        // On a busy machine answers are late and blended in: it continues until one is in time.
        let is_over = |observed: &ObservedTicks| {
            let fresh = observed.last.as_ref().is_some_and(|tick| tick.source == Source::Corrected);
            end.load(Relaxed) && (fresh || since.elapsed() > 2 * LIMIT)
        };
        while !is_over(&observed) {
            let tick = cell.tick();
            observed.ticks += 1;
            observed.unanswered += u64::from(!tick.answered);
            let now = cell.client.newest().map_or(0, |answer| answer.model_epoch);
            assert!(now >= epoch, "models are counted upwards");
            observed.epochs += u64::from(now != epoch);
            if tick.source == Source::Corrected {
                observed.corrected = Some((observed.ticks, tick));
            }
            (epoch, observed.last) = (now, Some(tick));
        }
        observed.broken = cell.broken;
        observed
    });
    let mut monitor = Monitor::connect_to(shared_cell, LIMIT).unwrap();
    let result = meanwhile(&mut monitor);
    over.store(true, Relaxed);
    (runner.join().unwrap(), result)
}

fn reload_model(monitor: &mut Monitor, model: Option<&Path>) -> Response {
    monitor.reload(model, LIMIT).unwrap()
}

pub(crate) fn status(monitor: &mut Monitor) -> Status {
    // A status made after the request.
    std::thread::sleep(Duration::from_millis(150));
    monitor.status().unwrap()
}

fn running(mode: &str) -> (TestDirectory, Process) {
    // Late commands are not tested here.
    let place = TestDirectory::new(mode, "[cycle]\nstale_ms = 500.0\n");
    let daemon = Process::daemon(TRUED, &place);
    assert!(daemon.wait_for_output("ready", LIMIT), "{:?}", daemon.lines());
    (place, daemon)
}

#[test]
fn a_model_swapped_at_1_khz_costs_no_answer_and_no_step() {
    let (place, _daemon) = running("full");
    let plain = place.model("plain.toml", "irb1600-6-145");
    let known = place.model("known.toml", MODEL);
    let (observed, after) = beside(&place.cell(), |monitor| {
        for k in 0..SWAPS {
            let model = if k % 2 == 0 { &plain } else { &known };
            let answer = reload_model(monitor, Some(model));
            assert_eq!(answer.answer(), Ok(Answer::Done), "{}", answer.message);
            std::thread::sleep(Duration::from_millis(30 + 17 * (k % 5)));
        }
        std::thread::sleep(Duration::from_secs(1));
        status(monitor)
    });
    println!("{} ticks, {SWAPS} swaps, {} unanswered", observed.ticks, observed.unanswered);
    assert_eq!(observed.unanswered, 0, "of {}", observed.ticks);
    assert_eq!(observed.broken, Vec::<String>::new());
    assert_eq!(observed.epochs, SWAPS + 1, "each swap is seen in the answers");
    assert_eq!((after.model_epoch, after.rejected), (SWAPS + 1, 0));
    let (corrected_at, last) = observed.corrected.unwrap();
    assert!(
        observed.ticks - corrected_at < 800 && last.largest() > 1e-3,
        "{corrected_at} of {}: {last:?}",
        observed.ticks
    );
}

#[test]
fn a_broken_model_is_refused_with_its_first_fault_and_the_old_one_stays() {
    let (place, _daemon) = running("full");
    let good = std::fs::read_to_string(place.file("model.toml")).unwrap();
    place.write("typo.toml", &good.replacen("axis = [0.0, 1.0, 0.0]", "axis = [0.0, 0.0]", 1));
    place.write("half.toml", &good[..good.len() / 2]);
    let seven = place.model("seven.toml", "fr3");
    let cases = [
        (place.file("typo.toml"), vec!["typo.toml", "axis"]),
        (place.file("half.toml"), vec!["half.toml"]),
        (place.file("none.toml"), vec!["none.toml"]),
        (seven, vec!["7 joints instead of 6", "restart the daemon"]),
    ];
    let (observed, ()) = beside(&place.cell(), |monitor| {
        let before = status(monitor);
        for (model, parts) in &cases {
            let answer = reload_model(monitor, Some(model));
            let message = answer.message.as_str();
            assert_eq!(answer.answer(), Ok(Answer::Refused), "{message}");
            assert!(parts.iter().all(|part| message.contains(part)), "{parts:?} in: {message}");
        }
        let after = status(monitor);
        assert_eq!(after.model_epoch, before.model_epoch);
        assert_eq!(after.model_hash, before.model_hash);
        // The path of the old one is kept too.
        assert_eq!(reload_model(monitor, None).answer(), Ok(Answer::Done));
        assert_eq!(status(monitor).model_hash, before.model_hash);
    });
    assert_eq!(observed.unanswered, 0);
    assert_eq!(observed.broken, Vec::<String>::new());
    assert!(observed.last.unwrap().largest() > 1e-3, "it corrects as before");
}

#[test]
fn the_bounds_told_are_those_of_the_model_in_use() {
    let (place, _daemon) = running("full");
    let good = std::fs::read_to_string(place.file("model.toml")).unwrap();
    let narrow = good.replacen("limits_deg = [-180.0, 180.0]", "limits_deg = [-100.0, 100.0]", 1);
    assert_ne!(good, narrow);
    place.write("narrow.toml", &narrow);
    let mut monitor = Monitor::connect_to(&place.cell(), LIMIT).unwrap();
    assert!((status(&mut monitor).bounds.max[0] - 180_f64.to_radians()).abs() < 1e-12);
    assert_eq!(
        reload_model(&mut monitor, Some(&place.file("narrow.toml"))).answer(),
        Ok(Answer::Done)
    );
    assert!((status(&mut monitor).bounds.max[0] - 100_f64.to_radians()).abs() < 1e-12);
}

/// Words of a refusal.
fn refused(answer: &Response) -> &str {
    assert_eq!(answer.answer(), Ok(Answer::Refused), "{}", answer.message);
    answer.message.as_str()
}

#[test]
fn a_model_of_another_robot_is_refused_unless_the_cell_is_in_shadow_and_it_is_asked_for_by_name() {
    let (place, _daemon) = running("full");
    let kuka = place.model("kuka.toml", "kuka-kr240");
    let (observed, ()) = beside(&place.cell(), |monitor| {
        let before = status(monitor);
        assert_eq!(before.robot_maker.as_str(), "ABB");
        let answer = reload_model(monitor, Some(&kuka));
        for part in ["another robot", "KUKA", "KR 240 R2900", "--other-robot"] {
            assert!(refused(&answer).contains(part), "{part}: {}", answer.message);
        }
        let answer = monitor.reload_other_robot(Some(&kuka), LIMIT).unwrap();
        assert!(refused(&answer).contains("switch to shadow mode first"), "{}", answer.message);
        assert_eq!(status(monitor).model_hash, before.model_hash);
    });
    assert_eq!(observed.broken, Vec::<String>::new());
    let mut cell = CellLoop::join(&place.cell(), LIMIT).unwrap();
    cell.client.arm(false, LIMIT).unwrap();
    let mut monitor = Monitor::connect_to(&place.cell(), LIMIT).unwrap();
    let geometry = status(&mut monitor).geometry_hash;
    assert!(refused(&reload_model(&mut monitor, Some(&kuka))).contains("in shadow mode"));
    let answer = monitor.reload_other_robot(Some(&kuka), LIMIT).unwrap();
    assert_eq!(answer.answer(), Ok(Answer::Done), "{}", answer.message);
    let after = status(&mut monitor);
    assert_eq!((after.robot_maker.as_str(), after.robot_type.as_str()), ("KUKA", "KR 240 R2900"));
    assert_ne!(after.geometry_hash, geometry);
}

#[test]
fn limits_that_the_arm_is_outside_of_are_refused_while_it_moves() {
    let (place, _daemon) = running("full");
    let good = std::fs::read_to_string(place.file("model.toml")).unwrap();
    let limits = |limits: &str| {
        let changed = good.replacen("limits_deg = [-180.0, 180.0]", limits, 1);
        assert_ne!(good, changed);
        changed
    };
    // The path of joint 1 goes from 8.6 to 14.3 degrees.
    place.write("outside.toml", &limits("limits_deg = [-180.0, 5.0]"));
    place.write("inside.toml", &limits("limits_deg = [-180.0, 20.0]"));
    let (observed, ()) = beside(&place.cell(), |monitor| {
        let answer = reload_model(monitor, Some(&place.file("outside.toml")));
        for part in ["joint 1 commanded at ", "limits -180.000 to 5.000 deg", "move the arm inside"]
        {
            assert!(refused(&answer).contains(part), "{part}: {}", answer.message);
        }
        let answer = reload_model(monitor, Some(&place.file("inside.toml")));
        assert_eq!(answer.answer(), Ok(Answer::Done), "{}", answer.message);
    });
    assert_eq!((observed.unanswered, observed.broken), (0, Vec::new()));
}

#[test]
fn the_command_line_refuses_another_robot_and_loads_it_in_shadow_by_name() {
    let (place, _daemon) = running("shadow");
    let config = place.file("cell.toml");
    let reload = |more: &[&str]| {
        let done = std::process::Command::new(TRUED)
            .args(["reload", "--config"])
            .arg(&config)
            .args(more)
            .env(shm_schema::RUNTIME_DIR_ENV, place.root())
            .output()
            .unwrap();
        (done.status.code(), String::from_utf8_lossy(&done.stdout).into_owned())
    };
    let (code, output) = reload(&["kuka-kr240"]);
    assert_eq!(code, Some(1), "{output}");
    assert!(output.contains("another robot") && output.contains("--other-robot"), "{output}");
    let (code, output) = reload(&["kuka-kr240", "--other-robot"]);
    assert_eq!(code, Some(0), "{output}");
}

#[test]
fn robot_and_models_stand_in_the_black_box() {
    let place = TestDirectory::new("full", "[recorder]\ndir = \"recordings\"\n");
    let mut daemon = Process::daemon(TRUED, &place);
    assert!(daemon.wait_for_output("ready", LIMIT), "{:?}", daemon.lines());
    let mut monitor = Monitor::connect_to(&place.cell(), LIMIT).unwrap();
    let now = status(&mut monitor);
    let plain = place.model("plain.toml", "irb1600-6-145");
    assert_eq!(reload_model(&mut monitor, Some(&plain)).answer(), Ok(Answer::Done));
    assert!(daemon.end().success());
    let file = std::fs::read_dir(place.file("recordings")).unwrap().next().unwrap().unwrap();
    let contents = recording::mcap_recording::read(&file.path()).unwrap();
    let header = &contents.header;
    assert_eq!(header.robot, "ABB IRB 1600-6/1.45");
    assert_eq!((header.model_hash, header.geometry_hash), (now.model_hash, now.geometry_hash));
    let [change] = &contents.model_changes[..] else { panic!("{:?}", contents.model_changes) };
    assert!(change.t_ns > now.t_ns && change.header.model.contains("nominal"));
    assert_eq!(change.header.geometry_hash, header.geometry_hash, "the same robot");
    assert_eq!((&change.header.cell, &change.header.config), (&header.cell, &header.config));
}

#[test]
fn many_reloads_at_once_are_all_counted() {
    let (place, _daemon) = running("full");
    let askers: Vec<_> = (0..4)
        .map(|_| {
            let cell = place.cell();
            std::thread::spawn(move || {
                let mut monitor = Monitor::connect_to(&cell, LIMIT).unwrap();
                for _ in 0..8 {
                    assert_eq!(reload_model(&mut monitor, None).answer(), Ok(Answer::Done));
                }
            })
        })
        .collect();
    let (observed, epoch) = beside(&place.cell(), |monitor| {
        askers.into_iter().for_each(|asker| asker.join().unwrap());
        status(monitor).model_epoch
    });
    assert_eq!(epoch, 33);
    assert_eq!(observed.unanswered, 0);
    assert_eq!(observed.broken, Vec::<String>::new());
}

#[test]
fn a_daemon_that_waits_for_commands_takes_a_model_however_long_they_stay_fresh() {
    let place = TestDirectory::new("full", "[cycle]\nstale_ms = 10000.0\n");
    let daemon = Process::daemon(TRUED, &place);
    assert!(daemon.wait_for_output("ready", LIMIT), "{:?}", daemon.lines());
    let mut monitor = Monitor::connect_to(&place.cell(), LIMIT).unwrap();
    for _ in 0..3 {
        let answer = reload_model(&mut monitor, None);
        assert_eq!(answer.answer(), Ok(Answer::Done), "{}", answer.message);
    }
}
