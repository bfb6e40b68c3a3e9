//! `trued challenge --inject`: effects added to real torque recordings. The diagnosis of the
//! original recording gives the model; with it the original and every modified recording are
//! diagnosed again, and the first finding that the original did not have is compared with the added
//! effect.
//!
//! Findings of the original recording count neither as right nor as wrong. An effect that the
//! recording cannot separate from the parameters that are always fitted does not count towards a
//! limit.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use challenge::answer::{Answer, Finding};
use challenge::arm::{JOINTS, Joints};
use challenge::chance::Chance;
use challenge::law::Law;
use challenge::torque::inject::{Injected, Real, Row};
use challenge::torque::kinds::Kind;
use challenge::torque::rig::Rig;
use challenge::weigh::APART;
use physics::{Arm, JointKind};
use recording::model::RobotModel;
use recording::series::{Channel, Recording};
use serde::Serialize;

use super::Work;
use super::solver::Solver;
use crate::exit::{Answer as Done, Failure, Outcome};
use crate::input::Reading;
use crate::output::Console;

/// Strengths of the added effects.
const STRENGTHS: [f64; 3] = [10.0, 20.0, 40.0];
/// Attempts per kind before it is reported that it cannot be added.
const DRAWS: usize = 6;

/// An added effect and the findings.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Line {
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

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Report {
    seed: u64,
    at_z: Vec<Share>,
    /// Effects that are not identifiable at any size beside the parameters that are always fitted,
    /// by recording.
    cannot_be_added: Vec<String>,
    cases: Vec<Line>,
}

/// A recording being processed.
struct Plain {
    name: String,
    real: Real,
    places: Vec<Joints>,
    slides: bool,
    /// The model that its own diagnosis wrote.
    model: String,
    /// Its findings with that model.
    said: Vec<Finding>,
}

/// An added effect.
struct Case<'a> {
    plain: &'a Plain,
    z: f64,
    injected: Injected,
}

pub(super) struct Injection<'a> {
    pub(super) reading: &'a Reading,
    pub(super) recordings: &'a [PathBuf],
    pub(super) out: &'a Path,
    pub(super) seed: u64,
    pub(super) solver: &'a Solver,
}

