//! Progress bars on standard error; none without a terminal, or with `-q`.

use std::fmt::Write;
use std::time::Duration;

use diagnosis::progress::{Progress, Stage};
use indicatif::style::TemplateError;
use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};

use report::pluralise;

use crate::output::Console;

/// A bar with the remaining time, within 80 columns.
const TEMPLATE: &str = "{msg:<26} {bar:20} {percent:>3} %  {elapsed}, {eta} left";
/// A stage with the steps of its present loop, if their number is known, and the time since the start, within the width of the terminal.
const STAGE: &str = "{spinner} {wide_msg} {steps}{elapsed:>6} ";
/// Refresh interval of a stage's time.
const TICK: Duration = Duration::from_millis(200);

/// A bar with the given number of steps. It disappears when finished or dropped.
#[must_use]
pub fn bar(console: &Console, steps: u64, what: impl Into<String>) -> ProgressBar {
    let style =
        ProgressStyle::with_template(TEMPLATE).unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(steps)
        .with_style(style.progress_chars("━╸ "))
        .with_message(what.into())
        .with_finish(indicatif::ProgressFinish::AndClear);
    console.progress().add(bar)
}

/// A spinner for work in stages: the present one, with the time since the start. [`show`] adds steps and remaining time where they are known.
#[must_use]
pub fn stages(console: &Console, first: &'static str) -> ProgressBar {
    let style = stage_style().unwrap_or_else(|_| ProgressStyle::default_spinner());
    let spinner = ProgressBar::new_spinner()
        .with_style(style)
        .with_message(first)
        .with_finish(indicatif::ProgressFinish::AndClear);
    let spinner = console.progress().add(spinner);
    spinner.enable_steady_tick(TICK);
    spinner
}

fn stage_style() -> Result<ProgressStyle, TemplateError> {
    let style = ProgressStyle::with_template(STAGE)?;
    Ok(style.with_key("steps", |state: &ProgressState, text: &mut dyn Write| {
        let steps = steps(state.pos(), state.len(), state.eta());
        // Writing into memory cannot fail.
        drop(text.write_str(&steps));
    }))
}

/// Steps of a loop with the remaining time, as `3/12, 20s left `: empty if their number `of` is unknown, without a time before the first is done.
fn steps(done: u64, of: Option<u64>, left: Duration) -> String {
    match of {
        None => String::new(),
        Some(of) if done == 0 => format!("0/{of} "),
        Some(of) => format!("{done}/{of}, {:#} left ", HumanDuration(left)),
    }
}

/// Shows the progress of a diagnosis or calibration by a spinner of [`stages`].
pub fn show(spinner: &ProgressBar, stage: Stage, progress: Progress) {
    match progress {
        Progress::Begun => {
            spinner.unset_length();
            spinner.set_message(stage.to_string());
        }
        Progress::Selected(count) => {
            spinner.set_message(format!("{stage}, {}", pluralise(count, "effect")));
        }
        Progress::Steps { done: 0, of } => {
            spinner.set_position(0);
            spinner.set_length(of as u64);
            spinner.reset_eta();
        }
        Progress::Steps { done, of } if done == of => spinner.unset_length(),
        Progress::Steps { done, .. } => spinner.set_position(done as u64),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::Common;

    #[test]
    fn the_template_is_understood_and_nothing_is_drawn_when_quiet() {
        assert!(ProgressStyle::with_template(TEMPLATE).is_ok());
        assert!(ProgressStyle::with_template(STAGE).is_ok());
        let console = Console::new(Common { quiet: true, ..Common::default() });
        assert!(bar(&console, 10, "demo").is_hidden());
    }
}
