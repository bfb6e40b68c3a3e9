//! Classification of a line, with the alternatives that the evidence does not exclude.
//!
//! A pure function of the evidence. The order of the rules matters: spindle harmonics are
//! classified as forced first; lines present in air are not chatter. If the evidence does not
//! distinguish two classes, the second is listed as an alternative. Source: research note on
//! vibration monitoring, section 2.6.

use crate::verdict::{Class, ClassSet, State};

/// Evidence on a line for its classification.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Evidence {
    /// Whether the spindle's speed is known.
    pub(crate) speed_known: bool,
    /// Whether the line coincides with a spindle multiple.
    pub(crate) at_spindle_harmonic: bool,
    /// Whether it coincides with an alias of a spindle multiple.
    pub(crate) aliased: bool,
    /// Whether it coincides with a multiple of the mains frequency.
    pub(crate) on_mains: bool,
    /// Whether another line was classified as electrical.
    pub(crate) mains_present: bool,
    /// Whether a known mode is near.
    pub(crate) near_mode: bool,
    /// Whether two known modes are near the line and close to each other.
    pub(crate) has_close_modes: bool,
    /// Whether the force vector rotates on an ellipse in one sense; `None` if unknown.
    pub(crate) rotates: Option<bool>,
    /// Whether the line is present in air; `None` if air and cut are not distinguished.
    pub(crate) in_air: Option<bool>,
    /// Whether the line was present before the noise floor was learned.
    pub(crate) from_start: bool,
    /// Whether the line follows the feed; `None` if the feed did not change, or is unknown.
    pub(crate) follows_feed: Option<bool>,
    /// Whether the feed is known and the frequency is possible for a gear.
    pub(crate) gear_possible: bool,
    /// Whether a shaft rotation or tooth mesh of a gear train has this frequency.
    pub(crate) at_gear_frequency: bool,
}

/// The most likely class, and its alternatives.
pub(crate) fn classify(e: &Evidence) -> (Class, ClassSet) {
    let mut rivals = ClassSet::default();
    let mut rival = |class: Class, possible: bool| {
        if possible {
            rivals.insert(class);
        }
    };
    let self_excited = e.in_air != Some(true);
    let class = if e.at_spindle_harmonic || e.aliased {
        rival(Class::Electrical, e.on_mains);
        // A harmonic itself is never chatter; a line at the alias of a harmonic may be.
        rival(Class::Chatter, !e.at_spindle_harmonic && e.near_mode && self_excited);
        Class::Forced
    } else if e.follows_feed == Some(true) {
        Class::Gear
    } else if e.on_mains
        && (e.in_air == Some(true) || e.mains_present || (e.in_air.is_none() && e.from_start))
    {
        rival(Class::Structural, e.near_mode);
        rival(Class::Chatter, e.in_air == Some(false));
        Class::Electrical
    } else if e.in_air == Some(true) {
        rival(Class::Gear, gear_is_alternative(e));
        Class::Structural
    } else if e.at_gear_frequency && e.follows_feed.is_none() {
        rival(Class::Chatter, e.near_mode || e.in_air == Some(false));
        rival(Class::Structural, e.in_air.is_none());
        Class::Gear
    } else if e.near_mode || e.in_air == Some(false) || (e.speed_known && !e.from_start) {
        // A line that arises during monitoring and is not a harmonic of a known spindle speed is
        // self-excited; the alternatives list what is not excluded.
        rival(Class::Electrical, e.on_mains);
        rival(Class::Forced, !e.speed_known);
        rival(Class::Structural, e.in_air.is_none());
        rival(Class::Gear, !e.near_mode && gear_is_alternative(e));
        if e.has_close_modes && e.rotates == Some(true) {
            rival(Class::Chatter, true);
            Class::ModeCoupling
        } else {
            rival(Class::ModeCoupling, e.has_close_modes && e.rotates.is_none());
            Class::Chatter
        }
    } else {
        // Without a known mode, cut state or spindle speed, self-excitation cannot be concluded.
        rival(Class::Chatter, self_excited && !e.from_start);
        rival(Class::Structural, e.in_air.is_none() && !e.from_start);
        rival(Class::Electrical, e.on_mains);
        rival(Class::Forced, !e.speed_known);
        rival(Class::Gear, gear_is_alternative(e));
        Class::Unknown
    };
    rivals.remove(class);
    (class, rivals)
}

