//! Duplicate columns: one measurement exported under two names, which a fit would count twice.

use super::{Channel, JOINTS_MAX, Recording, TARGETS_MAX};
use crate::faults::Fault;
use crate::series::GAUGES_MAX;

/// Two instruments may read the same number once; this many equal rows, and no different one, are
/// one measurement under two names.
const ROWS_ALIKE_LEAST: usize = 2;

/// The columns of one kind, by their number.
type Numbered = fn(usize) -> Channel;

/// Two names of one measurement.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct DuplicateColumns {
    first: String,
    second: String,
}

impl DuplicateColumns {
    fn message(&self) -> String {
        format!("has exactly the same values as `{}`: one measurement under two names", self.first)
    }

    pub(super) fn note(&self) -> String {
        format!("`{}` {}", self.second, self.message())
    }

    /// For a fit, which would count it twice.
    pub(super) fn fault(&self) -> Fault {
        Fault::new(&self.second, self.message()).expected("each measurement once").help(
            "remove one of them, and check whether it was exported or mapped under the wrong name",
        )
    }
}

impl Recording {
    /// Pairs of measured columns, or of points, whose samples are equal bit for bit wherever both
    /// exist.
    ///
    /// Constant columns are ignored: parked joints and placeholders are equal without being one
    /// measurement.
    pub(super) fn twins(&self) -> Vec<DuplicateColumns> {
        let point = |name: String, channel: &dyn Fn(usize) -> Channel| {
            (name, vec![channel(0), channel(1), channel(2)])
        };
        let mut points = vec![point("x, y, z".to_owned(), &Channel::Position)];
        points.extend((0..TARGETS_MAX).map(|target| {
            point(format!("target{}", target + 1), &move |axis| Channel::Target(target, axis))
        }));
        let mut twins = self.twins_among(&points);
        let single = |channel: Channel| (channel.base(), vec![channel]);
        let kinds: [(usize, Numbered); 4] = [
            (GAUGES_MAX, Channel::Distance),
            (JOINTS_MAX, Channel::Link),
            (JOINTS_MAX, Channel::Torque),
            (JOINTS_MAX, Channel::Current),
        ];
        for (count, channel) in kinds {
            twins
                .extend(self.twins_among(&(0..count).map(channel).map(single).collect::<Vec<_>>()));
        }
        twins
    }

    fn twins_among(&self, kind: &[(String, Vec<Channel>)]) -> Vec<DuplicateColumns> {
        let read = |channels: &Vec<Channel>| {
            channels.iter().map(|channel| self.column(*channel)).collect::<Option<Vec<_>>>()
        };
        let found: Vec<(&String, Vec<&[f64]>)> =
            kind.iter().filter_map(|(name, channels)| Some((name, read(channels)?))).collect();
        let mut twins = Vec::new();
        for (index, (first, a)) in found.iter().enumerate() {
            for (second, b) in found.iter().skip(index + 1) {
                if is_duplicate(a, b) {
                    twins.push(DuplicateColumns {
                        first: (*first).clone(),
                        second: (*second).clone(),
                    });
                }
            }
        }
        twins
    }
}

fn is_duplicate(a: &[&[f64]], b: &[&[f64]]) -> bool {
    let bits = |columns: &[&[f64]], row: usize| {
        let values = columns.iter().map(|column| column.get(row).copied().filter(|v| !v.is_nan()));
        values.map(|value| value.map(f64::to_bits)).collect::<Option<Vec<u64>>>()
    };
    let rows = a.first().map_or(0, |column| column.len());
    let (mut first, mut changes, mut count) = (None, false, 0);
    for row in 0..rows {
        let (Some(a), Some(b)) = (bits(a, row), bits(b, row)) else { continue };
        if a != b {
            return false;
        }
        changes |= first.get_or_insert_with(|| a.clone()) != &a;
        count += 1;
    }
    changes && count >= ROWS_ALIKE_LEAST
}

#[cfg(test)]
mod tests {
    use crate::series::{RequiredData, read_text};

    fn twins(text: &str) -> Vec<(String, String)> {
        let recording = read_text("x.csv", text, None, None, RequiredData::Path).unwrap();
        let twins = recording.twins();
        let noted = recording.notes.iter().filter(|note| note.contains("exactly the same values"));
        assert_eq!(noted.count(), twins.len());
        assert_eq!(recording.check_need(RequiredData::Measurement).is_err(), !twins.is_empty());
        let read = read_text("x.csv", text, None, None, RequiredData::Measurement);
        assert_eq!(read.is_err(), !twins.is_empty());
        twins.into_iter().map(|twins| (twins.first, twins.second)).collect()
    }

    fn pair(first: &str, second: &str) -> (String, String) {
        (first.to_owned(), second.to_owned())
    }

    #[test]
    fn readings_under_two_names_are_found_and_refused_by_a_fit() {
        let head = "t_s,q1_deg,target1_x_mm,target1_y_mm,target1_z_mm,target3_x_mm,target3_y_mm,target3_z_mm,tau1_Nm,tau2_Nm";
        let equal_columns = "0,1,1,2,3,1,2,3,5,5\n1,2,,,,7,8,9,6,6\n2,3,4,5,6,4,5,6,7,7\n";
        let found = twins(&format!("{head}\n{equal_columns}"));
        assert_eq!(found, [pair("target1", "target3"), pair("tau1", "tau2")]);
        let apart = "0,1,1,2,3,1,2,3,5,5\n1,2,4,5,6,4,5,6.001,6,5\n";
        assert_eq!(twins(&format!("{head}\n{apart}")), []);
    }

    #[test]
    fn what_does_not_change_is_no_reading_under_two_names() {
        assert_eq!(twins("t_s,q1_deg,ql1_deg,ql2_deg\n0,1,0,0\n1,2,0,0\n2,3,0,0\n"), []);
    }

    #[test]
    fn the_tool_point_and_a_target_can_be_one_reading() {
        let head = "t_s,q1_deg,x_mm,y_mm,z_mm,target1_x_mm,target1_y_mm,target1_z_mm";
        let found = twins(&format!("{head}\n0,1,1,2,3,1,2,3\n1,2,4,5,6,4,5,6\n"));
        assert_eq!(found, [pair("x, y, z", "target1")]);
    }
}
