//! A status as lines for a terminal.

use live::report::{Latency, Report};
use report::labelled;
use shm_schema::{FeedReason, FeedState, LeadState, TrimReason, TrimState};

/// Width of the labels on the left.
const INDENT: usize = 10;
/// A status older than this is out of date, s: one arrives every 40 ms.
const STATUS_AGE_MAX_S: f64 = 1.0;

/// The lines of a status.
pub(super) fn lines(report: &Report) -> Vec<String> {
    let mut lines = Vec::new();
    let mut put = |name: &str, text: &str| lines.extend(labelled(name, INDENT, text));
    let Report { cell, pid, uptime_s, .. } = report;
    put("cell", &format!("{cell}, daemon process {pid}, up {}", duration(*uptime_s)));
    if let Some(away) = &report.away {
        put("daemon", &format!("NOT RUNNING: {away}. Last known state:"));
    } else if report.age_s > STATUS_AGE_MAX_S {
        let age = duration(report.age_s);
        put(
            "daemon",
            &format!("NO STATUS for {age}: it may be stopped or overloaded. Last known state:"),
        );
    }
    // The message begins with the model's name and the health.
    let mut parts = report.message.split("; ");
    let name = parts.next().and_then(|first| first.rsplit_once(": ")).map(|(name, _)| name);
    put("health", report.health);
    parts.for_each(|part| put("", part));
    put("mode", report.mode);
    if report.bypassed {
        put("bypass", "ON: the correction is zero; `trued bypass off` ends the bypass");
    } else {
        put("bypass", "off");
    }
    put("robot", &robot(report));
    put("model", &model(report, name));
    put("corrected", &corrected(report));
    let counts = &report.counts;
    put(
        "commands",
        &format!(
            "{}; rejected {}, held {}, lost {}, timeouts {}",
            counts.commands, counts.rejected, counts.held, counts.commands_lost, counts.stale
        ),
    );
    put("cycles", &format!("{}; late {}", counts.cycles, counts.missed_cycles));
    put("latency", &latency(&report.latency_us));
    let force = &report.force;
    put(
        "force",
        &format!(
            "wrench gate {}; blocks {}, missing {}, rejected {}",
            force.wrench_gate, force.blocks, force.gaps, force.refused
        ),
    );
    let vibration = &report.vibration;
    let line = vibration.line.as_ref().map_or(String::new(), |line| format!("; {line}"));
    put("vibration", &format!("{}{line}", vibration.watch));
    if let Some(trim) = trim(report) {
        put("trim", &trim);
    }
    if let Some(lead) = lead(report) {
        put("lead", &lead);
    }
    if let Some(feed) = feed(report) {
        put("feed", &feed);
    }
    put("recorder", &format!("{}; dropped {}", report.recorder, report.recorder_dropped));
    lines
}

/// State of the trim by an instrument; none in a cell without one.
fn trim(report: &Report) -> Option<String> {
    let trim = &report.trim;
    if trim.state == TrimState::Off.name() {
        return None;
    }
    let reason = match trim.reason {
        reason if reason == TrimReason::None.name() => String::new(),
        reason => format!(" ({reason})"),
    };
    Some(format!(
        "{}{reason}; applied {:.3} mm, estimated {:.3} mm; measurements {}, rejected {}",
        trim.state,
        trim.length_mm(),
        trim.found_length_mm(),
        trim.measurements,
        trim.refused
    ))
}

/// State of the lead of moving joints; `None` in a cell without it.
fn lead(report: &Report) -> Option<String> {
    let lead = &report.lead;
    if lead.state == LeadState::Off.name() {
        return None;
    }
    if lead.state == LeadState::NothingInTime.name() {
        return Some("inactive: the model has no joint delay, lag or mode".to_owned());
    }
    Some(format!(
        "{}; {} of {} setpoints ahead known; {} horizons rejected",
        lead.state, lead.horizon_points, lead.horizon_points_used, lead.horizons_refused
    ))
}

