//! Targets that slipped on the tool. The distance between two targets on the tool does not depend on the arm, so a step of it over time shows that one of
//! them moved.
//!
//! Per pair of targets, the step of the mean distance at a row is compared with the noise, which is estimated from successive differences and therefore
//! not affected by a single step. The row and the target with the largest sum of squared normal deviates over its pairs are the most likely slip (a
//! change point of a mean: Page, Biometrika 41, 1954, with the sum over channels that move together).
//!
//! With three targets or more the slipped one can usually be identified; otherwise all that may have moved are taken. Their measurements after the slip
//! become those of new targets, whose positions on the tool are estimated as well: nothing is excluded.
//!
//! A slow change is no slip: the step must describe the distances better than a line over the rows. A slip perpendicular to all lines to the other
//! targets is not visible, nor is one of a single target.

use crate::engine::statistics::median;
use glam::DVec3;
use recording::series::{Channel, Recording, TARGETS_MAX};

/// When a step of the distances counts as a slip.
struct SlipSettings {
    /// Least step, in standard deviations of a single distance; above 0. Default 3: it exceeds the scatter of single rows, as a bias that differs between
    /// parts of the workspace does not.
    step_sigmas_min: f64,
    /// Least normal deviate of the step; above 0. Default 8, as for faults of a channel.
    deviate_min: f64,
    /// Largest normal deviate, root mean square over the pairs without a target, at which all others count as fixed; above 0. Default 5.
    others_deviate_max: f64,
    /// Least number of rows on either side; 2 or more. Default 8, as for runs of a constant value.
    rows_min: usize,
    /// Smallest noise of a distance, m; above 0. Default 1e-6: the resolution of instruments.
    resolution_m: f64,
    /// A distance that deviates from the median of the nearest five by more than this is a gross error and not used, in standard deviations; above 0.
    /// Default 6.
    gross_sigmas: f64,
}

impl Default for SlipSettings {
    fn default() -> Self {
        Self {
            step_sigmas_min: 3.0,
            deviate_min: 8.0,
            others_deviate_max: 5.0,
            rows_min: 8,
            resolution_m: 1e-6,
            gross_sigmas: 6.0,
        }
    }
}

/// Ratio of standard deviation to median absolute difference of two successive values, for normal noise.
const NORMAL_DIFFERENCE: f64 = 1.4826 / std::f64::consts::SQRT_2;
/// Number of successive distances whose median shows a gross error: robust to two of them.
const NEIGHBOURS: usize = 5;

/// Distances of two targets over the rows in which both were measured.
struct PairDistances {
    targets: [usize; 2],
    rows: Vec<usize>,
    /// Sums of the distances, less the first one, before each of these rows and after the last, m.
    sums: Vec<f64>,
    /// Standard deviation of a distance, m.
    sigma_m: f64,
    /// Sum of squares about a line over the rows, m².
    about_line_m2: f64,
    /// Sum of squares about the mean, m².
    about_mean_m2: f64,
}

/// Step of the mean distance of a pair at a row.
#[derive(Clone, Copy, Default)]
struct Step {
    /// Its size, in standard deviations of a distance.
    sigmas: f64,
    /// Its normal deviate.
    deviate: f64,
    size_m: f64,
}

/// Targets of which one moved, or several did.
struct Slip {
    targets: Vec<usize>,
    first_row_after: usize,
    /// Largest change of a distance, m.
    size_m: f64,
}

/// Separates the measurements of targets after they slipped on the tool from those before; returns messages for the user. `new_target`: the first index
/// that no target of any recording has.
pub(super) fn separate_slipped_targets(
    recording: &mut Recording,
    new_target: &mut usize,
) -> Vec<String> {
    let settings = SlipSettings::default();
    let mut notes = Vec::new();
    for _ in 0..recording.target_count() {
        let Some(slip) = find_slip(recording, &settings) else { break };
        if *new_target + slip.targets.len() > TARGETS_MAX {
            break;
        }
        notes.push(message(recording, &slip));
        for target in &slip.targets {
            separate(recording, (*target, *new_target), slip.first_row_after);
            *new_target += 1;
        }
    }
    notes
}

fn targets_on_tool(recording: &Recording) -> Vec<usize> {
    let on_links = &recording.metadata.targets_on_link;
    (0..recording.target_count()).filter(|target| !on_links.contains_key(target)).collect()
}

