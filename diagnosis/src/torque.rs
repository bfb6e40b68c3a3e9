//! Identifies physical effects in recorded drive torques: friction, inertia, gravity, springs, ripple, hysteresis, load friction, drive gain, delay,
//! payload.
//!
//! Method: torque and motion are filtered into one frequency band, the torque that the model predicts is subtracted, and the residual is regressed on
//! a dictionary of candidate effects (linear in their parameters, except a few searched ones) by stepwise selection with an information criterion and
//! an AR noise model. Selected effects are confirmed on a validation set and tested on a test set. Inputs: a model and recordings. Outputs:
//! [`Diagnosis`], in SI units, joints from 0.
//!
//! Reading order: `motion` (torque and motion in one band), `rigid` (rigid-body torques), `columns` and `library` (candidates), `case` (rows and
//! normal equations), `crate::engine` (selection), `refine` (nonlinear parameters), `zone`, `prove`, `unknown`, `found`, `finish`.
//!
//! Invariants: the same input and seed give the same bits; no selection and no fit uses test rows; the controller's tracking error is not a
//! covariate.

mod case;
mod columns;
mod filter;
mod finish;
mod found;
mod known;
mod library;
mod load;
mod memory;
mod motion;
mod payload;
mod prove;
mod refine;
mod reinterpretation;
mod resample;
mod result;
mod rigid;
mod smooth;
mod stand;
mod still;
mod stops;
mod stretches;
#[cfg(test)]
mod tests;
mod unknown;
mod view;
mod zone;

use recording::series::Recording;
use std::borrow::Cow;

use crate::engine::library::Form;
use crate::engine::stepwise::{Search, Selection, others};
use case::Case;
pub use found::{Number, Rival};
pub use known::{Refit, Stated};
pub use motion::has_torque;
use reinterpretation::{hardening_as_spring, hysteresis_as_friction, spring_as_asymmetry};
pub use result::{Diagnosis, Finding, JointProof};
pub use unknown::Law;
pub use view::Trace;
pub use zone::Zone;

/// Smallest relative increase of the residual on the validation set, when an effect is removed, for which the effect is kept.
const TELLS: f64 = 1e-3;
/// An effect that raises the predictive log-likelihood of the validation set (given the fit of the training set, with its parameter covariance) by at
/// least this much is kept.
const BEARS: f64 = 1.0;
/// Penalty, in log-likelihood, for fitting the stated masses too, although the model states no uncertainty for them.
const DOUBTED: f64 = 20.0;
/// A zone is dropped if its residual, with the effects selected without its rows, exceeds this multiple of the zone's earlier residual: the exclusion
/// has then removed the evidence for a known effect.
const LOST: f64 = 4.0;
/// Repetitions of the selection for which new ripple frequencies are searched.
const RIPPLE_ROUNDS: usize = 2;

/// Why a diagnosis is impossible.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Doubt {
    /// Too few rows remain after filtering.
    #[error(
        "{rows} rows of torque and motion without gaps are left, expected at least {least}: record more, or longer stretches"
    )]
    FewRows {
        /// Rows that remain.
        rows: usize,
        /// Rows that are required.
        least: usize,
    },
    /// No joint with recorded torque moves.
    #[error("no joint whose torque was recorded moves: move the arm")]
    Still,
}

/// Minimum number of rows for a diagnosis, and of moving rows for a joint to be diagnosed.
const ROWS_LEAST: usize = 200;

/// Diagnoses the drive torques of the arm of `stated` from `recordings`.
///
/// `band_hz`: edge of the low-pass filter, Hz; `None` selects it from the sampling rate. `seed` determines the split of the data. Owned recordings
/// are dropped as soon as the motion has been extracted, to save memory.
///
/// # Errors
/// [`Doubt`] if too few rows of torque and motion remain, or no joint with recorded torque moves.
pub fn diagnose<'r>(
    stated: &Stated<'_>,
    recordings: impl Into<Cow<'r, [Recording]>>,
    band_hz: Option<f64>,
    seed: u64,
) -> Result<Diagnosis, Doubt> {
    let recordings = recordings.into();
    let mut case = Case::new(stated, &recordings, band_hz, seed);
    drop(recordings);
    let rows = case.table.rows();
    if rows < ROWS_LEAST {
        return Err(Doubt::FewRows { rows, least: ROWS_LEAST });
    }
    if case.table.joints().next().is_none() {
        return Err(Doubt::Still);
    }
    case.estimate_noise();
    let train = case.rows.train.clone();
    let (_, selection) = named(&mut case, &[], &train);
    case.reload(&selection);
    case.estimate_noise();
    let (always, selection) = named(&mut case, &selection.names, &train);
    let mut zones = zones(&mut case, &selection, &train);
    let (always, selection) = if zones.is_empty() {
        (always, selection)
    } else {
        case.estimate_noise();
        // Selected from scratch: effects selected because of rows in zones may be spurious.
        let zoned = named(&mut case, &[], &train);
        if reopened(&mut case, &mut zones, &zoned.1, &train) {
            case.estimate_noise();
            named(&mut case, &selection.names, &train)
        } else {
            zoned
        }
    };
    let names = hardening_as_spring(&case, stated, &confirmed(&case, &always, selection).names);
    let seen = case.rows.seen();
    let products = case.products(&seen);
    let search = refine::search(&case, &products, &always);
    let names = spring_as_asymmetry(&search, names);
    let selection = search.solve(&names);
    refine::settle(&mut case, &selection, &always, &seen);
    refine::agree(&mut case, &selection.names, &always, &seen);
    let names = with_likelier_rivals(&case, &weighed(&case, &always, &names));
    let names = hysteresis_as_friction(&case, &always, names);
    let names = without_warm_friction_alone(&mut case, stated, &always, &names, &seen);
    let weighed = weighed(&case, &always, &names);
    case.ignore_autocorrelation();
    refit_nonlinear(&mut case, stated, &always, &weighed);
    Ok(finish::finish(&case, stated, (&always, &weighed), zones))
}

