//! The command line: common parts, and one file per command under `commands`.
//!
//! The conventions of docs/inputs.md and docs/reference/results.md (streams, `--json`, exit codes,
//! files complete or not at all) are implemented here once for every command. Logic that belongs to
//! a library of this project does not belong here.

mod child;
mod cli;
mod commands;
mod dynamic_options;
pub mod exit;
mod help;
mod input;
pub mod interrupt;
mod logs;
pub mod options;
pub mod output;
pub mod pages;
pub mod progress;
pub mod provenance;
#[cfg(feature = "schema")]
pub mod schemas;
pub mod table;
mod wrap;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{ArgMatches, CommandFactory, FromArgMatches};
use recording::program;

use crate::cli::Cli;
use crate::exit::{Answer, Failure};
use crate::output::Console;
use crate::provenance::Invocation;

/// Runs the program with these arguments, the first of which is its name; never panics on any of them.
///
/// Exit codes: see [`exit`].
pub fn run(args: impl Iterator<Item = OsString>) -> ExitCode {
    let args: Vec<OsString> = args.collect();
    let invocation = Invocation::from_args(&args);
    let cli = match parse(args) {
        Ok(cli) => cli,
        Err(message) => return print_clap_message(&message),
    };
    let mut console = Console::new(cli.common.clone()).with_invocation(invocation);
    logs::start(&console);
    let outcome = interrupt::continue_at_file_size_limit();
    let outcome = outcome.and_then(|()| commands::run(&cli.command, &mut console));
    let outcome = outcome.and_then(|answer| console.close().map(|()| answer));
    if let Err(failure) = &outcome {
        console.print_failure(failure);
    }
    logs::finish();
    exit::code(&outcome)
}

/// The command line, for generating man pages and completions.
#[must_use]
pub fn command() -> clap::Command {
    // Clap puts the program's name before it.
    let version = program::version().trim_start_matches("trued ");
    help::with_help_sections(Cli::command().version(version))
}

fn parse(args: Vec<OsString>) -> Result<Cli, clap::Error> {
    let mut command = command();
    let mut matches = command.try_get_matches_from_mut(args)?;
    if let Some(why) = unknown_json_use(&matches) {
        return Err(command.error(ErrorKind::ValueValidation, why));
    }
    Cli::from_arg_matches_mut(&mut matches)
}

/// Options that name files of results, besides `--json`.
const FILES: [&str; 5] = ["out", "report", "corrections", "textfile", "urdf"];
/// Commands that run until they are ended, or print something else, and have no result as JSON.
const WITHOUT_JSON: [&str; 5] = ["bridge", "completions", "live", "run", "top"];

/// Error: a global option does not apply to this command.
fn unknown_json_use(matches: &ArgMatches) -> Option<String> {
    let (name, mut inner) = matches.subcommand()?;
    if WITHOUT_JSON.contains(&name) && matches!(inner.try_get_raw("json"), Ok(Some(_))) {
        let instead = "the state of a running cell as JSON: `trued status --json -`";
        return Some(format!("`trued {name}` has no result as JSON: leave out --json ({instead})"));
    }
    loop {
        let is_dash = |id: &&&str| {
            let mut values = inner.try_get_raw(id).ok().flatten().into_iter().flatten();
            values.any(|value| value == "-")
        };
        if let Some(option) = FILES.iter().find(is_dash) {
            return Some(format!(
                "--{option} names a file, and `-` is none: only JSON goes to standard output (`--json -`); for a file of that name give `./-`"
            ));
        }
        inner = inner.subcommand()?.1;
    }
}

/// Help and version are results; everything else is a usage error.
fn print_clap_message(message: &clap::Error) -> ExitCode {
    let outcome = match message.print() {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(Failure::system(error)),
        _ if message.use_stderr() => Err(Failure::input("usage")),
        _ => Ok(Answer::Done),
    };
    exit::code(&outcome)
}

#[cfg(test)]
mod tests {
    use super::parse;

