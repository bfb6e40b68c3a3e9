//! The trim in a loop with a simple simulated tool and instrument, at 1 kHz, in one axis unless said otherwise.

use super::*;
use proptest::prelude::*;
use std::collections::VecDeque;
use std::f64::consts::TAU;

const MS: u64 = 1_000_000;
const START_NS: u64 = 1_000_000 * MS;

fn settings() -> TrimSettings {
    let mut settings = TrimSettings {
        is_sent: true,
        base_from_instrument: Frame::IDENTITY,
        point_in_tool_m: DVec3::ZERO,
        latency_s: 0.02,
        interval_s: 0.01,
        reaction_s: 0.01,
        time_constant_s: 0.0,
        noise_m: 2e-5,
        jump_m: 3e-4,
        hold_s: 0.5,
        limit_m: 2e-3,
        rules: TrimRules::default(),
    };
    settings.time_constant_s = TRIM_TIME_CONSTANT_DELAYS * settings.delay_s();
    settings
}

/// A source of chance (xorshift, G. Marsaglia 2003).
struct Rng(u64);

impl Rng {
    fn unit(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.normal(), self.normal(), self.normal())
    }
}

/// An instrument and a tool with their true properties, which may differ from the stated ones.
struct Bench {
    trim: Trim,
    rng: Rng,
    now_ns: u64,
    /// Tool positions sent in the last `reaction_ms`, oldest first.
    sent: VecDeque<DVec3>,
    reaction_ms: usize,
    latency_ms: u64,
    interval_ms: u64,
    /// How much the stamps are too late, ms.
    stamped_late_ms: i64,
    noise_m: f64,
    dropouts: f64,
    jumps: f64,
    is_blind: bool,
    corrects: bool,
    under_way: VecDeque<(u64, PointSample)>,
    /// Displacement of the instrument, m.
    shift_m: DVec3,
}

impl Bench {
    fn new(settings: TrimSettings) -> Self {
        Self {
            trim: Trim::new(settings),
            rng: Rng(0x9e37_79b9),
            now_ns: START_NS,
            sent: VecDeque::new(),
            reaction_ms: 10,
            latency_ms: 20,
            interval_ms: 10,
            stamped_late_ms: 0,
            noise_m: 0.0,
            dropouts: 0.0,
            jumps: 0.0,
            is_blind: false,
            corrects: true,
            under_way: VecDeque::new(),
            shift_m: DVec3::ZERO,
        }
    }

    /// With a delay of `times` the stated one; the stamps do not show it.
    fn delayed(settings: TrimSettings, times: f64) -> Self {
        let mut bench = Self::new(settings);
        let more_ms = (1e3 * settings.delay_s() * (times - 1.0)).round() as i64;
        bench.stamped_late_ms = more_ms;
        bench.latency_ms = bench.latency_ms.saturating_add_signed(more_ms);
        if more_ms < -20 {
            let at_once = (more_ms + 20).unsigned_abs() as usize;
            bench.reaction_ms = bench.reaction_ms.saturating_sub(at_once);
        }
        bench
    }

    /// A typical instrument: 0.02 mm of noise, 10 % dropouts, jumps of 1 mm.
    fn stated() -> Self {
        Self { noise_m: 2e-5, dropouts: 0.1, jumps: 0.02, ..Self::new(settings()) }
    }

    /// One cycle with the tool commanded to `path_m` and a model error of `error_m`; returns the
    /// distance of the tool from its path.
    fn cycle(&mut self, path_m: DVec3, error_m: DVec3) -> DVec3 {
        self.now_ns += MS;
        let now_ns = self.now_ns;
        while self.under_way.front().is_some_and(|(at_ns, _)| *at_ns <= now_ns) {
            let (_, sample) = self.under_way.pop_front().expect("just seen");
            self.trim.add_measurement(&sample, now_ns);
        }
        let sent_m = path_m + self.trim.step(now_ns, self.corrects);
        self.trim.store_prediction(now_ns, Some(&Frame::translation(sent_m)));
        self.sent.push_back(sent_m);
        while self.sent.len() > self.reaction_ms + 1 {
            self.sent.pop_front();
        }
        let tool_m = *self.sent.front().expect("sent just now") + error_m;
        if (now_ns / MS).is_multiple_of(self.interval_ms) {
            self.measure(tool_m);
        }
        tool_m
    }

