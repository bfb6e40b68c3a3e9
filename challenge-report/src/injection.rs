//! Effects added to real torque recordings: cases, files of a case, and which added effects were found (`trued.injection/1`).
//!
//! The diagnosis of the original recording gives the model; with it the original and every modified recording are diagnosed again, and the first finding that
//! the original did not have is compared with the added effect. Findings of the original recording count neither as right nor as wrong. An effect that is
//! confounded with the parameters that are always fitted is not scored against a limit.
//!
//! ```
//! use challenge::answer::Answer;
//! use challenge_report::injection::{InjectionReport, NoInjection, RealRecording, cases};
//! use recording::model::RobotModel;
//! use recording::series::Recording;
//!
//! fn found(
//!     model: &RobotModel,
//!     recording: Recording,
//!     solve: impl Fn(&str, &str) -> Option<Answer>,
//! ) -> Result<InjectionReport, NoInjection> {
//!     let mut real = RealRecording::of("A".to_owned(), model, &[recording])?;
//!     let answer = solve(&real.model, &real.table());
//!     real.set_answer(answer.as_ref());
//!     let reals = [real];
//!     let (cases, cannot_be_added) = cases(&reals, 7);
//!     let answers = cases.iter().map(|case| (case, solve(&case.recording.model, &case.table())));
//!     let lines = answers.map(|(case, answer)| case.line(answer.as_ref())).collect();
//!     Ok(InjectionReport::of(7, &cases, lines, cannot_be_added))
//! }
//! ```

use challenge::answer::{Answer, Finding};
use challenge::arm::{JOINTS, Joints};
use challenge::comparison::DISTINGUISHABLE_GAIN;
use challenge::effect::EffectKind;
use challenge::rng::Rng;
use challenge::torque::inject::{InjectedEffect, PreparedRecording, RecordedRow};
use challenge::torque::kinds::Kind;
use challenge::torque::rig::Rig;
use physics::{Arm, JointKind};
use recording::files::FileError;
use recording::model::RobotModel;
use recording::series::{Channel, Recording};
use serde::Serialize;

use crate::text::share as percent;

/// Target values of z of the added effects.
const STRENGTHS: [f64; 3] = [10.0, 20.0, 40.0];
/// Attempts per kind before it is reported that it cannot be added.
const DRAWS: usize = 6;

/// Reason why effects cannot be added to a recording.
#[derive(Debug, thiserror::Error)]
pub enum NoInjection {
    /// The kinematic structure is not supported.
    #[error("effects are added to arms of up to seven revolute joints, or to one slide")]
    Robot,
    /// The recording is too short.
    #[error("{0}: no section with positions and torques of every joint is long enough")]
    TooShort(String),
    /// The written model does not load.
    #[error(transparent)]
    Model(#[from] FileError),
}

/// An added effect and the findings.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct InjectedLine {
    recording: String,
    effect: &'static str,
    joint: Option<usize>,
    parameters: Vec<f64>,
    z: f64,
    least_gain: f64,
    counts: bool,
    first_new: Option<String>,
    right: bool,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Share {
    z: f64,
    cases: usize,
    right: usize,
    share: Option<f64>,
}

/// The result: `trued.injection/1` (docs/reference/results.md).
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct InjectionReport {
    seed: u64,
    at_z: Vec<Share>,
    /// Effects that are not identifiable at any size beside the parameters that are always fitted,
    /// by recording.
    cannot_be_added: Vec<String>,
    cases: Vec<InjectedLine>,
}

/// A real recording to which effects are added.
pub struct RealRecording {
    /// Its name in results and folders.
    pub name: String,
    /// Text of its model: the given one, later the one written by its own diagnosis.
    pub model: String,
    prepared: PreparedRecording,
    positions: Vec<Joints>,
    has_slides: bool,
    /// Findings of its own diagnosis with that model.
    findings: Vec<Finding>,
}

/// An added effect.
pub struct InjectedCase<'a> {
    /// The recording that it is added to.
    pub recording: &'a RealRecording,
    z: f64,
    injected: InjectedEffect,
}

