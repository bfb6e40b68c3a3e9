//! Targets without a daemon and without a clock.

use super::*;
use envelope::Limiter;
use proptest::prelude::*;

const MS: u64 = 1_000_000;
const DT_S: f64 = 1e-3;
const ANGLE: f64 = 0.02;
const RATE: f64 = 0.05;
const JERK: f64 = 5.0;

fn bounds(angle: f64, rate: f64, jerk: f64) -> JointBounds {
    JointBounds {
        min: [-3.0; JOINTS_MAX],
        max: [3.0; JOINTS_MAX],
        angle: [angle; JOINTS_MAX],
        rate: [rate; JOINTS_MAX],
        jerk: [jerk; JOINTS_MAX],
    }
}

fn output() -> Output {
    let mut output = Output::new();
    output.set_bounds(&bounds(ANGLE, RATE, JERK));
    output
}

fn answer(seq: u64, correction: f64) -> Corrected {
    Corrected {
        seq,
        command_seq: seq,
        made_ns: seq * MS,
        joints: 6,
        correction: [correction; JOINTS_MAX],
        ..Corrected::default()
    }
}

fn command(seq: u64, q_cmd: &[f64]) -> Command {
    let mut command = Command { seq, joints: q_cmd.len() as u32, ..Command::default() };
    command.q[..q_cmd.len()].copy_from_slice(q_cmd);
    command
}

/// A loop of 1 kHz with one constant command, and what it sent of the correction.
struct Loop {
    output: Output,
    seq: u64,
    now_ns: u64,
    sent: Vec<f64>,
}

impl Loop {
    fn new() -> Self {
        Self { output: output(), seq: 0, now_ns: 10 * MS, sent: vec![0.0; 3] }
    }

    fn tick(&mut self, correction: Option<f64>) -> Source {
        self.seq += 1;
        self.now_ns += MS;
        let q_cmd = [0.5; 6];
        let answer = correction.map(|c| Corrected { made_ns: self.now_ns, ..answer(self.seq, c) });
        let command = command(self.seq, &q_cmd);
        let target =
            self.output.target(&q_cmd, answer.as_ref(), Some(&command), self.now_ns).unwrap();
        self.sent.push(self.output.correction()[0]);
        target.source()
    }

    fn ticks(&mut self, count: usize, correction: Option<f64>) -> Source {
        (0..count).map(|_| self.tick(correction)).last().unwrap()
    }

    /// Holds all that was sent against limits, from the first tick on.
    fn assert_within(&self, angle: f64, rate: f64, jerk: f64) {
        for four in self.sent.windows(4) {
            let [a, b, c, d] = [four[0], four[1], four[2], four[3]];
            assert!(d.abs() <= angle * (1.0 + 1e-9), "angle {d}");
            assert!((d - c).abs() <= rate * DT_S * (1.0 + 1e-9), "rate from {c} to {d}");
            let third = (d - 3.0 * c + 3.0 * b - a).abs() / DT_S.powi(3);
            assert!(third <= jerk * (1.0 + 1e-6) + 1e-6, "jerk {third} at {four:?}");
        }
    }
}

#[test]
fn without_a_daemon_the_command_goes_out_bit_for_bit() {
    let q_cmd = [0.1, -0.0];
    let target = output().target(&q_cmd, None, None, MS).unwrap();
    let bits = |q: &[f64]| q.iter().map(|q| q.to_bits()).collect::<Vec<_>>();
    assert_eq!((bits(target.joints()), target.source()), (bits(&q_cmd), Source::Plain));
}

#[test]
fn a_command_that_is_no_number_is_an_error_and_changes_nothing() {
    let mut cell = Loop::new();
    cell.ticks(300, Some(0.003));
    let before = (cell.output.sent(), cell.output.correction());
    for (bad, error) in [
        (&[0.5, f64::NAN][..], InvalidTarget::NotFinite { joint: 2 }),
        (&[f64::INFINITY], InvalidTarget::NotFinite { joint: 1 }),
        (&[], InvalidTarget::Joints(0)),
        (&[0.0; 17], InvalidTarget::Joints(17)),
    ] {
        assert_eq!(cell.output.target(bad, None, None, cell.now_ns + 5 * MS), Err(error));
        assert_eq!((cell.output.sent(), cell.output.correction()), before);
    }
}

#[test]
fn the_daemons_correction_is_reached_and_then_sent_bit_for_bit() {
    let mut cell = Loop::new();
    assert_eq!(cell.tick(Some(0.003)), Source::Ramping);
    assert_eq!(cell.ticks(500, Some(0.003)), Source::Corrected);
    let mut daemon = Limiter::from_motion(0.003, 0.0, 0.0);
    let limits = Limits::new(ANGLE, RATE, JERK).unwrap();
    for k in 0..2000 {
        let correction = daemon.step(if k < 800 { -0.006 } else { 0.01 }, &limits, DT_S);
        assert_eq!(cell.tick(Some(correction)), Source::Corrected, "tick {k}");
        assert_eq!(cell.output.correction()[5].to_bits(), correction.to_bits());
    }
    cell.assert_within(ANGLE, RATE, JERK);
}

