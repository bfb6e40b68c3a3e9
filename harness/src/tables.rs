//! Results as text tables.

use crate::chunks::BackToBack;
use crate::cost::{Cost, CostSeries};
use crate::findings::{Findings, Setting};
use crate::latencies::Quantiles;
use crate::peers::Transport;

/// How a table is written to a terminal.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum TextLayout {
    /// In columns; on a narrow terminal without those of [`OMITTED_IF_NARROW`].
    #[default]
    Columns,
    /// In columns, the last of which is a sentence that may be wrapped.
    Sentences,
    /// At a terminal its title alone, which says the result; the rows are on the page and in the JSON.
    TitleOnly,
}

/// Columns of quantiles that a narrow terminal does not show; they are on the page and in the JSON.
pub const OMITTED_IF_NARROW: [&str; 3] = ["p90", "p99.99", "p99.999"];

/// A table: title, column heads, rows.
#[derive(Debug, Clone, Default)]
pub struct BenchTable {
    /// Title.
    pub title: String,
    /// Heads of the columns.
    pub heads: Vec<String>,
    /// Cells.
    pub rows: Vec<Vec<String>>,
    /// How it is written to a terminal.
    pub layout: TextLayout,
}

impl BenchTable {
    /// The table without these columns.
    #[must_use]
    pub fn without(&self, heads: &[&str]) -> Self {
        let stays: Vec<bool> =
            self.heads.iter().map(|head| !heads.contains(&head.as_str())).collect();
        let kept = |cells: &Vec<String>| {
            let cells = cells.iter().zip(&stays).filter(|(_, stays)| **stays);
            cells.map(|(cell, _)| cell.clone()).collect::<Vec<String>>()
        };
        Self {
            heads: kept(&self.heads),
            rows: self.rows.iter().map(kept).collect(),
            ..self.clone()
        }
    }
}

const QUANTILES: [&str; 8] = ["p50", "p90", "p99", "p99.9", "p99.99", "p99.999", "worst", "n"];

/// All tables, in the order of reading.
#[must_use]
pub fn tables(findings: &Findings) -> Vec<BenchTable> {
    let mut tables = Vec::new();
    for setting in &findings.settings {
        let under = setting.name();
        if let Some(flat) = &setting.flat {
            tables.push(trips(
                format!(
                    "Round trip at maximum rate, polled on both sides, µs ({under}){}",
                    solved(flat)
                ),
                flat,
            ));
        }
        if let Some(woken) = &setting.woken {
            let title = format!(
                "Round trip with kernel wake-up, µs ({under}); trued's daemon has no such wake-up, it polls or sleeps"
            );
            tables.push(trips(title, woken));
        }
        if !setting.paced.is_empty() {
            tables.push(paced(setting));
            tables.push(counts(setting));
        }
        tables.extend(force(setting));
    }
    tables.extend(once(findings));
    tables.extend(findings.cost.iter().flat_map(costs));
    if !findings.judged.is_empty() {
        tables.push(judged(findings));
    }
    if !findings.skipped.is_empty() {
        tables.push(skipped(findings));
    }
    tables
}

fn with_quantiles(title: String, first: &[&str]) -> BenchTable {
    let heads = first.iter().chain(&QUANTILES).map(|head| (*head).to_owned()).collect();
    BenchTable { title, heads, ..BenchTable::default() }
}

/// A duration in µs, with meaningful digits.
#[must_use]
pub fn microseconds(ns: u64) -> String {
    let us = ns as f64 * 1e-3;
    if us < 10.0 {
        format!("{us:.2}")
    } else if us < 100.0 {
        format!("{us:.1}")
    } else {
        format!("{us:.0}")
    }
}

