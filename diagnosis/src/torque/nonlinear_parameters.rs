//! Searches the parameters in which a column is nonlinear: Stribeck speed, reversal distance of a hysteresis, cycles of a ripple; updates columns
//! that depend on other fitted parameters.
//!
//! Each parameter moves to the vertex of a parabola through three values of the log-likelihood, with all others refitted at each; its uncertainty
//! follows from the derivative of the torque (`fit_quality`). Changes no selection.

use std::f64::consts::TAU;

use super::case::Case;
use super::load_dependent::StatedLoadFriction;
use super::regressors::{
    TorqueTerm, lowest_velocity, rms_velocity, shortest_reversal, sine_and_cosine,
};
use super::stated_effects::EffectKey;
use crate::engine::dictionary::CoefficientForm;
use crate::engine::normal_equations::{LeastSquaresSolution, NormalEquations};
use crate::engine::regression_data::Regressor;
use crate::engine::stepwise::{TermSearch, TermSelection};

/// Relative steps of the parabola search, from the first to the last iteration.
const RELATIVE_STEPS: [f64; 4] = [0.3, 0.15, 0.07, 0.03];
/// Largest move per iteration, in steps.
const MOVE_MOST: f64 = 2.0;
/// Largest reversal distance of a hysteresis, as a share of the joint's span; a longer one is indistinguishable from a spring.
const REVERSAL_SHARE_MOST: f64 = 0.15;
/// Maximum number of iterations of a fixed point, and relative tolerance of its convergence.
const ROUNDS: usize = 10;
const CONVERGED: f64 = 1e-4;
/// Number of rows per SIMD vector.
const LANES: usize = 8;
/// Rows per block of the ripple search, small enough for the cache.
const ROWS_PER_BLOCK: usize = 512;
/// Largest number of half cycles per span in the ripple search.
const HALF_CYCLES_MOST: usize = 400;
/// Bins over a joint's span for the ripple search: twenty per cycle of the shortest wave, which loses one hundredth of its amplitude.
const BINS: usize = 4096;
/// Smallest number of half cycles per span of a ripple.
const HALF_CYCLES_LEAST: usize = 3;
/// Minimum number of rows per cycle of a ripple, at the joint's mean speed.
const ROWS_PER_CYCLE: f64 = 4.0;

/// The columns of an effect for another value of its searched parameter.
fn columns(case: &Case, name: usize, value: f64) -> Option<Vec<Regressor>> {
    let family = &case.library.terms[name];
    let joint = family.joint?;
    let column = |law: TorqueTerm| law.column(&case.motion, joint);
    match (family.kind, family.form) {
        ("stribeck_friction", _) => Some(vec![column(TorqueTerm::Stribeck { speed: value })]),
        ("hysteresis", _) => Some(vec![column(TorqueTerm::Dahl { distance: value })]),
        (_, CoefficientForm::Wave) => Some(sine_and_cosine(&case.motion, joint, value).into()),
        _ => None,
    }
}

/// Derivative of an effect's torque with respect to the logarithm of its searched parameter, the other parameters fixed; `None` if it has none.
pub(super) fn derivative_by_log(
    case: &Case,
    name: usize,
    solved: &LeastSquaresSolution,
) -> Option<Regressor> {
    let family = &case.library.terms[name];
    let &(_, value) = family.settings.first()?;
    let step = RELATIVE_STEPS[RELATIVE_STEPS.len() - 1] * largest_step(case, name, value)
        / RELATIVE_STEPS[0];
    let (below, above) =
        (columns(case, name, value * (1.0 - step))?, columns(case, name, value * (1.0 + step))?);
    let mut parts: Vec<(usize, Vec<f64>)> = Vec::new();
    for ((place, below), above) in family.columns.iter().zip(below).zip(above) {
        let share = solved.value(*place)? / (2.0 * step);
        for ((joint, below), (_, above)) in below.parts.iter().zip(&above.parts) {
            let more = below.iter().zip(above.iter()).map(|(below, above)| share * (above - below));
            match parts.iter_mut().find(|(other, _)| other == joint) {
                Some((_, sum)) => sum.iter_mut().zip(more).for_each(|(sum, more)| *sum += more),
                None => parts.push((*joint, more.collect())),
            }
        }
    }
    Some(Regressor { parts: parts.into_iter().map(|(joint, sum)| (joint, sum.into())).collect() })
}