impl Injection<'_> {
    pub(super) fn run(&self, console: &mut Console, work: &Work<'_>) -> Outcome {
        let mut plains = Vec::new();
        for path in self.recordings {
            plains.push(self.plain(path, work.stop)?);
        }
        let (cases, cannot) = self.cases(&plains);
        let lines = work.each(console, cases.len(), "solving", |index| {
            self.line(&cases[index], index, work.stop)
        })?;
        let report = Report {
            seed: self.seed,
            at_z: STRENGTHS.iter().map(|z| share(*z, &cases, &lines)).collect(),
            cannot_be_added: cannot,
            cases: lines,
        };
        let text = serde_json::to_string_pretty(&report).map_err(Failure::system)?;
        let mut outputs = console.outputs();
        outputs.put(&self.out.join("outcomes.json"), text + "\n");
        console.write(outputs, "trued.injection/1", &report)?;
        for share in &report.at_z {
            let figure = super::told::share(share.share);
            console.say(format!(
                "first new answer right, z {:>3}   {figure} of {}",
                share.z, share.cases
            ))?;
        }
        console.say(format!("cannot be added     {}", report.cannot_be_added.join(", ")))?;
        Ok(Done::Done)
    }

    /// Reads a recording, diagnoses it, and diagnoses it again with the resulting model.
    fn plain(&self, path: &Path, stop: &AtomicBool) -> Result<Plain, Failure> {
        let (model, recordings) = self.reading.measured(&[path.to_owned()])?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let given = model.file.to_toml();
        let (rig, slides) = rig(&model.physics.arm)?;
        let rows: Vec<Row> = recordings.iter().flat_map(|one| rows(one, rig.count())).collect();
        let few = || {
            Failure::input(format!(
                "{name}: no stretch of positions and torques of every joint is long enough"
            ))
        };
        let real = Real::of(rig, &rows).ok_or_else(few)?;
        let places = real.sources().iter().map(|row| rows[*row].2).collect();
        let mut plain = Plain { name, real, places, slides, model: given, said: Vec::new() };
        let torques = plain.real.rows().1.to_vec();
        let first = self.answer(&plain, "first", &torques, stop)?;
        let written = first.1.ok_or_else(|| {
            Failure::input(format!(
                "{}: the solver gave no model for the plain recording",
                plain.name
            ))
        })?;
        plain.model = exact(&plain.name, &written)?;
        let again = self.answer(&plain, "again", &torques, stop)?;
        plain.said = again.0.map_or_else(Vec::new, |answer| claims(&answer));
        Ok(plain)
    }

    fn answer(
        &self,
        plain: &Plain,
        what: &str,
        torques: &[Joints],
        stop: &AtomicBool,
    ) -> Result<(Option<Answer>, Option<String>), Failure> {
        let folder = self.out.join("cases").join(&plain.name).join(what);
        std::fs::create_dir_all(&folder).map_err(Failure::system)?;
        let files = [("model.toml", plain.model.clone()), ("recording.csv", plain.text(torques))];
        super::write(files.map(|(name, text)| (folder.join(name), text)))?;
        let out = self.out.join("answers").join(&plain.name).join(what);
        let run = self.solver.answer(&folder, &out, stop)?;
        let answer = run.diagnosis.as_deref().and_then(|text| Answer::parse(text, "torque").ok());
        Ok((answer, run.model))
    }

    /// Each kind, on a random joint, at each strength, on each recording; and what could not be
    /// added.
    fn cases<'p>(&self, plains: &'p [Plain]) -> (Vec<Case<'p>>, Vec<String>) {
        let (mut cases, mut cannot) = (Vec::new(), Vec::new());
        for (place, plain) in plains.iter().enumerate() {
            for (turn, kind) in Kind::LIBRARY.into_iter().enumerate() {
                for (step, z) in STRENGTHS.into_iter().enumerate() {
                    let number = ((place * Kind::LIBRARY.len() + turn) * 3 + step) as u64;
                    let mut chance = Chance::new(self.seed, number);
                    let mut best: Option<Injected> = None;
                    // Effects that count towards a limit are preferred; others are tested only if
                    // nothing else can be added.
                    for _ in 0..DRAWS {
                        let Some(one) = plain.real.inject(kind, z, &mut chance) else { continue };
                        let counts = one.judged.least_gain >= APART;
                        if counts || best.is_none() {
                            best = Some(one);
                        }
                        if counts {
                            break;
                        }
                    }
                    match best {
                        Some(injected) => cases.push(Case { plain, z, injected }),
                        None => cannot.push(format!("{kind:?} at {z} to {}", plain.name)),
                    }
                }
            }
        }
        (cases, cannot)
    }

    fn line(&self, case: &Case<'_>, index: usize, stop: &AtomicBool) -> Result<Line, Failure> {
        let Case { plain, injected, .. } = case;
        let answer = self.answer(plain, &format!("{index:03}"), &injected.torques, stop)?.0;
        let said = answer.as_ref().map_or_else(Vec::new, claims);
        let first = said.iter().find(|one| !plain.said.iter().any(|old| old.named == one.named));
        let effect = injected.effect.kind.name().unwrap_or_default();
        let joint = injected.effect.joint_said();
        let is = |finding: &&Finding| {
            let named = &finding.named;
            let same = injected.judged.same.iter();
            (named.effect == effect && named.joint == joint)
                || same.into_iter().any(|(e, j)| named.effect == *e && named.joint == *j)
        };
        Ok(Line {
            recording: plain.name.clone(),
            effect,
            joint,
            parameters: injected.effect.numbers.clone(),
            z: injected.judged.z,
            least_gain: injected.judged.least_gain,
            counts: injected.judged.least_gain >= APART,
            first_new: first.map(|one| match one.named.joint {
                Some(joint) => format!("{} {joint}", one.named.effect),
                None => one.named.effect.clone(),
            }),
            right: first.as_ref().is_some_and(is),
        })
    }
}

