//! Data for the plots of a diagnosis: residuals before and after, over time, as a spectrum, and over the covariates of the findings. They are
//! computed from the existing fits.

use super::covariates::{Covariate, all_covariates};
use super::{Diagnosis, Finding};
use crate::campaign::{Reading, ToolPoint};
use crate::engine::statistics::median;
use crate::fit_result::Fit;
use crate::hold_out::runs;
use crate::hypothesis::Hypothesis;
use crate::least_squares::{FitState, VisitScope, visit_readings};
use crate::tool_motion::ToolMotion;
use glam::DVec3;
use physics::{AnyEffect, Chain};
use spectrum::welch::{Segments, welch};

/// Relative deviation from the median time step above which a step is not even.
const EVEN_TOLERANCE: f64 = 0.02;
/// Least number of samples of a spectrum, and largest length of its segments.
const SAMPLES_MIN: usize = 64;
const SEGMENT_MAX: usize = 1024;
/// Share of the energy of a finding, in the measured values, that an error of its joint must be able to represent. Below it the finding is shown as
/// tool displacement: a growing link, for example, does not rotate its joint.
const JOINT_ENERGY_SHARE: f64 = 0.5;

/// Residuals of one channel over the recording.
#[derive(Clone, Debug, PartialEq)]
pub struct ResidualSeries {
    /// Name of the channel: `x`, `target2 y`, `joint 3`.
    pub channel: String,
    /// Pose of each measurement, and measured minus predicted value with the model as given and with the final model, m or rad.
    pub off: Vec<(usize, [f64; 2])>,
}

/// One measurement, over the covariate of a finding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CovariatePoint {
    /// Value of the covariate, SI.
    pub at: f64,
    /// Sign of the joint's last motion; 0 if it is unknown or there is no joint.
    pub direction: f64,
    /// Residual with all effects but this finding: rad or m of its joint, or m of the tool.
    pub seen: f64,
    /// Part of it that the finding explains.
    pub explained: f64,
}

/// Measurements over the covariate that a finding depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct CovariatePlot {
    /// Name of the covariate (docs/reference/results.md).
    pub word: String,
    /// Index of the joint, from 0, whose error is plotted; `None` for displacement of the tool.
    pub joint: Option<usize>,
    /// One per measurement in which the finding is visible.
    pub points: Vec<CovariatePoint>,
}

/// Spectra of the residuals: power spectral density by Welch's method, m² (rad²) per Hz, mean of the channels.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectra {
    /// Frequencies, Hz.
    pub frequencies_hz: Vec<f64>,
    /// Density with the model as given, and with the final model.
    pub density: [Vec<f64>; 2],
    /// Duration of the evenly sampled section, s.
    pub duration_s: f64,
}

impl Diagnosis {
    /// Time of each pose since the first, s, with recordings and segments in sequence.
    #[must_use]
    pub fn elapsed_s(&self) -> Vec<f64> {
        let mut elapsed = vec![0.0; self.campaign.poses.len()];
        let mut from = 0.0;
        for run in runs(&self.campaign) {
            let time = |pose: usize| self.campaign.poses[pose].inputs.time_s;
            let first = time(run.start);
            let last = from + time(run.end - 1) - first;
            run.for_each(|pose| elapsed[pose] = from + time(pose) - first);
            from = last;
        }
        elapsed
    }

    /// Residuals of every channel with the model as given and with the final model.
    #[must_use]
    pub fn traces(&self) -> Vec<ResidualSeries> {
        let (given, last) =
            (self.given.residuals(&self.campaign), self.fit.residuals(&self.campaign));
        let readings = self.campaign.poses.iter().flat_map(|pose| &pose.seen);
        let mut traces: Vec<ResidualSeries> = Vec::new();
        for ((before, after), observation) in given.iter().zip(&last).zip(readings) {
            for (part, channel) in channel_names(&observation.reading).into_iter().enumerate() {
                let residuals = (before.pose, [before.residual[part], after.residual[part]]);
                match traces.iter_mut().find(|trace| trace.channel == channel) {
                    Some(trace) => trace.off.push(residuals),
                    None => traces.push(ResidualSeries { channel, off: vec![residuals] }),
                }
            }
        }
        traces
    }

    /// Lengths of the residuals on the test set, m or rad: with the model as given and with the final model.
    #[must_use]
    pub fn held_out(&self) -> [Vec<f64>; 2] {
        let held = |fit: &Fit| {
            let residuals = fit.residuals(&self.campaign).into_iter();
            let residuals = residuals.filter(|residual| !self.split.training[residual.pose]);
            residuals
                .filter(|residual| residual.is_length == self.test_errors.is_length)
                .map(|residual| residual.residual.length())
                .collect()
        };
        [held(&self.given), held(&self.fit)]
    }

