//! A client that writes into its messages after it has sent them.

use super::chance;
use crate::TRUED;
use tests::pair::{JAM, recorder};
use tests::place::Place;
use tests::process::Process;
use tests::scribbler::Scribbler;

const MESSAGES: u64 = 1500;

#[test]
fn a_client_that_writes_into_its_sent_messages_breaks_no_bound() {
    let place = Place::new("full", &recorder("box"));
    let mut daemon = Process::daemon(TRUED, &place);
    assert!(daemon.says("ready", JAM), "{:?}", daemon.lines());
    let mut chance = chance();
    let mut client = Scribbler::join(&place, &daemon, chance.bits());
    let [said, written] = client.scribble(&daemon, MESSAGES, chance);
    println!("{said} answers looked at, {written} words written into {MESSAGES} messages");
    assert!(said > 100 && written > MESSAGES);
    assert!(daemon.is_running(), "{:#?}", daemon.lines());
    println!("corrected again after {:?}", client.corrected_again());
    drop(client);
    assert!(daemon.end().success(), "{:#?}", daemon.lines());
    assert_eq!(place.left(), Vec::<String>::new());
}
