//! Conversion of the vibration monitor's verdicts and faults to messages.
//!
//! Codes have the same names on both sides (tested). No allocation.

use shm_schema::{Advice, SensorFault, Verdict, VibrationClass, VibrationState, monotonic_ns};
use spectrum::{Fault, Faults, Health, NearestLine};

/// A verdict as a message: the `seq`-th of this daemon, with the present state of sensor and
/// stream.
#[must_use]
pub fn verdict(verdict: &spectrum::Verdict, health: &Health, seq: u64) -> Verdict {
    let distances_to = |line: Option<NearestLine>| {
        line.map_or((f64::NAN, f64::NAN), |line| (line.frequency_hz, line.distance_hz))
    };
    let (nearest_mode_hz, mode_distance_hz) = distances_to(verdict.mode);
    let (nearest_harmonic_hz, harmonic_distance_hz) = distances_to(verdict.harmonic);
    let (nearest_alias_hz, alias_distance_hz) = distances_to(verdict.alias);
    let rivals = verdict.alternatives.iter().fold(0, |bits, rival| bits | 1 << class(rival).code());
    let channel = verdict.axis.channel();
    let advice = AdviceFields::new(&verdict.advice);
    Verdict {
        seq,
        t_ns: verdict.t_ns,
        made_ns: monotonic_ns(),
        event: u64::from(verdict.line),
        frequency_hz: verdict.frequency_hz,
        amplitude: verdict.amplitude_n,
        advice_rpm: advice.rpm,
        growth_per_s: verdict.growth_per_s,
        nearest_mode_hz,
        mode_distance_hz,
        nearest_harmonic_hz,
        harmonic_distance_hz,
        nearest_alias_hz,
        alias_distance_hz,
        state: state(verdict.state).code(),
        class: class(verdict.class).code(),
        rivals,
        axis: channel as u32,
        suspect_alias: u32::from(verdict.suspect_alias),
        advice: advice.code.code(),
        sensor_faults: faults(health.stream) | faults(health.channel[channel]),
        advice_lobe: advice.lobe,
        gear_joint: advice.gear.0,
        gear_shaft: advice.gear.1,
        ..Verdict::default()
    }
}

/// Faults as a bit set of a message.
#[must_use]
pub fn faults(faults: Faults) -> u32 {
    faults.iter().fold(0, |set, named| set | fault(named).bit())
}

fn fault(fault: Fault) -> SensorFault {
    match fault {
        Fault::NotFinite => SensorFault::NotFinite,
        Fault::Stuck => SensorFault::Stuck,
        Fault::Saturated => SensorFault::Saturated,
        Fault::Dead => SensorFault::Dead,
        Fault::Gap => SensorFault::Gaps,
        Fault::WrongRate => SensorFault::WrongRate,
        Fault::WrongShape => SensorFault::WrongShape,
        Fault::OutOfOrder => SensorFault::OutOfOrder,
    }
}

fn state(state: spectrum::State) -> VibrationState {
    match state {
        spectrum::State::Warn => VibrationState::Warn,
        spectrum::State::Alarm => VibrationState::Alarm,
        spectrum::State::Confirmed => VibrationState::Confirmed,
        spectrum::State::Over => VibrationState::Over,
    }
}

fn class(class: spectrum::Class) -> VibrationClass {
    match class {
        spectrum::Class::Forced => VibrationClass::Forced,
        spectrum::Class::Chatter => VibrationClass::Chatter,
        spectrum::Class::ModeCoupling => VibrationClass::ModeCoupling,
        spectrum::Class::Gear => VibrationClass::Gear,
        spectrum::Class::Structural => VibrationClass::Structural,
        spectrum::Class::Electrical => VibrationClass::Electrical,
        spectrum::Class::Unknown => VibrationClass::Unknown,
    }
}

/// An advice with its values.
struct AdviceFields {
    code: Advice,
    rpm: f64,
    lobe: u32,
    gear: (u32, u32),
}

impl AdviceFields {
    fn new(advice: &spectrum::Advice) -> Self {
        use spectrum::Advice as From;
        let plain = |code| Self { code, rpm: f64::NAN, lobe: 0, gear: (0, 0) };
        match *advice {
            From::None => plain(Advice::None),
            From::MoveOffMode { spindle_rpm } => {
                Self { rpm: spindle_rpm, ..plain(Advice::MoveOffMode) }
            }
            From::StabilityPocket { spindle_rpm, lobe } => {
                Self { rpm: spindle_rpm, lobe, ..plain(Advice::StabilityPocket) }
            }
            From::ChangeCut => plain(Advice::ChangeCut),
            From::ReduceDepth => plain(Advice::ReduceDepth),
            From::SampleFaster => plain(Advice::SampleFaster),
            From::CheckGear { joint, shaft } => {
                Self { gear: (u32::from(joint), u32::from(shaft)), ..plain(Advice::CheckGear) }
            }
            From::CheckWiring => plain(Advice::CheckWiring),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_and_classes_have_the_same_names_on_both_sides() {
        use spectrum::State;
        for known in [State::Warn, State::Alarm, State::Confirmed, State::Over] {
            assert_eq!(known.name(), state(known).name());
        }
        for known in spectrum::Class::ALL {
            assert_eq!(known.name(), class(known).name());
        }
        // The schema uses the plural, for compatibility.
        let spoken = |fault: Fault| if fault == Fault::Gap { "gaps" } else { fault.name() };
        for known in Fault::ALL {
            assert_eq!(spoken(known), fault(known).name());
        }
    }

    #[test]
    fn the_values_of_an_advice_are_in_the_message() {
        let with_advice = |advice| {
            let source = spectrum::Verdict { advice, ..spectrum::Verdict::default() };
            verdict(&source, &Health::default(), 1)
        };
        let pocket =
            with_advice(spectrum::Advice::StabilityPocket { spindle_rpm: 9000.0, lobe: 3 });
        assert_eq!((pocket.advice_rpm, pocket.advice_lobe), (9000.0, 3));
        let gear = with_advice(spectrum::Advice::CheckGear { joint: 5, shaft: 2 });
        assert_eq!((gear.gear_joint, gear.gear_shaft), (5, 2));
    }
}
