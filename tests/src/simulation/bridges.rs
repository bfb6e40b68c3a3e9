//! Both bridges in virtual time, between a controller and a daemon with random faults. The targets
//! of the robot are checked by the oracle in every cycle.
//!
//! The bridges are those of the product, without sockets; so are the corrector and the client's
//! output behind them. Datagrams of the controller are lost, late, repeated, reordered, replayed,
//! truncated, foreign, and jitter by up to half a millisecond.

mod egm;
mod rsi;

use crate::oracle::Oracle;
use crate::place::MODEL;
use crate::rng::TestRng;
use bridge::link::{Correction, Link};
use corrector::{Corrector, CycleInputs, Mode, Settings};
use daemon::{setup, translate};
use envelope::Limits;
use physics::{JOINTS_MAX, Model};
use recording::model::presets::preset;
use shm_schema::{Command, Corrected, CorrectionStatus, FeedBounds, RobotState};
use trued_client::{Output, Setpoint};

/// Time between a controller's cycles, ns, and the largest delay of each.
const CYCLE_NS: u64 = 4_000_000;
const JITTER_NS: u64 = 500_000;
/// Cycles with faults, then without.
const STORM: u64 = 1000;
const CALM: u64 = 750;
/// Limits of the feed override sent by the daemon.
const FEED: FeedBounds =
    FeedBounds { floor: 0.1, lost: 0.2, down_per_s: 2.0, up_per_s: 0.2, hold_s: 0.2 };
/// Its overrides in turn, including invalid ones, and the number of commands for each.
const ASKED: [f64; 6] = [0.3, 1.0, f64::NAN, 0.1, 7.0, 0.7];
const ASKED_COMMANDS: u64 = 60;
/// Number of cycles after the last fault within which the daemon's own correction must be sent.
const BACK_AFTER: u64 = 250;

/// Result of a run.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Targets that reached the robot, each judged.
    pub sent: u64,
    /// Runs of the robot.
    pub runs: u64,
    /// Phases of faults, each followed by a phase without faults in which the daemon's correction
    /// returned.
    pub storms: u64,
    /// The largest correction that went out, rad.
    pub largest: f64,
    /// The violation, as text; a run ends with the first.
    pub broken: Option<String>,
}

impl Summary {
    fn breaks(&mut self, text: &str) {
        let message = format!("target {} of run {}: {text}", self.sent, self.runs);
        self.broken.get_or_insert(message);
    }
}

/// EGM until `targets` targets have reached the robot, or a violation.
#[must_use]
pub fn egm(seed: u64, targets: u64) -> Summary {
    run(egm::EgmCell::new(seed), targets)
}

/// The same for RSI, with absolute or relative corrections.
#[must_use]
pub fn rsi(seed: u64, targets: u64, is_relative: bool) -> Summary {
    run(rsi::RsiCell::new(seed, is_relative), targets)
}

/// A controller with its program, its bridge and the daemon behind that.
trait ControllerCell {
    /// Injects a fault, effective now or in the next cycles.
    fn fault(&mut self);

    /// One cycle of the controller.
    fn cycle(&mut self);

    fn daemon(&mut self) -> &mut VirtualDaemon;

    fn summary(&mut self) -> &mut Summary;
}

/// Phases of faults, each followed by a phase without faults in which the daemon's correction has
/// to return.
fn run(mut cell: impl ControllerCell, targets: u64) -> Summary {
    while cell.summary().sent < targets && cell.summary().broken.is_none() {
        cell.daemon().fails = true;
        for _ in 0..STORM {
            cell.fault();
            cell.cycle();
        }
        cell.daemon().calm();
        let mut exact = 0;
        for k in 0..CALM {
            cell.cycle();
            exact += u64::from(k >= BACK_AFTER && cell.daemon().is_exact());
        }
        // Backlash is ramped where joints turn back.
        if exact < (CALM - BACK_AFTER) / 2 {
            cell.summary().breaks(&format!("{exact} exact corrections in a calm"));
        }
        cell.summary().storms += 1;
    }
    cell.summary().clone()
}

fn settings() -> Settings {
    let limits = Limits::new(0.02, 0.05, 5.0).expect("positive");
    Settings { mode: Mode::Full, period_ns: CYCLE_NS, ..Settings::with_envelope(limits) }
}

fn model() -> Model {
    preset(MODEL).and_then(|preset| preset.model().ok()).expect("a preset of the house").physics
}

fn oracle() -> Oracle {
    Oracle::new(&setup::bounds(&settings(), &model().arm), 0.0)
}