fn channels(target: usize) -> [Channel; 3] {
    [0, 1, 2].map(|axis| Channel::Target(target, axis))
}

/// The position of a target in a row, if it was measured.
fn position(recording: &Recording, target: usize, row: usize) -> Option<DVec3> {
    let value = |channel| recording.column(channel).map_or(f64::NAN, |column| column[row]);
    Some(DVec3::from_array(channels(target).map(value))).filter(|position| position.is_finite())
}

impl PairDistances {
    /// `None` with too few rows for a slip.
    fn of(recording: &Recording, targets: [usize; 2], settings: &SlipSettings) -> Option<Self> {
        let distance = |row: usize| {
            let [one, other] = targets.map(|target| position(recording, target, row));
            Some((row, (one? - other?).length()))
        };
        let all: Vec<(usize, f64)> = (0..recording.len()).filter_map(distance).collect();
        let differences = all.windows(2).map(|pair| (pair[1].1 - pair[0].1).abs());
        let sigma_m = (NORMAL_DIFFERENCE * median(differences)).max(settings.resolution_m);
        let is_sound = |k: &usize| {
            let first = k.saturating_sub(NEIGHBOURS / 2).min(all.len().saturating_sub(NEIGHBOURS));
            let near = all[first..].iter().take(NEIGHBOURS).map(|(_, distance)| *distance);
            (all[*k].1 - median(near)).abs() <= settings.gross_sigmas * sigma_m
        };
        let (rows, values): (Vec<usize>, Vec<f64>) =
            (0..all.len()).filter(is_sound).map(|k| all[k]).unzip();
        if rows.len() < 2 * settings.rows_min {
            return None;
        }
        let count = values.len() as f64;
        let mut sums = vec![0.0];
        values.iter().for_each(|value| sums.push(sums[sums.len() - 1] + (value - values[0])));
        let mean = values[0] + sums[values.len()] / count;
        let about_mean_m2 = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
        let from_centre = |k: usize| k as f64 - 0.5 * (count - 1.0);
        let slope_sum: f64 =
            values.iter().enumerate().map(|(k, v)| from_centre(k) * (v - mean)).sum();
        let centre_squares = count * (count * count - 1.0) / 12.0;
        let about_line_m2 = about_mean_m2 - slope_sum * slope_sum / centre_squares;
        Some(Self { targets, rows, sums, sigma_m, about_line_m2, about_mean_m2 })
    }

    /// The step at `row`, the first one after it; none too near an end.
    fn step_at(&self, row: usize, rows_min: usize) -> Step {
        let before = self.rows.partition_point(|known| *known < row);
        let after = self.rows.len() - before;
        if before.min(after) < rows_min {
            return Step::default();
        }
        let [before_count, after_count] = [before as f64, after as f64];
        let sum_before = self.sums[before];
        let sum_after = self.sums[self.rows.len()] - sum_before;
        let size_m = sum_after / after_count - sum_before / before_count;
        let harmonic = before_count * after_count / (before_count + after_count);
        // A change along a line reduces the sum of squares more than the best step does.
        let about_step_m2 = self.about_mean_m2 - harmonic * size_m * size_m;
        if about_step_m2 > self.about_line_m2 {
            return Step::default();
        }
        let sigmas = size_m.abs() / self.sigma_m;
        Step { sigmas, deviate: sigmas * harmonic.sqrt(), size_m: size_m.abs() }
    }
}

/// The most likely slip, if it is significant.
fn find_slip(recording: &Recording, settings: &SlipSettings) -> Option<Slip> {
    let targets = targets_on_tool(recording);
    let pairs: Vec<PairDistances> = targets
        .iter()
        .enumerate()
        .flat_map(|(k, one)| targets[k + 1..].iter().map(move |other| [*one, *other]))
        .filter_map(|pair| PairDistances::of(recording, pair, settings))
        .collect();
    let mut best: Option<(f64, usize)> = None;
    for row in 1..recording.len() {
        let strongest = |target: &usize| -> f64 {
            let own = pairs.iter().filter(|pair| pair.targets.contains(target));
            own.map(|pair| pair.step_at(row, settings.rows_min).deviate.powi(2)).sum()
        };
        let score = targets.iter().map(strongest).fold(0.0, f64::max);
        if best.is_none_or(|(most, _)| score > most) {
            best = Some((score, row));
        }
    }
    let (score, row) = best?;
    if score < settings.deviate_min.powi(2) {
        return None;
    }
    slip_at(&pairs, &targets, row, settings)
}