    fn measure(&mut self, tool_m: DVec3) {
        let lost = self.is_blind || self.rng.unit() < self.dropouts;
        let jumps = self.rng.unit() < self.jumps;
        let jump_m = if jumps { self.rng.vector().normalize_or_zero() * 1e-3 } else { DVec3::ZERO };
        let noise_m = self.noise_m * self.rng.vector();
        if lost {
            return;
        }
        let t_ns = self.now_ns.saturating_add_signed(self.stamped_late_ms * MS as i64);
        let point_m = tool_m + noise_m + jump_m + self.shift_m;
        let arrives_ns = self.now_ns + self.latency_ms * MS;
        self.under_way.push_back((arrives_ns, PointSample { point_m, t_ns }));
    }

    /// At rest for `ms` milliseconds with a constant error of the model along x; returns the tool's
    /// error along x at each millisecond.
    fn rest(&mut self, ms: u64, error_m: f64) -> Vec<f64> {
        (0..ms).map(|_| self.cycle(DVec3::ZERO, DVec3::X * error_m).x).collect()
    }

    fn state_and_reason(&self) -> (TrimState, TrimReason) {
        (self.trim.report().state, self.trim.report().reason)
    }
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most: f64, x| most.max(x.abs()))
}

#[derive(Clone, Copy)]
struct Complex(f64, f64);

impl Complex {
    fn turn(angle: f64) -> Self {
        Self(angle.cos(), angle.sin())
    }
    fn times(self, by: Self) -> Self {
        Self(self.0 * by.0 - self.1 * by.1, self.0 * by.1 + self.1 * by.0)
    }
    fn over(self, by: Self) -> Self {
        let square = by.0 * by.0 + by.1 * by.1;
        self.times(Self(by.0 / square, -by.1 / square))
    }
}

/// Gain margin of the loop by its frequency response, with a time constant and a true delay in
/// stated delays: the observer subtracts from the measurement what was sent one stated delay ago.
fn gain_margin(time_constant: f64, delay: f64) -> f64 {
    let response = |w: f64| {
        let pole = Complex(1.0, w * time_constant / 2.0);
        let filter = Complex(1.0, 0.0).over(pole.times(pole));
        let known = filter.times(Complex::turn(-w));
        let inner = Complex(1.0 - known.0, -known.1);
        filter.over(inner).times(Complex::turn(-w * delay))
    };
    let (mut most, mut before) = (0.0_f64, response(1e-3));
    for k in 2..200_000 {
        let current = response(1e-3 * f64::from(k));
        if before.1 * current.1 < 0.0 && current.0 < 0.0 {
            most = most.max(-current.0);
        }
        before = current;
    }
    1.0 / most
}

#[test]
fn the_gain_margin_is_two_at_every_delay_up_to_twice_the_stated_one() {
    for time_constant in [2.0, TRIM_TIME_CONSTANT_DELAYS] {
        let margins: Vec<f64> =
            (0..=8).map(|k| gain_margin(time_constant, 0.25 * f64::from(k))).collect();
        println!("T = {time_constant} delays: gain margins {margins:.2?} at 0 to 2 delays");
        let smallest = margins.iter().fold(f64::INFINITY, |smallest, x| smallest.min(*x));
        assert!(
            smallest >= if time_constant == TRIM_TIME_CONSTANT_DELAYS { 3.6 } else { 2.0 },
            "{margins:?}"
        );
        assert!(margins[4] >= 3.6, "at the stated delay {margins:?}");
    }
    assert!(gain_margin(1.0, 2.0) < 2.0, "a shorter time constant would not do");
}

