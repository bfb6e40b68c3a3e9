//! Figures of the page: residual before and after over time, as spectrum and as distribution; location; findings over their covariates; alternatives.
//!
//! The number of points in each drawing is bounded, and the caption reports what was omitted; all values come from the result.

use diagnosis::diagnose::{CovariatePlot, Diagnosis, ResidualSeries};
use physics::Arm;
use physics::JointKind;
use report::{
    Axis, Bar, Bars, Histogram, Multiples, Page, Plot, Role, Series, Svg, beside, significant,
};

use super::{Figure, tables};

use crate::drawings::{arm_with_errors, dominant_joints, tool_errors};
use crate::result::{MapCellReport, Report};

/// Joint positions, speeds, torques and times below this are rounding: SI units, below the resolution of any sensor.
const ROUNDING: f64 = 1e-9;
/// mm per m, mrad per rad.
const MILLI: f64 = 1e3;
/// Largest number of points of one series.
const POINTS: usize = 1500;
/// Largest number of channels that are drawn over time.
const CHANNELS: usize = 6;
/// Largest numbers of map cells and of findings that are drawn.
const CELLS: usize = 15;
const FINDINGS: usize = 6;

/// The arm with the errors of held-out poses at its tool; `None` if no point was measured.
pub(crate) fn arm(arm: &Arm, diagnosis: &Diagnosis, report: &Report) -> Option<Figure> {
    let training = &diagnosis.split.training;
    let held = |pose: usize| training.get(pose).is_some_and(|trains| !trains);
    let fits = [&diagnosis.given, &diagnosis.fit];
    let errors = tool_errors(&diagnosis.campaign, arm, fits, held);
    let lit = dominant_joints(arm.count(), &tables::sizes(report));
    let (drawing, factor) = arm_with_errors(arm, &diagnosis.campaign, &errors, &lit)?;
    let lit = if lit.is_empty() { "" } else { " Red: joints with the largest findings." };
    let caption = format!(
        "Tool errors on {} held-out poses: measured minus model, magnified {} times, with the given model (before) and with the findings (after).{lit}",
        errors.len(),
        significant(factor, 1)
    );
    Some(Figure { caption, drawing })
}

/// Distribution of the held-out errors, if there is no point at which to draw them.
pub(crate) fn sizes(diagnosis: &Diagnosis, report: &Report) -> Option<Figure> {
    let [before, after] = diagnosis.held_out();
    let drawing = (!before.is_empty()).then(|| histogram(report.unit, &before, &after))?;
    let caption =
        "Distribution of the errors of held-out readings, which were not used in any fit."
            .to_owned();
    Some(Figure { caption, drawing })
}

/// Validation: residual over time, distribution, spectrum.
pub(crate) fn validation(page: Page, diagnosis: &Diagnosis, report: &Report) -> Page {
    let unit = report.unit;
    let mut page = page.section("Before and after");
    let traces = diagnosis.traces();
    if !traces.is_empty() {
        let (figure, left_out) = over_time(diagnosis, &traces, unit);
        page = page.figure(
            &format!("Errors of the readings, before and after: measured minus model.{left_out}"),
            &figure,
        );
    }
    if let Some(figure) = sizes(diagnosis, report) {
        page = page.figure(&figure.caption, &figure.drawing);
    }
    if let Some(spectra) = diagnosis.spectra() {
        let figure = spectrum(&spectra, unit);
        page = page.figure(
            &format!(
                "Spectrum of the errors over the longest evenly sampled section ({} s): amplitude density, mean of the channels.",
                significant(spectra.duration_s, 3)
            ),
            &figure,
        );
    }
    page
}

/// Stride that reduces a series to at most [`POINTS`] points.
fn stride(count: usize) -> usize {
    count.div_ceil(POINTS).max(1)
}

fn omission_note(stride: usize) -> String {
    if stride > 1 { format!(" One reading in {stride} is drawn.") } else { String::new() }
}

fn over_time(diagnosis: &Diagnosis, traces: &[ResidualSeries], unit: &str) -> (Svg, String) {
    let elapsed = diagnosis.elapsed_s();
    let longest = traces.iter().map(|trace| trace.off.len()).max().unwrap_or(0);
    let stride = stride(longest);
    let whole = elapsed.last().copied().unwrap_or(0.0);
    let (factor, name) = if whole > 7200.0 { (1.0 / 3600.0, "h") } else { (1.0, "s") };
    let series = |trace: &ResidualSeries, side: usize| {
        let points = trace.off.iter().step_by(stride);
        let points: Vec<(f64, f64)> = points
            .map(|(pose, residuals)| (factor * elapsed[*pose], MILLI * residuals[side]))
            .collect();
        let name = ["given model", "with the findings"][side];
        let series = Series::dots(name, points);
        series.role([Role::Before, Role::After][side])
    };
    let columns = if traces.len() > 3 { 2 } else { 1 };
    let mut all = Multiples::new("Errors of the readings over time", columns);
    for trace in traces.iter().take(CHANNELS) {
        let plot = Plot::new(&trace.channel, Axis::new("Time", name), Axis::new("Off", unit))
            .series(series(trace, 0))
            .series(series(trace, 1));
        all = all.plot(plot);
    }
    let mut note = omission_note(stride);
    if traces.len() > CHANNELS {
        note += &format!(" The first {CHANNELS} of {} channels.", traces.len());
    }
    (all.render(), note)
}

