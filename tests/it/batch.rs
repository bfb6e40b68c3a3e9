//! `trued diagnose --batch`: the same results for any shards, threads and folders, and after a kill
//! at any time.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use tests::clients::{root, skipped};
use tests::rng::TestRng;

use crate::TRUED;
use crate::diagnose::{BASE, path_of};
use crate::program::{Done, Place};

/// Rows of a recording: few, so that many are diagnosed in little time.
const ROWS: usize = 120;
const RECORDINGS: usize = 6;

/// A folder with a manifest of two robots, of which the second one wears.
fn fleet() -> Place {
    let place = Place::new();
    let path: Vec<String> = path_of(0.05).lines().take(ROWS + 1).map(str::to_owned).collect();
    place.file("path.csv", &(path.join("\n") + "\n"));
    place.file("path.toml", "schema = \"trued.recording/1\"\nmeasuring_frame = \"base\"\n");
    let preset = recording::model::presets::preset(BASE).expect("preset").text;
    let mut manifest = String::from("schema = \"trued.manifest/1\"\nseed = 3\n");
    for robot in ["A", "B"] {
        write!(manifest, "[[robot]]\nname = \"{robot}\"\nmodel = \"{BASE}\"\n").unwrap();
    }
    for number in 0..RECORDINGS {
        let (robot, month) = ([("A", 0.0), ("B", 0.2)][number % 2], number / 2);
        let width = robot.1 * (1.0 + month as f64);
        let effect = format!("[[effect]]\nkind = \"backlash\"\njoint = 3\nwidth_mrad = {width}\n");
        place.file("truth.toml", &format!("{preset}\n{effect}"));
        let (name, seed) = (format!("{}{month}", robot.0), number.to_string());
        let simulate = ["simulate", "--model", "truth.toml", "--out", &name, "--seed", &seed];
        place.succeed(&[&simulate[..], &["--noise", "0.03", "path.csv"]].concat());
        let sigma = "sigma = { x_mm = 0.03, y_mm = 0.03, z_mm = 0.03 }\n";
        place.file(&format!("{name}.toml"), &format!("schema = \"trued.recording/1\"\n{sigma}"));
        let recorded_at = format!("recorded_at = \"2026-0{}-01T00:00:00Z\"\n", month + 1);
        let files = format!("robot = \"{}\"\nfiles = [\"{name}.csv\"]\n{recorded_at}", robot.0);
        write!(manifest, "[[recording]]\n{files}").unwrap();
    }
    place.file("manifest.toml", &manifest);
    place
}

/// The digest printed by a run.
fn digest(done: &Done) -> String {
    let line = done.out.lines().find_map(|line| line.strip_prefix("digest "));
    assert!(line.is_some(), "{done:#?}");
    line.unwrap_or_default().to_owned()
}

fn batch(place: &Place, out: &str, more: &[&str]) -> Done {
    place.run(&[&["diagnose", "--batch", "manifest.toml", "--out", out], more].concat())
}

/// Results of a folder, hidden files aside.
fn results(folder: &Path) -> Vec<PathBuf> {
    let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut results: Vec<PathBuf> =
        names.filter(|path| path.extension().is_some_and(|end| end == "parquet")).collect();
    results.sort();
    results
}

/// The rows of a result, by the names of its columns.
fn rows(result: &Path) -> Vec<BTreeMap<String, Field>> {
    let reader = SerializedFileReader::new(File::open(result).unwrap()).unwrap();
    let rows = reader.get_row_iter(None).unwrap().map(|row| {
        let row = row.unwrap();
        row.get_column_iter().map(|(name, field)| (name.clone(), field.clone())).collect()
    });
    rows.collect()
}

fn text(field: &Field) -> &str {
    let Field::Str(text) = field else { return "" };
    text
}

#[test]
fn shards_in_any_order_on_any_number_of_threads_give_the_same_files() {
    let place = fleet();
    let whole = batch(&place, "whole", &["--json", "said.json"]);
    assert_eq!(whole.code, Some(0), "{whole:#?}");
    for (shard, threads) in [("3/3", "1"), ("1/3", "2"), ("2/3", "3")] {
        let done = batch(&place, "parts", &["--shard", shard, "--threads", threads]);
        assert_eq!(done.code, Some(0), "{done:#?}");
    }
    let all = [results(&place.path("whole")), results(&place.path("parts"))];
    assert_eq!(all[0].len(), RECORDINGS);
    for (one, other) in all[0].iter().zip(&all[1]) {
        assert_eq!(one.file_name(), other.file_name());
        assert_eq!(fs::read(one).unwrap(), fs::read(other).unwrap(), "{}", one.display());
    }
    let again = batch(&place, "parts", &["--resume"]);
    assert!(again.out.contains("0 results written, 6 kept"), "{again:#?}");
    assert_eq!(digest(&again), digest(&whole));
    assert_eq!(place.json("said.json")["digest_sha256"], digest(&whole));
    // Standard tools give the same digest.
    let shell = "cd parts && sha256sum *.parquet | sha256sum";
    let output = Command::new("sh").args(["-c", shell]).current_dir(place.path("")).output();
    let stdout = String::from_utf8(output.unwrap().stdout).unwrap();
    assert_eq!(stdout.split_whitespace().next(), Some(digest(&whole).as_str()));
}

