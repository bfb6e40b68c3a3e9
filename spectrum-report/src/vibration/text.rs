//! Vibrations of a recording as text.

use report::{TextTable, capitalised, fixed, pluralise, quantity, significant};
use spectrum::{Advice, Class, Verdict};

use super::analysis::Analysis;
use super::input::{Channel, Source};
use super::monitor::Episode;
use super::path::PathSpectra;

/// Maximum number of rows of a table.
const ROWS: usize = 6;

/// The name of the axis in results.
pub(super) fn axis_of(channel: &Channel) -> Option<&'static str> {
    channel.axis.map(spectrum::Axis::name)
}

/// The unit of a power density over `per`: `N²/Hz`.
pub(super) fn density_unit(unit: &str, per: &str) -> String {
    match unit {
        "" => format!("1/{per}"),
        _ if unit.contains(['/', '²', '^']) => format!("({unit})²/{per}"),
        _ => format!("{unit}²/{per}"),
    }
}

/// A frequency with its significant digits.
pub(super) fn hz(frequency_hz: f64) -> String {
    format!("{}\u{a0}Hz", fixed(frequency_hz, 1))
}

/// A class as text.
fn class(class: Class) -> &'static str {
    match class {
        Class::Forced => "forced vibration",
        Class::Chatter => "chatter",
        Class::ModeCoupling => "mode coupling",
        Class::Gear => "a gear's line",
        Class::Structural => "the structure's own motion",
        Class::Electrical => "mains hum",
        Class::Unknown => "of unknown cause",
    }
}

/// A class and its alternatives: `chatter (or forced)`.
pub(super) fn class_and_rivals(verdict: &Verdict) -> String {
    let rivals: Vec<&str> = verdict.alternatives.iter().map(Class::name).collect();
    let name = verdict.class.name().replace('_', " ");
    if rivals.is_empty() {
        name
    } else {
        format!("{name} (or {})", rivals.join(", ").replace('_', " "))
    }
}

/// The finding in a few words.
pub(super) fn title(analysis: &Analysis) -> String {
    let worst = analysis.episodes.first().filter(|episode| episode.is_alarm());
    let Some(worst) = worst else {
        return if analysis.is_monitored() {
            "Nothing alarmed"
        } else {
            "A recording that could not be monitored"
        }
        .to_owned();
    };
    let f = hz(worst.frequency_hz);
    match worst.verdict.class {
        _ if worst.verdict.suspect_alias => format!("A line at {f} that may be an alias"),
        Class::Chatter if worst.verdict.alternatives.contains(Class::Forced) => {
            format!("It rings at {f}")
        }
        Class::Chatter => format!("The cut rings at {f}"),
        Class::ModeCoupling => format!("Two modes couple at {f}"),
        Class::Forced => format!("The spindle drives a mode at {f}"),
        Class::Gear => format!("A gear line at {f}"),
        _ => format!("A line at {f} alarms"),
    }
}

/// The finding in a few sentences.
pub(super) fn lead(analysis: &Analysis) -> String {
    let alarms: Vec<&Episode> = analysis.episodes.iter().filter(|e| e.is_alarm()).collect();
    let Some(worst) = alarms.first() else { return no_vibration_text(analysis) };
    let mut sentences = vec![
        when_and_what(&analysis.source, worst),
        why(&analysis.source, &worst.verdict, worst.frequency_hz),
    ];
    sentences.push(format!("To do: {}.", advice(&worst.verdict)));
    if worst.is_chatter() && !analysis.nearest_stable.is_empty() {
        sentences.push(format!("By modes and cutter: {}.", analysis.nearest_stable.join("; ")));
    }
    let is_advised = needs_spindle_speed(&worst.verdict);
    let is_speed_known = worst.verdict.harmonic.is_some();
    if worst.verdict.alternatives.contains(Class::Forced) && !is_speed_known && !is_advised {
        sentences.push("With the spindle speed (--spindle-rpm, --teeth) forced vibration could be distinguished.".to_owned());
    }
    if alarms.len() > 1 {
        let others: Vec<String> =
            alarms.iter().skip(1).take(3).map(|e| hz(e.frequency_hz)).collect();
        let more = if alarms.len() > 4 { " and others" } else { "" };
        sentences.push(format!("Alarms also at {}{more}.", others.join(", ")));
    }
    sentences.join(" ")
}

