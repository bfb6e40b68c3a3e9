//! The page of a plan: contributions of the poses, a drawing of each, and what was not checked.
//!
//! All values are contained in the JSON too.

use physics::Joints;
use recording::model::RobotModel;
use report::{ArmPoses, Cell, Column, Number, Page, Svg, Table, Tone, beside};

use crate::drawings::joint_points;
use crate::positions::columns;

/// Poses per drawing: as many as fit on one sheet of paper.
const DRAWN: usize = 12;

/// Scale of joint positions, deg (of linear joints as many mm): far smaller ones are rounding of the inverse kinematics.
const WHOLE_TURN_DEG: f64 = 360.0;

/// Content of the page about the poses.
pub(super) struct PageContent<'a> {
    /// What the poses are.
    pub(super) title: &'static str,
    pub(super) verdict: String,
    pub(super) sentence: String,
    pub(super) numbers: Vec<Number>,
    /// Name and joint positions of each pose.
    pub(super) poses: Vec<(String, Joints)>,
    pub(super) details: Vec<Table>,
    /// Open questions, and constraints that were not checked.
    pub(super) open: Vec<String>,
    /// Instructions for the poses, and the command that evaluates the measurements.
    pub(super) next: (&'a str, String),
}

/// Renders the page.
pub(super) fn render(model: &RobotModel, content: &PageContent<'_>) -> Page {
    let arm = &model.physics.arm;
    let drawn = content.poses.iter().fold(ArmPoses::new("Poses"), |all, (name, q)| {
        all.pose(name.clone(), joint_points(arm, q))
    });
    let part = |from: usize| -> Svg { drawn.render_part(from..from + DRAWN) };
    let caption = |from: usize| {
        let to = (from + DRAWN).min(content.poses.len());
        let places = if to - from == 1 {
            format!("Pose {to}")
        } else {
            format!("Poses {} to {to}", from + 1)
        };
        format!(
            "{places} of {}, each from the side (left) and from above (right); red: the tool.",
            content.poses.len()
        )
    };
    let mut page = Page::new(format!("{} for {}", content.title, model.file.name))
        .kicker("trued plan")
        .robot(model.file.identity().to_string())
        .verdict(Tone::Plain, &content.verdict, &content.sentence)
        .numbers(content.numbers.clone())
        .figure(&caption(0), &part(0))
        .next(content.next.0, Some(&content.next.1));
    if content.poses.len() > DRAWN {
        page = page.section("The other poses");
        let starts = (DRAWN..content.poses.len()).step_by(DRAWN);
        page = starts.fold(page, |page, from| page.figure(&caption(from), &part(from)));
    }
    page = page.section("Joint positions").table(&positions(model, content));
    page = content.details.iter().fold(page, Page::table);
    page.section("Not identifiable, and not checked").list(&content.open)
}

fn positions(model: &RobotModel, content: &PageContent<'_>) -> Table {
    let named = content.poses.iter().map(|(name, q)| (name, columns(&model.physics.arm, q)));
    let mut table: Option<Table> = None;
    for (name, positions) in named {
        let heads = positions.keys().map(|key| match key.rsplit_once('_') {
            Some((joint, unit)) => Column::new(format!("{joint} ({unit})")).digits(4),
            None => Column::new(key.clone()),
        });
        let heads = std::iter::once(Column::new("Pose")).chain(heads);
        let start = || Table::new("Joint positions, as the controller shows them", heads);
        let cells = positions.values().map(|x| Cell::from(beside(*x, WHOLE_TURN_DEG)));
        let row = std::iter::once(Cell::from(name.as_str())).chain(cells);
        table = Some(table.take().unwrap_or_else(start).row(row));
    }
    table.unwrap_or_else(|| Table::new("No pose", ["Pose"]))
}

/// Poses named by their numbers.
pub(super) fn numbered(poses: &[Joints]) -> Vec<(String, Joints)> {
    poses.iter().enumerate().map(|(place, q)| (format!("pose {}", place + 1), *q)).collect()
}
