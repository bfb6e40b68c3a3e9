//! State of the cutting process, from the cell's report, the commanded path or the configuration, in this order of precedence.
//!
//! Runs in the supervisor's thread. An expired report is no longer used, and this is logged;
//! unknown values are reported as unknown. The spindle is never commanded.

use crate::exchange::Exchange;
use crate::setup;
use crate::tool_motion::{PathTracker, ToolMotion};
use recording::cell::CellConfig;
use recording::model::RobotModel;
use recording::series::CoordinateFrame;
use shm_schema::{Answer, InCut, Request};
use spectrum::{GEAR_FREQUENCIES_MAX, GearFrequency, MODES_MAX, Mode, ProcessState};
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};
use tracing::info;

/// Process state for the vibration monitor, as sent to its thread.
#[derive(Clone, Copy, Debug)]
pub struct MonitorInputs {
    /// Spindle, teeth, feed, cut.
    pub state: ProcessState,
    /// Gear shafts along the present path.
    pub wheels: [Option<GearFrequency>; GEAR_FREQUENCIES_MAX],
    /// The model's natural frequencies.
    pub modes: [Option<Mode>; MODES_MAX],
}

/// The cell's last report. Unknown values are NaN, 0 or `None`.
#[derive(Clone, Copy, Debug)]
struct ProcessReport {
    state: ProcessState,
    until: Option<Instant>,
}

/// State of the process from all sources.
#[derive(Debug)]
pub struct ProcessTracker {
    configured: ProcessState,
    frame: CoordinateFrame,
    reported: Option<ProcessReport>,
    travel: PathTracker,
    modes: [Option<Mode>; MODES_MAX],
    state: ProcessState,
}

impl ProcessTracker {
    /// From the configuration and the model.
    pub fn new(config: &CellConfig, model: &RobotModel) -> Self {
        let configured =
            config.vibration.map_or_else(ProcessState::default, |vibration| ProcessState {
                spindle_rpm: vibration.spindle_rpm.unwrap_or(0.0),
                teeth: vibration.teeth.unwrap_or(0),
                ..ProcessState::default()
            });
        let mut process = Self {
            configured,
            frame: config.wrench.frame,
            reported: None,
            travel: PathTracker::default(),
            modes: [None; MODES_MAX],
            state: configured,
        };
        process.set_model(model);
        process
    }

    /// A new model is active.
    pub fn set_model(&mut self, model: &RobotModel) {
        self.travel.clear();
        self.modes = [None; MODES_MAX];
        for (place, mode) in self.modes.iter_mut().zip(setup::modes(model, self.frame)) {
            *place = Some(mode);
        }
    }

    /// The state that the monitor uses now: 0 is unknown, or at rest.
    pub fn state(&self) -> ProcessState {
        self.state
    }

    /// Stores a report of the cell.
    pub fn add_report(&mut self, exchange: &Exchange, request: &Request) -> (Answer, String) {
        let (spindle_rpm, feed_mm_s) = (request.spindle_rpm, request.feed_mm_s);
        let possible = |x: f64| x.is_nan() || (0.0..f64::INFINITY).contains(&x);
        if !possible(spindle_rpm) || !possible(feed_mm_s) {
            let message = "spindle speed and feed must be 0 or more, or NaN if unknown";
            return (Answer::Refused, message.to_owned());
        }
        let cut = match request.in_cut() {
            Ok(cut) => cut,
            Err(unknown) => return (Answer::Refused, unknown.to_string()),
        };
        let in_cut = match cut {
            InCut::Unknown => None,
            InCut::Air => Some(false),
            InCut::Cut => Some(true),
        };
        let holds = Duration::from_millis(u64::from(request.holds_ms));
        let until = (request.holds_ms > 0).then(|| Instant::now() + holds);
        let state = ProcessState { spindle_rpm, teeth: request.teeth, feed_mm_s, in_cut };
        self.reported = Some(ProcessReport { state, until });
        exchange.spindle_rpm_bits.store(spindle_rpm.to_bits(), Relaxed);
        let message = format!(
            "spindle {spindle_rpm} rev/min, {} teeth, feed {feed_mm_s} mm/s, in {cut}",
            request.teeth
        );
        (Answer::Done, message)
    }

