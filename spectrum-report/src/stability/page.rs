//! Stability of a cut as a page: the verdict, the stability chart, the limit over the direction of feed.

use std::f64::consts::PI;

use report::{Axis, Cell, Number, Page, Plot, Role, Series, Table, Tone, fixed, significant};
use spectrum::stability::{FeedDirectionLimits, Limit};

use super::analysis::{Analysis, signed_rad};
use super::result::depth_mm;
use super::text::{best_direction, cut, limit_text, mode_coupling, nearest, remedy, verdict};

/// The charts extend this far above the deepest limit shown.
const ROOM: f64 = 1.15;

impl Analysis {
    /// The page.
    #[must_use]
    pub fn page(&self) -> Page {
        page(self)
    }
}

fn page(analysis: &Analysis) -> Page {
    let name = analysis.cut.path.file_name().unwrap_or_default().to_string_lossy();
    let (label, tone) = called(analysis);
    let mut sentence = format!("{}: {}.", cut(analysis), verdict(analysis));
    if !analysis.nearest.is_present {
        sentence += &format!(" {}.", remedy(analysis));
    }
    let mut page = Page::new("Stability of a cut")
        .kicker(format!("trued stability, {name}"))
        .verdict(tone, label, &sentence)
        .numbers(numbers(analysis))
        .figure(
            "Axial depth from which chatter grows, over spindle speed: below the line the cut is stable.",
            &speeds(analysis).render(),
        );
    page = match analysis.nearest.is_present {
        true => page.next("Record the forces of the cut and compare them with the prediction.", Some("trued spectrum FORCES.csv --cut CUT.toml --report SPECTRUM.html")),
        false => page.next(&format!("{}. Set one of these cuts in the file and compute it again; measure modes and coefficients anew where they are uncertain.", remedy(analysis)), Some("trued stability CUT.toml --report STABILITY.html")),
    };
    if let Some((first, others)) = analysis.cut.warnings.split_first() {
        page = page.note(Tone::Caution, "Check", first);
        if !others.is_empty() {
            page = page.list(others);
        }
    }
    if !analysis.nearest.is_present {
        let proposals: Vec<String> = nearest(analysis).into_iter().map(|(_, text)| text).collect();
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
            &directions(analysis).render(),
        )
        .text(&format!("Chatter: {}. Mode coupling: {}.", best_direction(analysis), mode_coupling(analysis)))
        .section("Modes")
        .table(&modes(analysis))
}

/// Whether the cut is stable, as a word and its colour.
fn called(analysis: &Analysis) -> (&'static str, Tone) {
    match (analysis.is_stable, analysis.nearest.is_present) {
        (true, true) => ("stable", Tone::Good),
        (true, false) => ("stable", Tone::Caution),
        (false, _) => ("not stable", Tone::Bad),
    }
}

fn numbers(analysis: &Analysis) -> Vec<Number> {
    let file = &analysis.cut.file;
    let (label, tone) = called(analysis);
    let depth = significant(1e3 * file.cut.axial_depth_m, 3);
    vec![
        Number::text("The cut", label).note(format!("{depth} mm deep")).tone(tone),
        Number::text("Limit at this speed", limit_text(analysis, analysis.limit))
            .note(format!("zeroth order: {}", limit_text(analysis, analysis.zeroth_order))),
        Number::new("Chatter frequency", analysis.chatter_hz.unwrap_or(f64::NAN), "Hz"),
        Number::text("Spindle speed", format!("{} rpm", fixed(file.spindle_rpm, 0))),
    ]
}

/// What the depth axis shows, mm.
fn top_mm(analysis: &Analysis, limits: impl Iterator<Item = Option<Limit>>) -> f64 {
    let deepest = limits.filter_map(depth_mm).fold(0.0, f64::max);
    let top_mm = ROOM * deepest.max(1e3 * analysis.cut.file.cut.axial_depth_m);
    top_mm.min(1e3 * analysis.cut.file.chart.depth_max_m)
}

fn depths(top_mm: f64) -> Axis {
    Axis::new("Axial depth", "mm").range(0.0, top_mm)
}

fn mm(limit: Option<Limit>) -> f64 {
    depth_mm(limit).unwrap_or(f64::NAN)
}

fn speeds(analysis: &Analysis) -> Plot {
    let file = &analysis.cut.file;
    let [from, to] = file.chart.spindle_rpm;
    let top = top_mm(analysis, analysis.chart.iter().map(|point| point.limit));
    let depth_mm = 1e3 * file.cut.axial_depth_m;
    let line = |of: &dyn Fn(&spectrum::stability::SpeedLimits) -> Option<Limit>| {
        analysis.chart.iter().map(|point| (point.spindle_rpm, mm(of(point)))).collect::<Vec<_>>()
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
    if analysis.nearest.is_present {
        return plot;
    }
    let speed = analysis.nearest.spindle_rpm.map(|rpm| (rpm, depth_mm));
    let depth = (file.spindle_rpm, 1e3 * analysis.nearest.depth_m);
    plot.series(Series::dots("nearest stable cuts", speed.into_iter().chain([depth])))
}

fn directions(analysis: &Analysis) -> Plot {
    let limits = analysis.directions.iter().flat_map(|one| [one.limit, one.mode_coupling]);
    let top = top_mm(analysis, limits);
    let line = |of: &dyn Fn(&FeedDirectionLimits) -> Option<Limit>| {
        let mut points: Vec<(f64, f64)> = analysis
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
    .series(Series::dots("the cut", [(0.0, 1e3 * analysis.cut.file.cut.axial_depth_m)]));
    match analysis.nearest.best {
        Some(best) => [0.0, PI].into_iter().fold(plot, |plot, more| {
            plot.mark_x(signed_rad(best.angle_rad + more).to_degrees(), "best")
        }),
        None => plot,
    }
}

fn modes(analysis: &Analysis) -> Table {
    let heads = ["Frequency (Hz)", "Damping (%)", "Stiffness (N/µm)", "Direction", "From"];
    analysis.cut.modes.iter().fold(
        Table::new("Modes at the tip of the tool", heads),
        |table, one| {
            let from = one
                .tap
                .as_ref()
                .map_or_else(|| "the file".to_owned(), |tap| tap.display().to_string());
            table.row([
                Cell::from(one.mode.frequency_hz),
                (100.0 * one.mode.damping_ratio).into(),
                (1e-6 * one.mode.stiffness_n_per_m).into(),
                Cell::from(one.mode.direction.map(|x| fixed(x, 2)).join(", ")),
                from.into(),
            ])
        },
    )
}