fn share(z: f64, cases: &[Case<'_>], lines: &[Line]) -> Share {
    let counted = cases.iter().zip(lines).filter(|(case, line)| case.z == z && line.counts);
    let (count, right) =
        counted.fold((0, 0), |(n, right), (_, line)| (n + 1, right + usize::from(line.right)));
    Share { z, cases: count, right, share: (count > 0).then(|| right as f64 / count as f64) }
}

/// Findings that are claims.
fn claims(answer: &Answer) -> Vec<Finding> {
    if answer.verdict.claims() { answer.findings.clone() } else { Vec::new() }
}

/// The model without uncertainties: for its own recording the fitted parameters are exact, and
/// additions are relative to them.
fn exact(name: &str, model: &str) -> Result<String, Failure> {
    let mut file = RobotModel::parse(name, model).map_err(Failure::input)?.file;
    for parameter in file.effects.iter_mut().flat_map(|effect| &mut effect.parameters) {
        parameter.sigma = None;
    }
    Ok(file.to_toml())
}

/// The model's kinematic chain in the types of the challenge.
fn rig(arm: &Arm) -> Result<(Rig, bool), Failure> {
    let joints = arm.joints();
    let slides = joints.iter().any(|joint| joint.kind == JointKind::Prismatic);
    if joints.len() > JOINTS || slides && joints.len() > 1 {
        return Err(Failure::input(
            "effects are added to arms of up to seven revolute joints, or to one slide",
        ));
    }
    let axes: Vec<_> = joints.iter().map(|j| (j.axis.to_array(), j.point.to_array())).collect();
    let tcp = arm.tool.tcp.to_array();
    Ok((Rig::of_axes(&axes, slides, tcp, arm.gravity.to_array()), slides))
}

/// Rows that contain positions and torques of every joint.
fn rows(recording: &Recording, joints: usize) -> Vec<Row> {
    let places: Vec<Option<&[f64]>> = (0..joints)
        .map(|i| recording.column(Channel::Motor(i)).or(recording.column(Channel::Command(i))))
        .collect();
    let torque = |i: usize| {
        let torque = recording.column(Channel::Torque(i)).map(<[f64]>::to_vec);
        torque.or_else(|| {
            let constant = recording.about.torque_per_ampere.get(i)?;
            let current = recording.column(Channel::Current(i))?;
            Some(current.iter().map(|ampere| constant * ampere).collect())
        })
    };
    let torques: Vec<Option<Vec<f64>>> = (0..joints).map(torque).collect();
    let mut all = Vec::new();
    for row in 0..recording.len() {
        let place = |i: usize| places.get(i).copied().flatten().map_or(0.0, |c| c[row]);
        let torque = |i: usize| torques.get(i).and_then(Option::as_ref).map_or(0.0, |c| c[row]);
        let (q, tau): (Joints, Joints) = (std::array::from_fn(place), std::array::from_fn(torque));
        if q.iter().chain(&tau).all(|x| x.is_finite()) {
            let segment = recording.segment[row].unsigned_abs() as usize;
            all.push((segment, recording.t_s[row], q, tau));
        }
    }
    all
}

impl Plain {
    /// The recording with these torques.
    fn text(&self, torques: &[Joints]) -> String {
        let n = self.real.count();
        let (place, torque) = if self.slides { ("m", "N") } else { ("rad", "Nm") };
        let mut names = vec!["t_s".to_owned(), "segment".to_owned()];
        names.extend((1..=n).map(|i| format!("qa{i}_{place}")));
        names.extend((1..=n).map(|i| format!("tau{i}_{torque}")));
        let mut text = names.join(",") + "\n";
        for (row, (run, t_s)) in self.real.rows().0.iter().enumerate() {
            let numbers = self.places[row].iter().take(n).chain(torques[row].iter().take(n));
            let numbers: Vec<String> = numbers.map(|x| format!("{x:.9}")).collect();
            text += &format!("{t_s:.7},{run},{}\n", numbers.join(","));
        }
        text
    }
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<Report>("challenge-injection", "trued.injection/1")
}
