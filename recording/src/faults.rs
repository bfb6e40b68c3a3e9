//! Errors of a file: all at once, each with its location.
//!
//! An error owns the line that it refers to, so that it can be shown without the file. Nothing
//! here reads files or prints; `Display` is the plain rendering, [`Faults::styled`] the coloured.

use std::fmt;
use std::ops::Range;

use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer, Snippet};

/// At most this many faults are kept of one file; more are counted.
pub const FAULTS_MAX: usize = 50;

/// At most this many bytes of a line are kept and shown: those around the marked place.
const LINE_MAX: usize = 400;

/// At most this many bytes of a part of a message (a quoted cell, a list of names) are kept.
const PART_MAX: usize = 1000;
/// Stands for what is left out.
const ELLIPSIS: char = '…';

/// A setting of the caller by which a fault may be remedied: a program names its own option for it ([`Faults::name_settings`]).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Setting {
    /// The sampling rate of waveforms.
    SamplingRate,
    /// The spacing of a profile's points.
    Spacing,
    /// The value of a WAV file's full scale.
    FullScale,
    /// The columns or channels that are read.
    Columns,
    /// The mapping of a table.
    Mapping,
    /// The link at which a chain begins.
    BaseLink,
    /// The link at which a chain ends.
    TipLink,
}

/// One fault: place, message, expectation, remedy.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// Place in the file, where one can be named.
    pub location: Option<Location>,
    /// Path of the key (`joint[2].axis`) or name of the column (`q3_deg`); may be empty.
    pub key: String,
    /// What is wrong.
    pub message: String,
    /// What was expected instead; may be empty.
    pub expected: String,
    /// What to do about it; may be empty.
    pub help: String,
    /// Settings by which to do it.
    pub settings: Vec<Setting>,
}

/// A span within one line of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Location {
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// The line itself, without its end; of a long one what is around the place, with `…` for the rest.
    pub text: String,
    /// The marked bytes within `text`.
    pub span: Range<usize>,
}

impl Location {
    /// The place of a byte span in a source text; a span over several lines is cut to its first.
    #[must_use]
    pub fn from_span(source: &str, span: &Range<usize>) -> Self {
        let start = floor_boundary(source, span.start);
        let before = source.get(..start).unwrap_or_default();
        let line_start = before.rfind('\n').map_or(0, |line_break| line_break + 1);
        let rest = source.get(line_start..).unwrap_or_default();
        let text = rest.lines().next().unwrap_or_default();
        let line = before.matches('\n').count() + 1;
        Self::from_line(line, text, &(start - line_start..span.end.saturating_sub(line_start)))
    }

    /// A span of bytes within a given line (`line` counts from 1).
    #[must_use]
    pub fn from_line(line: usize, text: &str, span: &Range<usize>) -> Self {
        let start = floor_boundary(text, span.start);
        let end = floor_boundary(text, span.end).max(start);
        let column = text.get(..start).unwrap_or_default().chars().count() + 1;
        if text.len() <= LINE_MAX {
            return Self { line, column, text: text.to_owned(), span: start..end };
        }
        let first = if end <= LINE_MAX {
            0
        } else {
            floor_boundary(text, start.saturating_sub(LINE_MAX / 4))
        };
        let last = floor_boundary(text, first + LINE_MAX);
        let mut kept = String::new();
        kept.extend((first > 0).then_some(ELLIPSIS));
        let shift = kept.len();
        kept.push_str(text.get(first..last).unwrap_or_default());
        kept.extend((last < text.len()).then_some(ELLIPSIS));
        let span = start - first + shift..end.min(last) - first + shift;
        Self { line, column, text: kept, span }
    }

    /// Whether the start of the line was left out, so that a column in `text` is not one of the line.
    fn begins_late(&self) -> bool {
        let before = self.text.get(..self.span.start).unwrap_or_default();
        before.chars().count() + 1 != self.column
    }
}

/// The largest character boundary of `text` not after `at`.
fn floor_boundary(text: &str, byte: usize) -> usize {
    let mut byte = byte.min(text.len());
    while !text.is_char_boundary(byte) {
        byte -= 1;
    }
    byte
}

/// A text without its middle if it is long.
fn shortened(text: String) -> String {
    if text.len() <= PART_MAX {
        return text;
    }
    let head = text.get(..floor_boundary(&text, PART_MAX / 2)).unwrap_or_default();
    let tail = text.get(floor_boundary(&text, text.len() - PART_MAX / 4)..).unwrap_or_default();
    format!("{head}{ELLIPSIS}{tail}")
}

impl Fault {
    /// A fault without a place.
    #[must_use]
    pub fn new(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self {
            location: None,
            key: shortened(key.into()),
            message: shortened(message.into()),
            expected: String::new(),
            help: String::new(),
            settings: Vec::new(),
        }
    }

    /// The same fault at a place.
    #[must_use]
    pub fn at(mut self, place: Location) -> Self {
        self.location = Some(place);
        self
    }

    /// The same fault with an expectation.
    #[must_use]
    pub fn expected(mut self, expected: impl Into<String>) -> Self {
        self.expected = shortened(expected.into());
        self
    }

