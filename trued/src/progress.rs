//! Progress bars on standard error; none without a terminal, or with `-q`.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

use crate::output::Console;

/// A bar with the remaining time, within 80 columns.
const TEMPLATE: &str = "{msg:<26} {bar:20} {percent:>3} %  {elapsed}, {eta} left";
/// A stage with the elapsed time.
const STAGE: &str = "{spinner} {wide_msg} {elapsed:>6} ";
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

/// A spinner for work of unknown duration: the present stage, with the time since the start.
#[must_use]
pub fn stages(console: &Console, first: &'static str) -> ProgressBar {
    let style = ProgressStyle::with_template(STAGE);
    let style = style.unwrap_or_else(|_| ProgressStyle::default_spinner());
    let spinner = ProgressBar::new_spinner()
        .with_style(style)
        .with_message(first)
        .with_finish(indicatif::ProgressFinish::AndClear);
    let spinner = console.progress().add(spinner);
    spinner.enable_steady_tick(TICK);
    spinner
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
