//! Detectability of an effect, and whether another effect would have the same signature.
//!
//! Everything is linear: effects are columns of whitened values, projected on the complement of the nuisance parameters (registration, unknown
//! targets, the model's own parameters with their priors as additional values). `z` is the norm of an effect's residual; `ρ = z/√N`; the gain over an
//! alternative is half the residual sum of squares that the alternative leaves (docs/diagnosis.md).
//!
//! Expected values are computed without drawing noise. The evaluation does not depend on a solver's answer.

use crate::bent::{Bend, NUMBERS, of_point, tangent};
use crate::candidates::{candidates, free_numbers};
use crate::case::Case;
use crate::kinds::{Effect, Kind};
use crate::law::{Law, Trial};
use crate::laws::Run;
use crate::linear::{Span, dot};
use crate::ride::{Fine, loads};
use crate::scene::Scene;
use crate::space::{T4, V3, rotate};
use crate::view::Whitener;
pub use crate::weigh::{APART, Judged, Name};
use crate::weigh::{Question, determined, readings, take_known};

/// If less than this fraction of an effect's energy remains to first order, the nuisance parameters absorb the effect.
const TAKEN: f64 = 0.25;

/// Linearised values of a case.
pub struct Bench<'a> {
    case: &'a Case,
    scene: &'a Scene,
    run: Run<'a>,
    still: Vec<Bend>,
    /// Per row: motion of the tool by each deviation, and the lever arms of the measured points, base axes.
    slopes: Vec<Vec<(V3, V3)>>,
    levers: Vec<Vec<V3>>,
    whitener: Whitener,
    priors: usize,
}

