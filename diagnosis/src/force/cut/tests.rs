//! Cuts simulated by `world::milling` with one, two or no hidden effects; and invalid recordings.

mod unknown;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;
use recording::model::RobotModel;
use recording::series::{Channel, Cut, Recording};
use world::milling::{Row, measured_forces};

use super::super::tests::NO_ARM;
use super::super::{CutComparison, Diagnosis, NoComparison, diagnose};
use crate::diagnose::Verdict;
use crate::torque::Finding;

/// A simulated cut.
struct Made {
    rate_hz: f64,
    lasts_s: f64,
    feeds_m_s: &'static [f64],
    /// Spindle speed, rev/min.
    rpm: f64,
    /// Entry and exit angle, rad.
    engaged: [f64; 2],
    turning: bool,
    /// Standard deviation of the noise, N.
    noise: f64,
    /// Autocorrelation of the noise from row to row (AR(1) coefficient).
    stays: f64,
    /// Ratio of the recorded to the true spindle speed.
    tells: f64,
}

const MADE: Made = Made {
    rate_hz: 4000.0,
    lasts_s: 2.0,
    feeds_m_s: &[0.0, 4e-3, 8e-3, 16e-3],
    rpm: RPM,
    engaged: [0.0, 1.6],
    turning: false,
    noise: 2.0,
    stays: 0.0,
    tells: 1.0,
};

const RPM: f64 = 4020.0;

impl Made {
    fn cut(&self) -> Cut {
        Cut {
            teeth: if self.turning { 1 } else { 4 },
            diameter_m: 10e-3,
            helix_rad: 0.5,
            axial_depth_m: 2e-3,
            entry_rad: self.engaged[0],
            exit_rad: self.engaged[1],
            cutting_pa: [800e6, 300e6, 150e6],
            edge_n_per_m: [8e3, 10e3, 2e3],
            turning: self.turning,
        }
    }

    /// Recording with effects that the model does not state.
    fn recorded(&self, effects: &str) -> Recording {
        let model = RobotModel::parse("hidden", &format!("{NO_ARM}\n{effects}")).expect("sound");
        let count = (self.rate_hz * self.lasts_s) as usize;
        let rows: Vec<Row> = (0..count)
            .map(|k| Row {
                t_s: k as f64 / self.rate_hz,
                segment: 0,
                spindle_rpm: self.rpm,
                feed_m_s: self.feeds_m_s[k * self.feeds_m_s.len() / count],
            })
            .collect();
        let model = model.with_cutting().expect("few effects");
        let forces = measured_forces(&model, &self.cut().cutter(), &rows);
        let mut recording = Recording::new(rows.iter().map(|row| row.t_s).collect());
        recording.set(Channel::Spindle, vec![self.rpm * self.tells; count]);
        recording.set(Channel::Feed, rows.iter().map(|row| row.feed_m_s).collect());
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let fresh = (1.0 - self.stays * self.stays).sqrt();
        for axis in 0..3 {
            let mut last = 0.0;
            let mut noise = || {
                last = self.stays * last + fresh * rng.sample::<f64, _>(StandardNormal);
                self.noise * last
            };
            recording
                .set(Channel::Wrench(axis), forces.iter().map(|f| f[axis] + noise()).collect());
        }
        recording.metadata.cut = Some(self.cut());
        recording
    }

    fn compared(&self, effects: &str) -> CutComparison {
        of(&self.recorded(effects)).cut_comparison.expect("compared")
    }
}

fn of(recording: &Recording) -> Diagnosis {
    let model = RobotModel::parse("no arm", NO_ARM).expect("sound");
    diagnose(&model.physics, &[], recording).expect("sound")
}

fn effect(kind: &str, numbers: &str) -> String {
    format!("[[effect]]\nkind = \"{kind}\"\n{numbers}\n")
}

fn kinds(compared: &CutComparison) -> Vec<&'static str> {
    compared.findings.iter().map(|one| one.kind).collect()
}

