//! The help of the program: commands by task, examples, exit codes. Lists only commands that exist.

use clap::{Arg, Command};

use crate::wrap::{columns_of_stdout, wrapped};

/// Every command of the interface, grouped by task.
const TASKS: [(&str, &[&str]); 8] = [
    ("Try trued and test the computer", &["demo", "bench", "doctor"]),
    (
        "Correct a robot",
        &["run", "check", "reload", "correct", "learn", "replay", "bridge", "fleet"],
    ),
    (
        "Operate a running cell",
        &["status", "top", "bypass", "mode", "arm", "mark", "record", "live"],
    ),
    ("Create a model", &["model", "plan", "calibrate", "gears", "simulate"]),
    ("Find model errors", &["diagnose", "trends", "challenge"]),
    ("Analyse vibration and surfaces", &["spectrum", "surface", "tap", "stability"]),
    ("Work with recordings", &["record", "info", "convert"]),
    ("Set up a shell", &["completions"]),
];

/// Examples with the command they show; the first three whose command exists are printed.
const EXAMPLES: [(&str, &str, &str); 5] = [
    (
        "demo",
        "trued demo --quick",
        "simulate a cell: accuracy with and without correction, then a diagnosis",
    ),
    ("run", "trued run --config cell.toml", "run the daemon for one cell"),
    (
        "correct",
        "trued correct --model robot.toml path.csv",
        "correct a path file without a daemon",
    ),
    ("model", "trued model presets", "list the built-in robot models"),
    ("check", "trued check cell.toml", "check a configuration and report every error"),
];

const EXIT_CODES: &str = "  0    success
  1    completed with a negative result (for example a failed check or a rejected request)
  2    invalid input or usage
  3    system error (shared memory, permission, disk)
  130  interrupted";

/// The command with its help laid out.
pub(crate) fn with_help_sections(command: Command) -> Command {
    let commands = fitted(tasks(&command) + &examples(&command), columns_of_stdout());
    let exit_codes = fitted(EXIT_CODES.to_owned(), columns_of_stdout());
    let template = format!(
        "{{about-with-newline}}\nUsage: {{usage}}\n\n{commands}Options:\n{{options}}\n\nExit codes:\n{exit_codes}\n\n\
         Run `trued COMMAND --help` for more about a command.\n"
    );
    with_negative_numbers(command.help_template(template))
}

/// The text with its descriptions wrapped under themselves; unchanged if standard output is no terminal, as for man pages.
fn fitted(text: String, columns: Option<usize>) -> String {
    match columns {
        Some(columns) => wrapped(&text, columns),
        None => text,
    }
}

/// Lets every option take a negative number, so that the option's own check answers it and not the parser, which would take it for an option.
fn with_negative_numbers(command: Command) -> Command {
    let takes_value = |arg: &Arg| !arg.is_positional() && arg.get_action().takes_values();
    command
        .mut_args(|arg| if takes_value(&arg) { arg.allow_negative_numbers(true) } else { arg })
        .mut_subcommands(with_negative_numbers)
}

fn tasks(command: &Command) -> String {
    let mut text = String::new();
    for (task, names) in TASKS {
        let found: Vec<_> = names.iter().filter_map(|name| command.find_subcommand(name)).collect();
        if found.is_empty() {
            continue;
        }
        text += &format!("{task}:\n");
        for command in found {
            let about = command.get_about().map(ToString::to_string).unwrap_or_default();
            text += &format!("  {:<11} {about}\n", command.get_name());
        }
        text.push('\n');
    }
    text
}

fn examples(command: &Command) -> String {
    let known = |example: &&(&str, &str, &str)| command.find_subcommand(example.0).is_some();
    let lines: String = EXAMPLES
        .iter()
        .filter(known)
        .take(3)
        .map(|(_, line, about)| format!("  {line:<44} {about}\n"))
        .collect();
    if lines.is_empty() { lines } else { format!("Examples:\n{lines}\n") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::Cli;
    use clap::CommandFactory;

    #[test]
    fn the_arguments_are_consistent() {
        with_help_sections(Cli::command()).debug_assert();
    }

    #[test]
    fn every_command_has_its_place_in_the_help() {
        let placed = |name: &str| TASKS.iter().any(|(_, names)| names.contains(&name));
        assert!(Cli::command().get_subcommands().all(|command| placed(command.get_name())));
    }

    #[test]
    fn no_word_of_the_help_is_broken_at_80_columns_and_descriptions_hang_under_themselves() {
        let text = fitted(tasks(&Cli::command()), Some(80));
        assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
        let demo = text.split("  demo ").nth(1).and_then(|rest| rest.lines().nth(1));
        assert!(demo.is_some_and(|line| line.starts_with("              ")), "{text}");
        let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(words(&text), words(&tasks(&Cli::command())));
    }

    #[test]
    fn only_what_exists_is_listed_by_task_with_its_examples() {
        let known = ["demo", "model"].map(|name| Command::new(name).about("What it does"));
        let mut command =
            with_help_sections(Command::new("trued").about("About").subcommands(known));
        let help = command.render_help().to_string();
        assert!(
            help.contains(
                "Try trued and test the computer:\n  demo        What it does\n\nCreate a model:\n  model"
            ),
            "{help}"
        );
        assert!(help.contains("trued demo --quick") && help.contains("trued model presets"));
        assert!(!help.contains("diagnose") && !help.contains("trued run"));
    }
}
