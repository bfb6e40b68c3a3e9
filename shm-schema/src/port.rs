//! Typed ports for sending and receiving.
//!
//! Invariants: sending never blocks and never fails; it returns whether the message was
//! delivered. Receiving never blocks. Neither makes a system call or allocates, except for the one block that
//! the transport allocates per sent message. Ports of the daemon stay in the thread that created them.

use iceoryx2::identifiers::UniqueClientId;
use iceoryx2::port::client::Client as IoxClient;
use iceoryx2::port::publisher::{Publisher as IoxPublisher, PublisherCreateError};
use iceoryx2::port::server::Server as IoxServer;
use iceoryx2::port::subscriber::{Subscriber as IoxSubscriber, SubscriberCreateError};
use iceoryx2::prelude::{
    BackpressureStrategy, CallbackProgression, PortFactory as _, Service, ipc,
};
use iceoryx2::sample::Sample;
use iceoryx2::service::port_factory::client::ClientCreateError;

use crate::services::{READERS_MAX, Services, Topic};
use crate::{Request, Response};

/// A port could not be created.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PortError {
    /// The only place is occupied by another process, or by one that has just terminated.
    #[error(
        "service `/{service}`: the {port} is in use by another process, or the daemon has not cleaned up yet; retry"
    )]
    Occupied {
        /// Name of the service.
        service: &'static str,
        /// Publisher, subscriber, client or server.
        port: &'static str,
    },
    /// The transport refused.
    #[error(
        "service `/{service}`: cannot create the {port} ({cause}); check whether shared memory is full"
    )]
    Refused {
        /// Name of the service.
        service: &'static str,
        /// Publisher, subscriber, client or server.
        port: &'static str,
        /// Error of the transport.
        cause: String,
    },
}

/// Result of sending a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SendOutcome {
    /// Delivered to the reader's buffer.
    Delivered,
    /// No reader is connected.
    NoReader,
    /// The reader is too slow, or the transport failed: the message is lost, and counted.
    Lost,
}

/// Sends messages of one type.
#[derive(Debug)]
pub struct Publisher<T: Topic, S: Service = ipc::Service> {
    port: IoxPublisher<S, T, ()>,
    service: std::sync::Arc<Services<S>>,
    lost: u64,
}

impl<T: Topic, S: Service> Publisher<T, S> {
    pub(crate) fn new(services: &std::sync::Arc<Services<S>>) -> Result<Self, PortError> {
        let port = T::factory(services)
            .publisher_builder()
            .max_loaned_samples(1)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| match e {
                PublisherCreateError::ExceedsMaxSupportedPublishers => occupied::<T>("publisher"),
                e => refused::<T>("publisher", &e),
            })?;
        Ok(Self { port, service: services.clone(), lost: 0 })
    }

    /// Sends a copy; never blocks.
    pub fn send(&mut self, message: &T) -> SendOutcome {
        match self.port.send_copy(*message) {
            Ok(0) if !self.has_reader() => SendOutcome::NoReader,
            Ok(0) | Err(_) => {
                self.lost += 1;
                SendOutcome::Lost
            }
            Ok(_) => SendOutcome::Delivered,
        }
    }

    /// Messages lost at this port so far.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// Whether a reader is connected. A killed reader counts until its place is released.
    #[must_use]
    pub fn has_reader(&self) -> bool {
        T::factory(&self.service).dynamic_config().number_of_subscribers() > 0
    }
}

/// Receives messages of one type.
#[derive(Debug)]
pub struct Subscriber<T: Topic, S: Service = ipc::Service> {
    port: IoxSubscriber<S, T, ()>,
    failures: u64,
}

impl<T: Topic, S: Service> Subscriber<T, S> {
    /// One that leaves `kept` places to others.
    pub(crate) fn new(services: &Services<S>, kept: usize) -> Result<Self, PortError> {
        let taken = T::factory(services).dynamic_config().number_of_subscribers();
        if taken + kept >= T::KEEPING.subscribers {
            return Err(occupied::<T>("subscriber"));
        }
        let port = T::factory(services)
            .subscriber_builder()
            .buffer_size(T::KEEPING.buffer)
            .history_request(T::KEEPING.history)
            .create()
            .map_err(|e| match e {
                SubscriberCreateError::ExceedsMaxSupportedSubscribers => {
                    occupied::<T>("subscriber")
                }
                e => refused::<T>("subscriber", &e),
            })?;
        Ok(Self { port, failures: 0 })
    }

    /// The oldest message not yet taken.
    pub fn take_next(&mut self) -> Option<T> {
        self.receive().map(|sample| *sample.payload())
    }

