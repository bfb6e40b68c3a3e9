//! Thermal input: a temperature (or spindle speed) with a first-order lag, or the time since the start.
//!
//! `level = k x̃`, `dx̃/dt = (x − x̃)/lag`, x: `T − T₀` in K or the speed in rev/min, held between samples; or `A (1 − e^(−t/t₀))`.
//! An unknown input (NaN) has no effect or, with a lag, keeps the last state. The file states which
//! of the two laws applies.
//!
//! Memory: `[x̃, dx̃/dlag, 1 once x was known]`.

use crate::effect::{BuildContext, BuildError, Memory};
use crate::signals::Inputs;
use crate::spec::{Parameter, Range, Unit};
use libm::exp;

/// First-order lag, s.
pub(crate) const LAG: Parameter =
    Parameter::nonlinear("lag", Unit::Second, Range::NotNegative).optional();
/// Time constant of a warm-up, s.
pub(crate) const TIME_CONSTANT: Parameter =
    Parameter::nonlinear("time_constant", Unit::Second, Range::Positive).optional();
/// Temperature at which the geometry is nominal, °C.
pub(crate) const REFERENCE: Parameter = Parameter::setting("reference", Unit::Celsius, Range::Any);

/// Default of [`REFERENCE`].
pub(crate) const REFERENCE_C: f64 = 20.0;

/// The thermal input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ThermalInput {
    /// A joint's own temperature, or the ambient one.
    Joint(usize),
    /// The ambient temperature.
    Ambient,
    /// The spindle's speed.
    Spindle,
    /// Time since the start.
    WarmUp,
}

/// A thermal law; the effect keeps its two values: amount per unit of input and lag, or amplitude
/// and time constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ThermalLaw {
    pub(crate) cause: ThermalInput,
    /// How many of the effect's two values were given: a missing lag is zero.
    pub(crate) count: usize,
    reference_celsius: f64,
}

impl ThermalLaw {
    pub(crate) fn new(site: &BuildContext<'_>, cause: ThermalInput) -> Self {
        let both = cause == ThermalInput::WarmUp || site.optional_value("lag").is_some();
        let reference_celsius = site.optional_value("reference").unwrap_or(REFERENCE_C);
        Self { cause, count: if both { 2 } else { 1 }, reference_celsius }
    }

    /// The law of an effect of a joint: `per_kelvin` with `lag`, or `amplitude` with `time_constant`.
    pub(crate) fn of_joint(
        site: &BuildContext<'_>,
        per_kelvin: &str,
    ) -> Result<(Self, [f64; 2]), BuildError> {
        let given = |stem| site.optional_value(stem).is_some();
        let by_temperature = given(per_kelvin);
        let by_time = given("amplitude") && given("time_constant");
        let mixed = given("amplitude") || given("time_constant");
        match (by_temperature, by_time) {
            (true, false) if !mixed => Ok((
                Self::new(site, ThermalInput::Joint(site.joint)),
                [site.one(per_kelvin), site.one("lag")],
            )),
            (false, true) if !given("lag") => {
                let values = [site.one("amplitude"), site.one("time_constant")];
                Ok((Self::new(site, ThermalInput::WarmUp), values))
            }
            _ => Err(BuildError::Combination(
                "either an amount per kelvin (with `lag`), or `amplitude` with `time_constant`",
            )),
        }
    }

    /// The present level.
    pub(crate) fn response(&self, values: [f64; 2], inputs: &Inputs, memory: &Memory) -> f64 {
        values[0] * self.slope([1.0, values[1]], 0, inputs, memory)
    }

    /// Derivative of the level by value `k`.
    pub(crate) fn slope(
        &self,
        values: [f64; 2],
        k: usize,
        inputs: &Inputs,
        memory: &Memory,
    ) -> f64 {
        let [amount, time] = values;
        if self.cause == ThermalInput::WarmUp {
            let passed = inputs.time_s.max(0.0) / time;
            let rest = exp(-passed);
            return if k == 0 { 1.0 - rest } else { -amount * rest * passed / time };
        }
        let [followed, by_lag, known, _] = memory.0;
        let lags = time > 0.0 && known != 0.0;
        match k {
            0 if lags => followed,
            0 => Some(self.input(inputs)).filter(|x| !x.is_nan()).unwrap_or(0.0),
            _ if lags => amount * by_lag,
            _ => 0.0,
        }
    }

    /// Thermal equilibrium: the lag has decayed.
    pub(crate) fn settle(&self, inputs: &Inputs, memory: &mut Memory) {
        let x = self.input(inputs);
        *memory = if x.is_nan() { Memory::default() } else { Memory([x, 0.0, 1.0, 0.0]) };
    }

