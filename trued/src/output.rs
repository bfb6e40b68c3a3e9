//! Output of a command: text to standard output, errors to standard error, JSON and pages to files.
//!
//! A closed pipe (`trued info … | head`) is no error: the command continues and ends with its own
//! exit code; colour is used only where requested; with `--json -` standard output contains the
//! JSON object alone.

use std::borrow::Cow;
use std::error::Error;
use std::io::{self, ErrorKind, IsTerminal, Write};
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};

use indicatif::{MultiProgress, ProgressDrawTarget};
use recording::program;
use report::{TextLine, Tone, printable};
use serde::Serialize;
use terminal_size::{Width, terminal_size_of};

use crate::exit::Failure;
use crate::logs;
use crate::options::{Color, Common};
use crate::pages::Outputs;
use crate::provenance::Invocation;
use crate::wrap::wrapped;

/// The meaning of a word, shown by colour if enabled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Emphasis {
    /// A heading, a key figure.
    Strong,
    /// Beside the point.
    Faint,
    /// As it should be.
    Good,
    /// Needs attention.
    Caution,
    /// A fault.
    Bad,
}

/// The two streams of a command, and its output options.
#[derive(Debug)]
pub struct Console {
    common: Common,
    progress: MultiProgress,
    invocation: Invocation,
    /// Pages that were written.
    pages: Vec<PathBuf>,
    reader_left: bool,
}

impl Console {
    /// A console by the options of every command.
    #[must_use]
    pub fn new(common: Common) -> Self {
        let shown = !common.quiet && io::stderr().is_terminal();
        let target =
            if shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let progress = MultiProgress::with_draw_target(target);
        let invocation = Invocation::default();
        Self { common, progress, invocation, pages: Vec::new(), reader_left: false }
    }

    /// The same for the given program run, which its pages state.
    #[must_use]
    pub fn with_invocation(self, invocation: Invocation) -> Self {
        Self { invocation, ..self }
    }

    /// The run of the program.
    #[must_use]
    pub fn invocation(&self) -> &Invocation {
        &self.invocation
    }

    /// The options of every command.
    #[must_use]
    pub fn common(&self) -> &Common {
        &self.common
    }

    /// Where progress bars draw; hidden unless standard error is a terminal.
    #[must_use]
    pub fn progress(&self) -> &MultiProgress {
        &self.progress
    }

    /// Says a line (or several) of the result.
    ///
    /// # Errors
    ///
    /// [`Failure::System`] where the stream cannot be written, e.g. a full disk behind it.
    pub fn say(&mut self, text: impl AsRef<str>) -> Result<(), Failure> {
        let text = &printable(text.as_ref(), &PAINTS);
        if self.text_to_stderr() {
            return self.write_line(io::stderr(), &for_stream(&io::stderr(), text));
        }
        self.write_line(io::stdout(), &for_stream(&io::stdout(), text))
    }

    /// Says the lines of a result, their heads painted by tone.
    ///
    /// # Errors
    ///
    /// As [`Console::say`].
    pub fn say_lines(&mut self, lines: &[TextLine]) -> Result<(), Failure> {
        lines.iter().try_for_each(|line| {
            if line.head.is_empty() {
                return self.say(&line.rest);
            }
            let paint = match line.tone {
                Tone::Plain => Emphasis::Strong,
                Tone::Good => Emphasis::Good,
                Tone::Caution => Emphasis::Caution,
                Tone::Bad => Emphasis::Bad,
            };
            self.say(self.paint(paint, &line.head) + &line.rest)
        })
    }

    /// Writes machine-readable text, never wrapped.
    ///
    /// # Errors
    ///
    /// As [`Console::say`].
    pub fn verbatim(&mut self, text: &str) -> Result<(), Failure> {
        self.write_line(io::stdout(), text)
    }

    /// The files of this command besides the JSON; none so far.
    #[must_use]
    pub fn files(&self) -> Outputs {
        Outputs::new(self.common.overwrite).with_invocation(self.invocation.clone())
    }

    /// Lists the pages that this command wrote: the last line of its text.
    ///
    /// # Errors
    ///
    /// As [`Console::say`].
    pub fn close(&mut self) -> Result<(), Failure> {
        let pages = std::mem::take(&mut self.pages);
        pages.iter().try_for_each(|page| self.say(format!("page: {}", page.display())))
    }

    /// The files of this command: so far the one that `--json` names.
    #[must_use]
    pub fn outputs(&self) -> Outputs {
        let outputs = self.files();
        match &self.common.json {
            Some(path) if path != Path::new("-") => outputs.result(path),
            _ => outputs,
        }
    }

    /// Writes the files of a command, all or none, including the JSON result if `--json` is given,
    /// with `schema` first. `body` is a struct or a map; non-finite numbers become `null`.
    ///
    /// # Errors
    ///
    /// [`Failure`] if a file or the stream cannot be written, or if `body` is not an object.
    pub fn write(
        &mut self,
        mut outputs: Outputs,
        schema: &str,
        body: &impl Serialize,
    ) -> Result<(), Failure> {
        self.pages.extend(outputs.written_pages());
        let Some(path) = self.common.json.clone() else { return Ok(outputs.write()?) };
        let text = program::json(schema, body).map_err(Failure::system)?;
        if path == Path::new("-") {
            outputs.write()?;
            return self.write_line(io::stdout(), &text);
        }
        outputs.put(&path, text + "\n");
        Ok(outputs.write()?)
    }

    /// The same where a command has no files but that of `--json`.
    ///
    /// # Errors
    ///
    /// As [`Console::write`].
    pub fn json(&mut self, schema: &str, body: &impl Serialize) -> Result<(), Failure> {
        self.write(self.outputs(), schema, body)
    }

