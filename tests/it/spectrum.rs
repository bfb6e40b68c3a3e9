//! `trued spectrum` on recordings with known content, on real ones, and on invalid ones.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use serde_json::Value;
use spectrum::{Block, MonitorConfig, ProcessState, VibrationMonitor};
use tests::rng::TestRng;

use crate::program::{Place, real_data};

/// A recording of columns over time, written as CSV.
pub(crate) struct TestRecording {
    rate_hz: f64,
    heads: Vec<&'static str>,
    columns: Vec<Vec<f64>>,
}

impl TestRecording {
    fn new(rate_hz: f64) -> Self {
        Self { rate_hz, heads: Vec::new(), columns: Vec::new() }
    }

    /// Adds a column by its value at each time.
    fn with(mut self, head: &'static str, seconds: f64, value: impl FnMut(f64) -> f64) -> Self {
        let rows = (seconds * self.rate_hz) as usize;
        self.heads.push(head);
        self.columns.push((0..rows).map(|i| i as f64 / self.rate_hz).map(value).collect());
        self
    }

    pub(crate) fn csv(&self) -> String {
        let mut text = format!("t_s,{}\n", self.heads.join(","));
        for row in 0..self.columns[0].len() {
            write!(text, "{:.6}", row as f64 / self.rate_hz).unwrap();
            for column in &self.columns {
                write!(text, ",{:.6}", column[row]).unwrap();
            }
            text.push('\n');
        }
        text
    }
}

/// Noise of a standard deviation, nearly normal.
fn noise(sigma: f64, seed: u64) -> impl FnMut() -> f64 {
    let mut chance = TestRng::new(seed);
    move || sigma * ((0..12).map(|_| chance.uniform()).sum::<f64>() - 6.0)
}

fn spectrum(place: &Place, arguments: &[&str]) -> Value {
    place.succeed(&[&["spectrum", "--json", "found.json"], arguments].concat());
    place.json("found.json")
}

fn list<'v>(found: &'v Value, key: &str) -> &'v [Value] {
    found[key].as_array().expect(key).as_slice()
}

fn number(of: &Value, key: &str) -> f64 {
    of[key].as_f64().expect(key)
}

/// Two tones, the second of which begins at 4 s.
pub(crate) fn tones(rate_hz: f64) -> TestRecording {
    let (mut x, mut y) = (noise(0.5, 1), noise(0.5, 2));
    TestRecording::new(rate_hz)
        .with("fx_N", 10.0, move |t| x() + 2.0 * (TAU * 35.3 * t).sin())
        .with("fy_N", 10.0, move |t| {
            y() + if t < 4.0 { 0.0 } else { 5.0 * (TAU * 71.37 * t).sin() }
        })
}

#[test]
fn known_tones_are_found_with_frequency_amplitude_and_time() {
    let place = Place::new();
    place.file("run.csv", &tones(2000.0).csv());
    let found = spectrum(&place, &["run.csv"]);
    let line = |hz: f64, channel: &str| {
        let is_near = |line: &&Value| {
            (number(line, "frequency_Hz") - hz).abs() < 0.1 && line["channel"] == channel
        };
        list(&found, "lines").iter().find(is_near).expect("the line")
    };
    assert!((number(line(35.3, "fx_N"), "amplitude") - 2.0).abs() < 0.06);
    // The second tone lasts six of ten seconds: its mean power is 0.6 of its own.
    assert!((number(line(71.37, "fy_N"), "amplitude") - 5.0 * 0.6_f64.sqrt()).abs() < 0.2);
    let began = |episode: &&Value| (number(episode, "frequency_Hz") - 71.37).abs() < 0.1;
    let episode = list(&found, "episodes").iter().find(began).expect("the second tone");
    assert!((3.9..4.2).contains(&number(episode, "from_s")), "{episode}");
    assert!((number(episode, "amplitude") - 5.0).abs() < 0.3, "{episode}");
    assert_eq!((&episode["axis"], &episode["unit"]), (&"y".into(), &"N".into()));
    assert!(list(&found, "health").is_empty());
}

