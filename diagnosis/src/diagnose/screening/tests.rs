//! An oscillating joint measured by a tracker, with one fault at a time.

use super::*;
use crate::test_campaigns::nominal_robot;
use glam::{DMat3, DVec3};
use physics::{Chain, Joints};

const ROWS: usize = 600;

/// A path of three joints, measured in a rotated frame with noise of 20 µm.
fn simulated_recording() -> Recording {
    let arm = nominal_robot().arm;
    let mut made = Recording::new((0..ROWS).map(|row| 0.01 * row as f64).collect());
    let swing = |joint: usize, t: f64| match joint {
        0 => 0.8 * (1.1 * t).sin(),
        1 => 0.4 * (1.7 * t).sin(),
        4 => 0.5 + 0.5 * (2.3 * t).cos(),
        _ => 0.0,
    };
    let mut points: [Vec<f64>; 3] = Default::default();
    let mut chance = 1_u64;
    for row in 0..ROWS {
        let mut q = Joints::default();
        (0..6).for_each(|joint| q[joint] = swing(joint, 0.01 * row as f64));
        let turned = DMat3::from_rotation_z(0.7) * DMat3::from_rotation_x(0.2);
        let position = turned * Chain::nominal(&arm, &q).base_from_tool.origin + DVec3::splat(0.3);
        for (axis, column) in points.iter_mut().enumerate() {
            chance = chance.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let noise = (chance >> 33) as f64 / 2.0_f64.powi(31) - 0.5;
            column.push(position[axis] + 7e-5 * noise);
        }
    }
    for joint in 0..6 {
        let column = made.t_s.iter().map(|t| swing(joint, *t)).collect();
        made.set(Channel::Command(joint), column);
    }
    for (axis, column) in points.into_iter().enumerate() {
        made.set(Channel::Position(axis), column);
    }
    made.units = recording::series::FileUnits::WORKSHOP;
    made
}

fn changed(axis: usize, change: impl Fn(usize, f64) -> f64) -> Recording {
    let mut made = simulated_recording();
    let column = made.column(Channel::Position(axis)).expect("there");
    let column = column.iter().enumerate().map(|(row, x)| change(row, *x)).collect();
    made.set(Channel::Position(axis), column);
    made
}

fn screened(recording: Recording) -> (ScreeningReport, Recording) {
    let mut all = [recording];
    let report = screen_recordings(&nominal_robot().arm, &mut all);
    let [recording] = all;
    (report, recording)
}

fn left(recording: &Recording, axis: usize) -> usize {
    let column = recording.column(Channel::Position(axis)).expect("there");
    column.iter().filter(|value| value.is_finite()).count()
}

#[test]
fn of_a_sound_recording_nothing_is_said_and_nothing_taken() {
    let (report, after) = screened(simulated_recording());
    assert_eq!(report, ScreeningReport::default());
    assert_eq!(after, simulated_recording());
}

#[test]
fn a_channel_that_freezes_half_way_takes_no_part_from_there_on() {
    let frozen = simulated_recording().column(Channel::Position(1)).expect("there")[300];
    let (report, after) = screened(changed(1, |row, x| if row < 300 { x } else { frozen }));
    assert_eq!(left(&after, 1), 300);
    assert_eq!((left(&after, 0), left(&after, 2)), (ROWS, ROWS));
    let note = &report.notes[0];
    assert!(note.contains("y_mm is constant") && note.contains("(300 rows)"), "{note}");
    assert!(note.contains("between 3.000 s and 5.990 s"), "{note}");
}

#[test]
fn a_channel_at_its_largest_value_is_cut_off_there() {
    let column = simulated_recording().column(Channel::Position(0)).expect("there").to_vec();
    let most = column.iter().copied().fold(f64::MIN, f64::max) - 0.05;
    let beyond = column.iter().filter(|x| **x > most).count();
    let (report, after) = screened(changed(0, |_, x| x.min(most)));
    assert!(report.notes[0].contains("x_mm is clipped"), "{:?}", report.notes);
    assert_eq!(left(&after, 0), ROWS - beyond);
}

#[test]
fn an_arm_that_rests_may_leave_a_channel_as_it_is() {
    let mut made = simulated_recording();
    for channel in (0..6).map(Channel::Command).chain((0..3).map(Channel::Position)) {
        let column = made.column(channel).expect("there").to_vec();
        made.set(
            channel,
            column
                .iter()
                .enumerate()
                .map(|(k, x)| if (200..300).contains(&k) { column[200] } else { *x })
                .collect(),
        );
    }
    let (report, after) = screened(made.clone());
    assert_eq!(report, ScreeningReport::default());
    assert_eq!(after, made);
}

#[test]
fn a_tool_that_never_moves_while_the_arm_does_leaves_nothing_to_judge() {
    let mut made = simulated_recording();
    (0..3).for_each(|axis| made.set(Channel::Position(axis), vec![0.4; ROWS]));
    let (report, _) = screened(made);
    assert!(report.doubts[0].contains("x_mm, y_mm, z_mm never change"), "{report:?}");
}

#[test]
fn held_values_count_once_and_coarse_ones_are_said() {
    let mut made = simulated_recording();
    for axis in 0..3 {
        let column = made.column(Channel::Position(axis)).expect("there").to_vec();
        made.set(Channel::Position(axis), (0..ROWS).map(|row| column[row - row % 5]).collect());
    }
    let (report, after) = screened(made);
    assert!(report.notes[0].contains("the sampling rate of the instrument is lower"), "{report:?}");
    assert_eq!(left(&after, 0), ROWS / 5);
    let (report, after) = screened(changed(2, |_, z| (z * 1e3).round() / 1e3));
    assert!(report.notes[0].contains("z_mm has a resolution of 1.000e0"), "{report:?}");
    assert_eq!(left(&after, 2), ROWS);
}

#[test]
fn gaps_and_uneven_stamps_and_missing_rows_are_said() {
    let mut made = simulated_recording();
    for (row, t) in made.t_s.iter_mut().enumerate() {
        *t += if row % 2 == 0 { 2e-3 } else { 0.0 } + if row < 400 { 0.0 } else { 3.0 };
    }
    let mut column = made.column(Channel::Position(0)).expect("there").to_vec();
    column[7..27].fill(f64::NAN);
    made.set(Channel::Position(0), column);
    let notes = screened(made).0.notes.join("\n");
    assert!(notes.contains("time has 1 gap") && notes.contains("not evenly spaced"), "{notes}");
    assert!(notes.contains("x_mm, y_mm, z_mm is missing in 20 of 600 rows"), "{notes}");
}
