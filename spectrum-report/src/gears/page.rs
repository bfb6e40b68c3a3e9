//! Gear shafts along a path as a page.

use report::{
    Axis, Bars, Cell, Column, Page, Plot, Series, Svg, Table, Tone, fixed, pluralise, significant,
};

use super::analysis::Analysis;
use super::matching::MatchedLine;
use super::text::{DEGREES, by_parts, fitting, remarks};
use super::trains::GearTrain;

/// Shafts that are drawn.
const SHAFTS: usize = 12;
/// Lines that the verdict names.
const NAMED: usize = 3;
/// Alternatives that are listed for each line.
const RIVALS_MAX: usize = 8;

impl Analysis {
    /// The page.
    #[must_use]
    pub fn page(&self) -> Page {
        render(self)
    }
}

fn render(analysis: &Analysis) -> Page {
    let travelled = &analysis.travelled;
    let (tone, label, sentence) = verdict(analysis);
    let mut page = Page::new(format!("Gears of {}", analysis.model.file.name))
        .kicker("trued gears")
        .robot(analysis.model.file.identity().to_string())
        .verdict(tone, label, &sentence);
    if let Some(bars) = teeth(analysis) {
        page = page.figure("Tooth contacts per mm of path of every shaft that drives a stage; only those of joints that turn evenly cause lines in a surface or a force.", &bars);
    }
    let (says, command) = next(analysis);
    page = page
        .next(says, Some(command))
        .section("Shafts and wheels")
        .table(&wheels(analysis))
        .text(&format!("{DEGREES}."))
        .list(remarks(analysis));
    if travelled.parts.len() > 1 && !analysis.trains.is_empty() {
        page = page.figure(
            "The motor shaft of each joint along the path: where a curve is level, its wheels cause sharp lines.",
            &along(analysis),
        );
        let mut rows = by_parts(analysis).into_iter();
        let caption = "Shaft 1 of each joint, by section: mean (minimum to maximum)";
        let table = Table::new(caption, rows.next().unwrap_or_default());
        page =
            page.table(&rows.fold(table, |table, row| table.row(row.into_iter().map(Cell::from))));
    }
    if !analysis.lines.is_empty() {
        page = page.section("Lines").table(&lines(&analysis.lines)).text(
            "Random match: the share of the octave around a line in which any line would match a wheel. If it is large, a match is not significant.",
        );
    }
    page
}

fn verdict(analysis: &Analysis) -> (Tone, &'static str, String) {
    let travelled = &analysis.travelled;
    let path = format!("{} mm of path by {}", significant(travelled.length_mm, 4), travelled.by);
    let Some(evenest) = evenest(analysis) else {
        let why = format!("{path}: no joint with gear_teeth turns along it.");
        return (Tone::Caution, "no gear turns along this path", why);
    };
    let even = even_joints(analysis);
    if even.is_empty() {
        let why = format!(
            "{path}: no joint turns evenly enough to cause a sharp line. The most even one, joint {}, changes its speed per mm by {} %; a line needs at most {} %.",
            evenest.joint,
            fixed(100.0 * evenest.drift(), 0),
            fixed(100.0 * analysis.settings.drift_max, 0)
        );
        return (Tone::Caution, "no gear causes a line on this path", why);
    }
    let joints: Vec<String> = even.iter().map(u8::to_string).collect();
    let joints = format!(
        "{} {} evenly enough to cause lines",
        if even.len() == 1 { "joint" } else { "joints" },
        joints.join(", ") + if even.len() == 1 { " turns" } else { " turn" }
    );
    let (fit, all): (Vec<_>, _) = (
        analysis.lines.iter().filter(|matched| !matched.fits.is_empty()).collect(),
        analysis.lines.len(),
    );
    if all == 0 {
        return (Tone::Plain, "gears that can cause lines", format!("{path}: {joints}."));
    }
    let explained: Vec<String> = fit.iter().take(NAMED).filter_map(|one| explained(one)).collect();
    let named =
        if explained.is_empty() { String::new() } else { format!(": {}", explained.join("; ")) };
    let count = pluralise(all, "line");
    let label =
        if fit.is_empty() { "no line is explained by a gear" } else { "lines explained by gears" };
    (Tone::Plain, label, format!("{path}: {joints}. {} of {count} fit a wheel{named}.", fit.len()))
}

/// `0.344 per mm by joint 1, shaft 1`: a line with the wheel that fits best.
fn explained(matched: &MatchedLine) -> Option<String> {
    let best = matched.fits.first()?;
    Some(format!("{} per mm by {}", significant(matched.line.cycles_per_mm, 3), best.text()))
}