#[test]
fn an_earlier_commands_answer_lends_its_correction_to_a_later_command() {
    let mut cell = Loop::new();
    cell.ticks(500, Some(0.003));
    let q_cmd = [0.6; 6];
    let (made, now_ns) = (Corrected { made_ns: cell.now_ns, ..answer(500, 0.003) }, cell.now_ns);
    let target = cell.output.target(&q_cmd, Some(&made), Some(&command(501, &q_cmd)), now_ns + MS);
    let target = target.unwrap();
    assert_eq!((target.joints(), target.source()), (&[0.603; 6][..], Source::LastCorrection));
}

#[test]
fn a_silent_daemon_leaves_a_ramp_to_the_command_and_one_that_comes_back_a_ramp_from_there() {
    let mut cell = Loop::new();
    cell.ticks(500, Some(0.01));
    assert_eq!(cell.tick(None), Source::Ramping);
    assert_eq!(cell.ticks(100, None), Source::Ramping);
    cell.ticks(20, Some(-0.01));
    assert_eq!(cell.ticks(1500, None), Source::Plain);
    assert_eq!(cell.ticks(1500, Some(0.01)), Source::Corrected);
    cell.assert_within(ANGLE, RATE, JERK);
}

#[test]
fn an_answer_too_old_or_no_number_or_of_other_joints_counts_as_silence() {
    for spoilt in [
        Corrected { made_ns: 1, ..answer(1, 0.01) },
        Corrected { joints: 5, ..answer(1, 0.01) },
        Corrected { correction: [f64::NAN; JOINTS_MAX], ..answer(1, 0.01) },
    ] {
        let mut output = output();
        for ms in 100..400 {
            let answer = match spoilt.made_ns {
                1 => spoilt,
                _ => Corrected { made_ns: ms * MS, ..spoilt },
            };
            let target = output.target(&[0.5; 6], Some(&answer), None, ms * MS).unwrap();
            assert_eq!(target.joints(), [0.5; 6]);
        }
    }
}

#[test]
fn a_silence_moves_nothing_and_the_correction_goes_on_from_where_it_was() {
    let mut cell = Loop::new();
    cell.ticks(250, Some(0.01));
    let before = *cell.sent.last().unwrap();
    for silence_ms in [25, 200, 5000] {
        cell.now_ns += silence_ms * MS;
        cell.tick(None);
        assert_eq!(cell.sent.pop(), Some(*cell.sent.last().unwrap()), "after {silence_ms} ms");
    }
    assert!(before > 1e-3);
    cell.sent = vec![*cell.sent.last().unwrap(); 3];
    assert_eq!(cell.ticks(1000, None), Source::Plain);
    cell.assert_within(ANGLE, RATE, JERK);
}

#[test]
fn a_run_that_begins_anew_starts_where_the_robot_stands() {
    let mut cell = Loop::new();
    cell.ticks(500, Some(0.003));
    cell.output.start_from(&[]);
    assert_eq!(cell.output.correction(), [0.0; JOINTS_MAX]);
    cell.sent = vec![0.0; 3];
    cell.ticks(500, Some(0.003));
    cell.assert_within(ANGLE, RATE, JERK);
    cell.output.start_from(&[0.002, f64::NAN]);
    assert_eq!(cell.output.correction()[..3], [0.002, 0.0, 0.0]);
}

#[test]
fn bounds_that_make_no_sense_change_nothing() {
    let mut cell = Loop::new();
    cell.ticks(500, Some(0.01));
    for wild in [f64::NAN, 0.0, -1.0, f64::INFINITY] {
        cell.output.set_bounds(&bounds(wild, wild, wild));
        cell.ticks(30, Some(0.01));
        cell.ticks(30, Some(-0.01));
    }
    cell.assert_within(ANGLE, RATE, JERK);
}

#[test]
fn tighter_bounds_are_braked_into_within_the_old_ones() {
    let mut cell = Loop::new();
    cell.ticks(90, Some(0.02));
    cell.output.set_bounds(&bounds(0.002, 0.005, 0.5));
    cell.ticks(3000, Some(0.02));
    cell.assert_within(ANGLE, RATE, JERK);
    assert_eq!(*cell.sent.last().unwrap(), 0.002);
    cell.sent.drain(..2500);
    cell.ticks(3000, Some(-0.02));
    cell.assert_within(0.002, 0.005, 0.5);
}

proptest! {
    #[test]
    fn whatever_the_daemon_says_and_however_bounds_change_the_larger_of_both_hold(
        acts in prop::collection::vec((0..9_u8, -0.03..0.03_f64, 1..300_usize), 30),
    ) {
        let sets = [(ANGLE, RATE, JERK), (0.002, 0.005, 0.5), (0.01, 0.1, 50.0)];
        let mut cell = Loop::new();
        for (act, correction, ticks) in acts {
            match act {
                0 => { cell.ticks(ticks, None); }
                1 => { cell.ticks(ticks, Some(f64::NAN)); }
                2 => { cell.ticks(ticks, Some(1e300)); }
                3..6 => {
                    let (angle, rate, jerk) = sets[usize::from(act) - 3];
                    cell.output.set_bounds(&bounds(angle, rate, jerk));
                    cell.ticks(ticks, Some(correction));
                }
                6 => for k in 0..ticks { cell.tick((k % 3 == 0).then_some(correction)); },
                _ => { cell.ticks(ticks, Some(correction)); }
            }
        }
        cell.assert_within(ANGLE, 0.1, 50.0);
    }
}
