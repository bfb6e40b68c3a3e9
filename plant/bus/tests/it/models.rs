//! Models offered over the bus to a cell with a real daemon: what is taken is corrected by, what is refused changes nothing, and both are told.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde_json::Value;
use shm_schema::Cell;
use trued_client::{Client, Monitor};

use crate::offer::{Owner, SERIAL, model};
use crate::place::{LIMIT, Process, endpoint, plant, skipped, trued, until};

/// A cell of an owner, on the bus.
struct Scene {
    owner: Owner,
    endpoint: String,
}

fn in_a_day_unix_ms() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_millis() as u64 + 86_400_000
}

impl Scene {
    fn new(accept: &str) -> Self {
        let owner = Owner::new(accept);
        let config =
            "schema = \"trued.cell/1\"\ncell = \"cell\"\nmodel = \"robot.toml\"\nmode = \"full\"\n";
        std::fs::create_dir(owner.folder.0.join("run")).unwrap();
        std::fs::write(owner.folder.0.join("cell.toml"), config).unwrap();
        Self { owner, endpoint: endpoint() }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.owner.folder.0.join(name)
    }

    fn daemon(&self, trued: &Path) -> Process {
        let mut command = Command::new(trued);
        command.arg("run").arg("--config").arg(self.path("cell.toml"));
        Process::start(command.env("TRUED_RUNTIME_DIR", self.path("run")), "ready")
    }

    fn bridge(&self, with_models: bool) -> Process {
        let arguments =
            ["bridge", "cell", "--group", "line", "--listen", &self.endpoint, "--spool"];
        let mut command = plant(&arguments);
        command.arg(self.path("spool"));
        if with_models {
            command.arg("--models").arg(self.owner.file());
        }
        Process::start(command.env("TRUED_RUNTIME_DIR", self.path("run")), "ready")
    }

    fn write(&self, name: &str, model: &str, signature: &str) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, model).unwrap();
        std::fs::write(bus::offering::signature_of(&path), signature).unwrap();
        path
    }

    fn offer(&self, model: &Path, arguments: &[&str]) -> (i32, String) {
        let mut command = plant(&["offer", "line/cell", "--connect", &self.endpoint]);
        let output = command.arg(model).args(arguments).output().unwrap();
        let text = [output.stdout, output.stderr].concat();
        (output.status.code().unwrap(), String::from_utf8_lossy(&text).into_owned())
    }

    /// The body of the last event on the bus.
    fn last_event(&self) -> Value {
        let connect = bus::Endpoints { connect: vec![self.endpoint.clone()], ..Default::default() };
        let session = connect.open(bus::zenoh_bus::Part::Client).unwrap();
        let replies = zenoh::Wait::wait(session.get("trued/line/cell/event")).unwrap();
        let reply = replies.recv().unwrap();
        let bytes = reply.result().unwrap().payload().to_bytes().into_owned();
        serde_json::from_slice::<Value>(&bytes).unwrap()["body"].clone()
    }
}

/// Hash of the daemon's model.
fn model_in_use(monitor: &mut Monitor) -> u64 {
    // One that was made after what was asked.
    std::thread::sleep(Duration::from_millis(150));
    until("a status", || monitor.status()).model_hash
}

#[test]
fn an_offered_model_is_loaded_where_the_owner_says_so_and_a_refused_one_changes_nothing_and_is_told()
 {
    let Some(trued) = trued() else {
        return skipped("models offered to a daemon", "no program `trued`");
    };
    let scene = Scene::new("load");
    let owner = &scene.owner;
    let daemon = scene.daemon(&trued);
    let bridge = scene.bridge(true);
    let cell = Cell::at(&scene.path("run"), "cell").unwrap();
    let mut monitor = Monitor::connect_to(&cell, LIMIT).unwrap();
    let before = model_in_use(&mut monitor);
    let good = model(SERIAL, 820.0);
    let good = scene.write("good.toml", &good, &owner.sign(&good, 7, in_a_day_unix_ms()));
    let (code, text) = scene.offer(&good, &[]);
    assert!(code == 0 && text.contains("loaded by the daemon"), "{text}");
    let after = model_in_use(&mut monitor);
    assert_ne!(after, before);
    let loaded = until("the model's event", || {
        Some(scene.last_event()).filter(|event| event["event"] == "model_changed")
    });
    assert_eq!(loaded["to"], format!("{after:016x}"));

    // A new bridge has the counter of the former one.
    bridge.kill();
    let bridge = scene.bridge(true);
    let stranger = Owner::new("load");
    let other = model(SERIAL, 830.0);
    let sister = model("1600-00002", 830.0);
    let narrow = other.replacen("limits_deg = [-180.0, 180.0]", "limits_deg = [170.0, 180.0]", 1);
    let mut client = Client::connect_to(&cell, LIMIT).unwrap();
    let day = in_a_day_unix_ms();
    let torn = other[..other.len() / 2].to_owned();
    let cases = [
        ("replayed", good, "not above 7"),
        ("not_signed", scene.write("a.toml", &other, &stranger.sign(&other, 9, day)), "keys"),
        ("expired", scene.write("b.toml", &other, &owner.sign(&other, 9, 1)), "expired"),
        ("torn", scene.write("c.toml", &torn, &owner.sign(&other, 9, day)), "torn"),
        ("other_robot", scene.write("d.toml", &sister, &owner.sign(&sister, 9, day)), "serial"),
    ];
    let kept = owner.kept();
    for _ in 0..100 {
        let _ = client.exchange(&[0.2, 0.3, -0.2, 0.3, 0.8, 0.1], Duration::from_millis(10));
    }
    for (reason, path, part) in cases {
        let (code, text) = scene.offer(&path, &["--json"]);
        assert!(code == 1 && text.contains(part), "{reason}: {text}");
        let answer: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(
            (&answer["schema"], &answer["body"]["event"]),
            (&"trued.plant/1".into(), &"model_refused".into())
        );
        assert_eq!(answer["body"]["reason"], reason, "{answer:#}");
        assert_eq!(scene.last_event(), answer["body"], "the bus tells the same");
    }
    assert_eq!(owner.kept(), kept);
    let narrow = scene.write("e.toml", &narrow, &owner.sign(&narrow, 9, day));
    let (code, text) = scene.offer(&narrow, &[]);
    assert!(code == 1 && text.contains("move the arm inside"), "{text}");
    let models = |kept: BTreeMap<String, Vec<u8>>| kept.into_keys().collect::<Vec<_>>();
    assert_eq!(models(owner.kept()), models(kept), "what the daemon refused does not stay");
    assert_eq!(model_in_use(&mut monitor), after);
    let kept = owner.kept();
    daemon.kill();
    until("the alarm", || Some(scene.last_event()).filter(|event| event["alarm"] == "daemon_away"));
    let late = scene.write("f.toml", &other, &owner.sign(&other, 10, day));
    let (code, text) = scene.offer(&late, &["--json"]);
    assert!(code == 1 && text.contains("\"daemon_away\""), "{text}");
    assert_eq!(owner.kept(), kept, "the offer is not used up");
    drop(bridge);
}

