//! The command: exit codes, JSON, page, and what it says of results that cannot be used.

use std::process::{Command, Output};

use crate::written::{Folder, ONE_DAY, Recorded, backlash, write};

fn trends(folder: &Folder, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_trued-trends"))
        .arg(&folder.0)
        .args(arguments)
        .env("SOURCE_DATE_EPOCH", "1767247200")
        .output()
        .unwrap()
}

fn days(growth: f64) -> Vec<Recorded> {
    let width = |day: i64| 0.2 + growth * day as f64 + 0.004 * (day % 3 - 1) as f64;
    let recorded = |day| Recorded {
        robot: "A",
        day: Some(day),
        ambient_c: None,
        findings: Some(vec![backlash(width(day))]),
    };
    (0..20).map(recorded).collect()
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn the_exit_code_says_whether_something_grows() {
    let output = trends(&Folder::with(&days(0.0)), &[]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stdout).contains("no effect is growing"));
    let output = trends(&Folder::with(&days(0.02)), &[]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("A, backlash of joint 2: width changes by 0.6"), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
}

#[test]
fn json_follows_its_schema_and_the_schema_is_of_today() {
    let schema =
        format!("{:#}\n", serde_json::to_value(schemars::schema_for!(trends::Answer)).unwrap());
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/schemas/trends.schema.json");
    if std::env::var_os("TRUED_BLESS").is_some() {
        std::fs::write(path, &schema).unwrap();
    }
    assert_eq!(
        std::fs::read_to_string(path).unwrap_or_default(),
        schema,
        "TRUED_BLESS=1 writes it anew"
    );
    let output = trends(&Folder::with(&days(0.02)), &["--json", "--tolerance-mm", "0.5"]);
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["schema"], "trued.trends/1");
    let alert = &json["alerts"][0];
    for key in ["robot", "effect", "joint", "since", "per_month", "size_now", "reaches_tolerance"] {
        assert!(!alert[key].is_null(), "{key}: {alert:#}");
    }
}

#[test]
fn the_page_is_one_file_and_the_same_each_time() {
    let folder = Folder::with(&days(0.02));
    let out = Folder::new();
    let page = out.0.join("trends.html");
    let arguments = ["--page", page.to_str().unwrap()];
    let first = trends(&folder, &arguments);
    assert_eq!(first.status.code(), Some(1), "{first:?}");
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(
        html.contains("backlash of joint 2") && html.contains("<svg") && !html.contains("<script")
    );
    trends(&folder, &arguments);
    assert_eq!(std::fs::read_to_string(&page).unwrap(), html);
    let nowhere = trends(&folder, &["--page", "/nowhere/trends.html"]);
    assert_eq!(nowhere.status.code(), Some(3), "{nowhere:?}");
}

