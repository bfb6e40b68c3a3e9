//! Results as text.

use report::{TextTable, capitalised, count, fixed, quantity, significant};
use spectrum::{Advice, Class, State, Verdict};

use super::found::Found;
use super::listen::Episode;
use super::subject::{Channel, Subject};
use crate::exit::Failure;
use crate::output::{Console, Paint};
use crate::table::on_stdout;

/// Maximum number of lines in a table on the console.
const ROWS: usize = 6;

/// The axis as the contract names it.
pub(super) fn axis_of(channel: &Channel) -> Option<&'static str> {
    channel.axis.map(spectrum::Axis::name)
}

/// Units of spectra.
pub(super) mod frequency_words {
    /// The unit of a power density over `per`: `N²/Hz`.
    pub(in super::super) fn density_unit(unit: &str, per: &str) -> String {
        match unit {
            "" => format!("1/{per}"),
            _ if unit.contains(['/', '²', '^']) => format!("({unit})²/{per}"),
            _ => format!("{unit}²/{per}"),
        }
    }
}

/// A frequency with its significant digits.
pub(super) fn hz(frequency_hz: f64) -> String {
    format!("{}\u{a0}Hz", fixed(frequency_hz, 1))
}

/// A class in words.
pub(super) fn class(class: Class) -> &'static str {
    match class {
        Class::Forced => "forced vibration",
        Class::Chatter => "chatter",
        Class::ModeCoupling => "mode coupling",
        Class::Gear => "a gear's line",
        Class::Structural => "the structure's own motion",
        Class::Electrical => "mains hum",
        Class::Unknown => "a line of unknown origin",
    }
}

/// A class and its rivals: `chatter, or forced`.
pub(super) fn class_and_rivals(verdict: &Verdict) -> String {
    let rivals: Vec<&str> = verdict.rivals.iter().map(Class::name).collect();
    let name = verdict.class.name().replace('_', " ");
    if rivals.is_empty() {
        name
    } else {
        format!("{name} (or {})", rivals.join(", ").replace('_', " "))
    }
}

/// Whether a line is one to act on.
pub(super) fn alarmed(episode: &Episode) -> bool {
    episode.state >= State::Alarm && super::listen::is_harmful(&episode.verdict)
}

/// Whether a line is one to act on that another cut would take away.
pub(super) fn chatters(episode: &Episode) -> bool {
    alarmed(episode) && matches!(episode.verdict.class, Class::Chatter | Class::ModeCoupling)
}

