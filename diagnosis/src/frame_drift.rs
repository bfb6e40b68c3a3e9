//! Drift of the instrument, measured by reference targets on the base: the measurements of each row are transformed to one frame.
//!
//! A tracker on its stand moves by hundredths of a millimetre over hours, as much as the error of a good model. Three reference targets beside the
//! robot measure this; the correction of each row is the rigid motion to their mean positions. Their positions are noisy too: the number of rows to
//! average minimises the expected error (Mallows, Some comments on Cp, Technometrics 15, 1973), with the noise estimated from the residuals of the
//! rigid motions.
//!
//! A base that tilts under load moves the same targets: the corrected measurements are then relative to the base, as required for a model of the arm.
//!
//! Rows with inconsistent distances between the reference targets (confused targets, interrupted beam) use their neighbours. If the targets do not
//! define a frame, nothing is corrected, and this is reported. Measurements of the tool are not used.

use crate::engine::statistics::median;
use crate::rigid_motion::{fit_rigid_motion, rms_distance};
use glam::DVec3;
use physics::Frame;
use recording::series::{Channel, Recording};

/// A distance is inconsistent if it deviates from its median by this many times its usual scatter.
const INCONSISTENT_FACTOR: f64 = 6.0;
/// Best repeatability of a distance that any instrument attains, m.
const REPEATABILITY_M: f64 = 1e-6;
/// Distances with a larger usual scatter are not those of reference targets, m.
const SCATTER_MAX_M: f64 = 1e-3;
/// Least distance of the reference targets from a line, as a fraction of the longest distance between them.
const OFF_LINE: f64 = 0.05;
/// Largest number of rows that are averaged; the number triples at each step.
const ROWS_MAX: usize = 729;
/// Ratio of standard deviation to median absolute deviation for normal noise.
const NORMAL: f64 = 1.4826;

/// Drift correction of each row to the common measuring frame.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameDrift {
    /// Reference targets on the base, 0-based.
    pub targets: Vec<usize>,
    laid_from_seen: Vec<Frame>,
    /// Rows in which the distances between the reference targets are inconsistent.
    pub inconsistent_rows: Vec<usize>,
    /// Largest displacement of a reference target from its mean position, m.
    pub drift_m: f64,
    /// Number of rows that were averaged; 0 if nothing was corrected.
    pub averaged_rows: usize,
}

/// A row of one set-up, with the measured positions of all reference targets.
struct ReferenceRow {
    row: usize,
    nests: Vec<DVec3>,
}

impl FrameDrift {
    /// Drift from the targets on the base; `None` with fewer than three.
    #[must_use]
    pub fn of(recording: &Recording) -> Option<Self> {
        let on_base = recording.metadata.targets_on_link.iter().filter(|(_, link)| **link == 0);
        let targets: Vec<usize> = on_base.map(|(target, _)| *target).collect();
        if targets.len() < 3 {
            return None;
        }
        let mut nests = Self {
            targets,
            laid_from_seen: vec![Frame::IDENTITY; recording.len()],
            inconsistent_rows: Vec::new(),
            drift_m: 0.0,
            averaged_rows: 0,
        };
        rows_by_station(recording).iter().for_each(|rows| nests.align(recording, rows));
        nests.inconsistent_rows.sort_unstable();
        Some(nests)
    }

    /// Transformation from the measured coordinates of a row to the common frame.
    #[must_use]
    pub fn common_from_measured(&self, row: usize) -> Frame {
        self.laid_from_seen.get(row).copied().unwrap_or(Frame::IDENTITY)
    }

    /// Description for users.
    #[must_use]
    pub fn description(&self) -> String {
        let numbers: Vec<String> = self.targets.iter().map(|t| (t + 1).to_string()).collect();
        let numbers = numbers.join(", ");
        if self.averaged_rows == 0 {
            return format!(
                "targets {numbers} on the base do not define a measuring frame: they were never measured together, are collinear, or do not keep their distances"
            );
        }
        let strange = match self.inconsistent_rows.len() {
            0 => String::new(),
            one => format!("; in {one} rows they contradict each other and are not used"),
        };
        let rows = match self.averaged_rows {
            1 => "row by row".to_owned(),
            rows => format!("averaged over {rows} rows"),
        };
        format!(
            "the measuring frame was defined by targets {numbers} on the base, {rows}: it drifted by up to {:.3} mm{strange}",
            self.drift_m * 1e3
        )
    }

