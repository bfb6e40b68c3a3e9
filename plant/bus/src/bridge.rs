//! The bridge of one cell: reads its daemon as a [`Monitor`], writes every message to the spool, then publishes it.
//!
//! With a file of the cell's owner it also judges offered models ([`crate::acceptance`]), and asks the daemon to load one where that file says so; that is the only request it makes.
//!
//! The daemon does not wait for a monitor, so nothing here (a full disk, a network that stalls, this process dying) delays its cycle. A message is on disk before it is sent:
//! what a subscriber missed it finds in the history, also after a restart of the bridge.

use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use live::report::Report;
use shm_schema::{Announcement, Cell};
use trued_client::{Answer, ConnectionEvent, Monitor, Status};

use crate::acceptance::{Accept, Acceptance, Reason, Refusal};
use crate::keys::{Keys, NotAName};
use crate::message::{Content, Event, Message, SCHEMA, SpoolState, Summary};
use crate::model_age::ModelSince;
use crate::offer;
use crate::settings::Settings;
use crate::spool::{Found, Spool, SpoolError};
use crate::summary::{Accumulator, Changes, alarms, health};
use crate::zenoh_bus::{Bus, BusError, Endpoints, Kept, Offered};

/// Why the bridge does not start, or ends.
#[derive(Debug, thiserror::Error)]
pub enum BridgeError {
    /// Group or cell cannot be part of a key.
    #[error(transparent)]
    Name(#[from] NotAName),
    /// The cell's name is none.
    #[error("cell: {0}")]
    Cell(String),
    /// Summaries per second are out of range.
    #[error("{0} summaries per second; expected 0.1 to 10")]
    Rate(f64),
    /// Messages cannot be kept.
    #[error(transparent)]
    Spool(#[from] SpoolError),
    /// The bus cannot be used.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The age of the model cannot be noted.
    #[error("the spool's folder: cannot write the file `model`: {0}")]
    ModelSince(std::io::Error),
    /// A message is not JSON.
    #[error("a message cannot be written as JSON: {0}; please report it")]
    Json(serde_json::Error),
}

impl BridgeError {
    /// Whether what was given is wrong, rather than the system.
    #[must_use]
    pub fn is_input(&self) -> bool {
        let endpoint = matches!(self, Self::Bus(BusError::Endpoint(_) | BusError::NoEndpoint));
        let budget = matches!(self, Self::Spool(SpoolError::Budget(_)));
        endpoint || budget || matches!(self, Self::Name(_) | Self::Cell(_) | Self::Rate(_))
    }
}

/// The bridge of one cell.
pub struct Bridge {
    settings: Settings,
    keys: Keys,
    cell: Cell,
    bus: Bus,
    kept: Arc<Kept>,
    model_since: ModelSince,
    monitor: Option<Monitor>,
    /// Why the daemon is not connected.
    absent: String,
    /// Time stamp of the last status of a daemon that ended, so that it is not taken for one of the next daemon.
    former_t_ns: u64,
    status: Option<Status>,
    daemon_version: Option<String>,
    sums: Accumulator,
    changes: Changes,
    summarised: Instant,
    found: Found,
    /// Which offered models the cell takes; none: no model.
    acceptance: Option<Acceptance>,
    judged: Option<Instant>,
}

fn now_unix_ms() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_millis() as u64)
}

impl Bridge {
    /// Opens the spool in `folder` and puts the cell on the bus; its daemon need not be there.
    ///
    /// # Errors
    /// See [`BridgeError`].
    pub fn open(
        keys: Keys,
        endpoints: &Endpoints,
        folder: &Path,
        settings: Settings,
    ) -> Result<Self, BridgeError> {
        if !(0.1..=10.0).contains(&settings.summaries_hz) {
            return Err(BridgeError::Rate(settings.summaries_hz));
        }
        let cell = Cell::new(&keys.cell).map_err(|why| BridgeError::Cell(why.to_string()))?;
        let (spool, found) = Spool::open(folder, settings.spool_bytes, now_unix_ms())?;
        let kept = Kept::new(spool, settings.page_bytes);
        let bus = Bus::open(endpoints, keys.clone(), Arc::clone(&kept))?;
        Ok(Self {
            settings,
            keys,
            cell,
            bus,
            kept,
            model_since: ModelSince::read(folder),
            monitor: None,
            absent: "not looked for yet".to_owned(),
            former_t_ns: 0,
            status: None,
            daemon_version: None,
            sums: Accumulator::default(),
            changes: Changes::default(),
            summarised: Instant::now(),
            found,
            acceptance: None,
            judged: None,
        })
    }

