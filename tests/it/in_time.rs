//! Dynamic errors, through the built program, on a robot simulated here: joints with delay, lag and
//! a mode, integrated by a Runge-Kutta method. It shares only the geometry of the preset with the
//! inverse.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

use feedforward::learn::expected_error;
use glam::DVec3;
use joint_dynamics::plant::Plants;
use physics::{Arm, Chain, Joints};
use recording::model::RobotModel;
use shm_schema::LeadState;
use tests::clients::root;
use tests::rng::TestRng;
use tests::simulation::lead::{self, Outcome, RandomFaults};

use crate::TRUED;
use crate::guide::blocks;
use crate::program::{Place, real_data};

const STEP_S: f64 = 4e-3;
const JOINTS: usize = 6;
/// A corner is rounded over this time, s: at 100 mm/s with 2 m/s².
const BLEND_S: f64 = 0.05;
/// Of the link encoders, rad.
const NOISE_RAD: f64 = 2e-6;

/// One joint of the robot.
#[derive(Clone, Copy)]
struct Servo {
    delay_s: f64,
    lag_s: f64,
    frequency_hz: f64,
    damping_ratio: f64,
}

/// What the robot really is.
fn truth() -> [Servo; JOINTS] {
    let stiff = Servo { delay_s: 0.018, lag_s: 0.012, frequency_hz: 0.0, damping_ratio: 0.0 };
    let soft = Servo { frequency_hz: 8.0, damping_ratio: 0.02, ..stiff };
    [soft, soft, Servo { frequency_hz: 9.0, ..soft }, stiff, stiff, stiff]
}

/// The preset with delay, lags and modes; the truth deviates from it by `off` (delay, lag,
/// frequency, damping), relative to the model's values.
fn model_text(errors: [f64; 4], sigma: f64) -> String {
    let preset = root().join("deploy/presets/irb1600-6-145.toml");
    let mut text = fs::read_to_string(preset).unwrap();
    let mut effect = |head: &str, keys: &[(&str, f64)]| {
        write!(text, "\n[[effect]]\n{head}\n").unwrap();
        keys.iter().for_each(|(key, value)| writeln!(text, "{key} = {value:?}").unwrap());
        let sigmas: Vec<String> =
            keys.iter().map(|(key, value)| format!("{key} = {:?}", sigma * value)).collect();
        writeln!(text, "sigma = {{ {} }}", sigmas.join(", ")).unwrap();
    };
    let servos = truth();
    let delay_ms = servos[0].delay_s * 1e3 / (1.0 + errors[0]);
    effect("kind = \"time_delay\"", &[("delay_ms", delay_ms)]);
    for (index, servo) in servos.iter().enumerate() {
        let head = format!("kind = \"servo_lag\"\njoint = {}", index + 1);
        effect(&head, &[("time_constant_ms", servo.lag_s * 1e3 / (1.0 + errors[1]))]);
        if servo.frequency_hz > 0.0 {
            let head = format!("kind = \"flexible_mode\"\njoint = {}", index + 1);
            let frequency_hz = servo.frequency_hz / (1.0 + errors[2]);
            let damping_ratio = servo.damping_ratio / (1.0 + errors[3]);
            effect(&head, &[("frequency_Hz", frequency_hz), ("damping_ratio", damping_ratio)]);
        }
    }
    text
}