    /// Spectra of the longest evenly sampled section of a path; `None` if it is too short or the poses are settled.
    #[must_use]
    pub fn spectra(&self) -> Option<Spectra> {
        let elapsed = self.elapsed_s();
        let mut traces = self.traces();
        traces.retain(|trace| trace.off.len() >= SAMPLES_MIN);
        let follows =
            |pose: usize| self.campaign.poses[pose].arrival == crate::Arrival::FromPrevious;
        let times: Vec<f64> = traces.first()?.off.iter().map(|(pose, _)| elapsed[*pose]).collect();
        let (stretch, step) = longest_even_section(&times)?;
        if !stretch.clone().skip(1).all(|k| follows(traces[0].off[k].0)) {
            return None;
        }
        let count = stretch.len();
        let length = (count / 4).next_power_of_two().min(SEGMENT_MAX);
        let segments = Segments::new(1.0 / step, length);
        let mut density: [Vec<f64>; 2] = Default::default();
        let mut frequencies_hz = Vec::new();
        let mut channels = 0.0;
        for trace in traces.iter().filter(|trace| trace.off.len() >= stretch.end) {
            channels += 1.0;
            for (side, sum) in density.iter_mut().enumerate() {
                let samples: Vec<f64> = stretch.clone().map(|k| trace.off[k].1[side]).collect();
                let found = welch(&samples, &segments).ok()?;
                sum.resize(found.power.len(), 0.0);
                sum.iter_mut().zip(&found.power).for_each(|(sum, power)| *sum += power);
                frequencies_hz = found.frequency;
            }
        }
        density.iter_mut().flatten().for_each(|power| *power /= channels);
        Some(Spectra { frequencies_hz, density, duration_s: step * (count - 1) as f64 })
    }

    /// A finding over the covariate that it depends on; `None` if that is constant.
    #[must_use]
    pub fn over(&self, finding: &Finding) -> Option<CovariatePlot> {
        let covariates = all_covariates(&self.campaign, &self.given.hypothesis.model);
        let covariate = main_covariate(finding, &covariates)?;
        let joint = finding.effect.joint();
        let direction = joint.map(|joint| format!("direction_{}", joint + 1));
        let direction =
            covariates.iter().find(|covariate| Some(&covariate.name) == direction.as_ref());
        let (shown_in, points) = self.joint_residuals(finding);
        let points = points.into_iter().map(|(pose, seen, explained)| CovariatePoint {
            at: covariate.centre + covariate.half_range * covariate.values[pose],
            direction: direction
                .map_or(0.0, |d| (d.centre + d.half_range * d.values[pose]).round()),
            seen,
            explained,
        });
        Some(CovariatePlot {
            word: covariate.name.clone(),
            joint: shown_in,
            points: points.collect(),
        })
    }

    /// The final model without this finding.
    fn model_without(&self, finding: &Finding) -> Hypothesis {
        let whole = &self.fit.hypothesis;
        let Some(stated_values) = &finding.stated else {
            return whole.without(finding.effect_index);
        };
        let mut without = whole.clone();
        without.model.change(finding.effect_index, |effect| {
            effect.values_mut().copy_from_slice(stated_values);
        });
        without
    }

    /// The joint whose error is plotted (`None`: the tool), and pose, residual without the finding, and the part of it that the finding explains.
    fn joint_residuals(&self, finding: &Finding) -> (Option<usize>, Vec<(usize, f64, f64)>) {
        let without = self.model_without(finding);
        let Some(joint) = finding.effect.joint() else {
            return (None, self.tool_residuals(&without));
        };
        let state = |hypothesis: Hypothesis| FitState {
            surroundings: self.fit.surroundings.clone(),
            hypothesis,
        };
        let scope = VisitScope { used: None, derivatives: false };
        let arm = self.fit.hypothesis.model.arm;
        let mut whole = Vec::new();
        let full = state(self.fit.hypothesis.clone());
        visit_readings(&self.campaign, &full, scope, |reading| whole.push(reading.rows.residual));
        let mut points = Vec::new();
        visit_readings(&self.campaign, &state(without.clone()), scope, |reading| {
            let chain = Chain::nominal(&arm, &self.campaign.poses[reading.pose].inputs.q);
            let along = reading.rows.derivative_along(&ToolMotion::of_joint(&arm, &chain, joint));
            points.push((reading.pose, along, reading.rows.residual));
        });
        let explained = points.iter().zip(&whole).map(|(p, full)| (p.1, p.2 - *full));
        let [all, along] = explained.fold([0.0; 2], |[all, shown], (along, explained)| {
            let part = along.normalize_or_zero().dot(explained);
            [all + explained.length_squared(), shown + part * part]
        });
        let at_tool = if along < JOINT_ENERGY_SHARE * all {
            self.tool_residuals(&without)
        } else {
            Vec::new()
        };
        if !at_tool.is_empty() {
            return (None, at_tool);
        }
        // Poses at which the joint hardly moves the measured point do not determine its error.
        let most = points.iter().map(|p| p.1.length_squared()).fold(0.0, f64::max);
        let both = points.into_iter().zip(whole).zip(&self.fit.weights);
        let tool_points = both
            .filter(|((p, _), weight)| p.1.length_squared() > 0.04 * most && **weight >= 0.5)
            .map(|(((pose, along, without), full), _)| {
                let share = along / along.length_squared();
                (pose, share.dot(without), share.dot(without - full))
            });
        (Some(joint), tool_points.collect())
    }

