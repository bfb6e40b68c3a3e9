//! `trued-plant`: the command line. All logic is in the library.

use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use bus::acceptance::AcceptanceError;
use bus::fleet::{Question, query_fleet};
use bus::offer::{OfferError, Statement};
use bus::offering::{self, OfferingError};
use bus::sparkplug::session::{Credentials, NoBroker};
use bus::zenoh_bus::BusError;
use bus::{
    Acceptance, Bridge, BridgeError, Endpoints, FleetError, Keys, Settings, Sparkplug, text,
};
use clap::{Args, Parser, Subcommand};

/// The environment variable of the password at the broker.
const MQTT_PASSWORD: &str = "TRUED_MQTT_PASSWORD";

/// Connect cells to the plant's message bus (Zenoh)
///
/// Exit codes: 0 success; 1 a cell is missing or has an alarm (fleet), or rejects the model (offer); 2 invalid input; 3 system error, or no cell answers.
#[derive(Debug, Parser)]
#[command(name = "trued-plant", version)]
struct Options {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Bridge(BridgeOf),
    Fleet(FleetOf),
    Statement(StatementOf),
    Offer(OfferOf),
}

/// Where the bus is.
#[derive(Debug, Args)]
struct Where {
    /// Zenoh router or peer to connect to; repeat for several
    #[arg(long, value_name = "tcp/HOST:PORT")]
    connect: Vec<String>,
}

/// Publish a cell on the bus: summaries, events and health, and store them for subscribers that were offline
///
/// A separate process that reads the daemon's status; the daemon does not wait for it. Without `--models`, nothing from the network reaches the daemon. Runs until interrupted and
/// continues after a restart of the daemon or the router.
#[derive(Debug, Args)]
struct BridgeOf {
    /// Name of the cell
    #[arg(value_name = "CELL")]
    cell: String,
    /// Group of cells, for example the line
    #[arg(long, value_name = "NAME", default_value = "plant")]
    group: String,
    /// Folder of the stored messages; use a separate one for each cell
    #[arg(long, value_name = "DIR")]
    spool: PathBuf,
    /// Maximum size of the stored messages, MiB, 1 to 1048576; the oldest are removed
    #[arg(long, value_name = "MIB", default_value_t = Settings::default().spool_bytes >> 20, value_parser = clap::value_parser!(u64).range(1..=1 << 20))]
    spool_mib: u64,
    /// Summaries per second, 0.1 to 10
    #[arg(long, value_name = "HZ", default_value_t = Settings::default().summaries_hz)]
    rate_hz: f64,
    #[command(flatten)]
    bus: Where,
    /// Address to listen on, for a plant without a router; repeat for several
    #[arg(long, value_name = "tcp/HOST:PORT")]
    listen: Vec<String>,
    /// File of the cell's owner with the rules for accepting offered models; if not given, none are accepted
    #[arg(long, value_name = "MODELS.toml")]
    models: Option<PathBuf>,
    /// MQTT broker to which the messages are also sent as Sparkplug B
    #[arg(long, value_name = "HOST:PORT")]
    mqtt: Option<String>,
    /// User name at the broker; the password is read from the environment variable `TRUED_MQTT_PASSWORD`
    #[arg(long, value_name = "NAME", requires = "mqtt")]
    mqtt_user: Option<String>,
}

/// Print the statement to sign with an offered model: hash, robot, counter and expiry
///
/// The output is one line for the trusted comment of minisign: minisign -S -s SECRET.key -m MODEL -t "$(trued-plant statement MODEL --valid-days 7)"
#[derive(Debug, Args)]
struct StatementOf {
    /// The model file; its table [robot] states the serial number
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Counter, greater than that of the last model that the cell accepted; if not given, the current time in s since 1970
    #[arg(long, value_name = "N")]
    counter: Option<u64>,
    /// Days until the offer expires, 1 to 3650
    #[arg(long, value_name = "DAYS", value_parser = clap::value_parser!(u64).range(1..=3650))]
    valid_days: u64,
}

