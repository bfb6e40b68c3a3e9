//! Preparation of a campaign and a model before the first fit: which rows are used, and which parameters have a prior. Excluded rows are reported; no
//! measured value is changed.

use super::thinning::{self, RowProperties, RowSelection};
use crate::campaign::Campaign;
use crate::candidates::REVERSALS;
use crate::hold_out::runs;
use crate::hypothesis::Hypothesis;
use crate::least_squares::visit_poses;
use crate::path_dynamics::paths;
use glam::DVec3;
use physics::Model;
use std::ops::Range;

/// Difference in tool position below which two initial states of backlash or friction are equivalent, m.
const SAME_POSITION_M: f64 = 1e-6;
/// Travel of a joint after which its initial state no longer matters, rad or m: hysteresis has decayed to a hundredth and backlash has been crossed.
/// Five times the shortest reversal distance of the dictionary.
const MEMORY_TRAVEL: f64 = 5.0 * REVERSALS[0];
/// Share of a path within which this travel must be reached; otherwise the rows are kept, since the loss of data would outweigh the unknown state of
/// a slow joint.
const START_SHARE: f64 = 0.05;

/// Sets velocities and accelerations along paths, from which inertial deflection is computed.
pub(super) fn set_velocities(campaign: &mut Campaign, joints: usize) {
    let paths: Vec<_> = paths(campaign).collect();
    for path in paths {
        world::forward::set_rates_in(&mut campaign.poses[path], joints, |pose| &mut pose.inputs);
    }
}

/// Excludes measurements at the beginning of paths that depend on the unknown initial state of backlash and friction: until each joint has travelled
/// far enough (see [`MEMORY_TRAVEL`]), and until the model's own memory effects predict the same tool position from either initial state. If the
/// predictions never agree (a joint at rest), the rows are kept.
pub(super) fn exclude_path_starts(campaign: &mut Campaign, model: &Model, notes: &mut Vec<String>) {
    let paths: Vec<Range<usize>> = paths(campaign).collect();
    let mut firsts: Vec<usize> =
        paths.iter().map(|path| first_after_travel(campaign, path, model.arm.count())).collect();
    if model.effects().any(|effect| effect.spec().has_memory) {
        let of_model = first_state_independent(campaign, model, &paths);
        firsts.iter_mut().zip(of_model).for_each(|(first, met)| *first = met.max(*first));
    }
    let mut open = 0;
    for (path, first) in paths.iter().zip(firsts) {
        for pose in &mut campaign.poses[path.start..first] {
            open += usize::from(!pose.seen.is_empty());
            pose.seen.clear();
        }
    }
    if open > 0 {
        notes.push(format!(
            "excluded at the beginning of paths, where the state of backlash and friction is unknown; rows: {open}"
        ));
    }
}

/// The first row of a path at which every joint has travelled [`MEMORY_TRAVEL`]; joints that do not within the share [`START_SHARE`] of the path are ignored.
fn first_after_travel(campaign: &Campaign, path: &Range<usize>, joints: usize) -> usize {
    let soon = path.start + (START_SHARE * path.len() as f64) as usize;
    let first_after = |joint: usize| {
        let mut way = 0.0;
        (path.start + 1..soon).find(|k| {
            let [before, now] = [k - 1, *k].map(|k| campaign.poses[k].inputs.q[joint]);
            way += (now - before).abs();
            way >= MEMORY_TRAVEL
        })
    };
    (0..joints).filter_map(first_after).max().unwrap_or(path.start)
}

/// The first row of each path at which the model predicts the same tool position from either initial state.
fn first_state_independent(
    campaign: &mut Campaign,
    model: &Model,
    paths: &[Range<usize>],
) -> Vec<usize> {
    let directions: Vec<_> =
        paths.iter().map(|path| campaign.poses[path.start].inputs.direction).collect();
    let mut begun = |side: f64| -> Vec<DVec3> {
        for (path, direction) in paths.iter().zip(&directions) {
            let sided = direction.map(|direction| if direction == 0.0 { side } else { direction });
            campaign.poses[path.start].inputs.direction = sided;
        }
        let mut tool = Vec::with_capacity(campaign.poses.len());
        visit_poses(model, campaign, None, |_, evaluation, _| {
            tool.push(evaluation.real.base_from_tool.origin);
        });
        tool
    };
    let (above, below) = (begun(1.0), begun(-1.0));
    let starts = paths.iter().zip(directions).map(|(path, direction)| {
        campaign.poses[path.start].inputs.direction = direction;
        let is_one = |k: &usize| above[*k].distance(below[*k]) < SAME_POSITION_M;
        path.clone().find(is_one).unwrap_or(path.start)
    });
    starts.collect()
}