#[test]
fn a_static_error_is_gone_within_two_seconds_by_an_instrument_as_it_is() {
    let mut bench = Bench::stated();
    let errors = bench.rest(10_000, 1e-3);
    let after = &errors[2000..];
    println!(
        "0.02 mm noise, 10 % dropouts, jumps: {:.4} mm at most after 2 s",
        1e3 * largest(after)
    );
    assert!(largest(after) < 3e-5, "{:e}", largest(after));
    let report = bench.trim.report();
    assert!(report.measurements > 800 && report.refused > 5, "{report:?}");
    assert!((report.model_error_m.x - 1e-3).abs() < 3e-5, "{report:?}");
}

#[test]
fn no_delay_up_to_twice_the_stated_one_makes_it_oscillate() {
    for k in 0..=8 {
        let times = 0.25 * f64::from(k);
        let errors = Bench::delayed(settings(), times).rest(6000, 1e-3);
        let overshoot = errors.iter().fold(0.0_f64, |most, x| most.max(-x));
        println!("{times} of the stated delay: overshoot {:.1} %", 1e5 * overshoot);
        assert!(overshoot < 6e-5, "{times}: {overshoot:e}");
        // After an overshoot the error swings back by a negligible amount.
        let lowest = errors.iter().position(|x| -x >= overshoot).unwrap_or(0);
        let back = errors[lowest..].iter().fold(0.0_f64, |most, x| most.max(*x));
        assert!(overshoot < 1e-7 || back < 5e-6, "{times}: back to {back:e}");
        assert!(largest(&errors[3000..]) < 1e-5, "{times}");
    }
}

#[test]
fn the_error_along_a_path_is_halved_at_least() {
    let mut bench = Bench::stated();
    let (mut with, mut without) = (0.0, 0.0);
    for k in 0..30_000 {
        let t_s = f64::from(k) * 1e-3;
        // At most 100 mm/s, and an error of 0.3 mm that turns with a period of 4 s.
        let path_m = DVec3::new(0.2 * (0.5 * t_s).sin(), 0.1 * (0.5 * t_s).cos(), 0.0);
        let turn = TAU * t_s / 4.0;
        let error_m = 3e-4 * DVec3::new(turn.sin(), turn.cos(), 0.0);
        let behind_m =
            DVec3::new(0.2 * (0.5 * (t_s - 0.01)).sin(), 0.1 * (0.5 * (t_s - 0.01)).cos(), 0.0);
        let left = (bench.cycle(path_m, error_m) - behind_m).length();
        if k >= 4000 {
            with += left * left;
            without += error_m.length_squared();
        }
    }
    let share = (with / without).sqrt();
    println!("path error {share:.2} of what it is without the trim");
    assert!(share < 0.5, "{share}");
}

