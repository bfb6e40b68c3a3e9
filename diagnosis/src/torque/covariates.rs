//! Covariates of unmodelled structure: names and values. Covariates of the joint itself come first.

use super::motion::Motion;

/// A dependence of the residual torque on covariates.
#[derive(Clone, Debug, PartialEq)]
pub struct UnexplainedTorque {
    /// Joint from 0.
    pub joint: usize,
    /// Names of the covariates, as in docs/reference/results.md.
    pub depends_on: Vec<String>,
    /// Sums of squares of the residual on test rows without and with the law, (N m)².
    pub heldout_squares: [f64; 2],
}

/// A covariate and its value per row.
pub(crate) struct Covariate {
    pub(crate) name: String,
    pub(crate) values: Vec<f64>,
}

/// Covariates of a joint's torque: its position, velocity, acceleration, and time first.
pub(super) fn covariates(motion: &Motion, joint: usize) -> Vec<Covariate> {
    let all = |value: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
        let runs = motion.runs.iter().enumerate();
        runs.flat_map(|(k, run)| run.rows.iter().map(move |row| (k, *row)))
            .map(|(run, row)| value(run, row))
            .collect()
    };
    let track = |run: usize| &motion.runs[run].joints[joint];
    let name = |stem: &str| format!("{stem}{}", joint + 1);
    let mut covariates = vec![
        Covariate { name: name("q"), values: all(&|run, row| track(run).q[row]) },
        Covariate { name: name("v"), values: all(&|run, row| track(run).v[row]) },
        Covariate { name: name("a"), values: all(&|run, row| track(run).a[row]) },
        Covariate { name: "t_s".to_owned(), values: all(&|run, row| motion.runs[run].time_s(row)) },
    ];
    if motion.runs.iter().all(|run| !run.joints[joint].temperature.is_empty()) {
        let values = all(&|run, row| track(run).temperature[row]);
        covariates.push(Covariate { name: format!("{}_C", name("temp")), values });
    }
    for other in 0..motion.runs.first().map_or(0, |run| run.joints.len()) {
        if other != joint {
            let values = all(&|run, row| motion.runs[run].joints[other].q[row]);
            covariates.push(Covariate { name: format!("q{}", other + 1), values });
        }
    }
    covariates
}
