//! Folders, ports, processes and what is skipped.

use std::io::{BufRead as _, BufReader};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

pub(crate) const HERE: &str = env!("CARGO_MANIFEST_DIR");
pub(crate) const LIMIT: Duration = Duration::from_secs(30);

/// A folder in memory; gone at the end.
pub(crate) struct Folder(pub(crate) PathBuf);

impl Folder {
    pub(crate) fn new() -> Self {
        static NEXT: AtomicUsize = AtomicUsize::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let path = Path::new("/dev/shm").join(format!("trued-bus-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// An endpoint of this machine that nobody listens at.
pub(crate) fn endpoint() -> String {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    format!("tcp/127.0.0.1:{port}")
}

/// A process; killed at the end.
pub(crate) struct Process(pub(crate) Child);

impl Process {
    /// Starts it and waits for a line that holds `ready`.
    pub(crate) fn start(command: &mut Command, ready: &str) -> Self {
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let (tell, lines_read) = std::sync::mpsc::channel();
        let out = child.stdout.take().unwrap();
        let err = child.stderr.take().unwrap();
        for stream in [Box::new(out) as Box<dyn std::io::Read + Send>, Box::new(err)] {
            let tell = tell.clone();
            std::thread::spawn(move || {
                for line in BufReader::new(stream).lines().map_while(Result::ok) {
                    let _ = tell.send(line);
                }
            });
        }
        let mut lines = Vec::new();
        let begun = Instant::now();
        while !lines.last().is_some_and(|line: &String| line.contains(ready)) {
            let left = LIMIT.saturating_sub(begun.elapsed());
            lines.push(
                lines_read.recv_timeout(left).unwrap_or_else(|_| panic!("no `{ready}`: {lines:?}")),
            );
        }
        Self(child)
    }

    /// Sends it a signal by the program `kill`.
    pub(crate) fn signal(&self, signal: &str) {
        let id = self.0.id().to_string();
        assert!(Command::new("kill").args([signal, &id]).status().unwrap().success());
    }

    /// Kills it with no time to tidy up.
    pub(crate) fn kill(mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The program under test.
pub(crate) fn plant(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_trued-plant"));
    command.args(arguments);
    command
}

/// The main program, where it was built.
pub(crate) fn trued() -> Option<PathBuf> {
    let built = ["release", "debug"]
        .map(|profile| Path::new(HERE).join("../../target").join(profile).join("trued"));
    let given = std::env::var_os("TRUED").map(PathBuf::from);
    given.into_iter().chain(built).find(|path| path.is_file())
}

/// Says what is not tested, and lists it.
pub(crate) fn skipped(what: &str, why: &str) {
    let line = format!("SKIPPED: {what}: {why}\n");
    eprint!("{line}");
    let list = Path::new(HERE).join("../../target/tmp/skipped");
    if let Ok(mut file) = std::fs::OpenOptions::new().append(true).create(true).open(list) {
        let _ = std::io::Write::write_all(&mut file, line.as_bytes());
    }
}

/// Waits until `is` gives something.
pub(crate) fn until<T>(what: &str, mut is: impl FnMut() -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(found) = is() {
            return found;
        }
        assert!(begun.elapsed() < LIMIT, "it never came: {what}");
        std::thread::sleep(Duration::from_millis(50));
    }
}