    /// The same fault with a remedy.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = shortened(help.into());
        self
    }

    /// The same fault of a row of data that has no line, from 1; what to do is kept.
    #[must_use]
    pub fn in_row(mut self, row: usize) -> Self {
        let place = format!("in row {row} of the data");
        self.help = if self.help.is_empty() { place } else { format!("{place}: {}", self.help) };
        self
    }

    /// The same fault with the settings by which it may be remedied.
    #[must_use]
    pub fn by(mut self, settings: &[Setting]) -> Self {
        self.settings = settings.to_vec();
        self
    }

    fn title(&self) -> String {
        if self.key.is_empty() {
            self.message.clone()
        } else {
            format!("`{}`: {}", self.key, self.message)
        }
    }

    fn report<'a>(&'a self, file: &'a str) -> Group<'a> {
        let title = Level::ERROR.primary_title(self.title());
        let mut group = match &self.location {
            None => Group::with_title(title).element(Origin::path(file)),
            Some(place) => {
                let label =
                    (!self.expected.is_empty()).then(|| format!("expected {}", self.expected));
                let mark = AnnotationKind::Primary.span(place.span.clone()).label(label);
                let snippet =
                    Snippet::source(place.text.as_str()).line_start(place.line).annotation(mark);
                let group = Group::with_title(title);
                if place.begins_late() {
                    let origin = Origin::path(file).line(place.line).char_column(place.column);
                    group.element(origin).element(snippet)
                } else {
                    group.element(snippet.path(file))
                }
            }
        };
        if self.location.is_none() && !self.expected.is_empty() {
            group = group.element(Level::NOTE.message(format!("expected {}", self.expected)));
        }
        if !self.help.is_empty() {
            group = group.element(Level::HELP.message(self.help.as_str()));
        }
        group
    }
}

/// All faults of one file, in the order of their lines.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Faults {
    file: String,
    list: Vec<Fault>,
    left_out: usize,
}

impl Faults {
    /// No faults yet, of the file with this name.
    #[must_use]
    pub fn new(file: impl Into<String>) -> Self {
        Self { file: file.into(), list: Vec::new(), left_out: 0 }
    }

    /// Adds a fault; beyond [`FAULTS_MAX`] it is only counted.
    pub fn push(&mut self, fault: Fault) {
        self.push_with(|| fault);
    }

    /// Adds a fault that is costly to describe; beyond [`FAULTS_MAX`] it is only counted.
    pub fn push_with(&mut self, fault: impl FnOnce() -> Fault) {
        if self.list.len() < FAULTS_MAX {
            self.list.push(fault());
        } else {
            self.left_out += 1;
        }
    }

    /// `value` if there are no faults, otherwise all of them, sorted by line.
    ///
    /// # Errors
    /// The faults themselves.
    pub fn into_result<T>(mut self, value: Option<T>) -> Result<T, Self> {
        match value {
            Some(value) if self.list.is_empty() => Ok(value),
            _ => {
                if self.list.is_empty() {
                    self.push(Fault::new("", "the file could not be read completely"));
                }
                let line = |fault: &Fault| fault.location.as_ref().map(|p| (p.line, p.column));
                self.list.sort_by_key(line);
                Err(self)
            }
        }
    }

    /// The faults with the caller's names of their settings added to what to do.
    #[must_use]
    pub fn name_settings(mut self, name: impl Fn(Setting) -> &'static str) -> Self {
        for fault in &mut self.list {
            let names: Vec<&str> = fault.settings.drain(..).map(&name).collect();
            match (names.is_empty(), fault.help.is_empty()) {
                (true, _) => {}
                (false, true) => fault.help = format!("see {}", names.join(", ")),
                (false, false) => fault.help += &format!(" ({})", names.join(", ")),
            }
        }
        self
    }

    /// Name of the file.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.file
    }

    /// The faults, at most [`FAULTS_MAX`].
    #[must_use]
    pub fn list(&self) -> &[Fault] {
        &self.list
    }

    /// Whether there are no faults.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Number of faults, including those omitted.
    #[must_use]
    pub fn len(&self) -> usize {
        self.list.len() + self.left_out
    }

    /// All faults with line and caret, in colour (ANSI escapes).
    #[must_use]
    pub fn styled(&self) -> String {
        self.render(&Renderer::styled())
    }

    /// All faults with line and caret, without colour.
    #[must_use]
    pub fn plain(&self) -> String {
        self.render(&Renderer::plain())
    }

    /// Asserts that the text contains these words.
    #[cfg(test)]
    #[track_caller]
    pub(crate) fn assert_say(&self, part: &str) {
        let message = self.plain();
        assert!(message.contains(part), "{part} in\n{message}");
    }

    fn render(&self, renderer: &Renderer) -> String {
        let shown = self.list.iter().map(|fault| renderer.render(&[fault.report(&self.file)]));
        let mut text = shown.collect::<Vec<_>>().join("\n\n");
        if self.left_out > 0 {
            text.push_str(&format!("\n\nand {} more errors in {}", self.left_out, self.file));
        }
        text
    }
}

impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.plain())
    }
}

impl std::error::Error for Faults {}

