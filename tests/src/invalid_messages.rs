//! Invalid commands, each with the expected reason.

use crate::cell_loop::{JOINTS, path};
use crate::rng::TestRng;
use shm_schema::{
    Command, ForceBlock, Horizon, JOINTS_MAX, Payload, Reason, Request, RobotState, Text,
    monotonic_ns,
};

/// Expected handling of a message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Expected {
    /// Accepted as a valid command.
    Taken,
    /// Refused, with this reason in the answer.
    Refused(Reason),
    /// Unreadable: no answer, but counted.
    Malformed,
    /// Any random content.
    Anything,
}

/// Number of kinds of invalid commands.
pub const KINDS: u64 = 21;

/// A stream of valid and invalid commands.
#[derive(Clone, Debug)]
pub struct CommandSource {
    /// Source of all random numbers.
    pub chance: TestRng,
    /// The last valid command sent.
    pub last: Command,
    /// The time, if it is not that of the system.
    pub now_ns: Option<u64>,
}

impl CommandSource {
    /// A stream by its seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self { chance: TestRng::new(seed), last: Command::default(), now_ns: None }
    }

    /// Starts another session: its numbers and times restart.
    pub fn start_session(&mut self) {
        self.last = Command { session: self.chance.next_u64(), ..Command::default() };
    }

    /// The next valid command.
    pub fn next_valid(&mut self) -> Command {
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
    pub fn next_invalid(&mut self, kind: u64) -> (Command, Expected, bool) {
        let before = self.last;
        let mut c = self.next_valid();
        self.last = before;
        let joint = self.chance.below(JOINTS as u64) as usize;
        let refused = Expected::Refused;
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
            8 => set(&mut c.joints, 0, Expected::Malformed),
            9 => set(&mut c.joints, u32::MAX, Expected::Malformed),
            10 => set(&mut c.layout, Command::LAYOUT + 1, Expected::Malformed),
            11 => set(&mut c, before, refused(Reason::Duplicate)),
            12 => set(&mut c.seq, before.seq.saturating_sub(1), refused(Reason::OutOfOrder)),
            13 => set(&mut c.t_ns, before.t_ns, refused(Reason::OutOfOrder)),
            14 => {
                let back_ns = before.t_ns.saturating_sub(500_000_000);
                set(&mut c.t_ns, back_ns, refused(Reason::OutOfOrder))
            }
            15 => set(&mut c.sent_ns, 0, refused(Reason::Stale)),
            16 => self.jump_within_limits(&mut c),
            17 | 18 => {
                of_use = false;
                if kind == 17 {
                    c.t_ns = u64::MAX;
                } else {
                    c.seq = u64::MAX;
                }
                Expected::Taken
            }
            19 => {
                of_use = false;
                self.randomise(&mut c);
                Expected::Anything
            }
            _ => self.corrupt_unused_fields(&mut c),
        };
        if due == Expected::Taken && of_use {
            self.last = c;
        }
        (c, due, of_use)
    }

    /// A jump to another position within the limits.
    fn jump_within_limits(&mut self, c: &mut Command) -> Expected {
        for q in &mut c.q[..JOINTS] {
            *q += self.chance.uniform() - 0.5;
        }
        Expected::Taken
    }

    /// Valid joints, with arbitrary values in the unused elements.
    fn corrupt_unused_fields(&mut self, c: &mut Command) -> Expected {
        c.flags = self.chance.next_u64() as u32;
        c.direction = [(); JOINTS_MAX].map(|()| self.chance.next_u64() as i8);
        c.wrench = [(); 6].map(|()| self.any_number());
        c.temperature_c = [(); JOINTS_MAX + 1].map(|()| self.any_number());
        c.feed_override = self.any_number();
        c.sent_ns = u64::MAX;
        Expected::Taken
    }

    fn randomise(&mut self, c: &mut Command) {
        let bits = |chance: &mut TestRng| f64::from_bits(chance.next_u64());
        let Self { chance, .. } = self;
        *c = Command {
            seq: chance.next_u64(),
            session: chance.next_u64(),
            t_ns: chance.next_u64(),
            sent_ns: if chance.below(2) == 0 { chance.next_u64() } else { c.sent_ns },
            layout: if chance.below(4) == 0 { chance.next_u64() as u32 } else { c.layout },
            joints: if chance.below(4) == 0 { chance.next_u64() as u32 } else { c.joints },
            flags: chance.next_u64() as u32,
            direction: [(); JOINTS_MAX].map(|()| chance.next_u64() as i8),
            reserved: chance.next_u64() as u32,
            q: [(); JOINTS_MAX].map(|()| bits(chance)),
            wrench: [(); 6].map(|()| bits(chance)),
            temperature_c: [(); JOINTS_MAX + 1].map(|()| bits(chance)),
            feed_override: bits(chance),
        };
    }

    /// Any number, including NaN.
    pub fn any_number(&mut self) -> f64 {
        match self.chance.below(6) {
            0 => f64::NAN,
            1 => f64::INFINITY,
            2 => -f64::MAX,
            3 => f64::from_bits(self.chance.next_u64()),
            4 => 0.0,
            _ => 200.0 * (self.chance.uniform() - 0.5),
        }
    }

    /// Arbitrary force samples.
    pub fn fill_force_block(&mut self, block: &mut ForceBlock) {
        let Self { chance, .. } = self;
        let odd = chance.below(3) == 0;
        block.seq = if odd {
            [u64::MAX, 0, chance.next_u64()][chance.below(3) as usize]
        } else {
            block.seq.wrapping_add(1)
        };
        block.t_ns = if chance.below(10) == 0 { u64::MAX } else { monotonic_ns() };
        block.channels = if chance.below(20) == 0 { chance.next_u64() as u32 } else { 3 };
        block.samples = if chance.below(20) == 0 { chance.next_u64() as u32 } else { 10 };
        block.layout = ForceBlock::LAYOUT + u32::from(chance.below(20) == 0);
        block.flags = chance.next_u64() as u32;
        block.rate_hz = if chance.below(5) == 0 { self.any_number() } else { 10_000.0 };
        for i in 0..30 {
            block.data[i] = if odd { self.any_number() } else { self.chance.uniform() };
        }
    }

    /// An arbitrary robot state.
    pub fn any_state(&mut self) -> RobotState {
        let mut state =
            RobotState { flags: self.chance.next_u64() as u32, ..RobotState::default() };
        state.joints = if self.chance.below(4) == 0 { self.chance.next_u64() as u32 } else { 6 };
        state.t_ns = self.chance.next_u64();
        state.temperature_c = [(); JOINTS_MAX + 1].map(|()| self.any_number());
        state.q_measured = [(); JOINTS_MAX].map(|()| self.any_number());
        state
    }

    /// Arbitrary setpoints after the last valid command; half of the horizons follow the path.
    pub fn fill_horizon(&mut self, horizon: &mut Horizon) {
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
            0 => horizon.session = self.chance.next_u64(),
            1 => horizon.command_seq = self.chance.next_u64(),
            2 => horizon.sent_ns = [0, u64::MAX][self.chance.below(2) as usize],
            3 => horizon.count = self.chance.next_u64() as u32,
            4 => horizon.layout += 1,
            5 => {
                for q in horizon.points.iter_mut().flatten() {
                    *q = self.any_number();
                }
            }
            _ => {}
        }
    }

    /// A request that changes nothing on which the test relies.
    pub fn harmless_request(&mut self) -> Request {
        let operation =
            if self.chance.below(2) == 0 { 4 } else { 5 + self.chance.next_u64() as u32 / 2 };
        Request {
            seq: self.chance.next_u64(),
            session: self.chance.next_u64(),
            operation,
            on: self.chance.next_u64() as u32,
            teeth: self.chance.next_u64() as u32,
            spindle_rpm: self.any_number(),
            feed_mm_s: self.any_number(),
            path: Text::new("../\u{7}\u{feff}"),
            ..Request::default()
        }
    }
}

fn set<T>(place: &mut T, value: T, due: Expected) -> Expected {
    *place = value;
    due
}
