//! Selection of effects for calibration: geometry first, then forward selection.
//!
//! The criterion of a candidate is its gain in log-likelihood minus the penalty of its parameters: `gain/λ − k ln(n/λ) − 2 ln(rivals)`, the extended Bayesian
//! information criterion (Schwarz 1978; Chen and Chen 2008), λ the design effect, since errors of readings of one pose are correlated. At the
//! end every effect must satisfy the criterion in the presence of all others.
//!
//! Promises: only training poses are used; the same input gives the same selection. Never: use of held-out poses, special treatment of a data set.

mod compliances;
mod replace;

use crate::campaign::{Campaign, Pose};
use crate::candidates::{Candidate, candidates, remainders, wave_candidate};
use crate::fit::{Effort, Settings, fit};
use crate::geometry::Tolerances;
use crate::hypothesis::{Hypothesis, named};
use crate::result::Fit;
use crate::score::Fitted;
use crate::triangle::Triangle;
use crate::waves::{Line, lines};
use physics::spec::Role;
use physics::{AnyEffect, Memories};

/// Rounds of adding.
const ROUNDS: usize = 40;
/// Effects that join in one round: those that gain at least this share of the best, each on another joint.
const BESIDE: f64 = 0.3;
/// What is found may be this many times as large.
const BROAD: f64 = 3.0;

/// An effect that was added.
#[derive(Clone, Debug)]
pub struct Chosen {
    /// Its place in the model's effects.
    pub effect: usize,
    /// By how much it lowered the sum of squares when it joined, in units of the noise.
    pub gain: f64,
    /// Entries that no fit changes, with their numbers, SI.
    pub settings: Vec<(&'static str, Vec<f64>)>,
}

/// A fit and what was added for it.
#[derive(Clone, Debug)]
pub struct Selection {
    /// The fit with all that was added.
    pub fit: Fit,
    /// What was added, in that order.
    pub chosen: Vec<Chosen>,
}

/// Adds to `calibrated` what the poses that take part ask for.
#[must_use]
pub fn select(campaign: &Campaign, calibrated: &Fit, settings: &Settings<'_>) -> Selection {
    let model = &calibrated.hypothesis.model;
    let mut open = candidates(&model.arm, campaign);
    open.retain(|candidate| !model.effects().any(|effect| candidate.is_rival_of(effect)));
    let mut selecting = Selecting {
        campaign,
        settings: *settings,
        tolerances: Tolerances::default(),
        is_finished: true,
        fit: calibrated.clone(),
        rivals: open.len().max(1),
        open,
        chosen: Vec::new(),
    };
    selecting.grow();
    selecting.finish();
    selecting.replace();
    selecting.prune();
    selecting.finish();
    Selection { fit: selecting.fit, chosen: selecting.chosen }
}

/// A candidate that joins.
struct Pick {
    candidate: Candidate,
    found: Vec<f64>,
    gain: f64,
    worth: f64,
    kept: &'static [&'static str],
}

/// A choice under way.
struct Selecting<'a> {
    campaign: &'a Campaign,
    settings: Settings<'a>,
    fit: Fit,
    tolerances: Tolerances,
    /// Whether the fit went until nothing was left to gain.
    is_finished: bool,
    open: Vec<Candidate>,
    rivals: usize,
    chosen: Vec<Chosen>,
}