    /// Transforms rows of one set-up to one frame.
    fn align(&mut self, recording: &Recording, rows: &[usize]) {
        let reference_rows: Vec<ReferenceRow> =
            rows.iter().filter_map(|row| self.reference_row(recording, *row)).collect();
        let Some((sound, ordinary)) = consistent_rows(&reference_rows) else { return };
        self.inconsistent_rows.extend(
            reference_rows.iter().zip(&sound).filter(|(_, sound)| !**sound).map(|(s, _)| s.row),
        );
        let shape = reference_rows[ordinary].nests.clone();
        let reference_rows: Vec<ReferenceRow> = reference_rows
            .into_iter()
            .zip(sound)
            .filter_map(|(row, sound)| sound.then_some(row))
            .collect();
        let Some(place) = mean_positions(&shape, &reference_rows) else { return };
        let (averaged, smooth) = smoothed(&reference_rows, &place);
        self.averaged_rows = self.averaged_rows.max(averaged);
        let mut next = 0;
        for row in rows {
            while next + 1 < reference_rows.len() && reference_rows[next].row < *row {
                next += 1;
            }
            let before = next.saturating_sub(usize::from(reference_rows[next].row > *row));
            let apart = (reference_rows[next].row - reference_rows[before].row) as f64;
            let share = row.saturating_sub(reference_rows[before].row) as f64 / apart.max(1.0);
            let between = smooth[before].iter().zip(&smooth[next]);
            let positions: Vec<DVec3> = between.map(|(a, b)| a.lerp(*b, share.min(1.0))).collect();
            if let Some(motion) = fit_rigid_motion(&positions, &place) {
                let wander = positions.iter().map(|nest| (motion.point(*nest) - *nest).length());
                self.drift_m = wander.fold(self.drift_m, f64::max);
                self.laid_from_seen[*row] = motion;
            }
        }
    }

    fn reference_row(&self, recording: &Recording, row: usize) -> Option<ReferenceRow> {
        let value = |target, axis| {
            recording.column(Channel::Target(target, axis)).map_or(f64::NAN, |column| column[row])
        };
        let position =
            |target: &usize| DVec3::from_array([0, 1, 2].map(|axis| value(*target, axis)));
        let nests: Vec<DVec3> = self.targets.iter().map(position).collect();
        nests.iter().all(|nest| nest.is_finite()).then_some(ReferenceRow { row, nests })
    }
}

/// Rows grouped by instrument position.
fn rows_by_station(recording: &Recording) -> Vec<Vec<usize>> {
    let station = |row: usize| {
        let number = recording.column(Channel::Station).map_or(f64::NAN, |column| column[row]);
        (!number.is_nan()).then_some(number.to_bits())
    };
    let mut all = std::collections::BTreeMap::<Option<u64>, Vec<usize>>::new();
    (0..recording.len()).for_each(|row| all.entry(station(row)).or_default().push(row));
    all.into_values().collect()
}

/// The shape of the reference targets, fitted to their mean positions over all rows.
fn mean_positions(shape: &[DVec3], rows: &[ReferenceRow]) -> Option<Vec<DVec3>> {
    let sum_of = |k: usize| rows.iter().map(move |row| row.nests[k] - shape[k]).sum::<DVec3>();
    let mean = |k: usize| shape[k] + sum_of(k) / rows.len() as f64;
    let means: Vec<DVec3> = (0..shape.len()).map(mean).collect();
    let motion = fit_rigid_motion(shape, &means)?;
    Some(shape.iter().map(|nest| motion.point(*nest)).collect())
}

