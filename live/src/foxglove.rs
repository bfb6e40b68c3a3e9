//! A stream for Foxglove and PlotJuggler: WebSocket, subprotocol `foxglove.sdk.v1` (the protocol text of the `ws-protocol` repository of Foxglove).
//!
//! Topics, schemas and encoding are those of the recordings: `/trued/status` with each status, `/trued/vibration` with each verdict. Clients may subscribe; nothing
//! else of the protocol is offered (no publishing, no services, no parameters).

#![expect(clippy::result_large_err, reason = "the refusal's type is the library's")]

use std::io;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::thread;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use daemon::records;
use recording::mcap_recording::Topic;
use serde_json::{Value, json};
use tungstenite::handshake::server::{ErrorResponse, Request, Response};
use tungstenite::http::{HeaderValue, StatusCode};
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Bytes, Error, Message, WebSocket};

use crate::access::AccessRequest;
use crate::cell_watch::{CellWatch, ReaderPosition};
use crate::{Access, LiveError};

/// The protocol's names, the current one first.
const PROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
/// How often `stop` and the messages of a client are polled.
const POLL_EVERY: Duration = Duration::from_millis(20);
/// A client that receives nothing for this long is disconnected.
const STALLED_AFTER: Duration = Duration::from_secs(2);
/// Limit on clients; each takes a thread.
const CLIENTS_MAX: usize = 16;
/// Limit on the size of a client's message, bytes: a list of subscriptions.
const MESSAGE_BYTES_MAX: usize = 64 * 1024;
/// Opcode of a message of a channel.
const MESSAGE_DATA: u8 = 1;

/// Serves the stream.
pub(crate) struct Server {
    listener: TcpListener,
    address: SocketAddr,
    cell: String,
    access: Access,
}

impl Server {
    /// Binds the address.
    pub(crate) fn bind(address: SocketAddr, cell: &str, access: Access) -> Result<Self, LiveError> {
        let refused = |why: io::Error| LiveError::Listen { address, why: why.to_string() };
        let listener = TcpListener::bind(address).map_err(refused)?;
        listener.set_nonblocking(true).map_err(refused)?;
        let address = listener.local_addr().map_err(refused)?;
        Ok(Self { listener, address, cell: cell.to_owned(), access })
    }

    /// The address bound.
    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }

    /// Accepts clients until `stop` is set.
    pub(crate) fn run(self, watch: &Arc<CellWatch>, stop: &Arc<AtomicBool>) {
        let clients = Arc::new(AtomicUsize::new(0));
        while !stop.load(Relaxed) {
            let Ok((stream, _)) = self.listener.accept() else {
                thread::sleep(POLL_EVERY);
                continue;
            };
            if clients.load(Relaxed) >= CLIENTS_MAX {
                continue;
            }
            clients.fetch_add(1, Relaxed);
            let (watch, stop, count) = (Arc::clone(watch), Arc::clone(stop), Arc::clone(&clients));
            let (cell, access) = (self.cell.clone(), self.access.clone());
            let thread = thread::Builder::new().name("foxglove client".to_owned());
            let spawned = thread.spawn(move || {
                // On an error the client has left, or uses another protocol.
                let _ = serve(stream, &cell, &access, &watch, &stop);
                count.fetch_sub(1, Relaxed);
            });
            if spawned.is_err() {
                clients.fetch_sub(1, Relaxed);
            }
        }
    }
}

/// A client, and the subscription numbers of its channels.
struct Client {
    socket: WebSocket<TcpStream>,
    subscriptions: Vec<Subscription>,
}

#[derive(Clone, Copy)]
struct Subscription {
    id: u32,
    channel: u32,
}

const STATUS: u32 = 1;
const VERDICT: u32 = 2;

fn serve(
    stream: TcpStream,
    cell: &str,
    access: &Access,
    watch: &CellWatch,
    stop: &AtomicBool,
) -> Result<(), Error> {
    stream.set_nonblocking(false)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(STALLED_AFTER))?;
    stream.set_write_timeout(Some(STALLED_AFTER))?;
    let limits = WebSocketConfig::default()
        .max_message_size(Some(MESSAGE_BYTES_MAX))
        .max_frame_size(Some(MESSAGE_BYTES_MAX));
    let greeted = tungstenite::accept_hdr_with_config(
        stream,
        |request: &Request, response: Response| negotiate(request, response, access),
        Some(limits),
    );
    let mut socket = greeted.map_err(|_| Error::ConnectionClosed)?;
    socket.get_mut().set_read_timeout(Some(POLL_EVERY))?;
    let mut client = Client { socket, subscriptions: Vec::new() };
    for message in [server_info(cell), advertisement()] {
        client.socket.send(Message::text(message.to_string()))?;
    }
    let mut reader = ReaderPosition::default();
    while !stop.load(Relaxed) {
        client.receive()?;
        let news = watch.wait_for_update(&mut reader, Duration::ZERO);
        for verdict in &news.verdicts {
            client.send(VERDICT, &records::verdict(verdict).to_cdr())?;
        }
        if let Some(cell_state) = news.cell_state {
            client.send(STATUS, &records::status(&cell_state.status).to_cdr())?;
        }
    }
    client.socket.close(None)
}

