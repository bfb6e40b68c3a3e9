//! Findings as English sentences for technicians, with values and units.

use super::{JointSection, StructureLocation};
use crate::hypothesis::parameter_key;
use physics::{AnyEffect, JointKind};

/// Formats the parameters of an effect in the units of files, with three significant digits.
struct EffectFormatter<'a> {
    effect: &'a AnyEffect,
    stated: Option<&'a [f64]>,
    is_prismatic: bool,
}

impl EffectFormatter<'_> {
    /// Parameter `k` (its change, if the model states one) in the unit of files.
    fn value(&self, k: usize) -> f64 {
        let kind = if self.is_prismatic { JointKind::Prismatic } else { JointKind::Revolute };
        let stated = self.stated.and_then(|stated| stated.get(k)).copied().unwrap_or(0.0);
        let value = self.effect.values().get(k).copied().unwrap_or(0.0) - stated;
        parameter_key(self.effect, k)
            .map_or(value, |n| value / n.parameter.unit.suffix_and_si(kind).1)
    }

    fn formatted(&self, k: usize) -> String {
        three_digits(self.value(k))
    }

    /// Euclidean norm of parameters `from` to `to`.
    fn formatted_norm(&self, from: usize, to: usize) -> String {
        three_digits((from..to).map(|k| self.value(k).powi(2)).sum::<f64>().sqrt())
    }

    fn angle_unit(&self) -> &'static str {
        if self.is_prismatic { "mm" } else { "mrad" }
    }
}

/// Three significant digits.
fn three_digits(value: f64) -> String {
    let places = if value == 0.0 { 0.0 } else { 2.0 - value.abs().log10().floor() };
    format!("{value:.*}", places.clamp(0.0, 9.0) as usize)
}

/// What an unexplained structure is, and what to do about it; `depends_on`: names of its covariates; `section`: where it is, if it is local.
#[must_use]
pub fn structure(
    location: StructureLocation,
    depends_on: &[String],
    section: Option<JointSection>,
) -> String {
    match (location, section) {
        (StructureLocation::Joint(joint), Some(JointSection { limits, largest, kind })) => {
            let is_prismatic = kind == JointKind::Prismatic;
            let (unit, error_unit) = if is_prismatic { (" mm", "mm") } else { ("°", "mrad") };
            let [low, high] =
                limits.map(|limit| if is_prismatic { 1e3 * limit } else { limit.to_degrees() });
            format!(
                "Joint {} has an unmodelled error of up to {} {error_unit} between {low:.1} and {high:.1}{unit}: \
                 look there for damage to its gear, bearing or encoder.",
                joint + 1,
                three_digits(1e3 * largest)
            )
        }
        (StructureLocation::Joint(joint), None) => format!(
            "An unmodelled error of joint {}, depending on {}, remains.",
            joint + 1,
            depends_on.join(" and ")
        ),
        (StructureLocation::MeasuringFrame, _) => "The measuring frame moves against the robot's base during the recording: the instrument, its stand or the base is not \
             steady, or the arm grows with heat. Measure again with three reference targets on the base (`target#_on_link = 0`): they show which."
            .to_owned(),
        (StructureLocation::MeasuredPoint, _) => "The measured point moves on the tool during the recording: a target or the tool slipped, or the tool grows with heat. \
             Fasten it and measure again, with three targets on the tool."
            .to_owned(),
    }
}

/// A finding as one sentence. `stated`: the parameters that the model states, if they are corrected; `is_prismatic`: whether the joint is prismatic.
#[must_use]
pub fn sentence(effect: &AnyEffect, stated: Option<&[f64]>, is_prismatic: bool) -> String {
    let formatter = EffectFormatter { effect, stated, is_prismatic };
    let joint = effect.joint().map_or(String::new(), |joint| format!("Joint {}", joint + 1));
    let what = drive_phrase(&formatter, &joint);
    match stated {
        None => format!("{what}."),
        Some(_) => format!(
            "The model's {} is wrong; the difference: {what}.",
            effect.spec().kind.replace('_', " ")
        ),
    }
}

/// The joint whose motion is coupled into another one.
fn coupled_joint(effect: &AnyEffect) -> String {
    match effect {
        AnyEffect::JointCoupling(coupling) => format!("joint {}", coupling.from_joint() + 1),
        _ => "another joint".to_owned(),
    }
}