#[test]
fn results_that_cannot_be_used_are_named_with_a_remedy() {
    let empty = trends(&Folder::new(), &[]);
    assert_eq!(empty.status.code(), Some(2));
    assert!(
        errors(&empty).contains("no file `*.parquet`; write results with"),
        "{}",
        errors(&empty)
    );

    let torn = Folder::with(&days(0.0));
    std::fs::write(torn.0.join("torn.parquet"), b"PAR1 and no more").unwrap();
    let output = trends(&torn, &[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        errors(&output).contains("torn.parquet") && errors(&output).contains("--resume"),
        "{}",
        errors(&output)
    );

    let twice = Folder::with(&days(0.0));
    write(&twice.0.join("again.parquet"), "again", &days(0.0)[3]);
    let output = trends(&twice, &[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(errors(&output).contains("diagnosed twice"), "{}", errors(&output));

    let timeless: Vec<Recorded> =
        days(0.0).into_iter().map(|one| Recorded { day: None, ..one }).collect();
    let output = trends(&Folder::with(&timeless), &[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(errors(&output).contains("none of 20 recordings has a time"), "{}", errors(&output));
}

#[test]
fn the_page_overwrites_no_file_of_a_user_unless_it_is_permitted_and_never_a_result() {
    let folder = Folder::with(&days(0.0));
    let out = Folder::new();
    let notes = out.0.join("notes.html");
    std::fs::write(&notes, "my notes").unwrap();
    let page = notes.to_str().unwrap();
    let refused = trends(&folder, &["--page", page]);
    assert_eq!(refused.status.code(), Some(2), "{refused:?}");
    assert!(errors(&refused).contains("--overwrite"), "{}", errors(&refused));
    assert_eq!(std::fs::read_to_string(&notes).unwrap(), "my notes");
    assert_eq!(trends(&folder, &["--page", page, "--overwrite"]).status.code(), Some(0));
    assert!(std::fs::read_to_string(&notes).unwrap().contains("made by trued"));
    assert_eq!(trends(&folder, &["--page", page]).status.code(), Some(0), "an earlier page");
    let result = std::fs::read_dir(&folder.0).unwrap().flatten().next().unwrap().path();
    let before = std::fs::read(&result).unwrap();
    let input = trends(&folder, &["--page", result.to_str().unwrap(), "--overwrite"]);
    assert_eq!(input.status.code(), Some(2), "{input:?}");
    assert_eq!(std::fs::read(&result).unwrap(), before);
    assert_eq!(std::fs::read_dir(&out.0).unwrap().count(), 1, "nothing is left beside it");
}

#[test]
fn of_recordings_with_one_time_nothing_is_said_to_grow_or_not_to() {
    let one_day: Vec<Recorded> =
        days(0.02).into_iter().map(|one| Recorded { day: Some(ONE_DAY), ..one }).collect();
    let output = trends(&Folder::with(&one_day), &[]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert!(errors(&output).contains("one and the same time"), "{}", errors(&output));
    assert!(!String::from_utf8_lossy(&output.stdout).contains("growing"));
    // Beside a robot with times it is said of this one.
    let other = days(0.0).into_iter().map(|one| Recorded { robot: "B", ..one });
    let output = trends(&Folder::with(&one_day.into_iter().chain(other).collect::<Vec<_>>()), &[]);
    let text = String::from_utf8_lossy(&output.stdout).replace("\n", " ");
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert_eq!(text.matches("one and the same time").count(), 1, "{text}");
}

#[test]
fn a_damaged_file_and_a_name_without_a_file_are_named_with_a_remedy() {
    let refused = |prepare: &dyn Fn(&std::path::Path), expected: &[&str]| {
        let folder = Folder::with(&days(0.0));
        prepare(&folder.0);
        let output = trends(&folder, &[]);
        assert_eq!(output.status.code(), Some(2), "{expected:?} {output:?}");
        for text in expected {
            assert!(errors(&output).contains(text), "{text}: {}", errors(&output));
        }
    };
    let remedy = "--resume";
    refused(
        &|dir| std::fs::write(dir.join("empty.parquet"), "").unwrap(),
        &["empty.parquet", remedy],
    );
    refused(&|dir| std::fs::write(dir.join("X.PARQUET"), "PAR1").unwrap(), &["X.PARQUET", remedy]);
    refused(&|dir| std::fs::create_dir(dir.join("d.parquet")).unwrap(), &["d.parquet", "a folder"]);
    refused(
        &|dir| std::os::unix::fs::symlink("nowhere", dir.join("l.parquet")).unwrap(),
        &["l.parquet", "a link"],
    );
    // Damage in the data: the footer is right.
    refused(
        &|dir| {
            let path = dir.join(format!("{:064x}.parquet", 7));
            let mut bytes = std::fs::read(&path).unwrap();
            bytes[4..400].fill(0xff);
            std::fs::write(path, bytes).unwrap();
        },
        &[&format!("{:064x}.parquet", 7), remedy],
    );
}

#[test]
fn refused_recordings_and_those_without_a_time_are_counted() {
    let mut all = days(0.0);
    all[4].findings = None;
    all[5].day = None;
    let output = trends(&Folder::with(&all), &[]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        text.contains("20 recordings")
            && text.contains("1 refused")
            && text.contains("1 without a"),
        "{text}"
    );
}

#[test]
fn another_parquet_file_is_named_by_its_missing_column() {
    use datafusion::arrow::array::{Int64Array, RecordBatch};
    let folder = Folder::with(&days(0.0));
    let column: datafusion::arrow::array::ArrayRef = std::sync::Arc::new(Int64Array::from(vec![1]));
    let batch = RecordBatch::try_from_iter([("other", column)]).unwrap();
    let file = std::fs::File::create(folder.0.join("other.parquet")).unwrap();
    let mut writer =
        datafusion::parquet::arrow::ArrowWriter::try_new(file, batch.schema(), None).unwrap();
    writer.write(&batch).unwrap();
    writer.close().unwrap();
    let output = trends(&folder, &[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        errors(&output).contains("other.parquet: column `key` is missing"),
        "{}",
        errors(&output)
    );
}
