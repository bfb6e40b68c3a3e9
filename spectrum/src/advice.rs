//! Recommended action for a spectral line, from its class and the state of the process.
//!
//! Arithmetic on speeds and modes only: a single frequency gives an estimate, not a computed stability lobe.
//!
//! - Forced vibration: at the recommended speed neither the runout nor any multiple of the tooth passing coincides with a mode.
//! - Regenerative chatter: the stable depth is largest where the tooth passing frequency is the mode's frequency divided by an integer. With
//!   the tooth passing far above the mode the waves cut by consecutive teeth are almost in phase (28° and a quarter of the largest regenerative
//!   effect for a mode of 72 Hz at 933 Hz); far below it the pockets are narrower than the speed tolerance of a spindle.
//! - Mode coupling: independent of the speed (thesis 4.6).
//!
//! Source: Altintas, Manufacturing Automation, chapter 3, for the lobes.

use crate::config::Mode;
use crate::verdict::{Advice, Class};

/// Tooth passing frequencies beyond this multiple of the mode have no useful stability lobes.
const FAR_ABOVE: f64 = 3.0;
/// Least distance of a tooth harmonic from a mode, relative to the mode's frequency.
const MODE_CLEARANCE: f64 = 0.1;
/// Highest usable lobe number: lobes of a higher number are narrower than the speed tolerance of a
/// spindle.
const LOBE_MAX: u32 = 10;
/// Speeds with a smaller relative difference are equal.
const SPEED_TOLERANCE: f64 = 0.02;
/// Largest recommended change of the speed, percent.
const SPEED_RANGE_PERCENT: i32 = 40;

/// Inputs of the recommendation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AdviceInput<'a> {
    pub(crate) class: Class,
    pub(crate) frequency_hz: f64,
    pub(crate) suspect_alias: bool,
    pub(crate) near_mode_hz: Option<f64>,
    pub(crate) modes: &'a [Mode],
    pub(crate) spindle_rpm: f64,
    pub(crate) teeth: u32,
    pub(crate) gear: Option<(u8, u8)>,
}

impl AdviceInput<'_> {
    /// Tooth passing frequency, Hz; 0 if speed or teeth are unknown.
    fn tooth_hz(&self) -> f64 {
        self.spindle_rpm / 60.0 * f64::from(self.teeth)
    }
}

/// The recommended action against regenerative chatter at this frequency, where nothing else is known of the structure. `spindle_rpm`, `teeth`: 0 if
/// unknown. The same that the monitor gives for a line that it classifies as chatter.
#[must_use]
pub fn against_chatter(frequency_hz: f64, spindle_rpm: f64, teeth: u32) -> Advice {
    advise(&AdviceInput {
        class: Class::Chatter,
        frequency_hz,
        suspect_alias: false,
        near_mode_hz: None,
        modes: &[],
        spindle_rpm,
        teeth,
        gear: None,
    })
}

/// The recommended action.
pub(crate) fn advise(case: &AdviceInput<'_>) -> Advice {
    match case.class {
        _ if case.suspect_alias => Advice::SampleFaster,
        Class::Forced if case.near_mode_hz.is_some() => move_off_mode(case),
        Class::Chatter => stability_pocket(case),
        Class::ModeCoupling => Advice::ChangeCut,
        Class::Gear => {
            let (joint, shaft) = case.gear.unwrap_or((0, 0));
            Advice::CheckGear { joint, shaft }
        }
        Class::Electrical => Advice::CheckWiring,
        Class::Forced | Class::Structural | Class::Unknown => Advice::None,
    }
}

/// The nearest stability pocket; a smaller depth where there is none.
fn stability_pocket(case: &AdviceInput<'_>) -> Advice {
    let tooth_hz = case.tooth_hz();
    if tooth_hz <= 0.0 {
        return Advice::ReduceDepth;
    }
    let mode_hz = case.near_mode_hz.unwrap_or(case.frequency_hz);
    if tooth_hz > FAR_ABOVE * mode_hz {
        return Advice::ChangeCut;
    }
    let lobe = (mode_hz / tooth_hz).round().max(1.0);
    let spindle_rpm = 60.0 * mode_hz / (lobe * f64::from(case.teeth));
    let is_there = (spindle_rpm / case.spindle_rpm - 1.0).abs() < SPEED_TOLERANCE;
    if lobe > f64::from(LOBE_MAX) || is_there {
        // The speed is already in the pocket, as far as one frequency shows, or there is no pocket:
        // only a smaller depth helps.
        return Advice::ReduceDepth;
    }
    Advice::StabilityPocket { spindle_rpm, lobe: lobe as u32 }
}

/// The nearest speed at which no spindle harmonic coincides with a mode.
fn move_off_mode(case: &AdviceInput<'_>) -> Advice {
    if case.spindle_rpm <= 0.0 {
        return Advice::None;
    }
    let percent = (1..=SPEED_RANGE_PERCENT).flat_map(|p| [-p, p]);
    percent
        .map(|p| (1.0 + 0.01 * f64::from(p)) * case.spindle_rpm)
        .find(|rpm| case.modes.iter().all(|mode| is_clear_of_mode(case, *rpm, mode.frequency_hz)))
        .map_or(Advice::ChangeCut, |spindle_rpm| Advice::MoveOffMode { spindle_rpm })
}

