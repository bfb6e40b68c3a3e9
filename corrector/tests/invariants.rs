//! Invariants for any input: the correction is finite, within the envelope and without jumps, and
//! every outcome has a status and a reason.
#![expect(clippy::expect_used, reason = "in a test a panic is the message")]

mod support;

use corrector::{
    Command, CycleInputs, LIMITED_SHARE, Mode, Outcome, Reason, Settings, Status, WrenchSample,
};
use glam::DVec3;
use physics::{JOINTS_MAX, Model, Wrench};
use support::{DT_NS, Run, envelope, erring, six, smooth};

/// `SplitMix64`, a reproducible pseudo-random generator.
struct Chance(u64);

impl Chance {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^ (x >> 31)
    }

    fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn one_in(&mut self, n: u64) -> bool {
        self.bits().is_multiple_of(n)
    }

    fn hostile(&mut self) -> f64 {
        let wild = [f64::NAN, f64::INFINITY, -f64::INFINITY, 1e308, -1e300, 1e-320, -0.0, 40.0];
        wild[(self.bits() % wild.len() as u64) as usize]
    }
}

fn settings() -> Settings {
    Settings::with_envelope(envelope())
}

/// Largest difference between the stamps of commands, which pace the correction, and the clock, to
/// either side, s.
const PARTED_S: f64 = 2.0 * 0.0201;

/// Checks every correction in every state: finite, within the position limit, and within the rate
/// limit, apart from the difference between stamps and clock.
struct Judge {
    before: [f64; JOINTS_MAX],
    ahead: [f64; JOINTS_MAX],
    now_ns: u64,
}

impl Judge {
    fn judge(&mut self, outcome: &Outcome, now_ns: u64, cycle: u64) {
        let passed = envelope().rate() * ((now_ns - self.now_ns) as f64 * 1e-9);
        let most = envelope().rate() * PARTED_S;
        for (i, (now, before)) in outcome.correction.iter().zip(self.before).enumerate() {
            assert!(now.is_finite(), "{cycle}: joint {i} by {now}");
            assert!(now.abs() <= envelope().angle() * (1.0 + 1e-9), "{cycle}: joint {i} by {now}");
            self.ahead[i] = (self.ahead[i] + (now - before).abs() - passed).max(0.0);
            assert!(self.ahead[i] <= most, "{cycle}: joint {i} moved ahead: {outcome:?}");
        }
        (self.before, self.now_ns) = (outcome.correction, now_ns);
    }
}

struct Hostile {
    run: Run,
    chance: Chance,
    now_ns: u64,
    seq: u64,
    t_ns: u64,
}

impl Hostile {
    fn command(&mut self) -> Command {
        let c = &mut self.chance;
        self.seq += 1;
        self.t_ns += (c.unit() * 2.0 * DT_NS as f64) as u64;
        let mut q = smooth(self.t_ns as f64 * 1e-9);
        for (i, joint) in self.run.model.arm.joints().iter().enumerate() {
            let (low, high) = joint.limits;
            match c.bits() % 300 {
                0 => q[i] = c.hostile(),
                1 => q[i] = low + (high - low) * c.unit(),
                2 => q[i] = if c.one_in(2) { low } else { high },
                _ => {}
            }
        }
        let mut command = Command::new(self.seq, self.t_ns, &q);
        match c.bits() % 200 {
            0 => command.joints = (c.bits() % 20) as usize,
            1 => command.seq = c.bits(),
            2 => command.t_ns = c.bits(),
            3 => command.age_ns = c.bits(),
            4 => command.direction = Some([c.hostile(); JOINTS_MAX]),
            5 => command.settled = true,
            6..14 => (command.session, self.seq) = (c.bits(), command.seq),
            14 => command.q[4] = 1e-3 * c.unit(),
            15 => command.q[9] = c.hostile(),
            _ => {}
        }
        command
    }

