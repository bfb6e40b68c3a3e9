//! Conversion between messages and corrector types: the only file of the daemon that uses both.
//!
//! Numbers from other processes are copied without a check; the corrector validates them. Codes have
//! the same names on both sides (tested).

use corrector::{FeedReport, GateState, Outcome, TrimReport};
use physics::JOINTS_MAX;
use shm_schema::{
    Command, Corrected, CorrectionStatus, FeedReason, FeedState, Reason, TrimReason, TrimState,
    WrenchGate,
};

/// A command as a type of the corrector; `now_ns` is the cycle's time.
pub fn command(from: &Command, now_ns: u64, lockstep: bool) -> corrector::Command {
    let direction = from.has(Command::HAS_DIRECTION).then(|| {
        let mut signs = [0.0; JOINTS_MAX];
        for (sign, given) in signs.iter_mut().zip(from.direction) {
            *sign = f64::from(given.signum());
        }
        signs
    });
    corrector::Command {
        session: from.session,
        seq: from.seq,
        t_ns: from.t_ns,
        age_ns: if lockstep { 0 } else { now_ns.saturating_sub(from.sent_ns) },
        joints: from.joints as usize,
        q: from.q,
        direction,
        settled: from.has(Command::SETTLED),
    }
}

/// An outcome of the corrector as a message.
pub fn corrected(outcome: &Outcome, joints: usize) -> Corrected {
    Corrected {
        joints: joints as u32,
        status: status(outcome.status).code(),
        reason: reason(outcome.reason).code(),
        wrench_gate: gate(outcome.gate).code(),
        iterations: outcome.steps,
        correction: outcome.correction,
        correction_rate: outcome.correction_rate,
        correction_acceleration: outcome.correction_acceleration,
        wanted: outcome.requested,
        residual_m: outcome.residual.m,
        residual_rad: outcome.residual.rad,
        feed_override: 1.0,
        ..Corrected::default()
    }
}

fn status(status: corrector::Status) -> CorrectionStatus {
    match status {
        corrector::Status::Corrected => CorrectionStatus::Corrected,
        corrector::Status::Held => CorrectionStatus::Held,
        corrector::Status::Ramping => CorrectionStatus::Ramping,
        corrector::Status::Bypassed => CorrectionStatus::Bypassed,
        corrector::Status::Rejected => CorrectionStatus::Rejected,
        corrector::Status::Shadow => CorrectionStatus::Shadow,
        corrector::Status::Limited => CorrectionStatus::Limited,
    }
}

fn reason(reason: corrector::Reason) -> Reason {
    match reason {
        corrector::Reason::None => Reason::None,
        corrector::Reason::NotFinite => Reason::NotFinite,
        corrector::Reason::OutOfLimits => Reason::OutOfLimits,
        corrector::Reason::OutOfOrder => Reason::OutOfOrder,
        corrector::Reason::Stale => Reason::Stale,
        corrector::Reason::Duplicate => Reason::Duplicate,
        corrector::Reason::WrongJointCount => Reason::WrongJointCount,
        corrector::Reason::NotConverged => Reason::NotConverged,
        corrector::Reason::Envelope => Reason::Envelope,
        corrector::Reason::Bypass => Reason::Bypass,
        corrector::Reason::ModelChanged => Reason::ModelChanged,
        corrector::Reason::Starting => Reason::Starting,
        corrector::Reason::TimeJump => Reason::TimeJump,
        corrector::Reason::ShadowMode => Reason::ShadowMode,
        corrector::Reason::JointLimit => Reason::JointLimit,
        corrector::Reason::CommandJump => Reason::CommandJump,
        corrector::Reason::Singular => Reason::Singular,
    }
}

/// State and reason of the trim as message codes.
pub fn trim(report: &TrimReport) -> (TrimState, TrimReason) {
    let state = match report.state {
        corrector::TrimState::Off => TrimState::Off,
        corrector::TrimState::Waiting => TrimState::Waiting,
        corrector::TrimState::Observing => TrimState::Observing,
        corrector::TrimState::Trimming => TrimState::Trimming,
        corrector::TrimState::Holding => TrimState::Holding,
        corrector::TrimState::Ramping => TrimState::Ramping,
    };
    let reason = match report.reason {
        corrector::TrimReason::None => TrimReason::None,
        corrector::TrimReason::NoMeasurement => TrimReason::NoMeasurement,
        corrector::TrimReason::NotFinite => TrimReason::NotFinite,
        corrector::TrimReason::OutOfOrder => TrimReason::OutOfOrder,
        corrector::TrimReason::Late => TrimReason::Late,
        corrector::TrimReason::Ahead => TrimReason::Ahead,
        corrector::TrimReason::NotPredicted => TrimReason::NotPredicted,
        corrector::TrimReason::Jumped => TrimReason::Jumped,
        corrector::TrimReason::Bounded => TrimReason::Bounded,
    };
    (state, reason)
}

/// State and reason of the feed override as message codes.
pub fn feed(report: &FeedReport) -> (FeedState, FeedReason) {
    let state = match report.state {
        corrector::FeedState::Off => FeedState::Off,
        corrector::FeedState::Lost => FeedState::Lost,
        corrector::FeedState::Observing => FeedState::Observing,
        corrector::FeedState::Air => FeedState::Air,
        corrector::FeedState::Adapting => FeedState::Adapting,
        corrector::FeedState::Holding => FeedState::Holding,
    };
    let reason = match report.reason {
        corrector::FeedReason::None => FeedReason::None,
        corrector::FeedReason::NoWrench => FeedReason::NoWrench,
        corrector::FeedReason::Stale => FeedReason::Stale,
        corrector::FeedReason::SensorFault => FeedReason::SensorFault,
        corrector::FeedReason::NotFinite => FeedReason::NotFinite,
        corrector::FeedReason::NoDeflection => FeedReason::NoDeflection,
        corrector::FeedReason::AtRest => FeedReason::AtRest,
        corrector::FeedReason::AtFloor => FeedReason::AtFloor,
    };
    (state, reason)
}

fn gate(gate: GateState) -> WrenchGate {
    match gate {
        GateState::Absent => WrenchGate::Absent,
        GateState::Open => WrenchGate::Open,
        GateState::Partly => WrenchGate::Ramping,
        GateState::GainTooHigh => WrenchGate::GainTooHigh,
        GateState::Stale => WrenchGate::Stale,
        GateState::Off => WrenchGate::Off,
        GateState::SensorFault => WrenchGate::SensorFault,
    }
}
