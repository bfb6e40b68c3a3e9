//! The poses as files: a list to be filled with measurements, and programs for the robot.
//!
//! Promises: all three carry the same figures; whole or not at all, never over a recording. Never: a program that leaves the joint limits.

use std::path::{Path, PathBuf};

use clap::Args;
use diagnosis::Noise;
use diagnosis::plan::order::home;
use diagnosis::plan::{Sees, Task};
use physics::Joints;
use recording::model::RobotModel;
use recording::programs::{Approach, Axis, Krl, Program, Rapid, Tour};
use recording::series::{Channel, about_path};

use crate::atomic;
use crate::exit::Failure;
use crate::input::Faulty;

/// The list that measurements are filled into.
const LIST: &str = "poses.csv";

/// Where files go, and how the robot comes to each pose.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Programs")]
pub(super) struct Files {
    /// Write poses.csv (to be filled with measurements), poses.mod (ABB RAPID), poses.src and poses.dat (KUKA KRL) into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Come to each pose straight, or twice, all joints from below and from above, so that lost motion shows
    #[arg(long, value_name = "direct|both", value_enum, default_value = "both")]
    approach: Coming,
    /// How far away a joint begins its approach, degrees (mm where it slides)
    #[arg(long, value_name = "DEG", default_value_t = 3.0)]
    approach_deg: f64,
    /// How long the robot rests at each pose, s
    #[arg(long, value_name = "S", default_value_t = 3.0)]
    pause_s: f64,
    /// Which axis of the controller each joint is, where it does not go without saying: E1,A1,A2,A3,A4,A5,A6
    #[arg(long, value_name = "A,…", value_delimiter = ',')]
    axes: Vec<Axis>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Coming {
    Direct,
    Both,
}

impl Files {
    /// Whether each pose is measured twice.
    pub(super) fn both_ways(&self) -> bool {
        self.approach == Coming::Both
    }

    pub(super) fn out(&self) -> Option<&Path> {
        self.out.as_deref()
    }

    /// No recording that is read is one that would be written.
    pub(super) fn check_apart(&self, recordings: &[PathBuf]) -> Result<(), Failure> {
        let Some(out) = &self.out else { return Ok(()) };
        let list = out.join(LIST);
        recordings.iter().try_for_each(|input| super::super::correct::check_apart(input, &list))
    }

    /// Writes the poses where they were asked for.
    pub(super) fn write(
        &self,
        model: &RobotModel,
        task: &Task,
        stops: &[Joints],
    ) -> Result<(), Failure> {
        let approach = match self.approach {
            Coming::Direct => Approach::Direct,
            Coming::Both => Approach::BothWays {
                turn_rad: self.approach_deg.to_radians(),
                slide_m: 1e-3 * self.approach_deg,
            },
        };
        self.write_tour(model, task, stops, approach)
    }

    /// The same, always straight from the pose before.
    pub(super) fn write_direct(
        &self,
        model: &RobotModel,
        task: &Task,
        stops: &[Joints],
    ) -> Result<(), Failure> {
        self.write_tour(model, task, stops, Approach::Direct)
    }

    fn write_tour(
        &self,
        model: &RobotModel,
        task: &Task,
        stops: &[Joints],
        approach: Approach,
    ) -> Result<(), Failure> {
        let Some(out) = &self.out else { return Ok(()) };
        let arm = &model.physics.arm;
        let list = |q: &Joints| q[..arm.count()].to_vec();
        let tour = Tour {
            name: "poses".to_owned(),
            home: list(&home(arm, &task.reach)),
            poses: stops.iter().map(list).collect(),
            approach,
            pause_s: self.pause_s,
            axes: self.axes.clone(),
        };
        let faulty = |faults| Failure::input(Faulty(faults));
        let program = Program::new(&tour, &model.file).map_err(faulty)?;
        let krl = program.krl(&Krl::default()).map_err(faulty)?;
        let rapid = program.rapid(&Rapid::default()).map_err(faulty)?;
        let columns = columns(task);
        let mut recording = program.recording(&columns);
        if let (Sees::Points { .. }, Noise::Equal(sigma)) = (&task.sees, task.noise) {
            let lengths = columns.iter().filter(|c| !matches!(c, Channel::Orientation(_)));
            recording.about.sigma = lengths.map(|column| (*column, sigma)).collect();
        }
        recording.about.measured_in_base = task.surroundings.frames.iter().all(|frame| !frame.free);
        let targets = task.surroundings.targets.iter().enumerate();
        recording.about.targets_tool = targets
            .filter(|(_, target)| !target.free)
            .map(|(place, target)| (place, target.value.to_array()))
            .collect();
        std::fs::create_dir_all(out).map_err(|error| {
            Failure::system(format!("{}: cannot make this folder: {error}", out.display()))
        })?;
        let list = out.join(LIST);
        let texts = [
            (about_path(&list), recording.about_toml().into_bytes()),
            (list, recording.to_csv()),
            (out.join("poses.mod"), rapid.into_bytes()),
            (out.join("poses.src"), krl.src.into_bytes()),
            (out.join("poses.dat"), krl.dat.into_bytes()),
        ];
        texts
            .iter()
            .try_for_each(|(path, text)| Ok(atomic::write(path, |file| file.write_all(text))?))
    }
}

/// Columns for what is measured; none where recordings have none for it.
fn columns(task: &Task) -> Vec<Channel> {
    let Sees::Points { orientation_rad, .. } = &task.sees else { return Vec::new() };
    let mut columns: Vec<Channel> = match task.surroundings.targets.len() {
        0 => (0..3).map(Channel::Position).collect(),
        count => {
            (0..count).flat_map(|t| (0..3).map(move |axis| Channel::Target(t, axis))).collect()
        }
    };
    if orientation_rad.is_some() {
        columns.extend((0..4).map(Channel::Orientation));
    }
    columns
}
