//! Rotation of the gear trains of a model along a path.

use physics::JointKind;
use physics::gears::shafts;

use super::ModelFile;

impl ModelFile {
    /// Rotation of the gear trains along a path: for each joint the turns of every shaft that drives a
    /// stage, motor side first, then the tooth meshes of each stage. `turns_per_mm`: revolutions of each
    /// joint per mm of path; joints at rest and prismatic joints are left out.
    ///
    /// `wheel` makes the item: of joint and shaft, from 1, of the cycles per revolution of the shaft (1 for its
    /// rotation, otherwise the teeth of its driver), and of the cycles (revolutions, or teeth) per mm of path.
    pub fn gear_cycles<W: 'static>(
        &self,
        turns_per_mm: &[f64],
        wheel: fn(u8, u8, u32, f64) -> W,
    ) -> impl Iterator<Item = W> {
        let joints = (1..=u8::MAX).zip(&self.joints).zip(turns_per_mm);
        let turning =
            joints.filter(|((_, entry), turns)| entry.kind == JointKind::Revolute && **turns > 0.0);
        turning.flat_map(move |((joint, entry), turns)| {
            let cycles =
                move |shaft, teeth, per_turn: f64| wheel(joint, shaft, teeth, turns * per_turn);
            let turned = shafts(&entry.gear_teeth).map(move |s| cycles(s.number, 1, s.turns));
            let meshed =
                shafts(&entry.gear_teeth).map(move |s| cycles(s.number, s.teeth, s.meshes()));
            turned.chain(meshed)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::presets::preset;
    use physics::JOINTS_MAX;

    #[test]
    fn the_motor_of_a_joint_that_turns_has_its_ratio_and_the_others_are_at_rest() {
        let model = preset("irb1600-6-145-thesis").unwrap().model().unwrap();
        // Thesis, table A III-1: the total gear ratios of the joints.
        for (i, ratio) in [129.99, 129.99, 104.42, 60.0, 63.74, 44.0].into_iter().enumerate() {
            let mut turns_per_mm = [0.0; JOINTS_MAX];
            turns_per_mm[i] = 1e-3;
            let of = |joint, _, teeth, per_mm| (joint, teeth, per_mm);
            let cycles: Vec<(u8, u32, f64)> = model.file.gear_cycles(&turns_per_mm, of).collect();
            let stages = &model.file.joints[i].gear_teeth;
            assert_eq!(cycles.len(), 2 * stages.len());
            assert!(cycles[stages.len()..].iter().zip(stages).all(|(c, s)| c.1 == s[0]));
            let meshed = f64::from(stages[0][0]) * cycles[0].2;
            assert!((cycles[stages.len()].2 - meshed).abs() < 1e-12);
            assert!(cycles.iter().all(|cycles| usize::from(cycles.0) == i + 1));
            assert!((1e3 * cycles[0].2 - ratio).abs() < 0.01, "{:?}", cycles[0]);
        }
    }
}
