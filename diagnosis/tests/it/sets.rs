//! Other laser-tracker data sets: a two-arm Motoman, a FANUC of unstated type, a construction robot on a mast.

use super::data;
use diagnosis::hold_out::{Calibration, HoldOutSplit, PositionErrors, calibrate};
use diagnosis::progress::ignore;
use diagnosis::{Campaign, Fit, FitSettings, Hypothesis, Influence};
use diagnosis::{campaign_import, fit, gross_errors};
use physics::Model;
use recording::model::presets::preset;
use recording::series::{self, Recording, RequiredData};
use recording::urdf::{self, ChainEnds};
use std::path::Path;

fn recorded(file: &str, mapping: &str, model: &Model) -> Option<(Campaign, Recording)> {
    let path = data(file)?;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy/mappings");
    let mapping = folder.join(format!("{mapping}.mapping.toml"));
    let recording = series::read(&path, Some(&mapping), RequiredData::Measurement).expect("sound");
    let one = std::slice::from_ref(&recording);
    Some((campaign_import::campaign(&model.arm, one).expect("usable"), recording))
}

fn known(name: &str) -> Model {
    preset(name).expect("preset").model().expect("sound").physics
}

fn calibrated(campaign: &Campaign, model: &Model, training: &[bool]) -> Calibration {
    assert_eq!(gross_errors::detect_global_errors(campaign, model), []);
    calibrate(campaign, model, &[], training, &ignore)
}

/// Mean errors of the nominal and of the calibrated model with effects, mm.
fn means(found: &Calibration, campaign: &Campaign, wanted: &[bool]) -> [f64; 2] {
    [&found.nominal, &found.advanced.fit]
        .map(|fit| PositionErrors::of(fit, campaign, wanted).mean() * 1e3)
}

#[test]
fn both_motoman_arms_gain_in_free_motion_and_in_contact() {
    let file = "motoman-leica/leica_poses_all.csv";
    // Largest admissible mean error per station, mm, in the order in which the rows name the stations.
    let bars = [("right", &[0.45, 0.11, 0.22, 0.26][..]), ("left", &[0.14][..])];
    for (arm, bars) in bars {
        let model = known(&format!("motoman-{arm}"));
        let mapping = format!("motoman-leica-{arm}");
        let Some((campaign, _)) = recorded(file, &mapping, &model) else { return };
        assert_eq!(campaign.surroundings.frames.len(), bars.len());
        let split = HoldOutSplit::random(&campaign, 0.5, 1);
        let found = calibrated(&campaign, &model, &split.training);
        for (station, bar) in bars.iter().enumerate() {
            let poses = campaign.poses.iter().zip(&split.training);
            let held: Vec<bool> = poses.map(|(p, t)| !t && p.frame() == Some(station)).collect();
            let [nominal, best] = means(&found, &campaign, &held);
            assert!(best < *bar && best < 0.7 * nominal, "{arm} {station}: {nominal} to {best} mm");
        }
    }
}

#[test]
fn the_few_poses_of_single_joints_calibrate_each_other() {
    let model = known("fanuc-r2000ib");
    let Some((campaign, _)) = recorded("kuka-3smr/poses_36.csv", "kuka-3smr", &model) else {
        return;
    };
    let (mut before, mut after) = (0.0, 0.0);
    for (pose, split) in HoldOutSplit::leave_one_out(&campaign).iter().enumerate().step_by(3) {
        let found = calibrated(&campaign, &model, &split.training);
        let only: Vec<bool> = (0..campaign.poses.len()).map(|other| other == pose).collect();
        let [nominal, best] = means(&found, &campaign, &only);
        before += nominal / 12.0;
        after += best / 12.0;
    }
    assert!(after < 0.4 && after < 0.5 * before, "{before} to {after} mm");
}

#[test]
fn a_mast_calibrated_on_level_ground_is_three_times_as_good_where_it_stands_tilted() {
    let Some(path) = data("hilti/trailblazer.urdf") else { return };
    let ends = ChainEnds { base: Some("base_link"), tip: Some("prism") };
    let model = urdf::read(&path, &ends).expect("an arm").model.physics;
    let Some((campaign, recording)) = recorded("hilti/all_measurements.csv", "hilti", &model)
    else {
        return;
    };
    let flat: Vec<bool> = campaign.poses.iter().map(|pose| pose.frame() == Some(1)).collect();
    let found = calibrated(&campaign, &model, &flat);
    // In the other scenes only the frame is fitted, to the stationing points.
    let stationing: Vec<bool> = recording.segment.iter().map(|segment| segment % 2 == 0).collect();
    let scored: Vec<bool> = flat.iter().zip(&stationing).map(|(f, s)| !f && !s).collect();
    let mean = |model: &Model| {
        let settings = FitSettings::full(&stationing, Influence::Huber);
        let placed: Fit = fit(&campaign, &Hypothesis::fixed(*model), &settings);
        PositionErrors::of(&placed, &campaign, &scored).mean() * 1e3
    };
    let (before, after) = (mean(&model), mean(&found.advanced.fit.hypothesis.model));
    assert!(after < 2.9 && 3.0 * after < before, "{before} to {after} mm");
}
