//! Distances between measured points and points predicted by a model, on held-out rows.
//!
//! The measuring frame of each station is fitted by least squares on the training rows, never on
//! held-out ones. Independent of a robot; positions of points on the tool come from the program.

use super::csv_table::CsvTable;

type Point = [f64; 3];

/// Iterations of least squares: the initial frame may be far off if the program knows of one
/// station only.
const ITERATIONS: usize = 60;

/// A row's points: measured and predicted, m.
struct PointPairs {
    station: String,
    is_held: bool,
    points: Vec<[Point; 2]>,
}

/// Columns of one point: measured, predicted, and the length of their unit, m.
pub(super) struct Columns {
    pub(super) measured: [String; 3],
    pub(super) predicted: [String; 3],
    pub(super) metres: [f64; 2],
}

/// The mean distance on held-out rows, m; NaN without any.
pub(super) fn mean_distance(
    measured: &CsvTable,
    predicted: &CsvTable,
    columns: &[Columns],
    station: Option<&str>,
    held_out: &[bool],
) -> f64 {
    let mut pairs = pairs(measured, predicted, columns, station, held_out);
    let mut names: Vec<String> = pairs.iter().map(|pair| pair.station.clone()).collect();
    names.sort_unstable();
    names.dedup();
    for name in names {
        for _ in 0..ITERATIONS {
            let of = |pair: &&PointPairs| pair.station == name && !pair.is_held;
            let trains = pairs.iter().filter(of).flat_map(|pair| &pair.points);
            let moved = fit_rigid_motion(trains);
            for pair in pairs.iter_mut().filter(|pair| pair.station == name) {
                pair.points.iter_mut().for_each(|[_, p]| *p = apply(&moved, p));
            }
        }
    }
    let all = pairs.iter().filter(|pair| pair.is_held).flat_map(|pair| &pair.points);
    let distances: Vec<f64> = all.map(|[m, p]| norm(&difference(m, p))).collect();
    distances.iter().sum::<f64>() / distances.len() as f64
}

fn pairs(
    measured: &CsvTable,
    predicted: &CsvTable,
    columns: &[Columns],
    station: Option<&str>,
    held_out: &[bool],
) -> Vec<PointPairs> {
    let stations = station.map(|name| measured.texts(name));
    let each: Vec<[[Vec<f64>; 3]; 2]> = columns
        .iter()
        .map(|one| {
            let of = |sheet: &CsvTable, names: &[String; 3], m: f64| {
                [0, 1, 2].map(|k| sheet.numbers(&names[k]).iter().map(|x| m * x).collect())
            };
            [
                of(measured, &one.measured, one.metres[0]),
                of(predicted, &one.predicted, one.metres[1]),
            ]
        })
        .collect();
    let rows = measured.len().min(predicted.len()).min(held_out.len());
    let point = |all: &[Vec<f64>; 3], row: usize| [0, 1, 2].map(|k| all[k][row]);
    let pair = |row: usize| {
        let points = each.iter().map(|[m, p]| [point(m, row), point(p, row)]);
        let known = points.filter(|pair| pair.iter().flatten().all(|x| x.is_finite()));
        PointPairs {
            station: stations.as_ref().map_or(String::new(), |all| all[row].clone()),
            is_held: held_out[row],
            points: known.collect(),
        }
    };
    (0..rows).map(pair).collect()
}

