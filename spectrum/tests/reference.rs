//! Comparison of the offline tools with SciPy and pyFRF: equal to 1e-9 of each spectrum's size.
//!
//! The numbers are made by `tests/reference/make.py`. pyFRF removes the mean, so that its first bin
//! is NaN; all others are compared.
#![expect(clippy::expect_used, reason = "in a test a panic is the message")]

use spectrum::frf::{Estimator, Hit, Response, frf};
use spectrum::welch::{Detrend, Scaling, Segments, Taper, coherence, csd, detrended, welch};
use std::collections::HashMap;

type Table = HashMap<String, Vec<f64>>;

fn table(text: &str) -> Table {
    let line = |line: &str| {
        let mut fields = line.split_whitespace();
        let name = fields.next()?.to_string();
        Some((name, fields.map(|field| field.parse().expect("a number")).collect()))
    };
    text.lines().filter_map(line).collect()
}

/// Equal to 1e-9 of the reference's largest value; NaN of the reference is not compared.
fn assert_equal(name: &str, ours: &[f64], reference: &[f64]) {
    assert_eq!(ours.len(), reference.len(), "{name}");
    let size = reference.iter().filter(|r| r.is_finite()).fold(0.0_f64, |a, r| a.max(r.abs()));
    for (i, (a, b)) in ours.iter().zip(reference).enumerate().filter(|(_, (_, b))| b.is_finite()) {
        assert!((a - b).abs() <= 1e-9 * b.abs() + 1e-12 * size, "{name}[{i}]: {a} for {b}");
    }
}

fn parts<'a>(
    values: impl IntoIterator<Item = &'a realfft::num_complex::Complex<f64>>,
) -> (Vec<f64>, Vec<f64>) {
    values.into_iter().map(|value| (value.re, value.im)).unzip()
}

#[test]
fn welch_csd_coherence_and_detrend_are_scipys() {
    let t = table(include_str!("reference/scipy.txt"));
    let (x, y) = (&t["x"], &t["y"]);
    let base = Segments::new(1000.0, 64);
    let power = |segments: &Segments| welch(x, segments).expect("a spectrum").power;
    assert_equal("linear", &detrended(x, Detrend::Linear), &t["detrend_linear"]);
    assert_equal("constant", &detrended(x, Detrend::Constant), &t["detrend_constant"]);
    assert_equal("default", &power(&base), &t["welch_default"]);
    let frequency = welch(x, &base).expect("a spectrum").frequency;
    assert_equal("frequency", &frequency, &t["welch_frequency"]);
    let linear =
        Segments { overlap: 48, detrend: Detrend::Linear, scaling: Scaling::Spectrum, ..base };
    assert_equal("spectrum", &power(&linear), &t["welch_linear_spectrum"]);
    let odd = Segments { length: 45, overlap: 10, detrend: Detrend::None, ..base };
    assert_equal("odd", &power(&odd), &t["welch_odd"]);
    let boxcar = Segments { overlap: 0, taper: Taper::Boxcar, ..base };
    assert_equal("boxcar", &power(&boxcar), &t["welch_boxcar"]);
    let straight = Segments { overlap: 16, detrend: Detrend::Linear, ..base };
    for (name, segments) in [("csd", base), ("csd_linear", straight)] {
        let (re, im) = parts(&csd(x, y, &segments).expect("a cross spectrum").value);
        assert_equal(name, &re, &t[&format!("{name}.re")]);
        assert_equal(name, &im, &t[&format!("{name}.im")]);
    }
    let c = coherence(x, y, &base).expect("a coherence").power;
    assert_equal("coherence", &c, &t["coherence"]);
}

#[test]
fn h1_h2_receptance_and_coherence_are_pyfrfs() {
    let t = table(include_str!("reference/pyfrf.txt"));
    let names = (0..4).map(|k| (format!("force{k}"), format!("response{k}")));
    let hits: Vec<Hit<'_>> =
        names.map(|(force, response)| Hit { force: &t[&force], response: &t[&response] }).collect();
    let h = frf(&hits, 1000.0, Response::Acceleration).expect("a response function");
    for (name, values) in [("H1", &h.h1), ("H2", &h.h2)] {
        let (re, im) = parts(values);
        assert_equal(name, &re, &t[&format!("{name}.re")]);
        assert_equal(name, &im, &t[&format!("{name}.im")]);
    }
    let (re, im) = parts(&h.per_force(Estimator::H1, Response::Displacement)[1..]);
    assert_equal("receptance", &re, &t["receptance.re"]);
    assert_equal("receptance", &im, &t["receptance.im"]);
    assert_equal("coherence", &h.coherence.expect("four hits"), &t["coherence"]);
}