impl Servo {
    /// Where the link is when the motor is commanded so; motor, deflection and its rate are the state.
    fn run(&self, commanded: &[f64]) -> Vec<f64> {
        const SUBSTEPS: usize = 10;
        let h = STEP_S / SUBSTEPS as f64;
        let mut state = [commanded[0], 0.0, 0.0];
        let mut link = vec![commanded[0]];
        for k in 0..commanded.len() - 1 {
            for substep in 0..SUBSTEPS {
                let t = k as f64 * STEP_S + substep as f64 * h;
                let rates = |state: [f64; 3], t: f64| self.rates(state, self.command(t, commanded));
                let moved = |by: [f64; 3], h: f64| [0, 1, 2].map(|i| state[i] + h * by[i]);
                let a = rates(state, t);
                let b = rates(moved(a, h / 2.0), t + h / 2.0);
                let c = rates(moved(b, h / 2.0), t + h / 2.0);
                let d = rates(moved(c, h), t + h);
                state = [0, 1, 2].map(|i| state[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]));
            }
            link.push(state[0] + state[1]);
        }
        link
    }

    /// The deflection's rate is kept with the motor's in it, so that no acceleration of the motor is needed: `v = x' + q'`.
    fn rates(&self, [motor, bent, speed]: [f64; 3], command: f64) -> [f64; 3] {
        let motor_rate = (command - motor) / self.lag_s;
        let omega = TAU * self.frequency_hz;
        if omega == 0.0 {
            return [motor_rate, 0.0, 0.0];
        }
        let bent_rate = speed - motor_rate;
        [
            motor_rate,
            bent_rate,
            -2.0 * self.damping_ratio * omega * bent_rate - omega * omega * bent,
        ]
    }

    fn command(&self, t: f64, commanded: &[f64]) -> f64 {
        let place = ((t - self.delay_s) / STEP_S).max(0.0);
        let k = (place as usize).min(commanded.len() - 2);
        commanded[k] + (place - k as f64).min(1.0) * (commanded[k + 1] - commanded[k])
    }
}

/// Joints as lists over the rows.
type Path6 = Vec<Vec<f64>>;

fn tool(arm: &Arm, path: &Path6) -> Vec<DVec3> {
    let tool_at = |row: usize| {
        let mut q = Joints::default();
        q.iter_mut().zip(path).for_each(|(q, joint)| *q = joint[row]);
        Chain::tool_at(arm, &q).origin
    };
    (0..path[0].len()).map(tool_at).collect()
}

/// A polygon in the air at 100 mm/s, corners rounded, by joints 1 to 3: Newton's method with differences.
fn wanted(arm: &Arm) -> Path6 {
    let mut q = Joints::default();
    q[..JOINTS].copy_from_slice(&[0.1, 0.2, 0.1, 0.2, 0.6, 0.0]);
    let start = Chain::tool_at(arm, &q).origin;
    let corners =
        [[0.0, 0.0, 0.0], [0.12, 0.0, 0.0], [0.12, 0.1, 0.0], [0.0, 0.1, 0.06], [0.06, -0.05, 0.0]];
    let mut points = vec![start; 125];
    for ends in corners.windows(2) {
        let [from, to] = [ends[0], ends[1]].map(|corner| start + DVec3::from_array(corner));
        let rows = (from.distance(to) / (0.1 * STEP_S)).round() as usize;
        points.extend((1..=rows).map(|k| from.lerp(to, k as f64 / rows as f64)));
    }
    points.extend(vec![points[points.len() - 1]; 125]);
    let half = (BLEND_S / STEP_S / 2.0) as usize;
    let about = |k: usize| k.saturating_sub(half)..(k + half + 1).min(points.len());
    let rounded = |k: usize| points[about(k)].iter().sum::<DVec3>() / about(k).len() as f64;
    let mut path = vec![Vec::new(); JOINTS];
    for point in (0..points.len()).map(rounded) {
        for _ in 0..4 {
            let error = point - Chain::tool_at(arm, &q).origin;
            let column = |joint: usize| {
                let mut moved = q;
                moved[joint] += 1e-6;
                (Chain::tool_at(arm, &moved).origin - Chain::tool_at(arm, &q).origin) / 1e-6
            };
            let step = glam::DMat3::from_cols(column(0), column(1), column(2)).inverse() * error;
            q.iter_mut().zip(step.to_array()).for_each(|(q, step)| *q += step);
        }
        path.iter_mut().zip(q).for_each(|(joint, q)| joint.push(q));
    }
    path
}

