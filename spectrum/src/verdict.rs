//! Verdicts: copyable and of fixed size, so that they fit into shared memory.

use crate::block::Axis;
use std::fmt;

/// State of a line, in increasing certainty.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum State {
    /// Two disjoint windows agree.
    #[default]
    Warn,
    /// Three disjoint windows agree, and the line is not known to be harmless.
    Alarm,
    /// The line has lasted long enough to be measured and classified.
    Confirmed,
    /// The line has ended.
    Over,
}

impl State {
    /// Name as the contract writes it.
    #[must_use]
    pub fn name(self) -> &'static str {
        ["warn", "alarm", "confirmed", "over"][self as usize]
    }
}

/// Most likely cause of a line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Class {
    /// Driven by the spindle: runout, tooth passing, or an alias of them.
    Forced,
    /// Self-excited near a mode of the machine, in the cut only.
    Chatter,
    /// Self-excited by two close modes: the tool moves on an ellipse.
    ModeCoupling,
    /// Constant in cycles per mm of path, as caused by the eccentricity of a gear.
    Gear,
    /// Constant in time and present in air: vibration of the structure itself.
    Structural,
    /// A multiple of the mains frequency, independent of the process.
    Electrical,
    /// No known cause.
    #[default]
    Unknown,
}

impl Class {
    /// All classes.
    pub const ALL: [Self; 7] = [
        Self::Forced,
        Self::Chatter,
        Self::ModeCoupling,
        Self::Gear,
        Self::Structural,
        Self::Electrical,
        Self::Unknown,
    ];

    /// Name as the contract writes it.
    #[must_use]
    pub fn name(self) -> &'static str {
        ["forced", "chatter", "mode_coupling", "gear", "structural", "electrical", "unknown"]
            [self as usize]
    }
}

/// A set of classes: the alternatives that the samples do not distinguish from the most likely
/// class.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct ClassSet(u8);

impl ClassSet {
    /// Adds a class.
    pub fn insert(&mut self, class: Class) {
        self.0 |= 1 << class as u8;
    }

    /// Removes a class.
    pub fn remove(&mut self, class: Class) {
        self.0 &= !(1 << class as u8);
    }

    /// Whether the class is in the set.
    #[must_use]
    pub fn contains(self, class: Class) -> bool {
        self.0 & (1 << class as u8) != 0
    }

    /// Whether no class is in the set.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The classes in the set.
    pub fn iter(self) -> impl Iterator<Item = Class> {
        Class::ALL.into_iter().filter(move |&class| self.contains(class))
    }

    /// One bit per class, in the order of [`Class::ALL`]; for transport.
    #[must_use]
    pub fn bits(self) -> u8 {
        self.0
    }
}

impl fmt::Debug for ClassSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self.iter()).finish()
    }
}

/// The nearest mode, spindle harmonic or alias of one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestLine {
    /// Its frequency, Hz; for an alias, after folding.
    pub frequency_hz: f64,
    /// Measured line minus this one, Hz.
    pub distance_hz: f64,
    /// Order of the spindle harmonic, from 1; for a mode, its index in the list, from 0.
    pub order: u32,
}

/// Recommended action for the operator. The monitor only advises.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Advice {
    /// No action, or none known.
    #[default]
    None,
    /// Forced vibration: at this speed no tooth harmonic coincides with the mode.
    MoveOffMode {
        /// Speed to go to, rev/min.
        spindle_rpm: f64,
    },
    /// Regenerative chatter: this speed is between stability lobes.
    StabilityPocket {
        /// Speed to go to, rev/min.
        spindle_rpm: f64,
        /// Lobe number: waves of the mode per tooth period.
        lobe: u32,
    },
    /// Speed has no effect: change direction of cut, feed or depth.
    ChangeCut,
    /// Chatter at an unknown speed, or already in a lobe: reduce the depth of cut.
    ReduceDepth,
    /// The line may be a folded spindle harmonic: sample faster, or filter before sampling.
    SampleFaster,
    /// A gear's line, which follows the feed: check this joint's gear train.
    CheckGear {
        /// Joint, from 1; 0 where no wheel matches.
        joint: u8,
        /// Shaft, from 1, motor side first; 0 where no wheel matches.
        shaft: u8,
    },
    /// A mains line: check cables, shields and grounding.
    CheckWiring,
}

