//! Output of `trued stability`: text and JSON.

use report::{fixed, significant};
use serde::Serialize;
use spectrum::stability::{Limit, Turned};

use super::found::{Found, signed_rad};
use crate::table::beside;

/// Width of the names before the lines.
const INDENT: usize = 14;

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "Hz is the unit's name")]
pub(super) struct Report {
    cut: CutReport,
    stable: bool,
    multiplier_modulus: f64,
    limit_mm: Option<f64>,
    zeroth_order_limit_mm: Option<f64>,
    mode_coupling_limit_mm: Option<f64>,
    mode_coupling_Hz: Option<f64>,
    chatter_Hz: Option<f64>,
    margin: f64,
    depth_max_mm: f64,
    nearest: NearestReport,
    best_direction: Option<DirectionReport>,
    modes: Vec<ModeReport>,
    chart: Vec<PointReport>,
    directions: Vec<DirectionReport>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct CutReport {
    spindle_rpm: f64,
    depth_mm: f64,
    teeth: u32,
    feed: [f64; 3],
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct NearestReport {
    spindle_rpm: Option<f64>,
    depth_mm: f64,
    direction: Option<DirectionReport>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "Hz and N are units' names")]
struct ModeReport {
    frequency_Hz: f64,
    damping_ratio: f64,
    stiffness_N_per_um: f64,
    direction: [f64; 3],
    tap: Option<String>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "Hz is the unit's name")]
struct PointReport {
    spindle_rpm: f64,
    limit_mm: Option<f64>,
    chatter_Hz: Option<f64>,
    zeroth_order_limit_mm: Option<f64>,
    zeroth_order_chatter_Hz: Option<f64>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "Hz is the unit's name")]
struct DirectionReport {
    turn_deg: f64,
    feed: [f64; 3],
    limit_mm: Option<f64>,
    chatter_Hz: Option<f64>,
    mode_coupling_limit_mm: Option<f64>,
}

/// A limit's depth, mm.
pub(super) fn depth_mm(limit: Option<Limit>) -> Option<f64> {
    limit.map(|limit| 1e3 * limit.depth_m)
}

fn hz(limit: Option<Limit>) -> Option<f64> {
    limit.map(|limit| limit.frequency_hz)
}

impl DirectionReport {
    fn of(found: &Found, one: &Turned) -> Self {
        Self {
            turn_deg: signed_rad(one.angle_rad).to_degrees(),
            feed: found.feed(one.angle_rad),
            limit_mm: depth_mm(one.limit),
            chatter_Hz: hz(one.limit),
            mode_coupling_limit_mm: depth_mm(one.mode_coupling),
        }
    }
}

impl Report {
    pub(super) fn of(found: &Found) -> Self {
        let (file, nearest) = (&found.file, &found.nearest);
        let direction = |one: &Turned| DirectionReport::of(found, one);
        let modes = found.modes.all.iter().map(|one| ModeReport {
            frequency_Hz: one.mode.frequency_hz,
            damping_ratio: one.mode.damping_ratio,
            stiffness_N_per_um: 1e-6 * one.mode.stiffness_n_per_m,
            direction: one.mode.direction,
            tap: one.tap.as_ref().map(|tap| tap.display().to_string()),
        });
        let chart = found.chart.iter().map(|point| PointReport {
            spindle_rpm: point.spindle_rpm,
            limit_mm: depth_mm(point.limit),
            chatter_Hz: hz(point.limit),
            zeroth_order_limit_mm: depth_mm(point.zeroth_order),
            zeroth_order_chatter_Hz: hz(point.zeroth_order),
        });
        Self {
            cut: CutReport {
                spindle_rpm: file.spindle_rpm,
                depth_mm: 1e3 * file.cut.axial_depth_m,
                teeth: file.cut.teeth,
                feed: found.feed(0.0),
            },
            stable: found.is_stable,
            multiplier_modulus: found.modulus,
            limit_mm: depth_mm(found.limit),
            zeroth_order_limit_mm: depth_mm(found.zeroth_order),
            mode_coupling_limit_mm: depth_mm(found.mode_coupling),
            mode_coupling_Hz: hz(found.mode_coupling),
            chatter_Hz: found.chatter_hz,
            margin: file.margin,
            depth_max_mm: 1e3 * file.chart.depth_max_m,
            nearest: NearestReport {
                spindle_rpm: nearest.spindle_rpm,
                depth_mm: 1e3 * nearest.depth_m,
                direction: nearest.turned.as_ref().map(direction),
            },
            best_direction: nearest.best.as_ref().map(direction),
            modes: modes.collect(),
            chart: chart.collect(),
            directions: found.directions.iter().map(direction).collect(),
            warnings: found.modes.warnings.clone(),
        }
    }
}

