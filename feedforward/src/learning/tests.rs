//! A run that is worse than the one before is undone, and what is kept for that passes through a table.

use super::*;
use recording::series::Channel;

const STEP_S: f64 = 4e-3;
const ROWS: usize = 1200;
const KINDS: [JointKind; 1] = [JointKind::Prismatic];

fn model() -> RobotModel {
    let text = "schema = \"trued.model/1\"\nname = \"slide\"\n[[joint]]\nname = \"1\"\nkind = \"prismatic\"\naxis = [1.0, 0.0, 0.0]\n\
                limits_mm = [-3000.0, 3000.0]\n[tool]\ntcp_mm = [0.0, 0.0, 0.0]\n\
                [[effect]]\nkind = \"servo_lag\"\njoint = 1\ntime_constant_ms = 12.0\nsigma = { time_constant_ms = 0.3 }\n";
    RobotModel::parse("slide", text).expect("a model")
}

fn times_s() -> Vec<f64> {
    (0..ROWS).map(|k| k as f64 * STEP_S).collect()
}

/// A second of rest, motion, a second of rest.
fn wanted() -> Vec<f64> {
    let at = |t_s: &f64| 0.05 * (1.0 - (2.0 * (t_s - 1.0).clamp(0.0, std::f64::consts::PI)).cos());
    times_s().iter().map(at).collect()
}

fn table(commanded: &[f64]) -> Recording {
    let mut recording = Recording::new(times_s());
    recording.set_joint_kind(0, JointKind::Prismatic);
    recording.set(Channel::Command(0), wanted());
    let texts = commanded.iter().map(|c| format!("{:?}", c * 1e3)).collect();
    recording.other.push(("c1_mm".to_owned(), texts));
    recording
}

/// Where the slide is with an oscillation of `size`, m.
fn measured(size: f64) -> Recording {
    let mut recording = Recording::new(times_s());
    recording.set_joint_kind(0, JointKind::Prismatic);
    let swing = |(k, q): (usize, &f64)| q + size * (0.07 * k as f64).sin();
    recording.set(Channel::Link(0), wanted().iter().enumerate().map(swing).collect());
    recording
}

fn learn_from(table: &Recording, run: &Recording) -> Learned {
    let (model, settings) = (model(), Settings::with_limits(0.2, 1.0, 5e3).expect("sound"));
    let plants = Plants::of(&model, settings.unstated);
    let path = CommandedPath::of(table, &KINDS, &plants, &settings).expect("a table");
    let wanted = vec![path.recording.input(0).expect("a joint").to_vec()];
    let commanded = path.commanded.expect("commands");
    let commands = Commands { wanted, commanded, history: path.history };
    let mut learning =
        Learning::of(&model, &plants, &path.recording, commands, &settings).expect("a path");
    learning.add(run, Clock::Offset(0.0)).expect("a run");
    learning.next("next.csv".to_owned(), &path.source).expect("learned")
}

/// The table of a next run.
fn table_of(learned: &Learned) -> Recording {
    let mut table = table(&learned.next.commanded[0]);
    learned.history.put(&mut table, &KINDS);
    table
}

#[test]
fn after_a_worse_run_the_commands_are_those_of_the_run_before_and_the_next_change_is_halved() {
    let first = wanted();
    let learned = learn_from(&table(&first), &measured(1e-3));
    assert!(!learned.report.is_back());
    assert!(learned.next.commanded[0] != first, "something is learned");
    let worse = learn_from(&table_of(&learned), &measured(2e-3));
    assert!(worse.report.is_back() && worse.report.text().contains("went back"));
    let most = worse.next.commanded[0].iter().zip(&first).map(|(a, b)| (a - b).abs());
    assert!(most.fold(0.0, f64::max) < 1e-12, "the commands of the run before");
    assert_eq!(worse.history, History { before: None, learning_share: 0.5 });
    let again = learn_from(&table_of(&worse), &measured(1e-3));
    let change = |learned: &Learned| {
        let changes = learned.next.commanded[0].iter().zip(&first).map(|(a, b)| (a - b).abs());
        changes.fold(0.0, f64::max)
    };
    assert!((change(&again) / change(&learned) - 0.5).abs() < 0.02);
}

#[test]
fn a_better_run_and_one_as_good_are_learned_from() {
    let learned = learn_from(&table(&wanted()), &measured(1e-3));
    for size in [1e-4, 1.05e-3] {
        let next = learn_from(&table_of(&learned), &measured(size));
        assert!(!next.report.is_back(), "{size}");
        assert_eq!(next.history.learning_share, 1.0);
        let before = next.history.before.expect("this run");
        assert!((before.rms_m / (size / 2f64.sqrt()) - 1.0).abs() < 0.1, "{}", before.rms_m);
    }
}

#[test]
fn the_run_before_passes_through_its_columns() {
    let commanded = vec![(0..ROWS).map(|k| 1e-3 / (k + 3) as f64).collect::<Vec<f64>>()];
    let history = History {
        before: Some(Before { commanded, rms_m: 1.0 / 3.0 * 1e-3 }),
        learning_share: 0.25,
    };
    let mut recording = table(&wanted());
    history.put(&mut recording, &KINDS);
    let read = History::of(&recording, &KINDS).expect("its columns");
    assert_eq!(read.learning_share, 0.25);
    let (read, put) = (read.before.expect("a run"), history.before.expect("a run"));
    assert!((read.rms_m - put.rms_m).abs() < 1e-18);
    let differ = read.commanded[0].iter().zip(&put.commanded[0]).map(|(a, b)| (a - b).abs());
    assert!(differ.fold(0.0, f64::max) < 1e-15);
    History::default().put(&mut recording, &KINDS);
    assert_eq!(History::of(&recording, &KINDS).expect("its columns"), History::default());
}

#[test]
fn a_run_far_worse_than_predicted_is_reported_and_one_as_predicted_is_not() {
    let worse = learn_from(&table(&wanted()), &measured(2e-2));
    assert!(worse.report.warnings().iter().any(|warning| warning.contains("within its sigma")));
    let plants = Plants::of(&model(), 0.1);
    let error = expected_error(&plants, STEP_S, &[wanted()], &[wanted()]).remove(0);
    let mut as_predicted = measured(0.0);
    let reached = wanted().iter().zip(error).map(|(q, error)| q - error).collect();
    as_predicted.set(Channel::Link(0), reached);
    assert_eq!(learn_from(&table(&wanted()), &as_predicted).report.warnings(), [""; 0]);
}