/// Negotiates the protocol.
fn negotiate(
    request: &Request,
    mut response: Response,
    access: &Access,
) -> Result<Response, ErrorResponse> {
    let refused = |code: StatusCode, text: &str| {
        let mut refusal = ErrorResponse::new(Some(text.to_owned()));
        *refusal.status_mut() = code;
        Err(refusal)
    };
    let header = |name: &str| request.headers().get(name).and_then(|value| value.to_str().ok());
    let target = request.uri().to_string();
    let (host, authorization) = (header("Host"), header("Authorization"));
    let origin = header("Origin");
    if !access.allows(AccessRequest { target: &target, host, origin, authorization }) {
        let text =
            "a token is required: ?token=TOKEN; without one, pages of other servers are refused";
        return refused(StatusCode::UNAUTHORIZED, text);
    }
    let offered = header("Sec-WebSocket-Protocol").unwrap_or_default();
    let offers = |name: &&str| offered.split(',').any(|one| one.trim() == *name);
    let Some(protocol) = PROTOCOLS.into_iter().find(|name| offers(name)) else {
        return refused(StatusCode::BAD_REQUEST, "expected the protocol foxglove.sdk.v1");
    };
    let headers = response.headers_mut();
    headers.insert("Sec-WebSocket-Protocol", HeaderValue::from_static(protocol));
    Ok(response)
}

fn server_info(cell: &str) -> Value {
    let name = format!("{} cell {cell}", recording::program::version());
    json!({
        "op": "serverInfo", "name": name, "capabilities": [], "supportedEncodings": [],
        "metadata": {}, "sessionId": std::process::id().to_string(),
    })
}

fn advertisement() -> Value {
    let channel = |id: u32, topic: Topic| {
        json!({
            "id": id, "topic": topic.name, "encoding": "cdr", "schemaName": topic.message,
            "schema": topic.definition, "schemaEncoding": "ros2msg",
        })
    };
    let channels = [channel(STATUS, Topic::status()), channel(VERDICT, Topic::verdict())];
    json!({ "op": "advertise", "channels": channels })
}

impl Client {
    /// Receives messages of the client, for up to [`POLL_EVERY`].
    fn receive(&mut self) -> Result<(), Error> {
        match self.socket.read() {
            Ok(Message::Text(text)) => {
                // Unknown messages are ignored, as the protocol requires.
                if let Ok(request) = serde_json::from_str::<Value>(&text) {
                    self.handle(&request);
                }
                Ok(())
            }
            Ok(Message::Close(_)) => Err(Error::ConnectionClosed),
            Ok(_) => Ok(()),
            Err(Error::Io(why))
                if [io::ErrorKind::WouldBlock, io::ErrorKind::TimedOut].contains(&why.kind()) =>
            {
                Ok(())
            }
            Err(why) => Err(why),
        }
    }

    fn handle(&mut self, request: &Value) {
        let number = |value: &Value| value.as_u64().and_then(|value| u32::try_from(value).ok());
        let list = |key: &str| request[key].as_array().cloned().unwrap_or_default();
        match request["op"].as_str() {
            Some("subscribe") => {
                for one in list("subscriptions") {
                    let ids = number(&one["id"]).zip(number(&one["channelId"]));
                    let Some((id, channel)) = ids else { continue };
                    self.subscriptions.retain(|other| other.id != id && other.channel != channel);
                    if [STATUS, VERDICT].contains(&channel) {
                        self.subscriptions.push(Subscription { id, channel });
                    }
                }
            }
            Some("unsubscribe") => {
                let ended: Vec<u32> = list("subscriptionIds").iter().filter_map(number).collect();
                self.subscriptions.retain(|one| !ended.contains(&one.id));
            }
            _ => {}
        }
    }

    /// Sends a message of a channel if the client has subscribed to it.
    fn send(&mut self, channel: u32, payload: &[u8]) -> Result<(), Error> {
        let wanted = self.subscriptions.iter().find(|one| one.channel == channel);
        let Some(Subscription { id, .. }) = wanted.copied() else { return Ok(()) };
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let now_ns = u64::try_from(now.as_nanos()).unwrap_or_default();
        let mut frame = vec![MESSAGE_DATA];
        frame.extend(id.to_le_bytes());
        frame.extend(now_ns.to_le_bytes());
        frame.extend(payload);
        self.socket.send(Message::Binary(Bytes::from(frame)))
    }
}
