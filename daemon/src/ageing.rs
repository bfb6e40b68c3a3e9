//! Checks whether the active model still holds, by comparison with measurements of the tool.
//!
//! Runs in the supervisor's thread. An implausible measurement is refused without effect; a new
//! model resets the test. The correction is not changed.

use corrector::AgeingTest;
use glam::DVec3;
use physics::{Inputs, JOINTS_MAX, Memories, Model};
use shm_schema::{Answer, Request, Status, TrimState, monotonic_ns};

/// Result of the comparison of the active model with measurements.
#[derive(Debug, Default)]
pub struct ModelAgeing {
    ageing: AgeingTest,
    /// Pose of the last estimate used from the trim, rad or m.
    last_pose: Option<[f64; JOINTS_MAX]>,
}

/// Poses differ if a joint differs by more than this, rad or m: the model's error there is a new
/// measurement.
const POSE_DISTANCE: f64 = 0.2;

impl ModelAgeing {
    /// Adds a measurement of the tool of `model`.
    pub fn add_measurement(&mut self, model: &Model, request: &Request) -> (Answer, String) {
        let count = model.arm.count();
        if request.joints as usize != count {
            let message = format!("{} joints, the model has {count}", request.joints);
            return (Answer::Refused, message);
        }
        if !request.q.iter().all(|q| q.is_finite()) || !model.arm.within_limits(&request.q) {
            return (
                Answer::Refused,
                "joint positions must be finite and within their limits".to_owned(),
            );
        }
        let residual = DVec3::from_array(request.point_m) - predicted(model, request);
        if !self.ageing.add_measurement(residual, request.sigma_m, monotonic_ns()) {
            let message = "the point must be finite and its sigma above 0, both in m";
            return (Answer::Refused, message.to_owned());
        }
        let message =
            self.message(monotonic_ns()).unwrap_or_else(|| "the model is confirmed".to_owned());
        (
            Answer::Done,
            format!("{:.3} mm from the model's prediction; {message}", 1e3 * residual.length()),
        )
    }

    /// Adds the trim's estimate of the model's error, once in each pose: repeated estimates at one
    /// pose contain no new information. `sigma_m` is the standard uncertainty per axis, of model
    /// and instrument together.
    pub fn add_trim_estimate(&mut self, status: &Status, sigma_m: f64) {
        let believed = [TrimState::Observing, TrimState::Trimming];
        let is_near = self.last_pose.is_some_and(|pose| {
            pose.iter().zip(status.q_command).all(|(pose, q)| (q - pose).abs() < POSE_DISTANCE)
        });
        if is_near || !status.trim_state().is_ok_and(|state| believed.contains(&state)) {
            return;
        }
        if self.ageing.add_measurement(DVec3::from_array(status.trim_found_m), sigma_m, status.t_ns)
        {
            self.last_pose = Some(status.q_command);
        }
    }

    /// Writes the result into a status.
    pub fn write_status(&self, status: &mut Status) {
        status.model_broken_since_ns = self.ageing.broken_since_ns().unwrap_or(0);
        status.model_measurements = self.ageing.count();
        status.model_residual_m = self.ageing.residual_m();
    }

    /// Message for users at `now_ns`; `None` while the model holds.
    pub fn message(&self, now_ns: u64) -> Option<String> {
        let since_ns = self.ageing.broken_since_ns()?;
        Some(format!(
            "the model has been outdated since {} ago: tool error {:.3} mm; record a measuring program and run `trued diagnose`",
            duration_text(now_ns.saturating_sub(since_ns)),
            1e3 * self.ageing.residual_m()
        ))
    }
}

/// Tool position by the model, settled in this pose, base frame, m.
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

/// A duration in words.
fn duration_text(ns: u64) -> String {
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

    fn found(state: TrimState, k: u32, found_m: f64) -> Status {
        let mut status = Status { trim_state: state.code(), ..Status::default() };
        status.q_command[0] = 0.3 * f64::from(k);
        status.trim_found_m = [found_m, 0.0, 0.0];
        status.t_ns = u64::from(k) * 1_000_000_000;
        status
    }

    #[test]
    fn what_the_trim_finds_counts_once_in_each_pose_and_tells_that_the_model_has_aged() {
        let sigma_m = 1e-4;
        let mut age = ModelAgeing::default();
        for _ in 0..1000 {
            age.add_trim_estimate(&found(TrimState::Trimming, 1, 3e-4), sigma_m);
        }
        assert_eq!(age.ageing.count(), 1, "the same pose");
        age.add_trim_estimate(&found(TrimState::Holding, 2, 3e-4), sigma_m);
        assert_eq!(age.ageing.count(), 1, "nothing is measured");
        for k in 2..30 {
            age.add_trim_estimate(&found(TrimState::Observing, k, 3e-4), sigma_m);
        }
        assert!(
            age.message(40_000_000_000)
                .is_some_and(|message| message.contains("has been outdated"))
        );
    }

    #[test]
    fn durations_have_a_readable_unit() {
        let durations = [5, 300, 10_000, 400_000].map(|s| duration_text(s * 1_000_000_000));
        assert_eq!(durations, ["5 s", "5 min", "2 h", "4 days"]);
    }
}
