//! A client that writes into its messages after it has sent them: every byte that the daemon reads may change under its eyes.

use super::chance;
use crate::TRUED;
use rustix::process::Signal;
use shm_schema::{
    Command, Corrected, ForceBlock, JOINTS_MAX, JointBounds, PeerPublisher, PeerSubscriber, Role,
    Seat, SendOutcome, Status, monotonic_ns,
};
use std::fs::{File, OpenOptions};
use std::os::unix::fs::FileExt;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};
use tests::cell_loop::{JOINTS, path};
use tests::chance::Chance;
use tests::gauge::Gauge;
use tests::pair::{JAM, recorder};
use tests::place::Place;
use tests::process::Process;

/// Names this test's messages in memory.
const SESSION: u64 = 0x7275_6564_2d66_6c74;
const ROUNDS: u64 = 1500;
const ROUNDING: f64 = 1e-12;

/// Places of this session's messages in the cell's memory: the file, where in it they begin, how long they are.
fn places(place: &Place) -> Vec<(File, Vec<u64>, u64)> {
    let prefix = place.cell().shared_memory_prefix();
    let mut found = Vec::new();
    for entry in std::fs::read_dir("/dev/shm").unwrap().flatten() {
        let ours = entry.file_name().to_string_lossy().starts_with(&prefix);
        let Some(bytes) = std::fs::read(entry.path()).ok().filter(|_| ours) else { continue };
        // `session` is the second number of both kinds.
        let at = bytes.chunks_exact(8).zip(0..).filter(|(word, _)| *word == SESSION.to_ne_bytes());
        let begins: Vec<u64> = at.map(|(_, number): (_, u64)| 8 * number - 8).collect();
        let force = bytes.len() > 8 * size_of::<ForceBlock>();
        let size = if force { size_of::<ForceBlock>() } else { size_of::<Command>() };
        if !begins.is_empty() {
            let file = OpenOptions::new().write(true).open(entry.path()).unwrap();
            found.push((file, begins, size as u64));
        }
    }
    found
}

/// Writes into all of them until told to end: any bytes, or numbers that are none.
fn scribble(
    places: &[(File, Vec<u64>, u64)],
    over: &AtomicBool,
    written: &AtomicU64,
    mut chance: Chance,
) {
    while !over.load(Relaxed) {
        for (file, begins, size) in places {
            let begin = begins[chance.below(begins.len() as u64) as usize];
            let at = begin + 8 * chance.below(size / 8);
            let bytes = match chance.below(4) {
                0 => f64::NAN.to_ne_bytes(),
                1 => f64::INFINITY.to_ne_bytes(),
                2 => (f64::from_bits(chance.bits())).to_ne_bytes(),
                _ => chance.bits().to_ne_bytes(),
            };
            let length = 1 + chance.below(8) as usize;
            file.write_all_at(&bytes[..length], at).unwrap();
            written.fetch_add(1, Relaxed);
        }
    }
}

struct End<'a>(&'a AtomicBool);

impl Drop for End<'_> {
    fn drop(&mut self) {
        self.0.store(true, Relaxed);
    }
}

/// A client without the library, and what it is told.
struct Cell {
    _seats: [Seat; 2],
    commands: PeerPublisher<Command>,
    answers: PeerSubscriber<Corrected>,
    blocks: PeerPublisher<ForceBlock>,
    bounds: JointBounds,
    gauge: Gauge,
    seq: u64,
}

impl Cell {
    fn join(place: &Place) -> Self {
        let mut seats = [Role::Cell, Role::Force].map(|role| Seat::new(&place.cell(), role));
        let [cell, force] = [0, 1].map(|i| seats[i].join().unwrap());
        let mut statuses = cell.subscriber::<Status>().unwrap();
        let mut bounds = None;
        assert!(super::wait_for(JAM, || {
            bounds = statuses.take_newest().map(|status| status.bounds).or(bounds);
            bounds.is_some()
        }));
        let bounds = bounds.unwrap();
        Self {
            _seats: seats,
            commands: cell.publisher().unwrap(),
            answers: cell.subscriber().unwrap(),
            blocks: force.publisher().unwrap(),
            gauge: Gauge::new(&bounds.rate[..JOINTS]),
            bounds,
            seq: 0,
        }
    }

