//! Change of the model during a path: no missed cycle, continuous correction.
//!
//! The models differ, so that there is a difference to be ramped; steps are compared with the
//! daemon's own rate limit.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

use trued_client::{Answer, Corrected, JOINTS_MAX, Monitor};

use crate::bench_directory::BenchDirectory;
use crate::error::BenchError;
use crate::paced::{Paced, PacedMeasurement};
use crate::plan::Plan;

/// Time between two changes, in which the correction moves.
const SWAP_INTERVAL: Duration = Duration::from_millis(400);
/// Time limit of the daemon's answer to a request.
const ANSWER_WITHIN: Duration = Duration::from_secs(5);
/// Allowance for rounding in a step, rad or m.
const ROUNDING: f64 = 1e-9;

/// Results.
#[derive(Debug, Clone, Default)]
pub struct ModelSwap {
    /// Models activated.
    pub swaps: u64,
    /// Number of models seen in the answers during the path.
    pub epochs_seen: u64,
    /// The round trips of that path.
    pub paced: Paced,
    /// Largest step of a joint's correction from one answer to the next, relative to its rate limit
    /// over that time.
    pub step_over_bound: f64,
    /// Largest change of the requested correction from one answer to the next, rad or m, which was
    /// ramped.
    pub jump_wanted: f64,
}

/// Changes models while the path runs.
pub(crate) fn run(
    plan: &Plan,
    place: &BenchDirectory,
    pacing: &PacedMeasurement<'_>,
) -> Result<ModelSwap, BenchError> {
    let rate = pacing.subject.client()?.status().map_or([f64::NAN; JOINTS_MAX], |s| s.bounds.rate);
    let mut monitor = pacing.subject.monitor()?;
    let models = [place.write("model-a.toml", &plan.models[1])?, place.path("model.toml")];
    let over = AtomicBool::new(false);
    let mut steps = CorrectionSteps { rate, last: None, worst: 0.0, jump: 0.0, epochs: 0 };
    let (paced, swaps) = std::thread::scope(|scope| {
        let swapping = scope.spawn(|| {
            let paths = models.iter().cycle();
            paths.take_while(|_| wait(&over)).filter(|path| swap(&mut monitor, path)).count()
        });
        let paced = pacing.run(|answer| steps.add(answer));
        over.store(true, Relaxed);
        (paced, swapping.join())
    });
    let swaps = swaps.map_err(|_| BenchError::Thread("swap"))? as u64;
    let CorrectionSteps { worst, jump, epochs, .. } = steps;
    Ok(ModelSwap {
        swaps,
        epochs_seen: epochs,
        paced: paced?,
        step_over_bound: worst,
        jump_wanted: jump,
    })
}

/// Waits for the next change; false if there is none.
fn wait(over: &AtomicBool) -> bool {
    std::thread::sleep(SWAP_INTERVAL);
    !over.load(Relaxed)
}

fn swap(monitor: &mut Monitor, path: &std::path::Path) -> bool {
    monitor
        .reload(Some(path), ANSWER_WITHIN)
        .is_ok_and(|response| response.answer() == Ok(Answer::Done))
}

/// Steps of the correction from answer to answer.
struct CorrectionSteps {
    rate: [f64; JOINTS_MAX],
    last: Option<Corrected>,
    worst: f64,
    jump: f64,
    epochs: u64,
}

impl CorrectionSteps {
    fn add(&mut self, answer: &Corrected) {
        if let Some(last) = self.last {
            // The daemon moves by the commands' time or by its own, whichever is longer.
            let dt_ns = answer.made_ns.saturating_sub(last.made_ns);
            let dt_s = dt_ns.max(answer.t_ns.saturating_sub(last.t_ns)) as f64 * 1e-9;
            for i in 0..(answer.joints as usize).min(JOINTS_MAX) {
                let step = (answer.correction[i] - last.correction[i]).abs();
                let allowed = self.rate[i] * dt_s;
                self.worst = self.worst.max((step - ROUNDING).max(0.0) / allowed);
                if answer.model_epoch != last.model_epoch {
                    self.jump = self.jump.max((answer.wanted[i] - last.wanted[i]).abs());
                }
            }
            self.epochs += u64::from(answer.model_epoch != last.model_epoch);
        }
        self.last = Some(*answer);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_beyond_the_rate_is_seen_and_one_within_is_not() {
        let mut steps = CorrectionSteps {
            rate: [0.05; JOINTS_MAX],
            last: None,
            worst: 0.0,
            jump: 0.0,
            epochs: 0,
        };
        let answer_at = |ms: u64, correction: f64, model_epoch: u64| {
            let mut answer = Corrected { joints: 6, model_epoch, ..Corrected::default() };
            (answer.made_ns, answer.t_ns) = (ms * 1_000_000, ms * 1_000_000);
            (answer.correction[2], answer.wanted[2]) = (correction, correction);
            answer
        };
        steps.add(&answer_at(0, 0.0, 1));
        steps.add(&answer_at(1, 4e-5, 1));
        assert!(steps.worst > 0.75 && steps.worst < 1.0, "{}", steps.worst);
        steps.add(&answer_at(2, 4e-4, 2));
        assert!(steps.worst > 7.0 && steps.epochs == 1 && steps.jump > 3e-4);
    }
}
