//! A bench as one HTML page, and its plots as SVG.

use std::collections::BTreeSet;

use report::{Axis, Number, Page, Plot, Role, Series, Svg, Table, Tone, quantity};

use crate::chunks::BackToBack;
use crate::cost::CostSeries;
use crate::findings::{Findings, Setting};
use crate::latencies::Quantiles;
use crate::peers::Transport;
use crate::tables::{self, BenchTable};

/// The plots, with their file names.
#[must_use]
pub fn plots(findings: &Findings) -> Vec<(String, String, Svg)> {
    let mut plots = Vec::new();
    for setting in &findings.settings {
        let under = setting.name();
        let name = |what: &str| format!("{what}-{}-{}", setting.policy.name(), setting.load_name());
        if let Some(flat) = &setting.flat {
            let caption = format!(
                "Round trips at maximum rate, polled ({under}): the time that one trip in so many exceeds, to the slowest."
            );
            plots.push((name("flat"), caption, curves(flat)));
        }
        if let Some(woken) = &setting.woken {
            let caption = format!("Round trips with kernel wake-up ({under}).");
            plots.push((name("woken"), caption, curves(woken)));
        }
        if !setting.paced.is_empty() {
            let caption = format!(
                "At fixed rates ({under}): command to answer, measured from the scheduled time, to the slowest; dotted: the next command is due; grey: wake-up of an empty cycle at the first rate."
            );
            plots.push((name("paced"), caption, paced(setting)));
        }
    }
    for (name, what, _, costs) in findings.cost.iter().flat_map(tables::kinds) {
        let caption = format!("{what} over {name}, with a fitted line.");
        plots.push((format!("cost-{name}"), caption, line(name, costs)));
    }
    plots
}

fn line(name: &str, costs: &CostSeries) -> Svg {
    let measured = costs.points.iter().map(|point| (point.n as f64, point.cost_us));
    let ends = costs.points.first().into_iter().chain(costs.points.last());
    let line = ends.map(|point| (point.n as f64, costs.line.at(point.n)));
    Plot::new(format!("Cost by {name}"), Axis::new(name, ""), Axis::new("Cost", "µs"))
        .series(Series::line("fitted line", line).role(Role::Before))
        .series(Series::dots("measured", measured))
        .render()
}

fn axes(title: &str) -> Plot {
    // Logarithmic in the rarity: 1000 means that one trip in a thousand is slower.
    let x = Axis::new("Slower trips: one in", "trips").log();
    Plot::new(title, x, Axis::new("Time", "µs").log())
}

fn curves(flat: &BackToBack) -> Svg {
    let measured = Transport::ALL.into_iter().zip(&flat.counted).filter(|(_, c)| c.all.count() > 0);
    measured
        .fold(axes("Round trips"), |plot, (kind, counted)| {
            let series = Series::line(kind.description(), counted.all.curve());
            plot.series(match kind {
                Transport::Bare => series.role(Role::Before),
                Transport::Trued => series.role(Role::After),
                _ => series,
            })
        })
        .render()
}

fn paced(setting: &Setting) -> Svg {
    let plot = setting.paced.iter().fold(axes("Round trips at a rate"), |plot, run| {
        let name = format!("{} Hz, daemon by {}", run.rate_hz, run.wait.name());
        plot.series(Series::line(name, run.paced.scheduled.curve()))
    });
    let plot = deadlines(setting).fold(plot, |plot, rate_hz| {
        plot.mark_y(1e6 / f64::from(rate_hz), format!("next command due at {rate_hz} Hz"))
    });
    let empty = setting.paced.first().map(|run| run.paced.empty.curve()).unwrap_or_default();
    plot.series(Series::line("empty cycle", empty).role(Role::Before)).render()
}

/// The rates of a setting, each once.
fn deadlines(setting: &Setting) -> impl Iterator<Item = u32> {
    let rates: BTreeSet<u32> = setting.paced.iter().map(|run| run.rate_hz).collect();
    rates.into_iter().rev()
}

/// The whole page.
#[must_use]
pub fn render(findings: &Findings) -> Page {
    let machine = &findings.machine;
    let missed = findings.judged.iter().filter(|judged| !judged.ok).count();
    let (tone, label) = match (findings.judged.len(), missed) {
        (0, _) => (Tone::Plain, "measured, no limits requested".to_owned()),
        (_, 0) => (Tone::Good, "all limits met".to_owned()),
        (all, missed) => (Tone::Bad, format!("{missed} of {all} limits missed")),
    };
    let mut page = Page::new("Latency of this computer")
        .kicker(match (&findings.cell, findings.model) {
            (Some(cell), _) => format!("trued bench: cell {cell}"),
            (None, model) => {
                format!("trued bench: separate daemon, model {}", model.unwrap_or("unknown"))
            }
        })
        .verdict(tone, &label, &sentence(findings))
        .numbers(numbers(findings));
    let mut all = plots(findings);
    // At a rate, from the due time of each command: the latency of a cell.
    all.sort_by_key(|(name, ..)| !name.starts_with("paced"));
    let mut all = all.into_iter();
    if let Some((_, caption, plot)) = all.next() {
        page = page.figure(&caption, &plot);
    }
    page = page.next("Check this computer for real-time use.", Some("trued doctor"));
    page = page
        .section("Computer")
        .facts([
            ("Kernel", machine.kernel.clone()),
            ("PREEMPT_RT", yes(machine.preempt_rt)),
            ("Virtual", yes(machine.is_virtual)),
            ("Processor", format!("{}, {} cores online", machine.processor, machine.cpus)),
            ("Scheduling", machine.scheduling.name().to_owned()),
            ("Cores: client, daemon", format!("{}, {}", machine.cores[0], machine.cores[1])),
            (
                "Isolated",
                if machine.isolated.is_empty() {
                    "none".to_owned()
                } else {
                    format!("{:?}", machine.isolated)
                },
            ),
            ("Governor", machine.governor.clone()),
            ("Clock source", machine.clock_source.clone()),
            (
                "CPU time taken by the host (steal)",
                format!("{:.2} s", machine.stolen_ticks as f64 * 0.01),
            ),
        ])
        .list(&machine.means);
    if !findings.skipped.is_empty() {
        let why: Vec<_> =
            findings.skipped.iter().map(|s| format!("{}: {}", s.what, s.why)).collect();
        page = page.note(Tone::Caution, "Not measured", &why.join("; "));
    }
    for (place, (_, caption, plot)) in all.enumerate() {
        page = if place == 0 { page.section("Other curves") } else { page };
        page = page.figure(&caption, &plot);
    }
    page = page.section("Figures");
    for contents in tables::tables(findings) {
        page = page.table(&table(&contents));
    }
    page
}

