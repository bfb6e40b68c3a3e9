//! The cell on Zenoh: messages are published, the last of each kind and the kept ones are answered, a token says that the bridge is there.
//!
//! A message that cannot be sent at once (no route, a slow or stalled subscriber) is dropped by Zenoh, never waited for: it is in the spool, and whoever sees a gap in
//! the numbers asks for it at the key `history`. Queries of these keys are all that is answered; an offered model is handed to the bridge, one at a time, and to nobody else.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde_json::value::RawValue;
use zenoh::bytes::Encoding;
use zenoh::key_expr::KeyExpr;
use zenoh::liveliness::LivelinessToken;
use zenoh::query::{Query, Queryable};
use zenoh::{Session, Wait};

use crate::keys::Keys;
use crate::message::{History, Kind};
use crate::offer::{MODEL_BYTES_MAX, SIGNATURE_BYTES_MAX};
use crate::spool::Spool;

/// Why the bus cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// An endpoint that is none.
    #[error("endpoint `{0}`: expected tcp/HOST:PORT")]
    Endpoint(String),
    /// Neither an address to connect to nor one to listen at.
    #[error("no endpoint: give --connect tcp/HOST:PORT (a Zenoh router) or --listen tcp/HOST:PORT")]
    NoEndpoint,
    /// Zenoh refuses.
    #[error("Zenoh: cannot {what}: {why}")]
    Zenoh {
        /// What was tried.
        what: &'static str,
        /// What it said.
        why: String,
    },
}

pub(crate) fn zenoh_error(what: &'static str) -> impl FnOnce(zenoh::Error) -> BusError {
    // It appends the place in its own source.
    move |why| {
        let why = why.to_string();
        let reason = why.split(" at /").next().unwrap_or_default().trim_end().to_owned();
        BusError::Zenoh { what, why: reason }
    }
}

/// Where the bus is: Zenoh endpoints, `tcp/HOST:PORT`.
#[derive(Debug, Clone, Default)]
pub struct Endpoints {
    /// Routers or peers to connect to.
    pub connect: Vec<String>,
    /// Addresses to listen at.
    pub listen: Vec<String>,
}

/// How a program takes part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// It goes on, and connects again, whenever the others come and go.
    Peer,
    /// It asks once, and fails where nobody is there.
    Client,
}

impl Endpoints {
    /// A session with these endpoints and no others: no multicast, no gossip.
    ///
    /// # Errors
    /// See [`BusError`].
    pub fn open(&self, part: Part) -> Result<Session, BusError> {
        if self.connect.is_empty() && self.listen.is_empty() {
            return Err(BusError::NoEndpoint);
        }
        for endpoint in self.connect.iter().chain(&self.listen) {
            let address = endpoint.strip_prefix("tcp/").and_then(|rest| rest.rsplit_once(':'));
            address
                .filter(|(host, port)| !host.is_empty() && port.parse::<u16>().is_ok())
                .ok_or_else(|| BusError::Endpoint(endpoint.clone()))?;
        }
        let json_list = |list: &[String]| serde_json::to_string(list).unwrap_or_default();
        let mode = if part == Part::Peer { "\"peer\"" } else { "\"client\"" };
        let mut config = zenoh::Config::default();
        let values = [
            ("mode", mode),
            ("connect/endpoints", &json_list(&self.connect)),
            ("listen/endpoints", &json_list(&self.listen)),
            ("scouting/multicast/enabled", "false"),
            ("scouting/gossip/enabled", "false"),
            ("adminspace/enabled", "false"),
        ];
        for (key, value) in values {
            config.insert_json5(key, value).map_err(zenoh_error("be configured"))?;
        }
        zenoh::open(config).wait().map_err(zenoh_error("open a session"))
    }
}

/// What queries are answered from.
#[derive(Debug)]
pub struct Kept {
    spool: Mutex<Spool>,
    last: Mutex<[Option<Vec<u8>>; 3]>,
    page_bytes: usize,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Kept {
    /// Answers from `spool`, up to `page_bytes` at once.
    #[must_use]
    pub fn new(spool: Spool, page_bytes: usize) -> Arc<Self> {
        Arc::new(Self { spool: Mutex::new(spool), last: Mutex::default(), page_bytes })
    }

    /// The spool.
    pub fn spool(&self) -> MutexGuard<'_, Spool> {
        lock(&self.spool)
    }

    /// The last message of a kind.
    pub(crate) fn last(&self, kind: Kind) -> Option<Vec<u8>> {
        lock(&self.last)[kind as usize].clone()
    }

    /// The kept messages from a number on, of a stream if it is given, as JSON; an error in words.
    fn history(&self, from: Option<&str>, stream: Option<&str>) -> Result<Vec<u8>, String> {
        let from = from.map_or(Ok(0), str::parse);
        let from = from.map_err(|_| "from: expected the number of a message".to_owned())?;
        let stream = stream.map(str::parse).transpose();
        let stream = stream.map_err(|_| "stream: expected the stream of a message".to_owned())?;
        let spool = self.spool();
        let from = stream.map_or(from, |stream| spool.position(stream, from));
        let page = spool.page(from, self.page_bytes).map_err(|why| why.to_string())?;
        let (first, next) = (spool.first(), spool.next());
        let stream = page.stream;
        drop(spool);
        let raw = |bytes| RawValue::from_string(String::from_utf8(bytes).ok()?).ok();
        let messages = page.records.into_iter().map_while(raw).collect();
        let history = History { stream, first, from: page.from, next, messages };
        serde_json::to_vec(&history).map_err(|why| why.to_string())
    }
}

