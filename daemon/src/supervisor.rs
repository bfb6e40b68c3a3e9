//! Supervision: status, requests, reload of the model, dead clients.
//!
//! Thread of [`crate::run`], 50 times a second. A model that cannot be loaded has no effect, and
//! its errors are reported; a valid one is activated between two cycles. The cycle never waits for
//! this thread.

use crate::ageing::Age;
use crate::change_log::{ChangeLog, RequestLog};
use crate::exchange::{Exchange, LoadedModel, RecorderAnswer};
use crate::lead::LeadSettings;
use crate::notebook::States;
use crate::process::Process;
use crate::{admission, at_rest, log_model, recorder, sender, status};
use corrector::Mode;
use crossbeam::queue::ArrayQueue;
use recording::blackbox::{LogRecord, ModelChange};
use recording::cell::CellConfig;
use recording::model::RobotModel;
use shm_schema::{
    Answer, ControlServer, DaemonSide, DomainError, JointBounds, Operation, PortError, Publisher,
    RecorderAction, RecorderState, Request, Response, Status, Text, monotonic_ns,
};
use std::path::PathBuf;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};
use tracing::{info, warn};

/// Period of the supervisor.
pub const LOOK_EVERY: Duration = Duration::from_millis(20);
/// Periods between two messages on `/status`.
const STATUS_EVERY: u32 = 2;
/// Time limit for closing a recording, in which its disk writes outstanding data.
const CLOSING_MAX: Duration = Duration::from_secs(3);
/// Time limit for adopting a model, or for threads to switch to a new epoch.
const PATIENCE: Duration = Duration::from_millis(500);
/// Least time between two epochs, so that repeated rejoin requests or damage to the cell's files do
/// not move all clients continually.
const RENEW_AGAIN_AFTER: Duration = Duration::from_millis(250);

/// Level of markers in the recording's log.
const MARK: &str = "mark";

/// State of the supervisor.
#[derive(Debug)]
pub struct Supervisor {
    /// The cell's shared memory.
    pub domain: DaemonSide,
    status: Publisher<Status>,
    control: ControlServer,
    model_path: PathBuf,
    model: RobotModel,
    model_epoch: u64,
    constants: status::Constants,
    process: Process,
    age: Age,
    /// Standard uncertainty of the model by its validation, m; `None`: the trim's estimate is not
    /// compared with it.
    model_sigma_m: Option<f64>,
    change_log: ChangeLog,
    states: States,
    requests: RequestLog,
    looks: u32,
    /// Summary of the last status.
    said: Text<512>,
    renewed: Option<Instant>,
}

impl Supervisor {
    /// Creates the ports, in the thread that will use them.
    ///
    /// # Errors
    /// If the transport refuses a port.
    pub fn join(
        domain: DaemonSide,
        config: &CellConfig,
        model: RobotModel,
        bounds: JointBounds,
        lead: Option<LeadSettings>,
    ) -> Result<Self, PortError> {
        let ports = domain.ports();
        Ok(Self {
            status: ports.publisher()?,
            control: ports.control()?,
            model_path: config.model.clone(),
            model_epoch: 1,
            constants: status::Constants::new(config, &model, bounds, lead, monotonic_ns()),
            process: Process::new(config, &model),
            age: Age::default(),
            model_sigma_m: config.measured.and_then(|measured| measured.model_sigma_m),
            change_log: ChangeLog::default(),
            states: States::default(),
            requests: RequestLog::default(),
            looks: 0,
            said: Text::new("starting"),
            renewed: None,
            domain,
            model,
        })
    }

    /// One period.
    ///
    /// # Errors
    /// [`DomainError::AlreadyServed`] if another daemon has taken over this cell.
    pub fn look(&mut self, exchange: &Exchange) -> Result<(), DomainError> {
        free_retired(exchange);
        self.serve(exchange);
        let commands_come = status::commands_come(exchange, monotonic_ns());
        self.process.look(&self.model, exchange, commands_come);
        let found = self.domain.supervise();
        if found.cleaned > 0 {
            info!(clients = found.cleaned, "cleaned up after terminated clients");
        }
        let wanted = found.knocked || found.torn;
        if wanted && self.renewed.is_none_or(|at| at.elapsed() > RENEW_AGAIN_AFTER) {
            let why = if found.torn {
                "its shared-memory files were removed or changed"
            } else {
                "a client cannot join"
            };
            warn!("{why}: creating new shared memory for this cell");
            self.renewed = Some(Instant::now());
            self.renew(exchange)?;
        }
        if self.looks.is_multiple_of(STATUS_EVERY) {
            self.tell(exchange);
        }
        self.looks = self.looks.wrapping_add(1);
        Ok(())
    }

    /// Publishes the present status and logs changes.
    pub fn tell(&mut self, exchange: &Exchange) {
        let process = self.process.state();
        let message = self.constants.status(exchange, &process, &self.age, monotonic_ns());
        self.status.send(&message);
        if let Some(sigma_m) = self.model_sigma_m {
            self.age.watch(&message, sigma_m);
        }
        self.said = message.message;
        if let Some(state) = self.states.take(&message) {
            exchange.note_state(state);
        }
        self.change_log.log(exchange, &message);
    }