#[test]
fn the_results_name_what_wears_on_which_robot() {
    let place = fleet();
    batch(&place, "said", &[]);
    let all: Vec<_> = results(&place.path("said")).iter().flat_map(|path| rows(path)).collect();
    let widths = |robot: &str| -> Vec<f64> {
        let of_robot = all.iter().filter(|row| {
            text(&row["robot"]) == robot
                && text(&row["parameter"]) == "width_mrad"
                && row["claimed"] == Field::Bool(true)
                && row["joint"] == Field::Long(3)
        });
        let mut found: Vec<(i64, f64)> = of_robot
            .filter_map(|row| match (&row["recorded_at"], &row["value"]) {
                (Field::TimestampMicros(time_us), Field::Double(value)) => Some((*time_us, *value)),
                _ => None,
            })
            .collect();
        found.sort_by_key(|(time_us, _)| *time_us);
        found.into_iter().map(|(_, width)| width).collect()
    };
    assert_eq!(widths("A"), Vec::<f64>::new(), "nothing is missing on A");
    let of_b = widths("B");
    assert_eq!(of_b.len(), 3, "{of_b:?}");
    for (width, truth) in of_b.iter().zip([0.2, 0.4, 0.6]) {
        assert!((width - truth).abs() < 0.06, "{of_b:?}");
    }
    let domains = all.iter().filter(|row| text(&row["subject"]) == "recording");
    assert_eq!(domains.count(), RECORDINGS);
}

#[test]
fn a_batch_that_is_killed_at_random_continues_to_the_same_digest() {
    let place = fleet();
    let expected = digest(&batch(&place, "whole", &[]));
    let mut chance = TestRng::new(37);
    for _ in 0..8 {
        let arguments = ["diagnose", "--batch", "manifest.toml", "--out", "killed", "--resume"];
        let mut child = place.start(&arguments);
        std::thread::sleep(Duration::from_millis(chance.below(900)));
        child.kill().unwrap();
        child.wait().unwrap();
    }
    let done = batch(&place, "killed", &["--resume"]);
    assert_eq!((done.code, digest(&done)), (Some(0), expected), "{done:#?}");
    let left = fs::read_dir(place.path("killed")).unwrap().count();
    assert_eq!(left, RECORDINGS, "nothing is left of what was killed");
}

#[test]
fn a_recording_that_cannot_be_diagnosed_gets_a_reason_and_stops_no_other() {
    let place = fleet();
    place.file("A0.csv", "t_s,q1_deg\n0,abc\n");
    fs::remove_file(place.path("B1.csv")).unwrap();
    let done = batch(&place, "said", &["--json", "said.json"]);
    assert_eq!(done.code, Some(3), "{done:#?}");
    assert!(done.err.contains("no result for 1 recording"), "{done:#?}");
    let result = place.json("said.json");
    assert_eq!((&result["written"], &result["results"]), (&5.into(), &5.into()), "{result:#}");
    assert_eq!(result["refused"][0]["files"], "A0.csv");
    assert_eq!(result["unread"][0]["files"], "B1.csv");
    let all: Vec<_> = results(&place.path("said")).iter().flat_map(|path| rows(path)).collect();
    let refused: Vec<_> = all.iter().filter(|row| text(&row["subject"]) == "refused").collect();
    assert!(text(&refused[0]["says"]).contains("`abc`"), "{refused:?}");
    assert_eq!(refused.len(), 1);
    // Refused recordings are not tried again, and are reported again; unreadable ones are tried
    // again. Messages do not depend on the folder.
    fs::copy(place.path("B0.csv"), place.path("B1.csv")).unwrap();
    let again = batch(&place, "said", &["--resume"]);
    assert!(again.out.contains("1 result written, 5 kept"), "{again:#?}");
    assert!(again.code == Some(1) && again.out.contains("refused: A0.csv"), "{again:#?}");
    fs::create_dir(place.path("moved")).unwrap();
    for name in place.names().iter().filter(|name| name.contains('.')) {
        fs::copy(place.path(name), place.path("moved").join(name)).unwrap();
    }
    let moved = place.run(&["diagnose", "--batch", "moved/manifest.toml", "--out", "other"]);
    assert_eq!((moved.code, digest(&moved)), (Some(1), digest(&again)));
}

