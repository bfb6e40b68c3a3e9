//! `trued simulate` in the torque domain: drive torques in the layout of the recording, with or
//! without a controller in the loop.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use recording::series::{Channel, Recording, RequiredData, read};

use crate::program::Place;

const RATE_HZ: f64 = 1000.0;
const ROWS: usize = 3000;
const LEVEL: f64 = 20.4;
const SPEED: f64 = 0.15;

/// A level slide of one axis, as test rigs have it.
pub(crate) const SLIDE: &str = r#"
schema = "trued.model/1"
name = "slide"
[[joint]]
kind = "prismatic"
axis = [1.0, 0.0, 0.0]
limits_mm = [-500.0, 500.0]
link = { mass_kg = 95.0, com_mm = [0.0, 0.0, 0.0] }
[tool]
tcp_mm = [0.0, 0.0, 100.0]
"#;

/// To and fro once in two seconds at an even speed, with soft turns of 0.2 s.
fn position(t: f64) -> f64 {
    let (turn, run) = (0.2, 0.8);
    let phase = t.rem_euclid(2.0 * (turn + run));
    let (sign, phase) = if phase < turn + run { (1.0, phase) } else { (-1.0, phase - turn - run) };
    let half = 0.5 * run * SPEED;
    let place = if phase < run {
        SPEED * phase - half
    } else {
        half + SPEED * turn / TAU * 2.0 * (TAU * 0.5 * (phase - run) / turn).sin()
    };
    sign * place
}

fn place(effects: &str, columns: &str) -> Place {
    let place = Place::new();
    let mut text = format!("t_s,q1_m{columns}\n");
    let empty = ",1".repeat(columns.matches(',').count());
    for k in 0..ROWS {
        let t = k as f64 / RATE_HZ;
        writeln!(text, "{t},{}{empty}", position(t)).unwrap();
    }
    place.file("path.csv", &text);
    place.file("path.toml", "schema = \"trued.recording/1\"\n");
    place.file("slide.toml", &format!("{SLIDE}{effects}"));
    place
}

fn simulated(place: &Place, out: &str, more: &[&str]) -> Recording {
    let mut arguments = vec!["simulate", "--model", "slide.toml", "--out", out, "path.csv"];
    arguments.extend(more);
    place.succeed(&arguments);
    read(&place.path(&format!("{out}.csv")), None, RequiredData::Measurement).expect("a recording")
}

fn column(recording: &Recording, channel: Channel) -> Vec<f64> {
    recording.column(channel).expect("simulated").to_vec()
}

fn coulomb() -> String {
    format!("[[effect]]\nkind = \"coulomb_friction\"\njoint = 1\nlevel_N = {LEVEL}\n")
}

/// Force where the slide runs evenly forth and back.
fn runs(force: &[f64]) -> (f64, f64) {
    let mean = |rows: std::ops::Range<usize>| {
        let count = rows.len() as f64;
        force[rows].iter().sum::<f64>() / count
    };
    (mean(200..700), mean(1200..1700))
}

#[test]
fn a_slide_with_dry_friction_asks_its_level_against_the_motion() {
    let made = simulated(&place(&coulomb(), ",tau1_N"), "made", &[]);
    let force = column(&made, Channel::Torque(0));
    let (forth, back) = runs(&force);
    assert!((forth - LEVEL).abs() < 1e-6 && (back + LEVEL).abs() < 1e-6, "{forth} {back}");
    // The reversal is at 0.9 s; speeds are averaged over 16 ms.
    let jump = force[900 - 10] - force[900 + 10];
    assert!((jump - 2.0 * LEVEL).abs() < 1.0, "{jump} N");
    assert_eq!(made.len(), ROWS);
    assert!(made.column(Channel::Position(0)).is_none(), "nothing that was not measured");
}

#[test]
fn noise_of_forces_is_of_the_requested_size_and_of_that_seed() {
    let place = place(&coulomb(), ",tau1_N");
    let clean = column(&simulated(&place, "clean", &[]), Channel::Torque(0));
    let noise = ["--seed", "5", "--torque-noise", "1.5"];
    let noisy = simulated(&place, "noisy", &noise);
    simulated(&place, "again", &noise);
    assert_eq!(place.read("noisy.csv"), place.read("again.csv"));
    assert_eq!(noisy.sigma(Channel::Torque(0)), Some(1.5));
    let square = |(a, b): (&f64, &f64)| (a - b) * (a - b);
    let noisy = column(&noisy, Channel::Torque(0));
    let rms = (noisy.iter().zip(&clean).map(square).sum::<f64>() / ROWS as f64).sqrt();
    assert!((rms / 1.5 - 1.0).abs() < 0.06, "{rms} N");
    let head = place.read("noisy.toml");
    assert!(head.contains("--seed 5 --noise 0 --torque-noise 1.5\n"), "{head}");
}

