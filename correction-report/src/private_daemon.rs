//! A private daemon: a child process in a private directory on tmpfs, in lockstep.
//!
//! Nobody else can connect to it, no running cell is affected, and nothing of it remains when the
//! value is dropped.

use std::fs::{self, DirBuilder, File};
use std::io::ErrorKind;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use harness::child::ChildGuard;
use recording::model::RobotModel;
use recording::series::Recording;
use shm_schema::{Cell, Corrected, RUNTIME_DIR_ENV};
use trued_client::{Client, ConnectError, SendError};

use crate::error::Error;
use crate::lockstep::{CELL, cell_toml};
use crate::replay::{DaemonCommand, check};
use crate::setpoints::TimedSetpoint;

/// How long the daemon may take to open, and to answer one row.
const OPEN_TIMEOUT: Duration = Duration::from_secs(15);
const ANSWER_TIMEOUT: Duration = Duration::from_secs(10);
/// Interval of checks during a wait.
const POLL_EVERY: Duration = Duration::from_millis(250);
/// Lines of the daemon's log that an error shows.
const LOG_LINES_SHOWN: usize = 8;

/// The daemon and the one connection to it. Dropped in this order.
pub(crate) struct PrivateDaemon {
    client: Client,
    child: ChildGuard,
    place: PrivateDir,
}

/// The daemon failed; with the end of its log.
#[derive(Debug, thiserror::Error)]
#[error("the daemon {what}; its log:\n{log_end}")]
struct DaemonFailed {
    what: String,
    log_end: String,
}

impl PrivateDaemon {
    /// Starts a daemon for the recording and joins it.
    pub(crate) fn start(
        model: &RobotModel,
        recording: &Recording,
        program: &DaemonCommand<'_>,
        stop: &AtomicBool,
    ) -> Result<Self, Error> {
        let place = PrivateDir::create()?;
        let config = place.write_files(&model.file.to_toml(), recording)?;
        let log = File::create(place.log()).map_err(Error::system)?;
        let mut command = program(&config).map_err(Error::system)?;
        command.env(RUNTIME_DIR_ENV, &place.dir);
        let streams = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(log);
        let mut child = ChildGuard::spawn(streams).map_err(Error::system)?;
        let client = join(&place, &mut child, stop)?;
        Ok(Self { client, child, place })
    }

    /// Sends one row and waits for its answer. A lost row is sent again.
    pub(crate) fn request(
        &mut self,
        row: &TimedSetpoint,
        stop: &AtomicBool,
    ) -> Result<Corrected, Error> {
        let since = Instant::now();
        if row.starts_segment {
            self.client.start_anew();
        }
        let mut sent = self.client.send(&row.setpoint);
        loop {
            match sent {
                Ok(seq) => {
                    if let Some(answer) = self.client.wait_corrected(seq, POLL_EVERY) {
                        return Ok(answer);
                    }
                }
                Err(SendError::Disconnected(_) | SendError::Lost) => {
                    std::thread::sleep(Duration::from_millis(1));
                    sent = self.client.send(&row.setpoint);
                }
                Err(never_sent) => return Err(Error::input(never_sent)),
            }
            check(stop)?;
            if let Some(status) = self.child.try_exit_status() {
                return Err(self.place.failure(format!("ended early ({status})")));
            }
            if since.elapsed() > ANSWER_TIMEOUT {
                return Err(self
                    .place
                    .failure(format!("did not answer within {ANSWER_TIMEOUT:?}")));
            }
        }
    }
}

fn join(place: &PrivateDir, child: &mut ChildGuard, stop: &AtomicBool) -> Result<Client, Error> {
    let since = Instant::now();
    loop {
        match Client::connect_to(&place.cell, POLL_EVERY) {
            Ok(client) => return Ok(client),
            Err(ConnectError::Refused(why)) => return Err(Error::system(why)),
            Err(why) if since.elapsed() > OPEN_TIMEOUT => {
                return Err(place.failure(format!("did not open: {why}")));
            }
            Err(_) => {}
        }
        check(stop)?;
        if let Some(status) = child.try_exit_status() {
            return Err(place.failure(format!("did not start ({status})")));
        }
    }
}

/// A private directory on tmpfs, removed with the value together with whatever the daemon left.
struct PrivateDir {
    dir: PathBuf,
    cell: Cell,
}

impl PrivateDir {
    fn create() -> Result<Self, Error> {
        let root = std::env::var_os(RUNTIME_DIR_ENV).unwrap_or_else(|| "/dev/shm".into());
        for attempt in 0.. {
            let name = format!("replay-{}-{attempt}", std::process::id());
            let dir = Path::new(&root).join(name);
            match DirBuilder::new().mode(0o700).create(&dir) {
                Err(error) if error.kind() == ErrorKind::AlreadyExists && attempt < 1000 => {}
                Err(error) => {
                    let message = format!("{}: cannot create this folder: {error}", dir.display());
                    return Err(Error::system(message));
                }
                Ok(()) => {
                    let cell = Cell::at(&dir, CELL).map_err(Error::system)?;
                    return Ok(Self { dir, cell });
                }
            }
        }
        Err(Error::system("cannot find an unused folder name for the daemon"))
    }

    /// Puts model and configuration there; the model as it was read, so that a file that changes meanwhile plays no part.
    fn write_files(&self, model: &str, recording: &Recording) -> Result<PathBuf, Error> {
        let (config, beside) = (self.dir.join("cell.toml"), self.dir.join("model.toml"));
        fs::write(&beside, model).map_err(Error::system)?;
        fs::write(&config, cell_toml(&beside, recording)).map_err(Error::system)?;
        Ok(config)
    }

    fn log(&self) -> PathBuf {
        self.dir.join("daemon.log")
    }

    fn failure(&self, what: String) -> Error {
        let log = fs::read_to_string(self.log()).unwrap_or_default();
        let lines: Vec<&str> = log.lines().collect();
        let log_end = lines[lines.len().saturating_sub(LOG_LINES_SHOWN)..].join("\n");
        Error::system(DaemonFailed { what, log_end })
    }
}

impl Drop for PrivateDir {
    fn drop(&mut self) {
        // A killed daemon may have left something; otherwise there is nothing to remove.
        let _ = shm_schema::remove_leftovers(&self.cell);
        let _ = fs::remove_dir_all(&self.dir);
    }
}
