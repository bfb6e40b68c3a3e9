//! Known solutions: shifts without spread, spread without shift, five values by hand, the Maxwell distribution.

use super::*;
use std::f64::consts::PI;

const COMMAND: Placement = Placement {
    position_m: DVec3::new(1.2, -0.3, 0.7),
    orientation: Some(DQuat::from_xyzw(0.5, 0.5, 0.5, 0.5)),
};

/// The commanded pose, translated (m) and rotated (rad, measuring axes).
fn displaced(shift: DVec3, turn: DVec3) -> Placement {
    Placement {
        position_m: COMMAND.position_m + shift,
        orientation: COMMAND.orientation.map(|reference| DQuat::from_scaled_axis(turn) * reference),
    }
}

fn is_close(found: f64, wanted: f64) -> bool {
    (found - wanted).abs() < 1e-12
}

fn close(found: DVec3, wanted: DVec3) -> bool {
    found.distance(wanted) < 1e-12
}

/// Quasi-random standard normal values: Box-Muller transform of Halton points.
fn normal(index: usize, pair: usize) -> [f64; 2] {
    let halton = |base: usize| {
        let (mut left, mut size, mut sum) = (index + 1, 1.0, 0.0);
        while left > 0 {
            size /= base as f64;
            sum += size * (left % base) as f64;
            left /= base;
        }
        sum
    };
    let [u, v] = [[2, 3], [5, 7]][pair].map(halton);
    let (sin, cos) = (2.0 * PI * v).sin_cos();
    let radius = (-2.0 * u.ln()).sqrt();
    [radius * cos, radius * sin]
}

#[test]
fn a_constant_offset_is_accuracy_alone() {
    let (shift, turn) = (DVec3::new(3e-4, -4e-4, 12e-4), DVec3::new(1e-3, -2e-3, 5e-4));
    let figures = pose_figures(&COMMAND, &[displaced(shift, turn); 30]).expect("figures");
    assert!(is_close(figures.accuracy_m, 13e-4) && close(figures.accuracy_xyz_m, shift));
    assert!(close(figures.accuracy_abc_rad.expect("angles"), turn));
    assert!(is_close(figures.repeatability_m, 0.0));
    assert!(close(figures.repeatability_abc_rad.expect("angles"), DVec3::ZERO));
}

#[test]
fn a_spread_about_the_command_is_repeatability_alone() {
    let ends = [DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z];
    let visits = ends.map(|end| displaced(end * 1e-4, end * 2e-3));
    let figures = pose_figures(&COMMAND, &visits).expect("figures");
    assert!(
        is_close(figures.accuracy_m, 0.0)
            && close(figures.accuracy_abc_rad.expect("angles"), DVec3::ZERO)
    );
    // All distances are equal, so their deviation is zero.
    assert!(is_close(figures.repeatability_m, 1e-4) && is_close(figures.distance_deviation_m, 0.0));
    let deviation = (2.0 * 4e-6_f64 / 5.0).sqrt();
    assert!(close(figures.repeatability_abc_rad.expect("angles"), DVec3::splat(3.0 * deviation)));
}

#[test]
fn five_numbers_give_what_the_hand_gives() {
    // Positions −2 … 2 mm on a line: distances 2, 1, 0, 1, 2; mean 1.2; sum of squares 2.8 over 4, S = √0.7.
    let visits =
        [-2.0, -1.0, 0.0, 1.0, 2.0].map(|x| displaced(DVec3::X * x * 1e-3, DVec3::Y * x * 1e-3));
    let figures = pose_figures(&COMMAND, &visits).expect("figures");
    assert_eq!(figures.visits, 5);
    assert!(is_close(figures.mean_distance_m, 1.2e-3));
    assert!(is_close(figures.distance_deviation_m, 0.7_f64.sqrt() * 1e-3));
    assert!(is_close(figures.repeatability_m, 3.709_980_079_602_2e-3));
    // Angles −2 … 2 mrad about y: sum of squares 10 over 4, 3 S = 3 √2.5.
    let angles = figures.repeatability_abc_rad.expect("angles");
    assert!(close(angles, DVec3::Y * 4.743_416_490_252_6e-3));
}

#[test]
fn normal_noise_gives_the_moments_of_maxwell() {
    let sigma = 2e-5;
    let visit = |index: usize| {
        let ([x, y], [z, _]) = (normal(index, 0), normal(index, 1));
        Placement::point(DVec3::new(x, y, z) * sigma)
    };
    let visits: Vec<Placement> = (0..20_000).map(visit).collect();
    let figures = pose_figures(&Placement::point(DVec3::ZERO), &visits).expect("figures");
    let wanted = (8.0 / PI).sqrt() + 3.0 * (3.0 - 8.0 / PI).sqrt();
    assert!(
        (figures.repeatability_m / sigma - wanted).abs() < 0.02,
        "{}",
        figures.repeatability_m / sigma
    );
    assert!(figures.accuracy_m < 0.01 * sigma);
    assert_eq!((figures.accuracy_abc_rad, figures.repeatability_abc_rad), (None, None));
}

