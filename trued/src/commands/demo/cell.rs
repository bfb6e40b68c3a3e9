//! The cell's process: commands at 1 kHz, corrected targets to the virtual robot, force blocks back.
//!
//! It talks to whoever started it in lines on standard output: `tick K`, in the end `report {json}`. The loop is that of
//! `client/examples/robot_loop.rs` with measuring around it.

use std::path::Path;
use std::time::Duration;

use physics::{JOINTS_MAX, Joints};
use trued_client::{
    Client, ForceSamples, ForceSource, Samples, Setpoint, WrenchFrame, monotonic_ns,
};
use world::cell::{Cell, FORCES_PER_TICK, Setup, Tick};

use super::log::{Log, keeps_invariants};
use super::page;
use super::scene::{Scene, TICK_S};
use crate::exit::{Answer, Failure, Outcome};
use crate::interrupt;

/// How long the cell waits for the daemon at the start.
const JOIN_WITHIN: Duration = Duration::from_secs(5);
/// How long it waits for an answer in each tick; the rest of the tick is the robot's.
const ANSWER_WITHIN: Duration = Duration::from_micros(800);
/// How old an answer may be: as long as the daemon takes commands for fresh, on a machine that is no controller.
const FRESH: Duration = Duration::from_millis(50);
/// How long before a tick is due it begins to spin.
const SPIN_BEFORE_NS: u64 = 120_000;
/// Ticks between two signs of life.
const TELL_EVERY: usize = 100;
const TICK_NS: u64 = (TICK_S * 1e9) as u64;

/// Runs the cell `name` and says what it measured.
pub(super) fn run(name: &str, scene: &Scene, out: &Path) -> Outcome {
    let stop = interrupt::flag()?;
    let mut client = Client::connect(name, JOIN_WITHIN).map_err(Failure::system)?;
    client.set_fresh(FRESH);
    let force = ForceSource::connect(name, JOIN_WITHIN).map_err(Failure::system)?;
    let setup =
        Setup { chatter: Some(scene.chatter), ..Setup::quiet(scene.path.clone(), scene.seed) };
    let log = Log::new(scene.path.samples.len()).map_err(Failure::system)?;
    let mut loop_ = Loop {
        client,
        force,
        cell: Cell::new(&scene.truth, setup),
        log,
        start_ns: 0,
        before: None,
    };
    loop_.run(scene, &stop)?;
    loop_.hear_out();
    let rejected = loop_.client.status().map_or(0, |status| status.rejected);
    let report = loop_.log.report(scene, rejected);
    let page = page::render(scene, &report, &loop_.log);
    crate::atomic::write(&out.join("report.html"), |file| file.write_all(page.as_bytes()))?;
    recording::series::write(&out.join("recording.csv"), &loop_.log.recording(scene))
        .map_err(Failure::system)?;
    let json = serde_json::to_string(&report).map_err(Failure::system)?;
    tell(&format!("report {json}"))?;
    Ok(Answer::Done)
}

struct Loop {
    client: Client,
    force: ForceSource,
    cell: Cell,
    log: Log,
    start_ns: u64,
    before: Option<(Joints, u64)>,
}

impl Loop {
    fn run(&mut self, scene: &Scene, stop: &std::sync::atomic::AtomicBool) -> Result<(), Failure> {
        self.start_ns = monotonic_ns() + TICK_NS;
        for k in 0..self.cell.ticks() {
            let due_ns = self.start_ns + k as u64 * TICK_NS;
            wait_until(due_ns);
            self.tick(scene, due_ns);
            if k % TELL_EVERY == 0 {
                if super::is_set(stop) {
                    return Err(Failure::Interrupted);
                }
                tell(&format!("tick {k}"))?;
            }
        }
        Ok(())
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
            if self.client.wait_corrected(seq, ANSWER_WITHIN).is_some() {
                self.log.latency.saturating_record(monotonic_ns() - sent_ns);
            } else {
                self.log.missed += 1;
            }
        }
        let now_ns = monotonic_ns();
        let target = self.client.target_for(&q_cmd[..joints], now_ns);
        let mut published = [0.0; JOINTS_MAX];
        published[..joints].copy_from_slice(target.joints());
        self.check(scene, &q_cmd, &published, now_ns);
        let Some(tick) = self.cell.step(&published) else { return };
        self.log.tick(&tick, &published);
        self.send_forces(&tick, due_ns);
        while let Some(verdict) = self.client.vibration() {
            self.log.verdict(&verdict, self.start_ns);
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

    /// Gives the vibration watch a moment for its last words.
    fn hear_out(&mut self) {
        std::thread::sleep(Duration::from_millis(50));
        while let Some(verdict) = self.client.vibration() {
            self.log.verdict(&verdict, self.start_ns);
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

fn tell(line: &str) -> Result<(), Failure> {
    use std::io::Write;
    let mut out = std::io::stdout().lock();
    writeln!(out, "{line}").and_then(|()| out.flush()).map_err(Failure::system)
}