/// Largest relative step of a searched parameter.
fn largest_step(case: &Case, name: usize, value: f64) -> f64 {
    let family = &case.library.terms[name];
    match (family.form, family.joint) {
        // A larger step would shift the wave by more than a fraction of a cycle at the end of the span.
        (CoefficientForm::Wave, Some(joint)) => {
            let [low, high] = case.motion.span(joint);
            let cycles = value * (high - low) / TAU;
            (0.3 / cycles.max(1.0)).min(RELATIVE_STEPS[0])
        }
        _ => RELATIVE_STEPS[0],
    }
}

/// Moves every searched parameter of a selection to the maximum of the likelihood.
pub(super) fn search_parameters(
    case: &mut Case,
    selection: &TermSelection,
    always: &[usize],
    used: &[bool],
) {
    for &name in &selection.terms {
        let Some(&(_, start)) = case.library.terms[name].settings.first() else { continue };
        if columns(case, name, start).is_none() {
            continue;
        }
        let widest = largest_step(case, name, start);
        let mut value = start;
        let joint = case.library.terms[name].joint.unwrap_or(0);
        let (shortest, lowest) =
            (shortest_reversal(&case.motion, joint), lowest_velocity(&case.motion, joint));
        let [low, high] = case.motion.span(joint);
        let longest = REVERSAL_SHARE_MOST * (high - low);
        // At a higher Stribeck speed the effect is indistinguishable from dry friction.
        let highest = rms_velocity(&case.motion, joint);
        for step in RELATIVE_STEPS.map(|step| step * widest / RELATIVE_STEPS[0]) {
            let mut gains = [0.0; 3];
            for (gain, away) in gains.iter_mut().zip([-step, 0.0, step]) {
                *gain =
                    self::gain_with(case, selection, always, (name, value * (1.0 + away)), used);
            }
            let bend = gains[0] - 2.0 * gains[1] + gains[2];
            let moved = if bend < 0.0 {
                0.5 * step * (gains[0] - gains[2]) / bend
            } else if gains[2] > gains[0] {
                MOVE_MOST * step
            } else {
                -MOVE_MOST * step
            };
            value *= 1.0 + moved.clamp(-MOVE_MOST * step, MOVE_MOST * step).max(-0.9);
            value = match case.library.terms[name].kind {
                "hysteresis" => value.clamp(shortest, longest.max(shortest)),
                "stribeck_friction" => value.clamp(lowest, highest.max(lowest)),
                _ => value,
            };
        }
        set_parameter(case, name, value);
    }
}

/// Iterates the temperature coefficient in each exponential friction law until it agrees with the fitted parameter. `viscous`: stated viscous
/// friction of a joint, N m s/rad or N s/m.
pub(super) fn fit_temperature_coefficients(
    case: &mut Case,
    names: &[usize],
    always: &[usize],
    used: &[bool],
    viscous: &dyn Fn(usize) -> f64,
) {
    for &name in names {
        let family = &case.library.terms[name];
        let (CoefficientForm::Warmth, Some(joint)) = (family.form, family.joint) else { continue };
        let place = family.columns[0];
        let (mut per_kelvin, mut before) = (0.0, None::<(f64, f64)>);
        for _ in 0..ROUNDS {
            let products = case.products(used);
            let solved = search(case, &products, always).solve(names).solved;
            let friction = viscous(joint) + found_viscous(case, names, &solved, joint);
            let implied = -solved.value(place).unwrap_or(0.0) / friction;
            let mismatch = implied - per_kelvin;
            if !implied.is_finite() || mismatch.abs() <= CONVERGED * implied.abs() {
                break;
            }
            // A fixed-point step would oscillate or diverge, since the fitted coefficient falls at least as steeply as the assumed one rises; hence a
            // secant step.
            let secant =
                before.map(|(k, o)| per_kelvin - mismatch * (per_kelvin - k) / (mismatch - o));
            before = Some((per_kelvin, mismatch));
            per_kelvin = secant.filter(|k| k.is_finite() && k * implied > 0.0).unwrap_or(implied);
            case.library.columns[place] =
                TorqueTerm::ThermalDecrease { per_kelvin }.column(&case.motion, joint);
        }
    }
}