/// State of the feed adaptation; `None` in a cell without it.
fn feed(report: &Report) -> Option<String> {
    let feed = &report.feed;
    if feed.state == FeedState::Off.name() {
        return None;
    }
    let reason = match feed.reason {
        reason if reason == FeedReason::None.name() => String::new(),
        reason => format!(" ({reason})"),
    };
    let newtons = |n: f64| if n.is_finite() { format!("{n:.0} N") } else { "unknown".to_owned() };
    Some(format!(
        "{}{reason}; override {:.0} %, requested {:.0} %; force {}, at the programmed feed {}, limit {}",
        feed.state,
        feed.override_percent,
        feed.wanted_percent,
        newtons(feed.force_n),
        newtons(feed.programmed_force_n),
        newtons(feed.limit_n)
    ))
}

fn robot(report: &Report) -> String {
    let robot = &report.robot;
    let named = [&robot.maker, &robot.kind].map(String::as_str);
    let mut text: Vec<&str> = named.into_iter().filter(|name| !name.is_empty()).collect();
    if text.is_empty() {
        text.push("not stated");
    }
    let serial = match robot.serial.as_str() {
        "" => String::new(),
        serial => format!(", serial {serial}"),
    };
    format!("{}{serial}, {} joints", text.join(" "), robot.joints)
}

/// The joint whose correction is nearest to its limit.
fn corrected(report: &Report) -> String {
    let shares = report.joints.iter().map(|joint| joint.share.abs()).enumerate();
    match shares.max_by(|a, b| a.1.total_cmp(&b.1)) {
        Some((joint, share)) if share > 0.0 => {
            let percent = 100.0 * share;
            format!("joint {} by {percent:.1} % of its limit, the other joints less", joint + 1)
        }
        _ => "nothing".to_owned(),
    }
}

fn model(report: &Report, name: Option<&str>) -> String {
    let model = &report.model;
    let name = name.map_or(String::new(), |name| format!("{name}, "));
    let holds = match (model.holds, model.measurements) {
        (false, _) => "; OUTDATED according to measurements".to_owned(),
        (true, 0) => String::new(),
        (true, count) => format!("; confirmed by {count} measurements"),
    };
    // It is known from the first cycle on.
    let epoch = match model.epoch {
        0 => String::new(),
        epoch => format!(", epoch {epoch}"),
    };
    format!("{name}hash {}{epoch}{holds}", model.hash)
}

/// A time that a person reads.
fn duration(seconds: f64) -> String {
    let whole = seconds.max(0.0).round() as u64;
    let (days, hours, minutes) = (whole / 86_400, whole / 3600 % 24, whole / 60 % 60);
    match (days, hours, minutes) {
        (0, 0, 0) => format!("{whole} s"),
        (0, 0, _) => format!("{minutes} min {} s", whole % 60),
        (0, _, _) => format!("{hours} h {minutes} min"),
        _ => format!("{days} d {hours} h"),
    }
}

fn latency(latency: &Latency) -> String {
    if latency.max <= 0.0 {
        return "unknown: no command so far".to_owned();
    }
    format!(
        "median {:.1} µs, 99 % {:.1} µs, 99.9 % {:.1} µs, largest {:.1} µs",
        latency.p50, latency.p99, latency.p999, latency.max
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use trued_client::Status;

    #[test]
    fn a_bypass_and_a_daemon_that_is_gone_are_reported_with_the_way_out() {
        let mut status = Status { bypassed: 1, joints: 6, ..Status::default() };
        let text = |status: &Status, away: Option<&str>| {
            lines(&Report::new("cell", status, away.map(str::to_owned))).join("\n")
        };
        let text_shown = text(&status, None);
        assert!(text_shown.contains("`trued bypass off`"), "{text_shown}");
        status.bypassed = 0;
        let text_shown = text(&status, Some("no daemon is there now"));
        assert!(
            text_shown.contains("bypass    off") && text_shown.contains("NOT RUNNING"),
            "{text_shown}"
        );
    }

    #[test]
    fn times_have_readable_units() {
        let durations = [5.4, 65.0, 3_700.0, 200_000.0].map(duration);
        assert_eq!(durations, ["5 s", "1 min 5 s", "1 h 1 min", "2 d 7 h"]);
    }
}
