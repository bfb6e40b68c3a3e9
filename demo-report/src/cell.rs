//! The cell's process: commands at 1 kHz, corrected targets to the simulated robot, force blocks back; milling, measuring, milling again.
//!
//! It communicates with its parent by lines on standard output: `tick K`, `milled {json}`,
//! `measured`, `again {json}`. After `measured` it stays at the path's start, still sending
//! commands, until it receives `again {json}` (the model was replaced) or `end {json}`, each with
//! the diagnosis. The loop is that of `client/examples/robot_loop.rs` with measurements added.

use std::io::BufRead;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use physics::{JOINTS_MAX, Joints};
use recording::outputs::Outputs;
use recording::series::{Recording, metadata_path};
use report::Provenance;
use trued_client::{
    Client, ForceSamples, ForceSource, Samples, Setpoint, WrenchFrame, monotonic_ns,
};
use world::cell::{Cell, FORCES_PER_TICK, Setup, Tick};
use world::joint_path::JointPath;

use crate::PAGE;
use crate::error::Error;
use crate::log::{CellLog, keeps_invariants};
use crate::measure::measuring_recording;
use crate::outcome::{DiagnosisOutcome, ModelChange, RepeatRun, Report};
use crate::page;
use crate::run::check;
use crate::scene::{Scene, TICK_S};
use crate::standstill::Standstill;

/// How long the cell waits for the daemon at the start.
const JOIN_TIMEOUT: Duration = Duration::from_secs(5);
/// How long it waits for an answer in each tick; the rest of the tick is the robot's.
const ANSWER_TIMEOUT: Duration = Duration::from_micros(800);
/// How old an answer may be: as long as the daemon takes commands for fresh, on a machine that is no controller.
const ANSWER_AGE_MAX: Duration = Duration::from_millis(50);
/// How long before a tick is due it begins to spin.
const SPIN_BEFORE_NS: u64 = 120_000;
/// Ticks between two signs of life.
const PROGRESS_EVERY: usize = 100;
const TICK_NS: u64 = (TICK_S * 1e9) as u64;

/// Runs the cell `name` as the child process of [`crate::Demo::run`], with its standard streams; the page states `provenance`.
///
/// # Errors
/// No daemon; files that cannot be written; the parent is gone; `stop` was set.
pub fn run_cell(
    name: &str,
    scene: &Scene,
    out: &Path,
    provenance: Provenance,
    stop: &AtomicBool,
) -> Result<(), Error> {
    let instructions = read_instructions();
    let mut loop_ = CellLoop::join(name, scene)?;
    loop_.mill(scene, &scene.path, stop)?;
    loop_.drain_verdicts();
    let rejected = loop_.rejected();
    let milled = loop_.log.milled(scene, rejected);
    write_recording(&out.join("recording.csv"), &loop_.log.recording(scene))?;
    print_line(&format!("milled {}", json(&milled)?))?;
    write_recording(&out.join("measured.csv"), &measuring_recording(scene))?;
    print_line("measured")?;
    let first = loop_.renew_log(scene)?;
    loop_.client.start_anew();
    let (outcome, swap) = loop_.wait_for_diagnosis(scene, &instructions, stop)?;
    let (mut again, mut second) = (None, None);
    if let Some(swap) = swap {
        let stood = loop_.renew_log(scene)?;
        loop_.mill(scene, &scene.work, stop)?;
        let rejected = loop_.rejected();
        let mut counts = loop_.log.counts(rejected);
        counts.invariants_broken += stood.broken;
        again = Some(RepeatRun { error_mm: loop_.log.error_mm(0), counts, swap });
        second = Some(loop_.log);
    }
    let report = Report::new(milled, outcome, again);
    let page = page::render(scene, &report, &first, second.as_ref());
    write_files([(out.join(PAGE), page.provenance(provenance).render().into_bytes())])?;
    print_line(&format!("again {}", json(&again)?))
}

