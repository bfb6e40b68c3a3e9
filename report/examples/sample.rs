//! Renders one page with every kind of drawing on invented data: `cargo run -p report --example sample > sample.html`.

use std::io::{self, Write};

use report::{
    ArmPicture, Axis, Bar, Bars, HeatMap, Histogram, Multiples, Number, Page, Plot, Role, Series,
    Table, Tone, ToolError,
};

fn main() -> io::Result<()> {
    io::stdout().lock().write_all(page().render().as_bytes())
}

fn page() -> Page {
    Page::new("The tool goes where it was told to, within 0.12 mm")
        .kicker("Sample page, invented data")
        .robot("IRB 1600-6/1.45, serial 0000")
        .verdict(
            Tone::Good,
            "within 0.2 mm",
            "Along three slots the tool strayed 0.84 mm from its path. With the correction it stays within a seventh \
             of that. One cut rang at 72 Hz, and was flagged after 38 ms.",
        )
        .numbers([
            Number::new("Mean tool error", 0.1234, "mm").note("0.843 mm without").tone(Tone::Good),
            Number::new("Latency, 99.9 %", 41.2, "µs").note("worst 188 µs"),
            Number::new("Missed cycles", 0.0, "").note("of 58 012"),
            Number::new("Vibration", 72.0, "Hz").note("y, at 4.03 s").tone(Tone::Caution),
        ])
        .figure("The tool's error over the arm's room, before and after.", &arm())
        .next("Measure again after a week.", Some("trued plan --model irb1600.toml --check"))
        .section("Tool error along the path")
        .text("Both runs were measured on the same robot; only the correction differs.")
        .figure("Distance of the tool from the commanded path.", &error())
        .table(&table())
        .figure("Seen from above, the error exaggerated a hundredfold.", &path())
        .section("What was corrected")
        .figure("Correction of each joint over the run, on one scale.", &joints())
        .section("Timing")
        .figure("Command in to corrected target out; the tail matters, so shares are logarithmic.", &latency())
        .section("Vibration")
        .figure("Spectrum of the force along y over time.", &waterfall())
        .note(Tone::Caution, "One cut rang", "From 4.03 s on a line at 72 Hz stood 21 dB above the floor along y.")
        .section("Where the rest comes from")
        .figure("Share of the remaining error, with 95 % intervals.", &shares())
        .facts([("Model", "irb1600-hybrid.toml"), ("Seed", "7"), ("Cycles", "58 012"), ("Kernel", "6.8.0, not real-time")])
        .code("trued demo --seed 7 --out demo-out")
        .footer("Made by trued.")
}

fn arm() -> report::Svg {
    let error = |i: u32| {
        let turn = f64::from(i) * 0.37;
        let out = 0.7 + 0.25 * (turn * 1.7).sin();
        let position = [
            out * (0.5 * turn.sin()).cos(),
            out * (0.5 * turn.sin()).sin(),
            0.6 + 0.3 * turn.cos(),
        ];
        let before = [2e-4 * turn.sin(), 3e-4, -9e-4 * out];
        ToolError { at: position, before, after: before.map(|x| 0.15 * x) }
    };
    ArmPicture::new("Errors at the tool", [1.0, 0.0, 0.95])
        .joint("1", [0.0, 0.0, 0.2], false)
        .joint("2", [0.15, 0.0, 0.49], true)
        .joint("3", [0.15, 0.0, 0.96], false)
        .joint("4", [0.45, 0.0, 0.96], false)
        .joint("5", [0.75, 0.0, 0.96], false)
        .joint("6", [0.81, 0.0, 0.96], false)
        .errors((0..60).map(error))
        .render()
}

fn time_s() -> impl Iterator<Item = f64> {
    (0..58_000).map(|i| f64::from(i) * 1e-3)
}

fn noise(t: f64) -> f64 {
    ((t * 12_543.7).sin() * 43_758.545_3).fract()
}

fn stray_mm(t: f64) -> f64 {
    0.8 + 0.35 * (t / 9.0).sin() + 0.08 * (t * 2.1).cos() + 0.03 * noise(t)
}

fn error() -> report::Svg {
    Plot::new("Tool error over time", Axis::new("Time", "s"), Axis::new("Tool error", "mm"))
        .series(
            Series::line("without correction", time_s().map(|t| (t, stray_mm(t))))
                .role(Role::Before),
        )
        .series(
            Series::line(
                "with correction",
                time_s().map(|t| (t, 0.15 * stray_mm(t) + 0.02 * noise(t + 3.0).abs())),
            )
            .role(Role::After),
        )
        .mark_x(4.03, "72 Hz flagged")
        .mark_y(0.2, "asked: 0.2 mm")
        .render()
}