#[test]
fn an_offer_without_signature_too_large_or_to_many_cells_at_once_is_refused_before_it_is_judged() {
    let scene = Scene::new("stage");
    let _bridge = scene.bridge(true);
    let connect = bus::Endpoints { connect: vec![scene.endpoint.clone()], ..Default::default() };
    let session = connect.open(bus::zenoh_bus::Part::Client).unwrap();
    let text = model(SERIAL, 820.0);
    let signature = scene.owner.sign(&text, 7, in_a_day_unix_ms());
    let large = "x".repeat(bus::offer::MODEL_BYTES_MAX + 1);
    let cases = [
        ("trued/*/*/offer", &text, Some(&signature), "without wildcards"),
        ("trued/line/cell/summary", &text, Some(&signature), "without wildcards"),
        ("trued/line/cell/offer", &text, None, "not a signature"),
        ("trued/line/cell/offer", &text, Some(&large), "not a signature"),
        ("trued/line/cell/offer", &large, Some(&signature), "expected at most"),
    ];
    let before = scene.owner.kept();
    for (key, model, signature, part) in cases {
        let query = session.get(key).payload(model.clone());
        let query = query.attachment(signature.cloned().map(String::into_bytes));
        let replies = zenoh::Wait::wait(query).unwrap();
        let reply = replies.recv().unwrap();
        let why = reply.result().unwrap_err().payload().try_to_string().unwrap().into_owned();
        assert!(why.contains(part), "{part}: {why}");
    }
    assert_eq!(scene.owner.kept(), before);
    let last = scene.last_event();
    assert!(!last["event"].as_str().unwrap().starts_with("model_"), "{last}");
}

#[test]
fn a_staged_model_waits_for_the_owner_and_without_an_owners_file_or_a_daemon_nothing_is_taken() {
    let scene = Scene::new("stage");
    let owner = &scene.owner;
    let text = model(SERIAL, 820.0);
    let signed = scene.write("good.toml", &text, &owner.sign(&text, 7, in_a_day_unix_ms()));
    assert_eq!(scene.offer(&signed, &["--within-s", "1"]).0, 3, "nobody answers");
    let bridge = scene.bridge(false);
    let (code, output) = scene.offer(&signed, &[]);
    assert!(code == 1 && output.contains("without `--models`"), "{output}");
    drop(bridge);
    let bridge = scene.bridge(true);
    let (code, output) = scene.offer(&signed, &[]);
    assert!(code == 0 && output.contains("not loaded into the daemon"), "{output}");
    assert_eq!(scene.last_event()["event"], "model_staged");
    let kept = owner.kept();
    assert_eq!(kept.len(), 3, "{:?}", kept.keys());
    drop(bridge);
    let file = std::fs::read_to_string(owner.file()).unwrap();
    std::fs::write(owner.file(), file.replace("\"stage\"", "\"load\"")).unwrap();
    let _bridge = scene.bridge(true);
    let signed = scene.write("good.toml", &text, &owner.sign(&text, 8, in_a_day_unix_ms()));
    let (code, output) = scene.offer(&signed, &["--json"]);
    assert!(code == 1 && output.contains("\"daemon_away\""), "{output}");
    assert_eq!(owner.kept(), kept);
}
