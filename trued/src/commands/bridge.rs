//! `trued bridge`: a controller's own protocol, as a client of the daemon like any other.

use std::path::PathBuf;
use std::sync::Arc;

use bridge::{BridgeError, Counts, Options};
use clap::{Args, Subcommand};
use recording::bridge::{EgmConfig, RsiConfig};

use crate::exit::{Answer, Failure, Outcome};
use crate::input::unusable;
use crate::interrupt;
use crate::output::Console;

/// Correct a robot by its controller's own protocol: ABB EGM, KUKA RSI
///
/// Runs beside `trued run` until it is told to end, and says then what it has seen. Without a daemon it passes on what it is given.
/// docs/bridge.md says what to change on the controller.
#[derive(Debug, Args)]
pub(crate) struct Bridge {
    #[command(subcommand)]
    protocol: Protocol,
}

#[derive(Debug, Subcommand)]
enum Protocol {
    /// Stand between an ABB controller and the application that guides it (EGM)
    Egm(With),
    /// Be the sensor of a KUKA controller (RSI); its program stays as it is
    Rsi(With),
}

#[derive(Debug, Args)]
struct With {
    /// The bridge's configuration
    #[arg(long, value_name = "BRIDGE.toml")]
    config: PathBuf,
}

impl Bridge {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let options = Options { stop: interrupt::flag()?, counts: Arc::new(Counts::default()) };
        let mut told = Ok(());
        let mut ready = |at| told = console.say(format!("ready: listens at {at}"));
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
        told?;
        console.say(options.counts.told().trim_end())?;
        Ok(Answer::Done)
    }
}

fn failure(error: BridgeError) -> Failure {
    match error {
        BridgeError::File(fault) => unusable(fault),
        BridgeError::Misfit { .. } => Failure::input(error),
        BridgeError::Listen { .. } | BridgeError::System(_) => Failure::system(error),
    }
}