fn csv(times_s: &[f64], names: &str, joints: &Path6) -> String {
    let mut text = String::from("t_s");
    (1..=joints.len()).for_each(|joint| write!(text, ",{names}{joint}_rad").unwrap());
    for (row, t_s) in times_s.iter().enumerate() {
        write!(text, "\n{t_s:?}").unwrap();
        joints.iter().for_each(|joint| write!(text, ",{:?}", joint[row]).unwrap());
    }
    text + "\n"
}

/// Times and one group of columns of a table, angles in rad.
fn table(text: &str, name: &str, unit: &str) -> (Vec<f64>, Path6) {
    let mut lines = text.lines();
    let heads: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    let column = |head: &str| -> Vec<f64> {
        let column_index = heads.iter().position(|found| *found == head).expect(head);
        rows.iter().map(|row| row[column_index].parse().unwrap()).collect()
    };
    let si = if unit == "deg" { 1.0_f64.to_radians() } else { 1.0 };
    let joint =
        |joint: usize| column(&format!("{name}{joint}_{unit}")).iter().map(|q| q * si).collect();
    (column("t_s"), (1..=JOINTS).map(joint).collect())
}

/// Errors of the virtual robot's tool.
struct Error {
    from_path_m: f64,
    in_time_rms_m: f64,
}

struct Cell {
    place: Place,
    arm: Arm,
    path: Path6,
    chance: TestRng,
}

impl Cell {
    fn new() -> Self {
        let arm = RobotModel::read(Path::new("irb1600-6-145")).unwrap().physics.arm;
        let path = wanted(&arm);
        let place = Place::new();
        let times_s: Vec<f64> = (0..path[0].len()).map(|k| k as f64 * STEP_S).collect();
        place.file("path.csv", &csv(&times_s, "q", &path));
        Self { place, arm, path, chance: TestRng::new(11) }
    }

    /// Runs the robot on commands; `lead`: rows before the path's first.
    fn error(&self, commanded: &Path6, lead: usize) -> (Error, Path6) {
        let servos = truth();
        let reached: Path6 =
            servos.iter().zip(commanded).map(|(servo, joint)| servo.run(joint)).collect();
        let (wanted, points) = (tool(&self.arm, &self.path), tool(&self.arm, &reached));
        let wanted_at = |row: usize| wanted[row.saturating_sub(lead).min(wanted.len() - 1)];
        let distance = |point: &DVec3| {
            let of_leg = |ends: &[DVec3]| {
                let along = ends[1] - ends[0];
                let share = (*point - ends[0]).dot(along) / along.length_squared().max(1e-30);
                point.distance(ends[0] + share.clamp(0.0, 1.0) * along)
            };
            wanted.windows(2).map(of_leg).fold(f64::MAX, f64::min)
        };
        let from_path_m = points.iter().map(distance).fold(0.0, f64::max);
        let squares = points.iter().enumerate().map(|(k, p)| p.distance_squared(wanted_at(k)));
        let in_time_rms_m = (squares.sum::<f64>() / points.len() as f64).sqrt();
        (Error { from_path_m, in_time_rms_m }, reached)
    }

    fn uncompensated(&self) -> Error {
        let rest = 100;
        let extended = |joint: &Vec<f64>| {
            let (first, last) = (joint[0], joint[joint.len() - 1]);
            [vec![first; rest], joint.clone(), vec![last; rest]].concat()
        };
        self.error(&self.path.iter().map(extended).collect(), rest).0
    }

    /// Runs the table with this name: returns its error, and the measurements of the link encoders
    /// as a file.
    fn run(&mut self, name: &str, measured: &str) -> Error {
        let (times_s, commanded) = table(&self.place.read(name), "c", "deg");
        let lead = times_s.iter().filter(|t_s| **t_s < -1e-9).count();
        let (error, mut reached) = self.error(&commanded, lead);
        for value in reached.iter_mut().flatten() {
            let uniform: f64 = (0..12).map(|_| self.chance.uniform()).sum();
            *value += NOISE_RAD * (uniform - 6.0);
        }
        self.place.file(measured, &csv(&times_s, "ql", &reached));
        error
    }
}