    fn world(&mut self) -> CycleInputs {
        let c = &mut self.chance;
        let mut world = CycleInputs::default();
        let mut vector = || {
            let size = if c.one_in(500) { c.hostile() } else { 200.0 };
            DVec3::new(c.unit(), c.unit(), c.unit()) * size
        };
        let wrench = Wrench { force: vector(), moment: vector() * 0.1 };
        let age_ns = if c.one_in(50) { c.bits() } else { DT_NS };
        world.wrench =
            Some(WrenchSample { wrench, in_base: c.one_in(2), age_ns, faulty: c.one_in(100) });
        world.ambient_celsius = if c.one_in(20) { c.hostile() } else { 25.0 };
        world
    }

    fn order(&mut self) {
        let c = &mut self.chance;
        let corrector = &mut self.run.corrector;
        match c.bits() % 1000 {
            0 => corrector.set_bypass(c.one_in(2)),
            1 => {
                corrector
                    .set_mode([Mode::Shadow, Mode::Limited, Mode::Full][c.bits() as usize % 3]);
            }
            2 => {
                let nominal = Model::nominal(six());
                self.run.model = if c.one_in(2) { nominal } else { erring(six()) };
                corrector.model_changed(&self.run.model);
            }
            3 => corrector.rearm_wrench(),
            4 => self.now_ns += c.bits() % 3_000_000_000,
            _ => {}
        }
    }

    fn cycle(&mut self) -> Outcome {
        self.now_ns += (self.chance.unit() * 2.0 * DT_NS as f64) as u64;
        self.order();
        self.run.world = self.world();
        let command = self.command();
        self.run.give(&command, self.now_ns)
    }
}

#[test]
fn a_hundred_thousand_hostile_cycles_break_no_bound() {
    let run = Run::new(erring(six()), settings());
    let mut cell = Hostile { run, chance: Chance(7), now_ns: 0, seq: 0, t_ns: 0 };
    let mut statuses = std::collections::BTreeMap::new();
    let mut judge = Judge { before: [0.0; JOINTS_MAX], ahead: [0.0; JOINTS_MAX], now_ns: 0 };
    for cycle in 0..100_000 {
        let outcome = cell.cycle();
        judge.judge(&outcome, cell.now_ns, cycle);
        *statuses.entry(format!("{:?}", outcome.status)).or_insert(0) += 1;
    }
    assert!(statuses.len() >= 5, "every status was seen: {statuses:?}");
    assert!(statuses.values().all(|n| *n > 20), "{statuses:?}");
}

/// Third differences of all corrections at an even pace, per s³.
fn largest_jerk(corrections: &[[f64; JOINTS_MAX]]) -> f64 {
    let third =
        |w: &[[f64; JOINTS_MAX]], i: usize| w[3][i] - 3.0 * w[2][i] + 3.0 * w[1][i] - w[0][i];
    let all = corrections.windows(4).flat_map(|w| (0..6).map(move |i| third(w, i).abs() * 1e9));
    all.fold(0.0, f64::max)
}

#[test]
fn swaps_bypass_modes_and_refusals_keep_rate_and_jerk() {
    let mut run = Run::new(erring(six()), settings());
    let mut corrections = vec![[0.0; JOINTS_MAX]; 3];
    let mut reported = std::collections::BTreeSet::new();
    for k in 1..12_000_u64 {
        match k {
            2000 | 3000 => run.corrector.set_bypass(k == 2000),
            4000 | 5000 => {
                run.model = if k == 4000 { Model::nominal(six()) } else { erring(six()) };
                run.corrector.model_changed(&run.model);
            }
            6000 | 7000 => {
                run.corrector.set_mode(if k == 6000 { Mode::Limited } else { Mode::Full });
            }
            8000 => run.corrector.set_mode(Mode::Shadow),
            8600 => run.corrector.set_mode(Mode::Full),
            _ => {}
        }
        let mut command = Command::new(k, k * DT_NS, &smooth(k as f64 * 1e-3));
        if k % 500 == 17 || (9500..9700).contains(&k) {
            command.q[2] = f64::NAN;
        }
        let outcome = run.give(&command, k * DT_NS);
        corrections.push(outcome.correction);
        reported.insert(format!("{:?} {:?}", outcome.status, outcome.reason));
    }
    let jerk = largest_jerk(&corrections);
    assert!(jerk <= envelope().jerk() * 1.001, "{jerk}: {reported:?}");
    for wanted in [
        "Ramping Starting",
        "Corrected None",
        "Bypassed Bypass",
        "Ramping ModelChanged",
        "Shadow ShadowMode",
        "Rejected NotFinite",
    ] {
        assert!(reported.contains(wanted), "{wanted} among {reported:?}");
    }
}

