//! Forces compared with the model of the stated cut: over one spindle revolution, over time, and as spectra of the residual.
//!
//! Promises: a bounded number of points in each drawing. Never: a number of its own.

use diagnosis::force::{Compared, Traced};
use report::{Axis, Multiples, Page, Plot, Role, Series, Svg};
use spectrum::welch::{Segments, welch};

/// Points of a spectrum at most.
const POINTS: usize = 1000;
/// Samples of a segment of a spectrum at most.
const SEGMENT: usize = 2048;
const AXES: [&str; 3] = ["fx_N", "fy_N", "fz_N"];

pub(crate) fn figures(page: Page, compared: &Compared) -> Page {
    let turn: Vec<&Traced> = compared.traces.iter().collect();
    page.section("DiagnosedForces beside the law of the cut")
        .figure(
            "Over one turn of the spindle: what was measured, what the stated law says, and what it says with what was found.",
            &all(&turn, "Over one turn", &|one| {
                Plot::new(AXES[one.axis], Axis::new("turn", ""), Axis::new("force", "N"))
                    .series(Series::dots("measured", points(&one.turn, &one.read)).role(Role::Truth))
                    .series(Series::dots("law as stated", points(&one.turn, &one.law[0])).role(Role::Before))
                    .series(Series::dots("with what was found", points(&one.turn, &one.law[1])).role(Role::After))
            }),
        )
        .figure(
            "What the law is off by over time, before and after.",
            &all(&turn, "Over time", &|one| {
                Plot::new(AXES[one.axis], Axis::new("time", "s"), Axis::new("off by", "N"))
                    .series(Series::dots("as stated", points(&one.t_s, &one.off[0])).role(Role::Before))
                    .series(Series::dots("with what was found", points(&one.t_s, &one.off[1])).role(Role::After))
            }),
        )
        .figure(
            "Spectra of what the law is off by: lines at multiples of the spindle are forced, others ring by themselves.",
            &all(&turn, "Spectra", &|one| {
                let hertz = Axis::new("frequency", "Hz");
                Plot::new(AXES[one.axis], hertz, Axis::new("off by", "N²/Hz").log())
                    .series(Series::line("as stated", power(&one.run[0], one.rate_hz)).role(Role::Before))
                    .series(Series::line(
                        "with what was found",
                        power(&one.run[1], one.rate_hz),
                    ).role(Role::After))
            }),
        )
}

fn all(traces: &[&Traced], title: &str, plot: &dyn Fn(&Traced) -> Plot) -> Svg {
    let start = Multiples::new(title, 1).own_y();
    traces.iter().fold(start, |all, one| all.plot(plot(one))).render()
}

fn points(x: &[f64], y: &[f64]) -> Vec<(f64, f64)> {
    x.iter().copied().zip(y.iter().copied()).collect()
}

/// A spectrum without what is not above zero, for an axis of logarithms.
fn power(samples: &[f64], rate_hz: f64) -> Vec<(f64, f64)> {
    let plan = Segments::new(rate_hz, samples.len().min(SEGMENT));
    let Ok(spectrum) = welch(samples, &plan) else { return Vec::new() };
    let pairs = spectrum.frequency.iter().copied().zip(spectrum.power.iter().copied());
    let pairs: Vec<(f64, f64)> = pairs.filter(|(_, power)| *power > 0.0).collect();
    let thin = pairs.len().div_ceil(POINTS).max(1);
    pairs.into_iter().step_by(thin).collect()
}