#[test]
fn the_command_reports_the_same_verdicts_as_the_daemon() {
    let place = Place::new();
    let made = tones(2000.0);
    place.file("run.csv", &made.csv());
    let found = spectrum(&place, &["run.csv", "--spindle-rpm", "2400", "--teeth", "2"]);
    let config = MonitorConfig { rate_hz: 2000.0, channels: 2, ..MonitorConfig::default() };
    let mut watch = VibrationMonitor::new(config).unwrap();
    watch.set_process_state(ProcessState {
        spindle_rpm: 2400.0,
        teeth: 2,
        ..ProcessState::default()
    });
    let mut verdicts = Vec::new();
    // Blocks of another length than the command's: the verdicts do not depend on it.
    for (seq, from) in (0..20_000).step_by(64).enumerate() {
        let to = (from + 64).min(20_000);
        let rounded = |x: f64| format!("{x:.6}").parse::<f64>().unwrap();
        let samples: Vec<f64> =
            (from..to).flat_map(|i| made.columns.iter().map(move |c| rounded(c[i]))).collect();
        let (seq, t_ns) = (seq as u64, from as u64 * 500_000);
        let block = Block {
            seq,
            t_ns,
            rate_hz: 2000.0,
            channels: 2,
            samples: &samples,
            ..Block::default()
        };
        verdicts.extend(watch.push(&block).iter().copied());
    }
    let events = list(&found, "events");
    assert!(!events.is_empty());
    assert_eq!(events.len(), verdicts.len());
    for (event, verdict) in events.iter().zip(&verdicts) {
        assert_eq!(event["state"], verdict.state.name());
        assert_eq!(event["class"], verdict.class.name());
        assert_eq!(number(event, "frequency_Hz"), verdict.frequency_hz);
        assert!((number(event, "t_s") - verdict.t_ns as f64 * 1e-9).abs() < 1e-6);
    }
}

#[test]
fn waviness_is_one_line_over_the_path_whatever_the_feed() {
    let place = Place::new();
    let feed = |t: f64| [5.0, 10.0, 20.0][((t / 12.0) as usize).min(2)];
    let path = |t: f64| match t {
        t if t < 12.0 => 5.0 * t,
        t if t < 24.0 => 60.0 + 10.0 * (t - 12.0),
        t => 180.0 + 20.0 * (t - 24.0),
    };
    let (mut force, mut tracker) = (noise(0.5, 3), noise(0.02, 4));
    let force_of =
        move |t: f64| force() + 3.0 * (TAU * 0.3 * path(t)).sin() + 2.0 * (TAU * 50.0 * t).sin();
    let recorded = TestRecording::new(1000.0).with("fx_N", 36.0, force_of);
    place.file("feed.csv", &recorded.csv());
    let by_feed = TestRecording { heads: vec!["fx_N", "feed_mm_s"], ..recorded };
    let columns = vec![
        by_feed.columns[0].clone(),
        (0..36_000).map(|i| feed(f64::from(i) / 1000.0)).collect(),
    ];
    let by_feed = TestRecording { columns, ..by_feed };
    place.file("feed.csv", &by_feed.csv());
    let by_place = TestRecording { heads: vec!["fx_N", "x_mm", "y_mm"], ..by_feed };
    let mut along = |part: f64| -> Vec<f64> {
        (0..36_000).map(|i| part * path(f64::from(i) / 1000.0) + tracker()).collect()
    };
    let columns = vec![by_place.columns[0].clone(), along(0.6), along(0.8)];
    place.file("place.csv", &TestRecording { columns, ..by_place }.csv());
    for (file, known_by) in
        [("feed.csv", "the recorded feed"), ("place.csv", "the measured positions")]
    {
        let found = spectrum(&place, &[file]);
        let path = &found["path"];
        assert_eq!((&path["known_by"], &path["one_feed"]), (&known_by.into(), &false.into()));
        assert!((number(path, "length_mm") - 420.0).abs() < 2.0, "{}", path["length_mm"]);
        let first = &list(path, "lines")[0];
        assert!((number(first, "cycles_per_mm") - 0.3).abs() < 0.003, "{first}");
        assert!((number(first, "amplitude") - 3.0).abs() < 0.3, "{first}");
    }
}

