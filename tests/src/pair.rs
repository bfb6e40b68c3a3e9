//! A daemon and the robot loop that it serves, as separate processes, with monitors: the target of faults.
//!
//! Violations seen by the loop are always reported; at the end nothing may be left in shared
//! memory.

use crate::chance::Chance;
use crate::place::Place;
use crate::process::Process;
use recording::blackbox::{self, Record};
use std::path::PathBuf;
use std::time::Duration;

/// Time limit for anything awaited, however busy the machine.
pub const JAM: Duration = Duration::from_secs(10);

/// The programs under test.
#[derive(Clone, Copy, Debug)]
pub struct Programs<'a> {
    /// The program itself.
    pub trued: &'a str,
    /// Program of a robot's loop, or of a monitor.
    pub rig: &'a str,
}

/// A process of the cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Who {
    /// Corrects.
    Daemon,
    /// The robot's loop.
    Cell,
    /// Reads status and verdicts.
    Monitor,
    /// Sends force samples.
    Force,
}

impl Who {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Daemon, Self::Cell, Self::Monitor, Self::Force];
}

/// A cell at work. The daemon records, and listens to forces.
#[derive(Debug)]
pub struct Pair<'a> {
    /// The daemon.
    pub daemon: Process,
    /// The robot's loop.
    pub cell: Process,
    /// The monitor; `None` until requested.
    pub monitor: Option<Process>,
    /// The sender of forces; `None` until requested.
    pub force: Option<Process>,
    programs: Programs<'a>,
    /// Where: swept once all others have ended.
    pub place: Place,
}

impl<'a> Pair<'a> {
    /// A daemon with the usual configuration and its cell.
    #[must_use]
    pub fn start(programs: Programs<'a>) -> Self {
        let place = Place::new("full", &recorder("box"));
        let daemon = run(programs, Who::Daemon, &place);
        Self::with(programs, place, daemon)
    }

    /// A pair whose daemon is started by the caller.
    #[must_use]
    pub fn with(programs: Programs<'a>, place: Place, daemon: Process) -> Self {
        let cell = run(programs, Who::Cell, &place);
        Self { place, daemon, cell, monitor: None, force: None, programs }
    }

    /// Its programs.
    #[must_use]
    pub fn programs(&self) -> Programs<'a> {
        self.programs
    }

    /// Also starts the monitor and the sender of forces.
    pub fn complete(&mut self) {
        for who in [Who::Monitor, Who::Force] {
            self.start_anew(who);
        }
    }

    /// That process, which must have been started.
    pub fn of(&mut self, who: Who) -> &mut Process {
        match who {
            Who::Daemon => &mut self.daemon,
            Who::Cell => &mut self.cell,
            Who::Monitor => self.monitor.as_mut().expect("started"),
            Who::Force => self.force.as_mut().expect("started"),
        }
    }

    /// Starts that process; a running one is killed.
    pub fn start_anew(&mut self, who: Who) {
        let fresh = run(self.programs, who, &self.place);
        match who {
            Who::Daemon => self.daemon = fresh,
            Who::Cell => self.cell = fresh,
            Who::Monitor => self.monitor = Some(fresh),
            Who::Force => self.force = Some(fresh),
        }
    }

    /// Kills these in this order, and restarts them in the same order.
    pub fn strike(&mut self, order: &[Who], chance: &mut Chance) {
        for who in order {
            let victim = self.of(*who);
            assert!(victim.is_running(), "{who:?} ended by itself: {:#?}", victim.lines());
            unbroken(victim);
            victim.kill();
            std::thread::sleep(Duration::from_micros(chance.below(3_000)));
        }
        for who in order {
            self.start_anew(*who);
        }
    }

    /// Time until the robot's loop has a new answer of the daemon; panics with the whole output if
    /// none arrives.
    pub fn back(&mut self) -> Duration {
        let time = self.cell.wait_answered(&self.daemon, JAM);
        self.unbroken();
        time.unwrap_or_else(|| {
            let (cell, daemon) = (self.cell.lines(), self.daemon.lines());
            let waits = [self.cell.waits(), self.daemon.waits()];
            panic!("no answer within {JAM:?}; cell: {cell:#?}; daemon: {daemon:#?}; threads: {waits:#?}")
        })
    }

    /// The robot's loop saw no violation so far.
    pub fn unbroken(&self) {
        unbroken(&self.cell);
    }

    /// Ends all in order: nothing may be left, and every recording is read. Returns the time of the
    /// last cycle in them.
    pub fn end(mut self) -> u64 {
        for other in [&mut self.monitor, &mut self.force].into_iter().flatten() {
            assert!(other.let_go().success(), "{:#?}", other.lines());
        }
        assert!(self.cell.let_go().success(), "{:#?}", self.cell.lines());
        assert!(self.daemon.end().success(), "{:#?}", self.daemon.lines());
        self.unbroken();
        assert_eq!(self.place.left(), Vec::<String>::new(), "in shared memory after a clean end");
        last_recorded_ns(&self.place.file("box"))
    }

    /// Part of a killed daemon's answers that is missing in its recording, every file of which must
    /// be readable.
    #[must_use]
    pub fn unrecorded(&self) -> Duration {
        let last_ns = last_recorded_ns(&self.place.file("box"));
        Duration::from_nanos(self.cell.answered_ns().saturating_sub(last_ns))
    }
}

/// The table that has the daemon of a place record into a folder of it.
#[must_use]
pub fn recorder(folder: &str) -> String {
    format!(
        "[force]\nrate_Hz = 10000.0\nchannels = 3\n[vibration]\nenabled = true\n\
         [recorder]\ndir = \"{folder}\"\n"
    )
}

/// When the last recorded cycle was received (`CLOCK_MONOTONIC`, ns); every file must be readable,
/// except one that was killed while it was empty.
#[must_use]
pub fn last_recorded_ns(folder: &std::path::Path) -> u64 {
    let boxes = |folder: &std::path::Path| -> Vec<PathBuf> {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        let begun = |path: &PathBuf| std::fs::metadata(path).is_ok_and(|file| file.len() > 0);
        entries.map(|entry| entry.path()).filter(begun).collect()
    };
    let last = |path: PathBuf| {
        let read = blackbox::read(&path);
        let contents = read.unwrap_or_else(|fault| panic!("a black box that is none: {fault}"));
        let received = contents.records.iter().filter_map(|record| match record {
            Record::Cycle(cycle) => Some(cycle.received_ns),
            _ => None,
        });
        received.max().unwrap_or(0)
    };
    boxes(folder).into_iter().map(last).max().unwrap_or(0)
}

/// That process, a robot's loop, saw no violation so far.
pub fn unbroken(process: &Process) {
    let broken = process.lines().into_iter().find(|line| line.starts_with("broken"));
    assert_eq!(broken, None, "no published target breaks a bound");
}

fn run(programs: Programs<'_>, who: Who, place: &Place) -> Process {
    match who {
        Who::Daemon => Process::daemon(programs.trued, place),
        Who::Cell => Process::start::<&str>(programs.rig, &[], place),
        Who::Monitor => Process::start(programs.rig, &["monitor"], place),
        Who::Force => Process::start(programs.rig, &["force"], place),
    }
}
