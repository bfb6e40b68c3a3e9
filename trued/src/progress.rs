//! Progress bars on standard error; none without a terminal, or with `-q`.

use std::fmt::Write;
use std::time::Duration;

use correction_report::path;
use diagnosis::progress::{Progress, Stage};
use indicatif::style::TemplateError;
use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};
use report::pluralise;

use crate::output::Console;

/// A bar with the elapsed time and, once a step is done, the remaining time, within 80 columns.
const TEMPLATE: &str = "{msg:<26} {bar:20} {percent:>3} %  {elapsed}{left}";
/// A stage with the steps of its present loop, if their number is known, and the time since the start, within the width of the terminal.
const STAGE: &str = "{spinner} {wide_msg} {steps}{elapsed:>6} ";
/// Refresh interval of a stage's time.
const TICK: Duration = Duration::from_millis(200);
/// Least remaining time of a loop that is shown, as it is shown in whole seconds.
const LEFT_LEAST: Duration = Duration::from_secs(1);

/// A bar with the given number of steps. It disappears when finished or dropped.
#[must_use]
pub fn bar(console: &Console, steps: u64, what: impl Into<String>) -> ProgressBar {
    let style = bar_style().unwrap_or_else(|_| ProgressStyle::default_bar());
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

fn bar_style() -> Result<ProgressStyle, TemplateError> {
    let style = ProgressStyle::with_template(TEMPLATE)?;
    Ok(style.with_key("left", |state: &ProgressState, text: &mut dyn Write| {
        // Without a step nothing is known about the remaining time. Writing into memory cannot fail.
        if state.pos() > 0 {
            write!(text, ", {:#} left", HumanDuration(state.eta())).unwrap_or_default();
        }
    }))
}

fn stage_style() -> Result<ProgressStyle, TemplateError> {
    let style = ProgressStyle::with_template(STAGE)?;
    Ok(style.with_key("steps", |state: &ProgressState, text: &mut dyn Write| {
        // Writing into memory cannot fail.
        text.write_str(&steps(state.pos(), state.len(), state.eta())).unwrap_or_default();
    }))
}

/// Steps of a loop with the remaining time, as `3/12, 20s left `. Empty if their number `of` is unknown, if none is done yet, or if less than
/// [`LEFT_LEAST`] is left: many short loops would flicker.
fn steps(done: u64, of: Option<u64>, left: Duration) -> String {
    match of {
        Some(of) if done > 0 && left >= LEFT_LEAST => {
            format!("{done}/{of}, {:#} left ", HumanDuration(left))
        }
        _ => String::new(),
    }
}

/// Shows the progress of a correction by a spinner of [`stages`].
pub fn show_rows(spinner: &ProgressBar, progress: path::Progress) {
    match progress {
        path::Progress::Stage(stage) => {
            spinner.unset_length();
            spinner.set_message(stage);
        }
        path::Progress::Rows { done, of } => show_steps(spinner, done, of),
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
        Progress::Steps { done, of } => show_steps(spinner, done, of),
    }
}

/// Shows a loop, from `done` = 0 to `of`.
fn show_steps(spinner: &ProgressBar, done: usize, of: usize) {
    if done == of {
        spinner.unset_length();
    } else if done == 0 {
        spinner.set_position(0);
        spinner.set_length(of as u64);
        spinner.reset_eta();
    } else {
        spinner.set_position(done as u64);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::Common;

    #[test]
    fn the_template_is_understood_and_nothing_is_drawn_when_quiet() {
        assert!(bar_style().is_ok());
        assert!(stage_style().is_ok());
        let console = Console::new(Common { quiet: true, ..Common::default() });
        assert!(bar(&console, 10, "demo").is_hidden());
        assert!(stages(&console, "reading").is_hidden());
    }

    #[test]
    fn a_stage_fits_80_columns_with_a_hundred_effects_and_an_hour_left() {
        let steps = steps(100, Some(402), Duration::from_secs(3599));
        assert_eq!(steps, "100/402, 60m left ");
        let stages = Stage::POSITIONS.iter().chain(&Stage::TORQUES).chain(&Stage::CALIBRATION);
        for stage in stages {
            // Spinner, message, steps, time and the spaces of the template.
            let columns = 2 + format!("{stage}, 100 effects").len() + 1 + steps.len() + 6 + 1;
            assert!(columns <= 80, "{stage}: {columns}");
        }
    }

    #[test]
    fn rows_of_a_correction_are_counted_and_a_stage_ends_the_count() {
        let spinner = ProgressBar::hidden();
        let shown = |progress| {
            show_rows(&spinner, progress);
            (spinner.message(), spinner.length(), spinner.position())
        };
        let stage = "static corrections";
        shown(path::Progress::Stage(stage));
        assert_eq!(shown(path::Progress::Rows { done: 0, of: 9 }), (stage.into(), Some(9), 0));
        assert_eq!(shown(path::Progress::Rows { done: 4, of: 9 }), (stage.into(), Some(9), 4));
        assert_eq!(shown(path::Progress::Stage("table")).1, None);
        assert_eq!(shown(path::Progress::Rows { done: 0, of: 0 }).1, None);
    }

    #[test]
    fn a_loop_is_shown_with_its_length_until_it_ends_and_no_time_is_invented() {
        let spinner = ProgressBar::hidden();
        let shown = |progress| {
            show(&spinner, Stage::Validation, progress);
            (spinner.message(), spinner.length(), spinner.position())
        };
        let message = "positions 6/10: validation".to_owned();
        assert_eq!(shown(Progress::Begun), (message.clone(), None, 0));
        assert_eq!(shown(Progress::Steps { done: 0, of: 2 }), (message.clone(), Some(2), 0));
        assert_eq!(shown(Progress::Steps { done: 1, of: 2 }), (message.clone(), Some(2), 1));
        assert_eq!(shown(Progress::Steps { done: 2, of: 2 }).1, None);
        assert_eq!(shown(Progress::Selected(1)).0, message.clone() + ", 1 effect");
        assert_eq!(shown(Progress::Selected(2)).0, message + ", 2 effects");
        let second = Duration::from_secs(1);
        assert_eq!(super::steps(0, Some(2), second), "", "no step is done");
        assert_eq!(super::steps(1, None, second), "", "the length is unknown");
        assert_eq!(super::steps(1, Some(2), second / 2), "", "nearly done");
        assert_eq!(super::steps(1, Some(2), second), "1/2, 1s left ");
    }
}
