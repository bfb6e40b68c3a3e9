//! The page of the demo: key figures, path error before and after, correction per joint, missing effect, latency, vibration.

use report::{
    Axis, Column, Histogram, Multiples, Number, Page, Plot, Role, Series, Table, Tone, significant,
};

use crate::log::{CellLog, LogRow};
use crate::outcome::{MillingResult, Report};
use crate::scene::Scene;

/// The whole page; `again`: the same path with the findings, if the model was replaced.
pub(crate) fn render(
    scene: &Scene,
    report: &Report,
    log: &CellLog,
    again: Option<&CellLog>,
) -> Page {
    let milled = &report.milled;
    let rows = log.rows.get(scene.dwell..).unwrap_or(&[]);
    Page::new("Accuracy with and without correction")
        .kicker("trued demo: a simulated cell")
        .robot(format!("{}, simulated", milled.robot))
        .verdict(tone(report), verdict_label(report), &sentence(scene, report))
        .numbers(numbers(report))
        .figure(
            "Distance of the true tool centre point from the commanded path, both measured on the true robot.",
            &error_over_time(rows, again.map(|log| log.rows.as_slice())).render(),
        )
        .next(
            "Diagnose a recording of your own robot: joint positions and measurements of its tool.",
            Some("trued diagnose --model ROBOT.toml RECORDING.csv"),
        )
        .section("Tool error")
        .table(&errors(report))
        .figure("Distribution of the tool error.", &histogram(rows).render())
        .section("Corrections")
        .figure("Published target minus command, joint by joint.", &corrections(scene, rows).render())
        .section("Diagnosis")
        .text("The robot was measured, the recording was diagnosed, and the resulting model was loaded into the running daemon. Result:")
        .list(&report.diagnosis.says)
        .text(&format!("True effect, revealed afterwards: {}", report.diagnosis.truth))
        .section("Latency")
        .text(
            "Time from sending the command to receiving the corrected target, between two processes on this computer. A desktop or \
             virtual machine does not have a real-time kernel: its latency tail is not representative of a controller.",
        )
        .figure("Round trip over shared memory.", &latency(log).render())
        .section("Chatter")
        .text(&format!("The daemon receives force samples at 10 kHz. Simulated chatter: {}.", milled.ringing.words))
        .figure("Force on the tool during the chatter, tool axes.", &force(scene, log).render())
        .table(&events(milled))
        .footer("The recording in the folder of this page contains every cycle.")
}

fn tone(report: &Report) -> Tone {
    if report.diagnosis.named_right { Tone::Good } else { Tone::Caution }
}

fn verdict_label(report: &Report) -> &'static str {
    if report.diagnosis.named_right {
        "corrected, hidden effect identified"
    } else {
        "corrected, hidden effect not identified"
    }
}

fn sentence(scene: &Scene, report: &Report) -> String {
    let errors = &report.milled.tool_error_mm;
    let [without, with] = [errors.without.mean, errors.with.mean].map(|mm| significant(mm, 2));
    let after = report.tool_error_after_diagnosis_mm.as_ref().map_or(String::new(), |after| {
        format!(", and {} mm after the diagnosis", significant(after.mean, 2))
    });
    format!(
        "{} mills {}: the mean tool error is {without} mm without correction, {with} mm with the calibrated model{after}.",
        report.milled.robot,
        scene.description()
    )
}

fn numbers(report: &Report) -> Vec<Number> {
    let errors = &report.milled.tool_error_mm;
    let share =
        |mean: f64| format!("{:.0} % of the uncorrected error", 100.0 * mean / errors.without.mean);
    let with = errors.with.mean;
    let mut numbers = vec![
        Number::new("Mean tool error, uncorrected", errors.without.mean, "mm"),
        Number::new("With the calibrated model", with, "mm").note(share(with)),
    ];
    if let Some(after) = &report.tool_error_after_diagnosis_mm {
        let number = Number::new("After the diagnosis", after.mean, "mm");
        numbers.push(number.note(share(after.mean)));
    }
    let milled = &report.milled;
    let missed =
        format!("{} of {} cycles missed", milled.counts.missed_cycles, milled.counts.cycles);
    numbers.push(
        Number::new("Round trip, median", milled.latency_ns.p50 as f64 * 1e-3, "µs").note(missed),
    );
    numbers
}

