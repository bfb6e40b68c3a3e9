//! RSI: a controller that checks every answer.

use super::{LIMIT, WIDE, corrected, count, daemon, ended, peer, peers, place};
use crate::TRUED;
use std::net::UdpSocket;
use tests::clients::figures;
use tests::egm::bridge;
use tests::place::TestDirectory;

const CYCLES: &str = "10000";
/// What a correction may move by from one telegram to the next, deg: the envelope's rate for the longest step of a ramp, 0.1 s.
const STEP_DEG: f64 = 0.06;
/// Resolution of the answers, and of the emulator's telegrams (0.01 deg) times the change of the
/// correction.
const RESOLUTION_DEG: f64 = 2e-4;

/// A site's configuration: one port, the setpoints out, axis corrections in, and an output with
/// another owner.
fn ethernet(port: u16) -> String {
    ethernet_of(port, &["A1", "A2", "A3", "A4", "A5", "A6"].map(|axis| format!("AKorr.{axis}")), 1)
}

/// The same with these corrections, which stay where an answer is late, or fall to zero.
pub(super) fn ethernet_of(port: u16, corrections: &[String; 6], hold_on: u8) -> String {
    let element = |(i, tag): (usize, &String)| {
        let i = i + 1;
        format!("<ELEMENT TAG=\"{tag}\" TYPE=\"DOUBLE\" INDX=\"{i}\" HOLDON=\"{hold_on}\" />\n")
    };
    let axes: String = corrections.iter().enumerate().map(element).collect();
    format!(
        "<ROOT>\n<CONFIG><IP_NUMBER>127.0.0.1</IP_NUMBER><PORT>{port}</PORT><SENTYPE>Trued</SENTYPE>\
         <ONLYSEND>FALSE</ONLYSEND></CONFIG>\n<SEND><ELEMENTS>\n\
         <ELEMENT TAG=\"DEF_AIPos\" TYPE=\"DOUBLE\" INDX=\"INTERNAL\" />\n\
         <ELEMENT TAG=\"DEF_ASPos\" TYPE=\"DOUBLE\" INDX=\"INTERNAL\" />\n\
         <ELEMENT TAG=\"DEF_Delay\" TYPE=\"LONG\" INDX=\"INTERNAL\" />\n\
         </ELEMENTS></SEND>\n<RECEIVE><ELEMENTS>\n{axes}\
         <ELEMENT TAG=\"DiO\" TYPE=\"LONG\" INDX=\"7\" HOLDON=\"1\" />\n</ELEMENTS></RECEIVE>\n</ROOT>\n"
    )
}

const BRIDGE: &str = "schema = \"trued.bridge-rsi/1\"\ncell = \"cell.toml\"\nabsolute_accuracy = \"off\"\n\
    ethernet = \"ethernet.xml\"\n[robot]\naddress = \"127.0.0.1\"\n[setpoint]\nholds_correction = true\n\
    [correction]\nkind = \"axes\"\nsums = \"absolute\"\n[others]\nDiO = 5\n";

/// The emulator sends its axes with two decimals, too few to determine the direction of slow ones:
/// the model has no backlash.
fn without_play(place: &TestDirectory) {
    let model = std::fs::read_to_string(place.file("model.toml")).unwrap();
    let has_play =
        |effect: &&str| ["backlash", "hysteresis"].iter().any(|kind| effect.contains(kind));
    let mut parts = model.split("[[effect]]");
    let head = parts.next().unwrap().to_owned();
    let kept = parts.filter(|effect| !has_play(effect)).map(|effect| format!("[[effect]]{effect}"));
    place.write("model.toml", &(head + &kept.collect::<String>()));
}

