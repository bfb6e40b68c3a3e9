//! The plain transport: iceoryx2 with the payloads and settings of trued's real-time services, nothing else.
//!
//! In its own domain; the answering process creates the services, the bench opens them. It uses
//! nothing of trued but the layout of its payloads.

use std::path::Path;
use std::time::Duration;

use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{
    BackpressureStrategy, Config, FileName, Path as IoxPath, SemanticString, ServiceName,
    SignalHandlingMode, ZeroCopySend, ipc,
};
use shm_schema::{Command, Corrected, monotonic_ns};

use super::echo::STOP;
use super::{ANSWER_WITHIN, RoundTrip, WakeMode, poll};
use crate::bench_directory::BenchDirectory;
use crate::error::BenchError;

type Ipc = ipc::Service;

/// Duration of one wait for an event, after which the caller polls again.
const EVENT_WAIT: Duration = Duration::from_millis(100);

/// Sends `Out`, receives `In`.
struct IpcPorts<
    Out: ZeroCopySend + std::fmt::Debug + 'static,
    In: ZeroCopySend + std::fmt::Debug + 'static,
> {
    out: Publisher<Ipc, Out, ()>,
    incoming: Subscriber<Ipc, In, ()>,
    wake: Notifier<Ipc>,
    woken: Listener<Ipc>,
    way: WakeMode,
}

impl<Out, In> IpcPorts<Out, In>
where
    Out: Copy + ZeroCopySend + std::fmt::Debug + 'static,
    In: Copy + ZeroCopySend + std::fmt::Debug + 'static,
{
    fn send(&self, message: Out) -> bool {
        let sent = self.out.send_copy(message).is_ok();
        sent && (self.way == WakeMode::Poll || self.wake.notify().is_ok())
    }

    fn take(&self) -> Option<In> {
        self.incoming.receive().ok().flatten().map(|sample| *sample.payload())
    }

    fn next(&self) -> Option<In> {
        if self.way == WakeMode::Poll {
            return poll(|| self.take());
        }
        let rounds = ANSWER_WITHIN.as_millis() / EVENT_WAIT.as_millis();
        (0..rounds).find_map(|_| {
            self.take().or_else(|| {
                // After the wait, only the presence of a message counts.
                let _ = self.woken.timed_wait(|_| {}, EVENT_WAIT);
                self.take()
            })
        })
    }
}

/// The side of a process.
enum Side {
    Asks(IpcPorts<Command, Corrected>),
    Answers(IpcPorts<Corrected, Command>),
}

/// One side of the plain transport.
pub(crate) struct PlainIpc {
    side: Side,
    _node: Node<Ipc>,
}

impl PlainIpc {
    /// The answering side, which creates all services.
    pub(crate) fn create(dir: &Path) -> Result<Self, BenchError> {
        let node = node(dir)?;
        let side = Side::Answers(open_ports(&node, "back", "there")?);
        Ok(Self { side, _node: node })
    }

    /// The asking side.
    pub(crate) fn open(dir: &Path) -> Result<Self, BenchError> {
        let node = node(dir)?;
        let side = Side::Asks(open_ports(&node, "there", "back")?);
        Ok(Self { side, _node: node })
    }

    pub(crate) fn wait(&mut self, way: WakeMode) {
        match &mut self.side {
            Side::Asks(ends) => ends.way = way,
            Side::Answers(ends) => ends.way = way,
        }
    }

    /// Answers until the last message, or until no message was received for a long time.
    pub(crate) fn answer(&mut self) {
        let Side::Answers(ends) = &self.side else { return };
        let mut silences = 0;
        while silences < 30 {
            let Some(command) = ends.next() else {
                silences += 1;
                continue;
            };
            silences = 0;
            let seq = std::hint::black_box(&command).seq;
            ends.send(Corrected { command_seq: seq, ..Corrected::default() });
            if seq == STOP {
                return;
            }
        }
    }
}

impl RoundTrip for PlainIpc {
    fn round_trip(&mut self, seq: u64) -> Option<u64> {
        let Side::Asks(ends) = &self.side else { return None };
        let command = Command { seq, ..Command::default() };
        let since_ns = monotonic_ns();
        if !ends.send(std::hint::black_box(command)) {
            return None;
        }
        loop {
            let corrected = ends.next()?;
            if std::hint::black_box(&corrected).command_seq == seq {
                return Some(monotonic_ns() - since_ns);
            }
        }
    }
}

fn failed(cause: impl std::fmt::Debug) -> BenchError {
    BenchError::Transport(format!("{cause:?}"))
}

fn node(dir: &Path) -> Result<Node<Ipc>, BenchError> {
    let mut config = Config::default();
    let root = dir.join("p");
    let root = IoxPath::new(root.to_string_lossy().as_bytes()).map_err(failed)?;
    config.global.set_root_path(&root);
    config.global.prefix = FileName::new(BenchDirectory::prefix(dir).as_bytes()).map_err(failed)?;
    NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<Ipc>()
        .map_err(failed)
}

/// The two directions, polled, and an event for each.
fn open_ports<Out, In>(
    node: &Node<Ipc>,
    out: &str,
    incoming: &str,
) -> Result<IpcPorts<Out, In>, BenchError>
where
    Out: Copy + ZeroCopySend + std::fmt::Debug + 'static,
    In: Copy + ZeroCopySend + std::fmt::Debug + 'static,
{
    let name = |name: &str| ServiceName::new(name).map_err(failed);
    macro_rules! service {
        ($payload:ty, $name:expr) => {
            node.service_builder(&name($name)?)
                .publish_subscribe::<$payload>()
                .max_publishers(1)
                .max_subscribers(1)
                .max_nodes(4)
                .subscriber_max_buffer_size(1)
                .subscriber_max_borrowed_samples(2)
                .history_size(0)
                .enable_safe_overflow(true)
                .open_or_create()
                .map_err(failed)?
        };
    }
    let event = |of: &str| {
        let name = name(&format!("{of}-event"))?;
        node.service_builder(&name).event().open_or_create().map_err(failed)
    };
    let publisher = service!(Out, out)
        .publisher_builder()
        .max_loaned_samples(1)
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .create()
        .map_err(failed)?;
    let subscriber =
        service!(In, incoming).subscriber_builder().buffer_size(1).create().map_err(failed)?;
    let wake = event(out)?.notifier_builder().create().map_err(failed)?;
    let woken = event(incoming)?.listener_builder().create().map_err(failed)?;
    Ok(IpcPorts { out: publisher, incoming: subscriber, wake, woken, way: WakeMode::Poll })
}
