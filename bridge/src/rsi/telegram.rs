//! RSI telegrams: in-place reading of numbers, and writing of the answer.
//!
//! No allocation, no panic on any bytes. A telegram is XML without entities or CDATA sections;
//! other XML features are not supported.

use std::io::Write;

use recording::bridge::{Element, EthernetConfig, Group};

/// Largest number of values in a group.
pub const NUMBERS_MAX: usize = 6;
/// Largest number of digits of the controller's clock.
pub const IPOC_MAX: usize = 19;
/// Resolution of an answer, parts per degree or mm: finer than a robot resolves.
const PARTS_PER_UNIT: f64 = 1e6;

/// A telegram of the controller.
#[derive(Debug, Clone, Copy)]
pub struct Telegram<'a> {
    /// As received: text content may be in any encoding that extends ASCII.
    bytes: &'a [u8],
    /// The controller's clock, which is echoed.
    pub ipoc: &'a str,
}

impl<'a> Telegram<'a> {
    /// Reads a datagram; `None` if it is not a `<Rob>` with an `IPOC` of digits.
    #[must_use]
    pub fn read(datagram: &'a [u8]) -> Option<Self> {
        let end = datagram.iter().rposition(|byte| *byte != 0)?;
        let bytes = datagram.get(..=end)?.trim_ascii();
        element(bytes, "Rob")
            .filter(|_| bytes.starts_with(b"<Rob") && bytes.ends_with(b"</Rob>"))?;
        let (_, after) = split(bytes, b"<IPOC>")?;
        let (ipoc, _) = split(after, b"</IPOC>")?;
        let ipoc = text(ipoc.trim_ascii())?;
        let is_number =
            (1..=IPOC_MAX).contains(&ipoc.len()) && ipoc.bytes().all(|b| b.is_ascii_digit());
        is_number.then_some(Self { bytes, ipoc })
    }

    /// The values of a group, in the group's order; `None` if one is missing or not a number.
    #[must_use]
    pub fn numbers(&self, group: &Group) -> Option<[f64; NUMBERS_MAX]> {
        let head = element(self.bytes, &group.tag)?;
        let mut numbers = [0.0; NUMBERS_MAX];
        for (number, name) in numbers.iter_mut().zip(&group.names) {
            let value: f64 = attribute(head, name)?.parse().ok()?;
            *number = value;
        }
        numbers.iter().all(|number| number.is_finite()).then_some(numbers)
    }

    /// Number of late answers by the controller's own count, if stated.
    #[must_use]
    pub fn late_count(&self) -> Option<u64> {
        attribute(element(self.bytes, "Delay")?, "D")?.trim().parse().ok()
    }
}

fn text(bytes: &[u8]) -> Option<&str> {
    std::str::from_utf8(bytes).ok()
}

/// The text before and after the first `mark`.
fn split<'a>(bytes: &'a [u8], mark: &[u8]) -> Option<(&'a [u8], &'a [u8])> {
    let start = bytes.windows(mark.len()).position(|window| window == mark)?;
    Some((bytes.get(..start)?, bytes.get(start + mark.len()..)?))
}

/// The text between `<tag` and `>` of the first such element.
fn element<'a>(bytes: &'a [u8], tag: &str) -> Option<&'a [u8]> {
    let mut rest = bytes;
    loop {
        (_, rest) = split(rest, b"<")?;
        let head = rest.strip_prefix(tag.as_bytes());
        let ends = |byte: &u8| byte.is_ascii_whitespace() || matches!(byte, b'/' | b'>');
        if let Some(head) = head.filter(|head| head.first().is_some_and(ends)) {
            return split(head, b">").map(|(head, _)| head);
        }
    }
}

/// The value of an attribute; `None` if it is not valid text.
fn attribute<'a>(head: &'a [u8], name: &str) -> Option<&'a str> {
    let mut rest = head;
    loop {
        let (before, after) = split(rest, b"=")?;
        let after = after.trim_ascii_start();
        let quote = after.first().filter(|byte| matches!(byte, b'"' | b'\''))?;
        let (value, next) = split(after.get(1..)?, std::slice::from_ref(quote))?;
        if before.trim_ascii() == name.as_bytes() {
            return text(value);
        }
        rest = next;
    }
}

/// A value rounded as in an answer.
#[must_use]
pub fn rounded(value: f64) -> f64 {
    (value * PARTS_PER_UNIT).round() / PARTS_PER_UNIT
}

/// A number of an answer.
#[derive(Debug, Clone, Copy)]
enum Placeholder {
    /// A component of the correction, by its index in the group.
    Correction(usize),
    /// The feed override, percent.
    Feed { is_whole: bool },
}

