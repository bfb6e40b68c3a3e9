//! The limiter of corrections at uneven times, by the rules for what a robot is sent ([`tests::oracle`]).
//!
//! `TRUED_LIMITER_RUNS` sets the number of runs, `TRUED_SEED` repeats them.

use envelope::{Intervals, Limiters, Limits};
use shm_schema::{JOINTS_MAX, JointBounds};
use tests::cell_loop::JOINTS;
use tests::oracle::Oracle;
use tests::rng::TestRng;
use trued_client::monotonic_ns;

const RUNS: u64 = 300;
/// Outputs of a run.
const STEPS: u64 = 3000;
const ANGLE: f64 = 0.02;
const RATE: f64 = 0.05;
const JERK: f64 = 5.0;

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().and_then(|n| n.parse().ok())
}

fn bounds() -> JointBounds {
    JointBounds {
        min: [-3.0; JOINTS_MAX],
        max: [3.0; JOINTS_MAX],
        angle: [ANGLE; JOINTS_MAX],
        rate: [RATE; JOINTS_MAX],
        jerk: [JERK; JOINTS_MAX],
    }
}

/// Corrections that are wanted: a sine of each joint, in part held, jumping, missing or noisy.
struct RequestedCorrection {
    sines: [(f64, f64); JOINTS],
    offset: [f64; JOINTS],
    held: Option<[f64; JOINTS]>,
    /// One cycle in so many brings a jump or another state.
    seldom: u64,
}

impl RequestedCorrection {
    fn new(rng: &mut TestRng) -> Self {
        let sine = |chance: &mut TestRng| {
            let rad_s = 0.2 * 60.0_f64.powf(chance.uniform());
            let most = ANGLE.min(RATE / rad_s).min(JERK / rad_s.powi(3));
            (0.4 * chance.uniform() * most, rad_s)
        };
        let sines = std::array::from_fn(|_| sine(rng));
        let seldom = [16, 40, 120][rng.below(3) as usize];
        Self { sines, offset: [0.0; JOINTS], held: None, seldom }
    }

    /// At this time, after what may happen in a cycle.
    fn at(&mut self, t_s: f64, rng: &mut TestRng) -> [f64; JOINTS] {
        let now = |joint: usize| {
            let (amplitude, rad_s) = self.sines[joint];
            self.offset[joint] + amplitude * (rad_s * t_s).sin()
        };
        let now: [f64; JOINTS] = std::array::from_fn(now);
        match rng.below(self.seldom) {
            // A jump of any size: a refusal, another model, backlash.
            0 => {
                let joint = rng.below(JOINTS as u64) as usize;
                let size = 1e-9 * 1e7_f64.powf(rng.uniform());
                self.offset[joint] = size * (rng.uniform() - 0.5);
            }
            // No answer: the last value, for a while; later on none, or the present one.
            1..3 => self.held = Some(now),
            3 => self.held = Some([0.0; JOINTS]),
            4..12 => self.held = None,
            _ => {}
        }
        self.held.unwrap_or(now)
    }
}

/// The time to the next output, ns: a cycle of 1 ms with jitter, missed cycles, two outputs at once, silences.
fn interval_ns(rng: &mut TestRng, jitter_ns: u64) -> u64 {
    let jitter = rng.below(jitter_ns + 1);
    match rng.below(100) {
        0 => 500 + rng.below(60_000),
        1..4 => 2_000_000 + jitter,
        4..7 => 1_000_000 + rng.below(18_000_000),
        7 if rng.below(8) == 0 => 25_000_000 + rng.below(50_000_000),
        _ => 1_000_000 + jitter - jitter_ns / 2,
    }
}

#[test]
fn whatever_is_wanted_and_however_uneven_the_times_the_outputs_are_judged_smooth() {
    let seed = number("TRUED_SEED").unwrap_or_else(monotonic_ns);
    let limits = Limits::new(ANGLE, RATE, JERK).expect("positive");
    for run in 0..number("TRUED_LIMITER_RUNS").unwrap_or(RUNS) {
        let mut chance = TestRng::new(seed.wrapping_add(run));
        let jitter_ns = [0, 2_000, 50_000, 500_000][chance.below(4) as usize];
        let (mut wanted, mut limiters) =
            (RequestedCorrection::new(&mut chance), Limiters::at_rest());
        let (mut intervals, mut oracle) = (Intervals::new(), Oracle::new(&bounds(), 0.0));
        let (mut now_ns, mut apart) = (1_000_000_000, false);
        for step in 0..STEPS {
            let elapsed = intervals.elapse(now_ns, None).unwrap_or_else(|| {
                limiters.rest();
                Default::default()
            });
            let goal = wanted.at(1e-9 * now_ns as f64, &mut chance);
            // A correction that moves by itself is tracked joint by joint.
            let sent = match apart {
                true => limiters.step_independently(&goal, |_| Some(limits), elapsed),
                false => limiters.step(&goal, |_| Some(limits), elapsed),
            };
            apart ^= chance.below(300) == 0;
            let judged = oracle.take(now_ns, now_ns, &[0.0; JOINTS], &sent);
            assert_eq!(judged, Ok(()), "TRUED_SEED={} step {step}", seed.wrapping_add(run));
            now_ns += interval_ns(&mut chance, jitter_ns);
        }
    }
}
