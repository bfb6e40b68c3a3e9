//! The XML of a URDF: numbers and names, with the link or joint and the line of every error.
//!
//! A getter returns the value if it is valid, otherwise a harmless one after adding a fault: all
//! errors are reported at once, and nothing is built if there are any.

use std::cell::RefCell;
use std::ops::Range;

use glam::DVec3;
use physics::Frame;
use roxmltree::{Document, Error, Node, ParsingOptions};

use super::rpy;
use crate::faults::{Fault, Faults, Location};
use crate::xml::PREFIX_END;

/// Limit on XML nodes, above that of any robot: bounds the memory of a file.
const NODES_MAX: u32 = 200_000;
/// What to do with a xacro.
pub(super) const EXPAND: &str = "expand the xacro first: `xacro FILE.urdf.xacro > FILE.urdf`";

/// Limit on numbers, above those of any robot; their products stay finite.
const SIZE_MAX: f64 = 1e12;

/// Position and text of an attribute.
type Attribute<'d> = (Range<usize>, &'d str);

/// A text, and the faults found in it so far.
pub(super) struct Source<'s> {
    text: &'s str,
    faults: RefCell<Faults>,
}

/// The XML of a text; `relaxed` is the result of [`crate::xml::relaxed`] for it.
///
/// # Errors
/// Not valid XML, or too large.
pub(super) fn document<'t>(
    name: &str,
    text: &str,
    relaxed: &'t str,
) -> Result<Document<'t>, Faults> {
    let options = ParsingOptions { nodes_limit: NODES_MAX, ..ParsingOptions::default() };
    Document::parse_with_options(relaxed, options).map_err(|error| {
        let mut faults = Faults::new(name);
        let location = place_of(text, &error);
        let second = relaxed.matches("</robot>").count() > 1;
        let fault = if second {
            let help = "split the file into one file per robot";
            Fault::new("", format!("contains several <robot> elements: {error}")).help(help)
        } else {
            Fault::new("", format!("is not valid XML: {error}"))
        };
        let is_entity = matches!(&error, Error::UnknownEntityReference(..));
        let help = "replace the entity by its text; entities of a DOCTYPE are not expanded";
        faults.push(if is_entity { fault.help(help) } else { fault }.at(location));
        faults
    })
}

fn place_of(text: &str, error: &Error) -> Location {
    let position = error.pos();
    let row = usize::try_from(position.row).unwrap_or(1).max(1);
    let line = text.lines().nth(row - 1).unwrap_or_default();
    let column = usize::try_from(position.col).unwrap_or(1).saturating_sub(1);
    let byte = line.char_indices().nth(column).map_or(line.len(), |(byte, _)| byte);
    Location::from_line(row, line, &(byte..byte + 1))
}

/// The name of a link or joint; `None` without one.
pub(super) fn name<'d>(node: Node<'d, '_>) -> &'d str {
    node.attribute("name").unwrap_or_default()
}

/// The first child element with this tag.
pub(super) fn child<'d, 's>(node: Node<'d, 's>, tag: &str) -> Option<Node<'d, 's>> {
    node.children().find(|child| child.has_tag_name(tag))
}

/// Name of an element in faults: `joint a4`, `joint a4: limit`, `link arm: inertial mass`.
fn title(node: Node<'_, '_>) -> String {
    let mut parts = Vec::new();
    for node in node.ancestors().filter(Node::is_element) {
        let tag = node.tag_name().name();
        if tag == "link" || tag == "joint" {
            parts.reverse();
            let owner = format!("{tag} {}", name(node));
            let within = parts.join(" ").replace(PREFIX_END, ":");
            let colon = if within.is_empty() { "" } else { ": " };
            return format!("{}{colon}{within}", owner.trim_end());
        }
        parts.push(tag);
    }
    parts.reverse();
    parts.join(" ").replace(PREFIX_END, ":")
}

impl<'s> Source<'s> {
    pub(super) fn new(name: &str, text: &'s str) -> Self {
        Self { text, faults: RefCell::new(Faults::new(name)) }
    }

    /// The value, or every fault.
    pub(super) fn finish<T>(self, value: Option<T>) -> Result<T, Faults> {
        self.faults.into_inner().into_result(value)
    }

    pub(super) fn is_sound(&self) -> bool {
        self.faults.borrow().is_empty()
    }

    /// Adds a fault of the file, not of one element.
    pub(super) fn push(&self, fault: Fault) {
        self.faults.borrow_mut().push(fault);
    }

    /// Adds a fault of an element, marked at its first line.
    pub(super) fn fault(
        &self,
        node: Node<'_, '_>,
        message: impl Into<String>,
        help: impl Into<String>,
    ) {
        let fault = || Fault::new(title(node), message).help(help);
        self.mark(&node.range(), fault);
    }

