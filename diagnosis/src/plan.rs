//! Selection of measuring poses, and the contribution of each.
//!
//! Read in this order: [`Task`] (parameters, instruments, constraints), [`setup`] and [`starting_point`] (a task from a description and from recordings), [`plan()`] (poses chosen for a [`Criterion`]),
//! [`next()`] (one pose, and whether it is enough), [`check`] (whether a model still holds after a collision).
//!
//! Based on the information matrix `M = Σ AᵀA + prior`, `A` the whitened derivatives of a pose's readings by every fitted
//! parameter, scaled by its prior: unknown measuring frame and targets are included, so that directions confounded with them
//! do not count. Sources: Borm and Menq 1991 (O1), Fedorov 1972 (exchange), Klimchik et al. 2012, arXiv 1211.5739 (a zone's own error).
//!
//! Promises: the same task and seed give the same poses; every pose is inside the limits, seen, and free of what was described ([`reach`], [`sight`]).
//! Never: a collision-free motion between poses, or effects missing in the hypothesis.

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

/// Poses near each chosen one that are tried in its place.
const NEAR: usize = 6;
/// How far from it, rad or m.
const NEAR_BY: f64 = 0.12;

/// What was measured already, and the fit of it.
#[derive(Clone, Copy, Debug)]
pub struct Known<'a> {
    /// The measurements.
    pub campaign: &'a Campaign,
    /// Their fit; its hypothesis and surroundings are those of the [`Task`].
    pub fit: &'a Fit,
}

/// How a plan is made.
#[derive(Clone, Copy, Debug)]
pub struct Wish {
    /// How many poses.
    pub count: usize,
    /// Best for what.
    pub criterion: Criterion,
    /// Poses that are drawn to choose from.
    pub candidates: usize,
    /// Seed of all chance.
    pub seed: u64,
}

/// A chosen set of poses.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The poses, in an order that keeps moves short, with what each brings.
    pub poses: Vec<Added>,
    /// Every number that the poses tell, without and with all of them.
    pub numbers: Vec<Falls>,
    /// What the poses together do not determine, as sentences.
    pub undetermined: Vec<String>,
    /// Poses that could be chosen from.
    pub candidates: usize,
}

/// Why there is no plan.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoPlan {
    /// Nothing passes the constraints.
    #[error(
        "of {drawn} poses drawn {free} are free of base, floor and boxes, and {seen} of these are seen: {wanted} are needed; \
         move the instrument, or relax what bars a pose"
    )]
    Barred {
        /// Drawn.
        drawn: usize,
        /// Let through by [`reach::Reach`].
        free: usize,
        /// Seen besides.
        seen: usize,
        /// Needed.
        wanted: usize,
    },
    /// What is measured tells nothing of what is to be found.
    #[error(
        "no pose determines any parameter of the model: what is measured does not depend on them"
    )]
    Nothing,
}

/// Chooses poses for `task` that complement what is `known`.
///
/// # Errors
/// Where fewer poses than wanted pass the constraints, or none tells anything.
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

/// The best of the candidates, and of poses near them.
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