/// The gear train whose speed per mm changes least.
fn evenest(analysis: &Analysis) -> Option<&GearTrain> {
    analysis.trains.iter().min_by(|a, b| a.drift().total_cmp(&b.drift()))
}

/// Joints that turn evenly enough to cause sharp lines.
fn even_joints(analysis: &Analysis) -> Vec<u8> {
    let is_even = |train: &&GearTrain| train.drift() <= analysis.settings.drift_max;
    analysis.trains.iter().filter(is_even).map(|train| train.joint).collect()
}

/// What to do: where no gear can cause a line, another path comes first.
fn next(analysis: &Analysis) -> (&'static str, &'static str) {
    if even_joints(analysis).is_empty() {
        return (
            "Choose a shorter cut, or one along which a joint turns evenly, and compute it again; lines on this path have other causes.",
            "trued gears --model ROBOT.toml --from Q1,… --cut X,Y,Z --report gears.html",
        );
    }
    if analysis.lines.is_empty() {
        return (
            "Look for these lines in a recording of forces at constant feed, or in a surface profile.",
            "trued spectrum --model ROBOT.toml --report spectrum.html RECORDING.csv",
        );
    }
    (
        "Check the gears that fit a line with a low random match; record at another feed: a line of a gear keeps its cycles per mm.",
        "trued spectrum --model ROBOT.toml --report spectrum.html RECORDING.csv",
    )
}

/// Tooth contacts per mm, the highest first.
fn teeth(analysis: &Analysis) -> Option<Svg> {
    let mut all: Vec<(String, f64)> = analysis
        .trains
        .iter()
        .flat_map(GearTrain::shafts)
        .map(|(turn, mesh)| (turn.to_string(), mesh.cycles_per_mm))
        .collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    let bars = Bars::new("Tooth contacts", Axis::new("Teeth per mm", "1/mm"));
    let shown = all.iter().take(SHAFTS);
    (!all.is_empty())
        .then(|| shown.fold(bars, |bars, (name, value)| bars.row(name, [*value])).render())
}

fn wheels(analysis: &Analysis) -> Table {
    let heads =
        ["Shaft", "Teeth", "Revolutions per mm", "Degrees per mm", "Teeth per mm", "Drift (%)"];
    let heads = heads.map(|head| Column::new(head).digits(4));
    let mut table = Table::new("Every shaft that drives a stage, means over the path", heads);
    for train in &analysis.trains {
        for ((turn, mesh), [driver, driven]) in train.shafts().zip(&train.stages) {
            table = table.row([
                turn.to_string().into(),
                format!("{driver}:{driven}").into(),
                Cell::Number(turn.cycles_per_mm),
                Cell::Number(360.0 * turn.cycles_per_mm),
                Cell::Number(mesh.cycles_per_mm),
                Cell::Number(100.0 * train.drift()),
            ]);
        }
    }
    table
}

fn along(analysis: &Analysis) -> Svg {
    let lengths = analysis.travelled.parts.iter().map(|part| part.to_mm - part.from_mm);
    let centres: Vec<f64> = lengths
        .scan(0.0, |end, mm| {
            *end += mm;
            Some(*end - 0.5 * mm)
        })
        .collect();
    let plot =
        Plot::new("Motor shafts", Axis::new("Path", "mm"), Axis::new("Revolutions per mm", "1/mm"));
    let plots = analysis.trains.iter().fold(plot, |plot, train| {
        let motor = train.wheels.first().map_or(0.0, |wheel| wheel.cycles_per_mm);
        let points = centres.iter().zip(&train.parts).map(|(mm, part)| (*mm, motor * part[0]));
        plot.series(Series::line(format!("joint {}", train.joint), points))
    });
    plots.render()
}

fn lines(lines: &[MatchedLine]) -> Table {
    let heads = ["Cycles per mm", "From", "Amplitude", "Fits", "Random match (%)"];
    lines.iter().fold(Table::new("Lines and matching wheels", heads), |table, matched| {
        let amplitude = matched.line.amplitude.as_ref();
        table.row([
            matched.line.cycles_per_mm.into(),
            matched.line.source.clone().into(),
            amplitude.map_or("–".to_owned(), |(a, unit)| report::quantity(*a, unit)).into(),
            fitting(matched, RIVALS_MAX).into(),
            Cell::Number((100.0 * matched.by_chance).round()),
        ])
    })
}