    /// Adds a fault of an attribute, marked at its value.
    fn fault_at(
        &self,
        node: Node<'_, '_>,
        attribute: &str,
        (range, text): &Attribute<'_>,
        expected: &str,
    ) {
        let fault = || {
            let key = format!("{} {attribute}", title(node));
            let fault = Fault::new(key, format!("is \"{text}\"")).expected(expected);
            if text.contains('$') { fault.help(EXPAND) } else { fault }
        };
        self.mark(range, fault);
    }

    fn mark(&self, range: &Range<usize>, fault: impl FnOnce() -> Fault) {
        let place = || Location::from_span(self.text, range);
        self.faults.borrow_mut().push_with(|| fault().at(place()));
    }

    fn attribute<'d>(&self, node: Node<'d, '_>, attribute: &str) -> Option<Attribute<'d>> {
        let found = node.attribute_node(attribute)?;
        Some((found.range_value(), found.value()))
    }

    /// A number, if the attribute is present.
    pub(super) fn number(&self, node: Node<'_, '_>, attribute: &str) -> Option<f64> {
        let found = self.attribute(node, attribute)?;
        let number = number(found.1.trim());
        if number.is_none() {
            self.fault_at(node, attribute, &found, "a number below 1e12");
        }
        Some(number.unwrap_or_default())
    }

    /// A number that may be infinite, if the attribute is present; unrealistically large ones
    /// become infinite. NaN, with a fault, if it is not a number.
    pub(super) fn wide(&self, node: Node<'_, '_>, attribute: &str) -> Option<f64> {
        let found = self.attribute(node, attribute)?;
        let number = found.1.trim().parse().ok().filter(|number: &f64| !number.is_nan());
        if number.is_none() {
            self.fault_at(node, attribute, &found, "a number");
        }
        let number = number.unwrap_or(f64::NAN);
        let is_large = number.abs() >= SIZE_MAX;
        Some(if is_large { f64::INFINITY.copysign(number) } else { number })
    }

    /// A finite number; `None`, without a fault, if it is missing or not finite.
    pub(super) fn finite(&self, node: Node<'_, '_>, attribute: &str) -> Option<f64> {
        let found = self.attribute(node, attribute)?;
        match found.1.trim().parse::<f64>() {
            Ok(number) => (number.abs() < SIZE_MAX).then_some(number),
            Err(_) => {
                self.fault_at(node, attribute, &found, "a number below 1e12");
                None
            }
        }
    }

    /// Three numbers; `None`, with a fault, if they are not numbers, and without one if the attribute is missing.
    pub(super) fn vector(&self, node: Node<'_, '_>, attribute: &str) -> Option<DVec3> {
        let found = self.attribute(node, attribute)?;
        let numbers: Option<Vec<f64>> = found.1.split_whitespace().map(number).collect();
        let vector = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
        if vector.is_none() {
            self.fault_at(node, attribute, &found, "three numbers below 1e12, separated by spaces");
        }
        vector.map(DVec3::from_array)
    }

    /// The pose of `<origin>`: child frame to parent frame, m; the identity without one.
    pub(super) fn origin(&self, node: Node<'_, '_>) -> Frame {
        let Some(origin) = child(node, "origin") else { return Frame::IDENTITY };
        if origin.has_attribute("quat_xyzw") {
            self.fault(
                origin,
                "uses `quat_xyzw`, which is not supported",
                "write the same rotation as rpy",
            );
        }
        let rotation = rpy::rotation(self.vector(origin, "rpy").unwrap_or_default());
        Frame::new(rotation, self.vector(origin, "xyz").unwrap_or_default())
    }
}

fn number(text: &str) -> Option<f64> {
    text.parse().ok().filter(|number: &f64| number.abs() < SIZE_MAX)
}

/// A xacro element, in a document that was not expanded.
pub(super) fn macro_of<'d, 's>(document: &'d Document<'s>) -> Option<Node<'d, 's>> {
    let bound = |attribute: roxmltree::Attribute<'_, '_>| {
        let prefix = attribute.name().strip_prefix("xmlns")?.strip_prefix(PREFIX_END)?;
        attribute.value().contains("xacro").then(|| prefix.to_owned())
    };
    let mut prefixes: Vec<String> =
        document.root_element().attributes().filter_map(bound).collect();
    prefixes.push("xacro".to_owned());
    document.descendants().find(|node| {
        let prefix = node.tag_name().name().split_once(PREFIX_END).map(|(prefix, _)| prefix);
        prefix.is_some_and(|prefix| prefixes.iter().any(|known| known == prefix))
    })
}
