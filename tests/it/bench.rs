//! `trued bench` and `trued doctor` as programs: results are consistent, refused settings end them,
//! nothing is left behind. Speed is not tested.

use crate::program::{Done, Place};
use serde_json::Value;
use std::os::unix::fs::PermissionsExt;

/// The parts of a bench that any machine with two cores can run, none of them longer than a second.
const SHORT: &[&str] = &["bench", "--policy", "other", "--load", "idle", "--json", "bench.json"];

/// The same for parts that are measured once, without load.
const ONCE: &[&str] = &["bench", "--policy", "other", "--json", "bench.json"];

fn bench(place: &Place, more: &[&str]) -> Done {
    place.run(&[SHORT, more].concat())
}

fn has_two_cores() -> bool {
    let two = std::thread::available_parallelism().is_ok_and(|cores| cores.get() >= 2);
    if !two {
        println!("skipped: a bench wants two cores");
    }
    two
}

/// Quantiles in order, and as many as expected.
fn check_quantiles(q: &Value, n: Option<u64>) {
    let names = ["p50", "p90", "p99", "p999", "p9999", "p99999", "max"];
    let values = names.map(|name| q[name].as_u64().expect(name));
    assert!(values.windows(2).all(|pair| pair[0] <= pair[1]), "{q}");
    if let Some(n) = n {
        assert_eq!(q["n"].as_u64(), Some(n), "{q}");
    }
}

/// Names in shared memory left by benches that have ended: each contains its process number.
fn left() -> Vec<String> {
    let of_the_dead = |name: &String| {
        let number = name.split("bench-").nth(1).and_then(|rest| rest.split(['-', '.']).next());
        let pid = number.and_then(|hex| u32::from_str_radix(hex, 16).ok());
        pid.is_some_and(|pid| !std::path::Path::new(&format!("/proc/{pid}")).exists())
    };
    let names = std::fs::read_dir("/dev/shm").unwrap().flatten();
    let names = names.map(|entry| entry.file_name().to_string_lossy().into_owned());
    names.filter(of_the_dead).collect()
}

#[test]
fn a_short_bench_counts_every_cycle_of_its_schedule_and_leaves_nothing() {
    if !has_two_cores() {
        return;
    }
    let place = Place::new();
    let arguments =
        ["--only", "paced,flat", "--rate", "500,1000", "--wait", "sleep", "--seconds", "0.4"];
    let done = bench(&place, &[&arguments[..], &["--out", "out"]].concat());
    assert_eq!(done.code, Some(0), "{done:#?}");
    let result = place.json("bench.json");
    assert_eq!(result["schema"], "trued.bench/1");
    assert_eq!(result["machine"]["scheduling"], "other");
    let paced = result["settings"][0]["paced"].as_array().unwrap();
    assert_eq!(paced.len(), 2);
    for run in paced {
        let cycles = run["rate_hz"].as_u64().unwrap() * 4 / 10;
        assert_eq!(run["cycles"].as_u64(), Some(cycles));
        for from in ["scheduled_ns", "actual_ns"] {
            check_quantiles(&run[from], Some(cycles));
        }
        check_quantiles(&run["empty_ns"], Some(2 * cycles));
        for quantile in ["p50", "p99", "max"] {
            let (due, sent) = (&run["scheduled_ns"][quantile], &run["actual_ns"][quantile]);
            assert!(due.as_u64() >= sent.as_u64(), "{quantile}: {run}");
        }
        assert!(run["missed_beyond_empty"].as_u64() <= run["missed"].as_u64(), "{run}");
    }
    let missed = paced.iter().find(|run| run["rate_hz"] == 500).map(|run| &run["missed"]);
    assert_eq!(Some(&result["missed_cycles"]), missed, "of the lowest rate");
    for kind in ["trued", "iceoryx2", "atomics", "bare", "unix", "udp", "pipe"] {
        let trips = &result["round_trip_ns"][kind];
        check_quantiles(trips, None);
        assert!(trips["n"].as_u64() > Some(0) && trips["lost"] == 0, "{kind}: {trips}");
        let placed = ["near", "far"].map(|placement| trips[placement]["n"].as_u64().unwrap());
        assert!(placed.iter().sum::<u64>() <= trips["n"].as_u64().unwrap(), "{kind}: {trips}");
    }
    check_quantiles(&result["correction_ns"], None);
    let page = place.read("out/bench.html");
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    roxmltree::Document::parse_with_options(&page, options).expect("a sound page");
    assert!(page.contains("plain iceoryx2") && page.contains("<svg"));
    roxmltree::Document::parse(&place.read("out/flat-other-idle.svg")).expect("a sound plot");
    assert!(place.litter().is_empty() && left().is_empty(), "{:?} {:?}", place.litter(), left());
}

