//! The whole way over recordings that this house did not make: `tests/fleet/fleet.py` (kinematics, play and noise of its own), `trued diagnose --batch`,
//! `trued-trends`.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::written::Folder;

const HERE: &str = env!("CARGO_MANIFEST_DIR");

/// The program, where it was built.
fn trued() -> Option<PathBuf> {
    let built = ["release", "debug"]
        .map(|profile| Path::new(HERE).join("../../target").join(profile).join("trued"));
    let given = std::env::var_os("TRUED").map(PathBuf::from);
    given.into_iter().chain(built).find(|path| path.is_file())
}

fn skipped(why: &str) {
    eprintln!("SKIPPED: trends of a generated fleet: {why}");
    let list = Path::new(HERE).join("../../target/tmp/skipped");
    if let Ok(mut file) = std::fs::OpenOptions::new().append(true).create(true).open(list) {
        let _ = std::io::Write::write_fmt(
            &mut file,
            format_args!("SKIPPED: trends of a generated fleet: {why}\n"),
        );
    }
}

#[test]
fn of_four_robots_the_one_that_wears_is_named_with_joint_effect_and_onset() {
    let Some(trued) = trued() else { return skipped("no program `trued` in target/; cargo build") };
    let folder = Folder::new();
    let generator = Path::new(HERE).join("tests/fleet/fleet.py");
    // Fifty recordings each; joint 2 of R3 loses 0.02 mrad more from the 21st on.
    let arguments = [
        "--visits",
        "50",
        "--robot",
        "R3",
        "--joint",
        "2",
        "--onset",
        "20",
        "--growth-mrad",
        "0.02",
    ];
    match Command::new("python3").arg(generator).arg(&folder.0).args(arguments).status() {
        Ok(status) => assert!(status.success()),
        Err(why) => return skipped(&format!("python3: {why}")),
    }
    let run = |program: &Path, arguments: &[&str]| {
        Command::new(program).current_dir(&folder.0).args(arguments).output().unwrap()
    };
    let trued = &trued;
    // Two shards at once, as a plant would run them.
    std::thread::scope(|scope| {
        for shard in ["1/2", "2/2"] {
            scope.spawn(move || {
                let arguments = [
                    "diagnose",
                    "--quiet",
                    "--batch",
                    "fleet.toml",
                    "--out",
                    "results",
                    "--threads",
                    "1",
                    "--shard",
                    shard,
                ];
                let output = run(trued, &arguments);
                assert!(output.status.success(), "{output:?}");
            });
        }
    });
    let output = run(Path::new(env!("CARGO_BIN_EXE_trued-trends")), &["results", "--json"]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let alerts = answer["alerts"].as_array().unwrap();
    assert!(alerts.iter().all(|alert| alert["robot"] == "R3"), "{answer:#}");
    let alert = &alerts[0];
    assert_eq!(
        (&alert["effect"], &alert["joint"], &alert["kind"]),
        (&"backlash".into(), &2.into(), &"growth".into())
    );
    let onset = alert["since"]["recording"].as_u64().unwrap();
    assert!(onset.abs_diff(21) <= 10, "{alert:#}");
}