/// A model that was offered, as it came.
#[derive(Debug)]
pub struct Offered {
    query: Query,
    /// The bytes of the model file.
    pub model: Vec<u8>,
    /// The signature file.
    pub signature: String,
}

impl Offered {
    /// Tells who offered it what became of it, with the message of the event.
    pub fn answer(&self, message: Vec<u8>) {
        // Who offered may be gone: the event is on the bus as well.
        let key = self.query.key_expr();
        let _ = self.query.reply(key, message).encoding(Encoding::APPLICATION_JSON).wait();
    }
}

/// A cell on the bus; it is off when this is dropped.
#[derive(Debug)]
pub struct Bus {
    session: Session,
    offers: Receiver<Offered>,
    keys: Keys,
    kept: Arc<Kept>,
    _answers: Queryable<()>,
    _alive: LivelinessToken,
}

impl Bus {
    /// Puts a cell on the bus.
    ///
    /// # Errors
    /// See [`BusError`].
    pub fn open(endpoints: &Endpoints, keys: Keys, kept: Arc<Kept>) -> Result<Self, BusError> {
        let session = endpoints.open(Part::Peer)?;
        let (answer_keys, answered_by) = (keys.clone(), Arc::clone(&kept));
        let (hand_over, offers) = sync_channel(1);
        let answers = session
            .declare_queryable(format!("{}/{}/{}/*", crate::keys::ROOT, keys.group, keys.cell))
            .callback(move |query| match query.payload() {
                None => answer(&query, &answer_keys, &answered_by),
                Some(_) => take_offer(&query, &answer_keys, &hand_over),
            })
            .wait()
            .map_err(zenoh_error("declare its queryable"))?;
        let alive = session.liveliness().declare_token(keys.alive()).wait();
        let alive = alive.map_err(zenoh_error("declare its presence"))?;
        Ok(Self { session, offers, keys, kept, _answers: answers, _alive: alive })
    }

    /// The next offered model; `None` where there is none.
    #[must_use]
    pub fn next_offer(&self) -> Option<Offered> {
        self.offers.try_recv().ok()
    }

    /// Sends a message, and answers with it from now on.
    ///
    /// # Errors
    /// Only where the session was closed: a message without a way out is no error.
    pub fn send(&self, kind: Kind, message: Vec<u8>) -> Result<(), BusError> {
        lock(&self.kept.last)[kind as usize] = Some(message.clone());
        let put = self.session.put(self.keys.of(kind), message);
        put.encoding(Encoding::APPLICATION_JSON).wait().map_err(zenoh_error("send"))
    }
}

/// Hands an offered model over, or says why not: a query with the model as payload and its signature as attachment, at the cell's own key alone.
fn take_offer(query: &Query, keys: &Keys, hand_over: &SyncSender<Offered>) {
    let refuse = |why: String| {
        let _ = query.reply_err(why).encoding(Encoding::TEXT_PLAIN).wait();
    };
    if query.key_expr().as_str() != keys.offer() {
        return refuse(format!("a model is offered at `{}`, without wildcards", keys.offer()));
    }
    let size = query.payload().map_or(0, zenoh::bytes::ZBytes::len);
    if size > MODEL_BYTES_MAX {
        return refuse(format!("the model has {size} bytes; expected at most {MODEL_BYTES_MAX}"));
    }
    let signature = query.attachment().filter(|attached| attached.len() <= SIGNATURE_BYTES_MAX);
    let signature = signature.and_then(|attached| attached.try_to_string().ok());
    let Some(signature) = signature else {
        let message =
            format!("the attachment is not a signature of up to {SIGNATURE_BYTES_MAX} bytes");
        return refuse(message);
    };
    let signature = signature.into_owned();
    let model = query.payload().map_or(Vec::new(), |bytes| bytes.to_bytes().into_owned());
    if hand_over.try_send(Offered { query: query.clone(), model, signature }).is_err() {
        refuse("another offer is being processed; retry in a few seconds".to_owned());
    }
}

/// Answers a query of any of the cell's keys.
fn answer(query: &Query, keys: &Keys, kept: &Kept) {
    let is_asked =
        |key: &str| KeyExpr::try_from(key).is_ok_and(|key| query.key_expr().intersects(&key));
    let json = |key: String, bytes: Vec<u8>| {
        // Who asked may be gone: nobody is left to tell.
        let _ = query.reply(key, bytes).encoding(Encoding::APPLICATION_JSON).wait();
    };
    for kind in Kind::ALL {
        let key = keys.of(kind);
        if let Some(last) = kept.last(kind).filter(|_| is_asked(&key)) {
            json(key, last);
        }
    }
    let key = keys.history();
    if is_asked(&key) {
        let asked = query.parameters();
        match kept.history(asked.get("from"), asked.get("stream")) {
            Ok(history) => json(key, history),
            Err(why) => {
                let _ = query.reply_err(why).encoding(Encoding::TEXT_PLAIN).wait();
            }
        }
    }
}
