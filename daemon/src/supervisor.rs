//! Supervision: status, requests, reload of the model, cleanup after terminated clients.
//!
//! Thread of [`crate::run`], 50 times a second. A model that cannot be loaded has no effect, and
//! its errors are reported; a valid one is activated between two cycles. The cycle never waits for
//! this thread.

use crate::ageing::ModelAgeing;
use crate::change_log::{ChangeLog, RequestLog};
use crate::exchange::{Exchange, LoadedModel, RecorderAnswer};
use crate::lead::LeadSettings;
use crate::process::ProcessTracker;
use crate::recording_log::StatusFilter;
use crate::{admission, log_model, recorder, sender, stable_file, status};
use corrector::Mode;
use crossbeam::queue::ArrayQueue;
use recording::cell::CellConfig;
use recording::mcap_recording::{LogRecord, ModelChange};
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
pub const PERIOD: Duration = Duration::from_millis(20);
/// Number of periods between two messages on `/status`.
const STATUS_EVERY: u32 = 2;
/// Time limit for closing a recording, in which its disk writes outstanding data.
const CLOSING_TIMEOUT: Duration = Duration::from_secs(3);
/// Time limit for adopting a model, or for threads to switch to a new epoch.
const HANDOVER_TIMEOUT: Duration = Duration::from_millis(500);
/// Least time between two epochs, so that repeated rejoin requests or damage to the cell's files do
/// not move all clients continually.
const RENEW_AGAIN_AFTER: Duration = Duration::from_millis(250);

/// Level of markers in the recording's log.
const MARKER_LEVEL: &str = "mark";

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
    constants: status::StatusBuilder,
    process: ProcessTracker,
    age: ModelAgeing,
    /// Standard uncertainty of the model by its validation, m; `None`: the trim's estimate is not
    /// compared with it.
    model_sigma_m: Option<f64>,
    change_log: ChangeLog,
    states: StatusFilter,
    requests: RequestLog,
    periods: u32,
    /// Summary of the last status.
    last_message: Text<512>,
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
            constants: status::StatusBuilder::new(config, &model, bounds, lead, monotonic_ns()),
            process: ProcessTracker::new(config, &model),
            age: ModelAgeing::default(),
            model_sigma_m: config.measured.and_then(|measured| measured.model_sigma_m),
            change_log: ChangeLog::default(),
            states: StatusFilter::default(),
            requests: RequestLog::default(),
            periods: 0,
            last_message: Text::new("starting"),
            renewed: None,
            domain,
            model,
        })
    }

    /// One period.
    ///
    /// # Errors
    /// [`DomainError::AlreadyServed`] if another daemon has taken over this cell.
    pub fn run_period(&mut self, exchange: &Exchange) -> Result<(), DomainError> {
        free_retired(exchange);
        self.serve(exchange);
        let commands_come = status::commands_arrive(exchange, monotonic_ns());
        self.process.update(&self.model, exchange, commands_come);
        let found = self.domain.supervise();
        if found.cleaned > 0 {
            info!(clients = found.cleaned, "cleaned up after terminated clients");
        }
        let wanted = found.epoch_requested || found.files_damaged;
        if wanted && self.renewed.is_none_or(|instant| instant.elapsed() > RENEW_AGAIN_AFTER) {
            let why = if found.files_damaged {
                "its shared-memory files were removed or changed"
            } else {
                "a client cannot join"
            };
            warn!("{why}: creating new shared memory for this cell");
            self.renewed = Some(Instant::now());
            self.renew(exchange)?;
        }
        if self.periods.is_multiple_of(STATUS_EVERY) {
            self.publish_status(exchange);
        }
        self.periods = self.periods.wrapping_add(1);
        Ok(())
    }

    /// Publishes the present status and logs changes.
    pub fn publish_status(&mut self, exchange: &Exchange) {
        let process = self.process.state();
        let message = self.constants.status(exchange, &process, &self.age, monotonic_ns());
        self.status.send(&message);
        if let Some(sigma_m) = self.model_sigma_m {
            self.age.add_trim_estimate(&message, sigma_m);
        }
        self.last_message = message.message;
        if let Some(state) = self.states.select(&message) {
            exchange.record_status(state);
        }
        self.change_log.log(exchange, &message);
    }

    /// Summary of the last status.
    #[must_use]
    pub fn summary(&self) -> &str {
        self.last_message.as_str()
    }

    fn serve(&mut self, exchange: &Exchange) {
        let Self { control, model_path, model, model_epoch, constants, process, age, .. } = self;
        let requests = &mut self.requests;
        while control.serve_with_pid(|request, pid| {
            let mut desk =
                RequestHandler { model_path, model, model_epoch, constants, process, age, pid };
            let (answer, message) = desk.answer(exchange, request);
            requests.log(request.operation, answer, &message, pid, monotonic_ns());
            Response::to(request, answer, &message)
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
        while !taken() && since.elapsed() < HANDOVER_TIMEOUT {
            std::thread::sleep(Duration::from_millis(1));
        }
        match (ports.publisher(), ports.control()) {
            (Ok(status), Ok(control)) => (self.status, self.control) = (status, control),
            _ => warn!("no status or control service in the new epoch"),
        }
        self.publish_status(exchange);
        if let Err(fault) = self.domain.announce() {
            warn!(%fault, "the new epoch could not be announced");
        }
        Ok(())
    }
}

/// Answers requests.
struct RequestHandler<'a> {
    model_path: &'a mut PathBuf,
    model: &'a mut RobotModel,
    model_epoch: &'a mut u64,
    constants: &'a mut status::StatusBuilder,
    process: &'a mut ProcessTracker,
    age: &'a mut ModelAgeing,
    /// The requesting process.
    pid: Option<u32>,
}

