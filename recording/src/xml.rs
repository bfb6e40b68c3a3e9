//! XML as written in practice: any declared encoding, and the deviations that `TinyXML` accepts.
//!
//! Valid XML keeps its meaning; [`relaxed`] keeps every byte position, so that faults point into
//! the original text; time and memory are linear in the length. Entities of a DOCTYPE are not
//! expanded.

use std::path::Path;

use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};

use crate::faults::{Fault, Faults};
use crate::files::FileError;

/// An XML declaration is within this number of bytes.
const DECLARATION_MAX: usize = 256;
/// Replaces the colon of a prefix in the names of [`relaxed`]: a character that is valid in a name.
pub(crate) const PREFIX_END: char = '.';

/// A text that was decoded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Decoded {
    /// The text, without a byte-order mark.
    pub text: String,
    /// The assumed encoding, if the file has no declaration or does not follow it.
    pub assumed: Option<&'static str>,
}

/// The text of an XML file.
///
/// # Errors
/// The file cannot be read, or declares an encoding that is unknown or that its bytes do not follow.
pub(crate) fn read(path: &Path) -> Result<Decoded, FileError> {
    let bytes = std::fs::read(path).map_err(FileError::io("read", path))?;
    Ok(decode(&path.display().to_string(), &bytes)?)
}

/// Bytes as text: by the byte-order mark, otherwise by the declaration, otherwise UTF-8, otherwise
/// Windows-1252.
///
/// # Errors
/// An unknown encoding, or bytes that are not valid in it.
pub(crate) fn decode(name: &str, bytes: &[u8]) -> Result<Decoded, Faults> {
    let refuse = |message: String, help: &str| {
        let mut faults = Faults::new(name);
        faults.push(Fault::new("", message).help(help));
        Err(faults)
    };
    let declared = declared(bytes);
    let wide = match bytes {
        [b'<', 0, ..] => Some(UTF_16LE),
        [0, b'<', ..] => Some(UTF_16BE),
        _ => None,
    };
    let marked = Encoding::for_bom(bytes).map(|(encoding, _)| encoding).or(wide);
    let encoding = match (marked, &declared) {
        (Some(encoding), _) => encoding,
        (None, None) => UTF_8,
        (None, Some(label)) => match Encoding::for_label(label.as_bytes()) {
            // A declaration that can be read byte by byte is not in UTF-16, whatever it says.
            Some(encoding) if encoding == UTF_16LE || encoding == UTF_16BE => UTF_8,
            Some(encoding) => encoding,
            None => {
                let message = format!("declares the unknown encoding \"{label}\"");
                return refuse(message, "save the file as UTF-8");
            }
        },
    };
    let (text, _, is_broken) = encoding.decode(bytes);
    if !is_broken {
        return Ok(Decoded { text: text.into_owned(), assumed: None });
    }
    if encoding == UTF_8 && marked.is_none() {
        let (text, _, _) = WINDOWS_1252.decode(bytes);
        return Ok(Decoded { text: text.into_owned(), assumed: Some(WINDOWS_1252.name()) });
    }
    let message = format!("is not valid text in its encoding, {}", encoding.name());
    refuse(message, "save the file as UTF-8")
}

/// The encoding that the declaration names.
fn declared(bytes: &[u8]) -> Option<String> {
    let head = bytes.get(..bytes.len().min(DECLARATION_MAX))?.trim_ascii_start();
    let head = String::from_utf8_lossy(head);
    let (declaration, _) = head.strip_prefix("<?xml")?.split_once("?>")?;
    let (_, after) = declaration.split_once("encoding")?;
    let after = after.trim_start().strip_prefix('=')?.trim_start();
    let quote = after.chars().next().filter(|c| matches!(c, '"' | '\''))?;
    after.get(1..)?.split_once(quote).map(|(label, _)| label.trim().to_owned())
}

/// The text with the same byte positions, in which declarations, DOCTYPE and comments are blank and prefixes are part of
/// the name: `<a:b c:d="e:f"/>` is `<a.b c.d="e:f"/>`.
pub(crate) fn relaxed(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(index) = rest.find('<') {
        let (before, tag) = rest.split_at(index);
        out.push_str(before);
        let (taken, is_kept) = extent(tag);
        let (markup, after) = tag.split_at(taken);
        match is_kept {
            MarkupHandling::Whole => out.push_str(markup),
            MarkupHandling::Nothing => blank(&mut out, markup),
            MarkupHandling::WithoutPrefixes => unprefixed(&mut out, markup),
        }
        rest = after;
    }
    out.push_str(rest);
    out
}

enum MarkupHandling {
    Whole,
    Nothing,
    WithoutPrefixes,
}

/// How long the markup is that `text` begins with; to the end where it is not closed.
fn extent(text: &str) -> (usize, MarkupHandling) {
    let upto = |end: &str, from: usize| {
        text.get(from..).and_then(|rest| rest.find(end)).map(|index| from + index + end.len())
    };
    let whole = text.len();
    if text.starts_with("<!--") {
        // Unclosed parts are refused by the parser.
        upto("-->", 4)
            .map_or((whole, MarkupHandling::Whole), |length| (length, MarkupHandling::Nothing))
    } else if text.starts_with("<![CDATA[") {
        (upto("]]>", 9).unwrap_or(whole), MarkupHandling::Whole)
    } else if text.starts_with("<?") {
        upto("?>", 2)
            .map_or((whole, MarkupHandling::Whole), |length| (length, MarkupHandling::Nothing))
    } else if text.starts_with("<!") {
        closed(text)
            .map_or((whole, MarkupHandling::Whole), |length| (length, MarkupHandling::Nothing))
    } else {
        closed(text).map_or((whole, MarkupHandling::Whole), |length| {
            (length, MarkupHandling::WithoutPrefixes)
        })
    }
}

