//! Cache of the Jacobian columns of every candidate of the dictionary, from one selection to the next.
//!
//! Columns are computed on the nominal geometry. They depend on the fit only through effects that change the loads or the path, and those of
//! load-dependent candidates also through the compliances; only if these change are they computed again. Invariant: cached columns equal newly
//! computed ones.

use crate::candidates::Candidate;
use crate::path_dynamics::ElementDisplacement;
use crate::score_test::{CandidateMotions, ScoreTest};
use physics::AnyEffect;
use physics::spec::ActsOn;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Columns of candidates that change the loads, of all others, and of flexible modes.
#[derive(Default)]
pub(super) struct JacobianCache {
    load_changing: Mutex<CandidateColumns>,
    others: Mutex<CandidateColumns>,
    modes: Mutex<ModeColumns>,
}

/// Columns of flexible modes, and the effects for which they are valid.
#[derive(Default)]
struct ModeColumns {
    context: Vec<AnyEffect>,
    columns: Option<Arc<Vec<ElementDisplacement>>>,
}

/// Columns, and the effects and poses for which they are valid.
#[derive(Default)]
struct CandidateColumns {
    context: Vec<AnyEffect>,
    used: Vec<bool>,
    columns: Vec<Arc<CandidateMotions>>,
}

impl JacobianCache {
    /// The columns of every candidate of `dictionary`, which has to be the same in every call, at the present fit.
    pub(super) fn columns(
        &self,
        fitted: &ScoreTest<'_>,
        library: &[Candidate],
    ) -> Vec<Arc<CandidateMotions>> {
        let (mut of_loads, mut others) = (lock(&self.load_changing), lock(&self.others));
        let whole = fitted.context();
        let relevant = relevant_effects(&whole);
        of_loads.update(
            fitted,
            whole,
            library.iter().filter(|candidate| is_load_changing(candidate)),
        );
        others.update(
            fitted,
            relevant,
            library.iter().filter(|candidate| !is_load_changing(candidate)),
        );
        let (mut of_loads, mut others) = (of_loads.columns.iter(), others.columns.iter());
        let next = |candidate: &Candidate| {
            if is_load_changing(candidate) { of_loads.next() } else { others.next() }.cloned()
        };
        library.iter().filter_map(next).collect()
    }
}

impl JacobianCache {
    /// The columns of the coarse grid of modes, which is the same in every call; `columns` computes them if they are not cached or no longer valid.
    pub(super) fn mode_columns(
        &self,
        fitted: &ScoreTest<'_>,
        columns: impl FnOnce() -> Vec<ElementDisplacement>,
    ) -> Arc<Vec<ElementDisplacement>> {
        let mut kept = lock(&self.modes);
        let relevant = relevant_effects(&fitted.context());
        if kept.context != relevant {
            *kept = ModeColumns { context: relevant, columns: None };
        }
        Arc::clone(kept.columns.get_or_insert_with(|| Arc::new(columns())))
    }
}

/// A poisoned lock is usable: each part of the cache is replaced as a whole.
fn lock<T>(kept: &Mutex<T>) -> MutexGuard<'_, T> {
    kept.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The effects that change the loads or the path.
fn relevant_effects(whole: &[AnyEffect]) -> Vec<AnyEffect> {
    let changes_all = |effect: &&AnyEffect| changes_loads(effect) || is_over_path(effect);
    whole.iter().filter(changes_all).copied().collect()
}

impl CandidateColumns {
    fn update<'a>(
        &mut self,
        fitted: &ScoreTest<'_>,
        context: Vec<AnyEffect>,
        candidates: impl Iterator<Item = &'a Candidate>,
    ) {
        let used = &fitted.weighing.used;
        if self.context == context && self.used == *used {
            return;
        }
        let candidates: Vec<Candidate> = candidates.cloned().collect();
        // The previous columns are released first, since they need much memory.
        self.columns.clear();
        self.columns = fitted.candidate_motions(&candidates).into_iter().map(Arc::new).collect();
        (self.context, self.used) = (context, used.clone());
    }
}

fn changes_loads(effect: &AnyEffect) -> bool {
    effect.spec().acts_on == ActsOn::Loads
}

fn is_over_path(effect: &AnyEffect) -> bool {
    matches!(effect, AnyEffect::OverPath(_))
}

fn is_load_changing(candidate: &Candidate) -> bool {
    candidate.probes.iter().any(|probe| changes_loads(&probe.effect))
}