#[test]
fn an_independent_controller_finds_no_fault_in_ten_thousand_answers_and_no_jump_when_some_are_late()
{
    let Some(python) = peers("RSIPI's controller before the RSI bridge") else { return };
    let place =
        place("[envelope]\nrate_mrad_s = 10.0\n[cycle]\nperiod_ms = 0.5\nstale_ms = 200.0\n");
    without_play(&place);
    let _daemon = daemon(&place);
    let port = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    place.write("ethernet.xml", &ethernet(port));
    let (bridge, _) = bridge(TRUED, &[], "rsi", &place, BRIDGE);
    assert!(bridge.wait_for_output("connected to the daemon", LIMIT), "{:#?}", bridge.lines());
    let mut controller = std::process::Command::new(python);
    controller.arg(peer("rsi_controller.py")).arg(place.file("ethernet.xml")).arg(CYCLES);
    controller.arg(bridge.id().to_string()).current_dir(place.root());
    let output = controller.output().unwrap();
    let results = figures(&output);
    println!("{results:#?}");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let number = |name: &str| results[name].parse::<f64>().unwrap();
    let list =
        |name: &str| -> Vec<f64> { results[name].split(' ').map(|n| n.parse().unwrap()).collect() };
    assert_eq!((number("accepted"), number("faulty")), (10_000.0, 0.0));
    let (setpoint, correction) = (list("setpoint"), list("correction"));
    let wanted = corrected(&place, &vec![setpoint.clone(); 1000]).pop().unwrap();
    for i in 0..6 {
        let error_deg = correction[i] - (wanted[i] - setpoint[i]);
        assert!(error_deg.abs() < RESOLUTION_DEG, "axis {}: {error_deg} deg off", i + 1);
    }
    assert!(correction.iter().any(|c| c.abs() > 0.05), "{correction:?}");
    assert_eq!(number("twice_accepted"), 1.0);
    assert_eq!(number("foreign_answered"), 0.0);
    assert_eq!((number("after_garbage_accepted"), number("after_garbage_faulty")), (50.0, 0.0));
    assert!(number("late_faulty") >= 1.0, "some answers were late");
    assert_eq!(number("late_accepted"), 200.0);
    assert!(number("largest_jump") < STEP_DEG, "{} deg", number("largest_jump"));
    assert!(number("late_jump") < STEP_DEG, "{} deg", number("late_jump"));
    assert!(number("dead_jump") < 1e-9 && number("running") == 1.0);
}

#[test]
fn a_bridge_prints_its_counts_when_it_ends() {
    let place = place(WIDE.trim_end());
    place.write("ethernet.xml", &ethernet(0x1000));
    let text = BRIDGE.replace("[setpoint]", "listen = \"127.0.0.1:0\"\n[setpoint]");
    let cell = std::fs::read_to_string(place.file("cell.toml")).unwrap();
    place.write("cell.toml", &format!("{cell}\n[cycle]\nperiod_ms = 4.0\nstale_ms = 200.0\n"));
    // No daemon: zeros are answered all the same.
    let (mut bridge, address) = bridge(TRUED, &[], "rsi", &place, &text);
    let robot = tests::egm::socket();
    let telegram = |ipoc: u32| {
        format!(
            "<Rob Type=\"KUKA\"><ASPos A1=\"1\" A2=\"2\" A3=\"3\" A4=\"4\" A5=\"5\" A6=\"6\" /><IPOC>{ipoc}</IPOC></Rob>"
        )
    };
    for ipoc in [1000, 1004, 1008] {
        robot.send_to(telegram(ipoc).as_bytes(), address).unwrap();
        let (answer, _) = tests::egm::receive_datagram(&robot).unwrap();
        let zeros: String = (1..=6).map(|i| format!(" A{i}=\"0.000000\"")).collect();
        let wanted =
            format!("<Sen Type=\"Trued\"><AKorr{zeros} /><DiO>5</DiO><IPOC>{ipoc}</IPOC></Sen>");
        assert_eq!(String::from_utf8(answer).unwrap(), wanted);
    }
    assert_eq!(count(&ended(&mut bridge), "answers to the robot"), 3, "{:#?}", bridge.lines());
}
