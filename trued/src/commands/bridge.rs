//! `trued bridge`: connects a controller's protocol to the daemon.
//!
//! A thread of its own reports to the service manager that the bridge is ready, and that its loop
//! is running.

use std::path::PathBuf;
use std::sync::atomic::Ordering::Relaxed;
use std::thread::JoinHandle;

use bridge::{BridgeError, Count, Options};
use clap::{Args, Subcommand};
use daemon::notify::ServiceManager;
use daemon::supervisor::PERIOD;
use recording::bridge::{EgmConfig, RsiConfig};

use crate::exit::{Answer, Failure, Outcome};
use crate::input::unusable;
use crate::interrupt;
use crate::output::Console;

/// Correct a robot through its controller's protocol: ABB EGM, KUKA RSI
///
/// Runs beside `trued run` until interrupted or terminated, then prints counters of the datagrams. Without a daemon, targets pass unchanged.
/// docs/bridge.md describes the setup of the controller.
#[derive(Debug, Args)]
pub(crate) struct Bridge {
    #[command(subcommand)]
    protocol: Protocol,
}

#[derive(Debug, Subcommand)]
enum Protocol {
    /// Relay between an ABB controller and the application that guides it (EGM)
    Egm(BridgeOptions),
    /// Act as the sensor of a KUKA controller (RSI); the robot program stays unchanged
    Rsi(BridgeOptions),
}

#[derive(Debug, Args)]
struct BridgeOptions {
    /// The bridge's configuration
    #[arg(long, value_name = "BRIDGE.toml")]
    config: PathBuf,
}

impl Bridge {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let options = Options { stop: interrupt::flag_of_service()?, ..Options::default() };
        let mut printed = Ok(None);
        let mut ready = |address| {
            printed = console
                .say(format!("ready: listening on {address}"))
                .and_then(|()| start_watchdog(&options));
        };
        match &self.protocol {
            Protocol::Egm(with) => {
                let config = EgmConfig::read(&with.config).map_err(unusable)?;
                bridge::egm::run(&config, &options, &mut ready)
            }
            Protocol::Rsi(with) => {
                let config = RsiConfig::read(&with.config).map_err(unusable)?;
                bridge::rsi::run(config, &options, &mut ready)
            }
        }
        .map_err(failure)?;
        if let Some(attendant) = printed? {
            // The loop has ended, and the service manager has been informed.
            let _ = attendant.join();
        }
        console.say(options.counts.summary().trim_end())?;
        Ok(Answer::Done)
    }
}

/// Tells the service manager that the bridge is ready, and from then on that it lives.
fn start_watchdog(options: &Options) -> Result<Option<JoinHandle<()>>, Failure> {
    let mut manager = ServiceManager::from_environment(1);
    manager.report_alive(0, 0, "listening");
    manager.ready();
    let options = options.clone();
    let attend = move || {
        while !options.stop.load(Relaxed) {
            let [received, sent] = [Count::Robot, Count::Sent].map(|what| options.counts.get(what));
            let summary =
                format!("{received} datagrams received from the robot, {sent} replies sent");
            manager.report_alive(0, options.iterations.load(Relaxed), &summary);
            std::thread::sleep(PERIOD);
        }
        manager.stopping();
    };
    let thread = std::thread::Builder::new().name("trued-alive".to_owned()).spawn(attend);
    thread.map(Some).map_err(Failure::system)
}

fn failure(error: BridgeError) -> Failure {
    match error {
        BridgeError::File(fault) => unusable(fault),
        BridgeError::Misfit { .. } => Failure::input(error),
        BridgeError::Listen { .. } | BridgeError::System(_) => Failure::system(error),
    }
}