/// The page's title: the finding in a few words.
pub(super) fn title(found: &Found) -> String {
    let worst = found.episodes.first().filter(|episode| alarmed(episode));
    let Some(worst) = worst else {
        return if watched(found) {
            "Nothing alarmed"
        } else {
            "A recording that could not be watched"
        }
        .to_owned();
    };
    let f = hz(worst.frequency_hz);
    match worst.verdict.class {
        _ if worst.verdict.suspect_alias => format!("A line at {f} that may not be there"),
        Class::Chatter if worst.verdict.rivals.contains(Class::Forced) => {
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
pub(super) fn lead(subject: &Subject, found: &Found) -> String {
    let alarms: Vec<&Episode> = found.episodes.iter().filter(|e| alarmed(e)).collect();
    let Some(worst) = alarms.first() else { return calm(subject, found) };
    let mut words =
        vec![when_and_what(subject, worst), why(subject, &worst.verdict, worst.frequency_hz)];
    if worst.verdict.advice != Advice::None {
        words.push(format!("To do: {}.", worst.verdict.advice));
    }
    if chatters(worst) && !found.nearest_stable.is_empty() {
        words.push(format!("By modes and cutter: {}.", found.nearest_stable.join("; ")));
    }
    if worst.verdict.rivals.contains(Class::Forced) && worst.verdict.harmonic.is_none() {
        words.push("With the spindle speed (--spindle-rpm, --teeth) forced vibration could be distinguished.".to_owned());
    }
    if alarms.len() > 1 {
        let others: Vec<String> =
            alarms.iter().skip(1).take(3).map(|e| hz(e.frequency_hz)).collect();
        let more = if alarms.len() > 4 { " and others" } else { "" };
        words.push(format!("Alarms also at {}{more}.", others.join(", ")));
    }
    words.join(" ")
}

fn when_and_what(subject: &Subject, episode: &Episode) -> String {
    let channel = &subject.channels[episode.channel];
    let until = episode.to_s.map_or("the end".to_owned(), |t| format!("{}\u{a0}s", fixed(t, 2)));
    format!(
        "From {}\u{a0}s to {until} a line at {} stood on {}, with an amplitude of up to {}.",
        fixed(episode.from_s, 2),
        hz(episode.frequency_hz),
        channel.name,
        quantity(episode.amplitude, &channel.unit),
    )
}

/// The reason for a line's class, and alternatives.
pub(super) fn why(subject: &Subject, verdict: &Verdict, frequency_hz: f64) -> String {
    let mut reasons = Vec::new();
    if let Some(alias) = verdict.alias.filter(|_| verdict.suspect_alias) {
        let rate_hz = subject.rate_hz;
        let true_hz = f64::from(alias.order)
            * verdict.harmonic.map_or(0.0, |h| h.frequency_hz / f64::from(h.order));
        reasons.push(format!(
            "sampling at {} Hz folds the spindle's multiple {} ({}) onto {}, so that it may not exist at this frequency at all",
            significant(rate_hz, 4), alias.order, hz(true_hz), hz(alias.frequency_hz)
        ));
    } else if let Some(harmonic) = verdict.harmonic {
        let turn_hz = harmonic.frequency_hz / f64::from(harmonic.order.max(1));
        let orders = frequency_hz / turn_hz;
        reasons.push(if verdict.class == Class::Forced {
            format!("it is {} times the spindle's {}", harmonic.order, hz(turn_hz))
        } else {
            format!(
                "it stands between the spindle's multiples ({} × {})",
                fixed(orders, 2),
                hz(turn_hz)
            )
        });
    }
    if let Some(mode) = verdict.mode {
        let near = mode.distance_hz.abs() < 0.05 * mode.frequency_hz;
        reasons.push(if near {
            format!("the model has a mode at {}", hz(mode.frequency_hz))
        } else {
            format!("the model's nearest mode is at {}", hz(mode.frequency_hz))
        });
    }
    let rivals: Vec<&str> = verdict.rivals.iter().map(class).collect();
    let called = class(verdict.class);
    let but = if rivals.is_empty() {
        String::new()
    } else {
        format!("; the recording cannot tell it from {}", rivals.join(" or "))
    };
    if reasons.is_empty() {
        format!("Most likely it is {called}{but}.")
    } else {
        let text = capitalised(&reasons.join(", and "));
        format!("{text}: most likely {called}{but}.")
    }
}

/// Whether the monitor had enough data for a result.
pub(super) fn watched(found: &Found) -> bool {
    found.listened.iter().any(|listened| !listened.result.still_learning)
}

fn calm(subject: &Subject, found: &Found) -> String {
    let told = match found.episodes.len() {
        _ if !watched(found) => "There are spectra only.".to_owned(),
        0 => "The monitor reported no line.".to_owned(),
        told => {
            format!("The monitor reported {}, none of which needs action.", count(told, "line"))
        }
    };
    let strongest = found
        .spectra
        .iter()
        .flat_map(|one| one.lines.iter().map(move |line| (one.channel, line)))
        .max_by(|a, b| a.1.line.amplitude.total_cmp(&b.1.line.amplitude));
    let Some((channel, judged)) = strongest else {
        return format!("{told} In the spectrum of the whole recording nothing exceeds the noise.");
    };
    let channel = &subject.channels[channel];
    format!(
        "{told} In the spectrum of the whole the strongest line stands at {} on {}, with an amplitude of {}: {}.",
        hz(judged.line.frequency),
        channel.name,
        quantity(judged.line.amplitude, &channel.unit),
        class(judged.verdict.class)
    )
}

/// What the sensor's health is, one sentence each.
pub(super) fn health(subject: &Subject, found: &Found) -> Vec<String> {
    let mut said = Vec::new();
    for listened in &found.listened {
        for finding in &listened.result.findings {
            let channel = finding.channel.and_then(|at| listened.group.get(at));
            let name = channel.map_or("the recording", |at| subject.channels[*at].name.as_str());
            said.push(format!(
                "{name}, {} to {} s: {}",
                fixed(finding.from_s, 2),
                fixed(finding.to_s, 2),
                finding.fault
            ));
        }
    }
    for channel in subject.channels.iter().filter(|channel| channel.holes > 0) {
        said.push(format!("{}: samples that were not taken: {}", channel.name, channel.holes));
    }
    said
}

/// The console's lines.
pub(super) fn say(console: &mut Console, subject: &Subject, found: &Found) -> Result<(), Failure> {
    let names: Vec<String> = subject.channels.iter().map(with_unit).collect();
    let file = subject.file.display();
    console.say(format!(
        "{file}: {} s at {} Hz, {}{}",
        significant(subject.seconds(), 3),
        significant(subject.rate_hz, 5),
        names.join(", "),
        if subject.pieces.len() > 1 {
            format!(", {} records", subject.pieces.len())
        } else {
            String::new()
        }
    ))?;
    let paint = if found.episodes.iter().any(alarmed) { Paint::Bad } else { Paint::Good };
    console.say(format!("{}. {}", console.paint(paint, &title(found)), lead(subject, found)))?;
    if !found.episodes.is_empty() {
        console.say(format!("\n{}", episodes(subject, found).trim_end()))?;
    }
    let missing = found.episodes.len().saturating_sub(ROWS);
    if missing > 0 {
        console.say(format!("and {missing} more (--json, --report)"))?;
    }
    if found.episodes.is_empty() && found.spectra.iter().any(|one| !one.lines.is_empty()) {
        console.say(format!("\n{}", lines(subject, found).trim_end()))?;
    }
    if let Ok(space) = &found.space {
        console.say(format!("\npath      {}", path(subject, space)))?;
    }
    let health = health(subject, found);
    let sensor =
        if health.is_empty() { "no fault".to_owned() } else { health.join("\n          ") };
    console.say(format!("sensor    {sensor}"))?;
    for note in &found.notes {
        console.say(format!("note      {note}"))?;
    }
    Ok(())
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

fn episodes(subject: &Subject, found: &Found) -> String {
    let heads = ["state", "Hz", "amplitude", "channel", "from s", "to s", "class"];
    let rows = found.episodes.iter().take(ROWS);
    let table = rows.fold(TextTable::new(heads), |table, episode| {
        let channel = &subject.channels[episode.channel];
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
    on_stdout(&table)
}

fn lines(subject: &Subject, found: &Found) -> String {
    let mut all: Vec<_> = found
        .spectra
        .iter()
        .flat_map(|one| one.lines.iter().map(move |line| (&subject.channels[one.channel], line)))
        .collect();
    all.sort_by(|a, b| b.1.line.amplitude.total_cmp(&a.1.line.amplitude));
    let heads = ["Hz", "amplitude", "channel", "class"];
    let table = all.iter().take(ROWS).fold(TextTable::new(heads), |table, (channel, judged)| {
        table.row([
            fixed(judged.line.frequency, 1),
            quantity(judged.line.amplitude, &channel.unit),
            channel.name.clone(),
            class_and_rivals(&judged.verdict),
        ])
    });
    on_stdout(&table)
}

/// The result over the path, in a sentence.
pub(super) fn path(subject: &Subject, space: &super::space::Space) -> String {
    // A line that is also one in time does not belong to the path.
    let strongest = space
        .channels
        .iter()
        .flat_map(|one| one.lines.iter().map(move |found| (&subject.channels[one.channel], found)))
        .filter(|(_, found)| space.one_feed || found.in_time_hz.is_none())
        .max_by(|a, b| a.1.line.amplitude.total_cmp(&b.1.line.amplitude));
    let known = format!("{} mm by {}", fixed(space.length_mm, 0), space.by);
    let Some((channel, found)) = strongest else {
        return format!("{known}: no line of its own stands over the noise");
    };
    let wheel = found.wheel.map_or(String::new(), |wheel| format!(", {}", wheel.words()));
    let doubt = match (space.one_feed, found.in_time_hz) {
        (true, Some(in_time_hz)) => {
            format!("; at this one feed the same as {} in time", hz(in_time_hz))
        }
        (true, None) => "; at one feed alone it may as well be a line in time".to_owned(),
        _ => String::new(),
    };
    format!(
        "{known}: {} cycles/mm ({} mm) on {}, amplitude {}{wheel}{doubt}",
        significant(found.line.frequency, 3),
        significant(1.0 / found.line.frequency, 3),
        channel.name,
        quantity(found.line.amplitude, &channel.unit)
    )
}