fn when_and_what(source: &Source, episode: &Episode) -> String {
    let channel = &source.channels[episode.channel];
    let until = episode.to_s.map_or("the end".to_owned(), |t| format!("{}\u{a0}s", fixed(t, 2)));
    format!(
        "From {}\u{a0}s to {until} there was a line at {} on {}, with an amplitude of up to {}.",
        fixed(episode.from_s, 2),
        hz(episode.frequency_hz),
        channel.name,
        quantity(episode.amplitude, &channel.unit),
    )
}

/// What to do about a line with an alarm. Where its class has no remedy, the next step is the recording that determines its cause.
pub(super) fn advice(verdict: &Verdict) -> String {
    if needs_spindle_speed(verdict) {
        return "record again with the spindle speed (--spindle-rpm, --teeth), so that forced vibration can be distinguished from chatter; without a spindle, record once more with every machine nearby switched off".to_owned();
    }
    match (verdict.advice, verdict.class) {
        (Advice::None, Class::Unknown) => "repeat the cut at another spindle speed: forced vibration follows it, chatter and the structure's own motion keep their frequency".to_owned(),
        (Advice::None, Class::Forced) => "balance the spindle and check the runout of the cutter; no mode is near, so that another speed changes little".to_owned(),
        (Advice::None, Class::Structural) => "record the same motion without cutting: what remains is not caused by the cut".to_owned(),
        (advice, _) => advice.to_string(),
    }
}

/// Whether the cause is unknown because the speed of the spindle is.
pub(super) fn needs_spindle_speed(verdict: &Verdict) -> bool {
    verdict.advice == Advice::None && verdict.class == Class::Unknown && verdict.harmonic.is_none()
}

/// The reason for a line's class, and alternatives.
pub(super) fn why(source: &Source, verdict: &Verdict, frequency_hz: f64) -> String {
    let mut reasons = Vec::new();
    if let Some(alias) = verdict.alias.filter(|_| verdict.suspect_alias) {
        let rate_hz = source.rate_hz;
        let true_hz = f64::from(alias.order)
            * verdict.harmonic.map_or(0.0, |h| h.frequency_hz / f64::from(h.order));
        reasons.push(format!(
            "sampling at {} Hz aliases spindle harmonic {} ({}) to {}, so the line may not exist at this frequency",
            significant(rate_hz, 4), alias.order, hz(true_hz), hz(alias.frequency_hz)
        ));
    } else if let Some(harmonic) = verdict.harmonic {
        let turn_hz = harmonic.frequency_hz / f64::from(harmonic.order.max(1));
        let orders = frequency_hz / turn_hz;
        reasons.push(if verdict.class == Class::Forced {
            format!("it is {} times the spindle frequency of {}", harmonic.order, hz(turn_hz))
        } else {
            format!(
                "it lies between multiples of the spindle frequency ({} × {})",
                fixed(orders, 2),
                hz(turn_hz)
            )
        });
    }
    if let Some(mode) = verdict.mode {
        let is_near = mode.distance_hz.abs() < 0.05 * mode.frequency_hz;
        reasons.push(if is_near {
            format!("the model has a mode at {}", hz(mode.frequency_hz))
        } else {
            format!("the model's nearest mode is at {}", hz(mode.frequency_hz))
        });
    }
    let rivals: Vec<&str> = verdict.alternatives.iter().map(class).collect();
    if verdict.class == Class::Unknown {
        let possible = if rivals.is_empty() {
            "none is more likely".to_owned()
        } else {
            format!("possible are {}", rivals.join(", "))
        };
        let seen = if reasons.is_empty() {
            String::new()
        } else {
            format!("{}. ", capitalised(&reasons.join(", and ")))
        };
        return format!("{seen}Its cause cannot be determined from this recording: {possible}.");
    }
    let called = class(verdict.class);
    let but = if rivals.is_empty() {
        String::new()
    } else {
        format!("; the recording cannot distinguish it from {}", rivals.join(" or "))
    };
    if reasons.is_empty() {
        format!("Most likely it is {called}{but}.")
    } else {
        let text = capitalised(&reasons.join(", and "));
        format!("{text}: most likely {called}{but}.")
    }
}

