//! A client that writes into its messages after it has sent them.

use super::chance;
use crate::TRUED;
use tests::message_corruptor::MessageCorruptor;
use tests::place::TestDirectory;
use tests::process::Process;
use tests::served_cell::{AWAIT_LIMIT, recorder};

const MESSAGES: u64 = 1500;

#[test]
fn a_client_that_writes_into_its_sent_messages_breaks_no_bound() {
    let place = TestDirectory::new("full", &recorder("box"));
    let mut daemon = Process::daemon(TRUED, &place);
    assert!(daemon.wait_for_output("ready", AWAIT_LIMIT), "{:?}", daemon.lines());
    let mut chance = chance();
    let mut client = MessageCorruptor::join(&place, &daemon, chance.next_u64());
    let [answers, written] = client.corrupt_messages(&daemon, MESSAGES, chance);
    println!("{answers} answers looked at, {written} words written into {MESSAGES} messages");
    assert!(answers > 100 && written > MESSAGES);
    assert!(daemon.is_running(), "{:#?}", daemon.lines());
    println!("corrected again after {:?}", client.wait_corrected());
    drop(client);
    assert!(daemon.end().success(), "{:#?}", daemon.lines());
    assert_eq!(place.remaining_names(), Vec::<String>::new());
}
