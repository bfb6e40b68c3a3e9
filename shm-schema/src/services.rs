//! The services of an epoch: names, numbers of participants, buffer sizes.
//!
//! Invariant: the daemon creates all of them; other processes only open them. Each carries the layout hash of
//! its payload as an attribute, as the transport compares only type names and sizes.

use core::fmt::Debug;

use iceoryx2::node::Node;
use iceoryx2::prelude::{
    AttributeSpecifier, AttributeVerifier, IceoryxSend, Service, ZeroCopySend,
};
use iceoryx2::service::port_factory::{publish_subscribe, request_response};

use crate::layout::{Payload, hash_text, mix};
use crate::{
    Command, Corrected, ForceBlock, Horizon, MeasuredPoint, Request, Response, RobotState,
    Spectrum, Status, Verdict,
};

/// Version of services and payloads as a whole: changes with any change of meaning.
pub const CONTRACT_VERSION: u32 = 7;

/// Layout hash of all payloads together.
pub const CONTRACT_HASH: u64 = {
    let hash = hash_text("trued.contract");
    let hash = mix(hash, Command::LAYOUT_HASH);
    let hash = mix(hash, Corrected::LAYOUT_HASH);
    let hash = mix(hash, ForceBlock::LAYOUT_HASH);
    let hash = mix(hash, RobotState::LAYOUT_HASH);
    let hash = mix(hash, Horizon::LAYOUT_HASH);
    let hash = mix(hash, MeasuredPoint::LAYOUT_HASH);
    let hash = mix(hash, Verdict::LAYOUT_HASH);
    let hash = mix(hash, Spectrum::LAYOUT_HASH);
    let hash = mix(hash, Status::LAYOUT_HASH);
    let hash = mix(hash, Request::LAYOUT_HASH);
    mix(hash, Response::LAYOUT_HASH)
};

/// Version of the transport; all processes of a domain must use the same one.
pub(crate) const TRANSPORT_VERSION: &str = "0.10.0";

/// Largest number of processes in one epoch: daemon, cell, force source, monitors, and terminated ones not yet released.
const NODES_MAX: usize = 32;
/// Monitors: readers of `/vibration`, `/spectrum` and `/status`, and clients of `/control`.
const MONITORS_MAX: usize = 16;
/// Places for them and for the cell, whose place no monitor can take.
pub(crate) const READERS_MAX: usize = MONITORS_MAX + 1;

/// Queue of a service: number of readers, buffer, history, overflow.
#[derive(Debug, Clone, Copy)]
pub struct QueueSettings {
    pub(crate) subscribers: usize,
    pub(crate) buffer: usize,
    pub(crate) history: usize,
    pub(crate) overflow: bool,
}

impl QueueSettings {
    /// Number of places reserved for the cell.
    pub(crate) const fn reserved_for_cell(&self) -> usize {
        if self.subscribers == READERS_MAX { 1 } else { 0 }
    }
}

/// Measured points that wait for the next cycle: those of an instrument at 1 kHz within 64 ms.
const MEASURED_BUFFER: usize = 64;

const NEWEST: QueueSettings =
    QueueSettings { subscribers: 1, buffer: 1, history: 0, overflow: true };

/// A payload with its own service. Sealed: the list of services is closed.
pub trait Topic: Payload + factory::ServiceFactory {
    /// Name of its service.
    const SERVICE: &'static str;
    /// Queue of the service.
    const KEEPING: QueueSettings;
}

pub(crate) mod factory {
    use super::{IceoryxSend, PubSub, Service, Services, ZeroCopySend};
    /// The port factory of a payload among the services.
    pub trait ServiceFactory:
        IceoryxSend + ZeroCopySend + core::fmt::Debug + Sized + 'static
    {
        #[doc(hidden)]
        fn factory<S: Service>(services: &Services<S>) -> &PubSub<S, Self>;
    }
}

macro_rules! topics {
    ($($payload:ident = $field:ident $name:literal $keeping:expr;)*) => { $(
        impl Topic for $payload {
            const SERVICE: &'static str = $name;
            const KEEPING: QueueSettings = $keeping;
        }
        impl factory::ServiceFactory for $payload {
            fn factory<S: Service>(services: &Services<S>) -> &PubSub<S, Self> {
                &services.$field
            }
        }
    )* };
}
topics! {
    Command = command "command" NEWEST;
    Corrected = corrected "corrected" NEWEST;
    ForceBlock = force "force" QueueSettings { subscribers: 1, buffer: 64, history: 0, overflow: false };
    RobotState = state "state" NEWEST;
    Horizon = horizon "horizon" NEWEST;
    MeasuredPoint = measured "measured"
        QueueSettings { subscribers: 1, buffer: MEASURED_BUFFER, history: 0, overflow: true };
    Verdict = vibration "vibration"
        QueueSettings { subscribers: READERS_MAX, buffer: 16, history: 8, overflow: true };
    Spectrum = spectrum "spectrum"
        QueueSettings { subscribers: READERS_MAX, buffer: 4, history: 0, overflow: true };
    Status = status "status"
        QueueSettings { subscribers: READERS_MAX, buffer: 1, history: 1, overflow: true };
}

