//! Effects added to a real recording: everything else is unchanged, and only the added effect is scored.
//!
//! The motion is estimated from the recorded positions by local cubic fits. The noise is the residual of the recorded torque after a fit of free
//! masses and simple friction, averaged over a hundredth of a second and whitened by a long linear predictor. `z` and gains are then those of
//! [`crate::comparison`].
//!
//! Rows, positions and times are unchanged; torques change only by the law of the effect.

use crate::arm::{JOINTS, Joints};
use crate::case::Tier;
use crate::comparison::{Detectability, EffectComparison};
use crate::effect::EffectKind;
use crate::least_squares::{OrthonormalBasis, dot};
use crate::rng::Rng;
use crate::scene::Excitation;

use super::candidates::{candidates, is_observable};
use super::case::{Noise, TorqueCase};
use super::detectability::{are_mass_effects, difference};
use super::generate::{JointScale, max_linear_parameter, random_parameters};
use super::kinds::{Effect, Kind};
use super::laws::{SampledMotion, torques_at};
use super::motion::{JointRange, JointState, Motion};
use super::predictor::Predictor;
use super::rig::Rig;

/// Half width of the window of a cubic fit, s.
const FIT_HALF_WINDOW_S: f64 = 0.02;
/// Averaging time of values, s: a robot's drive torque contains little information beyond this bandwidth.
const AVERAGING_S: f64 = 0.01;
/// A pause of this many steps separates two runs.
const PAUSE_STEPS: f64 = 3.5;
/// Effects of which less than this fraction remains after projection on the nuisance parameters are not used.
const MIN_REMAINING_FRACTION: f64 = 0.02;

/// A real recording, prepared for added effects.
pub struct PreparedRecording {
    case: TorqueCase,
    scales: Vec<JointScale>,
    sampled: SampledMotion,
    torques: Vec<Joints>,
    runs: Vec<std::ops::Range<usize>>,
    sources: Vec<usize>,
    step_s: f64,
    predictors: Vec<Predictor>,
    nuisances: OrthonormalBasis,
    base_torques: Vec<Joints>,
}

/// An added effect.
#[derive(Clone, Debug)]
pub struct InjectedEffect {
    /// The effect.
    pub effect: Effect,
    /// Its detectability, known before any answer.
    pub detectability: Detectability,
    /// Torques including the effect, row by row, Nm or N.
    pub torques: Vec<Joints>,
}

/// A row of a recording: segment, time (s), positions and torques.
pub type RecordedRow = (usize, f64, Joints, Joints);

impl PreparedRecording {
    /// Prepares rows in order of time; masses and joint ranges of the rig are not used. `None` if there are too few rows.
    #[must_use]
    pub fn of(mut rig: Rig, rows: &[RecordedRow]) -> Option<Self> {
        let step_s = step_s(rows)?;
        let half = ((FIT_HALF_WINDOW_S / step_s).round() as usize).max(3);
        let runs = runs(rows, step_s, 4 * half + 1);
        let mut run_times = Vec::new();
        let (mut states, mut smooth, mut torques) = (Vec::new(), Vec::new(), Vec::new());
        let (mut kept, mut sources) = (Vec::new(), Vec::new());
        for (number, run) in runs.into_iter().enumerate() {
            let from = run_times.len();
            for row in run.clone() {
                let (now, torque) = local_cubic_fit(rows, &run, row, half, rig.count());
                run_times.push((number, rows[row].1));
                states.push(now);
                smooth.push(torque);
                torques.push(rows[row].3);
                sources.push(row);
            }
            kept.push(from..run_times.len());
        }
        if run_times.is_empty() {
            return None;
        }
        rig.masses.clear();
        rig.ranges = (0..rig.count()).map(|i| joint_range(&states, i)).collect();
        let celsius = vec![[20.0; JOINTS]; run_times.len()];
        let mut sampled = SampledMotion::from_states(&rig, run_times, states, celsius);
        let scales = joint_scales(&rig, &sampled, &torques);
        let (rigid, left) = fit_masses_and_friction(&rig, &sampled, &torques, &scales);
        let besides = difference(&smooth, &rigid);
        sampled.set_recorded(rigid, besides);
        let case = case_with_rig_only(rig, 1.0 / step_s);
        let mut real = Self {
            case,
            scales,
            sampled,
            torques,
            runs: kept,
            sources,
            step_s,
            predictors: Vec::new(),
            nuisances: OrthonormalBasis::default(),
            base_torques: Vec::new(),
        };
        real.base_torques = torques_at(&real.case.rig, &real.sampled, &[]);
        real.predictors = (0..real.case.rig.count())
            .map(|i| Predictor::of(&real.interval_means(&left, i)))
            .collect();
        let mut basis = OrthonormalBasis::default();
        for torques in unit_mass_columns(&real.case.rig, &real.sampled) {
            basis.add_column(real.whitened_means(&torques));
        }
        real.nuisances = basis;
        Some(real)
    }

    /// The rows in use, each with its run and time, and their recorded torques.
    #[must_use]
    pub fn rows(&self) -> (&[(usize, f64)], &[Joints]) {
        (&self.sampled.times, &self.torques)
    }