    fn refused(line: &str) -> String {
        let args = ["trued"].into_iter().chain(line.split(' ')).map(Into::into).collect();
        parse(args).map(|_| ()).expect_err(line).to_string()
    }

    fn is_accepted(line: &str) {
        let args = ["trued"].into_iter().chain(line.split(' ')).map(Into::into).collect();
        parse(args).unwrap_or_else(|error| panic!("{line}: {error}"));
    }

    #[test]
    fn a_dash_is_no_output_file_of_any_command() {
        for line in [
            "correct --out - a.csv",
            "learn --out - a.csv b.csv",
            "simulate --out - a.csv",
            "convert --out - a.mcap",
            "calibrate --out - a.csv",
            "surface --report - a.csv",
            "replay --corrections - a.mcap",
            "model export a.toml --urdf -",
            "model import a.urdf --out -",
            "plan --model m --out -",
            "live --textfile -",
        ] {
            assert!(refused(line).contains("names a file"), "{line}: {}", refused(line));
        }
        is_accepted("correct --out ./- --json - a.csv");
    }

    #[test]
    fn an_option_that_would_do_nothing_is_refused() {
        for line in [
            "live --json -",
            "top --json a.json",
            "run --config a.toml --json a.json",
            "completions bash --json -",
            "correct --bandwidth-hz 20 a.csv",
            "correct --max-mrad 20 a.csv",
            "surface --teeth 0 --spindle-rpm 1 --feed-mm-s 1 a.csv",
            "surface --teeth 2 a.csv",
            "spectrum --teeth 0 a.csv",
            "gears --spacing-um 1 a.csv",
            "gears --tolerance 1 a.csv",
            "gears --model m --from 1 --cut 1,0,0 --mapping a.toml",
            "tap --frf --response-kind velocity --windows none a.csv",
            "challenge --limit 0",
            "challenge --limit -1",
            "challenge --model a.toml",
            "challenge --inject a.csv --tier null",
            "plan --for d --count 3",
            "plan --for d --instrument 1,2,3",
            "plan --model m --direction 1,0,0",
            "plan --model m --alarm 0.1",
            "plan --model m --among a.csv --candidates 30",
            "plan --model m --pause-s 1",
            "plan --model m --iso9283 --criterion d",
            "plan --model m --accept-deg 20",
            "plan --model m --least-targets 0 --target 1,2,3",
            "plan --model m --targets-known",
            "challenge --cases 3 --model a.toml",
            "challenge --tier null --mapping a.toml",
            "challenge --domain force --model a.toml",
            "plan --model m --count 5 --worth-mm 0.01",
            "plan --model m --check --worth-mm 0.01",
            "plan --model m --worth-mm 0.01",
            "plan --model m --next --worth-mm nan",
            "plan --model m --next --worth-mm -1",
            "plan --model m --next --worth-mm=-1",
            "plan --model m --next --alarm 0.1",
            "plan --model m --sphere 1,2,3,4 --accept-deg 20",
            "plan --model m --sphere 1,2,3,4 --length-mm 1,2",
            "gears --model m --cut 1,0,0 a.csv",
            "diagnose --shard 1/2 --band 30",
            "tap --frf --response-kind velocity --response 2 a.csv",
            "surface --wheel 17:1=3 a.csv",
            "correct --dynamic --max-rate-mrad-s=-1 a.csv",
            "correct --dynamic --max-mrad 0 a.csv",
            "bench --quick --starts 3",
        ] {
            refused(line);
        }
        for line in [
            "correct --dynamic --bandwidth-hz 20 a.csv",
            "surface --teeth 2 --spindle-rpm 1 --feed-mm-s 1 a.csv",
            "gears --spacing-um 1 --profile p.csv a.csv",
            "challenge --limit 0.5",
            "plan --for d --out e --json a.json",
            "plan --model m --iso9283 --direction 1,0,0",
            "plan --model m --out d --pause-s 1",
            "plan --model m --next --worth-mm 0",
            "challenge --inject a.csv --model m",
            "status --json -",
        ] {
            is_accepted(line);
        }
    }
}
