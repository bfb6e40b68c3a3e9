//! Selection between similar effects.

use physics::JointKind;

use super::*;
use crate::engine::normal_equations::LeastSquaresSolution;
use crate::engine::validation::supported;
use crate::engine::{noise, regression_data};
use crate::torque::low_speed_zone::{self, Zone};
use crate::torque::{fit_quality, reopen_zones, varying_coefficients};

fn kinds(found: &Diagnosis) -> Vec<&'static str> {
    found.findings.iter().map(|finding| finding.kind).collect()
}

/// A slider whose mass and dry friction are stated.
fn known(noise: f64, lacks: impl Fn([f64; 3]) -> f64) -> Diagnosis {
    let force = |state: [f64; 3]| MASS * state[2] + 20.0 * state[1].signum() + lacks(state);
    let arm = slider(true);
    let dry = effect(&arm, "coulomb_friction", &[("level", &[20.0])]);
    of(&arm, &[dry], recording(JointKind::Prismatic, noise, force))
}

#[test]
fn rows_of_a_zone_come_back_where_a_law_would_be_lost_with_them() {
    let force =
        |[_, v, a]: [f64; 3]| MASS * a + 10.0 * v.signum() * libm::exp(-(v / 0.01) * (v / 0.01));
    let mut case = case(slider(true), 0.1, force);
    let train = case.row_sets.train.clone();
    let products = case.products(&train);
    let search = nonlinear_parameters::search(&case, &products, &[]);
    let [lost, kept] = [search.solve(&[]), search.select(&[])];
    let left = case.residual(&kept.solved, 0);
    let speeds = low_speed_zone::speeds(&case.motion, 0);
    let within: Vec<f64> =
        left.iter().zip(&speeds).filter(|(_, v)| **v < 0.02).map(|(x, _)| x * x).collect();
    let rms = libm::sqrt(within.iter().sum::<f64>() / within.len() as f64);
    let zone = Zone { joint: 0, speed_limit: 0.02, share: 0.05, residual_rms: [rms, 0.1] };
    for (selection, comes_back) in [(kept, false), (lost, true)] {
        case.table.counts[0]
            .iter_mut()
            .zip(&speeds)
            .for_each(|(c, v)| *c &= *v >= zone.speed_limit);
        let mut zones = vec![zone];
        assert_eq!(reopen_zones(&mut case, &mut zones, &selection, &train), comes_back);
        assert_eq!(zones.is_empty(), comes_back);
        assert_eq!(case.table.counts == case.table.moves, comes_back);
    }
}

#[test]
fn what_pulls_alike_everywhere_is_no_spring_though_a_little_of_it_follows_the_place() {
    let found = known(1.0, |[q, ..]| 3.0 + 0.5 * q);
    assert_eq!(kinds(&found), ["friction_asymmetry"]);
    let found = known(1.0, |[q, ..]| 3.0 + 10.0 * q);
    assert_eq!(kinds(&found), ["spring"]);
}

#[test]
fn what_fell_once_is_not_chosen_again() {
    let force = |[_, v, a]: [f64; 3]| MASS * a + 20.0 * v.signum();
    let case = case(slider(false), 1.0, force);
    let products = case.products(&case.row_sets.train);
    let search = nonlinear_parameters::search(&case, &products, &case.always_fitted);
    let best = search.select(&[]).terms[0];
    assert!(!search.select_excluding(&[], &[best]).terms.contains(&best));
}

#[test]
fn a_delay_is_no_surer_than_a_hundredth_of_a_step() {
    let force = |[_, v, a]: [f64; 3]| MASS * a + 20.0 * v.signum();
    let case = case(slider(true), 1e-6, force);
    let products = case.products(&case.row_sets.train);
    let search = nonlinear_parameters::search(&case, &products, &[]);
    let mut families = case.library.terms.iter();
    let delay = families.position(|family| family.kind == "torque_delay").unwrap();
    let solved = search.solve(&[delay]).solved;
    let used = &case.row_sets.train;
    let of_rows =
        regression_data::covariance(&case.table, &case.library.columns, &solved, used)[(0, 0)];
    let variance = fit_quality::covariance(&case, &solved, used)[(0, 0)];
    assert!(((variance - of_rows).sqrt() - 0.01 * 2e-3).abs() < 1e-9, "{variance} {of_rows}");
}

