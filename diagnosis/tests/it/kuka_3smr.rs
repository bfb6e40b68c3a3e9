//! A heavy six-axis arm whose set names no make, three reflectors, one joint at a time: its axes stand to each other as those of a FANUC R-2000iB do.

use super::data;
use diagnosis::single_joint::Sag;
use diagnosis::{from_recording, sweeps};
use recording::model::presets::preset;
use recording::series::{self, Need};
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

#[test]
fn axes_of_an_arm_without_a_name_stand_to_each_other_as_those_of_the_fanuc_do() {
    let Some(path) = data("kuka-3smr/poses_36.csv") else { return };
    let mapping =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy/mappings/kuka-3smr.mapping.toml");
    let recording = series::read(&path, Some(&mapping), Need::Measurement).expect("sound");
    // Only the senses of its axes are asked for, and no sag is taken out.
    let model = preset("fanuc-r2000ib").expect("preset").model().expect("sound").physics;
    let campaign = from_recording::campaign(&model.arm, &[recording]).expect("usable");
    let found = sweeps::sweeps(&model.arm, &campaign, &campaign.surroundings);
    let joints: Vec<usize> = found.iter().map(|found| found.sweep.joint).collect();
    // What the controller calls joint 3 was moved against joint 2 while that swept: the mapping adds them.
    assert_eq!(joints, [0, 1, 2, 3, 4, 5]);
    let said = sweeps::said(&model, Sag::AsMeasured, found);
    for said in &said {
        let axis = said.axis.as_ref().expect("an axis");
        eprintln!("joint {}: left {:.1} um", axis.joint + 1, axis.axis.left_m * 1e6);
        // Reflectors are known to 0.03 mm there; a circle of six points may leave what the joint bends.
        assert!(axis.axis.left_m < 3e-4, "joint {}: {} m left", axis.joint + 1, axis.axis.left_m);
    }
    let relative = sweeps::relative(&said);
    let published_m = [0.312, 1.075, 0.225, 0.0, 0.0];
    assert_eq!(relative.len(), published_m.len());
    for (relative, published) in relative.iter().zip(published_m) {
        eprintln!("{relative:?}");
        let nearest = [0.0, FRAC_PI_2, PI].map(|angle| (relative.angle_rad - angle).abs());
        let off = nearest.into_iter().fold(f64::INFINITY, f64::min);
        assert!(off < 5e-3, "{relative:?}");
        assert!((relative.distance_m - published).abs() < 2e-3, "{relative:?}, {published}");
    }
}
