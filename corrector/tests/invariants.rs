//! What holds whatever comes in: no target out of limits, out of the envelope or no number; no jump; a word for everything.
#![expect(clippy::expect_used, reason = "in a test a panic is the message")]

mod support;

use corrector::{Command, Mode, Outcome, Reason, Settings, Status, World, WrenchSample};
use glam::DVec3;
use physics::{JOINTS_MAX, Model, Wrench};
use support::{DT_NS, Run, envelope, erring, six};

/// `SplitMix64`: chance that is the same everywhere.
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

fn smooth(t_s: f64) -> [f64; 6] {
    let wave = |rad_s: f64, phase: f64| 0.4 * (rad_s * t_s + phase).sin();
    let mut q: [f64; 6] = std::array::from_fn(|i| wave(0.3 + 0.1 * i as f64, i as f64));
    q[4] += 0.9;
    q
}

fn assert_safe(outcome: &Outcome, model: &Model, q_cmd: &[f64; 6], at: u64) {
    let Some(q) = outcome.q else { return };
    for (i, joint) in model.arm.joints().iter().enumerate() {
        let (low, high) = joint.limits;
        assert!(q[i].is_finite() && (low..=high).contains(&q[i]), "{at}: joint {i} at {}", q[i]);
        let off = (q[i] - q_cmd[i]).abs();
        assert!(off <= envelope().angle() * (1.0 + 1e-12), "{at}: joint {i} off by {off}");
        assert_eq!(outcome.correction[i], q[i] - q_cmd[i], "{at}");
    }
}

struct Hostile {
    run: Run,
    chance: Chance,
    now_ns: u64,
    seq: u64,
    t_ns: u64,
    good: [f64; 6],
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

    fn world(&mut self) -> World {
        let c = &mut self.chance;
        let mut world = World::default();
        let mut vector = || {
            let size = if c.one_in(500) { c.hostile() } else { 200.0 };
            DVec3::new(c.unit(), c.unit(), c.unit()) * size
        };
        let wrench = Wrench { force: vector(), moment: vector() * 0.1 };
        let age_ns = if c.one_in(50) { c.bits() } else { DT_NS };
        world.wrench = Some(WrenchSample { wrench, in_base: c.one_in(2), age_ns });
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

    fn cycle(&mut self) -> Option<Outcome> {
        self.now_ns += (self.chance.unit() * 2.0 * DT_NS as f64) as u64;
        self.order();
        if self.chance.one_in(40) {
            return self.run.corrector.idle(&self.run.model, self.now_ns);
        }
        self.run.world = self.world();
        let command = self.command();
        let outcome = self.run.give(&command, self.now_ns);
        if outcome.status != Status::Rejected {
            self.good.copy_from_slice(&command.q[..6]);
        }
        Some(outcome)
    }
}

#[test]
fn a_hundred_thousand_hostile_cycles_break_no_bound() {
    let run = Run::new(erring(six()), settings());
    let (chance, good) = (Chance(7), [0.0; 6]);
    let mut cell = Hostile { run, chance, now_ns: 0, seq: 0, t_ns: 0, good };
    let mut statuses = std::collections::BTreeMap::new();
    let mut window = std::collections::VecDeque::new();
    for at in 0..100_000 {
        let Some(outcome) = cell.cycle() else { continue };
        assert_safe(&outcome, &cell.run.model, &cell.good, at);
        *statuses.entry(format!("{:?}", outcome.status)).or_insert(0) += 1;
        if outcome.reason == Reason::JointLimit || near_limit(&cell) {
            window.clear();
            continue;
        }
        window.push_back((cell.now_ns, outcome.correction));
        if window.len() > 40 {
            window.pop_front();
        }
        let (from_ns, before) = window[0];
        // Real time, and the 20 ms that commands may be early or late.
        let most = envelope().rate() * ((cell.now_ns - from_ns) as f64 * 1e-9 + 0.02);
        for (i, before) in before.iter().enumerate().take(6) {
            let moved = (outcome.correction[i] - before).abs();
            assert!(moved <= most + 1e-12, "{at}: joint {i} moved {moved} of {most}");
        }
    }
    assert!(statuses.len() >= 5, "every status was seen: {statuses:?}");
    assert!(statuses.values().all(|n| *n > 20), "{statuses:?}");
}

/// Where a joint limit may cut the correction.
fn near_limit(cell: &Hostile) -> bool {
    let reach = envelope().angle();
    let joints = cell.run.model.arm.joints();
    joints.iter().zip(cell.good).any(|(joint, q)| {
        let (low, high) = joint.limits;
        q - low < reach || high - q < reach
    })
}

/// Third differences of all corrections at an even pace, per s³.
fn largest_jerk(corrections: &[[f64; JOINTS_MAX]]) -> f64 {
    let third =
        |w: &[[f64; JOINTS_MAX]], i: usize| w[3][i] - 3.0 * w[2][i] + 3.0 * w[1][i] - w[0][i];
    let all = corrections.windows(4).flat_map(|w| (0..6).map(move |i| third(w, i).abs() * 1e9));
    all.fold(0.0, f64::max)
}

#[test]
fn swaps_bypass_modes_refusals_and_silence_keep_rate_and_jerk() {
    let mut run = Run::new(erring(six()), settings());
    let mut corrections = vec![[0.0; JOINTS_MAX]; 3];
    let mut said = std::collections::BTreeSet::new();
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
        let outcome = if (10_500..11_000).contains(&k) {
            run.corrector.idle(&run.model, k * DT_NS)
        } else {
            Some(run.give(&command, k * DT_NS))
        };
        let correction = outcome.map_or([0.0; JOINTS_MAX], |o| o.correction);
        corrections.push(correction);
        if let Some(o) = outcome {
            said.insert(format!("{:?} {:?}", o.status, o.reason));
        }
    }
    let jerk = largest_jerk(&corrections);
    assert!(jerk <= envelope().jerk() * 1.001, "{jerk}: {said:?}");
    for word in [
        "Ramping Starting",
        "Corrected None",
        "Bypassed Bypass",
        "Ramping ModelChanged",
        "Shadow ShadowMode",
        "Rejected NotFinite",
        "Ramping Stale",
    ] {
        assert!(said.contains(word), "{word} among {said:?}");
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
                    .zip(&outcome.wanted)
                    .all(|(c, w)| (c - w).abs() < 1e-15)
        );
    }
    assert!(exact > 2400, "apart from backlash at turning points: {exact} of 3000");
}

