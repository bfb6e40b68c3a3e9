//! Content of the files, read by the container's own reader; other tools decode the messages in
//! `tests/`.

use mcap::MessageStream;

use super::*;
use crate::mcap_recording::InlineVec;
use crate::series::RequiredData;
use crate::series::read_text;

fn table() -> Recording {
    let text = "t_s,q1_rad,q2_rad,qa1_rad,qa2_rad,tau1_Nm,tau2_Nm,fx_N,x_mm,y_mm,z_mm,temp_C,spindle_rpm,note\n\
                -1.0,0.1,0.2,0.11,0.21,5,6,7,1000,2000,3000,21.5,6000,a\n\
                0.5,0.3,0.4,0.31,0.41,5,6,7,,,,21.5,6000,b\n";
    read_text("table.csv", text, None, None, RequiredData::Samples).expect("a table")
}

/// Topic, log time and bytes of each message.
fn messages(bag: &Bag) -> Vec<(String, u64, Vec<u8>)> {
    let read = MessageStream::new(&bag.bytes).expect("a container");
    let message = |message: Result<mcap::Message<'_>, _>| {
        let message = message.expect("a message");
        (message.channel.topic.clone(), message.log_time, message.data.into_owned())
    };
    read.map(message).collect()
}

#[test]
fn a_table_becomes_messages_from_its_first_row_on_and_what_has_none_is_named() {
    let bag = from_table(&table()).expect("a bag");
    let expected = [
        ("/joint_states", 2),
        ("/trued/joint_command", 2),
        ("/trued/measured_point", 1),
        ("/trued/temperature/ambient", 2),
        ("/trued/wrench", 2),
    ];
    let topics: Vec<(&str, usize)> =
        bag.topics.iter().map(|(topic, count)| (topic.as_str(), *count)).collect();
    assert_eq!(topics, expected);
    assert_eq!(bag.left_out, ["spindle_rpm", "note"]);
    let times: Vec<u64> = messages(&bag)
        .iter()
        .filter(|(topic, ..)| topic == "/joint_states")
        .map(|(_, t_ns, _)| *t_ns)
        .collect();
    assert_eq!((times, bag.shifted_s), (vec![0, 1_500_000_000], 1.0));
}

#[test]
fn tables_of_one_recording_keep_their_relation_in_time() {
    let text = "t_s,fx_N\n3.167,1\n3.168,2\n";
    let late = read_text("forces.csv", text, None, None, RequiredData::Samples).expect("a table");
    let bag = from_table(&late).expect("a bag");
    let times: Vec<u64> = messages(&bag).iter().map(|(_, t_ns, _)| *t_ns).collect();
    assert_eq!((times, bag.shifted_s), (vec![3_167_000_000, 3_168_000_000], 0.0));
}

#[test]
fn a_joint_state_has_stamp_names_position_and_effort_in_turn() {
    let bag = from_table(&table()).expect("a bag");
    let all = messages(&bag);
    let (_, _, bytes) = all.iter().find(|(topic, ..)| topic == "/joint_states").expect("one");
    // Header of CDR, seconds, nanoseconds, "base" with its length and zero, then padding to the count of names.
    assert_eq!(bytes[..4], [0, 1, 0, 0]);
    assert_eq!(bytes[4..12], [0; 8]);
    assert_eq!(bytes[12..21], *b"\x05\0\0\0base\0");
    assert_eq!(bytes[24..28], [2, 0, 0, 0]);
    let q = 0.21_f64.to_le_bytes();
    assert!(bytes.windows(8).any(|window| window == q), "the second joint's position");
}

#[test]
fn a_cycle_has_wall_clock_times_by_the_clocks_of_the_file() {
    let cycle = CycleRecord {
        received_ns: 5_000_000_100,
        q_command: InlineVec::from_slice(&[0.1, 0.2]),
        q_corrected: InlineVec::from_slice(&[0.11, 0.21]),
        wrench_used: InlineVec::from_slice(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
        ..CycleRecord::default()
    };
    let contents = Contents {
        clocks: vec![Clocks { monotonic_ns: 5_000_000_000, wall_ns: 1_700_000_000_000_000_000 }],
        records: vec![Record::Cycle(Box::new(cycle))],
        ..Contents::default()
    };
    let bag = from_daemon_recording(&contents).expect("a bag");
    let all = messages(&bag);
    let topics: Vec<&str> = all.iter().map(|(topic, ..)| topic.as_str()).collect();
    assert_eq!(topics, ["/trued/joint_command", "/trued/joint_corrected", "/trued/wrench"]);
    assert!(all.iter().all(|(_, t_ns, _)| *t_ns == 1_700_000_000_000_000_100));
}

#[test]
fn an_empty_recording_is_an_empty_file() {
    let bag = from_daemon_recording(&Contents::default()).expect("a bag");
    assert!(bag.topics.is_empty() && messages(&bag).is_empty());
}
