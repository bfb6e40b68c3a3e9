//! Output files of commands: they never replace a user's file, are all written or none, and none if
//! the disk is full.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::TRUED;
use crate::program::Place;
use tests::clients::skipped;

const MODEL: &str = "irb1600-6-145";
const MINE: &str = "pose,x_mm\n1,12.5\n";
const PLAN: [&str; 8] = ["plan", "--model", MODEL, "--seed", "1", "--count", "4", "--out"];

/// A path that any command takes for its input.
fn place() -> Place {
    let place = Place::new();
    let rows: Vec<String> = (0..40).map(|k| format!("0.0{k:02},{k},-20,20,0,40,0,1,2,3")).collect();
    let head = "t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm";
    place.file("path.csv", &format!("{head}\n{}\n", rows.join("\n")));
    place.file("path.toml", "schema = \"trued.recording/1\"\nmeasuring_frame = \"base\"\n");
    place
}

#[test]
fn poses_that_were_filled_in_stay_as_they_are_and_nothing_is_written_beside_them() {
    let place = place();
    fs::create_dir(place.path("poses")).unwrap();
    place.file("poses/poses.csv", MINE);
    let done = place.run(&[&PLAN[..], &["poses"]].concat());
    assert!(
        done.code == Some(2) && done.err.contains("poses/poses.csv already exists"),
        "{done:?}"
    );
    assert!(done.err.contains("--overwrite"), "{done:?}");
    assert_eq!(place.read("poses/poses.csv"), MINE);
    assert_eq!(fs::read_dir(place.path("poses")).unwrap().count(), 1, "no orphan");
    place.succeed(&[&PLAN[..], &["poses", "--overwrite"]].concat());
    assert!(place.read("poses/poses.csv").starts_with("t_s"));
}

#[test]
fn every_command_refuses_an_output_that_is_there_before_it_begins() {
    let commands: [(&str, &[&str]); 15] = [
        ("o.toml", &["calibrate", "--model", MODEL, "--out", "o.toml", "path.csv"]),
        (
            "o.html",
            &["calibrate", "--model", MODEL, "--out", "n.toml", "--report", "o.html", "path.csv"],
        ),
        ("o.csv", &["correct", "--model", MODEL, "--out", "o.csv", "path.csv"]),
        ("path.corrected.csv", &["correct", "--model", MODEL, "path.csv"]),
        ("o.csv", &["learn", "--model", MODEL, "--out", "o.csv", "path.csv", "path.csv"]),
        ("o.csv", &["replay", "--model", MODEL, "--corrections", "o.csv", "path.csv"]),
        ("o.toml", &["simulate", "--model", MODEL, "--out", "o", "path.csv"]),
        ("d/model.toml", &["diagnose", "--model", MODEL, "--out", "d", "path.csv"]),
        ("d/cell.toml", &["demo", "--quick", "--out", "d"]),
        ("d/bench.html", &["bench", "--quick", "--out", "d"]),
        ("o.urdf", &["model", "export", MODEL, "--urdf", "o.urdf"]),
        ("o.html", &["spectrum", "--report", "o.html", "path.csv"]),
        ("o.html", &["gears", "--model", MODEL, "--report", "o.html", "path.csv"]),
        ("o.html", &["plan", "--check", "--model", MODEL, "--report", "o.html", "path.csv"]),
        ("o.json", &["model", "presets", "--json", "o.json"]),
    ];
    for (output, arguments) in commands {
        let place = place();
        fs::create_dir(place.path("d")).unwrap();
        place.file(output, MINE);
        let before = (place.names(), fs::read_dir(place.path("d")).unwrap().count());
        let done = place.run(arguments);
        assert!(
            done.code == Some(2) && done.err.contains("already exists"),
            "{arguments:?}: {done:?}"
        );
        assert_eq!(place.read(output), MINE, "{arguments:?}");
        let after = (place.names(), fs::read_dir(place.path("d")).unwrap().count());
        assert_eq!(before, after, "{arguments:?}");
    }
}

