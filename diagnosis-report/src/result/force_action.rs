//! What to do after a diagnosis of forces: for the most urgent of its findings.
//!
//! Chatter comes first, with the advice of `trued spectrum`; then a sensor whose zero changed, because it makes every other force doubtful; then the
//! other findings in their order.

use diagnosis::force::{Diagnosis, State};
use report::{capitalised, shell_word};
use spectrum::{Advice, against_chatter};

use super::{Report, ReportedFinding};
use crate::forces::ForceDiagnosis;

/// Seconds per minute.
const MINUTE_S: f64 = 60.0;

/// A step for the person at the machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Action {
    /// What to do.
    pub(crate) says: String,
    /// The command of this step, if there is one.
    pub(crate) command: Option<String>,
}

impl Action {
    fn only(says: impl Into<String>) -> Self {
        Self { says: says.into(), command: None }
    }
}

/// The step for the findings of a report; `None` if nothing was found that asks for one.
pub(super) fn action(
    found: &ForceDiagnosis,
    diagnosis: &Diagnosis,
    report: &Report,
) -> Option<Action> {
    let chatter = report.findings.iter().find(|one| one.effect == "chatter");
    let chatter_hz = chatter.and_then(|one| one.location.frequency_Hz);
    if let Some(frequency_hz) = chatter_hz {
        let file = shell_word(&found.file.display().to_string());
        let spindle_rpm = diagnosis.spindle_hz.map(|hz| MINUTE_S * hz);
        let mut action = against(frequency_hz, spindle_rpm, found.teeth, &file);
        if let Some(next) = &report.next_experiment {
            action.says = format!("{} {next}", action.says);
        }
        return Some(action);
    }
    if diagnosis.is_force && zero_changes(diagnosis) {
        return Some(Action::only(
            "Check that the tool is clear of the workpiece at the end of the recording. If it is, the sensor drifts: let it warm up, check its cable and its mounting, set it to zero in air directly before the cut, and record again.",
        ));
    }
    if report.next_experiment.is_some() {
        return None;
    }
    report.findings.iter().find_map(of_finding).map(Action::only)
}

/// What to do against chatter at this frequency.
fn against(frequency_hz: f64, spindle_rpm: Option<f64>, teeth: u32, file: &str) -> Action {
    let advice = against_chatter(frequency_hz, spindle_rpm.unwrap_or(0.0), teeth);
    let says = format!("{}.", capitalised(&advice.to_string()));
    match spindle_rpm {
        Some(_) if advice != Advice::ReduceDepth || teeth > 0 => Action::only(says),
        Some(_) => Action {
            says: format!(
                "{says} With the number of teeth, `trued spectrum` gives the nearest stable spindle speed."
            ),
            command: Some(format!("trued spectrum --teeth N {file}")),
        },
        None => Action {
            says,
            command: Some(format!("trued spectrum --spindle-rpm RPM --teeth N {file}")),
        },
    }
}

/// Whether the mean force in air after the cut differs from that before it by more than the scatter of single values, as in the note of the diagnosis.
fn zero_changes(diagnosis: &Diagnosis) -> bool {
    let mut air = diagnosis.phases.iter().filter(|phase| phase.state == State::Air);
    let (Some(first), Some(last)) = (air.next(), air.next_back()) else { return false };
    let squares = last.mean.iter().zip(&first.mean).map(|(after, before)| (after - before).powi(2));
    let change = squares.sum::<f64>().sqrt();
    change > last.scatter.iter().chain(&first.scatter).copied().fold(0.0, f64::max)
}

/// The step for one finding.
fn of_finding(finding: &ReportedFinding) -> Option<&'static str> {
    Some(match finding.effect {
        "wrench_bias" => {
            "Set the sensor to zero in air before the next cut, or use the resulting model, which subtracts its offset."
        }
        "wrench_scale" | "wrench_misalignment" | "cross_talk" => {
            "Calibrate the force sensor, or use the resulting model, which corrects its readings."
        }
        "tool_wear" => "Inspect the cutting edge, and change the tool if it is worn.",
        "runout" => "Clean the tool holder and measure the runout of the cutter at its edges.",
        "cutting_force" | "edge_force" => {
            "Use the resulting model for this tool and workpiece: it contains the cutting coefficients found here."
        }
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chatter_at_a_known_speed_and_number_of_teeth_gets_a_stable_speed() {
        let action = against(684.4, Some(5000.0), 4, "cut.csv");
        let expected = "A spindle speed of 5133 rev/min lies in stability pocket 2.";
        assert_eq!(action, Action::only(expected));
    }

    #[test]
    fn chatter_without_a_number_of_teeth_asks_for_less_depth_and_for_the_teeth() {
        let action = against(684.4, Some(5000.0), 0, "cut.csv");
        assert!(action.says.starts_with("Reduce the depth of cut."), "{}", action.says);
        assert_eq!(action.command.as_deref(), Some("trued spectrum --teeth N cut.csv"));
        let action = against(684.4, None, 0, "cut.csv");
        let expected = "trued spectrum --spindle-rpm RPM --teeth N cut.csv";
        assert_eq!(action.command.as_deref(), Some(expected));
    }
}