/// For temperature-dependent friction: derivatives of the torque with respect to its parameters at the estimate, to replace the corresponding columns
/// (index, column) for the covariance.
pub(super) fn temperature_derivatives(
    case: &Case,
    selection: &TermSelection,
    viscous: &dyn Fn(usize) -> f64,
) -> Vec<(usize, Regressor)> {
    let mut all = Vec::new();
    for name in &selection.terms {
        let family = &case.library.terms[*name];
        let (CoefficientForm::Warmth, Some(joint)) = (family.form, family.joint) else { continue };
        let Some(value) = selection.solved.value(family.columns[0]) else { continue };
        let per_kelvin = -value / viscous(joint);
        let column = |law: TorqueTerm| law.column(&case.motion, joint);
        all.push((family.columns[0], column(TorqueTerm::ThermalDerivative { per_kelvin })));
        let families = selection.terms.iter().map(|name| &case.library.terms[*name]);
        let found = families
            .filter(|f| f.kind == "viscous_friction" && f.joint == Some(joint))
            .map(|f| f.columns[0]);
        let first = Some(("viscous_friction", Some(joint)));
        let stated =
            case.uncertain_parameters.iter().filter(|known| known.2 == first).map(|known| known.0);
        all.extend(
            found
                .chain(stated)
                .map(|place| (place, column(TorqueTerm::ThermalViscous { per_kelvin }))),
        );
    }
    all
}

/// Iterates the columns that depend on fitted parameters until these converge: payload position, load of load-dependent friction, delayed torque,
/// rest position of a spring.
pub(super) fn iterate_dependent_columns(
    case: &mut Case,
    names: &[usize],
    always: &[usize],
    used: &[bool],
) {
    let families = &case.library.terms;
    let is_of_load = |name: &usize| {
        matches!(families[*name].form, CoefficientForm::Payload { .. })
            || matches!(families[*name].kind, "load_friction" | "torque_delay")
    };
    let of_load: Vec<usize> = names.iter().copied().filter(is_of_load).collect();
    let mut before: Vec<f64> = Vec::new();
    let depends_on_load = !(of_load.is_empty() && case.stated_load_friction.is_empty());
    for _ in 0..if depends_on_load { ROUNDS } else { 0 } {
        let products = case.products(used);
        let selection = search(case, &products, always).solve(names);
        let first = |name: &usize| selection.solved.value(case.library.terms[*name].columns[0]);
        let mut now: Vec<f64> = of_load.iter().map(|name| first(name).unwrap_or(0.0)).collect();
        now.extend(case.stated_load_friction.iter().map(StatedLoadFriction::correction_norm));
        let mut both = now.iter().zip(&before);
        if !before.is_empty() && both.all(|(now, old)| (now - old).abs() <= CONVERGED * now.abs()) {
            break;
        }
        before = now;
        case.recentre_payloads(&selection);
        case.update_load_columns(&selection);
        case.update_delay(&selection);
    }
}

/// Viscous friction of a joint beyond the stated value: a selected effect, or the refit within the stated uncertainty.
pub(super) fn found_viscous(
    case: &Case,
    names: &[usize],
    solved: &LeastSquaresSolution,
    joint: usize,
) -> f64 {
    let families = names.iter().map(|name| &case.library.terms[*name]);
    let mut viscous = families.filter(|f| f.kind == "viscous_friction" && f.joint == Some(joint));
    let found = viscous.next().and_then(|f| solved.value(f.columns[0])).unwrap_or(0.0);
    let value = |(column, _, first_of): &(usize, (usize, usize), Option<EffectKey>)| {
        (*first_of == Some(("viscous_friction", Some(joint)))).then(|| solved.value(*column))?
    };
    found + case.uncertain_parameters.iter().filter_map(value).sum::<f64>()
}

