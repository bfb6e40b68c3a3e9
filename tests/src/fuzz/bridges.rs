//! Controller protocols and bridge configurations: accepted input is complete and written correctly.
//!
//! No sockets, no daemon; the handling of corrections is tested in the bridges' own tests.

use bridge::egm::joints::JointOrder;
use bridge::egm::messages::{
    Header, JointValues, PathCorrMessage, Posture, RobotMessage, SensorMessage,
};
use bridge::rsi::telegram::{AnswerTemplate, IPOC_MAX, NUMBERS_MAX, Telegram, rounded};
use recording::bridge::{EgmConfig, EthernetConfig, Group, RsiConfig, RsiCorrection};
use std::sync::LazyLock;

use super::files::{NAME, shown, text};

/// Largest datagram received or sent by a bridge.
const DATAGRAM_MAX: usize = 16_384;
/// No correction is as large, degrees or mm.
const NUMBERS: [f64; NUMBERS_MAX] = [-999.999_999, 0.0, 0.000_001, -0.25, 1e5, 12.5];

static RSI: LazyLock<RsiConfig> = LazyLock::new(|| {
    let xml = include_str!("../../../deploy/rsi-ethernet.xml");
    let ethernet = EthernetConfig::parse(NAME, xml).expect("the house's own example");
    let text = include_str!("../../../deploy/bridge-rsi.toml");
    RsiConfig::parse(NAME, text, ethernet).expect("the house's own example")
});

fn correction_group(config: &RsiConfig) -> &Group {
    match &config.correction {
        RsiCorrection::Axes(group) | RsiCorrection::Pose(group, _) => group,
    }
}

/// A telegram: its values are numbers, and its clock is echoed digit by digit.
pub(super) fn rsi(bytes: &[u8]) {
    let Some(telegram) = Telegram::read(bytes) else { return };
    assert!(telegram.ipoc.parse::<u64>().is_ok(), "{}", telegram.ipoc);
    let _ = telegram.late_count();
    let mut numbers = NUMBERS;
    if let Some(read) = telegram.numbers(&RSI.setpoint) {
        assert!(read.iter().all(|number| number.is_finite()), "{read:?}");
        numbers = read.map(|number| number.clamp(-1e3, 1e3));
    }
    answered(&RSI, &numbers, telegram.ipoc);
}

/// An answer fits, or there is none; read like its receiver, it has the intended content.
fn answered(config: &RsiConfig, numbers: &[f64; NUMBERS_MAX], ipoc: &str) {
    let correction_group = correction_group(config);
    let form = AnswerTemplate::new(
        &config.ethernet,
        correction_group,
        config.feed.as_ref(),
        &config.others,
    );
    let mut to = vec![0; DATAGRAM_MAX];
    let length = form.write(&mut to, numbers, 0.5, ipoc).expect("it fits into a datagram");
    assert_eq!(
        form.write(&mut to[..length - 1], numbers, 0.5, ipoc),
        None,
        "half an answer is none"
    );
    let answer = std::str::from_utf8(&to[..length]).expect("text");
    let as_sent = answer.replacen("<Sen", "<Rob", 1).replace("</Sen>", "</Rob>");
    let received = Telegram::read(as_sent.as_bytes()).expect("as well-formed as the controller's");
    assert_eq!(received.ipoc, ipoc, "{answer}");
    let received = received.numbers(correction_group).expect("every number under its name");
    for (i, name) in correction_group.names.iter().enumerate() {
        let (received, meant) = (received[i].to_bits(), rounded(numbers[i]).to_bits());
        assert_eq!(received, meant, "{name} in {answer}");
    }
}

