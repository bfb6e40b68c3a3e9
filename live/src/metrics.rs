//! The status as metrics for Prometheus: OpenMetrics text, see `docs/reference/metrics.md`.
//!
//! Names begin with `trued_`, units are base units as recommended by Prometheus; each metric has the label `cell`. While the daemon does not respond, `trued_up` is 0 and
//! the others are omitted: an old value would look like a current one.

use std::fmt;

use prometheus_client::collector::Collector;
use prometheus_client::encoding::text::encode;
use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric, NoLabelSet};
use prometheus_client::metrics::MetricType;
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::registry::Registry;
use shm_schema::{FeedState, LeadState, TrimState};

use crate::report::Report;

/// The metrics of a cell as text; `report`: `None` before the first status.
///
/// # Errors
/// None in practice: writing to a string cannot fail.
pub fn metrics_text(cell: &str, report: Option<&Report>) -> Result<String, fmt::Error> {
    let mut registry = Registry::with_prefix("trued");
    let cell = CellCollector { name: escaped(cell), report: report.cloned() };
    registry.register_collector(Box::new(cell));
    let mut text = String::new();
    encode(&mut text, &registry)?;
    Ok(text)
}

/// The value of a label with the escapes of the format, which the library does not add.
fn escaped(value: &str) -> String {
    value.replace('\\', r"\\").replace('"', "\\\"").replace('\n', r"\n")
}

#[derive(Debug)]
struct CellCollector {
    /// Escaped.
    name: String,
    report: Option<Report>,
}

impl Collector for CellCollector {
    fn encode(&self, encoder: DescriptorEncoder<'_>) -> fmt::Result {
        let mut metrics = Metrics { cell: &self.name, encoder };
        let connected = self.report.as_ref().filter(|report| report.away.is_none());
        metrics.gauge(
            "up",
            "1 if the daemon of the cell responds",
            f64::from(u8::from(connected.is_some())),
        )?;
        let Some(report) = connected else { return Ok(()) };
        metrics.state(report)?;
        metrics.correction(report)?;
        metrics.latency(report)?;
        metrics.counts(report)?;
        metrics.sensor_inputs(report)
    }
}

struct Metrics<'a, 'e> {
    cell: &'a str,
    encoder: DescriptorEncoder<'e>,
}

/// Name and value of a label.
type Label<'a> = (&'static str, &'a str);

/// Names of the states, one of which applies.
const HEALTH: [&str; 6] = ["starting", "idle", "running", "degraded", "fault", "stopping"];
const MODES: [&str; 3] = ["shadow", "limited", "full"];
const RECORDER: [&str; 5] = ["off", "recording", "dropping", "failed", "stopped"];

