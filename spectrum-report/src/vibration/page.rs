//! Vibrations of a recording as a page: time and cause, spectra over time and path, sensor status.

use report::{Column, Number, Page, Table, Tone, fixed, pluralise, significant};

use super::analysis::Analysis;
use super::input::Source;
use super::monitor::Episode;
use super::path::PathSpectra;
use super::plots;
use super::text::{self, class_and_rivals, hz};
use crate::error::Error;
use spectrum::Class;

/// Maximum number of rows of a table.
const ROWS: usize = 40;

impl Analysis {
    /// The page.
    ///
    /// # Errors
    /// [`Error::File`] if samples that remained in the file cannot be read.
    pub fn page(&self) -> Result<Page, Error> {
        render(self)
    }
}

fn render(analysis: &Analysis) -> Result<Page, Error> {
    let channel = plots::shown(analysis);
    let name = &analysis.source.channels[channel].name;
    let rings = analysis.has_alarm();
    let monitored = analysis.is_monitored();
    let tone = match (rings, monitored) {
        (true, _) => Tone::Bad,
        (false, true) => Tone::Good,
        (false, false) => Tone::Caution,
    };
    let label = if rings {
        "alarm"
    } else if monitored {
        "no alarm"
    } else {
        "not watched"
    };
    let mut page = Page::new(text::title(analysis)).kicker("trued spectrum");
    if let Some(model) = &analysis.source.model {
        page = page.robot(model.file.identity().to_string());
    }
    page = page.verdict(tone, label, &text::lead(analysis)).numbers(numbers(analysis));
    if let Some(map) = plots::waterfall(analysis, channel)? {
        page = page.figure(&format!("Amplitude of {name} over time and frequency. Framed: the most harmful lines, from their begin to their end."), &map);
    }
    page = next(page, analysis).section(if rings { "Vibration over time" } else { "Over time" });
    let drawn = match plots::thinned(&analysis.source) {
        1 => format!("The samples of {name}."),
        group => format!("Samples of {name}: minimum and maximum of every {group} samples."),
    };
    page = page.figure(&drawn, &plots::signal(analysis, channel)?);
    if !analysis.episodes.is_empty() {
        page = page.table(&episodes(analysis));
    }
    page = why(page, analysis);
    page = spectra(page, analysis);
    page = match &analysis.path {
        Ok(spectra) => over_path(page, &analysis.source, spectra),
        Err(missing) => page.section("Over the tool's path").text(&format!(
            "Lines of gears and of the surface have a constant number of cycles per mm at any feed. To see them: {missing}."
        )),
    };
    let page = health(page, analysis)
        .section("Analysed data")
        .facts(facts(analysis))
        .footer("Amplitudes are half of peak to peak, in the channel's own unit.");
    Ok(page)
}

fn next(page: Page, analysis: &Analysis) -> Page {
    let worst = analysis.episodes.iter().find(|episode| episode.is_alarm());
    match worst {
        Some(worst) => {
            let command = "trued spectrum --spindle-rpm RPM --teeth N RECORDING";
            let command = text::needs_spindle_speed(&worst.verdict).then_some(command);
            let advice = report::capitalised(&text::advice(&worst.verdict));
            page.next(&format!("{advice}."), command)
        }
        None => page.next("No change needed. Monitor the cut with the daemon.", None),
    }
}

/// One advice for each kind of vibration: a line that glides is one, however many frequencies it was seen at.
fn why(page: Page, analysis: &Analysis) -> Page {
    let mut kinds: Vec<(Class, Vec<&Episode>)> = Vec::new();
    for episode in analysis.episodes.iter().filter(|episode| episode.is_alarm()) {
        let class = episode.verdict.class;
        match kinds.iter_mut().find(|(known, _)| *known == class) {
            Some((_, episodes)) => episodes.push(episode),
            None => kinds.push((class, vec![episode])),
        }
    }
    let lines: Vec<String> = kinds
        .iter()
        .filter_map(|(_, episodes)| {
            let first = episodes.first()?;
            let also = match episodes.len() {
                1 => String::new(),
                all => format!(" {} more alarms of this kind: see the table.", all - 1),
            };
            Some(format!("{}{also}", advice(&analysis.source, first)))
        })
        .collect();
    if lines.is_empty() { page } else { page.section("Why, and what to do").list(lines) }
}

