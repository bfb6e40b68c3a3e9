//! `cargo xtask evidence`: the document is made of recordings by the program, absent sets are said, the same data gives the same bytes.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use xtask::evidence::{Asked, make, set_names};

use crate::program::Place;

/// A slide of 95 kg with 20 N of dry friction in the columns of EMPS: `seconds` long, its motion shifted by `phase`.
fn experiment(seconds: u32, phase: f64) -> String {
    let mut text = String::from("t_s,q_ref_m,q_meas_m,vir_V\n");
    for k in 0..500 * seconds {
        let t = 2e-3 * f64::from(k);
        let waves = [(0.1, 1.1, phase), (0.04, 2.9, 1.0 + phase)];
        let sum = |f: &dyn Fn(f64, f64, f64) -> f64| {
            waves.iter().map(|(size, rate, at)| f(*size, *rate, rate * t + at)).sum::<f64>()
        };
        let q = sum(&|size, _, x| size * x.sin());
        let v = sum(&|size, rate, x| size * rate * x.cos());
        let a = sum(&|size, rate, x| -size * rate * rate * x.sin());
        let noise = f64::from(k * 7919 % 1000) / 500.0 - 1.0;
        let force = 95.0 * a + 200.0 * v + 20.0 * v.signum() + noise;
        let _ = writeln!(text, "{t:.4},{q:.9},{q:.9},{:.9}", force / 35.15065);
    }
    text
}

fn asked(place: &Place, out: &str) -> Asked {
    Asked {
        program: PathBuf::from(crate::TRUED),
        data: place.path("data"),
        out: place.path(out),
        work: place.path(&format!("work-{out}")),
        only: None,
        challenge: None,
        limit_s: 600.0,
    }
}

#[test]
fn a_recording_becomes_a_section_and_absent_sets_are_said() {
    let place = Place::new();
    fs::create_dir_all(place.path("data/emps")).unwrap();
    place.file("data/emps/DATA_EMPS.csv", &experiment(24, 0.0));
    place.file("data/emps/DATA_EMPS_PULSES.csv", &experiment(20, 0.7));
    make(&asked(&place, "docs")).unwrap();
    let text = place.read("docs/evidence.md");
    // What the program said of a slide that hides 20 N of dry friction.
    assert!(text.contains("coulomb friction 1"), "{text}");
    assert!(
        text.contains("| named first | coulomb friction 1 | coulomb friction 1 | met |"),
        "{text}"
    );
    // Said by rule: what this slide lacks is asked for and missed.
    assert!(text.contains("**Missed**: friction that differs by direction"), "{text}");
    let plot = place.read("docs/evidence/emps.svg");
    assert!(roxmltree::Document::parse(&plot).is_ok());
    for name in set_names() {
        assert!(text.contains(&format!("## {name}\n")), "{name} has no section");
    }
    assert!(text.contains("absent: f416_a100.csv"), "{text}");
    assert!(!place.path("docs/evidence/ur10e.svg").exists());
    // The program's answers are kept apart from the data, which stays as it was.
    assert_eq!(fs::read_dir(place.path("data/emps")).unwrap().count(), 2);

    make(&asked(&place, "again")).unwrap();
    assert_eq!(text, place.read("again/evidence.md"));
    assert_eq!(plot, place.read("again/evidence/emps.svg"));
}

#[test]
fn a_set_that_nobody_knows_and_a_run_beyond_its_time_are_said() {
    let place = Place::new();
    let unknown = Asked { only: Some("emsp".to_owned()), ..asked(&place, "docs") };
    let why = make(&unknown).unwrap_err();
    assert!(why.contains("emsp") && why.contains("emps"), "{why}");

    fs::create_dir_all(place.path("data/emps")).unwrap();
    place.file("data/emps/DATA_EMPS.csv", &experiment(24, 0.0));
    place.file("data/emps/DATA_EMPS_PULSES.csv", &experiment(20, 0.7));
    let hasty = Asked { limit_s: 0.0, ..asked(&place, "docs") };
    assert_eq!(make(&hasty), Ok(false));
    assert!(place.read("docs/evidence.md").contains("no answer within 0 s"));
}

#[test]
fn the_committed_document_has_a_section_for_each_set_and_its_plots() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let text = fs::read_to_string(docs.join("evidence.md")).unwrap();
    let sections: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("## ")).collect();
    assert_eq!(sections, set_names());
    for line in text.lines().filter(|line| line.starts_with("![")) {
        let file = line.rsplit_once("](").map_or("", |(_, rest)| rest.trim_end_matches(')'));
        let plot = fs::read_to_string(docs.join(file)).expect(file);
        assert!(roxmltree::Document::parse(&plot).is_ok(), "{file}");
    }
}
