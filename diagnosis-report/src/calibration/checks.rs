//! Objections to a calibrated model: reasons to reject it, and warnings.

use diagnosis::hold_out::{Calibration, PositionErrors};
use diagnosis::{
    Campaign, Fit, FitSettings, FreeParameter, Influence, gross_errors, joint_readback,
};
use recording::model::RobotModel;
use recording::series::{DirectionSource, Recording, RecordingKind};
use report::{fixed, pluralise};

use crate::entries::{PARALLEL_COSINE, ineffective_axis};

/// Reasons to reject the model: a larger error on the held-out poses than before, or a remaining gross error.
pub(super) fn rejection_reasons(
    [nominal, _, advanced]: &[PositionErrors; 3],
    campaign: &Campaign,
    last: &Fit,
) -> Vec<String> {
    let mm = |metres: f64| fixed(metres * 1e3, 4);
    // A NaN error counts as worse.
    let is_better = advanced.mean() <= nominal.mean();
    let worse = (!is_better).then(|| {
        format!(
            "mean error on held-out poses: {} mm with the new model, {} mm with the previous one; measure more poses or keep the previous model",
            mm(advanced.mean()),
            mm(nominal.mean())
        )
    });
    let faults = gross_errors::detect_gross_errors(campaign, &last.hypothesis.model);
    worse.into_iter().chain(faults.into_iter().map(|fault| fault.message)).collect()
}

/// Whether a parameter shifts a joint's axis along itself, which has no effect.
pub(super) fn is_along_axis(fit: &Fit, free: &FreeParameter) -> bool {
    let axis =
        fit.hypothesis.effect_of(free).and_then(|e| ineffective_axis(e, &fit.hypothesis.model.arm));
    axis.and_then(|axis| axis.to_array().get(free.value).copied())
        .is_some_and(|x| x.abs() > PARALLEL_COSINE)
}

/// Joint positions that were read back before the arm had settled.
pub(super) fn readback_warnings(
    recordings: &[Recording],
    base: &RobotModel,
    campaign: &Campaign,
    calibration: &Calibration,
    training: &[bool],
) -> Vec<String> {
    let contradictions = recordings.iter().filter_map(|recording| {
        let found = joint_readback::detect_readback_mismatch(recording, &base.physics)?;
        Some(format!("{}: {}", recording.file.display(), found.message))
    });
    let mut warnings: Vec<String> = contradictions.collect();
    let settings = FitSettings::full(training, Influence::Huber);
    let ahead = joint_readback::detect_early_readback(campaign, &calibration.calibrated, &settings);
    warnings.extend(ahead.map(|found| found.message));
    warnings
}

/// Warnings from the fit: residuals against the stated noise, parameters far from their priors, conditioning.
pub(super) fn fit_warnings(
    campaign: &Campaign,
    last: &Fit,
    settings: &super::Settings,
) -> Vec<String> {
    let mut warnings = Vec::new();
    for (instrument, factor) in campaign.instruments.iter().zip(&last.factors) {
        if instrument.noise_is_known && *factor > 1.0 {
            warnings.push(format!(
                "{}: the residuals are {} times as large as the stated noise (`sigma`): the noise is larger than stated, or the robot has errors that the model does not \
                 describe; intervals are widened by this factor",
                instrument.name,
                fixed(*factor, 2)
            ));
        }
    }
    for (what, deviation) in last.beyond_tolerance(settings.implausible_sigmas) {
        warnings.push(format!(
            "{what} is {} standard deviations of its tolerance from the prior; check the model's geometry, and whether these poses determine it",
            fixed(deviation, 1)
        ));
    }
    let condition = last.conditioning().condition;
    if condition > settings.condition_max {
        warnings.push(format!(
            "the identification is ill-conditioned (condition number {condition:.0e}); measure more varied poses"
        ));
    }
    warnings
}

/// Circumstances of recordings and held-out errors that make the model less certain.
pub(super) fn data_warnings(
    recordings: &[Recording],
    errors: &[PositionErrors; 3],
    last: &Fit,
) -> Vec<String> {
    let mut warnings = Vec::new();
    let numbers = last.hypothesis.free.iter().enumerate();
    let open = numbers
        .filter(|(k, free)| last.sigma(last.column_of(*k)).is_none() && !is_along_axis(last, free))
        .count();
    if open > 0 {
        warnings.push(format!(
            "{} of the model cannot be determined individually from these data: only their combination is determined, and each value follows its prior",
            pluralise(open, "number")
        ));
    }
    let [nominal, calibrated, advanced] = errors.each_ref().map(PositionErrors::mean);
    if advanced >= nominal {
        warnings.push("the advanced model is not better than the given model on held-out poses: do not use it; measure more poses".to_owned());
    } else if advanced > calibrated {
        warnings.push(
            "on held-out poses, the advanced model is worse than calibrated geometry alone; measure more poses"
                .to_owned(),
        );
    }
    if !last.converged {
        warnings.push(
            "the fit ended before it converged: its parameters are less certain than stated".into(),
        );
    }
    for recording in recordings {
        let about = &recording.metadata;
        if about.kind == RecordingKind::Poses && about.approach == DirectionSource::Unknown {
            warnings.push(format!(
                "{}: the approach direction of the joints is not stated (`approach`), so lost motion cannot be determined",
                recording.file.display()
            ));
        }
    }
    warnings
}
