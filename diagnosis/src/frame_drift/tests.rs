//! A drifting tracker that measures a tool and three reference targets on the base.

use super::*;
use physics::frame::rotation_from_vector;
use proptest::prelude::*;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;

const ROWS: usize = 400;
/// Standard deviation of a reference target's coordinate, m.
const NOISE_M: f64 = 3e-6;

/// Positions of the reference targets, tracker frame, m.
fn places() -> [DVec3; 3] {
    [DVec3::new(2.4, 0.5, -0.5), DVec3::new(2.9, 0.8, -0.5), DVec3::new(2.7, 0.0, -0.6)]
}

/// A point of the tool in the frame of a tracker at rest, m.
fn tool(row: usize) -> DVec3 {
    let t = 0.1 * row as f64;
    DVec3::new(2.6 + 0.3 * t.sin(), 0.2 + 0.4 * (1.3 * t).cos(), 0.2 * (0.7 * t).sin())
}

/// Measurements in each row by a tracker whose drift is `seen_from_still`.
fn recording_from(seen_from_still: impl Fn(usize) -> Frame) -> Recording {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut normal = || rng.sample::<f64, _>(StandardNormal);
    let mut made = Recording::new((0..ROWS).map(|row| row as f64).collect());
    let mut columns = vec![Vec::new(); 12];
    for row in 0..ROWS {
        let wander = seen_from_still(row);
        let noisy = places()
            .map(|place| wander.point(place) + NOISE_M * DVec3::new(normal(), normal(), normal()));
        let points = [[wander.point(tool(row))].as_slice(), &noisy].concat();
        let values = points.iter().flat_map(DVec3::to_array);
        columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
    }
    for (k, column) in columns.into_iter().enumerate() {
        made.set(Channel::Target(k / 3, k % 3), column);
    }
    made.metadata.targets_on_link.extend([(1, 0), (2, 0), (3, 0)]);
    made
}

/// Drift over hours of a warming stand: 60 µm and 30 µrad.
fn warming(row: usize) -> Frame {
    let share = row as f64 / ROWS as f64;
    let turn = DVec3::new(1e-5, -2e-5, 3e-5) * (3.0 * share).sin();
    Frame::new(rotation_from_vector(turn), DVec3::new(5e-5, 0.0, -3e-5) * share)
}

fn at(recording: &Recording, target: usize, row: usize) -> DVec3 {
    let value = |axis| recording.column(Channel::Target(target, axis)).expect("there")[row];
    DVec3::from_array([0, 1, 2].map(value))
}

/// Remaining drift of the tool position, apart from one rigid motion of all rows: root mean square distance, m.
fn left(recording: &Recording, nests: &FrameDrift) -> f64 {
    let laid: Vec<DVec3> =
        (0..ROWS).map(|row| nests.common_from_measured(row).point(at(recording, 0, row))).collect();
    let still: Vec<DVec3> = (0..ROWS).map(tool).collect();
    rms_distance(&fit_rigid_motion(&still, &laid).expect("enough points"), &still, &laid)
}

#[test]
fn a_tracker_that_wanders_reads_as_one_that_stands_still() {
    let recording = recording_from(warming);
    let nests = FrameDrift::of(&recording).expect("three nests");
    assert!(left(&recording, &nests) < NOISE_M, "{:e}", left(&recording, &nests));
    assert!(nests.drift_m > 2e-5 && nests.inconsistent_rows.is_empty(), "{nests:?}");
}

#[test]
fn a_step_of_the_stand_is_not_smeared_over_the_rows_around_it() {
    let kicked =
        |row| Frame::new(glam::DMat3::IDENTITY, DVec3::X * if row < 200 { 0.0 } else { 2e-4 });
    let recording = recording_from(kicked);
    let nests = FrameDrift::of(&recording).expect("three nests");
    assert_eq!(nests.averaged_rows, 1);
    assert!(left(&recording, &nests) < 1e-5);
}

#[test]
fn nests_of_a_tracker_that_stands_still_add_less_than_a_third_of_their_own_noise() {
    let recording = recording_from(|_| Frame::IDENTITY);
    let nests = FrameDrift::of(&recording).expect("three nests");
    assert!(nests.averaged_rows >= 81, "{}", nests.averaged_rows);
    assert!(left(&recording, &nests) < NOISE_M / 3.0);
}

#[test]
fn a_nest_taken_for_another_says_nothing_and_its_neighbours_speak_for_it() {
    let mut recording = recording_from(warming);
    let sound = left(&recording, &FrameDrift::of(&recording).expect("three nests"));
    for row in [50, 51, 300] {
        let (first, second) = (at(&recording, 1, row), at(&recording, 2, row));
        for axis in 0..3 {
            for (target, value) in [(1, second[axis]), (2, first[axis])] {
                let channel = Channel::Target(target, axis);
                let mut column = recording.column(channel).expect("there").to_vec();
                column[row] = value;
                recording.set(channel, column);
            }
        }
    }
    let nests = FrameDrift::of(&recording).expect("three nests");
    assert_eq!(nests.inconsistent_rows, [50, 51, 300]);
    assert!(left(&recording, &nests) < 1.5 * sound);
}

