//! Data of one comparison of forces with a cut: rows, tooth model at the current parameters, its derivatives as columns, noise.
//!
//! The model is linearised at the current parameters; solving gives new parameters, at which it is linearised again (Gauss-Newton). Amplifier drift
//! and parameters with a stated uncertainty are always fitted too, and angle and speed of the spindle if they are questioned. Selects nothing. SI
//! units.

use glam::DVec3;
use nalgebra::DMatrix;
use physics::Bite;

use super::law::{CHIP, EDGE, Law, NUMBERS, Spindle, Stood};
use crate::colour::Colour;
use crate::engine::library::Library;
use crate::engine::noise;
use crate::engine::normal_equations::{Products, Solved};
use crate::engine::split::RowSets;
use crate::engine::table;
use crate::engine::table::Column;
use crate::engine::table::{Table, residual};
use crate::engine::validation::{rms_of, sum};

/// Step of the spindle angle for derivatives and for borders of engagement, rad.
const TURNED: f64 = 5e-3;
/// A row lies at a border of engagement if a change of `TURNED` in either direction changes the engaged share of a tooth by this much.
const BORDER: f64 = 0.3;
/// Largest change of a phase in one iteration, rad.
const LEAP: f64 = 0.2;
/// Maximum number of Gauss-Newton iterations.
const ROUNDS: usize = 4;
/// A smaller gain in log-likelihood ends the iteration.
const STANDS: f64 = 0.05;

/// A column whose squared norm, after projecting out the other columns, is a smaller share of its own adds nothing. Far below the usual threshold,
/// because a candidate's column retains little beside the nuisance column of the same parameter with a wide prior.
const BRINGS: f64 = 1e-8;
/// Prior standard deviation of an amplifier's drift over a segment, as a multiple of the noise.
pub(super) const DRIFTS: f64 = 0.15;
/// The stated noise is limited to the range from the residual divided by this factor to the residual.
const HOLDS: f64 = 2.0;

/// Current parameter estimates.
#[derive(Clone, Debug)]
pub(super) struct Belief {
    pub(super) numbers: Vec<f64>,
    pub(super) spindle: Spindle,
    /// Drift of each axis at the end of each segment, three values per segment, N.
    pub(super) drift: Vec<f64>,
    /// Negative log prior density of the parameters with a prior, up to a constant.
    pub(super) pull: f64,
}

/// A parameter that the model states with an uncertainty.
#[derive(Clone, Copy, Debug)]
pub(super) struct Doubt {
    /// Index in the list of parameters.
    pub(super) number: usize,
    /// Standard uncertainty, SI units.
    pub(super) sigma: f64,
}

/// Columns of nuisance parameters.
#[derive(Clone, Debug, Default)]
pub(super) struct Anyway {
    /// Spindle: phase of each segment, then the speed.
    pub(super) spindle: Vec<usize>,
    /// Amplifier drift: three per segment.
    pub(super) drift: Vec<usize>,
    /// Parameters that the model states with an uncertainty.
    pub(super) doubts: Vec<usize>,
}

#[derive(Clone)]
pub(super) struct Case {
    pub(super) law: Law,
    pub(super) belief: Belief,
    /// Recorded force per axis and row, N.
    pub(super) measured: [Option<Vec<f64>>; 3],
    pub(super) table: Table,
    pub(super) library: Library,
    /// Parameters of each column with their weights; indices from `NUMBERS` on are phases of segments, the speed, drifts and their curvatures.
    pub(super) directions: Vec<Vec<(usize, f64)>>,
    pub(super) always: Vec<usize>,
    pub(super) anyway: Anyway,
    pub(super) doubts: Vec<Doubt>,
    /// Stated noise of each axis, N.
    pub(super) told_noise: [Option<f64>; 3],
    pub(super) sets: RowSets,
}

impl Belief {
    /// The model as stated.
    pub(super) fn as_told(spindle: Spindle) -> Self {
        let drift = vec![0.0; 3 * spindle.phases.len()];
        Self { numbers: vec![0.0; NUMBERS], spindle, drift, pull: 0.0 }
    }

    /// Drift of an axis in a row, N.
    fn drifted(&self, axis: usize, stood: &Stood) -> f64 {
        self.drift[3 * stood.segment + axis] * stood.along
    }
}

