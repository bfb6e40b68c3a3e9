//! What every page promises, whatever is put on it: well-formed, escaped, finite, deterministic, of bounded size.

#![expect(clippy::expect_used, reason = "a helper of tests may fail like a test")]

use proptest::prelude::*;
use report::{
    Axis, Bar, Bars, Cell, HeatMap, Histogram, Multiples, Number, Page, Plot, Series, Svg, Table,
    Tone,
};

/// Everything there is to draw, from the same words and values.
fn drawings(words: &str, values: &[f64], log: bool) -> Vec<Svg> {
    let axis = || if log { Axis::new(words, words).log() } else { Axis::new(words, words) };
    let (a, b) =
        (values.first().copied().unwrap_or(f64::NAN), values.last().copied().unwrap_or(0.0));
    let points = || values.iter().copied().zip(values.iter().rev().copied());
    let signal = || values.iter().enumerate().map(|(i, value)| (i as f64, *value));
    let plot = || {
        Plot::new(words, axis(), axis().range(a, b))
            .series(Series::line(words, points()))
            .series(Series::dots(words, points()).muted())
            .mark_x(a, words)
            .mark_y(b, words)
    };
    let bars = Bars::new(words, axis())
        .groups([words, words])
        .row(words, [Bar::new(a).between(b, a), Bar::new(b).between(a, b)])
        .row(words, values.iter().take(12).copied());
    vec![
        plot().render(),
        plot().equal_scale().height(a).render(),
        Plot::new(words, axis(), axis()).series(Series::line(words, signal()).dashed()).render(),
        Multiples::new(words, 3)
            .plot(plot())
            .plot(plot())
            .plot(Plot::new(words, axis(), axis()))
            .render(),
        Histogram::new(words, axis()).values(words, values.iter().copied()).mark(a, words).render(),
        Histogram::new(words, axis()).counted(words, [(a, u64::MAX), (b, 1)]).log_share().render(),
        bars.render(),
        HeatMap::new(words, axis(), axis().range(a, b), axis())
            .cells(3, values.to_vec())
            .mark_x(a, words)
            .mark_y(b, words)
            .render(),
    ]
}

fn page(words: &str, values: &[f64], log: bool) -> Page {
    let number = values.first().copied().unwrap_or(f64::NAN);
    let cells = values.iter().map(|value| Cell::from(*value));
    let page = Page::new(words)
        .kicker(words)
        .lead(words)
        .numbers([Number::new(words, number, words).note(words).tone(Tone::Bad)])
        .section(words)
        .text(words)
        .list([words])
        .note(Tone::Caution, words, words)
        .table(&Table::new(words, [words, words]).row([words.into(), number.into()]).row(cells))
        .facts([(words, words)])
        .code(words)
        .footer(words);
    drawings(words, values, log).iter().fold(page, |page, svg| page.figure(words, svg))
}

fn parse(html: &str) -> roxmltree::Document<'_> {
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    roxmltree::Document::parse_with_options(html, options).expect("well-formed")
}

/// Values as they come from a broken instrument.
fn value() -> impl Strategy<Value = f64> {
    prop_oneof![
        any::<f64>(),
        -10.0..10.0_f64,
        prop::sample::select(vec![
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::MAX,
            f64::MIN,
            f64::MIN_POSITIVE,
            5e-324,
            0.0,
            -0.0,
            1e300,
            -1e300,
        ]),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(192))]

    #[test]
    fn any_values_make_a_well_formed_page_without_nan(values in prop::collection::vec(value(), 0..40), log in any::<bool>()) {
        let html = page("words", &values, log).render();
        parse(&html);
        for drawing in drawings("words", &values, log) {
            parse(&drawing.file());
        }
        for bad in ["NaN", "inf", "Infinity", "e+", "undefined"] {
            prop_assert!(!html.contains(bad), "{bad}");
        }
    }

    #[test]
    fn any_words_come_out_as_they_went_in(words in any::<String>(), log in any::<bool>()) {
        let html = page(&words, &[1.0, 2.0, 5.0], log).render();
        let document = parse(&html);
        let title = document.descendants().find(|node| node.has_tag_name(("http://www.w3.org/1999/xhtml", "h1")));
        let shown = title.and_then(|node| node.text()).unwrap_or_default();
        prop_assert_eq!(shown.chars().count(), words.chars().count());
    }
}

#[test]
fn hostile_words_never_become_markup() {
    let hostile =
        "</title></svg><script src='https://evil.example/x.js' onload=\"alert(1)\">&lt;]]>";
    let html = page(hostile, &[1.0, 2.0], false).render();
    let document = parse(&html);
    assert!(document.descendants().all(|node| node.tag_name().name() != "script"));
    let attributes = || document.descendants().flat_map(|node| node.attributes());
    assert!(attributes().all(|attribute| !attribute.name().starts_with("on")));
    assert!(attributes().all(|attribute| !matches!(attribute.name(), "src" | "href")));
}

#[test]
fn a_page_asks_nothing_of_the_network() {
    let html = page("plain", &[1.0, 2.0], true).render();
    let style = html.split("<style>").nth(1).and_then(|rest| rest.split("</style>").next());
    let style = style.expect("one stylesheet");
    assert!(!style.contains("url(") && !style.contains("@import"));
    let names = ["http://www.w3.org/1999/xhtml", "http://www.w3.org/2000/svg"];
    let addresses = html.match_indices("http").map(|(at, _)| &html[at..]);
    assert!(
        addresses.into_iter().all(|address| names.iter().any(|name| address.starts_with(name)))
    );
}

#[test]
fn nothing_at_all_is_drawn_without_a_panic() {
    let html = page("", &[], false).render();
    parse(&html);
    parse(Multiples::new("", 0).render().as_str());
    parse(Bars::new("", Axis::new("", "")).render().as_str());
}

#[test]
fn every_drawing_says_in_words_what_it_shows() {
    for svg in drawings("tool error", &[1.0, 3.0, 2.0], false) {
        let document = parse(svg.as_str());
        let root = document.root_element();
        assert_eq!(root.attribute("role"), Some("img"));
        let told = |name: &str| root.children().find(|node| node.tag_name().name() == name);
        assert_eq!(told("title").and_then(|node| node.text()), Some("tool error"));
        assert!(told("desc").and_then(|node| node.text()).is_some_and(|text| text.len() > 20));
    }
}

#[test]
fn the_same_input_gives_the_same_bytes() {
    let values: Vec<f64> = (0..20_000).map(|i| f64::from(i * 7919 % 1000)).collect();
    assert_eq!(page("a", &values, true).render(), page("a", &values, true).render());
}

#[test]
fn a_million_points_make_a_small_drawing() {
    let noise = |i: u32| f64::from(i.wrapping_mul(2_654_435_761) >> 8);
    let axis = || Axis::new("", "");
    let signal = Series::line("", (0..1_000_000).map(|i| (f64::from(i), noise(i))));
    let scatter = Series::dots("", (0..1_000_000).map(|i| (noise(i), noise(i + 77))));
    let drawn = Plot::new("", axis(), axis()).series(signal).series(scatter).render();
    assert!(drawn.as_str().len() < 200_000, "{}", drawn.as_str().len());
}
