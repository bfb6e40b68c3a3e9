//! The three models with their errors on held-out poses, and the resulting model.
//!
//! Held-out poses that recordings reserve for validation are not used in the resulting model; those drawn at random are used after their errors have
//! been evaluated.

use diagnosis::diagnose::{ScreeningReport, motion_over_time, screen_recordings, sentences};
use diagnosis::hold_out::{self, Calibration, HoldOutSplit, PositionErrors};
use diagnosis::progress::{Listener, Progress, Stage, ignore};
use diagnosis::{
    Campaign, ExtendedModel, Fit, Pose, UndeterminedParameter, campaign_import, gross_errors,
};
use physics::{Arm, Chain};
use recording::model::RobotModel;
use recording::series::Recording;
use report::ToolError;

use super::checks::{
    data_warnings, fit_warnings, is_along_axis, readback_warnings, rejection_reasons,
};
use super::registered_sizes::registered_sizes;
use super::split::PoseSplit;
use super::{Settings, SweepsAndLoads, Tolerance, mm, undetermined};
use crate::drawings::tool_errors;
use crate::entries::{FittedEffect, PARALLEL_COSINE, fitted_effects};
use crate::error::Error;

/// A pose with a measurement of weight below one half.
pub struct Outlier {
    /// Index into the campaign's recordings.
    pub recording: usize,
    /// Row of the table, 1-based.
    pub row: usize,
    /// Largest residual, m.
    pub error_m: f64,
}

/// Held-out errors by the direction of approach of a joint.
pub struct ApproachErrors {
    /// 0-based.
    pub joint: usize,
    /// Errors after rising and falling motion, for each of the three models.
    pub errors: [[PositionErrors; 2]; 3],
}

/// Held-out errors of one recording.
pub struct RecordingErrors {
    /// Index into the campaign's recordings.
    pub recording: usize,
    /// Whether the joints that move have parallel axes, so that the tool stays in a plane.
    pub planar: bool,
    /// Errors of the nominal, calibrated and advanced models.
    pub errors: [PositionErrors; 3],
}

/// Held-out errors of one station of the instrument.
pub struct StationErrors {
    /// Index into the campaign's measuring frames.
    pub frame: usize,
    /// Index into the campaign's recordings.
    pub recording: usize,
    /// Errors of the three models.
    pub errors: [PositionErrors; 3],
}

/// A calibration with its validation.
pub struct CalibrationResult {
    /// The given model.
    pub base: RobotModel,
    /// The measurements.
    pub campaign: Campaign,
    /// Training poses of the three models.
    pub split: HoldOutSplit,
    /// The seed, if the held-out poses were drawn at random.
    pub seed: Option<u64>,
    /// Errors on held-out poses: nominal, calibrated, advanced ([`MODELS`](super::MODELS)).
    pub errors: [PositionErrors; 3],
    /// The fit of the resulting model.
    pub fit: Fit,
    /// Number of poses to which it was fitted.
    pub poses: usize,
    /// Its effects with their parameters in file units.
    pub entries: Vec<FittedEffect>,
    /// Poses with low weight in it.
    pub outliers: Vec<Outlier>,
    /// Errors of the held-out poses with measured points: with the nominal and the advanced model.
    pub(super) tool_errors: Vec<ToolError>,
    /// Errors of the joints that were approached from both directions.
    pub approach_errors: Vec<ApproachErrors>,
    /// Errors of the recordings with held-out poses.
    pub recording_errors: Vec<RecordingErrors>,
    /// Errors of the instrument's stations; empty if there is only one.
    pub station_errors: Vec<StationErrors>,
    /// Analyses of single joints and of loads.
    pub sweeps_and_loads: SweepsAndLoads,
    /// Warnings, one sentence each.
    pub warnings: Vec<String>,
    /// Why the model must not be used, one sentence each; empty if the held-out errors support it.
    pub rejection_reasons: Vec<String>,
    tolerance_mm: Option<f64>,
}

/// Calibrates `base` by recordings of one robot. `listener` is told of the progress, by [`Stage::CALIBRATION`].
///
/// # Errors
/// [`Error::GrossFaults`] if recordings and model do not match; [`Error::Input`] if recordings cannot be used with this model or contain too few
/// poses.
pub fn calibrate(
    base: RobotModel,
    recordings: &[Recording],
    settings: &Settings,
    listener: Listener<'_>,
) -> Result<CalibrationResult, Error> {
    listener(Stage::CalibrationScreening, Progress::Begun);
    let mut recordings = recordings.to_vec();
    let ScreeningReport { notes, doubts } = screen_recordings(&base.physics.arm, &mut recordings);
    if !doubts.is_empty() {
        return Err(Error::input(doubts.join("; ")));
    }
    let campaign =
        campaign_import::campaign(&base.physics.arm, &recordings).map_err(Error::input)?;
    let parts = PoseSplit::of(&campaign, &recordings, settings)?;
    let faults = gross_errors::detect_global_errors(&campaign, &base.physics);
    if !faults.is_empty() {
        return Err(Error::GrossFaults(faults));
    }
    let fitted = FittedModels::of(&base, &campaign, &parts, listener);
    listener(Stage::CalibrationChecks, Progress::Begun);
    let mut result = CalibrationResult::of(base, &recordings, campaign, parts, fitted, settings)?;
    result.warnings.splice(..0, notes);
    Ok(result)
}