/// Change of each hysteresis parameter if the loop is modelled by slipping springs instead of Dahl's law, per column. The law is unknown, and motion
/// that reverses within a loop gives amplitudes that depend on it.
pub(super) fn changes_under_maxwell_slip(
    case: &Case,
    selection: &TermSelection,
    used: &[bool],
) -> Vec<(usize, f64)> {
    let families = selection.terms.iter().map(|name| &case.library.terms[*name]);
    let loops: Vec<(usize, Regressor)> = families
        .filter(|family| family.form == CoefficientForm::Loop)
        .filter_map(|family| {
            let &(_, distance) = family.settings.first()?;
            Some((
                family.columns[0],
                TorqueTerm::MaxwellSlip { distance }.column(&case.motion, family.joint?),
            ))
        })
        .collect();
    if loops.is_empty() {
        return Vec::new();
    }
    let column_of = |place: &usize| {
        let other = loops.iter().find(|(one, _)| one == place);
        other.map_or(&case.library.columns[*place], |(_, other)| other)
    };
    let places = &selection.solved.columns;
    let columns: Vec<&Regressor> = places.iter().map(column_of).collect();
    let prior = places.iter().map(|place| case.library.prior[*place]).collect();
    let all: Vec<usize> = (0..columns.len()).collect();
    let solved = NormalEquations::new(&case.table, &columns, prior, used).solve(&all);
    let moved = |(place, _): &(usize, Regressor)| {
        let index = places.iter().position(|other| other == place)?;
        Some((*place, solved.value(index)? - selection.solved.values[index]))
    };
    loops.iter().filter_map(moved).collect()
}

/// Sets the searched parameter of a candidate and recomputes its columns.
fn set_parameter(case: &mut Case, name: usize, value: f64) {
    let Some(columns) = columns(case, name, value) else { return };
    let places = case.library.terms[name].columns.clone();
    places.iter().zip(columns).for_each(|(place, column)| case.library.columns[*place] = column);
    if let Some(setting) = case.library.terms[name].settings.first_mut() {
        setting.1 = value;
    }
}

/// Gain in log-likelihood of a selection with this value of a candidate's searched parameter.
fn gain_with(
    case: &mut Case,
    selection: &TermSelection,
    always: &[usize],
    (name, value): (usize, f64),
    used: &[bool],
) -> f64 {
    set_parameter(case, name, value);
    let products = case.products(used);
    search(case, &products, always).solve(&selection.terms).solved.gain
}

/// Adds the best-fitting ripple of each joint's residual to the library; returns whether any was added.
pub(super) fn find_ripple(case: &mut Case, selection: &TermSelection, used: &[bool]) -> bool {
    let mut found = false;
    let joints: Vec<usize> = case.table.joints().collect();
    for joint in joints {
        let left = case.residual(&selection.solved, joint);
        if let Some(cycles) = strongest_wave(case, joint, &left, used) {
            case.library.add_ripple(&case.motion, joint, cycles);
            found = true;
        }
    }
    found
}

/// Spatial frequency with the largest power in the residual of a joint, in cycles per revolution (rad/m for a prismatic joint).
fn strongest_wave(case: &Case, joint: usize, left: &[f64], used: &[bool]) -> Option<f64> {
    let [low, high] = case.motion.span(joint);
    let one = TAU / (high - low);
    let mut rows: Vec<(f64, f64)> = Vec::new();
    let mut from = 0;
    let mut usual = 0.0;
    for run in &case.motion.runs {
        let stride = run.rows.get(1).map_or(1, |second| second - run.rows[0]);
        for (k, row) in run.rows.iter().enumerate() {
            if used[from + k] && case.table.counts[joint][from + k] {
                rows.push((run.joints[joint].q[*row], left[from + k]));
                usual += (run.joints[joint].v[*row] * stride as f64 * run.step_s).abs();
            }
        }
        from += run.rows.len();
    }
    let per_row = usual / rows.len().max(1) as f64;
    if rows.is_empty() || per_row <= 0.0 || !one.is_finite() {
        return None;
    }
    let highest = TAU / (per_row * ROWS_PER_CYCLE);
    let count = ((highest / (0.5 * one)) as usize).clamp(1, HALF_CYCLES_MOST);
    // Fewer than one and a half cycles per span are indistinguishable from a slope or a curvature.
    let step = 0.5 * one;
    let powers = powers(&binned(rows, [low, high]), HALF_CYCLES_LEAST, step, count);
    let waves = (HALF_CYCLES_LEAST..=count).map(|k| step * k as f64).zip(powers);
    waves.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(cycles, _)| cycles)
}

