//! Parameters of findings: their form and uncertainty.

use physics::JointKind;

use super::*;
use crate::engine::dictionary::{CandidateTerm, CoefficientForm};
use crate::engine::validation::significant;
use crate::torque::motion::Motion;
use crate::torque::{final_checks, finish, fit_quality};

#[test]
fn a_stated_number_far_off_its_doubt_is_told_where_what_stood_for_it_fell() {
    let force = |[_, v, a]: [f64; 3]| MASS * a + 22.0 * v.signum();
    let arm = slider(true);
    let dry = effect(&arm, "coulomb_friction", &[("level", &[20.0])]);
    let model = Model::new(arm, &[dry]).unwrap();
    for (sigma, expected) in [(0.1, Some("coulomb_friction")), (2.0, None)] {
        let sigma = [vec![sigma]];
        let stated = StatedModel { model: &model, sigma: &sigma, delay_s: 0.0 };
        let made = recording(JointKind::Prismatic, 1.0, force);
        let mut case = Case::new(&stated, &[made], None, 1);
        case.estimate_noise();
        case.ignore_autocorrelation();
        let fitted_rows = case.row_sets.fitted();
        let products = case.products(&fitted_rows);
        let search = nonlinear_parameters::search(&case, &products, &case.always_fitted);
        let name = final_checks::contradicted_parameter(&case, &search, &[], &fitted_rows);
        assert_eq!(name.map(|name| case.library.terms[name].kind), expected);
    }
}

#[test]
fn the_only_joint_is_told_its_gravity_as_sine_and_cosine() {
    let arm = pendulum();
    let gravity = effect(&arm, "gravity_torque", &[("cos", &[0.5]), ("sin", &[0.8])]);
    let made = driven(&arm, &[gravity], JointKind::Revolute, 0.02);
    let model = Model::new(arm, &[]).unwrap();
    let stated = StatedModel { model: &model, sigma: &[], delay_s: 0.0 };
    let case = Case::new(&stated, std::slice::from_ref(&made), None, 1);
    let is_moment = |family: &CandidateTerm| family.form == CoefficientForm::Moment;
    assert!(!case.library.terms.iter().any(is_moment), "a moment of the body says the same");
    let found = of(&arm, &[], made);
    let stems: Vec<&str> = found.findings[0].parameters.iter().map(|number| number.stem).collect();
    assert_eq!(stems, ["cos", "sin"], "{:?}", found.findings);
    assert_near(&found, "gravity_torque", 0.5, 0.02);
}

#[test]
fn a_small_second_number_of_a_name_is_told_and_bends_the_first_no_more() {
    let force = |[_, v, a]: [f64; 3]| MASS * a + 4.0 - 0.3 * v.abs();
    let found = of(&slider(true), &[], recording(JointKind::Prismatic, 1.0, force));
    let [one] = &found.findings[..] else { panic!("{:?}", found.findings) };
    for (number, truth) in one.parameters.iter().zip([4.0, -0.3]) {
        let (value, sigma) = (number.values[0], number.sigma[0]);
        assert!((value - truth).abs() < 3.0 * sigma, "{:?}", one.parameters);
    }
    assert_eq!(one.parameters.len(), 2);
}

#[test]
fn where_warmth_bends_friction_its_number_is_told_with_the_slope_at_the_bend() {
    let force = |[_, v, a]: [f64; 3]| MASS * a + 150.0 * v;
    let arm = slider(true);
    let viscous = effect(&arm, "viscous_friction", &[("coefficient", &[150.0])]);
    let mut made = recording(JointKind::Prismatic, 0.5, force);
    let warm: Vec<f64> = made.t_s.iter().map(|t| 20.0 + 15.0 * t / 40.0).collect();
    let cooled = |(torque, (t, celsius)): (&f64, (&f64, &f64))| {
        torque + 150.0 * motion(*t)[1] * libm::expm1(-0.1 * (celsius - 20.0))
    };
    let torques = made.column(Channel::Torque(0)).unwrap().to_vec();
    let torques = torques.iter().zip(made.t_s.iter().zip(&warm)).map(cooled).collect();
    made.set(Channel::Torque(0), torques);
    made.set(Channel::Ambient, warm);
    let model = Model::new(arm, &[viscous]).unwrap();
    let stated = StatedModel { model: &model, sigma: &[vec![0.0]], delay_s: 0.0 };
    let mut case = Case::new(&stated, &[made], None, 1);
    case.estimate_noise();
    case.ignore_autocorrelation();
    let mut families = case.library.terms.iter();
    let name = families.position(|f| f.kind == "friction_temperature").unwrap();
    let fitted_rows = case.row_sets.fitted();
    nonlinear_parameters::fit_temperature_coefficients(
        &mut case,
        &[name],
        &[],
        &fitted_rows,
        &|_| 150.0,
    );
    let products = case.products(&fitted_rows);
    let selection = nonlinear_parameters::search(&case, &products, &[]).solve(&[name]);
    let flat = fit_quality::covariance(&case, &selection.solved, &fitted_rows)[(0, 0)];
    let (bent, _) =
        fit_quality::covariance_with_searched(&case, &selection, &fitted_rows, &|_| 150.0);
    // Once friction has nearly vanished, its decay rate is poorly determined: the column reaches 1 − e⁻¹˙⁵ and its slope falls to 1.5 e⁻¹˙⁵.
    assert!(bent[(0, 0)] > 1.5 * flat, "{bent} {flat}");
    let per_kelvin = -selection.solved.values[0] / 150.0;
    assert!((per_kelvin - 0.1).abs() < 3.0 * bent[(0, 0)].sqrt() / 150.0, "{per_kelvin}");
}

