//! The report as a page: what grows, and a small multiple of every series that changes; the others behind a summary.

use report::{Axis, Cell, Multiples, Number, Page, Plot, Provenance, Role, Series, Table, Tone};

use crate::change::ChangeKind;
use crate::fleet::{Alert, Answer, SearchedSeries};
use crate::likelihood::Reading;
use crate::text::{headline, number_and_unit, place, sentence};
use crate::time::months;

/// Small multiples side by side.
const COLUMNS: usize = 3;
/// Series without a change that are drawn, at most; those that changed most probably.
const UNCHANGED: usize = 60;

/// The page.
#[must_use]
pub fn page(answer: &Answer, provenance: Provenance) -> String {
    let (tone, label) = match answer.alerts.len() {
        0 => (Tone::Good, "No effect is growing"),
        _ => (Tone::Bad, "An effect is growing"),
    };
    let mut page = Page::new("Trends of a fleet").kicker("trued trends").provenance(provenance);
    page = page.verdict(tone, label, &headline(answer)).numbers(numbers(answer));
    page = answer.alerts.iter().fold(page, |page, alert| {
        page.note(Tone::Bad, &format!("{}: {}", alert.robot, place(alert)), &sentence(alert))
    });
    let mut reported: Vec<&SearchedSeries> =
        answer.searched.iter().filter(|one| one.is_reported).collect();
    reported.sort_by(|a, b| b.change.log_bayes.total_cmp(&a.change.log_bayes));
    let mut still: Vec<&SearchedSeries> =
        answer.searched.iter().filter(|one| !one.is_reported).collect();
    still.sort_by(|a, b| b.change.log_bayes.total_cmp(&a.change.log_bayes));
    if !reported.is_empty() {
        page = page
            .section("Changing series")
            .figure(CAPTION, &drawn("Series that change", &reported));
    }
    if !answer.alerts.is_empty() || !answer.decreases.is_empty() {
        let all = answer.alerts.iter().chain(&answer.decreases);
        page = page.table(&changes(all));
    }
    page = page.section("Robots").table(&robots(answer));
    if !still.is_empty() {
        let some = &still[..still.len().min(UNCHANGED)];
        let caption = format!(
            "{CAPTION} The {} of {} series without a reported change that changed most probably.",
            some.len(),
            still.len()
        );
        let svg = drawn("Series without a change", some);
        page = page
            .section("Unchanged series")
            .folded("Every series", |page| page.figure(&caption, &svg));
    }
    page.section("How it was computed").text(METHOD).render()
}

const CAPTION: &str = "One parameter of one effect over the months since the robot's first recording. Dots: found. Strokes at the limit: not found, so the parameter is smaller. Line: the most probable mean.";

const METHOD: &str = "Each series is compared with a constant, a step and a growth that begins at some recording, by Bayes factors; the time of the change is \
     averaged over all recordings, the scatter between recordings is estimated with it, and ambient temperature is taken out where it was recorded. Recordings in \
     which an effect was not found bound it, unless they name another effect in its place. Every series has the same prior probability of a change, so that more \
     series ask for more evidence.";

fn numbers(answer: &Answer) -> Vec<Number> {
    let recordings: usize = answer.robots.iter().map(|robot| robot.recordings).sum();
    let robots = answer.robots.iter().filter(|robot| robot.alerts > 0).count();
    let tone = if robots == 0 { Tone::Good } else { Tone::Bad };
    vec![
        Number::text("Robots with an alert", format!("{robots} of {}", answer.robots.len()))
            .tone(tone),
        Number::text("Alerts", answer.alerts.len().to_string()),
        Number::text("Recordings", recordings.to_string()),
        Number::text("Series", answer.series.to_string()),
    ]
}

fn drawn(title: &str, series: &[&SearchedSeries]) -> report::Svg {
    let multiples = Multiples::new(title, COLUMNS).own_y();
    series.iter().fold(multiples, |multiples, one| multiples.plot(plot(one))).render()
}