#[test]
fn noise_leaves_in_the_trim_what_its_formula_says() {
    let mut bench = Bench { noise_m: 2e-5, ..Bench::new(settings()) };
    bench.rest(3000, 0.0);
    let values = bench.rest(200_000, 0.0);
    let found = (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt();
    let wanted = settings().trim_noise_m();
    println!("noise in the trim {:.2} µm, by the formula {:.2} µm", 1e6 * found, 1e6 * wanted);
    assert!((found / wanted - 1.0).abs() < 0.2, "{found:e} {wanted:e}");
}

#[test]
fn nothing_winds_up_while_the_trim_is_not_sent_or_is_bounded() {
    let mut bench = Bench { corrects: false, ..Bench::new(settings()) };
    assert!(bench.rest(60_000, 1e-3).iter().all(|x| *x == 1e-3), "shadow sends nothing");
    assert_eq!(bench.state_and_reason(), (TrimState::Observing, TrimReason::None));
    assert!((bench.trim.report().model_error_m.x - 1e-3).abs() < 1e-9);
    bench.corrects = true;
    let errors = bench.rest(2000, 1e-3);
    assert!(errors.iter().all(|x| *x > -1e-6), "no overshoot after a minute of shadow");
    assert!(largest(&errors[1200..]) < 1e-6);

    let mut bounded = Bench::new(TrimSettings { limit_m: 5e-4, ..settings() });
    let errors = bounded.rest(60_000, 1.5e-3);
    assert!((errors[59_999] - 1e-3).abs() < 1e-9, "the bound, and the rest is left");
    assert_eq!(bounded.state_and_reason(), (TrimState::Trimming, TrimReason::Bounded));
    // The error disappears in increments smaller than a jump: the trim follows at once.
    for k in 0..1500_u32 {
        bounded.cycle(DVec3::ZERO, DVec3::X * (1.5e-3 - 1e-6 * f64::from(k)));
    }
    assert!(largest(&bounded.rest(2000, 0.0)[1200..]) < 1e-6);
}

#[test]
fn a_lost_beam_holds_then_ramps_out_and_its_return_ramps_in() {
    let mut bench = Bench::new(settings());
    bench.rest(3000, 1e-3);
    assert_eq!(bench.state_and_reason(), (TrimState::Trimming, TrimReason::None));
    bench.is_blind = true;
    let errors = bench.rest(450, 1e-3);
    assert!(largest(&errors) < 1e-6, "it holds");
    assert_eq!(bench.state_and_reason(), (TrimState::Holding, TrimReason::NoMeasurement));
    let out = bench.rest(300, 1e-3);
    assert_eq!(bench.state_and_reason(), (TrimState::Ramping, TrimReason::NoMeasurement));
    let without_beam = bench.rest(1000, 1e-3);
    assert_eq!(bench.state_and_reason(), (TrimState::Waiting, TrimReason::NoMeasurement));
    assert_eq!(without_beam[999], 1e-3, "nothing is trimmed");
    bench.is_blind = false;
    let back = bench.rest(2000, 1e-3);
    assert_eq!(bench.state_and_reason(), (TrimState::Trimming, TrimReason::None));
    assert!(largest(&back[1500..]) < 1e-6);
    let all = [errors, out, without_beam, back].concat();
    let step = all.windows(2).fold(0.0_f64, |most, two| most.max((two[1] - two[0]).abs()));
    assert!(step < 2e-6, "1 mm in a second, no step: {step:e}");
}

#[test]
fn an_instrument_that_jumps_is_not_followed_but_named_until_it_is_looked_after() {
    let mut bench = Bench::new(settings());
    bench.rest(3000, 1e-3);
    bench.shift_m = DVec3::Y * 1e-3;
    assert!(largest(&bench.rest(400, 1e-3)) < 1e-6, "it holds");
    assert_eq!(bench.state_and_reason(), (TrimState::Holding, TrimReason::Jumped));
    bench.rest(10_000, 1e-3);
    assert_eq!(bench.state_and_reason(), (TrimState::Waiting, TrimReason::Jumped));
    assert_eq!(bench.trim.report().trim_m, DVec3::ZERO);
    bench.trim.rearm();
    bench.rest(3000, 1e-3);
    assert_eq!(bench.state_and_reason(), (TrimState::Trimming, TrimReason::None));
    assert!((bench.trim.report().trim_m.y + 1e-3).abs() < 1e-6, "the new registration is right");
    bench.shift_m = DVec3::ZERO;
    bench.rest(200, 1e-3);
    bench.shift_m = DVec3::Y * 1e-3;
    bench.rest(400, 1e-3);
    assert_eq!(
        bench.state_and_reason().0,
        TrimState::Trimming,
        "one that comes back is believed again"
    );
}

#[test]
fn observing_finds_the_error_and_sends_nothing() {
    let mut bench = Bench::new(TrimSettings { is_sent: false, ..settings() });
    assert!(bench.rest(3000, 1e-3).iter().all(|x| *x == 1e-3));
    assert_eq!(bench.state_and_reason(), (TrimState::Observing, TrimReason::None));
    assert!((bench.trim.report().model_error_m.x - 1e-3).abs() < 1e-6);
}

#[test]
fn another_model_begins_anew() {
    let mut bench = Bench::new(settings());
    bench.rest(3000, 1e-3);
    bench.trim.model_changed();
    bench.trim.step(bench.now_ns + MS, true);
    assert_eq!(
        (bench.trim.report().trim_m, bench.state_and_reason().0),
        (DVec3::ZERO, TrimState::Waiting)
    );
}

#[test]
fn a_measurement_that_makes_no_sense_is_refused_by_name_and_changes_nothing() {
    let mut bench = Bench::new(settings());
    bench.rest(3000, 1e-3);
    let before = *bench.trim.report();
    let now_ns = bench.now_ns;
    let sound = PointSample { point_m: DVec3::X * 1e-3, t_ns: now_ns - 5 * MS };
    let cases = [
        (PointSample { point_m: DVec3::splat(f64::NAN), ..sound }, TrimReason::NotFinite),
        (PointSample { point_m: DVec3::X * f64::INFINITY, ..sound }, TrimReason::NotFinite),
        (PointSample { point_m: DVec3::X * 1e4, ..sound }, TrimReason::NotFinite),
        (PointSample { t_ns: now_ns + 6 * MS, ..sound }, TrimReason::Ahead),
        (PointSample { t_ns: now_ns - 900 * MS, ..sound }, TrimReason::OutOfOrder),
        (PointSample { t_ns: 0, ..sound }, TrimReason::OutOfOrder),
    ];
    for (k, (sample, reason)) in (1..).zip(cases) {
        bench.trim.add_measurement(&sample, now_ns);
        let refused = bench.trim.report().refused - before.refused;
        assert_eq!((bench.trim.last_refusal, refused), (reason, k));
    }
    bench.now_ns += 100 * MS;
    bench.trim.add_measurement(&sound, bench.now_ns);
    assert_eq!(bench.trim.last_refusal, TrimReason::Late, "105 ms old, 20 ms are stated");
    let mut idle = Trim::new(settings());
    idle.add_measurement(&sound, now_ns);
    assert_eq!(idle.last_refusal, TrimReason::NotPredicted);
    bench.trim.step(bench.now_ns, true);
    assert_eq!(bench.trim.report().trim_m, before.trim_m);
}

#[test]
fn after_a_refused_measurement_an_interrupted_beam_is_reported_as_no_measurement() {
    let mut bench = Bench::new(settings());
    bench.rest(3000, 1e-3);
    let late = PointSample { point_m: DVec3::X * 1e-3, t_ns: bench.now_ns - MS };
    bench.now_ns += 100 * MS;
    bench.trim.add_measurement(&late, bench.now_ns);
    bench.trim.step(bench.now_ns, true);
    assert_eq!(bench.state_and_reason(), (TrimState::Holding, TrimReason::Late));
    for _ in 0..40 {
        bench.now_ns += MS;
        bench.trim.step(bench.now_ns, true);
    }
    assert_eq!(bench.state_and_reason(), (TrimState::Holding, TrimReason::NoMeasurement));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn whatever_the_delay_and_the_instrument_the_trim_is_bounded_slow_and_settles(
        times in 0.0..2.0_f64,
        dropouts in 0.0..0.5_f64,
        jumps in 0.0..0.1_f64,
        error_mm in -3.0..3.0_f64,
        seed in 1..u64::MAX,
    ) {
        let mut bench = Bench::delayed(settings(), times);
        (bench.dropouts, bench.jumps, bench.noise_m) = (dropouts, jumps, 2e-5);
        bench.rng = Rng(seed);
        let mut before = DVec3::ZERO;
        let mut late = Vec::new();
        for k in 0..8000_u32 {
            bench.cycle(DVec3::ZERO, DVec3::X * error_mm * 1e-3);
            let trim_m = bench.trim.report().trim_m;
            prop_assert!(trim_m.length() <= 2e-3 * (1.0 + 1e-12));
            prop_assert!((trim_m - before).length() < 4e-5, "{}", (trim_m - before).length());
            before = trim_m;
            if k >= 5000 {
                late.push(trim_m.x);
            }
        }
        let swing = late.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b))
            - late.iter().fold(f64::INFINITY, |a, b| a.min(*b));
        prop_assert!(swing < 8e-5, "it swings by {swing:e} m");
        let wanted = (-error_mm * 1e-3).clamp(-2e-3, 2e-3);
        prop_assert!((late[2999] - wanted).abs() < 5e-5, "{} {wanted}", late[2999]);
    }
}
