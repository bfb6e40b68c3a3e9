//! What client and daemon say to each other, with a daemon in this process.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use shm_schema::*;
use trued_client::{
    Client, ConnectError, Connection, ConnectionEvent, DisconnectReason, ErrorKind, ForceSamples,
    ForceSource, HORIZON_POINTS_MAX, InvalidTarget, Monitor, RequestError, Samples, SendError,
    Setpoint, Source, WrenchFrame,
};

use crate::mini::Runtime;

const LIMIT: Duration = Duration::from_secs(10);

/// A daemon that answers with the command itself and, to a reload, with the path.
struct Daemon {
    side: DaemonSide,
    commands: Subscriber<Command>,
    answers: Publisher<Corrected>,
    statuses: Publisher<Status>,
    control: ControlServer,
    answer: Corrected,
}

impl Daemon {
    fn start(cell: &Cell) -> Self {
        let side = DaemonSide::create(cell).unwrap();
        let ports = side.ports();
        let mut daemon = Self {
            commands: ports.subscriber().unwrap(),
            answers: ports.publisher().unwrap(),
            statuses: ports.publisher().unwrap(),
            control: ports.control().unwrap(),
            answer: Corrected { joints: 6, ..Corrected::default() },
            side,
        };
        daemon.turn();
        daemon.side.announce().unwrap();
        daemon
    }

    /// Goes on in a new epoch, as a client could not get into the old one.
    fn renew(&mut self) {
        self.side.renew().unwrap();
        let ports = self.side.ports();
        self.commands = ports.subscriber().unwrap();
        self.answers = ports.publisher().unwrap();
        self.statuses = ports.publisher().unwrap();
        self.control = ports.control().unwrap();
        self.turn();
        self.side.announce().unwrap();
    }

    fn turn(&mut self) -> Option<Command> {
        let command = self.commands.take_newest();
        if let Some(command) = command {
            self.answer.seq += 1;
            self.answer.command_seq = command.seq;
            self.answer.command_session = command.session;
            self.answer.made_ns = monotonic_ns();
            self.answers.send(&self.answer);
        }
        let mut status = Status { joints: 6, ..Status::default() };
        status.bounds.angle = [0.02; JOINTS_MAX];
        status.bounds.rate = [0.02; JOINTS_MAX];
        status.bounds.jerk = [5.0; JOINTS_MAX];
        self.statuses.send(&status);
        self.control.serve(|request| Response::to(request, Answer::Done, request.path.as_str()));
        command
    }
}

/// Runs what a client does in another thread while the daemon turns in this one.
fn beside<R: Send + 'static>(
    daemon: &mut Daemon,
    client: impl FnOnce() -> R + Send + 'static,
) -> R {
    let client = std::thread::spawn(client);
    while !client.is_finished() {
        daemon.turn();
        std::thread::sleep(Duration::from_micros(200));
    }
    client.join().unwrap()
}

