//! The feed override on a simulated cut, `F = P (feed override)ᵐ`, with a delay of its own.

use super::*;
use physics::Wrench;
use proptest::prelude::*;
use std::collections::VecDeque;

const MS: u64 = 1_000_000;
const START_NS: u64 = 1 << 40;

fn settings() -> FeedSettings {
    FeedSettings {
        is_sent: true,
        limit: FeedLimit::Force(100.0),
        bounds: OverrideLimits::new(0.1, 2.0, 0.2).expect("good ones"),
        lost: 0.1,
        air: 1.0,
        air_n: 5.0,
        hold_s: 0.2,
        stale_s: 0.1,
        delay_s: 0.06,
        time_constant_s: 0.12,
        exponent: 1.0,
        relief: 1.25,
        rules: FeedRules::default(),
    }
}

/// A cut whose feed is controlled, at 1 kHz.
struct Bench {
    feed: Feed,
    now_ns: u64,
    /// Overrides that have not yet reached the force.
    under_way: VecDeque<f64>,
    delay_ms: usize,
    exponent: f64,
    programmed_m_s: f64,
    at_m: f64,
    force_n: f64,
    before: f64,
}

impl Bench {
    fn new(settings: FeedSettings, delay_ms: usize) -> Self {
        let feed = Feed::new(settings, true);
        let before = feed.report().feed_override;
        Self {
            feed,
            now_ns: START_NS,
            under_way: VecDeque::new(),
            delay_ms,
            exponent: settings.exponent,
            programmed_m_s: 0.02,
            at_m: 0.0,
            force_n: 0.0,
            before,
        }
    }

    /// One millisecond of a cut with this force at the programmed feed; returns the override.
    fn tick(&mut self, programmed_n: f64) -> f64 {
        let o = self.under_way.front().copied().unwrap_or(self.before);
        self.force_n = programmed_n * o.powf(self.exponent);
        self.at_m += 1e-3 * self.programmed_m_s * o;
        let force = DVec3::new(0.6, 0.0, 0.8) * self.force_n;
        let wrench = Wrench { force, ..Wrench::ZERO };
        let sample = WrenchSample { wrench, in_base: true, age_ns: 0, faulty: false };
        self.step(Some(sample), 1)
    }

    /// A cycle `ms` milliseconds after the last, with this wrench; checks bounds and rates.
    fn step(&mut self, wrench: Option<WrenchSample>, ms: u64) -> f64 {
        self.now_ns += ms * MS;
        let input = FeedInput {
            now_ns: self.now_ns,
            wrench,
            tool_m: Some(DVec3::X * self.at_m),
            compliance_m_per_n: None,
            corrects: true,
            client_override: None,
        };
        self.cycle(&input, ms)
    }

    fn cycle(&mut self, input: &FeedInput, ms: u64) -> f64 {
        let o = self.feed.step(input);
        let dt_s = 1e-3 * ms as f64;
        assert!((0.1..=1.0).contains(&o), "{o}");
        assert!(o - self.before <= 0.2 * dt_s + 1e-12, "rises from {} to {o}", self.before);
        assert!(self.before - o <= 2.0 * dt_s + 1e-12, "falls from {} to {o}", self.before);
        self.before = o;
        self.under_way.push_back(o);
        while self.under_way.len() > self.delay_ms + 1 {
            self.under_way.pop_front();
        }
        o
    }

    fn ticks(&mut self, count: usize, programmed_n: f64) -> Vec<f64> {
        (0..count).map(|_| self.tick(programmed_n)).collect()
    }
}

#[test]
fn the_force_is_kept_at_its_limit_whatever_the_depth() {
    for exponent in [1.0, 0.75] {
        let mut bench = Bench::new(FeedSettings { exponent, ..settings() }, 60);
        for programmed_n in [250.0, 500.0, 250.0, 130.0] {
            bench.ticks(8000, programmed_n);
            assert!((bench.force_n - 100.0).abs() < 0.5, "{programmed_n}: {}", bench.force_n);
            let report = bench.feed.report();
            assert_eq!((report.state, report.reason), (FeedState::Adapting, FeedReason::None));
            assert!((report.programmed_force_n - programmed_n).abs() < 0.01 * programmed_n);
            assert!((report.speed_m_s - 0.02 * bench.before).abs() < 1e-4, "{report:?}");
        }
        bench.ticks(8000, 60.0);
        assert_eq!(bench.before, 1.0, "never above the programmed feed");
        bench.ticks(8000, 5000.0);
        assert_eq!((bench.before, bench.feed.report().reason), (0.1, FeedReason::AtFloor));
    }
}