/// The nearest of `known` to `name`, if it is near enough for a misspelling.
#[must_use]
pub fn nearest<'k>(name: &str, known: impl IntoIterator<Item = &'k str>) -> Option<&'k str> {
    let with_distance = |k: &'k str| (distance(name, k), k);
    let (steps, found) = known.into_iter().map(with_distance).min_by_key(|(steps, _)| *steps)?;
    // Only the start of a name is compared, so that a long text has no near match.
    let length = name.chars().count().max(found.chars().count()).min(COMPARED);
    (steps > 0 && steps * 3 <= length.max(3)).then_some(found)
}

/// Number of characters of a name that are compared.
const COMPARED: usize = 64;

/// Number of single-character edits (insert, delete, replace, swap of neighbours).
fn distance(a: &str, b: &str) -> usize {
    let a: Vec<char> = a.chars().take(COMPARED).collect();
    let b: Vec<char> = b.chars().take(COMPARED).collect();
    let mut rows = vec![vec![0_usize; b.len() + 1]; a.len() + 1];
    for i in 0..=a.len() {
        for j in 0..=b.len() {
            if i == 0 || j == 0 {
                rows[i][j] = i + j;
                continue;
            }
            let replace = usize::from(a[i - 1] != b[j - 1]);
            let mut best = (rows[i - 1][j] + 1).min(rows[i][j - 1] + 1);
            best = best.min(rows[i - 1][j - 1] + replace);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                best = best.min(rows[i - 2][j - 2] + 1);
            }
            rows[i][j] = best;
        }
    }
    rows[a.len()][b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_shows_its_line_and_a_caret() {
        let source = "a = 1\nanlge = 2\n";
        let mut faults = Faults::new("cell.toml");
        let place = Location::from_span(source, &(6..11));
        faults.push(
            Fault::new("anlge", "unknown key")
                .at(place)
                .expected("one of the known keys")
                .help("did you mean `angle`?"),
        );
        insta::assert_snapshot!(faults, @r"
        error: `anlge`: unknown key
         --> cell.toml:2:1
          |
        2 | anlge = 2
          | ^^^^^ expected one of the known keys
          |
          = help: did you mean `angle`?
        ");
        assert!(faults.styled().contains('\u{1b}'));
    }

    #[test]
    fn a_swapped_letter_is_near_and_another_word_is_not() {
        assert_eq!(nearest("anlge", ["angle", "rate"]), Some("angle"));
        assert_eq!(nearest("stiffness", ["angle", "rate"]), None);
        assert_eq!(nearest("angle", ["angle"]), None);
    }

    #[test]
    fn faults_beyond_the_limit_are_counted() {
        let mut faults = Faults::new("x");
        for _ in 0..FAULTS_MAX + 7 {
            faults.push(Fault::new("k", "m"));
        }
        assert_eq!((faults.list().len(), faults.len()), (FAULTS_MAX, FAULTS_MAX + 7));
        assert!(faults.plain().ends_with("and 7 more errors in x"));
    }

    #[test]
    fn a_caller_adds_its_names_of_the_settings_once() {
        let mut faults = Faults::new("x");
        faults.push(Fault::new("k", "m").help("state the rate").by(&[Setting::SamplingRate]));
        faults.push(Fault::new("l", "m").by(&[Setting::BaseLink]));
        assert!(!faults.plain().contains("--rate") && !faults.plain().contains("--base"));
        let name = |setting| if setting == Setting::BaseLink { "--base" } else { "--rate" };
        let named = faults.name_settings(name);
        let helps: Vec<&str> = named.list().iter().map(|fault| fault.help.as_str()).collect();
        assert_eq!(helps, ["state the rate (--rate)", "see --base"]);
        assert_eq!(named.clone().name_settings(name), named);
    }

    #[test]
    fn a_place_far_in_a_long_line_is_shown_with_its_true_column_and_a_short_text() {
        let line = format!("{}wrong{}", "größe,".repeat(1_000), ",1".repeat(1_000_000));
        let at = line.find("wrong").unwrap();
        let place = Location::from_span(&line, &(at..at + 5));
        assert_eq!((place.line, place.column), (1, 6_001));
        assert_eq!(place.text.get(place.span.clone()), Some("wrong"));
        let mut faults = Faults::new("long.csv");
        let quoted = format!("`{line}` is not a number");
        faults.push(Fault::new("q1_deg", quoted).at(place).expected("a number"));
        let text = faults.plain();
        assert!(text.contains("long.csv:1:6001\n"), "{text}");
        assert!(text.contains("is not a number") && text.len() < 4_000, "{}", text.len());
        // A span as long as the line.
        let whole = Location::from_line(1, &line, &(0..line.len()));
        assert!((whole.column, whole.text.len() < 500) == (1, true), "{}", whole.text.len());
        assert_eq!(whole.span.start, 0);
    }

    #[test]
    fn a_span_beyond_its_text_or_inside_a_character_is_cut() {
        let place = Location::from_span("größe", &(3..900));
        assert_eq!((place.line, place.column), (1, 3));
        let empty = Location::from_span("", &(7..9));
        assert_eq!(empty.span, 0..0);
    }
}
