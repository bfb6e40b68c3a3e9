//! Comparison of measured joint positions with the commanded ones and with the measured tool position.
//!
//! At settled poses both agree to a few thousandths of a degree. A controller that is read too early returns positions before
//! the target, which degrade any calibration.
//!
//! Only for settled poses; messages state which positions to use. The recording is not changed.

use crate::campaign::Campaign;
use crate::campaign_import;
use crate::candidates::candidates;
use crate::fit::{FitSettings, fit};
use crate::fit_result::Fit;
use crate::geometry::{Tolerances, geometry_with_tolerances};
use crate::gross_errors::SuspectedError;
use crate::hold_out::PositionErrors;
use crate::robust_weights::Influence;
use crate::score_test::ScoreTest;
use physics::{AnyEffect, Model};
use recording::series::{Channel, InputKind, Recording, RecordingKind};

/// Positions that differ by less are equal, rad or m.
const SAME: f64 = 2e-4;
/// One kind of position is worse if its error is this many times larger.
const WORSE: f64 = 1.3;
/// Improvement of the sum of squares, in units of the noise variance, above which a backlash of negative width is significant.
const CERTAIN: f64 = 30.0;

/// Whether commanded and read-back positions of `recording` contradict each other, and which of them agree with the tool.
#[must_use]
pub fn detect_readback_mismatch(recording: &Recording, model: &Model) -> Option<SuspectedError> {
    let joints = model.arm.count();
    let both = |joint: &usize| {
        recording.column(Channel::Command(*joint)).is_some()
            && recording.column(Channel::Motor(*joint)).is_some()
    };
    if recording.metadata.kind != RecordingKind::Poses || !(0..joints).all(|joint| both(&joint)) {
        return None;
    }
    let apart = ReadbackDifference::of(recording, joints);
    if apart.rms <= SAME {
        return None;
    }
    let left = |input: InputKind| {
        let mut other = recording.clone();
        other.metadata.input = Some(input);
        let campaign = campaign_import::campaign(&model.arm, &[other]).ok()?;
        let used = vec![true; campaign.poses.len()];
        let influence = Influence::Huber;
        let settings = FitSettings::full(&used, influence);
        let within = geometry_with_tolerances(model, &[], &Tolerances::default(), &campaign);
        let found = fit(&campaign, &within, &settings);
        Some(PositionErrors::of(&found, &campaign, &used).quantile(0.5))
    };
    let (commanded, read) = (left(InputKind::Command)?, left(InputKind::Motor)?);
    let early = if apart.short > 0.75 {
        format!(
            "in {:.0} % of the moves they end before the target, so they were read before the arm had settled; ",
            apart.short * 100.0
        )
    } else {
        String::new()
    };
    let (verdict, before_m, after_m) = if read > WORSE * commanded {
        (
            "the tool agrees with the commanded positions: use these (`input = \"q\"`)",
            read,
            commanded,
        )
    } else if commanded > WORSE * read {
        (
            "the tool agrees with the measured positions: use these (`input = \"qa\"`)",
            commanded,
            read,
        )
    } else {
        (
            "the tool does not show which are right: measure again, reading after the arm has settled",
            read,
            commanded,
        )
    };
    let message = format!(
        "the measured joint positions differ from the commanded ones by {:.3} degrees RMS (joint {} by up to {:.2}); \
         {early}the residual of the geometry is {:.3} mm with the commanded and {:.3} mm with the measured ones; {verdict}",
        apart.rms.to_degrees(),
        apart.joint + 1,
        apart.most.to_degrees(),
        commanded * 1e3,
        read * 1e3
    );
    Some(SuspectedError { message, before_m, after_m })
}

/// Difference between read-back and commanded positions.
struct ReadbackDifference {
    rms: f64,
    most: f64,
    joint: usize,
    /// Fraction of the moves in which the read-back position is short of the target.
    short: f64,
}

impl ReadbackDifference {
    fn of(recording: &Recording, joints: usize) -> Self {
        let (mut square, mut count, mut short, mut moves) = (0.0, 0.0, 0.0, 0.0);
        let (mut most, mut worst) = (0.0, 0);
        for joint in 0..joints {
            let column = |channel| recording.column(channel).unwrap_or_default();
            let (q, qa) = (column(Channel::Command(joint)), column(Channel::Motor(joint)));
            let mut before = f64::NAN;
            for (q, qa) in q.iter().zip(qa) {
                let (apart, moved) = (qa - q, q - before);
                before = *q;
                if !apart.is_finite() {
                    continue;
                }
                square += apart * apart;
                count += 1.0;
                if apart.abs() > most {
                    (most, worst) = (apart.abs(), joint);
                }
                if apart.abs() > SAME && moved.is_finite() && moved != 0.0 {
                    moves += 1.0;
                    short += if apart * moved < 0.0 { 1.0 } else { 0.0 };
                }
            }
        }
        let rms = (square / f64::max(count, 1.0)).sqrt();
        Self { rms, most, joint: worst, short: short / f64::max(moves, 1.0) }
    }
}

/// Joints for which the tool is further along each move than the joint positions imply: a backlash of negative width, which is physically impossible.
#[must_use]
pub fn detect_early_readback(
    campaign: &Campaign,
    found: &Fit,
    settings: &FitSettings<'_>,
) -> Option<SuspectedError> {
    // Along a path, a delay has the same effect.
    if campaign.recordings.iter().any(|source| source.is_path) {
        return None;
    }
    let arm = &found.hypothesis.model.arm;
    let gaps: Vec<_> = candidates(arm, campaign)
        .into_iter()
        .filter(|c| matches!(c.probes.first().map(|p| p.effect), Some(AnyEffect::Backlash(_))))
        .collect();
    let fitted = ScoreTest::new(campaign, found, settings);
    let mut joints = Vec::new();
    for score in fitted.scores(&gaps) {
        let (joint, width) = (gaps[score.candidate].joint, score.values.first().copied());
        if let (Some(joint), Some(width)) = (joint, width)
            && width < -2.0 * SAME
            && score.gain / found.design_effect > CERTAIN
        {
            joints.push(format!("joint {} by {:.3} degrees", joint + 1, -0.5 * width.to_degrees()));
        }
    }
    if joints.is_empty() {
        return None;
    }
    let left = PositionErrors::of(found, campaign, settings.used).quantile(0.5);
    let message = format!(
        "the tool is further along each move than the joint positions ({}): they were read before the arm had settled; \
         use the commanded positions, or read again after the arm has settled",
        joints.join(", ")
    );
    Some(SuspectedError { message, before_m: left, after_m: left })
}
