//! Simulation of a recording: a model run forward on recorded commands, loads and temperatures, measured by the recorded instruments.
//!
//! All effects on positions and torques act, including delays, lags and modes. The model is not fitted; only the measuring frame and unknown target
//! positions are estimated, from the recorded data ([`station`]). Instruments: [`world::instrument`].
//!
//! The same recording and seed give the same bits; without noise the result is the model's own, to the last digit.

pub mod station;

use crate::campaign::{Arrival, Pose};
use crate::campaign_import::{self, CampaignError};
use glam::DVec3;
use physics::{Inputs, Joints, ModelError, ParameterValues};
use recording::model::RobotModel;
use recording::series::{Channel, InputKind, Recording, RecordingKind};
use station::Station;
use world::drives;
use world::dynamics::Dynamics;
use world::forward::{self, ArmState};
use world::instrument::forces::{self, ProcessColumnMissing};
use world::instrument::{Instrument, SimulatedMotion};
use world::servo::{self, ServoError};

pub use world::instrument::Readings;

/// Noise of simulated measurements: standard deviations, 0 or above. Default 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SimulationNoise {
    /// For lengths and angles, m and rad.
    pub length_m: f64,
    /// For torques, Nm (N of a prismatic joint).
    pub torque_nm: f64,
    /// For cutting forces, N.
    pub force_n: f64,
}

/// Why a recording cannot be simulated.
#[derive(Debug, thiserror::Error)]
pub enum SimulationError {
    /// An input is missing.
    #[error(transparent)]
    Unusable(#[from] CampaignError),
    /// The model has too many effects.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The closed loop of the drives cannot be simulated.
    #[error(transparent)]
    Servo(#[from] ServoError),
    /// The process data of a cut are missing.
    #[error(transparent)]
    Process(#[from] ProcessColumnMissing),
    /// An effect on the motion cannot be used.
    #[error("{effect}: {reason}")]
    Dynamics {
        /// The effect, as the model file names it.
        effect: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A target's position on the tool is neither known nor measured.
    #[error(
        "{file}: where target {target} sits on the tool is not known, and nothing was recorded of it: give target{target}_mm in the TOML"
    )]
    TargetUnknown {
        /// The recording.
        file: String,
        /// 1-based.
        target: usize,
    },
    /// Noise is given for a kind of measurement that is not simulated.
    #[error(
        "{file}: noise is given for {kind} (--{option}), and none are simulated from this recording and model: leave it out"
    )]
    NoiseWithoutEffect {
        /// The recording.
        file: String,
        /// What is not simulated.
        kind: &'static str,
        /// The option of `trued simulate`.
        option: &'static str,
    },
    /// The recording contains nothing to simulate.
    #[error("{file}: neither joint positions nor a [cut]: nothing can be simulated")]
    Nothing {
        /// The recording.
        file: String,
    },
}

/// The recording with the simulated measurements of its instruments on the robot `model`.
///
/// ```
/// use diagnosis::recording_simulation::{SimulationNoise, simulate};
/// use recording::model::RobotModel;
/// use recording::series::{Channel, RequiredData, read_text};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let model = RobotModel::read("irb120".as_ref())?;
/// let text = "t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,0,10,20,0,30,0\n";
/// let commands = read_text("commands.csv", text, None, None, RequiredData::Path)?;
/// let readings = simulate(&model, commands, &SimulationNoise::default(), 1)?;
/// assert_eq!(readings.columns, ["x", "y", "z"]);
/// assert!(readings.recording.column(Channel::Position(0)).is_some());
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// See [`SimulationError`].
pub fn simulate(
    model: &RobotModel,
    mut recording: Recording,
    noise: &SimulationNoise,
    seed: u64,
) -> Result<Readings, SimulationError> {
    let mut readings = if recording.joint_count() == 0 {
        Readings::without_arm(recording)
    } else {
        recording.hold_inputs();
        let run = run(model, &recording, DriveMotion::of(model, &recording))?;
        let station = Station::find(model, &recording)?;
        let instrument = Instrument {
            measuring_from_base: &|row| station.measuring_from_base(row),
            targets_tool_m: &station.targets_tool_m,
            in_base: station.in_base,
            noise: noise.length_m,
            torque_noise: noise.torque_nm,
            seed,
        };
        instrument.read(&model.physics.arm, recording, &run)
    };
    let with_cutting = model.with_cutting()?;
    let of_cut = forces::read(&with_cutting, &mut readings.recording, noise.force_n, seed)?;
    if readings.columns.is_empty() && of_cut.columns.is_empty() {
        return Err(SimulationError::Nothing {
            file: readings.recording.file.display().to_string(),
        });
    }
    check_noise(noise, &readings, !of_cut.columns.is_empty())?;
    readings.columns.extend(of_cut.columns);
    readings.left_out.extend(of_cut.left_out);
    Ok(readings)
}

