//! `trued bench`: latency of this machine, compared with the limit and with other transports.

mod options;
mod twenty_effects;

use std::path::PathBuf;
use std::process::Command;

use clap::Args;
use harness::findings::Findings;
use harness::plan::{Plan, Programs};
use harness::tables::{self, BenchTable, OMITTED_IF_NARROW, TextLayout};
use harness::{BenchError, page};
use report::TextTable;
use tracing::info;

use crate::child::this_program;
use crate::exit::{Answer, Failure, Outcome};
use crate::interrupt;
use crate::output::{Console, Emphasis};
use crate::pages::Outputs;
use crate::progress;
use crate::table::on_stdout;
use crate::wrap::columns_of_stdout;

use options::BenchOptions;

/// The page's name in the output directory.
const PAGE: &str = "bench.html";

/// Measure the latency of the daemon on this computer, compared with other transports
#[derive(Debug, Args)]
pub(crate) struct Bench {
    #[command(flatten)]
    options: BenchOptions,
    /// Directory for the page (`bench.html`) and the plots; if not given, neither is written
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Exit 1 if a figure misses its acceptance limit
    #[arg(long)]
    judge: bool,
    /// This process is a part of a bench
    #[arg(long, hide = true, value_name = "WORDS")]
    part: Option<String>,
}

impl Bench {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        if let Some(arguments) = &self.part {
            harness::part(arguments).map_err(failure)?;
            return Ok(Answer::Done);
        }
        let stop = interrupt::flag()?;
        let plan = self.options.plan()?;
        let mut outputs = console.outputs();
        if let Some(out) = &self.out {
            outputs = outputs.in_folder(out).page(out.join(PAGE));
        }
        // Hours may pass before there is anything to write.
        outputs.check([])?;
        let bar = progress::stages(console, "starting");
        let findings = harness::run(&plan, &ThisProgram, &stop, &mut |about| {
            bar.set_message(about.to_owned());
            info!("{about}");
        });
        bar.finish_and_clear();
        let findings = findings.map_err(failure)?;
        self.report(console, outputs, &plan, &findings)?;
        let missed = findings.judged.iter().any(|judged| !judged.ok);
        Ok(if self.judge && missed { Answer::No } else { Answer::Done })
    }

    fn report(
        &self,
        console: &mut Console,
        mut outputs: Outputs,
        plan: &Plan,
        findings: &Findings,
    ) -> Result<(), Failure> {
        let machine = &findings.machine;
        console.say(format!(
            "{}, kernel {}{}{}, client on core {}, {}{}, scheduling {}, {} s per part",
            machine.processor,
            machine.kernel,
            if machine.preempt_rt { ", PREEMPT_RT" } else { "" },
            if machine.is_virtual { ", virtual" } else { "" },
            machine.cores[0],
            match &findings.cell {
                None => format!("daemon on core {}", machine.cores[1]),
                Some(cell) => format!("daemon of cell {cell} on its own core"),
            },
            findings.model.map_or_else(String::new, |model| format!(", model {model}")),
            machine.scheduling.name(),
            plan.seconds
        ))?;
        for means in &machine.means {
            console.say(format!("  {means}"))?;
        }
        for table in tables::tables(findings) {
            let title = console.paint(Emphasis::Strong, &table.title);
            console.say(format!("\n{title}\n{}", text(&table).trim_end()))?;
        }
        if let Some(out) = &self.out {
            outputs.put_page(&out.join(PAGE), page::render(findings));
            for (name, _, plot) in page::plots(findings) {
                let path = out.join(format!("{name}.svg"));
                outputs = outputs.result(&path);
                outputs.put(&path, plot.file());
            }
        }
        console.write(outputs, "trued.bench/1", &findings.json())
    }
}

/// The rows of a table for standard output.
fn text(table: &BenchTable) -> String {
    let aligned = |table: &BenchTable| {
        let rows = table.rows.iter().cloned();
        rows.fold(TextTable::new(table.heads.iter().cloned()), TextTable::row)
    };
    match table.layout {
        TextLayout::TitleOnly if columns_of_stdout().is_some() => String::new(),
        TextLayout::Sentences => aligned(table).render(None),
        TextLayout::Columns if is_too_wide(&aligned(table)) => {
            on_stdout(&aligned(&table.without(&OMITTED_IF_NARROW)))
        }
        TextLayout::Columns | TextLayout::TitleOnly => on_stdout(&aligned(table)),
    }
}

/// Whether a table does not fit into the terminal.
fn is_too_wide(table: &TextTable) -> bool {
    let widest = table.render(None).lines().map(|line| line.chars().count()).max();
    columns_of_stdout().is_some_and(|columns| widest.unwrap_or(0) > columns)
}

/// This program as further processes of a bench.
struct ThisProgram;

impl Programs for ThisProgram {
    fn daemon(&self, configs: &[PathBuf]) -> std::io::Result<Command> {
        let mut command = this_program()?;
        command.args(["run", "--with-parent=kill", "--quiet"]);
        for config in configs {
            command.arg("--config").arg(config);
        }
        Ok(command)
    }

    fn part(&self, arguments: &str) -> std::io::Result<Command> {
        let mut command = this_program()?;
        command.args(["bench", "--part", arguments]);
        Ok(command)
    }
}

fn failure(error: BenchError) -> Failure {
    match error {
        BenchError::Interrupted => Failure::Interrupted,
        BenchError::Cores { .. } | BenchError::OfCell { .. } => Failure::input(error),
        _ => Failure::system(error),
    }
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<harness::findings::BenchReport<'_>>("bench", "trued.bench/1")
}
