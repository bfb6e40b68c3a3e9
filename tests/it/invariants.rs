//! Targets published by the real daemon while a client sends arbitrary messages.
//!
//! `TRUED_SEED` repeats a run, `TRUED_HOSTILE` sets the number of invalid messages.

use crate::TRUED;
use shm_schema::{
    Command, Corrected, CorrectionStatus, ForceBlock, Horizon, JointBounds, PeerControl,
    PeerPublisher, PeerSubscriber, Reason, RobotState, Role, RoleClaim, SendOutcome, Status,
    monotonic_ns,
};
use std::collections::BTreeMap;
use std::fs;
use std::time::{Duration, Instant};
use tests::cell_loop::JOINTS;
use tests::invalid_messages::{CommandSource, Expected, KINDS};
use tests::place::TestDirectory;
use tests::process::Process;
use tests::rate_check::RateCheck;

const LIMIT: Duration = Duration::from_secs(10);
const MESSAGES: u64 = 3000;
const ROUNDING: f64 = 1e-12;

/// A client that bypasses the client library.
struct Cell {
    _seats: [RoleClaim; 2],
    commands: PeerPublisher<Command>,
    answers: PeerSubscriber<Corrected>,
    states: PeerPublisher<RobotState>,
    horizons: PeerPublisher<Horizon>,
    statuses: PeerSubscriber<Status>,
    control: PeerControl,
    forces: PeerPublisher<ForceBlock>,
    bounds: JointBounds,
    sender: CommandSource,
    block: Box<ForceBlock>,
    horizon: Box<Horizon>,
    gauge: RateCheck,
    published: u64,
    tally: BTreeMap<String, u64>,
    last: Option<Corrected>,
}

impl Cell {
    fn join(place: &TestDirectory, seed: u64) -> Self {
        let mut seats = [Role::Cell, Role::Force].map(|role| RoleClaim::new(&place.cell(), role));
        let [cell, force] = [0, 1].map(|i| seats[i].join().expect("a daemon that is ready"));
        let mut statuses = cell.subscriber::<Status>().unwrap();
        let bounds = wait(LIMIT, || statuses.take_newest()).expect("a status").bounds;
        Self {
            commands: cell.publisher().unwrap(),
            answers: cell.subscriber().unwrap(),
            states: cell.publisher().unwrap(),
            horizons: cell.publisher().unwrap(),
            control: cell.control().unwrap(),
            forces: force.publisher().unwrap(),
            statuses,
            _seats: seats,
            gauge: RateCheck::new(&bounds.rate[..JOINTS]),
            bounds,
            sender: CommandSource::new(seed),
            block: Box::default(),
            horizon: Box::default(),
            published: 0,
            tally: BTreeMap::new(),
            last: None,
        }
    }

    fn send(&mut self, command: &Command) {
        assert_eq!(self.commands.send(command), SendOutcome::Delivered);
    }

    /// Takes an answer if there is one, and checks it against every invariant.
    fn hear(&mut self) -> Option<Corrected> {
        let answer = self.answers.take_newest()?;
        self.published += 1;
        assert!(answer.status().is_ok() && answer.reason().is_ok(), "{answer:?}");
        *self.tally.entry(format!("{}/{}", named(&answer).0, named(&answer).1)).or_default() += 1;
        self.last = Some(answer);
        assert_eq!(answer.joints as usize, JOINTS, "{answer:?}");
        for (i, correction) in answer.correction().iter().enumerate() {
            let within = correction.abs() <= self.bounds.angle[i] + ROUNDING;
            assert!(within, "joint {i} beyond its bound: {answer:?}");
        }
        for numbers in [answer.correction_rate, answer.correction_acceleration, answer.wanted] {
            assert!(numbers.iter().all(|x| x.is_finite()), "{answer:?}");
        }
        self.gauge.take(answer.made_ns, &answer.correction[..JOINTS]).unwrap();
        Some(answer)
    }

    /// Sends a command and waits for its answer.
    fn exchange(&mut self, command: &Command, limit: Duration) -> Option<Corrected> {
        self.hear();
        let sent_ns = monotonic_ns();
        self.send(command);
        let end = Instant::now() + limit;
        while Instant::now() < end {
            let ours = |answer: &Corrected| {
                (answer.command_session, answer.command_seq) == (command.session, command.seq)
                    && answer.received_ns >= sent_ns
            };
            if let Some(answer) = self.hear().filter(ours) {
                return Some(answer);
            }
            std::thread::sleep(Duration::from_micros(50));
        }
        None
    }

    fn good(&mut self) -> Corrected {
        let command = self.sender.next_valid();
        let answer = self.exchange(&command, LIMIT).expect("a good command is answered");
        assert_ne!(answer.status(), Ok(CorrectionStatus::Rejected), "{answer:?}");
        answer
    }

    fn bad(&mut self, kind: u64) {
        let (command, due, of_use) = self.sender.next_invalid(kind);
        let about =
            |answer: &Corrected| format!("kind {kind}: {:?} for {command:?}", named(answer));
        match due {
            Expected::Taken => {
                let answer = self.exchange(&command, LIMIT).expect("an answer");
                assert_ne!(answer.status(), Ok(CorrectionStatus::Rejected), "{}", about(&answer));
            }
            Expected::Refused(reason) => {
                let answer = self.exchange(&command, LIMIT).expect("an answer");
                let refused = (CorrectionStatus::Rejected, reason);
                assert_eq!(named(&answer), refused, "{}", about(&answer));
            }
            Expected::Malformed => {
                let answer = self.exchange(&command, Duration::from_millis(4));
                assert!(answer.is_none(), "{}", about(&answer.unwrap()));
            }
            Expected::Anything => {
                self.exchange(&command, Duration::from_millis(4));
            }
        }
        if !of_use {
            self.sender.start_session();
        }
    }

