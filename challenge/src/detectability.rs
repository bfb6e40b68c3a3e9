//! Detectability of an effect, and whether another effect would have the same signature.
//!
//! Everything is linear: effects are columns of whitened values, projected on the complement of the nuisance parameters (registration, unknown
//! targets, the model's own parameters with their priors as additional values). `z` is the norm of an effect's residual; `ρ = z/√N`; the gain over an
//! alternative is half the residual sum of squares that the alternative leaves (docs/diagnosis.md).
//!
//! Expected values are computed without drawing noise. The evaluation does not depend on a solver's answer.

use crate::candidates::{candidates, free_parameter_count};
use crate::case::PositionCase;
pub use crate::comparison::{DISTINGUISHABLE_GAIN, Detectability, EffectName};
use crate::comparison::{
    EffectComparison, add_model_nuisances, identifiable_parameters, prior_count,
};
use crate::deviation::{COUNT, Deviation, ToolMotion, tool_jacobian};
use crate::effect::{BlindCase, EffectKind};
use crate::instrument::Whitener;
use crate::kinds::{Effect, Kind};
use crate::laws::Run;
use crate::least_squares::{OrthonormalBasis, dot};
use crate::motion_and_loads::{FineMotion, loads};
use crate::scene::Scene;
use crate::transform::{Transform, Vector3, rotate};

/// If less than this fraction of an effect's energy remains to first order, the nuisance parameters absorb the effect.
const ABSORBED_FRACTION: f64 = 0.25;

/// Linearised values of a case.
pub struct LinearisedCase<'a> {
    case: &'a PositionCase,
    scene: &'a Scene,
    run: Run<'a>,
    nominal_deviations: Vec<Deviation>,
    /// Per row: motion of the tool by each deviation, and the lever arms of the measured points, base axes.
    jacobians: Vec<Vec<ToolMotion>>,
    levers: Vec<Vec<Vector3>>,
    whitener: Whitener,
    priors: usize,
}

impl<'a> LinearisedCase<'a> {
    /// The columns of the rows marked in `right`.
    #[must_use]
    pub fn of(case: &'a PositionCase, scene: &'a Scene, right: &[bool]) -> Self {
        let modelled = case.nominal();
        let run = Run::new(scene, &modelled);
        let nominal_deviations = run.deviations(&modelled);
        let motors = run.motor_positions();
        let whitener =
            Whitener::of(scene, &case.noise, right, case.instrument.values_per_row(scene));
        let jacobians = motors.iter().map(|q| tool_jacobian(&scene.arm, q)).collect();
        let lever = |q: &[f64; 7]| {
            let tool = scene.arm.tool_pose(q);
            case.instrument.points.iter().map(|place| rotate(&tool, *place)).collect()
        };
        let levers = motors.iter().map(lever).collect();
        Self {
            case,
            scene,
            run,
            nominal_deviations,
            jacobians,
            levers,
            whitener,
            priors: prior_count(case),
        }
    }

    /// Number of values in use.
    #[must_use]
    pub fn count(&self) -> usize {
        self.whitener.count()
    }

    /// Whitens values, with zeros for the prior entries.
    #[must_use]
    pub fn whiten(&self, values: &[f64]) -> Vec<f64> {
        let mut whitened = self.whitener.apply(values);
        whitened.resize(whitened.len() + self.priors, 0.0);
        whitened
    }

    /// Values of deviations, to first order.
    #[must_use]
    pub fn deviation_values(&self, deviations: &[Deviation]) -> Vec<f64> {
        let frame = &self.case.instrument.measuring_from_base;
        let mut values = Vec::new();
        for ((bend, slopes), levers) in deviations.iter().zip(&self.jacobians).zip(&self.levers) {
            if levers.is_empty() {
                values.extend((0..self.scene.arm.joint_count()).map(|i| bend.0[9 * i]));
                continue;
            }
            let used: Vec<usize> = (0..COUNT).filter(|k| bend.0[*k] != 0.0).collect();
            for lever in levers {
                let mut moved = [0.0; 3];
                for k in &used {
                    let by = slopes[*k].of_point(*lever);
                    (0..3).for_each(|axis| moved[axis] += bend.0[*k] * by[axis]);
                }
                values.extend(rotate(frame, moved));
            }
        }
        values
    }

    /// Deviations added by an effect to those of the model, to first order.
    #[must_use]
    pub fn deviations(&self, effect: &Effect) -> Vec<Deviation> {
        match effect.kind {
            Kind::TimeDelay | Kind::ServoLag => self.delayed_deviations(effect),
            Kind::Payload
            | Kind::GravityTilt
            | Kind::Counterbalance
            | Kind::WrenchBias
            | Kind::WrenchScale
            | Kind::WrenchMisalignment => {
                let mut all = self.case.nominal();
                let modelled = all.clone();
                all.push(effect.clone());
                let mut loaded = self.run.clone();
                loaded.loads = loads(self.scene, &loaded.fine_motion, &all);
                loaded
                    .deviations(&modelled)
                    .iter()
                    .zip(&self.nominal_deviations)
                    .map(|(a, b)| a.minus(b))
                    .collect()
            }
            Kind::Backlash => {
                let mut all = self.case.nominal();
                all.push(effect.clone());
                self.run
                    .deviations(&all)
                    .iter()
                    .zip(&self.nominal_deviations)
                    .map(|(a, b)| a.minus(b))
                    .collect()
            }
            _ => self.run.deviations(std::slice::from_ref(effect)),
        }
    }