    /// The same of a command that reads files, none of which it may replace.
    ///
    /// # Errors
    ///
    /// As [`Console::write`]; the file of `--json` is an input.
    pub fn json_of<'a>(
        &mut self,
        inputs: impl IntoIterator<Item = &'a PathBuf>,
        schema: &str,
        body: &impl Serialize,
    ) -> Result<(), Failure> {
        let mut outputs = self.outputs();
        outputs.check(inputs)?;
        self.write(outputs, schema, body)
    }

    /// The text in colour, where the stream of the result has any.
    #[must_use]
    pub fn paint(&self, paint: Emphasis, text: &str) -> String {
        let to_terminal = if self.text_to_stderr() {
            io::stderr().is_terminal()
        } else {
            io::stdout().is_terminal()
        };
        if self.coloured(to_terminal) { painted(paint, text) } else { text.to_owned() }
    }

    /// Says on standard error why the command was not done.
    pub(crate) fn print_failure(&self, failure: &Failure) {
        let head = if self.colour_on_stderr() {
            painted(Emphasis::Bad, "error:")
        } else {
            "error:".into()
        };
        let mut message = failure.to_string();
        // Messages of the command-line parser already begin this way.
        let mut text = format!("{head} {}\n", message.strip_prefix("error: ").unwrap_or(&message));
        let mut cause = failure.source();
        while let Some(error) = cause {
            let cause_text = error.to_string();
            if !message.contains(&cause_text) {
                text += &format!("  because {cause_text}\n");
            }
            message = cause_text;
            cause = error.source();
        }
        let text = printable(&text, &PAINTS);
        let text = for_stream(&io::stderr(), &text).into_owned();
        logs::write(&self.progress, text.as_bytes());
    }

    pub(crate) fn colour_on_stderr(&self) -> bool {
        self.coloured(io::stderr().is_terminal())
    }

    fn text_to_stderr(&self) -> bool {
        self.common.json.as_deref() == Some(Path::new("-"))
    }

    fn coloured(&self, on_terminal: bool) -> bool {
        let refused = || {
            std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty())
                || std::env::var_os("TERM").is_some_and(|value| value == "dumb")
        };
        match self.common.color {
            Color::Always => true,
            Color::Never => false,
            Color::Auto => on_terminal && !refused(),
        }
    }

    fn write_line(&mut self, mut stream: impl Write, text: &str) -> Result<(), Failure> {
        if self.reader_left {
            return Ok(());
        }
        let written = self.progress.suspend(|| {
            stream.write_all(text.as_bytes())?;
            stream.write_all(if text.ends_with('\n') { b"" } else { b"\n" })?;
            stream.flush()
        });
        match written {
            Err(error) if error.kind() == ErrorKind::BrokenPipe => self.reader_left = true,
            written => {
                written.map_err(|error| {
                    Failure::system(format!("cannot write the result: {error}"))
                })?;
            }
        }
        Ok(())
    }
}

/// The text wrapped to the terminal's width, if the stream is a terminal.
fn for_stream<'a>(stream: &impl AsFd, text: &'a str) -> Cow<'a, str> {
    match terminal_size_of(stream) {
        Some((Width(columns), _)) => Cow::Owned(wrapped(text, usize::from(columns))),
        None => Cow::Borrowed(text),
    }
}

/// The escape sequences of [`painted`]; no other one reaches the terminal.
const PAINTS: [&str; 6] =
    ["\u{1b}[1m", "\u{1b}[2m", "\u{1b}[32m", "\u{1b}[33m", "\u{1b}[1;31m", "\u{1b}[0m"];

fn painted(paint: Emphasis, text: &str) -> String {
    let [strong, faint, good, caution, bad, end] = PAINTS;
    let begin = match paint {
        Emphasis::Strong => strong,
        Emphasis::Faint => faint,
        Emphasis::Good => good,
        Emphasis::Caution => caution,
        Emphasis::Bad => bad,
    };
    format!("{begin}{text}{end}")
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Gone(ErrorKind);

    impl Write for Gone {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(self.0.into())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[derive(Serialize)]
    struct Body {
        seed: u64,
        error_mm: f64,
    }

    #[test]
    fn a_reader_that_left_is_no_error_but_a_full_disk_is() {
        let mut console = Console::new(Common::default());
        assert!(matches!(
            console.write_line(Gone(ErrorKind::StorageFull), "a"),
            Err(Failure::System(_))
        ));
        assert!(console.write_line(Gone(ErrorKind::BrokenPipe), "a").is_ok());
        assert!(console.write_line(Gone(ErrorKind::StorageFull), "never tried").is_ok());
    }

    #[test]
    fn json_names_its_schema_first() {
        let path = std::env::temp_dir().join(format!("trued-json-{}", std::process::id()));
        let common = Common { json: Some(path.clone()), ..Common::default() };
        let body = Body { seed: 7, error_mm: f64::NAN };
        Console::new(common).json("trued.demo/1", &body).expect("written");
        let text = std::fs::read_to_string(&path).expect("read");
        std::fs::remove_file(&path).expect("removed");
        let version = program::version();
        let expected = format!(
            "{{\n  \"schema\": \"trued.demo/1\",\n  \"version\": \"{version}\",\n  \"seed\": 7,\n  \"error_mm\": null\n}}\n"
        );
        assert_eq!(text, expected);
    }

    #[test]
    fn colour_is_only_where_it_was_asked_for() {
        let paint =
            |color| Console::new(Common { color, ..Common::default() }).paint(Emphasis::Good, "ok");
        assert_eq!(paint(Color::Never), "ok");
        assert_eq!(paint(Color::Always), "\u{1b}[32mok\u{1b}[0m");
    }
}