    fn send(&mut self, session: u64) -> SendOutcome {
        self.seq += 1;
        let now_ns = monotonic_ns();
        let mut q = [0.0; JOINTS_MAX];
        q[..JOINTS].copy_from_slice(&path(now_ns));
        let (seq, t_ns, sent_ns, joints) = (self.seq, now_ns, now_ns, JOINTS as u32);
        let (channels, samples, rate_hz) = (3, 10, 1e4);
        self.blocks.send(&ForceBlock {
            seq,
            session,
            t_ns,
            channels,
            samples,
            rate_hz,
            ..ForceBlock::default()
        });
        self.commands.send(&Command {
            seq,
            session,
            t_ns,
            sent_ns,
            joints,
            q,
            ..Command::default()
        })
    }

    /// The newest answer, held against the bounds.
    fn hear(&mut self) -> Option<Corrected> {
        let said = self.answers.take_newest()?;
        for i in 0..said.joints as usize {
            let inside = (self.bounds.min[i]..=self.bounds.max[i]).contains(&said.q[i]);
            let near = said.correction[i].abs() <= self.bounds.angle[i] + ROUNDING;
            assert!(inside && near, "{said:?}");
        }
        self.gauge.take(said.made_ns, &said.correction[..JOINTS]).unwrap();
        Some(said)
    }

    /// Until that session is corrected as if nothing had been.
    fn corrected_again(&mut self, session: u64) {
        let mut good = 0;
        let start = Instant::now();
        while good < 100 {
            assert!(start.elapsed() < JAM, "not corrected again");
            self.send(session);
            std::thread::sleep(Duration::from_millis(1));
            let Some(answer) = self.hear() else { continue };
            let corrected = answer.status() == Ok(shm_schema::CorrectionStatus::Corrected);
            good += u32::from(answer.command_session == session && corrected);
        }
        println!("corrected again after {:?}", start.elapsed());
    }
}

#[test]
fn a_client_that_writes_into_its_sent_messages_breaks_no_bound() {
    let place = Place::new("full", &recorder("box"));
    let mut daemon = Process::daemon(TRUED, &place);
    assert!(daemon.says("ready", JAM), "{:?}", daemon.lines());
    let mut cell = Cell::join(&place);
    // While it cannot answer, the messages in memory are this side's alone.
    daemon.signal(Signal::STOP);
    std::thread::sleep(Duration::from_millis(50));
    for _ in 0..4 {
        assert_eq!(cell.send(SESSION), SendOutcome::Delivered);
    }
    let places = places(&place);
    assert_eq!(places.len(), 2, "commands and blocks are found in memory");
    daemon.signal(Signal::CONT);
    let (over, written) = (AtomicBool::new(false), AtomicU64::new(0));
    let chance = chance();
    let mut said = 0;
    std::thread::scope(|scope| {
        scope.spawn(|| scribble(&places, &over, &written, chance));
        // A look that fails ends the other thread too.
        let _end = End(&over);
        for _ in 0..ROUNDS {
            cell.send(SESSION);
            std::thread::sleep(Duration::from_micros(300));
            said += u64::from(cell.hear().is_some());
        }
    });
    println!("{said} answers looked at, {written:?} words written into {ROUNDS} messages");
    assert!(said > 100 && written.load(Relaxed) > ROUNDS);
    assert!(daemon.is_running(), "{:#?}", daemon.lines());
    cell.corrected_again(SESSION + 1);
    drop(cell);
    assert!(daemon.end().success(), "{:#?}", daemon.lines());
    assert_eq!(place.left(), Vec::<String>::new());
}
