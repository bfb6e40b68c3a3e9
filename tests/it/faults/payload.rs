//! A client that writes into its messages after it has sent them: every byte that the daemon reads may change under its eyes.

use super::chance;
use crate::TRUED;
use rustix::process::Signal;
use shm_schema::{
    Command, Corrected, ForceBlock, JOINTS_MAX, Role, Seat, SendOutcome, Status, monotonic_ns,
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

#[test]
fn a_client_that_writes_into_its_sent_messages_breaks_no_bound() {
    let place = Place::new("full", &recorder("box"));
    let mut daemon = Process::daemon(TRUED, &place);
    assert!(daemon.says("ready", JAM), "{:?}", daemon.lines());
    let mut seats = [Role::Cell, Role::Force].map(|role| Seat::new(&place.cell(), role));
    let [cell, force] = [0, 1].map(|i| seats[i].join().unwrap());
    let mut commands = cell.publisher::<Command>().unwrap();
    let mut answers = cell.subscriber::<Corrected>().unwrap();
    let mut statuses = cell.subscriber::<Status>().unwrap();
    let mut blocks = force.publisher::<ForceBlock>().unwrap();
    let mut bounds = None;
    assert!(super::wait_for(JAM, || {
        bounds = statuses.take_newest().map(|status| status.bounds).or(bounds);
        bounds.is_some()
    }));
    let bounds = bounds.unwrap();
    let mut gauge = Gauge::new(&bounds.rate[..JOINTS]);
    let mut look = |said: &Corrected| {
        for i in 0..said.joints as usize {
            let inside = (bounds.min[i]..=bounds.max[i]).contains(&said.q[i]);
            let near = said.correction[i].abs() <= bounds.angle[i] + ROUNDING;
            assert!(inside && near, "{said:?}");
        }
        gauge.take(said.made_ns, &said.correction[..JOINTS]).unwrap();
    };
    let mut seq = 0;
    let mut send = |session: u64| {
        seq += 1;
        let now_ns = monotonic_ns();
        let mut q = [0.0; JOINTS_MAX];
        q[..JOINTS].copy_from_slice(&path(now_ns));
        let (t_ns, sent_ns, joints) = (now_ns, now_ns, JOINTS as u32);
        let block = ForceBlock {
            seq,
            session,
            t_ns,
            channels: 3,
            samples: 10,
            rate_hz: 1e4,
            ..ForceBlock::default()
        };
        blocks.send(&block);
        commands.send(&Command { seq, session, t_ns, sent_ns, joints, q, ..Command::default() })
    };
    // While it cannot answer, the messages in memory are this side's alone.
    daemon.signal(Signal::STOP);
    std::thread::sleep(Duration::from_millis(50));
    for _ in 0..4 {
        assert_eq!(send(SESSION), SendOutcome::Delivered);
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
            send(SESSION);
            std::thread::sleep(Duration::from_micros(300));
            if let Some(answer) = answers.take_newest() {
                look(&answer);
                said += 1;
            }
        }
    });
    println!("{said} answers looked at, {written:?} words written into {ROUNDS} messages");
    assert!(said > 100 && written.load(Relaxed) > ROUNDS);
    assert!(daemon.is_running(), "{:#?}", daemon.lines());
    // Another session begins anew, and is corrected as if nothing had been.
    let start = Instant::now();
    let mut good = 0;
    while good < 100 {
        assert!(start.elapsed() < JAM, "not corrected again");
        send(SESSION + 1);
        std::thread::sleep(Duration::from_millis(1));
        let Some(answer) = answers.take_newest() else { continue };
        look(&answer);
        let ours = answer.command_session == SESSION + 1;
        good += u32::from(ours && answer.status() == Ok(shm_schema::CorrectionStatus::Corrected));
    }
    println!("corrected again after {:?}", start.elapsed());
    drop((commands, answers, statuses, blocks, cell, force, seats));
    assert!(daemon.end().success(), "{:#?}", daemon.lines());
    assert_eq!(place.left(), Vec::<String>::new());
}