fn numbers(analysis: &Analysis) -> Vec<Number> {
    let alarms = analysis.episodes.iter().filter(|e| e.is_alarm()).count();
    let tone = if alarms > 0 { Tone::Bad } else { Tone::Good };
    let mut numbers = vec![
        Number::text("Lines with an alarm", alarms.to_string())
            .tone(tone)
            .note(format!("of {}", pluralise(analysis.episodes.len(), "line"))),
    ];
    if let Some(worst) = analysis.episodes.first() {
        let channel = &analysis.source.channels[worst.channel];
        numbers.push(
            Number::text("Most harmful line", hz(worst.frequency_hz))
                .note(class_and_rivals(&worst.verdict)),
        );
        numbers.push(
            Number::new("Its amplitude", worst.amplitude, &channel.unit)
                .note(format!("on {}, in its strongest quarter of a second", channel.name)),
        );
        let to_s = worst.to_s.unwrap_or_else(|| analysis.source.seconds());
        numbers.push(
            Number::new("It lasted", to_s - worst.from_s, "s")
                .note(format!("from {} s", fixed(worst.from_s, 2))),
        );
    } else {
        let loudest = analysis.spectra.iter().max_by(|a, b| a.rms.total_cmp(&b.rms));
        if let Some(loudest) = loudest {
            let channel = &analysis.source.channels[loudest.channel];
            numbers.push(
                Number::new("Loudest channel, rms", loudest.rms, &channel.unit).note(&channel.name),
            );
        }
    }
    numbers
}

fn episodes(analysis: &Analysis) -> Table {
    let heads = [
        Column::new("State"),
        Column::new("Frequency (Hz)").digits(4),
        Column::new("Amplitude"),
        Column::new("Channel"),
        Column::new("From"),
        Column::new("To"),
        Column::new("Growth (1/s)"),
        Column::new("Class"),
    ];
    let table = Table::new("Lines over time, the most harmful first", heads);
    analysis.episodes.iter().take(ROWS).fold(table, |table, episode| {
        let channel = &analysis.source.channels[episode.channel];
        table.row([
            episode.state.name().into(),
            episode.frequency_hz.into(),
            report::quantity(episode.amplitude, &channel.unit).into(),
            channel.name.as_str().into(),
            seconds(episode.from_s).into(),
            episode.to_s.map_or("end".to_owned(), seconds).into(),
            episode.growth_per_s.into(),
            class_and_rivals(&episode.verdict).into(),
        ])
    })
}

fn seconds(t_s: f64) -> String {
    format!("{}\u{a0}s", fixed(t_s, 2))
}

fn advice(source: &Source, episode: &Episode) -> String {
    let why = text::why(source, &episode.verdict, episode.frequency_hz);
    let advice = text::advice(&episode.verdict);
    format!("{}: {why} Advice: {advice}.", hz(episode.frequency_hz))
}

/// The units of the channels, each once.
fn units(source: &Source) -> Vec<&str> {
    let mut units: Vec<&str> = Vec::new();
    for channel in &source.channels {
        if !units.contains(&channel.unit.as_str()) {
            units.push(&channel.unit);
        }
    }
    units
}

fn spectra(mut page: Page, analysis: &Analysis) -> Page {
    page = page.section("Spectrum of the whole recording").text(&format!(
        "Averaged over windows of {} s (Hann, half overlapping). A line that is there for a part of the time reads lower here \
         than it was.",
        significant(analysis.window_s, 3)
    ));
    let nyquist_hz = 0.5 * analysis.source.rate_hz;
    for unit in units(&analysis.source) {
        let caption = "Power density; dots below the curves mark known modes and multiples of the spindle speed.";
        page = page.figure(caption, &plots::density(analysis, unit, false));
        if nyquist_hz > 2.0 * plots::top_hz(analysis) {
            page = page.figure(
                "The same up to half the sampling rate.",
                &plots::density(analysis, unit, true),
            );
        }
    }
    if analysis.spectra.iter().all(|one| one.lines.is_empty()) {
        return page.text("No line exceeds the noise.");
    }
    page.table(&lines(analysis))
}

fn lines(analysis: &Analysis) -> Table {
    let heads = [
        Column::new("Frequency (Hz)").digits(5),
        Column::new("Amplitude"),
        Column::new("Over floor (dB)"),
        Column::new("Channel"),
        Column::new("Class"),
        Column::new("Judged by"),
    ];
    let mut all: Vec<_> = analysis.lines().collect();
    all.sort_by(|a, b| a.1.line.frequency.total_cmp(&b.1.line.frequency));
    let table = Table::new("Lines of the whole recording, by frequency", heads);
    all.iter().take(ROWS).fold(table, |table, (channel, one)| {
        table.row([
            one.line.frequency.into(),
            report::quantity(one.line.amplitude, &channel.unit).into(),
            (10.0 * one.line.ratio.log10()).into(),
            channel.name.as_str().into(),
            class_and_rivals(&one.verdict).into(),
            if one.is_tracked { "the monitor, over time" } else { "its frequency" }.into(),
        ])
    })
}

