//! Result of a calibration: the three models on held-out poses, the written model, undetermined parameters.
//!
//! Promises: held-out poses that recordings keep for validation take no part in the written model either; those drawn by chance do, after their
//! figures are taken. Never: words beyond warnings.

use diagnosis::proof::{self, Calibration, Errors, Split};
use diagnosis::share::tool_shares;
use diagnosis::{Campaign, Effort, Fit, Free, Influence, Settings, Undetermined, gross, readback};
use physics::{Arm, Chain};
use recording::model::RobotModel;
use recording::series::{Approach, Kind, Recording};
use report::{ToolError, count, fixed};

use super::Parts;
use crate::exit::Failure;
use diagnosis_report::drawings::tool_errors;
use diagnosis_report::entries::{ALONG, Entry, barred, entries};

/// A joint whose positions differ by no more stands still, rad or m.
const STILL: f64 = 1e-3;

/// A pose with a reading that weighs less than half.
pub(super) struct Outlier {
    /// Place in the campaign's recordings.
    pub(super) recording: usize,
    /// Row of the table, from 1.
    pub(super) row: usize,
    /// What its worst reading is off by, m.
    pub(super) off_m: f64,
}

/// Held-out errors by the direction in which a joint arrived.
pub(super) struct Approached {
    /// From 0.
    pub(super) joint: usize,
    /// Rising and falling, for each of the three models.
    pub(super) errors: [[Errors; 2]; 3],
}

/// Held-out errors of one recording.
pub(super) struct OfRecording {
    /// Place in the campaign's recordings.
    pub(super) recording: usize,
    /// Whether the joints that move have parallel axes, so that the tool stays in a plane.
    pub(super) planar: bool,
    /// Nominal, calibrated, advanced.
    pub(super) errors: [Errors; 3],
}

/// Held-out errors of one station of the instrument.
pub(super) struct Stationed {
    /// Place in the campaign's measuring frames.
    pub(super) frame: usize,
    /// Place in the campaign's recordings.
    pub(super) recording: usize,
    /// Of the three models.
    pub(super) errors: [Errors; 3],
}

/// All of it.
pub(super) struct Found {
    pub(super) base: RobotModel,
    pub(super) campaign: Campaign,
    pub(super) split: Split,
    pub(super) seed: Option<u64>,
    /// Held out: nominal, calibrated, advanced.
    pub(super) errors: [Errors; 3],
    /// The fit of the model that is written.
    pub(super) last: Fit,
    /// Poses of it.
    pub(super) poses: usize,
    /// Its effects with their numbers.
    pub(super) entries: Vec<Entry>,
    pub(super) outliers: Vec<Outlier>,
    /// Of the held-out poses in which points were measured: with the nominal model, and with the advanced.
    pub(super) tool_errors: Vec<ToolError>,
    pub(super) approached: Vec<Approached>,
    pub(super) of_recordings: Vec<OfRecording>,
    /// Where there are several.
    pub(super) stationed: Vec<Stationed>,
    pub(super) warnings: Vec<String>,
    /// Why the model is not to be used; empty where its proof holds.
    pub(super) refused: Vec<String>,
}

/// The names of the three models.
pub(super) const MODELS: [&str; 3] = ["nominal", "calibrated", "advanced"];