    /// Advances by one sample.
    pub(crate) fn advance(&self, values: [f64; 2], inputs: &Inputs, memory: &mut Memory) {
        let (x, lag) = (self.input(inputs), values[1]);
        let [followed, by_lag, known, _] = memory.0;
        if x.is_nan() {
            return;
        }
        if known == 0.0 || lag <= 0.0 {
            return self.settle(inputs, memory);
        }
        let passed = inputs.dt_s.max(0.0) / lag;
        let (gap, rest) = (followed - x, exp(-passed));
        memory.0 = [x + gap * rest, (by_lag + gap * passed / lag) * rest, 1.0, 0.0];
    }

    fn input(&self, inputs: &Inputs) -> f64 {
        match self.cause {
            ThermalInput::Joint(joint) => inputs.celsius(joint) - self.reference_celsius,
            ThermalInput::Ambient => inputs.ambient_celsius - self.reference_celsius,
            ThermalInput::Spindle => inputs.spindle_rpm,
            ThermalInput::WarmUp => f64::NAN,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::effects::AnyEffect;
    use crate::effects::conformance::scene;
    use crate::{Arm, Inputs, Memories, Model, ParameterValues};

    fn drifting(arm: Arm, given: &[(&str, &[f64])]) -> Model {
        let effect =
            AnyEffect::build("thermal_zero", &arm, Some(1), ParameterValues(given)).expect("sound");
        Model::new(arm, &[effect]).expect("one effect")
    }

    fn drift(model: &Model, inputs: &Inputs, memories: &Memories) -> f64 {
        model.evaluate(inputs, memories).deviation.joints[1]
    }

    #[test]
    fn a_lagging_zero_has_followed_63_percent_of_a_step_after_its_lag_in_any_sampling() {
        let scene = scene();
        let model = drifting(scene.arm, &[("drift", &[1e-5]), ("lag", &[600.0])]);
        for samples in [1, 60] {
            let mut inputs = Inputs { ambient_celsius: 20.0, ..scene.inputs };
            let mut memories = Memories::default();
            model.settle(&inputs, &mut memories);
            assert_eq!(drift(&model, &inputs, &memories), 0.0);
            (inputs.ambient_celsius, inputs.dt_s) = (30.0, 600.0 / f64::from(samples));
            (0..samples).for_each(|_| model.advance(&inputs, &mut memories));
            let wanted = 1e-4 * (1.0 - f64::exp(-1.0));
            assert!((drift(&model, &inputs, &memories) - wanted).abs() < 1e-16);
        }
    }

    #[test]
    fn a_lag_continues_over_settled_poses_and_restarts_where_time_does() {
        let scene = scene();
        let model = drifting(scene.arm, &[("drift", &[1e-5]), ("lag", &[600.0])]);
        let mut inputs = Inputs { ambient_celsius: 20.0, dt_s: 0.0, ..scene.inputs };
        let mut memories = Memories::default();
        model.settle_pose(&inputs, &mut memories);
        (inputs.ambient_celsius, inputs.dt_s) = (30.0, 600.0);
        model.settle_pose(&inputs, &mut memories);
        let wanted = 1e-4 * (1.0 - f64::exp(-1.0));
        assert!((drift(&model, &inputs, &memories) - wanted).abs() < 1e-16);
        inputs.dt_s = 0.0;
        model.settle_pose(&inputs, &mut memories);
        assert!((drift(&model, &inputs, &memories) - 1e-4).abs() < 1e-16);
    }

    #[test]
    fn a_temperature_that_went_missing_is_held_and_one_never_known_does_nothing() {
        let scene = scene();
        let model = drifting(scene.arm, &[("drift", &[1e-5]), ("lag", &[600.0])]);
        let mut memories = Memories::default();
        let lost = Inputs { ambient_celsius: f64::NAN, dt_s: 60.0, ..scene.inputs };
        assert_eq!(drift(&model, &lost, &memories), 0.0);
        model.settle(&scene.inputs, &mut memories);
        model.advance(&lost, &mut memories);
        assert!((drift(&model, &lost, &memories) - 7e-5).abs() < 1e-18);
    }

    #[test]
    fn a_warm_up_starts_at_nothing_and_ends_at_its_amplitude() {
        let scene = scene();
        let model = drifting(scene.arm, &[("amplitude", &[2e-4]), ("time_constant", &[900.0])]);
        for (time_s, share) in [(0.0, 0.0), (900.0, 1.0 - f64::exp(-1.0)), (1e6, 1.0)] {
            let inputs = Inputs { time_s, ..scene.inputs };
            let found = drift(&model, &inputs, &Memories::default());
            assert!((found - 2e-4 * share).abs() < 1e-18, "{found} at {time_s} s");
        }
    }

    #[test]
    fn two_laws_at_once_are_refused() {
        let arm = scene().arm;
        for given in [
            &[("drift", [1e-5].as_slice()), ("amplitude", &[1e-4])][..],
            &[("amplitude", &[1e-4])],
            &[("time_constant", &[900.0])],
            &[("amplitude", &[1e-4]), ("time_constant", &[900.0]), ("lag", &[1.0])],
            &[],
        ] {
            assert!(
                AnyEffect::build("thermal_zero", &arm, Some(1), ParameterValues(given)).is_err()
            );
        }
    }
}
