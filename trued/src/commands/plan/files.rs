//! The poses as files: a list for the measurements, and robot programs.
//!
//! All three files contain the same numbers; they are written completely or not at all, never over
//! a recording. A program stays within the joint limits.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::Args;
use diagnosis::plan::order::home;
use diagnosis::plan::{Patch, Sees, Task};
use diagnosis::{Fitted, Noise};
use physics::Joints;
use recording::model::RobotModel;
use recording::programs::{Approach, Axis, Krl, Program, Rapid, Tour};
use recording::series::{
    Channel, Distance, Gauges, Probe, TouchedPlane, TouchedSphere, about_path,
};

use super::Input;
use super::page::{self, PAGE, Sheet};
use crate::atomic::Outputs;
use crate::exit::Failure;
use crate::input::Faulty;
use crate::output::Console;

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

    /// The output files of the poses, if requested.
    pub(super) fn outputs(&self, console: &Console) -> Outputs {
        let Some(out) = &self.out else { return console.outputs() };
        let list = out.join(LIST);
        let about = about_path(&list);
        let programs = ["poses.mod", "poses.src", "poses.dat"].map(|name| out.join(name));
        let outputs = console.outputs().in_folder(out).file(about).file(list).page(out.join(PAGE));
        programs.into_iter().fold(outputs, Outputs::file)
    }

    /// Puts the poses into these files.
    pub(super) fn put(
        &self,
        outputs: &mut Outputs,
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
        self.put_tour(outputs, model, task, stops, approach)
    }

    /// Adds the page of the poses.
    pub(super) fn put_page(&self, outputs: &mut Outputs, input: &Input, sheet: &Sheet<'_>) {
        if let Some(out) = &self.out {
            outputs.put_page(&out.join(PAGE), page::render(input, sheet));
        }
    }

    /// The list that measurements are filled into.
    pub(super) fn list(&self) -> PathBuf {
        self.out.as_deref().unwrap_or(Path::new("")).join(LIST)
    }

    /// The same, always straight from the pose before.
    pub(super) fn put_direct(
        &self,
        outputs: &mut Outputs,
        model: &RobotModel,
        task: &Task,
        stops: &[Joints],
    ) -> Result<(), Failure> {
        self.put_tour(outputs, model, task, stops, Approach::Direct)
    }

    fn put_tour(
        &self,
        outputs: &mut Outputs,
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
        if let Noise::Equal(sigma) = task.noise {
            let lengths = columns.iter().filter(|c| {
                matches!(c, Channel::Position(_) | Channel::Target(..) | Channel::Distance(_))
            });
            recording.about.sigma = lengths.map(|column| (*column, sigma)).collect();
        }
        recording.about.gauges = gauges(task);
        recording.about.measured_in_base = task.surroundings.frames.iter().all(|frame| !frame.free);
        let targets = task.surroundings.targets.iter().enumerate();
        recording.about.targets_tool = targets
            .filter(|(_, target)| !target.free)
            .map(|(place, target)| (place, target.value.to_array()))
            .collect();
        let list = out.join(LIST);
        outputs.put(&about_path(&list), recording.about_toml());
        outputs.put(&list, recording.to_csv());
        outputs.put(&out.join("poses.mod"), rapid);
        outputs.put(&out.join("poses.src"), krl.src);
        outputs.put(&out.join("poses.dat"), krl.dat);
        Ok(())
    }
}

/// Columns for the measurements.
fn columns(task: &Task) -> Vec<Channel> {
    let orientation_rad = match &task.sees {
        Sees::Points { orientation_rad, .. } => orientation_rad,
        Sees::Distance { .. } => return vec![Channel::Distance(0)],
        Sees::Touch(patches) => {
            let touches = |patch: &Patch| match patch {
                Patch::Plane { .. } => Channel::TouchPlane,
                Patch::Sphere(_) => Channel::TouchSphere,
            };
            return patches.iter().map(touches).collect::<BTreeSet<_>>().into_iter().collect();
        }
    };
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

/// The reference points of distances and the touched surfaces, as far as they are known; the probe
/// is a point, as the poses were chosen for one.
fn gauges(task: &Task) -> Gauges {
    let around = &task.surroundings;
    let target = (!around.targets.is_empty()).then_some(0);
    let mut gauges = Gauges::default();
    match &task.sees {
        Sees::Points { .. } => {}
        Sees::Distance { .. } => {
            gauges.distances = (0..)
                .zip(around.anchors.iter().take(1).map(|anchor| Distance {
                    anchor_m: known(anchor.place).map(|at| at.to_array()),
                    target,
                    offset_m: known(anchor.offset_m),
                }))
                .collect();
        }
        Sees::Touch(_) => {
            let sigma_m = match task.noise {
                Noise::Equal(sigma) => Some(sigma),
                _ => None,
            };
            gauges.probe = Some(Probe { radius_m: 0.0, target, sigma_m });
            gauges.planes = (0..)
                .zip(around.planes.iter().map(|plane| TouchedPlane {
                    normal: plane.value.normal.to_array(),
                    offset_m: known(*plane).map(|plane| plane.offset_m),
                }))
                .collect();
            gauges.spheres = (0..)
                .zip(around.spheres.iter().map(|sphere| TouchedSphere {
                    centre_m: known(sphere.centre).map(|at| at.to_array()),
                    radius_m: known(sphere.radius_m),
                }))
                .collect();
        }
    }
    gauges
}

fn known<T>(fitted: Fitted<T>) -> Option<T> {
    (!fitted.free).then_some(fitted.value)
}