    /// The kept messages, for another reader.
    #[must_use]
    pub fn kept(&self) -> Arc<Kept> {
        Arc::clone(&self.kept)
    }

    /// Takes offered models as `acceptance` says; without this call all are refused.
    #[must_use]
    pub fn accepting(self, acceptance: Acceptance) -> Self {
        Self { acceptance: Some(acceptance), ..self }
    }

    /// What was in the spool.
    #[must_use]
    pub fn found(&self) -> Found {
        self.found
    }

    /// Runs until `stop` is set; what becomes of offered models is written to `log`.
    ///
    /// # Errors
    /// See [`BridgeError`].
    pub fn run(&mut self, stop: &AtomicBool, log: &mut impl Write) -> Result<(), BridgeError> {
        let version = env!("CARGO_PKG_VERSION").to_owned();
        let torn_bytes = self.found.torn_bytes;
        self.publish(Content::Event(Event::BridgeStarted { version, torn_bytes }))?;
        let period = Duration::from_secs_f64(1.0 / self.settings.summaries_hz);
        while !stop.load(Relaxed) {
            self.poll()?;
            self.judge_offer(log)?;
            if self.summarised.elapsed() >= period {
                self.summarise()?;
            }
            std::thread::sleep(self.settings.look_every);
        }
        Ok(())
    }

    /// Judges an offered model, and tells the bus, the log and who offered it.
    fn judge_offer(&mut self, log: &mut impl Write) -> Result<(), BridgeError> {
        if self.judged.is_some_and(|judged| judged.elapsed() < self.settings.offer_every) {
            return Ok(());
        }
        let Some(offered) = self.bus.next_offer() else { return Ok(()) };
        let event = self.take_model(&offered).unwrap_or_else(|refusal| Event::ModelRefused {
            sha256: offer::sha256(&offered.model),
            reason: refusal.reason,
            message: refusal.message,
        });
        self.judged = Some(Instant::now());
        // A log that nobody reads any more must not end the bridge.
        let _ = match &event {
            Event::ModelRefused { sha256, message, .. } => {
                writeln!(log, "offered model {sha256}: rejected: {message}")
            }
            Event::ModelLoaded { sha256, message, .. } => {
                writeln!(log, "offered model {sha256}: {message}")
            }
            Event::ModelStaged { path, .. } => writeln!(log, "offered model staged: {path}"),
            _ => Ok(()),
        };
        offered.answer(self.publish(Content::Event(event))?);
        Ok(())
    }

    /// Checks an offered model, stages it, and has it loaded where the owner's file says so.
    fn take_model(&mut self, offered: &Offered) -> Result<Event, Refusal> {
        let Some(acceptance) = &mut self.acceptance else {
            let message = "this cell accepts no models: its bridge runs without `--models`";
            return Err(Refusal::new(Reason::NotAccepted, message));
        };
        let checked = acceptance.check(&offered.model, &offered.signature, now_unix_ms())?;
        let (sha256, counter) = (checked.statement.sha256.clone(), checked.statement.counter);
        if acceptance.accept() == Accept::Stage {
            let path = acceptance.stage(&checked)?.display().to_string();
            return Ok(Event::ModelStaged { sha256, counter, path });
        }
        let away = |why: String| Refusal::new(Reason::DaemonAway, why);
        let monitor = self.monitor.as_mut().ok_or_else(|| away(self.absent.clone()))?;
        if let Some(why) = monitor.disconnect_reason() {
            return Err(away(why.to_string()));
        }
        let file = acceptance.stage(&checked)?;
        let response = monitor.reload(Some(&file), self.settings.load_within);
        let refused = match response {
            Ok(response) if response.answer() == Ok(Answer::Done) => {
                let (path, message) = (file.display().to_string(), response.message.to_string());
                return Ok(Event::ModelLoaded { sha256, counter, path, message });
            }
            Ok(response) => Refusal::new(Reason::DaemonRefused, response.message.to_string()),
            // It may still load it, so the file stays.
            Err(why) => return Err(away(why.to_string())),
        };
        acceptance.discard(&file);
        Err(refused)
    }

