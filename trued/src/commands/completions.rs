//! `trued completions`: shell completions of this command line.

use clap::Args;
use clap_complete::Shell;

use crate::exit::{Answer, Failure, Outcome};
use crate::output::Console;

/// Print the completion script for a shell
///
/// For the current shell only: `source <(trued completions bash)`. The Debian package installs the scripts for bash, zsh and fish.
#[derive(Debug, Args)]
pub(crate) struct Completions {
    /// The shell
    #[arg(value_name = "SHELL", value_enum)]
    shell: Shell,
}

impl Completions {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut crate::command(), "trued", &mut script);
        console.verbatim(&String::from_utf8(script).map_err(Failure::system)?)?;
        Ok(Answer::Done)
    }
}