#[test]
fn nests_that_are_read_now_and_then_tell_of_the_rows_between() {
    let mut recording = recording_from(warming);
    for target in 1..4 {
        for axis in 0..3 {
            let channel = Channel::Target(target, axis);
            let column = recording.column(channel).expect("there").to_vec();
            let thin = |(row, x): (usize, f64)| if row % 40 == 0 { x } else { f64::NAN };
            recording.set(channel, column.into_iter().enumerate().map(thin).collect());
        }
    }
    let nests = FrameDrift::of(&recording).expect("three nests");
    let untouched = FrameDrift { laid_from_seen: Vec::new(), ..nests.clone() };
    let (with, without) = (left(&recording, &nests), left(&recording, &untouched));
    assert!(with < 0.6 * without, "{with:e} of {without:e}");
    // No step between adjacent rows, although rows are averaged.
    let step = |row: usize| {
        let [a, b] = [row, row + 1].map(|row| nests.common_from_measured(row).point(tool(0)));
        (a - b).length()
    };
    assert!((0..ROWS - 1).map(step).fold(0.0, f64::max) < 2e-6);
}

#[test]
fn each_station_has_a_frame_of_its_own() {
    let moved_station = Frame::new(rotation_from_vector(DVec3::Z), DVec3::new(-3.0, 1.0, 0.4));
    let mut recording =
        recording_from(|row| if row < 200 { Frame::IDENTITY } else { moved_station });
    let station = |row| if row < 200 { 1.0 } else { 2.0 };
    recording.set(Channel::Station, (0..ROWS).map(station).collect());
    let nests = FrameDrift::of(&recording).expect("three nests");
    assert!(nests.drift_m < 1e-5, "{nests:?}");
}

#[test]
fn two_nests_or_nests_on_a_line_lay_nothing() {
    let mut recording = recording_from(warming);
    recording.metadata.targets_on_link.insert(3, 1);
    assert!(FrameDrift::of(&recording).is_none());
    let mut recording = recording_from(warming);
    for axis in 0..3 {
        let middle = |row| 0.5 * (at(&recording, 1, row) + at(&recording, 2, row))[axis];
        let column = (0..ROWS).map(middle).collect();
        recording.set(Channel::Target(3, axis), column);
    }
    lay_nothing_and_say_so(&recording);
}

fn lay_nothing_and_say_so(recording: &Recording) {
    let nests = FrameDrift::of(recording).expect("reference targets are stated");
    let still = (0..recording.len()).all(|row| nests.common_from_measured(row) == Frame::IDENTITY);
    assert!(
        still && nests.description().contains("do not define a measuring frame"),
        "{}",
        nests.description()
    );
}

#[test]
fn rows_that_all_contradict_each_other_lay_nothing() {
    // In each row one of `count` reference targets is far off: with three targets most distances change; with five few do, but some in every row.
    for count in [3, 5] {
        let mut made = Recording::new((0..40).map(f64::from).collect());
        for k in 0..3 * count {
            let place = ((7 * k) % 11) as f64;
            let value_at =
                |row: usize| place + if row % count == k / 3 { 1.0 + row as f64 } else { 0.0 };
            made.set(Channel::Target(k / 3, k % 3), (0..40).map(value_at).collect());
            made.metadata.targets_on_link.insert(k / 3, 0);
        }
        lay_nothing_and_say_so(&made);
    }
}

proptest! {
    #[test]
    fn no_numbers_make_it_panic_or_move_a_reading_to_nowhere(
        values in prop::collection::vec(prop_oneof![Just(f64::NAN), Just(0.0), -1e9..1e9_f64], 9..120),
        station in 0..3_usize,
    ) {
        let rows = values.len() / 9;
        let mut made = Recording::new((0..rows).map(|row| row as f64).collect());
        for k in 0..9 {
            made.set(Channel::Target(k / 3, k % 3), (0..rows).map(|row| values[9 * row + k]).collect());
        }
        made.set(Channel::Station, (0..rows).map(|row| (row % (station + 1)) as f64).collect());
        made.metadata.targets_on_link.extend([(0, 0), (1, 0), (2, 0)]);
        if let Some(nests) = FrameDrift::of(&made) {
            for row in 0..rows {
                prop_assert!(nests.common_from_measured(row).point(DVec3::ONE).is_finite());
            }
        }
    }
}
