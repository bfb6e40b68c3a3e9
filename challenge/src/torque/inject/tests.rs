//! Effects added to a synthetic recording.

use super::*;

/// 40 s of a linear axis of 90 kg with Coulomb friction and autocorrelated noise, like a real recording.
fn slide() -> PreparedRecording {
    let mut rng = Rng::new(2, 0);
    let rig = Rig::linear_axis(false, &mut rng);
    let mut memory = 0.0;
    let rows: Vec<RecordedRow> = (0..10_000)
        .map(|k| {
            let t = 4e-3 * f64::from(k);
            let waves = [(0.1, 1.1, 0.0_f64), (0.04, 2.9, 1.0), (0.02, 5.3, 0.4)];
            let sum = |f: &dyn Fn(f64, f64, f64) -> f64| {
                waves.iter().map(|(a, w, p)| f(*a, *w, w * t + p)).sum::<f64>()
            };
            let q = sum(&|a, _, x| a * x.sin());
            let v = sum(&|a, w, x| a * w * x.cos());
            let a = sum(&|a, w, x| -a * w * w * x.sin());
            memory = 0.6 * memory + 0.8 * rng.normal();
            let force = 90.0 * a + 20.0 * v.signum() + memory;
            let one = |x: f64| std::array::from_fn(|i| if i == 0 { x } else { 0.0 });
            (0, t, one((q * 1e7).round() * 1e-7), one(force))
        })
        .collect();
    PreparedRecording::of(rig, &rows).expect("a recording")
}

#[test]
fn what_was_added_is_what_the_law_says_and_shows_as_much_as_was_asked() {
    let real = slide();
    let mut rng = Rng::new(9, 1);
    let one = real.inject(Kind::ViscousFriction, 20.0, &mut rng).expect("it can be added");
    assert!((one.detectability.z - 20.0).abs() < 0.2, "{}", one.detectability.z);
    let (_, plain) = real.rows();
    for (row, (with, without)) in one.torques.iter().zip(plain).enumerate() {
        let expected = one.effect.parameters[0] * real.sampled.states[row][0][1];
        assert!((with[0] - without[0] - expected).abs() < 1e-9);
    }
}

#[test]
fn a_mass_beside_masses_that_nobody_told_cannot_be_added_so_that_it_shows() {
    let real = slide();
    let mut rng = Rng::new(9, 1);
    assert!(real.inject(Kind::Inertia, 20.0, &mut rng).is_none());
    assert!(real.inject(Kind::Payload, 20.0, &mut rng).is_none());
    assert!(real.inject(Kind::CoulombFriction, 20.0, &mut rng).is_some());
}

#[test]
fn a_delay_shifts_what_was_recorded() {
    let real = slide();
    let mut rng = Rng::new(9, 1);
    let one = real.inject(Kind::TorqueDelay, 40.0, &mut rng).expect("it can be added");
    let (late, row) = (one.effect.parameters[0], 5000);
    let (_, plain) = real.rows();
    let slope =
        (real.base_torques[row + 1][0] - real.base_torques[row - 1][0]) / (2.0 * real.step_s);
    let by = one.torques[row][0] - plain[row][0];
    assert!((by + late * slope).abs() < 0.2 * (late * slope).abs() + 1e-3, "{by} {slope}");
}
