//! Evaluation of all series of a fleet: which changes are reported, and their effect at the tool.
//!
//! False alarms: every series has the same prior probability of a change, so many that in the whole fleet [`Settings::expected_changes`] are expected; more series
//! thus need more evidence each. A reported change has the posterior probability [`Settings::reported_probability`] or more. Measured on fleets that do not change:
//! `cargo run --release --example false_alarms`.

use schemars::JsonSchema;
use serde::Serialize;

use crate::change::{Change, ChangeKind, Estimate, most_probable_change};
use crate::results::{Results, RobotCounts, has_one_time};
use crate::series::{self, Series};
use crate::settings::Settings;
use crate::time::{after, day};

/// Name of the format.
pub const SCHEMA: &str = "trued.trends/1";

/// Report on a fleet.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[schemars(title = "trued.trends/1")]
pub struct Answer {
    /// `trued.trends/1`.
    pub schema: &'static str,
    /// Program that computed it.
    pub version: &'static str,
    /// Robots, by name.
    pub robots: Vec<RobotSummary>,
    /// Changes away from zero, the most probable first.
    pub alerts: Vec<Alert>,
    /// Changes towards zero: a repair, an adjustment.
    pub decreases: Vec<Alert>,
    /// Series that were searched for a change.
    pub series: usize,
    /// Tool error that is allowed, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance_mm: Option<f64>,
    /// The searched series, for pages.
    #[serde(skip)]
    #[schemars(skip)]
    pub searched: Vec<SearchedSeries>,
}

/// Summary of a robot.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct RobotSummary {
    /// Its name.
    pub robot: String,
    /// Recordings.
    pub recordings: usize,
    /// Number of refused recordings.
    pub refused: usize,
    /// Recordings without a time, which are left out.
    pub without_time: usize,
    /// Whether all its recordings of a domain have one and the same time, so that nothing can be said about them.
    pub has_one_time: bool,
    /// Day of the first recording with a time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<String>,
    /// Day of the last.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to: Option<String>,
    /// Series that were searched for a change.
    pub series: usize,
    /// Alerts.
    pub alerts: usize,
}

/// A change of a number.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Alert {
    /// Robot.
    pub robot: String,
    /// `position`, `torque` or `force`.
    pub domain: String,
    /// Effect, as in model files.
    pub effect: String,
    /// Joint, from 1; none for effects of the whole robot.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint: Option<i64>,
    /// Which of several effects of this kind at the joint: cycles per revolution (per metre), or the driving joint, as a whole number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub form: Option<i64>,
    /// Parameter with its unit, as in model files.
    pub parameter: String,
    /// Place in the list, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub index: Option<i64>,
    /// `new`: the model lacks the effect; `revised`: numbers are differences to those of the model.
    pub change: String,
    /// `step` or `growth`.
    pub kind: &'static str,
    /// Probability of a change, 0 to 1.
    pub probability: f64,
    /// Probability that it is of this kind, 0 to 1.
    pub kind_probability: f64,
    /// Since when.
    pub since: Onset,
    /// The number before, in the unit of the parameter.
    pub before: Interval,
    /// The number at the last recording.
    pub now: Interval,
    /// Growth per month (30.44 days); of a growth only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub per_month: Option<Interval>,
    /// Height of the step; of a step only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step: Option<Interval>,
    /// Size of the effect on the measured quantity (the tool, in the position domain) at the last recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_now: Option<EffectSize>,
    /// When its largest tool error reaches the tolerance, if the growth continues.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reaches_tolerance: Option<Reaches>,
    /// Recordings in which the effect was found.
    pub found: usize,
    /// Recordings in which it was not found, which bound it.
    pub below: usize,
    /// Recordings that name another effect in its place; they give no information.
    pub unknown: usize,
    /// Scatter between recordings beyond the stated uncertainty, in the unit of the parameter.
    pub scatter: f64,
    /// Change per kelvin of ambient temperature, which is compensated; none where it was not recorded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub per_kelvin: Option<f64>,
    /// Other numbers of the same effect that change, and other names that recordings give it: `EFFECT.PARAMETER`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub also: Vec<String>,
}

/// A number with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Interval {
    /// The number.
    pub value: f64,
    /// Its 95 % interval.
    pub ci95: [f64; 2],
}

