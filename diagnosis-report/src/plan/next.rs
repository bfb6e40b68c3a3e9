//! The next pose to measure, and whether measuring it is worthwhile.

use diagnosis::plan::next_pose::LOOKAHEAD_POSES;
use diagnosis::plan::starting_point::StartingPoint;
use diagnosis::plan::{NextPose, best_next_pose};
use report::{Number, Page, TextLine, Tone, pluralise};
use serde::Serialize;

use super::files::PlanFile;
use super::page::{PageContent, render};
use super::poses::{PoseReport, mm, uncertainty_change};
use super::{MILLI, Robot, Settings};
use crate::error::Error;
use crate::positions::joint_positions_text;

/// The next pose: `trued.plan/1` (docs/reference/results.md).
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct NextReport<'a> {
    does: &'static str,
    model: &'a str,
    seed: u64,
    measured_poses: usize,
    enough: bool,
    tool_mm: f64,
    tool_with_ten_more_mm: f64,
    worth_mm: f64,
    pose: PoseReport,
    not_checked: Vec<&'static str>,
}

/// The next pose to measure.
#[derive(Clone, Debug)]
pub struct NextPlan<'a> {
    robot: Robot<'a>,
    settings: &'a Settings,
    start: StartingPoint,
    worth_mm: f64,
    /// The chosen pose.
    pub found: NextPose,
}

/// Chooses the pose that reduces the tool's expected error most. `worth_mm`: least reduction of that error by ten more poses for measuring to be
/// worthwhile, mm.
///
/// ```
/// use diagnosis_report::plan::{Robot, Settings, next_pose};
/// use recording::model::RobotModel;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let model = RobotModel::read("irb120".as_ref())?;
/// let robot = Robot { model: &model, recordings: &[] };
/// let settings = Settings { candidates: 20, ..Settings::default() };
/// let next = next_pose(robot, &settings, 0.003)?;
/// assert!(!next.found.enough, "nothing was measured yet");
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// [`Error::Input`] if recordings cannot be used, or too few poses satisfy the constraints.
pub fn next_pose<'a>(
    robot: Robot<'a>,
    settings: &'a Settings,
    worth_mm: f64,
) -> Result<NextPlan<'a>, Error> {
    let start = settings.start_with_zone(robot)?;
    let Settings { candidates, seed, .. } = settings;
    let found = best_next_pose(&start.task, start.known(), *candidates, 1e-3 * worth_mm, *seed)
        .map_err(Error::input)?;
    Ok(NextPlan { robot, settings, start, worth_mm, found })
}

impl NextPlan<'_> {
    /// The result as an object.
    #[must_use]
    pub fn report(&self) -> NextReport<'_> {
        let Self { robot: Robot { model, .. }, settings, start, found, .. } = self;
        let [now_m, later_m] = found.tool_m;
        NextReport {
            does: "next",
            model: &model.file.name,
            seed: settings.seed,
            measured_poses: start.measured_poses(),
            enough: found.enough,
            tool_mm: MILLI * now_m,
            tool_with_ten_more_mm: MILLI * later_m,
            worth_mm: self.worth_mm,
            pose: PoseReport::of(model, &found.pose),
            not_checked: settings.not_checked(&start.task.measurement),
        }
    }

    /// The result in lines of text.
    #[must_use]
    pub fn text(&self) -> Vec<TextLine> {
        let Self { robot, settings, start, worth_mm, found } = self;
        let improvement = self.improvement();
        let first = if found.enough {
            let rest = format!(": {improvement} (worth measuring: {worth_mm} mm): stop");
            TextLine::with_head(Tone::Good, "enough", rest)
        } else {
            TextLine::with_head(Tone::Plain, "go on", format!(": {improvement}"))
        };
        let q = joint_positions_text(&robot.model.physics.arm, &found.pose.q);
        let [before_m, after_m] = found.pose.tool_m;
        let mut lines = vec![
            first,
            format!("next: {q}  (joints, deg; mm for a linear joint)").into(),
            format!(
                "why: it reduces the tool's expected error from {} to {} mm; {}",
                mm(before_m),
                mm(after_m),
                self.improved_parameters().join("; ")
            )
            .into(),
        ];
        lines.extend(settings.closing(&settings.not_checked(&start.task.measurement)));
        lines
    }

    /// The result as a page.
    #[must_use]
    pub fn page(&self) -> Page {
        let Self { robot, settings, start, worth_mm, found } = self;
        let region = settings.region();
        let improved = self.improved_parameters();
        let improved = improved.iter().map(|one| format!("becomes surer: {one}"));
        let not_checked = settings.not_checked(&start.task.measurement);
        let open = improved.chain(not_checked.iter().map(|open| format!("not checked: {open}")));
        let [before_m, after_m] = found.pose.tool_m;
        let content = PageContent {
            title: "The next pose",
            verdict: if found.enough { "enough measured" } else { "continue with this pose" }
                .to_owned(),
            sentence: format!("{}.", self.improvement()),
            numbers: vec![
                Number::new("Expected error now", MILLI * before_m, "mm").note(region),
                Number::new("With this pose", MILLI * after_m, "mm").note(region),
                Number::new("Worth measuring", *worth_mm, "mm").note("for ten more poses"),
            ],
            poses: vec![("next".to_owned(), found.pose.q)],
            details: Vec::new(),
            open: open.collect(),
            next: settings.calibration_steps(),
        };
        render(robot.model, &content)
    }

    /// Robot program and list of the pose.
    ///
    /// # Errors
    /// [`Error::File`] if a program would exceed the joint limits, or the axes do not match the robot.
    pub fn files(&self) -> Result<Vec<PlanFile>, Error> {
        let Self { robot, settings, start, found, .. } = self;
        let approach = settings.programs.approach(settings.setup.both_ways);
        settings.programs.files(robot.model, &start.task, &[found.pose.q], approach)
    }

    /// The tool's expected error, and its reduction by more poses, as text.
    fn improvement(&self) -> String {
        let [now_m, later_m] = self.found.tool_m;
        format!(
            "{} measured; expected error of the tool {} mm {}; {LOOKAHEAD_POSES} more poses would reduce it by {} mm",
            pluralise(self.start.measured_poses(), "pose"),
            mm(now_m),
            self.settings.region(),
            mm(now_m - later_m)
        )
    }

    fn improved_parameters(&self) -> Vec<String> {
        self.found.pose.reductions.iter().map(uncertainty_change).collect()
    }
}