/// Whether two frequencies belong to different lines of the text: they are written with one decimal.
fn line_differs(one_hz: f64, other_hz: f64) -> bool {
    hz(one_hz) != hz(other_hz)
}

fn no_vibration_text(analysis: &Analysis) -> String {
    let reported = match analysis.episodes.len() {
        _ if !analysis.is_monitored() => "There are spectra only.".to_owned(),
        0 => "The monitor reported no line.".to_owned(),
        lines => {
            format!(
                "The monitor reported {}, none of which needs action.",
                pluralise(lines, "line")
            )
        }
    };
    let strongest = analysis
        .spectra
        .iter()
        .flat_map(|one| one.lines.iter().map(move |line| (one.channel, line)))
        .max_by(|a, b| a.1.line.amplitude.total_cmp(&b.1.line.amplitude));
    let Some((channel, strongest)) = strongest else {
        return format!(
            "{reported} In the spectrum of the whole recording nothing exceeds the noise."
        );
    };
    let channel = &analysis.source.channels[channel];
    let other = match analysis.episodes.first() {
        Some(first) if line_differs(first.frequency_hz, strongest.line.frequency) => format!(
            " It is averaged over the whole time; the most harmful line, {}, was there for a part of it and is measured where it was strongest.",
            hz(first.frequency_hz)
        ),
        _ => String::new(),
    };
    format!(
        "{reported} In the spectrum of the whole recording, the strongest line is at {} on {}, with an amplitude of {}: {}.{other}",
        hz(strongest.line.frequency),
        channel.name,
        quantity(strongest.line.amplitude, &channel.unit),
        class(strongest.verdict.class)
    )
}

/// Faults of the sensor, one sentence each.
pub(super) fn health(analysis: &Analysis) -> Vec<String> {
    let mut sentences = Vec::new();
    for monitored in &analysis.monitored {
        for finding in &monitored.result.findings {
            let channel =
                finding.channel.and_then(|channel_index| monitored.group.get(channel_index));
            let name = channel.map_or("the recording", |channel_index| {
                analysis.source.channels[*channel_index].name.as_str()
            });
            sentences.push(format!(
                "{name}, {} to {} s: {}",
                fixed(finding.from_s, 2),
                fixed(finding.to_s, 2),
                finding.fault
            ));
        }
    }
    for channel in analysis.source.channels.iter().filter(|channel| channel.missing > 0) {
        sentences.push(format!("{}: missing samples: {}", channel.name, channel.missing));
    }
    sentences
}

impl Analysis {
    /// The result as text; its tables are at most `width_max` characters wide. `emphasised`: the finding as it is
    /// emphasised, e.g. in colour; `str::to_owned` for plain text.
    #[must_use]
    pub fn text(&self, width_max: Option<usize>, emphasised: impl Fn(&str) -> String) -> String {
        let mut text = format!(
            "{}
",
            recorded(&self.source)
        );
        text += &format!(
            "{}. {}
",
            emphasised(&title(self)),
            lead(self)
        );
        if !self.episodes.is_empty() {
            text += &format!(
                "
{}
",
                episodes(self, width_max).trim_end()
            );
        }
        let missing = self.episodes.len().saturating_sub(ROWS);
        if missing > 0 {
            text += &format!(
                "and {missing} more (--json, --report)
"
            );
        }
        if self.episodes.is_empty() && self.spectra.iter().any(|one| !one.lines.is_empty()) {
            text += &format!(
                "
{}
",
                lines(self, width_max).trim_end()
            );
        }
        if let Ok(spectra) = &self.path {
            text += &format!(
                "
path      {}
",
                path(&self.source, spectra)
            );
        }
        let health = health(self);
        let sensor = if health.is_empty() {
            "no fault".to_owned()
        } else {
            health.join(
                "
          ",
            )
        };
        text += &format!(
            "sensor    {sensor}
"
        );
        text + &self
            .notes
            .iter()
            .map(|note| {
                format!(
                    "note      {note}
"
                )
            })
            .collect::<String>()
    }
}