impl Selecting<'_> {
    fn grow(&mut self) {
        self.join_compliances();
        for _ in 0..ROUNDS {
            let mut picks = self.among_open();
            if picks.is_empty() {
                picks = self.among_lines_and_remainders();
            }
            if picks.is_empty() {
                break;
            }
            let before = self.chosen.len();
            self.join(picks);
            if self.chosen.len() == before {
                break;
            }
        }
    }

    /// What `numbers` numbers cost, in the sum of squares.
    fn cost(&self, numbers: usize, rivals: f64) -> f64 {
        let readings = self.fit.readings as f64 / self.fit.design_effect;
        numbers as f64 * readings.max(2.0).ln() + 2.0 * rivals.max(1.0).ln()
    }

    fn among_open(&self) -> Vec<Pick> {
        let model = &self.fit.hypothesis.model;
        let ready = self.open.iter().filter(|candidate| candidate.has_its_ground(model));
        self.among(&ready.cloned().collect::<Vec<_>>())
    }

    /// A wave of any length or, where it says more, a description: one for each joint.
    fn among_lines_and_remainders(&self) -> Vec<Pick> {
        let (mut picks, described) = (self.among_lines(), self.among_remainders());
        for pick in described {
            let joint = pick.candidate.joint;
            let says_more = |line: &Pick| line.candidate.joint == joint && line.worth >= pick.worth;
            if !picks.iter().any(says_more) {
                picks.retain(|line| line.candidate.joint != joint);
                picks.push(pick);
            }
        }
        picks
    }

    /// What no effect explains, joint by joint.
    fn among_remainders(&self) -> Vec<Pick> {
        let model = &self.fit.hypothesis.model;
        let mut open = remainders(&model.arm, self.campaign, self.settings.used);
        open.retain(|candidate| !model.effects().any(|effect| candidate.is_rival_of(effect)));
        self.among(&open)
    }

    fn among(&self, open: &[Candidate]) -> Vec<Pick> {
        let fitted = Fitted::new(self.campaign, &self.fit, &self.settings);
        let mut picks: Vec<Pick> = Vec::new();
        for score in fitted.scores(open) {
            let candidate = &open[score.candidate];
            let numbers = score.numbers + candidate.tried_numbers();
            let cost = self.cost(numbers, self.rivals as f64);
            let worth = score.gain / self.fit.design_effect - cost;
            if worth > 0.0
                && is_sound(candidate, &score.found)
                && self.is_possible(candidate, &score.found)
            {
                let (candidate, kept) = (candidate.clone(), candidate.kept());
                picks.push(Pick { candidate, found: score.found, gain: score.gain, worth, kept });
            }
        }
        strongest(picks)
    }

    /// Whether a robot that stands may have these numbers.
    fn is_possible(&self, candidate: &Candidate, found: &[f64]) -> bool {
        let effect = candidate.effect(&self.fit.hypothesis.model.arm, found);
        effect.is_none_or(|effect| is_possible(&effect))
    }

    fn among_lines(&self) -> Vec<Pick> {
        let fitted = Fitted::new(self.campaign, &self.fit, &self.settings);
        let arm = &self.fit.hypothesis.model.arm;
        let found = lines(&fitted);
        let tried: usize = found.iter().map(|line| line.tried).sum();
        let pick = |line: &Line| {
            let worth = line.gain / self.fit.design_effect - self.cost(3, tried as f64);
            let candidate = wave_candidate(arm, line.joint, line.cycles).filter(|_| worth > 0.0)?;
            let score = fitted.scores(std::slice::from_ref(&candidate)).pop()?;
            Some(Pick { candidate, found: score.found, gain: line.gain, worth, kept: &[] })
        };
        found.iter().filter_map(pick).collect()
    }

    fn join(&mut self, picks: Vec<Pick>) {
        let mut hypothesis = self.fit.hypothesis.clone();
        for pick in picks {
            let Some(chosen) = joined(&mut hypothesis, &pick) else { break };
            let joined = hypothesis.model.effects().nth(chosen.effect);
            let bars = |open: &Candidate| joined.is_some_and(|effect| open.is_rival_of(effect));
            self.open.retain(|open| open.slot != pick.candidate.slot && !bars(open));
            self.chosen.push(chosen);
        }
        self.refit(&hypothesis, Effort::Sketch);
    }

    /// Takes out what was chosen in place `k`.
    fn drop(&mut self, k: usize) {
        let gone = self.chosen.remove(k).effect;
        for chosen in self.chosen.iter_mut().filter(|chosen| chosen.effect > gone) {
            chosen.effect -= 1;
        }
        let hypothesis = self.fit.hypothesis.without(gone);
        self.refit(&hypothesis, Effort::Sketch);
    }

    fn refit(&mut self, hypothesis: &Hypothesis, effort: Effort) {
        self.is_finished = effort == Effort::Full;
        let around = self.fit.surroundings.clone();
        let settings = Settings { from: Some(&around), effort, ..self.settings };
        self.fit = fit(self.campaign, hypothesis, &settings);
    }

    fn finish(&mut self) {
        if !self.is_finished {
            let hypothesis = self.fit.hypothesis.clone();
            self.refit(&hypothesis, Effort::Full);
        }
    }

    /// Takes out, the least worth first, what is not worth its numbers beside all others.
    fn prune(&mut self) {
        for _ in 0..ROUNDS {
            let worths = self.chosen.iter().enumerate().map(|(k, c)| (k, self.worth(c.effect)));
            let least = worths.min_by(|a, b| a.1.total_cmp(&b.1));
            let Some((k, _)) = least.filter(|(_, worth)| *worth <= 0.0) else { break };
            self.drop(k);
        }
    }

    /// By how much the sum of squares would rise without an effect, less what its numbers cost.
    fn worth(&self, effect: usize) -> f64 {
        let hypothesis = &self.fit.hypothesis;
        if hypothesis.model.effects().nth(effect).is_some_and(|effect| !is_possible(effect)) {
            return f64::NEG_INFINITY;
        }
        if let Some(said) = self.by_neighbours(effect) {
            return said;
        }
        if self.is_tolerated(effect) {
            return f64::INFINITY;
        }
        let values = hypothesis.values();
        let mut own = Vec::new();
        for (k, free) in hypothesis.free.iter().enumerate().filter(|(_, f)| f.effect == effect) {
            let column = self.fit.column_of(k);
            if self.fit.covariance(column, column).is_none() {
                continue;
            }
            let entry = hypothesis.effect_of(free).and_then(|effect| named(effect, free.value));
            // Without its linear numbers the others say nothing: they stay out of what would rise.
            let is_linear = entry.is_some_and(|named| named.parameter.role == Role::Linear);
            own.push((column, if is_linear { values[k] } else { 0.0 }));
        }
        self.rise(&own) - self.cost(own.len(), 1.0)
    }

    /// What effects that lean on one another say of the worth of one: a stiffening law that a pose is beyond stands for nothing, and what it works
    /// upon stays as long as it does.
    fn by_neighbours(&self, effect: usize) -> Option<f64> {
        let model = &self.fit.hypothesis.model;
        let own = model.effects().nth(effect)?;
        if matches!(own, AnyEffect::StiffnessHardening(_)) {
            let mut used = self.campaign.poses.iter().zip(self.settings.used).filter(|(_, u)| **u);
            let memories = Memories::default();
            let is_beyond = |(pose, _): (&Pose, &bool)| {
                let beyond = model.evaluate(&pose.inputs, &memories).beyond;
                beyond.is_some_and(|beyond| Some(beyond.joint) == own.joint())
            };
            return used.any(is_beyond).then_some(f64::NEG_INFINITY);
        }
        let without = self.fit.hypothesis.without(effect);
        (model.check().is_ok() && without.model.check().is_err()).then_some(f64::INFINITY)
    }

    /// `xᵀ C⁻¹ x` of the numbers `own`, C their covariance.
    fn rise(&self, own: &[(usize, f64)]) -> f64 {
        let mut triangle = Triangle::new(own.len());
        // Rows of the covariance as equations: C y = x, then x · y.
        for (a, x) in own {
            let row: Vec<f64> =
                own.iter().map(|(b, _)| self.fit.covariance(*a, *b).unwrap_or(0.0)).collect();
            let size = self.fit.sigma(*a).unwrap_or(1.0);
            let row: Vec<f64> = row.iter().map(|c| c / size).collect();
            triangle.push(&row, x / size);
        }
        triangle.reduce();
        let y = triangle.solve(&[]);
        own.iter().zip(y).map(|((_, x), y)| x * y).sum()
    }
}