/// Final fit of the parameters that are not linear: searched parameters, temperature coefficients, and columns that depend on other parameters, with
/// the row weights of the final fit.
fn refit_nonlinear(case: &mut Case, stated: &Stated<'_>, always: &[usize], weighed: &[Weighed]) {
    let seen = case.rows.seen();
    let names: Vec<usize> = weighed.iter().map(|one| one.name).collect();
    let products = case.products(&seen);
    let selection = refine::search(case, &products, always).solve(&names);
    refine::settle(case, &selection, always, &seen);
    refine::agree(case, &names, always, &seen);
    refine::warm(case, &names, always, &seen, &|joint| stated.first("viscous_friction", joint));
}

/// Removes a temperature dependence of friction where the joint's viscous friction, stated plus found, is not positive.
fn without_warm_friction_alone(
    case: &mut Case,
    stated: &Stated<'_>,
    always: &[usize],
    names: &[usize],
    used: &[bool],
) -> Vec<usize> {
    let products = case.products(used);
    let solved = refine::search(case, &products, always).solve(names).solved;
    let has_friction = |name: &usize| {
        let family = &case.library.families[*name];
        let viscous = |joint: usize| {
            stated.first("viscous_friction", joint)
                + refine::found_viscous(case, names, &solved, joint)
        };
        family.form != Form::Warmth || family.joint.is_some_and(|joint| viscous(joint) > 0.0)
    };
    let kept: Vec<usize> = names.iter().copied().filter(has_friction).collect();
    refine::warm(case, &kept, always, used, &|joint| stated.first("viscous_friction", joint));
    kept
}

/// A selected effect with its gain in log-likelihood and its alternatives, evaluated with the autocorrelated noise model.
#[derive(Clone)]
struct Weighed {
    name: usize,
    gain: f64,
    confidence: f64,
    rivals: Vec<Rival>,
}

/// Replaces each effect by its most probable alternative if that is more probable. An effect is dropped if its replacement, or another form of it, is
/// selected already.
fn with_likelier_rivals(case: &Case, weighed: &[Weighed]) -> Vec<usize> {
    let families = &case.library.families;
    let mut names: Vec<usize> = Vec::new();
    for one in weighed {
        let best = one.rivals.first().filter(|rival| rival.confidence > one.confidence);
        let name = best.map_or(one.name, |rival| rival.place);
        let stands = |other: &usize| *other == name || families[*other].is_kin(&families[name]);
        let is_there = names.iter().any(stands)
            || weighed.iter().any(|w| w.name != one.name && stands(&w.name));
        if name == one.name || !is_there {
            names.push(name);
        }
    }
    names
}

fn weighed(case: &Case, always: &[usize], names: &[usize]) -> Vec<Weighed> {
    let products = case.products(&case.rows.seen());
    let search = refine::search(case, &products, always);
    let selection = search.solve(names);
    let one = |name: &usize| {
        let (confidence, rivals) = found::rivals(&search, &selection, *name);
        Weighed { name: *name, gain: search.worth(&selection, *name), confidence, rivals }
    };
    let pays = |one: &Weighed| one.gain > search.penalty(&case.library.families[one.name]);
    names.iter().map(one).filter(pays).collect()
}