#[test]
fn every_effect_of_drives_changes_what_is_recorded_and_a_delay_shifts_it() {
    let exact = column(&simulated(&place("", ",tau1_N"), "exact", &[]), Channel::Torque(0));
    let list = [
        ("viscous_friction", "joint = 1\ncoefficient = 203.0"),
        ("stribeck_friction", "joint = 1\nlevel_N = 5.0\nstribeck_speed = 0.1"),
        ("friction_asymmetry", "joint = 1\noffset_N = 3.0"),
        ("inertia", "joint = 1\nmass_kg = 5.0"),
        ("gravity_torque", "joint = 1\ncos_N = 2.0\nsin_N = 1.0"),
        ("torque_ripple", "joint = 1\namplitude_N = 2.0\ncycles_per_m = 400.0\nphase_rad = 0.3"),
        ("spring", "joint = 1\nstiffness = 500.0\nrest_position = 0.02"),
        ("spring_hardening", "joint = 1\ncubic_stiffness = 90000.0"),
        ("hysteresis", "joint = 1\namplitude_N = 12.0\nreversal_mm = 2.0"),
        ("drive_gain", "joint = 1\ngain = 0.1"),
        ("torque_delay", "delay_ms = 5.0"),
        ("payload", "mass_kg = 3.0\ncom_mm = [0.0, 0.0, 50.0]"),
    ];
    for (kind, numbers) in list {
        let place = place(&format!("[[effect]]\nkind = \"{kind}\"\n{numbers}\n"), ",tau1_N");
        let made = column(&simulated(&place, "made", &[]), Channel::Torque(0));
        let most = made.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(most > 1.0, "{kind}: {most} N");
        if kind == "torque_delay" {
            let difference = (5..ROWS).map(|k| (made[k] - exact[k - 5]).abs()).fold(0.0, f64::max);
            assert!(difference < 1e-9, "{difference} N");
        }
    }
}

#[test]
fn in_a_closed_loop_friction_shows_in_the_motion() {
    let columns = ",qa1_m,tau1_N";
    let free = simulated(&place("", columns), "made", &[]);
    let dry = simulated(&place(&coulomb().replace("20.4", "60.0"), columns), "made", &[]);
    let (with, without) = (column(&dry, Channel::Motor(0)), column(&free, Channel::Motor(0)));
    let largest_difference = |rows: std::ops::Range<usize>| {
        rows.map(|k| (with[k] - without[k]).abs()).fold(0.0, f64::max)
    };
    // The force turns by 120 N at 0.9 s; the loop has forgotten that by the middle of each run.
    assert!(
        largest_difference(850..1000) > 1e-4,
        "{} m at the turn",
        largest_difference(850..1000)
    );
    assert!(largest_difference(400..750) < 1e-5, "{} m in between", largest_difference(400..750));
    let lost = (0..ROWS).map(|k| (without[k] - position(k as f64 / RATE_HZ)).abs());
    assert!(lost.fold(0.0, f64::max) < 1e-3, "the slide follows");
    let (forth, back) = runs(&column(&dry, Channel::Torque(0)));
    assert!((forth - 60.0).abs() < 0.5 && (back + 60.0).abs() < 0.5, "{forth} {back}");
}

#[test]
fn without_masses_a_loop_is_refused_and_without_any_law_torques_are_left_out() {
    let simulate = ["simulate", "--model", "slide.toml", "--out", "made", "path.csv"];
    let massless = SLIDE.replace("link = ", "# link = ");
    let place = place("", ",qa1_m,tau1_N");
    place.file("slide.toml", &format!("{massless}{}", coulomb()));
    let done = place.run(&simulate);
    assert!(done.code == Some(2) && done.err.contains("no inertia"), "{done:#?}");
    place.file("slide.toml", &massless);
    let done = place.run(&simulate);
    assert!(done.code == Some(0) && done.err.contains("left out: tau1"), "{done:#?}");
    assert!(!place.read("made.csv").contains("tau1"));
}
