//! Runs of large residuals, which are not outliers but the sign of a missing effect: in consecutive rows of a path, or at consecutive positions of a joint,
//! as at a worn tooth or a dent in a guide. A gross error of the instrument does not return where the joint returns.

use crate::autocorrelation::is_later_row;
use crate::campaign::Campaign;
use crate::linearisation::ResidualNorm;
use std::collections::BTreeMap;

/// Least lengths of runs of large residuals.
struct RunSettings {
    /// In consecutive rows of a path; 2 or more. Default 4: single gross errors seldom follow one another, and a spike after a reversal lasts longer.
    rows_min: usize,
    /// At consecutive positions of a joint; 2 or more. Default 6: if one residual in ten is a gross error, a run of six has a probability of 1e-6 at each
    /// position.
    positions_min: usize,
}

const SETTINGS: RunSettings = RunSettings { rows_min: 4, positions_min: 6 };

/// Where a measurement belongs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReadingPlace {
    pub(crate) pose: usize,
    pub(crate) instrument: usize,
    /// Its stream, by [`series_index`](crate::autocorrelation::series_index).
    pub(crate) stream: usize,
}

impl From<&ResidualNorm> for ReadingPlace {
    fn from(norm: &ResidualNorm) -> Self {
        Self { pose: norm.pose, instrument: norm.instrument, stream: norm.stream }
    }
}

/// Which measurements belong to a run of large residuals (`is_far`) of their stream.
pub(crate) fn in_runs(
    campaign: &Campaign,
    readings: &[ReadingPlace],
    is_far: &[bool],
) -> Vec<bool> {
    let mut streams: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    for (place, one) in readings.iter().enumerate() {
        streams.entry((one.instrument, one.stream)).or_default().push(place);
    }
    let mut found = vec![false; readings.len()];
    let joints = campaign.poses.first().map_or(0, |pose| pose.inputs.q.len());
    for places in streams.values() {
        mark_runs(places, SETTINGS.rows_min, is_far, &mut found, |last, place| {
            is_later_row(campaign, readings[last].pose, readings[place].pose)
                && campaign.recordings[campaign.poses[readings[place].pose].recording].is_path
        });
        if places.iter().filter(|place| is_far[**place]).count() < SETTINGS.positions_min {
            continue;
        }
        for joint in 0..joints {
            let position = |place: usize| campaign.poses[readings[place].pose].inputs.q[joint];
            let mut by_position = places.clone();
            by_position.sort_by(|a, b| position(*a).total_cmp(&position(*b)));
            // Rows of a joint at rest have one position and no order.
            mark_runs(&by_position, SETTINGS.positions_min, is_far, &mut found, |last, place| {
                position(last) < position(place)
            });
        }
    }
    found
}

/// Marks the runs of at least `count` large residuals in the order of `places`, of which each continues the one before.
fn mark_runs(
    places: &[usize],
    count: usize,
    is_far: &[bool],
    found: &mut [bool],
    continues: impl Fn(usize, usize) -> bool,
) {
    let run =
        |last: &usize, place: &usize| is_far[*last] && is_far[*place] && continues(*last, *place);
    for run in places.chunk_by(run).filter(|run| run.len() >= count) {
        run.iter().for_each(|place| found[*place] = true);
    }
}

#[cfg(test)]
mod tests {
    use super::{ReadingPlace, in_runs};
    use crate::test_campaigns::unmeasured_campaign;

    /// The readings in runs, where those of the poses `far` are far; one reading a pose, in the order of poses.
    fn runs(campaign: &crate::campaign::Campaign, far: &[usize]) -> Vec<usize> {
        let places: Vec<ReadingPlace> = (0..campaign.poses.len())
            .map(|pose| ReadingPlace { pose, instrument: 0, stream: 0 })
            .collect();
        let is_far: Vec<bool> = (0..places.len()).map(|pose| far.contains(&pose)).collect();
        let found = in_runs(campaign, &places, &is_far);
        (0..places.len()).filter(|pose| found[*pose]).collect()
    }

    #[test]
    fn large_residuals_where_a_joint_returns_are_a_run_and_scattered_ones_are_not() {
        let campaign = unmeasured_campaign(1, 200);
        let mut by_position: Vec<usize> = (0..200).collect();
        let q = |pose: usize| campaign.poses[pose].inputs.q[1];
        by_position.sort_by(|a, b| q(*a).total_cmp(&q(*b)));
        let mut near = by_position[80..86].to_vec();
        near.sort_unstable();
        assert_eq!(runs(&campaign, &near), near);
        assert_eq!(runs(&campaign, &by_position[80..85]), Vec::<usize>::new());
        let scattered = [3, 17, 31, 48, 52, 77, 90, 101, 119, 126, 143, 158, 171, 188, 195];
        assert_eq!(runs(&campaign, &scattered), Vec::<usize>::new());
    }

    #[test]
    fn consecutive_rows_are_a_run_on_a_path_only() {
        let mut campaign = unmeasured_campaign(1, 50);
        assert_eq!(runs(&campaign, &[20, 21, 22, 23]), Vec::<usize>::new());
        campaign.recordings[0].is_path = true;
        assert_eq!(runs(&campaign, &[20, 21, 22, 23]), vec![20, 21, 22, 23]);
        assert_eq!(runs(&campaign, &[20, 21, 22]), Vec::<usize>::new());
    }
}