impl<'a> Bench<'a> {
    /// The columns of the rows marked in `right`.
    #[must_use]
    pub fn of(case: &'a Case, scene: &'a Scene, right: &[bool]) -> Self {
        let known = case.nominal();
        let run = Run::of(scene, &known);
        let still = run.bends(&known);
        let motors = run.motors();
        let whitener = Whitener::of(scene, &case.noise, right, case.view.width(scene));
        let slopes = motors.iter().map(|q| tangent(&scene.arm, q)).collect();
        let lever = |q: &[f64; 7]| {
            let tool = scene.arm.tool(q);
            case.view.places.iter().map(|place| rotate(&tool, *place)).collect()
        };
        let levers = motors.iter().map(lever).collect();
        Self { case, scene, run, still, slopes, levers, whitener, priors: readings(case) }
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
    pub fn of_bends(&self, bends: &[Bend]) -> Vec<f64> {
        let frame = &self.case.view.measuring_from_base;
        let mut values = Vec::new();
        for ((bend, slopes), levers) in bends.iter().zip(&self.slopes).zip(&self.levers) {
            if levers.is_empty() {
                values.extend((0..self.scene.arm.count()).map(|i| bend.0[9 * i]));
                continue;
            }
            let used: Vec<usize> = (0..NUMBERS).filter(|k| bend.0[*k] != 0.0).collect();
            for lever in levers {
                let mut moved = [0.0; 3];
                for k in &used {
                    let by = of_point(&slopes[*k], *lever);
                    (0..3).for_each(|axis| moved[axis] += bend.0[*k] * by[axis]);
                }
                values.extend(rotate(frame, moved));
            }
        }
        values
    }

    /// Deviations added by an effect to those of the model, to first order.
    #[must_use]
    pub fn bends(&self, effect: &Effect) -> Vec<Bend> {
        match effect.kind {
            Kind::TimeDelay | Kind::ServoLag => self.late(effect),
            Kind::Payload
            | Kind::GravityTilt
            | Kind::Counterbalance
            | Kind::WrenchBias
            | Kind::WrenchScale
            | Kind::WrenchMisalignment => {
                let mut all = self.case.nominal();
                let known = all.clone();
                all.push(effect.clone());
                let mut loaded = self.run.clone();
                loaded.loads = loads(self.scene, &loaded.fine, &all);
                loaded.bends(&known).iter().zip(&self.still).map(|(a, b)| a.minus(b)).collect()
            }
            Kind::Backlash => {
                let mut all = self.case.nominal();
                all.push(effect.clone());
                self.run.bends(&all).iter().zip(&self.still).map(|(a, b)| a.minus(b)).collect()
            }
            _ => self.run.bends(std::slice::from_ref(effect)),
        }
    }

    fn late(&self, effect: &Effect) -> Vec<Bend> {
        let mut bends = vec![Bend::default(); self.scene.rows.len()];
        let moved = Fine::of(self.scene, std::slice::from_ref(effect));
        for (fine, then) in moved.iter().zip(&self.run.fine) {
            for (row, k) in fine.at.iter().enumerate() {
                for i in 0..self.scene.arm.count() {
                    *bends[fine.first + row].of(i, 0) = fine.q[i][*k] - then.q[i][*k];
                }
            }
        }
        bends
    }

    /// Whitened column of an effect.
    #[must_use]
    pub fn column(&self, effect: &Effect) -> Vec<f64> {
        self.whiten(&self.of_bends(&self.bends(effect)))
    }

    /// The nuisance columns; parameters of the model that effects in `except` (kind, joint) revise are left out.
    #[must_use]
    pub fn nuisances(&self, except: &[&Effect]) -> Span {
        let mut span = Span::default();
        for values in registration(self.case, self.scene, &self.run.motors()) {
            span.take(self.whiten(&values));
        }
        take_known(&mut span, self.case, except, |effect| self.column(effect));
        span
    }

    /// Detectability of hidden effect `which`; `shown`: its values without noise.
    #[must_use]
    pub fn judge(&self, which: usize, shown: &[f64]) -> Judged {
        let truth = &self.case.hidden[which];
        let mut span = self.nuisances(&[truth]);
        for (k, other) in self.case.hidden.iter().enumerate() {
            if k != which {
                span.take(self.column(other));
            }
        }
        let whole = span.rest(&self.whiten(shown));
        let first = span.rest(&self.column(truth));
        // Frames and targets absorb rigid motions of any size, but their columns are only of first order.
        let is_taken = dot(&first, &first) < TAKEN * dot(&whole, &whole);
        let rest = if is_taken { first } else { whole };
        let question = Question {
            name: truth.kind.name().map(|name| (name, truth.joint_said())),
            numbers: free_numbers(truth.kind, self.scene, truth.joint),
            span: &span,
            rest: &rest,
            values: self.count(),
        };
        let mut judged = question.weigh(
            &candidates(self.case, self.scene),
            |effect| self.column(effect),
            |name| one_family(truth.kind, name),
        );
        judged.determined = determined(truth, &span, |effect| self.column(effect));
        judged
    }
}

/// Equivalent effects of one family (docs/reference/effects.md, last section): if their signatures agree, either is right.
fn one_family(truth: Kind, name: &str) -> bool {
    let family = |name: &str| match name {
        "gravity_compliance" | "load_compliance" | "joint_compliance" => 1,
        "axis_shift" => 2,
        "backlash" | "hysteresis" => 3,
        _ => 0,
    };
    truth.name().is_some_and(|own| family(own) != 0 && family(own) == family(name))
}

/// Values per unit of each registration parameter: measuring frame, then unknown points on the tool.
#[must_use]
pub fn registration(case: &Case, scene: &Scene, motors: &[[f64; 7]]) -> Vec<Vec<f64>> {
    let view = &case.view;
    let mut columns = Vec::new();
    if view.places.is_empty() {
        return columns;
    }
    let tools: Vec<T4> = motors
        .iter()
        .map(|q| crate::space::mul(&view.measuring_from_base, &scene.arm.tool(q)))
        .collect();
    let mut add = |law: &dyn Fn(&T4, usize, V3) -> V3| {
        let each = |tool: &T4| {
            let at = |(k, place): (usize, &V3)| law(tool, k, crate::space::point(tool, *place));
            view.places.iter().enumerate().flat_map(at).collect::<Vec<f64>>()
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
            add(&|_, _, p| crate::space::cross(unit(axis), crate::space::sub(p, case.middle())));
        }
    }
    if !view.places_known {
        for place in 0..view.places.len() {
            for axis in 0..3 {
                add(&|tool, k, _| if k == place { rotate(tool, unit(axis)) } else { [0.0; 3] });
            }
        }
    }
    columns
}

#[cfg(test)]
mod tests;