    /// Without waiting for anything.
    fn burst(&mut self) {
        for _ in 0..40 {
            let kind = self.sender.chance.below(KINDS);
            let (command, _, _) = self.sender.next_invalid(kind);
            self.send(&command);
            self.hear();
        }
        self.sender.start_session();
    }

    fn everything_else(&mut self) {
        for _ in 0..4 {
            self.sender.fill_force_block(&mut self.block);
            self.forces.send(&self.block);
        }
        let state = self.sender.any_state();
        self.states.send(&state);
        self.sender.fill_horizon(&mut self.horizon);
        self.horizons.send(&self.horizon);
        if self.sender.chance.below(20) == 0 {
            let request = self.sender.harmless_request();
            let pending = self.control.send_request(&request);
            let answered =
                wait(LIMIT, || pending.as_ref().and_then(shm_schema::PendingResponse::answer));
            assert!(answered.is_some(), "{request:?}");
        }
    }
}

fn named(answer: &Corrected) -> (CorrectionStatus, Reason) {
    (answer.status().unwrap(), answer.reason().unwrap())
}

fn wait<T>(limit: Duration, mut poll: impl FnMut() -> Option<T>) -> Option<T> {
    let start = Instant::now();
    while start.elapsed() < limit {
        if let Some(found) = poll() {
            return Some(found);
        }
        std::thread::sleep(Duration::from_micros(200));
    }
    None
}

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().and_then(|n| n.parse().ok())
}

/// Delay and lags, which `[dynamic]` compensates.
const LAGS: &str = "
[[effect]]
kind = \"time_delay\"
delay_ms = 3.0

[[effect]]
kind = \"servo_lag\"
joint = 1
time_constant_ms = 10.0

[[effect]]
kind = \"servo_lag\"
joint = 2
time_constant_ms = 10.0
";

/// A campaign against a daemon with this source of the wrench, and with these tables. Afterwards valid commands get
/// answers of these kinds alone.
fn campaign(wrench: &str, more: &str, accepted: &[CorrectionStatus]) {
    let seed = number("TRUED_SEED").unwrap_or_else(monotonic_ns);
    println!("TRUED_SEED={seed}");
    let tables = format!(
        "[cycle]\nstale_ms = 300.0\n[wrench]\nsource = \"{wrench}\"\n\
         [force]\nrate_Hz = 10000.0\nchannels = 3\n[vibration]\nenabled = true\n{more}"
    );
    let place = TestDirectory::new("full", &tables);
    let model = fs::read_to_string(place.file("model.toml")).expect("a model");
    place.write("model.toml", &(model + LAGS));
    let mut daemon = Process::daemon(TRUED, &place);
    assert!(daemon.wait_for_output("ready", LIMIT), "{:?}", daemon.lines());
    let mut cell = Cell::join(&place, seed);
    cell.sender.start_session();
    for number in 0..number("TRUED_HOSTILE").unwrap_or(MESSAGES) {
        // Two, so that there is something to be older than.
        cell.good();
        cell.good();
        let kind = cell.sender.chance.below(KINDS);
        cell.bad(kind);
        cell.everything_else();
        if number % 100 == 99 {
            cell.burst();
        }
        assert!(daemon.is_running(), "message {number}: {:#?}", daemon.lines());
    }
    goes_on(&mut cell, accepted);
    assert!(daemon.end().success(), "{:#?}", daemon.lines());
}

/// Afterwards valid commands are corrected as before.
fn goes_on(cell: &mut Cell, accepted: &[CorrectionStatus]) {
    cell.sender.start_session();
    let end = Instant::now() + LIMIT;
    let mut in_a_row = 0;
    while in_a_row < 200 {
        assert!(Instant::now() < end, "not corrected again: {:?}", cell.last);
        let is_accepted = accepted.contains(&named(&cell.good()).0);
        in_a_row = if is_accepted { in_a_row + 1 } else { 0 };
    }
    let status = wait(LIMIT, || cell.statuses.take_newest()).unwrap();
    assert!(status.rejected > 0 && status.malformed > 0, "{status:?}");
    println!(
        "{} targets looked at, rate bucket at most {:.2} full, {:?}",
        cell.published, cell.gauge.fullest, cell.tally
    );
}

#[test]
fn no_target_breaks_an_invariant_whatever_is_commanded() {
    campaign("force", "", &[CorrectionStatus::Corrected]);
}

#[test]
fn nor_where_the_command_brings_the_wrench() {
    campaign("command", "", &[CorrectionStatus::Corrected]);
}

#[test]
fn nor_where_delay_and_lags_are_compensated_and_horizons_of_any_kind_are_stated() {
    // The lead of commands without a steady period changes faster than the limits of the correction allow.
    let accepted = [CorrectionStatus::Corrected, CorrectionStatus::Ramping];
    campaign("none", "[dynamic]\nmode = \"compensate\"\n", &accepted);
}