/// Adds what was picked; none where there is no room.
fn joined(hypothesis: &mut Hypothesis, pick: &Pick) -> Option<Chosen> {
    let effect = put(hypothesis, &pick.candidate, pick.kept, &pick.found)?;
    Some(Chosen { effect, gain: pick.gain, settings: pick.candidate.settings.clone() })
}

/// Adds the effect of a candidate with the numbers that were found for it, all free but those of `kept`; gives its place, none where there is no room.
pub(crate) fn put(
    hypothesis: &mut Hypothesis,
    candidate: &Candidate,
    kept: &[&str],
    found: &[f64],
) -> Option<usize> {
    let effect = candidate.effect(&hypothesis.model.arm, found)?;
    let place = hypothesis.model.effects().len();
    hypothesis.add(effect, kept).ok()?;
    hypothesis.free.retain(|free| free.effect != place || candidate.frees(free.value));
    believe_nothing(hypothesis, place, &effect);
    Some(place)
}

/// What was found is where the search starts; what is believed before the data is nothing.
fn believe_nothing(hypothesis: &mut Hypothesis, place: usize, effect: &AnyEffect) {
    for free in hypothesis.free.iter_mut().filter(|free| free.effect == place) {
        let named = named(effect, free.value);
        let linear = named.is_some_and(|named| named.parameter.role == Role::Linear);
        free.mean = if linear { 0.0 } else { free.mean };
        // A place on a grid is no belief; and what the data ask for is no more than a robot may have.
        let size = if linear { BROAD * size_of(effect, free.value) } else { free.mean.abs() };
        free.sigma = free.sigma.max(size);
    }
}