#[test]
fn a_path_through_a_singular_wrist_keeps_its_correction_without_a_jump() {
    let mut run = Run::new(erring(six()), settings());
    let mut corrections = Vec::new();
    let (mut said, mut limited) = (Vec::new(), 0);
    for k in 0..4000 {
        let outcome = run.cycle(&[0.2, 0.1, 0.3, 0.4, -0.3 + 0.15 * f64::from(k) * 1e-3, 0.1]);
        corrections.push(outcome.correction);
        if said.last() != Some(&(outcome.status, outcome.reason)) {
            said.push((outcome.status, outcome.reason));
        }
        limited += u32::from(outcome.residual.rad > 1e-7);
        assert_ne!(outcome.reason, Reason::NotConverged);
    }
    assert!(limited > 10, "{limited} cycles leave something");
    assert_eq!(said.last(), Some(&(Status::Corrected, Reason::None)), "{said:?}");
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
fn a_stale_command_ramps_the_correction_out_and_then_stands_down() {
    let mut run = Run::new(erring(six()), settings());
    for _ in 0..500 {
        run.cycle(&smooth(0.0));
    }
    let mut now_ns = run.cycles * DT_NS;
    let mut last = f64::INFINITY;
    for _ in 0..2000 {
        now_ns += DT_NS;
        let Some(outcome) = run.corrector.idle(&run.model, now_ns) else {
            assert_eq!(last, 0.0);
            return;
        };
        assert_eq!((outcome.status, outcome.reason), (Status::Ramping, Reason::Stale));
        last = outcome.correction.iter().fold(0.0, |most: f64, c| most.max(c.abs()));
    }
    panic!("it still ramps: {last}");
}

#[test]
fn shadow_publishes_the_command_to_the_bit_and_says_what_it_would_do() {
    let mut run = Run::new(erring(six()), Settings { mode: Mode::Shadow, ..settings() });
    for k in 0..200 {
        let q = smooth(f64::from(k) * 1e-3);
        let outcome = run.cycle(&q);
        assert_eq!(outcome.q.expect("a target")[..6], q);
        assert_eq!((outcome.status, outcome.reason), (Status::Shadow, Reason::ShadowMode));
        assert!(outcome.wanted[1].abs() > 1e-5);
    }
}

#[test]
fn settled_poses_are_solved_without_ramps_and_only_in_lockstep() {
    for lockstep in [true, false] {
        let mut run = Run::new(erring(six()), Settings { lockstep, ..settings() });
        let mut command = Command::new(1, 60_000_000_000, &smooth(3.0));
        command.settled = true;
        let outcome = run.give(&command, 60_000_000_000);
        let at_once = outcome.correction[..6] == outcome.wanted[..6];
        assert_eq!(at_once && outcome.status == Status::Corrected, lockstep);
    }
}

#[test]
fn minutes_between_poses_are_time_to_warm_up_in() {
    let arm = six();
    let given: &[(&str, &[f64])] = &[("amplitude", &[2e-4]), ("time_constant", &[1800.0])];
    let warm = support::effect(&arm, "thermal_growth", Some(1), given);
    let model = Model::new(arm, &[warm]).expect("room");
    let mut run = Run::new(model, Settings { lockstep: true, ..settings() });
    let largest = |outcome: &Outcome| outcome.wanted.iter().fold(0.0, |m: f64, c| m.max(c.abs()));
    let sizes: Vec<f64> = (0..121)
        .map(|minute| {
            let t_ns = minute * 60_000_000_000;
            let mut command = Command::new(minute + 1, t_ns, &smooth(3.0));
            command.settled = true;
            largest(&run.give(&command, t_ns))
        })
        .collect();
    assert!(sizes[0] < 1e-12 && sizes[120] > 5e-5, "{} {}", sizes[0], sizes[120]);
    let share = sizes[30] / sizes[120];
    assert!((share - (1.0 - (-1.0_f64).exp()) / (1.0 - (-4.0_f64).exp())).abs() < 0.01, "{share}");
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