fn plot(one: &SearchedSeries) -> Plot {
    let number = &one.series.number;
    let observations = &one.series.observations;
    let (name, unit) = number_and_unit(&number.parameter);
    let index = number.index.map_or(String::new(), |index| format!(" {index}"));
    let joint = number.joint.map_or(String::new(), |joint| format!(" {joint}"));
    let form = number.form.map_or(String::new(), |form| format!(" ({form})"));
    let title = format!(
        "{}: {}{joint}{form}, {name}{index}",
        number.robot,
        number.effect.replace('_', " ")
    );
    let start = observations.first().map_or(0, |one| one.at_us);
    let month_of = |at_us: i64| months(start, at_us);
    let found = observations.iter().filter_map(|one| match one.reading {
        Reading::Value { value, .. } => Some((month_of(one.at_us), value)),
        Reading::Below { .. } => None,
    });
    let sign = one.change.now.value.signum();
    let below = observations.iter().filter_map(|one| match one.reading {
        Reading::Below { limit, .. } => Some((month_of(one.at_us), sign * limit)),
        Reading::Value { .. } => None,
    });
    let plot = Plot::new(title, Axis::new("Time", "months"), Axis::new(name, unit))
        .series(Series::dots("found", found).role(Role::After))
        .series(Series::dots("not found: smaller than", below).role(Role::Before));
    if one.is_reported {
        plot.series(Series::line("mean", mean(one)).role(Role::Calibrated))
    } else {
        plot
    }
}

/// The corners of the mean, in months.
fn mean(one: &SearchedSeries) -> Vec<(f64, f64)> {
    let (change, observations) = (&one.change, &one.series.observations);
    let start = observations.first().map_or(0, |one| one.at_us);
    let month_of =
        |index: usize| observations.get(index).map_or(0.0, |one| months(start, one.at_us));
    let end = month_of(observations.len().saturating_sub(1));
    let before = change.before.value;
    let corner = match change.kind {
        ChangeKind::Step => {
            vec![(month_of(change.first[0]), before), (month_of(change.first[0]), change.now.value)]
        }
        ChangeKind::Growth => vec![(month_of(change.first[0].saturating_sub(1)), before)],
    };
    let (first, last) = ((0.0, before), (end, change.now.value));
    std::iter::once(first).chain(corner).chain(std::iter::once(last)).collect()
}

fn changes<'a>(alerts: impl Iterator<Item = &'a Alert>) -> Table {
    let heads = [
        "Robot",
        "Effect",
        "Parameter",
        "Kind",
        "Since",
        "Probability",
        "Before",
        "Now",
        "Change or per month",
    ];
    alerts.fold(Table::new("Changes", heads), |table, alert| {
        let change = alert.per_month.or(alert.step).map_or(f64::NAN, |interval| interval.value);
        table.row([
            Cell::from(alert.robot.as_str()),
            Cell::from(place(alert)),
            Cell::from(alert.parameter.as_str()),
            Cell::from(alert.kind),
            Cell::from(alert.since.day.as_str()),
            Cell::from(format!("{:.3}", alert.probability.min(0.999))),
            Cell::from(alert.before.value),
            Cell::from(alert.now.value),
            Cell::from(change),
        ])
    })
}

fn robots(answer: &Answer) -> Table {
    let heads =
        ["Robot", "Recordings", "Refused", "Without time", "From", "To", "Series", "Alerts"];
    answer.robots.iter().fold(Table::new("Robots", heads), |table, robot| {
        let date = |date: &Option<String>| Cell::from(date.clone().unwrap_or_default());
        table.row([
            Cell::from(robot.robot.as_str()),
            Cell::from(robot.recordings as f64),
            Cell::from(robot.refused as f64),
            Cell::from(robot.without_time as f64),
            date(&robot.from),
            date(&robot.to),
            Cell::from(robot.series as f64),
            Cell::from(robot.alerts as f64),
        ])
    })
}
