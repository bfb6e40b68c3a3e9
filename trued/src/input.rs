//! Reading of inputs: models by file or preset, recordings checked against their model, with error messages.
//!
//! Nothing with an error is used; all errors of a file are reported at once. The robot is never
//! guessed.

use std::collections::BTreeSet;
use std::fmt::Display;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use clap::Args;
use daemon::setup;
use physics::JointKind;
use recording::faults::{Faults, Setting, nearest};
use recording::files::FileError;
use recording::model::{RobotModel, presets};
use recording::series::{self, Recording, RecordingKind, RequiredData};
use report::pluralise;
use tracing::{info, warn};

use crate::exit::Failure;

/// From here on the bound of a correction's step takes a row for late, s (`corrector`, the most time of one step).
const STEP_S_MAX: f64 = 0.02;

/// The model where forces were recorded without a robot.
const NO_ARM: &str = include_str!("no_arm.toml");

/// Whose recording it is, and how it is read.
#[derive(Debug, Clone, Args)]
pub(crate) struct Reading {
    /// Robot model: a file, or the name of a preset; if not given, the model stated in the recording's TOML
    #[arg(long, value_name = "MODEL")]
    pub(crate) model: Option<PathBuf>,
    /// Mapping from another program's table to a recording; if not given, `NAME.mapping.toml` in the same folder
    #[arg(long, value_name = "FILE")]
    pub(crate) mapping: Option<PathBuf>,
}

/// A recording and the model that fits it.
#[derive(Debug)]
pub(crate) struct Input {
    pub(crate) model: RobotModel,
    pub(crate) recording: Recording,
    /// How each joint of the model moves.
    pub(crate) joint_kinds: Vec<JointKind>,
}

/// A recording whose content has been inspected.
pub(crate) enum InspectedRecording {
    /// It contains no joints: with the model that is given or named for it, or a placeholder
    /// without an arm.
    WithoutArm(Box<(RobotModel, Recording)>),
    /// Joints are in it; none where it cannot be read.
    OfArm(Option<Box<Recording>>),
}

/// No model under this name.
#[derive(Debug, thiserror::Error)]
#[error("`{}` is neither a model file nor a preset{meant}; `trued model presets` lists the presets", name.display())]
struct NoModelError {
    name: PathBuf,
    meant: String,
}

/// A file with faults, all of them.
#[derive(Debug, thiserror::Error)]
#[error("{} has {}\n\n{}", .0.file(), pluralise(.0.len(), "fault"), .0.plain())]
pub(crate) struct FaultyFile(Faults);

impl FaultyFile {
    /// The faults, with the options of the command line for the settings that they name.
    pub(crate) fn of(faults: Faults) -> Self {
        Self::with(faults, option)
    }

    /// The same for a command with options of its own.
    pub(crate) fn with(faults: Faults, option: impl Fn(Setting) -> &'static str) -> Self {
        Self(faults.name_settings(option))
    }
}

/// The option for a setting of a library.
pub(crate) fn option(setting: Setting) -> &'static str {
    match setting {
        Setting::SamplingRate => "--rate HZ",
        Setting::Spacing => "--spacing-um UM",
        Setting::FullScale => "--scale A",
        Setting::Columns => "--column C",
        Setting::Mapping => "--mapping FILE",
        Setting::BaseLink => "--base LINK",
        Setting::TipLink => "--tip LINK",
    }
}

/// No model was named.
#[derive(Debug, thiserror::Error)]
#[error("{}: no model is stated; give --model MODEL (a file, or a preset of `trued model presets`)", .0.display())]
struct NoModelNamed(PathBuf);

/// One recording, twice.
#[derive(Debug, thiserror::Error)]
#[error("{}: is given twice, and its measurements would count twice; give each recording once", .0.display())]
struct GivenTwice(PathBuf);

/// Recordings of several robots.
#[derive(Debug, thiserror::Error)]
#[error("{}: states a different model than the first recording; give --model MODEL if both are of one robot", .0.display())]
struct DifferentModels(PathBuf);

