//! The present state of a cell as a page to save (`/report`): the status, and the last five minutes.
//!
//! Laid out as all reports: subject, verdict, one picture, four numbers, next step; then the details. Computed from the state and the history that the live view
//! has received; sends no request to the cell and writes no file.

mod pictures;
mod vibration_events;

use std::sync::Arc;

use ::report::{
    Axis, Bars, Column, Number, Page, Provenance, Table, Tone, capitalised, duration, fixed,
    pluralise, quantity, significant,
};
use recording::mcap_recording::Utc;

use crate::cell_watch::CellState;
use crate::history::{Entries, Latency, SPAN_MS};
use crate::report::Report;
use shm_schema::VibrationState;
use vibration_events::VibrationEvent;

/// Age at which a status is out of date, s: one is published every 40 ms.
const STATUS_AGE_MAX_S: f64 = 1.0;
/// Largest number of rows in the table of events.
const EVENTS_MAX: usize = 100;

/// Content of a page.
pub(crate) struct SnapshotPage {
    /// The state.
    pub(crate) cell_state: Arc<CellState>,
    /// The last five minutes.
    pub(crate) entries: Entries,
    /// This computer's clock, ms since 1970.
    pub(crate) now_ms: u64,
}

/// The verdict and the next step.
struct Headline {
    tone: Tone,
    label: String,
    sentence: String,
    next: &'static str,
    /// Command for the next step, without the cell's name, which is appended.
    command: &'static str,
}

impl SnapshotPage {
    /// File name under which a browser saves the page: `CELL-YYYYMMDD-HHMMSS.html`, UTC.
    pub(crate) fn file_name(&self) -> String {
        let digits: String = self.utc().chars().filter(char::is_ascii_digit).take(14).collect();
        let (day, time) = digits.split_at(8.min(digits.len()));
        format!("{}-{day}-{time}.html", self.cell_state.report.cell)
    }

    /// The page as HTML.
    pub(crate) fn html(&self) -> String {
        let report = &self.cell_state.report;
        let episodes = vibration_events::from_events(&self.entries.events, self.now_ms);
        let headline = self.headline(&episodes);
        let robot = &report.robot;
        let serial = if robot.serial.is_empty() {
            String::new()
        } else {
            format!("serial {}", robot.serial)
        };
        let named = [robot.maker.as_str(), &robot.kind, &serial];
        let named: Vec<&str> = named.into_iter().filter(|name| !name.is_empty()).collect();
        let mut page = Page::new(format!("Cell {}: {}", report.cell, headline.label))
            .kicker("trued live")
            .robot(named.join(" "))
            .about("Cell", &report.cell)
            .about("Model", &report.model.hash)
            .provenance(Provenance {
                date_utc: format!(
                    "{} UTC",
                    self.utc().get(..19).unwrap_or_default().replace('T', " ")
                ),
                version: recording::program::version().to_owned(),
                command: format!("trued live {}", report.cell),
                ..Provenance::default()
            })
            .verdict(headline.tone, &headline.label, &headline.sentence);
        let rings = episodes.iter().any(|one| one.is_alarm);
        let force = pictures::spectrogram(&self.entries.spectra, &episodes, self.now_ms);
        let force_caption = "Amplitude of the force over frequency and time, the largest of the force channels; outlined: vibration events, empty: no force samples.";
        let joints_caption = "Correction of each joint at the last command, relative to its limit.";
        page = match &force {
            Some(force) if rings => page.figure(force_caption, force),
            _ => page.figure(joints_caption, &joint_bars(report)),
        };
        page = page
            .numbers(self.numbers(&episodes))
            .next(headline.next, Some(&format!("{} {}", headline.command, report.cell)))
            .section("Joints");
        if force.is_some() && rings {
            page = page.figure(joints_caption, &joint_bars(report));
        }
        page = self.robot(page.table(&joint_table(report)));
        page = self.latency(page).section("Force and vibration");
        page = match &force {
            Some(_) if rings => page.text("The picture at the top shows the force."),
            Some(force) => page.figure(force_caption, force),
            None => page.text("No force samples in the last five minutes."),
        };
        page = if episodes.is_empty() {
            page
        } else {
            page.table(&vibration_events::table(&episodes, self.now_ms))
        };
        page = page.facts(force_facts(report)).section("Events of the last five minutes");
        page = self.events(page).section("Counters and model").facts(counters(report));
        page.footer("Values are those of the last status that the live view received; counters since the start of the daemon.").render()
    }