/// Rejects noise of measurements that are not simulated; `readings` are those of the arm.
fn check_noise(
    noise: &SimulationNoise,
    readings: &Readings,
    has_forces: bool,
) -> Result<(), SimulationError> {
    let is_torque = |channel: &Channel| matches!(channel, Channel::Torque(_));
    let torques = readings.recording.channels().filter(is_torque).count();
    let has_lengths = readings.columns.len() > torques;
    let given = [
        (noise.length_m, has_lengths, "lengths and angles", "noise"),
        (noise.torque_nm, torques > 0, "torques", "torque-noise"),
        (noise.force_n, has_forces, "cutting forces", "force-noise"),
    ];
    let idle = given.into_iter().find(|(sigma, is_simulated, ..)| *sigma > 0.0 && !is_simulated);
    idle.map_or(Ok(()), |(_, _, kind, option)| {
        let file = readings.recording.file.display().to_string();
        Err(SimulationError::NoiseWithoutEffect { file, kind, option })
    })
}

/// Positions of the arm along a recording, row by row.
///
/// ```
/// # use recording::model::RobotModel;
/// # use recording::series::{RequiredData, read_text};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let model = RobotModel::read("irb120".as_ref())?;
/// let text = "t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,0,10,20,0,30,0\n";
/// let commands = read_text("commands.csv", text, None, None, RequiredData::Path)?;
/// let seen = diagnosis::recording_simulation::positions(&model, commands)?;
/// println!("the tool is at {} m", seen[0].base_from_tool.origin);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// See [`SimulationError`].
pub fn positions(
    model: &RobotModel,
    mut recording: Recording,
) -> Result<Vec<ArmState>, SimulationError> {
    recording.hold_inputs();
    Ok(run(model, &recording, DriveMotion::NotSimulated)?.states)
}

/// Drive torques along a recording, with motions as commanded, row by row, Nm or N.
///
/// ```
/// # use recording::model::RobotModel;
/// # use recording::series::{RequiredData, read_text};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let model = RobotModel::read("irb120".as_ref())?;
/// let text = "t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,0,10,20,0,30,0\n";
/// let commands = read_text("commands.csv", text, None, None, RequiredData::Path)?;
/// assert_eq!(diagnosis::recording_simulation::torques(&model, commands)?.len(), 1);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// See [`SimulationError`].
pub fn torques(
    model: &RobotModel,
    mut recording: Recording,
) -> Result<Vec<Joints>, SimulationError> {
    recording.hold_inputs();
    Ok(run(model, &recording, DriveMotion::AsCommanded)?.torques.unwrap_or_default())
}

/// Measured forces of the recording's cut, row by row, N; empty without a cut.
///
/// ```
/// # use recording::model::RobotModel;
/// # use recording::series::{RequiredData, read_text};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let model = RobotModel::read("irb120".as_ref())?;
/// let text = "t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,0,10,20,0,30,0\n";
/// let commands = read_text("commands.csv", text, None, None, RequiredData::Path)?;
/// assert!(diagnosis::recording_simulation::cut_forces(&model, &commands)?.is_empty());
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// See [`SimulationError`].
pub fn cut_forces(
    model: &RobotModel,
    recording: &Recording,
) -> Result<Vec<DVec3>, SimulationError> {
    let Some(cut) = &recording.metadata.cut else { return Ok(Vec::new()) };
    Ok(forces::exact(&model.with_cutting()?, cut, recording)?)
}