/// Selects effects on the rows `used`, once with stated masses exact and once fitted within their prior; returns the always-fitted columns and the
/// selection of the variant with the better score.
fn named(case: &mut Case, start: &[usize], used: &[bool]) -> (Vec<usize>, Selection) {
    let exact = case.open.clone();
    let mut doubted = case.open.clone();
    doubted.extend(&case.doubted);
    let mut best: Option<(f64, Vec<usize>, Selection)> = None;
    let beliefs = if case.doubted.is_empty() { vec![exact] } else { vec![exact, doubted] };
    for always in beliefs {
        let mut names = start.to_vec();
        let mut selection = None;
        for round in 0..=RIPPLE_ROUNDS {
            let products = case.products(used);
            let search = refine::search(case, &products, &always);
            let chosen = search.choose(&names);
            let moved = case.recentre(&chosen) | case.late(&chosen);
            let goes_on =
                round < RIPPLE_ROUNDS && (refine::find_ripple(case, &chosen, used) || moved);
            names.clone_from(&chosen.names);
            selection = Some(chosen);
            if !goes_on {
                break;
            }
        }
        let Some(selection) = selection else { continue };
        refine::settle(case, &selection, &always, used);
        let products = case.products(used);
        let search = refine::search(case, &products, &always);
        let selection = search.choose(&selection.names);
        let doubts = if always.len() > case.open.len() { DOUBTED } else { 0.0 };
        let score = search.score(&selection) - products.room(&always) - doubts;
        if best.as_ref().is_none_or(|(most, ..)| score > *most) {
            best = Some((score, always, selection));
        }
    }
    match best {
        Some((_, always, selection)) => (always, selection),
        None => {
            let products = case.products(used);
            let selection = refine::search(case, &products, &[]).solve(&[]);
            (Vec::new(), selection)
        }
    }
}

/// Finds low-speed zones that no candidate effect describes, and excludes their rows from the fit.
fn zones(case: &mut Case, selection: &Selection, used: &[bool]) -> Vec<Zone> {
    let joints: Vec<usize> = case.table.joints().collect();
    let mut zones = Vec::new();
    for joint in joints {
        let left = case.residual(&selection.solved, joint);
        if let Some(zone) = zone::find(&case.motion, &case.table, joint, &left, used) {
            let speeds = zone::speeds(&case.motion, joint);
            let counts = case.table.counts[joint].iter_mut();
            counts.zip(speeds).for_each(|(counts, speed)| *counts &= speed >= zone.below);
            zones.push(zone);
        }
    }
    zones
}

/// Includes the rows of a zone again if effects selected without them leave a much larger residual there than those selected with them: a known
/// effect acts there. Returns whether any zone was reopened.
fn reopened(case: &mut Case, zones: &mut Vec<Zone>, selection: &Selection, used: &[bool]) -> bool {
    let before = zones.len();
    zones.retain(|zone| {
        let left = case.residual(&selection.solved, zone.joint);
        let speeds = zone::speeds(&case.motion, zone.joint);
        let moves = &case.table.moves[zone.joint];
        let within: Vec<f64> = (0..left.len())
            .filter(|row| used[*row] && moves[*row] && speeds[*row] < zone.below)
            .map(|row| left[row])
            .collect();
        let rms =
            libm::sqrt(within.iter().map(|x| x * x).sum::<f64>() / within.len().max(1) as f64);
        let is_lawless = rms < LOST * zone.left[0];
        if !is_lawless {
            case.table.counts[zone.joint].clone_from(&case.table.moves[zone.joint]);
        }
        is_lawless
    });
    zones.len() < before
}

/// Drops the effects that the validation set does not support, by the residual itself and by the whitened residual; then selects again, since the
/// dropped effects may have displaced others.
fn confirmed(case: &Case, always: &[usize], mut selection: Selection) -> Selection {
    let products = case.products(&case.rows.train);
    let search = refine::search(case, &products, always);
    let Some(fell) = fallen(case, &search, &mut selection) else { return selection };
    let renamed = search.renamed(selection).names;
    let never: Vec<usize> = fell.into_iter().filter(|name| !renamed.contains(name)).collect();
    let mut selection = search.choose_but(&renamed, &never);
    match fallen(case, &search, &mut selection) {
        Some(_) => search.renamed(selection),
        None => selection,
    }
}

/// Removes unsupported effects one by one, the least supported first; returns them, or `None` if all are supported.
fn fallen(case: &Case, search: &Search<'_>, selection: &mut Selection) -> Option<Vec<usize>> {
    let look = &case.rows.validation;
    let left = |selection: &Selection| {
        [
            prove::rms_outside(case, &selection.solved, look),
            prove::news(case, &selection.solved, look),
        ]
    };
    let both = case.products(&case.rows.seen());
    let foretold = |selection: &Selection| {
        let columns = &selection.solved.columns;
        both.likelihood(columns) - search.products.likelihood(columns)
    };
    let mut fell = Vec::new();
    loop {
        let whole = left(selection);
        let told = foretold(selection);
        let asked = selection.names.iter().filter(|name| !case.is_belief(**name, search.always));
        let asked = asked.filter(|name| {
            foretold(&search.solve(&others(&selection.names, **name))) > told - BEARS
        });
        let harm = |name: &usize| {
            let without = left(&search.solve(&others(&selection.names, *name)));
            (without[0] / whole[0]).max(without[1] / whole[1]) - 1.0
        };
        let worst = asked.map(|name| (*name, harm(name)));
        match worst.min_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((name, harm)) if harm < TELLS => {
                *selection = search.solve(&others(&selection.names, name));
                fell.push(name);
            }
            _ => return (!fell.is_empty()).then_some(fell),
        }
    }
}
