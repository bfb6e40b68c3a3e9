//! Rotation of each joint per millimetre of path, by the controller's geometry.
//!
//! A joint that turns back and forth counts in both directions; gaps between segments of a
//! recording are not part of the path.

use glam::DVec3;
use physics::{Arm, Chain, Frame, JOINTS_MAX, JointKind, Joints};
use recording::series::{Recording, RecordingKind};
use std::f64::consts::TAU;

use crate::error::Error;

/// Number of steps in which a part of the path is evaluated.
const STEPS: usize = 16;
/// Minimum length of a path, mm.
const SHORTEST_MM: f64 = 1.0;

/// A path that cannot be used.
#[derive(Debug, thiserror::Error)]
enum GearPathError {
    #[error("{0}: contains poses at rest, expected a path (kind = \"path\")")]
    Poses(String),
    #[error("{0}: the tool moves by less than {SHORTEST_MM} mm in every segment, expected a path")]
    TooShort(String),
    #[error("--from has {given} positions, the robot has {joints} joints")]
    From { given: usize, joints: usize },
    #[error(
        "--cut is {0:?}, expected three finite lengths DX,DY,DZ, mm, together at least {SHORTEST_MM} mm"
    )]
    Cut(Vec<f64>),
    #[error("{at_mm:.1} mm along the cut: {source}")]
    Unreached { at_mm: f64, source: world::ik::IkError },
}

/// Revolutions of a joint per mm of path, without sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RevolutionsPerMm {
    /// Mean.
    pub mean: f64,
    /// Least.
    pub least: f64,
    /// Most.
    pub most: f64,
}

/// A part of the path.
#[derive(Clone, Debug)]
pub struct PathPart {
    /// Segment of the recording; 0 for a cut.
    pub segment: i64,
    /// Its begin from the start of the segment, mm.
    pub from_mm: f64,
    /// Its end from the start of the segment, mm.
    pub to_mm: f64,
    /// Rotation of each joint; 0 for a prismatic joint.
    pub turns: Vec<RevolutionsPerMm>,
}

/// A path and the rotations of the joints along it.
#[derive(Clone, Debug)]
pub struct TravelledPath {
    /// Description of the path.
    pub by: String,
    /// Length of the path, mm.
    pub length_mm: f64,
    /// Its parts in order.
    pub parts: Vec<PathPart>,
}

impl TravelledPath {
    /// Rotation of a joint along the whole path.
    pub(super) fn whole(&self, joint: usize) -> RevolutionsPerMm {
        let of = |part: &PathPart| (part.to_mm - part.from_mm, part.turns[joint]);
        let mean = self.parts.iter().map(of).map(|(mm, turns)| mm * turns.mean).sum::<f64>();
        let min = self.parts.iter().map(|p| p.turns[joint].least).fold(f64::INFINITY, f64::min);
        let max = self.parts.iter().map(|p| p.turns[joint].most).fold(0.0, f64::max);
        RevolutionsPerMm { mean: mean / self.length_mm, least: min, most: max }
    }

    fn of(by: String, arm: &Arm, runs: &[(i64, Vec<Joints>)], parts: usize) -> Option<Self> {
        let mut all = Vec::new();
        for (segment, rows) in runs {
            let run = Run::of(arm, rows);
            // A cut of exactly this length counts, independent of rounding at its ends.
            if run.length_mm() >= (1.0 - 1e-6) * SHORTEST_MM {
                all.extend((0..parts).map(|k| run.part(arm, *segment, k, parts)));
            }
        }
        let length_mm = all.iter().map(|part| part.to_mm - part.from_mm).sum();
        (!all.is_empty()).then_some(Self { by, length_mm, parts: all })
    }
}

/// One run of joint positions with the length of path at each.
struct Run<'a> {
    rows: &'a [Joints],
    path_mm: Vec<f64>,
}

impl<'a> Run<'a> {
    fn of(arm: &Arm, rows: &'a [Joints]) -> Self {
        let tcp = |q: &Joints| 1e3 * Chain::nominal(arm, q).base_from_tool.origin;
        let (mut place_mm, mut before) = (0.0, rows.first().map_or(DVec3::ZERO, tcp));
        let path_mm = rows.iter().map(|q| {
            let position = tcp(q);
            place_mm += (position - before).length();
            before = position;
            place_mm
        });
        Self { rows, path_mm: path_mm.collect() }
    }

    fn length_mm(&self) -> f64 {
        self.path_mm.last().copied().unwrap_or(0.0)
    }

    /// The joints at a place, between two rows by a straight line.
    fn at(&self, place_mm: f64) -> Joints {
        let last = self.rows.len() - 1;
        let after = self.path_mm.partition_point(|mm| *mm < place_mm).clamp(1, last);
        let (from, to) = (self.path_mm[after - 1], self.path_mm[after]);
        let part = if to > from { ((place_mm - from) / (to - from)).clamp(0.0, 1.0) } else { 1.0 };
        let (a, b) = (&self.rows[after - 1], &self.rows[after]);
        std::array::from_fn(|i| a[i] + part * (b[i] - a[i]))
    }

