//! A cell in miniature, for tests that kill it: a robot's loop that says what it gets.
//!
//! On standard output: `answered NS by PID`, events of the connection, `broken WORDS`; in the end `ticks N`.
//! Ends when its standard input closes.
#![expect(clippy::print_stdout, reason = "a test listens")]

use shm_schema::Cell;
use std::io::Read;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;
use tests::cell_loop::CellLoop;
use tests::place::CELL;
use trued_client::{Connection, monotonic_ns};

/// Between two signs of life, ns.
const TELL_EVERY_NS: u64 = 2_000_000;

fn main() {
    let over = Arc::new(AtomicBool::new(false));
    let end = over.clone();
    std::thread::spawn(move || {
        let _ = std::io::stdin().read(&mut [0]);
        end.store(true, Relaxed);
    });
    match Cell::new(CELL) {
        Ok(cell) => run(&cell, &over),
        Err(fault) => println!("{fault}"),
    }
}

fn run(cell: &Cell, over: &AtomicBool) {
    let mut cell_loop = loop {
        match CellLoop::join(cell, Duration::from_millis(5)) {
            Ok(joined) => break joined,
            Err(fault) => println!("{fault}"),
        }
        if over.load(Relaxed) {
            return;
        }
    };
    let mut told_ns = 0;
    while !over.load(Relaxed) {
        let tick = cell_loop.tick();
        let now_ns = monotonic_ns();
        if let (true, Connection::Connected { pid, .. }) =
            (tick.answered, cell_loop.client.connection())
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
