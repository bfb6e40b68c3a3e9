//! Pages of moments: the verdict, and that the numbers are those of the status.

use super::*;
use crate::history::{History, HistoryPosition};
use shm_schema::{Spectrum, Status, Verdict, monotonic_ns};

const NOW_MS: u64 = 1_700_000_000_000;

fn moment(status: Status, history: &History) -> SnapshotPage {
    let report = Report::new("mill", &status, None);
    let cell_state = Arc::new(CellState { report, status, robot: None });
    SnapshotPage {
        cell_state,
        entries: history.since(&mut HistoryPosition::default()),
        now_ms: NOW_MS,
    }
}

/// A cell that corrects: joint 2 by a quarter of its limit.
fn running() -> Status {
    let now_ns = monotonic_ns();
    let mut status =
        Status { t_ns: now_ns, started_ns: 1, health: 2, mode: 2, joints: 6, ..Status::default() };
    status.bounds.angle = [0.02; 16];
    status.correction[1] = -0.005;
    (status.commands, status.rejected) = (12_345, 3);
    status
}

/// Ten seconds of force with a tone, and its vibration event in the given states.
fn rung(states: &[u32]) -> History {
    let mut history = History::default();
    let mut spectrum = Spectrum { bins: 100, first_hz: 10.0, bin_hz: 5.0, ..Spectrum::default() };
    spectrum.amplitude_n[..100].fill(0.01);
    spectrum.amplitude_n[20] = 4.0;
    (0..100).for_each(|k| history.add_spectrum(NOW_MS - 10_000 + 100 * k, &spectrum));
    for (k, state) in states.iter().enumerate() {
        let verdict = Verdict {
            event: 1,
            state: *state,
            class: 2,
            frequency_hz: 110.0,
            amplitude: 4.0,
            ..Verdict::default()
        };
        history.add_verdict(NOW_MS - 5000 + 1000 * k as u64, &verdict);
    }
    history
}

#[test]
fn a_page_says_what_the_status_says_and_is_named_by_cell_and_time() {
    let moment = moment(running(), &History::default());
    assert_eq!(moment.file_name(), "mill-20231114-221320.html");
    let page = moment.html();
    for part in [
        "Cell mill: running, mode full",
        "25 % of its limit (joint 2)",
        "12345",
        "No force samples",
        "2023-11-14 22:13:20 UTC",
        &moment.cell_state.report.model.hash,
    ] {
        assert!(page.contains(part), "{part}");
    }
    assert!(!page.contains("<script") && !page.contains("http://1") && !page.contains("https://"));
}

#[test]
fn a_vibration_alarm_is_the_verdict_while_it_lasts_and_a_remark_when_it_is_over() {
    let mut status = running();
    (status.verdict.state, status.verdict.class, status.verdict.frequency_hz) = (2, 2, 110.0);
    let lasts = moment(status, &rung(&[1, 2])).html();
    assert!(lasts.contains("Cell mill: vibration alarm"));
    assert!(lasts.contains(">110 Hz chatter<"), "outlined in the picture");
    let command = lasts.replace("<span>", "").replace("</span>", "").replace("&#39;", "'");
    assert!(command.contains("trued mark 'vibration alarm' mill"));
    let over = moment(running(), &rung(&[1, 2, 0])).html();
    assert!(
        over.contains("1 vibration alarm in the last five minutes, the last at 110 Hz chatter")
    );
    let warned = moment(running(), &rung(&[1, 0])).html();
    assert!(warned.contains("No action is needed") && warned.contains("warning, over"));
}

#[test]
fn a_cell_that_does_not_correct_is_not_good_and_the_command_says_what_to_do() {
    for (change, label, command) in [
        (Status { bypassed: 1, ..running() }, "bypassed", "trued bypass off mill"),
        (Status { mode: 0, ..running() }, "idle", "trued mode limited mill"),
        (Status { health: 3, ..running() }, "degraded", "trued status mill"),
        (Status { health: 4, ..running() }, "fault", "trued status mill"),
        (Status { t_ns: 1, ..running() }, "no status", "trued status mill"),
    ] {
        let status = if label == "idle" { Status { health: 1, ..change } } else { change };
        let page = moment(status, &History::default()).html();
        assert!(page.contains(&format!("Cell mill: {label}")), "{label}");
        assert!(page.contains(command), "{command}");
        assert!(!page.contains("verdict good"), "{label}");
    }
}

#[test]
fn the_period_is_that_of_moving_commands_and_a_new_daemon_does_not_disturb_it() {
    let latency = |t_ms: u64, commands: u64| Latency {
        t_ms,
        p99_us: 1.0,
        counted: (t_ms * 1_000_000, commands),
    };
    let latency = [
        latency(0, 1000),
        latency(500, 1125),
        latency(1000, 1250),
        latency(1500, 1250),
        latency(2000, 0),
        latency(2500, 125),
    ];
    assert!((period_s(&latency).expect("a period") - 0.004).abs() < 1e-9);
    assert_eq!(period_s(&latency[..1]), None);
}