/// The slip at `row`: which targets may have moved, and how far at least; `None` if no single distance shows it.
fn slip_at(
    pairs: &[PairDistances],
    targets: &[usize],
    row: usize,
    settings: &SlipSettings,
) -> Option<Slip> {
    let steps: Vec<([usize; 2], Step)> =
        pairs.iter().map(|pair| (pair.targets, pair.step_at(row, settings.rows_min))).collect();
    let visible: Vec<&([usize; 2], Step)> =
        steps.iter().filter(|(_, step)| step.sigmas >= settings.step_sigmas_min).collect();
    let size_m = visible.iter().map(|(_, step)| step.size_m).reduce(f64::max)?;
    let others = |target: usize| steps.iter().filter(move |(pair, _)| !pair.contains(&target));
    // That one target alone moved is possible if the distances between all others are unchanged.
    let is_alone = |target: &usize| {
        let squares: f64 = others(*target).map(|(_, step)| step.deviate.powi(2)).sum();
        squares <= settings.others_deviate_max.powi(2) * others(*target).count() as f64
    };
    let is_visible = |target: &usize| visible.iter().any(|(pair, _)| pair.contains(target));
    let alone: Vec<usize> = targets.iter().copied().filter(is_alone).collect();
    let moved = match alone.is_empty() {
        true => targets.iter().copied().filter(is_visible).collect(),
        false => alone,
    };
    Some(Slip { targets: moved, first_row_after: row, size_m })
}

/// Moves the measurements of target `from` after a slip to the columns of the new target `to`.
fn separate(recording: &mut Recording, (from, to): (usize, usize), first_row_after: usize) {
    for (old, new) in channels(from).into_iter().zip(channels(to)) {
        let Some(mut before) = recording.column(old).map(<[f64]>::to_vec) else { continue };
        let mut after = before.clone();
        before[first_row_after..].fill(f64::NAN);
        after[..first_row_after].fill(f64::NAN);
        recording.set(old, before);
        recording.set(new, after);
        if let Some(sigma) = recording.sigma(old) {
            recording.metadata.sigma.insert(new, sigma);
        }
    }
}