    fn utc(&self) -> String {
        Utc(self.now_ms.saturating_mul(1_000_000)).to_string()
    }

    /// The first of these that applies: no daemon or status, restricted, not correcting; otherwise correcting.
    fn headline(&self, episodes: &[VibrationEvent]) -> Headline {
        let found = self
            .no_daemon_headline()
            .or_else(|| self.restricted_headline())
            .or_else(|| self.uncorrected_headline());
        found.unwrap_or_else(|| self.correcting_headline(episodes))
    }

    fn no_daemon_headline(&self) -> Option<Headline> {
        let report = &self.cell_state.report;
        let (label, why) = match &report.away {
            Some(why) => ("no daemon", capitalised(why)),
            None if report.age_s > STATUS_AGE_MAX_S => {
                ("no status", format!("No status for {}", duration(report.age_s)))
            }
            None => return None,
        };
        Some(Headline {
            tone: Tone::Bad,
            label: label.to_owned(),
            sentence: format!("{why}. All values are the last known ones."),
            next: "Find out why the daemon does not respond, and start it again.",
            command: "trued status",
        })
    }

    fn restricted_headline(&self) -> Option<Headline> {
        let report = &self.cell_state.report;
        let state = self.cell_state.status.verdict.state();
        let rings = matches!(state, Ok(VibrationState::Alarm | VibrationState::Confirmed));
        let line = report.vibration.line.as_ref().filter(|_| rings && report.health != "fault");
        if let Some(line) = line {
            return Some(Headline {
                tone: Tone::Bad,
                label: "vibration alarm".to_owned(),
                sentence: format!("{}.", capitalised(line)),
                next: "Follow the advice above, and mark the moment in the recording for an analysis.",
                command: "trued mark 'vibration alarm'",
            });
        }
        let (tone, otherwise) = match report.health {
            "fault" => (Tone::Bad, "The daemon corrects nothing"),
            "degraded" => (Tone::Caution, "The daemon works with restrictions"),
            _ => return None,
        };
        let details = self.details();
        let sentence = if details.is_empty() { otherwise } else { &details };
        Some(Headline {
            tone,
            label: report.health.to_owned(),
            sentence: format!("{}.", capitalised(sentence)),
            next: "Remove the cause that is named above; the status has the details.",
            command: "trued status",
        })
    }

    fn uncorrected_headline(&self) -> Option<Headline> {
        let report = &self.cell_state.report;
        let (label, sentence, next, command) = if report.bypassed {
            (
                "bypassed".to_owned(),
                "The correction is bypassed on request: targets are sent as commanded.".to_owned(),
                "Restore the correction once the reason for the bypass is gone.",
                "trued bypass off",
            )
        } else if report.mode == "shadow" {
            (
                format!("{}, mode shadow", report.health),
                format!("The correction is computed and not sent. {}", self.largest_share_text()),
                "Let the cell correct, within a tenth of the limits first.",
                "trued mode limited",
            )
        } else {
            return None;
        };
        Some(Headline { tone: Tone::Caution, label, sentence, next, command })
    }

    fn correcting_headline(&self, episodes: &[VibrationEvent]) -> Headline {
        let report = &self.cell_state.report;
        let label = format!("{}, mode {}", report.health, report.mode);
        let alarms: Vec<&VibrationEvent> = episodes.iter().filter(|one| one.is_alarm).collect();
        if let Some(last) = alarms.last() {
            let alarms = pluralise(alarms.len(), "vibration alarm");
            return Headline {
                tone: Tone::Caution,
                label,
                sentence: format!(
                    "{alarms} in the last five minutes, the last at {}. {}",
                    last.name,
                    self.largest_share_text()
                ),
                next: "Mark the moment in the recording for an analysis of the vibration.",
                command: "trued mark 'vibration alarm'",
            };
        }
        let details = self.details();
        let also =
            if details.is_empty() { details } else { format!(" {}.", capitalised(&details)) };
        Headline {
            tone: Tone::Good,
            label,
            sentence: format!("{}{also}", self.largest_share_text()),
            next: "No action is needed. To follow the cell:",
            command: "trued live",
        }
    }

    /// The status message without its first part (the state).
    fn details(&self) -> String {
        self.cell_state.report.message.split("; ").skip(1).collect::<Vec<_>>().join("; ")
    }