impl RequestHandler<'_> {
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
            Operation::ProcessState => self.process.add_report(exchange, request),
            Operation::Measured => self.age.add_measurement(&self.model.physics, request),
            Operation::Mode => self.request_mode(exchange, request.on),
            Operation::Mark => self.mark(exchange, request.path.as_str()),
            Operation::Record => request_recorder(exchange, request.on),
        }
    }

    /// Writes a marker into the recording, as a line of its log with a level of its own.
    fn mark(&self, exchange: &Exchange, text: &str) -> (Answer, String) {
        let state = exchange.recorder(monotonic_ns());
        if state != RecorderState::Recording {
            let message = format!(
                "nothing is being recorded (recorder: {state}); use `trued record start`, with a table [recorder] in the configuration"
            );
            return (Answer::Refused, message);
        }
        let text_with_sender = format!("{text} (by {})", sender::description(self.pid));
        exchange.record_line(|| LogRecord {
            t_ns: monotonic_ns(),
            level: MARKER_LEVEL.to_owned(),
            says: text_with_sender,
        });
        (Answer::Done, "marked".to_owned())
    }

    fn bypass(&mut self, exchange: &Exchange, on: bool) -> (Answer, String) {
        let was = exchange.bypassed.swap(on, Relaxed);
        if was != on {
            self.constants.bypassed_by = on.then(|| sender::description_with_time(self.pid));
        }
        let message = if on { "the correction ramps out" } else { "the correction ramps in" };
        (Answer::Done, message.to_owned())
    }

    /// Sets a mode; the corrector and the client's limiter ramp the change.
    fn request_mode(&mut self, exchange: &Exchange, code: u32) -> (Answer, String) {
        let Ok(mode) = shm_schema::Mode::try_from(code) else {
            return (Answer::Malformed, format!("unknown mode {code}"));
        };
        let mode_max = self.constants.mode_max;
        if mode.code() > mode_max.code() {
            let message = format!(
                "the configuration of this cell allows at most `{mode_max}`: set mode_max = \"{mode}\" in it \
                 and restart the daemon"
            );
            return (Answer::Refused, message);
        }
        let message = match mode {
            shm_schema::Mode::Shadow => "shadow: commands pass unchanged",
            shm_schema::Mode::Limited => "limited: corrections up to a tenth of the limits",
            shm_schema::Mode::Full => "full: corrections up to the limits",
        };
        self.set_mode(exchange, status::corrector_mode(mode));
        (Answer::Done, message.to_owned())
    }

    fn set_mode(&mut self, exchange: &Exchange, mode: Mode) {
        if mode != exchange.mode() {
            self.constants.mode_by = Some(sender::description_with_time(self.pid));
        }
        exchange.set_mode(mode);
        exchange.rearm_wrench.store(mode != Mode::Shadow, Relaxed);
    }

    fn arm(&mut self, exchange: &Exchange, on: bool) -> (Answer, String) {
        // Independent of the configured mode: the registration of the instrument was checked.
        exchange.rearm_instrument.store(on, Relaxed);
        let (mode, message) = match (on, self.constants.armed_mode) {
            (false, _) => (Mode::Shadow, "shadow: commands pass unchanged"),
            (true, Some(mode)) => (mode, "armed: corrections are applied"),
            (true, None) => {
                let message = "this cell is configured for shadow mode: set mode = \"limited\" or \"full\" \
                             in its configuration and restart the daemon, or mode_max, and ask for a mode; \
                             an instrument whose readings jumped is used again in any case";
                return (Answer::Refused, message.to_owned());
            }
        };
        self.set_mode(exchange, mode);
        (Answer::Done, message.to_owned())
    }

    fn reload(&mut self, exchange: &Exchange, request: &Request) -> (Answer, String) {
        let path = request.path.as_str();
        let path = if path.is_empty() { self.model_path.clone() } else { PathBuf::from(path) };
        let next = match stable_file::read(&path) {
            Ok(next) => next,
            Err(fault) => return (Answer::Refused, shortened(&fault)),
        };
        let reload = admission::ReloadRequest {
            other_robot: request.other_robot != 0,
            in_shadow: exchange.mode() == Mode::Shadow,
        };
        if let Some(reason) = admission::refusal(self.model, &next, &exchange.positions, reload) {
            return (Answer::Refused, reason);
        }
        if !self.hand_over(exchange, &next) {
            return (Answer::Failed, "the cycle did not take over the model in time".to_owned());
        }
        let message = format!("{} loaded from {}", next.file.name, path.display());
        log_model(&next, self.constants.lead.is_some());
        let header = recorder::header("", &next, *self.model_epoch, String::new());
        exchange.record_model(ModelChange { t_ns: monotonic_ns(), header });
        self.constants.set_model(&next);
        self.process.set_model(&next);
        *self.age = ModelAgeing::default();
        (*self.model_path, *self.model) = (path, next);
        (Answer::Done, shortened(&message))
    }

    /// Activates the model between two cycles and waits until the cycle has it.
    fn hand_over(&mut self, exchange: &Exchange, next: &RobotModel) -> bool {
        let epoch = *self.model_epoch + 1;
        let filter = self.constants.lead.and_then(|lead| lead.filter(next));
        let loaded = Box::new(LoadedModel { filter, ..LoadedModel::new(next.physics, epoch) });
        // Several requests may arrive in one period: the ring must always have space for the model
        // that the cycle returns.
        free_retired(exchange);
        if exchange.next_model.push(loaded).is_err() {
            return false;
        }
        let since = Instant::now();
        while !exchange.next_model.is_empty() {
            if since.elapsed() > HANDOVER_TIMEOUT && exchange.next_model.pop().is_some() {
                return false;
            }
            std::thread::sleep(Duration::from_micros(200));
        }
        *self.model_epoch = epoch;
        true
    }
}

