//! What a loop is told when the daemon goes, comes back, is another one, or may not be joined; and that it goes on.
//!
//! `cargo run -p trued-client --example outage -- CELL [SECONDS]`: prints each change.
#![expect(clippy::print_stdout, reason = "what is told is what it is for")]

use std::time::{Duration, Instant};

use trued_client::{Client, ErrorKind, monotonic_ns};

fn main() {
    let cell = std::env::args().nth(1).unwrap_or_else(|| "cell-1".to_owned());
    let seconds = std::env::args().nth(2).and_then(|s| s.parse().ok()).unwrap_or(60);
    let end = Instant::now() + Duration::from_secs(seconds);
    let mut last_kind = None;
    let mut client = None;
    while Instant::now() < end {
        let outcome = match &mut client {
            None => match Client::connect(&cell, Duration::from_millis(200)) {
                Ok(joined) => {
                    client = Some(joined);
                    continue;
                }
                Err(e) => Some((e.kind(), e.to_string())),
            },
            Some(client) => cycle(client),
        };
        let kind = outcome.as_ref().map(|(kind, _)| *kind);
        if last_kind.replace(kind) != Some(kind) {
            match outcome {
                Some((kind, message)) => println!("{kind}: {message}"),
                None => println!("ok"),
            }
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// One cycle; tells why nothing was sent.
fn cycle(client: &mut Client) -> Option<(ErrorKind, String)> {
    let q_cmd = [0.0, -0.5, 0.7, 0.0, 0.4, 0.0];
    let sent = client.send(&q_cmd.into());
    // Whatever is said: there is always something to publish.
    let _publish = client.target_for(&q_cmd, monotonic_ns());
    sent.err().map(|e| (e.kind(), e.to_string()))
}