/// Whether each row has consistent distances, and the index of the most consistent row; `None` if there is none, or if the reference targets are
/// collinear.
fn consistent_rows(rows: &[ReferenceRow]) -> Option<(Vec<bool>, usize)> {
    let all: Vec<Vec<f64>> = rows.iter().map(|one| distances(&one.nests)).collect();
    let pairs = all.first()?.len();
    let of_pair = |pair: usize, from: f64| all.iter().map(move |d| (d[pair] - from).abs());
    let middles: Vec<f64> = (0..pairs).map(|pair| median(of_pair(pair, 0.0))).collect();
    let deviations: Vec<f64> =
        middles.iter().enumerate().map(|(k, middle)| median(of_pair(k, *middle))).collect();
    if deviations.iter().any(|deviation| NORMAL * deviation > SCATTER_MAX_M) {
        return None;
    }
    let inconsistency = |distances: &Vec<f64>| {
        let one = |k: usize| {
            (distances[k] - middles[k]).abs() / (NORMAL * deviations[k]).max(REPEATABILITY_M)
        };
        (0..pairs).map(one).fold(0.0, f64::max)
    };
    let inconsistency: Vec<f64> = all.iter().map(inconsistency).collect();
    let ordinary =
        (0..rows.len()).min_by(|a, b| inconsistency[*a].total_cmp(&inconsistency[*b]))?;
    let sound: Vec<bool> = inconsistency.iter().map(|s| *s <= INCONSISTENT_FACTOR).collect();
    (sound[ordinary] && !on_a_line(&rows[ordinary].nests)).then_some((sound, ordinary))
}

fn distances(nests: &[DVec3]) -> Vec<f64> {
    let from = |i: usize| nests[i + 1..].iter().map(move |other| (nests[i] - *other).length());
    (0..nests.len()).flat_map(from).collect()
}

fn on_a_line(nests: &[DVec3]) -> bool {
    let longest = distances(nests).into_iter().fold(0.0, f64::max);
    let end = |nest: &DVec3| (*nest - nests[0]).length();
    let farthest =
        nests.iter().copied().max_by(|a, b| end(a).total_cmp(&end(b))).unwrap_or(nests[0]);
    let along = (farthest - nests[0]).normalize_or_zero();
    let distance_to_line = |nest: &DVec3| (*nest - nests[0]).cross(along).length();
    nests.iter().map(distance_to_line).fold(0.0, f64::max) <= OFF_LINE * longest
}

/// Positions of the reference targets in each row, averaged over the number of rows that minimises the expected error; and that number.
fn smoothed(reference_rows: &[ReferenceRow], place: &[DVec3]) -> (usize, Vec<Vec<DVec3>>) {
    let one = |row: &ReferenceRow| {
        let motion = fit_rigid_motion(place, &row.nests).unwrap_or(Frame::IDENTITY);
        let left = rms_distance(&motion, place, &row.nests).powi(2) * place.len() as f64;
        (place.iter().map(|position| motion.point(*position)).collect(), left)
    };
    let (rigid, left): (Vec<Vec<DVec3>>, Vec<f64>) = reference_rows.iter().map(one).unzip();
    // Six parameters per row are its rigid motion; the remaining degrees of freedom estimate the noise.
    let free = (3 * place.len() - 6) * reference_rows.len();
    let variance = left.iter().sum::<f64>() / free as f64;
    let error = |rows: usize, smooth: &[Vec<DVec3>]| {
        let apart = |(a, b): (&Vec<DVec3>, &Vec<DVec3>)| -> f64 {
            a.iter().zip(b).map(|(x, y)| (*x - *y).length_squared()).sum()
        };
        let away: f64 = rigid.iter().zip(smooth).map(apart).sum();
        away / reference_rows.len() as f64 + 12.0 * variance / rows as f64
    };
    let mut best = (1, rigid.clone(), error(1, &rigid));
    let mut rows = 3;
    while rows <= ROWS_MAX.min(reference_rows.len()) {
        let smooth = moving_average(&rigid, rows);
        let found = error(rows, &smooth);
        if found < best.2 {
            best = (rows, smooth, found);
        }
        rows *= 3;
    }
    (best.0, best.1)
}

/// Moving averages over `rows` neighbours; towards the ends over the nearest rows.
fn moving_average(series: &[Vec<DVec3>], rows: usize) -> Vec<Vec<DVec3>> {
    let width = series.first().map_or(0, Vec::len);
    let from = series.first().cloned().unwrap_or_default();
    // Sums of differences from the first value, so that metres do not cost the digits of micrometres.
    let mut sums = vec![vec![DVec3::ZERO; width]];
    for one in series {
        let last = &sums[sums.len() - 1];
        sums.push((0..width).map(|k| last[k] + (one[k] - from[k])).collect());
    }
    let mean_at = |row: usize| {
        let first = row.saturating_sub(rows / 2).min(series.len() - rows);
        let mean = |k: usize| from[k] + (sums[first + rows][k] - sums[first][k]) / rows as f64;
        (0..width).map(mean).collect()
    };
    (0..series.len()).map(mean_at).collect()
}

#[cfg(test)]
mod tests;
