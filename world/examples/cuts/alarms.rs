//! Alarms of the vibration monitor for a simulated cut.

use crate::record::{AIR_S, RATE_HZ, Record};
use spectrum::{
    Block, Class, ConfigError, Mode, MonitorConfig, ProcessState, State, VibrationMonitor,
};
use std::fmt;

const FRAMES: usize = 20;

/// A line with an alarm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AlarmedLine {
    line: u32,
    pub(crate) alarm_s: f64,
    frequency_hz: f64,
    amplitude_n: f64,
    class: Class,
}

/// All alarms of a cut.
#[derive(Default)]
pub(crate) struct CutAlarms {
    /// Lines other than multiples of the spindle speed.
    pub(crate) alarms: Vec<AlarmedLine>,
    /// Whether a multiple of the spindle speed raised an alarm because it coincides with a mode.
    pub(crate) forced: bool,
}

impl CutAlarms {
    pub(crate) fn of(record: &Record) -> Result<Self, ConfigError> {
        let process = &record.process;
        let config = MonitorConfig {
            rate_hz: RATE_HZ,
            modes: process.modes.iter().map(|mode| Mode::at_hz(mode.frequency_hz)).collect(),
            ..MonitorConfig::default()
        };
        let mut watch = VibrationMonitor::new(config)?;
        watch.set_process_state(ProcessState {
            spindle_rpm: 60.0 * process.cutter.spindle_hz,
            teeth: process.cutter.teeth,
            ..ProcessState::default()
        });
        let mut cut_alarms = Self::default();
        for (seq, samples) in record.samples.chunks_exact(3 * FRAMES).enumerate() {
            let t_s = (seq * FRAMES) as f64 / RATE_HZ;
            let verdicts = watch.push(&Block {
                seq: seq as u64,
                t_ns: (1e9 * t_s) as u64,
                rate_hz: RATE_HZ,
                channels: 3,
                samples,
                ..Block::default()
            });
            // The last state of a line that ended is taken from the lines present at each time.
            for verdict in verdicts.iter().chain(watch.lines().iter()) {
                cut_alarms.take(verdict, t_s + FRAMES as f64 / RATE_HZ);
            }
        }
        Ok(cut_alarms)
    }

    fn take(&mut self, verdict: &spectrum::Verdict, now_s: f64) {
        if !matches!(verdict.state, State::Alarm | State::Confirmed) {
            return;
        }
        if verdict.class == Class::Forced {
            self.forced = true;
            return;
        }
        let now = AlarmedLine {
            line: verdict.line,
            alarm_s: now_s,
            frequency_hz: verdict.frequency_hz,
            amplitude_n: verdict.amplitude_n,
            class: verdict.class,
        };
        match self.alarms.iter_mut().find(|line| line.line == verdict.line) {
            Some(line) => {
                let (alarm_s, stronger) = (line.alarm_s, now.amplitude_n > line.amplitude_n);
                if stronger {
                    *line = AlarmedLine { alarm_s, ..now };
                }
            }
            None => self.alarms.push(now),
        }
    }

    /// The frequency of the strongest line with an alarm, Hz.
    pub(crate) fn strongest_hz(&self) -> Option<f64> {
        let strongest = self.alarms.iter().max_by(|a, b| a.amplitude_n.total_cmp(&b.amplitude_n));
        strongest.map(|line| line.frequency_hz)
    }
}

impl fmt::Display for CutAlarms {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "forced {}", self.forced)?;
        for line in &self.alarms {
            let after_s = line.alarm_s - AIR_S;
            write!(
                f,
                ", {} at {:.3} s {:.1} Hz {:.2} N {}",
                line.line,
                after_s + AIR_S,
                line.frequency_hz,
                line.amplitude_n,
                line.class.name()
            )?;
        }
        Ok(())
    }
}