/// The three models of the training poses, and the resulting one.
struct FittedModels {
    calibration: Calibration,
    written: ExtendedModel,
    /// Poses to which the resulting model was fitted.
    used: Vec<bool>,
}

impl FittedModels {
    fn of(
        base: &RobotModel,
        campaign: &Campaign,
        PoseSplit { split, seed }: &PoseSplit,
        listener: Listener<'_>,
    ) -> Self {
        let training = &split.training;
        // Poses that were held out at random are used in the resulting model, which is selected and fitted again on all poses and so does not depend
        // on the seed. Poses that a recording reserves for validation are used in no fit.
        let used = if seed.is_some() { vec![true; campaign.poses.len()] } else { training.clone() };
        let recalibrated = |used: &[bool]| {
            hold_out::calibrate(campaign, &base.physics, &base.sigma, used, &ignore).advanced
        };
        let (calibration, written) = std::thread::scope(|scope| {
            let written = seed.is_some().then(|| scope.spawn(|| recalibrated(&used)));
            let proven =
                hold_out::calibrate(campaign, &base.physics, &base.sigma, training, listener);
            listener(Stage::CalibrationAllPoses, Progress::Begun);
            (proven, written.map(std::thread::ScopedJoinHandle::join))
        });
        let written = match written {
            None => calibration.advanced.clone(),
            Some(Ok(written)) => written,
            Some(Err(_)) => recalibrated(&used),
        };
        Self { calibration, written, used }
    }
}

impl CalibrationResult {
    fn of(
        base: RobotModel,
        recordings: &[Recording],
        campaign: Campaign,
        PoseSplit { split, seed }: PoseSplit,
        FittedModels { calibration, written, used }: FittedModels,
        settings: &Settings,
    ) -> Result<Self, Error> {
        let training = &split.training;
        let (fit, chosen) = (written.fit, written.chosen);
        let held = split.held_out();
        let errors = fits(&calibration).map(|fit| PositionErrors::of(fit, &campaign, &held));
        let mut warnings = readback_warnings(recordings, &base, &campaign, &calibration, training);
        let shares_m = registered_sizes(&campaign, &fit, &used);
        let entries = fitted_effects(&base, &fit, &chosen, &shares_m)?;
        warnings.extend(data_warnings(recordings, &errors, &fit));
        warnings.extend(fit_warnings(&campaign, &fit, settings));
        let moved = motion_over_time(&campaign, &fit, &used);
        warnings.extend(moved.map(|part| sentences::structure(part, &["t_s".to_owned()], None)));
        let [nominal, _, advanced] = fits(&calibration);
        let is_held = |pose: usize| held.get(pose).copied().unwrap_or(false);
        let arm = &base.physics.arm;
        Ok(Self {
            rejection_reasons: rejection_reasons(&errors, &campaign, &fit),
            outliers: outliers(&campaign, &fit),
            approach_errors: approach_errors(&campaign, &calibration, &held),
            tool_errors: tool_errors(&campaign, arm, [nominal, advanced], is_held),
            recording_errors: recording_errors(
                &campaign,
                &calibration,
                &held,
                settings.rest_tolerance,
            ),
            station_errors: station_errors(&campaign, fits(&calibration), &held),
            sweeps_and_loads: SweepsAndLoads::of(&campaign, recordings, &fit, settings.sag),
            poses: used.iter().filter(|used| **used).count(),
            tolerance_mm: settings.tolerance_mm,
            base,
            campaign,
            split,
            seed,
            errors,
            fit,
            entries,
            warnings,
        })
    }

    /// Whether the validation supports the model: on held-out poses it is no worse than the given one, and no gross error remains.
    #[must_use]
    pub fn is_validated(&self) -> bool {
        self.rejection_reasons.is_empty()
    }

    /// The resulting model compared with the tolerance, if one is stated.
    #[must_use]
    pub fn tolerance(&self) -> Option<Tolerance> {
        let tolerance_mm = self.tolerance_mm?;
        let [.., advanced] = &self.errors;
        let p95_mm = mm(advanced.quantile(0.95));
        Some(Tolerance { tolerance_mm, p95_mm, met: p95_mm <= tolerance_mm })
    }

    /// Parameters that the data do not determine, except the shift of an axis along itself, which has no effect.
    fn undetermined_parameters(&self) -> impl Iterator<Item = &UndeterminedParameter> {
        let first = self.fit.column_of(0);
        let is_something = move |open: &&UndeterminedParameter| {
            let free = open.column.checked_sub(first).and_then(|k| self.fit.hypothesis.free.get(k));
            !free.is_some_and(|free| is_along_axis(&self.fit, free))
        };
        self.fit.undetermined.iter().filter(is_something)
    }

    /// One sentence for each parameter that the data do not determine.
    #[must_use]
    pub fn undetermined_sentences(&self) -> Vec<String> {
        self.undetermined_parameters().map(UndeterminedParameter::message).collect()
    }

