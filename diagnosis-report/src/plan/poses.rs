//! Poses for a calibration, and the contribution of each.

use std::collections::BTreeMap;
use std::path::PathBuf;

use diagnosis::plan::starting_point::StartingPoint;
use diagnosis::plan::{Criterion, Plan, PoseContribution, UncertaintyReduction, plan};
use physics::Joints;
use recording::model::RobotModel;
use report::{Number, Page, Table, TextLine, TextTable, Tone, pluralise, significant};
use serde::Serialize;

use super::files::PlanFile;
use super::page::{PageContent, numbered, render};
use super::{MILLI, Robot, Settings};
use crate::error::Error;
use crate::positions::{columns, joint_positions_text};

/// Largest number of open questions in the text.
const OPEN: usize = 3;

/// Poses to measure: `trued.plan/1` (docs/reference/results.md).
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PosesReport<'a> {
    does: &'static str,
    model: &'a str,
    seed: u64,
    criterion: &'static str,
    candidates: usize,
    measured_poses: usize,
    poses: Vec<PoseReport>,
    numbers: Vec<UncertaintyReport>,
    undetermined: &'a [String],
    not_checked: Vec<&'static str>,
    out: Option<PathBuf>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct PoseReport {
    #[serde(flatten)]
    q: BTreeMap<String, f64>,
    readings: usize,
    log_det_gain: f64,
    o1: Option<f64>,
    tool_before_mm: f64,
    tool_after_mm: f64,
    surer: Vec<UncertaintyReport>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct UncertaintyReport {
    what: String,
    unit: &'static str,
    sigma_before: f64,
    sigma_after: f64,
}

impl PoseReport {
    pub(super) fn of(model: &RobotModel, pose: &PoseContribution) -> Self {
        Self {
            q: columns(&model.physics.arm, &pose.q),
            readings: pose.readings,
            log_det_gain: pose.log_det_gain,
            o1: pose.o1,
            tool_before_mm: MILLI * pose.tool_m[0],
            tool_after_mm: MILLI * pose.tool_m[1],
            surer: pose.reductions.iter().map(UncertaintyReport::of).collect(),
        }
    }
}

impl UncertaintyReport {
    fn of(falls: &UncertaintyReduction) -> Self {
        let (suffix, si) = falls.unit;
        Self {
            what: falls.what.clone(),
            unit: suffix.trim_start_matches('_'),
            sigma_before: falls.from / si,
            sigma_after: falls.to / si,
        }
    }
}

/// Text of a length in mm.
pub(super) fn mm(metres: f64) -> String {
    significant(MILLI * metres, 3)
}

/// A parameter's standard uncertainty before and after: `joint 4's offset (joint_offset) 0.42 → 0.11 mrad`.
pub(super) fn uncertainty_change(falls: &UncertaintyReduction) -> String {
    let (suffix, si) = falls.unit;
    let number = |sigma: f64| significant(sigma / si, 2);
    let unit = suffix.trim_start_matches('_').replace("_per_", "/");
    format!("{} {} → {} {unit}", falls.what, number(falls.from), number(falls.to))
}

/// Poses to measure for a calibration.
#[derive(Clone, Debug)]
pub struct PosesPlan<'a> {
    robot: Robot<'a>,
    settings: &'a Settings,
    start: StartingPoint,
    criterion: Criterion,
    /// The chosen poses.
    pub found: Plan,
}

/// Chooses the best `count` poses for a calibration by a criterion, complementing the existing measurements.
///
/// ```
/// use diagnosis::plan::Criterion;
/// use diagnosis_report::plan::{Robot, Settings, measuring_poses};
/// use recording::model::RobotModel;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let model = RobotModel::read("irb120".as_ref())?;
/// let robot = Robot { model: &model, recordings: &[] };
/// let settings = Settings { candidates: 20, ..Settings::default() };
/// let plan = measuring_poses(robot, &settings, Criterion::Random, 2)?;
/// assert_eq!(plan.found.poses.len(), 2);
/// for line in plan.text(None) {
///     println!("{line}");
/// }
/// for file in plan.files()? {
///     println!("{}: {} bytes", file.name, file.bytes.len());
/// }
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// [`Error::Input`] if recordings cannot be used, or fewer poses satisfy the constraints.
pub fn measuring_poses<'a>(
    robot: Robot<'a>,
    settings: &'a Settings,
    criterion: Criterion,
    count: usize,
) -> Result<PosesPlan<'a>, Error> {
    let start = settings.start_with_zone(robot)?;
    let plan_settings = settings.plan_settings(count, criterion);
    let found = plan(&start.task, start.known(), &plan_settings).map_err(Error::input)?;
    Ok(PosesPlan { robot, settings, start, criterion, found })
}

