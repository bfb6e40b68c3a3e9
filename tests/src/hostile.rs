//! Invalid commands, each with the expected reason.

use crate::cell_loop::{JOINTS, path};
use crate::chance::Chance;
use shm_schema::{
    Command, ForceBlock, Horizon, JOINTS_MAX, Payload, Reason, Request, RobotState, Text,
    monotonic_ns,
};

/// What must become of a message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Due {
    /// Accepted as a valid command.
    Taken,
    /// Refused, with this reason in the answer.
    Refused(Reason),
    /// It cannot be read: no answer, a count.
    Malformed,
    /// Any random content.
    Anything,
}

/// How many kinds of bad commands there are.
pub const KINDS: u64 = 21;

/// A stream of commands, good and bad.
#[derive(Clone, Debug)]
pub struct Sender {
    /// All chance.
    pub chance: Chance,
    /// The command sent last that was meant well.
    pub last: Command,
    /// The time, where it is not the system's.
    pub now_ns: Option<u64>,
}

impl Sender {
    /// A stream by seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self { chance: Chance::new(seed), last: Command::default(), now_ns: None }
    }

    /// Starts another session: its numbers and times restart.
    pub fn start_anew(&mut self) {
        self.last = Command { session: self.chance.bits(), ..Command::default() };
    }

    /// The next good command.
    pub fn good(&mut self) -> Command {
        let now_ns = self.now_ns.unwrap_or_else(monotonic_ns);
        let t_ns = now_ns.max(self.last.t_ns + 1);
        let mut q = [0.0; JOINTS_MAX];
        q[..JOINTS].copy_from_slice(&path(now_ns));
        let joints = JOINTS as u32;
        self.last = Command {
            seq: self.last.seq + 1,
            session: self.last.session,
            t_ns,
            sent_ns: now_ns,
            joints,
            q,
            ..Command::default()
        };
        self.last
    }

    /// A command that differs from a valid one in one way, or in all; returns whether the session
    /// is usable afterwards.
    pub fn bad(&mut self, kind: u64) -> (Command, Due, bool) {
        let before = self.last;
        let mut c = self.good();
        self.last = before;
        let joint = self.chance.below(JOINTS as u64) as usize;
        let refused = Due::Refused;
        let mut of_use = true;
        let due = match kind {
            0 => set(&mut c.q[joint], f64::NAN, refused(Reason::NotFinite)),
            1 => set(&mut c.q[joint], f64::INFINITY, refused(Reason::NotFinite)),
            2 => set(&mut c.q[joint], f64::NEG_INFINITY, refused(Reason::NotFinite)),
            3 => set(&mut c.q[JOINTS_MAX - 1], f64::NAN, refused(Reason::NotFinite)),
            4 => set(&mut c.q[joint], 1e3, refused(Reason::OutOfLimits)),
            5 => set(&mut c.q[joint], -f64::MAX, refused(Reason::OutOfLimits)),
            6 => set(&mut c.joints, 5, refused(Reason::WrongJointCount)),
            7 => set(&mut c.joints, 16, refused(Reason::WrongJointCount)),
            8 => set(&mut c.joints, 0, Due::Malformed),
            9 => set(&mut c.joints, u32::MAX, Due::Malformed),
            10 => set(&mut c.layout, Command::LAYOUT + 1, Due::Malformed),
            11 => set(&mut c, before, refused(Reason::Duplicate)),
            12 => set(&mut c.seq, before.seq.saturating_sub(1), refused(Reason::OutOfOrder)),
            13 => set(&mut c.t_ns, before.t_ns, refused(Reason::OutOfOrder)),
            14 => {
                let back_ns = before.t_ns.saturating_sub(500_000_000);
                set(&mut c.t_ns, back_ns, refused(Reason::OutOfOrder))
            }
            15 => set(&mut c.sent_ns, 0, refused(Reason::Stale)),
            16 => self.far_away(&mut c),
            17 | 18 => {
                of_use = false;
                if kind == 17 {
                    c.t_ns = u64::MAX;
                } else {
                    c.seq = u64::MAX;
                }
                Due::Taken
            }
            19 => {
                of_use = false;
                self.all_bits(&mut c);
                Due::Anything
            }
            _ => self.beside_the_joints(&mut c),
        };
        if due == Due::Taken && of_use {
            self.last = c;
        }
        (c, due, of_use)
    }

    /// A jump to another place within the limits.
    fn far_away(&mut self, c: &mut Command) -> Due {
        for q in &mut c.q[..JOINTS] {
            *q += self.chance.unit() - 0.5;
        }
        Due::Taken
    }

    /// Joints as they should be, nonsense around them.
    fn beside_the_joints(&mut self, c: &mut Command) -> Due {
        c.flags = self.chance.bits() as u32;
        c.direction = [(); JOINTS_MAX].map(|()| self.chance.bits() as i8);
        c.wrench = [(); 6].map(|()| self.number());
        c.temperature_c = [(); JOINTS_MAX + 1].map(|()| self.number());
        c.feed_override = self.number();
        c.sent_ns = u64::MAX;
        Due::Taken
    }

    fn all_bits(&mut self, c: &mut Command) {
        let bits = |chance: &mut Chance| f64::from_bits(chance.bits());
        let Self { chance, .. } = self;
        *c = Command {
            seq: chance.bits(),
            session: chance.bits(),
            t_ns: chance.bits(),
            sent_ns: if chance.below(2) == 0 { chance.bits() } else { c.sent_ns },
            layout: if chance.below(4) == 0 { chance.bits() as u32 } else { c.layout },
            joints: if chance.below(4) == 0 { chance.bits() as u32 } else { c.joints },
            flags: chance.bits() as u32,
            direction: [(); JOINTS_MAX].map(|()| chance.bits() as i8),
            reserved: chance.bits() as u32,
            q: [(); JOINTS_MAX].map(|()| bits(chance)),
            wrench: [(); 6].map(|()| bits(chance)),
            temperature_c: [(); JOINTS_MAX + 1].map(|()| bits(chance)),
            feed_override: bits(chance),
        };
    }

    /// Any number, including NaN.
    pub fn number(&mut self) -> f64 {
        match self.chance.below(6) {
            0 => f64::NAN,
            1 => f64::INFINITY,
            2 => -f64::MAX,
            3 => f64::from_bits(self.chance.bits()),
            4 => 0.0,
            _ => 200.0 * (self.chance.unit() - 0.5),
        }
    }

    /// Force samples of any kind.
    pub fn force(&mut self, block: &mut ForceBlock) {
        let Self { chance, .. } = self;
        let odd = chance.below(3) == 0;
        block.seq = if odd {
            [u64::MAX, 0, chance.bits()][chance.below(3) as usize]
        } else {
            block.seq.wrapping_add(1)
        };
        block.t_ns = if chance.below(10) == 0 { u64::MAX } else { monotonic_ns() };
        block.channels = if chance.below(20) == 0 { chance.bits() as u32 } else { 3 };
        block.samples = if chance.below(20) == 0 { chance.bits() as u32 } else { 10 };
        block.layout = ForceBlock::LAYOUT + u32::from(chance.below(20) == 0);
        block.flags = chance.bits() as u32;
        block.rate_hz = if chance.below(5) == 0 { self.number() } else { 10_000.0 };
        for i in 0..30 {
            block.data[i] = if odd { self.number() } else { self.chance.unit() };
        }
    }

    /// A robot's state of any kind.
    pub fn state(&mut self) -> RobotState {
        let mut state = RobotState { flags: self.chance.bits() as u32, ..RobotState::default() };
        state.joints = if self.chance.below(4) == 0 { self.chance.bits() as u32 } else { 6 };
        state.t_ns = self.chance.bits();
        state.temperature_c = [(); JOINTS_MAX + 1].map(|()| self.number());
        state.q_measured = [(); JOINTS_MAX].map(|()| self.number());
        state
    }

    /// Setpoints that follow the last good command, of any kind: half of them those of the path.
    pub fn horizon(&mut self, horizon: &mut Horizon) {
        horizon.seq += 1;
        horizon.session = self.last.session;
        horizon.command_seq = self.last.seq;
        horizon.sent_ns = monotonic_ns();
        horizon.layout = Horizon::LAYOUT;
        horizon.count = self.chance.below(Horizon::POINTS_MAX as u64 + 1) as u32;
        for (k, point) in (1..).zip(&mut horizon.points) {
            point[..JOINTS].copy_from_slice(&path(self.last.t_ns + k * 1_000_000));
        }
        match self.chance.below(12) {
            0 => horizon.session = self.chance.bits(),
            1 => horizon.command_seq = self.chance.bits(),
            2 => horizon.sent_ns = [0, u64::MAX][self.chance.below(2) as usize],
            3 => horizon.count = self.chance.bits() as u32,
            4 => horizon.layout += 1,
            5 => {
                for q in horizon.points.iter_mut().flatten() {
                    *q = self.number();
                }
            }
            _ => {}
        }
    }

    /// A request that changes nothing on which the test relies.
    pub fn request(&mut self) -> Request {
        let operation =
            if self.chance.below(2) == 0 { 4 } else { 5 + self.chance.bits() as u32 / 2 };
        Request {
            seq: self.chance.bits(),
            session: self.chance.bits(),
            operation,
            on: self.chance.bits() as u32,
            teeth: self.chance.bits() as u32,
            spindle_rpm: self.number(),
            feed_mm_s: self.number(),
            path: Text::new("../\u{7}\u{feff}"),
            ..Request::default()
        }
    }
}

fn set<T>(place: &mut T, value: T, due: Due) -> Due {
    *place = value;
    due
}