/// A service could not be created or opened.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("service `/{service}`: {cause}")]
pub struct ServiceError {
    /// Name of the service.
    pub service: &'static str,
    /// The transport's error.
    pub cause: String,
}

pub(crate) type PubSub<S, T> = publish_subscribe::PortFactory<S, T, ()>;
pub(crate) type Control<S> = request_response::PortFactory<S, Request, (), Response, ()>;

/// All services of one epoch.
#[derive(Debug)]
pub struct Services<S: Service> {
    command: PubSub<S, Command>,
    corrected: PubSub<S, Corrected>,
    force: PubSub<S, ForceBlock>,
    state: PubSub<S, RobotState>,
    horizon: PubSub<S, Horizon>,
    measured: PubSub<S, MeasuredPoint>,
    vibration: PubSub<S, Verdict>,
    spectrum: PubSub<S, Spectrum>,
    status: PubSub<S, Status>,
    pub(crate) control: Control<S>,
}

/// Whether services are created (by the daemon) or opened (by all others).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum OpenMode {
    Create,
    Open,
}

impl<S: Service> Services<S> {
    pub(crate) fn open_all(node: &Node<S>, way: OpenMode) -> Result<Self, ServiceError> {
        Ok(Self {
            command: pub_sub(node, way)?,
            corrected: pub_sub(node, way)?,
            force: pub_sub(node, way)?,
            state: pub_sub(node, way)?,
            horizon: pub_sub(node, way)?,
            measured: pub_sub(node, way)?,
            vibration: pub_sub(node, way)?,
            spectrum: pub_sub(node, way)?,
            status: pub_sub(node, way)?,
            control: control(node, way)?,
        })
    }
}

fn pub_sub<S: Service, T: Topic>(
    node: &Node<S>,
    way: OpenMode,
) -> Result<PubSub<S, T>, ServiceError> {
    let fault =
        |cause: &dyn Debug| ServiceError { service: T::SERVICE, cause: format!("{cause:?}") };
    let name = T::SERVICE.try_into().map_err(|e| fault(&e))?;
    let builder = node.service_builder(&name).publish_subscribe::<T>();
    if way == OpenMode::Open {
        let attributes = required(T::LAYOUT_HASH).map_err(|e| fault(&e))?;
        return builder.open_with_attributes(&attributes).map_err(|e| fault(&e));
    }
    builder
        .max_publishers(1)
        .max_subscribers(T::KEEPING.subscribers)
        .max_nodes(NODES_MAX)
        .subscriber_max_buffer_size(T::KEEPING.buffer)
        .subscriber_max_borrowed_samples(2)
        .history_size(T::KEEPING.history)
        .enable_safe_overflow(T::KEEPING.overflow)
        .create_with_attributes(&defined(T::LAYOUT_HASH).map_err(|e| fault(&e))?)
        .map_err(|e| fault(&e))
}

fn control<S: Service>(node: &Node<S>, way: OpenMode) -> Result<Control<S>, ServiceError> {
    let fault =
        |cause: &dyn Debug| ServiceError { service: "control", cause: format!("{cause:?}") };
    let name = "control".try_into().map_err(|e| fault(&e))?;
    let builder = node.service_builder(&name).request_response::<Request, Response>();
    let hash = mix(Request::LAYOUT_HASH, Response::LAYOUT_HASH);
    if way == OpenMode::Open {
        let attributes = required(hash).map_err(|e| fault(&e))?;
        return builder.open_with_attributes(&attributes).map_err(|e| fault(&e));
    }
    builder
        .max_servers(1)
        .max_clients(READERS_MAX)
        .max_nodes(NODES_MAX)
        .max_active_requests_per_client(2)
        .max_response_buffer_size(2)
        .enable_safe_overflow_for_requests(true)
        .enable_safe_overflow_for_responses(true)
        .create_with_attributes(&defined(hash).map_err(|e| fault(&e))?)
        .map_err(|e| fault(&e))
}

type AttributeError = Box<dyn Debug>;

fn boxed<E: Debug + 'static>(e: E) -> AttributeError {
    Box::new(e)
}

fn defined(hash: u64) -> Result<AttributeSpecifier, AttributeError> {
    let key = "layout".try_into().map_err(boxed)?;
    let value = format!("{hash:016x}").as_str().try_into().map_err(boxed)?;
    AttributeSpecifier::new().define(&key, &value).map_err(boxed)
}

fn required(hash: u64) -> Result<AttributeVerifier, AttributeError> {
    let key = "layout".try_into().map_err(boxed)?;
    let value = format!("{hash:016x}").as_str().try_into().map_err(boxed)?;
    AttributeVerifier::new().require(&key, &value).map_err(boxed)
}
