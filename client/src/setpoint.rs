//! Commanded joint targets and measured state of the robot.

use shm_schema::{Command, JOINTS_MAX};

use crate::InvalidTarget;

/// Axes of a wrench; always at the TCP.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WrenchFrame {
    /// The tool's.
    Tool,
    /// The base's.
    Base,
}

/// One commanded joint target with optional inputs.
#[derive(Debug, Clone, Copy)]
pub struct Setpoint {
    joints: usize,
    command: Command,
}

impl Setpoint {
    /// Joint angles in rad (lengths in m), 1 to 16; valid now.
    #[must_use]
    pub fn new(q: &[f64]) -> Self {
        let mut command = Command::default();
        let kept = q.len().min(JOINTS_MAX);
        command.q[..kept].copy_from_slice(&q[..kept]);
        command.joints = kept as u32;
        Self { joints: q.len(), command }
    }

    /// The commanded joints, rad or m; of more than 16 the first 16.
    #[must_use]
    pub fn joints(&self) -> &[f64] {
        self.command.joints()
    }

    /// Time for which the target is valid, ns, instead of now: `CLOCK_MONOTONIC`, or a recording's time in a replay.
    #[must_use]
    pub fn at_ns(mut self, t_ns: u64) -> Self {
        self.command.t_ns = t_ns;
        self
    }

    /// Wrench acting on the robot at the TCP: force in N, moment in N·m.
    #[must_use]
    pub fn wrench(mut self, wrench: [f64; 6], frame: WrenchFrame) -> Self {
        self.command.wrench = wrench;
        self.command.flags |= Command::HAS_WRENCH;
        match frame {
            WrenchFrame::Tool => self.command.flags &= !Command::WRENCH_IN_BASE,
            WrenchFrame::Base => self.command.flags |= Command::WRENCH_IN_BASE,
        }
        self
    }

    /// Ambient and joint temperatures, °C; NaN where unknown. Joints beyond 16 are ignored.
    #[must_use]
    pub fn temperatures(mut self, ambient_c: f64, joints_c: &[f64]) -> Self {
        self.command.temperature_c = [f64::NAN; JOINTS_MAX + 1];
        self.command.temperature_c[0] = ambient_c;
        for (to, from) in self.command.temperature_c[1..].iter_mut().zip(joints_c) {
            *to = *from;
        }
        self.command.flags |= Command::HAS_TEMPERATURE;
        self
    }

    /// Direction of approach of each joint: −1, 0 or 1.
    #[must_use]
    pub fn direction(mut self, direction: &[i8]) -> Self {
        for (to, from) in self.command.direction.iter_mut().zip(direction) {
            *to = from.signum();
        }
        self.command.flags |= Command::HAS_DIRECTION;
        self
    }

    /// A pose at rest, without rate or jerk bound. Honoured only in a lockstep replay.
    #[must_use]
    pub fn settled(mut self) -> Self {
        self.command.flags |= Command::SETTLED;
        self
    }

    /// The message with its number and time stamps; [`Client::send`](crate::Client::send) sends this one.
    ///
    /// # Errors
    /// [`InvalidTarget`] if the joints are not 1 to 16 finite numbers.
    pub fn command(&self, seq: u64, session: u64, now_ns: u64) -> Result<Command, InvalidTarget> {
        if self.joints > JOINTS_MAX {
            return Err(InvalidTarget::Joints(self.joints));
        }
        InvalidTarget::check(self.command.joints())?;
        let t_ns = if self.command.t_ns == 0 { now_ns } else { self.command.t_ns };
        Ok(Command { seq, session, t_ns, sent_ns: now_ns, ..self.command })
    }
}

impl<const N: usize> From<[f64; N]> for Setpoint {
    fn from(q: [f64; N]) -> Self {
        Self::new(&q)
    }
}

impl From<&[f64]> for Setpoint {
    fn from(q: &[f64]) -> Self {
        Self::new(q)
    }
}