    /// Summary of the last status.
    #[must_use]
    pub fn words(&self) -> &str {
        self.said.as_str()
    }

    fn serve(&mut self, exchange: &Exchange) {
        let Self { control, model_path, model, model_epoch, constants, process, age, .. } = self;
        let requests = &mut self.requests;
        while control.serve_known(|request, pid| {
            let mut desk = Desk { model_path, model, model_epoch, constants, process, age, pid };
            let (answer, words) = desk.answer(exchange, request);
            requests.log(request.operation, answer, &words, pid, monotonic_ns());
            Response::to(request, answer, &words)
        }) {}
    }

    /// Makes a new epoch when clients cannot join the present one: the threads switch to it, then
    /// it is announced.
    fn renew(&mut self, exchange: &Exchange) -> Result<(), DomainError> {
        match self.domain.renew() {
            Err(fault @ DomainError::AlreadyServed { .. }) => return Err(fault),
            Err(fault) => {
                warn!(%fault, "no new epoch");
                return Ok(());
            }
            Ok(()) => {}
        }
        let ports = self.domain.ports();
        for ring in &exchange.new_ports {
            // Ports of an epoch that a thread has not switched to yet are out of date.
            ring.force_push(ports.clone());
        }
        let since = Instant::now();
        let taken = || exchange.new_ports.iter().all(ArrayQueue::is_empty);
        while !taken() && since.elapsed() < PATIENCE {
            std::thread::sleep(Duration::from_millis(1));
        }
        match (ports.publisher(), ports.control()) {
            (Ok(status), Ok(control)) => (self.status, self.control) = (status, control),
            _ => warn!("no status or control service in the new epoch"),
        }
        self.tell(exchange);
        if let Err(fault) = self.domain.announce() {
            warn!(%fault, "the new epoch could not be announced");
        }
        Ok(())
    }
}

/// Answers requests.
struct Desk<'a> {
    model_path: &'a mut PathBuf,
    model: &'a mut RobotModel,
    model_epoch: &'a mut u64,
    constants: &'a mut status::Constants,
    process: &'a mut Process,
    age: &'a mut Age,
    /// The requesting process.
    pid: Option<u32>,
}