impl Case {
    /// Predicted readings per axis, N.
    pub(super) fn readings(&self, belief: &Belief) -> [Vec<f64>; 3] {
        let bites = self.law.bites(&belief.spindle);
        let reader = self.law.reader(&belief.numbers);
        by_axis(bites.iter().enumerate().map(|(k, b)| reader.reading(k, b)))
    }

    /// Residual per axis, N.
    pub(super) fn left(&self, belief: &Belief) -> [Vec<f64>; 3] {
        let mut left = self.readings(belief);
        for (axis, (left, measured)) in left.iter_mut().zip(&self.measured).enumerate() {
            let Some(values) = measured else {
                left.fill(0.0);
                continue;
            };
            for ((x, m), stood) in left.iter_mut().zip(values).zip(&self.law.rows) {
                *x = m - *x - belief.drifted(axis, stood);
            }
        }
        left
    }

    /// First index of phases, speed, drifts and drift curvatures in the list of parameters.
    pub(super) fn anyway_at(&self) -> [usize; 4] {
        let segments = self.belief.spindle.phases.len();
        let speed = NUMBERS + segments;
        [NUMBERS, speed, speed + 1, speed + 1 + 3 * segments]
    }

    /// Selects the columns that every fit includes; those of the spindle only if questioned.
    pub(super) fn doubt_spindle(&mut self, is_doubted: bool) {
        let of_spindle = self.anyway.spindle.iter().filter(|_| is_doubted);
        let rest = self.anyway.drift.iter().chain(&self.anyway.doubts);
        self.always = of_spindle.chain(rest).copied().collect();
    }

