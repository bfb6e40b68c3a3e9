//! One node on a broker: connect, births, kept messages in order, rebirth on request; again after each loss.
//!
//! Sparkplug sends data with quality of service 0, which a broker does not acknowledge. After each page of messages this sends an UNSUBSCRIBE of a topic that it never subscribed to: a broker handles the packets of a connection in order, so that its UNSUBACK
//! says that it has received all before. Until then the place in the spool does not move, and after a loss the page is sent again: a historian may get a message twice (`number` tells), and misses none.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use prost::Message as _;
use recording::files::FileError;
use rumqttc::{Client, Event, LastWill, MqttOptions, Packet, QoS};

use super::cursor::Cursor;
use super::metrics::{self, DEVICE, Metrics, NODE, metric};
use super::payload::{DataType, Metric, Payload, Value};
use crate::keys::Keys;
use crate::message::Kind;
use crate::settings::Settings;
use crate::spool::{Page, SpoolError};
use crate::zenoh_bus::Kept;

/// The device of each node: the cell's robot with its daemon.
pub const DEVICE_ID: &str = "robot";
/// Capacity of the queue of requests to the connection: more than the messages of one page.
const QUEUE: usize = 4096;
/// Largest packet, bytes: above the largest message of the spool.
const PACKET_BYTES_MAX: usize = 1 << 20;
const REBIRTH: &str = "Node Control/Rebirth";

/// An invalid broker address.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("broker `{0}`: expected HOST:PORT")]
pub struct NoBroker(String);

/// What a node signs in with at its broker. The connection is not encrypted.
#[derive(Clone)]
pub struct Credentials {
    /// Name of the user.
    pub user: String,
    /// Its password; never shown.
    pub password: String,
}

impl fmt::Debug for Credentials {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Credentials").field("user", &self.user).finish_non_exhaustive()
    }
}