/// Passes a request to the recorder, and returns its answer.
fn request_recorder(exchange: &Exchange, code: u32) -> (Answer, String) {
    let Ok(action) = RecorderAction::try_from(code) else {
        return (Answer::Malformed, format!("unknown recorder request {code}"));
    };
    if !exchange.has_recorder() {
        let message = "this cell has no recorder; add a table [recorder] to its configuration";
        return (Answer::Refused, message.to_owned());
    }
    // Discards late answers of a slow recorder.
    while exchange.recorder_answers.pop().is_some() {}
    exchange.recorder_requests.force_push(action);
    let since = Instant::now();
    while since.elapsed() < CLOSING_TIMEOUT {
        if let Some(RecorderAnswer { answer, message }) = exchange.recorder_answers.pop() {
            return (answer, shortened(&message));
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    // After the timeout the request is withdrawn.
    let message = match exchange.recorder_requests.pop() {
        Some(_) => "the recorder does not respond; check its disk. Nothing was done",
        None => "the recorder is slow and still working; see `trued status`",
    };
    (Answer::Failed, message.to_owned())
}

/// Frees models returned by the cycle, in this thread, where freeing may take time.
fn free_retired(exchange: &Exchange) {
    while exchange.retired_models.pop().is_some() {}
}

/// Shortens a message to the length of an answer: its first lines.
fn shortened(message: &str) -> String {
    message.chars().take(admission::MESSAGE_BYTES_MAX).collect()
}