impl RealRecording {
    /// The rows of recordings of one robot that contain positions and torques of every joint.
    ///
    /// # Errors
    /// Another kind of robot, or too few rows.
    pub fn of(
        name: String,
        model: &RobotModel,
        recordings: &[Recording],
    ) -> Result<Self, NoInjection> {
        let (rig, has_slides) = rig(&model.physics.arm)?;
        let rows: Vec<RecordedRow> =
            recordings.iter().flat_map(|one| rows(one, rig.count())).collect();
        let prepared =
            PreparedRecording::of(rig, &rows).ok_or_else(|| NoInjection::TooShort(name.clone()))?;
        let positions = prepared.sources().iter().map(|row| rows[*row].2).collect();
        let (model, findings) = (model.file.to_toml(), Vec::new());
        Ok(Self { name, model, prepared, positions, has_slides, findings })
    }

    /// The unmodified recording as CSV.
    #[must_use]
    pub fn table(&self) -> String {
        self.table_of(self.prepared.rows().1)
    }

    /// Replaces the model by the one that its diagnosis wrote, without uncertainties: for its own recording the fitted parameters are exact, and additions are
    /// relative to them.
    ///
    /// # Errors
    /// The text is not a valid model.
    pub fn set_model(&mut self, written: &str) -> Result<(), NoInjection> {
        let mut file = RobotModel::parse(&self.name, written).map_err(FileError::from)?.file;
        for parameter in file.effects.iter_mut().flat_map(|effect| &mut effect.parameters) {
            parameter.sigma = None;
        }
        self.model = file.to_toml();
        Ok(())
    }

    /// Sets the answer of the diagnosis of the unmodified recording with its model.
    pub fn set_answer(&mut self, answer: Option<&Answer>) {
        self.findings = answer.map_or_else(Vec::new, claims);
    }

    fn table_of(&self, torques: &[Joints]) -> String {
        let n = self.prepared.count();
        let (position, torque) = if self.has_slides { ("m", "N") } else { ("rad", "Nm") };
        let mut names = vec!["t_s".to_owned(), "segment".to_owned()];
        names.extend((1..=n).map(|i| format!("qa{i}_{position}")));
        names.extend((1..=n).map(|i| format!("tau{i}_{torque}")));
        let mut text = names.join(",") + "\n";
        for (row, (run, t_s)) in self.prepared.rows().0.iter().enumerate() {
            let parameters = self.positions[row].iter().take(n).chain(torques[row].iter().take(n));
            let parameters: Vec<String> = parameters.map(|x| format!("{x:.9}")).collect();
            text += &format!("{t_s:.7},{run},{}\n", parameters.join(","));
        }
        text
    }
}

/// Each kind of effect, on a random joint, at each strength, added to each recording; and the combinations that could not be added.
#[must_use]
pub fn cases(recordings: &[RealRecording], seed: u64) -> (Vec<InjectedCase<'_>>, Vec<String>) {
    let (mut cases, mut cannot) = (Vec::new(), Vec::new());
    for (place, recording) in recordings.iter().enumerate() {
        for (turn, kind) in Kind::DICTIONARY.into_iter().enumerate() {
            for (step, z) in STRENGTHS.into_iter().enumerate() {
                let number = ((place * Kind::DICTIONARY.len() + turn) * 3 + step) as u64;
                match inject(recording, kind, z, &mut Rng::new(seed, number)) {
                    Some(injected) => cases.push(InjectedCase { recording, z, injected }),
                    None => cannot.push(format!("{kind:?} at {z} to {}", recording.name)),
                }
            }
        }
    }
    (cases, cannot)
}

/// An added effect. Scored effects are preferred; others are used only if nothing else can be added.
fn inject(recording: &RealRecording, kind: Kind, z: f64, rng: &mut Rng) -> Option<InjectedEffect> {
    let mut best: Option<InjectedEffect> = None;
    for _ in 0..DRAWS {
        let Some(one) = recording.prepared.inject(kind, z, rng) else { continue };
        let counts = one.detectability.least_gain >= DISTINGUISHABLE_GAIN;
        if counts || best.is_none() {
            best = Some(one);
        }
        if counts {
            break;
        }
    }
    best
}

