//! The page: one self-contained HTML file, also well-formed XML, for screen (light and dark) and print.

use crate::MADE_BY;
use crate::canvas::Svg;
use crate::escape::escape;
use crate::number::significant;
use crate::table::Table;

pub(crate) const STYLE: &str = include_str!("style.css");

/// How a statement is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Tone {
    /// A plain statement.
    #[default]
    Plain,
    /// As it should be.
    Good,
    /// To be looked at.
    Caution,
    /// A fault.
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

    /// A short remark beneath, e.g. what it was before.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// How the number is to be taken.
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
        let note = match self.note.as_str() {
            "" => String::new(),
            note => format!("<dd class=\"remark\">{}</dd>", escape(note)),
        };
        format!(
            "<div class=\"{}\"><dt>{}</dt><dd class=\"value\">{}{unit}</dd>{note}</div>",
            self.tone.class(),
            escape(&self.label),
            escape(&self.value)
        )
    }
}

/// A page in the making; what is added stands in the order of adding.
#[derive(Debug, Clone)]
pub struct Page {
    title: String,
    kicker: String,
    body: String,
    footer: String,
    figures: usize,
}

impl Page {
    /// An empty page by its title.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        let (body, footer) = (String::new(), String::new());
        Self { title: title.into(), kicker: String::new(), body, footer, figures: 0 }
    }

    /// A short line above the title: which cell, robot, recording.
    #[must_use]
    pub fn kicker(mut self, text: impl Into<String>) -> Self {
        self.kicker = text.into();
        self
    }

    /// What the page says, in a sentence or two, larger than the rest.
    #[must_use]
    pub fn lead(self, text: &str) -> Self {
        self.with(&format!("<p class=\"lead\">{}</p>\n", escape(text)))
    }

    /// The key numbers.
    #[must_use]
    pub fn numbers(self, numbers: impl IntoIterator<Item = Number>) -> Self {
        let numbers: String = numbers.into_iter().map(|number| number.html()).collect();
        self.with(&format!("<dl class=\"numbers\">{numbers}</dl>\n"))
    }

    /// The head of a section.
    #[must_use]
    pub fn section(self, heading: &str) -> Self {
        self.with(&format!("<h2>{}</h2>\n", escape(heading)))
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

    /// A statement set apart: a verdict, a warning, what remains open.
    #[must_use]
    pub fn note(self, tone: Tone, heading: &str, text: &str) -> Self {
        let (heading, text) = (escape(heading), escape(text));
        let class = tone.class();
        self.with(&format!(
            "<aside class=\"{class}\"><strong>{heading}</strong><p>{text}</p></aside>\n"
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
        let drawing = svg.as_str();
        self.with(&format!(
            "<figure><div class=\"wide\">{drawing}</div><figcaption>{label}</figcaption></figure>\n"
        ))
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

    /// Text as it is typed: a command, a file.
    #[must_use]
    pub fn code(self, text: &str) -> Self {
        self.with(&format!("<pre>{}</pre>\n", escape(text)))
    }

    /// The foot of the page: the command that makes it again, the version that made it.
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
        format!(
            "<!DOCTYPE html>\n{MADE_BY}\n<html lang=\"en\" xmlns=\"http://www.w3.org/1999/xhtml\">\n<head>\n<meta charset=\"utf-8\"/>\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
             <meta name=\"color-scheme\" content=\"light dark\"/>\n<title>{title}</title>\n<style>\n{STYLE}</style>\n\
             </head>\n<body>\n<main>\n<header>\n{kicker}<h1>{title}</h1>\n</header>\n{}{footer}</main>\n</body>\n</html>\n",
            self.body
        )
    }

    fn with(mut self, html: &str) -> Self {
        self.body += html;
        self
    }
}
