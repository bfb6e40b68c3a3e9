//! `trued live`: a running cell in a browser, in Foxglove or PlotJuggler, and for Prometheus.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use live::report::Report;
use live::{Access, Live, Settings};
use trued_client::Monitor;

use super::control::CellSelection;
use crate::exit::{Answer, Failure, Outcome};
use crate::interrupt;
use crate::output::Console;

/// How the file for node_exporter begins.
const METRICS_HEAD: &[u8] = b"# HELP trued_";
/// How long the first status may take.
const FIRST_STATUS_TIMEOUT: Duration = Duration::from_secs(2);
/// How often the file for node_exporter is written: its usual scrape interval is 15 s.
const TEXT_EVERY: Duration = Duration::from_secs(5);
/// Maximum sleep between checks for an interruption.
const SLEEP: Duration = Duration::from_millis(50);
/// The environment variable of the view's access token: a command line can be read by everybody on
/// the machine.
const TOKEN: &str = "TRUED_LIVE_TOKEN";

/// Monitor a running cell in a browser, in Foxglove or PlotJuggler, and with Prometheus
///
/// A separate, read-only process: the daemon opens no socket, and no request from the network reaches it. Serves a page (/),
/// this moment as a page to keep (/report), the status as JSON (/status) and as server-sent events (/events), metrics (/metrics), and on a second port a WebSocket stream of the
/// topics of the recordings (protocol foxglove.sdk.v1). Listens on this computer only; to listen on another address, set `TRUED_LIVE_TOKEN` and open
/// http://HOST:PORT/?token=TOKEN. Runs until interrupted, and reconnects after a restart of the daemon.
#[derive(Debug, Args)]
pub(crate) struct LiveCommand {
    /// Address for page, status and metrics
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:9177")]
    listen: SocketAddr,
    /// Address for the Foxglove stream
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8765")]
    foxglove: SocketAddr,
    /// Do not serve; write the metrics to this file every 5 s, for the textfile collector of node_exporter
    #[arg(long, value_name = "FILE", conflicts_with_all = ["listen", "foxglove"])]
    textfile: Option<PathBuf>,
    #[command(flatten)]
    which: CellSelection,
}

impl LiveCommand {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let (cell, monitor) = self.which.join()?;
        match &self.textfile {
            Some(file) => write_metrics(console, &cell, monitor, file),
            None => self.serve(console, &cell, monitor),
        }
    }

    fn serve(&self, console: &mut Console, cell: &str, monitor: Monitor) -> Outcome {
        let stop = interrupt::flag()?;
        let token = std::env::var(TOKEN).ok().filter(|token| !token.is_empty());
        let access = token.map_or(Access::ThisMachine, Access::Token);
        let settings = Settings {
            http: self.listen,
            foxglove: Some(self.foxglove),
            access,
            model: self.which.model(),
        };
        let live = Live::start(cell, monitor, &settings).map_err(Failure::system)?;
        console.say(format!(
            "cell `{cell}`: page http://{0}/, metrics http://{0}/metrics",
            live.http
        ))?;
        if let Some(address) = live.foxglove {
            console.say(format!("Foxglove and PlotJuggler: ws://{address}"))?;
        }
        while interrupt::check(&stop).is_ok() {
            std::thread::sleep(SLEEP);
        }
        drop(live);
        Ok(Answer::Done)
    }
}

fn write_metrics(console: &mut Console, cell: &str, mut monitor: Monitor, file: &Path) -> Outcome {
    let stop = interrupt::flag()?;
    if !may_be_replaced(file) {
        return Err(Failure::input(format!(
            "{} exists and is not a metrics file of trued; choose another name",
            file.display()
        )));
    }
    let begun = Instant::now();
    while monitor.status().is_none() && begun.elapsed() < FIRST_STATUS_TIMEOUT {
        std::thread::sleep(SLEEP);
    }
    console.say(format!("cell `{cell}`: metrics in {} every 5 s", file.display()))?;
    while interrupt::check(&stop).is_ok() {
        let begun = Instant::now();
        let away = monitor.disconnect_reason().map(|away| away.to_string());
        let report = monitor.status().map(|status| Report::new(cell, &status, away));
        let text = live::metrics_text(cell, report.as_ref()).map_err(Failure::system)?;
        replace(file, &text).map_err(|why| {
            Failure::system(format!(
                "cannot write {}: {why}; check that its folder exists and is writable",
                file.display()
            ))
        })?;
        while begun.elapsed() < TEXT_EVERY && interrupt::check(&stop).is_ok() {
            std::thread::sleep(SLEEP);
        }
    }
    // Stale metrics would look like current ones.
    let _ = std::fs::remove_file(file);
    Ok(Answer::Done)
}

/// Whether there is no such file, or one that this command wrote.
fn may_be_replaced(file: &Path) -> bool {
    match std::fs::symlink_metadata(file) {
        Ok(found) if found.is_file() => {
            std::fs::read(file).is_ok_and(|text| text.starts_with(METRICS_HEAD))
        }
        Ok(_) => false,
        Err(_) => true,
    }
}

/// A reader sees the old text or the new one, never half of one.
fn replace(file: &Path, text: &str) -> std::io::Result<()> {
    let mut beside = file.as_os_str().to_owned();
    beside.push(format!(".{}.part", std::process::id()));
    let beside = PathBuf::from(beside);
    std::fs::write(&beside, text)?;
    std::fs::rename(&beside, file)
}