#[test]
fn a_force_far_beyond_the_limit_takes_the_override_down_at_once() {
    let mut bench = Bench::new(settings(), 60);
    bench.ticks(8000, 250.0);
    let before = bench.before;
    let after = bench.ticks(100, 1000.0);
    assert!((before - after[99] - 0.2).abs() < 5e-3, "as fast as it may: {before} {}", after[99]);
}

#[test]
fn relief_acts_at_once_however_slow_the_estimate_is() {
    let mut bench = Bench::new(FeedSettings { time_constant_s: 2.0, ..settings() }, 60);
    bench.ticks(30_000, 250.0);
    let before = bench.before;
    let after = bench.ticks(30, 400.0);
    assert!((before - after[29] - 0.06).abs() < 2e-3, "{before} {}", after[29]);
}

#[test]
fn a_change_of_the_override_does_not_change_the_estimate_of_the_cut() {
    let mut bench = Bench::new(settings(), 60);
    for ms in 0..5000 {
        bench.tick(250.0);
        let found_n = bench.feed.report().programmed_force_n;
        assert!(ms < 100 || (found_n - 250.0).abs() < 0.02 * 250.0, "{ms} ms: {found_n} N");
    }
}

/// The largest gain over all frequencies of the loop that a wrongly stated delay closes; time
/// constant and delay in stated delays.
fn largest_gain(time_constant: f64, delay: f64) -> f64 {
    let gain = |w: f64| {
        let apart = 2.0 * (0.5 * w * (delay - 1.0)).sin().abs();
        apart / (1.0 + (w * time_constant).powi(2)).sqrt()
    };
    (1..200_000).map(|k| gain(1e-3 * f64::from(k))).fold(0.0, f64::max)
}

#[test]
fn the_gain_margin_is_two_at_every_delay_up_to_twice_the_stated_one() {
    let margins: Vec<f64> = (0..=8)
        .map(|k| 1.0 / largest_gain(FEED_TIME_CONSTANT_DELAYS, 0.25 * f64::from(k)))
        .collect();
    println!(
        "T = {FEED_TIME_CONSTANT_DELAYS} delays: gain margins of at least {margins:.2?} at 0 to 2 delays"
    );
    assert!(margins.iter().all(|margin| *margin >= 2.0), "{margins:?}");
    assert!(1.0 / largest_gain(1.0, 2.0) < 2.0, "a shorter time constant would not do");
}

#[test]
fn no_delay_up_to_twice_the_stated_one_makes_it_oscillate() {
    for delay_ms in [0, 30, 60, 90, 120] {
        let mut bench = Bench::new(settings(), delay_ms);
        bench.ticks(6000, 250.0);
        // Half the depth again, below the threshold of relief: only the estimate acts.
        let after = bench.ticks(6000, 300.0);
        let lowest = after.iter().fold(1.0_f64, |lowest, o| lowest.min(*o));
        let wanted = 100.0 / 300.0;
        println!("{delay_ms} ms: undershoot {:.1} %", 100.0 * (1.0 - lowest / wanted));
        assert!(lowest > 0.9 * wanted, "{delay_ms}: {lowest}");
        let late = &after[3000..];
        assert!(late.iter().all(|o| (o - wanted).abs() < 2e-3), "{delay_ms}: {:?}", &late[..5]);
    }
}

#[test]
fn without_a_force_the_override_holds_then_goes_where_the_cell_has_set_it() {
    let mut bench = Bench::new(FeedSettings { lost: 0.3, ..settings() }, 60);
    bench.ticks(8000, 150.0);
    let held = bench.before;
    for k in 1..=1500 {
        let o = bench.step(None, 1);
        let report = bench.feed.report();
        assert_eq!(report.reason, FeedReason::NoWrench);
        if k <= 200 {
            assert_eq!((o, report.state), (held, FeedState::Holding), "{k}");
        } else {
            assert_eq!(report.state, FeedState::Lost, "{k}");
        }
    }
    assert_eq!(bench.before, 0.3);
    bench.ticks(8000, 150.0);
    assert!((bench.before - held).abs() < 1e-2, "it comes back: {}", bench.before);
}

