//! The torque domain's part of the page: torque over time and over speed, what the model is off by before and after, joint by joint.
//!
//! Promises: a bounded number of points in each drawing. Never: a number of its own.

use diagnosis::torque::{Diagnosis, Trace};
use physics::JointKind;
use report::{Axis, Column, Histogram, Multiples, Page, Plot, Series, Table, significant};

use super::{Found, Report, rest, words};

/// Joints that are drawn.
const JOINTS: usize = 6;

pub(super) fn domain(page: Page, found: &Found, torques: &Diagnosis, report: &Report) -> Page {
    let unit = report.unit;
    let mut page = words(page, report, true);
    page = page.section("Joint by joint").table(&joints(report, unit));
    page = page.section("Before and after").figure(
        "What the torque is off by over time, before and after: recorded minus model, in the band.",
        &over(torques, unit, "time", "s", &|trace, k| trace.t_s[k]),
    );
    let kinds = found.base.physics.arm.joints();
    let slides = kinds.iter().all(|joint| joint.kind == JointKind::Prismatic);
    let speed = if slides { "m/s" } else { "rad/s" };
    page = page.figure(
        "The same over the joint's speed: friction shows here, in the step at rest, the slope, and the difference between the sides.",
        &over(torques, unit, "speed", speed, &|trace, k| trace.speed[k]),
    );
    let held = |side: usize| -> Vec<f64> {
        let of = |trace: &Trace| -> Vec<f64> {
            let rows = (0..trace.held.len()).filter(|k| trace.held[*k]);
            rows.map(|k| trace.off[side][k].abs()).collect()
        };
        torques.traces.iter().flat_map(of).collect()
    };
    let sizes = Histogram::new("Held-out rows", Axis::new("off by", unit))
        .values("as given", held(0))
        .values("with what was found", held(1));
    page = page.figure(
        "Sizes of what held-out rows are off by, all joints: rows that no fit has seen.",
        &sizes.render(),
    );
    page = rest(page, report).section("What was done with the data").list(&report.notes);
    page.facts([
        ("Rows of each joint", report.samples().to_string()),
        ("Held out", report.heldout.clone()),
        ("Band", format!("0 to {} Hz", significant(torques.band_hz, 3))),
        ("Seed", found.seed.to_string()),
    ])
}

fn joints(report: &Report, unit: &str) -> Table {
    let heads = ["Joint", "Torque", "Off before", "Off after", "Outside low-speed zones", "Noise"];
    let table =
        Table::new(format!("Root mean square on held-out rows, {unit}"), heads.map(Column::new));
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

/// What each joint is off by over something, before and after.
fn over(
    torques: &Diagnosis,
    unit: &str,
    name: &str,
    its_unit: &str,
    place: &dyn Fn(&Trace, usize) -> f64,
) -> report::Svg {
    let columns = if torques.traces.len() > 3 { 2 } else { 1 };
    let mut all = Multiples::new(format!("Torque against the model over {name}"), columns).own_y();
    for trace in torques.traces.iter().take(JOINTS) {
        let points = |side: usize| -> Vec<(f64, f64)> {
            (0..trace.t_s.len()).map(|k| (place(trace, k), trace.off[side][k])).collect()
        };
        let plot = Plot::new(
            format!("Joint {}", trace.joint + 1),
            Axis::new(name, its_unit),
            Axis::new("off by", unit),
        );
        all = all.plot(
            plot.series(Series::dots("as given", points(0)).muted())
                .series(Series::dots("with what was found", points(1))),
        );
    }
    all.render()
}
