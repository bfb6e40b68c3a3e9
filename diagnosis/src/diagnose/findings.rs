//! Names as findings: most important first, each with its numbers, their uncertainty, its rivals and what it brings on rows that no fit has seen.
//!
//! Promises: errors held out are of all findings up to this one. Never: a name more or less.

use super::judge;
use super::locate;
use super::name::{Named, without};
use super::prove::Held;
use super::{FLOOR, Finding, QUANTILE};
use crate::hypothesis::named;
use crate::result::Fit;
use physics::spec::Unit;
use physics::{AnyEffect, Model};
use std::f64::consts::TAU;

pub(super) fn findings(
    held: &Held<'_>,
    model: &Model,
    (last, uncertainty): (&Fit, &[f64]),
    all: &[Named],
    given: &Fit,
) -> Vec<Finding> {
    let mut order: Vec<&Named> = all.iter().collect();
    order.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut before = held.rms(given);
    let mut findings = Vec::new();
    let whole = &last.hypothesis.model;
    for (k, one) in order.iter().enumerate() {
        let left: Vec<&Named> = order[k + 1..].to_vec();
        let after = held.rms(&held.beside(&without(last, model, &left), last));
        let Some(effect) = last.hypothesis.model.effects().nth(one.effect).copied() else {
            continue;
        };
        let sigma = |value: usize| sigma(one, &effect, value, (last, uncertainty));
        let (confidence, shares) = judge::confidence(one, last);
        let had = one
            .stated
            .as_ref()
            .and_then(|_| Some(model.effects().nth(one.effect)?.values().to_vec()));
        let bare = without(last, model, &[one]).model;
        let seen = locate::seen(held.campaign, &last.surroundings, whole, &bare);
        findings.push(Finding {
            seen,
            sigma: (0..effect.values().len()).map(sigma).collect(),
            effect,
            place: one.effect,
            had,
            settings: one.candidate.settings.clone(),
            confidence,
            gain: one.gain,
            rivals: one.rivals.iter().cloned().zip(shares).collect(),
            heldout: [before, after],
        });
        before = after;
    }
    findings
}

/// The standard uncertainty of a value of what was named, SI; none for one that neither was fitted nor has variants.
fn sigma(
    one: &Named,
    effect: &AnyEffect,
    value: usize,
    (last, uncertainty): (&Fit, &[f64]),
) -> Option<f64> {
    let free = last.hypothesis.free.iter();
    let free = free.enumerate().find(|(_, free)| free.effect == one.effect && free.value == value);
    let fitted = free.map(|(k, free)| {
        let place = last.columns().iter().position(|column| *column == last.column_of(k));
        // What the data do not determine is as open as it was believed to be.
        let sigma = place.map_or(free.sigma, |place| uncertainty[place]);
        sigma.hypot(FLOOR * effect.values()[value])
    });
    let is_phase =
        named(effect, value).is_some_and(|named| named.parameter.unit == Unit::PhaseRadian);
    let away = |variant: &AnyEffect| {
        let away = variant.values()[value] - effect.values()[value];
        if is_phase { libm::remainder(away, TAU).abs() } else { away.abs() }
    };
    let widest = one.variants.iter().map(away).fold(0.0, f64::max) / QUANTILE;
    (fitted.is_some() || widest > 0.0).then(|| fitted.unwrap_or_default() + widest)
}