    /// The newest message; older ones are dropped. Reads at most the service's buffer: messages that arrive meanwhile are returned by the next call.
    pub fn take_newest(&mut self) -> Option<T> {
        self.read_newest(|message| *message)
    }

    /// The same, read in place: for a large message that is rarely full.
    pub fn read_newest<R>(&mut self, read: impl FnOnce(&T) -> R) -> Option<R> {
        let mut newest = None;
        for _ in 0..T::KEEPING.buffer {
            match self.receive() {
                Some(sample) => newest = Some(sample),
                None => break,
            }
        }
        newest.map(|sample| read(sample.payload()))
    }

    fn receive(&mut self) -> Option<Sample<S, T, ()>> {
        let received = self.port.receive();
        self.failures += u64::from(received.is_err());
        received.ok().flatten()
    }

    /// Number of failed receptions.
    #[must_use]
    pub fn failures(&self) -> u64 {
        self.failures
    }
}

/// The daemon's server of `/control`.
#[derive(Debug)]
pub struct ControlServer<S: Service = ipc::Service> {
    port: IoxServer<S, Request, (), Response, ()>,
    services: std::sync::Arc<Services<S>>,
}

impl<S: Service> ControlServer<S> {
    pub(crate) fn new(services: &std::sync::Arc<Services<S>>) -> Result<Self, PortError> {
        let port = services
            .control
            .server_builder()
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| control_refused("server", &e))?;
        Ok(Self { port, services: services.clone() })
    }

    /// Answers one waiting request, if there is one. Allocates: not for the cycle.
    pub fn serve(&mut self, answer: impl FnOnce(&Request) -> Response) -> bool {
        self.serve_with_pid(|request, _| answer(request))
    }

    /// The same, with the id of the requesting process; `None` if it has terminated.
    pub fn serve_with_pid(
        &mut self,
        answer: impl FnOnce(&Request, Option<u32>) -> Response,
    ) -> bool {
        let Ok(Some(request)) = self.port.receive() else { return false };
        let response = answer(request.payload(), self.process_of(request.origin()));
        // The client may have terminated meanwhile.
        let _ = request.send_copy(response);
        true
    }
}

impl<S: Service> ControlServer<S> {
    /// The process of a client, as recorded by the transport.
    fn process_of(&self, client: UniqueClientId) -> Option<u32> {
        let mut node = None;
        self.services.control.dynamic_config().list_clients(|details| {
            if details.client_id != client {
                return CallbackProgression::Continue;
            }
            node = Some(details.node_id);
            CallbackProgression::Stop
        });
        let pid = node?.pid::<S>().ok()?;
        u32::try_from(pid.value()).ok()
    }
}

/// A client of `/control`.
#[derive(Debug)]
pub struct ControlClient<S: Service = ipc::Service> {
    port: IoxClient<S, Request, (), Response, ()>,
}

/// A request whose answer is pending.
#[derive(Debug)]
pub struct PendingResponse<S: Service = ipc::Service> {
    pending: iceoryx2::pending_response::PendingResponse<S, Request, (), Response, ()>,
}

impl<S: Service> ControlClient<S> {
    /// One that leaves `kept` places to others.
    pub(crate) fn new(services: &Services<S>, kept: usize) -> Result<Self, PortError> {
        let occupied = PortError::Occupied { service: "control", port: "client" };
        if services.control.dynamic_config().number_of_clients() + kept >= READERS_MAX {
            return Err(occupied);
        }
        let port = services
            .control
            .client_builder()
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| match e {
                ClientCreateError::ExceedsMaxSupportedClients => occupied,
                e => control_refused("client", &e),
            })?;
        Ok(Self { port })
    }

    /// Sends a request; the answer is polled by [`PendingResponse::answer`]. `None` if the daemon cannot receive it now.
    pub fn send_request(&mut self, request: &Request) -> Option<PendingResponse<S>> {
        let pending = self.port.send_copy(*request).ok()?;
        (pending.number_of_server_connections() > 0).then_some(PendingResponse { pending })
    }
}

impl<S: Service> PendingResponse<S> {
    /// The answer, once it has arrived.
    #[must_use]
    pub fn answer(&self) -> Option<Response> {
        self.pending.receive().ok().flatten().map(|response| *response.payload())
    }
}

fn occupied<T: Topic>(port: &'static str) -> PortError {
    PortError::Occupied { service: T::SERVICE, port }
}

fn refused<T: Topic>(port: &'static str, cause: &dyn core::fmt::Debug) -> PortError {
    PortError::Refused { service: T::SERVICE, port, cause: format!("{cause:?}") }
}

fn control_refused(port: &'static str, cause: &dyn core::fmt::Debug) -> PortError {
    PortError::Refused { service: "control", port, cause: format!("{cause:?}") }
}
