//! The page: one self-contained HTML file, also well-formed XML, for screen (light and dark) and print.

use crate::MADE_BY;
use crate::canvas::Svg;
use crate::escape::escape;
use crate::number::significant;
use crate::provenance::{self, Provenance};
use crate::table::Table;

pub(crate) const STYLE: &str = include_str!("style.css");
/// Limit on key numbers.
const NUMBERS: usize = 4;
/// Sections from which on a page has a list of contents.
const CONTENTS_LEAST: usize = 3;

/// Tone of a statement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Tone {
    /// A plain statement.
    #[default]
    Plain,
    /// As required.
    Good,
    /// Needs attention.
    Caution,
    /// A fault or a failed requirement.
    Bad,
}

impl Tone {
    fn class(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Good => "good",
            Self::Caution => "caution",
            Self::Bad => "bad",
        }
    }

    /// The equivalent sign, independent of colour.
    fn sign(self) -> &'static str {
        match self {
            Self::Plain => "",
            Self::Good => "<span class=\"sign\">✓</span> ",
            Self::Caution => "<span class=\"sign\">!</span> ",
            Self::Bad => "<span class=\"sign\">✗</span> ",
        }
    }
}

/// A key number, shown large at the top of a page.
#[derive(Debug, Clone)]
pub struct Number {
    label: String,
    value: String,
    unit: String,
    note: String,
    tone: Tone,
}

impl Number {
    /// A value of three significant digits; `–` where it is not finite.
    #[must_use]
    pub fn new(label: impl Into<String>, value: f64, unit: impl Into<String>) -> Self {
        Self { unit: unit.into(), ..Self::text(label, significant(value, 3)) }
    }

    /// A value that is written already, e.g. `3 of 20`.
    #[must_use]
    pub fn text(label: impl Into<String>, value: impl Into<String>) -> Self {
        let (unit, note) = (String::new(), String::new());
        Self { label: label.into(), value: value.into(), unit, note, tone: Tone::Plain }
    }

    /// A short remark below, e.g. the previous value.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// The tone of the number.
    #[must_use]
    pub fn tone(mut self, tone: Tone) -> Self {
        self.tone = tone;
        self
    }

    fn html(&self) -> String {
        let unit = match self.unit.as_str() {
            "" => String::new(),
            unit => format!("<span class=\"unit\">\u{a0}{}</span>", escape(unit)),
        };
        let sign = self.tone.sign();
        let note = match self.note.as_str() {
            "" if sign.is_empty() => String::new(),
            note => format!("<dd class=\"remark\">{sign}{}</dd>", escape(note)),
        };
        format!(
            "<div class=\"{}\"><dt>{}</dt><dd class=\"value\">{}{unit}</dd>{note}</div>",
            self.tone.class(),
            escape(&self.label),
            escape(&self.value)
        )
    }
}

/// Preformatted text that breaks between its words only, so that an option is not separated from its value: `--target=-0.1,2` has places where a
/// browser would break.
fn command_box(text: &str) -> String {
    let mut html = String::from("<pre>");
    let mut word = String::new();
    let mut is_quoted = false;
    for letter in text.chars() {
        is_quoted ^= letter == '\'';
        if letter.is_whitespace() && !is_quoted {
            html += &unbroken(&std::mem::take(&mut word));
            html.push(letter);
        } else {
            word.push(letter);
        }
    }
    html + &unbroken(&word) + "</pre>"
}

/// A word of a command that is not broken; one of letters and digits has no place for a break.
fn unbroken(word: &str) -> String {
    let is_breakable = word.contains(|letter: char| !letter.is_alphanumeric());
    if is_breakable { format!("<span>{}</span>", escape(word)) } else { escape(word) }
}

/// A page; elements appear in the order of addition. Elements before the first section form the
/// first screen, and the first sheet of paper.
#[derive(Debug, Clone)]
pub struct Page {
    title: String,
    kicker: String,
    robot: String,
    about: Vec<(String, String)>,
    provenance: Option<Provenance>,
    body: String,
    /// Where in the body the first section begins.
    details_at: Option<usize>,
    sections: Vec<Section>,
    footer: String,
    figures: usize,
}

/// A section of a page, with a link target.
#[derive(Debug, Clone)]
struct Section {
    heading: String,
    id: String,
}

