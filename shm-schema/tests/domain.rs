//! Claims about the life of a domain, within one process.
#![expect(clippy::unwrap_used, reason = "a test program")]

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use shm_schema::*;

/// A runtime directory of its own, in memory, gone at the end.
struct Runtime(PathBuf);

impl Runtime {
    fn new(name: &str) -> Self {
        let dir = PathBuf::from(format!("/dev/shm/trued-test-{name}-{:x}", new_session()));
        std::fs::create_dir(&dir).unwrap();
        Self(dir)
    }
    fn cell(&self) -> Cell {
        Cell::at(&self.0, "test").unwrap()
    }
    fn left(&self) -> Vec<String> {
        left_behind(&self.cell())
    }
}

impl Drop for Runtime {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Every name of this cell that is still there.
fn left_behind(cell: &Cell) -> Vec<String> {
    let prefix = cell.shared_memory_prefix();
    let names = |dir: &Path| -> Vec<String> {
        let entries = std::fs::read_dir(dir).into_iter().flatten().flatten();
        entries.map(|e| e.file_name().to_string_lossy().into_owned()).collect()
    };
    let mut left = names(cell.dir());
    left.extend(names(Path::new("/dev/shm")).into_iter().filter(|n| n.starts_with(&prefix)));
    left
}

fn wait_for<T>(limit: Duration, mut poll: impl FnMut() -> Option<T>) -> Option<T> {
    let start = Instant::now();
    loop {
        if let Some(found) = poll() {
            return Some(found);
        }
        if start.elapsed() > limit {
            return None;
        }
        std::thread::sleep(Duration::from_micros(200));
    }
}

#[test]
fn a_command_goes_in_and_its_answer_comes_out() {
    let runtime = Runtime::new("round");
    let cell = runtime.cell();
    let daemon = DaemonSide::create(&cell).unwrap();
    let mut commands = daemon.ports().subscriber::<Command>().unwrap();
    let mut answers = daemon.ports().publisher::<Corrected>().unwrap();
    daemon.announce().unwrap();

    let mut seat = RoleClaim::new(&cell, Role::Cell);
    let joined = seat.join().unwrap();
    let mut send = joined.publisher::<Command>().unwrap();
    let mut take = joined.subscriber::<Corrected>().unwrap();
    let command = Command { seq: 1, joints: 6, ..Command::default() };
    assert_eq!(send.send(&command), SendOutcome::Delivered);
    assert_eq!(commands.take_newest(), Some(command));
    assert_eq!(
        answers.send(&Corrected { command_seq: 1, joints: 6, ..Corrected::default() }),
        SendOutcome::Delivered
    );
    assert_eq!(take.take_newest().unwrap().command_seq, 1);
    drop((commands, answers, send, take, joined, daemon, seat));
    assert_eq!(runtime.left(), Vec::<String>::new());
}

#[test]
fn the_newest_command_wins() {
    let runtime = Runtime::new("newest");
    let daemon = DaemonSide::create(&runtime.cell()).unwrap();
    let mut commands = daemon.ports().subscriber::<Command>().unwrap();
    daemon.announce().unwrap();
    let joined = RoleClaim::new(&runtime.cell(), Role::Cell).join().unwrap();
    let mut send = joined.publisher::<Command>().unwrap();
    for seq in 1..=100 {
        send.send(&Command { seq, joints: 1, ..Command::default() });
    }
    assert_eq!(commands.take_newest().unwrap().seq, 100);
    assert!(commands.take_newest().is_none());
}

#[test]
fn a_force_reader_that_sleeps_costs_blocks_that_the_sender_counts() {
    let runtime = Runtime::new("force");
    let daemon = DaemonSide::create(&runtime.cell()).unwrap();
    let mut blocks = daemon.ports().subscriber::<ForceBlock>().unwrap();
    daemon.announce().unwrap();
    let joined = RoleClaim::new(&runtime.cell(), Role::Force).join().unwrap();
    let mut send = joined.publisher::<ForceBlock>().unwrap();
    for seq in 1..=100 {
        send.send(&ForceBlock { seq, channels: 3, samples: 10, ..ForceBlock::default() });
    }
    let mut taken = Vec::new();
    while let Some(block) = blocks.take_next() {
        taken.push(block.seq);
    }
    assert_eq!(taken, (1..=64).collect::<Vec<u64>>());
    assert_eq!(send.lost(), 36);
}

#[test]
fn a_late_monitor_sees_the_last_status() {
    let runtime = Runtime::new("late");
    let daemon = DaemonSide::create(&runtime.cell()).unwrap();
    let mut status = daemon.ports().publisher::<Status>().unwrap();
    status.send(&Status { seq: 7, joints: 6, ..Status::default() });
    daemon.announce().unwrap();
    let joined = RoleClaim::new(&runtime.cell(), Role::Monitor).join().unwrap();
    let mut monitor = joined.subscriber::<Status>().unwrap();
    // History is handed over when the sender sees the new reader, with its next message at the latest.
    let received = wait_for(Duration::from_secs(1), || {
        monitor.take_newest().or_else(|| {
            status.send(&Status { seq: 8, joints: 6, ..Status::default() });
            None
        })
    });
    assert!(received.unwrap().seq >= 7);
}

#[test]
fn a_request_gets_its_answer() {
    let runtime = Runtime::new("control");
    let daemon = DaemonSide::create(&runtime.cell()).unwrap();
    let mut server = daemon.ports().control().unwrap();
    daemon.announce().unwrap();
    let joined = RoleClaim::new(&runtime.cell(), Role::Monitor).join().unwrap();
    let mut client = joined.control().unwrap();
    for seq in 1..=5 {
        let request = Request { seq, ..Request::default() };
        let pending = client.send_request(&request).unwrap();
        assert!(pending.answer().is_none());
        assert!(server.serve(|r| Response::to(r, Answer::Done, "pong")));
        let answer = wait_for(Duration::from_secs(1), || pending.answer()).unwrap();
        assert_eq!((answer.seq, answer.message.as_str()), (seq, "pong"));
    }
}

#[test]
fn a_second_daemon_is_refused_and_told_who_serves() {
    let runtime = Runtime::new("second");
    let daemon = DaemonSide::create(&runtime.cell()).unwrap();
    let refused = DaemonSide::create(&runtime.cell()).unwrap_err().to_string();
    assert!(refused.contains(&std::process::id().to_string()), "{refused}");
    drop(daemon);
    DaemonSide::create(&runtime.cell()).unwrap();
}

#[test]
fn a_second_cell_client_is_refused_and_told_who_is_in() {
    let runtime = Runtime::new("role");
    let daemon = DaemonSide::create(&runtime.cell()).unwrap();
    daemon.announce().unwrap();
    let mut first = RoleClaim::new(&runtime.cell(), Role::Cell);
    let _joined = first.join().unwrap();
    let refused = RoleClaim::new(&runtime.cell(), Role::Cell).join().unwrap_err();
    assert!(refused.is_transient());
    assert!(refused.to_string().contains(&std::process::id().to_string()), "{refused}");
}

#[test]
fn another_contract_is_refused_with_both_versions_named() {
    let runtime = Runtime::new("version");
    let daemon = DaemonSide::create(&runtime.cell()).unwrap();
    daemon.announce().unwrap();
    let current = runtime.cell().dir().join("current");
    let text = std::fs::read_to_string(&current).unwrap();
    std::fs::write(
        &current,
        text.replace(&format!("contract {CONTRACT_VERSION}\n"), "contract 77\n"),
    )
    .unwrap();
    let refused = RoleClaim::new(&runtime.cell(), Role::Cell).join().unwrap_err();
    let message = refused.to_string();
    assert!(!refused.is_transient());
    let ours = format!("contract {CONTRACT_VERSION},");
    assert!(message.contains("contract 77,") && message.contains(&ours), "{message}");
}

#[test]
fn without_a_daemon_nobody_joins() {
    let runtime = Runtime::new("none");
    assert!(matches!(
        RoleClaim::new(&runtime.cell(), Role::Cell).join(),
        Err(JoinError::NoDaemon { .. })
    ));
    assert!(!runtime.cell().dir().exists());
}

#[test]
fn whoever_has_the_old_epoch_mapped_outlives_its_removal() {
    let runtime = Runtime::new("unlink");
    let mut daemon = DaemonSide::create(&runtime.cell()).unwrap();
    let mut commands = daemon.ports().subscriber::<Command>().unwrap();
    let mut answers = daemon.ports().publisher::<Corrected>().unwrap();
    daemon.announce().unwrap();
    let mut seat = RoleClaim::new(&runtime.cell(), Role::Cell);
    let joined = seat.join().unwrap();
    let mut send = joined.publisher::<Command>().unwrap();
    let mut take = joined.subscriber::<Corrected>().unwrap();
    // Both ends map each other with their first message.
    send.send(&Command::default());
    assert!(commands.take_newest().is_some());
    answers.send(&Corrected::default());
    assert!(take.take_newest().is_some());

    daemon.renew().unwrap();
    daemon.announce().unwrap();
    for seq in 1..=10_u64 {
        assert_eq!(send.send(&Command { seq, ..Command::default() }), SendOutcome::Delivered);
        assert_eq!(commands.take_newest().unwrap().seq, seq);
        answers.send(&Corrected { seq, ..Corrected::default() });
        assert_eq!(take.take_newest().unwrap().seq, seq);
    }
    assert_ne!(seat.current_epoch().unwrap().epoch, joined.current().epoch);
    let again = seat.join().unwrap();
    assert_eq!(again.current().epoch, daemon.ports().epoch());
    drop((commands, answers, send, take, joined, again));
    drop(daemon);
    drop(seat);
    assert_eq!(runtime.left(), Vec::<String>::new());
}

#[test]
fn memory_that_its_creator_never_sized_is_removed_as_it_holds_up_whoever_opens_it() {
    let runtime = Runtime::new("mend");
    let daemon = DaemonSide::create(&runtime.cell()).unwrap();
    let prefix = runtime.cell().shared_memory_prefix();
    let path = |name: &str| PathBuf::from(format!("/dev/shm/{prefix}{name}"));
    std::fs::write(path("empty"), "").unwrap();
    std::fs::write(path("sized"), "x").unwrap();
    assert!(
        wait_for(Duration::from_secs(10), || (!path("empty").exists()).then_some(())).is_some()
    );
    assert!(path("sized").exists());
    drop(daemon);
    assert_eq!(runtime.left(), Vec::<String>::new());
}

#[test]
fn a_directory_that_the_transport_made_anew_is_closed_again() {
    let runtime = Runtime::new("ajar");
    let cell = runtime.cell();
    std::fs::create_dir(cell.dir()).unwrap();
    let mode = |mode| std::os::unix::fs::PermissionsExt::from_mode(mode);
    std::fs::set_permissions(cell.dir(), mode(0o750)).unwrap();
    let mut daemon = DaemonSide::create(&cell).unwrap();
    daemon.announce().unwrap();
    assert!(!daemon.supervise().files_damaged);
    std::fs::set_permissions(cell.dir(), mode(0o755)).unwrap();
    assert!(daemon.supervise().files_damaged);
    daemon.renew().unwrap();
    daemon.announce().unwrap();
    assert!(!daemon.supervise().files_damaged);
    RoleClaim::new(&cell, Role::Cell).join().unwrap();
}

#[test]
fn files_that_are_removed_while_an_epoch_is_announced_are_made_once_more() {
    let runtime = Runtime::new("again");
    let cell = runtime.cell();
    let mut daemon = DaemonSide::create(&cell).unwrap();
    daemon.announce().unwrap();
    daemon.renew().unwrap();
    std::fs::remove_dir_all(cell.dir()).unwrap();
    daemon.announce().unwrap_err();
    assert!(daemon.supervise().files_damaged, "nobody finds this daemon, and it does not see it");
    daemon.renew().unwrap();
    daemon.announce().unwrap();
    assert!(!daemon.supervise().files_damaged);
    RoleClaim::new(&cell, Role::Cell).join().unwrap();
}

#[test]
fn a_directory_on_a_disk_or_of_others_is_refused() {
    let runtime = Runtime::new("place");
    let cell = runtime.cell();
    std::fs::create_dir(cell.dir()).unwrap();
    std::fs::set_permissions(cell.dir(), std::os::unix::fs::PermissionsExt::from_mode(0o777))
        .unwrap();
    assert!(matches!(DaemonSide::create(&cell), Err(DomainError::WrongOwner { .. })));
    assert!(matches!(Cell::new("Über"), Err(DomainError::BadName { .. })));
    assert!(matches!(Cell::at(Path::new("tmp"), "a"), Err(DomainError::BadDirectory { .. })));
    let deep = Path::new(
        "/dev/shm/a-directory-of-seventy-bytes-in-which-the-transport-s-names-do-not-fit",
    );
    assert!(matches!(Cell::at(deep, "a"), Err(DomainError::BadDirectory { .. })));
}
