//! A bench as one HTML page, and its plots as SVG. Never a figure that is not in the findings.

use report::{Axis, Number, Page, Plot, Series, Svg, Table, Tone};

use crate::chunks::Flat;
use crate::cost::Costs;
use crate::findings::{Findings, Setting};
use crate::peers::Kind;
use crate::tables::{self, Words};

/// The plots, by the name of their file.
#[must_use]
pub fn plots(findings: &Findings) -> Vec<(String, String, Svg)> {
    let mut plots = Vec::new();
    for setting in &findings.settings {
        let under = setting.name();
        let name = |what: &str| format!("{what}-{}-{}", setting.policy.name(), setting.load_name());
        if let Some(flat) = &setting.flat {
            let caption =
                format!("Round trips flat out, polled ({under}): what share is slower than that.");
            plots.push((name("flat"), caption, curves(flat)));
        }
        if let Some(woken) = &setting.woken {
            let caption = format!("Round trips woken by the kernel ({under}).");
            plots.push((name("woken"), caption, curves(woken)));
        }
        if !setting.paced.is_empty() {
            let caption = format!(
                "At a rate ({under}): command to answer, from the time it was due; grey: the empty cycle's wake-up at the first rate."
            );
            plots.push((name("paced"), caption, paced(setting)));
        }
    }
    for (name, what, _, costs) in findings.cost.iter().flat_map(tables::kinds) {
        let caption = format!("{what}, by {name}, with the straight line through the figures.");
        plots.push((format!("cost-{name}"), caption, line(name, costs)));
    }
    plots
}

fn line(name: &str, costs: &Costs) -> Svg {
    let measured = costs.points.iter().map(|point| (point.n as f64, point.cost_us));
    let ends = costs.points.first().into_iter().chain(costs.points.last());
    let line = ends.map(|point| (point.n as f64, costs.line.at(point.n)));
    Plot::new(format!("Cost by {name}"), Axis::new(name, ""), Axis::new("Cost", "µs"))
        .series(Series::line("straight line", line).muted())
        .series(Series::dots("measured", measured))
        .render()
}

fn axes(title: &str) -> Plot {
    let x = Axis::new("One trip in so many is slower", "").log();
    Plot::new(title, x, Axis::new("Time", "µs").log())
}

fn curves(flat: &Flat) -> Svg {
    let measured = Kind::ALL.into_iter().zip(&flat.counted).filter(|(_, c)| c.all.count() > 0);
    measured
        .fold(axes("Round trips"), |plot, (kind, counted)| {
            let series = Series::line(kind.what(), counted.all.curve());
            plot.series(if kind == Kind::Bare { series.muted() } else { series })
        })
        .render()
}

fn paced(setting: &Setting) -> Svg {
    let plot = setting.paced.iter().fold(axes("Round trips at a rate"), |plot, at| {
        let name = format!("{} Hz, daemon by {}", at.rate_hz, at.wait.name());
        plot.series(Series::line(name, at.paced.scheduled.curve()))
    });
    let empty = setting.paced.first().map(|at| at.paced.empty.curve()).unwrap_or_default();
    plot.series(Series::line("empty cycle", empty).muted()).render()
}

/// The whole page; `command` is what makes it again.
#[must_use]
pub fn render(findings: &Findings, command: &str) -> String {
    let machine = &findings.machine;
    let missed = findings.judged.iter().filter(|judged| !judged.ok).count();
    let mut page = Page::new("Latency on this machine")
        .kicker(match (&findings.cell, findings.model) {
            (Some(cell), _) => cell.clone(),
            (None, model) => {
                format!("a daemon of the bench's own, model {}", model.unwrap_or("unknown"))
            }
        })
        .lead(&format!(
            "{} of {} bars held; {} parts not measured.",
            findings.judged.len() - missed,
            findings.judged.len(),
            findings.skipped.len()
        ))
        .numbers(findings.judged.iter().take(6).map(|judged| {
            let tone = if judged.ok { Tone::Good } else { Tone::Bad };
            let note = format!("at most {} {}", judged.bar, judged.unit);
            Number::new(judged.what.clone(), judged.measured, judged.unit).note(note).tone(tone)
        }))
        .section("The machine")
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
            ("Taken by the host meanwhile", format!("{:.2} s", machine.stolen_ticks as f64 * 0.01)),
        ])
        .list(&machine.means);
    if !findings.skipped.is_empty() {
        let why: Vec<_> =
            findings.skipped.iter().map(|s| format!("{}: {}", s.what, s.why)).collect();
        page = page.note(Tone::Caution, "Not measured", &why.join("; "));
    }
    page = page.section("Curves");
    for (_, caption, plot) in plots(findings) {
        page = page.figure(&caption, &plot);
    }
    page = page.section("Figures");
    for words in tables::tables(findings) {
        page = page.table(&table(&words));
    }
    page.footer(command).render()
}

fn yes(is: bool) -> String {
    if is { "yes" } else { "no" }.to_owned()
}

fn table(words: &Words) -> Table {
    let table = Table::new(words.title.clone(), words.heads.iter().map(String::as_str));
    words.rows.iter().fold(table, |table, row| {
        table.row(row.iter().map(|cell| report::Cell::from(cell.as_str())))
    })
}
