//! `trued top` in a terminal of 80 × 24, operated by keys (needs `tmux`; SKIPPED without it).

use crate::TRUED;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};
use tests::cell_loop::CellLoop;
use tests::clients::skipped;
use tests::place::{CELL, TestDirectory};
use tests::process::Process;
use trued_client::Monitor;

const LIMIT: Duration = Duration::from_secs(10);
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// A separate terminal with one command.
struct Terminal {
    socket: String,
}

impl Terminal {
    fn running(place: &TestDirectory, command: &str) -> Self {
        let socket = format!("trued-test-{}", std::process::id());
        let terminal = Self { socket };
        let runtime = format!("TRUED_RUNTIME_DIR={}", place.root().display());
        let begin = ["new-session", "-d", "-s", "top", "-x", "80", "-y", "24", "-e", &runtime];
        let output = Command::new("tmux")
            .args(["-L", &terminal.socket, "-f", "/dev/null"])
            .args(begin)
            .arg(format!("{command}; echo ended with $?; sleep 60"))
            .output()
            .expect("tmux");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        terminal
    }

    fn tmux(&self, arguments: &[&str]) -> String {
        let mut tmux = Command::new("tmux");
        let output = tmux.args(["-L", &self.socket]).args(arguments).output().expect("tmux");
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    fn press(&self, key: &str) {
        self.tmux(&["send-keys", "-t", "top", key]);
    }

    /// The rows once they contain `wanted`.
    fn shows(&self, wanted: &str) -> Vec<String> {
        self.comes_to_show(wanted, |rows| rows.iter().any(|row| row.contains(wanted)))
    }

    /// The rows once `is_so` holds; `what` describes it.
    fn comes_to_show(&self, what: &str, is_so: impl Fn(&[String]) -> bool) -> Vec<String> {
        let begun = Instant::now();
        loop {
            let text = self.tmux(&["capture-pane", "-p", "-t", "top"]);
            let rows: Vec<String> = text.lines().map(str::to_owned).collect();
            if is_so(&rows) {
                return rows;
            }
            assert!(begun.elapsed() < LIMIT, "`{what}` is not on\n{text}");
            std::thread::sleep(LOOK_EVERY);
        }
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.tmux(&["kill-server"]);
    }
}

fn is_bypassed(monitor: &mut Monitor) -> bool {
    let begun = Instant::now();
    loop {
        if let Some(status) = monitor.status() {
            return status.bypassed != 0;
        }
        assert!(begun.elapsed() < LIMIT, "no status");
        std::thread::sleep(LOOK_EVERY);
    }
}

#[test]
fn keys_do_what_they_say_and_the_screen_fits_80_by_24_and_smaller() {
    // `tmux --version` fails; it is `-V`.
    if Command::new("tmux").arg("-V").output().is_err() {
        let scratch = Path::new(env!("CARGO_TARGET_TMPDIR"));
        skipped(scratch, "`trued top` by keys", "no `tmux`");
        return;
    }
    let place = TestDirectory::new("full", "");
    let mut daemon = Process::ready_daemon(TRUED, &place);
    let mut robot = CellLoop::join(&place.cell(), LIMIT).expect("a daemon");
    let mut monitor = Monitor::connect_to(&place.cell(), LIMIT).expect("a daemon");
    let terminal = Terminal::running(&place, &format!("{TRUED} top {CELL}"));
    assert!(robot.tick_until(LIMIT, |_, tick| tick.largest() > 1e-4));
    let rows = terminal.shows("FULL");
    assert_eq!(rows.len(), 24, "{rows:#?}");
    assert!(rows[23].contains("bypass") && rows[23].contains("quit"), "{rows:#?}");

    terminal.press("b");
    terminal.shows("BYPASSED");
    assert!(is_bypassed(&mut monitor));
    terminal.press("b");
    terminal.shows("bypass off? y");
    terminal.press("n");
    terminal.shows("quit");
    assert!(is_bypassed(&mut monitor), "a no changes nothing");
    terminal.press("b");
    terminal.shows("bypass off? y");
    terminal.press("y");
    terminal.shows("bypass ended");
    assert!(!is_bypassed(&mut monitor));
    terminal.press("s");
    terminal.shows("mode full -> shadow");
    terminal.press("a");
    terminal.shows("arm? y");
    terminal.press("y");
    terminal.shows("mode shadow -> full");

    terminal.tmux(&["resize-window", "-t", "top", "-x", "50", "-y", "12"]);
    // For a moment the terminal shows the end of the larger screen.
    terminal.comes_to_show("12 rows with the mode and the keys", |rows| {
        let has = |row: usize, part: &str| rows.get(row).is_some_and(|row| row.contains(part));
        rows.len() <= 12 && has(1, "FULL") && has(rows.len() - 1, "quit")
    });
    terminal.tmux(&["resize-window", "-t", "top", "-x", "80", "-y", "24"]);
    daemon.kill();
    terminal.shows("NO DAEMON");
    terminal.press("q");
    let rows = terminal.shows("ended with 0");
    assert!(!rows.iter().any(|row| row.contains("trued top")), "its screen is gone: {rows:#?}");
    assert!(robot.broken.is_empty(), "{:?}", robot.broken);
}