#[test]
fn a_smooth_path_is_corrected_exactly_and_smoothly() {
    let mut run = Run::new(erring(six()), settings());
    let mut last = [0.0; JOINTS_MAX];
    for k in 0..5000 {
        let outcome = run.cycle(&smooth(f64::from(k) * 1e-3));
        if k > 1000 {
            let change =
                (0..6).map(|i| (outcome.correction[i] - last[i]).abs()).fold(0.0, f64::max);
            assert!(change <= envelope().rate() * 1e-3 * (1.0 + 1e-9), "{k}: {change}");
        }
        last = outcome.correction;
    }
    let mut exact = 0;
    for k in 5000..8000 {
        let outcome = run.cycle(&smooth(f64::from(k) * 1e-3));
        exact += u32::from(outcome.status == Status::Corrected);
        assert!(
            outcome.status != Status::Corrected
                || outcome.correction[..6]
                    .iter()
                    .zip(&outcome.requested)
                    .all(|(c, w)| (c - w).abs() < 1e-15)
        );
    }
    assert!(exact > 2400, "apart from backlash at turning points: {exact} of 3000");
}

#[test]
fn a_path_through_a_singular_wrist_keeps_its_correction_without_a_jump() {
    let mut run = Run::new(erring(six()), settings());
    let mut corrections = Vec::new();
    let (mut reported, mut limited) = (Vec::new(), 0);
    for k in 0..4000 {
        let outcome = run.cycle(&[0.2, 0.1, 0.3, 0.4, -0.3 + 0.15 * f64::from(k) * 1e-3, 0.1]);
        corrections.push(outcome.correction);
        if reported.last() != Some(&(outcome.status, outcome.reason)) {
            reported.push((outcome.status, outcome.reason));
        }
        limited += u32::from(outcome.residual.rad > 1e-7);
        assert_ne!(outcome.reason, Reason::NotConverged);
    }
    assert!(limited > 10, "{limited} cycles leave something");
    assert_eq!(reported.last(), Some(&(Status::Corrected, Reason::None)), "{reported:?}");
    assert!(largest_jerk(&corrections) <= envelope().jerk() * 1.001);
}

#[test]
fn one_refused_command_does_not_move_a_standing_correction() {
    let mut run = Run::new(erring(six()), settings());
    let q = smooth(0.0);
    let before = (0..500).map(|_| run.cycle(&q)).last().expect("a cycle");
    assert_eq!(before.status, Status::Corrected);
    run.cycles += 1;
    let bad =
        run.give(&Command::new(run.cycles, run.cycles * DT_NS, &[f64::NAN; 6]), run.cycles * DT_NS);
    assert_eq!((bad.status, bad.reason), (Status::Rejected, Reason::NotFinite));
    assert_eq!(bad.correction, before.correction);
    assert_eq!(run.cycle(&q).correction, before.correction);
}

#[test]
fn limited_mode_never_goes_beyond_its_share_however_bypass_and_arming_are_toggled() {
    let mut run = Run::new(erring(six()), Settings { mode: Mode::Limited, ..settings() });
    let mut chance = Chance(11);
    let most = LIMITED_SHARE * envelope().angle() * (1.0 + 1e-9);
    for k in 0..60_000 {
        if chance.one_in(60) {
            run.corrector.set_bypass(chance.one_in(2));
        }
        if chance.one_in(60) {
            let mode = if chance.one_in(2) { Mode::Limited } else { Mode::Shadow };
            run.corrector.set_mode(mode);
        }
        let outcome = run.cycle(&smooth(f64::from(k) * 1e-3));
        let largest = outcome.correction.iter().fold(0.0, |m: f64, c| m.max(c.abs()));
        assert!(largest <= most, "{k}: {largest} of {most}");
    }
}

