//! Peak memory with a long recording. The test has its own process, since the kernel reports the peak of the whole process.

use diagnosis::diagnose::{ThinnedRecordings, screen_recordings};
use recording::model::presets::preset;
use recording::series::{Channel, Recording};

const ROWS: usize = 1_000_000;

/// Peak resident memory of this process, MB; `None` if the kernel does not report it.
fn most_mb() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().trim_end_matches("kB").trim().parse::<u64>().ok()? / 1024)
}

/// The ten columns of the recording take 80 MB; one pose per row would take more than a gigabyte.
#[test]
fn of_a_million_rows_only_those_that_are_looked_at_become_poses() {
    let arm = preset("irb1600-6-145").expect("preset").model().expect("sound").physics.arm;
    let time = |row: usize| row as f64 * 2e-3;
    let mut recording = Recording::new((0..ROWS).map(time).collect());
    for joint in 0..6 {
        let rate = 0.2 + 0.1 * joint as f64;
        recording
            .set(Channel::Command(joint), (0..ROWS).map(|k| libm::sin(rate * time(k))).collect());
    }
    for axis in 0..3 {
        let rate = 0.2 + 0.1 * axis as f64;
        recording
            .set(Channel::Position(axis), (0..ROWS).map(|k| libm::cos(rate * time(k))).collect());
    }
    let mut one = [recording];
    let report = screen_recordings(&arm, &mut one);
    assert!(report.doubts.is_empty(), "{report:?}");
    let thinned = ThinnedRecordings::select(&arm, &one).expect("usable");
    assert!(thinned.moves && thinned.rows == ROWS, "{}", thinned.rows);
    let read = thinned.campaign.poses.iter().filter(|pose| !pose.seen.is_empty()).count();
    assert!((2_900..3_100).contains(&read), "{read}");
    match most_mb() {
        Some(most) => assert!(most < 400, "{most} MB"),
        None => println!("SKIPPED: this kernel does not tell how much memory a process held"),
    }
}
