//! Forces compared with the model of the stated cut: over one spindle revolution, over time, and as spectra of the residual.
//!
//! The number of points in each drawing is bounded; all values come from the result.

use diagnosis::force::{CutComparison, ForceTrace};
use report::{Axis, Multiples, Page, Plot, Role, Series, Svg};
use spectrum::welch::{Segments, welch};

/// Largest number of points of a spectrum.
const POINTS: usize = 1000;
/// Largest number of samples of a segment of a spectrum.
const SEGMENT: usize = 2048;
const AXES: [&str; 3] = ["fx_N", "fy_N", "fz_N"];

pub(crate) fn figures(page: Page, compared: &CutComparison) -> Page {
    let turn: Vec<&ForceTrace> = compared.traces.iter().collect();
    page.section("Forces compared with the cutting force model")
        .figure(
            "One spindle revolution: measured force, stated force model, and force model with the findings.",
            &all(&turn, "One revolution", &|one| {
                Plot::new(AXES[one.axis], Axis::new("turn", ""), Axis::new("force", "N"))
                    .series(Series::dots("measured", points(&one.revolution, &one.measured)).role(Role::Truth))
                    .series(Series::dots("stated model", points(&one.revolution, &one.predicted[0])).role(Role::Before))
                    .series(Series::dots("with the findings", points(&one.revolution, &one.predicted[1])).role(Role::After))
            }),
        )
        .figure(
            "Error of the force model over time, before and after.",
            &all(&turn, "Over time", &|one| {
                Plot::new(AXES[one.axis], Axis::new("time", "s"), Axis::new("error", "N"))
                    .series(Series::dots("stated model", points(&one.t_s, &one.residuals[0])).role(Role::Before))
                    .series(Series::dots("with the findings", points(&one.t_s, &one.residuals[1])).role(Role::After))
            }),
        )
        .figure(
            "Spectra of the force model error: lines at multiples of the spindle frequency are forced, others self-excited.",
            &all(&turn, "Spectra", &|one| {
                let hertz = Axis::new("frequency", "Hz");
                Plot::new(AXES[one.axis], hertz, Axis::new("error", "N²/Hz").log())
                    .series(Series::line("stated model", power(&one.residual_run[0], one.rate_hz)).role(Role::Before))
                    .series(Series::line(
                        "with the findings",
                        power(&one.residual_run[1], one.rate_hz),
                    ).role(Role::After))
            }),
        )
}

fn all(traces: &[&ForceTrace], title: &str, plot: &dyn Fn(&ForceTrace) -> Plot) -> Svg {
    let start = Multiples::new(title, 1).own_y();
    traces.iter().fold(start, |all, one| all.plot(plot(one))).render()
}

fn points(x: &[f64], y: &[f64]) -> Vec<(f64, f64)> {
    x.iter().copied().zip(y.iter().copied()).collect()
}

/// The positive values of a spectrum, for a logarithmic axis.
fn power(samples: &[f64], rate_hz: f64) -> Vec<(f64, f64)> {
    let plan = Segments::new(rate_hz, samples.len().min(SEGMENT));
    let Ok(spectrum) = welch(samples, &plan) else { return Vec::new() };
    let pairs = spectrum.frequency.iter().copied().zip(spectrum.power.iter().copied());
    let pairs: Vec<(f64, f64)> = pairs.filter(|(_, power)| *power > 0.0).collect();
    let thin = pairs.len().div_ceil(POINTS).max(1);
    pairs.into_iter().step_by(thin).collect()
}
