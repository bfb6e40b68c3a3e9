//! The report as text, at most 80 columns wide.

use std::fmt::Write as _;

use report::significant;

use crate::fleet::{Alert, Answer, Interval, Reaches, RobotSummary};

/// Columns of a line.
const COLUMNS: usize = 80;

/// The whole answer.
#[must_use]
pub fn text(answer: &Answer) -> String {
    let mut lines = vec![headline(answer)];
    lines.extend(answer.alerts.iter().map(|alert| format!("  {}", sentence(alert))));
    if !answer.decreases.is_empty() {
        lines.push("Smaller than before:".to_owned());
        lines.extend(answer.decreases.iter().map(|alert| format!("  {}", sentence(alert))));
    }
    lines.extend(answer.robots.iter().map(robot));
    let mut text = String::new();
    for line in lines {
        let _ = writeln!(text, "{}", wrapped(&line));
    }
    text
}

/// What is the matter, in one sentence.
#[must_use]
pub fn headline(answer: &Answer) -> String {
    let recordings: usize = answer.robots.iter().map(|robot| robot.recordings).sum();
    let searched = format!(
        "{}, {}, {}",
        counted(answer.robots.len(), "robot", "robots"),
        counted(recordings, "recording", "recordings"),
        counted(answer.series, "series", "series")
    );
    match answer.alerts.len() {
        0 if answer.series == 0 => {
            format!("{searched}: no effect was found often enough to be evaluated.")
        }
        0 => format!("{searched}: no effect is growing."),
        alerts => {
            let mut robots: Vec<&str> =
                answer.alerts.iter().map(|alert| alert.robot.as_str()).collect();
            robots.sort_unstable();
            robots.dedup();
            format!("{searched}: {} on {}.", counted(alerts, "alert", "alerts"), robots.join(", "))
        }
    }
}

/// A change in words.
#[must_use]
pub fn sentence(alert: &Alert) -> String {
    let (_, unit) = number_and_unit(&alert.parameter);
    let with_unit = |value: f64| spaced(significant(value, 3), &unit);
    let what = match (&alert.per_month, &alert.step) {
        (Some(rate), _) => format!("changes by {} per month", ranged(rate, &unit)),
        (_, Some(step)) => format!("has a step of {}", ranged(step, &unit)),
        _ => "changes".to_owned(),
    };
    let since = &alert.since;
    let between = if since.day_ci95[0] == since.day_ci95[1] {
        String::new()
    } else {
        format!(", between {} and {}", since.day_ci95[0], since.day_ci95[1])
    };
    let [low, high] = alert.before.ci95;
    let before = match low <= 0.0 && 0.0 <= high {
        true => "0 within its uncertainty".to_owned(),
        false => with_unit(alert.before.value),
    };
    let mut text = format!(
        "{}, {}: {} {what} since {} (recording {}{between}); probability {:.3}. It was {} and is {}",
        alert.robot,
        place(alert),
        name(alert),
        since.day,
        since.recording,
        alert.probability.min(0.999),
        before,
        with_unit(alert.now.value)
    );
    if let Some(size) = &alert.size_now {
        let place = if alert.domain == "position" { " at the tool" } else { "" };
        let _ = write!(
            text,
            ", {}{place} (largest {})",
            spaced(significant(size.rms, 3), &size.unit),
            spaced(significant(size.max, 3), &size.unit)
        );
    }
    text.push('.');
    if !alert.also.is_empty() {
        let _ = write!(text, " Also: {}.", alert.also.join(", "));
    }
    if let Some(reaches) = &alert.reaches_tolerance {
        text += &tolerance(reaches);
    }
    text
}

fn tolerance(reaches: &Reaches) -> String {
    match (&reaches.day, reaches.is_reached) {
        (_, true) => " Its largest error exceeds the tolerance.".to_owned(),
        (Some(day), false) => {
            let [early, late] = &reaches.day_ci95;
            let early = early.as_deref().unwrap_or(day);
            let late = late.as_deref().map_or("never".to_owned(), str::to_owned);
            format!(
                " Its largest error reaches the tolerance about {day} ({early} to {late}) if this continues."
            )
        }
        (None, false) => String::new(),
    }
}