#[test]
fn a_preview_leaves_a_fifth_of_the_path_error_and_learning_a_tenth() {
    let mut cell = Cell::new();
    let before = cell.uncompensated();
    for (sign, sigma) in [(1.0, 0.02), (-1.0, 0.02)] {
        cell.place.file(
            "robot.toml",
            &model_text([sign * sigma, -sign * sigma, sign * sigma, sigma], sigma),
        );
        let model = ["--model", "robot.toml", "--overwrite"];
        let correct =
            ["correct", "--dynamic", "path.csv", "--out", "run1.csv", "--json", "correct.json"];
        let output = cell.place.succeed(&[&correct[..], &model].concat()).out;
        assert!(output.contains("the arm stands still for"), "{output}");
        let json = cell.place.json("correct.json");
        let deviation_mm =
            json["dynamic"]["tool_with"]["from_path_mm"]["largest"].as_f64().unwrap();
        for (part, code) in [(0.9, 1), (1.1, 0)] {
            let tolerance_mm = format!("{:.6}", part * deviation_mm);
            let allowed = ["--tolerance-mm", tolerance_mm.as_str()];
            let judged = cell.place.run(&[&correct[..], &model, &allowed].concat());
            assert_eq!(judged.code, Some(code), "{} of {deviation_mm}", judged.out);
        }
        let preview = cell.run("run1.csv", "measured1.csv");
        println!(
            "largest from the path: {:.3} mm uncompensated, {:.3} mm with preview",
            before.from_path_m * 1e3,
            preview.from_path_m * 1e3
        );
        assert!(preview.from_path_m < before.from_path_m / 5.0);
        assert!(preview.in_time_rms_m < before.in_time_rms_m / 5.0);
        let mut learned = preview;
        for k in 1..=3 {
            let (run, measured) = (format!("run{k}.csv"), format!("measured{k}.csv"));
            let (next, measured_next) =
                (format!("run{}.csv", k + 1), format!("measured{}.csv", k + 1));
            let learn = ["learn", &run, &measured, "--out", &next, "--json", "learn.json"];
            cell.place.succeed(&[&learn[..], &model].concat());
            learned = cell.run(&next, &measured_next);
            println!("after learning run {k}: {:.3} mm", learned.from_path_m * 1e3);
        }
        assert!(learned.from_path_m < before.from_path_m / 10.0);
        let json = cell.place.json("learn.json");
        assert_eq!(json["joints"].as_array().unwrap().len(), JOINTS, "{json}");
    }
}

/// Rows at rest before and after the path of a cell.
const REST_ROWS: usize = 100;

/// A cell with `[dynamic]`, and limits of the correction that a lag of 30 ms at 100 mm/s does not reach.
const LEADING: &str = "[cycle]\nperiod_ms = 4\nstale_ms = 20\n[envelope]\nangle_mrad = 100\nrate_mrad_s = 1000\n\
                       jerk_mrad_s3 = 5e6\n[dynamic]\n";

impl Cell {
    /// The path row by row, with rest at both ends.
    fn rows(&self) -> Vec<Joints> {
        let last = self.path[0].len() - 1;
        let row = |k: usize| {
            let mut q = Joints::default();
            let k = k.saturating_sub(REST_ROWS).min(last);
            q.iter_mut().zip(&self.path).for_each(|(q, joint)| *q = joint[k]);
            q
        };
        (0..=last + 2 * REST_ROWS).map(row).collect()
    }