/// The text of the answer, without its numbers and the `IPOC`.
#[derive(Debug, Clone)]
pub struct AnswerTemplate {
    /// Text before each number, and the number's meaning.
    numbers: Vec<(String, Placeholder)>,
    /// Text after the last number, up to the `IPOC`.
    tail: String,
}

impl AnswerTemplate {
    /// The answer to this controller: `own` and the feed override change, `others` are constant.
    #[must_use]
    pub fn new(
        ethernet: &EthernetConfig,
        correction_group: &Group,
        feed: Option<&Element>,
        others: &[(Element, f64)],
    ) -> Self {
        let mut form =
            Self { numbers: Vec::new(), tail: format!("<Sen Type=\"{}\">", ethernet.sentype) };
        let mut done: Vec<&str> = Vec::new();
        for element in ethernet.receive.iter().filter(|element| !element.is_internal) {
            let head = element.tag.split('.').next().unwrap_or_default();
            if done.contains(&head) {
                continue;
            }
            done.push(head);
            form.element(ethernet, head, correction_group, feed, others);
        }
        form.tail += "<IPOC>";
        form
    }

    /// One element with all its attributes, in the controller's order.
    fn element(
        &mut self,
        ethernet: &EthernetConfig,
        head: &str,
        correction_group: &Group,
        feed: Option<&Element>,
        others: &[(Element, f64)],
    ) {
        let override_of = |tag: &str| {
            let feed = feed.filter(|feed| feed.tag == tag)?;
            Some(Placeholder::Feed { is_whole: feed.is_whole })
        };
        let constant = |tag: &str| others.iter().find(|(element, _)| element.tag == tag);
        let of_head = ethernet.receive.iter().filter_map(|element| {
            element.tag.split_once('.').filter(|(group, _)| *group == head).map(|(_, name)| name)
        });
        let names: Vec<&str> = of_head.collect();
        if names.is_empty() {
            if let Some(number) = override_of(head) {
                self.tail += &format!("<{head}>");
                self.numbers.push((std::mem::take(&mut self.tail), number));
                self.tail = format!("</{head}>");
            } else if let Some((element, value)) = constant(head) {
                self.tail += &format!("<{head}>{}</{head}>", formatted(element, *value));
            }
            return;
        }
        self.tail += &format!("<{head}");
        for name in names {
            let place = correction_group
                .names
                .iter()
                .position(|one| one == name)
                .filter(|_| correction_group.tag == head);
            self.tail += &format!(" {name}=\"");
            let tag = format!("{head}.{name}");
            let number = place.map(Placeholder::Correction).or_else(|| override_of(&tag));
            match (number, constant(&tag)) {
                (Some(number), _) => self.numbers.push((std::mem::take(&mut self.tail), number)),
                (None, Some((element, value))) => self.tail += &formatted(element, *value),
                (None, None) => self.tail.push('0'),
            }
            self.tail.push('"');
        }
        self.tail += " />";
    }

    /// Writes the answer with a correction and a feed override, 0 to 1; returns its length, `None`
    /// if `to` is too short.
    #[must_use]
    pub fn write(
        &self,
        to: &mut [u8],
        numbers: &[f64; NUMBERS_MAX],
        feed_override: f64,
        ipoc: &str,
    ) -> Option<usize> {
        let room = to.len();
        let mut rest = to;
        for (text, number) in &self.numbers {
            rest.write_all(text.as_bytes()).ok()?;
            match *number {
                Placeholder::Correction(place) => write!(rest, "{:.6}", numbers.get(place)?),
                Placeholder::Feed { is_whole: true } => {
                    write!(rest, "{:.0}", whole_percent(feed_override))
                }
                Placeholder::Feed { is_whole: false } => write!(rest, "{:.6}", 1e2 * feed_override),
            }
            .ok()?;
        }
        rest.write_all(self.tail.as_bytes()).ok()?;
        rest.write_all(ipoc.as_bytes()).ok()?;
        rest.write_all(b"</IPOC></Sen>").ok()?;
        Some(room - rest.len())
    }
}

/// A share in whole percent, rounded down: the feed is never above the override. Tolerates rounding
/// of 1e-9 percent.
fn whole_percent(share: f64) -> f64 {
    (1e2 * share + 1e-9).floor()
}