impl Metrics<'_, '_> {
    fn put(&mut self, name: &str, help: &str, values: &[(Option<Label<'_>>, f64)]) -> fmt::Result {
        let gauge = ConstGauge::new(0.0);
        let mut metric = self.encoder.encode_descriptor(name, help, None, gauge.metric_type())?;
        for (label, value) in values {
            let labels: Vec<Label<'_>> =
                std::iter::once(("cell", self.cell)).chain(*label).collect();
            ConstGauge::new(*value).encode(metric.encode_family(&labels)?)?;
        }
        Ok(())
    }

    fn gauge(&mut self, name: &str, help: &str, value: f64) -> fmt::Result {
        self.put(name, help, &[(None, value)])
    }

    fn counter(&mut self, name: &str, help: &str, value: u64) -> fmt::Result {
        let counter = ConstCounter::new(value);
        let mut metric = self.encoder.encode_descriptor(name, help, None, counter.metric_type())?;
        counter.encode(metric.encode_family(&[("cell", self.cell)])?)
    }

    /// One value for each name: 1 for the state that applies.
    fn state_gauge(&mut self, name: &str, help: &str, states: &[&str], now: &str) -> fmt::Result {
        let value = |state: &&str| f64::from(u8::from(*state == now));
        let label = |state| Some(("state", state));
        let values: Vec<_> = states.iter().map(|state| (label(*state), value(state))).collect();
        self.put(name, help, &values)
    }

    fn state(&mut self, report: &Report) -> fmt::Result {
        self.state_gauge(
            "health",
            "1 for the state that the daemon is in",
            &HEALTH,
            report.health,
        )?;
        self.state_gauge("mode", "1 for the mode that the cell is in", &MODES, report.mode)?;
        self.state_gauge(
            "recorder",
            "1 for the state of the recorder",
            &RECORDER,
            report.recorder,
        )?;
        let flag = |is: bool| f64::from(u8::from(is));
        self.gauge(
            "bypassed",
            "1 if the correction is bypassed on request",
            flag(report.bypassed),
        )?;
        self.gauge("uptime_seconds", "Time since the daemon's start", report.uptime_s)?;
        self.gauge(
            "status_age_seconds",
            "Age of the status from which these metrics are taken",
            report.age_s,
        )?;
        let model = &report.model;
        self.gauge(
            "model_epoch",
            "Number of models loaded since the daemon's start",
            model.epoch as f64,
        )?;
        self.gauge(
            "model_holds",
            "0 where measurements of the tool contradict the model",
            flag(model.holds),
        )?;
        let name = "model_residual_meters";
        let help = "RMS deviation of the last tool measurements from the model";
        if model.residual_mm.is_finite() {
            self.gauge(name, help, 1e-3 * model.residual_mm)?;
        }
        let name = "model_uncompensated_effects";
        let help = "Effects of the model that are not compensated";
        self.gauge(name, help, f64::from(model.uncompensated_effects))
    }

    fn correction(&mut self, report: &Report) -> fmt::Result {
        let numbers: Vec<String> = (1..=report.joints.len()).map(|n| n.to_string()).collect();
        let of = |value: fn(&crate::report::Joint) -> f64| -> Vec<_> {
            let joints = report.joints.iter().zip(&numbers);
            joints.map(|(joint, n)| (Some(("joint", n.as_str())), value(joint))).collect()
        };
        let help = "Correction of the joint at the last command, rad or m";
        self.put("correction", help, &of(|joint| joint.correction))?;
        let help = "The same over its largest allowed value, -1 to 1";
        self.put("correction_ratio", help, &of(|joint| joint.share))
    }

    fn latency(&mut self, report: &Report) -> fmt::Result {
        let latency = &report.latency_us;
        let values = [
            ("50", latency.p50),
            ("99", latency.p99),
            ("99.9", latency.p999),
            ("100", latency.max),
        ];
        let values = values.map(|(percentile, us)| (Some(("percentile", percentile)), 1e-6 * us));
        let help = "Percentiles of the round-trip time since the daemon's start";
        self.put("latency_percentile_seconds", help, &values)?;
        let help = "Round-trip time from sending a command to its answer";
        let kind = MetricType::Histogram;
        let mut metric = self.encoder.encode_descriptor("latency_seconds", help, None, kind)?;
        let buckets: Vec<(f64, u64)> = latency
            .histogram
            .iter()
            .map(|bucket| (bucket.below.map_or(f64::MAX, |us| us / 1e6), bucket.count))
            .collect();
        let count = buckets.iter().map(|(_, count)| count).sum::<u64>();
        let sum = 1e-6 * latency.mean * count as f64;
        metric
            .encode_family(&[("cell", self.cell)])?
            .encode_histogram::<NoLabelSet>(sum, count, &buckets, None)
    }

    fn counts(&mut self, report: &Report) -> fmt::Result {
        let counts = &report.counts;
        for (name, help, value) in [
            ("cycles", "Cycles executed", counts.cycles),
            ("missed_cycles", "Cycles that missed their deadline", counts.missed_cycles),
            ("commands", "Commands received", counts.commands),
            ("commands_lost", "Commands lost, by their sequence numbers", counts.commands_lost),
            ("commands_rejected", "Commands rejected", counts.rejected),
            ("targets_held", "Targets with the last correction held", counts.held),
            ("command_silences", "Command timeouts", counts.stale),
            ("targets_lost", "Targets that could not be sent", counts.corrected_lost),
            ("messages_malformed", "Invalid messages", counts.malformed),
            ("force_blocks", "Blocks of force samples received", report.force.blocks),
            ("force_gaps", "Blocks of force samples lost", report.force.gaps),
            ("force_refused", "Blocks of force samples rejected", report.force.refused),
            ("trim_measurements", "Measured points of the tool", report.trim.measurements),
            ("trim_refused", "Measured points rejected", report.trim.refused),
            ("feed_refused", "Wrenches rejected by the feed adaptation", report.feed.refused),
            ("horizons_refused", "Horizons rejected", u64::from(report.lead.horizons_refused)),
            ("recorder_dropped", "Records that the recorder dropped", report.recorder_dropped),
        ] {
            self.counter(name, help, value)?;
        }
        Ok(())
    }

    fn sensor_inputs(&mut self, report: &Report) -> fmt::Result {
        let flag = |is: bool| f64::from(u8::from(is));
        let open = flag(report.force.wrench_gate == "open");
        self.gauge("wrench_gate_open", "1 if the wrench is used in the correction", open)?;
        let faults = report.force.faults.len() as f64;
        self.gauge("force_faults", "Faults of the force stream and its channels", faults)?;
        let line = flag(report.vibration.line.is_some());
        self.gauge("vibration_line", "1 while a line of the force spectrum is reported", line)?;
        let rpm = report.vibration.spindle_rpm;
        if rpm.is_finite() {
            self.gauge("spindle_hertz", "Spindle speed used by the vibration monitor", rpm / 60.0)?;
        }
        let stale = report.stale_temperatures.len() as f64;
        self.gauge("stale_temperatures", "Temperatures too old to be used", stale)?;
        self.feed(report)?;
        self.lead(report)?;
        self.trim(report)
    }

    fn feed(&mut self, report: &Report) -> fmt::Result {
        let feed = &report.feed;
        if feed.state == FeedState::Off.name() {
            return Ok(());
        }
        let share = 1e-2 * feed.override_percent;
        self.gauge(
            "feed_override_ratio",
            "Feed override as a fraction of the programmed feed",
            share,
        )?;
        for (name, help, value) in [
            ("feed_force_newtons", "Process force, low-passed", feed.force_n),
            (
                "feed_programmed_force_newtons",
                "Predicted process force at the programmed feed",
                feed.programmed_force_n,
            ),
            ("feed_limit_newtons", "Limit of the process force", feed.limit_n),
        ] {
            if value.is_finite() {
                self.gauge(name, help, value)?;
            }
        }
        Ok(())
    }

    fn lead(&mut self, report: &Report) -> fmt::Result {
        let lead = &report.lead;
        if lead.state == LeadState::Off.name() {
            return Ok(());
        }
        let points = f64::from(lead.horizon_points);
        self.gauge(
            "horizon_points",
            "Setpoints known ahead, of those used by the lead compensation",
            points,
        )
    }

    fn trim(&mut self, report: &Report) -> fmt::Result {
        if report.trim.state == TrimState::Off.name() {
            return Ok(());
        }
        let trim_m = 1e-3 * report.trim.length_mm();
        let found_m = 1e-3 * report.trim.found_length_mm();
        self.gauge("trim_meters", "Displacement applied to the tool target", trim_m)?;
        self.gauge("trim_found_meters", "Model error estimated from the instrument", found_m)
    }
}

#[cfg(test)]
mod tests {
    use super::metrics_text;
    use crate::report::Report;
    use shm_schema::{Mode, Status};

    fn report(away: Option<&str>) -> Report {
        let mut status =
            Status { joints: 2, mode: Mode::Full.code(), cycles: 12, ..Status::default() };
        status.correction[..2].copy_from_slice(&[1e-3, -2e-3]);
        status.bounds.angle[..2].copy_from_slice(&[2e-3, 4e-3]);
        status.latency_p99_ns = 25_000;
        (status.latency_counts[6], status.latency_counts[16]) = (2, 1);
        status.latency_sum_ns = 40_100_000;
        Report::new("line 4 \"east\"", &status, away.map(str::to_owned))
    }

    #[test]
    fn every_line_is_a_comment_or_a_sample_and_values_are_those_of_the_status() {
        let text = metrics_text("line 4 \"east\"", Some(&report(None))).expect("text");
        let sample = |begin: &str| {
            let line = text.lines().find(|line| line.starts_with(begin));
            let line = line.unwrap_or_else(|| panic!("{begin} in {text}"));
            line.rsplit(' ').next().and_then(|value| value.parse::<f64>().ok()).expect(begin)
        };
        let cell = "{cell=\"line 4 \\\"east\\\"\"";
        assert_eq!(sample(&format!("trued_up{cell}")), 1.0);
        assert_eq!(sample(&format!("trued_cycles_total{cell}")), 12.0);
        assert_eq!(sample(&format!("trued_mode{cell},state=\"full\"")), 1.0);
        assert_eq!(sample(&format!("trued_mode{cell},state=\"shadow\"")), 0.0);
        assert_eq!(sample(&format!("trued_correction_ratio{cell},joint=\"2\"")), -0.5);
        let latency = sample(&format!("trued_latency_percentile_seconds{cell},percentile=\"99\""));
        assert!((latency - 25e-6).abs() < 1e-12, "{latency}");
        let at_most = |le: &str| {
            sample(&format!(
                "trued_latency_seconds_bucket{{le=\"{le}\",cell=\"line 4 \\\"east\\\"\"}}"
            ))
        };
        assert_eq!([at_most("0.000001024"), at_most("+Inf")], [0.0, 3.0]);
        let seconds = sample(&format!("trued_latency_seconds_sum{cell}"));
        assert!((seconds - 0.0401).abs() < 1e-12, "{seconds}");
        assert!(text.ends_with("# EOF\n"));
    }

    #[test]
    fn a_daemon_that_is_away_has_no_figures_that_look_like_present_ones() {
        for text in [metrics_text("x", None), metrics_text("x", Some(&report(Some("it ended"))))] {
            let text = text.expect("text");
            let samples: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
            assert_eq!(samples.len(), 1, "{text}");
            assert!(samples[0].starts_with("trued_up") && samples[0].ends_with(" 0.0"), "{text}");
        }
    }
}
