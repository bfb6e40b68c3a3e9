//! Poses that detect damage.

use std::collections::BTreeMap;

use diagnosis::Hypothesis;
use diagnosis::plan::Criterion;
use diagnosis::plan::check::{ErrorRates, PlannedCheck, plan_check};
use diagnosis::plan::starting_point::StartingPoint;
use report::{Number, Page, Table, TextLine, TextTable, Tone, fixed, pluralise, significant};
use serde::Serialize;

use super::files::PlanFile;
use super::page::{PageContent, numbered, render};
use super::{DetectableReport, Robot, Settings, assumptions, detectable_table, minimum_detectable};
use crate::error::Error;
use crate::positions::{columns, joint_positions_text};

/// Poses of a check: `trued.plan/1` (docs/reference/results.md).
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CheckReport<'a> {
    does: &'static str,
    model: &'a str,
    seed: u64,
    alarm: f64,
    power: f64,
    poses: Vec<BTreeMap<String, f64>>,
    detectable: Vec<DetectableReport>,
    not_checked: Vec<&'static str>,
}

/// Poses of a check.
#[derive(Clone, Debug)]
pub struct CheckPlan<'a> {
    robot: Robot<'a>,
    settings: &'a Settings,
    start: StartingPoint,
    terms: ErrorRates,
    /// The chosen poses.
    pub found: PlannedCheck,
}

/// Chooses `count` poses at which damage is detectable.
///
/// ```
/// use diagnosis::plan::Criterion;
/// use diagnosis::plan::check::ErrorRates;
/// use diagnosis_report::plan::{Robot, Settings, check_poses};
/// use recording::model::RobotModel;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let model = RobotModel::read("irb120".as_ref())?;
/// let robot = Robot { model: &model, recordings: &[] };
/// let settings = Settings { candidates: 40, ..Settings::default() };
/// let rates = ErrorRates { alarm: 0.01, power: 0.9 };
/// let plan = check_poses(robot, &settings, &rates, Criterion::D, 10)?;
/// assert_eq!(plan.found.poses.len(), 10);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// [`Error::Input`] if recordings cannot be used, or fewer poses satisfy the constraints.
pub fn check_poses<'a>(
    robot: Robot<'a>,
    settings: &'a Settings,
    terms: &ErrorRates,
    criterion: Criterion,
    count: usize,
) -> Result<CheckPlan<'a>, Error> {
    let mut start = settings.start(robot)?;
    start.task.hypothesis = Hypothesis::fixed(robot.model.physics);
    let plan_settings = settings.plan_settings(count, criterion);
    let found =
        plan_check(&start.task, &robot.model.sigma, &plan_settings, terms).map_err(Error::input)?;
    Ok(CheckPlan { robot, settings, start, terms: *terms, found })
}

impl CheckPlan<'_> {
    /// The result as an object.
    #[must_use]
    pub fn report(&self) -> CheckReport<'_> {
        let Self { robot: Robot { model, .. }, settings, start, terms, found } = self;
        CheckReport {
            does: "check",
            model: &model.file.name,
            seed: settings.seed,
            alarm: terms.alarm,
            power: terms.power,
            poses: found.poses.iter().map(|q| columns(&model.physics.arm, q)).collect(),
            detectable: DetectableReport::all(&model.physics, &found.detectable),
            not_checked: settings.not_checked(&start.task.measurement),
        }
    }

    /// The result in lines of text, its tables at most `width_max` characters wide.
    #[must_use]
    pub fn text(&self, width_max: Option<usize>) -> Vec<TextLine> {
        let Self { robot, settings, start, found, .. } = self;
        let model = &robot.model.physics;
        let head = pluralise(found.poses.len(), "pose");
        let rest = format!(" for a check (seed {})", settings.seed);
        let mut lines = vec![TextLine::with_head(Tone::Plain, head, rest)];
        let poses = found.poses.iter().enumerate();
        let table =
            poses.fold(TextTable::new(["pose", "joints, deg (mm)"]), |table, (place, q)| {
                table.row([(place + 1).to_string(), joint_positions_text(&model.arm, q)])
            });
        lines.push(table.render(width_max).into());
        let (detected, false_alarms) = self.rates();
        lines.push(
            format!("detected in {detected} of 100 cases if at least this large, with {false_alarms} false alarms in 1000 undamaged robots:")
                .into(),
        );
        lines.push(detectable_table(model, &found.detectable, width_max).into());
        let assumed = assumptions(*robot).into_iter();
        lines.extend(assumed.map(|warning| TextLine::from(format!("note: {warning}"))));
        lines.extend(settings.closing(&settings.not_checked(&start.task.measurement)));
        lines
    }

    /// The result as a page.
    #[must_use]
    pub fn page(&self) -> Page {
        let Self { robot, settings, start, found, .. } = self;
        let heads = ["Damage", "Minimum detectable change"];
        let start_table = Table::new("Detectable damage", heads);
        let detectable = found.detectable.iter().fold(start_table, |table, one| {
            table.row([
                one.damage.says().into(),
                minimum_detectable(&robot.model.physics, one).into(),
            ])
        });
        let (detected, false_alarms) = self.rates();
        let not_checked = settings.not_checked(&start.task.measurement);
        let content = PageContent {
            title: "Check poses",
            verdict: format!("{} for a check", pluralise(found.poses.len(), "pose")),
            sentence: format!(
                "Damage of the size in the table is detected in {detected} of 100 cases, with {false_alarms} false alarms in 1000 undamaged robots."
            ),
            numbers: vec![Number::text("Poses", found.poses.len().to_string())],
            poses: numbered(&found.poses),
            details: vec![detectable],
            open: not_checked.iter().map(|open| format!("not checked: {open}")).collect(),
            next: (
                "Load the program and run it slowly first; measure, enter the readings in poses.csv, and evaluate them.",
                settings.evaluation_command("plan --check", "--report check.html "),
            ),
        };
        render(robot.model, &content)
    }

    /// Robot programs and list of the poses.
    ///
    /// # Errors
    /// [`Error::File`] if a program would exceed the joint limits, or the axes do not match the robot.
    pub fn files(&self) -> Result<Vec<PlanFile>, Error> {
        let Self { robot, settings, start, found, .. } = self;
        let approach = settings.programs.approach(settings.setup.both_ways);
        settings.programs.files(robot.model, &start.task, &found.poses, approach)
    }

    /// Number of detections per 100 damaged robots, and of false alarms per 1000 undamaged ones.
    fn rates(&self) -> (String, String) {
        let ErrorRates { alarm, power } = self.terms;
        (fixed(100.0 * power, 0), significant(1e3 * alarm, 2))
    }
}
