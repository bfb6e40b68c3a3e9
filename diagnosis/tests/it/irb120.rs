//! ABB IRB 120 with three reflectors and a laser tracker: 1000 poses, calibrated on the first half in time, tested on the second.

use super::data;
use diagnosis::hold_out::{HoldOutSplit, PositionErrors, calibrate};
use diagnosis::progress::ignore;
use diagnosis::{
    Campaign, FitSettings, Influence, campaign_import, fit, geometry, gross_errors, joint_readback,
};
use physics::Model;
use recording::model::presets::preset;
use recording::series::{self, InputKind, Recording, RequiredData};
use std::path::Path;

fn recorded() -> Option<(Recording, Model)> {
    let path = data("irb120-tracker/poses_1000.csv")?;
    let mapping = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../deploy/mappings/irb120-tracker.mapping.toml");
    let recording =
        series::read(&path, Some(&mapping), RequiredData::Measurement).expect("a sound recording");
    Some((recording, preset("irb120").expect("preset").model().expect("sound").physics))
}

fn campaign(recording: &Recording, model: &Model) -> Campaign {
    campaign_import::campaign(&model.arm, std::slice::from_ref(recording)).expect("usable")
}

#[test]
fn named_effects_carry_from_the_first_half_in_time_to_the_second() {
    let Some((recording, model)) = recorded() else { return };
    let campaign = campaign(&recording, &model);
    let split = HoldOutSplit::in_time(&campaign, 0.5);
    // Every second pose only, to save time; docs/figures.md has the figures for all.
    let training: Vec<bool> =
        split.training.iter().enumerate().map(|(pose, trains)| *trains && pose % 2 == 0).collect();
    let found = calibrate(&campaign, &model, &[], &training, &ignore);
    let errors = |fit| PositionErrors::of(fit, &campaign, &split.held_out());
    let (plain, named) = (errors(&found.calibrated), errors(&found.advanced.fit));
    assert!(plain.mean() < 0.25e-3, "geometry leaves {} mm", plain.mean() * 1e3);
    assert!(named.mean() < 0.065e-3, "the effects leave {} mm", named.mean() * 1e3);
    assert!(named.quantile(0.95) < 0.12e-3, "95 % below {} mm", named.quantile(0.95) * 1e3);
    let kinds: Vec<&str> =
        found.advanced.fit.hypothesis.model.effects().map(|effect| effect.spec().kind).collect();
    // Deflection under gravity can be represented as a sag or as a compliance.
    let wanted: [&[&str]; 4] = [
        &["gravity_sag", "joint_compliance"],
        &["thermal_growth"],
        &["backlash"],
        &["transmission_error"],
    ];
    for any in wanted {
        assert!(any.iter().any(|kind| kinds.contains(kind)), "none of {any:?} among {kinds:?}");
    }
}

#[test]
fn the_read_back_joints_are_noticed_as_bad_beside_the_commanded_and_alone() {
    let Some((mut recording, model)) = recorded() else { return };
    assert_eq!(gross_errors::detect_global_errors(&campaign(&recording, &model), &model), []);
    let message =
        joint_readback::detect_readback_mismatch(&recording, &model).expect("noticed").message;
    assert!(
        message.contains("before the arm had settled") && message.contains("use these"),
        "{message}"
    );
    recording.metadata.input = Some(InputKind::Motor);
    let alone = campaign(&recording, &model);
    let used = vec![true; alone.poses.len()];
    let settings = FitSettings::full(&used, Influence::Huber);
    let found = fit(&alone, &geometry(&model, &[]), &settings);
    let message =
        joint_readback::detect_early_readback(&alone, &found, &settings).expect("noticed").message;
    assert!(message.contains("joint 1") && message.contains("commanded"), "{message}");
    recording.metadata.input = Some(InputKind::Command);
    let commanded = campaign(&recording, &model);
    let found = fit(&commanded, &geometry(&model, &[]), &settings);
    assert_eq!(joint_readback::detect_early_readback(&commanded, &found, &settings), None);
}
