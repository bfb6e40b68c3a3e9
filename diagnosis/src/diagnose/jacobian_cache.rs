//! Columns of the Jacobian for every candidate of the library, kept from one selection to the next.
//!
//! Columns are taken on the nominal geometry. They depend on the fit only through effects that change the loads or the path, and those of load-dependent candidates
//! through what is compliant; only then are they computed again. The cached columns are those that a new computation would give.

use crate::candidates::Candidate;
use crate::rides::Moved;
use crate::score::{Fitted, Moves};
use physics::AnyEffect;
use physics::spec::ActsOn;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Columns of those that act upon the loads, and of all others.
#[derive(Default)]
pub(super) struct JacobianCache {
    of_loads: Mutex<Kept>,
    others: Mutex<Kept>,
    ringing: Mutex<Ringing>,
}

/// What modes move, and the effects that they feel.
#[derive(Default)]
struct Ringing {
    context: Vec<AnyEffect>,
    columns: Option<Arc<Vec<Moved>>>,
}

/// Columns, and what they hold for.
#[derive(Default)]
struct Kept {
    context: Vec<AnyEffect>,
    used: Vec<bool>,
    moves: Vec<Arc<Moves>>,
}

impl JacobianCache {
    /// The columns of every candidate of `library`, which is always the same, where a fit stands.
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
    /// What the modes that are asked first move, which are always the same ones; `columns` tells it where it is not known.
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

/// What is kept is whole whenever it is let go of: each part is replaced at once.
fn held<T>(kept: &Mutex<T>) -> MutexGuard<'_, T> {
    kept.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Those of the effects that change the loads or the way.
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
        // What was kept goes first: it is large.
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
