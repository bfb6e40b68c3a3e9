//! `trued diagnose` for effects that resemble another one, or two together: the right one is found,
//! and no other.

use recording::model::presets::preset;

use crate::diagnose::{BASE, path_of};
use crate::program::Place;

/// Model, robot, and measurement.
struct Case<'a> {
    known: &'a str,
    truth: &'a str,
    step_s: f64,
    /// Of the rows that the robot went through every n-th was recorded.
    recorded: usize,
    /// Largest force and moment at the tool, N and Nm along its axes; none was recorded where they are zero.
    wrench: [f64; 6],
    noise_mm: f64,
}

/// A path with the wrench of a tool that is pushed about.
fn pushed(path: &str, wrench: [f64; 6]) -> String {
    let row = |(k, line): (usize, &str)| {
        let push = wrench.iter().enumerate().map(|(axis, most)| {
            let pace = [0.11, 0.17, 0.23, 0.31, 0.41, 0.53][axis];
            format!("{:.4}", most * (pace * k as f64).sin())
        });
        match k {
            0 => format!("{line},fx_N,fy_N,fz_N,mx_Nm,my_Nm,mz_Nm"),
            _ => format!("{line},{}", push.collect::<Vec<_>>().join(",")),
        }
    };
    path.lines().enumerate().map(row).collect::<Vec<_>>().join("\n") + "\n"
}

impl Case<'_> {
    /// Every finding, with its joint.
    fn findings(&self) -> Vec<(String, u64)> {
        let place = Place::new();
        let base = preset(BASE).expect("preset").text;
        let Self { known, truth, step_s, recorded, wrench, noise_mm } = self;
        place.file("known.toml", &format!("{base}\n{known}"));
        place.file("truth.toml", &format!("{base}\n{truth}"));
        let path = path_of(*step_s);
        let is_pushed = wrench.iter().any(|most| *most != 0.0);
        place.file("path.csv", &if is_pushed { pushed(&path, *wrench) } else { path });
        place.file("path.toml", "schema = \"trued.recording/1\"\nmeasuring_frame = \"base\"\n");
        let noise = noise_mm.to_string();
        let simulate = ["simulate", "--model", "truth.toml", "--out", "seen", "--seed", "4"];
        place.succeed(&[&simulate[..], &["--noise", &noise, "path.csv"]].concat());
        let table = place.read("seen.csv");
        let (header, rows) = table.split_once('\n').unwrap_or_default();
        let rows: Vec<&str> = rows.lines().step_by(*recorded).collect();
        place.file("seen.csv", &format!("{header}\n{}\n", rows.join("\n")));
        let sigma = format!("sigma = {{ x_mm = {noise}, y_mm = {noise}, z_mm = {noise} }}\n");
        place.file("seen.toml", &format!("schema = \"trued.recording/1\"\n{sigma}"));
        let diagnose = ["diagnose", "--model", "known.toml", "--out", "said", "--seed", "1"];
        place.succeed(&[&diagnose[..], &["seen.csv"]].concat());
        let result = place.json("said/diagnosis.json");
        let findings = result["findings"].as_array().cloned().unwrap_or_default();
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
        let case = Case {
            known: &known,
            truth: &truth,
            step_s: 0.02,
            recorded: 1,
            wrench: [0.0; 6],
            noise_mm,
        };
        assert_eq!(case.findings(), [("counterbalance".to_owned(), 2)], "{spring}");
    }
}

/// Rows within the gap show a ramp after each reversal, as hysteresis does.
#[test]
fn a_gap_that_takes_several_rows_to_cross_is_backlash() {
    let truth = "[[effect]]\nkind = \"backlash\"\njoint = 5\nwidth_mrad = 2.0\n";
    for step_s in [0.01, 0.005] {
        let case = Case { known: "", truth, step_s, recorded: 1, wrench: [0.0; 6], noise_mm: 0.01 };
        assert_eq!(case.findings(), [("backlash".to_owned(), 5)], "{step_s} s");
    }
}

/// A hysteresis whose distance is between those of the candidates, measured so accurately that the
/// neighbours leave hundreds of times the noise; the last joint moves further from row to row than
/// any hysteresis is wide.
#[test]
fn a_loop_is_no_gap_with_a_spike() {
    for (amplitude, reversal, noise_mm) in [(0.3, 1.0, 0.005), (1.0, 5.0, 0.01)] {
        let truth = format!(
            "[[effect]]\nkind = \"hysteresis\"\njoint = 3\namplitude_mrad = {amplitude:?}\nreversal_mrad = {reversal:?}\n"
        );
        let case = Case {
            known: "",
            truth: &truth,
            step_s: 0.02,
            recorded: 1,
            wrench: [0.0; 6],
            noise_mm,
        };
        assert_eq!(case.findings(), [("hysteresis".to_owned(), 3)], "{reversal} mrad");
    }
}