    fn largest_share_text(&self) -> String {
        let (joint, share) = largest(&self.cell_state.report);
        format!("The largest correction is {} % of its limit (joint {joint}).", percent(share))
    }

    fn numbers(&self, episodes: &[VibrationEvent]) -> [Number; 4] {
        let report = &self.cell_state.report;
        let (joint, share) = largest(report);
        let tone = if share >= 1.0 { Tone::Caution } else { Tone::Plain };
        let counts = &report.counts;
        let refused = counts.rejected + counts.held + counts.commands_lost;
        let period = period_s(&self.entries.latency);
        let note = period.map_or("no commands in the last five minutes".to_owned(), |period_s| {
            format!("commands every {}", duration(period_s))
        });
        let alarms = episodes.iter().filter(|one| one.is_alarm).count();
        [
            Number::text("Largest correction", format!("{} %", percent(share)))
                .note(format!("of its limit, joint {joint}"))
                .tone(tone),
            Number::text("Latency, 99 %", latency(report.latency_us.p99)).note(note),
            Number::text("Rejected, held or lost", refused.to_string())
                .note(format!("of {} since the start", count_of(counts.commands, "command"))),
            Number::text("Vibration alarms", alarms.to_string())
                .note(format!("in five minutes; monitor {}", report.vibration.watch))
                .tone(if alarms > 0 { Tone::Bad } else { Tone::Plain }),
        ]
    }

    fn robot(&self, page: Page) -> Page {
        let page = page.section("Robot at the last command");
        match self.cell_state.robot.as_ref().map(pictures::robot) {
            Some(Ok((side, above, factor, shift_mm))) => page
                .figure(&format!("From the side. The correction displaces the tool by {}, drawn {factor} times as long.", quantity(shift_mm, "mm")), &side)
                .figure("From above.", &above),
            Some(Err(why)) => page.text(&format!("Not drawn: {why}.")),
            None => page.text("Not drawn: the live view was started without the cell's configuration file."),
        }
    }

    fn latency(&self, page: Page) -> Page {
        let (latency_us, page) = (&self.cell_state.report.latency_us, page.section("Latency"));
        let period_s = period_s(&self.entries.latency);
        let page = match pictures::latency(&self.entries.latency, period_s, self.now_ms) {
            Some(plot) => page.figure("99th percentile of the time from a command to its answer, since the start of the daemon.", &plot),
            None => page.text("No command was answered in the last five minutes."),
        };
        page.facts([
            ("Median", latency(latency_us.p50)),
            ("99 %", latency(latency_us.p99)),
            ("99.9 %", latency(latency_us.p999)),
            ("Largest", latency(latency_us.max)),
            ("Period of the commands", period_s.map_or("unknown".to_owned(), duration)),
            ("Late cycles", self.cell_state.report.counts.missed_cycles.to_string()),
        ])
    }

    fn events(&self, page: Page) -> Page {
        if self.entries.events.is_empty() {
            return page.text("None.");
        }
        let table = Table::new("Newest first", ["UTC", "Event"]);
        let newest = self.entries.events.iter().rev().take(EVENTS_MAX);
        let table = newest.fold(table, |table, event| {
            let utc = Utc(event.t_ms.saturating_mul(1_000_000)).to_string();
            table.row([utc.get(11..19).unwrap_or_default().into(), event.says.as_str().into()])
        });
        page.table(&table)
    }
}

fn percent(share: f64) -> String {
    fixed(1e2 * share, if share < 0.1 { 1 } else { 0 })
}

fn latency(us: f64) -> String {
    if us > 0.0 { duration(1e-6 * us) } else { "–".to_owned() }
}

fn count_of(number: u64, what: &str) -> String {
    pluralise(usize::try_from(number).unwrap_or(usize::MAX), what)
}

/// The joint, from 1, whose correction is nearest to its limit, and the share of the limit.
fn largest(report: &Report) -> (usize, f64) {
    let shares = report.joints.iter().map(|joint| joint.share.abs()).enumerate();
    shares.max_by(|a, b| a.1.total_cmp(&b.1)).map_or((1, 0.0), |(k, share)| (k + 1, share))
}