    /// Writes a message to the spool, then publishes it; returns it.
    fn publish(&mut self, content: Content) -> Result<Vec<u8>, BridgeError> {
        let kind = content.kind();
        let mut spool = self.kept.spool();
        let message = Message {
            schema: SCHEMA,
            stream: spool.stream(),
            number: spool.next(),
            unix_ms: now_unix_ms(),
            group: self.keys.group.clone(),
            cell: self.keys.cell.clone(),
            content,
        };
        let bytes = serde_json::to_vec(&message).map_err(BridgeError::Json)?;
        spool.append(&bytes)?;
        drop(spool);
        self.bus.send(kind, bytes.clone())?;
        Ok(bytes)
    }

    /// Reads the daemon's messages and publishes what changed.
    fn poll(&mut self) -> Result<(), BridgeError> {
        self.connect();
        let mut events = Vec::new();
        if let Some(monitor) = &mut self.monitor {
            while let Some(event) = monitor.next_event() {
                if matches!(event, ConnectionEvent::Connected { .. }) {
                    let current = Announcement::read(&self.cell);
                    self.daemon_version = current.ok().map(|current| current.contract.program);
                }
                events.push(match event {
                    ConnectionEvent::Connected { pid, .. } => Event::DaemonConnected { pid },
                    ConnectionEvent::Lost { why, .. } => Event::DaemonLost { why },
                });
            }
            while let Some(verdict) = monitor.vibration() {
                events.extend(self.changes.vibration(&verdict));
            }
        }
        let away = self.take_status();
        let alarms = alarms(self.status.as_ref(), away.is_some());
        let report = self.report(away.clone());
        let hash = report.as_ref().map(|report| report.model.hash.as_str());
        events.extend(self.changes.events(&alarms, hash));
        for event in events {
            self.publish(Content::Event(event))?;
        }
        let health = health(report.as_ref(), away.as_deref());
        match self.changes.health(health) {
            Some(health) => self.publish(Content::Health(health)).map(drop),
            None => Ok(()),
        }
    }

    fn connect(&mut self) {
        if self.monitor.is_none() {
            match Monitor::connect_to(&self.cell, self.settings.connect_within) {
                Ok(monitor) => self.monitor = Some(monitor),
                Err(why) => self.absent = why.to_string(),
            }
        }
    }

    /// Reads the newest status; returns why the daemon does not respond, `None` if it does.
    fn take_status(&mut self) -> Option<String> {
        let Some(monitor) = &mut self.monitor else { return Some(self.absent.clone()) };
        let status = monitor.status();
        if let Some(away) = monitor.disconnect_reason() {
            self.former_t_ns = status.map_or(0, |status| status.t_ns);
            return Some(away.to_string());
        }
        let Some(status) = status.filter(|status| status.t_ns != self.former_t_ns) else {
            return Some("its first status has not arrived yet".to_owned());
        };
        if self.status.is_none_or(|last| last.t_ns != status.t_ns) {
            self.sums.add(&status);
            self.status = Some(status);
        }
        None
    }

    fn report(&self, away: Option<String>) -> Option<Report> {
        self.status.as_ref().map(|status| Report::new(&self.keys.cell, status, away))
    }

    fn summarise(&mut self) -> Result<(), BridgeError> {
        let away = self.take_status();
        let status = self.report(away.clone());
        let model_since = &mut self.model_since;
        let since = status.as_ref().map(|report| model_since.of(&report.model.hash, now_unix_ms()));
        let model_since_unix_ms = since.transpose().map_err(BridgeError::ModelSince)?;
        let spool = {
            let (kept, budget_bytes) = (self.kept.spool(), self.settings.spool_bytes);
            SpoolState { first: kept.first(), bytes: kept.bytes(), budget_bytes }
        };
        let period_s = self.summarised.elapsed().as_secs_f64();
        self.summarised = Instant::now();
        let summary = Summary {
            period_s,
            bridge_version: env!("CARGO_PKG_VERSION").to_owned(),
            daemon_version: self.daemon_version.clone(),
            alarms: alarms(self.status.as_ref(), away.is_some()),
            away,
            model_since_unix_ms,
            correction: self.sums.take(),
            spool,
            status,
        };
        self.publish(Content::Summary(Box::new(summary))).map(drop)
    }
}