/// The first recording that is changed.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Onset {
    /// Its day: the median of its probability.
    pub day: String,
    /// Days between which it lies with 95 %.
    pub day_ci95: [String; 2],
    /// Which of the robot's recordings, from 1.
    pub recording: usize,
    /// Recordings between which it lies with 95 %.
    pub recording_ci95: [usize; 2],
    /// µs since 1970, for drawings.
    #[serde(skip)]
    #[schemars(skip)]
    pub at_us: i64,
}

/// Size of an effect on the measured quantity.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct EffectSize {
    /// Root mean square.
    pub rms: f64,
    /// Largest.
    pub max: f64,
    /// `mm`, `mrad`, `Nm`, `N` or `m/s²`.
    pub unit: String,
}

/// When a tolerance is reached.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Reaches {
    /// Whether it is reached already.
    pub is_reached: bool,
    /// The day; none beyond the calendar.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub day: Option<String>,
    /// Earliest and latest day, from the interval of the growth.
    pub day_ci95: [Option<String>; 2],
}

/// A series with its change.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchedSeries {
    /// The series.
    pub series: Series,
    /// Its unit of size.
    pub unit: String,
    /// Most probable change.
    pub change: Change,
    /// Probability of a change.
    pub probability: f64,
    /// Whether it is reported.
    pub is_reported: bool,
}

impl SearchedSeries {
    /// Whether the number moves away from zero.
    #[must_use]
    pub fn is_worse(&self) -> bool {
        self.change.now.value.abs() > self.change.before.value.abs()
    }
}

/// Evaluates the results.
#[must_use]
pub fn evaluate(results: &Results, settings: &Settings) -> Answer {
    let all = series::all(results, settings);
    let changes: Vec<(Series, Change)> = all
        .into_iter()
        .filter_map(|series| most_probable_change(&series, settings).map(|change| (series, change)))
        .collect();
    let prior = (settings.expected_changes / changes.len().max(1) as f64).min(0.5);
    let odds = (prior / (1.0 - prior)).ln();
    let searched: Vec<SearchedSeries> = changes
        .into_iter()
        .map(|(series, change)| {
            let probability = 1.0 / (1.0 + (-change.log_bayes - odds).exp());
            let unit = unit(results, &series);
            SearchedSeries {
                is_reported: probability >= settings.reported_probability,
                series,
                unit,
                change,
                probability,
            }
        })
        .collect();
    let mut reported: Vec<&SearchedSeries> =
        searched.iter().filter(|one| one.is_reported).collect();
    reported.sort_by(|a, b| b.change.log_bayes.total_cmp(&a.change.log_bayes));
    let alerts = alerts_of(reported.iter().copied().filter(|one| one.is_worse()), settings);
    let decreases = alerts_of(reported.iter().copied().filter(|one| !one.is_worse()), settings);
    Answer {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        robots: results
            .counts
            .iter()
            .map(|count| summary(count, results, &searched, &alerts))
            .collect(),
        alerts,
        decreases,
        series: searched.len(),
        tolerance_mm: settings.tolerance_mm,
        searched,
    }
}

fn unit(results: &Results, series: &Series) -> String {
    let number = &series.number;
    let robot = results
        .recordings
        .keys()
        .find(|robot| robot.name == number.robot && robot.domain == number.domain);
    robot.map(|robot| robot.unit.clone()).unwrap_or_default()
}

fn summary(
    count: &RobotCounts,
    results: &Results,
    searched: &[SearchedSeries],
    alerts: &[Alert],
) -> RobotSummary {
    let of_robot = || results.recordings.iter().filter(|(robot, _)| robot.name == count.robot);
    let times: Vec<i64> =
        of_robot().flat_map(|(_, recordings)| recordings.iter().map(|one| one.at_us)).collect();
    RobotSummary {
        robot: count.robot.clone(),
        recordings: count.recordings,
        refused: count.refused,
        without_time: count.without_time,
        has_one_time: of_robot().any(|(_, recordings)| has_one_time(recordings)),
        from: times.iter().min().map(|time| day(*time)),
        to: times.iter().max().map(|time| day(*time)),
        series: searched.iter().filter(|one| one.series.number.robot == count.robot).count(),
        alerts: alerts.iter().filter(|alert| alert.robot == count.robot).count(),
    }
}

