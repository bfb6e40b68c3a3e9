//! Poses of the test of ISO 9283.

use std::collections::BTreeMap;

use diagnosis::plan::iso::{IsoCube, cube, largest_cube};
use diagnosis::plan::starting_point::StartingPoint;
use glam::DVec3;
use physics::Joints;
use report::{Number, Page, TextLine, TextTable, fixed, pluralise};
use serde::Serialize;

use super::files::PlanFile;
use super::page::{PageContent, render};
use super::{MILLI, Robot, Settings};
use crate::error::Error;
use crate::positions::{columns, joint_positions_text};

/// Edges of a cube may differ by this much, m: below the resolution of the options.
const SAME_EDGE_M: f64 = 1e-6;

/// Poses of the test: `trued.plan/1` (docs/reference/results.md).
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct IsoReport<'a> {
    does: &'static str,
    model: &'a str,
    seed: u64,
    cycles: usize,
    cube_middle_mm: [f64; 3],
    cube_edge_mm: f64,
    poses: Vec<BTreeMap<String, f64>>,
    not_checked: Vec<&'static str>,
}

/// The five test poses, and how often they are visited.
#[derive(Clone, Debug)]
pub struct IsoPlan<'a> {
    robot: Robot<'a>,
    settings: &'a Settings,
    start: StartingPoint,
    cycles: usize,
    /// The cube and its poses.
    pub found: IsoCube,
}

/// Places the test cube: in the box of the settings' zone, otherwise the largest one in front of the arm. `along_base`: direction of the tool's z
/// axis, base frame, unit length; `cycles`: visits of each pose, 30 by the standard ([`diagnosis::plan::iso::VISITS_REQUIRED`]).
///
/// ```no_run
/// use diagnosis_report::plan::{Robot, Settings, iso_poses};
/// use glam::DVec3;
/// use recording::model::RobotModel;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let model = RobotModel::read("irb120".as_ref())?;
/// let robot = Robot { model: &model, recordings: &[] };
/// let settings = Settings::default();
/// let plan = iso_poses(robot, &settings, DVec3::NEG_Z, 30)?;
/// println!("a cube of {:.0} mm", 1e3 * plan.found.edge_m);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// [`Error::Input`] if the arm does not reach all five poses, or the zone is not a cube.
pub fn iso_poses<'a>(
    robot: Robot<'a>,
    settings: &'a Settings,
    along_base: DVec3,
    cycles: usize,
) -> Result<IsoPlan<'a>, Error> {
    let start = settings.start(robot)?;
    let (arm, reach, seed) = (&robot.model.physics.arm, &start.task.reach, settings.seed);
    let found = match &settings.zone {
        None => largest_cube(arm, reach, along_base, seed),
        Some(zone) => {
            let [low, high] = zone.corners;
            let edges = high - low;
            if edges.max_element() - edges.min_element() > SAME_EDGE_M {
                return Err(Error::input("--zone: the standard's cube has edges of one length"));
            }
            cube(arm, reach, 0.5 * (low + high), edges.x, along_base, seed)
        }
    };
    let found = found.ok_or_else(|| {
        Error::input(match &settings.zone {
            Some(_) => "the arm cannot reach all five poses of this cube with the tool in this direction: state another cube (--zone), none for the largest, or another --direction",
            None => "the arm reaches the five poses of no cube with the tool in this direction: state another --direction, or relax what bars a pose",
        })
    })?;
    Ok(IsoPlan { robot, settings, start, cycles, found })
}

impl IsoPlan<'_> {
    /// The result as an object.
    #[must_use]
    pub fn report(&self) -> IsoReport<'_> {
        let Self { robot: Robot { model, .. }, settings, start, cycles, found } = self;
        IsoReport {
            does: "iso9283",
            model: &model.file.name,
            seed: settings.seed,
            cycles: *cycles,
            cube_middle_mm: (MILLI * found.middle).to_array(),
            cube_edge_mm: MILLI * found.edge_m,
            poses: found.poses.iter().map(|q| columns(&model.physics.arm, q)).collect(),
            not_checked: settings.not_checked(&start.task.measurement),
        }
    }

    /// The result in lines of text, its table at most `width_max` characters wide.
    #[must_use]
    pub fn text(&self, width_max: Option<usize>) -> Vec<TextLine> {
        let Self { robot, settings, start, cycles, found } = self;
        let cycles = pluralise(*cycles, "cycle");
        let mut lines = vec![format!("{}; {cycles} of P5, P4, P3, P2, P1", self.cube()).into()];
        let poses = found.poses.iter().enumerate();
        let table =
            poses.fold(TextTable::new(["pose", "joints, deg (mm)"]), |table, (place, q)| {
                table.row([
                    format!("P{}", place + 1),
                    joint_positions_text(&robot.model.physics.arm, q),
                ])
            });
        lines.push(table.render(width_max).into());
        lines.push("the standard requires rated load, rated speed and a warm robot: set them on the controller".into());
        lines.extend(settings.closing(&settings.not_checked(&start.task.measurement)));
        lines
    }

    /// The result as a page.
    #[must_use]
    pub fn page(&self) -> Page {
        let Self { robot, settings, start, cycles, found } = self;
        let names = (1..).map(|place| format!("P{place}"));
        let not_checked = settings.not_checked(&start.task.measurement);
        let content = PageContent {
            title: "Test poses of ISO 9283",
            verdict: format!("five poses, {}", pluralise(*cycles, "cycle")),
            sentence: format!(
                "{} (base frame): the tool goes through P5, P4, P3, P2, P1, {}.",
                report::capitalised(&self.cube()),
                pluralise(*cycles, "time")
            ),
            numbers: vec![
                Number::new("Edge of the cube", MILLI * found.edge_m, "mm"),
                Number::text("Cycles", cycles.to_string()),
            ],
            poses: names.zip(found.poses).collect(),
            details: Vec::new(),
            open: not_checked.iter().map(|open| format!("not checked: {open}")).collect(),
            next: (
                "Set rated load and rated speed, warm the robot up, run the program slowly first; then measure and evaluate.",
                settings.evaluation_command("plan --iso9283", "--report iso9283.html "),
            ),
        };
        render(robot.model, &content)
    }

    /// Robot programs and list of all visits.
    ///
    /// # Errors
    /// [`Error::File`] if a program would exceed the joint limits, or the axes do not match the robot.
    pub fn files(&self) -> Result<Vec<PlanFile>, Error> {
        let Self { robot, settings, start, cycles, found } = self;
        // Always approached from the same direction: P5 to P1, repeatedly.
        let cycle = [4, 3, 2, 1, 0].map(|place| found.poses[place]);
        let stops: Vec<Joints> = (0..*cycles).flat_map(|_| cycle).collect();
        let approach = settings.programs.approach(false);
        settings.programs.files(robot.model, &start.task, &stops, approach)
    }

    fn cube(&self) -> String {
        let middle_mm = MILLI * self.found.middle;
        let [x, y, z] = middle_mm.to_array().map(|mm| fixed(mm, 0));
        format!("a cube of {} mm about {x} {y} {z} mm", fixed(MILLI * self.found.edge_m, 0))
    }
}