/// Offer a signed model to a cell, and print the outcome
///
/// The cell accepts it only if the file of its owner permits it (`trued-plant bridge --models`).
#[derive(Debug, Args)]
struct OfferOf {
    /// The cell
    #[arg(value_name = "GROUP/CELL")]
    cell: String,
    /// The model file; its signature MODEL.minisig must be in the same folder
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Timeout for the answer, s, 1 to 60
    #[arg(long, value_name = "S", default_value_t = 15, value_parser = clap::value_parser!(u64).range(1..=60))]
    within_s: u64,
    /// Print the answer as JSON, the message of the event (`trued.plant/1`)
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    bus: Where,
}

/// Show all cells: state, versions, models, corrections, alarms
///
/// Only queries the bus. LARGEST: largest joint correction of the last period as a fraction of its limit. AGE: time since the cell loaded its model. HEARD: age of the daemon's last status.
#[derive(Debug, Args)]
struct FleetOf {
    /// Show only this group
    #[arg(long, value_name = "NAME")]
    group: Option<String>,
    /// A cell that must be present; repeat for several
    #[arg(long, value_name = "GROUP/CELL")]
    expect: Vec<String>,
    /// Timeout for answers, s, 1 to 60
    #[arg(long, value_name = "S", default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..=60))]
    within_s: u64,
    /// Print JSON (`trued.plant-fleet/1`)
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    bus: Where,
}

/// Why the program ends without an answer.
#[derive(Debug, thiserror::Error)]
enum Failure {
    #[error(transparent)]
    Bridge(#[from] BridgeError),
    #[error(transparent)]
    Fleet(#[from] FleetError),
    #[error(transparent)]
    Acceptance(#[from] AcceptanceError),
    #[error(transparent)]
    Broker(#[from] NoBroker),
    #[error(
        "--mqtt-user needs the password in the environment variable `{MQTT_PASSWORD}`, which is not set"
    )]
    NoPassword,
    #[error("{path}: {why}")]
    Model { path: String, why: OfferError },
    #[error("cannot read {path}: {why}")]
    Read { path: String, why: std::io::Error },
    #[error(transparent)]
    Offering(#[from] OfferingError),
    #[error("cannot write to standard output: {0}")]
    Print(#[from] std::io::Error),
    #[error("cannot install a signal handler: {0}")]
    Signal(std::io::Error),
}

impl Failure {
    fn is_input(&self) -> bool {
        match self {
            Self::Bridge(why) => why.is_input(),
            Self::Fleet(FleetError::Name(_) | FleetError::Expected(_)) => true,
            Self::Acceptance(_)
            | Self::Broker(_)
            | Self::NoPassword
            | Self::Model { .. }
            | Self::Read { .. } => true,
            Self::Offering(
                OfferingError::Name(_) | OfferingError::Cell(_) | OfferingError::Read { .. },
            ) => true,
            Self::Fleet(FleetError::Bus(why)) | Self::Offering(OfferingError::Bus(why)) => {
                matches!(why, BusError::Endpoint(_) | BusError::NoEndpoint)
            }
            _ => false,
        }
    }
}

fn main() -> ExitCode {
    let done = match Options::parse().command {
        Command::Bridge(options) => bridge(options),
        Command::Fleet(options) => fleet(options),
        Command::Statement(options) => statement(&options),
        Command::Offer(options) => offer(options),
    };
    match done {
        Ok(code) => ExitCode::from(code),
        Err(failure) => {
            let _ = writeln!(std::io::stderr(), "error: {failure}");
            ExitCode::from(if failure.is_input() { 2 } else { 3 })
        }
    }
}

fn bridge(options: BridgeOf) -> Result<u8, Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stop)).map_err(Failure::Signal)?;
    }
    let settings = Settings {
        summaries_hz: options.rate_hz,
        spool_bytes: options.spool_mib << 20,
        ..Settings::default()
    };
    let keys = Keys::new(&options.group, &options.cell).map_err(BridgeError::Name)?;
    let endpoints = Endpoints { connect: options.bus.connect, listen: options.listen };
    let acceptance = options.models.as_deref().map(Acceptance::read).transpose()?;
    let credentials = options.mqtt_user.map(credentials).transpose()?;
    let mut bridge = Bridge::open(keys.clone(), &endpoints, &options.spool, settings)?;
    if let Some(acceptance) = acceptance {
        bridge = bridge.accepting(acceptance);
    }
    let found = bridge.found();
    let mut out = std::io::stdout();
    writeln!(
        out,
        "cell `{}`: ready as trued/{}/{}, {} stored messages from earlier",
        options.cell, options.group, options.cell, found.records
    )?;
    if found.torn_bytes > 0 {
        writeln!(
            out,
            "spool: {} bytes were incomplete or damaged and cannot be read{}",
            found.torn_bytes,
            if found.is_new_stream { "; another stream of numbers begins" } else { "" }
        )?;
    }
    let node = options
        .mqtt
        .map(|broker| Sparkplug::new(&broker, keys, bridge.kept(), &options.spool, settings));
    let node = node.transpose()?.map(|node| match credentials {
        Some(credentials) => node.signed_in(credentials),
        None => node,
    });
    let delivery = node.map(|node| deliver(node, Arc::clone(&stop)));
    let ended = bridge.run(&stop, &mut out);
    stop.store(true, Ordering::Relaxed);
    if let Some(delivery) = delivery {
        // It panicked: what it had to say is on standard error already.
        let _ = delivery.join();
    }
    ended?;
    Ok(0)
}

