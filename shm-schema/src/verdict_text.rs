//! Text of a vibration verdict: frequency, cause and remedy.
//!
//! Used by the daemon's log, its status, and every client. Never allocates; a code of a later version is written as
//! its number.

use core::fmt;

use crate::sensor::channel_name;
use crate::vibration::{Advice, Verdict, VibrationClass, VibrationState};

/// A mode is mentioned if its distance is below this share of its frequency.
const NEAR_MODE: f64 = 0.1;
/// Growth below this is not mentioned, 1/s.
const GROWTH_MIN: f64 = 0.5;

/// "confirmed 684 Hz on y, 5.3 N, chatter of the 690 Hz mode, growing 12 /s: reduce the depth of cut".
impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.state() {
            Ok(state) => write!(f, "{state} ")?,
            Err(_) => write!(f, "state {} ", self.state)?,
        }
        write!(f, "{} Hz on {}", Hertz(self.frequency_hz), channel_name(self.axis))?;
        if self.state() == Ok(VibrationState::Over) {
            return Ok(());
        }
        let unit = if self.axis < 3 { "N" } else { "Nm" };
        write!(f, ", {:.2} {unit}, ", self.amplitude)?;
        self.write_cause(f)?;
        self.write_alternatives(f)?;
        if self.growth_per_s.abs() >= GROWTH_MIN {
            let trend = if self.growth_per_s > 0.0 { "growing" } else { "fading" };
            write!(f, ", {trend} {:.0} /s", self.growth_per_s.abs())?;
        }
        if self.sensor_faults != 0 {
            f.write_str(", on a faulty sensor")?;
        }
        self.write_remedy(f)
    }
}

impl Verdict {
    fn write_cause(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.class() {
            Ok(VibrationClass::Gear) if self.gear_joint > 0 => {
                return write!(f, "gear shaft {} of joint {}", self.gear_shaft, self.gear_joint);
            }
            Ok(class) => f.write_str(class_text(class))?,
            Err(_) => write!(f, "class {}", self.class)?,
        }
        if self.mode_distance_hz.abs() < NEAR_MODE * self.nearest_mode_hz {
            write!(f, " of the {} Hz mode", Hertz(self.nearest_mode_hz))?;
        }
        Ok(())
    }

    fn write_alternatives(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let possible = |class: &&VibrationClass| self.rivals & 1 << class.code() != 0;
        for class in VibrationClass::ALL.iter().filter(possible) {
            write!(f, ", or {}", class_text(*class))?;
        }
        Ok(())
    }

    fn write_remedy(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rpm = self.advice_rpm;
        let text = match Advice::try_from(self.advice) {
            Ok(Advice::None) => return Ok(()),
            Ok(Advice::MoveOffMode) => {
                return write!(
                    f,
                    ": change to {rpm:.0} rev/min to move the tooth frequency away from the modes"
                );
            }
            Ok(Advice::StabilityPocket) => {
                return write!(
                    f,
                    ": change to {rpm:.0} rev/min, stability lobe {}",
                    self.advice_lobe
                );
            }
            Ok(Advice::CheckGear) if self.gear_joint > 0 => {
                return write!(f, ": check the gear train of joint {}", self.gear_joint);
            }
            Ok(Advice::CheckGear) => "check the gear trains",
            Ok(Advice::ChangeCut) => {
                "not affected by spindle speed; change the direction of cut, the feed or the depth"
            }
            Ok(Advice::ReduceDepth) => "reduce the depth of cut",
            Ok(Advice::SampleFaster) => {
                "may be an aliased harmonic of the spindle speed; increase the sampling rate or add an anti-aliasing filter"
            }
            Ok(Advice::CheckWiring) => "check cables, shields and grounding",
            Err(_) => return write!(f, ": advice {}", self.advice),
        };
        write!(f, ": {text}")
    }
}

const fn class_text(class: VibrationClass) -> &'static str {
    match class {
        VibrationClass::Unknown => "of unknown cause",
        VibrationClass::Forced => "forced by the spindle",
        VibrationClass::Chatter => "chatter",
        VibrationClass::ModeCoupling => "mode coupling",
        VibrationClass::Gear => "gear mesh",
        VibrationClass::Structural => "structural vibration",
        VibrationClass::Electrical => "mains interference",
    }
}

/// A frequency with its significant digits.
struct Hertz(f64);

impl fmt::Display for Hertz {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(hz) = *self;
        if hz < 100.0 { write!(f, "{hz:.1}") } else { write!(f, "{hz:.0}") }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chatter() -> Verdict {
        Verdict {
            frequency_hz: 684.2,
            amplitude: 5.31,
            growth_per_s: 12.4,
            nearest_mode_hz: 690.0,
            mode_distance_hz: -5.8,
            state: VibrationState::Confirmed.code(),
            class: VibrationClass::Chatter.code(),
            axis: 1,
            advice: Advice::ReduceDepth.code(),
            ..Verdict::default()
        }
    }

    #[test]
    fn a_verdict_says_what_rings_why_and_what_to_do() {
        assert_eq!(
            chatter().to_string(),
            "confirmed 684 Hz on y, 5.31 N, chatter of the 690 Hz mode, growing 12 /s: reduce the depth of cut"
        );
        let gear = Verdict {
            frequency_hz: 40.12,
            growth_per_s: 0.1,
            class: VibrationClass::Gear.code(),
            rivals: 1 << VibrationClass::Chatter.code(),
            axis: 4,
            advice: Advice::CheckGear.code(),
            gear_joint: 3,
            gear_shaft: 1,
            ..chatter()
        };
        assert_eq!(
            gear.to_string(),
            "confirmed 40.1 Hz on my, 5.31 Nm, gear shaft 1 of joint 3, or chatter: check the gear train of joint 3"
        );
        let over = Verdict { state: VibrationState::Over.code(), ..chatter() };
        assert_eq!(over.to_string(), "over 684 Hz on y");
    }

    #[test]
    fn every_code_and_none_makes_a_sentence() {
        for code in 0..12 {
            let all = Verdict {
                state: 1 + code,
                class: code,
                rivals: u32::MAX,
                advice: code,
                advice_rpm: f64::NAN,
                nearest_mode_hz: f64::NAN,
                axis: code,
                ..chatter()
            };
            assert!(all.to_string().len() > 20, "{all}");
        }
    }
}