fn histogram(unit: &str, before: &[f64], after: &[f64]) -> Svg {
    let values = |all: &[f64]| all.iter().map(|error| MILLI * error).collect::<Vec<_>>();
    Histogram::new("Held-out errors", Axis::new("Error", unit).log())
        .values("given model", values(before))
        .role(Role::Before)
        .values("with the findings", values(after))
        .role(Role::After)
        .bins(48)
        .render()
}

fn spectrum(spectra: &diagnosis::diagnose::Spectra, unit: &str) -> Svg {
    let line = |side: usize| {
        let density = spectra.density[side].iter().map(|power| MILLI * power.sqrt());
        spectra.frequencies_hz.iter().copied().zip(density).skip(1).collect::<Vec<_>>()
    };
    let y = Axis::new("Density", format!("{unit}/√Hz")).log();
    Plot::new("Spectrum of the residual", Axis::new("Frequency", "Hz").log(), y)
        .series(Series::line("given model", line(0)).role(Role::Before))
        .series(Series::line("with the findings", line(1)).role(Role::After))
        .render()
}

/// A covariate for users, with its unit and the factor from SI to it.
fn covariate_label(covariate: &str, slides: bool) -> (String, &'static str, f64) {
    let stem: String =
        covariate.chars().take_while(|c| c.is_ascii_lowercase() && *c != '_').collect();
    let joint: String = covariate.chars().filter(char::is_ascii_digit).collect();
    let of_joint = |what: &str| {
        if joint.is_empty() { what.to_owned() } else { format!("{what} of joint {joint}") }
    };
    let degrees = 180.0 / std::f64::consts::PI;
    match (stem.as_str(), slides) {
        ("q", false) => (of_joint("Position"), "deg", degrees),
        ("q", true) => (of_joint("Position"), "mm", MILLI),
        ("v", false) => (of_joint("Speed"), "deg/s", degrees),
        ("v", true) => (of_joint("Speed"), "mm/s", MILLI),
        ("a", false) => (of_joint("Acceleration"), "deg/s²", degrees),
        ("a", true) => (of_joint("Acceleration"), "mm/s²", MILLI),
        ("direction", _) => (of_joint("Direction"), "", 1.0),
        ("tau", false) => (of_joint("Torque"), "Nm", 1.0),
        ("tau", true) => (of_joint("Force"), "N", 1.0),
        ("temp", _) => (of_joint("Temperature"), "°C", 1.0),
        ("spindle", _) => ("Spindle speed".to_owned(), "1/min", 1.0),
        ("wrench", _) => ("Wrench on the tool".to_owned(), "N or Nm", 1.0),
        ("t", _) => ("Time".to_owned(), "s", 1.0),
        _ => (covariate.to_owned(), "", 1.0),
    }
}

fn is_prismatic(diagnosis: &Diagnosis, covariate: &str) -> bool {
    let digits: String = covariate.chars().filter(char::is_ascii_digit).collect();
    let joint = digits.parse::<usize>().ok().and_then(|n| n.checked_sub(1));
    let joints = diagnosis.given.hypothesis.model.arm.joints();
    joint.and_then(|j| joints.get(j)).is_some_and(|j| j.kind == JointKind::Prismatic)
}

/// The map: deviation of each joint where it is most significant.
pub(crate) fn error_map(page: Page, diagnosis: &Diagnosis, report: &Report) -> Page {
    let is_clear = |place: &&MapCellReport| place.ci95[0] * place.ci95[1] > 0.0;
    // A covariate that is zero but for rounding, such as the torque of gravity on an axis through the centre of mass, is no operating condition.
    let varies = |place: &&MapCellReport| place.from.abs().max(place.to.abs()) > ROUNDING;
    let clear = report.map.iter().filter(is_clear).filter(varies);
    let mut cells: Vec<&MapCellReport> = Vec::new();
    for place in clear {
        // Of the cells of one joint and covariate only the most significant is shown.
        let known = |other: &&MapCellReport| {
            (other.joint, &other.depends_on) == (place.joint, &place.depends_on)
        };
        if cells.len() < CELLS && !cells.iter().any(known) {
            cells.push(place);
        }
    }
    if cells.is_empty() {
        return page;
    }
    let mut bars = Bars::new(
        "Where model and recording differ",
        Axis::new("Equivalent error of the joint alone", "mrad, or mm for a linear joint"),
    );
    for cell in cells {
        let name = format!("joint {}: {}", cell.joint, cell_range(diagnosis, cell));
        bars = bars.row(name, [Bar::new(cell.off).between(cell.ci95[0], cell.ci95[1])]);
    }
    page.section("Where model and recording differ")
        .text(
            "Each bar is for the readings in one operating condition, and gives the error that one joint alone would need to explain them, with the given \
             model; most significant first. It shows where errors occur, not their cause: neighbouring joints are often hard to distinguish.",
        )
        .figure("Equivalent error of a joint, with 95 % intervals.", &bars.render())
}