fn message(recording: &Recording, slip: &Slip) -> String {
    let names: Vec<String> = slip.targets.iter().map(|t| (t + 1).to_string()).collect();
    let (subject, positions) = match names.len() {
        1 => ("target", "its position"),
        _ => ("at least one of targets", "their positions"),
    };
    format!(
        "{subject} {} moved on the tool between {:.3} s and {:.3} s: distances between targets change by {:.3} mm; {positions} on the tool before and after are estimated separately",
        names.join(", "),
        recording.t_s[slip.first_row_after - 1],
        recording.t_s[slip.first_row_after],
        slip.size_m * 1e3
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    const NOISE_M: f64 = 2e-5;
    const POINTS_M: [[f64; 3]; 3] = [[0.05, 0.0, 0.1], [-0.05, 0.0, 0.1], [0.0, 0.06, 0.08]];

    /// Poses of a tool with `count` targets and noise; `moved` changes the position of a target at a row.
    fn recording(
        count: usize,
        rows: usize,
        moved: impl Fn(usize, usize) -> DVec3,
        seed: u64,
    ) -> Recording {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut made = Recording::new((0..rows).map(|row| 20.0 * row as f64).collect());
        let poses: Vec<glam::DQuat> = (0..rows)
            .map(|_| {
                let [x, y, z, w] = [(); 4].map(|()| random.sample::<f64, _>(StandardNormal));
                glam::DQuat::from_xyzw(x, y, z, w).normalize()
            })
            .collect();
        for (target, point_m) in POINTS_M.iter().enumerate().take(count) {
            let mut columns = [vec![0.0; rows], vec![0.0; rows], vec![0.0; rows]];
            for (row, pose) in poses.iter().enumerate() {
                let point = *pose * (DVec3::from(*point_m) + moved(target, row));
                for (axis, column) in columns.iter_mut().enumerate() {
                    column[row] = point[axis] + NOISE_M * random.sample::<f64, _>(StandardNormal);
                }
            }
            channels(target).into_iter().zip(columns).for_each(|(c, column)| made.set(c, column));
        }
        made
    }

    fn separated(recording: &mut Recording) -> (Vec<String>, usize) {
        let mut new_target = recording.target_count();
        (separate_slipped_targets(recording, &mut new_target), new_target)
    }

    fn slip(target: usize, from: usize, by_m: DVec3) -> impl Fn(usize, usize) -> DVec3 {
        move |t, row| if t == target && row >= from { by_m } else { DVec3::ZERO }
    }

    #[test]
    fn a_target_that_slipped_becomes_a_new_one_and_no_measurement_is_lost() {
        for seed in 0..20 {
            let moved = slip(1, 55, DVec3::new(3e-4, 3e-4, 0.0));
            let mut found = recording(3, 100, moved, seed);
            let before = found.clone();
            let (notes, targets) = separated(&mut found);
            assert_eq!((notes.len(), targets), (1, 4), "{notes:?}");
            assert!(notes[0].starts_with("target 2 moved on the tool between 1"), "{notes:?}");
            let first = found.column(Channel::Target(1, 0)).expect("kept").to_vec();
            let second = found.column(Channel::Target(3, 0)).expect("new").to_vec();
            let all = before.column(Channel::Target(1, 0)).expect("there");
            let is_whole = (0..100).all(|row| first[row].is_finite() != second[row].is_finite());
            assert!(is_whole, "seed {seed}");
            let row = second.iter().position(|x| x.is_finite()).expect("a slip");
            assert!(row.abs_diff(55) <= 2, "seed {seed}: {row}");
            assert_eq!(
                (first[..row].to_vec(), second[row..].to_vec()),
                (all[..row].to_vec(), all[row..].to_vec())
            );
        }
    }

    #[test]
    fn where_the_distances_do_not_tell_which_target_moved_all_that_may_have_are_separated() {
        let mut pair = recording(2, 100, slip(0, 30, DVec3::X * 3e-4), 1);
        let (notes, targets) = separated(&mut pair);
        assert_eq!(targets, 4);
        assert!(notes[0].starts_with("at least one of targets 1, 2 moved"), "{notes:?}");
    }

    #[test]
    fn targets_that_slip_one_after_the_other_are_all_separated() {
        let moved = |target, row| match (target, row) {
            (0, 30..) => DVec3::new(3e-4, -4e-4, 0.0),
            (1, 70..) => DVec3::new(-5e-4, 5e-4, 0.0),
            _ => DVec3::ZERO,
        };
        let mut found = recording(3, 100, moved, 4);
        let (notes, targets) = separated(&mut found);
        assert_eq!(notes.len(), 2, "{notes:?}");
        let measured = |target: &usize, row| position(&found, *target, row).is_some();
        let counts: Vec<usize> = (0..100)
            .map(|row| (0..targets).filter(|target| measured(target, row)).count())
            .collect();
        assert_eq!(counts, [3; 100], "no measurement is lost");
    }

    #[test]
    fn noise_drifts_and_gross_errors_are_no_slips() {
        let none = |_, _| DVec3::ZERO;
        for seed in 0..200 {
            assert_eq!(separated(&mut recording(3, 100, none, seed)).0, Vec::<String>::new());
        }
        let drift =
            |target, row| if target == 0 { DVec3::X * 5e-6 * row as f64 } else { DVec3::ZERO };
        let gross = |target, row: usize| match (target, row % 23) {
            (1, 7) => DVec3::new(2e-3, -1e-3, 1e-3),
            _ => DVec3::ZERO,
        };
        for seed in 0..50 {
            assert_eq!(separated(&mut recording(3, 100, drift, seed)).0, Vec::<String>::new());
            assert_eq!(separated(&mut recording(3, 100, gross, seed)).0, Vec::<String>::new());
        }
    }

    #[test]
    fn few_rows_or_a_single_target_show_no_slip() {
        let moved = || slip(0, 7, DVec3::X * 1e-3);
        assert_eq!(separated(&mut recording(3, 15, moved(), 1)).1, 3);
        assert_eq!(separated(&mut recording(1, 100, moved(), 1)).1, 1);
    }
}
