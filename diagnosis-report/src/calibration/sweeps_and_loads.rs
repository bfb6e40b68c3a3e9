//! Separate analysis of single-joint sweeps and loaded poses, in addition to the overall fit.
//!
//! The removed gravity deflection is reported with its effect, as are joints that sweeps do not determine. The results do not enter the calibrated
//! model: its fit uses the same measurements jointly.

mod text;

use diagnosis::link_targets::{self, BaseTilt};
use diagnosis::load_pairs::{self, EnhancedEffectAtPose, NEGLIGIBLE_M};
use diagnosis::single_joint::{JointAxis, SagCorrection};
use diagnosis::stiffness::{Compliances, estimate_joint_by_joint};
use diagnosis::sweeps::{self, JointSweepModel, RelativeAxes, SweepResult};
use diagnosis::{Campaign, Fit};
use recording::series::Recording;
use serde::Serialize;

/// From rad to mrad, or m to mm.
const MILLI: f64 = 1e3;
/// From m to µm.
const MICRO: f64 = 1e6;
/// From rad/Nm to mrad/kNm.
const COMPLIANCE: f64 = 1e6;

/// Separate results of single-joint sweeps and of pairs of loaded and unloaded poses.
pub struct SweepsAndLoads {
    sweep_results: Vec<SweepResult>,
    joints: Vec<JointSweepModel>,
    axes: Vec<RelativeAxes>,
    pairs: usize,
    compliances: Option<Compliances>,
    by_links: Option<Compliances>,
    base_tilt: Option<BaseTilt>,
    load_effects: Vec<EnhancedEffectAtPose>,
    rows: Vec<(usize, usize)>,
    is_sag_removed: bool,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct SweepsAndLoadsReport {
    single_joint: Vec<SweepReport>,
    joint_models: Vec<ModelReport>,
    axes: Vec<AxesReport>,
    stiffness: Option<StiffnessReport>,
    base_tilt: Option<TiltReport>,
}

/// Tilt of the base at the pose with the largest tilt, relative to the first pose.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct TiltReport {
    row: usize,
    poses: usize,
    turn_mrad: [f64; 3],
    sigma_mrad: f64,
    blind: [f64; 3],
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct SweepReport {
    joint: usize,
    rows: [usize; 2],
    fault: Option<String>,
    targets: usize,
    tilt_mrad: Option<[f64; 2]>,
    sigma_tilt_mrad: Option<[f64; 2]>,
    shift_um: Option<[f64; 3]>,
    sigma_shift_um: Option<[f64; 2]>,
    noise_um: Option<f64>,
    sag: Option<SagReport>,
    steps: Vec<StepReport>,
}

/// Effect of the removal of the other joints' gravity deflection.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct SagReport {
    taken_out: bool,
    moved_points_um: f64,
    turned_axis_mrad: f64,
    shifted_axis_um: f64,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct StepReport {
    position_deg: f64,
    mean_mrad: f64,
    sigma_mrad: f64,
    half_lost_motion_mrad: Option<f64>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct ModelReport {
    joint: usize,
    what: String,
    value: f64,
    sigma: Option<f64>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct AxesReport {
    joints: [usize; 2],
    angle_mrad: f64,
    sigma_angle_mrad: f64,
    distance_mm: f64,
    sigma_distance_mm: f64,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct StiffnessReport {
    pairs: usize,
    joints: Vec<CompliantJoint>,
    /// From targets on the links, one joint after the other.
    one_by_one: Vec<CompliantJoint>,
    not_told: Vec<usize>,
    left: Option<f64>,
    by_load_um: Option<LoadDeflection>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct CompliantJoint {
    joint: usize,
    compliance_mrad_per_knm: f64,
    sigma: f64,
    stiffness_knm_per_rad: Option<f64>,
}

/// Effect of the load-induced change of geometry, with the resulting model.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct LoadDeflection {
    poses: usize,
    deflection_median: f64,
    deflection_max: f64,
    enhanced_median: f64,
    enhanced_max: f64,
    gravity_max: f64,
    negligible_below: f64,
    negligible_rows: Vec<usize>,
}

impl SweepsAndLoads {
    /// `fit` provides the poses of the instruments and the compliances.
    pub(super) fn of(
        campaign: &Campaign,
        recordings: &[Recording],
        fit: &Fit,
        sag: SagCorrection,
    ) -> Self {
        let (model, around) = (&fit.hypothesis.model, &fit.surroundings);
        let is_sag_removed = sag != SagCorrection::AsMeasured;
        let sweep_results =
            sweeps::analyse_sweeps(model, sag, sweeps::sweeps(&model.arm, campaign, around));
        let joints = sweeps::joint_models(&model.arm, &sweep_results);
        let axes = sweeps::relative_axes(&sweep_results);
        let pairs = load_pairs::pairs(&model.arm, campaign, around);
        let noise_m = typical_noise(campaign, fit);
        let compliances = load_pairs::compliances(&model.arm, &pairs, noise_m).ok().flatten();
        let on_links = link_targets::points(campaign, recordings, around);
        let cases = link_targets::loaded_links(&model.arm, campaign, &on_links);
        let by_links = estimate_joint_by_joint(&model.arm, &cases, noise_m).ok();
        let by_links = by_links.filter(|_| !cases.is_empty());
        // Where targets on the base define the measuring frame row by row, their motion is its drift, which is reported and removed: it is no tilt.
        let is_frame = campaign.recordings.iter().any(|source| source.frame_drift.is_some());
        let base_tilt = link_targets::base_tilt(&on_links, noise_m).filter(|_| !is_frame);
        let load_effects = load_pairs::enhanced_effects(model, campaign);
        let rows = campaign.poses.iter().map(|pose| (pose.recording, pose.row + 1)).collect();
        let pairs = pairs.len();
        Self {
            sweep_results,
            joints,
            axes,
            pairs,
            compliances,
            by_links,
            base_tilt,
            load_effects,
            rows,
            is_sag_removed,
        }
    }

    pub(super) fn report(&self) -> SweepsAndLoadsReport {
        SweepsAndLoadsReport {
            single_joint: self.sweep_results.iter().map(|result| self.sweep(result)).collect(),
            joint_models: self.joints.iter().flat_map(joint_model).collect(),
            axes: self.axes.iter().map(axes_report).collect(),
            stiffness: self.stiffness(),
            base_tilt: self.base_tilt.map(|tilt| TiltReport {
                row: self.rows[tilt.pose].1,
                poses: tilt.poses,
                turn_mrad: (tilt.largest.turn * MILLI).to_array(),
                sigma_mrad: tilt.largest.sigma_rad * MILLI,
                blind: tilt.largest.unobservable_axis.to_array(),
            }),
        }
    }

    fn sweep(&self, result: &SweepResult) -> SweepReport {
        let axis = result.axis.as_ref().ok();
        let error = result.error.as_ref();
        let errors = result.errors.iter().flat_map(|errors| &errors.steps);
        let sag = |axis: &JointAxis| SagReport {
            taken_out: self.is_sag_removed,
            moved_points_um: axis.moved_by_sag_m * MICRO,
            turned_axis_mrad: axis.turned_by_sag.length() * MILLI,
            shifted_axis_um: axis.shifted_by_sag.length() * MICRO,
        };
        SweepReport {
            joint: result.found.sweep.joint + 1,
            rows: [result.found.rows.0 + 1, result.found.rows.1 + 1],
            fault: result.axis.as_ref().err().map(ToString::to_string),
            targets: axis.map_or(0, |axis| axis.targets.len()),
            tilt_mrad: error.map(|error| error.tilt_rad.map(|x| x * MILLI)),
            sigma_tilt_mrad: error.map(|error| error.sigma_tilt_rad.map(|x| x * MILLI)),
            shift_um: error.map(|error| (error.shift_m * MICRO).to_array()),
            sigma_shift_um: error.map(|error| error.sigma_shift_m.map(|x| x * MICRO)),
            noise_um: axis.map(|axis| axis.axis.residual_rms_m * MICRO),
            sag: axis.map(sag),
            steps: errors
                .map(|step| StepReport {
                    position_deg: step.position_rad.to_degrees(),
                    mean_mrad: step.mean_rad * MILLI,
                    sigma_mrad: step.sigma_rad * MILLI,
                    half_lost_motion_mrad: step.half_lost_motion_rad.map(|x| x * MILLI),
                })
                .collect(),
        }
    }

    fn stiffness(&self) -> Option<StiffnessReport> {
        if self.compliances.is_none() && self.by_links.is_none() && self.load_effects.is_empty() {
            return None;
        }
        let open = |found: &Compliances| found.undetermined.iter().map(|j| j + 1).collect();
        Some(StiffnessReport {
            pairs: self.pairs,
            joints: self.compliances.iter().flat_map(compliant_joints).collect(),
            one_by_one: self.by_links.iter().flat_map(compliant_joints).collect(),
            not_told: self.compliances.as_ref().map(open).unwrap_or_default(),
            left: self.compliances.as_ref().map(|found| found.normalised_rms),
            by_load_um: self.load_deflection(),
        })
    }

    fn load_deflection(&self) -> Option<LoadDeflection> {
        let effects = || self.load_effects.iter().filter_map(|w| Some((w.pose, w.effect?)));
        let sorted = |quantity: &dyn Fn(&diagnosis::enhanced_stiffness::EnhancedEffect) -> f64| {
            let mut all: Vec<f64> =
                effects().map(|(_, effect)| quantity(&effect) * MICRO).collect();
            all.sort_by(f64::total_cmp);
            (all.get(all.len() / 2).copied(), all.last().copied())
        };
        let (deflection_median, deflection_max) = sorted(&|effect| effect.deflection_m);
        let (enhanced_median, enhanced_max) = sorted(&|effect| effect.by_wrench_m);
        let small = effects().filter(|(_, effect)| effect.by_wrench_m <= NEGLIGIBLE_M);
        Some(LoadDeflection {
            poses: self.load_effects.len(),
            deflection_median: deflection_median?,
            deflection_max: deflection_max?,
            enhanced_median: enhanced_median?,
            enhanced_max: enhanced_max?,
            gravity_max: sorted(&|effect| effect.by_gravity_m).1?,
            negligible_below: NEGLIGIBLE_M * MICRO,
            negligible_rows: small.map(|(pose, _)| self.rows[pose].1).collect(),
        })
    }

    /// Lines of text; empty without sweeps and loads.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        let report = self.report();
        let mut lines: Vec<String> = report.single_joint.iter().map(SweepReport::line).collect();
        lines.extend(report.axes.iter().map(AxesReport::line));
        lines.extend(report.stiffness.iter().flat_map(StiffnessReport::lines));
        lines.extend(report.base_tilt.iter().map(TiltReport::line));
        lines
    }
}

fn compliant_joints(found: &Compliances) -> Vec<CompliantJoint> {
    let joint = |(joint, value): (usize, &Option<f64>)| {
        Some(CompliantJoint {
            joint: joint + 1,
            compliance_mrad_per_knm: (*value)? * COMPLIANCE,
            sigma: found.sigma(joint) * COMPLIANCE,
            stiffness_knm_per_rad: found.stiffness(joint).map(|(k, _)| k * 1e-3),
        })
    };
    found.value.iter().enumerate().filter_map(joint).collect()
}

fn joint_model(joint_model: &JointSweepModel) -> Vec<ModelReport> {
    let hypothesis = &joint_model.model.hypothesis;
    let values = hypothesis.values();
    let each = hypothesis.free.iter().zip(values).zip(&joint_model.model.determined);
    each.map(|((free, value), determined)| ModelReport {
        joint: joint_model.joint + 1,
        what: hypothesis.describe(free),
        value: value * MILLI,
        sigma: determined.then_some(free.sigma * MILLI),
    })
    .collect()
}

fn axes_report(relative: &RelativeAxes) -> AxesReport {
    AxesReport {
        joints: [relative.joints.0 + 1, relative.joints.1 + 1],
        angle_mrad: relative.angle_rad * MILLI,
        sigma_angle_mrad: relative.sigma_angle_rad * MILLI,
        distance_mm: relative.distance_m * MILLI,
        sigma_distance_mm: relative.sigma_distance_m * MILLI,
    }
}

/// Fitted standard uncertainty of one coordinate of a point, m.
fn typical_noise(campaign: &Campaign, fit: &Fit) -> f64 {
    let mut all: Vec<f64> = Vec::new();
    for observation in campaign.poses.iter().flat_map(|pose| &pose.seen) {
        if matches!(observation.reading, diagnosis::Reading::Point { .. }) {
            let sigma = observation.whitening.determinant().abs().powf(-1.0 / 3.0);
            all.push(sigma * fit.factors[observation.instrument]);
        }
    }
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(1e-5)
}