/// An EGM datagram; the first byte selects the message.
pub(super) fn egm(bytes: &[u8]) {
    let Some((kind, datagram)) = bytes.split_first() else { return };
    match kind % 3 {
        0 => {
            let Ok(message) = RobotMessage::read(datagram) else { return };
            let read = |datagram: &[u8]| RobotMessage::read(datagram).map(|again| again.planned);
            posture(datagram, &message.planned, read);
            let read = |datagram: &[u8]| RobotMessage::read(datagram).map(|again| again.feedback);
            posture(datagram, &message.feedback, read);
            let _ = message.force.wrench();
        }
        1 => {
            let Ok(message) = SensorMessage::read(datagram) else { return };
            let read = |datagram: &[u8]| SensorMessage::read(datagram).map(|again| again.planned);
            posture(datagram, &message.planned, read);
        }
        _ => {
            let Ok(message) = PathCorrMessage::read(datagram) else { return };
            own_answer(message.header);
            let Some(offset) = message.offset else { return };
            let mut changed = datagram.to_vec();
            offset.put(&mut changed, [1.0, 2.0, 3.0]);
            let again = PathCorrMessage::read(&changed).expect("as well-formed as before");
            assert_eq!(again.offset.map(|offset| offset.mm), Some([1.0, 2.0, 3.0]));
            offset.put(&mut changed, offset.mm);
            assert_eq!(changed, datagram, "nothing else was touched");
        }
    }
}

/// Joints are numbers or missing; changed in place they are read as changed, and nothing else
/// changes.
fn posture<E: std::fmt::Debug>(
    datagram: &[u8],
    posture: &Posture,
    read: impl Fn(&[u8]) -> Result<Posture, E>,
) {
    let joints = posture.joints.values().len();
    for seventh_after in [None, Some(2)] {
        let order =
            JointOrder { count: joints + usize::from(seventh_after.is_some()), seventh_after };
        if let Some(q) = order.rad(posture) {
            assert!(q.iter().all(|q| q.is_finite()), "{q:?}");
        }
        let mut changed = datagram.to_vec();
        order.write_joints(&mut changed, posture, |i, _| i as f64);
        let again = read(&changed).expect("as well-formed as before");
        let count = order.count.min(trued_client::JOINTS_MAX);
        let is_whole = seventh_after.is_none() || !posture.external.values().is_empty();
        if let Some(q) = order.rad(&again).filter(|_| is_whole) {
            assert!((0..count).all(|i| q[i] == (i as f64).to_radians()), "{q:?}");
        }
        back(&mut changed, &posture.joints);
        back(&mut changed, &posture.external);
        assert_eq!(changed, datagram, "nothing else was touched");
    }
}

fn back(datagram: &mut [u8], numbers: &JointValues) {
    numbers.write(datagram, numbers.values());
}

/// What the bridge itself writes, it reads.
fn own_answer(header: Header) {
    let mut to = [0; 128];
    let length = PathCorrMessage::write(&mut to, header, [0.0, -1.5, 2.5], 4).expect("it fits");
    let again = PathCorrMessage::read(&to[..length]).expect("a message");
    assert_eq!((again.header, again.offset.map(|o| o.mm)), (header, Some([0.0, -1.5, 2.5])));
}

/// A bridge's configuration, followed by a form feed and the controller's own.
pub(super) fn config(bytes: &[u8]) {
    let Some(text) = text(bytes) else { return };
    let Some((text, xml)) = text.split_once('\u{c}') else {
        let Some(config) = shown(EgmConfig::parse(NAME, &text)) else { return };
        assert!((5e-5..=0.1).contains(&config.common.answer_within_s));
        assert!((0.024..=1.0).contains(&config.path_period_s));
        return;
    };
    let Some(ethernet) = shown(EthernetConfig::parse(NAME, xml)) else { return };
    let Some(config) = shown(RsiConfig::parse(NAME, text, ethernet)) else { return };
    assert!((5e-5..=0.1).contains(&config.common.answer_within_s));
    assert!((1..=NUMBERS_MAX).contains(&config.setpoint.names.len()));
    answered(&config, &NUMBERS, &"9".repeat(IPOC_MAX));
}
