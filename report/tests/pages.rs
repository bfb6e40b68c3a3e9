//! Properties of every page, whatever its content: well-formed, escaped, finite, deterministic, of
//! bounded size.

#![expect(clippy::expect_used, reason = "a helper of tests may fail like a test")]

use proptest::prelude::*;
use report::{
    ArmPicture, ArmPoses, Axis, Bar, Bars, Cell, HeatMap, Histogram, InputFile, Multiples, Number,
    Page, Plot, Point, Provenance, Role, Series, Svg, Table, Tone, ToolError,
};

/// Every drawing, from the same texts and values.
fn drawings(text: &str, values: &[f64], log: bool) -> Vec<Svg> {
    let axis = || if log { Axis::new(text, text).log() } else { Axis::new(text, text) };
    let (a, b) =
        (values.first().copied().unwrap_or(f64::NAN), values.last().copied().unwrap_or(0.0));
    let points = || values.iter().copied().zip(values.iter().rev().copied());
    let signal = || values.iter().enumerate().map(|(i, value)| (i as f64, *value));
    let plot = || {
        Plot::new(text, axis(), axis().range(a, b))
            .series(Series::line(text, points()))
            .series(Series::dots(text, points()).role(Role::Before))
            .mark_x(a, text)
            .mark_y(b, text)
    };
    let bars = Bars::new(text, axis())
        .groups([text, text])
        .row(text, [Bar::new(a).between(b, a), Bar::new(b).between(a, b)])
        .row(text, values.iter().take(12).copied());
    let point =
        |i: usize| -> Point { std::array::from_fn(|k| values.get(i + k).copied().unwrap_or(a)) };
    let errors = || {
        (0..values.len()).map(|i| ToolError { at: point(i), before: point(i + 1), after: [b; 3] })
    };
    vec![
        ArmPicture::new(text, point(0)).joint(text, point(1), true).errors(errors()).render(),
        ArmPoses::new(text).pose(text, (0..values.len()).map(point)).pose(text, []).render(),
        plot().render(),
        plot().equal_scale().height(a).render(),
        Plot::new(text, axis(), axis()).series(Series::line(text, signal()).dashed()).render(),
        Multiples::new(text, 3)
            .plot(plot())
            .plot(plot())
            .plot(Plot::new(text, axis(), axis()))
            .render(),
        Histogram::new(text, axis()).values(text, values.iter().copied()).mark(a, text).render(),
        Histogram::new(text, axis()).counted(text, [(a, u64::MAX), (b, 1)]).log_share().render(),
        bars.render(),
        HeatMap::new(text, axis(), axis().range(a, b), axis())
            .cells(3, values.to_vec())
            .mark_x(a, text)
            .mark_y(b, text)
            .render(),
    ]
}

fn page(text: &str, values: &[f64], log: bool) -> Page {
    let number = values.first().copied().unwrap_or(f64::NAN);
    let cells = values.iter().map(|value| Cell::from(*value));
    let file = InputFile { name: text.to_owned(), sha256: text.to_owned() };
    let made = Provenance {
        files: vec![file; 6],
        date_utc: text.to_owned(),
        version: text.to_owned(),
        command: text.to_owned(),
    };
    let page = Page::new(text)
        .kicker(text)
        .robot(text)
        .provenance(made)
        .verdict(Tone::Good, text, text)
        .lead(text)
        .numbers([Number::new(text, number, text).note(text).tone(Tone::Bad)])
        .next(text, Some(text))
        .section(text)
        .section(text)
        .folded(text, |page| page.section(text).text(text))
        .text(text)
        .list([text])
        .note(Tone::Caution, text, text)
        .table(&Table::new(text, [text, text]).row([text.into(), number.into()]).row(cells))
        .facts([(text, text)])
        .code(text)
        .footer(text);
    drawings(text, values, log).iter().fold(page, |page, svg| page.figure(text, svg))
}

fn parse(html: &str) -> roxmltree::Document<'_> {
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    roxmltree::Document::parse_with_options(html, options).expect("well-formed")
}