/// The joints of a cut by joint 1 alone, at three speeds, and a force line of the teeth of its
/// first gear pair.
pub(crate) fn geared_cut() -> TestRecording {
    let q1_rad = |t: f64| match t {
        t if t < 10.0 => 0.012 * t,
        t if t < 20.0 => 0.12 + 0.024 * (t - 10.0),
        t => 0.36 + 0.036 * (t - 20.0),
    };
    // Table A III-1: the motor's pinion of 10 teeth turns 131/10 · 129/13 times as often as the joint.
    let teeth = move |t: f64| (10.0 * 131.0 / 10.0 * 129.0 / 13.0 * q1_rad(t)).sin();
    let (mut x, mut y) = (noise(0.5, 5), noise(0.5, 6));
    let mut made = TestRecording::new(1000.0)
        .with("q1_deg", 30.0, move |t| q1_rad(t).to_degrees())
        .with("fx_N", 30.0, move |t| x() + 3.0 * teeth(t))
        .with("fy_N", 30.0, move |t| y() + teeth(t));
    for (head, angle_deg) in
        [("q2_deg", 10.0), ("q3_deg", 10.0), ("q4_deg", 0.0), ("q5_deg", 30.0), ("q6_deg", 0.0)]
    {
        made = made.with(head, 30.0, move |_| angle_deg);
    }
    made
}

#[test]
fn a_line_over_the_path_is_matched_with_the_models_gears() {
    let place = Place::new();
    place.file("cut.csv", &geared_cut().csv());
    let found = spectrum(&place, &["--model", "irb1600-6-145-thesis", "cut.csv"]);
    let first = &list(&found["path"], "lines")[0];
    let wheel = &first["wheel"];
    assert_eq!(
        (&wheel["joint"], &wheel["shaft"], &wheel["teeth"]),
        (&1.into(), &1.into(), &10.into()),
        "{first}"
    );
    let without_model = spectrum(&place, &["--feed-mm-s", "10", "cut.csv"]);
    let missing = without_model["path"]["wheels_missing"].as_str().unwrap();
    assert!(missing.contains("--model"), "{missing}");
    let none = spectrum(&place, &["--column", "fx_N", "cut.csv"]);
    assert!(
        none["path"].is_null() && none["path_missing"].as_str().unwrap().contains("--feed-mm-s")
    );
}

#[test]
fn the_folded_tooth_passing_is_a_suspect_alias_and_no_chatter() {
    let place = Place::new();
    let (mut x, mut y) = (noise(0.3, 7), noise(0.3, 8));
    let tooth = |t: f64| if t < 4.0 { 0.0 } else { (TAU * 28_000.0 / 60.0 * 2.0 * t).sin() };
    let made = TestRecording::new(1000.0).with("fx_N", 8.0, move |t| x() + 2.0 * tooth(t)).with(
        "fy_N",
        8.0,
        move |t| y() + 4.0 * tooth(t),
    );
    place.file("cut.csv", &made.csv());
    let model = "irb1600-6-145-thesis";
    let found =
        spectrum(&place, &["--model", model, "--spindle-rpm", "28000", "--teeth", "2", "cut.csv"]);
    let is_near = |one: &&Value| (number(one, "frequency_Hz") - 66.7).abs() < 1.0;
    let lines: Vec<&Value> = list(&found, "lines").iter().filter(is_near).collect();
    let episode = list(&found, "episodes").iter().find(is_near).expect("the line is seen");
    assert!(!lines.is_empty());
    for judged in lines.into_iter().chain([episode]) {
        assert_eq!(
            (&judged["suspect_alias"], &judged["class"]),
            (&true.into(), &"forced".into()),
            "{judged}"
        );
        assert!(judged["advice"].as_str().unwrap().contains("sample faster"));
        assert_eq!(judged["alias"]["order"], 2);
    }
    let blind = spectrum(&place, &["--model", model, "cut.csv"]);
    let episode = list(&blind, "episodes").iter().find(is_near).expect("the line is seen");
    assert!(episode["rivals"].as_array().unwrap().contains(&"forced".into()), "{episode}");
}

