//! Checks distances and touches against the TOML.
//!
//! Each error is reported with its row or table. Values are not changed.

use super::Builder;
use super::channel::{Channel, GAUGES_MAX};
use super::gauges::Gauges;
use crate::faults::Fault;

impl Builder<'_, '_> {
    pub(super) fn judge_gauges(&mut self, gauges: &Gauges) {
        self.judge_lengths(gauges);
        let touched = [Channel::TouchPlane, Channel::TouchSphere].map(|c| self.touched(c));
        if touched.iter().any(|numbers| !numbers.is_empty()) && gauges.probe.is_none() {
            let fault = Fault::new("probe", "is missing, but the recording contains contacts");
            let expected = "[probe] with radius_mm in the recording's TOML";
            self.faults.push(fault.expected(expected));
        }
        let [planes, spheres] = touched;
        for number in planes.iter().filter(|number| !gauges.planes.contains_key(&(**number - 1))) {
            let fault = Fault::new(format!("plane{number}"), "is contacted but not defined");
            let expected = format!("[plane{number}] with normal = [x, y, z], towards the probe");
            self.faults.push(fault.expected(expected));
        }
        for number in gauges.planes.keys().filter(|number| !planes.contains(&(**number + 1))) {
            self.untouched(&format!("plane{}", number + 1), "touch_plane");
        }
        for number in gauges.spheres.keys().filter(|number| !spheres.contains(&(**number + 1))) {
            self.untouched(&format!("sphere{}", number + 1), "touch_sphere");
        }
    }

    fn judge_lengths(&mut self, gauges: &Gauges) {
        for number in gauges.distances.keys() {
            if !self.columns.contains_key(&Channel::Distance(*number)) {
                let key = format!("distance{}", number + 1);
                let fault = Fault::new(&key, "has no such column");
                self.faults.push(fault.expected(format!("a column `{key}_mm`")));
            }
        }
        let negative = self.columns.iter().filter_map(|(channel, values)| {
            let of_distance = matches!(channel, Channel::Distance(_));
            let row = values.iter().position(|value| *value < 0.0)?;
            of_distance.then_some((row, *channel))
        });
        for (row, channel) in negative.collect::<Vec<_>>() {
            let fault = Fault::new(channel.base(), "is below zero").expected("a distance");
            self.channel_fault(row, channel, fault);
        }
    }

    /// The numbers of the touched objects; the first invalid one is a fault.
    fn touched(&mut self, channel: Channel) -> Vec<usize> {
        let Some(values) = self.columns.get(&channel) else { return Vec::new() };
        let number = |value: f64| (0..=GAUGES_MAX).find(|number| *number as f64 == value);
        let bad = values.iter().position(|value| !value.is_nan() && number(*value).is_none());
        let mut numbers: Vec<usize> = values.iter().filter_map(|value| number(*value)).collect();
        numbers.sort_unstable();
        numbers.dedup();
        numbers.retain(|number| *number > 0);
        if let Some(row) = bad {
            let expected =
                format!("the number of the contacted surface, 1 to {GAUGES_MAX}; 0 for none");
            let fault = Fault::new(channel.base(), format!("is {}", values[row]));
            self.channel_fault(row, channel, fault.expected(expected));
        }
        numbers
    }

    fn untouched(&mut self, key: &str, column: &str) {
        let fault = Fault::new(key, "is never contacted");
        self.faults.push(fault.expected(format!("its number in a row of `{column}`")));
    }
}
