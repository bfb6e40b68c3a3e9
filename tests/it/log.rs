//! The daemon's log: it contains what an operator must know at the default level, at a readable
//! rate.

use crate::TRUED;
use std::time::{Duration, Instant};
use tests::cell_loop::MIDDLE;
use tests::place::TestDirectory;
use tests::process::Process;
use trued_client::{Client, Monitor, Setpoint};

const LIMIT: Duration = Duration::from_secs(10);
/// Beyond the limits of joint 1 of the model, rad.
const OUTSIDE_RAD: f64 = 3.2;

/// Commands every millisecond, a number of them.
fn command(client: &mut Client, q: &[f64], commands: u32) {
    for _ in 0..commands {
        let sent = client.send(&Setpoint::new(q));
        let _ = sent.ok().and_then(|seq| client.wait_corrected(seq, LIMIT));
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// The lines that hold `words`.
fn with<'a>(lines: &'a [String], text: &str) -> Vec<&'a String> {
    lines.iter().filter(|line| line.contains(text)).collect()
}

/// The number after `key` in a line.
fn number(line: &str, key: &str) -> u64 {
    let digits: String = line.split_once(key).map_or_else(String::new, |(_, rest)| {
        rest.chars().take_while(char::is_ascii_digit).collect()
    });
    assert!(!digits.is_empty(), "{key} in {line}");
    digits.parse().unwrap()
}

#[test]
fn refused_commands_and_the_health_that_they_make_are_logged_and_summed_up_at_the_end() {
    let place = TestDirectory::new("full", "[cycle]\nstale_ms = 500.0\n");
    let mut daemon = Process::daemon(TRUED, &place);
    assert!(daemon.wait_for_output("ready", LIMIT), "{:?}", daemon.lines());
    let mut client = Client::connect_to(&place.cell(), LIMIT).unwrap();
    command(&mut client, &MIDDLE, 200);
    let outside = [OUTSIDE_RAD, MIDDLE[1], MIDDLE[2], MIDDLE[3], MIDDLE[4], MIDDLE[5]];
    command(&mut client, &outside, 998);
    let message = "WARN a commanded joint is outside the model's limits";
    assert!(daemon.wait_for_output(message, LIMIT), "{:#?}", daemon.lines());
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_millis(10_500) {
        command(&mut client, &outside, 20);
    }
    drop(client);
    assert!(daemon.end().success());
    let lines = daemon.lines();
    let refused = with(&lines, message);
    assert_eq!(refused.len(), 2, "the first, and a sum after 10 s: {lines:#?}");
    assert!(refused[0].contains("reason=\"out_of_limits\""), "{}", refused[0]);
    let degraded = with(&lines, "WARN health running -> degraded: out_of_limits");
    assert_eq!(degraded.len(), 1, "{lines:#?}");
    let [summary] = with(&lines, "INFO ended ")[..] else { panic!("one summary: {lines:#?}") };
    assert!(number(summary, "cycles=") > 1000, "{summary}");
    let total = number(summary, "out_of_limits ");
    assert!(total >= 998, "{summary}");
    assert!(number(refused[1], "total=") <= total, "{summary}");
    for key in
        ["missed_cycles=", "commands_lost=", "refused=", "latency_p50_us=", "latency_max_us="]
    {
        number(summary, key);
    }
    assert!(lines.len() < 60, "lines that a person can read: {lines:#?}");
}

#[test]
fn requests_and_changes_of_the_model_are_logged_and_a_stream_of_the_same_is_not() {
    let place = TestDirectory::new("full", "");
    let mut daemon = Process::daemon(TRUED, &place);
    assert!(daemon.wait_for_output("ready", LIMIT), "{:?}", daemon.lines());
    assert!(daemon.wait_for_output("robot=ABB IRB 1600-6/1.45", LIMIT), "{:?}", daemon.lines());
    let mut monitor = Monitor::connect_to(&place.cell(), LIMIT).unwrap();
    for on in [true, false] {
        monitor.bypass(on, LIMIT).unwrap();
    }
    for _ in 0..50 {
        monitor.ping(LIMIT).unwrap();
        monitor.bypass(true, LIMIT).unwrap();
    }
    monitor.reload(None, LIMIT).unwrap();
    let kuka = place.model("kuka.toml", "kuka-kr240");
    monitor.reload(Some(&kuka), LIMIT).unwrap();
    assert!(daemon.end().success());
    let lines = daemon.lines();
    assert_eq!(with(&lines, "request: bypass").len(), 3, "in, out, in: {lines:#?}");
    assert_eq!(with(&lines, "request: ping").len(), 0);
    assert_eq!(with(&lines, "INFO loaded ").len(), 2, "at the start, and anew: {lines:#?}");
    assert_eq!(with(&lines, "WARN request: reload answer=refused").len(), 1, "{lines:#?}");
}