#[test]
fn whatever_is_wrong_with_the_wrench_is_named_and_counted_where_it_is_no_number() {
    let mut bench = Bench::new(settings(), 60);
    bench.ticks(4000, 150.0);
    let good = WrenchSample {
        wrench: Wrench { force: DVec3::X * 50.0, ..Wrench::ZERO },
        in_base: true,
        age_ns: 0,
        faulty: false,
    };
    let sample_of = |force| WrenchSample { wrench: Wrench { force, ..Wrench::ZERO }, ..good };
    for (sample, reason, refused) in [
        (sample_of(DVec3::NAN), FeedReason::NotFinite, 1),
        (sample_of(DVec3::X * f64::INFINITY), FeedReason::NotFinite, 2),
        (sample_of(DVec3::X * 1e9), FeedReason::NotFinite, 3),
        (WrenchSample { faulty: true, ..good }, FeedReason::SensorFault, 3),
        (WrenchSample { age_ns: 101 * MS, ..good }, FeedReason::Stale, 3),
    ] {
        bench.step(Some(sample), 1);
        let report = bench.feed.report();
        assert_eq!((report.reason, report.refused), (reason, refused));
        assert_eq!(report.state, FeedState::Holding);
    }
}

#[test]
fn a_robot_that_stands_in_its_cut_learns_nothing_and_goes_on_as_before() {
    let mut bench = Bench::new(settings(), 60);
    bench.ticks(8000, 250.0);
    let before = bench.before;
    bench.programmed_m_s = 0.0;
    bench.ticks(20, 250.0);
    bench.ticks(3000, 1.0);
    assert_eq!(bench.feed.report().reason, FeedReason::AtRest);
    assert!((bench.before - before).abs() < 5e-3, "{before} {}", bench.before);
}

#[test]
fn in_the_air_it_rises_slowly_to_what_the_cell_allows_there() {
    let mut bench = Bench::new(FeedSettings { air: 0.6, ..settings() }, 60);
    bench.ticks(8000, 1000.0);
    let o = bench.ticks(1500, 1.0);
    assert!((o[1499] - 0.4).abs() < 0.05, "{}", o[1499]);
    bench.ticks(3000, 1.0);
    assert_eq!((bench.before, bench.feed.report().state), (0.6, FeedState::Air));
}

#[test]
fn a_deflection_limit_is_a_force_limit_by_the_compliance_and_none_without_one() {
    let limit = FeedLimit::Deflection(1e-4);
    let mut bench = Bench::new(FeedSettings { limit, ..settings() }, 60);
    let wrench = WrenchSample {
        wrench: Wrench { force: DVec3::X * 20.0, ..Wrench::ZERO },
        in_base: true,
        age_ns: 0,
        faulty: false,
    };
    for (compliance_m_per_n, limit_n) in
        [(Some(2e-6), Some(50.0)), (Some(1e-6), Some(100.0)), (None, None), (Some(f64::NAN), None)]
    {
        bench.now_ns += MS;
        let input = FeedInput {
            now_ns: bench.now_ns,
            wrench: Some(wrench),
            tool_m: Some(DVec3::ZERO),
            compliance_m_per_n,
            corrects: true,
            client_override: None,
        };
        bench.cycle(&input, 1);
        let report = bench.feed.report();
        assert_eq!(report.reason == FeedReason::NoDeflection, limit_n.is_none(), "{report:?}");
        if let Some(limit_n) = limit_n {
            assert!((report.limit_n - limit_n).abs() < 1e-9);
        }
    }
}

#[test]
fn what_is_not_sent_is_found_and_told_and_the_programmed_feed_goes_out() {
    let mut bench = Bench::new(FeedSettings { is_sent: false, ..settings() }, 60);
    assert!(bench.ticks(8000, 250.0).iter().all(|o| *o == 1.0));
    let report = bench.feed.report();
    assert_eq!(report.state, FeedState::Observing);
    assert!((report.requested - 0.4).abs() < 1e-3, "{report:?}");
}

#[test]
fn a_client_that_starts_anew_below_what_was_sent_gets_no_more_force_than_the_limit() {
    const LIMIT_N: f64 = 100.0;
    let mut bench = Bench::new(FeedSettings { limit: FeedLimit::Force(LIMIT_N), ..settings() }, 60);
    bench.ticks(20_000, 250.0);
    assert!((bench.before - 0.4).abs() < 1e-3, "settled at {}", bench.before);
    // The controller receives the client's override: from 0.1 on, at its rate.
    let mut client_override = 0.1;
    let mut in_force = VecDeque::from(vec![client_override; 61]);
    let mut most_n: f64 = 0.0;
    for _ in 0..20_000 {
        let o = in_force.pop_front().expect("61 of them");
        bench.now_ns += MS;
        bench.at_m += 1e-3 * bench.programmed_m_s * o;
        let wrench = Wrench { force: DVec3::X * 250.0 * o, ..Wrench::ZERO };
        most_n = most_n.max(250.0 * o);
        let requested = bench.feed.step(&FeedInput {
            now_ns: bench.now_ns,
            wrench: Some(WrenchSample { wrench, in_base: true, age_ns: 0, faulty: false }),
            tool_m: Some(DVec3::X * bench.at_m),
            compliance_m_per_n: None,
            corrects: true,
            client_override: Some(client_override),
        });
        client_override = requested.clamp(client_override - 2e-3, client_override + 2e-4);
        in_force.push_back(client_override);
    }
    assert!(most_n < 1.02 * LIMIT_N, "{most_n} N");
    assert!((client_override - 0.4).abs() < 1e-3, "settles at {client_override}");
}

