//! The page of `trued stability`: the verdict, the stability chart, the limit over the direction of feed.

use std::path::Path;

use report::{Axis, Cell, Number, Page, Plot, Role, Series, Table, Tone, fixed, significant};
use spectrum::stability::{Limit, Turned};

use super::found::{Found, signed_rad};
use super::told::{best_direction, cut, depth_mm, mode_coupling, nearest, verdict, words};

/// The charts extend this far above the deepest limit shown.
const ROOM: f64 = 1.15;

/// The whole page.
pub(super) fn page(path: &Path, found: &Found) -> Page {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let (word, tone) = called(found);
    let mut page = Page::new("Stability of a cut")
        .kicker(format!("trued stability, {name}"))
        .verdict(tone, word, &format!("{}: {}.", cut(found), verdict(found)))
        .numbers(numbers(found))
        .figure(
            "Axial depth from which chatter grows, over spindle speed: below the line the cut is stable.",
            &speeds(found).render(),
        );
    page = match found.nearest.is_present {
        true => page.next("Record the forces of the cut and see whether it is as quiet as predicted.", Some("trued spectrum FORCES.csv --cut CUT.toml --report SPECTRUM.html")),
        false => page.next("Take one of the nearest stable cuts below, or measure modes and coefficients anew where they are uncertain.", None),
    };
    if let Some((first, others)) = found.modes.warnings.split_first() {
        page = page.note(Tone::Caution, "To be looked at", first);
        if !others.is_empty() {
            page = page.list(others);
        }
    }
    if !found.nearest.is_present {
        let proposals: Vec<String> = nearest(found).into_iter().map(|(_, text)| text).collect();
        if let Some((head, points)) = proposals.split_first() {
            let points = points.iter().map(|point| point.trim_start_matches("- "));
            page = page.section("Nearest stable cut").text(head).list(points);
        }
    }
    page.section("How the chart is computed")
        .text(
            "Semi-discretisation takes the teeth as they enter and leave the work, the zeroth order their mean force. Linear theory without process \
             damping: at low speeds the true limit is higher.",
        )
        .section("Direction of feed")
        .figure(
            "Axial depth from which chatter grows at this spindle speed, over the angle by which the feed is turned, counterclockwise seen from above.",
            &directions(found).render(),
        )
        .text(&format!("Chatter: {}. Mode coupling: {}.", best_direction(found), mode_coupling(found)))
        .section("Modes")
        .table(&modes(found))
}

/// Whether the cut is stable, as a word and its colour.
fn called(found: &Found) -> (&'static str, Tone) {
    match (found.is_stable, found.nearest.is_present) {
        (true, true) => ("stable", Tone::Good),
        (true, false) => ("stable", Tone::Caution),
        (false, _) => ("not stable", Tone::Bad),
    }
}

fn numbers(found: &Found) -> Vec<Number> {
    let file = &found.file;
    let (word, tone) = called(found);
    let depth = significant(1e3 * file.cut.axial_depth_m, 3);
    vec![
        Number::text("The cut", word).note(format!("{depth} mm deep")).tone(tone),
        Number::text("Limit at this speed", words(found, found.limit))
            .note(format!("zeroth order: {}", words(found, found.zeroth_order))),
        Number::new("Chatter frequency", found.chatter_hz.unwrap_or(f64::NAN), "Hz"),
        Number::text("Spindle speed", format!("{} rpm", fixed(file.spindle_rpm, 0))),
    ]
}

/// What the depth axis shows, mm.
fn top_mm(found: &Found, limits: impl Iterator<Item = Option<Limit>>) -> f64 {
    let deepest = limits.filter_map(depth_mm).fold(0.0, f64::max);
    let wanted = ROOM * deepest.max(1e3 * found.file.cut.axial_depth_m);
    wanted.min(1e3 * found.file.chart.depth_max_m)
}

fn depths(top_mm: f64) -> Axis {
    Axis::new("Axial depth", "mm").range(0.0, top_mm)
}

fn mm(limit: Option<Limit>) -> f64 {
    depth_mm(limit).unwrap_or(f64::NAN)
}

fn speeds(found: &Found) -> Plot {
    let file = &found.file;
    let [from, to] = file.chart.spindle_rpm;
    let top = top_mm(found, found.chart.iter().map(|point| point.limit));
    let depth_mm = 1e3 * file.cut.axial_depth_m;
    let line = |of: &dyn Fn(&spectrum::stability::Point) -> Option<Limit>| {
        found.chart.iter().map(|point| (point.spindle_rpm, mm(of(point)))).collect::<Vec<_>>()
    };
    let plot = Plot::new(
        "Stability chart",
        Axis::new("Spindle speed", "rpm").range(from, to),
        depths(top),
    )
    .height(340.0)
    .series(Series::line("semi-discretisation", line(&|point| point.limit)))
    .series(Series::line("zeroth order", line(&|point| point.zeroth_order)).role(Role::Before))
    .series(Series::dots("the cut", [(file.spindle_rpm, depth_mm)]));
    if found.nearest.is_present {
        return plot;
    }
    let speed = found.nearest.spindle_rpm.map(|rpm| (rpm, depth_mm));
    let depth = (file.spindle_rpm, 1e3 * found.nearest.depth_m);
    plot.series(Series::dots("nearest stable cuts", speed.into_iter().chain([depth])))
}

fn directions(found: &Found) -> Plot {
    let limits = found.directions.iter().flat_map(|one| [one.limit, one.mode_coupling]);
    let top = top_mm(found, limits);
    let line = |of: &dyn Fn(&Turned) -> Option<Limit>| {
        let mut points: Vec<(f64, f64)> = found
            .directions
            .iter()
            .map(|one| (signed_rad(one.angle_rad).to_degrees(), mm(of(one))))
            .collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    };
    let plot = Plot::new(
        "Direction of feed",
        Axis::new("Feed turned by", "°").range(-180.0, 180.0),
        depths(top),
    )
    .height(280.0)
    .series(Series::line("chatter", line(&|one| one.limit)))
    .series(
        Series::line("mode coupling without regeneration", line(&|one| one.mode_coupling)).dashed(),
    )
    .series(Series::dots("the cut", [(0.0, 1e3 * found.file.cut.axial_depth_m)]));
    match found.nearest.best {
        Some(best) => plot.mark_x(signed_rad(best.angle_rad).to_degrees(), "best"),
        None => plot,
    }
}

fn modes(found: &Found) -> Table {
    let heads = ["Frequency (Hz)", "Damping (%)", "Stiffness (N/µm)", "Direction", "From"];
    found.modes.all.iter().fold(Table::new("Modes at the tip of the tool", heads), |table, one| {
        let from =
            one.tap.as_ref().map_or_else(|| "the file".to_owned(), |tap| tap.display().to_string());
        table.row([
            Cell::from(one.mode.frequency_hz),
            (100.0 * one.mode.damping_ratio).into(),
            (1e-6 * one.mode.stiffness_n_per_m).into(),
            Cell::from(one.mode.direction.map(|x| fixed(x, 2)).join(", ")),
            from.into(),
        ])
    })
}