fn formatted(element: &Element, value: f64) -> String {
    if element.is_whole { format!("{value:.0}") } else { format!("{value:.6}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROB: &str = "<Rob Type=\"KUKA\"><ASPosX A1=\"9\"/><ASPos A1=\"1.5\" A2='-2' A3=\"3e0\" />\
                       <Delay D=\"4\" /><IPOC>0012345</IPOC></Rob>";

    fn group(names: &[&str]) -> Group {
        Group { tag: "ASPos".to_owned(), names: names.iter().map(|n| (*n).to_owned()).collect() }
    }

    #[test]
    fn numbers_are_found_by_their_names_and_the_clock_as_it_is_written() {
        let telegram = Telegram::read(ROB.as_bytes()).unwrap();
        assert_eq!(telegram.ipoc, "0012345");
        assert_eq!(telegram.late_count(), Some(4));
        let numbers = telegram.numbers(&group(&["A3", "A1", "A2"])).unwrap();
        assert_eq!(numbers[..3], [3.0, 1.5, -2.0]);
        assert!(telegram.numbers(&group(&["A1", "A4"])).is_none());
    }

    #[test]
    fn text_in_any_encoding_does_not_hide_the_numbers_behind_it() {
        let messages: [&[u8]; 4] =
            [b"Stra\xdfe \xfc", "Straße ü 点".as_bytes(), b"\x82\xa0\xff\xfe", b"\xc3"];
        for message in messages {
            let (head, tail) = ROB.split_once("<ASPosX").unwrap();
            let attribute = [b"<EStr Text=\"", message, b"\" />"].concat();
            let content = [b"<EStr>", message, b"</EStr>"].concat();
            for element in [attribute, content] {
                let datagram =
                    [head.as_bytes(), &element, b"<ASPosX", tail.as_bytes(), b"\r\n\0\0"].concat();
                let telegram = Telegram::read(&datagram).unwrap();
                assert_eq!((telegram.ipoc, telegram.late_count()), ("0012345", Some(4)));
                let numbers = telegram.numbers(&group(&["A3", "A1", "A2"])).unwrap();
                assert_eq!(numbers[..3], [3.0, 1.5, -2.0]);
            }
        }
    }

    #[test]
    fn whole_percents_are_rounded_down_and_those_that_are_whole_stay() {
        for percent in 1..=100 {
            assert_eq!(whole_percent(f64::from(percent) * 1e-2), f64::from(percent));
            assert_eq!(whole_percent(f64::from(percent) * 1e-2 - 1e-6), f64::from(percent - 1));
        }
    }

    #[test]
    fn the_feed_override_is_an_element_or_an_attribute_and_whole_where_the_controller_wants_it() {
        for (tag, kind, written) in [
            ("OvPro", "LONG", "<OvPro>41</OvPro>"),
            ("OvPro", "DOUBLE", "<OvPro>41.900000</OvPro>"),
            ("Feed.Ov", "LONG", "<Feed Ov=\"41\" />"),
        ] {
            let xml = format!(
                "<ROOT><CONFIG><IP_NUMBER>192.168.1.10</IP_NUMBER><PORT>49152</PORT><SENTYPE>T</SENTYPE></CONFIG>\
                 <SEND><ELEMENTS /></SEND><RECEIVE><ELEMENTS>\
                 <ELEMENT TAG=\"AKorr.A1\" TYPE=\"DOUBLE\" INDX=\"1\" HOLDON=\"1\" />\
                 <ELEMENT TAG=\"{tag}\" TYPE=\"{kind}\" INDX=\"2\" HOLDON=\"1\" />\
                 </ELEMENTS></RECEIVE></ROOT>"
            );
            let ethernet = EthernetConfig::parse("rsi.xml", &xml).unwrap();
            let correction_group = Group { tag: "AKorr".to_owned(), names: vec!["A1".to_owned()] };
            let form =
                AnswerTemplate::new(&ethernet, &correction_group, ethernet.find_received(tag), &[]);
            let mut to = [0; 500];
            let length = form.write(&mut to, &[0.25; NUMBERS_MAX], 0.419, "7").unwrap();
            let text = std::str::from_utf8(&to[..length]).unwrap();
            assert!(text.contains(written) && text.contains("A1=\"0.250000\""), "{text}");
        }
    }

    #[test]
    fn invalid_telegrams_are_not_read() {
        let no_clock = ROB.replace("0012345", "12x");
        let torn = &ROB[..ROB.len() - 3];
        for text in ["", "<Rob", "<Robot><IPOC>1</IPOC></Rob>", &no_clock, torn, "\u{0}"] {
            assert!(Telegram::read(text.as_bytes()).is_none(), "{text}");
        }
        assert!(Telegram::read(&[0xff, b'<']).is_none());
        let nan = ROB.replace("1.5", "nan");
        let telegram = Telegram::read(nan.as_bytes()).unwrap();
        assert!(telegram.numbers(&group(&["A1"])).is_none(), "no number");
    }
}