/// Why a connection ended.
#[derive(Debug, thiserror::Error)]
enum Ended {
    #[error("{0}")]
    Lost(String),
    #[error("the broker sends no {what} within {within:?}")]
    Silent { what: &'static str, within: Duration },
    #[error(transparent)]
    Cursor(#[from] FileError),
    #[error(transparent)]
    Spool(#[from] SpoolError),
}

/// A cell as a Sparkplug node.
#[derive(Debug)]
pub struct Sparkplug {
    host: String,
    port: u16,
    credentials: Option<Credentials>,
    keys: Keys,
    kept: Arc<Kept>,
    settings: Settings,
    cursor: Cursor,
}

impl Sparkplug {
    /// A node for the cell of `keys` on the broker at `address`, reading what `kept` holds; its place stands in `folder`.
    ///
    /// # Errors
    /// [`NoBroker`].
    pub fn new(
        address: &str,
        keys: Keys,
        kept: Arc<Kept>,
        folder: &std::path::Path,
        settings: Settings,
    ) -> Result<Self, NoBroker> {
        let parts = address.rsplit_once(':');
        let parts = parts.and_then(|(host, port)| Some((host, port.parse::<u16>().ok()?)));
        let parts = parts.filter(|(host, _)| !host.is_empty() && !host.contains('/'));
        let (host, port) = parts.ok_or_else(|| NoBroker(address.to_owned()))?;
        let cursor = Cursor::read(folder, &kept.spool());
        Ok(Self { host: host.to_owned(), port, credentials: None, keys, kept, settings, cursor })
    }

    /// The same, signing in at the broker.
    #[must_use]
    pub fn signed_in(self, credentials: Credentials) -> Self {
        Self { credentials: Some(credentials), ..self }
    }

    /// Delivers until `stop` is set; `tell` gets each change of the connection in words.
    pub fn run(&mut self, stop: &AtomicBool, tell: &mut dyn FnMut(&str)) {
        let mut last = String::new();
        let mut tell = |text: &str| {
            if text != last {
                tell(text);
                text.clone_into(&mut last);
            }
        };
        while !stop.load(Relaxed) {
            let ended = self.deliver(stop, &mut tell);
            // Another place, or a later one, is all that can be lost.
            let written = self.cursor.write().map_err(Ended::from);
            if let Err(why) = ended.and(written) {
                tell(&format!("mqtt: {}:{}: {why}", self.host, self.port));
            }
            let ended = Instant::now();
            while !stop.load(Relaxed) && ended.elapsed() < self.settings.broker_retry_every {
                std::thread::sleep(self.settings.look_every);
            }
        }
    }

    fn topic(&self, kind: &str) -> String {
        format!("spBv1.0/{}/{kind}/{}", self.keys.group, self.keys.cell)
    }

    /// One connection, until it is lost or the program ends.
    fn deliver(&mut self, stop: &AtomicBool, tell: &mut dyn FnMut(&str)) -> Result<(), Ended> {
        let bd_seq = self.cursor.connect();
        // No number is used twice, also after a loss of power.
        self.cursor.write()?;
        let mut connection = Connection::open(self, bd_seq)?;
        tell(&format!("mqtt: {}:{}: connected", self.host, self.port));
        let born_at = self.kept.spool().next();
        self.publish_births(&mut connection)?;
        let mut written = Instant::now();
        while !stop.load(Relaxed) {
            connection.poll(self.settings.look_every)?;
            if std::mem::take(&mut connection.is_rebirth_asked) {
                self.publish_births(&mut connection)?;
            }
            let page = self.kept.spool().page(self.cursor.next, self.settings.broker_page_bytes)?;
            if page.from > self.cursor.next {
                let (from, to) = (self.cursor.next, page.from - 1);
                tell(&format!(
                    "mqtt: messages {from} to {to} were removed from the spool before delivery"
                ));
            }
            self.cursor.next = page.from;
            if page.records.is_empty() {
                continue;
            }
            self.send(&mut connection, &page, born_at)?;
            self.cursor.next = page.from + page.records.len() as u64;
            if written.elapsed() >= Duration::from_secs(1) {
                self.cursor.write()?;
                written = Instant::now();
            }
        }
        connection.die(self.topic("NDEATH"))
    }

    /// Birth of the node and of its device, with all metrics that there will be.
    fn publish_births(&self, connection: &mut Connection) -> Result<(), Ended> {
        let now = now_unix_ms();
        let version = Value::String(env!("CARGO_PKG_VERSION").to_owned());
        let mut node = vec![
            bd_seq_metric(connection.bd_seq, now),
            metric(REBIRTH, DataType::Boolean, Value::Boolean(false), now),
            metric("bridge_version", DataType::String, version, now),
        ];
        node.extend(metrics::unknown(NODE, now));
        connection.seq = 0;
        connection.publish(self.topic("NBIRTH"), node)?;
        let last = self.kept.last(Kind::Summary).and_then(|last| metrics::of(&last, false));
        let device = match last {
            Some(Metrics::Device(device)) => device,
            _ => metrics::unknown(DEVICE, now),
        };
        connection.publish(format!("{}/{DEVICE_ID}", self.topic("DBIRTH")), device)
    }

    /// Sends a page, and waits until the broker has it.
    fn send(&self, connection: &mut Connection, page: &Page, born_at: u64) -> Result<(), Ended> {
        for (number, record) in (page.from..).zip(&page.records) {
            match metrics::of(record, number < born_at) {
                Some(Metrics::Node(node)) => connection.publish(self.topic("NDATA"), node)?,
                Some(Metrics::Device(device)) => {
                    let topic = format!("{}/{DEVICE_ID}", self.topic("DDATA"));
                    connection.publish(topic, device)?;
                }
                None => {}
            }
        }
        let client = &connection.client;
        client.try_unsubscribe(self.topic("NDATA")).map_err(|why| Ended::Lost(why.to_string()))?;
        connection.wait_for("UNSUBACK", |packet| matches!(packet, Packet::UnsubAck(_)))
    }
}

fn now_unix_ms() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_millis() as u64)
}

fn bd_seq_metric(bd_seq: u8, now: u64) -> Metric {
    metric("bdSeq", DataType::Int64, Value::Long(u64::from(bd_seq)), now)
}

/// A connection to the broker.
struct Connection {
    client: Client,
    packets: Receiver<Result<Packet, String>>,
    commands: String,
    within: Duration,
    bd_seq: u8,
    /// Of the next message.
    seq: u8,
    is_rebirth_asked: bool,
}

impl Connection {
    /// Connects, with the node's death as will, and subscribes to its commands.
    fn open(node: &Sparkplug, bd_seq: u8) -> Result<Self, Ended> {
        let id = format!("trued-{}-{}", node.keys.group, node.keys.cell);
        let mut options = MqttOptions::new(id, node.host.as_str(), node.port);
        let metrics = vec![bd_seq_metric(bd_seq, now_unix_ms())];
        let death = Payload { timestamp: Some(now_unix_ms()), metrics, seq: None };
        let topic = node.topic("NDEATH");
        options
            .set_last_will(LastWill::new(topic, death.encode_to_vec(), QoS::AtLeastOnce, false))
            .set_keep_alive(node.settings.broker_keep_alive)
            .set_clean_session(true)
            .set_max_packet_size(PACKET_BYTES_MAX, PACKET_BYTES_MAX);
        if let Some(Credentials { user, password }) = &node.credentials {
            options.set_credentials(user, password);
        }
        let (client, mut loop_) = Client::new(options, QUEUE);
        let (hand_over, packets) = channel();
        // It ends with the connection, or when this side is dropped.
        std::thread::spawn(move || {
            for event in loop_.iter() {
                let packet = match event {
                    Ok(Event::Incoming(packet)) => Ok(packet),
                    Ok(Event::Outgoing(_)) => continue,
                    Err(why) => Err(why.to_string()),
                };
                let is_over = packet.is_err();
                if hand_over.send(packet).is_err() || is_over {
                    break;
                }
            }
        });
        let (commands, within) = (node.topic("NCMD"), node.settings.broker_within);
        let mut connection = Self {
            client,
            packets,
            commands: commands.clone(),
            within,
            bd_seq,
            seq: 0,
            is_rebirth_asked: false,
        };
        let subscribed = connection.client.try_subscribe(commands, QoS::AtLeastOnce);
        subscribed.map_err(|why| Ended::Lost(why.to_string()))?;
        connection.wait_for("SUBACK", |packet| matches!(packet, Packet::SubAck(_)))?;
        Ok(connection)
    }