fn slot(path_m: f64) -> (f64, f64) {
    match path_m {
        _ if path_m < 1.0 => (0.0, 60.0 * path_m),
        _ if path_m < 2.0 => (120.0 * (path_m - 1.0), 60.0),
        _ => (120.0, 60.0 * (3.0 - path_m)),
    }
}

fn path() -> report::Svg {
    let along = || (0..=3000).map(|i| f64::from(i) * 1e-3);
    let deviated = |scale: f64| {
        along().map(move |s| {
            let (x, y) = slot(s);
            (x + scale * (6.0 + 2.0 * (s * 4.0).sin()), y + scale * (4.0 * (s * 3.0).cos() - 3.0))
        })
    };
    Plot::new(
        "Path in the plane",
        Axis::new("x in the base frame", "mm"),
        Axis::new("y in the base frame", "mm"),
    )
    .series(Series::line("commanded", along().map(slot)).role(Role::Truth))
    .series(Series::line("without correction", deviated(1.0)).role(Role::Before))
    .series(Series::line("with correction", deviated(0.14)).role(Role::After))
    .equal_scale()
    .height(380.0)
    .render()
}

fn joints() -> report::Svg {
    (0..6)
        .map(|joint| {
            let size = [0.4, 1.6, 1.2, 0.2, 0.5, 0.1][joint];
            let wave = move |t: f64| {
                size * (t / 7.0 + joint as f64).sin() + 0.05 * (t.rem_euclid(20.0) - 10.0).signum()
            };
            Plot::new(
                format!("Joint {}", joint + 1),
                Axis::new("Time", "s"),
                Axis::new("Correction", "mrad"),
            )
            .series(Series::line("", time_s().map(move |t| (t, wave(t)))))
        })
        .fold(Multiples::new("Correction per joint", 3), Multiples::plot)
        .render()
}

fn latency() -> report::Svg {
    let sample = |middle: f64, tail: f64| {
        time_s()
            .map(move |t| middle * (0.25 * noise(t)).exp() + tail * noise(t * 1.7).abs().powi(40))
    };
    Histogram::new("Latency", Axis::new("Latency", "µs").log())
        .values("spinning", sample(12.0, 150.0))
        .values("woken", sample(31.0, 400.0))
        .mark(41.2, "99.9 %")
        .log_share()
        .render()
}

fn waterfall() -> report::Svg {
    let (columns, rows) = (400, 160);
    let cells = (0..rows * columns).map(|i| {
        let (t, f) = (f64::from(i % columns) * 0.025, f64::from(i / columns) * 1.25);
        let line = if t > 4.0 {
            (-((f - 72.0) / 1.6).powi(2)).exp() * (t - 4.0).min(1.0) * 12.0
        } else {
            0.0
        };
        0.06 + 0.05 * noise(f64::from(i)).abs() + line + 1.8 * (-((f - 33.0) / 1.2).powi(2)).exp()
    });
    HeatMap::new(
        "Waterfall",
        Axis::new("Time", "s").range(0.0, 10.0),
        Axis::new("Frequency", "Hz").range(0.0, 200.0),
        Axis::new("Amplitude", "N").log(),
    )
    .cells(columns as usize, cells.collect())
    .render()
}

fn shares() -> report::Svg {
    Bars::new("Shares of the remaining error", Axis::new("Mean tool error", "mm"))
        .groups(["before", "after"])
        .roles([Role::Before, Role::After])
        .row(
            "backlash, joint 3",
            [Bar::new(0.062).between(0.055, 0.071), Bar::new(0.004).between(0.0, 0.009)],
        )
        .row(
            "gravity_compliance, joint 2",
            [Bar::new(0.041).between(0.030, 0.052), Bar::new(0.011).between(0.006, 0.015)],
        )
        .row(
            "transmission_error, joint 1",
            [Bar::new(0.018).between(0.009, 0.027), Bar::new(0.016).between(0.008, 0.024)],
        )
        .render()
}

fn table() -> Table {
    Table::new("Tool error over the path, mm", ["", "Mean", "95 %", "Largest", "Points"])
        .row([
            "without correction".into(),
            0.8432.into(),
            1.12.into(),
            1.31.into(),
            58_012.0.into(),
        ])
        .row(["with correction".into(), 0.1234.into(), 0.17.into(), 0.2042.into(), 58_012.0.into()])
}
