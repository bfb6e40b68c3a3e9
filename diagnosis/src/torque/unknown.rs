//! Structure that no name explains: a smooth law of the contract's words, and how much of what is left it explains on rows that it has not seen.
//!
//! Words alone and in pairs, each as a table of linear pieces (a tent at every knot; knots at even shares of the rows).
//!
//! Promises: a law is claimed where rows that took no part in its choice bear it out. Never: a formula.

use nalgebra::{DMatrix, DVector};

use super::motion::Motion;
use super::table::Table;

/// Knots of a word alone, and of each word of a pair.
const KNOTS: [usize; 2] = [8, 5];
/// What a law must bring beyond its price.
const MARGIN: f64 = 10.0;
/// Words tell from rows of at least this number.
const ROWS: usize = 100;

/// What the rest follows.
#[derive(Clone, Debug, PartialEq)]
pub struct Law {
    /// From 0.
    pub joint: usize,
    /// The contract's words.
    pub words: Vec<String>,
    /// Sums of squares of what is left on held-out rows without and with it, (N m)².
    pub held: [f64; 2],
}

/// One word and its value per row.
pub(crate) struct Word {
    pub(crate) name: String,
    pub(crate) values: Vec<f64>,
}

/// What a joint's torque may follow: its position, speed, acceleration and time first.
pub(super) fn words(motion: &Motion, joint: usize) -> Vec<Word> {
    let all = |value: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
        let runs = motion.runs.iter().enumerate();
        runs.flat_map(|(k, run)| run.rows.iter().map(move |row| (k, *row)))
            .map(|(run, row)| value(run, row))
            .collect()
    };
    let track = |run: usize| &motion.runs[run].joints[joint];
    let name = |stem: &str| format!("{stem}{}", joint + 1);
    let mut words = vec![
        Word { name: name("q"), values: all(&|run, row| track(run).q[row]) },
        Word { name: name("v"), values: all(&|run, row| track(run).v[row]) },
        Word { name: name("a"), values: all(&|run, row| track(run).a[row]) },
        Word { name: "t_s".to_owned(), values: all(&|run, row| motion.runs[run].time_s(row)) },
    ];
    if motion.runs.iter().all(|run| !run.joints[joint].temperature.is_empty()) {
        let values = all(&|run, row| track(run).temperature[row]);
        words.push(Word { name: format!("{}_C", name("temp")), values });
    }
    for other in 0..motion.runs.first().map_or(0, |run| run.joints.len()) {
        if other != joint {
            let values = all(&|run, row| motion.runs[run].joints[other].q[row]);
            words.push(Word { name: format!("q{}", other + 1), values });
        }
    }
    words
}

/// Knots at even shares of the rows.
fn knots(values: &[f64], count: usize) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |k: usize| sorted[(k * (sorted.len() - 1)) / (count - 1)];
    let mut knots: Vec<f64> = (0..count).map(at).collect();
    knots.dedup_by(|a, b| *a <= *b);
    knots
}

/// The weights of the two knots beside a value.
fn tents(knots: &[f64], value: f64) -> [(usize, f64); 2] {
    let last = knots.len().saturating_sub(2);
    let at = knots.partition_point(|knot| *knot <= value).saturating_sub(1).min(last);
    let Some(next) = knots.get(at + 1) else { return [(0, 1.0), (0, 0.0)] };
    let share = ((value - knots[at]) / (next - knots[at])).clamp(0.0, 1.0);
    [(at, 1.0 - share), (at + 1, share)]
}

/// A table of one word or two: per row the cells that it stands between, with their weights.
fn cells(of: &[&Word], count: usize) -> (usize, Vec<Vec<(usize, f64)>>) {
    let knots: Vec<Vec<f64>> = of.iter().map(|word| knots(&word.values, count)).collect();
    let rows = of[0].values.len();
    let cells = (0..rows)
        .map(|row| {
            let mut cells = vec![(0, 1.0)];
            for (word, knots) in of.iter().zip(&knots) {
                let beside = tents(knots, word.values[row]);
                let onward = cells.iter().flat_map(|(at, weight)| {
                    beside.map(|(k, share)| (at * knots.len() + k, weight * share))
                });
                cells = onward.collect();
            }
            cells
        })
        .collect();
    (knots.iter().map(Vec::len).product(), cells)
}