fn gear_is_alternative(e: &Evidence) -> bool {
    e.follows_feed.is_none() && (e.at_gear_frequency || e.gear_possible)
}

/// The highest state that a line of this class may reach: lines known to be harmless remain
/// warnings, so that a normal cut raises no alarm.
pub(crate) fn max_state(class: Class, rivals: ClassSet, e: &Evidence) -> State {
    let harmless = match class {
        Class::Forced => !e.near_mode,
        Class::Electrical | Class::Structural => !rivals.contains(Class::Chatter),
        _ => false,
    };
    if harmless { State::Warn } else { State::Confirmed }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CUT: Evidence = Evidence {
        speed_known: true,
        at_spindle_harmonic: false,
        aliased: false,
        on_mains: false,
        mains_present: false,
        near_mode: false,
        has_close_modes: false,
        rotates: None,
        in_air: Some(false),
        from_start: false,
        follows_feed: None,
        gear_possible: false,
        at_gear_frequency: false,
    };

    fn rivals(e: &Evidence) -> Vec<Class> {
        classify(e).1.iter().collect()
    }

    #[test]
    fn each_class_has_its_evidence() {
        let class = |e: Evidence| classify(&e).0;
        assert_eq!(
            class(Evidence { at_spindle_harmonic: true, near_mode: true, ..CUT }),
            Class::Forced
        );
        assert_eq!(class(Evidence { near_mode: true, ..CUT }), Class::Chatter);
        assert_eq!(class(CUT), Class::Chatter);
        let coupled =
            Evidence { near_mode: true, has_close_modes: true, rotates: Some(true), ..CUT };
        assert_eq!(class(coupled), Class::ModeCoupling);
        assert_eq!(class(Evidence { follows_feed: Some(true), ..CUT }), Class::Gear);
        assert_eq!(class(Evidence { in_air: Some(true), ..CUT }), Class::Structural);
        let mains = Evidence { in_air: Some(true), on_mains: true, ..CUT };
        assert_eq!(class(mains), Class::Electrical);
        let always = Evidence { in_air: None, from_start: true, ..CUT };
        assert_eq!(class(always), Class::Unknown);
    }

    #[test]
    fn a_tone_that_arises_is_no_chatter_while_neither_spindle_nor_cut_nor_mode_is_known() {
        let tone = Evidence { speed_known: false, in_air: None, ..CUT };
        assert_eq!(classify(&tone).0, Class::Unknown);
        assert_eq!(rivals(&tone), [Class::Forced, Class::Chatter, Class::Structural]);
        let class = |e: Evidence| classify(&e).0;
        assert_eq!(class(Evidence { speed_known: true, ..tone }), Class::Chatter);
        assert_eq!(class(Evidence { near_mode: true, ..tone }), Class::Chatter);
        assert_eq!(class(Evidence { in_air: Some(false), ..tone }), Class::Chatter);
    }

    #[test]
    fn indistinguishable_classes_are_reported() {
        let alias = Evidence { aliased: true, near_mode: true, ..CUT };
        assert_eq!((classify(&alias).0, rivals(&alias)), (Class::Forced, vec![Class::Chatter]));
        let ignorant = Evidence { near_mode: true, in_air: None, speed_known: false, ..CUT };
        assert_eq!(rivals(&ignorant), [Class::Forced, Class::Structural]);
        let close = Evidence { near_mode: true, has_close_modes: true, ..CUT };
        assert_eq!(rivals(&close), [Class::ModeCoupling]);
        let wheel = Evidence { in_air: Some(true), at_gear_frequency: true, ..CUT };
        assert_eq!(rivals(&wheel), [Class::Gear]);
    }

    #[test]
    fn harmless_lines_stay_warnings_and_a_driven_mode_does_not() {
        let top = |e: Evidence| {
            let (class, rivals) = classify(&e);
            max_state(class, rivals, &e)
        };
        assert_eq!(top(Evidence { at_spindle_harmonic: true, ..CUT }), State::Warn);
        assert_eq!(
            top(Evidence { at_spindle_harmonic: true, near_mode: true, ..CUT }),
            State::Confirmed
        );
        assert_eq!(top(Evidence { in_air: Some(true), on_mains: true, ..CUT }), State::Warn);
        assert_eq!(top(CUT), State::Confirmed);
    }
}