impl InjectedCase<'_> {
    /// The recording with the added effect as CSV.
    #[must_use]
    pub fn table(&self) -> String {
        self.recording.table_of(&self.injected.torques)
    }

    /// Compares the first finding that the original recording did not have with the added effect.
    #[must_use]
    pub fn line(&self, answer: Option<&Answer>) -> InjectedLine {
        let Self { recording, injected, .. } = self;
        let findings = answer.map_or_else(Vec::new, claims);
        let is_old = |one: &Finding| recording.findings.iter().any(|old| old.effect == one.effect);
        let first = findings.iter().find(|one| !is_old(one));
        let effect = injected.effect.kind.name().unwrap_or_default();
        let joint = injected.effect.joint_number();
        let is_right = |finding: &&Finding| {
            let named = &finding.effect;
            let same = injected.detectability.same.iter();
            (named.name == effect && named.joint == joint)
                || same.into_iter().any(|(e, j)| named.name == *e && named.joint == *j)
        };
        InjectedLine {
            recording: recording.name.clone(),
            effect,
            joint,
            parameters: injected.effect.parameters.clone(),
            z: injected.detectability.z,
            least_gain: injected.detectability.least_gain,
            counts: injected.detectability.least_gain >= DISTINGUISHABLE_GAIN,
            first_new: first.map(|one| match one.effect.joint {
                Some(joint) => format!("{} {joint}", one.effect.name),
                None => one.effect.name.clone(),
            }),
            right: first.as_ref().is_some_and(is_right),
        }
    }
}

impl InjectionReport {
    /// The result of all cases, in their order.
    #[must_use]
    pub fn of(
        seed: u64,
        cases: &[InjectedCase<'_>],
        lines: Vec<InjectedLine>,
        cannot_be_added: Vec<String>,
    ) -> Self {
        let at_z = STRENGTHS.iter().map(|z| Share::of(*z, cases, &lines)).collect();
        Self { seed, at_z, cannot_be_added, cases: lines }
    }

    /// The result as lines of text.
    #[must_use]
    pub fn text(&self) -> String {
        let lines = self.at_z.iter().map(|share| {
            let (z, figure, cases) = (share.z, percent(share.share), share.cases);
            format!("first new answer right, z {z:>3}   {figure} of {cases}\n")
        });
        lines.collect::<String>()
            + &format!("cannot be added     {}", self.cannot_be_added.join(", "))
    }
}

impl Share {
    fn of(z: f64, cases: &[InjectedCase<'_>], lines: &[InjectedLine]) -> Self {
        let counted = cases.iter().zip(lines).filter(|(case, line)| case.z == z && line.counts);
        let (count, right) =
            counted.fold((0, 0), |(n, right), (_, line)| (n + 1, right + usize::from(line.right)));
        Self { z, cases: count, right, share: (count > 0).then(|| right as f64 / count as f64) }
    }
}

/// Findings that are claims.
fn claims(answer: &Answer) -> Vec<Finding> {
    if answer.verdict.makes_claims() { answer.findings.clone() } else { Vec::new() }
}

/// The model's kinematic chain in the types of the challenge, and whether the joint is prismatic.
fn rig(arm: &Arm) -> Result<(Rig, bool), NoInjection> {
    let joints = arm.joints();
    let has_slides = joints.iter().any(|joint| joint.kind == JointKind::Prismatic);
    if joints.len() > JOINTS || has_slides && joints.len() > 1 {
        return Err(NoInjection::Robot);
    }
    let axes: Vec<_> = joints.iter().map(|j| (j.axis.to_array(), j.point.to_array())).collect();
    let tcp = arm.tool.tcp.to_array();
    Ok((Rig::from_axes(&axes, has_slides, tcp, arm.gravity.to_array()), has_slides))
}

/// Rows that contain positions and torques of every joint.
fn rows(recording: &Recording, joints: usize) -> Vec<RecordedRow> {
    let positions: Vec<Option<&[f64]>> = (0..joints)
        .map(|i| recording.column(Channel::Motor(i)).or(recording.column(Channel::Command(i))))
        .collect();
    let torque = |i: usize| {
        let torque = recording.column(Channel::Torque(i)).map(<[f64]>::to_vec);
        torque.or_else(|| {
            let constant = recording.metadata.torque_per_ampere.get(i)?;
            let current = recording.column(Channel::Current(i))?;
            Some(current.iter().map(|ampere| constant * ampere).collect())
        })
    };
    let torques: Vec<Option<Vec<f64>>> = (0..joints).map(torque).collect();
    let mut all = Vec::new();
    for row in 0..recording.len() {
        let position = |i: usize| positions.get(i).copied().flatten().map_or(0.0, |c| c[row]);
        let torque = |i: usize| torques.get(i).and_then(Option::as_ref).map_or(0.0, |c| c[row]);
        let (q, tau): (Joints, Joints) =
            (std::array::from_fn(position), std::array::from_fn(torque));
        if q.iter().chain(&tau).all(|x| x.is_finite()) {
            let segment = recording.segment[row].unsigned_abs() as usize;
            all.push((segment, recording.t_s[row], q, tau));
        }
    }
    all
}