    /// Linearises the model at `belief`: right-hand side, and the wanted columns.
    fn taken(&self, belief: &Belief, wanted: &[usize]) -> ([Vec<f64>; 3], Vec<(usize, Column)>) {
        let bites = self.law.bites(&belief.spindle);
        let mut used: Vec<usize> =
            wanted.iter().flat_map(|k| self.directions[*k].iter().map(|(at, _)| *at)).collect();
        used.sort_unstable();
        used.dedup();
        let (numbers, turned): (Vec<usize>, Vec<usize>) = used.iter().partition(|k| **k < NUMBERS);
        let slopes = self.law.slopes(&bites, &belief.numbers, &numbers);
        let mut target = self.left(belief);
        for (axis, target) in target.iter_mut().enumerate() {
            let rows = target.iter_mut().zip(&self.law.rows);
            rows.for_each(|(x, stood)| *x += belief.drifted(axis, stood));
        }
        for (k, slope) in numbers.iter().zip(&slopes) {
            for (target, slope) in target.iter_mut().zip(slope) {
                let own = belief.numbers[*k];
                target.iter_mut().zip(slope).for_each(|(t, x)| *t += own * x);
            }
        }
        let drifts = self.anyway_at()[2];
        let is_turned = turned.iter().any(|at| *at < drifts);
        let by_angle = if is_turned { self.turned(belief) } else { Default::default() };
        let column = |k: usize| {
            let mut parts: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; self.law.rows.len()]);
            for (at, weight) in &self.directions[k] {
                match numbers.iter().position(|n| n == at) {
                    Some(place) => add(&mut parts, &slopes[place], *weight),
                    None if *at >= drifts => self.drifting(at - drifts, &mut parts),
                    None => add(&mut parts, &self.of_spindle(at - NUMBERS, &by_angle), 1.0),
                }
            }
            let felt = |values: &Vec<f64>| values.iter().any(|x| *x != 0.0);
            let parts = parts.into_iter().enumerate().filter(|(_, values)| felt(values));
            Column { parts: parts.map(|(axis, values)| (axis, values.into())).collect() }
        };
        let columns = wanted.iter().map(|k| (*k, column(*k))).collect();
        (target, columns)
    }

    /// Derivative of the readings with respect to the spindle angle, N/rad.
    fn turned(&self, belief: &Belief) -> [Vec<f64>; 3] {
        let reader = self.law.reader(&belief.numbers);
        by_axis(self.law.rows.iter().enumerate().map(|(row, stood)| {
            let at = |by: f64| -> DVec3 {
                let bite: Bite = self.law.bite(&belief.spindle, stood, by);
                reader.reading(row, &bite)
            };
            (at(TURNED) - at(-TURNED)) / (2.0 * TURNED)
        }))
    }

    /// Column of the phase of one segment, or, for the last index, of the speed.
    fn of_spindle(&self, which: usize, by_angle: &[Vec<f64>; 3]) -> [Vec<f64>; 3] {
        let is_speed = which == self.belief.spindle.phases.len();
        let weight = |row: usize| {
            let stood = &self.law.rows[row];
            if is_speed { stood.angle_rad } else { f64::from(u8::from(stood.segment == which)) }
        };
        std::array::from_fn(|axis| {
            by_angle[axis].iter().enumerate().map(|(row, x)| x * weight(row)).collect()
        })
    }

    /// Adds the linear drift of one axis over one segment, or its curvature.
    fn drifting(&self, which: usize, parts: &mut [Vec<f64>; 3]) {
        let lines = 3 * self.belief.spindle.phases.len();
        let (which, is_bend) = (which % lines, which >= lines);
        let rows = parts[which % 3].iter_mut().zip(&self.law.rows);
        for (x, stood) in rows.filter(|(_, stood)| stood.segment == which / 3) {
            *x += if is_bend { stood.along * (1.0 - stood.along) } else { stood.along };
        }
    }

    /// Linearises the model at the current parameters, for all columns of the library.
    pub(super) fn take(&mut self) {
        let all: Vec<usize> = (0..self.directions.len()).collect();
        let (target, columns) = self.taken(&self.belief, &all);
        self.put_target(target);
        columns.into_iter().for_each(|(k, column)| self.library.columns[k] = column);
    }

    fn put_target(&mut self, target: [Vec<f64>; 3]) {
        for (axis, values) in target.into_iter().enumerate() {
            self.table.target[axis] = self.measured[axis].is_some().then_some(values);
        }
    }

    /// Selects the rows that count: not in entry or exit, and not at a border of engagement.
    pub(super) fn count(&mut self, is_between: &[bool]) {
        let spindle = &self.belief.spindle;
        let counts: Vec<bool> = self
            .law
            .rows
            .iter()
            .zip(is_between)
            .map(|(stood, between)| {
                let engaged = |by: f64| self.law.bite(spindle, stood, by).engaged;
                !between && (engaged(TURNED) - engaged(-TURNED)).abs() < BORDER
            })
            .collect();
        self.table.counts.fill(counts);
    }

    pub(super) fn products(&self, used: &[bool]) -> Products {
        let columns: Vec<&Column> = self.library.columns.iter().collect();
        let products = Products::new(&self.table, &columns, self.library.prior.clone(), used);
        Products { brings: BRINGS, ..products }
    }

    /// Estimates each axis' noise from the residual of the fit of all candidates.
    pub(super) fn estimate_noise(&mut self) {
        for _ in 0..2 {
            self.table.noise.iter_mut().for_each(|(colour, _)| *colour = Colour::default());
            let rich = self.products(&self.sets.train);
            let rich = rich.solve(&(0..self.library.columns.len()).collect::<Vec<usize>>());
            self.table.noise =
                noise::of(&self.table, &self.library.columns, &rich, &self.sets.train);
            for ((_, size), told) in self.table.noise.iter_mut().zip(self.told_noise) {
                *size = told.map_or(*size, |told| told.clamp(*size / HOLDS, *size));
            }
            for (at, column) in self.anyway.drift.iter().enumerate() {
                let sigma = DRIFTS * self.table.noise[at % 3].1;
                self.library.prior[*column] = 1.0 / (sigma * sigma);
            }
        }
    }

    /// Parameters from a solution of the linearised model.
    pub(super) fn believed(&self, from: &Belief, solved: &Solved) -> Belief {
        let mut belief = Belief::as_told(from.spindle.clone());
        let [phases, speed, drifts, bends] = self.anyway_at();
        for (k, value) in solved.columns.iter().zip(&solved.values) {
            belief.pull += 0.5 * self.library.prior[*k] * value * value;
            for (at, weight) in &self.directions[*k] {
                match *at {
                    at if at >= bends => {}
                    at if at >= drifts => belief.drift[at - drifts] += value,
                    at if at == speed => belief.spindle.faster += value,
                    at if at >= phases => {
                        belief.spindle.phases[at - phases] += value.clamp(-LEAP, LEAP);
                    }
                    at => belief.numbers[at] += weight * value,
                }
            }
        }
        belief
    }

    /// Negative log-likelihood of parameters on rows, including their prior, up to a constant.
    pub(super) fn misfit(&self, belief: &Belief, used: &[bool]) -> f64 {
        let left = self.left(belief);
        let mut sum = belief.pull;
        for axis in self.table.joints() {
            let white = self.table.whitened(axis, &left[axis]);
            let counts = &self.table.counts[axis];
            let rows = (0..white.len()).filter(|row| used[*row] && counts[*row]);
            sum += 0.5 * rows.map(|row| white[row] * white[row]).sum::<f64>();
        }
        sum
    }

    /// Fits the parameters of the given columns to the nonlinear model by Gauss-Newton iterations; returns them and their misfit.
    pub(super) fn fitted(&self, start: &Belief, columns: &[usize], used: &[bool]) -> (Belief, f64) {
        let mut belief = start.clone();
        let kept: Vec<usize> =
            columns.iter().flat_map(|k| self.directions[*k].iter().map(|d| d.0)).collect();
        for (k, number) in belief.numbers.iter_mut().enumerate() {
            if !kept.contains(&k) {
                *number = 0.0;
            }
        }
        let mut best = (belief.clone(), f64::INFINITY);
        for _ in 0..ROUNDS {
            let (target, taken) = self.taken(&belief, columns);
            let mut table = self.table.clone();
            for (axis, values) in target.into_iter().enumerate() {
                table.target[axis] = self.measured[axis].is_some().then_some(values);
            }
            let refs: Vec<&Column> = taken.iter().map(|(_, column)| column).collect();
            let prior = columns.iter().map(|k| self.library.prior[*k]).collect();
            let products = Products::new(&table, &refs, prior, used);
            let mut solved = products.solve(&(0..columns.len()).collect::<Vec<usize>>());
            solved.columns.iter_mut().for_each(|k| *k = columns[*k]);
            belief = self.believed(&belief, &solved);
            let misfit = self.misfit(&belief, used);
            let gained = best.1 - misfit;
            if gained > 0.0 {
                best = (belief.clone(), misfit);
            }
            if gained < STANDS {
                break;
            }
        }
        best
    }

    /// RMS residual on `used` rows, weighted by the noise of each axis and scaled by the geometric mean of these, N.
    pub(super) fn rms(&self, solved: &Solved, used: &[bool]) -> f64 {
        rms_of(&self.table, &self.library.columns, solved, used, &self.table.counts)
    }

    /// Half the sum of squares of the innovations on `used` rows, in units of the noise: negative log-likelihood.
    pub(super) fn left_white(&self, solved: &Solved, used: &[bool]) -> f64 {
        let of_axis = |axis: usize| {
            let left = residual(&self.table, &self.library.columns, solved, axis);
            0.5 * sum(&self.table, axis, &self.table.whitened(axis, &left), used)
        };
        self.table.joints().map(of_axis).sum()
    }

    pub(super) fn covariance(&self, solved: &Solved, used: &[bool]) -> DMatrix<f64> {
        table::covariance(&self.table, &self.library.columns, solved, used)
    }

    /// Largest stated shear and edge coefficient, N/m² and N/m.
    pub(super) fn told(&self) -> [f64; 2] {
        let force = self.law.base.first().copied().unwrap_or_default();
        [
            force.chip(&self.law.cutter).abs().max_element(),
            force.edge(&self.law.cutter, 0.0).abs().max_element(),
        ]
    }

    /// Coefficients of the stated cut with the model's effects: first index, and tangential, radial, axial values.
    pub(super) fn coefficients(&self) -> [(usize, DVec3); 2] {
        let force = self.law.base.first().copied().unwrap_or_default();
        let cutter = &self.law.cutter;
        [(CHIP.from, force.chip(cutter)), (EDGE.from, force.edge(cutter, 0.0))]
    }
}

fn add(parts: &mut [Vec<f64>; 3], more: &[Vec<f64>; 3], weight: f64) {
    for (part, more) in parts.iter_mut().zip(more) {
        part.iter_mut().zip(more).for_each(|(x, m)| *x += weight * m);
    }
}

fn by_axis(rows: impl Iterator<Item = DVec3>) -> [Vec<f64>; 3] {
    let mut all: [Vec<f64>; 3] = Default::default();
    for row in rows {
        all.iter_mut().zip(row.to_array()).for_each(|(list, x)| list.push(x));
    }
    all
}