/// Values of a broken instrument.
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
    fn any_words_come_out_as_they_went_in(text in any::<String>(), log in any::<bool>()) {
        let html = page(&text, &[1.0, 2.0, 5.0], log).render();
        let document = parse(&html);
        let title = document.descendants().find(|node| node.has_tag_name(("http://www.w3.org/1999/xhtml", "h1")));
        let shown = title.and_then(|node| node.text()).unwrap_or_default();
        prop_assert_eq!(shown.chars().count(), text.chars().count());
    }
}

/// How the link begins that saves a table.
const CSV: &str = "data:text/csv;charset=utf-8,";

#[test]
fn hostile_words_never_become_markup() {
    let hostile =
        "</title></svg><script src='https://evil.example/x.js' onload=\"alert(1)\">&lt;]]>";
    let html = page(hostile, &[1.0, 2.0], false).render();
    let document = parse(&html);
    assert!(document.descendants().all(|node| node.tag_name().name() != "script"));
    let attributes = || document.descendants().flat_map(|node| node.attributes());
    assert!(attributes().all(|attribute| !attribute.name().starts_with("on")));
    assert!(attributes().all(|attribute| attribute.name() != "src"));
    let mut links = attributes().filter(|attribute| attribute.name() == "href");
    assert!(
        links.all(|link| link.value().starts_with('#') || link.value().starts_with(CSV)),
        "links lead into the page alone, or save what stands in it"
    );
}

#[test]
fn a_page_asks_nothing_of_the_network() {
    let html = page("plain", &[1.0, 2.0], true).render();
    let style = html.split("<style>").nth(1).and_then(|rest| rest.split("</style>").next());
    let style = style.expect("one stylesheet");
    assert!(!style.contains("url(") && !style.contains("@import"));
    let names = ["http://www.w3.org/1999/xhtml", "http://www.w3.org/2000/svg"];
    let addresses = html.match_indices("http").map(|(index, _)| &html[index..]);
    assert!(
        addresses.into_iter().all(|address| names.iter().any(|name| address.starts_with(name)))
    );
}

#[test]
fn every_link_of_a_page_leads_to_a_place_of_its_own() {
    let html = page("Where it goes", &[1.0, 2.0], false).render();
    let document = parse(&html);
    let of = |name: &'static str| {
        let attributes = document.descendants().flat_map(|node| node.attributes());
        attributes.filter(move |a| a.name() == name).map(|a| a.value().to_owned())
    };
    let ids: Vec<String> = of("id").collect();
    let mut unlike = ids.clone();
    unlike.sort();
    unlike.dedup();
    assert_eq!(unlike.len(), ids.len(), "{ids:?}");
    let links: Vec<String> = of("href").filter(|link| !link.starts_with(CSV)).collect();
    assert!(links.len() > 3, "contents and ways back");
    assert!(links.iter().all(|link| ids.iter().any(|id| link[1..] == **id)), "{links:?}");
}

#[test]
fn the_first_screen_stands_before_the_contents_and_the_strip_before_all() {
    let html = page("words", &[1.0, 2.0], false).render();
    let place = |what: &str| html.find(what).unwrap_or_else(|| panic!("{what}"));
    let order = [
        "class=\"strip\"",
        "class=\"verdict good\"",
        "class=\"numbers\"",
        "class=\"next\"",
        "class=\"contents\"",
        "<h2",
    ];
    assert!(order.map(place).is_sorted(), "{:?}", order.map(place));
}

#[test]
fn what_is_good_and_what_is_bad_differ_by_a_sign_too() {
    let number = |tone| Page::new("").numbers([Number::new("n", 1.0, "").tone(tone)]).render();
    let verdict = |tone| Page::new("").verdict(tone, "word", "sentence").render();
    for made in [&number as &dyn Fn(Tone) -> String, &verdict] {
        assert!(made(Tone::Good).contains(">✓<") && made(Tone::Bad).contains(">✗<"));
        assert!(made(Tone::Caution).contains(">!<") && !made(Tone::Plain).contains("\"sign\""));
    }
}