impl Found {
    pub(super) fn of(
        base: RobotModel,
        recordings: &[Recording],
        campaign: Campaign,
        Parts { split, seed }: Parts,
        heard: &mut dyn FnMut(&'static str),
    ) -> Result<Self, Failure> {
        let training = &split.training;
        // Chance only lent the held-out poses: the written model is chosen and fitted anew on all of them, so that no seed has a say in it. A recording
        // that keeps poses for validation means every fit.
        let used = if seed.is_some() { vec![true; campaign.poses.len()] } else { training.clone() };
        let anew = |used: &[bool]| {
            proof::calibrate(&campaign, &base.physics, &base.sigma, used, &mut |_| ()).advanced
        };
        let (calibration, written) = std::thread::scope(|scope| {
            let written = seed.is_some().then(|| scope.spawn(|| anew(&used)));
            let proven = proof::calibrate(&campaign, &base.physics, &base.sigma, training, heard);
            heard("the model on all poses");
            (proven, written.map(std::thread::ScopedJoinHandle::join))
        });
        let written = match written {
            None => calibration.advanced.clone(),
            Some(Ok(written)) => written,
            Some(Err(_)) => anew(&used),
        };
        let (last, chosen) = (written.fit, written.chosen);
        let held = split.held_out();
        let errors = fits(&calibration).map(|fit| Errors::of(fit, &campaign, &held));
        heard("checks");
        let mut warnings = readback(recordings, &base, &campaign, &calibration, training);
        let shares_m = tool_shares(&last.hypothesis, &campaign);
        let entries = entries(&base, &last, &chosen, &shares_m)?;
        warnings.extend(doubts(recordings, &errors, &last));
        warnings.extend(checks(&campaign, &last));
        let refused = refused(&errors, &campaign, &last);
        let outliers = outliers(&campaign, &last);
        let approached = approached(&campaign, &calibration, &held);
        let [nominal, _, advanced] = fits(&calibration);
        let is_held = |pose: usize| held.get(pose).copied().unwrap_or(false);
        let arm = &base.physics.arm;
        let tool_errors = tool_errors(&campaign, arm, [nominal, advanced], is_held);
        let of_recordings = of_recordings(&campaign, &calibration, &held);
        let stationed = stationed(&campaign, fits(&calibration), &held);
        let poses = used.iter().filter(|used| **used).count();
        Ok(Self {
            base,
            campaign,
            split,
            seed,
            errors,
            last,
            poses,
            entries,
            outliers,
            tool_errors,
            approached,
            of_recordings,
            stationed,
            warnings,
            refused,
        })
    }

    /// What the data do not tell. A shift along its own axis is none: it is nothing at all.
    fn open(&self) -> impl Iterator<Item = &Undetermined> {
        let first = self.last.column_of(0);
        let is_something = move |open: &&Undetermined| {
            let free =
                open.column.checked_sub(first).and_then(|k| self.last.hypothesis.free.get(k));
            !free.is_some_and(|free| is_along_axis(&self.last, free))
        };
        self.last.undetermined.iter().filter(is_something)
    }

    /// One sentence per number that the data do not tell.
    pub(super) fn undetermined(&self) -> Vec<String> {
        self.open().map(Undetermined::says).collect()
    }

    /// The same in one sentence per reason.
    pub(super) fn left_open(&self) -> Vec<String> {
        super::open::sentences(&self.last, self.open())
    }

    /// How the instruments wandered, in words.
    pub(super) fn nests(&self) -> Vec<String> {
        let nests = self.campaign.recordings.iter().filter_map(|source| source.nests.as_ref());
        nests.map(diagnosis::nests::Nests::note).collect()
    }

    /// The name of a recording, without its folder.
    pub(super) fn recording(&self, place: usize) -> &str {
        let name = self.campaign.recordings.get(place).map_or("", |source| source.name.as_str());
        std::path::Path::new(name).file_name().and_then(|name| name.to_str()).unwrap_or(name)
    }
}

/// Reasons to reject the model: a larger error on the held-out poses than before, or a gross fault that remains.
fn refused([nominal, _, advanced]: &[Errors; 3], campaign: &Campaign, last: &Fit) -> Vec<String> {
    let mm = |metres: f64| fixed(metres * 1e3, 4);
    // An error that is no number is no better.
    let is_better = advanced.mean() <= nominal.mean();
    let worse = (!is_better).then(|| {
        format!(
            "mean error on held-out poses: {} mm with the new model, {} mm with the previous one; measure more poses or keep the previous model",
            mm(advanced.mean()),
            mm(nominal.mean())
        )
    });
    let faults = gross::faults(campaign, &last.hypothesis.model);
    worse.into_iter().chain(faults.into_iter().map(|fault| fault.says)).collect()
}

/// Whether a number shifts a joint's axis along itself, where no shift shows.
fn is_along_axis(fit: &Fit, free: &Free) -> bool {
    let axis = fit.hypothesis.effect_of(free).and_then(|e| barred(e, &fit.hypothesis.model.arm));
    axis.and_then(|axis| axis.to_array().get(free.value).copied()).is_some_and(|x| x.abs() > ALONG)
}

/// Joint positions that were read back before the arm stood.
fn readback(
    recordings: &[Recording],
    base: &RobotModel,
    campaign: &Campaign,
    calibration: &Calibration,
    training: &[bool],
) -> Vec<String> {
    let contradictions = recordings.iter().filter_map(|recording| {
        let found = readback::contradiction(recording, &base.physics)?;
        Some(format!("{}: {}", recording.file.display(), found.says))
    });
    let mut warnings: Vec<String> = contradictions.collect();
    let settings =
        Settings { used: training, influence: Influence::Huber, from: None, effort: Effort::Full };
    let ahead = readback::ahead(campaign, &calibration.calibrated, &settings);
    warnings.extend(ahead.map(|found| found.says));
    warnings
}

/// Standard deviations of its tolerance from which a number is called implausible; no unit, 1 to 10. By chance one number in four hundred lies beyond three.
const IMPLAUSIBLE: f64 = 3.0;
/// Condition number from which sums of products carry too few digits; no unit, 1e3 to 1e15. A double has sixteen: eight are left.
const CONDITION_MAX: f64 = 1e8;

/// What the fit says of itself: the residuals against the stated noise, numbers beyond their tolerance, and the conditioning.
fn checks(campaign: &Campaign, last: &Fit) -> Vec<String> {
    let mut warnings = Vec::new();
    for (instrument, factor) in campaign.instruments.iter().zip(&last.factors) {
        if instrument.noise_is_known && *factor > 1.0 {
            warnings.push(format!(
                "{}: the residuals are {} times as large as the stated noise (`sigma`): the noise is larger than that, or the robot has errors that the model does not \
                 describe; intervals are widened by this factor",
                instrument.name,
                fixed(*factor, 2)
            ));
        }
    }
    for (what, off) in last.beyond_tolerance(IMPLAUSIBLE) {
        warnings.push(format!(
            "{what} comes out at {} standard deviations of its tolerance: check the model's geometry, and whether these poses show it",
            fixed(off, 1)
        ));
    }
    let condition = last.conditioning().condition;
    if condition > CONDITION_MAX {
        warnings.push(format!(
            "the directions that these poses determine differ by a factor of {condition:.0e} in how well they show (condition number): measure poses that differ more"
        ));
    }
    warnings
}

fn doubts(recordings: &[Recording], errors: &[Errors; 3], last: &Fit) -> Vec<String> {
    let mut warnings = Vec::new();
    let numbers = last.hypothesis.free.iter().enumerate();
    let open = numbers
        .filter(|(k, free)| last.sigma(last.column_of(*k)).is_none() && !is_along_axis(last, free))
        .count();
    if open > 0 {
        warnings.push(format!(
            "{} of the model cannot be determined one by one from these data: their combination is determined, and each value follows the prior of its kind",
            count(open, "number")
        ));
    }
    let [nominal, calibrated, advanced] = errors.each_ref().map(Errors::mean);
    if advanced >= nominal {
        warnings.push("the advanced model is no better than the model as it is on held-out poses: do not use it; measure more poses".to_owned());
    } else if advanced > calibrated {
        warnings.push(
            "on held-out poses the advanced model is worse than plain geometry: measure more poses"
                .to_owned(),
        );
    }
    if !last.converged {
        warnings.push(
            "the fit ended before it converged: its parameters are less certain than stated".into(),
        );
    }
    for recording in recordings {
        let about = &recording.about;
        if about.kind == Kind::Poses && about.approach == Approach::Unknown {
            warnings.push(format!(
                "{}: how the joints arrived is not said (`approach`), so lost motion cannot be determined",
                recording.file.display()
            ));
        }
    }
    warnings
}

fn outliers(campaign: &Campaign, last: &Fit) -> Vec<Outlier> {
    let off = last.off(campaign);
    let worst = |pose: usize| {
        let lengths = off.iter().filter(|off| off.pose == pose && off.is_length);
        lengths.map(|off| off.off.length()).fold(0.0, f64::max)
    };
    let outlier = |place: usize| {
        let pose = &campaign.poses[place];
        Outlier { recording: pose.recording, row: pose.row + 1, off_m: worst(place) }
    };
    last.outliers(campaign).into_iter().map(outlier).collect()
}

/// Nominal, calibrated, advanced.
fn fits(calibration: &Calibration) -> [&Fit; 3] {
    [&calibration.nominal, &calibration.calibrated, &calibration.advanced.fit]
}

fn of_recordings(
    campaign: &Campaign,
    calibration: &Calibration,
    held: &[bool],
) -> Vec<OfRecording> {
    let of = |recording: usize| {
        let poses = campaign.poses.iter().zip(held);
        let wanted: Vec<bool> = poses.map(|(p, held)| *held && p.recording == recording).collect();
        let errors = fits(calibration).map(|fit| Errors::of(fit, campaign, &wanted));
        let planar = is_planar(&calibration.nominal.hypothesis.model.arm, campaign, &wanted);
        OfRecording { recording, planar, errors }
    };
    let all = (0..campaign.recordings.len()).map(of);
    all.filter(|one| !one.errors[0].sorted_m.is_empty()).collect()
}

/// Whether the axes of all joints that move between these poses are parallel.
fn is_planar(arm: &Arm, campaign: &Campaign, wanted: &[bool]) -> bool {
    let poses = || campaign.poses.iter().zip(wanted).filter(|(_, w)| **w).map(|(pose, _)| pose);
    let Some(first) = poses().next() else { return false };
    let q = first.inputs.q;
    let chain = Chain::nominal(arm, &q);
    let moves = |joint: &usize| poses().any(|p| (p.inputs.q[*joint] - q[*joint]).abs() > STILL);
    let moving: Vec<usize> = (0..arm.count()).filter(moves).collect();
    moving.iter().all(|joint| chain.axis(moving[0]).dot(chain.axis(*joint)).abs() > ALONG)
}

fn stationed(campaign: &Campaign, fits: [&Fit; 3], held: &[bool]) -> Vec<Stationed> {
    let of_frame = |frame: usize| {
        let seen = |pose: &diagnosis::Pose| pose.frame() == Some(frame);
        let recording = campaign.poses.iter().find(|pose| seen(pose))?.recording;
        let poses = campaign.poses.iter().zip(held);
        let wanted: Vec<bool> = poses.map(|(pose, held)| *held && seen(pose)).collect();
        let errors = fits.map(|fit| Errors::of(fit, campaign, &wanted));
        Some(Stationed { frame, recording, errors })
    };
    let frames = campaign.surroundings.frames.len();
    let all = (0..frames).filter_map(of_frame).filter(|one| !one.errors[0].sorted_m.is_empty());
    if frames > 1 { all.collect() } else { Vec::new() }
}

fn approached(campaign: &Campaign, calibration: &Calibration, held: &[bool]) -> Vec<Approached> {
    let fits = fits(calibration);
    let of_joint = |joint: usize| {
        let arrived = |sign: f64| -> Vec<bool> {
            let poses = campaign.poses.iter().zip(held);
            poses.map(|(pose, held)| *held && pose.inputs.direction[joint] == sign).collect()
        };
        let (rising, falling) = (arrived(1.0), arrived(-1.0));
        let errors =
            fits.map(|fit| [&rising, &falling].map(|wanted| Errors::of(fit, campaign, wanted)));
        Approached { joint, errors }
    };
    let known = |one: &Approached| one.errors[0].iter().all(|e| !e.sorted_m.is_empty());
    let joints = calibration.nominal.hypothesis.model.arm.count();
    (0..joints).map(of_joint).filter(known).collect()
}