/// Scope of the simulation of the drives.
#[derive(Clone, Copy, PartialEq, Eq)]
enum DriveMotion {
    /// None.
    NotSimulated,
    /// Torques, on motions as commanded.
    AsCommanded,
    /// Torques, and the motion of a closed position and velocity loop.
    ClosedLoop,
}

impl DriveMotion {
    /// Depends on the measured columns; a model without masses and drive effects has no torques.
    fn of(model: &RobotModel, recording: &Recording) -> Self {
        if model.physics.arm.bodies().next().is_none() && model.drives.is_empty() {
            return Self::NotSimulated;
        }
        let has = |wanted: fn(&Channel) -> bool| recording.channels().any(|c| wanted(&c));
        let path = recording.metadata.kind == RecordingKind::Path;
        let by_command = path && recording.input_kind() == InputKind::Command;
        match has(|c| matches!(c, Channel::Torque(_))) {
            true if by_command && has(|c| matches!(c, Channel::Motor(_))) => Self::ClosedLoop,
            true => Self::AsCommanded,
            false => Self::NotSimulated,
        }
    }
}

/// Positions of the arm, row by row, along a recording whose inputs are held between samples.
fn run(
    model: &RobotModel,
    recording: &Recording,
    drive_motion: DriveMotion,
) -> Result<SimulatedMotion, SimulationError> {
    let rows = campaign_import::motion(&model.physics.arm, recording)?;
    let with_drives = model.with_drives()?;
    let has_torques = drive_motion != DriveMotion::NotSimulated;
    if recording.metadata.kind == RecordingKind::Poses {
        let rows: Vec<(Inputs, bool)> =
            rows.iter().map(|row| (row.inputs, row.arrival == Arrival::FromPrevious)).collect();
        let torques = has_torques.then(|| drives::poses(&with_drives, &rows));
        return Ok(SimulatedMotion { states: forward::poses(&model.physics, &rows), torques });
    }
    let dynamics = dynamics(model)?;
    // The measured motor motion already contains delay and lag.
    let on_motors = Dynamics { delay_s: 0.0, lags: Vec::new(), ..dynamics.clone() };
    let is_same_segment =
        |a: &Pose, b: &Pose| recording.segment.get(a.row) == recording.segment.get(b.row);
    let (mut states, mut torques) = (Vec::with_capacity(rows.len()), Vec::new());
    for segment in rows.chunk_by(is_same_segment) {
        let mut inputs: Vec<Inputs> = segment.iter().map(|row| row.inputs).collect();
        match drive_motion {
            DriveMotion::NotSimulated => {}
            DriveMotion::AsCommanded => {
                torques.extend(drives::path(&with_drives, &dynamics, &inputs));
            }
            DriveMotion::ClosedLoop => {
                let followed = servo::path(&with_drives, &dynamics, &inputs)?;
                torques.extend(followed.iter().map(|row| row.torque));
                inputs
                    .iter_mut()
                    .zip(followed)
                    .for_each(|(row, simulated)| row.q = simulated.motor);
            }
        }
        let is_closed = drive_motion == DriveMotion::ClosedLoop;
        let dynamics = if is_closed { &on_motors } else { &dynamics };
        states.extend(forward::path(&model.physics, dynamics, &inputs));
    }
    Ok(SimulatedMotion { states, torques: has_torques.then_some(torques) })
}

/// Delays, lags and modes of the model; effects of drives and forces have no dynamics and are skipped.
fn dynamics(model: &RobotModel) -> Result<Dynamics, SimulationError> {
    let mut dynamics = Dynamics::default();
    let arm = &model.physics.arm;
    for entry in model.not_compensated.iter().filter_map(|index| model.file.effects.get(*index)) {
        let Some(numbers) = entry.to_si(arm) else { continue };
        let given: Vec<(&str, &[f64])> = numbers.iter().map(|(s, v)| (*s, v.as_slice())).collect();
        let joint = entry.joint.map(|joint| joint.saturating_sub(1));
        dynamics
            .add_named(arm, &entry.kind, joint, entry.channel.as_deref(), ParameterValues(&given))
            .map_err(|error| SimulationError::Dynamics {
                effect: entry.title(),
                reason: error.to_string(),
            })?;
    }
    Ok(dynamics)
}