/// Effect and joint: `backlash of joint 2`, `transmission error of joint 3 at 2 cycles`.
#[must_use]
pub fn place(alert: &Alert) -> String {
    let effect = alert.effect.replace('_', " ");
    let at_joint = alert.joint.map_or(String::new(), |joint| format!(" of joint {joint}"));
    let form = match alert.form {
        Some(joint) if alert.effect == "joint_coupling" => format!(" to joint {joint}"),
        Some(cycles) => format!(" at {cycles} cycles"),
        None => String::new(),
    };
    format!("{effect}{at_joint}{form}")
}

/// The number without its unit: `width`, `shift 2`.
fn name(alert: &Alert) -> String {
    let (name, _) = number_and_unit(&alert.parameter);
    alert.index.map_or_else(|| name.clone(), |index| format!("{name} {index}"))
}

/// A parameter's name apart from its unit: `compliance` and `mrad/kNm` of `compliance_mrad_per_kNm`.
#[must_use]
pub fn number_and_unit(parameter: &str) -> (String, String) {
    const UNITS: [&str; 12] =
        ["mrad", "mm", "um", "Nm", "N", "kg", "deg", "ms", "s", "rad", "kgm", "kgm2"];
    let parts: Vec<&str> = parameter.split('_').collect();
    let is_unit = |i: usize| i > 0 && UNITS.contains(&parts[i]);
    match (0..parts.len()).find(|i| is_unit(*i)) {
        Some(index) => (parts[..index].join(" "), parts[index..].join(" ").replace(" per ", "/")),
        None => (parts.join(" "), String::new()),
    }
}

fn ranged(interval: &Interval, unit: &str) -> String {
    let half = 0.5 * (interval.ci95[1] - interval.ci95[0]);
    spaced(format!("{} ± {}", significant(interval.value, 3), significant(half, 2)), unit)
}

fn spaced(number: String, unit: &str) -> String {
    if unit.is_empty() { number } else { format!("{number} {unit}") }
}

fn robot(robot: &RobotSummary) -> String {
    let mut text =
        format!("{}: {}", robot.robot, counted(robot.recordings, "recording", "recordings"));
    if let (Some(from), Some(to)) = (&robot.from, &robot.to) {
        let _ = write!(text, " from {from} to {to}");
    }
    let _ = write!(text, ", {}", counted(robot.series, "series", "series"));
    for (count, what) in
        [(robot.refused, "refused"), (robot.without_time, "without a time, left out")]
    {
        if count > 0 {
            let _ = write!(text, ", {count} {what}");
        }
    }
    if robot.has_one_time {
        text += "; its recordings have one and the same time, which says nothing about growth";
    }
    match robot.alerts {
        0 => text + "; no alert",
        alerts => format!("{text}; {}", counted(alerts, "alert", "alerts")),
    }
}

fn counted(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// A line broken between words; what follows is indented by two more.
fn wrapped(line: &str) -> String {
    let indent = line.len() - line.trim_start().len();
    let mut lines: Vec<String> = Vec::new();
    for word in line.split_whitespace() {
        match lines.last_mut() {
            Some(last) if last.chars().count() + 1 + word.chars().count() <= COLUMNS => {
                last.push(' ');
                last.push_str(word);
            }
            Some(_) => lines.push(format!("{}{word}", " ".repeat(indent + 2))),
            None => lines.push(format!("{}{word}", " ".repeat(indent))),
        }
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parameter_is_a_name_and_a_unit() {
        for (parameter, name, unit) in [
            ("width_mrad", "width", "mrad"),
            ("compliance_mrad_per_kNm", "compliance", "mrad/kNm"),
            ("ratio", "ratio", ""),
            ("growth_um_per_K", "growth", "um/K"),
            ("dynamic_compliance_mm_per_kN", "dynamic compliance", "mm/kN"),
        ] {
            assert_eq!(number_and_unit(parameter), (name.to_owned(), unit.to_owned()));
        }
    }

    #[test]
    fn no_line_is_wider_than_a_terminal() {
        let line = format!("  {}", "backlash of joint 2 ".repeat(30));
        assert!(wrapped(&line).lines().all(|line| line.chars().count() <= COLUMNS));
        assert!(wrapped(&line).lines().skip(1).all(|line| line.starts_with("    ")));
    }
}
