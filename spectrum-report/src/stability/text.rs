//! Stability of a cut as text.

use std::path::Path;

use report::{fixed, labelled, significant};
use spectrum::stability::{FeedDirectionLimits, Limit};

use super::analysis::{Analysis, analyse, signed_rad};
use super::input::read;
use super::result::depth_mm;
use crate::error::Error;

/// Width of the labels before the lines.
const INDENT: usize = 14;

impl Analysis {
    /// The result as text, at most 80 columns wide.
    #[must_use]
    pub fn text(&self) -> String {
        let mut rows = vec![
            ("cut", cut(self)),
            ("verdict", verdict(self)),
            ("limit", limit(self)),
            ("feed", best_direction(self)),
            ("mode coupling", mode_coupling(self)),
        ];
        if !self.nearest.is_present {
            rows.splice(3..3, nearest(self));
        }
        let lines = rows.iter().flat_map(|(label, text)| labelled(label, INDENT, text));
        lines.map(|line| line + "\n").collect()
    }
}

/// What is predicted of a cut that chatters, as text: its verdict, and the nearest stable cuts.
///
/// ```no_run
/// # fn main() -> Result<(), spectrum_report::Error> {
/// for line in spectrum_report::stability::nearest_stable("cut.toml")? {
///     println!("{line}");
/// }
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// As [`read`] and [`analyse`].
pub fn nearest_stable(path: impl AsRef<Path>) -> Result<Vec<String>, Error> {
    let analysis = analyse(read(path)?)?;
    let nearest = nearest(&analysis).into_iter().skip(1);
    let nearest = nearest.map(|(_, text)| text.trim_start_matches("- ").to_owned());
    let verdict = format!("predicted {}", verdict(&analysis));
    let margin = format!("stable with a margin of {} % in depth", 100.0 * analysis.cut.file.margin);
    Ok([verdict, margin].into_iter().chain(nearest).collect())
}

/// A limit as text, in mm; beyond the largest depth it is stated as larger.
pub(super) fn limit_text(analysis: &Analysis, limit: Option<Limit>) -> String {
    match depth_mm(limit) {
        Some(mm) => format!("{} mm", significant(mm, 3)),
        None => {
            format!("more than {} mm", significant(1e3 * analysis.cut.file.chart.depth_max_m, 3))
        }
    }
}

pub(super) fn cut(analysis: &Analysis) -> String {
    let file = &analysis.cut.file;
    let number = analysis.cut.modes.len();
    format!(
        "{} rpm, {} mm deep, feed along {}, up along {}; {}",
        fixed(file.spindle_rpm, 0),
        significant(1e3 * file.cut.axial_depth_m, 3),
        direction(analysis.feed(0.0)),
        direction(analysis.up()),
        report::pluralise(number, "mode")
    )
}

pub(super) fn verdict(analysis: &Analysis) -> String {
    let frequency =
        |hz: Option<f64>| hz.map_or_else(String::new, |hz| format!("{} Hz", significant(hz, 3)));
    if !analysis.is_stable {
        return format!("not stable: chatter at {}", frequency(analysis.chatter_hz));
    }
    let Some(limit) = analysis.limit else { return "stable".to_owned() };
    let times = limit.depth_m / analysis.cut.file.cut.axial_depth_m;
    let distance = match times {
        _ if times < 1.0 => {
            return "stable, in a pocket above the least limit of its speed".to_owned();
        }
        _ if times < 2.0 => format!("{} % above this depth", significant(100.0 * (times - 1.0), 2)),
        _ => format!("{} times this depth", significant(times, 2)),
    };
    let caveat = if analysis.nearest.is_present { "" } else { ", less than the margin" };
    format!(
        "stable: the limit is {distance}{caveat}; chatter would begin at {}",
        frequency(analysis.chatter_hz)
    )
}

fn limit(analysis: &Analysis) -> String {
    format!(
        "{} at this speed by semi-discretisation, {} by the zeroth order",
        limit_text(analysis, analysis.limit),
        limit_text(analysis, analysis.zeroth_order)
    )
}

/// The remedy in short: the nearest stable speed at this depth, or the depth at this speed.
pub(super) fn remedy(analysis: &Analysis) -> String {
    let nearest = &analysis.nearest;
    let depth = format!("{} mm deep at this speed", significant(1e3 * nearest.depth_m, 3));
    let margin = significant(100.0 * analysis.cut.file.margin, 2);
    let way = match nearest.spindle_rpm {
        Some(rpm) => format!("at {} rpm at this depth, or {depth}", fixed(rpm, 0)),
        None => format!("{depth}; no speed of the chart at this depth"),
    };
    format!("Stable with a margin of {margin} % {way}")
}

/// The nearest cuts that are stable with the margin.
pub(super) fn nearest(analysis: &Analysis) -> Vec<(&'static str, String)> {
    let (nearest, file) = (&analysis.nearest, &analysis.cut.file);
    let margin = significant(100.0 * file.margin, 2);
    let speed = match nearest.spindle_rpm {
        Some(rpm) => format!("{} rpm at this depth", fixed(rpm, 0)),
        None => {
            let [from, to] = file.chart.spindle_rpm.map(|rpm| fixed(rpm, 0));
            format!("no speed from {from} to {to} rpm is stable at this depth")
        }
    };
    let depth = format!("{} mm deep at this speed", significant(1e3 * nearest.depth_m, 3));
    let turn = match nearest.turned {
        Some(one) => format!("feed turned by {}", turn(analysis, &one)),
        None => "no direction of feed is stable at this depth and speed".to_owned(),
    };
    vec![
        ("nearest cut", format!("stable with a margin of {margin} % in depth, one of:")),
        ("", format!("- {speed}")),
        ("", format!("- {depth}")),
        ("", format!("- {turn}")),
    ]
}

/// `40° (along 0.77, 0.64, 0)`: the angle by which the feed is turned, and its new direction.
fn turn(analysis: &Analysis, one: &FeedDirectionLimits) -> String {
    let [degrees, opposite] = [0.0, std::f64::consts::PI]
        .map(|more| fixed(signed_rad(one.angle_rad + more).to_degrees(), 0));
    // Forward and backward feed along one line have the same limit: both turn the forces and the modes by half a revolution.
    format!(
        "{degrees}° or {opposite}° (along {}, forward or backward)",
        direction(analysis.feed(one.angle_rad))
    )
}

pub(super) fn best_direction(analysis: &Analysis) -> String {
    match analysis.nearest.best {
        Some(best) => format!(
            "the best direction at this speed is turned by {}, with a limit of {}",
            turn(analysis, &best),
            limit_text(analysis, best.limit)
        ),
        None => "no direction was evaluated".to_owned(),
    }
}

pub(super) fn mode_coupling(analysis: &Analysis) -> String {
    let without = "without regeneration (a surface without chatter marks)";
    match analysis.mode_coupling {
        Some(limit) if limit.frequency_hz == 0.0 => {
            format!(
                "{without}, the tool is pulled into the cut from {} on",
                limit_text(analysis, Some(limit))
            )
        }
        Some(limit) => format!(
            "{without}, from {} on, at {} Hz, at any speed",
            limit_text(analysis, Some(limit)),
            significant(limit.frequency_hz, 3)
        ),
        None => format!("none to {}", limit_text(analysis, None).trim_start_matches("more than ")),
    }
}

fn direction(vector: [f64; 3]) -> String {
    // Plain zeros, none of them negative.
    vector.map(|x| fixed((100.0 * x).round() / 100.0 + 0.0, 2)).join(", ")
}
