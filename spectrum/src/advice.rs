//! What to do about a line, from its class and the process.
//!
//! Pure arithmetic on speeds and modes. Regenerative chatter has pockets of stability where the tooth
//! passing is the mode's frequency over a whole number; far above the mode, and for mode coupling, the
//! speed does not matter. Source: thesis 4.6 for mode coupling; Altintas, Manufacturing Automation,
//! chapter 3, for the lobes. A pocket is a first guess from one frequency, not a computed lobe.

use crate::config::Mode;
use crate::verdict::{Advice, Class};

/// Tooth passing beyond this many times the mode has no pockets worth the name.
const FAR_ABOVE: f64 = 3.0;
/// A tooth harmonic is off a mode when it is this part of the mode's frequency away.
const OFF_MODE: f64 = 0.1;
/// Pockets finer than this are too narrow to hold.
const LOBES: u32 = 10;

/// What the advice rests on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Case<'a> {
    pub(crate) class: Class,
    pub(crate) frequency_hz: f64,
    pub(crate) suspect_alias: bool,
    pub(crate) near_mode_hz: Option<f64>,
    pub(crate) modes: &'a [Mode],
    pub(crate) spindle_rpm: f64,
    pub(crate) teeth: u32,
    pub(crate) wheel: Option<(u8, u8)>,
}

/// The advice for a case.
pub(crate) fn advise(case: &Case<'_>) -> Advice {
    match case.class {
        _ if case.suspect_alias => Advice::SampleFaster,
        Class::Forced if case.near_mode_hz.is_some() => move_off_mode(case),
        Class::Chatter => pocket(case),
        Class::ModeCoupling => Advice::ChangeCut,
        Class::Gear => {
            let (joint, shaft) = case.wheel.unwrap_or((0, 0));
            Advice::CheckGear { joint, shaft }
        }
        Class::Electrical => Advice::CheckWiring,
        Class::Forced | Class::Structural | Class::Unknown => Advice::None,
    }
}

fn pocket(case: &Case<'_>) -> Advice {
    let tooth_hz = case.spindle_rpm / 60.0 * f64::from(case.teeth);
    if tooth_hz <= 0.0 {
        return Advice::ReduceDepth;
    }
    let mode_hz = case.near_mode_hz.unwrap_or(case.frequency_hz);
    if tooth_hz > FAR_ABOVE * mode_hz {
        return Advice::ChangeCut;
    }
    let lobe = ((mode_hz / tooth_hz).round() as u32).clamp(1, LOBES);
    let spindle_rpm = 60.0 * mode_hz / (f64::from(lobe) * f64::from(case.teeth));
    if (spindle_rpm / case.spindle_rpm - 1.0).abs() < 0.02 {
        // Already in the pocket, as far as one frequency tells: depth is what remains.
        return Advice::ReduceDepth;
    }
    Advice::StabilityPocket { spindle_rpm, lobe }
}

/// The nearest speed, within 40 %, at which no strong multiple stands on a mode.
fn move_off_mode(case: &Case<'_>) -> Advice {
    let percent = (1..=40).flat_map(|p| [-p, p]).map(|p: i32| 1.0 + 0.01 * f64::from(p));
    percent
        .map(|part| part * case.spindle_rpm)
        .find(|rpm| is_off_modes(case, *rpm))
        .map_or(Advice::ChangeCut, |spindle_rpm| Advice::MoveOffMode { spindle_rpm })
}

fn is_off_modes(case: &Case<'_>, rpm: f64) -> bool {
    // Runout, and the first multiples of the teeth; the multiple that was seen counts in any case.
    let seen = (case.frequency_hz * 60.0 / case.spindle_rpm).round().max(1.0);
    let teeth = f64::from(case.teeth.max(1));
    let orders = [1.0, teeth, 2.0 * teeth, 3.0 * teeth, seen];
    orders.iter().all(|order| {
        let line_hz = order * rpm / 60.0;
        case.modes.iter().all(|m| (line_hz - m.frequency_hz).abs() > OFF_MODE * m.frequency_hz)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn case(class: Class, frequency_hz: f64, rpm: f64, modes: &[Mode]) -> Case<'_> {
        Case {
            class,
            frequency_hz,
            suspect_alias: false,
            near_mode_hz: modes.first().map(|m| m.frequency_hz),
            modes,
            spindle_rpm: rpm,
            teeth: 2,
            wheel: None,
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
    fn the_advised_speed_leaves_no_tooth_harmonic_on_a_mode() {
        let modes = [67.0, 70.0, 72.0].map(Mode::at_hz);
        let Advice::MoveOffMode { spindle_rpm } =
            advise(&case(Class::Forced, 70.0, 2100.0, &modes))
        else {
            panic!("a speed is expected")
        };
        let tooth_hz = spindle_rpm / 30.0;
        assert!((tooth_hz - 67.0).abs() > 6.7 && (tooth_hz - 72.0).abs() > 7.2, "{tooth_hz}");
    }

    #[test]
    fn a_suspect_alias_asks_for_a_faster_sensor() {
        let modes = [Mode::at_hz(67.0)];
        let alias = Case { suspect_alias: true, ..case(Class::Forced, 66.7, 28_000.0, &modes) };
        assert_eq!(advise(&alias), Advice::SampleFaster);
    }
}