/// Asserts that each true parameter is within four standard uncertainties of the found one.
fn holds(finding: &Finding, truth: &[(&str, &[f64])]) {
    for (stem, wanted) in truth {
        let found =
            finding.parameters.iter().find(|number| number.stem == *stem).expect("a number");
        for (k, wanted) in wanted.iter().enumerate() {
            let (value, sigma) = (found.values[k], found.sigma[k]);
            assert!(
                (value - wanted).abs() < 4.0 * sigma + 1e-12,
                "{stem} {k}: {found:?}, {wanted}"
            );
        }
    }
}

#[test]
fn each_effect_alone_is_named_and_its_numbers_hold_the_truth() {
    type Hidden = (&'static str, &'static str, &'static [(&'static str, &'static [f64])]);
    let hidden: [Hidden; 9] = [
        (
            "edge_force",
            "coefficient_N_per_mm = [4.0, 3.0, 1.0]",
            &[("coefficient", &[4e3, 3e3, 1e3])],
        ),
        (
            "cutting_force",
            "coefficient_N_per_mm2 = [80.0, 40.0, 15.0]",
            &[("coefficient", &[80e6, 40e6, 15e6])],
        ),
        ("tool_wear", "growth_per_m = 40.0", &[("growth", &[40.0])]),
        ("runout", "radial_um = 4.0\nphase_rad = 0.7", &[("radial", &[4e-6]), ("phase", &[0.7])]),
        (
            "chatter",
            "frequency_Hz = 684.0\namplitude_N = 6.0",
            &[("frequency", &[684.0]), ("amplitude", &[6.0])],
        ),
        ("cross_talk", "matrix = [0, 0.08, 0, 0, 0, 0, 0, 0, 0]", &[("matrix", &[0.0, 0.08, 0.0])]),
        ("wrench_bias", "bias_N = [2.0, -3.0, 1.0]", &[("bias", &[2.0, -3.0, 1.0])]),
        ("wrench_scale", "scale = [0.1, 0, 0, 0, 0, 0]", &[("scale", &[0.1, 0.0, 0.0])]),
        ("wrench_misalignment", "turn_mrad = [20, -30, 40]", &[("turn", &[0.02, -0.03, 0.04])]),
    ];
    for (kind, numbers, truth) in hidden {
        let compared = MADE.compared(&effect(kind, numbers));
        assert_eq!(kinds(&compared), [kind], "{kind}: {:?}", compared.findings);
        assert_eq!(compared.verdict, Verdict::MissingPhysics, "{kind}");
        let [finding] = &compared.findings[..] else { unreachable!() };
        holds(finding, truth);
        assert!(finding.confidence > 0.5, "{kind}: {}", finding.confidence);
        let [before, after] = compared.heldout;
        assert!(after < before && after < 1.1 * MADE.noise, "{kind}: {before} {after}");
    }
}

#[test]
fn a_law_that_holds_is_consistent_up_and_down_milling_and_whatever_the_noise_remembers() {
    for made in [
        Made { ..MADE },
        Made { engaged: [1.5, 3.1], ..MADE },
        Made { stays: 0.9, ..MADE },
        Made { turning: true, ..MADE },
    ] {
        let compared = made.compared("");
        assert!(compared.findings.is_empty(), "{:?}", compared.findings);
        assert_eq!(compared.verdict, Verdict::Consistent);
    }
}

#[test]
fn two_effects_at_once_are_both_named() {
    let runout = effect("runout", "radial_um = 4.0\nphase_rad = 0.7");
    let harder = effect("cutting_force", "coefficient_N_per_mm2 = [80.0, 40.0, 15.0]");
    let bias = effect("wrench_bias", "bias_N = [2.0, -3.0, 1.0]");
    for (one, other) in [(&runout, &harder), (&harder, &bias)] {
        let compared = MADE.compared(&format!("{one}{other}"));
        let mut found = kinds(&compared);
        found.sort_unstable();
        let mut wanted: Vec<&str> =
            [one, other].map(|text| text.split('"').nth(1).expect("a kind")).to_vec();
        wanted.sort_unstable();
        assert_eq!(found, wanted, "{:?}", compared.findings);
    }
}

#[test]
fn down_milling_noise_with_a_memory_and_aliases_do_not_hide_an_edge() {
    let edge = effect("edge_force", "coefficient_N_per_mm = [4.0, 3.0, 1.0]");
    for made in [
        Made { engaged: [1.5, 3.1], ..MADE },
        Made { stays: 0.9, ..MADE },
        // The tooth-passing frequency is 268 Hz.
        Made { rate_hz: 430.0, lasts_s: 12.0, ..MADE },
    ] {
        let compared = made.compared(&edge);
        assert_eq!(kinds(&compared), ["edge_force"], "{:?}", compared.findings);
        holds(&compared.findings[0], &[("coefficient", &[4e3, 3e3, 1e3])]);
    }
}

#[test]
fn a_told_speed_that_is_a_thousandth_off_is_found_and_is_no_physics() {
    let made = Made { tells: 1.001, ..MADE };
    let compared = made.compared("");
    assert!(compared.findings.is_empty(), "{:?}", compared.findings);
    assert!(compared.notes.iter().any(|note| note.contains("slower")), "{:?}", compared.notes);
    let compared = made.compared(&effect("runout", "radial_um = 4.0\nphase_rad = 0.7"));
    assert_eq!(kinds(&compared), ["runout"], "{:?}", compared.findings);
}

#[test]
fn turned_at_one_feed_what_shears_and_what_rubs_is_not_told_apart() {
    let made = Made { turning: true, feeds_m_s: &[0.0, 8e-3], ..MADE };
    let compared = made.compared(&effect("edge_force", "coefficient_N_per_mm = [4.0, 0, 0]"));
    assert_eq!(compared.verdict, Verdict::Undetermined, "{:?}", compared.findings);
    let [one] = &compared.findings[..] else { panic!("{:?}", compared.findings) };
    let mut names: Vec<&str> = one
        .alternatives
        .iter()
        .filter(|rival| rival.is_indistinguishable)
        .map(|rival| rival.kind)
        .collect();
    names.push(one.kind);
    for kind in ["edge_force", "cutting_force", "wrench_scale"] {
        assert!(names.contains(&kind), "{names:?}");
    }
    assert!(compared.has_one_feed);
}

#[test]
fn swapped_channels_another_unit_and_no_speed_are_never_a_finding() {
    let mut swapped = MADE.recorded("");
    let [x, y] = [0, 1].map(|axis| swapped.column(Channel::Wrench(axis)).expect("made").to_vec());
    swapped.set(Channel::Wrench(0), y);
    swapped.set(Channel::Wrench(1), x);
    let mut other_unit = MADE.recorded("");
    for axis in 0..3 {
        let values = other_unit.column(Channel::Wrench(axis)).expect("made");
        let values = values.iter().map(|force| 1e3 * force).collect();
        other_unit.set(Channel::Wrench(axis), values);
    }
    let mut speedless = MADE.recorded("");
    speedless.remove(Channel::Spindle);
    // The stated cut with forces of air.
    let mut uncut = MADE.recorded("");
    let air = Made { feeds_m_s: &[0.0], ..MADE }.recorded("");
    for axis in 0..3 {
        uncut.set(Channel::Wrench(axis), air.column(Channel::Wrench(axis)).expect("made").to_vec());
    }
    let mut unknown = MADE.recorded("");
    unknown.set(Channel::Spindle, vec![f64::NAN; unknown.len()]);
    for (recording, why) in [
        (swapped, NoComparison::SwappedChannels),
        (other_unit, NoComparison::WrongMagnitude),
        (uncut, NoComparison::WrongMagnitude),
        (speedless, NoComparison::NoSpeed),
        (unknown, NoComparison::NoRows),
    ] {
        let found = of(&recording);
        assert_eq!(found.cut_comparison.as_ref().err(), Some(&why));
        assert!(found.findings.is_empty(), "{why:?}: {:?}", found.findings);
        assert_eq!(found.verdict, Verdict::Undetermined, "{why:?}");
    }
}

#[test]
fn a_number_that_is_off_within_what_the_model_doubts_is_no_finding() {
    let recording = MADE.recorded(&effect("edge_force", "coefficient_N_per_mm = [4.0, 3.0, 1.0]"));
    let stated = effect("edge_force", "coefficient_N_per_mm = [3.6, 3.3, 0.8]");
    for (sigma, wanted) in [(0.4, Verdict::Consistent), (0.004, Verdict::MissingPhysics)] {
        let sigma = format!("sigma = {{ coefficient_N_per_mm = [{sigma}, {sigma}, {sigma}] }}");
        let model = RobotModel::parse("stated", &format!("{NO_ARM}\n{stated}{sigma}\n"));
        let model = model.expect("sound");
        let with_cutting = model.with_cutting().expect("few effects");
        let sigma: Vec<Vec<f64>> =
            model.sigma.iter().chain(&model.cutting_sigma).cloned().collect();
        let compared = diagnose(&with_cutting, &sigma, &recording).expect("sound").cut_comparison;
        let compared = compared.expect("compared");
        assert_eq!(compared.verdict, wanted, "{:?}", compared.findings);
        assert!(compared.findings.iter().all(|one| one.kind == "edge_force" && one.is_change));
        // A parameter that is not a finding is reported as refitted, with a smaller uncertainty
        // than stated.
        let refits = &compared.refits;
        assert_eq!(refits.len(), usize::from(wanted == Verdict::Consistent), "{refits:?}");
        for number in refits.iter().map(|refit| &refit.parameter) {
            for (k, change) in [400.0, -300.0, 200.0].iter().enumerate() {
                let (value, sigma) = (number.values[k], number.sigma[k]);
                assert!((value - change).abs() < 4.0 * sigma && sigma < 200.0, "{number:?}");
            }
        }
    }
}

/// Forces of the stated cut multiplied by `share`, a function of time in s; noise unchanged.
fn partly(share: &dyn Fn(f64) -> f64) -> Recording {
    let [mut cut, air] = [&[8e-3], &[0.0]]
        .map(|feeds: &'static [f64; 1]| Made { feeds_m_s: feeds, ..MADE }.recorded(""));
    for axis in 0..3 {
        let [whole, none] =
            [&cut, &air].map(|one| one.column(Channel::Wrench(axis)).expect("made").to_vec());
        let one = |(k, t_s): (usize, &f64)| none[k] + share(*t_s) * (whole[k] - none[k]);
        let mixed = cut.t_s.iter().enumerate().map(one).collect();
        cut.set(Channel::Wrench(axis), mixed);
    }
    cut
}

#[test]
fn air_that_is_fed_through_and_the_way_into_the_work_are_no_finding() {
    let compared = of(&partly(&|t_s| ((t_s - 0.3) / 0.2).clamp(0.0, 1.0))).cut_comparison;
    let compared = compared.expect("compared");
    assert!(compared.findings.is_empty(), "{:?}", compared.findings);
    assert_eq!(compared.verdict, Verdict::Consistent, "{:?}", compared.unexplained);
}

#[test]
fn chatter_much_quieter_than_the_noise_is_heard_beside_another_name() {
    let harder = effect("cutting_force", "coefficient_N_per_mm2 = [80.0, 40.0, 15.0]");
    let rings = effect("chatter", "frequency_Hz = 684.0\namplitude_N = 0.6");
    let found = MADE.compared(&format!("{harder}{rings}"));
    let mut names = kinds(&found);
    names.sort_unstable();
    assert_eq!(names, ["chatter", "cutting_force"]);
    let chatter = found.findings.iter().find(|one| one.kind == "chatter").expect("named");
    holds(chatter, &[("frequency", &[684.0]), ("amplitude", &[0.6])]);
}

#[test]
fn a_turned_sensor_that_leaks_in_one_channel_too_is_told_as_both_and_not_as_six_leaks() {
    let turned = effect("wrench_misalignment", "turn_mrad = [40, -30, 50]");
    let leaks = effect("cross_talk", "matrix = [0, 0.08, 0, 0, 0, 0, 0, 0, 0]");
    let found = MADE.compared(&format!("{turned}{leaks}"));
    let mut names = kinds(&found);
    names.sort_unstable();
    assert_eq!(names, ["cross_talk", "wrench_misalignment"]);
}

#[test]
fn a_sensor_turned_about_two_or_three_axes_is_no_pair_of_leaks() {
    for turn in ["[12, -10, 0]", "[8, -6, 5]"] {
        let turned = effect("wrench_misalignment", &format!("turn_mrad = {turn}"));
        assert_eq!(kinds(&MADE.compared(&turned)), ["wrench_misalignment"], "{turn}");
    }
}
