//! System calls of the real daemon's cycle: none while it spins; only its sleep if it sleeps.
//!
//! System calls are counted by `strace` on the cycle's thread alone, page faults and switches read
//! from `/proc`. A round trip is a cycle; `TRUED_QUIET_CYCLES` sets their number: a million in
//! `.ci/run`, with nothing else running.

use shm_schema::{Command, Corrected, JOINTS_MAX, Role, RoleClaim, monotonic_ns};
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};
use tests::cell_loop::{JOINTS, path};
use tests::clients::{has, skipped};
use tests::place::TestDirectory;
use tests::process::Process;
use tests::served_cell::{AWAIT_LIMIT, recorder};

const TRUED: &str = env!("CARGO_BIN_EXE_trued-under-test");
const SPUN: u64 = 50_000;
const SLEPT: u64 = 3_000;
/// Round trips before anything is counted: connections, caches, rings.
const WARM_UP: u64 = 6_000;
/// However busy the machine is.
const LIMIT: Duration = Duration::from_secs(480);

/// Kernel counters of a thread so far.
#[derive(Clone, Copy, Debug)]
struct Cost {
    faults: u64,
    /// Voluntary context switches.
    slept: u64,
    /// Switches that others forced on it.
    preempted: u64,
}

impl Cost {
    fn of(process: &Process, thread: u32) -> Self {
        let folder = format!("/proc/{}/task/{thread}", process.id());
        let stat = std::fs::read_to_string(format!("{folder}/stat")).unwrap();
        // After the name, which may contain blanks: state is field 3, faults are 10 and 12.
        let fields: Vec<&str> = stat.rsplit(')').next().unwrap().split_whitespace().collect();
        let status = std::fs::read_to_string(format!("{folder}/status")).unwrap();
        let line = |name: &str| -> u64 {
            let value = status.lines().find_map(|line| line.strip_prefix(name)).unwrap();
            value.trim_start_matches(':').trim().parse().unwrap()
        };
        Self {
            faults: fields[7].parse::<u64>().unwrap() + fields[9].parse::<u64>().unwrap(),
            slept: line("voluntary_ctxt_switches"),
            preempted: line("nonvoluntary_ctxt_switches"),
        }
    }

    fn since(&self, before: &Self) -> Self {
        Self {
            faults: self.faults - before.faults,
            slept: self.slept - before.slept,
            preempted: self.preempted - before.preempted,
        }
    }
}

/// Traces the system calls of one thread into a file.
struct Trace {
    strace: Child,
    file: PathBuf,
}