#[test]
fn no_result_takes_the_place_of_an_input() {
    let place = place();
    place.file("m.toml", &place.succeed(&["model", "show", MODEL, "--toml"]).out);
    let cell = "schema = \"trued.cell/1\"\ncell = \"demo\"\nmodel = \"m.toml\"\n";
    place.file("cell.toml", cell);
    place.file(
        "fleet.toml",
        "schema = \"trued.manifest/1\"\n[[robot]]\nname = \"A\"\nmodel = \"m.toml\"\n\
         [[recording]]\nrobot = \"A\"\nfiles = [\"path.csv\"]\n",
    );
    let batch = ["diagnose", "--batch", "fleet.toml", "--out", "d"];
    let commands: [(&str, &[&str]); 16] = [
        ("fleet.toml", &batch),
        ("m.toml", &batch),
        ("path.csv", &batch),
        ("path.toml", &batch),
        ("fleet.toml", &["check", "fleet.toml"]),
        ("path.csv", &["check", "path.csv"]),
        ("m.toml", &["check", "cell.toml"]),
        ("m.toml", &["model", "show", "m.toml"]),
        ("path.csv", &["correct", "--model", "m.toml", "--out", "o.csv", "path.csv"]),
        ("m.toml", &["correct", "--model", "m.toml", "--out", "o.csv", "path.csv"]),
        ("path.csv", &["calibrate", "--model", "m.toml", "--out", "o.toml", "path.csv"]),
        ("path.csv", &["diagnose", "--model", "m.toml", "--out", "d", "path.csv"]),
        ("path.csv", &["simulate", "--model", "m.toml", "--out", "o", "path.csv"]),
        ("path.csv", &["replay", "--model", "m.toml", "path.csv"]),
        ("path.csv", &["spectrum", "path.csv"]),
        ("path.csv", &["gears", "--model", "m.toml", "path.csv"]),
    ];
    for (input, arguments) in commands {
        let before = place.read(input);
        let done = place.run(&[arguments, &["--json", input, "--overwrite"]].concat());
        assert_eq!(done.code, Some(2), "{arguments:?} onto {input}: {done:#?}");
        assert_eq!(place.read(input), before, "{arguments:?} onto {input}");
    }
}

#[test]
fn results_are_created_again_without_asking() {
    let place = place();
    let names = ["o.json", "o.html"];
    let made = || {
        place.succeed(&["model", "presets", "--json", "o.json"]);
        place.succeed(&["gears", "--model", MODEL, "--report", "o.html", "path.csv"]);
        names.map(|name| place.read(name))
    };
    let first = made();
    for (name, text) in names.iter().zip(&first) {
        place.file(name, &format!("{text}\nof an earlier version\n"));
    }
    assert_eq!(made(), first);
}

/// Runs a shell in which `$1` is a folder on a disk of that size, `$2` the program; none where the system refuses such a disk.
fn on_a_small_disk(place: &Place, kilobytes: u32, script: &str) -> Option<String> {
    let disk = place.path("disk");
    fs::create_dir_all(&disk).unwrap();
    let mount = format!(
        "mount -t tmpfs -o size={kilobytes}k tmpfs \"$1\" && echo mounted && {{ {script}\n}}"
    );
    let mut command = Command::new("unshare");
    if !rustix::process::geteuid().is_root() {
        command.args(["--user", "--map-root-user"]);
    }
    command.args(["--mount", "sh", "-c", &mount, "sh"]).arg(&disk).arg(TRUED);
    let output = command.current_dir(place.path(".")).output().ok()?;
    let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
    stdout.contains("mounted").then(|| stdout + &String::from_utf8_lossy(&output.stderr))
}

#[test]
fn a_full_disk_leaves_all_outputs_as_they_were_and_no_orphan() {
    let place = place();
    let plan = format!("\"$2\" {} \"$1/poses\"", PLAN.join(" "));
    // Every file takes 4 kB at least: five of them do not fit into twelve.
    let script = format!("{plan}; echo \"code $?\"; ls -A \"$1\"; echo end");
    let Some(output) = on_a_small_disk(&place, 12, &script) else {
        let why = "no mount namespace of its own may be made";
        return skipped(Path::new(env!("CARGO_TARGET_TMPDIR")), "a full disk", why);
    };
    assert!(output.contains("code 3\nend\n") && output.contains("cannot write"), "{output}");
    let before = "mkdir \"$1/poses\"; echo mine > \"$1/poses/poses.csv\"";
    let after = "cat \"$1/poses/poses.csv\"; ls -A \"$1/poses\"; echo end";
    let script = format!("{before}; {plan} --overwrite; echo \"code $?\"; {after}");
    let output = on_a_small_disk(&place, 12, &script).expect("as before");
    assert!(output.contains("code 3\nmine\nposes.csv\nend\n"), "{output}");
}

#[test]
fn a_limit_of_the_file_size_leaves_nothing_half_written() {
    let place = place();
    // Blocks of 512 bytes: the small files fit, the list of poses does not.
    let script = format!("ulimit -f 2; exec \"$0\" {} poses", PLAN.join(" "));
    let output = Command::new("sh")
        .args(["-c", &script, TRUED])
        .current_dir(place.path("."))
        .output()
        .unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{stderr}");
    assert!(stderr.contains("cannot write"), "{stderr}");
    assert!(!place.path("poses").exists(), "{stderr}");
}