/// The model as a hypothesis in which the parameters with a stated standard uncertainty are free.
pub(super) fn stated_hypothesis(model: &Model, sigma: &[Vec<f64>]) -> Hypothesis {
    let mut known = Hypothesis::fixed(*model);
    for (effect, sigma) in sigma.iter().enumerate().filter(|(_, s)| s.iter().any(|s| *s > 0.0)) {
        let first = known.free.len();
        known.free_all(effect, &[], sigma);
        let stated = |value: usize| sigma.get(value).is_some_and(|sigma| *sigma > 0.0);
        let mut index = 0;
        known.free.retain(|free| {
            index += 1;
            index <= first || stated(free.value)
        });
    }
    known
}

/// Subsamples a campaign of very many poses; returns which poses are kept. See [`thinning::select_rows`].
pub(super) fn subsample(
    campaign: &mut Campaign,
    joints: usize,
    notes: &mut Vec<String>,
) -> Vec<bool> {
    let count = campaign.poses.len();
    let Some(RowSelection { kept, measured_kept, note }) =
        thinning::select_rows(&row_properties(campaign, joints))
    else {
        return vec![true; count];
    };
    campaign.poses.iter_mut().zip(&measured_kept).filter(|(_, read)| !**read).for_each(
        |(pose, _)| {
            pose.seen.clear();
        },
    );
    let mut is_kept = kept.iter();
    campaign.poses.retain(|_| *is_kept.next().unwrap_or(&true));
    relink_poses(campaign);
    notes.push(note);
    kept
}

/// The properties of the rows by which they are selected.
fn row_properties(campaign: &Campaign, joints: usize) -> RowProperties<'_> {
    let poses = &campaign.poses;
    let turns = |k: usize| k > 0 && poses[k].inputs.direction != poses[k - 1].inputs.direction;
    RowProperties {
        paths: paths(campaign).collect::<Vec<_>>().into(),
        measured: poses.iter().map(|pose| !pose.seen.is_empty()).collect::<Vec<_>>().into(),
        is_reversal: (0..poses.len()).map(turns).collect::<Vec<_>>().into(),
        joints,
        acceleration: Box::new(|k, joint| poses[k].inputs.acceleration[joint]),
    }
}

