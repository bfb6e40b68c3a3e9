//! Gear trains: revolutions of the shafts of a joint's gearbox, and tooth meshes, per revolution of the joint.
//!
//! A train is the list of its stages, motor side first, each `[driver, driven]` in teeth. Shaft `k`, from 1, carries the driver of stage `k`; the
//! motor's is shaft 1. A stage reduces the speed by `driven / driver`, so shaft `k` makes `Π driven / driver` (over the stages from `k` on)
//! revolutions per revolution of the joint (thesis A III-1 without its offset and periodic term, table A III-1). Eccentricity errors repeat with
//! every revolution of their shaft, mesh errors with every tooth: `driver · turns`. Valid for fixed axes; coupling between wrist joints is not
//! included.

/// A shaft that drives a stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shaft {
    /// 1-based, motor side first.
    pub number: u8,
    /// Revolutions of the shaft per revolution of the joint.
    pub turns: f64,
    /// Number of teeth of its driver.
    pub teeth: u32,
}

impl Shaft {
    /// Tooth meshes of its stage per revolution of the joint.
    pub fn meshes(&self) -> f64 {
        f64::from(self.teeth) * self.turns
    }
}

/// Revolutions of the motor per revolution of the joint; 1 without stages. A driver without teeth
/// counts as one tooth.
pub fn ratio(stages: &[[u32; 2]]) -> f64 {
    stages.iter().map(|[driver, driven]| f64::from(*driven) / f64::from((*driver).max(1))).product()
}

/// The shafts that drive a stage, motor side first; at most 255.
pub fn shafts(stages: &[[u32; 2]]) -> impl Iterator<Item = Shaft> + '_ {
    (1..=u8::MAX).zip(stages).enumerate().map(|(before, (number, [driver, _]))| Shaft {
        number,
        turns: ratio(&stages[before..]),
        teeth: *driver,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Table A III-1, with the total ratios and the rows of table A III-2 for cut 1, +Y.
    type Row = (&'static [[u32; 2]], f64, &'static [f64]);
    const THESIS: [Row; 6] = [
        (&[[10, 131], [13, 129]], 129.99, &[5.95, 0.45]),
        (&[[10, 131], [13, 129]], 129.99, &[6.69, 0.51]),
        (&[[11, 134], [14, 120]], 104.42, &[8.02, 0.65]),
        (&[[11, 84], [14, 110]], 60.00, &[3.67, 0.48]),
        (&[[26, 78], [29, 39], [5, 79]], 63.74, &[1.76, 0.58, 0.43]),
        (&[[26, 52], [28, 22], [5, 70], [15, 30]], 44.00, &[1.77, 0.88, 1.13]),
    ];

    #[test]
    fn from_shaft_to_shaft_the_teeth_carry_as_in_the_thesis() {
        for (stages, whole, table) in THESIS {
            assert!((ratio(stages) - whole).abs() < 0.006, "{stages:?}");
            let found: Vec<Shaft> = shafts(stages).collect();
            assert_eq!(found.len(), stages.len());
            for (shaft, known) in found.iter().zip(table) {
                let carried = table[0] * shaft.turns / found[0].turns;
                // To 1 %, or one unit of the last printed digit: the table truncates.
                assert!((carried - known).abs() < (0.01 * known).max(0.01), "{shaft:?}: {known}");
            }
        }
    }

    #[test]
    fn two_wheels_in_mesh_pass_as_many_teeth() {
        for (stages, ..) in THESIS {
            let found: Vec<Shaft> = shafts(stages).collect();
            for (stage, pair) in stages.iter().zip(found.windows(2)) {
                let passed = f64::from(stage[1]) * pair[1].turns;
                assert!((pair[0].meshes() / passed - 1.0).abs() < 1e-12);
            }
        }
        assert!(shafts(&[]).next().is_none() && shafts(&[[0, 7]]).all(|s| s.turns.is_finite()));
    }

    /// Decision 0010: a joint that moves the wrist at the distance `r` turns by at most `1/r` per unit of path.
    #[test]
    fn the_thesis_table_holds_in_degrees_and_cannot_hold_in_revolutions() {
        let (stages, _, table) = THESIS[0];
        let joint_per_mm = table[0] / ratio(stages);
        let radius_mm = |rad_per_unit: f64| 1.0 / (joint_per_mm * rad_per_unit);
        let (degrees, revolutions) = (radius_mm(TAU / 360.0), radius_mm(TAU));
        assert!((degrees - 1252.0).abs() < 2.0, "{degrees}: inside the reach of 1450 mm");
        assert!((revolutions - 3.48).abs() < 0.01, "{revolutions}: inside the robot's column");
    }
}
