//! The command-line arguments as types, without their execution.

use clap::Parser;

use crate::commands::Command;
use crate::options::Common;

/// Corrects a robot's joint targets so that the tool reaches the commanded pose.
///
/// trued corrects commanded joint targets over shared memory with a model of the individual robot, and finds the errors
/// that the model does not cover.
#[derive(Debug, Parser)]
#[command(name = "trued", version, max_term_width = 100, subcommand_required = true)]
#[command(arg_required_else_help = true, disable_help_subcommand = true)]
pub(crate) struct Cli {
    #[command(flatten)]
    pub(crate) common: Common,
    #[command(subcommand)]
    pub(crate) command: Command,
}
