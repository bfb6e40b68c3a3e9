//! Sender of a request (program, process, user), for log, status and recording.
//!
//! Information missing in `/proc` is omitted. Reads files, so it must not run in a real-time thread.

use recording::mcap_recording::Utc;
use std::fs;
use std::time::{SystemTime, UNIX_EPOCH};

/// File with the names of users; without it they are shown as numbers.
const USERS: &str = "/etc/passwd";

/// For example `trued, process 4711, user operator`, read from `/proc` while the process waits for
/// its answer.
#[must_use]
pub fn description(pid: Option<u32>) -> String {
    let Some(pid) = pid else { return "an unknown process".to_owned() };
    let program = fs::read_to_string(format!("/proc/{pid}/comm")).unwrap_or_default();
    let program = match program.trim() {
        "" => String::new(),
        program => format!("{program}, "),
    };
    let status = fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
    let user = user_id(&status).map(|uid| {
        let users = fs::read_to_string(USERS).unwrap_or_default();
        format!(", user {}", user_name(uid, &users).unwrap_or(uid))
    });
    format!("{program}process {pid}{}", user.unwrap_or_default())
}

/// The same with the present time, for states that hold until the next request (bypass, mode).
#[must_use]
pub fn description_with_time(pid: Option<u32>) -> String {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let now_ns = u64::try_from(now.as_nanos()).unwrap_or(u64::MAX);
    format!("since {} by {}", Utc(now_ns), description(pid))
}

/// The real user of a process, from the text of its status.
fn user_id(status: &str) -> Option<&str> {
    status.lines().find_map(|line| line.strip_prefix("Uid:"))?.split_whitespace().next()
}

fn user_name<'t>(uid: &str, users: &'t str) -> Option<&'t str> {
    users.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)? == uid).then_some(name)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_is_described_with_program_and_user_if_it_exists() {
        let pid = std::process::id();
        let sender = description(Some(pid));
        assert!(sender.contains(&format!("process {pid}, user ")), "{sender}");
        // Above the largest process number.
        assert_eq!(description(Some(u32::MAX)), format!("process {}", u32::MAX));
        assert_eq!(description(None), "an unknown process");
    }

    #[test]
    fn users_have_names_if_known() {
        let users = "root:x:0:0:root:/root:/bin/sh\noperator:x:1000:1000::/:/bin/sh\n";
        assert_eq!(user_id("Name:\tx\nUid:\t1000\t1000\t0\t0\n"), Some("1000"));
        assert_eq!((user_name("1000", users), user_name("7", users)), (Some("operator"), None));
    }
}