#[test]
fn costs_are_reported_for_every_number_with_the_line_through_them() {
    if !has_two_cores() {
        return;
    }
    let place = Place::new();
    let asked = ["--only", "cost", "--seconds", "0.05", "--out", "out"];
    let done = place.run(&[ONCE, &asked].concat());
    assert_eq!(done.code, Some(0), "{done:#?}");
    let cost = &place.json("bench.json")["cost"];
    for (kind, numbers) in [
        ("joints", (1..=16).collect::<Vec<u64>>()),
        ("effects", (0..=100).step_by(10).collect()),
        ("cells", (1..=8).collect()),
    ] {
        let points = cost[kind]["points"].as_array().unwrap();
        let found: Vec<u64> = points.iter().map(|point| point["n"].as_u64().unwrap()).collect();
        assert_eq!(found, numbers, "{kind}");
        let costs = points.iter().map(|point| point["cost_us"].as_f64().unwrap());
        assert!(costs.clone().all(|cost| cost > 0.0), "{kind}: {points:?}");
        // By least squares the line has as much above it as below.
        let line = |n: u64| {
            let of = |name: &str| cost[kind]["line"][name].as_f64().unwrap();
            of("none_us") + of("slope_us") * n as f64
        };
        let residuals: Vec<f64> = costs.zip(&found).map(|(cost, n)| cost - line(*n)).collect();
        let (sum, size) =
            (residuals.iter().sum::<f64>(), residuals.iter().map(|x| x.abs()).sum::<f64>());
        assert!(sum.abs() < 1e-6 * (1.0 + size), "{kind}: {residuals:?}");
        roxmltree::Document::parse(&place.read(&format!("out/cost-{kind}.svg"))).expect("a plot");
    }
    // A solve without errors to correct would cost nothing.
    let steps = |kind: &str| cost[kind]["points"][3]["beside"].as_u64();
    assert!(steps("joints") > Some(0) && steps("effects") > Some(0), "{cost}");
    assert!(place.litter().is_empty() && left().is_empty(), "{:?} {:?}", place.litter(), left());
}

#[test]
fn a_policy_that_is_refused_fails_and_measures_nothing() {
    if !has_two_cores() {
        return;
    }
    let place = Place::new();
    let arguments = ["bench", "--policy", "fifo", "--only", "paced", "--seconds", "0.1"];
    let done = place.run_unprivileged(&[&arguments[..], &["--json", "bench.json"]].concat());
    assert_eq!(done.code, Some(3), "{done:#?}");
    assert!(done.err.contains("denied, so nothing is measured"), "{}", done.err);
    assert!(done.err.contains("--policy other"), "says what to do: {}", done.err);
    assert!(done.err.contains("memlock unlimited"), "and what it takes: {}", done.err);
    assert!(!done.err.contains("[realtime]"), "a bench has no such key: {}", done.err);
    assert!(!place.names().contains(&"bench.json".to_owned()));
    assert!(place.litter().is_empty() && left().is_empty(), "{:?} {:?}", place.litter(), left());
}

#[test]
fn cores_that_cannot_be_and_parts_that_do_not_exist_are_bad_input() {
    let place = Place::new();
    for wrong in [
        &["--cores", "0,0"][..],
        &["--cores", "0,8191"],
        &["--cores", "0"],
        &["--only", "tea"],
        &["--load", "tea"],
        &["--rate", "1000000"],
        &["--seconds", "-1"],
        &["--quick", "--seconds", "3"],
        &["--cell", "No Cell"],
        &["--cell", ""],
        &["--cell", "mine", "--wait", "spin"],
    ] {
        let done = bench(&place, wrong);
        assert_eq!(done.code, Some(2), "{wrong:?}: {done:#?}");
    }
    assert!(place.litter().is_empty());
}

#[test]
fn options_of_parts_that_are_not_measured_are_refused() {
    let place = Place::new();
    for (wrong, option) in [
        (&["--policy", "other", "--priority", "80"][..], "--priority"),
        (&["--only", "flat", "--starts", "5"], "--starts"),
        (&["--only", "flat,cost", "--rate", "1000"], "--rate"),
        (&["--only", "force", "--wait", "spin"], "--wait"),
        (&["--only", "start,swap", "--load", "idle"], "--load"),
        (&["--only", "start", "--seconds", "1"], "--seconds"),
        (&["--cell", "mine", "--starts", "5"], "--starts"),
    ] {
        let done = place.run(&[&["bench"], wrong].concat());
        assert_eq!(done.code, Some(2), "{wrong:?}: {done:#?}");
        let said = format!("{option} has no effect");
        assert!(done.err.contains(&said), "{wrong:?}: {}", done.err);
    }
}