    fn part(&self, arm: &Arm, segment: i64, k: usize, parts: usize) -> PathPart {
        let step_mm = self.length_mm() / (parts * STEPS) as f64;
        let stations: Vec<Joints> =
            (k * STEPS..=(k + 1) * STEPS).map(|n| self.at(n as f64 * step_mm)).collect();
        let turns = arm.joints().iter().enumerate().map(|(joint, of)| {
            if of.kind != JointKind::Revolute {
                return RevolutionsPerMm { mean: 0.0, least: 0.0, most: 0.0 };
            }
            let steps = stations.windows(2).map(|q| (q[1][joint] - q[0][joint]).abs());
            let steps: Vec<f64> = steps.map(|turned| turned / TAU / step_mm).collect();
            RevolutionsPerMm {
                mean: steps.iter().sum::<f64>() / STEPS as f64,
                least: steps.iter().copied().fold(f64::INFINITY, f64::min),
                most: steps.iter().copied().fold(0.0, f64::max),
            }
        });
        let [from_mm, to_mm] = [k, k + 1].map(|n| (n * STEPS) as f64 * step_mm);
        PathPart { segment, from_mm, to_mm, turns: turns.collect() }
    }
}

/// The path of a recording, divided into the given number of parts per segment, at least 1; rows without
/// all joints are skipped.
///
/// ```no_run
/// use std::path::Path;
///
/// use recording::model::RobotModel;
/// use recording::series::{RequiredData, read};
/// use spectrum_report::gears::recorded;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let model = RobotModel::read(Path::new("irb1600-6-145-thesis"))?;
/// let recording = read(Path::new("path.csv"), None, RequiredData::Path)?;
/// let path = recorded(&model.physics.arm, &recording, 4)?;
/// println!("{:.0} mm, {} parts", path.length_mm, path.parts.len());
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// [`Error::Input`] if the recording holds poses at rest, or if the tool does not move.
pub fn recorded(arm: &Arm, recording: &Recording, parts: usize) -> Result<TravelledPath, Error> {
    let file = || recording.file.display().to_string();
    if recording.metadata.kind == RecordingKind::Poses {
        return Err(Error::input(GearPathError::Poses(file())));
    }
    let columns: Vec<&[f64]> =
        (0..arm.count()).map(|joint| recording.input(joint).unwrap_or_default()).collect();
    let mut runs: Vec<(i64, Vec<Joints>)> = Vec::new();
    for (row, segment) in recording.segment.iter().enumerate() {
        let mut q = [0.0; JOINTS_MAX];
        for (q, column) in q.iter_mut().zip(&columns) {
            *q = column.get(row).copied().unwrap_or(f64::NAN);
        }
        if q.iter().any(|q| !q.is_finite()) {
            continue;
        }
        match runs.last_mut().filter(|(of, _)| of == segment) {
            Some((_, rows)) => rows.push(q),
            None => runs.push((*segment, vec![q])),
        }
    }
    let by = format!("the joints of {}", file());
    TravelledPath::of(by, arm, &runs, parts)
        .ok_or_else(|| Error::input(GearPathError::TooShort(file())))
}

/// A straight cut: from a pose (deg, or mm for prismatic joints) by a displacement in the base
/// frame, mm, with constant tool orientation, divided into the given number of parts, at least 1.
///
/// # Errors
/// [`Error::Input`] if the pose has another number of joints than the arm, if the displacement is not three
/// finite lengths or shorter than 1 mm, or if the arm does not reach its end.
pub fn straight(
    arm: &Arm,
    from: &[f64],
    cut_mm: &[f64],
    parts: usize,
) -> Result<TravelledPath, Error> {
    let (given, joints) = (from.len(), arm.count());
    if given != joints {
        return Err(Error::input(GearPathError::From { given, joints }));
    }
    let cut = match cut_mm {
        [x, y, z] => 1e-3 * DVec3::new(*x, *y, *z),
        _ => DVec3::ZERO,
    };
    if !(cut.is_finite() && 1e3 * cut.length() >= SHORTEST_MM) {
        return Err(Error::input(GearPathError::Cut(cut_mm.to_vec())));
    }
    let mut q = [0.0; JOINTS_MAX];
    for ((q, from), joint) in q.iter_mut().zip(from).zip(arm.joints()) {
        *q = if joint.kind == JointKind::Revolute { from.to_radians() } else { 1e-3 * from };
    }
    let start = Chain::nominal(arm, &q).base_from_tool;
    let steps = parts * STEPS;
    let mut rows = vec![q];
    for step in 1..=steps {
        let along = step as f64 / steps as f64;
        let target = Frame::new(start.rotation, start.origin + along * cut);
        let at_mm = 1e3 * along * cut.length();
        q = world::ik::solve(arm, &target, &q)
            .map_err(|source| Error::input(GearPathError::Unreached { at_mm, source }))?;
        rows.push(q);
    }
    let by = format!("a straight cut by {cut_mm:?} mm in the base frame");
    TravelledPath::of(by, arm, &[(0, rows)], parts)
        .ok_or_else(|| Error::input(GearPathError::Cut(cut_mm.to_vec())))
}
