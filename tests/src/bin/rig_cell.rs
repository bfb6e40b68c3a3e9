//! A minimal cell, for tests that kill it: a robot's loop that prints what it receives, or
//! (`monitor`, `force`) one of a cell's other processes.
//!
//! Standard output: `answered NS by PID`, events of the connection, `broken WORDS`; at the end
//! `ticks N`. Standard input: `clock NS` sets the clock that stamps its commands to this offset
//! from the system's. It ends when the input closes.
#![expect(clippy::print_stdout, reason = "a test listens")]

use shm_schema::Cell;
use std::fmt::Display;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering::Relaxed};
use std::time::Duration;
use tests::cell_loop::CellLoop;
use tests::place::CELL;
use tests::rng::TestRng;
use trued_client::{
    Connection, ForceSamples, ForceSource, Monitor, Samples, WrenchFrame, monotonic_ns,
};

/// Interval between two `answered` lines, ns.
const TELL_EVERY_NS: u64 = 2_000_000;
/// Time limit of one attempt to connect.
const PATIENCE: Duration = Duration::from_millis(500);

fn main() {
    let over = Arc::new(AtomicBool::new(false));
    let clock_ns = Arc::new(AtomicI64::new(0));
    let (end, set) = (over.clone(), clock_ns.clone());
    std::thread::spawn(move || {
        for line in std::io::stdin().lines().map_while(Result::ok) {
            let ns = line.strip_prefix("clock ").and_then(|ns| ns.parse().ok());
            set.store(ns.unwrap_or(0), Relaxed);
        }
        end.store(true, Relaxed);
    });
    let cell = match Cell::new(CELL) {
        Ok(cell) => cell,
        Err(fault) => return println!("{fault}"),
    };
    match std::env::args().nth(1).as_deref() {
        Some("monitor") => watch(&cell, &over),
        Some("force") => push(&cell, &over),
        _ => run(&cell, &over, &clock_ns),
    }
}

/// Retries until it has joined; `None` if it has to end before.
fn joined<T, E: Display>(over: &AtomicBool, mut join: impl FnMut() -> Result<T, E>) -> Option<T> {
    while !over.load(Relaxed) {
        match join() {
            Ok(joined) => return Some(joined),
            Err(fault) => println!("{fault}"),
        }
    }
    None
}

fn run(cell: &Cell, over: &AtomicBool, clock_ns: &AtomicI64) {
    let Some(mut cell_loop) = joined(over, || CellLoop::join(cell, Duration::from_millis(5)))
    else {
        return;
    };
    let mut told_ns = 0;
    while !over.load(Relaxed) {
        cell_loop.clock_set_ns = clock_ns.load(Relaxed);
        let tick = cell_loop.tick();
        let now_ns = monotonic_ns();
        if let (true, Connection::Connected { pid, .. }) =
            (tick.answered && !tick.refused, cell_loop.client.connection())
            && now_ns > told_ns + TELL_EVERY_NS
        {
            println!("answered {now_ns} by {pid}");
            told_ns = now_ns;
        }
        while let Some(event) = cell_loop.client.next_event() {
            println!("{event:?}");
        }
        for broken in cell_loop.broken.drain(..) {
            println!("broken {broken}");
        }
    }
    println!("ticks {}", cell_loop.ticks);
}

/// A monitor: prints a line for each new status.
fn watch(cell: &Cell, over: &AtomicBool) {
    let Some(mut monitor) = joined(over, || Monitor::connect_to(cell, PATIENCE)) else { return };
    let mut seen_ns = 0;
    while !over.load(Relaxed) {
        if let Some(status) = monitor.status().filter(|status| status.t_ns != seen_ns) {
            println!("answered {} by {}", monotonic_ns(), status.pid);
            seen_ns = status.t_ns;
        }
        while monitor.vibration().is_some() {}
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Noise at 10 kHz in three channels, in blocks of 10 ms.
fn push(cell: &Cell, over: &AtomicBool) {
    let Some(mut source) = joined(over, || ForceSource::connect_to(cell, PATIENCE)) else { return };
    let mut chance = TestRng::new(monotonic_ns());
    let mut due_ns = monotonic_ns();
    while !over.load(Relaxed) {
        let noise: Vec<f64> = (0..300).map(|_| chance.uniform() - 0.5).collect();
        let sent = source.send(&ForceSamples {
            t_ns: due_ns,
            rate_hz: 10_000.0,
            channels: 3,
            frame: WrenchFrame::Base,
            samples: Samples::F64(&noise),
        });
        if let (Ok(()), Connection::Connected { pid, .. }) = (sent, source.connection()) {
            println!("answered {} by {pid}", monotonic_ns());
        }
        due_ns = (due_ns + 10_000_000).max(monotonic_ns().saturating_sub(10_000_000));
        std::thread::sleep(Duration::from_nanos(due_ns.saturating_sub(monotonic_ns())));
    }
}
