//! The controller for `ros2_control`, against stub headers of ROS 2 and against the real daemon.
//! Agreement with ROS 2's own headers is not tested.

use super::{LIMIT, beside, can_build, scratch, started};
use std::process::Stdio;
use tests::clients::{Language, Prefix, figures, has, root, skipped};
use tests::process::Process;

/// The envelope's angle unless a cell sets it, rad.
const ENVELOPE: f64 = 0.02;

#[test]
fn a_chained_controller_passes_corrected_positions_on_and_ramps_out_when_the_daemon_dies() {
    if !can_build(Language::Cpp, "ros2_control") {
        return;
    }
    if !has("ros2") {
        skipped(
            scratch(),
            "ros2_control by ROS 2's own headers",
            "no ROS 2: compiled against stubs",
        );
    }
    let prefix = Prefix::install("ros2");
    let folder = root().join("client/ros2");
    let sources = ["src/trued_controller.cpp", "test/drive.cpp"].map(|name| folder.join(name));
    let headers = ["include", "test/stubs"].map(|name| folder.join(name));
    let program = prefix.build_of(Language::Cpp, &sources, &headers, "drive");

    let (place, mut daemon) = started("full", "[cycle]\nstale_ms = 100.0\n", &[]);
    let mut driven = Process::start(program.to_str().unwrap(), &[tests::place::CELL], &place);
    assert!(driven.wait_for_output("corrected", LIMIT), "{:?}", driven.lines());
    daemon.kill();
    assert!(driven.wait_for_output("out", LIMIT), "{:?}", driven.lines());
    assert!(driven.close_input().success());
    let lines = driven.lines().join("\n");
    let figure = |name: &str| -> f64 {
        let line = lines.lines().find_map(|line| line.strip_prefix(name)).expect("a figure");
        line.trim().parse().unwrap()
    };
    assert_eq!(figure("faults"), 0.0, "{lines}");
    assert!((1e-4..=ENVELOPE).contains(&figure("largest")), "{lines}");

    // Without a daemon it does not start, and reports why.
    let alone = beside(&place, &program).stdin(Stdio::null()).output().unwrap();
    assert!(!alone.status.success() && figures(&alone).is_empty());
    assert!(String::from_utf8_lossy(&alone.stderr).contains("daemon"), "{alone:?}");
}