#[test]
fn what_turns_sharply_is_told_from_quicker_motion_where_rows_are_few() {
    let swing = |hz: f64, t: f64| libm::sin(std::f64::consts::TAU * hz * t);
    let motion_at = |step_s: f64| {
        let t_s: Vec<f64> = (0..4000).map(|k| step_s * f64::from(k)).collect();
        let mut made = Recording::new(t_s.clone());
        made.set_joint_kind(0, JointKind::Prismatic);
        let q = t_s.iter().map(|t| swing(0.3, *t) + 1e-3 * swing(20.0, *t)).collect();
        made.set(Channel::Motor(0), q);
        made.set(Channel::Torque(0), vec![0.0; t_s.len()]);
        Motion::of(&slider(true), 0.0, &[made], None)
    };
    let quicker = |motion: &Motion| {
        let track = &motion.runs[0].joints[0];
        let apart =
            track.wide_band_motion()[1].iter().zip(&track.v).map(|(quick, v)| (quick - v).abs());
        apart.skip(200).take(3000).fold(0.0, f64::max)
    };
    // 20 Hz at an amplitude of 1e-3 is a velocity of 0.126; a band of 12.5 Hz attenuates most of it.
    assert!(quicker(&motion_at(8e-3)) > 0.06);
    assert_eq!(quicker(&motion_at(1e-3)), 0.0);
}

#[test]
fn a_wave_so_long_that_only_its_slope_shows_has_no_height_to_tell() {
    let arm = slider(true);
    let model = Model::new(arm, &[]).unwrap();
    let stated = StatedModel { model: &model, sigma: &[], delay_s: 0.0 };
    let long = |[q, _, a]: [f64; 3]| MASS * a + 40.0 * q;
    let short = |[q, _, a]: [f64; 3]| MASS * a + 2.0 * libm::sin(60.0 * q);
    let kept = |cycles: f64, force: &dyn Fn([f64; 3]) -> f64| {
        let mut case = case(arm, 1.0, force);
        case.library.add_ripple(&case.motion, 0, cycles);
        case.ignore_autocorrelation();
        let wave = vec![case.library.terms.len() - 1];
        let fitted_rows = case.row_sets.fitted();
        let products = case.products(&fitted_rows);
        let search = nonlinear_parameters::search(&case, &products, &case.always_fitted);
        let significant_terms = significant(
            &search,
            wave.clone(),
            &|solved| fit_quality::covariance(&case, solved, &fitted_rows),
            &|_| false,
        );
        assert_eq!(significant_terms, wave, "beside a height that is known it is plain");
        finish::with_significant_size(&case, &stated, &search, wave).1.len()
    };
    assert_eq!([kept(1.0, &long), kept(60.0, &short)], [0, 1]);
}

#[test]
fn rows_more_are_as_likely_as_numbers_of_these_few_foretell_them() {
    let mut case = case(slider(true), 1.0, |[_, v, a]| MASS * a + 3.0 * v.signum());
    case.ignore_autocorrelation();
    let families = &case.library.terms;
    let dry = families.iter().find(|family| family.kind == "coulomb_friction").unwrap().columns[0];
    let (few, all) = (case.products(&case.row_sets.train), case.products(&case.row_sets.fitted()));
    let log_likelihood = all.log_marginal_likelihood(&[dry]) - few.log_marginal_likelihood(&[dry]);
    // Computed by hand for one parameter: predictive log-likelihood of additional rows under the noise and the parameter's uncertainty.
    let [one, both] = [&few, &all].map(|products| (products.gram[(dry, dry)], products.right[dry]));
    let by_hand = 0.5 * (both.1 * both.1 / both.0 - one.1 * one.1 / one.0 - (both.0 / one.0).ln());
    assert!((log_likelihood - by_hand).abs() < 1e-6 * by_hand.abs(), "{log_likelihood} {by_hand}");
    assert!(log_likelihood > 100.0, "{log_likelihood}");
    // A parameter that these rows contradict predicts them worse than none.
    let mut other = all.clone();
    other.right[dry] = 2.0 * one.1 - both.1;
    assert!(other.log_marginal_likelihood(&[dry]) - few.log_marginal_likelihood(&[dry]) < -100.0);
}