    /// Updates from the commanded path, drops expired reports, and informs the monitor.
    pub fn update(&mut self, model: &RobotModel, exchange: &Exchange, commands_come: bool) {
        let arm = &model.physics.arm;
        while let Some(point) = exchange.path.pop() {
            self.travel.add(arm, &point);
        }
        if !commands_come {
            self.travel.clear();
        }
        if self
            .reported
            .is_some_and(|reported| reported.until.is_some_and(|until| until <= Instant::now()))
        {
            info!("the reported process state has expired");
            self.reported = None;
            exchange.spindle_rpm_bits.store(f64::NAN.to_bits(), Relaxed);
        }
        let motion = self.travel.motion(arm);
        self.state = self.merged(motion.as_ref());
        let mut known = MonitorInputs {
            state: self.state,
            wheels: [None; GEAR_FREQUENCIES_MAX],
            modes: self.modes,
        };
        let turning = motion.map_or_else(Vec::new, |motion| {
            model.file.gear_cycles(&motion.turns_per_mm, GearFrequency::new).collect()
        });
        // Verdicts name shafts: only their rotations are monitored, not their teeth.
        let shafts = turning.into_iter().filter(|wheel| wheel.teeth == 1);
        for (place, wheel) in known.wheels.iter_mut().zip(shafts) {
            *place = Some(wheel);
        }
        // If the ring is full, the monitor receives the next one.
        let _ = exchange.monitor_inputs.push(known);
    }

    /// A report takes precedence over derived values, and these over configured ones.
    fn merged(&self, motion: Option<&ToolMotion>) -> ProcessState {
        let derived_mm_s = motion.map_or(0.0, |motion| motion.feed_mm_s);
        let configured = self.configured;
        let Some(ProcessReport { state, .. }) = self.reported else {
            return ProcessState { feed_mm_s: derived_mm_s, ..configured };
        };
        let or = |reported: f64, other: f64| if reported.is_nan() { other } else { reported };
        ProcessState {
            spindle_rpm: or(state.spindle_rpm, configured.spindle_rpm),
            teeth: if state.teeth == 0 { configured.teeth } else { state.teeth },
            feed_mm_s: or(state.feed_mm_s, derived_mm_s),
            in_cut: state.in_cut,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use corrector::Mode as Correction;
    use recording::model::presets::preset;
    use shm_schema::Operation;

    fn process() -> (ProcessTracker, Exchange, RobotModel) {
        let text = "schema = \"trued.cell/1\"\ncell = \"a\"\nmodel = \"m\"\n[force]\nrate_Hz = 1000\n\
                    [vibration]\nspindle_rpm = 6000\nteeth = 3\n";
        let config = CellConfig::parse("cell.toml", text).unwrap();
        let model = preset("irb1600-6-145-thesis").unwrap().model().unwrap();
        (ProcessTracker::new(&config, &model), Exchange::new(Correction::Full, false), model)
    }

    fn report() -> Request {
        Request {
            operation: Operation::ProcessState.code(),
            spindle_rpm: 28_000.0,
            teeth: 2,
            feed_mm_s: 5.0,
            in_cut: InCut::Cut.code(),
            ..Request::default()
        }
    }

    #[test]
    fn the_cells_report_takes_precedence_over_the_configuration_until_it_expires() {
        let (mut process, exchange, model) = process();
        let configured = process.state();
        assert_eq!((configured.spindle_rpm, configured.teeth), (6000.0, 3));
        let brief = Request { holds_ms: 30, ..report() };
        assert_eq!(process.add_report(&exchange, &brief).0, Answer::Done);
        process.update(&model, &exchange, true);
        let reported = process.state();
        assert_eq!((reported.spindle_rpm, reported.teeth, reported.feed_mm_s), (28_000.0, 2, 5.0));
        assert_eq!(reported.in_cut, Some(true));
        assert_eq!(exchange.monitor_inputs.pop().unwrap().state, reported);
        std::thread::sleep(Duration::from_millis(40));
        process.update(&model, &exchange, true);
        assert_eq!(process.state(), configured);
        assert!(f64::from_bits(exchange.spindle_rpm_bits.load(Relaxed)).is_nan());
    }

    #[test]
    fn values_missing_in_a_report_come_from_other_sources() {
        let (mut process, exchange, model) = process();
        let partly = Request { spindle_rpm: f64::NAN, teeth: 0, feed_mm_s: f64::NAN, ..report() };
        process.add_report(&exchange, &partly);
        process.update(&model, &exchange, true);
        let state = process.state();
        assert_eq!((state.spindle_rpm, state.teeth, state.feed_mm_s), (6000.0, 3, 0.0));
    }

    #[test]
    fn invalid_reports_are_refused_without_effect() {
        let (mut process, exchange, model) = process();
        let refused = [
            Request { spindle_rpm: -1.0, ..report() },
            Request { feed_mm_s: f64::INFINITY, ..report() },
            Request { in_cut: 7, ..report() },
        ];
        for request in refused {
            assert_eq!(process.add_report(&exchange, &request).0, Answer::Refused);
        }
        process.update(&model, &exchange, true);
        assert_eq!(process.state().spindle_rpm, 6000.0);
    }

    #[test]
    fn the_watch_is_given_the_modes_of_the_model_in_use() {
        let (mut process, exchange, mut model) = process();
        model.file.modes.truncate(1);
        process.set_model(&model);
        process.update(&model, &exchange, true);
        let modes = exchange.monitor_inputs.pop().unwrap().modes;
        assert_eq!(modes.iter().flatten().count(), 1);
    }
}