/// Whether at this speed neither the runout, nor any multiple of the tooth passing, nor the
/// observed multiple coincides with the mode.
fn is_clear_of_mode(case: &AdviceInput<'_>, rpm: f64, mode_hz: f64) -> bool {
    let turn_hz = rpm / 60.0;
    let tooth_hz = turn_hz * f64::from(case.teeth.max(1));
    let order = (case.frequency_hz * 60.0 / case.spindle_rpm).round().max(1.0);
    let nearest = (mode_hz / tooth_hz).round().max(1.0);
    [turn_hz, order * turn_hz, nearest * tooth_hz]
        .iter()
        .all(|line_hz| (line_hz - mode_hz).abs() > MODE_CLEARANCE * mode_hz)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn case(class: Class, frequency_hz: f64, rpm: f64, modes: &[Mode]) -> AdviceInput<'_> {
        AdviceInput {
            class,
            frequency_hz,
            suspect_alias: false,
            near_mode_hz: modes.first().map(|m| m.frequency_hz),
            modes,
            spindle_rpm: rpm,
            teeth: 2,
            gear: None,
        }
    }

    #[test]
    fn far_above_the_mode_the_speed_does_not_help() {
        let modes = [Mode::at_hz(70.0)];
        assert_eq!(advise(&case(Class::Chatter, 72.0, 28_000.0, &modes)), Advice::ChangeCut);
        assert_eq!(advise(&case(Class::ModeCoupling, 72.0, 2000.0, &modes)), Advice::ChangeCut);
    }

    #[test]
    fn a_pocket_has_its_tooth_passing_at_the_mode_over_a_whole_number() {
        let modes = [Mode::at_hz(700.0)];
        let Advice::StabilityPocket { spindle_rpm, lobe } =
            advise(&case(Class::Chatter, 715.0, 9500.0, &modes))
        else {
            panic!("a pocket is expected")
        };
        assert_eq!(lobe, 2);
        assert!((spindle_rpm / 60.0 * 2.0 * f64::from(lobe) - 700.0).abs() < 1e-9);
    }

    #[test]
    fn in_the_pocket_or_below_all_pockets_depth_is_what_remains() {
        let modes = [Mode::at_hz(700.0)];
        for rpm in [10_500.0, 10_600.0, 1000.0] {
            assert_eq!(advise(&case(Class::Chatter, 715.0, rpm, &modes)), Advice::ReduceDepth);
        }
    }

    #[test]
    fn what_the_speed_cannot_clear_asks_for_another_cut() {
        // Teeth every 3 Hz, and a mode that must be 7 Hz away from each of them.
        let modes = [Mode::at_hz(70.0)];
        assert_eq!(advise(&case(Class::Forced, 70.0, 90.0, &modes)), Advice::ChangeCut);
        assert_eq!(advise(&case(Class::Forced, 70.0, 0.0, &modes)), Advice::None);
    }

    proptest! {
        /// Checked one by one for every line that the spindle can excite up to beyond the highest
        /// mode.
        #[test]
        fn the_advised_speed_leaves_no_tooth_harmonic_on_any_mode(
            modes in prop::collection::vec(15.0..800.0_f64, 1..6),
            index in 0_usize..6,
            order in 1_u32..4,
            teeth in 1_u32..5,
        ) {
            let modes: Vec<Mode> = modes.into_iter().map(Mode::at_hz).collect();
            let mode_hz = modes[index % modes.len()].frequency_hz;
            let rpm = 60.0 * mode_hz / f64::from(order * teeth);
            let near_mode_hz = Some(mode_hz);
            let forced = AdviceInput { teeth, near_mode_hz, ..case(Class::Forced, mode_hz, rpm, &modes) };
            match advise(&forced) {
                Advice::MoveOffMode { spindle_rpm } => {
                    prop_assert!((spindle_rpm / rpm - 1.0).abs() < 0.405);
                    for k in (1..2000).map(f64::from) {
                        let tooth_hz = k * f64::from(teeth) * spindle_rpm / 60.0;
                        for mode in &modes {
                            let away = (tooth_hz / mode.frequency_hz - 1.0).abs();
                            prop_assert!(away > 0.1 - 1e-9, "{k} x {tooth_hz} on {}", mode.frequency_hz);
                        }
                    }
                }
                advice => prop_assert_eq!(advice, Advice::ChangeCut),
            }
        }

        /// In a pocket both teeth meet the wave in the same phase: the tooth passing divides the mode's frequency.
        #[test]
        fn a_pocket_is_the_nearest_speed_at_which_waves_of_two_teeth_are_in_phase(
            mode_hz in 20.0..3000.0_f64,
            rpm in 500.0..40_000.0_f64,
            teeth in 1_u32..8,
        ) {
            let modes = [Mode::at_hz(mode_hz)];
            let chatter = AdviceInput { teeth, ..case(Class::Chatter, 1.02 * mode_hz, rpm, &modes) };
            let waves = |rpm: f64| mode_hz / (rpm / 60.0 * f64::from(teeth));
            match advise(&chatter) {
                Advice::StabilityPocket { spindle_rpm, lobe } => {
                    prop_assert!((waves(spindle_rpm) - f64::from(lobe)).abs() < 1e-9);
                    prop_assert!((waves(rpm) - f64::from(lobe)).abs() <= 0.5 || lobe == 1);
                    prop_assert!((1..=LOBE_MAX).contains(&lobe));
                }
                Advice::ChangeCut => prop_assert!(waves(rpm) < 1.0 / FAR_ABOVE),
                advice => {
                    prop_assert_eq!(advice, Advice::ReduceDepth);
                    let is_near_pocket = (waves(rpm) / waves(rpm).round().max(1.0) - 1.0).abs() < 0.021;
                    prop_assert!(is_near_pocket || waves(rpm) > f64::from(LOBE_MAX) + 0.49);
                }
            }
        }
    }

    #[test]
    fn a_suspect_alias_asks_for_a_faster_sensor() {
        let modes = [Mode::at_hz(67.0)];
        let alias =
            AdviceInput { suspect_alias: true, ..case(Class::Forced, 66.7, 28_000.0, &modes) };
        assert_eq!(advise(&alias), Advice::SampleFaster);
    }
}
