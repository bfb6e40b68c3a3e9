//! Configurations of bridges, good and bad.

use super::*;
use proptest::prelude::*;

const EGM: &str = include_str!("../../../deploy/bridge-egm.toml");
const RSI: &str = include_str!("../../../deploy/bridge-rsi.toml");
const XML: &str = include_str!("../../../deploy/rsi-ethernet.xml");

fn ethernet(xml: &str) -> EthernetConfig {
    EthernetConfig::parse("ethernet.xml", xml).unwrap()
}

fn rsi(text: &str, xml: &str) -> Result<RsiConfig, Faults> {
    RsiConfig::parse("bridge.toml", text, ethernet(xml))
}

/// The message of a refusal; empty if there is none.
fn refusal_text<T>(parsed: Result<T, Faults>) -> String {
    parsed.err().map(|faults| faults.plain()).unwrap_or_default()
}

#[test]
fn the_examples_that_are_shipped_load() {
    let egm = EgmConfig::parse("bridge.toml", EGM).unwrap();
    assert_eq!((egm.listen.port(), egm.guidance), (6510, Guidance::Joints));
    assert_eq!((egm.path_period_s, egm.common.answer_within_s), (0.048, 0.001));
    assert_eq!(egm.common.run_ends_after_s, 1.0);
    assert_eq!((egm.force, egm.common.absolute_accuracy), (Some(CoordinateFrame::Tool), false));
    let rsi = rsi(RSI, XML).unwrap();
    assert_eq!((rsi.listen.port(), rsi.ethernet.sentype.as_str()), (49152, "Trued"));
    assert_eq!((rsi.others.len(), rsi.others[0].1, rsi.others[0].0.is_whole), (1, 0.0, true));
    assert!(matches!(&rsi.correction, RsiCorrection::Axes(group) if group.names.len() == 6));
}