fn over_path(mut page: Page, source: &Source, spectra: &PathSpectra) -> Page {
    page = page.section("Over the tool's path").text(&format!("{}.", text::path(source, spectra)));
    for unit in units(source) {
        let caption = "Power density over cycles per mm of path: lines of gears and waviness do not move with the feed here.";
        page = page.figure(caption, &plots::path(source, spectra, unit));
    }
    if let Some(missing) = &spectra.wheels.missing {
        page = page.text(&format!("{}.", report::capitalised(missing)));
    }
    if spectra.wheels.spread > 0.05 {
        let percent = fixed(100.0 * spectra.wheels.spread, 0);
        page = page.text(&format!(
            "The joints' speeds per mm change by about {percent} % along this path: the line of a gear is broadened by as much. Shorter straight cuts give narrower lines."
        ));
    }
    if spectra.channels.iter().any(|one| !one.lines.is_empty()) {
        page = page.table(&path_lines(source, spectra));
    }
    page
}

fn path_lines(source: &Source, spectra: &PathSpectra) -> Table {
    let heads = [
        Column::new("Cycles per mm").digits(4),
        Column::new("Wavelength (mm)"),
        Column::new("Amplitude"),
        Column::new("Channel"),
        Column::new("Also in time (Hz)").digits(4),
        Column::new("Gear"),
    ];
    let all = spectra
        .channels
        .iter()
        .flat_map(|one| one.lines.iter().map(move |found| (&source.channels[one.channel], found)));
    all.take(ROWS).fold(Table::new("Lines over the path", heads), |table, (channel, found)| {
        let wheel = found.wheel.map_or("–".to_owned(), |wheel| wheel.text());
        table.row([
            found.line.frequency.into(),
            (1.0 / found.line.frequency).into(),
            report::quantity(found.line.amplitude, &channel.unit).into(),
            channel.name.as_str().into(),
            found.in_time_hz.unwrap_or(f64::NAN).into(),
            wheel.into(),
        ])
    })
}

fn health(page: Page, analysis: &Analysis) -> Page {
    let faults = text::health(analysis);
    let page = page.section("The sensor");
    let page = if faults.is_empty() {
        page.text("No channel was stuck, dead, saturated or without numbers.")
    } else {
        page.list(faults)
    };
    if analysis.notes.is_empty() { page } else { page.list(&analysis.notes) }
}

fn facts(analysis: &Analysis) -> Vec<(&'static str, String)> {
    let channels: Vec<String> = analysis.source.channels.iter().map(text::with_unit).collect();
    let mut facts = vec![
        ("Channels", channels.join(", ")),
        (
            "Sampled",
            format!(
                "{} s at {} Hz",
                significant(analysis.source.seconds(), 4),
                significant(analysis.source.rate_hz, 5)
            ),
        ),
    ];
    if analysis.source.pieces.len() > 1 {
        facts.push(("Records", analysis.source.pieces.len().to_string()));
    }
    let rpm = analysis.source.pieces.iter().find_map(|piece| piece.motion.median_rpm());
    facts.push((
        "Spindle",
        rpm.map_or("not known".to_owned(), |rpm| {
            let teeth = if analysis.source.teeth > 0 {
                format!(", {}", pluralise(analysis.source.teeth as usize, "tooth"))
            } else {
                String::new()
            };
            format!("{} rev/min{}", fixed(rpm, 0), teeth.replace("tooths", "teeth"))
        }),
    ));
    let feed = analysis.source.pieces.iter().find_map(|piece| piece.motion.median_feed_mm_s());
    facts.push((
        "Feed",
        feed.map_or("not known".to_owned(), |feed| format!("{} mm/s", significant(feed, 3))),
    ));
    let model =
        analysis.source.model.as_ref().map_or("none".to_owned(), |model| model.file.name.clone());
    facts.push(("Model", model));
    for monitored in &analysis.monitored {
        let unit = &analysis.source.channels[monitored.channel(spectrum::Axis::X)].unit;
        facts.push(("Least amplitude", report::quantity(monitored.amplitude_min, unit)));
    }
    facts
}
