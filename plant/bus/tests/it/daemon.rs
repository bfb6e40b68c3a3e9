//! With a real daemon: the fleet shows its correction, its end and its return.

use std::path::PathBuf;
use std::process::Command;
use std::time::Duration;

use serde_json::Value;
use shm_schema::Cell;
use trued_client::Client;

use crate::place::{Folder, HERE, LIMIT, Process, endpoint, plant, skipped, trued, until};

const Q_RAD: [f64; 6] = [0.2, 0.3, -0.2, 0.3, 0.8, 0.1];

/// A cell with its daemon and bridge.
struct Scene {
    folder: Folder,
    trued: PathBuf,
    endpoint: String,
}

impl Scene {
    fn new(trued: PathBuf) -> Self {
        let folder = Folder::new();
        std::fs::create_dir(folder.0.join("run")).unwrap();
        let presets = PathBuf::from(HERE).join("../../deploy/presets");
        let model = folder.0.join("model.toml");
        std::fs::copy(presets.join("irb1600-6-145-thesis.toml"), &model).unwrap();
        let config = format!(
            "schema = \"trued.cell/1\"\ncell = \"cell\"\nmodel = \"{}\"\nmode = \"full\"\n",
            model.display()
        );
        std::fs::write(folder.0.join("cell.toml"), config).unwrap();
        Self { folder, trued, endpoint: endpoint() }
    }

    fn daemon(&self) -> Process {
        let mut command = Command::new(&self.trued);
        command.arg("run").arg("--config").arg(self.folder.0.join("cell.toml"));
        Process::start(command.env("TRUED_RUNTIME_DIR", self.folder.0.join("run")), "ready")
    }

    fn bridge(&self) -> Process {
        let spool = self.folder.0.join("spool");
        let arguments = ["bridge", "cell", "--group", "line", "--rate-hz", "10", "--spool"];
        let mut command = plant(&arguments);
        command.arg(spool).args(["--listen", &self.endpoint]);
        Process::start(command.env("TRUED_RUNTIME_DIR", self.folder.0.join("run")), "ready")
    }

    /// Exit code and output of `trued-plant fleet`.
    fn fleet(&self, arguments: &[&str]) -> (i32, String) {
        let output =
            plant(&["fleet", "--connect", &self.endpoint]).args(arguments).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        (output.status.code().unwrap(), text)
    }

    fn row(&self) -> Value {
        let (_, text) = self.fleet(&["--json"]);
        let fleet: Value = serde_json::from_str(&text).unwrap_or_default();
        fleet["cells"][0].clone()
    }
}

/// Commands a posture for a while.
fn command(client: &mut Client, cycles: usize) {
    for _ in 0..cycles {
        let _ = client.exchange(&Q_RAD, Duration::from_millis(10));
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn the_fleet_shows_a_cell_that_corrects_then_that_its_daemon_is_gone_then_that_it_is_back() {
    let Some(trued) = trued() else {
        return skipped("the bus with a daemon", "no program `trued`");
    };
    let scene = Scene::new(trued);
    let daemon = scene.daemon();
    let bridge = scene.bridge();
    let cell = Cell::at(&scene.folder.0.join("run"), "cell").unwrap();
    let mut client = Client::connect_to(&cell, LIMIT).unwrap();
    command(&mut client, 1_000);
    let row = until("a correction", || {
        command(&mut client, 300);
        let row = scene.row();
        (row["correction_rms"].as_f64()? > 1e-5 && row["health"] == "running").then_some(row)
    });
    assert_eq!((&row["group"], &row["cell"]), (&"line".into(), &"cell".into()));
    let mode_and_alarms = (&row["mode"], row["alarms"].as_array().map(Vec::len));
    assert_eq!(mode_and_alarms, (&"full".into(), Some(0)), "{row:#}");
    let version = row["daemon_version"].as_str().unwrap();
    assert!(version.starts_with(env!("CARGO_PKG_VERSION")), "{version}");
    assert_eq!(row["model_hash"].as_str().unwrap().len(), 16);
    assert!(row["model_age_s"].as_f64().unwrap() < 60.0 && row["heard_s"].as_f64().unwrap() < 2.0);
    let (code, text) = scene.fleet(&["--expect", "line/cell"]);
    assert_eq!(code, 0, "{text}");
    assert!(
        text.contains("line/cell") && text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );

    daemon.kill();
    let row = until("its absence", || Some(scene.row()).filter(|row| !row["away"].is_null()));
    assert_eq!(row["alarms"], serde_json::json!(["daemon_away"]));
    let (code, text) = scene.fleet(&[]);
    assert!(code == 1 && text.contains("AWAY") && text.contains("daemon_away"), "{text}");

    let _again = scene.daemon();
    until("its return", || {
        Some(scene.row()).filter(|row| {
            row["away"].is_null() && row["alarms"].as_array().is_some_and(Vec::is_empty)
        })
    });
    drop(bridge);
    assert_eq!(scene.fleet(&[]).0, 3, "nobody answers");
}
