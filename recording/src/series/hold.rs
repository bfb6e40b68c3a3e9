//! Missing samples of inputs: the last value is kept.

use super::{Channel, Recording};

impl Recording {
    /// Replaces missing samples of loads, temperatures and process state by the last sample before them. With a `[cut]`, the wrench is measured, not an input,
    /// and stays as it is.
    ///
    /// ```
    /// use recording::series::{Channel, Recording};
    ///
    /// let mut recording = Recording::new(vec![0.0, 0.1]);
    /// recording.set(Channel::Ambient, vec![293.0, f64::NAN]);
    /// recording.hold_inputs();
    /// assert_eq!(recording.column(Channel::Ambient), Some([293.0, 293.0].as_slice()));
    /// ```
    pub fn hold_inputs(&mut self) {
        let is_measured = self.metadata.cut.is_some();
        let is_input = |channel: &Channel| match channel {
            Channel::Wrench(_) => !is_measured,
            Channel::Ambient | Channel::JointTemperature(_) | Channel::Spindle | Channel::Feed => {
                true
            }
            _ => false,
        };
        let channels: Vec<Channel> = self.channels().filter(is_input).collect();
        for channel in channels {
            let mut last = f64::NAN;
            let hold = |sample: &f64| {
                last = if sample.is_nan() { last } else { *sample };
                last
            };
            let held = self.column(channel).unwrap_or_default().iter().map(hold).collect();
            self.set(channel, held);
        }
    }

    /// Whether a measured column has a value in a row: where it had one when this was called, in all rows if it had none.
    pub fn rows_with_values(&self, channel: Channel) -> impl Fn(usize) -> bool + use<> {
        let has_value: Vec<bool> =
            self.column(channel).unwrap_or_default().iter().map(|x| x.is_finite()).collect();
        let all = !has_value.contains(&true);
        move |row| all || has_value.get(row).copied().unwrap_or(false)
    }
}