/// A small rotation and shift that bring the predicted points nearest to the measured ones:
/// rotation, shift, centre.
fn fit_rigid_motion<'a>(points: impl Iterator<Item = &'a [Point; 2]> + Clone) -> [Point; 3] {
    let count = points.clone().count().max(1) as f64;
    let mut middle = [0.0; 3];
    points.clone().for_each(|[_, p]| (0..3).for_each(|k| middle[k] += p[k] / count));
    let mut normal = [[0.0; 7]; 6];
    for [m, p] in points {
        let r = difference(p, &middle);
        let residual = difference(m, p);
        // Rows of d(turn × r + shift).
        let rows = [
            [0.0, r[2], -r[1], 1.0, 0.0, 0.0],
            [-r[2], 0.0, r[0], 0.0, 1.0, 0.0],
            [r[1], -r[0], 0.0, 0.0, 0.0, 1.0],
        ];
        for (row, residual) in rows.iter().zip(residual) {
            for i in 0..6 {
                (0..6).for_each(|j| normal[i][j] += row[i] * row[j]);
                normal[i][6] += row[i] * residual;
            }
        }
    }
    let x = solve(&mut normal);
    [[x[0], x[1], x[2]], [x[3], x[4], x[5]], middle]
}

/// Gauss elimination with pivoting; undetermined unknowns stay zero.
fn solve(a: &mut [[f64; 7]; 6]) -> [f64; 6] {
    let largest = a.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
    for k in 0..6 {
        let best = (k..6).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs())).unwrap_or(k);
        a.swap(k, best);
        if a[k][k].abs() <= 1e-12 * largest {
            a[k] = [0.0; 7];
            continue;
        }
        let pivot = a[k];
        for (i, row) in a.iter_mut().enumerate().filter(|(i, _)| *i != k) {
            let _ = i;
            let by = row[k] / pivot[k];
            (0..7).for_each(|j| row[j] -= by * pivot[j]);
        }
    }
    [0, 1, 2, 3, 4, 5].map(|k| if a[k][k] == 0.0 { 0.0 } else { a[k][6] / a[k][k] })
}

/// A point rotated about the centre (Rodrigues' formula) and shifted.
fn apply([turn, shift, middle]: &[Point; 3], p: &Point) -> Point {
    let angle = norm(turn);
    let r = difference(p, middle);
    let turned = if angle > 0.0 {
        let axis = turn.map(|x| x / angle);
        let (sin, cos) = angle.sin_cos();
        let cross = [
            axis[1] * r[2] - axis[2] * r[1],
            axis[2] * r[0] - axis[0] * r[2],
            axis[0] * r[1] - axis[1] * r[0],
        ];
        let along: f64 = (0..3).map(|k| axis[k] * r[k]).sum();
        [0, 1, 2].map(|k| r[k] * cos + cross[k] * sin + axis[k] * along * (1.0 - cos))
    } else {
        r
    };
    [0, 1, 2].map(|k| middle[k] + turned[k] + shift[k])
}

fn difference(a: &Point, b: &Point) -> Point {
    [0, 1, 2].map(|k| a[k] - b[k])
}

fn norm(a: &Point) -> f64 {
    a.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Held-out rows are off by 1 mm and by a frame that the other rows determine.
    #[test]
    fn the_frame_is_laid_on_rows_that_train_and_the_distance_is_that_of_the_others() {
        let turn = [[0.02, -0.03, 0.05], [0.4, -0.2, 0.1], [0.0; 3]];
        let place = |k: usize| {
            let x = k as f64;
            [(0.7 * x).sin(), (1.1 * x).cos(), (0.3 * x).sin() * 0.5]
        };
        let held: Vec<bool> = (0..40).map(|k| k % 2 == 1).collect();
        let (mut m, mut p) = ("x,y,z\n".to_owned(), "x,y,z\n".to_owned());
        for (k, held) in held.iter().enumerate() {
            let mut point = apply(&turn, &place(k));
            point[0] += if *held { 1e-3 } else { 0.0 };
            m += &format!("{},{},{}\n", point[0], point[1], point[2]);
            let point = place(k);
            p += &format!("{},{},{}\n", point[0], point[1], point[2]);
        }
        let names = || ["x", "y", "z"].map(str::to_owned);
        let columns = [Columns { measured: names(), predicted: names(), metres: [1.0, 1.0] }];
        let distance =
            mean_distance(&CsvTable::read(&m), &CsvTable::read(&p), &columns, None, &held);
        assert!((distance - 1e-3).abs() < 1e-9, "{distance}");
    }
}
