//! A client, without the client library, that overwrites its messages in shared memory after
//! sending them: every byte may change while the daemon reads it.
//!
//! Meanwhile the daemon's answers are checked against the limits. Only the client's own messages
//! are modified, not the data of the transport.

use crate::cell_loop::{JOINTS, path};
use crate::place::TestDirectory;
use crate::process::Process;
use crate::rate_check::RateCheck;
use crate::rng::TestRng;
use crate::served_cell::AWAIT_LIMIT;
use rustix::process::Signal;
use shm_schema::{
    Command, Corrected, CorrectionStatus, ForceBlock, JOINTS_MAX, JoinError, JointBounds,
    PeerPublisher, PeerSubscriber, Role, RoleClaim, SendOutcome, Status, monotonic_ns,
};
use std::fs::{File, OpenOptions};
use std::os::unix::fs::FileExt;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};

const ROUNDING: f64 = 1e-12;
/// Interval between two requests for a new epoch.
const REQUEST_INTERVAL: Duration = Duration::from_millis(300);

/// A file of the cell's memory, the positions of its messages, and their length.
type MessageLocations = (File, Vec<u64>, u64);

/// The client, in the roles of the robot and of the force source.
pub struct MessageCorruptor {
    _seats: [RoleClaim; 2],
    ports: Ports,
    bounds: JointBounds,
    gauge: RateCheck,
    /// Prefix of the names of the cell's shared memory.
    prefix: String,
    session: u64,
    seq: u64,
}

/// The ports of both roles, in one epoch.
struct Ports {
    commands: PeerPublisher<Command>,
    answers: PeerSubscriber<Corrected>,
    blocks: PeerPublisher<ForceBlock>,
    statuses: PeerSubscriber<Status>,
}

impl Ports {
    fn join(seats: &mut [RoleClaim; 2]) -> Result<Self, JoinError> {
        let [cell, force] = seats;
        let (cell, force) = (cell.join()?, force.join()?);
        Ok(Self {
            commands: cell.publisher()?,
            answers: cell.subscriber()?,
            blocks: force.publisher()?,
            statuses: cell.subscriber()?,
        })
    }