    /// The same at the tool, along the displacement by the finding: pose, residual without the finding, and the part that it explains, m.
    fn tool_residuals(&self, without: &Hypothesis) -> Vec<(usize, f64, f64)> {
        let whole = self.fit.residuals(&self.campaign);
        let mut fit = self.fit.clone();
        fit.hypothesis = without.clone();
        let without = fit.residuals(&self.campaign);
        let pairs = whole.iter().zip(&without).filter(|(whole, _)| whole.is_length);
        pairs
            .map(|(whole, without)| {
                let explained: DVec3 = without.residual - whole.residual;
                let along = explained.normalize_or_zero();
                (whole.pose, along.dot(without.residual), explained.length())
            })
            .collect()
    }
}

/// Names of the coordinates of a measurement.
fn channel_names(reading: &Reading) -> Vec<String> {
    let axes = |prefix: String| ["x", "y", "z"].map(|axis| format!("{prefix}{axis}")).to_vec();
    match reading {
        Reading::Point { place: ToolPoint::Tcp, .. } => axes(String::new()),
        Reading::Point { place: ToolPoint::Target(target), .. } => {
            axes(format!("target{} ", target + 1))
        }
        Reading::Orientation { .. } => axes("turned about ".to_owned()),
        Reading::JointPosition { joint, .. } => vec![format!("joint {}", joint + 1)],
        Reading::Distance { anchor, .. } => vec![format!("distance {}", anchor + 1)],
        Reading::Plane { plane, .. } => vec![format!("plane {}", plane + 1)],
        Reading::Sphere { sphere, .. } => vec![format!("sphere {}", sphere + 1)],
    }
}

/// The main covariate of an effect, among those that vary.
fn main_covariate<'a>(finding: &Finding, covariates: &'a [Covariate]) -> Option<&'a Covariate> {
    let effect = &finding.effect;
    let n = effect.joint().map_or(0, |joint| joint + 1);
    let other = finding.settings.iter().find(|(stem, _)| *stem == "from_joint");
    let other = other.and_then(|(_, numbers)| numbers.first()).map_or(n, |from| *from as usize);
    let load = match effect {
        AnyEffect::LoadCompliance(_) => "wrench".to_owned(),
        _ => format!("tau{n}"),
    };
    let wanted: Vec<String> = match effect.spec().kind {
        "joint_compliance"
        | "gravity_compliance"
        | "load_compliance"
        | "stiffness_hardening"
        | "lost_motion"
        | "bearing_compliance"
        | "counterbalance" => {
            vec![load, format!("q{n}")]
        }
        "thermal_zero" | "thermal_growth" | "spindle_growth" => {
            vec![format!("temp{n}_C"), "temp_C".to_owned(), "t_s".to_owned()]
        }
        "joint_coupling" => vec![format!("q{other}")],
        "tool_compliance" | "payload" | "base_compliance" => {
            vec!["wrench".to_owned(), "tau2".to_owned(), "q2".to_owned()]
        }
        _ => vec![format!("q{n}"), "t_s".to_owned()],
    };
    wanted.iter().find_map(|name| covariates.iter().find(|covariate| covariate.name == *name))
}

/// The longest evenly sampled section, and its time step, s.
fn longest_even_section(times: &[f64]) -> Option<(std::ops::Range<usize>, f64)> {
    let steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.first()?;
    let step = median(steps.iter().copied());
    let mut best = 0..0;
    let mut from = 0;
    for (k, interval) in steps.iter().enumerate() {
        if (interval - step).abs() > EVEN_TOLERANCE * step {
            from = k + 1;
        }
        if k + 2 - from > best.len() {
            best = from..k + 2;
        }
    }
    (step > 0.0 && best.len() >= SAMPLES_MIN).then_some((best, step))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_even_stretch_is_found_between_gaps() {
        let mut times: Vec<f64> = (0..900).map(|k| 0.01 * f64::from(k)).collect();
        times[200..].iter_mut().for_each(|t| *t += 1.0);
        times[800..].iter_mut().for_each(|t| *t += 0.5);
        let (stretch, step) = longest_even_section(&times).expect("long enough");
        assert_eq!(stretch, 200..800);
        assert!((step - 0.01).abs() < 1e-9);
        assert_eq!(longest_even_section(&times[..SAMPLES_MIN - 1]), None);
        assert_eq!(longest_even_section(&[]), None);
    }
}