fn cells(first: &[&str], quantiles: &Quantiles) -> Vec<String> {
    let sure = quantiles
        .supported_quantiles()
        .map(|value| value.map_or_else(|| "–".to_owned(), microseconds));
    let mut cells: Vec<String> = first.iter().map(|cell| (*cell).to_owned()).collect();
    cells.extend(sure);
    let worst = if quantiles.n == 0 { "–".to_owned() } else { microseconds(quantiles.max) };
    cells.extend([worst, quantiles.n.to_string()]);
    cells
}

/// Share of the daemon's answers with a solved correction.
fn solved(flat: &BackToBack) -> String {
    let share = flat.solved_share();
    share.map_or_else(String::new, |share| {
        format!("; solved for {:.1} % of trued's answers", 100.0 * share)
    })
}

fn trips(title: String, flat: &BackToBack) -> BenchTable {
    let mut table = with_quantiles(title, &["", "cores"]);
    let two = flat.sorter.threshold_ns.is_some();
    for (kind, counted) in Transport::ALL.into_iter().zip(&flat.counted) {
        let rows = if two {
            vec![("near", &counted.near), ("far", &counted.far)]
        } else {
            vec![("", &counted.all)]
        };
        for (cores, latencies) in rows.into_iter().filter(|(_, l)| l.count() > 0) {
            table.rows.push(cells(&[kind.description(), cores], &latencies.quantiles()));
        }
    }
    if flat.correction.count() > 0 {
        for (name, counted) in
            [("  of which correction", &flat.correction), ("  of which transport", &flat.around)]
        {
            table.rows.push(cells(&[name, ""], &counted.quantiles()));
        }
    }
    table
}

fn paced(setting: &Setting) -> BenchTable {
    let title = format!("At fixed rates, command to answer, µs ({})", setting.name());
    let mut table = with_quantiles(title, &["rate", "daemon by", "from"]);
    for run in &setting.paced {
        let (rate, wait) = (format!("{} Hz", run.rate_hz), run.wait.name());
        for (from, counted) in [
            ("schedule", &run.paced.scheduled),
            ("sending", &run.paced.actual),
            ("empty cycle, its wake-up", &run.paced.empty),
        ] {
            table.rows.push(cells(&[&rate, wait, from], &counted.quantiles()));
        }
    }
    table
}

fn counts(setting: &Setting) -> BenchTable {
    let heads = [
        "rate",
        "daemon by",
        "cycles",
        "missed",
        "without answer",
        "empty cycle missed",
        "missed beyond it",
    ];
    let rows = setting.paced.iter().map(|run| {
        let p = &run.paced;
        let numbers = [p.cycles, p.missed, p.unanswered, p.empty_missed, p.missed_beyond_empty];
        let mut cells = vec![format!("{} Hz", run.rate_hz), run.wait.name().to_owned()];
        cells.extend(numbers.map(|number| number.to_string()));
        cells
    });
    BenchTable {
        title: format!(
            "Missed cycles ({}): answered after the next command was due",
            setting.name()
        ),
        heads: heads.map(str::to_owned).to_vec(),
        rows: rows.collect(),
        layout: TextLayout::Columns,
    }
}

fn force(setting: &Setting) -> Option<BenchTable> {
    let force = setting.force.as_ref()?;
    let title = format!(
        "Force block to verdict, µs ({}); {} blocks played, {} taken, {} not handed over",
        setting.name(),
        force.blocks,
        force.taken,
        force.lost
    );
    let mut table = with_quantiles(title, &["from"]);
    for (from, counted) in [
        ("schedule", &force.scheduled),
        ("sending", &force.actual),
        ("sending, to the verdict's making", &force.one_way),
    ] {
        table.rows.push(cells(&[from], &counted.quantiles()));
    }
    Some(table)
}

