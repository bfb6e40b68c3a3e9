//! `trued replay`: runs the daemon on a recording over shared memory, row by row.
//!
//! The crate `correction-report` does the work. A running cell is not affected; nothing is left behind.

use std::path::{Path, PathBuf};

use clap::Args;
use correction_report::replay;

use crate::child::this_program;
use crate::exit::{Answer, Outcome};
use crate::input::{Input, Reading};
use crate::output::Console;
use crate::{interrupt, progress, wrap};

/// Replay a recording through the daemon over shared memory
///
/// Starts a separate daemon and sends it the recording row by row, each row as soon as the previous one
/// was answered. With kind = "poses" in the accompanying TOML, each row gets its steady-state correction.
#[derive(Debug, Args)]
pub(crate) struct Replay {
    #[command(flatten)]
    reading: Reading,
    /// Write the corrections: the columns of the recording, `c1_deg` … (`c1_mm`), `status`
    #[arg(long, value_name = "FILE.csv")]
    corrections: Option<PathBuf>,
    /// Replay in real time; without it, as fast as possible
    #[arg(long)]
    pace: bool,
    /// The recording
    #[arg(value_name = "RECORDING")]
    recording: PathBuf,
}

impl Replay {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let mut outputs = console.outputs();
        if let Some(out) = &self.corrections {
            outputs = outputs.file(out);
        }
        outputs.check([&self.recording].into_iter().chain(self.reading.files()))?;
        let Input { model, recording, .. } = self.reading.read(&self.recording, None)?;
        let stop = interrupt::flag()?;
        let bar = progress::bar(console, recording.len() as u64, "replaying");
        let daemon = |config: &Path| {
            let mut command = this_program()?;
            command.args(["run", "--with-parent", "--lockstep", "--config"]).arg(config);
            Ok(command)
        };
        let replayed =
            replay::Replay::run(&model, recording, self.pace, &daemon, &stop, &mut || {
                bar.inc(1);
            })?;
        drop(bar);
        if let Some(out) = &self.corrections {
            outputs.put(out, replayed.csv.as_slice());
        }
        let report = replayed.report(self.corrections.as_ref());
        console.write(outputs, "trued.replay/1", &report)?;
        for line in replayed.text(wrap::columns_of_stdout()) {
            console.say(line)?;
        }
        if let Some(out) = &self.corrections {
            console.say(format!("corrections         {}", out.display()))?;
        }
        Ok(Answer::Done)
    }
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<replay::Report<'_>>("replay", "trued.replay/1")
}