/// A joint that turns a few times in the recording: rows that lie far off, one after the other.
#[test]
fn a_spike_at_few_reversals_is_no_reading_gone_wrong() {
    let truth = "[[effect]]\nkind = \"reversal_spike\"\njoint = 2\namplitude_mrad = 0.9\ntime_constant_ms = 80.0\n";
    let case =
        Case { known: "", truth, step_s: 0.004, recorded: 1, wrench: [0.0; 6], noise_mm: 0.005 };
    assert_eq!(case.findings(), [("reversal_spike".to_owned(), 2)]);
}

/// The missing effect is hundreds of times above the noise, with an autocorrelation unlike that of
/// noise.
#[test]
fn an_effect_far_above_the_noise_is_not_taken_for_noise() {
    let effects = [
        ("tool_offset", 0, "shift_mm = [0.8, 1.2, -0.5]\nturn_mrad = [0.0, 0.0, 0.0]\n"),
        ("servo_lag", 3, "joint = 3\ntime_constant_ms = 9.5\n"),
        (
            "transmission_error",
            1,
            "joint = 1\namplitude_mrad = 0.3\ncycles_per_rev = 50.0\nphase_rad = 0.6\n",
        ),
    ];
    for (kind, joint, numbers) in effects {
        let truth = format!("[[effect]]\nkind = \"{kind}\"\n{numbers}");
        let case = Case {
            known: "",
            truth: &truth,
            step_s: 0.01,
            recorded: 1,
            wrench: [0.0; 6],
            noise_mm: 0.002,
        };
        assert_eq!(case.findings(), [(kind.to_owned(), joint)], "{kind}");
    }
}

/// A wrist that carries 2 Nm hardens a million times as much per cubed load as a shoulder that carries 200.
#[test]
fn a_light_joint_that_hardens_is_named() {
    let known = compliance(5, 50.0, 2.0);
    let hard = "[[effect]]\nkind = \"stiffness_hardening\"\njoint = 5\ncubic_mrad_per_kNm3 = 1e6\n";
    let truth = format!("{known}\n{hard}");
    let case = Case {
        known: &known,
        truth: &truth,
        step_s: 0.02,
        recorded: 1,
        wrench: [0.0; 6],
        noise_mm: 0.003,
    };
    assert_eq!(case.findings(), [("stiffness_hardening".to_owned(), 5)]);
}

/// The arm approaches its reversals five times as fast as the rows are recorded, and the gap is
/// open from there.
#[test]
fn play_that_turns_between_rows_is_no_hysteresis() {
    let truth = "[[effect]]\nkind = \"backlash\"\njoint = 2\nwidth_mrad = 0.2\n";
    let case =
        Case { known: "", truth, step_s: 0.008, recorded: 5, wrench: [0.0; 6], noise_mm: 0.002 };
    assert_eq!(case.findings(), [("backlash".to_owned(), 2)]);
}

#[test]
fn a_gear_that_is_stated_to_have_play_may_lack_hysteresis() {
    let known = "[[effect]]\nkind = \"backlash\"\njoint = 3\nwidth_mrad = 0.1\nsigma = { width_mrad = 0.005 }\n";
    let lag =
        "[[effect]]\nkind = \"hysteresis\"\njoint = 3\namplitude_mrad = 0.1\nreversal_mrad = 8.0\n";
    let truth = format!("{known}\n{lag}");
    let case =
        Case { known, truth: &truth, step_s: 0.01, recorded: 1, wrench: [0.0; 6], noise_mm: 0.005 };
    assert_eq!(case.findings(), [("hysteresis".to_owned(), 3)]);
}

/// Moments of a newton metre hardly determine their scales, which are then arbitrary: this must not
/// exclude scales of the forces.
#[test]
fn a_scale_that_nothing_shows_bars_no_scales_that_show() {
    let known = [2, 3, 5].map(|joint| compliance(joint, 3.0, 0.03)).concat();
    let scale = "[[effect]]\nkind = \"wrench_scale\"\nscale = [0.2, 0.25, 0.25, 0.2, -0.3, 0.17]\n";
    let truth = format!("{known}\n{scale}");
    let wrench = [60.0, 80.0, 100.0, 0.5, 0.5, 0.5];
    let case =
        Case { known: &known, truth: &truth, step_s: 0.02, recorded: 1, wrench, noise_mm: 0.01 };
    assert_eq!(case.findings(), [("wrench_scale".to_owned(), 0)]);
}

/// A vertical axis is not loaded by gravity, and the arm's own inertia hardly deflects it: one
/// compliance with two equivalent descriptions, of which one is reported.
#[test]
fn a_vertical_joint_loaded_by_the_tool_has_a_compliance_under_either_name() {
    let truth =
        "[[effect]]\nkind = \"load_compliance\"\njoint = 1\ncompliance_mrad_per_kNm = 0.1\n";
    let wrench = [1200.0, 1600.0, 2000.0, 40.0, 40.0, 40.0];
    let case = Case { known: "", truth, step_s: 0.02, recorded: 1, wrench, noise_mm: 0.03 };
    assert_eq!(case.findings(), [("joint_compliance".to_owned(), 1)]);
}