    /// The daemon with a model whose parameters are off so; at each command the next `known` setpoints are known.
    fn lead(&self, errors: [f64; 4], known: usize, trouble: RandomFaults, seed: u64) -> Outcome {
        self.place.file("robot.toml", &model_text(errors, 0.02));
        self.place.file("other.toml", &model_text(errors.map(|error| error + 0.1), 0.02));
        let model = |name: &str| RobotModel::read(&self.place.path(name)).unwrap();
        let models = [model("robot.toml"), model("other.toml")];
        lead::run(LEADING, models, &self.rows(), known, trouble, seed)
    }

    fn error_of(&self, outcome: &Outcome) -> Error {
        assert_eq!(outcome.broken, None);
        let sent = (0..JOINTS).map(|joint| outcome.sent.iter().map(|q| q[joint]).collect());
        self.error(&sent.collect(), REST_ROWS).0
    }
}

#[test]
fn the_daemon_leaves_a_quarter_of_the_path_error_where_it_knows_a_tenth_of_a_second_ahead() {
    let cell = Cell::new();
    let before = cell.uncompensated();
    for sign in [1.0, -1.0] {
        let errors = [0.02 * sign, -0.02 * sign, 0.02 * sign, 0.02];
        let mut left = Vec::new();
        for known in [0, 5, 10, 25, 125] {
            let outcome = cell.lead(errors, known, RandomFaults::default(), 1);
            let after = cell.error_of(&outcome);
            println!(
                "{known} setpoints ahead: from the path {:.3} then {:.3} mm at most, in time {:.3} then {:.3} mm rms",
                before.from_path_m * 1e3,
                after.from_path_m * 1e3,
                before.in_time_rms_m * 1e3,
                after.in_time_rms_m * 1e3
            );
            let state = [LeadState::NoHorizon, LeadState::ShortHorizon, LeadState::Horizon];
            let state = state[usize::from(known >= 10) + usize::from(known >= 125)];
            assert!(outcome.ticks_in(state) > outcome.sent.len() / 2, "{:?}", outcome.states);
            assert!(after.in_time_rms_m <= before.in_time_rms_m);
            assert!(after.from_path_m <= before.from_path_m);
            left.push((known, after.from_path_m / before.from_path_m));
            assert!(known < 25 || after.in_time_rms_m < before.in_time_rms_m / 10.0, "{known}");
        }
        for (known, left) in left {
            let limit = if known >= 125 {
                0.2
            } else if known >= 25 {
                0.25
            } else {
                1.0
            };
            assert!(left <= limit, "{known} setpoints ahead: {left}");
        }
    }
}

#[test]
fn a_lead_by_a_model_that_is_off_by_thirty_percent_makes_no_path_worse_in_time() {
    let cell = Cell::new();
    let before = cell.uncompensated();
    for errors in [[0.3; 4], [-0.3; 4], [0.3, -0.3, -0.3, 0.3], [-0.3, 0.3, 0.3, -0.3]] {
        for known in [0, 10, 25, 125] {
            let after = cell.error_of(&cell.lead(errors, known, RandomFaults::default(), 1));
            println!(
                "{errors:?}, {known} ahead: {:.3} then {:.3} mm rms",
                before.in_time_rms_m * 1e3,
                after.in_time_rms_m * 1e3
            );
            assert!(after.in_time_rms_m <= before.in_time_rms_m, "{errors:?}, {known}");
        }
    }
}

#[test]
fn a_lead_breaks_no_bound_whatever_is_lost_or_changed() {
    let cell = Cell::new();
    let mut states = [0; 5];
    let mut refused = 0;
    for seed in 0..40 {
        let trouble = RandomFaults { lost: 0.05, changes: 0.02 };
        let outcome = cell.lead([0.0; 4], 40, trouble, seed);
        assert_eq!(outcome.broken, None, "seed {seed}");
        states.iter_mut().zip(outcome.states).for_each(|(sum, state)| *sum += state);
        refused += outcome.horizons_refused;
    }
    assert!(states[2..].iter().all(|ticks| *ticks > 0), "{states:?}");
    assert!(refused > 0);
}