impl Page {
    /// An empty page by its title.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            kicker: String::new(),
            robot: String::new(),
            about: Vec::new(),
            provenance: None,
            body: String::new(),
            details_at: None,
            sections: Vec::new(),
            footer: String::new(),
            figures: 0,
        }
    }

    /// A short line above the title: the kind of the page.
    #[must_use]
    pub fn kicker(mut self, text: impl Into<String>) -> Self {
        self.kicker = text.into();
        self
    }

    /// The robot and its serial number, as far as known.
    #[must_use]
    pub fn robot(mut self, robot: impl Into<String>) -> Self {
        self.robot = robot.into();
        self
    }

    /// A further subject of the page, after the robot in the strip: a cell, a model.
    #[must_use]
    pub fn about(mut self, name: impl Into<String>, value: impl Into<String>) -> Self {
        self.about.push((name.into(), value.into()));
        self
    }

    /// Inputs, time and program of the page: the strip below the title.
    #[must_use]
    pub fn provenance(mut self, provenance: Provenance) -> Self {
        self.provenance = Some(provenance);
        self
    }

    /// The verdict: a word, and a complete sentence.
    #[must_use]
    pub fn verdict(self, tone: Tone, label: &str, sentence: &str) -> Self {
        let (label, sentence) = (escape(label), escape(sentence));
        let (class, sign) = (tone.class(), tone.sign());
        self.with(&format!(
            "<div class=\"verdict {class}\"><p class=\"word\">{sign}{label}</p><p>{sentence}</p></div>\n"
        ))
    }

    /// The main statement of the page, in a sentence or two, larger than the rest.
    #[must_use]
    pub fn lead(self, text: &str) -> Self {
        self.with(&format!("<p class=\"lead\">{}</p>\n", escape(text)))
    }

    /// The key numbers; the first four are shown.
    #[must_use]
    pub fn numbers(self, numbers: impl IntoIterator<Item = Number>) -> Self {
        let numbers: String = numbers.into_iter().take(NUMBERS).map(|one| one.html()).collect();
        self.with(&format!("<dl class=\"numbers\">{numbers}</dl>\n"))
    }

    /// The next step, with its command if there is one.
    #[must_use]
    pub fn next(self, text: &str, command: Option<&str>) -> Self {
        let command = command.map_or(String::new(), |line| command_box(line) + "\n");
        self.with(&format!(
            "<div class=\"next\"><p><strong>Next:</strong> {}</p>{command}</div>\n",
            escape(text)
        ))
    }

    /// The head of a section; the contents list it.
    #[must_use]
    pub fn section(mut self, heading: &str) -> Self {
        self.details_at.get_or_insert(self.body.len());
        let id = self.free_id(heading);
        let section = format!(
            "<h2 id=\"{id}\">{} <a class=\"up\" href=\"#top\" aria-label=\"Back to the top\">↑</a></h2>\n",
            escape(heading)
        );
        self.sections.push(Section { heading: heading.to_owned(), id });
        self.with(&section)
    }

    /// Long content, collapsed below its summary; shown completely in print.
    #[must_use]
    pub fn folded(self, summary: &str, inside: impl FnOnce(Self) -> Self) -> Self {
        let open = format!("<details><summary>{}</summary>\n", escape(summary));
        inside(self.with(&open)).with("</details>\n")
    }

    /// A paragraph.
    #[must_use]
    pub fn text(self, text: &str) -> Self {
        self.with(&format!("<p>{}</p>\n", escape(text)))
    }

    /// A list of points.
    #[must_use]
    pub fn list<T: AsRef<str>>(self, points: impl IntoIterator<Item = T>) -> Self {
        let points = points.into_iter().map(|point| format!("<li>{}</li>", escape(point.as_ref())));
        self.with(&format!("<ul>{}</ul>\n", points.collect::<String>()))
    }

    /// A highlighted statement: a verdict, a warning, an open point.
    #[must_use]
    pub fn note(self, tone: Tone, heading: &str, text: &str) -> Self {
        let (heading, text) = (escape(heading), escape(text));
        let (class, sign) = (tone.class(), tone.sign());
        self.with(&format!(
            "<aside class=\"{class}\"><strong>{sign}{heading}</strong><p>{text}</p></aside>\n"
        ))
    }

    /// A table.
    #[must_use]
    pub fn table(self, table: &Table) -> Self {
        self.with(&table.html())
    }

    /// A drawing with its caption; figures are numbered.
    #[must_use]
    pub fn figure(mut self, caption: &str, svg: &Svg) -> Self {
        self.figures += 1;
        let label = format!("<b>Figure {}.</b> {}", self.figures, escape(caption));
        let drawing = svg.html();
        self.with(&format!("<figure>{drawing}<figcaption>{label}</figcaption></figure>\n"))
    }

    /// Facts by name: model, recording, seed, versions.
    #[must_use]
    pub fn facts<K: AsRef<str>, V: AsRef<str>>(
        self,
        facts: impl IntoIterator<Item = (K, V)>,
    ) -> Self {
        let fact = |(name, value): (K, V)| {
            format!(
                "<div><dt>{}</dt><dd>{}</dd></div>",
                escape(name.as_ref()),
                escape(value.as_ref())
            )
        };
        let facts: String = facts.into_iter().map(fact).collect();
        self.with(&format!("<dl class=\"facts\">{facts}</dl>\n"))
    }

    /// Preformatted text: a command, a file.
    #[must_use]
    pub fn code(self, text: &str) -> Self {
        self.with(&format!("{}\n", command_box(text)))
    }

    /// The footer of the page: further information.
    #[must_use]
    pub fn footer(mut self, text: impl Into<String>) -> Self {
        self.footer = text.into();
        self
    }

    /// The whole file.
    #[must_use]
    pub fn render(&self) -> String {
        let title = escape(&self.title);
        let kicker = match self.kicker.as_str() {
            "" => String::new(),
            text => format!("<p class=\"kicker\">{}</p>\n", escape(text)),
        };
        let footer = match self.footer.as_str() {
            "" => String::new(),
            text => format!("<footer>{}</footer>\n", escape(text)),
        };
        let (first, details) = self.body.split_at(self.details_at.unwrap_or(self.body.len()));
        let (strip, contents, files) = (self.strip(), self.contents(), self.files());
        format!(
            "<!DOCTYPE html>\n{MADE_BY}\n<html lang=\"en\" xmlns=\"http://www.w3.org/1999/xhtml\">\n<head>\n<meta charset=\"utf-8\"/>\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
             <meta name=\"color-scheme\" content=\"light dark\"/>\n<title>{title}</title>\n<style>\n{STYLE}</style>\n\
             </head>\n<body>\n<main>\n<header id=\"top\">\n{kicker}<h1>{title}</h1>\n{strip}</header>\n{first}{contents}{details}{files}{footer}</main>\n</body>\n</html>\n"
        )
    }

    fn strip(&self) -> String {
        let robot = match self.robot.as_str() {
            "" => String::new(),
            robot => provenance::entry("Robot", &escape(robot)),
        };
        let made = self.provenance.as_ref().map_or(String::new(), Provenance::strip);
        let about =
            self.about.iter().map(|(name, value)| provenance::entry(&escape(name), &escape(value)));
        match robot + &about.collect::<String>() + &made {
            entries if entries.is_empty() => entries,
            entries => format!("<dl class=\"strip\">{entries}</dl>\n"),
        }
    }

    /// Every input file with its complete hash, if the strip has no room for all.
    fn files(&self) -> String {
        self.provenance.as_ref().and_then(Provenance::table).map_or(String::new(), |table| {
            format!("<details><summary>All input files</summary>\n{}</details>\n", table.html())
        })
    }

    /// Links to the sections; none for a page of few sections.
    fn contents(&self) -> String {
        if self.sections.len() < CONTENTS_LEAST {
            return String::new();
        }
        let link = |Section { heading, id }: &Section| {
            format!("<li><a href=\"#{id}\">{}</a></li>", escape(heading))
        };
        let links: String = self.sections.iter().map(link).collect();
        format!("<nav class=\"contents\" aria-label=\"Contents\"><ol>{links}</ol></nav>\n")
    }

    /// An unused id made of the heading's letters and digits.
    fn free_id(&self, heading: &str) -> String {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { ' ' };
        let plain_text: String = heading.chars().map(plain).collect();
        let stem = format!("s-{}", plain_text.split_whitespace().collect::<Vec<_>>().join("-"));
        let is_free = |id: &String| self.sections.iter().all(|section| section.id != *id);
        let numbered = (2..).map(|n| format!("{stem}-{n}"));
        std::iter::once(stem.clone()).chain(numbered).find(is_free).unwrap_or_default()
    }

    fn with(mut self, html: &str) -> Self {
        self.body += html;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_option_of_a_command_stays_with_its_value_and_a_quoted_word_with_itself() {
        let html = command_box("trued plan --target=-0.1,2.3 'my robot.toml'\n  <end>");
        assert_eq!(
            html,
            "<pre>trued plan <span>--target=-0.1,2.3</span> <span>&#39;my robot.toml&#39;</span>\n  <span>&lt;end&gt;</span></pre>"
        );
    }
}