/// The length up to the `>` outside quotes and brackets.
fn closed(text: &str) -> Option<usize> {
    let mut quote = None;
    let mut depth = 0_usize;
    for (index, byte) in text.bytes().enumerate() {
        match (quote, byte) {
            (Some(open), _) if open == byte => quote = None,
            (Some(_), _) => {}
            (None, b'"' | b'\'') => quote = Some(byte),
            (None, b'[') => depth += 1,
            (None, b']') => depth = depth.saturating_sub(1),
            (None, b'>') if depth == 0 => return Some(index + 1),
            (None, _) => {}
        }
    }
    None
}

fn blank(out: &mut String, markup: &str) {
    // One space for every byte of a character, so that positions stay.
    for c in markup.chars() {
        match c {
            '\n' | '\r' | '\t' => out.push(c),
            _ => out.extend(std::iter::repeat_n(' ', c.len_utf8())),
        }
    }
}

fn unprefixed(out: &mut String, markup: &str) {
    let mut quote = None;
    for c in markup.chars() {
        match quote {
            Some(open) if open == c => quote = None,
            Some(_) => {}
            None if matches!(c, '"' | '\'') => quote = Some(c),
            None if c == ':' => {
                out.push(PREFIX_END);
                continue;
            }
            None => {}
        }
        out.push(c);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn decoded(bytes: &[u8]) -> String {
        decode("x", bytes).unwrap().text
    }

    #[test]
    fn every_declared_encoding_and_every_byte_order_mark_gives_the_same_text() {
        let text =
            |label: &str| format!("<?xml version=\"1.0\" encoding='{label}'?><a b=\"Größe\"/>");
        for label in ["ISO-8859-1", "latin1", "windows-1252", "iso-8859-15"] {
            let bytes: Vec<u8> = text(label).chars().map(|c| c as u8).collect();
            assert_eq!(decoded(&bytes), text(label));
        }
        let wide = text("UTF-16");
        let units = || wide.encode_utf16().collect::<Vec<u16>>();
        let little: Vec<u8> = units().iter().flat_map(|unit| unit.to_le_bytes()).collect();
        let big: Vec<u8> = units().iter().flat_map(|unit| unit.to_be_bytes()).collect();
        assert_eq!(decoded(&[&[0xff, 0xfe], &little[..]].concat()), wide);
        assert_eq!(decoded(&[&[0xfe, 0xff], &big[..]].concat()), wide);
        assert_eq!((decoded(&little), decoded(&big)), (wide.clone(), wide.clone()));
        assert_eq!(decoded(format!("\u{feff}{wide}").as_bytes()), wide);
    }

    #[test]
    fn bytes_that_follow_no_declaration_are_windows_1252_and_that_is_reported() {
        for head in ["", "<?xml version='1.0' encoding='UTF-8'?>"] {
            let found = decode("x", &[head.as_bytes(), b"<a>\x84 \xfc</a>"].concat()).unwrap();
            assert_eq!(found.text, format!("{head}<a>„ ü</a>"));
            assert_eq!(found.assumed, Some("windows-1252"));
        }
        assert_eq!(decode("x", "<a>ü</a>".as_bytes()).unwrap().assumed, None);
        let unknown = decode("x", b"<?xml version='1.0' encoding='klingon'?><a/>").unwrap_err();
        assert!(unknown.plain().contains("unknown encoding \"klingon\""));
        let torn = decode("x", b"\xff\xfe<\x00a").unwrap_err().plain();
        assert!(torn.contains("is not valid text in its encoding, UTF-16LE"), "{torn}");
    }

    #[test]
    fn comments_doctypes_and_prefixes_that_a_strict_parser_refuses_are_read() {
        let text = "\n<!-- a -- b ---><?xml version='1.0'?><!DOCTYPE r [<!ENTITY a \"]>\">]>\n\
                    <r x:y='p:q' z=\"a>b\"><n:m/><![CDATA[<u:v>]]></r><!-- ü -->";
        let relaxed = relaxed(text);
        assert_eq!(relaxed.len(), text.len());
        let document = roxmltree::Document::parse(&relaxed).unwrap();
        let root = document.root_element();
        assert_eq!((root.attribute("x.y"), root.attribute("z")), (Some("p:q"), Some("a>b")));
        assert_eq!(root.first_element_child().unwrap().tag_name().name(), "n.m");
        assert_eq!(root.last_child().unwrap().text(), Some("<u:v>"));
        assert_eq!(root.range().start, text.find("<r x").unwrap());
    }

    proptest! {
        #[test]
        fn positions_of_any_text_stay(text in "[<>!\\-\\[\\]CDAT?:'\" aü\n]{0,60}") {
            let relaxed = relaxed(&text);
            prop_assert_eq!(relaxed.len(), text.len());
            let places = |text: &str| text.match_indices('\n').map(|(index, _)| index).collect::<Vec<_>>();
            prop_assert_eq!(places(&relaxed), places(&text));
        }
    }
}