/// A gap that is wider on one half of the joint's range is mostly backlash; the remainder is one
/// law of that joint, and not a dozen effects.
#[test]
fn a_gap_that_is_wider_here_than_there_is_no_dozen_of_names() {
    let place = Place::new();
    let base = preset(BASE).expect("preset").text;
    place.file("known.toml", base);
    place.file("path.csv", &path_of(0.02));
    place.file("path.toml", "schema = \"trued.recording/1\"\nmeasuring_frame = \"base\"\n");
    let [narrow, wide] = [0.5, 2.0].map(|width| {
        let gap = format!("[[effect]]\nkind = \"backlash\"\njoint = 4\nwidth_mrad = {width:?}\n");
        place.file("truth.toml", &format!("{base}\n{gap}"));
        let simulate = ["simulate", "--model", "truth.toml", "--out", "seen", "--seed", "4"];
        place.succeed(&[&simulate[..], &["--overwrite", "--noise", "0.01", "path.csv"]].concat());
        place.read("seen.csv")
    });
    let column = narrow.lines().next().and_then(|line| line.split(',').position(|c| c == "q4_deg"));
    let is_here = |line: &str| {
        let q4 = column.and_then(|column| line.split(',').nth(column));
        q4.and_then(|q4| q4.parse::<f64>().ok()).is_some_and(|q4| q4 > 0.0)
    };
    let rows = narrow.lines().zip(wide.lines());
    let rows = rows.map(|(narrow, wide)| if is_here(narrow) { wide } else { narrow });
    place.file("seen.csv", &(rows.collect::<Vec<_>>().join("\n") + "\n"));
    let sigma = "sigma = { x_mm = 0.01, y_mm = 0.01, z_mm = 0.01 }\n";
    place.file("seen.toml", &format!("schema = \"trued.recording/1\"\n{sigma}"));
    let diagnose = ["diagnose", "--model", "known.toml", "--out", "said", "--seed", "1"];
    place.succeed(&[&diagnose[..], &["seen.csv"]].concat());
    let result = place.json("said/diagnosis.json");
    assert_eq!(result["verdict"], "unknown_structure", "{}", result["findings"]);
    let findings = result["findings"].as_array().cloned().unwrap_or_default();
    assert!(findings.len() <= 2, "{findings:?}");
    let follows = result["unexplained"]["depends_on"].as_array().cloned().unwrap_or_default();
    assert!(
        follows.contains(&"q4".into()) && follows.contains(&"direction_4".into()),
        "{follows:?}"
    );
}

/// Two hundred settled poses do not constrain everything that resembles noise; a drift with the
/// ambient temperature is not noise.
#[test]
fn a_link_that_grows_behind_the_air_is_no_noise_that_remembers_itself() {
    let place = Place::new();
    let base = preset(BASE).expect("preset").text;
    place.file("known.toml", base);
    let growth =
        "[[effect]]\nkind = \"thermal_growth\"\njoint = 1\ngrowth_um_per_K = 60.0\nlag_s = 700.0\n";
    place.file("truth.toml", &format!("{base}\n{growth}"));
    let joints = |stem: &str, unit: &str| {
        (1..=6).map(|n| format!("{stem}{n}{unit}")).collect::<Vec<_>>().join(",")
    };
    let mut path =
        format!("t_s,{},{},x_mm,y_mm,z_mm,temp_C\n", joints("q", "_deg"), joints("d", ""));
    for k in 0..240 {
        let pace = f64::from(k);
        let q = [0.9, 1.7, 2.3, 3.1, 0.7, 1.3].map(|by: f64| 50.0 * (by * pace).sin());
        let q = q.map(|q| format!("{q:.6}")).join(",");
        let d = [3.0, 5.0, 7.0, 11.0, 13.0, 17.0]
            .map(|by: f64| if (by * pace).sin() < 0.0 { "-1" } else { "1" })
            .join(",");
        let temp_c = 20.0 + 6.0 * (pace / 50.0).sin();
        path += &format!("{:.1},{q},{d},1,2,3,{temp_c:.3}\n", 20.0 * pace);
    }
    place.file("path.csv", &path);
    let about = "schema = \"trued.recording/1\"\nkind = \"poses\"\napproach = \"columns\"\n";
    place.file("path.toml", &format!("{about}measuring_frame = \"base\"\n"));
    let simulate = ["simulate", "--model", "truth.toml", "--out", "seen", "--seed", "4"];
    place.succeed(&[&simulate[..], &["--noise", "0.03", "path.csv"]].concat());
    let sigma = "sigma = { x_mm = 0.03, y_mm = 0.03, z_mm = 0.03 }\n";
    place.file("seen.toml", &format!("{about}{sigma}"));
    let diagnose = ["diagnose", "--model", "known.toml", "--out", "said", "--seed", "1"];
    place.succeed(&[&diagnose[..], &["seen.csv"]].concat());
    let result = place.json("said/diagnosis.json");
    assert_eq!(result["verdict"], "missing_physics", "{result}");
    assert_eq!(result["findings"][0]["effect"], "thermal_growth");
    assert_eq!(result["findings"][0]["joint"], 1);
}
