//! Forces of a cutter: closed forms, signs, harmonics, and changes by effects and a sensor.

use crate::cut::{CutForce, Cutter, ToothForces};
use crate::effects::conformance::scene;
use crate::{AnyEffect, Memories, Model, ParameterValues};
use core::f64::consts::{FRAC_PI_2, PI, TAU};
use glam::{DMat3, DVec3};

const FEED: f64 = 40e-6;
/// Samples per turn.
const TURN: u32 = 7200;

fn mill() -> Cutter {
    Cutter {
        teeth: 2,
        diameter_m: 6e-3,
        helix_rad: 0.0,
        axial_depth_m: 0.25e-3,
        entry_rad: 0.0,
        exit_rad: PI,
        turning: false,
        chip_n_m2: DVec3::new(800e6, 300e6, 150e6),
        edge_n_m: DVec3::new(8e3, 10e3, 2e3),
    }
}

fn force(cutter: &Cutter, bite: &ToothForces) -> DVec3 {
    CutForce::default().acting(cutter, bite, 0.0)
}

/// Angles over one turn of the spindle.
fn turn() -> impl Iterator<Item = f64> {
    (0..TURN).map(|k| TAU * (f64::from(k) + 0.5) / f64::from(TURN))
}

/// Amplitude of a force's harmonic with `cycles` per turn, along each axis, N.
fn wave(cutter: &Cutter, under: &CutForce, cycles: f64) -> DVec3 {
    let (mut cos, mut sin) = (DVec3::ZERO, DVec3::ZERO);
    for angle in turn() {
        let force = under.acting(cutter, &cutter.tooth_forces(angle, FEED), 0.0);
        cos += force * (cycles * angle).cos();
        sin += force * (cycles * angle).sin();
    }
    let length = |k: usize| cos[k].hypot(sin[k]) * 2.0 / f64::from(TURN);
    DVec3::new(length(0), length(1), length(2))
}

/// An effect's name with its values.
type Named<'a> = (&'a str, &'a [(&'a str, &'a [f64])]);

