//! An impact test of a tool, and profiles of machined surfaces.

use super::super::case::{Case, LimitCheck, Reference};
use super::super::set_runner::{RunOutcome, SetRunner, json};
use super::Set;

/// Natural frequencies of the tool by the set's note, Hz.
const MODES_HZ: [f64; 3] = [1056.0, 1941.0, 2598.0];

pub(super) const TAP: Set = Set {
    name: "tap-test",
    description: "A tool struck once by an instrumented hammer, force and acceleration at 51.2 kHz.",
    source: "github.com/leekunhwee/Vibration-Signal-Processing",
    given_model: "the columns of force and response.",
    files: &["impact_time_Point1_Channel1_CH1.txt"],
    not_run_reason: None,
    run: tap,
};

pub(super) const SURFACE: Set = Set {
    name: "surface-profile",
    description: "Stylus profiles of a milled and an eroded surface, 5.6 mm at 0.25 µm, with the parameters that the National Physical Laboratory computed of them.",
    source: "github.com/NavierPy/surface-roughness-profile-analyser (data: National Physical Laboratory, UK)",
    given_model: "only the profiles; a fitted line is subtracted as form.",
    files: &["mill_profile.csv", "edm_profile.csv", "mill.xml", "edm.xml"],
    not_run_reason: None,
    run: surface,
};

fn tap(bench: &SetRunner) -> Result<Vec<Case>, String> {
    let file = "impact_time_Point1_Channel1_CH1.txt";
    bench.copy(&[file])?;
    let arguments = [
        "tap",
        "--force",
        "2",
        "--response",
        "3",
        "--response-kind",
        "acceleration",
        "--json",
        "OUT/said.json",
        "--report",
        "OUT/report.html",
        file,
    ];
    let answer = bench.run_trued("tap", &arguments)?;
    let mut case =
        Case::from_outcome("natural frequencies", "the tool's modes", &arguments, &answer);
    let RunOutcome::Done(folder) = &answer else { return Ok(vec![case]) };
    let page = folder.join("report.html");
    bench.offer_figure(
        &page,
        "Magnitude of the accelerance",
        "Magnitude of the accelerance, with the natural frequencies as found.",
    );
    let result = json(&folder.join("said.json"));
    let modes: Vec<(f64, f64, bool)> = result["modes"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(|one| {
            Some((
                one["frequency_Hz"].as_f64()?,
                one["sigma_frequency_Hz"].as_f64()?,
                one["verified"] == true,
            ))
        })
        .collect();
    case.verdict = format!("modes: {}", modes.len());
    for (hz, sigma, _) in &modes {
        case.statements.push(format!(
            "A mode at {} ± {} Hz.",
            report::significant(*hz, 4),
            report::significant(*sigma, 2)
        ));
    }
    case.short.clone_from(&case.verdict);
    case.reference = Some(Reference {
        value: None,
        text: "modes near 1056, 1941, 2598 Hz (noted with the set)",
    });
    for known in MODES_HZ {
        let frequencies = modes.iter().map(|mode| mode.0);
        let nearest = frequencies.min_by(|a, b| (a - known).abs().total_cmp(&(b - known).abs()));
        let deviation = nearest.map_or(f64::NAN, |hz| 100.0 * (hz - known).abs() / known);
        case.checks.push(LimitCheck::at_most(
            &format!("off the mode near {known} Hz"),
            deviation,
            3.0,
            "%",
        ));
    }
    let doubtful = modes.iter().filter(|mode| !mode.2).count();
    if doubtful > 0 {
        case.shortfall_notes.push(format!("Marked unverified by the program: {doubtful} of {} modes, since one hit gives no coherence.", modes.len()));
    }
    Ok(vec![case])
}

fn surface(bench: &SetRunner) -> Result<Vec<Case>, String> {
    let mut cases = Vec::new();
    for (name, run, xml) in
        [("milled surface", "mill", "mill.xml"), ("eroded surface", "edm", "edm.xml")]
    {
        let file = format!("{run}_profile.csv");
        bench.copy(&[file.as_str()])?;
        let arguments =
            ["surface", "--json", "OUT/said.json", "--report", "OUT/report.html", file.as_str()];
        let answer = bench.run_trued(run, &arguments)?;
        let mut case = Case::from_outcome(name, "the parameters", &arguments, &answer);
        let RunOutcome::Done(folder) = &answer else {
            cases.push(case);
            continue;
        };
        if run == "mill" {
            bench.offer_figure(
                &folder.join("report.html"),
                "",
                "The milled profile as `trued surface` draws it.",
            );
        }
        case.reference = Some(Reference {
            value: None,
            text: "the parameters in the set's own files, computed by the National Physical Laboratory",
        });
        let result = json(&folder.join("said.json"));
        let text = bench.data(xml)?;
        let primary = &result["profiles"][0]["primary"];
        for (tag, key, what) in [("PA", "a_um", "Pa"), ("PQ", "q_um", "Pq")] {
            let known = xml_value(&text, tag);
            let found = primary[key].as_f64().unwrap_or(f64::NAN);
            case.statements.push(format!(
                "{what} {} µm; reference {} µm.",
                report::significant(found, 5),
                report::significant(known, 5)
            ));
            let deviation = 100.0 * (found - known).abs() / known;
            case.checks.push(LimitCheck::at_most(
                &format!("{what} off theirs"),
                deviation,
                0.1,
                "%",
            ));
        }
        let lines = result["profiles"][0]["lines"].as_array().map_or(0, Vec::len);
        case.verdict = format!("lines in the spectrum: {lines}");
        case.short.clone_from(&case.verdict);
        cases.push(case);
    }
    Ok(cases)
}

/// `<PA>0.19942</PA>`.
fn xml_value(xml: &str, tag: &str) -> f64 {
    let after = xml.split_once(&format!("<{tag}>")).map_or("", |(_, rest)| rest);
    after.split('<').next().and_then(|number| number.trim().parse().ok()).unwrap_or(f64::NAN)
}
