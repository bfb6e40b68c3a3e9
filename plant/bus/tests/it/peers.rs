//! Two sessions of Zenoh in this process: what is sent, answered and kept.

use std::time::{Duration, Instant};

use bus::message::{History, Kind};
use bus::spool::{BUDGET_BYTES_MIN, Spool};
use bus::zenoh_bus::{Bus, Endpoints, Kept, Part};
use bus::{Keys, fleet};
use serde_json::{Value, json};
use zenoh::bytes::Encoding;
use zenoh::query::QueryTarget;
use zenoh::{Session, Wait};

use crate::place::{Folder, endpoint, until};

/// A cell on the bus of this machine, and a session that asks.
struct Scene {
    _folder: Folder,
    kept: std::sync::Arc<Kept>,
    bus: Option<Bus>,
    session: Session,
    connect: Endpoints,
}

impl Scene {
    fn new() -> Self {
        let folder = Folder::new();
        let spool = Spool::open(&folder.0, BUDGET_BYTES_MIN, 7).unwrap().0;
        let kept = Kept::new(spool, 1_000);
        let endpoint = endpoint();
        let listen = Endpoints { listen: vec![endpoint.clone()], ..Endpoints::default() };
        let keys = Keys::new("line", "cell").unwrap();
        let bus = Bus::open(&listen, keys, std::sync::Arc::clone(&kept)).unwrap();
        let connect = Endpoints { connect: vec![endpoint], ..Endpoints::default() };
        let session = connect.open(Part::Client).unwrap();
        Self { _folder: folder, kept, bus: Some(bus), session, connect }
    }

    fn send(&self, kind: Kind, text: &Value) {
        let bytes = serde_json::to_vec(text).unwrap();
        self.kept.spool().append(&bytes).unwrap();
        self.bus.as_ref().unwrap().send(kind, bytes).unwrap();
    }

    /// Answers by key, as JSON; an error as text.
    fn query(&self, selector: &str) -> Vec<(String, Value)> {
        let query = self.session.get(selector).target(QueryTarget::All);
        let replies = query.timeout(Duration::from_secs(5)).wait().unwrap();
        let mut answers = Vec::new();
        while let Ok(reply) = replies.recv() {
            answers.push(match reply.result() {
                Ok(sample) => {
                    assert_eq!(*sample.encoding(), Encoding::APPLICATION_JSON);
                    let json = serde_json::from_slice(&sample.payload().to_bytes()).unwrap();
                    (sample.key_expr().to_string(), json)
                }
                Err(why) => (String::new(), why.payload().try_to_string().unwrap().into()),
            });
        }
        answers.sort_by(|a, b| a.0.cmp(&b.0));
        answers
    }

    fn history(&self, from: u64) -> History {
        let answers = self.query(&format!("trued/line/cell/history?from={from}"));
        assert_eq!(answers.len(), 1);
        serde_json::from_value(answers[0].1.clone()).unwrap()
    }
}