fn once(findings: &Findings) -> Vec<BenchTable> {
    let mut tables = Vec::new();
    if let Some(starts) = &findings.starts {
        let mut table =
            with_quantiles("Start of a daemon to its first corrected target, µs".into(), &[""]);
        table.rows.push(cells(&["starts"], &starts.quantiles()));
        tables.push(table);
    }
    if let Some(swap) = &findings.swap {
        let p = &swap.paced;
        let facts = [
            ("swaps", swap.swaps.to_string()),
            ("cycles meanwhile", p.cycles.to_string()),
            ("missed, and by the empty cycle", format!("{}, {}", p.missed, p.empty_missed)),
            (
                "largest step of the correction over its bound",
                format!("{:.3}", swap.step_over_bound),
            ),
            (
                "largest step of the requested correction, mrad",
                format!("{:.3}", swap.jump_wanted * 1e3),
            ),
        ];
        let rows = facts.into_iter().map(|(name, value)| vec![name.to_owned(), value]).collect();
        let heads = vec![String::new(), String::new()];
        tables.push(BenchTable {
            title: "Models swapped during a running path, 1 kHz".into(),
            heads,
            rows,
            layout: TextLayout::Columns,
        });
    }
    tables
}

/// For each kind of cost: its name, description, additional column, figures.
pub(crate) fn kinds(cost: &Cost) -> [(&'static str, String, &'static str, &CostSeries); 3] {
    let correction = "Time of one correction, µs (lowest median of batches)".to_owned();
    let of_six = format!("{correction}, six joints");
    let rate_hz = cost.cell_rate_hz;
    let in_all =
        format!("Processor time of one daemon, µs per second, each cell commanded at {rate_hz} Hz");
    [
        ("joints", correction, "steps of the solve", &cost.joints),
        ("effects", of_six, "steps of the solve", &cost.effects),
        ("cells", in_all, "commands without answer", &cost.cells),
    ]
}

fn costs(cost: &Cost) -> Vec<BenchTable> {
    let table = |(name, what, beside, costs): (&str, String, &str, &CostSeries)| {
        let line = &costs.line;
        let row = |point: &crate::cost::CostPoint| {
            let deviation = 100.0 * (point.cost_us / line.at(point.n) - 1.0);
            let numbers = [format!("{:.2}", point.cost_us), format!("{deviation:+.1} %")];
            let mut cells = vec![point.n.to_string()];
            cells.extend(numbers);
            cells.push(point.beside.to_string());
            cells
        };
        let title = format!(
            "{what}: {:.3} and {:.3} for each of the {name}; the worst, at {}, is {:.1} % off the line",
            line.none_us,
            line.slope_us,
            line.worst_at,
            100.0 * line.worst
        );
        let heads = [name, "cost, µs", "off the line", beside].map(str::to_owned).to_vec();
        let rows = costs.points.iter().map(row).collect();
        BenchTable { title, heads, rows, layout: TextLayout::TitleOnly }
    };
    kinds(cost).map(table).to_vec()
}

fn judged(findings: &Findings) -> BenchTable {
    let rows = findings.judged.iter().map(|judged| {
        let unit = if judged.unit.is_empty() { String::new() } else { format!(" {}", judged.unit) };
        let digits = if judged.measured.fract() == 0.0 { 0 } else { 2 };
        let measured = format!("{:.digits$}{unit}", judged.measured);
        let verdict = if judged.ok { "✓ held" } else { "✗ missed" };
        vec![verdict.to_owned(), measured, format!("{}{unit}", judged.bar), judged.what.clone()]
    });
    BenchTable {
        title: "Compared with the limits".to_owned(),
        heads: ["", "measured", "at most", "limit of"].map(str::to_owned).to_vec(),
        rows: rows.collect(),
        layout: TextLayout::Sentences,
    }
}

fn skipped(findings: &Findings) -> BenchTable {
    let rows = findings.skipped.iter().map(|s| vec![s.what.clone(), s.why.clone()]);
    BenchTable {
        title: format!("NOT MEASURED: {}", findings.skipped.len()),
        heads: ["", "why"].map(str::to_owned).to_vec(),
        rows: rows.collect(),
        layout: TextLayout::Sentences,
    }
}
