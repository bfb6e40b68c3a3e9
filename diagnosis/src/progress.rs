//! Progress of a diagnosis or calibration, for display: the stage that is computed, and how far it is. No result depends on it.
//!
//! A [`Listener`] is called when a stage begins, after each step of a loop whose length is known, and when a search has selected effects. Parallel
//! loops count their steps under a lock, so that a listener sees the counts in order.

use std::fmt;
use std::sync::{Mutex, PoisonError};

/// Receives the stage and its progress. It is called on the threads that compute, so it should return within a millisecond.
pub type Listener<'a> = &'a (dyn Fn(Stage, Progress) + Sync);

/// A [`Listener`] that does nothing.
pub fn ignore(_: Stage, _: Progress) {}

/// How far a stage is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// The stage begins.
    Begun,
    /// Number of effects that the search has selected so far; later rounds may remove some.
    Selected(usize),
    /// Steps of a loop. Each loop of a stage begins with `done` = 0, counts up by one and ends at `of`.
    Steps {
        /// Number of steps that are done.
        done: usize,
        /// Number of all steps of this loop, from 1.
        of: usize,
    },
}

/// A stage of a computation. The stages of a domain follow each other in the order of its list; a computation may skip some.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Positions: screening of the recordings, search for gross errors.
    Screening,
    /// Positions: fit of frames and targets with the model as given.
    GivenModel,
    /// Positions: autocorrelation of the noise.
    NoiseModel,
    /// Positions: search that separates effects from noise.
    FirstSearch,
    /// Positions: search with the noise model estimated again.
    SecondSearch,
    /// Positions: removal of effects that the validation set does not support.
    Validation,
    /// Positions: structure that no effect explains.
    Structure,
    /// Positions: fit of the selected effects to all rows outside the test set, and their alternatives.
    Alternatives,
    /// Positions: errors on the test set with and without each effect.
    TestErrors,
    /// Positions: experiment that would distinguish alternatives.
    Experiment,
    /// Torques: filter of torque and motion, candidate effects.
    TorqueRows,
    /// Torques: autocorrelation of the noise.
    TorqueNoise,
    /// Torques: search for effects.
    TorqueFirstSearch,
    /// Torques: search with the noise model estimated again.
    TorqueSecondSearch,
    /// Torques: search without the rows of low-speed zones that no effect describes.
    TorqueZones,
    /// Torques: removal of effects that the validation set does not support.
    TorqueValidation,
    /// Torques: parameters that are not linear, and alternatives of the selected effects.
    TorqueAlternatives,
    /// Torques: errors on the test set with and without each effect.
    TorqueTestErrors,
    /// Calibration: search for gross errors.
    CalibrationScreening,
    /// Calibration: fit of frames and targets with the model as given.
    CalibrationGivenModel,
    /// Calibration: fit of the geometry of every joint.
    CalibrationGeometry,
    /// Calibration: search for effects beside the geometry.
    CalibrationSearch,
    /// Calibration: the same fits and search on all poses.
    CalibrationAllPoses,
    /// Calibration: errors on the held-out poses, checks.
    CalibrationChecks,
}

impl Stage {
    /// Stages of a diagnosis of positions.
    pub const POSITIONS: [Self; 10] = [
        Self::Screening,
        Self::GivenModel,
        Self::NoiseModel,
        Self::FirstSearch,
        Self::SecondSearch,
        Self::Validation,
        Self::Structure,
        Self::Alternatives,
        Self::TestErrors,
        Self::Experiment,
    ];

    /// Stages of a diagnosis of torques.
    pub const TORQUES: [Self; 8] = [
        Self::TorqueRows,
        Self::TorqueNoise,
        Self::TorqueFirstSearch,
        Self::TorqueSecondSearch,
        Self::TorqueZones,
        Self::TorqueValidation,
        Self::TorqueAlternatives,
        Self::TorqueTestErrors,
    ];

    /// Stages of a calibration.
    pub const CALIBRATION: [Self; 6] = [
        Self::CalibrationScreening,
        Self::CalibrationGivenModel,
        Self::CalibrationGeometry,
        Self::CalibrationSearch,
        Self::CalibrationAllPoses,
        Self::CalibrationChecks,
    ];

    /// What is computed, in a few words.
    fn name(self) -> &'static str {
        match self {
            Self::Screening => "screening, gross errors",
            Self::GivenModel | Self::CalibrationGivenModel => "fit of the given model",
            Self::NoiseModel | Self::TorqueNoise => "noise model",
            Self::FirstSearch | Self::TorqueFirstSearch => "first search",
            Self::SecondSearch | Self::TorqueSecondSearch => "second search",
            Self::Validation | Self::TorqueValidation => "validation",
            Self::Structure => "unexplained structure",
            Self::Alternatives | Self::TorqueAlternatives => "alternatives",
            Self::TestErrors | Self::TorqueTestErrors => "test errors",
            Self::Experiment => "next experiment",
            Self::TorqueRows => "filter",
            Self::TorqueZones => "low-speed zones",
            Self::CalibrationScreening => "gross errors",
            Self::CalibrationGeometry => "fit of the geometry",
            Self::CalibrationSearch => "search",
            Self::CalibrationAllPoses => "fit to all poses",
            Self::CalibrationChecks => "checks",
        }
    }
}