    /// The limits sent by the daemon; `None` if it sends none.
    fn bounds(&mut self) -> Option<JointBounds> {
        let start = Instant::now();
        while start.elapsed() < REQUEST_INTERVAL {
            if let Some(status) = self.statuses.take_newest() {
                return Some(status.bounds);
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        None
    }
}

impl MessageCorruptor {
    /// Takes both roles, which must be free or become free; panics with the daemon's output if that
    /// fails.
    #[must_use]
    pub fn join(place: &TestDirectory, daemon: &Process, session: u64) -> Self {
        let mut seats = [Role::Cell, Role::Force].map(|role| RoleClaim::new(&place.cell(), role));
        let (start, mut knocked) = (Instant::now(), Instant::now());
        let (ports, bounds) = loop {
            let why = match Ports::join(&mut seats) {
                Ok(mut ports) => match ports.bounds() {
                    Some(bounds) => break (ports, bounds),
                    None => "no status".to_owned(),
                },
                Err(why) => why.to_string(),
            };
            assert!(
                start.elapsed() < AWAIT_LIMIT,
                "{why}: {:#?} {:#?}",
                daemon.lines(),
                daemon.waits()
            );
            std::thread::sleep(Duration::from_millis(2));
            // Like the library: an epoch whose files are gone cannot be joined.
            if let Some(current) =
                seats[0].current_epoch().ok().filter(|_| knocked.elapsed() > REQUEST_INTERVAL)
            {
                seats[0].request_new_epoch(current.epoch);
                knocked = Instant::now();
            }
        };
        let gauge = RateCheck::new(&bounds.rate[..JOINTS]);
        let prefix = place.cell().shared_memory_prefix();
        Self { _seats: seats, ports, bounds, gauge, prefix, session, seq: 0 }
    }

    fn send(&mut self) -> SendOutcome {
        self.seq += 1;
        let now_ns = monotonic_ns();
        let mut q = [0.0; JOINTS_MAX];
        q[..JOINTS].copy_from_slice(&path(now_ns));
        let (seq, session, t_ns, sent_ns) = (self.seq, self.session, now_ns, now_ns);
        let (channels, samples, rate_hz) = (3, 10, 1e4);
        let block = ForceBlock { seq, session, t_ns, channels, samples, rate_hz, ..<_>::default() };
        self.ports.blocks.send(&block);
        let joints = JOINTS as u32;
        self.ports.commands.send(&Command {
            seq,
            session,
            t_ns,
            sent_ns,
            joints,
            q,
            ..<_>::default()
        })
    }

    /// The newest answer, checked against the limits.
    fn take_answer(&mut self) -> Option<Corrected> {
        let answer = self.ports.answers.take_newest()?;
        for i in 0..answer.joints as usize {
            let is_bounded = answer.correction[i].abs() <= self.bounds.angle[i] + ROUNDING;
            assert!(is_bounded, "{answer:?}");
        }
        self.gauge.take(answer.made_ns, &answer.correction[..JOINTS]).expect("within its rate");
        Some(answer)
    }

    /// Sends a number of messages and overwrites them meanwhile; returns the number of answers
    /// checked and of words written.
    pub fn corrupt_messages(&mut self, daemon: &Process, messages: u64, rng: TestRng) -> [u64; 2] {
        // While the daemon is stopped, the messages in memory belong to this side alone.
        daemon.signal(Signal::STOP);
        std::thread::sleep(Duration::from_millis(50));
        for _ in 0..4 {
            assert_eq!(self.send(), SendOutcome::Delivered);
        }
        let places = self.message_locations();
        daemon.signal(Signal::CONT);
        assert_eq!(places.len(), 2, "commands and blocks are found in memory");
        let (over, written) = (AtomicBool::new(false), AtomicU64::new(0));
        let mut answers = 0;
        std::thread::scope(|scope| {
            scope.spawn(|| overwrite(&places, &over, &written, rng));
            // A failed check ends the other thread too.
            let _end = StopOnDrop(&over);
            for _ in 0..messages {
                self.send();
                std::thread::sleep(Duration::from_micros(300));
                answers += u64::from(self.take_answer().is_some());
            }
        });
        [answers, written.into_inner()]
    }

    /// Continues as another session until the daemon corrects it normally; returns the elapsed
    /// time.
    pub fn wait_corrected(&mut self) -> Duration {
        self.session += 1;
        let (start, mut good) = (Instant::now(), 0);
        while good < 100 {
            assert!(start.elapsed() < AWAIT_LIMIT, "not corrected again");
            self.send();
            std::thread::sleep(Duration::from_millis(1));
            let Some(answer) = self.take_answer() else { continue };
            let corrected = answer.status() == Ok(CorrectionStatus::Corrected);
            good += u32::from(answer.command_session == self.session && corrected);
        }
        start.elapsed()
    }

    /// Locations of this session's messages in shared memory.
    fn message_locations(&self) -> Vec<MessageLocations> {
        let mut found = Vec::new();
        for entry in std::fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
            let ours = entry.file_name().to_string_lossy().starts_with(&self.prefix);
            let Some(bytes) = std::fs::read(entry.path()).ok().filter(|_| ours) else { continue };
            // `session` is the second number of both kinds.
            let numbers = bytes.chunks_exact(8).zip(0_u64..);
            let sessions = numbers.filter(|(value, _)| *value == self.session.to_ne_bytes());
            let begins: Vec<u64> = sessions.map(|(_, number)| 8 * number - 8).collect();
            let force = bytes.len() > 8 * size_of::<ForceBlock>();
            let size = if force { size_of::<ForceBlock>() } else { size_of::<Command>() };
            if !begins.is_empty() {
                let file = OpenOptions::new().write(true).open(entry.path()).expect("our memory");
                found.push((file, begins, size as u64));
            }
        }
        found
    }
}

/// Overwrites all of them with arbitrary bytes or NaN until stopped.
fn overwrite(
    places: &[MessageLocations],
    over: &AtomicBool,
    written: &AtomicU64,
    mut rng: TestRng,
) {
    while !over.load(Relaxed) {
        for (file, begins, size) in places {
            let begin = begins[rng.below(begins.len() as u64) as usize];
            let offset = begin + 8 * rng.below(size / 8);
            let bytes = match rng.below(4) {
                0 => f64::NAN.to_ne_bytes(),
                1 => f64::INFINITY.to_ne_bytes(),
                2 => (f64::from_bits(rng.next_u64())).to_ne_bytes(),
                _ => rng.next_u64().to_ne_bytes(),
            };
            let length = 1 + rng.below(8) as usize;
            file.write_all_at(&bytes[..length], offset).expect("memory can be written");
            written.fetch_add(1, Relaxed);
        }
    }
}

struct StopOnDrop<'a>(&'a AtomicBool);

impl Drop for StopOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Relaxed);
    }
}