#[test]
fn holes_and_a_stuck_channel_are_reported_and_do_no_harm() {
    let place = Place::new();
    let mut lines: Vec<String> = tones(2000.0).csv().lines().map(str::to_owned).collect();
    for (row, line) in lines.iter_mut().enumerate().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let (t, x, y) = (cells[0], cells[1], cells[2]);
        let x = if (3000..3010).contains(&row) { "nan" } else { x };
        let y = if row > 16_000 { "7.25" } else { y };
        *line = format!("{t},{x},{y}");
    }
    place.file("run.csv", &lines.join("\n"));
    let found = spectrum(&place, &["run.csv"]);
    assert_eq!(list(&found, "channels")[0]["samples_not_taken"], 10);
    let fault = |name: &str, channel: &str| {
        list(&found, "health").iter().any(|f| f["fault"] == name && f["channel"] == channel)
    };
    assert!(fault("not_finite", "fx_N") && fault("stuck", "fy_N"), "{}", found["health"]);
    let tone = |line: &Value| (number(line, "frequency_Hz") - 35.3).abs() < 0.1;
    assert!(list(&found, "lines").iter().any(tone));
}

#[test]
fn a_gap_makes_two_records_and_a_slow_recording_has_spectra_only() {
    let place = Place::new();
    let mut text = tones(2000.0).csv();
    let gap: Vec<&str> = text.lines().collect();
    text = [&gap[..4001], &gap[5001..]].concat().join("\n");
    place.file("gap.csv", &text);
    let found = spectrum(&place, &["gap.csv"]);
    assert_eq!((&found["records"], number(&found, "seconds")), (&2.into(), 9.5));
    assert!(list(&found, "notes").iter().any(|note| note.as_str().unwrap().contains("gap")));
    assert!(list(&found, "events").iter().any(|event| event["record"] == 2), "both are watched");
    let mut y = noise(0.1, 9);
    let slow = TestRecording::new(100.0).with("fx_N", 20.0, move |t| y() + (TAU * 13.0 * t).sin());
    place.file("slow.csv", &slow.csv());
    let found = spectrum(&place, &["slow.csv"]);
    assert!(list(&found, "events").is_empty());
    assert!((number(&list(&found, "lines")[0], "frequency_Hz") - 13.0).abs() < 0.1);
}

#[test]
fn the_page_is_whole_and_says_what_the_console_says() {
    let place = Place::new();
    place.file("cut.csv", &geared_cut().csv());
    let model = ["--model", "irb1600-6-145-thesis"];
    let done =
        place.succeed(&[&["spectrum", "--report", "page.html"], &model[..], &["cut.csv"]].concat());
    let page = place.read("page.html");
    assert!(page.starts_with("<!DOCTYPE html>") && page.trim_end().ends_with("</html>"));
    for part in ["Over the tool's path", "10 teeth of shaft 1", "The sensor"] {
        assert!(page.replace("&#39;", "'").contains(part), "{part}");
    }
    assert!(
        done.out.contains("10 teeth of shaft 1") && done.out.lines().count() < 20,
        "{}",
        done.out
    );
    assert!(!page.contains("NaN") && !page.contains("inf "));
}

#[test]
fn bad_input_is_refused_with_a_remedy_and_nothing_is_written() {
    let place = Place::new();
    place.file("rateless.csv", "sample,force\n1,2\n2,3\n3,5\n4,1\n5,2\n");
    place.file("run.csv", &tones(1000.0).csv());
    place.file("broken.csv", "t_s,fx_N\n0,1\n0.001,two\n0.002,inf\n0.003,4\n");
    let short: String = (0..12).map(|i| format!("{:.1},{i}\n", 0.1 * f64::from(i))).collect();
    place.file("short.csv", &format!("t_s,fx_N\n{short}"));
    place.file("uneven.csv", "t_s,force\n0,1\n1,2\n1.1,3\n5,4\n5.1,1\n9,1\n9.3,2\n");
    let fast: String =
        (0..64).map(|i| format!("{:.9},{}\n", 2.5e-7 * f64::from(i), i % 7)).collect();
    place.file("fast.csv", &format!("t_s,fx_N\n{fast}"));
    for (arguments, part) in [
        (vec!["fast.csv"], "correct the unit of the time column"),
        (vec!["--rate", "1e6", "run.csv"], "--rate is 1000000 Hz"),
        (vec!["--teeth", "4", "run.csv"], "give --spindle-rpm too"),
        (vec!["--spindle-rpm", "1e12", "run.csv"], "at most 1000000 rev/min"),
        (vec!["--window", "1e9", "run.csv"], "longer than the recording"),
        (vec!["--band", "10", "1e9", "run.csv"], "above 500 Hz"),
        (vec!["rateless.csv"], "--rate HZ"),
        (vec!["--rate", "-5", "rateless.csv"], "is -5"),
        (vec!["--column", "fx_M", "run.csv"], "did you mean `fx_N`?"),
        (vec!["--rate=-5", "rateless.csv"], "above 0"),
        (vec!["--spindle-rpm", "NaN", "run.csv"], "--spindle-rpm"),
        (vec!["--band", "200", "100", "run.csv"], "--band is 200 100"),
        (vec!["--band", "-5", "100", "run.csv"], "--band is -5 100"),
        (vec!["--threshold", "nan", "run.csv"], "--threshold is NaN, expected 0.25 to 10"),
        (vec!["--mains", "-1", "run.csv"], "--mains is -1"),
        (vec!["short.csv"], "without --window, the window is 0.25 s, expected 16 samples or more"),
        (vec!["--window", "0", "run.csv"], "--window"),
        (vec!["--model", "irb1600", "run.csv"], "neither a model file nor a preset"),
        (vec!["broken.csv"], "broken.csv:3:7"),
        (vec!["uneven.csv"], "evenly spaced"),
        (vec!["absent.csv"], "cannot read"),
    ] {
        let files =
            [&["spectrum", "--json", "new.json", "--report", "new.html"], arguments.as_slice()];
        let done = place.run(&files.concat());
        assert_eq!(done.code, Some(2), "{arguments:?}: {done:#?}");
        assert!(done.err.contains(part), "{part:?} in {}", done.err);
    }
    let over = place.run(&["spectrum", "--report", "run.csv", "run.csv"]);
    assert_eq!(over.code, Some(2), "an input is not replaced");
    assert_eq!(
        place.names(),
        ["broken.csv", "fast.csv", "rateless.csv", "run.csv", "short.csv", "uneven.csv"]
    );
}