/// Range of a map cell for users: `q3 10 to 20 deg`, `joint 3 rising`.
fn cell_range(diagnosis: &Diagnosis, cell: &MapCellReport) -> String {
    let covariate = &cell.depends_on;
    if let Some(joint) = covariate.strip_prefix("direction_") {
        let way = if cell.from + cell.to > 0.0 { "rising" } else { "falling" };
        return format!("joint {joint} {way}");
    }
    let (_, unit, factor) = covariate_label(covariate, is_prismatic(diagnosis, covariate));
    let scale = cell.from.abs().max(cell.to.abs());
    let [from, to] = [cell.from, cell.to].map(|edge| significant(factor * beside(edge, scale), 2));
    let name = covariate.trim_end_matches("_C").trim_end_matches("_s").trim_end_matches("_rpm");
    format!("{name} {from} to {to} {unit}")
}

/// Each finding over the covariate on which it depends.
pub(crate) fn findings_over_covariates(
    mut page: Page,
    diagnosis: &Diagnosis,
    report: &Report,
) -> Page {
    let shown: Vec<_> = diagnosis.findings.iter().zip(&report.findings).take(FINDINGS).collect();
    let mut first = true;
    for (finding, reported) in shown {
        // A finding of the whole recording, such as a delay, has no covariate with readings over it.
        let over = diagnosis.over(finding).filter(|over| !over.points.is_empty());
        let Some(over) = over else { continue };
        if std::mem::take(&mut first) {
            page = page.section("Each finding over its input");
        }
        let stride = stride(over.points.len());
        let caption = format!(
            "{} Dots: readings, with all other findings subtracted.{}",
            reported.says,
            omission_note(stride)
        );
        page = page.figure(&caption, &over_covariate(diagnosis, &over, stride, report));
    }
    page
}

fn over_covariate(
    diagnosis: &Diagnosis,
    over: &CovariatePlot,
    stride: usize,
    report: &Report,
) -> Svg {
    let (what, unit, factor) = covariate_label(&over.word, is_prismatic(diagnosis, &over.word));
    let joint = over.joint;
    let sliding = joint.is_some_and(|j| is_prismatic(diagnosis, &format!("q{}", j + 1)));
    // An error of the tool is in the unit of the readings.
    let error_unit = match joint {
        None => report.unit,
        Some(_) if sliding => "mm",
        Some(_) => "mrad",
    };
    let y = match joint {
        Some(joint) => Axis::new(format!("Error of joint {}", joint + 1), error_unit),
        None => Axis::new("Error of the tool", error_unit),
    };
    let drawn = || over.points.iter().step_by(stride);
    let measured = |wanted: Option<f64>| {
        let points = drawn().filter(move |p| wanted.is_none_or(|d| p.direction == d));
        points.map(|p| (factor * p.at, MILLI * p.seen)).collect::<Vec<_>>()
    };
    let both = drawn().any(|p| p.direction > 0.0) && drawn().any(|p| p.direction < 0.0);
    let mut plot =
        Plot::new(format!("Error over {}", what.to_lowercase()), Axis::new(what, unit), y);
    plot = if both && joint.is_some() {
        plot.series(Series::dots("measured, increasing", measured(Some(1.0))))
            .series(Series::dots("measured, decreasing", measured(Some(-1.0))))
    } else {
        plot.series(Series::dots("measured", measured(None)))
    };
    let explained = drawn().map(|p| (factor * p.at, MILLI * p.explained));
    plot.series(Series::dots("explained by the finding", explained).role(Role::After)).render()
}

/// Posterior probabilities of the alternatives to each finding.
pub(crate) fn probabilities_of_alternatives(report: &Report) -> Svg {
    let mut bars = Bars::new("Alternatives", Axis::new("Probability", "").range(0.0, 1.0));
    let whose = |effect: &str, joint: Option<usize>| {
        let joint = joint.map_or(String::new(), |joint| format!(", joint {joint}"));
        format!("{}{joint}", effect.replace('_', " "))
    };
    for reported in report.findings.iter().filter(|reported| !reported.alternatives.is_empty()) {
        bars = bars.row(whose(reported.effect, reported.joint), reported.confidence);
        for rival in &reported.alternatives {
            let name = format!("or {}", whose(rival.effect, rival.joint));
            bars = bars.row(name, rival.confidence);
        }
    }
    bars.render()
}
