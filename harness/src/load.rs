//! A load that the bench makes itself, in a process of its own with ordinary priority.
//!
//! Promises: it ends with its parent, and as soon as one of its loads cannot be made; it works on whatever core it gets. Never: real-time, or pinned.

use std::fs::File;
use std::hint::black_box;
use std::io::{Read, Seek, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::mpsc;

use rustix::process::{Signal, set_parent_process_death_signal};

use crate::BETWEEN_WORDS;
use crate::child::Guarded;
use crate::error::BenchError;
use crate::plan::{Load, Plan, Programs};

/// Words of what the memory load copies: more than any cache.
const MEMORY_WORDS: usize = 16 << 20;
/// Words of what the cache load writes: about the last cache.
const CACHE_WORDS: usize = 4 << 20;
/// How far apart the cache load writes, words: each time another line.
const STRIDE_WORDS: usize = 4097;
const DISK_BYTES: usize = 4 << 20;
/// Writes before the file begins anew.
const DISK_WRITES: u32 = 16;
const NETWORK_BYTES: usize = 64 << 10;

/// Starts a process that makes these loads; none where there are none.
pub(crate) fn start(
    plan: &Plan,
    programs: &dyn Programs,
    loads: &[Load],
) -> Result<Option<Guarded>, BenchError> {
    if loads.is_empty() {
        return Ok(None);
    }
    let names: Vec<_> = loads.iter().map(|load| load.name()).collect();
    let words = ["load", &plan.scratch.to_string_lossy(), &names.join(",")].join(BETWEEN_WORDS);
    let failed = |e: std::io::Error| BenchError::part("load", e.to_string());
    Ok(Some(Guarded::spawn(programs.part(&words).map_err(failed)?).map_err(failed)?))
}

/// Whether a load is still made, as long as it should be.
///
/// # Errors
/// Where it has ended: what was measured meanwhile was measured without it.
pub(crate) fn still_made(made: &mut Option<Guarded>) -> Result<(), BenchError> {
    match made.as_mut().and_then(Guarded::ended) {
        Some(status) => Err(BenchError::part("load", format!("it ended ({status})"))),
        None => Ok(()),
    }
}

/// The process' own side: makes the loads until it is ended.
pub(crate) fn make(arguments: &[&str]) -> Result<(), BenchError> {
    // A refusal leaves a process that a killed parent does not end; its standard input then does.
    let _ = set_parent_process_death_signal(Some(Signal::KILL));
    let [scratch, names] = arguments else { return Err(BenchError::part("load", "arguments")) };
    let (end, ended) = mpsc::channel();
    for load in names.split(',').filter_map(Load::named) {
        let (scratch, end) = (PathBuf::from(scratch), end.clone());
        std::thread::spawn(move || {
            let failed = one(load, &scratch).err();
            let why = failed.map_or_else(|| "it ended".to_owned(), |e| e.to_string());
            // Nobody listens any more where another has failed before.
            let _ = end.send(Err(BenchError::part("load", format!("{}: {why}", load.name()))));
        });
    }
    std::thread::spawn(move || {
        // Closed by the parent's end.
        let _ = std::io::stdin().read_to_end(&mut Vec::new());
        let _ = end.send(Ok(()));
    });
    ended.recv().unwrap_or(Ok(()))
}

fn one(load: Load, scratch: &Path) -> std::io::Result<()> {
    match load {
        Load::Memory => memory(),
        Load::Cache => cache(),
        Load::Disk => disk(scratch),
        Load::Network => network(),
    }
}

fn memory() -> ! {
    let (mut a, b) = (vec![1_u64; MEMORY_WORDS], vec![2_u64; MEMORY_WORDS]);
    loop {
        a.copy_from_slice(black_box(&b));
        black_box(&a);
    }
}

fn cache() -> ! {
    let mut words = vec![0_u64; CACHE_WORDS];
    let mut at = 0;
    loop {
        for _ in 0..CACHE_WORDS {
            at = (at + STRIDE_WORDS) % CACHE_WORDS;
            words[at] = words[at].wrapping_add(1);
        }
        black_box(&words);
    }
}

fn disk(scratch: &Path) -> std::io::Result<()> {
    let path = scratch.join(format!(".trued-bench-{}", std::process::id()));
    let mut file = File::create_new(&path)?;
    // Without a name it is gone with the process, however that ends.
    std::fs::remove_file(&path)?;
    let bytes = vec![0x5a; DISK_BYTES];
    loop {
        file.rewind()?;
        for _ in 0..DISK_WRITES {
            file.write_all(&bytes)?;
            file.sync_data()?;
        }
    }
}

fn network() -> std::io::Result<()> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
    let mut out = TcpStream::connect(listener.local_addr()?)?;
    let (mut incoming, _) = listener.accept()?;
    std::thread::spawn(move || std::io::copy(&mut incoming, &mut std::io::sink()));
    let bytes = vec![0x5a; NETWORK_BYTES];
    loop {
        out.write_all(&bytes)?;
    }
}