#[test]
fn blocks_played_are_all_accounted_for_and_a_tone_brings_verdicts() {
    if !has_two_cores() {
        return;
    }
    let place = Place::new();
    let done = bench(&place, &["--only", "force", "--seconds", "1"]);
    assert_eq!(done.code, Some(0), "{done:#?}");
    let force = &place.json("bench.json")["settings"][0]["force"];
    let count = |name: &str| force[name].as_u64().unwrap();
    assert_eq!(count("blocks"), 2500, "1.5 s of noise and the second asked for");
    assert_eq!(count("taken") + count("lost"), count("blocks"), "{force}");
    if count("lost") > 0 {
        println!("skipped: a machine so busy that blocks are lost hears no tone");
        return;
    }
    for from in ["scheduled_ns", "actual_ns", "one_way_ns"] {
        check_quantiles(&force[from], None);
        assert!(force[from]["n"].as_u64() > Some(0), "{from}: {force}");
    }
    let median = |from: &str| force[from]["p50"].as_u64();
    assert!(
        median("scheduled_ns") >= median("actual_ns")
            && median("actual_ns") >= median("one_way_ns"),
        "{force}"
    );
}

#[test]
fn models_are_swapped_under_a_path_and_starts_are_timed() {
    if !has_two_cores() {
        return;
    }
    let place = Place::new();
    let asked = ["--only", "start,swap", "--starts", "2", "--seconds", "1"];
    let done = place.run(&[ONCE, &asked].concat());
    assert_eq!(done.code, Some(0), "{done:#?}");
    let result = place.json("bench.json");
    check_quantiles(&result["first_corrected_ns"], Some(2));
    let swap = &result["model_swap"];
    assert_eq!(swap["cycles"], 1000);
    assert!(swap["swaps"].as_u64() > Some(0), "{swap}");
    assert!(swap["epochs_seen"].as_u64() <= swap["swaps"].as_u64(), "{swap}");
    let step = swap["step_over_bound"].as_f64().unwrap();
    assert!(step > 0.0 && step <= 1.0, "the correction moves, and by its bound: {swap}");
    let judged = result["judged"].as_array().unwrap();
    assert!(judged.iter().any(|j| j["what"].as_str().unwrap().contains("first corrected")));
}

#[test]
fn a_part_that_cannot_be_measured_is_reported_and_counted() {
    if !has_two_cores() {
        return;
    }
    let place = Place::new();
    let done = place.run_alone(&[SHORT, &["--only", "woken", "--seconds", "0.2"]].concat());
    assert_eq!(done.code, Some(0), "{done:#?}");
    assert!(
        done.out.contains("NOT MEASURED: 1") && done.out.contains("cyclictest"),
        "{}",
        done.out
    );
    let result = place.json("bench.json");
    assert_eq!(result["skipped_count"], 1);
    assert!(result["skipped"][0]["why"].as_str().unwrap().contains("apt install rt-tests"));
    assert!(result["round_trip_woken_ns"]["pipe"]["n"].as_u64() > Some(0));
    assert_eq!(result["round_trip_ns"], Value::Null);
}

#[test]
fn cyclictest_takes_turns_with_what_it_stands_beside() {
    if !has_two_cores() {
        return;
    }
    let place = Place::new();
    let stub = place.path("cyclictest");
    let overflow_lines = "# Max Latencies: 00007\n# Histogram Overflows: 00000";
    let script = format!("#!/bin/sh\necho '000007 000030\n{overflow_lines}'\n");
    std::fs::write(&stub, script).unwrap();
    std::fs::set_permissions(&stub, std::fs::Permissions::from_mode(0o755)).unwrap();
    let folder = stub.parent().unwrap();
    let done = place.run_beside(folder, &[SHORT, &["--only", "woken", "--seconds", "1"]].concat());
    assert_eq!(done.code, Some(0), "{done:#?}");
    let trips = &place.json("bench.json")["settings"][0]["woken"]["round_trip_ns"];
    let turns = |kind: &str| -> u64 {
        trips[kind]["chunks"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).sum()
    };
    assert!(turns("cyclictest") > 1 && turns("cyclictest") == turns("pipe"), "{trips}");
    assert_eq!(trips["cyclictest"]["n"], 30 * turns("cyclictest"));
}

#[test]
fn the_doctor_lists_each_check_once_with_a_remedy_if_it_fails() {
    let place = Place::new();
    let done = place.run(&["doctor", "--json", "doctor.json"]);
    let result = place.json("doctor.json");
    let checks = result["checks"].as_array().unwrap();
    assert_eq!((result["schema"].as_str(), checks.len()), (Some("trued.doctor/1"), 11));
    assert_eq!(done.out.lines().count(), 13, "one line each, and the summary: {}", done.out);
    for (line, check) in done.out.lines().zip(checks) {
        let passes = check["state"] == "pass";
        assert!(line.starts_with(check["state"].as_str().unwrap()), "{line}");
        assert_eq!(check["fix"].as_str().unwrap().is_empty(), passes, "{check}");
        assert!(line.contains(check["found"].as_str().unwrap()), "{line}");
    }
    let wants_a_fix = checks.iter().any(|check| check["state"] == "fix");
    assert_eq!(done.code, Some(i32::from(wants_a_fix)));
    assert_eq!(result["ok"], !wants_a_fix);
    let summary = done.out.lines().last().unwrap();
    for check in checks.iter().filter(|check| check["state"] != "pass") {
        assert!(summary.contains(check["name"].as_str().unwrap()), "{summary}");
    }
}