/// One for each effect: that of its most probable number. Another name that diagnoses give the same effect in other recordings is listed with it.
fn alerts_of<'a>(
    reported: impl Iterator<Item = &'a SearchedSeries>,
    settings: &Settings,
) -> Vec<Alert> {
    let mut alerts: Vec<(&SearchedSeries, Alert)> = Vec::new();
    for one in reported {
        let same = alerts.iter_mut().find(|(lead, _)| is_same(&lead.series, &one.series, settings));
        match same {
            Some((_, alert)) => alert.also.push(one.series.number.path()),
            None => alerts.push((one, alert(one, settings))),
        }
    }
    alerts.into_iter().map(|(_, alert)| alert).collect()
}

/// Whether two series belong to the same effect: parameters of one effect, or two names at one joint that rarely occur together.
fn is_same(lead: &Series, other: &Series, settings: &Settings) -> bool {
    let (a, b) = (&lead.number, &other.number);
    if (&a.robot, &a.domain, a.joint) != (&b.robot, &b.domain, b.joint) {
        return false;
    }
    let places = lead.places();
    let together = other.places().iter().filter(|place| places.contains(place)).count() as f64;
    let is_rival = together <= settings.beside_share * lead.found().min(other.found()) as f64;
    (&a.effect, a.form, &a.change) == (&b.effect, b.form, &b.change)
        || (a.effect != b.effect && is_rival)
}

fn alert(one: &SearchedSeries, settings: &Settings) -> Alert {
    let SearchedSeries { series, change, unit, .. } = one;
    let number = &series.number;
    let size_now = series.per_unit.map(|[rms, max]| {
        let now = change.now.value.abs();
        EffectSize { rms: rms * now, max: max * now, unit: unit.clone() }
    });
    Alert {
        robot: number.robot.clone(),
        domain: number.domain.clone(),
        effect: number.effect.clone(),
        joint: number.joint,
        form: number.form,
        parameter: number.parameter.clone(),
        index: number.index,
        change: number.change.clone(),
        kind: match change.kind {
            ChangeKind::Step => "step",
            ChangeKind::Growth => "growth",
        },
        probability: one.probability,
        kind_probability: change.kind_probability,
        since: since(series, change),
        before: interval(&change.before),
        now: interval(&change.now),
        per_month: (change.kind == ChangeKind::Growth).then(|| interval(&change.change)),
        step: (change.kind == ChangeKind::Step).then(|| interval(&change.change)),
        reaches_tolerance: tolerance_forecast(one, settings),
        size_now,
        found: series.found(),
        below: series.observations.len() - series.found(),
        unknown: series.unknown,
        scatter: change.scatter,
        per_kelvin: change.per_kelvin,
        also: Vec::new(),
    }
}

fn interval(estimate: &Estimate) -> Interval {
    Interval { value: estimate.value, ci95: [estimate.low, estimate.high] }
}

fn since(series: &Series, change: &Change) -> Onset {
    let [first, low, high] = change.first.map(|index| series.observations[index]);
    Onset {
        day: day(first.at_us),
        day_ci95: [day(low.at_us), day(high.at_us)],
        recording: first.place + 1,
        recording_ci95: [low.place + 1, high.place + 1],
        at_us: first.at_us,
    }
}

/// When the largest tool error of a growing effect reaches the tolerance.
fn tolerance_forecast(one: &SearchedSeries, settings: &Settings) -> Option<Reaches> {
    let (tolerance, [_, max]) = (settings.tolerance_mm?, one.series.per_unit?);
    let is_growing = one.change.kind == ChangeKind::Growth && one.is_worse() && one.unit == "mm";
    let last = one.series.observations.last()?.at_us;
    if !is_growing || max <= 0.0 {
        return None;
    }
    let to_go = tolerance / max - one.change.now.value.abs();
    let sign = one.change.now.value.signum();
    let rate = &one.change.change;
    let mut ends = [rate.low * sign, rate.high * sign];
    ends.sort_unstable_by(f64::total_cmp);
    let time_at = |rate: f64| (rate > 0.0).then(|| after(last, to_go / rate)).flatten();
    let mut days = [time_at(ends[1]), time_at(ends[0])];
    if to_go < 0.0 {
        days.reverse();
    }
    Some(Reaches {
        is_reached: to_go <= 0.0,
        day: time_at(rate.value * sign).map(day),
        day_ci95: days.map(|time| time.map(day)),
    })
}