/// The best law of these words in what is left of one joint: chosen on rows that train, borne out on rows of the second look, weighed on those held out; the first
/// three go in pairs too. `share`: of what is left, it explains at least this on rows unseen, as energy.
pub(crate) fn law_of(
    words: &[Word],
    table: &Table,
    joint: usize,
    left: &[f64],
    [train, look, held]: [&[bool]; 3],
    share: f64,
) -> Option<Law> {
    let counts = |used: &[bool], row: usize| used[row] && table.counts[joint][row];
    let trained = (0..left.len()).filter(|row| counts(train, *row)).count();
    if trained < ROWS {
        return None;
    }
    let mut singles: Vec<Vec<&Word>> = words.iter().map(|word| vec![word]).collect();
    for (k, one) in words.iter().enumerate().take(3) {
        singles.extend(words[k + 1..].iter().map(|other| vec![one, other]));
    }
    let mut best: Option<(f64, Law)> = None;
    for of in singles {
        let (size, cells) = cells(&of, KNOTS[of.len() - 1]);
        let Some((gain, model)) = fitted(table, joint, left, &cells, size, &|r| counts(train, r))
        else {
            continue;
        };
        let price = 0.5 * size as f64 * (trained as f64).ln() + 3.0;
        let sums = |used: &[bool]| {
            let rows = (0..left.len()).filter(|row| counts(used, *row));
            rows.fold([0.0, 0.0], |[without, with], row| {
                let rest = left[row] - model[row];
                [without + left[row] * left[row], with + rest * rest]
            })
        };
        let [without, with] = sums(look);
        let bears_out = with < (1.0 - share) * without;
        let worth = gain - price;
        if worth > MARGIN && bears_out && best.as_ref().is_none_or(|(most, _)| worth > *most) {
            let words = of.iter().map(|word| word.name.clone()).collect();
            best = Some((worth, Law { joint, words, held: sums(held) }));
        }
    }
    best.map(|(_, law)| law).filter(|law| law.held[1] < (1.0 - share) * law.held[0])
}

/// The table that fits what is left best, whitened: the gain in log-likelihood, and its values row by row.
fn fitted(
    table: &Table,
    joint: usize,
    left: &[f64],
    cells: &[Vec<(usize, f64)>],
    size: usize,
    used: &dyn Fn(usize) -> bool,
) -> Option<(f64, Vec<f64>)> {
    let white = table.whitened(joint, left);
    let mut gram = DMatrix::zeros(size, size);
    let mut right = DVector::zeros(size);
    // A table's cells pass the same whitening as what is left of the torque.
    let mut columns = vec![vec![0.0; left.len()]; size];
    for (row, weights) in cells.iter().enumerate() {
        for (cell, weight) in weights {
            columns[*cell][row] += weight;
        }
    }
    let columns: Vec<Vec<f64>> = columns.iter().map(|c| table.whitened(joint, c)).collect();
    for row in (0..left.len()).filter(|row| used(*row)) {
        for i in 0..size {
            let x = columns[i][row];
            if x != 0.0 {
                right[i] += x * white[row];
                for j in 0..=i {
                    gram[(i, j)] += x * columns[j][row];
                }
            }
        }
    }
    let most = (0..size).map(|i| gram[(i, i)]).fold(0.0, f64::max);
    for i in 0..size {
        gram[(i, i)] += 1e-6 * most;
        for j in 0..i {
            gram[(j, i)] = gram[(i, j)];
        }
    }
    let numbers = gram.cholesky()?.solve(&right);
    let gain = 0.5 * right.dot(&numbers);
    let value = |weights: &Vec<(usize, f64)>| weights.iter().map(|(c, w)| w * numbers[*c]).sum();
    Some((gain, cells.iter().map(value).collect()))
}