/// Median time between two commands, s, from the command counts at successive times; pauses of the robot are ignored.
fn period_s(latency: &[Latency]) -> Option<f64> {
    let pairs = latency.iter().zip(latency.iter().skip(1));
    let period_s = |(before, after): (&Latency, &Latency)| {
        let ((from_ns, from), (to_ns, to)) = (before.counted, after.counted);
        let commands = to.checked_sub(from).filter(|count| *count > 1)?;
        Some(1e-9 * to_ns.checked_sub(from_ns)? as f64 / commands as f64)
    };
    let mut periods: Vec<f64> = pairs.filter_map(period_s).collect();
    periods.sort_by(f64::total_cmp);
    periods.get(periods.len() / 2).copied()
}

fn joint_bars(report: &Report) -> ::report::Svg {
    let axis = Axis::new("Correction relative to its limit", "%").range(0.0, 100.0);
    let bars = Bars::new("Correction of each joint", axis).groups(["correction"]);
    let joints = report.joints.iter().enumerate();
    let row = |bars: Bars, (k, joint): (usize, &crate::report::Joint)| {
        bars.row(format!("Joint {}", k + 1), [1e2 * joint.share.abs()])
    };
    joints.fold(bars, row).render()
}

fn joint_table(report: &Report) -> Table {
    let heads = [
        Column::new("Joint"),
        Column::new("Command (rad, m)").digits(5),
        Column::new("Correction (mrad, mm)"),
        Column::new("Limit (mrad, mm)"),
        Column::new("Share (%)"),
    ];
    let table =
        Table::new("The last command and its correction; m and mm for a linear joint", heads);
    report.joints.iter().enumerate().fold(table, |table, (k, joint)| {
        table.row([
            (k + 1).to_string().into(),
            joint.command.into(),
            (1e3 * joint.correction).into(),
            (1e3 * joint.correction_max).into(),
            (1e2 * joint.share).into(),
        ])
    })
}

fn force_facts(report: &Report) -> Vec<(&'static str, String)> {
    let (force, vibration) = (&report.force, &report.vibration);
    let known = |value: f64, unit| {
        if value.is_finite() { quantity(value, unit) } else { "unknown".to_owned() }
    };
    let faults = if force.faults.is_empty() { "none".to_owned() } else { force.faults.join("; ") };
    vec![
        ("Vibration monitor", vibration.watch.to_owned()),
        ("Line now", vibration.line.clone().unwrap_or("none".to_owned())),
        ("Spindle", known(vibration.spindle_rpm, "rev/min")),
        ("Feed", known(vibration.feed_mm_s, "mm/s")),
        ("Wrench gate", force.wrench_gate.to_owned()),
        ("Force blocks", force.blocks.to_string()),
        ("Missing, refused", format!("{}, {}", force.gaps, force.refused)),
        ("Faults", faults),
    ]
}

fn counters(report: &Report) -> Vec<(&'static str, String)> {
    let (counts, model) = (&report.counts, &report.model);
    let number = |count: u64| count.to_string();
    let residual = match model.measurements {
        0 => "no measurement".to_owned(),
        _ => format!("{} rms", quantity(model.residual_mm, "mm")),
    };
    vec![
        ("Commands", number(counts.commands)),
        ("Commands lost", number(counts.commands_lost)),
        ("Rejected", number(counts.rejected)),
        ("Held", number(counts.held)),
        ("Interruptions of the commands", number(counts.stale)),
        ("Cycles", number(counts.cycles)),
        ("Late cycles", number(counts.missed_cycles)),
        ("Answers not delivered", number(counts.corrected_lost)),
        ("Messages not readable", number(counts.malformed)),
        ("Recorder", format!("{}, {} records dropped", report.recorder, report.recorder_dropped)),
        ("Daemon", format!("process {}, for {}", report.pid, duration(report.uptime_s))),
        ("Model", format!("{}, number {} since the start", model.hash, model.epoch)),
        ("Geometry", model.geometry_hash.clone()),
        ("Effects not compensated", model.uncompensated_effects.to_string()),
        ("Measurements against the model", residual),
        (
            "Feed override",
            format!("{}, {} %", report.feed.state, significant(report.feed.override_percent, 3)),
        ),
    ]
}

/// Start of the time axis of a picture, s relative to now: five minutes ago, or later if the live view has a shorter history.
fn begin_s(first_ms: Option<u64>, now_ms: u64) -> f64 {
    let known_ms = first_ms.map_or(SPAN_MS, |first| now_ms.saturating_sub(first));
    -1e-3 * known_ms.clamp(10_000, SPAN_MS) as f64
}

#[cfg(test)]
mod tests;