#[test]
fn a_subscriber_sees_each_kind_at_its_key_as_json() {
    let scene = Scene::new();
    let subscriber = scene.session.declare_subscriber("trued/*/*/*").wait().unwrap();
    // A subscription takes a moment to reach the other side; what is sent before is in the history.
    let sample = until("a sample", || {
        scene.send(Kind::Event, &json!({"n": 1}));
        subscriber.try_recv().ok().flatten()
    });
    assert_eq!(sample.key_expr().as_str(), "trued/line/cell/event");
    assert_eq!(*sample.encoding(), Encoding::APPLICATION_JSON);
    assert_eq!(&*sample.payload().to_bytes(), br#"{"n":1}"#);
}

#[test]
fn the_last_message_of_each_kind_is_answered_and_the_token_goes_with_the_bridge() {
    let mut scene = Scene::new();
    scene.send(Kind::Summary, &json!({"n": 1}));
    scene.send(Kind::Health, &json!({"n": 2}));
    scene.send(Kind::Summary, &json!({"n": 3}));
    let answers = until("two answers", || {
        Some(scene.query("trued/line/*/*")).filter(|answers| answers.len() == 3)
    });
    let keys: Vec<&str> = answers.iter().map(|(key, _)| key.as_str()).collect();
    let expected = ["trued/line/cell/health", "trued/line/cell/history", "trued/line/cell/summary"];
    assert_eq!(keys, expected);
    assert_eq!((&answers[0].1, &answers[2].1), (&json!({"n": 2}), &json!({"n": 3})));
    assert_eq!(scene.query("trued/other/*/summary"), []);
    let tokens = |scene: &Scene| {
        let replies = scene.session.liveliness().get("trued/*/*/alive").wait().unwrap();
        replies.iter().filter(|reply| reply.result().is_ok()).count()
    };
    assert_eq!(tokens(&scene), 1);
    scene.bus = None;
    until("the end of the token", || (tokens(&scene) == 0).then_some(()));
}

#[test]
fn what_was_missed_is_answered_in_order_page_by_page_and_what_fell_out_is_told() {
    let scene = Scene::new();
    for n in 1..=500_u64 {
        scene.send(Kind::Event, &json!({"n": n, "filling": "x".repeat(5_000)}));
    }
    let (mut from, mut numbers) = (1, Vec::new());
    let next = loop {
        let history = scene.history(from);
        assert_eq!(history.stream, 7);
        assert!(numbers.is_empty() || history.from == from, "{from}");
        from = history.from + history.messages.len() as u64;
        for message in &history.messages {
            let message: Value = serde_json::from_str(message.get()).unwrap();
            numbers.push(message["n"].as_u64().unwrap());
        }
        if from == history.next {
            break history;
        }
    };
    assert_eq!((next.next, numbers.last()), (501, Some(&500)));
    assert_eq!(numbers, (next.first..=500).collect::<Vec<_>>());
    assert!(next.first > 1 && next.first < 400, "the budget holds a part: {}", next.first);
    let refused = scene.query("trued/line/cell/history?from=three");
    assert!(refused[0].1.as_str().unwrap().contains("expected the number"), "{refused:?}");
}

#[test]
fn sending_does_not_wait_for_a_subscriber_that_stalls() {
    let scene = Scene::new();
    // Its callback never returns, so that nothing is taken off the link any more.
    let (entered, stalls) = std::sync::mpsc::channel();
    let (_hold, held) = std::sync::mpsc::channel::<()>();
    let held = std::sync::Mutex::new(held);
    let stalled = scene.connect.open(Part::Client).unwrap();
    let subscriber = stalled.declare_subscriber("trued/**").callback(move |_| {
        let _ = entered.send(());
        let _ = held.lock().unwrap().recv();
    });
    let subscriber = subscriber.wait().unwrap();
    until("the stall", || {
        scene.send(Kind::Event, &json!({"n": 0}));
        stalls.try_recv().ok()
    });
    let mut longest = Duration::ZERO;
    for n in 0..4_000 {
        let message = serde_json::to_vec(&json!({"n": n, "filling": "x".repeat(6_000)})).unwrap();
        let begun = Instant::now();
        scene.bus.as_ref().unwrap().send(Kind::Summary, message).unwrap();
        longest = longest.max(begun.elapsed());
    }
    eprintln!("24 MB to a subscriber that stalls: longest {longest:?}");
    assert!(longest < Duration::from_secs(1), "{longest:?}");
    drop(_hold);
    drop(subscriber);
}

#[test]
fn a_summary_of_another_version_is_told_and_not_shown_as_a_cell() {
    let scene = Scene::new();
    scene.send(Kind::Summary, &json!({"schema": "trued.plant/2"}));
    let question = fleet::Question {
        group: None,
        expected: vec!["line/other".to_owned()],
        within: Duration::from_secs(5),
    };
    let fleet = until("an answer", || {
        Some(fleet::query_fleet(&scene.connect, &question).unwrap())
            .filter(|fleet| !fleet.unreadable.is_empty())
    });
    assert!(fleet.cells.is_empty() && fleet.needs_attention(), "{fleet:?}");
    assert!(fleet.unreadable[0].starts_with("trued/line/cell/summary: "), "{fleet:?}");
    assert_eq!(fleet.missing, ["line/other"]);
}