/// The largest number of the entry that a value belongs to.
fn size_of(effect: &AnyEffect, value: usize) -> f64 {
    let stem = |value| named(effect, value).map(|named| named.parameter.stem);
    let own = effect.values().iter().enumerate().filter(|(k, _)| stem(*k) == stem(value));
    own.map(|(_, x)| x.abs()).fold(0.0, f64::max)
}

/// Those that gain about as much as the best, each on a joint of its own.
fn strongest(mut picks: Vec<Pick>) -> Vec<Pick> {
    picks.sort_by(|a, b| b.worth.total_cmp(&a.worth));
    let best = picks.first().map_or(0.0, |pick| pick.gain);
    let mut taken = Vec::new();
    picks.retain(|pick| {
        let joint = pick.candidate.joint;
        let joins = pick.gain >= BESIDE * best && !taken.contains(&joint);
        if joins {
            taken.push(joint);
        }
        joins
    });
    picks
}

/// A tilt against the plumb line beyond this is none of a robot that was set up, rad; above 0. Default 0.06: three times the width of its prior.
const TILT_MAX_RAD: f64 = 0.06;

/// Whether physics lets a robot have an effect that the data ask for: no mass below zero, no absurd tilt.
fn is_possible(effect: &AnyEffect) -> bool {
    match effect {
        AnyEffect::Payload(_) => effect.values().first().is_none_or(|mass| *mass >= 0.0),
        AnyEffect::GravityTilt(_) => effect.values().iter().all(|t| t.abs() <= TILT_MAX_RAD),
        _ => true,
    }
}

/// Whether the numbers lie where they may: a gap or a compliance is not negative.
pub(crate) fn is_sound(candidate: &Candidate, found: &[f64]) -> bool {
    let ranges = candidate.probes.iter().map(|probe| named(&probe.effect, probe.value));
    if candidate.is_one_mass() {
        let mut ranges = ranges.flatten().map(|named| named.parameter.range);
        return ranges.all(|range| range.holds(found.iter().sum()));
    }
    candidate.changes().is_some()
        || candidate.probes.iter().zip(found).all(|(probe, value)| {
            let range = named(&probe.effect, probe.value).map(|named| named.parameter.range);
            range.is_none_or(|range| range.holds(*value))
        })
}

#[cfg(test)]
mod tests;