fn sentence(findings: &Findings) -> String {
    let machine = &findings.machine;
    let latency = trued_latency(findings).map_or(String::new(), |(how, quantiles)| {
        let us = |ns: u64| quantity(ns as f64 * 1e-3, "µs");
        format!(
            "From command to corrected target: median {}, maximum {} of {} ({how}). ",
            us(quantiles.p50),
            us(quantiles.max),
            quantiles.n
        )
    });
    let kernel =
        if machine.preempt_rt { "a real-time kernel" } else { "a kernel without PREEMPT_RT" };
    let on = if machine.is_virtual { "a virtual machine" } else { "this machine" };
    let skipped = match findings.skipped.len() {
        0 => String::new(),
        count => format!(" Parts not measured: {count}."),
    };
    format!("{latency}Measured on {on} with {kernel}.{skipped}")
}

/// The round trip through the daemon: at a rate if measured, otherwise back-to-back.
fn trued_latency(findings: &Findings) -> Option<(String, Quantiles)> {
    let settings = || findings.settings.iter();
    let paced = settings().flat_map(|setting| &setting.paced).next();
    let flat = || {
        let counted = settings().filter_map(|setting| setting.flat.as_ref()).flat_map(|flat| {
            Transport::ALL
                .into_iter()
                .zip(&flat.counted)
                .filter(|(kind, _)| *kind == Transport::Trued)
        });
        counted.map(|(_, counted)| counted.all.quantiles()).next()
    };
    let at_rate = paced.map(|run| {
        (
            format!("at {} Hz, daemon by {}", run.rate_hz, run.wait.name()),
            run.paced.scheduled.quantiles(),
        )
    });
    at_rate.or_else(|| Some(("flat out".to_owned(), flat()?))).filter(|(_, q)| q.n > 0)
}

fn numbers(findings: &Findings) -> Vec<Number> {
    let mut numbers = Vec::new();
    if let Some((how, quantiles)) = trued_latency(findings) {
        let us = |ns: u64| ns as f64 * 1e-3;
        numbers.push(Number::new("Round trip, median", us(quantiles.p50), "µs").note(how));
        numbers.push(rare(&quantiles));
        let of = format!("of {}", quantiles.n);
        numbers.push(Number::new("Round trip, maximum", us(quantiles.max), "µs").note(of));
    }
    let missed = findings.judged.iter().filter(|judged| !judged.ok).count();
    let tone = match findings.judged.len() {
        0 => Tone::Plain,
        _ if missed == 0 => Tone::Good,
        _ => Tone::Bad,
    };
    let all = findings.judged.len();
    numbers.push(Number::text("Limits met", format!("{} of {all}", all - missed)).tone(tone));
    numbers
}

/// The quantile of 99.9 %, by the rule of the tables: `–` where too few trips are beyond it.
fn rare(quantiles: &Quantiles) -> Number {
    let [_, _, _, supported, ..] = quantiles.supported_quantiles();
    let value = supported.map_or(f64::NAN, |ns| ns as f64 * 1e-3);
    let number = Number::new("Round trip, 99.9 %", value, "µs");
    if supported.is_some() {
        return number;
    }
    let least = Quantiles::trips_for(0.999);
    number.note(format!("needs {least} trips, {} were measured", quantiles.n))
}

fn yes(is: bool) -> String {
    if is { "yes" } else { "no" }.to_owned()
}

fn table(contents: &BenchTable) -> Table {
    let table = Table::new(contents.title.clone(), contents.heads.iter().map(String::as_str));
    contents.rows.iter().fold(table, |table, row| {
        table.row(row.iter().map(|cell| report::Cell::from(cell.as_str())))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tile(n: u64) -> String {
        let quantiles = Quantiles { p999: 3_762_000, max: 4_755_000, n, ..Quantiles::default() };
        Page::new("").numbers([rare(&quantiles)]).render()
    }

    #[test]
    fn a_tile_shows_a_quantile_only_where_the_table_does() {
        let few = tile(1500);
        assert!(few.contains("needs 10000 trips, 1500 were measured"), "{few}");
        assert!(!few.contains("3762"), "{few}");
        assert!(tile(10_000).contains("3762"));
    }
}
