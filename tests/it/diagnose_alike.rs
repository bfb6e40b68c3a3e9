//! `trued diagnose` where one effect looks much like another, or like two together: the right name is told, and alone.

use recording::model::presets::preset;

use crate::diagnose::{BASE, path_of};
use crate::program::Place;

/// What the model knows, what the robot has, how it is seen.
struct Case<'a> {
    known: &'a str,
    truth: &'a str,
    step_s: f64,
    noise_mm: f64,
}

impl Case<'_> {
    /// Every name that is told, with its joint.
    fn told(&self) -> Vec<(String, u64)> {
        let place = Place::new();
        let base = preset(BASE).expect("preset").text;
        let Self { known, truth, step_s, noise_mm } = self;
        place.file("known.toml", &format!("{base}\n{known}"));
        place.file("truth.toml", &format!("{base}\n{truth}"));
        place.file("path.csv", &path_of(*step_s));
        place.file("path.toml", "schema = \"trued.recording/1\"\nmeasuring_frame = \"base\"\n");
        let noise = noise_mm.to_string();
        let simulate = ["simulate", "--model", "truth.toml", "--out", "seen", "--seed", "4"];
        place.succeed(&[&simulate[..], &["--noise", &noise, "path.csv"]].concat());
        let sigma = format!("sigma = {{ x_mm = {noise}, y_mm = {noise}, z_mm = {noise} }}\n");
        place.file("seen.toml", &format!("schema = \"trued.recording/1\"\n{sigma}"));
        let diagnose = ["diagnose", "--model", "known.toml", "--out", "said", "--seed", "1"];
        place.succeed(&[&diagnose[..], &["seen.csv"]].concat());
        let said = place.json("said/diagnosis.json");
        let findings = said["findings"].as_array().cloned().unwrap_or_default();
        let one = |finding: &serde_json::Value| {
            let effect = finding["effect"].as_str().unwrap_or_default().to_owned();
            (effect, finding["joint"].as_u64().unwrap_or_default())
        };
        findings.iter().map(one).collect()
    }
}

fn compliance(joint: usize, mrad_per_knm: f64, sigma: f64) -> String {
    format!(
        "[[effect]]\nkind = \"joint_compliance\"\njoint = {joint}\ncompliance_mrad_per_kNm = {mrad_per_knm:?}\n\
         sigma = {{ compliance_mrad_per_kNm = {sigma:?} }}\n"
    )
}

fn spring(stiffness: f64, [free_mm, a_mm, l_mm]: [f64; 3], angle_deg: f64) -> String {
    format!(
        "[[effect]]\nkind = \"counterbalance\"\njoint = 2\nstiffness_N_per_m = {stiffness:?}\nfree_length_mm = {free_mm:?}\n\
         a_mm = {a_mm:?}\nL_mm = {l_mm:?}\nangle_deg = {angle_deg:?}\n"
    )
}

/// Where the compliance that it bends is stated a little wrong.
#[test]
fn a_counterbalance_is_no_set_of_waves_and_zeros() {
    let known = compliance(2, 2.5, 0.06);
    let springs = [
        (spring(9600.0, [75.0, 227.0, 314.0], 202.0), 2.5, 0.03),
        (spring(3000.0, [138.0, 206.0, 391.0], 94.0), 2.42, 0.003),
        (spring(6000.0, [100.0, 150.0, 500.0], 30.0), 2.56, 0.01),
    ];
    for (spring, mrad_per_knm, noise_mm) in springs {
        let truth = format!("{}\n{spring}", compliance(2, mrad_per_knm, 0.06));
        let case = Case { known: &known, truth: &truth, step_s: 0.02, noise_mm };
        assert_eq!(case.told(), [("counterbalance".to_owned(), 2)], "{spring}");
    }
}

/// Rows within the gap show a ramp after each reversal, as hysteresis does.
#[test]
fn a_gap_that_takes_several_rows_to_cross_is_backlash() {
    let truth = "[[effect]]\nkind = \"backlash\"\njoint = 5\nwidth_mrad = 2.0\n";
    for step_s in [0.01, 0.005] {
        let case = Case { known: "", truth, step_s, noise_mm: 0.01 };
        assert_eq!(case.told(), [("backlash".to_owned(), 5)], "{step_s} s");
    }
}

/// A wrist that carries 2 Nm hardens a million times as much per cubed load as a shoulder that carries 200.
#[test]
fn a_light_joint_that_hardens_is_named() {
    let known = compliance(5, 50.0, 2.0);
    let hard = "[[effect]]\nkind = \"stiffness_hardening\"\njoint = 5\ncubic_mrad_per_kNm3 = 1e6\n";
    let truth = format!("{known}\n{hard}");
    let case = Case { known: &known, truth: &truth, step_s: 0.02, noise_mm: 0.003 };
    assert_eq!(case.told(), [("stiffness_hardening".to_owned(), 5)]);
}

#[test]
fn a_gear_that_is_stated_to_have_play_may_lack_hysteresis() {
    let known = "[[effect]]\nkind = \"backlash\"\njoint = 3\nwidth_mrad = 0.1\nsigma = { width_mrad = 0.005 }\n";
    let lag =
        "[[effect]]\nkind = \"hysteresis\"\njoint = 3\namplitude_mrad = 0.1\nreversal_mrad = 8.0\n";
    let truth = format!("{known}\n{lag}");
    let case = Case { known, truth: &truth, step_s: 0.01, noise_mm: 0.005 };
    assert_eq!(case.told(), [("hysteresis".to_owned(), 3)]);
}