impl Desk<'_> {
    fn answer(&mut self, exchange: &Exchange, request: &Request) -> (Answer, String) {
        let Ok(operation) = request.operation() else {
            return (Answer::Malformed, format!("unknown operation {}", request.operation));
        };
        let on = request.on != 0;
        match operation {
            Operation::Ping => (Answer::Done, "here".to_owned()),
            Operation::Reload => self.reload(exchange, request),
            Operation::Bypass => self.bypass(exchange, on),
            Operation::Arm => self.arm(exchange, on),
            Operation::ProcessState => self.process.tell(exchange, request),
            Operation::Measured => self.age.tell(&self.model.physics, request),
            Operation::Mode => self.go_to(exchange, request.on),
            Operation::Mark => self.mark(exchange, request.path.as_str()),
            Operation::Record => record(exchange, request.on),
        }
    }

    /// Writes a marker into the recording, as a line of its log with a level of its own.
    fn mark(&self, exchange: &Exchange, text: &str) -> (Answer, String) {
        let state = exchange.recorder(monotonic_ns());
        if state != RecorderState::Recording {
            let words = format!(
                "nothing is being recorded (recorder: {state}); use `trued record start`, with a table [recorder] in the configuration"
            );
            return (Answer::Refused, words);
        }
        let says = format!("{text} (by {})", sender::words(self.pid));
        exchange.note(|| LogRecord { t_ns: monotonic_ns(), level: MARK.to_owned(), says });
        (Answer::Done, "marked".to_owned())
    }

    fn bypass(&mut self, exchange: &Exchange, on: bool) -> (Answer, String) {
        let was = exchange.bypassed.swap(on, Relaxed);
        if was != on {
            self.constants.bypassed_by = on.then(|| sender::words_of_now(self.pid));
        }
        let words = if on { "the correction ramps out" } else { "the correction ramps in" };
        (Answer::Done, words.to_owned())
    }

    /// Sets a mode; the corrector and the client's limiter ramp the change.
    fn go_to(&mut self, exchange: &Exchange, code: u32) -> (Answer, String) {
        let Ok(mode) = shm_schema::Mode::try_from(code) else {
            return (Answer::Malformed, format!("unknown mode {code}"));
        };
        let most = self.constants.mode_max;
        if mode.code() > most.code() {
            let words = format!(
                "the configuration of this cell allows at most `{most}`: set mode_max = \"{mode}\" in it \
                 and restart the daemon"
            );
            return (Answer::Refused, words);
        }
        let words = match mode {
            shm_schema::Mode::Shadow => "shadow: commands pass unchanged",
            shm_schema::Mode::Limited => "limited: corrections up to a tenth of the limits",
            shm_schema::Mode::Full => "full: corrections up to the limits",
        };
        self.set_mode(exchange, status::mode_of(mode));
        (Answer::Done, words.to_owned())
    }

    fn set_mode(&mut self, exchange: &Exchange, mode: Mode) {
        if mode != exchange.mode() {
            self.constants.mode_by = Some(sender::words_of_now(self.pid));
        }
        exchange.set_mode(mode);
        exchange.rearm.store(mode != Mode::Shadow, Relaxed);
    }

    fn arm(&mut self, exchange: &Exchange, on: bool) -> (Answer, String) {
        // Independent of the configured mode: the registration of the instrument was checked.
        exchange.believe_instrument.store(on, Relaxed);
        let (mode, words) = match (on, self.constants.armed_mode) {
            (false, _) => (Mode::Shadow, "shadow: commands pass unchanged"),
            (true, Some(mode)) => (mode, "armed: corrections are applied"),
            (true, None) => {
                let words = "this cell is configured for shadow mode: set mode = \"limited\" or \"full\" \
                             in its configuration and restart the daemon, or mode_max, and ask for a mode; \
                             an instrument whose readings jumped is used again in any case";
                return (Answer::Refused, words.to_owned());
            }
        };
        self.set_mode(exchange, mode);
        (Answer::Done, words.to_owned())
    }

    fn reload(&mut self, exchange: &Exchange, request: &Request) -> (Answer, String) {
        let path = request.path.as_str();
        let path = if path.is_empty() { self.model_path.clone() } else { PathBuf::from(path) };
        let next = match at_rest::read(&path) {
            Ok(next) => next,
            Err(fault) => return (Answer::Refused, brief(&fault)),
        };
        let asked = admission::Request {
            other_robot: request.other_robot != 0,
            in_shadow: exchange.mode() == Mode::Shadow,
        };
        if let Some(words) = admission::refusal(self.model, &next, &exchange.positions, asked) {
            return (Answer::Refused, words);
        }
        if !self.hand_over(exchange, &next) {
            return (Answer::Failed, "the cycle did not take over the model in time".to_owned());
        }
        let words = format!("{} loaded from {}", next.file.name, path.display());
        log_model(&next, self.constants.lead.is_some());
        let header = recorder::header("", &next, *self.model_epoch, String::new());
        exchange.record_model(ModelChange { t_ns: monotonic_ns(), header });
        self.constants.take(&next);
        self.process.take(&next);
        *self.age = Age::default();
        (*self.model_path, *self.model) = (path, next);
        (Answer::Done, brief(&words))
    }

    /// Activates the model between two cycles and waits until the cycle has it.
    fn hand_over(&mut self, exchange: &Exchange, next: &RobotModel) -> bool {
        let epoch = *self.model_epoch + 1;
        let filter = self.constants.lead.and_then(|lead| lead.filter(next));
        let loaded = Box::new(LoadedModel { filter, ..LoadedModel::new(next.physics, epoch) });
        // Several requests may arrive in one period: the cycle must always find room for the model
        // that it returns.
        free_retired(exchange);
        if exchange.next_model.push(loaded).is_err() {
            return false;
        }
        let since = Instant::now();
        while !exchange.next_model.is_empty() {
            if since.elapsed() > PATIENCE && exchange.next_model.pop().is_some() {
                return false;
            }
            std::thread::sleep(Duration::from_micros(200));
        }
        *self.model_epoch = epoch;
        true
    }
}

/// Passes a request to the recorder, and returns its answer.
fn record(exchange: &Exchange, code: u32) -> (Answer, String) {
    let Ok(action) = RecorderAction::try_from(code) else {
        return (Answer::Malformed, format!("unknown recorder request {code}"));
    };
    if !exchange.records() {
        let words = "this cell has no recorder; add a table [recorder] to its configuration";
        return (Answer::Refused, words.to_owned());
    }
    // Late answers of a slow recorder.
    while exchange.recorder_answered.pop().is_some() {}
    exchange.recorder_asked.force_push(action);
    let since = Instant::now();
    while since.elapsed() < CLOSING_MAX {
        if let Some(RecorderAnswer { answer, says }) = exchange.recorder_answered.pop() {
            return (answer, brief(&says));
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    // A request that nobody waits for any more is withdrawn.
    let words = match exchange.recorder_asked.pop() {
        Some(_) => "the recorder does not respond; check its disk. Nothing was done",
        None => "the recorder is slow and still working; see `trued status`",
    };
    (Answer::Failed, words.to_owned())
}

/// Frees models returned by the cycle, in this thread, where freeing may take time.
fn free_retired(exchange: &Exchange) {
    while exchange.retired_models.pop().is_some() {}
}

/// Shortens a message to the length of an answer: its first lines.
fn brief(words: &str) -> String {
    words.chars().take(admission::WORDS_MAX).collect()
}