    /// The undetermined parameters, one sentence per reason.
    #[must_use]
    pub fn undetermined_by_reason(&self) -> Vec<String> {
        undetermined::sentences(&self.fit, self.undetermined_parameters())
    }

    /// Drift of the instruments, one sentence each.
    #[must_use]
    pub fn frame_drift(&self) -> Vec<String> {
        let nests =
            self.campaign.recordings.iter().filter_map(|source| source.frame_drift.as_ref());
        nests.map(diagnosis::frame_drift::FrameDrift::description).collect()
    }

    /// The name of a recording, without its folder.
    #[must_use]
    pub fn recording_name(&self, place: usize) -> &str {
        let name = self.campaign.recordings.get(place).map_or("", |source| source.name.as_str());
        std::path::Path::new(name).file_name().and_then(|name| name.to_str()).unwrap_or(name)
    }
}

fn outliers(campaign: &Campaign, last: &Fit) -> Vec<Outlier> {
    let residuals = last.residuals(campaign);
    let worst = |pose: usize| {
        let lengths =
            residuals.iter().filter(|residual| residual.pose == pose && residual.is_length);
        lengths.map(|residual| residual.residual.length()).fold(0.0, f64::max)
    };
    let outlier = |place: usize| {
        let pose = &campaign.poses[place];
        Outlier { recording: pose.recording, row: pose.row + 1, error_m: worst(place) }
    };
    last.outliers(campaign).into_iter().map(outlier).collect()
}

/// Nominal, calibrated, advanced.
fn fits(calibration: &Calibration) -> [&Fit; 3] {
    [&calibration.nominal, &calibration.calibrated, &calibration.advanced.fit]
}

fn recording_errors(
    campaign: &Campaign,
    calibration: &Calibration,
    held: &[bool],
    still: f64,
) -> Vec<RecordingErrors> {
    let errors_of = |recording: usize| {
        let poses = campaign.poses.iter().zip(held);
        let wanted: Vec<bool> = poses.map(|(p, held)| *held && p.recording == recording).collect();
        let errors = fits(calibration).map(|fit| PositionErrors::of(fit, campaign, &wanted));
        let planar = is_planar(&calibration.nominal.hypothesis.model.arm, campaign, &wanted, still);
        RecordingErrors { recording, planar, errors }
    };
    let all = (0..campaign.recordings.len()).map(errors_of);
    all.filter(|one| !one.errors[0].sorted_m.is_empty()).collect()
}

/// Whether the axes of all joints that move between these poses are parallel.
fn is_planar(arm: &Arm, campaign: &Campaign, wanted: &[bool], still: f64) -> bool {
    let poses = || campaign.poses.iter().zip(wanted).filter(|(_, w)| **w).map(|(pose, _)| pose);
    let Some(first) = poses().next() else { return false };
    let q = first.inputs.q;
    let chain = Chain::nominal(arm, &q);
    let moves = |joint: &usize| poses().any(|p| (p.inputs.q[*joint] - q[*joint]).abs() > still);
    let moving: Vec<usize> = (0..arm.count()).filter(moves).collect();
    moving.iter().all(|joint| chain.axis(moving[0]).dot(chain.axis(*joint)).abs() > PARALLEL_COSINE)
}

fn station_errors(campaign: &Campaign, fits: [&Fit; 3], held: &[bool]) -> Vec<StationErrors> {
    let of_frame = |frame: usize| {
        let is_from_station = |pose: &Pose| pose.frame() == Some(frame);
        let recording = campaign.poses.iter().find(|pose| is_from_station(pose))?.recording;
        let poses = campaign.poses.iter().zip(held);
        let wanted: Vec<bool> = poses.map(|(pose, held)| *held && is_from_station(pose)).collect();
        let errors = fits.map(|fit| PositionErrors::of(fit, campaign, &wanted));
        Some(StationErrors { frame, recording, errors })
    };
    let frames = campaign.surroundings.frames.len();
    let all = (0..frames).filter_map(of_frame).filter(|one| !one.errors[0].sorted_m.is_empty());
    if frames > 1 { all.collect() } else { Vec::new() }
}

fn approach_errors(
    campaign: &Campaign,
    calibration: &Calibration,
    held: &[bool],
) -> Vec<ApproachErrors> {
    let fits = fits(calibration);
    let of_joint = |joint: usize| {
        let arrived = |sign: f64| -> Vec<bool> {
            let poses = campaign.poses.iter().zip(held);
            poses.map(|(pose, held)| *held && pose.inputs.direction[joint] == sign).collect()
        };
        let (rising, falling) = (arrived(1.0), arrived(-1.0));
        let errors = fits
            .map(|fit| [&rising, &falling].map(|wanted| PositionErrors::of(fit, campaign, wanted)));
        ApproachErrors { joint, errors }
    };
    let known = |one: &ApproachErrors| one.errors[0].iter().all(|e| !e.sorted_m.is_empty());
    let joints = calibration.nominal.hypothesis.model.arm.count();
    (0..joints).map(of_joint).filter(known).collect()
}