/// The user's password is in the environment: a command line can be read by everybody on the machine.
fn credentials(user: String) -> Result<Credentials, Failure> {
    let password = std::env::var(MQTT_PASSWORD).map_err(|_| Failure::NoPassword)?;
    Ok(Credentials { user, password })
}

/// Delivers to the broker in a thread of its own, so that the bridge does not wait for it.
fn deliver(mut node: Sparkplug, stop: Arc<AtomicBool>) -> JoinHandle<()> {
    std::thread::spawn(move || {
        node.run(&stop, &mut |text| {
            // A log that nobody reads any more must not end the delivery.
            let _ = writeln!(std::io::stdout(), "{text}");
        });
    })
}

fn statement(options: &StatementOf) -> Result<u8, Failure> {
    let path = || options.model.display().to_string();
    let bytes = std::fs::read(&options.model).map_err(|why| Failure::Read { path: path(), why })?;
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let counter = options.counter.unwrap_or(now.as_secs());
    let expires = now + Duration::from_secs(86_400 * options.valid_days);
    let statement = Statement::of(&bytes, counter, expires.as_millis() as u64)
        .map_err(|why| Failure::Model { path: path(), why })?;
    let line = serde_json::to_string(&statement).map_err(std::io::Error::from)?;
    writeln!(std::io::stdout(), "{line}")?;
    Ok(0)
}

fn offer(options: OfferOf) -> Result<u8, Failure> {
    let endpoints = Endpoints { connect: options.bus.connect, listen: Vec::new() };
    let within = Duration::from_secs(options.within_s);
    let result = offering::offer(&endpoints, &options.cell, &options.model, within)?;
    let mut out = std::io::stdout();
    if options.json {
        writeln!(out, "{}", result.message)?;
    } else {
        writeln!(out, "{}: {}", options.cell, result.words)?;
    }
    Ok(u8::from(!result.is_taken))
}

fn fleet(options: FleetOf) -> Result<u8, Failure> {
    let endpoints = Endpoints { connect: options.bus.connect, listen: Vec::new() };
    let within = Duration::from_secs(options.within_s);
    let question = Question { group: options.group, expected: options.expect, within };
    let fleet = query_fleet(&endpoints, &question)?;
    let mut out = std::io::stdout().lock();
    if options.json {
        serde_json::to_writer_pretty(&mut out, &fleet).map_err(std::io::Error::from)?;
        writeln!(out)?;
    } else {
        write!(out, "{}", text::text(&fleet))?;
    }
    Ok(u8::from(fleet.needs_attention()))
}