/// File, duration, rate and channels.
fn recorded(source: &Source) -> String {
    let names: Vec<String> = source.channels.iter().map(with_unit).collect();
    let records = match source.pieces.len() {
        0 | 1 => String::new(),
        several => format!(", {several} records"),
    };
    format!(
        "{}: {} s at {} Hz, {}{records}",
        source.file.display(),
        significant(source.seconds(), 3),
        significant(source.rate_hz, 5),
        names.join(", ")
    )
}

/// `fx_N` contains its unit; for other names it is added.
pub(super) fn with_unit(channel: &Channel) -> String {
    match channel.unit.as_str() {
        "" => channel.name.clone(),
        unit if channel.name.ends_with(unit) || channel.name.contains(['(', '[']) => {
            channel.name.clone()
        }
        unit => format!("{} in {unit}", channel.name),
    }
}

fn episodes(analysis: &Analysis, width_max: Option<usize>) -> String {
    let heads = ["state", "Hz", "amplitude", "channel", "from s", "to s", "class"];
    let rows = analysis.episodes.iter().take(ROWS);
    let table = rows.fold(TextTable::new(heads), |table, episode| {
        let channel = &analysis.source.channels[episode.channel];
        table.row([
            episode.state.name().to_owned(),
            fixed(episode.frequency_hz, 1),
            quantity(episode.amplitude, &channel.unit),
            channel.name.clone(),
            fixed(episode.from_s, 2),
            episode.to_s.map_or("end".to_owned(), |t| fixed(t, 2)),
            class_and_rivals(&episode.verdict),
        ])
    });
    table.render(width_max)
}

fn lines(analysis: &Analysis, width_max: Option<usize>) -> String {
    let mut all: Vec<_> = analysis.lines().collect();
    all.sort_by(|a, b| b.1.line.amplitude.total_cmp(&a.1.line.amplitude));
    let heads = ["Hz", "amplitude", "channel", "class"];
    let table = all.iter().take(ROWS).fold(TextTable::new(heads), |table, (channel, one)| {
        table.row([
            fixed(one.line.frequency, 1),
            quantity(one.line.amplitude, &channel.unit),
            channel.name.clone(),
            class_and_rivals(&one.verdict),
        ])
    });
    table.render(width_max)
}

/// The result over the path, in a sentence.
pub(super) fn path(source: &Source, spectra: &PathSpectra) -> String {
    // A line that is also one in time does not belong to the path.
    let strongest = spectra
        .channels
        .iter()
        .flat_map(|one| one.lines.iter().map(move |found| (&source.channels[one.channel], found)))
        .filter(|(_, found)| spectra.one_feed || found.in_time_hz.is_none())
        .max_by(|a, b| a.1.line.amplitude.total_cmp(&b.1.line.amplitude));
    let known = format!("{} mm by {}", fixed(spectra.length_mm, 0), spectra.by);
    let Some((channel, found)) = strongest else {
        return format!("{known}: no line exceeds the noise");
    };
    let wheel = found.wheel.map_or(String::new(), |wheel| format!(", {}", wheel.text()));
    let caveat = match (spectra.one_feed, found.in_time_hz) {
        (true, Some(in_time_hz)) => {
            format!("; at this single feed the same as {} in time", hz(in_time_hz))
        }
        (true, None) => {
            "; at a single feed it cannot be distinguished from a line in time".to_owned()
        }
        _ => String::new(),
    };
    format!(
        "{known}: {} cycles/mm ({} mm) on {}, amplitude {}{wheel}{caveat}",
        significant(found.line.frequency, 3),
        significant(1.0 / found.line.frequency, 3),
        channel.name,
        quantity(found.line.amplitude, &channel.unit)
    )
}
