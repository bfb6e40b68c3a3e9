//! The limit of the machine: atomic words between two threads on two cores, alone or with a copy of the payload.
//!
//! Between chunks the other thread is parked. No system call while polling.

use std::array::from_fn;
use std::hint::{black_box, spin_loop};
use std::sync::Arc;
use std::sync::atomic::{
    AtomicU32, AtomicU64,
    Ordering::{Acquire, Relaxed, Release},
};
use std::thread::{JoinHandle, Thread};
use std::time::Duration;

use shm_schema::monotonic_ns;

use super::{ANSWER_BYTES, COMMAND_BYTES, RoundTrip, WakeMode, poll};
use crate::error::BenchError;
use crate::thread_settings::ThreadSettings;

const COMMAND_WORDS: usize = COMMAND_BYTES / 8;
const ANSWER_WORDS: usize = ANSWER_BYTES / 8;

/// Modes of the other thread.
const PARKED: u32 = 0;
const BARE: u32 = 1;
const COPY: u32 = 2;
const WOKEN: u32 = 3;
const OVER: u32 = 4;

/// One direction: a payload, then its number on a separate cache line, because the number is
/// polled.
#[repr(align(128))]
struct Slot<const N: usize> {
    seq: CacheLine,
    values: [AtomicU64; N],
}

#[repr(align(128))]
struct CacheLine(AtomicU64);

impl<const N: usize> Slot<N> {
    fn new() -> Self {
        Self { seq: CacheLine(AtomicU64::new(0)), values: from_fn(|_| AtomicU64::new(0)) }
    }

    fn write(&self, payload: &[u64; N]) {
        self.values.iter().zip(payload).for_each(|(slot, value)| slot.store(*value, Relaxed));
    }

    fn read(&self) -> [u64; N] {
        from_fn(|i| self.values[i].load(Relaxed))
    }
}

struct Shared {
    command: Slot<COMMAND_WORDS>,
    answer: Slot<ANSWER_WORDS>,
    task: AtomicU32,
}

/// The measuring side, which owns the other thread.
pub(crate) struct Atomics {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    seq: u64,
}

impl Atomics {
    /// Starts the other thread with these settings; the calling thread measures.
    pub(crate) fn start(thread_settings: ThreadSettings) -> Result<Self, BenchError> {
        let shared = Arc::new(Shared {
            command: Slot::new(),
            answer: Slot::new(),
            task: AtomicU32::new(PARKED),
        });
        let (tell, started) = std::sync::mpsc::channel();
        let (other, asker) = (Arc::clone(&shared), std::thread::current());
        let thread = std::thread::Builder::new()
            .name("bench-atomics".to_owned())
            .spawn(move || {
                let taken = thread_settings.apply();
                let goes_on = taken.is_ok();
                // The receiver waits for this message.
                let _ = tell.send(taken);
                if goes_on {
                    answer(&other, &asker);
                }
            })
            .map_err(|e| BenchError::part("atomics", e.to_string()))?;
        started.recv().map_err(|_| BenchError::Thread("atomics"))??;
        Ok(Self { shared, thread: Some(thread), seq: 0 })
    }

    /// The answering side, for a chunk with one word in each direction.
    pub(crate) fn bare(&mut self) -> Chunk<'_> {
        self.begin(BARE)
    }

    /// The same with a copy of the payload.
    pub(crate) fn copying(&mut self, way: WakeMode) -> Chunk<'_> {
        self.begin(if way == WakeMode::Poll { COPY } else { WOKEN })
    }

    fn begin(&mut self, task: u32) -> Chunk<'_> {
        self.shared.task.store(task, Release);
        self.unpark();
        Chunk { atomics: self, task, payload: [1; COMMAND_WORDS] }
    }

    fn unpark(&self) {
        if let Some(thread) = &self.thread {
            thread.thread().unpark();
        }
    }
}

impl Drop for Atomics {
    fn drop(&mut self) {
        self.shared.task.store(OVER, Release);
        self.unpark();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// While it exists, the other side answers.
pub(crate) struct Chunk<'a> {
    atomics: &'a mut Atomics,
    task: u32,
    payload: [u64; COMMAND_WORDS],
}

impl RoundTrip for Chunk<'_> {
    // Inlined: compared with the latency of a cache line between two cores.
    #[inline]
    fn round_trip(&mut self, _: u64) -> Option<u64> {
        let since_ns = monotonic_ns();
        self.atomics.seq += 1;
        let (shared, seq) = (&self.atomics.shared, self.atomics.seq);
        if self.task != BARE {
            self.payload[0] = seq;
            shared.command.write(black_box(&self.payload));
        }
        shared.command.seq.0.store(seq, Release);
        let is_answered = || (shared.answer.seq.0.load(Acquire) == seq).then_some(());
        if self.task == WOKEN {
            self.atomics.unpark_and_park(is_answered);
        } else {
            poll(is_answered)?;
        }
        if self.task != BARE {
            black_box(shared.answer.read());
        }
        Some(monotonic_ns() - since_ns)
    }
}

impl Atomics {
    fn unpark_and_park(&self, condition: impl Fn() -> Option<()>) {
        self.unpark();
        while condition().is_none() {
            std::thread::park_timeout(Duration::from_millis(100));
        }
    }
}

impl Drop for Chunk<'_> {
    fn drop(&mut self) {
        self.atomics.shared.task.store(PARKED, Release);
    }
}

/// The other side.
fn answer(shared: &Shared, asker: &Thread) {
    let mut last = 0;
    let reply = [2; ANSWER_WORDS];
    loop {
        match shared.task.load(Acquire) {
            PARKED => std::thread::park(),
            OVER => return,
            task => {
                let seq = shared.command.seq.0.load(Acquire);
                if seq == last {
                    if task == WOKEN {
                        std::thread::park_timeout(Duration::from_millis(100));
                    } else {
                        spin_loop();
                    }
                    continue;
                }
                last = seq;
                if task != BARE {
                    black_box(shared.command.read());
                    shared.answer.write(black_box(&reply));
                }
                shared.answer.seq.0.store(seq, Release);
                if task == WOKEN {
                    asker.unpark();
                }
            }
        }
    }
}