/// Rows `(q, r)` binned on a grid over the span if there are more than [`BINS`]; each row is distributed to its two neighbouring grid points by
/// linear weights.
fn binned(rows: Vec<(f64, f64)>, [low, high]: [f64; 2]) -> Vec<(f64, f64)> {
    if rows.len() <= BINS {
        return rows;
    }
    let step = (high - low) / (BINS - 1) as f64;
    let mut places: Vec<(f64, f64)> = (0..BINS).map(|k| (low + step * k as f64, 0.0)).collect();
    for (q, rest) in rows {
        let position = ((q - low) / step).clamp(0.0, (BINS - 1) as f64);
        let below = (position as usize).min(BINS - 2);
        let share = position - below as f64;
        places[below].1 += (1.0 - share) * rest;
        places[below + 1].1 += share * rest;
    }
    places
}

/// `|Σ r e^{i k step q}|²` of rows `(q, r)` for `k` from `from` to `to`, by rotating each phasor by one step (no sine per wave).
fn powers(rows: &[(f64, f64)], from: usize, step: f64, to: usize) -> Vec<f64> {
    let mut sums: Vec<(f64, f64)> = (from..=to).map(|_| (0.0, 0.0)).collect();
    for piece in rows.chunks(ROWS_PER_BLOCK) {
        let mut piece = piece.to_vec();
        piece.resize(piece.len().next_multiple_of(LANES), (0.0, 0.0));
        let phasors = |cycles: f64| -> (Vec<f64>, Vec<f64>) {
            piece.iter().map(|(q, _)| libm::sincos(cycles * q)).unzip()
        };
        let rests: Vec<f64> = piece.iter().map(|(_, rest)| *rest).collect();
        let ((mut sines, mut cosines), (by_sine, by_cosine)) =
            (phasors(step * from as f64), phasors(step));
        for sum in &mut sums {
            let (mut of_sine, mut of_cosine) = ([0.0; LANES], [0.0; LANES]);
            let (sines, _) = sines.as_chunks_mut::<LANES>();
            let (cosines, _) = cosines.as_chunks_mut::<LANES>();
            let by = by_sine.as_chunks::<LANES>().0.iter().zip(by_cosine.as_chunks::<LANES>().0);
            let rests = rests.as_chunks::<LANES>().0;
            for (((sine, cosine), (s, c)), rest) in sines.iter_mut().zip(cosines).zip(by).zip(rests)
            {
                for k in 0..LANES {
                    of_sine[k] += rest[k] * sine[k];
                    of_cosine[k] += rest[k] * cosine[k];
                    (sine[k], cosine[k]) =
                        (sine[k] * c[k] + cosine[k] * s[k], cosine[k] * c[k] - sine[k] * s[k]);
                }
            }
            sum.0 += of_sine.iter().sum::<f64>();
            sum.1 += of_cosine.iter().sum::<f64>();
        }
    }
    sums.into_iter().map(|(sine, cosine)| sine * sine + cosine * cosine).collect()
}

/// A search over the library in its present state.
pub(super) fn search<'a>(
    case: &'a Case,
    products: &'a NormalEquations,
    always: &'a [usize],
) -> TermSearch<'a> {
    TermSearch { library: &case.library, products, always }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shortest_wave_keeps_its_height_where_rows_are_gathered_at_places() {
        let step = 0.5 * TAU;
        let wave = |k: u32| {
            let q = f64::from(k) / 19_999.0;
            (q, libm::sin(step * HALF_CYCLES_MOST as f64 * q + 0.3))
        };
        let rows: Vec<(f64, f64)> = (0..20_000).map(wave).collect();
        let places = binned(rows.clone(), [0.0, 1.0]);
        assert_eq!(places.len(), BINS);
        let height =
            |rows: &[(f64, f64)]| powers(rows, HALF_CYCLES_MOST, step, HALF_CYCLES_MOST)[0].sqrt();
        let share = height(&places) / height(&rows);
        assert!((0.98..1.0).contains(&share), "{share}");
    }
}