fn write_recording(csv: &Path, recording: &Recording) -> Result<(), Error> {
    let about = (metadata_path(csv), recording.about_toml().into_bytes());
    write_files([about, (csv.to_owned(), recording.to_csv())])
}

/// Writes files whose paths the demo has checked before it began.
fn write_files(
    files: impl IntoIterator<Item = (std::path::PathBuf, Vec<u8>)>,
) -> Result<(), Error> {
    let mut outputs = Outputs::new(true);
    files.into_iter().for_each(|(path, bytes)| outputs.put(&path, bytes));
    Ok(outputs.write()?)
}

/// Lines from standard input, read by another thread.
fn read_instructions() -> Receiver<String> {
    let (say, instructions) = channel();
    std::thread::spawn(move || {
        // If the receiver is gone, the loop has ended.
        std::io::stdin().lock().lines().map_while(Result::ok).try_for_each(|line| say.send(line))
    });
    instructions
}

fn json(value: &impl serde::Serialize) -> Result<String, Error> {
    serde_json::to_string(value).map_err(Error::system)
}

struct CellLoop {
    client: Client,
    force: ForceSource,
    cell: Cell,
    log: CellLog,
    start_ns: u64,
    before: Option<(Joints, u64)>,
}

impl CellLoop {
    fn join(name: &str, scene: &Scene) -> Result<Self, Error> {
        let mut client = Client::connect(name, JOIN_TIMEOUT).map_err(Error::system)?;
        client.set_fresh(ANSWER_AGE_MAX);
        let force = ForceSource::connect(name, JOIN_TIMEOUT).map_err(Error::system)?;
        let cell =
            Cell::new(&scene.truth, Setup::without_chatter(scene.standstill_path(), scene.seed));
        let log = CellLog::new(scene.path.samples.len()).map_err(Error::system)?;
        Ok(Self { client, force, cell, log, start_ns: 0, before: None })
    }

    fn rejected(&mut self) -> u64 {
        self.client.status().map_or(0, |status| status.rejected)
    }

    /// Mills along `path`.
    fn mill(&mut self, scene: &Scene, path: &JointPath, stop: &AtomicBool) -> Result<(), Error> {
        let setup = Setup {
            chatter: Some(scene.chatter),
            ..Setup::without_chatter(path.clone(), scene.seed)
        };
        self.cell = Cell::new(&scene.truth, setup);
        self.start_ns = monotonic_ns() + TICK_NS;
        for k in 0..self.cell.ticks() {
            self.tick_at(scene, k);
            if k % PROGRESS_EVERY == 0 {
                check(stop)?;
                print_line(&format!("tick {k}"))?;
            }
        }
        Ok(())
    }

    /// Starts a new log and returns the old one.
    fn renew_log(&mut self, scene: &Scene) -> Result<CellLog, Error> {
        let next = CellLog::new(scene.work.samples.len()).map_err(Error::system)?;
        Ok(std::mem::replace(&mut self.log, next))
    }

    /// Stays at the path's start, still sending commands, until it receives the diagnosis; if the
    /// model was replaced, reports how that went.
    fn wait_for_diagnosis(
        &mut self,
        scene: &Scene,
        instructions: &Receiver<String>,
        stop: &AtomicBool,
    ) -> Result<(DiagnosisOutcome, Option<ModelChange>), Error> {
        let mut standing = Standstill::default();
        loop {
            let setup = Setup::without_chatter(scene.standstill_path(), scene.seed);
            self.cell = Cell::new(&scene.truth, setup);
            self.start_ns = monotonic_ns() + TICK_NS;
            for k in 0..self.cell.ticks() {
                let missed_before = self.log.missed;
                self.tick_at(scene, k);
                let missed = self.log.missed > missed_before;
                standing.count_tick(self.client.newest().map(|answer| answer.model_epoch), missed);
                if let Some(done) = standing.poll_instruction(instructions)? {
                    return Ok(done);
                }
            }
            check(stop)?;
            // Log entries during standstill are not needed later.
            self.log.rows.clear();
        }
    }