/// The colours of a block of the stylesheet by their names, each channel 0 to 1.
fn colours(block: &str) -> Vec<(String, [f64; 3])> {
    let declaration = |one: &str| {
        let (name, value) = one.trim().strip_prefix("--")?.split_once(':')?;
        let hex = value.trim().strip_prefix('#')?;
        let channel = |k: usize| {
            Some(f64::from(u8::from_str_radix(hex.get(2 * k..2 * k + 2)?, 16).ok()?) / 255.0)
        };
        Some((name.to_owned(), [channel(0)?, channel(1)?, channel(2)?]))
    };
    block.split([';', '{', '}']).filter_map(declaration).collect()
}

/// WCAG 2.2: the ratio of relative luminances.
fn contrast(one: [f64; 3], other: [f64; 3]) -> f64 {
    let luminance = |colour: [f64; 3]| {
        let linear =
            colour.map(|c| if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) });
        0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    };
    let (a, b) = (luminance(one), luminance(other));
    (a.max(b) + 0.05) / (a.min(b) + 0.05)
}

#[test]
fn every_colour_that_says_something_stands_out_from_the_paper_in_light_and_in_dark() {
    let style = include_str!("../src/style.css");
    let (light, dark) =
        style.split_once("@media screen and (prefers-color-scheme: dark)").expect("both");
    let dark = dark.split_once("* { box-sizing").expect("the end of the colours").0;
    // Dots are drawn so opaque; behind them is paper.
    let opaque = style
        .split_once(".dots {")
        .and_then(|(_, rest)| rest.split_once("opacity: "))
        .expect("dots")
        .1;
    let opaque: f64 = opaque.split(';').next().and_then(|x| x.parse().ok()).expect("a number");
    for (mode, block) in [("light", light), ("dark", dark)] {
        let all = colours(block);
        let of = |name: &str| all.iter().find(|(known, _)| known == name).expect("a colour").1;
        let paper = of("paper");
        let roles = ["before", "calibrated", "after", "truth"].map(str::to_owned);
        let others = (1..=8).map(|k| format!("c{k}"));
        for name in roles.into_iter().chain(others) {
            let drawn = of(&name);
            let dot = std::array::from_fn(|k| opaque * drawn[k] + (1.0 - opaque) * paper[k]);
            let contrast_min = contrast(drawn, paper).min(contrast(dot, paper));
            assert!(contrast_min >= 3.0, "{mode} {name}: {contrast_min:.2}");
        }
        for name in ["ink", "soft", "good", "caution", "bad", "accent"] {
            let contrast_min = contrast(of(name), paper).min(contrast(of(name), of("panel")));
            assert!(contrast_min >= 4.5, "{mode} text {name}: {contrast_min:.2}");
        }
    }
}

#[test]
fn text_of_a_drawing_for_a_phone_is_no_smaller_than_12_px() {
    let style = include_str!("../src/style.css");
    let sizes =
        style.lines().filter(|line| line.starts_with(".plot") && line.contains("font-size"));
    let size =
        |line: &str| line.split_once("font-size: ")?.1.split("px").next()?.parse::<f64>().ok();
    let font_size_min = sizes.filter_map(size).fold(f64::INFINITY, f64::min);
    for svg in drawings("tool error", &[1.0, 3.0, 2.0], false) {
        let document = parse(svg.narrow());
        let view_box = document.root_element().attribute("viewBox").expect("a viewBox");
        let width_px: f64 =
            view_box.split(' ').nth(2).and_then(|w| w.parse().ok()).expect("a width");
        // A screen of 376 px with margins of 20 px on each side.
        assert!(
            font_size_min * (376.0 - 40.0) / width_px >= 12.0,
            "{font_size_min} px in {width_px}"
        );
    }
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
        let child = |name: &str| root.children().find(|node| node.tag_name().name() == name);
        assert_eq!(child("title").and_then(|node| node.text()), Some("tool error"));
        assert!(child("desc").and_then(|node| node.text()).is_some_and(|text| text.len() > 20));
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