/// The repeated path is drawn over the first one, without the initial standstill.
fn error_over_time(rows: &[LogRow], again: Option<&[LogRow]>) -> Plot {
    let line =
        |of: fn(&LogRow) -> f64| rows.iter().map(move |row| (row.t_s, of(row))).collect::<Vec<_>>();
    let start_s = rows.first().map_or(0.0, |row| row.t_s);
    let plot =
        Plot::new("Tool error over time", Axis::new("Time", "s"), Axis::new("Tool error", "mm"))
            .series(
                Series::line("without correction", line(|row| row.without_mm)).role(Role::Before),
            )
            .series(
                Series::line("with the calibrated model", line(|row| row.with_mm))
                    .role(Role::Calibrated),
            );
    match again {
        Some(rows) => {
            let line = rows.iter().map(|row| (row.t_s + start_s, row.with_mm));
            plot.series(
                Series::line("after the diagnosis", line.collect::<Vec<_>>()).role(Role::After),
            )
        }
        None => plot,
    }
}

fn histogram(rows: &[LogRow]) -> Histogram {
    Histogram::new("Tool error", Axis::new("Tool error", "mm"))
        .values("without correction", rows.iter().map(|row| row.without_mm))
        .role(Role::Before)
        .values("with the calibrated model", rows.iter().map(|row| row.with_mm))
        .role(Role::Calibrated)
        .bins(60)
}

fn corrections(scene: &Scene, rows: &[LogRow]) -> Multiples {
    let joints = 0..scene.model.physics.arm.count();
    joints.fold(Multiples::new("Correction", 3), |all, i| {
        let line = rows.iter().map(|row| (row.t_s, 1e3 * row.correction[i]));
        let title = format!("Joint {}", i + 1);
        let plot = Plot::new(title, Axis::new("Time", "s"), Axis::new("Correction", "mrad"));
        all.plot(plot.series(Series::line("correction", line)))
    })
}

fn latency(log: &CellLog) -> Histogram {
    let counted = log.latency.iter_recorded().map(|bucket| {
        (bucket.value_iterated_to() as f64 * 1e-3, bucket.count_since_last_iteration())
    });
    Histogram::new("Round trip", Axis::new("Round trip", "µs").log())
        .counted("round trips", counted)
        .log_share()
        .mark(log.latency.value_at_quantile(0.5) as f64 * 1e-3, "median")
        .mark(log.latency.value_at_quantile(0.99) as f64 * 1e-3, "99 %")
}

fn force(scene: &Scene, log: &CellLog) -> Plot {
    let from_s = log.ringing_from_s.unwrap_or(0.0) - 0.5;
    let rows = || log.rows.iter().filter(move |row| row.t_s >= from_s && row.t_s <= from_s + 1.5);
    let mut plot = Plot::new("Force", Axis::new("Time", "s"), Axis::new("Force", "N"));
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        plot =
            plot.series(Series::line(name, rows().map(move |row| (row.t_s, row.force_tool[axis]))));
    }
    if let Some(from_s) = log.ringing_from_s {
        plot = plot.mark_x(from_s, "rings");
    }
    let rings_at = scene.chatter.frequency_hz;
    let alarm = log
        .events
        .iter()
        .find(|event| event.state == "alarm" && (event.frequency_Hz - rings_at).abs() < 5.0);
    match alarm {
        Some(event) => plot.mark_x(event.t_s, "alarm"),
        None => plot,
    }
}

fn errors(report: &Report) -> Table {
    let row = |name: &str, spread: &crate::outcome::ErrorStatistics| {
        [name.into(), spread.mean.into(), spread.p95.into(), spread.max.into()]
    };
    let number = |head: &str| Column::new(head).digits(3);
    let heads = [Column::new("mm"), number("mean"), number("95 %"), number("largest")];
    let errors = &report.milled.tool_error_mm;
    let table = Table::new("Tool error along the path", heads)
        .row(row("without correction", &errors.without))
        .row(row("with correction, as calibrated", &errors.with));
    match &report.tool_error_after_diagnosis_mm {
        Some(after) => table.row(row("after the diagnosis", after)),
        None => table,
    }
}

fn events(report: &MillingResult) -> Table {
    let heads = ["Time, s", "State", "Frequency, Hz", "Amplitude, N", "Axis", "Message"];
    report.vibration.iter().fold(
        Table::new("Vibration messages of the daemon", heads),
        |table, event| {
            table.row([
                event.t_s.into(),
                event.state.as_str().into(),
                event.frequency_Hz.into(),
                event.amplitude_N.into(),
                event.axis.as_str().into(),
                event.says.as_str().into(),
            ])
        },
    )
}
