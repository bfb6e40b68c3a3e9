//! Even rows, rests at both ends, and refused recordings.

use super::*;

fn recording(times_s: &[f64], position: impl Fn(f64) -> f64) -> Recording {
    let mut recording = Recording::new(times_s.to_vec());
    recording.set(Channel::Command(0), times_s.iter().map(|t_s| position(*t_s)).collect());
    recording
}

#[test]
fn even_rows_stay_as_they_are_between_rests() {
    let times_s: Vec<f64> = (0..50).map(|k| 1.0 + f64::from(k) * 4e-3).collect();
    let path = recording(&times_s, |t_s| t_s * t_s);
    let extended = extend(&path, &[JointKind::Revolute], 0.1).expect("a path");
    assert!(!extended.is_resampled);
    assert_eq!(extended.lead_rows, 25);
    let q = extended.recording.column(Channel::Command(0)).expect("commands");
    assert_eq!(q[25..75], *path.column(Channel::Command(0)).expect("commands"));
    assert!(q[..25].iter().all(|position| *position == q[25]));
    assert!(q[75..].iter().all(|position| *position == q[74]));
    let steps = extended.recording.t_s.windows(2).map(|t| t[1] - t[0]);
    assert!(steps.into_iter().all(|step| (step - 4e-3).abs() < 1e-9));
}

#[test]
fn uneven_rows_are_resampled_and_this_is_reported() {
    let times_s: Vec<f64> =
        (0..200).map(|k| f64::from(k) * 4e-3 + if k % 3 == 0 { 1e-3 } else { 0.0 }).collect();
    let path = recording(&times_s, |t_s| (3.0 * t_s).sin());
    let extended = extend(&path, &[JointKind::Revolute], 0.0).expect("a path");
    assert!(extended.is_resampled);
    let q = extended.recording.column(Channel::Command(0)).expect("commands");
    let last_s = times_s[times_s.len() - 1];
    for (t_s, q) in extended.recording.t_s.iter().zip(q).filter(|(t_s, _)| **t_s < last_s) {
        assert!((q - (3.0 * t_s).sin()).abs() < 1e-6, "{t_s}");
    }
}

#[test]
fn a_gap_is_refused_with_its_row_and_no_motion_is_invented() {
    let mut times_s: Vec<f64> = (0..200).map(|k| f64::from(k) * 4e-3).collect();
    times_s[150..].iter_mut().for_each(|t_s| *t_s += 60.0);
    let path = recording(&times_s, |t_s| (3.0 * t_s).sin());
    let refused = extend(&path, &[JointKind::Revolute], 0.0).expect_err("a gap");
    let FeedforwardError::Gap { at, gap_s, .. } = refused else { panic!("{refused}") };
    assert_eq!(at.row, 151);
    assert!((gap_s - 60.004).abs() < 1e-9, "{gap_s}");
    // A last time stamp far away must not take memory.
    times_s.iter_mut().for_each(|t_s| *t_s = t_s.min(1.0));
    times_s[199] = 1e15;
    assert!(extend(&recording(&times_s, |_| 0.0), &[JointKind::Revolute], 0.0).is_err());
}

#[test]
fn anything_but_a_single_path_is_refused() {
    let times_s: Vec<f64> = (0..50).map(|k| f64::from(k) * 4e-3).collect();
    let kinds = [JointKind::Revolute];
    let mut two = recording(&times_s, |t_s| t_s);
    two.segment[30..].fill(1);
    assert_eq!(extend(&two, &kinds, 0.1), Err(FeedforwardError::Segments(2)));
    let mut poses = recording(&times_s, |t_s| t_s);
    poses.metadata.kind = RecordingKind::Poses;
    assert_eq!(extend(&poses, &kinds, 0.1), Err(FeedforwardError::Poses));
    let gap = recording(&times_s, |t_s| if t_s == 0.04 { f64::NAN } else { t_s });
    let missing = extend(&gap, &kinds, 0.1).expect_err("a sample is missing");
    let FeedforwardError::NoCommand { at, joint: 1 } = missing else { panic!("{missing}") };
    assert_eq!((at.row, at.t_s), (11, 0.04));
    let short = recording(&times_s[..5], |t_s| t_s);
    assert_eq!(extend(&short, &kinds, 0.1), Err(FeedforwardError::TooShort(5)));
}

#[test]
fn rows_are_those_of_the_file_in_spite_of_rest_and_of_other_times() {
    let even: Vec<f64> = (0..50).map(|k| f64::from(k) * 4e-3).collect();
    let uneven: Vec<f64> = even.iter().map(|t_s| t_s + 1.5e-3 * (700.0 * t_s).sin()).collect();
    for times_s in [even, uneven] {
        let path = extend(&recording(&times_s, |t_s| t_s), &[JointKind::Revolute], 0.1).unwrap();
        let row_at = |t_s: f64| path.source.at(t_s);
        assert!(path.lead_rows > 20);
        assert_eq!((row_at(path.recording.t_s[0]).row, row_at(9e9).row), (1, 50));
        for (row, t_s) in times_s.iter().enumerate() {
            assert_eq!(row_at(*t_s).row, row + 1);
        }
    }
}
