//! A heavy six-axis arm of unstated make with three reflectors, one joint moved at a time: relative positions of its axes equal those of a FANUC
//! R-2000iB.

use super::data;
use diagnosis::single_joint::SagCorrection;
use diagnosis::{campaign_import, sweeps};
use recording::model::presets::preset;
use recording::series::{self, RequiredData};
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

#[test]
fn axes_of_an_arm_without_a_name_stand_to_each_other_as_those_of_the_fanuc_do() {
    let Some(path) = data("kuka-3smr/poses_36.csv") else { return };
    let mapping =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy/mappings/kuka-3smr.mapping.toml");
    let recording = series::read(&path, Some(&mapping), RequiredData::Measurement).expect("sound");
    // Only the signs of the axes are taken from the model; sag is not corrected.
    let model = preset("fanuc-r2000ib").expect("preset").model().expect("sound").physics;
    let campaign = campaign_import::campaign(&model.arm, &[recording]).expect("usable");
    let found = sweeps::sweeps(&model.arm, &campaign, &campaign.surroundings);
    let joints: Vec<usize> = found.iter().map(|found| found.sweep.joint).collect();
    // While joint 2 swept, the controller's joint 3 moved in the opposite sense; the mapping adds the two.
    assert_eq!(joints, [0, 1, 2, 3, 4, 5]);
    let results = sweeps::analyse_sweeps(&model, SagCorrection::AsMeasured, found);
    for result in &results {
        let axis = result.axis.as_ref().expect("an axis");
        eprintln!("joint {}: left {:.1} um", axis.joint + 1, axis.axis.residual_rms_m * 1e6);
        // The reflectors are known to 0.03 mm; the residual of a circle through six points includes the deflection of the joint.
        assert!(
            axis.axis.residual_rms_m < 3e-4,
            "joint {}: {} m left",
            axis.joint + 1,
            axis.axis.residual_rms_m
        );
    }
    let relative = sweeps::relative_axes(&results);
    let published_m = [0.312, 1.075, 0.225, 0.0, 0.0];
    assert_eq!(relative.len(), published_m.len());
    for (relative, published) in relative.iter().zip(published_m) {
        eprintln!("{relative:?}");
        let nearest = [0.0, FRAC_PI_2, PI].map(|angle| (relative.angle_rad - angle).abs());
        let distance = nearest.into_iter().fold(f64::INFINITY, f64::min);
        assert!(distance < 5e-3, "{relative:?}");
        assert!((relative.distance_m - published).abs() < 2e-3, "{relative:?}, {published}");
    }
}
