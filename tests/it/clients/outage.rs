//! A daemon that is missing, dies, restarts, has another version, or belongs to another user: each
//! has its own error in every language, and the library reconnects by itself.

use super::{LIMIT, OUTAGE, compiled, python};
use crate::TRUED;
use rustix::process::Signal;
use shm_schema::CONTRACT_VERSION;
use std::fs;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tests::clients::Prefix;
use tests::place::{CELL, TestDirectory};
use tests::process::Process;

/// A program that prints each change of its state.
struct ProcessOutput {
    name: String,
    process: Process,
    lines_read: usize,
}

/// Events of a busy machine in between, and their end.
const BUSY: [&str; 2] = ["daemon_silent", "message_lost"];

impl ProcessOutput {
    /// The next change is that one; names are compared as every language writes them.
    fn next(&mut self, kind: &str) {
        let mut line = self.line(kind);
        while BUSY.contains(&named(&line).as_str()) {
            line = self.line(kind);
            if kind != "ok" && named(&line) == "ok" {
                line = self.line(kind);
            }
        }
        assert_eq!(named(&line), kind, "{}: {:#?}", self.name, self.process.lines());
        assert!(kind == "ok" || line.len() > kind.len() + 20, "{}: no words: {line}", self.name);
    }

    fn line(&mut self, kind: &str) -> String {
        let start = Instant::now();
        loop {
            if let Some(line) = self.process.lines().get(self.lines_read) {
                self.lines_read += 1;
                return line.clone();
            }
            assert!(start.elapsed() < LIMIT, "{} never said {kind}", self.name);
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

fn named(line: &str) -> String {
    let kind = line.split(':').next().unwrap_or_default().to_lowercase();
    kind.trim_start_matches("trued_").trim_start_matches("error_").to_owned()
}

/// The example in every language supported by this machine.
fn everyone(prefix: &Prefix) -> Vec<(String, PathBuf, Vec<PathBuf>)> {
    let mut all = vec![("Rust".to_owned(), PathBuf::from(OUTAGE), Vec::new())];
    for (language, program) in compiled(prefix, "outage") {
        all.push((format!("{language:?}"), program, Vec::new()));
    }
    if let Some(interpreter) = python::interpreter("outage in Python") {
        all.push((
            "Python".to_owned(),
            interpreter.to_path_buf(),
            vec![python::example("outage.py")],
        ));
    }
    all
}

fn daemon(place: &TestDirectory) -> Process {
    let daemon = Process::daemon(TRUED, place);
    assert!(daemon.wait_for_output("ready", LIMIT), "{:?}", daemon.lines());
    daemon
}

/// The file by which a daemon announces itself, as one of another version, and of another start, would write it.
fn as_another_version(current: &Path) {
    let text = fs::read_to_string(current).unwrap();
    let ours = format!("contract {CONTRACT_VERSION}\n");
    assert!(text.contains(&ours), "{text}");
    let mut lines: Vec<String> =
        text.replace(&ours, "contract 4711\n").lines().map(str::to_owned).collect();
    for line in &mut lines {
        if line.starts_with("epoch ") {
            *line = "epoch 0000000000000001".to_owned();
        }
    }
    let fresh = current.with_extension("other");
    fs::write(&fresh, lines.join("\n") + "\n").unwrap();
    fs::rename(&fresh, current).unwrap();
}

/// Like another user's directory: with another owner, or, where that requires privileges, with a
/// mode that no daemon gives it.
fn as_another_users(dir: &Path) {
    let nobody = 65534;
    let owner = fs::metadata(dir).unwrap().uid();
    if owner == 0 && std::os::unix::fs::chown(dir, Some(nobody), None).is_ok() {
        return;
    }
    fs::set_permissions(dir, fs::Permissions::from_mode(0o777)).unwrap();
}

fn as_ours(dir: &Path) {
    let me = fs::metadata(dir.parent().unwrap()).unwrap().uid();
    let _ = std::os::unix::fs::chown(dir, Some(me), None);
    fs::set_permissions(dir, fs::Permissions::from_mode(0o700)).unwrap();
}

#[test]
fn every_outage_has_its_own_error_in_every_language_and_ends_by_itself() {
    let prefix = Prefix::install("outage");
    for (name, program, mut arguments) in everyone(&prefix) {
        let place = TestDirectory::new("shadow", "");
        arguments.push(CELL.into());
        let process = Process::start(program.to_str().unwrap(), &arguments, &place);
        let mut output = ProcessOutput { name, process, lines_read: 0 };
        output.next("no_daemon");
        let mut first = daemon(&place);
        output.next("ok");
        first.kill();
        output.next("daemon_lost");
        let second = daemon(&place);
        output.next("daemon_restarted");
        output.next("ok");

        let dir = place.cell().dir().to_path_buf();
        as_another_users(&dir);
        output.next("wrong_user");
        as_ours(&dir);
        output.next("ok");

        let current = dir.join("current");
        let ours = fs::read_to_string(&current).unwrap();
        // One that runs would put it right at once.
        second.signal(Signal::STOP);
        as_another_version(&current);
        output.next("version_mismatch");
        fs::write(&current, ours).unwrap();
        second.signal(Signal::CONT);
        output.next("ok");
        drop(second);
        output.next("daemon_lost");
        println!("{}: {:#?}", output.name, output.process.lines());
    }
}

#[test]
fn connecting_says_at_once_what_no_waiting_will_mend() {
    let place = TestDirectory::new("shadow", "");
    let daemon = daemon(&place);
    daemon.signal(Signal::STOP);
    let dir = place.cell().dir().to_path_buf();
    let kind = |limit| {
        let start = Instant::now();
        let refused = trued_client::Client::connect_to(&place.cell(), limit).err().unwrap();
        assert!(start.elapsed() < limit, "{refused}");
        refused.kind()
    };
    as_another_users(&dir);
    assert_eq!(kind(LIMIT), trued_client::ErrorKind::WrongUser);
    as_ours(&dir);
    as_another_version(&dir.join("current"));
    assert_eq!(kind(LIMIT), trued_client::ErrorKind::VersionMismatch);
}