#[test]
fn a_result_that_is_there_is_kept_only_on_request_and_only_whole() {
    let place = fleet();
    let first = batch(&place, "said", &["--shard", "1/3"]);
    let expected = digest(&first);
    let refused = batch(&place, "said", &["--shard", "1/3"]);
    assert!(refused.code == Some(2) && refused.err.contains("--resume"), "{refused:#?}");
    let one = results(&place.path("said")).remove(0);
    let bytes = fs::read(&one).unwrap();
    fs::write(&one, &bytes[..bytes.len() / 2]).unwrap();
    let done = batch(&place, "said", &["--shard", "1/3", "--resume"]);
    assert!(done.out.contains("1 result written, 1 kept"), "{done:#?}");
    assert_eq!(digest(&done), expected);
    let anew = batch(&place, "said", &["--shard", "1/3", "--overwrite"]);
    assert!(anew.out.contains("2 results written, 0 kept"), "{anew:#?}");
    // Another option of the manifest is another result.
    place.file("manifest.toml", &place.read("manifest.toml").replace("seed = 3", "seed = 4"));
    let other = batch(&place, "said", &["--shard", "1/3", "--resume"]);
    assert!(other.out.contains("2 results written, 0 kept, 4 in"), "{other:#?}");
}

#[test]
fn options_that_change_a_result_stand_in_the_manifest_alone() {
    let place = fleet();
    for option in [&["--seed", "1"][..], &["--band", "40"], &["--model", BASE], &["A0.csv"]] {
        let done = batch(&place, "said", option);
        assert!(done.code == Some(2) && done.err.contains("--batch"), "{done:#?}");
    }
    for arguments in
        [&["--shard", "1/2"][..], &["--shard", "1/2", "A0.csv"], &["--resume", "A0.csv"]]
    {
        let done = place.run(&[&["diagnose", "--model", BASE], arguments].concat());
        assert!(done.code == Some(2) && done.err.contains(arguments[0]), "{done:#?}");
    }
    place.file(
        "manifest.toml",
        &place.read("manifest.toml").replace("robot = \"B\"", "robot = \"C\""),
    );
    let done = batch(&place, "said", &[]);
    assert!(done.code == Some(2) && done.err.contains("the name of a [[robot]]"), "{done:#?}");
    assert!(!place.path("said").exists(), "nothing was begun");
}

#[test]
fn the_worked_example_of_the_page_runs_as_it_stands() {
    let page = fs::read_to_string(root().join("docs/batch.md")).unwrap();
    let script = crate::guide::blocks(&page, "sh");
    let manifest = crate::guide::blocks(&page, "toml");
    let place = fleet();
    place.file("fleet.toml", &manifest);
    let output = Command::new("sh")
        .args(["-euc", &format!("trued() {{ {TRUED} \"$@\"; }}\n{script}")])
        .current_dir(place.path(""))
        .output()
        .unwrap();
    let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{stdout}\n{}", String::from_utf8_lossy(&output.stderr));
    let digests: Vec<&str> =
        stdout.lines().filter_map(|line| line.strip_prefix("digest ")).collect();
    assert!(digests.len() >= 2 && digests[0] == digests[digests.len() - 1], "{stdout}");
}

/// A Slurm cluster on this machine; `SKIPPED` if the distribution's Slurm is not installed or
/// cannot run.
#[test]
fn a_job_array_of_slurm_gives_the_digest_of_one_process() {
    let script = root().join("tests/peers/slurm.sh");
    let place = fleet();
    let expected = digest(&batch(&place, "whole", &[]));
    let output = Command::new("bash")
        .arg(script)
        .args([TRUED, "manifest.toml", "array", "3"])
        .env("TRUED_REQUEUE", "0.4")
        .current_dir(place.path(""))
        .output()
        .unwrap();
    let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
    if output.status.code() == Some(77) {
        let scratch = Path::new(env!("CARGO_TARGET_TMPDIR"));
        return skipped(scratch, "a job array of Slurm", stdout.trim());
    }
    assert!(output.status.success(), "{stdout}\n{}", String::from_utf8_lossy(&output.stderr));
    let done = batch(&place, "array", &["--resume"]);
    assert!(done.out.contains("0 results written, 6 kept"), "{done:#?}\n{stdout}");
    assert_eq!(digest(&done), expected);
}

/// The interpreter `TRUED_BATCH_PYTHON`, otherwise the system's, if it has this package.
fn python_with(package: &str) -> Option<String> {
    let python = std::env::var("TRUED_BATCH_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let arguments = ["-c".to_owned(), format!("import {package}")];
    let output = Command::new(&python).args(arguments).output().ok()?;
    output.status.success().then_some(python)
}

#[test]
fn tasks_of_ray_and_dask_give_the_digest_of_one_process() {
    let place = fleet();
    let expected = digest(&batch(&place, "whole", &[]));
    for (name, package) in [("ray", "ray"), ("dask", "dask.distributed")] {
        let Some(python) = python_with(package) else {
            let scratch = Path::new(env!("CARGO_TARGET_TMPDIR"));
            skipped(scratch, &format!("tasks of {name}"), "no Python with that package");
            continue;
        };
        let script = root().join("deploy").join(name).join("diagnose.py");
        let mut command = Command::new(python);
        command.arg(script).args(["manifest.toml", name, "3"]).env("TRUED", TRUED);
        let output = command.current_dir(place.path("")).output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{stderr}");
        let done = batch(&place, name, &["--resume"]);
        assert!(done.out.contains("0 results written, 6 kept"), "{done:#?}\n{stderr}");
        assert_eq!(digest(&done), expected);
    }
}
