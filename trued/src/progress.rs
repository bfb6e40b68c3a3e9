//! Progress bars on standard error; nothing where it is no terminal, or with `-q`.

use indicatif::{ProgressBar, ProgressStyle};

use crate::output::Console;

const TEMPLATE: &str = "{msg:<28} {bar:36} {percent:>3} %  {elapsed} of about {duration}";

/// A bar over so many steps. It vanishes when finished or dropped: the result speaks.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::Common;

    #[test]
    fn the_template_is_understood_and_nothing_is_drawn_when_quiet() {
        assert!(ProgressStyle::with_template(TEMPLATE).is_ok());
        let console = Console::new(Common { quiet: true, ..Common::default() });
        assert!(bar(&console, 10, "demo").is_hidden());
    }
}
