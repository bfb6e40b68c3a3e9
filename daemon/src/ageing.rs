//! Whether the model in use still holds: measurements of the tool, as they come, against what it says.
//!
//! In the supervisor's thread. Promises: a measurement that makes no sense is refused and changes nothing; another model begins anew.
//! Never: in the cycle; a change of the correction.

use corrector::Ageing;
use glam::DVec3;
use physics::{Inputs, JOINTS_MAX, Memories, Model};
use shm_schema::{Answer, Request, Status, monotonic_ns};

/// What measurements have said of the model in use.
#[derive(Debug, Default)]
pub struct Age {
    ageing: Ageing,
}

impl Age {
    /// Takes a measurement of the tool of `model`.
    pub fn tell(&mut self, model: &Model, request: &Request) -> (Answer, String) {
        let count = model.arm.count();
        if request.joints as usize != count {
            let words = format!("{} joints, the model has {count}", request.joints);
            return (Answer::Refused, words);
        }
        if !request.q.iter().all(|q| q.is_finite()) || !model.arm.within_limits(&request.q) {
            return (
                Answer::Refused,
                "the joints must be finite and inside their limits".to_owned(),
            );
        }
        let off = DVec3::from_array(request.point_m) - predicted(model, request);
        if !self.ageing.take(off, request.sigma_m, monotonic_ns()) {
            let words = "the point must be finite and its sigma above zero, both in m";
            return (Answer::Refused, words.to_owned());
        }
        let words = self.words(monotonic_ns()).unwrap_or_else(|| "the model holds".to_owned());
        (Answer::Done, format!("{:.3} mm from what the model says; {words}", 1e3 * off.length()))
    }

    /// Writes what is known into a status.
    pub fn put(&self, status: &mut Status) {
        status.model_broken_since_ns = self.ageing.broken_since_ns().unwrap_or(0);
        status.model_measurements = self.ageing.count();
        status.model_residual_m = self.ageing.residual_m();
    }

    /// What a person should know at `now_ns`; none while the model holds.
    pub fn words(&self, now_ns: u64) -> Option<String> {
        let since_ns = self.ageing.broken_since_ns()?;
        Some(format!(
            "the model no longer holds, since {} ago: the tool is off by {:.3} mm; record a measuring program and ask `trued diagnose` why",
            span(now_ns.saturating_sub(since_ns)),
            1e3 * self.ageing.residual_m()
        ))
    }
}

/// Where the model puts the tool, settled in that pose, base frame, m.
fn predicted(model: &Model, request: &Request) -> DVec3 {
    let mut inputs = Inputs::at_rest(request.q);
    inputs.ambient_celsius = request.ambient_c;
    for (joint, side) in request.direction.iter().enumerate().take(JOINTS_MAX) {
        inputs.direction[joint] = f64::from(side.signum());
    }
    let mut memories = Memories::default();
    model.settle(&inputs, &mut memories);
    model.evaluate(&inputs, &memories).real.base_from_tool.origin
}

/// A time that has passed, in words.
fn span(ns: u64) -> String {
    let seconds = ns / 1_000_000_000;
    match seconds {
        0..120 => format!("{seconds} s"),
        120..7200 => format!("{} min", seconds / 60),
        7200..172_800 => format!("{} h", seconds / 3600),
        _ => format!("{} days", seconds / 86_400),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_are_said_in_the_unit_that_a_person_would_use() {
        let said = [5, 300, 10_000, 400_000].map(|s| span(s * 1_000_000_000));
        assert_eq!(said, ["5 s", "5 min", "2 h", "4 days"]);
    }
}