    /// One tick at its time.
    fn tick_at(&mut self, scene: &Scene, k: usize) {
        let due_ns = self.start_ns + k as u64 * TICK_NS;
        wait_until(due_ns);
        self.tick(scene, due_ns);
    }

    /// One tick: command, answer, robot, forces.
    fn tick(&mut self, scene: &Scene, due_ns: u64) {
        let Some(sample) = self.cell.next_command() else { return };
        let joints = scene.model.physics.arm.count();
        let q_cmd = sample.q;
        let setpoint = Setpoint::new(&q_cmd[..joints])
            .at_ns(due_ns)
            .temperatures(self.cell.ambient_celsius(), &[]);
        let sent_ns = monotonic_ns();
        if let Ok(seq) = self.client.send(&setpoint) {
            if self.client.wait_corrected(seq, ANSWER_TIMEOUT).is_some() {
                self.log.latency.saturating_record(monotonic_ns() - sent_ns);
            } else {
                self.log.missed += 1;
            }
        }
        let now_ns = monotonic_ns();
        let Ok(target) = self.client.target_for(&q_cmd[..joints], now_ns) else { return };
        let mut published = [0.0; JOINTS_MAX];
        published[..joints].copy_from_slice(target.joints());
        self.check(scene, &q_cmd, &published, now_ns);
        let Some(tick) = self.cell.step(&published) else { return };
        self.log.add_tick(&tick, &published);
        self.send_forces(&tick, due_ns);
        while let Some(verdict) = self.client.vibration() {
            self.log.add_verdict(&verdict, self.start_ns);
        }
    }

    /// Counts a target that breaks an invariant. Time is the real one, or the tick where that is longer.
    fn check(&mut self, scene: &Scene, q_cmd: &Joints, published: &Joints, now_ns: u64) {
        let Some(status) = self.client.status() else { return };
        let arm = &scene.model.physics.arm;
        let before = self.before.as_ref().map(|(correction, then_ns)| {
            (correction, 1e-9 * (now_ns - then_ns).max(TICK_NS) as f64)
        });
        if !keeps_invariants(arm, &status.bounds, q_cmd, published, before) {
            self.log.broken += 1;
        }
        let mut correction = [0.0; JOINTS_MAX];
        for (i, slot) in correction.iter_mut().enumerate() {
            *slot = published[i] - q_cmd[i];
        }
        self.before = Some((correction, now_ns));
    }

    fn send_forces(&mut self, tick: &Tick, due_ns: u64) {
        let mut samples = [0.0; 3 * FORCES_PER_TICK];
        for (triple, force) in samples.chunks_exact_mut(3).zip(tick.forces_tool) {
            triple.copy_from_slice(&force.to_array());
        }
        // A lost block is counted on both sides, and shows in the status.
        let _ = self.force.send(&ForceSamples {
            t_ns: due_ns,
            rate_hz: FORCES_PER_TICK as f64 / TICK_S,
            channels: 3,
            frame: WrenchFrame::Tool,
            samples: Samples::F64(&samples),
        });
    }

    /// Waits a moment for the vibration monitor's last messages.
    fn drain_verdicts(&mut self) {
        std::thread::sleep(Duration::from_millis(50));
        while let Some(verdict) = self.client.vibration() {
            self.log.add_verdict(&verdict, self.start_ns);
        }
    }
}

/// Sleeps, and spins for the last stretch.
fn wait_until(due_ns: u64) {
    let now_ns = monotonic_ns();
    if due_ns > now_ns + SPIN_BEFORE_NS {
        std::thread::sleep(Duration::from_nanos(due_ns - now_ns - SPIN_BEFORE_NS));
    }
    while monotonic_ns() < due_ns {
        std::hint::spin_loop();
    }
}

fn print_line(line: &str) -> Result<(), Error> {
    use std::io::Write;
    let mut out = std::io::stdout().lock();
    writeln!(out, "{line}").and_then(|()| out.flush()).map_err(Error::system)
}