#[test]
fn a_model_off_by_thirty_percent_makes_no_path_worse_in_time_and_learning_continues_from_there() {
    let mut cell = Cell::new();
    let before = cell.uncompensated();
    let offs = [
        [0.3, 0.3, 0.3, 0.3],
        [-0.3, -0.3, -0.3, -0.3],
        [0.3, -0.3, -0.3, 0.3],
        [-0.3, 0.3, 0.3, -0.3],
    ];
    for errors in offs {
        cell.place.file("robot.toml", &model_text(errors, 0.05));
        let model = ["--model", "robot.toml", "--overwrite"];
        let correct = ["correct", "--dynamic", "path.csv", "--out", "run1.csv"];
        cell.place.succeed(&[&correct[..], &model].concat());
        let preview = cell.run("run1.csv", "measured1.csv");
        println!(
            "{errors:?}: in time {:.3} then {:.3} mm rms, from the path {:.3} then {:.3} mm at most",
            before.in_time_rms_m * 1e3,
            preview.in_time_rms_m * 1e3,
            before.from_path_m * 1e3,
            preview.from_path_m * 1e3
        );
        assert!(preview.in_time_rms_m <= before.in_time_rms_m);
        assert!(preview.from_path_m <= before.from_path_m);
        let mut last = preview.in_time_rms_m;
        for k in 1..=3 {
            let (run, measured) = (format!("run{k}.csv"), format!("measured{k}.csv"));
            let (next, measured_next) =
                (format!("run{}.csv", k + 1), format!("measured{}.csv", k + 1));
            cell.place.succeed(&[&["learn", &run, &measured, "--out", &next][..], &model].concat());
            let learned = cell.run(&next, &measured_next);
            assert!(
                learned.in_time_rms_m <= 1.01 * last + 1e-6,
                "{} after {last}",
                learned.in_time_rms_m
            );
            last = learned.in_time_rms_m;
        }
        println!("after three runs: {:.3} mm rms in time", last * 1e3);
    }
}

#[test]
fn a_clock_that_is_late_is_refused_or_reported_and_an_estimated_offset_cures_it() {
    let mut cell = Cell::new();
    cell.place.file("robot.toml", &model_text([0.02, -0.02, 0.02, 0.02], 0.02));
    let model = ["--model", "robot.toml", "--overwrite"];
    let correct = ["correct", "--dynamic", "path.csv", "--out", "run1.csv"];
    cell.place.succeed(&[&correct[..], &model].concat());
    let before = cell.run("run1.csv", "measured.csv");
    let measured = cell.place.read("measured.csv");
    let late = |by_s: f64| {
        let shifted = measured.lines().enumerate().map(|(row, line)| match line.split_once(',') {
            Some((t_s, rest)) if row > 0 => {
                format!("{:.6},{rest}\n", t_s.parse::<f64>().unwrap() + by_s)
            }
            _ => format!("{line}\n"),
        });
        shifted.collect::<String>()
    };
    let learn = ["learn", "run1.csv", "late.csv", "--out", "run2.csv", "--json", "learn.json"];
    for by_s in [0.015, 0.03, 0.05, -0.03] {
        cell.place.file("late.csv", &late(by_s));
        let done = cell.place.run(&[&learn[..], &model].concat());
        let named = done.err.contains("--clock-offset-ms unknown");
        assert!(done.code == Some(2) && named, "{by_s}: {done:#?}");
        assert!(!cell.place.path("run2.csv").exists(), "{by_s}: nothing is written");
        let unknown = [&learn[..], &model, &["--clock-offset-ms", "unknown"]].concat();
        cell.place.succeed(&unknown);
        let after = cell.run("run2.csv", "measured2.csv");
        println!("{by_s} s: from the path {} then {} m", before.from_path_m, after.from_path_m);
        assert!(after.from_path_m < before.from_path_m);
        fs::remove_file(cell.place.path("run2.csv")).unwrap();
    }
    cell.place.file("late.csv", &late(0.005));
    let done = cell.place.succeed(&[&learn[..], &model].concat());
    assert!(done.err.contains("ms later than the model predicts"), "{done:#?}");
    let late_ms = cell.place.json("learn.json")["late_ms"][0].as_f64().unwrap();
    assert!((late_ms - 5.0).abs() < 1.0, "{late_ms}");
}