/// The lines on the console, at most 80 columns wide.
pub(super) fn told(found: &Found) -> String {
    let mut said = vec![
        ("cut", cut(found)),
        ("verdict", verdict(found)),
        ("limit", limit(found)),
        ("feed", best_direction(found)),
        ("mode coupling", mode_coupling(found)),
    ];
    if !found.nearest.is_present {
        let proposals = nearest(found);
        said.splice(3..3, proposals);
    }
    let lines = said.iter().flat_map(|(name, text)| beside(name, INDENT, text));
    lines.map(|line| line + "\n").collect()
}

/// A limit in words, in mm; beyond the largest depth it is stated as larger.
pub(super) fn words(found: &Found, limit: Option<Limit>) -> String {
    match depth_mm(limit) {
        Some(mm) => format!("{} mm", significant(mm, 3)),
        None => format!("more than {} mm", significant(1e3 * found.file.chart.depth_max_m, 3)),
    }
}

pub(super) fn cut(found: &Found) -> String {
    let file = &found.file;
    let number = found.modes.all.len();
    format!(
        "{} rpm, {} mm deep, feed along {}; {}",
        fixed(file.spindle_rpm, 0),
        significant(1e3 * file.cut.axial_depth_m, 3),
        direction(found.feed(0.0)),
        report::count(number, "mode")
    )
}

pub(super) fn verdict(found: &Found) -> String {
    let at =
        |hz: Option<f64>| hz.map_or_else(String::new, |hz| format!("{} Hz", significant(hz, 3)));
    if !found.is_stable {
        return format!("not stable: chatter at {}", at(found.chatter_hz));
    }
    let Some(limit) = found.limit else { return "stable".to_owned() };
    let times = limit.depth_m / found.file.cut.axial_depth_m;
    let far = match times {
        _ if times < 1.0 => {
            return "stable, in a pocket above the least limit of its speed".to_owned();
        }
        _ if times < 2.0 => format!("{} % above this depth", significant(100.0 * (times - 1.0), 2)),
        _ => format!("{} times this depth", significant(times, 2)),
    };
    let near = if found.nearest.is_present { "" } else { ", less than the margin" };
    format!("stable: the limit is {far}{near}; chatter would begin at {}", at(found.chatter_hz))
}

fn limit(found: &Found) -> String {
    format!(
        "{} at this speed by semi-discretisation, {} by the zeroth order",
        words(found, found.limit),
        words(found, found.zeroth_order)
    )
}

/// The nearest cuts that are stable with the margin.
pub(super) fn nearest(found: &Found) -> Vec<(&'static str, String)> {
    let (nearest, file) = (&found.nearest, &found.file);
    let margin = significant(100.0 * file.margin, 2);
    let speed = match nearest.spindle_rpm {
        Some(rpm) => format!("{} rpm at this depth", fixed(rpm, 0)),
        None => {
            let [from, to] = file.chart.spindle_rpm.map(|rpm| fixed(rpm, 0));
            format!("no speed from {from} to {to} rpm bears this depth")
        }
    };
    let depth = format!("{} mm deep at this speed", significant(1e3 * nearest.depth_m, 3));
    let turn = match nearest.turned {
        Some(one) => format!("feed turned by {}", turn(found, &one)),
        None => "no direction of feed bears this depth at this speed".to_owned(),
    };
    vec![
        ("nearest cut", format!("stable with {margin} % of depth in hand, one of:")),
        ("", format!("- {speed}")),
        ("", format!("- {depth}")),
        ("", format!("- {turn}")),
    ]
}

/// `40° (along 0.77, 0.64, 0)`: the angle by which the feed is turned, and its new direction.
fn turn(found: &Found, one: &Turned) -> String {
    let degrees = fixed(signed_rad(one.angle_rad).to_degrees(), 0);
    format!("{degrees}° (along {})", direction(found.feed(one.angle_rad)))
}

pub(super) fn best_direction(found: &Found) -> String {
    match found.nearest.best {
        Some(best) => format!(
            "the best direction at this speed is turned by {}, with a limit of {}",
            turn(found, &best),
            words(found, best.limit)
        ),
        None => "no direction was looked at".to_owned(),
    }
}

pub(super) fn mode_coupling(found: &Found) -> String {
    let without = "where teeth meet a surface that vibration did not mark";
    match found.mode_coupling {
        Some(limit) if limit.frequency_hz == 0.0 => {
            format!("{without}, the tool dives in from {} on", words(found, Some(limit)))
        }
        Some(limit) => format!(
            "{without}, from {} on, at {} Hz, at any speed",
            words(found, Some(limit)),
            significant(limit.frequency_hz, 3)
        ),
        None => format!("none to {}", words(found, None).trim_start_matches("more than ")),
    }
}

fn direction(vector: [f64; 3]) -> String {
    // Plain zeros, none of them negative.
    vector.map(|x| fixed((100.0 * x).round() / 100.0 + 0.0, 2)).join(", ")
}
