//! Cache of the Jacobian columns of every candidate of the library, from one selection to the next.
//!
//! Columns are computed on the nominal geometry. They depend on the fit only through effects that change the loads or the path, and those of
//! load-dependent candidates also through the compliances; only if these change are they computed again. Invariant: cached columns equal newly
//! computed ones.

use crate::candidates::Candidate;
use crate::rides::Moved;
use crate::score::{Fitted, Moves};
use physics::AnyEffect;
use physics::spec::ActsOn;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Columns of candidates that change the loads, of all others, and of flexible modes.
#[derive(Default)]
pub(super) struct JacobianCache {
    of_loads: Mutex<Kept>,
    others: Mutex<Kept>,
    ringing: Mutex<Ringing>,
}

/// Columns of flexible modes, and the effects for which they are valid.
#[derive(Default)]
struct Ringing {
    context: Vec<AnyEffect>,
    columns: Option<Arc<Vec<Moved>>>,
}

/// Columns, and the effects and poses for which they are valid.
#[derive(Default)]
struct Kept {
    context: Vec<AnyEffect>,
    used: Vec<bool>,
    moves: Vec<Arc<Moves>>,
}

impl JacobianCache {
    /// The columns of every candidate of `library`, which has to be the same in every call, at the present fit.
    pub(super) fn moves(&self, fitted: &Fitted<'_>, library: &[Candidate]) -> Vec<Arc<Moves>> {
        let (mut of_loads, mut others) = (held(&self.of_loads), held(&self.others));
        let whole = fitted.context();
        let felt = felt(&whole);
        of_loads.hold(fitted, whole, library.iter().filter(|candidate| is_of_loads(candidate)));
        others.hold(fitted, felt, library.iter().filter(|candidate| !is_of_loads(candidate)));
        let (mut of_loads, mut others) = (of_loads.moves.iter(), others.moves.iter());
        let next = |candidate: &Candidate| {
            if is_of_loads(candidate) { of_loads.next() } else { others.next() }.cloned()
        };
        library.iter().filter_map(next).collect()
    }
}

impl JacobianCache {
    /// The columns of the coarse grid of modes, which is the same in every call; `columns` computes them if they are not cached or no longer valid.
    pub(super) fn ringing(
        &self,
        fitted: &Fitted<'_>,
        columns: impl FnOnce() -> Vec<Moved>,
    ) -> Arc<Vec<Moved>> {
        let mut kept = held(&self.ringing);
        let felt = felt(&fitted.context());
        if kept.context != felt {
            *kept = Ringing { context: felt, columns: None };
        }
        Arc::clone(kept.columns.get_or_insert_with(|| Arc::new(columns())))
    }
}

/// A poisoned lock is usable: each part of the cache is replaced as a whole.
fn held<T>(kept: &Mutex<T>) -> MutexGuard<'_, T> {
    kept.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The effects that change the loads or the path.
fn felt(whole: &[AnyEffect]) -> Vec<AnyEffect> {
    let changes_all = |effect: &&AnyEffect| on_loads(effect) || is_over_path(effect);
    whole.iter().filter(changes_all).copied().collect()
}

impl Kept {
    fn hold<'a>(
        &mut self,
        fitted: &Fitted<'_>,
        context: Vec<AnyEffect>,
        candidates: impl Iterator<Item = &'a Candidate>,
    ) {
        let used = &fitted.weighing.used;
        if self.context == context && self.used == *used {
            return;
        }
        let candidates: Vec<Candidate> = candidates.cloned().collect();
        // The previous columns are released first, since they need much memory.
        self.moves.clear();
        self.moves = fitted.moves(&candidates).into_iter().map(Arc::new).collect();
        (self.context, self.used) = (context, used.clone());
    }
}

fn on_loads(effect: &AnyEffect) -> bool {
    effect.spec().acts_on == ActsOn::Loads
}

fn is_over_path(effect: &AnyEffect) -> bool {
    matches!(effect, AnyEffect::OverPath(_))
}

fn is_of_loads(candidate: &Candidate) -> bool {
    candidate.probes.iter().any(|probe| on_loads(&probe.effect))
}
