//! Optimal experimental design of measuring poses for the identification of a robot model, and the contribution of each pose.
//!
//! Reading order: [`Task`] (parameters, instruments, constraints), [`setup`] and [`starting_point`] (a task from a description and from recordings),
//! [`plan()`] (poses for a [`Criterion`]), [`next()`] (one pose, and a stopping rule), [`check`] (test of a model after a collision).
//!
//! Based on the information matrix `M = Σ AᵀA + prior`, with `A` the whitened derivatives of a pose's readings with respect to every fitted
//! parameter, scaled by its prior. The unknown measuring frame and targets are included, so that directions confounded with them do not count.
//! Sources: Borm and Menq 1991 (O1), Fedorov 1972 (exchange), Klimchik et al. 2012, arXiv 1211.5739 (test-pose error). SI units.
//!
//! Invariants: the same task and seed give the same poses; every pose is within the limits, visible, and free of the described obstacles ([`reach`],
//! [`sight`]). Motions between poses are not checked for collisions, and effects missing in the hypothesis are not considered.

mod bank;
pub mod check;
mod choose;
mod gain;
pub mod inverse;
pub mod iso;
pub mod next;
pub mod order;
pub mod reach;
pub mod setup;
pub mod sight;
pub mod starting_point;
pub mod task;
#[cfg(test)]
mod tests;
pub mod zone;

pub use choose::Criterion;
pub use gain::{Added, Falls};
pub use next::{Next, next};
pub use task::{Patch, Sees, Task, believed};

use crate::campaign::Campaign;
use crate::result::Fit;
use bank::Bank;
use choose::{Design, choose, exchange};
use gain::{gains, numbers};
use physics::Joints;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Number of random neighbours tried for each selected pose.
const NEAR: usize = 6;
/// Largest joint displacement of a neighbour, rad or m.
const NEAR_BY: f64 = 0.12;

/// Existing measurements and their fit.
#[derive(Clone, Copy, Debug)]
pub struct Known<'a> {
    /// The measurements.
    pub campaign: &'a Campaign,
    /// Their fit; its hypothesis and extrinsic parameters are those of the [`Task`].
    pub fit: &'a Fit,
}

/// Settings of a plan.
#[derive(Clone, Copy, Debug)]
pub struct Wish {
    /// Number of poses.
    pub count: usize,
    /// Criterion of optimality.
    pub criterion: Criterion,
    /// Number of random candidate poses.
    pub candidates: usize,
    /// Seed of the random generator.
    pub seed: u64,
}

/// A selected set of poses.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The poses in an order with short moves, each with its contribution.
    pub poses: Vec<Added>,
    /// Standard uncertainty of every parameter, without and with all poses.
    pub numbers: Vec<Falls>,
    /// Parameters that the poses together do not determine, as sentences.
    pub undetermined: Vec<String>,
    /// Number of candidate poses.
    pub candidates: usize,
}

/// Why there is no plan.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoPlan {
    /// Too few poses satisfy the constraints.
    #[error(
        "of {drawn} poses {origin} {free} are free of base, floor and boxes, and {seen} of these can be measured: {wanted} are needed; {remedy}"
    )]
    Barred {
        /// Number of random poses, or of given ones.
        drawn: usize,
        /// Which of the two.
        origin: &'static str,
        /// Number accepted by [`reach::Reach`].
        free: usize,
        /// Number of these that are visible too.
        seen: usize,
        /// Number required.
        wanted: usize,
        /// What to change, of what was stated.
        remedy: &'static str,
    },
    /// The measurements do not depend on any parameter.
    #[error(
        "no pose determines any parameter of the model: what is measured does not depend on them"
    )]
    Nothing,
}

/// Selects poses for `task` that complement the measurements in `known`.
///
/// # Errors
/// [`NoPlan`] if fewer poses than required satisfy the constraints, or none determines a parameter.
pub fn plan(task: &Task, known: Option<Known<'_>>, wish: &Wish) -> Result<Plan, NoPlan> {
    let mut rng = ChaCha8Rng::seed_from_u64(wish.seed);
    let drawn = task.draw(&mut rng, wish.candidates, wish.count)?;
    let candidates = drawn.len();
    let mut bank = Bank::of(task, known, drawn)?;
    let picks = if wish.criterion == Criterion::Random {
        (0..wish.count).map(|place| place * candidates / wish.count).collect()
    } else {
        best(task, &mut bank, wish, &mut rng)
    };
    let start = match known.and_then(|known| known.campaign.poses.last()) {
        Some(pose) => pose.inputs.q,
        None => order::home(&task.hypothesis.model.arm, &task.reach),
    };
    let stops: Vec<Joints> = picks.iter().map(|pick| bank.candidates[*pick].q).collect();
    let order = order::visit(&task.hypothesis.model.arm, &start, &stops);
    let picks: Vec<usize> = order.into_iter().map(|place| picks[place]).collect();
    Ok(Plan {
        poses: gains(task, &bank, &picks),
        numbers: numbers(task, &bank, &picks),
        undetermined: bank.undetermined.clone(),
        candidates,
    })
}

/// The best of the candidates, improved by exchanges with neighbours of the selected poses.
fn best(task: &Task, bank: &mut Bank, wish: &Wish, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let design = Design::of(bank, wish.criterion);
    let mut picks = choose(&|picks| design.worths(picks), wish.count);
    let chosen: Vec<Joints> = picks.iter().map(|pick| bank.candidates[*pick].q).collect();
    let near: Vec<_> = chosen.iter().flat_map(|q| task.near(rng, q, NEAR_BY, NEAR)).collect();
    bank.add(task, near);
    let design = Design::of(bank, wish.criterion);
    exchange(&|picks| design.worths(picks), &mut picks);
    picks
}