#[test]
fn what_limits_a_dynamic_correction_is_in_rows_summary_and_exit_code() {
    let cell = Cell::new();
    cell.place.file("robot.toml", &model_text([0.0; 4], 0.02));
    let run = [
        "correct",
        "--dynamic",
        "path.csv",
        "--model",
        "robot.toml",
        "--overwrite",
        "--out",
        "run.csv",
    ];
    let json = ["--json", "run.json"];
    for (limit, by, option) in [
        (["--max-rate-mrad-s", "40"], "max_rate", "raise --max-rate-mrad-s"),
        (["--max-mrad", "2"], "max_mrad", "raise --max-mrad"),
    ] {
        let done = cell.place.run(&[&run[..], &json, &limit].concat());
        assert!(done.code == Some(1) && done.out.contains(option), "{done:#?}");
        let table = cell.place.read("run.csv");
        let heads: Vec<&str> = table.lines().next().unwrap().split(',').collect();
        let [status, left, limited] = ["status", "left_mm", "limited_by"]
            .map(|name| heads.iter().position(|head| *head == name).unwrap());
        let rows: Vec<Vec<&str>> =
            table.lines().skip(1).map(|line| line.split(',').collect()).collect();
        let limited_rows = rows.iter().filter(|row| row[limited] == by).count();
        assert!(
            limited_rows > 0
                && rows.iter().all(|row| row[limited].is_empty() == (row[status] != "limited"))
        );
        let result = cell.place.json("run.json");
        let is_limited = |row: &&Vec<&str>| row[status] == "limited";
        let all = rows.iter().filter(is_limited).count() as u64;
        assert_eq!(result["not_exact_rows"], all);
        assert_eq!(result["statuses"]["limited"], all);
        let reasons = result["reasons"].as_array().unwrap();
        assert!(reasons.iter().any(|reason| reason["reason"] == by), "{reasons:?}");
        let largest = rows.iter().map(|row| row[left].parse::<f64>().unwrap()).fold(0.0, f64::max);
        let reported = result["largest_left"]["mm"].as_f64().unwrap();
        assert!((largest - reported).abs() < 1e-6, "{largest} {reported}");
        let dynamic = &result["dynamic"];
        let size = |key: &str| dynamic[key]["from_path_mm"]["largest"].as_f64().unwrap();
        assert!((reported - size("tool_with")).abs() < 1e-3, "{reported}");
        assert!(size("tool_with") <= size("tool_without"));
    }
}

#[test]
fn a_file_given_twice_is_no_measurement_of_two_runs() {
    let place = Place::new();
    let table = "t_s,q1_deg,ql1_deg\n0,1,1\n0.01,2,2\n";
    for name in ["a.csv", "b.csv"] {
        place.file(name, table);
    }
    for (files, why) in [
        (["a.csv", "./a.csv", "b.csv"], "as path and as measurement"),
        (["a.csv", "b.csv", "b.csv"], "given twice"),
    ] {
        let done = place.run(&[&["learn", "--model", "irb120"][..], &files].concat());
        assert!(done.code == Some(2) && done.err.contains(why), "{done:#?}");
    }
}