impl PosesPlan<'_> {
    /// The result as an object.
    #[must_use]
    pub fn report(&self) -> PosesReport<'_> {
        let Self { robot: Robot { model, .. }, settings, start, found, .. } = self;
        PosesReport {
            does: "plan",
            model: &model.file.name,
            seed: settings.seed,
            criterion: name(self.criterion),
            candidates: found.candidates,
            measured_poses: start.measured_poses(),
            poses: found.poses.iter().map(|pose| PoseReport::of(model, pose)).collect(),
            numbers: found.numbers.iter().map(UncertaintyReport::of).collect(),
            undetermined: &found.undetermined,
            not_checked: settings.not_checked(&start.task.measurement),
            out: settings.out.clone(),
        }
    }

    /// The result in lines of text, its table at most `width_max` characters wide.
    #[must_use]
    pub fn text(&self, width_max: Option<usize>) -> Vec<TextLine> {
        let Self { settings, start, found, .. } = self;
        let rest = format!(
            " of {} that pass (seed {}), {}; measured so far: {}",
            found.candidates,
            settings.seed,
            self.criterion_text(),
            start.measured_poses()
        );
        let head = pluralise(found.poses.len(), "pose");
        let mut lines = vec![TextLine::with_head(Tone::Plain, head, rest)];
        lines.push(self.table_of_poses(width_max).into());
        if let (Some(first), Some(last)) = (found.poses.first(), found.poses.last()) {
            let region = settings.region();
            let (before, after) = (mm(first.tool_m[0]), mm(last.tool_m[1]));
            lines.push(
                format!(
                    "expected error of the tool {region}: {before} mm before, {after} mm after"
                )
                .into(),
            );
        }
        let open = found.undetermined.iter().take(OPEN);
        lines.extend(open.map(|open| TextLine::from(format!("stays open: {open}"))));
        if found.undetermined.len() > OPEN {
            let more = found.undetermined.len() - OPEN;
            lines
                .push(format!("stays open: {more} more; all are in the JSON (--json FILE)").into());
        }
        lines.extend(settings.closing(&settings.not_checked(&start.task.measurement)));
        lines
    }

    /// The result as a page.
    #[must_use]
    pub fn page(&self) -> Page {
        let Self { robot, settings, start, found, .. } = self;
        let region = settings.region();
        let expected = found.poses.first().zip(found.poses.last());
        let [before, after] = expected.map_or([f64::NAN; 2], |(first, last)| {
            [MILLI * first.tool_m[0], MILLI * last.tool_m[1]]
        });
        let open = found
            .undetermined
            .iter()
            .map(|open| format!("not identifiable from these poses: {open}"));
        let not_checked = settings.not_checked(&start.task.measurement);
        let open = open.chain(not_checked.iter().map(|open| format!("not checked: {open}")));
        let content = PageContent {
            title: "Measuring poses",
            verdict: format!("{} to measure", pluralise(found.poses.len(), "pose")),
            sentence: format!(
                "{} of {} that pass, {}. With them the tool's expected error {region} falls from {} to {} mm.",
                pluralise(found.poses.len(), "pose"),
                found.candidates,
                self.criterion_text(),
                significant(before, 2),
                significant(after, 2)
            ),
            numbers: vec![
                Number::text("Poses", found.poses.len().to_string()),
                Number::new("Expected error now", before, "mm").note(region),
                Number::new("Expected error afterwards", after, "mm").note(region),
            ],
            poses: numbered(&self.stops()),
            details: vec![self.table_of_uncertainties()],
            open: open.collect(),
            next: settings.calibration_steps(),
        };
        render(robot.model, &content)
    }

    /// Robot programs and list of the poses.
    ///
    /// # Errors
    /// [`Error::File`] if a program would exceed the joint limits, or the axes do not match the robot.
    pub fn files(&self) -> Result<Vec<PlanFile>, Error> {
        let Self { robot, settings, start, .. } = self;
        let approach = settings.programs.approach(settings.setup.both_ways);
        settings.programs.files(robot.model, &start.task, &self.stops(), approach)
    }

    fn stops(&self) -> Vec<Joints> {
        self.found.poses.iter().map(|pose| pose.q).collect()
    }

    fn table_of_uncertainties(&self) -> Table {
        let heads = ["Parameter", "Unit", "Uncertainty now", "Afterwards"];
        self.found.numbers.iter().map(UncertaintyReport::of).fold(
            Table::new("Standard uncertainty of the identified parameters", heads),
            |table, falls| {
                let unit = falls.unit.replace("_per_", "/");
                table.row([
                    falls.what.into(),
                    unit.into(),
                    significant(falls.sigma_before, 2).into(),
                    significant(falls.sigma_after, 2).into(),
                ])
            },
        )
    }

    /// One line per pose, with the parameter that it improves most.
    fn table_of_poses(&self, width_max: Option<usize>) -> String {
        let arm = &self.robot.model.physics.arm;
        let start = TextTable::new(["pose", "joints, deg (mm)", "tool, mm"]);
        let table = self.found.poses.iter().enumerate().fold(start, |table, (place, pose)| {
            let tool = format!("{} → {}", mm(pose.tool_m[0]), mm(pose.tool_m[1]));
            table.row([(place + 1).to_string(), joint_positions_text(arm, &pose.q), tool])
        });
        let table = table.render(width_max);
        let improved =
            self.found.poses.iter().map(|pose| pose.reductions.first().map(uncertainty_change));
        let lines = table.lines().zip(std::iter::once(None).chain(improved));
        lines.fold(String::new(), |text, (line, improved)| match improved {
            Some(improved) => format!("{text}{line}\n      {improved}\n"),
            None => format!("{text}{line}\n"),
        })
    }

    fn criterion_text(&self) -> String {
        match self.criterion {
            Criterion::D => "best for all parameters together (D)".to_owned(),
            Criterion::O1 => "best by information per reading (O1)".to_owned(),
            Criterion::Random => "random".to_owned(),
            Criterion::Zone => format!("best for the tool {}", self.settings.region()),
        }
    }
}

fn name(criterion: Criterion) -> &'static str {
    match criterion {
        Criterion::D => "d",
        Criterion::O1 => "o1",
        Criterion::Zone => "zone",
        Criterion::Random => "random",
    }
}