#[test]
fn milling_chatter_is_found_in_the_cut_and_the_hum_is_no_chatter() {
    let Some(file) = real_data("milling-chatter/N255_S5000_accY.csv") else { return };
    let place = Place::new();
    let file = file.to_str().unwrap();
    let found = spectrum(&place, &["--spindle-rpm", "5000", "--teeth", "4", file]);
    let worst = &list(&found, "episodes")[0];
    assert!((number(worst, "frequency_Hz") - 684.0).abs() < 1.0, "{worst}");
    assert_eq!(
        (&worst["class"], &worst["axis"], &worst["state"]),
        (&"chatter".into(), &"y".into(), &"confirmed".into())
    );
    let alarm_s = number(worst, "alarm_s");
    assert!((3.9..4.45).contains(&alarm_s) && number(worst, "to_s") < 5.3, "{worst}");
    for event in list(&found, "events") {
        let hum = (number(event, "frequency_Hz") - 150.0).abs() < 1.0;
        assert!(!(hum && event["class"] == "chatter"), "{event}");
    }
    let blind = spectrum(&place, &[file]);
    let worst = &list(&blind, "episodes")[0];
    assert!((number(worst, "frequency_Hz") - 684.0).abs() < 1.0, "{worst}");
    assert!(
        worst["rivals"].as_array().unwrap().contains(&"forced".into()),
        "without a speed it may be driven"
    );
}

#[test]
fn steady_turning_alarms_nothing_and_its_speed_is_read_from_the_tacho() {
    let Some(file) = real_data("turning-force/f416_a100.csv") else { return };
    let place = Place::new();
    let found = spectrum(&place, &[file.to_str().unwrap()]);
    let alarmed = |event: &&Value| event["state"] == "alarm" || event["state"] == "confirmed";
    assert_eq!(list(&found, "events").iter().filter(alarmed).count(), 0);
    assert!((number(&found, "spindle_rpm") - 1060.0).abs() < 5.0, "{}", found["spindle_rpm"]);
}

#[test]
fn the_beams_tones_are_found_in_the_labview_file() {
    let Some(file) = real_data("beam-tone/test_2_ds16.lvm") else { return };
    let place = Place::new();
    let found = spectrum(&place, &["--column", "Acceleration", file.to_str().unwrap()]);
    assert_eq!(list(&found, "channels")[0]["unit"], "g");
    for tone_hz in [100.0, 120.0, 150.0] {
        let is_near = |line: &Value| (number(line, "frequency_Hz") - tone_hz).abs() < 0.1;
        assert!(list(&found, "lines").iter().take(3).any(is_near), "{tone_hz}");
    }
}