fn with(effects: &[Named<'_>]) -> CutForce {
    at(effects, 0.0)
}

fn at(effects: &[Named<'_>], time_s: f64) -> CutForce {
    let scene = scene();
    let mut model = Model::nominal(scene.arm);
    for (kind, numbers) in effects {
        let effect =
            AnyEffect::build(kind, &scene.arm, None, ParameterValues(numbers)).expect("sound");
        model.push(effect).expect("room");
    }
    let inputs = crate::Inputs { time_s, ..scene.inputs };
    model.cut_force(&inputs, &Memories::default())
}

#[test]
fn the_mean_force_in_a_slot_is_the_closed_form() {
    let cutter = mill();
    let (n, a, f) = (2.0, cutter.axial_depth_m, FEED);
    let (c, e) = (cutter.chip_n_m2, cutter.edge_n_m);
    let expected = DVec3::new(
        -n * a / 4.0 * c.y * f - n * a / PI * e.y,
        n * a / 4.0 * c.x * f + n * a / PI * e.x,
        n * a / PI * c.z * f + n * a / 2.0 * e.z,
    );
    assert!((force(&cutter, &cutter.mean(FEED)) - expected).length() < 1e-12);
}

#[test]
fn the_mean_force_of_half_immersion_is_the_closed_form_up_and_down() {
    let (c, e, a) = (mill().chip_n_m2 * FEED, mill().edge_n_m, mill().axial_depth_m);
    for (entry_rad, exit_rad, sign) in [(0.0, FRAC_PI_2, 1.0), (FRAC_PI_2, PI, -1.0)] {
        let cutter = Cutter { entry_rad, exit_rad, ..mill() };
        // Over a quarter of a turn: ∫ sin cos = ±1/2, ∫ sin² = π/4, ∫ sin = 1, ∫ cos = ±1.
        let expected = DVec3::new(
            -sign * (0.5 * c.x + e.x) - (PI / 4.0 * c.y + e.y),
            PI / 4.0 * c.x + e.x - sign * (0.5 * c.y + e.y),
            c.z + FRAC_PI_2 * e.z,
        ) * (2.0 * a / TAU);
        let mean = force(&cutter, &cutter.mean(FEED));
        assert!((mean - expected).length() < 1e-12, "{mean} {expected}");
    }
}

#[test]
fn up_milling_resists_the_feed_and_down_milling_pulls_the_tool_along_and_away() {
    let sharp =
        Cutter { chip_n_m2: DVec3::new(800e6, 200e6, 0.0), edge_n_m: DVec3::ZERO, ..mill() };
    let up = Cutter { exit_rad: FRAC_PI_2, ..sharp };
    let down = Cutter { entry_rad: FRAC_PI_2, ..sharp };
    let (up, down) = (force(&up, &up.mean(FEED)), force(&down, &down.mean(FEED)));
    assert!(up.x < 0.0 && down.x > 0.0, "{up} {down}");
    assert!(down.y > up.y, "pushed away from the wall");
}

#[test]
fn the_mean_over_a_turn_is_the_mean_whatever_helix_and_runout() {
    let cutter = Cutter { teeth: 3, entry_rad: 0.3, exit_rad: 2.2, helix_rad: 0.5, ..mill() };
    let under = with(&[("runout", &[("radial", &[5e-6]), ("phase", &[0.7])])]);
    let mut sum = DVec3::ZERO;
    for angle in turn() {
        sum += under.acting(&cutter, &cutter.tooth_forces(angle, FEED), 0.0);
    }
    let error = sum / f64::from(TURN) - force(&cutter, &cutter.mean(FEED));
    assert!(error.length() < 5e-3, "{error}");
}

#[test]
fn even_teeth_repeat_with_their_passing_and_runout_adds_the_spindles_own_frequency() {
    let cutter = Cutter { teeth: 4, exit_rad: 1.2, ..mill() };
    let even = CutForce::default();
    for cycles in [1.0, 2.0, 3.0, 5.0] {
        assert!(wave(&cutter, &even, cycles).length() < 1e-9, "{cycles} per turn");
    }
    assert!(wave(&cutter, &even, 4.0).y > 0.5);
    let under = with(&[("runout", &[("radial", &[3e-6]), ("phase", &[0.4])])]);
    assert!(wave(&cutter, &under, 1.0).y > 0.05);
    let turned = with(&[("runout", &[("radial", &[3e-6]), ("phase", &[0.4 + FRAC_PI_2])])]);
    let (one, other) = (wave(&cutter, &under, 1.0), wave(&cutter, &turned, 1.0));
    assert!((one - other).length() < 1e-9, "which tooth it is changes no size: {one} {other}");
}

#[test]
fn the_tooth_that_stands_out_takes_what_the_one_before_it_left() {
    let cutter = mill();
    let radial = 3e-6;
    let under = with(&[("runout", &[("radial", &[radial]), ("phase", &[0.0])])]);
    // Tooth 0 where the chip is thickest, then tooth 1 there.
    let tangential = |angle: f64| under.acting(&cutter, &cutter.tooth_forces(angle, FEED), 0.0).y;
    let more = 2.0 * radial * cutter.chip_n_m2.x * cutter.axial_depth_m;
    let plain = force(&cutter, &cutter.tooth_forces(FRAC_PI_2, FEED)).y;
    assert!((tangential(FRAC_PI_2) - plain - more).abs() < 1e-9);
    assert!((tangential(FRAC_PI_2 + PI) - plain + more).abs() < 1e-9);
}

#[test]
fn without_feed_only_edges_rub_and_blunt_ones_rub_more_along_the_cut() {
    let cutter = mill();
    let bite = cutter.tooth_forces(1.0, 0.0);
    assert_eq!(force(&cutter, &bite), bite.edge * cutter.edge_n_m);
    let worn = with(&[("tool_wear", &[("growth", &[0.05])])]);
    let grown = worn.acting(&cutter, &bite, 4.0);
    assert!((grown - bite.edge * cutter.edge_n_m * 1.2).length() < 1e-12);
    assert_eq!(worn.acting(&cutter, &bite, 0.0), force(&cutter, &bite));
}

#[test]
fn turning_is_the_limit_of_one_tooth_that_stays_in_the_thickest_chip() {
    let turned = Cutter { teeth: 1, turning: true, ..mill() };
    let narrow = 1e-4;
    let grazing =
        Cutter { teeth: 1, entry_rad: FRAC_PI_2 - narrow, exit_rad: FRAC_PI_2 + narrow, ..mill() };
    let share = 2.0 * narrow / TAU;
    let limit = force(&grazing, &grazing.mean(FEED)) / share;
    let one = force(&turned, &turned.tooth_forces(2.0, FEED));
    assert!((one - limit).length() < 1e-6 * one.length(), "{one} {limit}");
    let (c, e) = (turned.chip_n_m2, turned.edge_n_m);
    let expected = (c * FEED + e) * turned.axial_depth_m;
    assert!((one - DVec3::new(-expected.y, expected.x, expected.z)).length() < 1e-12);
    let under = with(&[("runout", &[("radial", &[5e-6]), ("phase", &[0.7])])]);
    assert_eq!(
        under.acting(&turned, &turned.tooth_forces(0.0, FEED), 0.0),
        one,
        "one tooth leads none"
    );
}

#[test]
fn a_tool_that_gives_way_along_its_axis_cuts_less_deep() {
    let cutter = mill();
    let bite = cutter.tooth_forces(1.2, FEED);
    let give = 2e-6;
    let soft = with(&[("tool_compliance", &[("compliance", &[0.0, 0.0, give])])]);
    let force = soft.acting(&cutter, &bite, 0.0);
    let depth = cutter.axial_depth_m - give * force.z;
    let shallow = Cutter { axial_depth_m: depth, ..cutter };
    let expected = CutForce::default().acting(&shallow, &shallow.tooth_forces(1.2, FEED), 0.0);
    assert!((force - expected).length() < 1e-9, "{force} {expected}");
}

#[test]
fn a_sensor_reads_turned_then_leaking_then_scaled_then_off() {
    let turn = DVec3::new(0.02, -0.01, 0.03);
    let scale = [0.1, 0.0, -0.05, 0.0, 0.0, 0.0];
    let leak = [0.0, 0.04, 0.0, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0];
    let sensor = with(&[
        ("wrench_bias", &[("bias", &[1.0, 2.0, 3.0])]),
        ("wrench_scale", &[("scale", &scale)]),
        ("wrench_misalignment", &[("turn", &turn.to_array())]),
        ("cross_talk", &[("matrix", &leak)]),
    ]);
    let acting = DVec3::new(30.0, -20.0, 10.0);
    let turned = crate::frame::rotation_from_vector(turn).transpose() * acting;
    let expected = DVec3::new(
        1.0 + 1.1 * (turned.x + 0.04 * turned.y),
        2.0 + turned.y,
        3.0 + 0.95 * (turned.z + 0.01 * turned.x),
    );
    assert!((sensor.measured_force(acting) - expected).length() < 1e-12);
    assert_eq!(CutForce::default().measured_force(acting), DMat3::IDENTITY * acting);
}

#[test]
fn chatter_swings_across_the_feed_only_where_a_tooth_cuts() {
    let chatter: &[Named<'_>] = &[("chatter", &[("frequency", &[250.0]), ("amplitude", &[7.0])])];
    let cutter = Cutter { teeth: 1, ..mill() };
    let crest = at(chatter, 1e-3);
    let inside = cutter.tooth_forces(1.0, FEED);
    let swing = crest.acting(&cutter, &inside, 0.0) - force(&cutter, &inside);
    assert!((swing - DVec3::new(0.0, 7.0, 0.0)).length() < 1e-9, "{swing}");
    assert_eq!(crest.acting(&cutter, &cutter.tooth_forces(4.0, FEED), 0.0), DVec3::ZERO);
}
