//! A daemon and the robot loop that it serves, as separate processes, with monitors: the target of faults.
//!
//! Violations detected by the loop are always reported; at the end no shared memory may remain.

use crate::place::TestDirectory;
use crate::process::Process;
use crate::rng::TestRng;
use recording::mcap_recording::{self, Record};
use std::path::PathBuf;
use std::time::Duration;

/// Time limit of every wait, generous for a busy machine.
pub const AWAIT_LIMIT: Duration = Duration::from_secs(10);

/// The programs under test.
#[derive(Clone, Copy, Debug)]
pub struct Programs<'a> {
    /// The program itself.
    pub trued: &'a str,
    /// Program of the robot loop, the monitor or the force source.
    pub rig: &'a str,
}

/// A process of the cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellProcess {
    /// The daemon.
    Daemon,
    /// The robot's loop.
    Cell,
    /// A monitor of status and verdicts.
    Monitor,
    /// The force source.
    Force,
}

impl CellProcess {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Daemon, Self::Cell, Self::Monitor, Self::Force];
}

/// A running cell. The daemon records, and receives force samples.
#[derive(Debug)]
pub struct ServedCell<'a> {
    /// The daemon.
    pub daemon: Process,
    /// The robot's loop.
    pub cell: Process,
    /// The monitor; `None` until requested.
    pub monitor: Option<Process>,
    /// The force source; `None` until requested.
    pub force: Option<Process>,
    programs: Programs<'a>,
    /// The test directory; removed after all processes have ended.
    pub place: TestDirectory,
}

impl<'a> ServedCell<'a> {
    /// A daemon with the usual configuration and its cell.
    #[must_use]
    pub fn start(programs: Programs<'a>) -> Self {
        let place = TestDirectory::new("full", &recorder("box"));
        let daemon = run(programs, CellProcess::Daemon, &place);
        Self::with(programs, place, daemon)
    }

    /// The same with a daemon started by the caller.
    #[must_use]
    pub fn with(programs: Programs<'a>, place: TestDirectory, daemon: Process) -> Self {
        let cell = run(programs, CellProcess::Cell, &place);
        Self { place, daemon, cell, monitor: None, force: None, programs }
    }

    /// Its programs.
    #[must_use]
    pub fn programs(&self) -> Programs<'a> {
        self.programs
    }

    /// Also starts the monitor and the force source.
    pub fn start_observers(&mut self) {
        for who in [CellProcess::Monitor, CellProcess::Force] {
            self.restart(who);
        }
    }

    /// The process of this kind, which must have been started.
    pub fn process(&mut self, who: CellProcess) -> &mut Process {
        match who {
            CellProcess::Daemon => &mut self.daemon,
            CellProcess::Cell => &mut self.cell,
            CellProcess::Monitor => self.monitor.as_mut().expect("started"),
            CellProcess::Force => self.force.as_mut().expect("started"),
        }
    }

    /// Starts the process of this kind; a running one is killed.
    pub fn restart(&mut self, who: CellProcess) {
        let fresh = run(self.programs, who, &self.place);
        match who {
            CellProcess::Daemon => self.daemon = fresh,
            CellProcess::Cell => self.cell = fresh,
            CellProcess::Monitor => self.monitor = Some(fresh),
            CellProcess::Force => self.force = Some(fresh),
        }
    }

    /// Kills these processes and restarts them, both in this order.
    pub fn kill_and_restart(&mut self, order: &[CellProcess], rng: &mut TestRng) {
        for who in order {
            let victim = self.process(*who);
            assert!(victim.is_running(), "{who:?} ended by itself: {:#?}", victim.lines());
            unbroken(victim);
            victim.kill();
            std::thread::sleep(Duration::from_micros(rng.below(3_000)));
        }
        for who in order {
            self.restart(*who);
        }
    }

    /// Waits until the robot loop receives a new answer of the daemon, and returns the elapsed
    /// time; panics with the whole output if none arrives.
    pub fn wait_answered(&mut self) -> Duration {
        let time = self.cell.wait_answered(&self.daemon, AWAIT_LIMIT);
        self.unbroken();
        time.unwrap_or_else(|| {
            let (cell, daemon) = (self.cell.lines(), self.daemon.lines());
            let waits = [self.cell.waits(), self.daemon.waits()];
            panic!("no answer within {AWAIT_LIMIT:?}; cell: {cell:#?}; daemon: {daemon:#?}; threads: {waits:#?}")
        })
    }

    /// Asserts that the robot loop detected no violation so far.
    pub fn unbroken(&self) {
        unbroken(&self.cell);
    }

    /// Ends all processes in order, asserts that nothing remains, and reads every recording.
    /// Returns the time of the last recorded cycle.
    pub fn end(mut self) -> u64 {
        for other in [&mut self.monitor, &mut self.force].into_iter().flatten() {
            assert!(other.close_input().success(), "{:#?}", other.lines());
        }
        assert!(self.cell.close_input().success(), "{:#?}", self.cell.lines());
        assert!(self.daemon.end().success(), "{:#?}", self.daemon.lines());
        self.unbroken();
        assert_eq!(
            self.place.remaining_names(),
            Vec::<String>::new(),
            "in shared memory after a clean end"
        );
        last_recorded_ns(&self.place.file("box"))
    }

    /// Duration of a killed daemon's answers that is missing in its recording; asserts that every
    /// file is readable.
    #[must_use]
    pub fn unrecorded(&self) -> Duration {
        let last_ns = last_recorded_ns(&self.place.file("box"));
        Duration::from_nanos(self.cell.answered_ns().saturating_sub(last_ns))
    }
}

/// The configuration table by which the daemon records into a folder.
#[must_use]
pub fn recorder(folder: &str) -> String {
    format!(
        "[force]\nrate_Hz = 10000.0\nchannels = 3\n[vibration]\nenabled = true\n\
         [recorder]\ndir = \"{folder}\"\n"
    )
}

/// Time at which the last recorded cycle was received (`CLOCK_MONOTONIC`, ns); every file must be
/// readable, except an empty one of a killed daemon.
#[must_use]
pub fn last_recorded_ns(folder: &std::path::Path) -> u64 {
    let boxes = |folder: &std::path::Path| -> Vec<PathBuf> {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        let begun = |path: &PathBuf| std::fs::metadata(path).is_ok_and(|file| file.len() > 0);
        entries.map(|entry| entry.path()).filter(begun).collect()
    };
    let last = |path: PathBuf| {
        let read = mcap_recording::read(&path);
        let contents = read.unwrap_or_else(|fault| panic!("a black box that is none: {fault}"));
        let received = contents.records.iter().filter_map(|record| match record {
            Record::Cycle(cycle) => Some(cycle.received_ns),
            _ => None,
        });
        received.max().unwrap_or(0)
    };
    boxes(folder).into_iter().map(last).max().unwrap_or(0)
}

/// Asserts that this robot loop detected no violation so far.
pub fn unbroken(process: &Process) {
    let broken = process.lines().into_iter().find(|line| line.starts_with("broken"));
    assert_eq!(broken, None, "no published target breaks a bound");
}

fn run(programs: Programs<'_>, who: CellProcess, place: &TestDirectory) -> Process {
    match who {
        CellProcess::Daemon => Process::daemon(programs.trued, place),
        CellProcess::Cell => Process::start::<&str>(programs.rig, &[], place),
        CellProcess::Monitor => Process::start(programs.rig, &["monitor"], place),
        CellProcess::Force => Process::start(programs.rig, &["force"], place),
    }
}