impl Reading {
    /// The files that it names besides recordings.
    pub(crate) fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.model.iter().chain(&self.mapping)
    }

    /// Reads a recording of joint positions and the model that it belongs to; `fallback` is the model where neither
    /// the command line nor the recording names one.
    pub(crate) fn read(&self, path: &Path, fallback: Option<&Path>) -> Result<Input, Failure> {
        self.read_with(RequiredData::Path, path, fallback, None)
    }

    /// The same of a recording that has been inspected already.
    pub(crate) fn path_after(
        &self,
        read: Option<Recording>,
        path: &Path,
    ) -> Result<Input, Failure> {
        self.read_with(RequiredData::Path, path, None, read)
    }

    /// Reads recordings of one robot's measurements, and its model.
    pub(crate) fn measured(
        &self,
        paths: &[PathBuf],
    ) -> Result<(RobotModel, Vec<Recording>), Failure> {
        self.measured_after(None, paths)
    }

    /// The same if the first one has been inspected already.
    pub(crate) fn measured_after(
        &self,
        mut read: Option<Recording>,
        paths: &[PathBuf],
    ) -> Result<(RobotModel, Vec<Recording>), Failure> {
        check_distinct(paths)?;
        let mut inputs = Vec::with_capacity(paths.len());
        for path in paths {
            inputs.push(self.read_with(RequiredData::Measurement, path, None, read.take())?);
        }
        let first = inputs.first().map(|input| input.model.clone());
        let model = first.ok_or_else(|| Failure::input("no recording was given"))?;
        if let Some(other) = inputs.iter().find(|input| input.model.hash != model.hash) {
            return Err(Failure::input(DifferentModels(other.recording.file.clone())));
        }
        Ok((model, inputs.into_iter().map(|input| input.recording).collect()))
    }

    /// Reads a recording of which it is not known yet whether it contains joints.
    pub(crate) fn inspect(&self, path: &Path) -> Result<InspectedRecording, Failure> {
        // A read error is reported by the caller that needs joints.
        let recording = match series::read(path, self.mapping.as_deref(), RequiredData::Samples) {
            Ok(recording) => recording,
            // A pipe can be read only once.
            Err(error) if !path.is_file() => return Err(unusable(error)),
            Err(_) => return Ok(InspectedRecording::OfArm(None)),
        };
        if recording.joint_count() > 0 {
            return Ok(InspectedRecording::OfArm(Some(Box::new(recording))));
        }
        for note in &recording.notes {
            warn!("{}: {note}", recording.file.display());
        }
        let named = recording
            .metadata
            .model
            .as_ref()
            .map(|name| presets::resolve_model_path(path, Path::new(name)));
        let model = match self.model.as_deref().or(named.as_deref()) {
            Some(name) => model(name)?,
            None => RobotModel::parse("no arm", NO_ARM).map_err(Failure::system)?,
        };
        Ok(InspectedRecording::WithoutArm(Box::new((model, recording))))
    }

    fn read_with(
        &self,
        need: RequiredData,
        path: &Path,
        fallback: Option<&Path>,
        read: Option<Recording>,
    ) -> Result<Input, Failure> {
        let recording = match read {
            Some(recording) => {
                recording
                    .check_need(need)
                    .map_err(|faults| Failure::input(FaultyFile::of(faults)))?;
                recording
            }
            None => series::read(path, self.mapping.as_deref(), need).map_err(unusable)?,
        };
        let named = recording.metadata.model.as_ref();
        let beside = named.map(|name| presets::resolve_model_path(path, Path::new(name)));
        let name = self.model.as_deref().or(fallback).or(beside.as_deref());
        let model = model(name.ok_or_else(|| Failure::input(NoModelNamed(path.to_owned())))?)?;
        let joint_kinds = setup::joint_kinds(&model.physics.arm);
        recording
            .check_joints(&joint_kinds)
            .map_err(|faults| Failure::input(FaultyFile::of(faults)))?;
        let input = Input { model, recording, joint_kinds };
        input.log_notes(need);
        Ok(input)
    }
}

/// Checks that no measurement counts twice: parameters would look more certain than they are.
fn check_distinct(paths: &[PathBuf]) -> Result<(), Failure> {
    let mut places = BTreeSet::new();
    let place = |path: &PathBuf| path.canonicalize().unwrap_or_else(|_| path.clone());
    let again = paths.iter().find(|path| !places.insert(place(path)));
    again.map_or(Ok(()), |path| Err(Failure::input(GivenTwice(path.clone()))))
}

impl Input {
    fn log_notes(&self, need: RequiredData) {
        let Self { model, recording, joint_kinds } = self;
        let joints = joint_kinds.len();
        info!(model = model.file.name, joints, rows = recording.len(), "read");
        for note in &recording.notes {
            warn!("{}: {note}", recording.file.display());
        }
        for effect in model.not_compensated_names() {
            info!(effect, "not compensated by the static correction");
        }
        let step_s = median_step_s(recording);
        let corrects = need == RequiredData::Path && recording.metadata.kind == RecordingKind::Path;
        if corrects && step_s > STEP_S_MAX {
            warn!(
                "the time step is {step_s:.3} s, but the correction changes between two rows by no more than its limits allow in \
                 {STEP_S_MAX} s; for poses at rest, set kind = \"poses\" in the recording's TOML"
            );
        }
    }
}

/// The model in a file, or the preset of that name.
pub(crate) fn model(name: &Path) -> Result<RobotModel, Failure> {
    RobotModel::read(name).map_err(|error| unusable_model(name, error))
}

/// The same for an error of [`RobotModel::read`].
pub(crate) fn unusable_model(name: &Path, error: FileError) -> Failure {
    match error {
        FileError::Io { source, .. } if source.kind() == ErrorKind::NotFound => {
            let presets = presets::PRESETS.iter().map(|preset| preset.name);
            let nearest_name = name.to_str().and_then(|name| nearest(name, presets));
            let meant = nearest_name
                .map(|nearest_name| format!(" (did you mean `{nearest_name}`?)"))
                .unwrap_or_default();
            Failure::input(NoModelError { name: name.to_owned(), meant })
        }
        error => unusable(error),
    }
}

/// For `map_err`: what is wrong with the content of the file `path`, whose message does not name it.
pub(crate) fn in_file<E: Display>(path: &Path) -> impl Fn(E) -> Failure + '_ {
    move |error| Failure::input(format!("{}: {error}", path.display()))
}

/// A file that cannot be used is bad input, whatever the reason.
pub(crate) fn unusable(error: FileError) -> Failure {
    match error {
        FileError::Content(faults) => Failure::input(FaultyFile::of(faults)),
        error => Failure::input(error),
    }
}

/// The middle time between two rows of one segment, s; 0 where there are none.
fn median_step_s(recording: &Recording) -> f64 {
    let pairs = recording.t_s.windows(2).zip(recording.segment.windows(2));
    let mut steps: Vec<f64> = pairs
        .filter(|(_, segments)| segments[0] == segments[1])
        .map(|(t, _)| t[1] - t[0])
        .collect();
    let middle = steps.len() / 2;
    if steps.is_empty() { 0.0 } else { *steps.select_nth_unstable_by(middle, f64::total_cmp).1 }
}