/// Domain, number of the stage, count of stages and name, as `positions 3/10: noise model`.
impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let domains = [
            ("positions", &Self::POSITIONS[..]),
            ("torques", &Self::TORQUES),
            ("calibration", &Self::CALIBRATION),
        ];
        for (domain, stages) in domains {
            if let Some(k) = stages.iter().position(|stage| stage == self) {
                write!(f, "{domain} {}/{}: ", k + 1, stages.len())?;
            }
        }
        f.write_str(self.name())
    }
}

/// Reports the progress of one stage.
#[derive(Clone, Copy)]
pub(crate) struct StageProgress<'a> {
    listener: Listener<'a>,
    stage: Stage,
}

impl<'a> StageProgress<'a> {
    /// Reports that `stage` begins.
    pub(crate) fn begin(listener: Listener<'a>, stage: Stage) -> Self {
        listener(stage, Progress::Begun);
        Self { listener, stage }
    }

    /// Reports the number of effects that are selected so far.
    pub(crate) fn selected(self, count: usize) {
        (self.listener)(self.stage, Progress::Selected(count));
    }

    /// Begins a loop of `count` steps.
    pub(crate) fn steps(self, count: usize) -> Steps<'a> {
        if count > 0 {
            (self.listener)(self.stage, Progress::Steps { done: 0, of: count });
        }
        Steps { progress: self, done: Mutex::new(0), of: count }
    }
}

/// Counts the steps of a loop, which may be parallel.
pub(crate) struct Steps<'a> {
    progress: StageProgress<'a>,
    done: Mutex<usize>,
    of: usize,
}

impl Steps<'_> {
    /// Reports that one more step is done.
    pub(crate) fn step(&self) {
        // The lock is held during the call, so that no thread reports a count after a larger one.
        let mut done = self.done.lock().unwrap_or_else(PoisonError::into_inner);
        *done += 1;
        (self.progress.listener)(self.progress.stage, Progress::Steps { done: *done, of: self.of });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign_simulation::simulate_readings;
    use crate::diagnose::diagnose;
    use crate::test_campaigns::{nominal_robot, thesis_robot, unmeasured_campaign};

    #[test]
    fn a_diagnosis_reports_its_stages_in_order_and_every_loop_counts_to_its_end() {
        let received = Mutex::new(Vec::new());
        let listener = |stage, progress| {
            received.lock().expect("no thread panicked").push((stage, progress));
        };
        // Enough poses for a validation set.
        let unmeasured = unmeasured_campaign(1, 220);
        let campaign =
            simulate_readings(&unmeasured, &thesis_robot(), &unmeasured.surroundings, 1.0, 5);
        drop(diagnose(campaign, &nominal_robot(), &[], None, 1, &listener));
        let received = received.into_inner().expect("no thread panicked");
        let mut begun = Vec::new();
        let mut open: Option<(usize, usize)> = None;
        for (stage, progress) in &received {
            match *progress {
                Progress::Begun => begun.push(*stage),
                Progress::Selected(_) => {}
                Progress::Steps { done: 0, of } => {
                    assert!(of > 0, "{stage}");
                    assert_eq!(open.replace((0, of)), None, "{stage}: a loop did not end");
                }
                Progress::Steps { done, of } => {
                    assert_eq!(open, Some((done - 1, of)), "{stage}");
                    open = (done < of).then_some((done, of));
                }
            }
            assert_eq!(begun.last(), Some(stage));
            assert!(*progress != Progress::Begun || open.is_none(), "{stage}: a loop did not end");
        }
        assert_eq!(open, None);
        // The recordings were screened before.
        assert_eq!(begun, Stage::POSITIONS[1..]);
        let has =
            |stage, is: fn(&Progress) -> bool| received.iter().any(|(s, p)| *s == stage && is(p));
        for stage in [Stage::FirstSearch, Stage::SecondSearch] {
            assert!(has(stage, |p| matches!(p, Progress::Selected(1..))), "{stage}");
        }
        for stage in [Stage::Validation, Stage::Alternatives, Stage::TestErrors] {
            assert!(has(stage, |p| matches!(p, Progress::Steps { .. })), "{stage}");
        }
    }

    #[test]
    fn a_stage_says_its_domain_its_number_and_the_count_of_all() {
        assert_eq!(Stage::NoiseModel.to_string(), "positions 3/10: noise model");
        assert_eq!(Stage::TorqueRows.to_string(), "torques 1/8: filter");
        assert_eq!(Stage::CalibrationChecks.to_string(), "calibration 6/6: checks");
    }
}