#[test]
fn a_silence_leaves_the_correction_where_it_was() {
    let mut run = Run::new(erring(six()), settings());
    for _ in 0..500 {
        run.cycle(&smooth(0.0));
    }
    for pause_ms in [25, 200, 5000, 100_000] {
        let before = run.cycle(&smooth(0.0)).correction;
        run.cycles += pause_ms;
        assert_eq!(run.cycle(&smooth(0.0)).correction, before, "{pause_ms} ms");
    }
}

#[test]
fn a_command_that_jumps_is_reported_once_and_the_correction_makes_no_step() {
    let mut run = Run::new(erring(six()), settings());
    let mut corrections = Vec::new();
    let mut jumps = Vec::new();
    for k in 0..3000 {
        let mut q = smooth(0.0);
        // Joint 1 steps by 1 rad, and back.
        q[0] += if (1000..2000).contains(&k) { 1.0 } else { 0.0 };
        let outcome = run.cycle(&q);
        corrections.push(outcome.correction);
        if outcome.reason == Reason::CommandJump && outcome.steps > 0 {
            jumps.push((k, outcome.status));
        }
    }
    assert_eq!(jumps.first().map(|(k, _)| *k), Some(1000), "{jumps:?}");
    assert!(largest_jerk(&corrections) <= envelope().jerk() * 1.001);
}

#[test]
fn a_command_that_runs_into_a_joint_limit_and_beyond_takes_the_correction_along_without_a_step() {
    let arm = six();
    let (_, high) = arm.joints()[0].limits;
    for speed in [0.02, 0.3, 3.0] {
        for offset in [2e-3, -2e-3] {
            let given: &[(&str, &[f64])] = &[("offset", &[offset])];
            let offset_effect = support::effect(&arm, "joint_offset", Some(1), given);
            let mut run = Run::new(Model::new(arm, &[offset_effect]).expect("room"), settings());
            let mut corrections = vec![[0.0; JOINTS_MAX]; 3];
            let mut furthest = f64::MIN;
            for k in 0..4000 {
                let mut q = smooth(0.0);
                q[0] = high + speed * (f64::from(k) * 1e-3 - 2.0).min(0.5);
                let outcome = run.cycle(&q);
                corrections.push(outcome.correction);
                if q[0] <= high {
                    furthest = furthest.max(q[0] + outcome.correction[0] - high);
                }
            }
            assert!(largest_jerk(&corrections) <= envelope().jerk() * 1.001, "at {speed} rad/s");
            // At this speed it is taken back before the command reaches the limit.
            assert!(furthest <= 1e-4, "{furthest} rad beyond, at {speed} rad/s");
        }
    }
}

#[test]
fn shadow_publishes_the_command_to_the_bit_and_says_what_it_would_do() {
    let mut run = Run::new(erring(six()), Settings { mode: Mode::Shadow, ..settings() });
    for k in 0..200 {
        let q = smooth(f64::from(k) * 1e-3);
        let outcome = run.cycle(&q);
        assert_eq!(outcome.correction, [0.0; JOINTS_MAX]);
        assert_eq!((outcome.status, outcome.reason), (Status::Shadow, Reason::ShadowMode));
        assert!(outcome.requested[1].abs() > 1e-5);
    }
}

#[test]
fn the_same_inputs_give_the_same_bits() {
    let bits = || {
        let mut run = Run::new(erring(six()), settings());
        let all = (0..2000).flat_map(|k| run.cycle(&smooth(f64::from(k) * 1e-3)).correction);
        all.map(f64::to_bits).collect::<Vec<u64>>()
    };
    assert_eq!(bits(), bits());
}