#[test]
fn a_command_arrives_whole_and_its_answer_is_published() {
    let runtime = Runtime::new("whole");
    let cell = runtime.cell();
    let mut daemon = Daemon::start(&cell);
    let mut client = beside(&mut daemon, move || Client::connect_to(&cell, LIMIT)).unwrap();
    let setpoint = Setpoint::new(&[0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
        .at_ns(77)
        .wrench([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], WrenchFrame::Base)
        .temperatures(21.5, &[30.0, 31.0])
        .direction(&[1, -1, 5]);
    let seq = client.send(&setpoint).unwrap();
    let command = daemon.turn().unwrap();
    assert_eq!((command.seq, command.joints, command.t_ns), (seq, 6, 77));
    assert!(command.has(Command::HAS_WRENCH | Command::WRENCH_IN_BASE));
    assert!(command.has(Command::HAS_TEMPERATURE | Command::HAS_DIRECTION));
    assert_eq!(command.wrench[5], 6.0);
    assert_eq!(command.direction[..4], [1, -1, 1, 0]);
    assert_eq!(command.temperature_c[..3], [21.5, 30.0, 31.0]);
    assert!(command.temperature_c[3].is_nan());
    assert!(command.check().is_ok());
    assert_eq!(client.wait_corrected(seq, LIMIT).unwrap().command_seq, seq);
}

#[test]
fn too_many_joints_are_refused_before_they_are_sent() {
    let runtime = Runtime::new("joints");
    let cell = runtime.cell();
    let mut daemon = Daemon::start(&cell);
    let mut client = beside(&mut daemon, move || Client::connect_to(&cell, LIMIT)).unwrap();
    assert!(matches!(
        client.send(&[0.0; 17].into()),
        Err(SendError::InvalidTarget(InvalidTarget::Joints(17)))
    ));
    let none = client.send(&Setpoint::new(&[]));
    assert!(matches!(none, Err(SendError::InvalidTarget(InvalidTarget::Joints(0)))));
    assert!(daemon.turn().is_none());
}

#[test]
fn a_request_is_answered_to_client_and_monitor() {
    let runtime = Runtime::new("ask");
    let cell = runtime.cell();
    let mut daemon = Daemon::start(&cell);
    let answers = beside(&mut daemon, move || {
        let mut client = Client::connect_to(&cell, LIMIT).unwrap();
        let mut monitor = Monitor::connect_to(&cell, LIMIT).unwrap();
        let long = PathBuf::from("x".repeat(300));
        (
            client.reload(Some("/etc/robot.toml".as_ref()), LIMIT).unwrap(),
            monitor.ping(LIMIT).unwrap(),
            client.reload(Some(&long), LIMIT).unwrap_err(),
        )
    });
    assert_eq!(answers.0.message.as_str(), "/etc/robot.toml");
    assert_eq!(answers.1.answer(), Ok(Answer::Done));
    assert!(matches!(answers.2, RequestError::BadPath { .. }));
}

#[test]
fn a_request_that_nobody_answers_ends_in_time() {
    let runtime = Runtime::new("mute");
    let cell = runtime.cell();
    let mut daemon = Daemon::start(&cell);
    let mut client = beside(&mut daemon, move || Client::connect_to(&cell, LIMIT)).unwrap();
    let limit = Duration::from_millis(20);
    assert_eq!(client.ping(limit), Err(RequestError::TimedOut { limit }));
}

#[test]
fn force_in_single_precision_arrives_channel_by_channel_in_double() {
    let runtime = Runtime::new("force");
    let cell = runtime.cell();
    let daemon = Daemon::start(&cell);
    let mut blocks = daemon.side.ports().subscriber::<ForceBlock>().unwrap();
    let mut source = ForceSource::connect_to(&cell, LIMIT).unwrap();
    let samples = [1.0_f32, 10.0, 100.0, 2.0, 20.0, 200.0];
    let force = ForceSamples {
        t_ns: 5,
        rate_hz: 1e4,
        channels: 3,
        frame: WrenchFrame::Tool,
        samples: Samples::F32(&samples),
    };
    source.send(&force).unwrap();
    let block = blocks.take_next().unwrap();
    assert!(block.check().is_ok());
    assert_eq!((block.channel(0), block.channel(2)), (&[1.0, 2.0][..], &[100.0, 200.0][..]));
    assert_eq!(block.channel(3), &[] as &[f64]);
    assert_eq!(block.flags, ForceBlock::INPUT_F32);
    for bad in [ForceSamples { channels: 4, ..force }, ForceSamples { channels: 2, ..force }] {
        assert!(matches!(source.send(&bad), Err(SendError::Invalid { .. })));
    }
    for _ in 0..70 {
        let _ = source.send(&force);
    }
    assert_eq!(source.lost(), 6);
    let last = std::iter::from_fn(|| blocks.take_next()).last().unwrap();
    assert_eq!((last.seq, last.samples_before), (65, 128));
}

#[test]
fn a_horizon_arrives_with_the_command_that_it_follows_and_without_more_than_it_has() {
    let runtime = Runtime::new("horizon");
    let cell = runtime.cell();
    let mut daemon = Daemon::start(&cell);
    let mut client = beside(&mut daemon, move || Client::connect_to(&cell, LIMIT)).unwrap();
    let mut horizons = daemon.side.ports().subscriber::<Horizon>().unwrap();

    let known = [[0.1, 0.2, 0.3], [1.1, 1.2, 1.3]];
    assert_eq!(client.set_horizon(&known), Ok(2));
    client.send(&[0.0; 3].into()).unwrap();
    let (command, horizon) = (daemon.turn().unwrap(), horizons.take_newest().unwrap());
    assert_eq!(horizon.check(), Ok(()));
    assert_eq!((horizon.seq, horizon.count), (1, 2));
    assert_eq!((horizon.session, horizon.command_seq), (command.session, command.seq));
    assert!(horizon.sent_ns > 0 && horizon.sent_ns <= command.sent_ns);
    for (arrived, sent) in horizon.points().iter().zip(known) {
        assert_eq!((&arrived[..3], &arrived[3..]), (&sent[..], &[0.0; JOINTS_MAX - 3][..]));
    }

    // Fewer joints leave nothing of the joints before, fewer points nothing of the points.
    assert_eq!(client.set_horizon(&[[9.0], [9.5]]), Ok(2));
    assert_eq!(client.set_horizon(&[[2.0]]), Ok(1), "the newest replaces the others");
    let horizon = horizons.take_newest().unwrap();
    assert_eq!((horizon.seq, horizon.command_seq, horizon.points().len()), (3, 2, 1));
    assert_eq!(horizon.points()[0][..2], [2.0, 0.0]);
    assert!(horizons.take_newest().is_none());

    client.start_anew();
    assert_eq!(client.set_horizon::<6>(&[]), Ok(0));
    let horizon = horizons.take_newest().unwrap();
    assert_eq!((horizon.check(), horizon.count, horizon.command_seq), (Ok(()), 0, 1));
    assert_ne!(horizon.session, command.session);
}

#[test]
fn of_a_horizon_that_is_too_long_the_first_points_are_sent_and_of_a_bad_one_none() {
    let runtime = Runtime::new("horizon-bad");
    let cell = runtime.cell();
    let mut daemon = Daemon::start(&cell);
    let mut client = beside(&mut daemon, move || Client::connect_to(&cell, LIMIT)).unwrap();
    let mut horizons = daemon.side.ports().subscriber::<Horizon>().unwrap();

    let mut long: Vec<[f64; 6]> = (0..HORIZON_POINTS_MAX + 2).map(|k| [k as f64; 6]).collect();
    long[HORIZON_POINTS_MAX][0] = f64::NAN; // not sent, so not looked at
    assert_eq!(client.set_horizon(&long), Ok(HORIZON_POINTS_MAX));
    let horizon = horizons.take_newest().unwrap();
    assert_eq!((horizon.check(), horizon.points().len()), (Ok(()), HORIZON_POINTS_MAX));
    assert_eq!(horizon.points()[HORIZON_POINTS_MAX - 1][5], (HORIZON_POINTS_MAX - 1) as f64);

    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let points = [[0.0; 6], [0.0, 0.0, bad, bad, 0.0, 0.0]];
        let refused = client.set_horizon(&points).unwrap_err();
        assert_eq!(refused, SendError::HorizonNotFinite { point: 2, joint: 3 });
        assert_eq!(refused.kind(), ErrorKind::Argument);
    }
    let none = client.set_horizon::<0>(&[[]]);
    assert_eq!(none, Err(SendError::InvalidTarget(InvalidTarget::Joints(0))));
    assert_eq!(
        client.set_horizon(&[[0.0; 17]]),
        Err(SendError::InvalidTarget(InvalidTarget::Joints(17)))
    );
    let torn = client.set_horizon_flat(&[0.0; 7], 6);
    assert!(matches!(torn, Err(SendError::Invalid { value: 7, .. })), "{torn:?}");
    assert!(horizons.take_newest().is_none(), "nothing was sent");

    assert_eq!(client.set_horizon_flat(&[1.0, 2.0, 3.0, 4.0], 2), Ok(2));
    let horizon = horizons.take_newest().unwrap();
    assert_eq!((horizon.seq, horizon.points()[1][..3].to_vec()), (2, vec![3.0, 4.0, 0.0]));
}

#[test]
fn a_daemon_that_has_restarted_gets_the_next_horizon() {
    let runtime = Runtime::new("horizon-again");
    let cell = runtime.cell();
    let mut daemon = Daemon::start(&cell);
    let mut client = {
        let cell = cell.clone();
        beside(&mut daemon, move || Client::connect_to(&cell, LIMIT)).unwrap()
    };
    let point = [[0.5; 6]];
    assert_eq!(client.set_horizon(&point), Err(SendError::Lost), "nobody takes it");
    let mut horizons = daemon.side.ports().subscriber::<Horizon>().unwrap();
    assert_eq!(client.set_horizon(&point), Ok(1));
    assert_eq!(horizons.take_newest().unwrap().seq, 2);

    drop((horizons, daemon));
    let start = Instant::now();
    while client.connection() != Connection::Lost {
        assert!(start.elapsed() < LIMIT);
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(
        client.set_horizon(&point),
        Err(SendError::Disconnected(DisconnectReason::DaemonLost))
    );
    let mut daemon = Daemon::start(&cell);
    let mut horizons = daemon.side.ports().subscriber::<Horizon>().unwrap();
    while client.connection() == Connection::Lost {
        assert!(start.elapsed() < LIMIT);
        daemon.turn();
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(
        client.set_horizon(&point),
        Err(SendError::Disconnected(DisconnectReason::DaemonRestarted)),
        "said once"
    );
    assert_eq!(client.set_horizon(&point), Ok(1));
    let seq = client.send(&[0.5; 6].into()).unwrap();
    let (command, horizon) = (daemon.turn().unwrap(), horizons.take_newest().unwrap());
    assert_eq!((horizon.seq, horizon.command_seq), (3, seq), "what was not sent has no number");
    assert_eq!(horizon.session, command.session);
}

#[test]
fn without_a_daemon_connecting_ends_in_time_and_says_what_to_do() {
    let runtime = Runtime::new("none");
    let start = Instant::now();
    let refused = Client::connect_to(&runtime.cell(), Duration::from_millis(50)).err().unwrap();
    assert!(start.elapsed() < LIMIT);
    assert!(matches!(refused, ConnectError::TimedOut { .. }));
    assert!(refused.to_string().contains("trued run"), "{refused}");
}

#[test]
fn another_contract_is_refused_at_once() {
    let runtime = Runtime::new("contract");
    let _daemon = Daemon::start(&runtime.cell());
    let current = runtime.cell().dir().join("current");
    let text = std::fs::read_to_string(&current).unwrap();
    std::fs::write(
        &current,
        text.replace(&format!("contract {}\n", shm_schema::CONTRACT_VERSION), "contract 9\n"),
    )
    .unwrap();
    let refused = Client::connect_to(&runtime.cell(), LIMIT).err().unwrap();
    assert!(matches!(refused, ConnectError::Refused(JoinError::VersionMismatch { .. })));
}

#[test]
fn a_daemon_that_goes_and_comes_is_told_and_joined_again() {
    let runtime = Runtime::new("again");
    let cell = runtime.cell();
    let mut daemon = Daemon::start(&cell);
    let mut client = {
        let cell = cell.clone();
        beside(&mut daemon, move || Client::connect_to(&cell, LIMIT)).unwrap()
    };
    let first = client.connection();
    assert!(matches!(client.next_event(), Some(ConnectionEvent::Connected { .. })));

    drop(daemon);
    let start = Instant::now();
    while client.connection() != Connection::Lost {
        assert!(start.elapsed() < LIMIT);
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(
        client.send(&[0.0; 6].into()),
        Err(SendError::Disconnected(DisconnectReason::DaemonLost))
    );
    let target = client.target_for(&[0.3; 6], monotonic_ns()).unwrap();
    assert_eq!(target.source(), Source::Plain);
    assert!(matches!(client.next_event(), Some(ConnectionEvent::Lost { .. })));

    let mut daemon = Daemon::start(&cell);
    while client.connection() == Connection::Lost {
        assert!(start.elapsed() < LIMIT);
        daemon.turn();
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_ne!(client.connection(), first);
    assert_eq!(
        client.ping(LIMIT),
        Err(RequestError::Disconnected(DisconnectReason::DaemonRestarted)),
        "said once"
    );
    assert!(client.send(&[0.0; 6].into()).is_ok());
    assert!(daemon.turn().is_some());
}

#[test]
fn a_new_epoch_of_the_same_daemon_is_no_restart() {
    let runtime = Runtime::new("renewed");
    let cell = runtime.cell();
    let mut daemon = Daemon::start(&cell);
    let mut client = {
        let cell = cell.clone();
        beside(&mut daemon, move || Client::connect_to(&cell, LIMIT)).unwrap()
    };
    let first = client.connection();
    daemon.renew();
    let start = Instant::now();
    while client.connection() == first || client.connection() == Connection::Lost {
        assert!(start.elapsed() < LIMIT);
        daemon.turn();
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(client.send(&[0.0; 6].into()).is_ok(), "the daemon knows what it was told");
}

#[test]
fn a_client_of_another_version_or_user_says_which_while_it_runs() {
    let runtime = Runtime::new("changed");
    let cell = runtime.cell();
    let mut daemon = Daemon::start(&cell);
    let mut client = {
        let cell = cell.clone();
        beside(&mut daemon, move || Client::connect_to(&cell, LIMIT)).unwrap()
    };
    let until = |client: &mut Client, why: Option<DisconnectReason>| {
        let start = Instant::now();
        while client.disconnect_reason() != why {
            assert!(start.elapsed() < LIMIT, "{:?}", client.disconnect_reason());
            std::thread::sleep(Duration::from_millis(1));
        }
        assert_eq!(client.send(&[0.0; 6].into()).err(), why.map(SendError::Disconnected));
    };
    until(&mut client, None);
    // No daemon gives its directory that mode.
    let mode = |mode| std::os::unix::fs::PermissionsExt::from_mode(mode);
    std::fs::set_permissions(cell.dir(), mode(0o755)).unwrap();
    until(&mut client, Some(DisconnectReason::WrongUser));
    std::fs::set_permissions(cell.dir(), mode(0o700)).unwrap();
    until(&mut client, None);
    let current = cell.dir().join("current");
    std::fs::write(&current, "trued.current/9\n").unwrap();
    until(&mut client, Some(DisconnectReason::VersionMismatch));
}