impl fmt::Display for Advice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::None => f.write_str("nothing to do"),
            Self::MoveOffMode { spindle_rpm } => {
                write!(f, "a spindle speed of {spindle_rpm:.0} rev/min moves the tooth harmonics off the mode")
            }
            Self::StabilityPocket { spindle_rpm, lobe } => {
                write!(f, "a spindle speed of {spindle_rpm:.0} rev/min lies in stability pocket {lobe}")
            }
            Self::ChangeCut => f.write_str(
                "another spindle speed does not help: change the direction of cut, the feed or the depth",
            ),
            Self::ReduceDepth => f.write_str("reduce the depth of cut"),
            Self::SampleFaster => f.write_str(
                "sample faster, or filter before sampling: the line may be an aliased harmonic of the spindle speed",
            ),
            Self::CheckGear { joint: 0, .. } => f.write_str("check the gear trains: the line follows the feed"),
            Self::CheckGear { joint, shaft } => {
                write!(f, "check joint {joint}, gear shaft {shaft}: the line follows the feed")
            }
            Self::CheckWiring => f.write_str("check cables, shields and grounding: a mains line"),
        }
    }
}

/// Verdict on one line at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Verdict {
    /// Identifier of the line, equal in all its verdicts.
    pub line: u32,
    /// Time of the newest sample used, ns.
    pub t_ns: u64,
    /// State of the line.
    pub state: State,
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Amplitude (not rms) on the axis below, N; Nm where the axis is a moment.
    pub amplitude_n: f64,
    /// The axis where the line is strongest.
    pub axis: Axis,
    /// What the line most likely is.
    pub class: Class,
    /// Alternatives that the samples do not distinguish.
    pub alternatives: ClassSet,
    /// Growth of the amplitude: d ln A / dt, 1/s.
    pub growth_per_s: f64,
    /// The nearest known mode.
    pub mode: Option<NearestLine>,
    /// The nearest spindle harmonic, if the speed is known.
    pub harmonic: Option<NearestLine>,
    /// The nearest alias of a spindle harmonic at this sampling rate.
    pub alias: Option<NearestLine>,
    /// Whether the line coincides with an alias: the true frequency may be another one.
    pub suspect_alias: bool,
    /// Recommended action.
    pub advice: Advice,
}

/// Largest number of verdicts per block.
pub const VERDICTS_MAX: usize = 16;

/// The verdicts of one block: a list of fixed capacity, copyable.
#[derive(Clone, Copy, Debug)]
pub struct Verdicts {
    items: [Verdict; VERDICTS_MAX],
    len: usize,
    dropped: u32,
}

impl Default for Verdicts {
    fn default() -> Self {
        Self { items: [Verdict::default(); VERDICTS_MAX], len: 0, dropped: 0 }
    }
}

impl Verdicts {
    /// Adds a verdict; beyond the capacity it is only counted.
    pub(crate) fn push(&mut self, verdict: Verdict) {
        match self.items.get_mut(self.len) {
            Some(place) => {
                *place = verdict;
                self.len += 1;
            }
            None => self.dropped += 1,
        }
    }

    /// The verdicts, oldest first.
    #[must_use]
    pub fn as_slice(&self) -> &[Verdict] {
        &self.items[..self.len]
    }

    /// Iterates over the verdicts, oldest first.
    pub fn iter(&self) -> std::slice::Iter<'_, Verdict> {
        self.as_slice().iter()
    }

    /// Whether the list is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Number of verdicts.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Number of verdicts dropped.
    #[must_use]
    pub fn dropped(&self) -> u32 {
        self.dropped
    }
}

impl<'a> IntoIterator for &'a Verdicts {
    type Item = &'a Verdict;
    type IntoIter = std::slice::Iter<'a, Verdict>;
    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_list_counts_what_it_drops() {
        let mut verdicts = Verdicts::default();
        for _ in 0..VERDICTS_MAX + 3 {
            verdicts.push(Verdict::default());
        }
        assert_eq!((verdicts.len(), verdicts.dropped()), (VERDICTS_MAX, 3));
    }

    #[test]
    fn a_set_of_classes_holds_what_was_put_in() {
        let mut set = ClassSet::default();
        set.insert(Class::Gear);
        set.insert(Class::Unknown);
        set.remove(Class::Unknown);
        assert_eq!(set.iter().collect::<Vec<_>>(), [Class::Gear]);
    }
}