/// Updates each pose's previous position and time step after poses between were removed.
pub(super) fn relink_poses(campaign: &mut Campaign) {
    for run in runs(campaign) {
        for k in run.skip(1) {
            let before = campaign.poses[k - 1].inputs;
            let inputs = &mut campaign.poses[k].inputs;
            inputs.q_before = before.q;
            inputs.dt_s = inputs.time_s - before.time_s;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::thinning::{POSES_MAX, SECTIONS};
    use super::*;
    use crate::campaign::Arrival;
    use crate::test_campaigns;

    /// A path at 100 Hz on which the first joint oscillates, with high accelerations during one second.
    fn long_path(rows: usize) -> Campaign {
        let mut campaign = test_campaigns::unmeasured_campaign(0, 1);
        let first = campaign.poses[0].clone();
        campaign.recordings[0].is_path = true;
        campaign.poses = (0..rows)
            .map(|row| {
                let mut pose = first.clone();
                let t = row as f64 * 0.01;
                let hard = if (120.0..121.0).contains(&t) { 5.0 } else { 0.0 };
                pose.inputs.q[0] = libm::sin(0.7 * t);
                pose.inputs.direction[0] = libm::cos(0.7 * t).signum();
                pose.inputs.acceleration[0] = hard;
                (pose.inputs.time_s, pose.inputs.dt_s) = (t, 0.01);
                (pose.row, pose.arrival) = (row, Arrival::FromPrevious);
                pose
            })
            .collect();
        campaign
    }

    #[test]
    fn of_a_long_path_hard_stretches_stay_whole_and_every_turn_stays() {
        let mut campaign = long_path(20_000);
        let whole = campaign.clone();
        let mut notes = Vec::new();
        let kept = subsample(&mut campaign, 6, &mut notes);
        assert_eq!(kept.iter().filter(|kept| **kept).count(), campaign.poses.len());
        let read: Vec<usize> =
            campaign.poses.iter().filter(|p| !p.seen.is_empty()).map(|p| p.row).collect();
        assert!(read.len() <= POSES_MAX + SECTIONS, "{}", read.len());
        assert!((12_000..12_100).all(|row| read.contains(&row)), "the hard second");
        let turns = (1..whole.poses.len()).filter(|row| {
            whole.poses[*row].inputs.direction != whole.poses[row - 1].inputs.direction
        });
        let rows: Vec<usize> = campaign.poses.iter().map(|pose| pose.row).collect();
        assert!(turns.clone().count() > 30);
        turns.for_each(|row| assert!(rows.contains(&row) && rows.contains(&(row - 1)), "{row}"));
        let time: f64 = campaign.poses.iter().skip(1).map(|pose| pose.inputs.dt_s).sum();
        let last = campaign.poses.last().expect("poses").inputs.time_s;
        assert!((time - last).abs() < 1e-6 && last > 199.0, "no time is lost: {time} of {last}");
        assert!(notes[0].contains("of 20000 rows were used"), "{notes:?}");
    }

    #[test]
    fn settled_poses_keep_their_joints_and_lose_readings_later() {
        let settled = |rows: usize| {
            let mut campaign = long_path(rows);
            campaign.recordings[0].is_path = false;
            let mut notes = Vec::new();
            let kept = subsample(&mut campaign, 6, &mut notes);
            assert!(kept.iter().all(|kept| *kept) && campaign.poses.len() == rows);
            (campaign.poses.iter().filter(|pose| !pose.seen.is_empty()).count(), notes)
        };
        assert_eq!(settled(3_090).0, 3_090);
        let (read, notes) = settled(13_000);
        assert_eq!(
            (read, notes),
            (4_334, vec!["4334 of 13000 rows were used: one in 3".to_owned()])
        );
    }

    #[test]
    fn rows_before_known_play_has_touched_an_end_of_its_gap_are_left_out() {
        let mut campaign = long_path(400);
        campaign.poses[0].arrival = Arrival::Settled;
        campaign.poses[0].inputs.direction = [0.0; physics::JOINTS_MAX];
        for k in 1..400 {
            campaign.poses[k].inputs.q_before = campaign.poses[k - 1].inputs.q;
        }
        let whole = campaign.clone();
        let mut notes = Vec::new();
        let unread =
            |campaign: &Campaign| campaign.poses.iter().filter(|pose| pose.seen.is_empty()).count();
        exclude_path_starts(&mut campaign, &test_campaigns::nominal_robot(), &mut notes);
        // sin(0.7 t) reaches 10 mrad at t = 0.014 s: effects that the model lacks may have a memory, too.
        assert_eq!(unread(&campaign), 2, "{notes:?}");
        campaign = whole.clone();
        let mut model = test_campaigns::nominal_robot();
        let width: &[(&str, &[f64])] = &[("width", &[0.035])];
        let play = physics::AnyEffect::build(
            "backlash",
            &model.arm,
            Some(0),
            physics::ParameterValues(width),
        );
        model.push(play.expect("sound")).expect("room");
        exclude_path_starts(&mut campaign, &model, &mut notes);
        // sin(0.7 t) reaches 0.035 rad, the full width of the backlash, at t = 0.05 s.
        assert_eq!(unread(&campaign), 6, "{notes:?}");
        assert!(campaign.poses[..6].iter().all(|pose| pose.seen.is_empty()) && notes.len() == 2);
        let start = |campaign: &Campaign| campaign.poses[0].inputs.direction;
        assert_eq!(start(&campaign), start(&whole), "the start stays as it was told");
        let mut still = whole.clone();
        still.poses.iter_mut().for_each(|pose| {
            pose.inputs.q[0] = 0.0;
            pose.inputs.q_before = pose.inputs.q;
            pose.inputs.direction = [0.0; physics::JOINTS_MAX];
        });
        exclude_path_starts(&mut still, &model, &mut notes);
        assert_eq!(unread(&still), 0, "a joint that stands still");
    }

    #[test]
    fn a_short_recording_stays_as_it_is() {
        let mut campaign = long_path(2_000);
        let whole = campaign.clone();
        assert!(subsample(&mut campaign, 6, &mut Vec::new()).iter().all(|kept| *kept));
        assert_eq!(campaign.poses.len(), whole.poses.len());
    }
}