#[test]
fn another_frame_gives_the_same_figures() {
    let visits: Vec<Placement> = (0..30)
        .map(|index| {
            let ([x, y], [z, a]) = (normal(index, 0), normal(index, 1));
            displaced(DVec3::new(x, y, z) * 1e-4, DVec3::new(a, x, y) * 1e-3)
        })
        .collect();
    let turn = DQuat::from_scaled_axis(DVec3::new(0.4, -1.0, 2.0));
    let moved = |visit: &Placement| Placement {
        position_m: turn * visit.position_m + DVec3::new(3.0, -2.0, 1.0),
        orientation: visit.orientation.map(|orientation| turn * orientation),
    };
    let figures = pose_figures(&COMMAND, &visits).expect("figures");
    let moved_figures =
        pose_figures(&moved(&COMMAND), &visits.iter().map(moved).collect::<Vec<_>>())
            .expect("figures");
    assert!(
        is_close(figures.accuracy_m, moved_figures.accuracy_m)
            && is_close(figures.repeatability_m, moved_figures.repeatability_m)
    );
    assert!(close(
        turn * figures.accuracy_abc_rad.expect("angles"),
        moved_figures.accuracy_abc_rad.expect("angles")
    ));
}

#[test]
fn the_sign_of_a_quaternion_means_nothing() {
    let mut visits = [displaced(DVec3::ZERO, DVec3::Z * 1e-3); 4];
    visits[1].orientation = visits[1].orientation.map(|orientation| -orientation);
    let figures = pose_figures(&COMMAND, &visits).expect("figures");
    assert!(close(figures.accuracy_abc_rad.expect("angles"), DVec3::Z * 1e-3));
    assert!(close(figures.repeatability_abc_rad.expect("angles"), DVec3::ZERO));
}

#[test]
fn drift_is_against_the_first_cycle() {
    let cycle = |place: DVec3, half: f64| {
        [
            displaced(place + DVec3::Z * half, DVec3::ZERO),
            displaced(place - DVec3::Z * half, DVec3::ZERO),
        ]
    };
    let cold = cycle(DVec3::X * 3e-4, 1e-5);
    let warm = cycle(DVec3::X * 1e-4, 3e-5);
    let found = drift(&COMMAND, &[&cold, &warm]).expect("figures");
    assert!(is_close(found.accuracy_m, 2e-4) && is_close(found.travel_m, 2e-4));
    assert!(is_close(found.repeatability_m, 2e-5), "two visits at one distance: l̄ alone");
    // On the opposite side of the command: the accuracy is unchanged, the barycentre is not.
    let round = cycle(-DVec3::X * 3e-4, 1e-5);
    let found = drift(&COMMAND, &[&cold, &warm, &round]).expect("figures");
    assert!(is_close(found.accuracy_m, 2e-4) && is_close(found.travel_m, 6e-4));
}

#[test]
fn a_distance_that_is_too_long_is_its_accuracy_and_its_scatter_its_repeatability() {
    let command = [Placement::point(DVec3::ZERO), Placement::point(DVec3::new(0.3, -0.4, 0.0))];
    // 0.5 m commanded; 501, 502, 503 mm attained, along the line: mean 502, S = 1 mm.
    let pair = |scale: f64| [command[0], Placement::point(command[1].position_m * scale)];
    let found =
        distance_figures(command, &[pair(1.002), pair(1.004), pair(1.006)]).expect("figures");
    assert!(is_close(found.accuracy_m, 2e-3) && is_close(found.repeatability_m, 3e-3));
    assert!(close(found.accuracy_xyz_m, DVec3::new(1.2e-3, 1.6e-3, 0.0)));
    assert!(close(found.repeatability_xyz_m, DVec3::new(1.8e-3, 2.4e-3, 0.0)));
    assert_eq!((found.accuracy_abc_rad, found.visits), (None, 3));
    // A common shift of both ends does not change the distance.
    let shifted = |by: f64| command.map(|end| Placement::point(end.position_m + DVec3::splat(by)));
    let found = distance_figures(command, &[shifted(0.1), shifted(-0.7)]).expect("figures");
    assert!(is_close(found.accuracy_m, 0.0) && is_close(found.repeatability_m, 0.0));
}

#[test]
fn the_turn_between_two_poses_is_held_against_the_commanded_one() {
    let command = [COMMAND, displaced(DVec3::X * 0.2, DVec3::Z * 0.3)];
    let pair = |c: f64| [COMMAND, displaced(DVec3::X * 0.2, DVec3::Z * (0.3 + c))];
    let found = distance_figures(command, &[pair(1e-3), pair(3e-3)]).expect("figures");
    assert!(close(found.accuracy_abc_rad.expect("angles"), DVec3::Z * 2e-3));
    assert!(close(found.repeatability_abc_rad.expect("angles"), DVec3::Z * 3.0 * 2e-6_f64.sqrt()));
}

#[test]
fn what_gives_no_figures_says_why() {
    assert_eq!(pose_figures(&COMMAND, &[COMMAND]), Err(IsoError::Visits(1)));
    assert_eq!(drift(&COMMAND, &[]), Err(IsoError::Groups(0)));
    assert_eq!(distance_figures([COMMAND; 2], &[]), Err(IsoError::Visits(0)));
    let lost = Placement::point(DVec3::new(f64::NAN, 0.0, 0.0));
    assert_eq!(pose_figures(&COMMAND, &[COMMAND, lost]), Err(IsoError::NotFinite { visit: 2 }));
    let long = Placement { orientation: Some(DQuat::from_xyzw(0.0, 0.0, 0.0, 1.1)), ..COMMAND };
    assert_eq!(pose_figures(&long, &[COMMAND, COMMAND]), Err(IsoError::NoRotation { visit: 0 }));
    assert!(IsoError::Visits(1).to_string().contains("30"));
}
