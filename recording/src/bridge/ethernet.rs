//! The controller's own RSI configuration (`RSI_EthernetConfig.xml`): elements that it sends and
//! receives.
//!
//! All errors are reported at once, with line and caret; elements that are not needed are not
//! checked.

use std::ops::Range;

use roxmltree::{Document, Node, ParsingOptions};

use crate::faults::{Fault, Faults, Location};
use crate::xml;

/// Limit on XML nodes: more than 64 channels need.
const NODES_MAX: u32 = 20_000;
/// Channels of RSI in each direction.
const CHANNELS_MAX: usize = 64;
/// Limit on the length of tag or type, so that an answer fits into a datagram; an element in the
/// field has a third of it.
const WORD_MAX: usize = 64;

/// One element of the telegram.
#[derive(Debug, Clone, PartialEq)]
pub struct Element {
    /// Its tag without `DEF_`: `ASPos`, `AKorr.A1`.
    pub tag: String,
    /// An internal value of the controller: its attributes are predefined and it uses no channel.
    pub is_internal: bool,
    /// The output keeps the last value if an answer is late; otherwise it falls to zero.
    pub holds: bool,
    /// `BOOL` or `LONG`: written without decimals.
    pub is_whole: bool,
    /// Its position in the file.
    pub place: Location,
}

/// What the controller sends and receives.
#[derive(Debug, Clone, PartialEq)]
pub struct EthernetConfig {
    /// Name of the file.
    pub name: String,
    /// Port to which it sends.
    pub port: u16,
    /// Type of the answer.
    pub sentype: String,
    /// What it sends.
    pub send: Vec<Element>,
    /// What it receives.
    pub receive: Vec<Element>,
}

impl EthernetConfig {
    /// Reads a configuration from a text.
    ///
    /// # Errors
    /// All faults of the text.
    pub fn parse(name: &str, text: &str) -> Result<Self, Faults> {
        let options = ParsingOptions { nodes_limit: NODES_MAX, ..ParsingOptions::default() };
        let relaxed = xml::relaxed(text);
        let document = Document::parse_with_options(&relaxed, options).map_err(|error| {
            let position = error.pos();
            let row = usize::try_from(position.row).unwrap_or(1).max(1);
            let line = text.lines().nth(row - 1).unwrap_or_default();
            let mut faults = Faults::new(name);
            let fault = Fault::new("", format!("is not valid XML: {error}"));
            faults.push(fault.at(Location::from_line(row, line, &(0..line.len()))));
            faults
        })?;
        let mut source = Source { text, faults: Faults::new(name) };
        let read = source.read(name, document.root_element());
        source.faults.into_result(read)
    }

    /// The element that the controller sends under this tag.
    #[must_use]
    pub fn find_sent(&self, tag: &str) -> Option<&Element> {
        self.send.iter().find(|element| element.tag == tag)
    }

    /// The element that the controller receives under this tag.
    #[must_use]
    pub fn find_received(&self, tag: &str) -> Option<&Element> {
        self.receive.iter().find(|element| element.tag == tag)
    }
}

struct Source<'t> {
    text: &'t str,
    faults: Faults,
}

impl Source<'_> {
    fn fault(&mut self, span: &Range<usize>, key: &str, message: String, expected: &str) {
        let fault = Fault::new(key, message).expected(expected);
        self.faults.push(fault.at(Location::from_span(self.text, span)));
    }

    fn read(&mut self, name: &str, root: Node<'_, '_>) -> Option<EthernetConfig> {
        let config = child(root, "CONFIG");
        let port = self.text(root, config, "PORT").and_then(|(text, span)| {
            let port = text.parse().ok().filter(|port| *port != 0);
            if port.is_none() {
                self.fault(&span, "PORT", format!("is \"{text}\""), "a port, 1 to 65535");
            }
            port
        });
        let sentype = self.text(root, config, "SENTYPE").map(|(text, _)| text);
        if let Some(text) = &sentype
            && !(text.len() <= WORD_MAX
                && text.chars().all(|c| c.is_ascii_alphanumeric() || "_-.".contains(c)))
        {
            self.fault(
                &root.range(),
                "SENTYPE",
                format!("is \"{text}\""),
                "up to 64 letters, digits, _ - .",
            );
        }
        if let Some(node) = config.and_then(|config| child(config, "ONLYSEND"))
            && node.text().is_some_and(|text| text.trim().eq_ignore_ascii_case("TRUE"))
        {
            self.fault(
                &node.range(),
                "ONLYSEND",
                "is TRUE: the controller does not accept replies".to_owned(),
                "FALSE",
            );
        }
        let send = self.elements(root, "SEND");
        let receive = self.elements(root, "RECEIVE");
        Some(EthernetConfig {
            name: name.to_owned(),
            port: port?,
            sentype: sentype?,
            send,
            receive,
        })
    }

    fn text(
        &mut self,
        root: Node<'_, '_>,
        config: Option<Node<'_, '_>>,
        tag: &str,
    ) -> Option<(String, Range<usize>)> {
        let found = config.and_then(|config| child(config, tag));
        let text =
            found.and_then(|node| node.text()).map(str::trim).filter(|text| !text.is_empty());
        if text.is_none() {
            let span = found.or(config).unwrap_or(root).range();
            self.fault(&span, tag, "is missing".to_owned(), "CONFIG with PORT and SENTYPE");
        }
        text.map(|text| (text.to_owned(), found.map_or(0..0, |node| node.range())))
    }

    fn elements(&mut self, root: Node<'_, '_>, section: &str) -> Vec<Element> {
        let list = child(root, section).and_then(|node| child(node, "ELEMENTS"));
        let Some(list) = list else {
            self.fault(
                &root.range(),
                section,
                "is missing".to_owned(),
                "SEND and RECEIVE, each with ELEMENTS",
            );
            return Vec::new();
        };
        let mut elements: Vec<Element> = Vec::new();
        for node in list.children().filter(|node| node.has_tag_name("ELEMENT")) {
            let Some(tag) = node.attribute("TAG").filter(|tag| is_tag(tag)) else {
                self.fault(
                    &node.range(),
                    "ELEMENT",
                    "has no valid TAG".to_owned(),
                    "a TAG of up to 64 letters, digits, `_` and one dot",
                );
                continue;
            };
            let tag = tag.strip_prefix("DEF_").unwrap_or(tag).to_owned();
            if elements.iter().any(|element| element.tag == tag) {
                self.fault(&node.range(), &tag, "is defined twice".to_owned(), "each TAG once");
                continue;
            }
            elements.push(Element {
                is_internal: node.attribute("INDX") == Some("INTERNAL"),
                holds: node.attribute("HOLDON") != Some("0"),
                is_whole: matches!(node.attribute("TYPE"), Some("BOOL" | "LONG")),
                place: Location::from_span(self.text, &node.range()),
                tag,
            });
        }
        let channels = elements.iter().filter(|element| !element.is_internal).count();
        if channels > CHANNELS_MAX {
            let found = format!("has {channels} channels");
            self.fault(&list.range(), section, found, "at most 64, the limit of RSI");
        }
        elements
    }
}

fn is_tag(tag: &str) -> bool {
    let is_identifier = |text: &str| {
        !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
    };
    let is_form = match tag.split_once('.') {
        Some((group, name)) => is_identifier(group) && is_identifier(name),
        None => is_identifier(tag),
    };
    is_form && tag.len() <= WORD_MAX
}

fn child<'d, 's>(node: Node<'d, 's>, tag: &str) -> Option<Node<'d, 's>> {
    node.children().find(|child| child.has_tag_name(tag))
}