#[test]
fn a_configuration_of_the_controller_in_latin_1_is_read_whether_it_says_so_or_not() {
    let folder = std::env::temp_dir().join(format!("trued-rsi-latin-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let body = XML.split_once("?>").map_or(XML, |(_, body)| body).trim_start();
    let heads =
        ["<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?>\n", "", "<?xml version=\"1.0\"?>\n"];
    for head in heads {
        let text = format!("{head}<!-- Schwei\u{df}zelle -- T\u{fc}r 3 -->\n{body}");
        // Latin-1: one byte per character; the examples have no higher ones.
        let bytes: Vec<u8> =
            text.chars().map(|c| u8::try_from(u32::from(c)).unwrap_or(b'?')).collect();
        std::fs::write(folder.join("rsi-ethernet.xml"), bytes).unwrap();
        std::fs::write(folder.join("bridge.toml"), RSI).unwrap();
        let config = RsiConfig::read(&folder.join("bridge.toml")).unwrap();
        assert_eq!(config.ethernet.sentype, "Trued");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn whether_the_controller_compensates_itself_is_required() {
    for text in [EGM, RSI] {
        let silent: Vec<&str> = text.lines().filter(|l| !l.starts_with("absolute_acc")).collect();
        let silent = silent.join("\n");
        let message = if text == EGM {
            refusal_text(EgmConfig::parse("b", &silent))
        } else {
            refusal_text(rsi(&silent, XML))
        };
        assert!(message.contains("`absolute_accuracy`: is missing"), "{message}");
    }
}

#[test]
fn every_fault_of_a_bridge_is_reported_at_once() {
    let text = "schema = \"trued.bridge-egm/1\"\ncell = \"c.toml\"\nabsolute_accuracy = \"of\"\nguidance = \"joints\"\n\
                [robot]\naddress = \"192.168.125\"\nlisten = \"6510\"\nseventh_after = 9\n[path]\nperiod_ms = 50\n[forse]\n";
    let message = refusal_text(EgmConfig::parse("bridge.toml", text));
    for part in [
        "bridge.toml:3:21",
        "did you mean \"off\"",
        "is \"192.168.125\"",
        "is \"6510\"",
        "from 1 to 6",
        "a multiple of 24 ms",
        "needs an application that streams targets",
        "`forse`",
    ] {
        assert!(message.contains(part), "{part} in\n{message}");
    }
}

#[test]
fn configurations_that_jump_or_drift_on_late_answers_are_refused() {
    let falls = XML.replacen("HOLDON=\"1\"", "HOLDON=\"0\"", 1);
    let message = refusal_text(rsi(RSI, &falls));
    assert!(
        message.contains("AKorr.A1 becomes zero") && message.contains("ethernet.xml line 18"),
        "{message}"
    );
    let relative = RSI.replace("sums = \"absolute\"", "sums = \"relative\"");
    assert!(refusal_text(rsi(&relative, XML)).contains("the robot drifts"));
    let all_fall = XML.replace("HOLDON=\"1\"", "HOLDON=\"0\"");
    assert!(rsi(&relative, &all_fall).is_ok());
    let untold = all_fall.replace("DEF_Delay", "DEF_Other");
    assert!(refusal_text(rsi(&relative, &untold)).contains("count of late replies"));
}

#[test]
fn missing_elements_of_the_controller_are_reported() {
    let message = refusal_text(rsi(RSI, &XML.replace("DEF_ASPos", "DEF_RIst")));
    assert!(message.contains("does not send ASPos"), "{message}");
    let message = refusal_text(rsi(&RSI.replace("DiO = 0", ""), XML));
    assert!(message.contains("has no value for DiO") && message.contains("line 24"), "{message}");
    let message = refusal_text(rsi(&RSI.replace("DiO = 0", "DiO = 0\nDiP = 1"), XML));
    assert!(message.contains("`others.DiP`"), "{message}");
    let message = refusal_text(rsi(RSI, &XML.replace("AKorr.A3", "AKorr.B3")));
    assert!(
        message.contains("does not receive AKorr.A3") && message.contains("no value for AKorr.B3"),
        "{message}"
    );
    let renamed_channels = XML.replace("DEF_ASPos", "Axes.A1").replace("DEF_AIPos", "Axes.A2");
    let named =
        RSI.replace("\"ASPos\"", "\"Axes\"").replacen(", \"A3\", \"A4\", \"A5\", \"A6\"", "", 1);
    assert_eq!(
        rsi(&named, &renamed_channels).unwrap().setpoint.names,
        ["A1", "A2"],
        "the site's own channels"
    );
}

#[test]
fn unreadable_answers_are_refused_by_configuration() {
    let twice = RSI.replace("\"A2\"", "\"A1\"");
    let message = refusal_text(rsi(&twice, XML));
    assert_eq!(message.matches("lists A1 twice").count(), 2, "setpoint and correction: {message}");
    let message = refusal_text(rsi(&RSI.replace("DiO", "IPOC"), &XML.replace("DiO", "IPOC")));
    assert!(message.contains("IPOC is listed in RECEIVE"), "{message}");
    for constant in ["nan", "-inf", "1e10"] {
        let message = refusal_text(rsi(&RSI.replace("DiO = 0", &format!("DiO = {constant}")), XML));
        assert!(message.contains("`others.DiO`: is not a number that can be sent"), "{message}");
    }
    let refusal_of = |xml: &str| refusal_text(EthernetConfig::parse("ethernet.xml", xml));
    assert!(refusal_of(&XML.replace("DiO", &"D".repeat(65))).contains("no valid TAG"));
    assert!(refusal_of(&XML.replace("Trued", &"T".repeat(65))).contains("up to 64 letters"));
    let channel = |k: usize| format!("<ELEMENT TAG=\"D{k}\" TYPE=\"DOUBLE\" INDX=\"{k}\" />\n");
    let many: String = (0..60).map(channel).collect();
    let xml = XML.replacen("<ELEMENT TAG=\"AKorr.A1\"", &(many + "<ELEMENT TAG=\"AKorr.A1\""), 1);
    assert!(refusal_of(&xml).contains("`RECEIVE`: has 67 channels"), "{}", refusal_of(&xml));
}

#[test]
fn a_configuration_of_the_controller_that_cannot_be_used_is_reported_with_its_line() {
    let refusal_of = |xml: &str| refusal_text(EthernetConfig::parse("ethernet.xml", xml));
    assert!(
        refusal_of(&XML.replace("FALSE", "TRUE"))
            .contains("the controller does not accept replies")
    );
    assert!(refusal_of(&XML.replace("49152", "x")).contains("ethernet.xml:5"));
    assert!(
        refusal_of(&XML.replace("<SEND>", "<SENT>").replace("</SEND>", "</SENT>"))
            .contains("`SEND`")
    );
    assert!(refusal_of(&XML.replace("AKorr.A2", "AKorr.A1")).contains("is defined twice"));
    assert!(refusal_of("<ROOT>").contains("is not valid XML"));
    assert!(refusal_of(&XML.replace("Trued", "a\"b")).contains("letters, digits"));
}

proptest! {
    #[test]
    fn no_text_makes_the_readers_panic(text in "\\PC{0,200}", offset in 0_usize..900, with in "\\PC{0,5}") {
        let spoil = |good: &str| {
            let offset = (0..=offset.min(good.len())).rev().find(|offset| good.is_char_boundary(*offset)).unwrap_or(0);
            format!("{}{with}{}", &good[..offset], &good[offset..])
        };
        let _ = EgmConfig::parse("x", &text);
        let _ = EgmConfig::parse("x", &spoil(EGM));
        let _ = rsi(&spoil(RSI), XML);
        let _ = rsi(&text, XML);
        let _ = EthernetConfig::parse("x", &spoil(XML));
        let _ = EthernetConfig::parse("x", &text);
    }
}

#[test]
fn the_override_of_the_feed_has_an_element_that_holds_and_needs_no_constant() {
    let with = |element: &str| {
        let receive = "<RECEIVE>\n      <ELEMENTS>";
        XML.replace(receive, &format!("{receive}\n         {element}"))
    };
    let text = RSI.replace("[others]", "[feed]\ntag = \"OvPro\"\n\n[others]");
    let held = with("<ELEMENT TAG=\"OvPro\" TYPE=\"LONG\" INDX=\"8\" HOLDON=\"1\" />");
    let config = rsi(&text, &held).unwrap();
    assert_eq!(config.feed.map(|feed| (feed.tag, feed.is_whole)), Some(("OvPro".to_owned(), true)));
    assert_eq!(config.others.len(), 1);
    let message = refusal_text(rsi(&text, XML));
    assert!(message.contains("is OvPro, which the controller does not receive"), "{message}");
    let falls = refusal_text(rsi(
        &text,
        &held.replace("INDX=\"8\" HOLDON=\"1\"", "INDX=\"8\" HOLDON=\"0\""),
    ));
    assert!(falls.contains("becomes zero if a reply is late"), "{falls}");
    let message = refusal_text(rsi(RSI, &held));
    assert!(message.contains("has no value for OvPro"), "{message}");
}