    fn publish(&mut self, topic: String, metrics: Vec<Metric>) -> Result<(), Ended> {
        let seq = Some(u64::from(self.seq));
        let payload = Payload { timestamp: Some(now_unix_ms()), metrics, seq };
        self.seq = self.seq.wrapping_add(1);
        let sent = self.client.try_publish(topic, QoS::AtMostOnce, false, payload.encode_to_vec());
        sent.map_err(|why| Ended::Lost(why.to_string()))
    }

    /// Waits for a packet, and takes all others that come before it.
    fn wait_for(&mut self, what: &'static str, is: impl Fn(&Packet) -> bool) -> Result<(), Ended> {
        let begun = Instant::now();
        loop {
            match self.next(self.within.saturating_sub(begun.elapsed()))? {
                Some(packet) if is(&packet) => return Ok(()),
                Some(packet) => self.take(&packet),
                None => return Err(Ended::Silent { what, within: self.within }),
            }
        }
    }

    /// Takes what has come; waits for it no longer than `within`.
    fn poll(&mut self, within: Duration) -> Result<(), Ended> {
        if let Some(packet) = self.next(within)? {
            self.take(&packet);
        }
        Ok(())
    }

    fn next(&self, within: Duration) -> Result<Option<Packet>, Ended> {
        match self.packets.recv_timeout(within) {
            Ok(packet) => packet.map(Some).map_err(Ended::Lost),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => {
                Err(Ended::Lost("the connection ended".to_owned()))
            }
        }
    }

    /// The one command: to be born again.
    fn take(&mut self, packet: &Packet) {
        let Packet::Publish(publish) = packet else { return };
        if publish.topic != self.commands {
            return;
        }
        let Ok(command) = Payload::decode(publish.payload.as_ref()) else { return };
        let is_rebirth = |metric: &Metric| {
            metric.name.as_deref() == Some(REBIRTH) && metric.value == Some(Value::Boolean(true))
        };
        self.is_rebirth_asked |= command.metrics.iter().any(is_rebirth);
    }

    /// Tells the node's death, and disconnects.
    fn die(mut self, topic: String) -> Result<(), Ended> {
        let metrics = vec![bd_seq_metric(self.bd_seq, now_unix_ms())];
        let payload = Payload { timestamp: Some(now_unix_ms()), metrics, seq: None };
        let lost = |why: rumqttc::ClientError| Ended::Lost(why.to_string());
        let sent = self.client.try_publish(topic, QoS::AtLeastOnce, false, payload.encode_to_vec());
        sent.map_err(lost)?;
        self.wait_for("PUBACK", |packet| matches!(packet, Packet::PubAck(_)))?;
        self.client.try_disconnect().map_err(lost)?;
        // The end of the connection, which is what was asked for.
        let _ = self.next(self.within);
        Ok(())
    }
}