    /// Index of each row in use among the given rows.
    #[must_use]
    pub fn sources(&self) -> &[usize] {
        &self.sources
    }

    /// Number of joints.
    #[must_use]
    pub fn count(&self) -> usize {
        self.case.rig.count()
    }

    /// A random effect of this kind, scaled to detectability `z`; `None` if it is not observable, or if it would exceed its physical limit.
    #[must_use]
    pub fn inject(&self, kind: Kind, z: f64, rng: &mut Rng) -> Option<InjectedEffect> {
        let can = |joint: &usize| {
            is_observable(&self.case, kind, *joint) && self.scales[*joint].speed > 0.05
        };
        let joints: Vec<usize> = (0..self.case.rig.count()).filter(can).collect();
        if joints.is_empty() {
            return None;
        }
        let joint = if kind.spec().per_joint { joints[rng.uniform_index(joints.len())] } else { 0 };
        let scale = &self.scales[joint];
        let parameters = random_parameters(&self.case, scale, kind, joint, rng);
        let mut effect = Effect { kind, joint, other_joint: joint, parameters };
        let most = max_linear_parameter(&effect, scale);
        effect = effect.scaled(1e-2 * most / effect.linear_magnitude().max(1e-300));
        for _ in 0..2 {
            let column = self.column(&effect);
            let rest = self.nuisances.residual(&column);
            let length = dot(&rest, &rest).sqrt();
            if length < MIN_REMAINING_FRACTION * dot(&column, &column).sqrt() || length == 0.0 {
                return None;
            }
            effect = effect.scaled(z / length);
            if effect.linear_magnitude() > most {
                return None;
            }
        }
        let changed = self.torque_change(&effect);
        let rest = self.nuisances.residual(&self.whitened_means(&changed));
        let question = EffectComparison {
            name: kind.name().map(|name| (name, effect.joint_number())),
            parameter_count: kind.count(),
            nuisances: &self.nuisances,
            effect: &rest,
            value_count: rest.len(),
        };
        let is_related =
            |name: &str| kind.name().is_some_and(|true_name| are_mass_effects(true_name, name));
        let detectability =
            question.compare(&candidates(&self.case), |other| self.column(other), is_related);
        let sum = |(a, b): (&Joints, &Joints)| std::array::from_fn(|i| a[i] + b[i]);
        let torques = self.torques.iter().zip(&changed).map(sum).collect();
        Some(InjectedEffect { effect, detectability, torques })
    }

    /// Change of the recorded torques by an effect.
    fn torque_change(&self, effect: &Effect) -> Vec<Joints> {
        if effect.kind == Kind::TorqueDelay {
            let late = self.sampled.delayed(&self.base_torques, effect.parameters[0]);
            return difference(&late, &self.base_torques);
        }
        difference(
            &torques_at(&self.case.rig, &self.sampled, std::slice::from_ref(effect)),
            &self.base_torques,
        )
    }

    fn column(&self, effect: &Effect) -> Vec<f64> {
        self.whitened_means(&self.torque_change(effect))
    }

    /// Averaged values of a joint, run by run.
    fn interval_means(&self, torques: &[Joints], joint: usize) -> Vec<Vec<f64>> {
        let count = ((AVERAGING_S / self.step_s).round() as usize).max(1);
        let mean =
            |rows: &[Joints]| rows.iter().map(|row| row[joint]).sum::<f64>() / rows.len() as f64;
        self.runs.iter().map(|run| torques[run.clone()].chunks(count).map(mean).collect()).collect()
    }

    fn whitened_means(&self, torques: &[Joints]) -> Vec<f64> {
        let joints = self.predictors.iter().enumerate();
        joints
            .flat_map(|(i, predictor)| predictor.whiten(&self.interval_means(torques, i)))
            .collect()
    }
}

/// Ranges of rows without a pause, with at least `rows_min` rows each.
fn runs(rows: &[RecordedRow], step_s: f64, rows_min: usize) -> Vec<std::ops::Range<usize>> {
    let mut runs: Vec<std::ops::Range<usize>> = Vec::new();
    for row in 0..rows.len() {
        let is_contiguous = row > 0
            && rows[row].0 == rows[row - 1].0
            && rows[row].1 - rows[row - 1].1 < PAUSE_STEPS * step_s
            && rows[row].1 > rows[row - 1].1;
        match runs.last_mut() {
            Some(run) if is_contiguous => run.end = row + 1,
            _ => runs.push(row..row + 1),
        }
    }
    runs.retain(|run| run.len() >= rows_min);
    runs
}

/// Median sampling interval, s.
fn step_s(rows: &[RecordedRow]) -> Option<f64> {
    let pairs = rows.windows(2).filter(|pair| pair[0].0 == pair[1].0);
    let mut steps: Vec<f64> = pairs.map(|pair| pair[1].1 - pair[0].1).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().filter(|step| *step > 0.0)
}