#[test]
fn no_name_falls_for_a_rival_that_alone_would_have_the_wrong_sign() {
    let case = case(slider(true), 1.0, |[_, v, a]| MASS * a - 2.0 * v.signum());
    let products = case.products(&case.row_sets.train);
    let search = nonlinear_parameters::search(&case, &products, &[]);
    let find = |kind: &str| case.library.terms.iter().position(|f| f.kind == kind).unwrap();
    let (loop_, dry) = (find("hysteresis"), find("friction_asymmetry"));
    // The hysteresis alone would need a negative amplitude here; a search that prefers it without dry friction must be rejected.
    let likes = |solved: &LeastSquaresSolution| solved.columns.len() as f64;
    let (names, refuted) = supported(&search, vec![loop_, dry], &likes, &|_| false);
    assert!(!names.contains(&loop_) && refuted.contains(&loop_), "{names:?} {refuted:?}");
    assert_eq!(refuted[0], loop_, "the other fell first, and left what cannot be");
}

#[test]
fn a_loop_that_stood_beside_dry_friction_gives_way_to_it_when_it_stands_alone() {
    let force = |[_, v, a]: [f64; 3]| MASS * a + 20.0 * v.signum();
    let case = case(slider(false), 1.0, force);
    let products = case.products(&case.row_sets.train);
    let search = nonlinear_parameters::search(&case, &products, &case.always_fitted);
    let kind = |name: &usize| case.library.terms[*name].kind;
    let narrow = (0..case.library.terms.len()).find(|name| kind(name) == "hysteresis").unwrap();
    let renamed = search.exchanged_everywhere(search.solve(&[narrow]));
    assert_eq!(renamed.terms.iter().map(kind).collect::<Vec<_>>(), ["coulomb_friction"]);
}

#[test]
fn a_searched_number_is_told_with_its_doubt_and_leaves_the_number_beside_it_less_sure() {
    let speed = 0.05;
    let force =
        |[_, v, a]: [f64; 3]| MASS * a + 10.0 * v.signum() * libm::exp(-(v / speed) * (v / speed));
    let mut case = case(slider(true), 1.0, force);
    let fitted_rows = case.row_sets.fitted();
    let products = case.products(&fitted_rows);
    let selection = nonlinear_parameters::search(&case, &products, &[]).select(&[]);
    nonlinear_parameters::search_parameters(&mut case, &selection, &[], &fitted_rows);
    let products = case.products(&fitted_rows);
    let selection = nonlinear_parameters::search(&case, &products, &[]).solve(&selection.terms);
    let family = &case.library.terms[selection.terms[0]];
    assert_eq!((family.kind, selection.terms.len()), ("stribeck_friction", 1));
    let (covariance, spreads) =
        fit_quality::covariance_with_searched(&case, &selection, &fitted_rows, &|_| 0.0);
    let fixed = fit_quality::covariance(&case, &selection.solved, &fitted_rows);
    assert!(covariance[(0, 0)] > 1.1 * fixed[(0, 0)], "{covariance} {fixed}");
    let (found, spread) = (family.settings[0].1, spreads[0].1);
    assert!(spread > 1e-4 && spread < 0.05, "{spread}");
    assert!((found / speed - 1.0).abs() < 3.0 * spread, "{found} {spread}");
}

#[test]
fn a_law_that_makes_the_plain_error_on_unseen_rows_larger_is_none() {
    let mut case = case(slider(true), 0.01, |[_, _, a]| MASS * a);
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut slow = 0.0;
    let noise = std::iter::repeat_with(|| {
        slow = 0.998 * slow + 0.03 * rng.sample::<f64, _>(StandardNormal);
        slow
    });
    let noise: Vec<f64> = noise.take(case.table.rows()).collect();
    let held = case.row_sets.test.clone();
    case.table.noise[0] =
        noise::estimate_from_residual(&case.table, 0, &noise, &case.row_sets.fitted(), 0.0);
    // The law removes the fast part, but leaves a constant offset, which counts little against autocorrelated noise.
    let before: Vec<f64> =
        noise.iter().enumerate().map(|(k, x)| x + if k % 8 < 4 { 0.1 } else { -0.1 }).collect();
    let after = |level: f64| noise.iter().map(|x| x + level).collect::<Vec<f64>>();
    let is_law_supported =
        |level| varying_coefficients::is_supported(&case.table, 0, [&before, &after(level)], &held);
    assert!(fit_quality::is_supported(&case.table, 0, [&before, &after(1.0)], &held));
    assert!(is_law_supported(0.0) && !is_law_supported(1.0));
}