#[test]
fn a_large_force_on_a_robot_at_rest_leaves_the_override_as_it_is() {
    let mut bench = Bench::new(settings(), 60);
    bench.ticks(20_000, 250.0);
    let held = bench.before;
    let force = DVec3::X * 5000.0;
    let wrench = WrenchSample {
        wrench: Wrench { force, ..Wrench::ZERO },
        in_base: true,
        age_ns: 0,
        faulty: false,
    };
    // The speed is measured over 10 ms.
    for _ in 0..20 {
        bench.step(Some(WrenchSample { wrench: Wrench::ZERO, ..wrench }), 1);
    }
    let before = bench.before;
    for _ in 0..1000 {
        assert_eq!(bench.step(Some(wrench), 1), before, "held at {held}");
    }
    assert_eq!(bench.feed.report().reason, FeedReason::AtRest);
}

#[test]
fn each_wrench_that_is_no_number_counts_once_and_is_stale_later() {
    let mut bench = Bench::new(settings(), 60);
    bench.ticks(100, 250.0);
    let wrench = Wrench { force: DVec3::X * f64::NAN, ..Wrench::ZERO };
    let stale_ms = (1e3 * settings().stale_s) as u64;
    for age_ms in 0..stale_ms + 50 {
        let sample = WrenchSample { wrench, in_base: true, age_ns: age_ms * MS, faulty: false };
        bench.step(Some(sample), 1);
    }
    let report = bench.feed.report();
    assert_eq!((report.refused, report.reason), (1, FeedReason::Stale));
}

fn any_force() -> impl Strategy<Value = f64> {
    prop_oneof![
        8 => 0.0..2000.0_f64,
        1 => Just(f64::NAN),
        1 => Just(f64::INFINITY),
        1 => Just(-f64::MAX),
    ]
}

proptest! {
    #[test]
    fn whatever_comes_the_override_is_a_number_within_its_bounds_and_rates(
        steps in prop::collection::vec(
            (any_force(), 0_u64..300, any::<bool>(), 0_u64..200, any_force(), any::<bool>()),
            1..200,
        ),
        limit in prop_oneof![(1.0..1000.0_f64).prop_map(FeedLimit::Force), (1e-5..1e-3_f64).prop_map(FeedLimit::Deflection)],
    ) {
        let mut bench = Bench::new(FeedSettings { limit, ..settings() }, 60);
        for (force, ms, faulty, age_ms, at_m, has) in steps {
            let wrench = Wrench { force: DVec3::X * force, ..Wrench::ZERO };
            let sample = WrenchSample { wrench, in_base: true, age_ns: age_ms * MS, faulty };
            bench.now_ns += ms * MS;
            let input = FeedInput {
                now_ns: bench.now_ns,
                wrench: Some(sample).filter(|_| has),
                tool_m: Some(DVec3::Y * at_m),
                compliance_m_per_n: Some(force * 1e-9),
                corrects: true,
            client_override: None,
            };
            bench.cycle(&input, ms);
        }
    }

    #[test]
    fn a_higher_limit_never_asks_for_less(
        forces in prop::collection::vec(6.0..500.0_f64, 50..300),
        limit in 10.0..200.0_f64,
        more in 1.0..3.0_f64,
    ) {
        // If nothing is sent, both see the same cut.
        let with_limit = |n| FeedSettings { is_sent: false, limit: FeedLimit::Force(n), ..settings() };
        let mut lower = Bench::new(with_limit(limit), 60);
        let mut higher = Bench::new(with_limit(limit * more), 60);
        for force in forces {
            lower.tick(force);
            higher.tick(force);
            let wanted = [&lower, &higher].map(|bench| bench.feed.report().requested);
            prop_assert!(wanted[1] >= wanted[0], "{wanted:?}");
        }
    }
}