/// State and torque at a row, by a cubic fit to the neighbouring rows.
fn local_cubic_fit(
    rows: &[RecordedRow],
    run: &std::ops::Range<usize>,
    row: usize,
    half: usize,
    joints: usize,
) -> ([JointState; JOINTS], Joints) {
    let middle = row.clamp(run.start + half, run.end - half - 1);
    let window = &rows[middle - half..=middle + half];
    let scale_s = 0.5 * (window[window.len() - 1].1 - window[0].1);
    let u: Vec<f64> = window.iter().map(|one| (one.1 - rows[row].1) / scale_s).collect();
    let mut basis = OrthonormalBasis::default();
    for order in 0..4 {
        basis.add_column(u.iter().map(|u| u.powi(order)).collect());
    }
    let (mut states, mut torques) = ([[0.0; 3]; JOINTS], [0.0; JOINTS]);
    for i in 0..joints {
        let q = basis.solve(&window.iter().map(|one| one.2[i]).collect::<Vec<f64>>());
        states[i] = [q[0], q[1] / scale_s, 2.0 * q[2] / (scale_s * scale_s)];
        torques[i] = basis.solve(&window.iter().map(|one| one.3[i]).collect::<Vec<f64>>())[0];
    }
    (states, torques)
}

fn joint_range(states: &[[JointState; JOINTS]], joint: usize) -> JointRange {
    let places = states.iter().map(|states| states[joint][0]);
    let [low, high] =
        places.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], q| [l.min(q), h.max(q)]);
    let max_speed = states.iter().fold(0.0_f64, |most, states| most.max(states[joint][1].abs()));
    JointRange { centre: 0.5 * (low + high), half_range: 0.5 * (high - low).max(1e-6), max_speed }
}

fn joint_scales(rig: &Rig, ride: &SampledMotion, torques: &[Joints]) -> Vec<JointScale> {
    let rms = |quantity: &dyn Fn(usize) -> f64| {
        ((0..torques.len()).map(|row| quantity(row).powi(2)).sum::<f64>() / torques.len() as f64)
            .sqrt()
    };
    let of_joint = |i: usize| JointScale {
        torque: rms(&|row| torques[row][i]).max(1e-6),
        speed: rig.ranges[i].max_speed.max(1e-6),
        acceleration: rms(&|row| ride.states[row][i][2]).max(1e-3),
        half_range: rig.ranges[i].half_range,
    };
    (0..rig.count()).map(of_joint).collect()
}

fn unit_mass_columns(rig: &Rig, ride: &SampledMotion) -> Vec<Vec<Joints>> {
    (0..rig.count())
        .flat_map(Rig::unit_masses)
        .map(|probe| ride.torques_of_masses(rig, &[probe]))
        .collect()
}

/// Fitted torques of the masses, and residual after masses and simple friction.
fn fit_masses_and_friction(
    rig: &Rig,
    ride: &SampledMotion,
    torques: &[Joints],
    scales: &[JointScale],
) -> (Vec<Joints>, Vec<Joints>) {
    let n = rig.count();
    let flat = |torques: &[Joints]| -> Vec<f64> {
        torques.iter().flat_map(|row| (0..n).map(|i| row[i] / scales[i].torque)).collect()
    };
    let masses = unit_mass_columns(rig, ride);
    let mut columns = masses.clone();
    let laws: [fn(JointState) -> f64; 6] = [
        |_| 1.0,
        |[_, v, _]| if v == 0.0 { 0.0 } else { v.signum() },
        |[_, v, _]| v,
        |[_, v, _]| v.abs(),
        |[q, _, _]| q.sin(),
        |[q, _, _]| q.cos(),
    ];
    for i in 0..n {
        for law in laws {
            let of_row = |states: &[JointState; JOINTS]| {
                let mut row = [0.0; JOINTS];
                row[i] = law(states[i]);
                row
            };
            columns.push(ride.states.iter().map(of_row).collect());
        }
    }
    let mut basis = OrthonormalBasis::default();
    columns.iter().for_each(|column| {
        basis.add_column(flat(column));
    });
    let found = basis.solve(&flat(torques));
    let sum = |columns: &[Vec<Joints>], found: &[f64]| {
        let mut all = vec![[0.0; JOINTS]; torques.len()];
        for (column, share) in columns.iter().zip(found) {
            for (sum, row) in all.iter_mut().zip(column) {
                sum.iter_mut().zip(row).for_each(|(sum, x)| *sum += share * x);
            }
        }
        all
    };
    let rigid = sum(&masses, &found);
    let left = difference(torques, &sum(&columns, &found));
    (rigid, left)
}

/// A case that contains only the rig.
fn case_with_rig_only(rig: Rig, rate_hz: f64) -> TorqueCase {
    let noise = Noise {
        sigma: [1.0; JOINTS],
        quantum: [0.0; JOINTS],
        autocorrelation: 0.0,
        encoder_quantum: 0.0,
        gaps: 0,
    };
    TorqueCase {
        tier: Tier::Single,
        rig,
        motion: Motion { segments: Vec::new(), rate_hz, has_temperatures: false },
        excitation: Excitation::Full,
        noise,
        modelled: Vec::new(),
        hidden: Vec::new(),
        seed: 0,
    }
}

#[cfg(test)]
mod tests;