impl Trace {
    /// `None` if tracing is not permitted.
    fn start(place: &TestDirectory, thread: u32) -> Option<Self> {
        let file = place.file("trace");
        let mut strace = std::process::Command::new("strace")
            .args(["-o", file.to_str()?, "-p", &thread.to_string()])
            .stdin(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let tracer = format!("/proc/{thread}/status");
        let traced = || {
            let status = std::fs::read_to_string(&tracer).unwrap_or_default();
            status.lines().any(|line| line.starts_with("TracerPid:") && !line.ends_with("\t0"))
        };
        let start = Instant::now();
        while !traced() {
            if start.elapsed() > AWAIT_LIMIT || !matches!(strace.try_wait(), Ok(None)) {
                return None;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        // It stops the thread once, soon after: that is no sleep of the cycle's.
        std::thread::sleep(Duration::from_millis(300));
        Some(Self { strace, file })
    }

    /// The calls seen, by name.
    fn end(mut self) -> Vec<String> {
        let pid = rustix::process::Pid::from_child(&self.strace);
        rustix::process::kill_process(pid, rustix::process::Signal::INT).unwrap();
        self.strace.wait().unwrap();
        let text = std::fs::read_to_string(&self.file).unwrap();
        let name = |line: &str| line.split('(').next().unwrap_or_default().trim().to_owned();
        text.lines().filter(|line| line.contains('(')).map(name).collect()
    }
}

/// A client that sends commands and awaits answers, back-to-back or with a pause after each.
struct LatencyClient {
    _seat: RoleClaim,
    commands: shm_schema::PeerPublisher<Command>,
    answers: shm_schema::PeerSubscriber<Corrected>,
    seq: u64,
}

impl LatencyClient {
    fn join(place: &TestDirectory) -> Self {
        let mut seat = RoleClaim::new(&place.cell(), Role::Cell);
        let joined = seat.join().unwrap();
        let (commands, answers) = (joined.publisher().unwrap(), joined.subscriber().unwrap());
        Self { _seat: seat, commands, answers, seq: 0 }
    }

    fn exchange(&mut self, rounds: u64, pause: Duration) {
        let start = Instant::now();
        for _ in 0..rounds {
            self.seq += 1;
            let now_ns = monotonic_ns();
            let mut q = [0.0; JOINTS_MAX];
            q[..JOINTS].copy_from_slice(&path(now_ns));
            let (seq, joints) = (self.seq, JOINTS as u32);
            let (t_ns, sent_ns) = (now_ns, now_ns);
            self.commands.send(&Command {
                seq,
                session: 1,
                t_ns,
                sent_ns,
                joints,
                q,
                ..Command::default()
            });
            while self.answers.take_newest().is_none_or(|answer| answer.command_seq != self.seq) {
                assert!(start.elapsed() < LIMIT, "no answer to command {} of {rounds}", self.seq);
                std::hint::spin_loop();
            }
            if !pause.is_zero() {
                std::thread::sleep(pause);
            }
        }
    }
}

/// Kernel counters for a number of cycles of a daemon that waits in this way, and its system calls;
/// none of these if tracing is not permitted.
fn cost_of(wait: &str, rounds: u64, pause: Duration) -> (Cost, Option<Vec<String>>) {
    let tables = format!("[cycle]\nwait = \"{wait}\"\nstale_ms = 5000.0\n{}", recorder("box"));
    let place = TestDirectory::new("full", &tables);
    let daemon = Process::daemon(TRUED, &place);
    assert!(daemon.wait_for_output("ready", AWAIT_LIMIT), "{:?}", daemon.lines());
    let thread = daemon.thread("cycle").expect("a thread of that name");
    let mut asker = LatencyClient::join(&place);
    asker.exchange(WARM_UP.min(2 * rounds), pause);
    let trace = has("strace").then(|| Trace::start(&place, thread)).flatten();
    if trace.is_none() {
        let scratch = Path::new(env!("CARGO_TARGET_TMPDIR"));
        skipped(scratch, "system calls of the cycle", "no `strace` that may trace");
    }
    let before = Cost::of(&daemon, thread);
    let start = Instant::now();
    asker.exchange(rounds, pause);
    let cost = Cost::of(&daemon, thread).since(&before);
    println!("{wait}: {rounds} cycles in {:?}: {cost:?}", start.elapsed());
    (cost, trace.map(Trace::end))
}

#[test]
fn a_spinning_cycle_calls_no_system_faults_no_page_and_never_sleeps() {
    let given = std::env::var("TRUED_QUIET_CYCLES").ok().and_then(|n| n.parse().ok());
    let (cost, calls) = cost_of("spin", given.unwrap_or(SPUN), Duration::ZERO);
    assert_eq!((cost.faults, cost.slept), (0, 0), "{cost:?}");
    assert_eq!(calls.unwrap_or_default(), Vec::<String>::new());
}

#[test]
fn a_sleeping_cycle_calls_its_sleep_alone() {
    let (cost, calls) = cost_of("sleep", SLEPT, Duration::from_micros(700));
    assert_eq!(cost.faults, 0, "{cost:?}");
    let Some(calls) = calls else { return };
    assert!(calls.len() > 100, "{} calls", calls.len());
    // A trace that begins during a sleep shows it as resumed.
    let others: Vec<_> = calls
        .iter()
        .filter(|name| !["clock_nanosleep", "restart_syscall"].contains(&name.as_str()))
        .collect();
    assert!(others.is_empty(), "{others:?}");
}
