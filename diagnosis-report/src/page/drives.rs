//! The torque domain's part of the page: torque over time and speed, residual before and after, joint by joint.
//!
//! The number of points in each drawing is bounded; all values come from the result.

use diagnosis::torque::{Diagnosis, Trace};
use physics::JointKind;
use std::path::Path;

use report::{
    Axis, Bars, Column, Histogram, Multiples, Page, Plot, Role, Series, Table, significant,
};

use super::{Figure, Report, RobotDiagnosis, details, findings_section, first_screen};

/// Largest number of joints that are drawn.
const JOINTS: usize = 6;

pub(crate) fn domain(
    page: Page,
    found: &RobotDiagnosis,
    torques: &Diagnosis,
    report: &Report,
    dir: &Path,
) -> Page {
    let unit = report.unit;
    let over_time = Figure {
        caption:
            "Torque error over time, before and after: recorded minus model, low-pass filtered."
                .to_owned(),
        drawing: error_over(torques, unit, "time", "s", &|trace, k| trace.t_s[k]),
    };
    // For one or two joints, bars add nothing to the numbers.
    let (picture, below) = match report.joints.len() {
        0..=2 => (over_time, None),
        _ => (error_by_joint(report, unit), Some(over_time)),
    };
    let page = first_screen(page, report, true, Some(picture), dir);
    let mut page = findings_section(page, report, found.base.physics.arm.count());
    page = page.section("All joints").table(&joint_table(report, unit));
    page = page.section("Before and after");
    if let Some(figure) = below {
        page = page.figure(&figure.caption, &figure.drawing);
    }
    let kinds = found.base.physics.arm.joints();
    let slides = kinds.iter().all(|joint| joint.kind == JointKind::Prismatic);
    let speed = if slides { "m/s" } else { "rad/s" };
    page = page.figure(
        "Torque error over joint speed: friction appears as the step at zero speed, the slope, and the difference between the directions.",
        &error_over(torques, unit, "speed", speed, &|trace, k| trace.speed[k]),
    );
    let held = |side: usize| -> Vec<f64> {
        let test_errors = |trace: &Trace| -> Vec<f64> {
            let rows = (0..trace.is_test_row.len()).filter(|k| trace.is_test_row[*k]);
            rows.map(|k| trace.residuals[side][k].abs()).collect()
        };
        torques.traces.iter().flat_map(test_errors).collect()
    };
    let sizes = Histogram::new("Held-out rows", Axis::new("error", unit))
        .values("given model", held(0))
        .role(Role::Before)
        .values("with the findings", held(1))
        .role(Role::After);
    page = page.figure(
        "Distribution of the errors of held-out rows, which were not used in any fit, all joints.",
        &sizes.render(),
    );
    page = details(page, report).section("Data processing").list(&report.notes);
    page.facts([
        ("Rows of each joint", report.samples.to_string()),
        ("Held out", report.heldout.clone()),
        ("Band", format!("0 to {} Hz", significant(torques.band_hz, 3))),
        ("Seed", found.settings.seed.to_string()),
    ])
}

/// Torque error of each joint, before and after.
fn error_by_joint(report: &Report, unit: &str) -> Figure {
    let axis = Axis::new("Error", format!("{unit} RMS"));
    let bars = Bars::new("Torque error of each joint", axis)
        .groups(["given model", "with the findings"])
        .roles([Role::Before, Role::After]);
    let bars = report.joints.iter().fold(bars, |bars, one| {
        let sizes = [one.heldout_rms_before, one.heldout_rms_after];
        bars.row(format!("joint {}", one.joint), sizes)
    });
    let caption = "Torque error of each joint on held-out rows.".to_owned();
    Figure { caption, drawing: bars.render() }
}

fn joint_table(report: &Report, unit: &str) -> Table {
    let heads =
        ["Joint", "Torque", "Error before", "Error after", "Outside low-speed zones", "Residual"];
    let table = Table::new(format!("RMS on held-out rows, {unit}"), heads.map(Column::new));
    report.joints.iter().fold(table, |table, one| {
        let numbers = [
            one.torque_rms,
            one.heldout_rms_before,
            one.heldout_rms_after,
            one.heldout_rms_after_outside,
            one.noise_rms,
        ];
        let cells = numbers.map(|number| significant(number, 3));
        table.row(std::iter::once(one.joint.to_string()).chain(cells).map(Into::into))
    })
}

/// Torque error of each joint over a covariate, before and after.
fn error_over(
    torques: &Diagnosis,
    unit: &str,
    name: &str,
    its_unit: &str,
    place: &dyn Fn(&Trace, usize) -> f64,
) -> report::Svg {
    let columns = if torques.traces.len() > 3 { 2 } else { 1 };
    let mut all = Multiples::new(format!("Torque error over {name}"), columns).own_y();
    for trace in torques.traces.iter().take(JOINTS) {
        let points = |side: usize| -> Vec<(f64, f64)> {
            (0..trace.t_s.len()).map(|k| (place(trace, k), trace.residuals[side][k])).collect()
        };
        let plot = Plot::new(
            format!("Joint {}", trace.joint + 1),
            Axis::new(name, its_unit),
            Axis::new("error", unit),
        );
        all = all.plot(
            plot.series(Series::dots("given model", points(0)).role(Role::Before))
                .series(Series::dots("with the findings", points(1)).role(Role::After)),
        );
    }
    all.render()
}