#[test]
fn the_document_leads_from_a_model_to_what_was_learned_of_two_runs() {
    let document = fs::read_to_string(root().join("docs/dynamic.md")).unwrap();
    let script = blocks(&document, "sh");
    assert!(script.matches("\ntrued ").count() >= 7, "the document's commands are found");
    let place = Place::new();
    fs::create_dir(place.path("bin")).unwrap();
    std::os::unix::fs::symlink(TRUED, place.path("bin/trued")).unwrap();
    let path = format!("{}:{}", place.path("bin").display(), std::env::var("PATH").unwrap());
    let run = Command::new("timeout")
        .args(["120", "sh", "-euc", &script])
        .env("PATH", path)
        .current_dir(place.path(""))
        .output()
        .unwrap();
    let stdout = String::from_utf8_lossy(&run.stdout).into_owned();
    assert!(run.status.success(), "{stdout}\n{}", String::from_utf8_lossy(&run.stderr));
    for part in ["the arm stands still for", "estimated delay", "repeatability", "next commands"] {
        assert!(stdout.contains(part), "{part}: {stdout}");
    }
    // Of the second run, with learned commands, and of the first.
    let measured = |line: &str| {
        let (_, rest) = line.split_once("path deviation at most ").unwrap();
        rest.split(' ').next().unwrap().parse::<f64>().unwrap()
    };
    let before = stdout.lines().find(|line| line.starts_with("uncompensated error")).unwrap();
    let errors: Vec<f64> =
        stdout.lines().filter(|line| line.starts_with("measured error")).map(measured).collect();
    assert!(
        errors.len() == 2 && errors[1] < errors[0] && 10.0 * errors[1] < measured(before),
        "{stdout}"
    );
    println!("{stdout}");
}

/// Result of `trued diagnose --model slide.toml --seed 1 DATA_EMPS.csv DATA_EMPS_PULSES.csv` on the
/// first of two recordings of a real axis (the second held out; `slide.toml` is that of `xtask`,
/// `q_meas_m` read as `ql1_m`, no force).
const AXIS: &str = r#"
[[effect]]
kind = "time_delay"
delay_ms = 2.71

[[effect]]
kind = "servo_lag"
joint = 1
time_constant_ms = 3.67

[[effect]]
kind = "flexible_mode"
joint = 1
frequency_Hz = 19.545
damping_ratio = 0.4305
participation = 0.7613
"#;

#[test]
fn the_lag_that_is_compensated_is_that_of_a_real_axis_held_out() {
    let Some(recorded) = real_data("emps/DATA_EMPS_PULSES.csv") else { return };
    let slide = fs::read_to_string(root().join("xtask/src/evidence/sets/emps.toml")).unwrap();
    let model = RobotModel::parse("axis", &(slide + AXIS)).unwrap();
    let mut columns = [Vec::new(), Vec::new(), Vec::new()];
    for line in fs::read_to_string(recorded).unwrap().lines().skip(1) {
        let numbers = line.split(',').map(|number| number.parse::<f64>().unwrap());
        columns.iter_mut().zip(numbers).for_each(|(column, number)| column.push(number));
    }
    let [times_s, commanded, measured] = columns;
    let step_s = (times_s[times_s.len() - 1] - times_s[0]) / (times_s.len() - 1) as f64;
    let path = [commanded];
    let plants = Plants::of(&model, 0.1);
    let predicted = expected_error(&plants, step_s, &path, &path).remove(0);
    let rms_mm = |errors_m: Vec<f64>| {
        let mean = errors_m.iter().sum::<f64>() / errors_m.len() as f64;
        let square =
            errors_m.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / errors_m.len() as f64;
        square.sqrt() * 1e3
    };
    let late = path[0].iter().zip(&measured).map(|(q, y)| q - y);
    let left = late.clone().zip(predicted).map(|(late, predicted)| late - predicted);
    let (before, after) = (rms_mm(late.collect()), rms_mm(left.collect()));
    println!(
        "tracking error of the recording {before:.4} mm rms, without what the model predicts {after:.4}"
    );
    assert!(after < before / 8.0, "{before} {after}");
}
