//! Every kind of invalid command gets its reason.

use super::*;
use envelope::Limits;
use glam::{DMat3, DVec3};
use physics::{Joint, JointKind, Tool};

fn arm() -> Arm {
    let joint = Joint {
        kind: JointKind::Revolute,
        axis: DVec3::Z,
        point: DVec3::ZERO,
        limits: (-1.0, 1.0),
        max_speed: 1.0,
        link: None,
    };
    let tool = Tool { tcp: DVec3::X, base_from_tool: DMat3::IDENTITY, body: None };
    Arm::new(&[joint; 2], tool, DVec3::ZERO).expect("sound")
}

fn settings() -> Settings {
    Settings::with_envelope(Limits::new(1e-3, 1e-2, 1.0).expect("positive"))
}

fn second(change: impl FnOnce(&mut Command), now_ns: u64) -> Result<Continuity, Reason> {
    let mut judge = CommandValidator::default();
    let first = Command::new(5, 1_000_000_000, &[0.1, 0.2]);
    assert_eq!(
        judge.validate(&arm(), &settings(), &first, 1_000_000_000),
        Ok(Continuity::NewSession)
    );
    let mut next = Command::new(6, 1_001_000_000, &[0.1, 0.2]);
    change(&mut next);
    judge.validate(&arm(), &settings(), &next, now_ns)
}

const NEXT_NS: u64 = 1_001_000_000;

#[test]
fn a_good_command_passes_with_the_time_since_its_forerunner() {
    assert_eq!(second(|_| (), NEXT_NS), Ok(Continuity::After(1_000_000)));
}

#[test]
fn a_wrong_command_is_refused_by_name() {
    let reason = |change: fn(&mut Command)| second(change, NEXT_NS).err();
    assert_eq!(reason(|c| c.joints = 3), Some(Reason::WrongJointCount));
    assert_eq!(reason(|c| c.q[1] = f64::NAN), Some(Reason::NotFinite));
    assert_eq!(reason(|c| c.direction = Some([f64::NAN; JOINTS_MAX])), Some(Reason::NotFinite));
    assert_eq!(reason(|c| c.direction = Some([7.0; JOINTS_MAX])), Some(Reason::OutOfLimits));
    assert_eq!(reason(|c| c.q[0] = 1.0 + 1e-12), Some(Reason::OutOfLimits));
    assert_eq!(reason(|c| c.age_ns = 10_000_001), Some(Reason::Stale));
    assert_eq!(reason(|c| c.seq = 5), Some(Reason::Duplicate));
    assert_eq!(reason(|c| c.seq = 4), Some(Reason::OutOfOrder));
    assert_eq!(reason(|c| c.t_ns = 1_000_000_000), Some(Reason::OutOfOrder));
}

#[test]
fn a_refused_command_is_nobodys_forerunner() {
    let mut judge = CommandValidator::default();
    let bad = Command::new(90, u64::MAX, &[f64::NAN, 0.0]);
    assert_eq!(judge.validate(&arm(), &settings(), &bad, 0), Err(Reason::NotFinite));
    let good = Command::new(1, 1, &[0.0, 0.0]);
    assert_eq!(judge.validate(&arm(), &settings(), &good, 0), Ok(Continuity::NewSession));
}

#[test]
fn a_pause_is_no_jump_in_time_but_a_claim_of_more_than_passed_is() {
    let late = |c: &mut Command| c.t_ns = 61_000_000_000;
    assert_eq!(second(late, 61_000_000_000), Ok(Continuity::After(60_000_000_000)));
    assert_eq!(second(late, NEXT_NS), Ok(Continuity::TimeJump));
}

#[test]
fn another_run_of_the_sender_starts_anew() {
    let restarted = |c: &mut Command| (c.session, c.seq, c.t_ns) = (2, 0, 5);
    assert_eq!(second(restarted, NEXT_NS), Ok(Continuity::NewSession));
}