    fn delayed_deviations(&self, effect: &Effect) -> Vec<Deviation> {
        let mut deviations = vec![Deviation::default(); self.scene.rows.len()];
        let moved = FineMotion::from_scene(self.scene, std::slice::from_ref(effect));
        for (fine, then) in moved.iter().zip(&self.run.fine_motion) {
            for (row, k) in fine.row_index.iter().enumerate() {
                for i in 0..self.scene.arm.joint_count() {
                    *deviations[fine.first_row + row].component_mut(i, 0) =
                        fine.q[i][*k] - then.q[i][*k];
                }
            }
        }
        deviations
    }

    /// Whitened column of an effect.
    #[must_use]
    pub fn column(&self, effect: &Effect) -> Vec<f64> {
        self.whiten(&self.deviation_values(&self.deviations(effect)))
    }

    /// The nuisance columns; parameters of the model that effects in `except` (kind, joint) revise are left out.
    #[must_use]
    pub fn nuisances(&self, except: &[&Effect]) -> OrthonormalBasis {
        let mut basis = OrthonormalBasis::default();
        for values in registration_columns(self.case, self.scene, &self.run.motor_positions()) {
            basis.add_column(self.whiten(&values));
        }
        add_model_nuisances(&mut basis, self.case, except, |effect| self.column(effect));
        basis
    }

    /// Detectability of hidden effect `which`; `shown`: its values without noise.
    #[must_use]
    pub fn evaluate(&self, which: usize, shown: &[f64]) -> Detectability {
        let truth = &self.case.hidden[which];
        let mut basis = self.nuisances(&[truth]);
        for (k, other) in self.case.hidden.iter().enumerate() {
            if k != which {
                basis.add_column(self.column(other));
            }
        }
        let whole = basis.residual(&self.whiten(shown));
        let first = basis.residual(&self.column(truth));
        // Frames and targets absorb rigid motions of any size, but their columns are only of first order.
        let is_taken = dot(&first, &first) < ABSORBED_FRACTION * dot(&whole, &whole);
        let rest = if is_taken { first } else { whole };
        let question = EffectComparison {
            name: truth.kind.name().map(|name| (name, truth.joint_number())),
            parameter_count: free_parameter_count(truth.kind, self.scene, truth.joint),
            nuisances: &basis,
            effect: &rest,
            value_count: self.count(),
        };
        let mut detectability = question.compare(
            &candidates(self.case, self.scene),
            |effect| self.column(effect),
            |name| are_interchangeable(truth.kind, name),
        );
        detectability.determined =
            identifiable_parameters(truth, &basis, |effect| self.column(effect));
        detectability
    }
}

/// Equivalent effects of one family (docs/reference/effects.md, last section): if their signatures agree, either is right.
fn are_interchangeable(truth: Kind, name: &str) -> bool {
    let family = |name: &str| match name {
        "gravity_compliance" | "load_compliance" | "joint_compliance" => 1,
        "axis_shift" => 2,
        "backlash" | "hysteresis" => 3,
        _ => 0,
    };
    truth
        .name()
        .is_some_and(|true_name| family(true_name) != 0 && family(true_name) == family(name))
}

/// Values per unit of each registration parameter: measuring frame, then unknown points on the tool.
#[must_use]
pub fn registration_columns(
    case: &PositionCase,
    scene: &Scene,
    motors: &[[f64; 7]],
) -> Vec<Vec<f64>> {
    let view = &case.instrument;
    let mut columns = Vec::new();
    if view.points.is_empty() {
        return columns;
    }
    let tools: Vec<Transform> = motors
        .iter()
        .map(|q| crate::transform::mul(&view.measuring_from_base, &scene.arm.tool_pose(q)))
        .collect();
    let mut add = |law: &dyn Fn(&Transform, usize, Vector3) -> Vector3| {
        let each = |tool: &Transform| {
            let point_rows = |(k, place): (usize, &Vector3)| {
                law(tool, k, crate::transform::transform_point(tool, *place))
            };
            view.points.iter().enumerate().flat_map(point_rows).collect::<Vec<f64>>()
        };
        columns.push(tools.iter().flat_map(each).collect());
    };
    let unit = |axis: usize| {
        let mut e = [0.0; 3];
        e[axis] = 1.0;
        e
    };
    if !view.frame_known {
        for axis in 0..3 {
            add(&|_, _, _| unit(axis));
            add(&|_, _, p| {
                crate::transform::cross(unit(axis), crate::transform::sub(p, case.home_point()))
            });
        }
    }
    if !view.points_known {
        for place in 0..view.points.len() {
            for axis in 0..3 {
                add(&|tool, k, _| if k == place { rotate(tool, unit(axis)) } else { [0.0; 3] });
            }
        }
    }
    columns
}

#[cfg(test)]
mod tests;