/// Drives, gears and compliances.
fn drive_phrase(formatter: &EffectFormatter<'_>, joint: &str) -> String {
    let (n, mrad) = (|k| formatter.formatted(k), formatter.angle_unit());
    match formatter.effect.spec().kind {
        "joint_offset" => format!("{joint} has a zero offset of {} {mrad}", n(0)),
        "joint_ratio" => format!(
            "{joint} has a scale error of {} of its angle: gear ratio or encoder scale",
            n(0)
        ),
        "joint_coupling" => format!(
            "{joint} is coupled to {} by {} of its motion: coupled gears",
            coupled_joint(formatter.effect),
            n(0)
        ),
        "transmission_error" => format!(
            "{joint} has a transmission error of {} {mrad} with {} cycles per {}: eccentricity or mesh of its gears",
            n(0),
            n(1),
            if formatter.is_prismatic { "metre" } else { "revolution" }
        ),
        "backlash" => format!(
            "{joint} loses {} {mrad} of motion at each reversal: backlash in its gear train",
            n(0)
        ),
        "lost_motion" => format!(
            "{joint} has a lost motion of {} {mrad} around zero load (within about {} {}) in its gear train",
            n(0),
            n(1),
            if formatter.is_prismatic { "N" } else { "Nm" }
        ),
        "hysteresis" => format!(
            "{joint} has a hysteresis of {} {mrad}, which builds up over {} {mrad} after a reversal",
            n(0),
            n(1)
        ),
        "gravity_compliance" | "joint_compliance" => format!(
            "{joint} deflects under its load by {} {mrad} per kNm: compliance of its gear train",
            n(0)
        ),
        "load_compliance" => format!(
            "{joint} deflects under the load on the tool by {} {mrad} per kNm: compliance of its gear train",
            n(0)
        ),
        "gravity_sag" => format!(
            "{joint} deflects under gravity by up to {} {mrad}",
            formatter.formatted_norm(0, formatter.effect.values().len())
        ),
        "stiffness_hardening" => {
            format!(
                "{joint} stiffens under load: compliance decreases by {} {mrad} per kNm cubed",
                n(0)
            )
        }
        "bearing_compliance" => {
            format!("{joint}'s bearing tilts by {} mrad per kNm of moment across its axis", n(0))
        }
        "base_compliance" => {
            format!("The base tilts by {} mrad per kNm: compliance of foot, bolts or floor", n(0))
        }
        "tool_compliance" => {
            format!("The tool deflects by {}, {}, {} µm per N along its axes", n(0), n(1), n(2))
        }
        "counterbalance" => {
            format!("{joint} is loaded by a spring of {} N per m: its counterbalance", n(0))
        }
        _ => static_phrase(formatter, joint),
    }
}

/// Geometry, loads, temperature and force sensor.
fn static_phrase(formatter: &EffectFormatter<'_>, joint: &str) -> String {
    let (n, mrad) = (|k| formatter.formatted(k), formatter.angle_unit());
    match formatter.effect.spec().kind {
        "axis_tilt" => {
            format!("{joint}'s axis is tilted by {} mrad", formatter.formatted_norm(0, 2))
        }
        "axis_shift" => {
            format!("{joint}'s axis is displaced by {} mm", formatter.formatted_norm(0, 3))
        }
        "tool_offset" => {
            format!("The tool centre point is displaced by {} mm", formatter.formatted_norm(0, 3))
        }
        "gravity_tilt" => {
            format!(
                "The robot's base is tilted by {} mrad from the vertical",
                formatter.formatted_norm(0, 2)
            )
        }
        "payload" => {
            format!("The flange carries a mass of {} kg that the model does not state", n(0))
        }
        "thermal_growth" => format!(
            "The link after {} expands {}",
            joint.to_lowercase(),
            temperature_phrase(formatter, &format!("{} µm", n(0)))
        ),
        "thermal_zero" => {
            format!(
                "{joint}'s zero drifts {}",
                temperature_phrase(formatter, &format!("{} {mrad}", n(0)))
            )
        }
        "axis_wobble" => format!(
            "{joint}'s axis wobbles by {} mrad during rotation: runout of its bearing",
            formatter.formatted_norm(0, 2)
        ),
        "spindle_growth" => match formatter.effect.fitted().first().map(|p| p.stem) {
            Some("growth_um") => {
                format!("The spindle expands by {} µm per thousand rev/min as it warms up", n(0))
            }
            _ => format!("The spindle expands by {} µm per kelvin as it warms up", n(0)),
        },
        "wrench_bias" => format!(
            "The force sensor has an offset of {} N and {} Nm",
            formatter.formatted_norm(0, 3),
            formatter.formatted_norm(3, 6)
        ),
        "wrench_scale" => {
            format!(
                "The force sensor has scale errors of {}, {}, {} along its axes",
                n(0),
                n(1),
                n(2)
            )
        }
        "wrench_misalignment" => {
            format!("The force sensor is rotated by {} mrad", formatter.formatted_norm(0, 3))
        }
        _ => path_phrase(formatter, joint),
    }
}

