//! The page of `trued gears`.

use report::{Axis, Cell, Column, Page, Plot, Series, Svg, Table, significant};

use super::matching::Matched;
use super::told::{DEGREES, Found, by_parts, fitting, remarks};
use crate::output::made_by;

/// Rivals named for each line.
const RIVALS: usize = 8;

pub(super) fn render(found: &Found<'_>) -> String {
    let travelled = &found.travelled;
    let mut page = Page::new(format!("Gears of {}", found.model.file.name))
        .kicker("trued gears")
        .lead(&format!("{} mm of path by {}.", significant(travelled.length_mm, 4), travelled.by))
        .table(&wheels(found))
        .text(&format!("{DEGREES}."))
        .list(remarks(found));
    if travelled.parts.len() > 1 && !found.trains.is_empty() {
        page = page.figure(
            "The motor shaft of each joint along the path: where a curve is level, its wheels write sharp lines.",
            &along(found),
        );
        let mut rows = by_parts(found).into_iter();
        let caption = "Shaft 1 of each joint, part by part: mean (least to most)";
        let table = Table::new(caption, rows.next().unwrap_or_default());
        page =
            page.table(&rows.fold(table, |table, row| table.row(row.into_iter().map(Cell::from))));
    }
    if !found.lines.is_empty() {
        page = page.section("Lines").table(&lines(&found.lines)).text(
            "By chance: the part of the octave around a line in which any line would fit some wheel. Where it is large, a match says little.",
        );
    }
    page.footer(made_by("gears")).render()
}

fn wheels(found: &Found<'_>) -> Table {
    let heads =
        ["Shaft", "Teeth", "Revolutions per mm", "Degrees per mm", "Teeth per mm", "Drift (%)"];
    let heads = heads.map(|head| Column::new(head).digits(4));
    let mut table = Table::new("Every shaft that drives a stage, means over the path", heads);
    for train in &found.trains {
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

fn along(found: &Found<'_>) -> Svg {
    let lengths = found.travelled.parts.iter().map(|part| part.to_mm - part.from_mm);
    let middles: Vec<f64> = lengths
        .scan(0.0, |end, mm| {
            *end += mm;
            Some(*end - 0.5 * mm)
        })
        .collect();
    let plot =
        Plot::new("Motor shafts", Axis::new("Path", "mm"), Axis::new("Revolutions per mm", "1/mm"));
    let plots = found.trains.iter().fold(plot, |plot, train| {
        let motor = train.wheels.first().map_or(0.0, |wheel| wheel.cycles_per_mm);
        let points = middles.iter().zip(&train.parts).map(|(mm, part)| (*mm, motor * part[0]));
        plot.series(Series::line(format!("joint {}", train.joint), points))
    });
    plots.render()
}

fn lines(lines: &[Matched]) -> Table {
    let heads = ["Cycles per mm", "From", "Amplitude", "Fits", "By chance (%)"];
    lines.iter().fold(Table::new("Lines and what they fit", heads), |table, matched| {
        let amplitude = matched.line.amplitude.as_ref();
        table.row([
            matched.line.cycles_per_mm.into(),
            matched.line.source.clone().into(),
            amplitude.map_or("–".to_owned(), |(a, unit)| report::quantity(*a, unit)).into(),
            fitting(matched, RIVALS).into(),
            Cell::Number((100.0 * matched.by_chance).round()),
        ])
    })
}
