//! The page of `trued challenge`: all figures, success over effect-to-noise ratio, and confusions.

use challenge::score::ChallengeStatistics;
use report::{
    Axis, Bar, Bars, Cell, Histogram, Number, Page, Plot, Role, Series, Svg, Table, Tone,
};

use crate::ScoredChallenge;
use crate::text::{range, rows, share};

impl ScoredChallenge {
    /// The score as a page.
    #[must_use]
    pub fn page(&self) -> Page {
        let figures = &self.figures;
        let mut page = first_screen(figures);
        page = page.section("All figures").table(&all(figures)).section("By strength");
        page = page
            .table(&ranges(figures))
            .section("By effect")
            .figure("Correct first answers, single effects.", &by_effect(figures));
        page = page.table(&confused(figures));
        let counted = self.outcomes.iter().filter(|outcome| outcome.is_scored());
        let shares: Vec<f64> =
            counted.filter_map(|outcome| outcome.errors?.relative_gain()).collect();
        if !shares.is_empty() {
            let held = shares.iter().map(|share| share.clamp(-1.0, 1.2));
            let plot = Histogram::new("Gain", Axis::new("Share of the oracle's gain", "1"))
                .values("cases", held);
            page = page.section("Gain on a motion that was not recorded").figure(
                "Error reduction by the written model, relative to that by the true form with fitted parameters; limited to −1 and 1.2.",
                &plot.render(),
            );
        }
        if figures.calibration.iter().any(|bin| bin.claims > 0) {
            page = page.section("Confidence").table(&calibration(figures));
        }
        page.text(&format!("SHA-256 of the truth: {}", figures.sealed_sha256))
            .text(&format!("SHA-256 of the answers: {}", figures.answers_sha256))
    }
}

fn first_screen(figures: &ChallengeStatistics) -> Page {
    Page::new("Blind challenge")
        .kicker("trued challenge")
        .verdict(
            Tone::Plain,
            "blind cases scored",
            &format!(
                "{} cases of seed {}; the truth was sealed before the answers. Correct first answers: {}; false findings: {} of {}.",
                figures.cases,
                figures.seed,
                share(figures.first_right),
                figures.false_findings,
                figures.nulls
            ),
        )
        .numbers([
            Number::text("First answer right", share(figures.first_right)),
            Number::text(
                "False findings",
                format!("{} of {}", figures.false_findings, figures.nulls),
            ),
            Number::text("Wrong names", share(figures.named_wrong)),
            Number::text("Unknown recognised", share(figures.unknown_recognised)),
        ])
        .figure(
            "First answer right over z, the strength of what was hidden against the noise; each dot a range of cases that count towards a bar.",
            &by_z(figures),
        )
        .next(
            "Draw other cases: another seed is another sealed truth.",
            Some(&format!("trued challenge --cases {} --seed {} --out challenge-2", figures.cases, figures.seed + 1)),
        )
}

fn all(figures: &ChallengeStatistics) -> Table {
    let table = Table::new("All figures", ["What", "Figure", "Of cases"]);
    rows(figures).into_iter().fold(table, |table, (what, figure, cases)| {
        table.row([Cell::Text(what), Cell::Text(figure), Cell::Number(cases as f64)])
    })
}

fn by_z(figures: &ChallengeStatistics) -> Svg {
    let middle = |from: f64, to: Option<f64>| (from * to.unwrap_or(2.0 * from)).sqrt();
    let points = |right: fn(&challenge::score::Bin) -> Option<f64>| {
        let bins = figures.by_z.iter();
        bins.filter_map(move |bin| Some((middle(bin.from, bin.to), 100.0 * right(bin)?)))
            .collect::<Vec<_>>()
    };
    Plot::new(
        "Right over strength",
        Axis::new("z", "1").log(),
        Axis::new("Right", "%").range(0.0, 103.0),
    )
    .series(Series::line("first answer", points(|bin| bin.first_right)).role(Role::After))
    .series(
        Series::line("among the first three", points(|bin| bin.first_three_right))
            .role(Role::Before),
    )
    .mark_y(90.0, "90 %")
    .render()
}

fn ranges(figures: &ChallengeStatistics) -> Table {
    let table = Table::new("By range", ["Range", "Cases", "First right", "Among three"]);
    let named = [("ρ", &figures.by_effect_to_noise), ("z", &figures.by_z)];
    named.into_iter().flat_map(|(what, bins)| bins.iter().map(move |bin| (what, bin))).fold(
        table,
        |table, (what, bin)| {
            table.row([
                Cell::Text(format!("{what} {}", range(bin))),
                Cell::Number(bin.cases as f64),
                Cell::Text(share(bin.first_right)),
                Cell::Text(share(bin.first_three_right)),
            ])
        },
    )
}

fn by_effect(figures: &ChallengeStatistics) -> Svg {
    let bars = Bars::new("By effect", Axis::new("First answer right", "%")).groups(["right"]);
    let rows = figures.by_effect.iter().filter(|entry| entry.cases > 0);
    rows.fold(bars, |bars, entry| {
        let right = 100.0 * entry.right as f64 / entry.cases as f64;
        bars.row(format!("{} ({})", entry.effect, entry.cases), [Bar::new(right)])
    })
    .render()
}

fn confused(figures: &ChallengeStatistics) -> Table {
    let table = Table::new("What was said instead", ["Effect", "Cases", "Right", "Instead"]);
    figures.by_effect.iter().filter(|entry| entry.right < entry.cases).fold(
        table,
        |table, entry| {
            let instead = entry.instead.iter().map(|(name, count)| format!("{name} {count}"));
            table.row([
                Cell::from(entry.effect),
                Cell::Number(entry.cases as f64),
                Cell::Number(entry.right as f64),
                Cell::Text(instead.collect::<Vec<_>>().join(", ")),
            ])
        },
    )
}

fn calibration(figures: &ChallengeStatistics) -> Table {
    let table = Table::new("Confidence against truth", ["Said", "Claims", "Mean said", "Right"]);
    figures.calibration.iter().filter(|bin| bin.claims > 0).fold(table, |table, bin| {
        table.row([
            Cell::Text(format!("{} to {:.2}", bin.from, bin.to)),
            Cell::Number(bin.claims as f64),
            Cell::Text(share(bin.said)),
            Cell::Text(share(bin.right)),
        ])
    })
}