/// A daemon without shared memory, that answers in time, late, or not at all.
struct VirtualDaemon {
    now_ns: u64,
    chance: TestRng,
    fails: bool,
    output: Output,
    corrector: Corrector,
    model: Model,
    models: [Model; 2],
    session: u64,
    seq: u64,
    sent: Option<Command>,
    newest: Option<Corrected>,
    /// An answer in transit.
    late: Option<Corrected>,
    /// Time until which there is no daemon, ns.
    away_until_ns: u64,
}

impl VirtualDaemon {
    fn new(seed: u64) -> Self {
        let full = model();
        let mut output = Output::new();
        output.set_bounds(&setup::bounds(&settings(), &full.arm));
        output.set_feed_bounds(&FEED);
        output.fresh_ns = 10_000_000;
        Self {
            now_ns: 0,
            chance: TestRng::new(seed),
            fails: false,
            output,
            corrector: Corrector::new(settings()),
            model: full,
            models: [full, Model::nominal(full.arm)],
            session: 1,
            seq: 0,
            sent: None,
            newest: None,
            late: None,
            away_until_ns: 0,
        }
    }

    /// Whether the target sent is the newest one with the daemon's own correction, bit for bit.
    fn is_exact(&self) -> bool {
        let (Some(newest), Some(sent)) = (self.newest, self.sent) else { return false };
        newest.command_seq == sent.seq && newest.correction == self.output.correction()
    }

    fn calm(&mut self) {
        (self.fails, self.away_until_ns) = (false, 0);
        self.corrector.set_mode(Mode::Full);
        self.corrector.set_bypass(false);
        // With the nominal model there would be no correction.
        self.model = self.models[0];
        self.corrector.model_changed(&self.model);
    }

    fn trouble(&mut self) {
        let c = &mut self.chance;
        match c.below(600) {
            0 => {
                self.away_until_ns = self.now_ns + c.below(500_000_000);
                self.corrector = Corrector::new(settings());
                self.newest = None;
            }
            1 => self.away_until_ns = self.now_ns + c.below(60_000_000),
            2 => self.corrector.set_bypass(c.below(2) == 0),
            3 => {
                self.model = self.models[c.below(2) as usize];
                self.corrector.model_changed(&self.model);
            }
            4 => {
                let mode = [Mode::Shadow, Mode::Limited, Mode::Full][c.below(3) as usize];
                self.corrector.set_mode(mode);
            }
            _ => {}
        }
    }

    fn answer(&mut self, command: &Command) {
        self.newest = self.late.take().or(self.newest);
        if self.fails {
            self.trouble();
        }
        if self.now_ns < self.away_until_ns {
            return;
        }
        let claim = translate::command(command, self.now_ns, false);
        let wanted =
            self.corrector.correct(&self.model, &claim, &CycleInputs::default(), self.now_ns);
        let made = self.corrector.limit(&self.model, &wanted);
        let answer = Corrected {
            seq: command.seq,
            command_seq: command.seq,
            command_session: command.session,
            made_ns: self.now_ns,
            feed_override: ASKED[(command.seq / ASKED_COMMANDS) as usize % ASKED.len()],
            ..translate::corrected(&made, self.model.arm.count())
        };
        match if self.fails { self.chance.below(30) } else { 2 } {
            0 => {}
            1 => self.late = Some(answer),
            _ => self.newest = Some(answer),
        }
    }

    fn correction(&mut self, q: &[f64]) -> Correction {
        let (newest, sent) = (self.newest.as_ref(), self.sent.as_ref());
        let target = self.output.target(q, newest, sent, self.now_ns).expect("a target");
        let rejected = CorrectionStatus::Rejected.code();
        Correction {
            rad: self.output.correction(),
            source: target.source(),
            is_refused: newest.is_some_and(|newest| newest.status == rejected),
        }
    }
}

impl Link for VirtualDaemon {
    fn command(&mut self, q: &[f64]) -> Correction {
        self.seq += 1;
        let command = Setpoint::new(q).command(self.seq, self.session, self.now_ns);
        let command = command.expect("a target");
        self.sent = Some(command);
        self.answer(&command);
        self.correction(q)
    }

    fn repeat(&mut self, q: &[f64]) -> Correction {
        self.correction(q)
    }

    fn last_correction(&self) -> [f64; JOINTS_MAX] {
        self.output.correction()
    }

    fn feed_override(&self) -> f64 {
        self.output.feed_override()
    }

    fn start_anew(&mut self) {
        (self.session, self.seq) = (self.session + 1, 0);
    }

    fn start_from(&mut self, correction: &[f64; JOINTS_MAX]) {
        self.start_anew();
        self.output.start_from(correction);
    }

    fn send_state(&mut self, _: &RobotState) {}

    fn check_connection(&mut self) {}
}