/// Effects over paths: delay, lag, modes, reversal spikes.
fn path_phrase(formatter: &EffectFormatter<'_>, joint: &str) -> String {
    let (n, mrad) = (|k| formatter.formatted(k), formatter.angle_unit());
    match formatter.effect.spec().kind {
        "time_delay" => {
            format!("The measurement is delayed by {} ms relative to the commands", n(0))
        }
        "servo_lag" => {
            format!("{joint} follows its command with a time constant of {} ms: servo lag", n(0))
        }
        "flexible_mode" => {
            let who = if joint.is_empty() { "The base" } else { joint };
            format!("{who} has a mode at {} Hz with a damping ratio of {}", n(0), n(1))
        }
        "reversal_spike" => format!(
            "{joint} overshoots by {} {mrad} at each reversal and recovers within {} ms: servo mismatch",
            n(0),
            n(1)
        ),
        kind => format!("{joint} {kind}: {}", n(0)),
    }
}

/// Amount by temperature, or over time if no temperature was recorded.
fn temperature_phrase(formatter: &EffectFormatter<'_>, much: &str) -> String {
    let fitted = formatter.effect.fitted();
    let stem = |k: usize| fitted.get(k).map(|p| p.stem);
    match (stem(0), stem(1)) {
        (Some("growth" | "drift"), Some("lag")) => {
            format!(
                "with temperature: {much} per kelvin, with a lag of {} s behind the air",
                formatter.formatted(1)
            )
        }
        (Some("growth" | "drift"), _) => format!("with temperature: {much} per kelvin"),
        (_, Some("time_constant")) => format!(
            "over the recording, by {much} with a time constant of {} s; no temperature was recorded",
            formatter.formatted(1)
        ),
        _ => format!("with temperature: {much}"),
    }
}

/// When an effect is visible, as the field `condition` of a result.
#[must_use]
pub fn condition(effect: &AnyEffect) -> String {
    let n = effect.joint().map_or(0, |joint| joint + 1);
    match effect.spec().kind {
        "backlash" | "reversal_spike" => format!("changes sign with the direction of joint {n}"),
        "servo_lag" => format!("follows the speed of joint {n}"),
        "time_delay" => "follows the speed of the arm".to_owned(),
        "flexible_mode" if n > 0 => format!("oscillates after excitation by joint {n}"),
        "flexible_mode" => "oscillates after excitation by the arm".to_owned(),
        "wrench_bias" | "wrench_scale" | "wrench_misalignment" => {
            "follows the deflection under the wrench".to_owned()
        }
        "hysteresis" => format!("builds up after each reversal of joint {n}"),
        "lost_motion" => format!("changes sign with the load on joint {n}"),
        "gravity_compliance" | "joint_compliance" | "gravity_sag" => {
            format!("follows the load on joint {n}")
        }
        "load_compliance" | "tool_compliance" => "follows the wrench on the tool".to_owned(),
        "stiffness_hardening" => format!("follows the cube of the load on joint {n}"),
        "bearing_compliance" => format!("follows the moment across joint {n}'s axis"),
        "base_compliance" => "follows the moment about the base".to_owned(),
        "joint_ratio" => format!("increases with the angle of joint {n}"),
        "joint_coupling" => format!("follows the angle of a joint coupled to joint {n}"),
        "transmission_error" | "axis_wobble" => format!("is periodic in the angle of joint {n}"),
        "thermal_growth" | "thermal_zero" | "spindle_growth" => {
            "follows the temperature, or time since the start".to_owned()
        }
        "gravity_tilt" | "payload" | "counterbalance" => "follows the weight of the arm".to_owned(),
        "joint_offset" | "axis_tilt" | "axis_shift" => {
            format!("constant in the frame of joint {n}")
        }
        _ => "constant in the tool frame".to_owned(),
    }
}
