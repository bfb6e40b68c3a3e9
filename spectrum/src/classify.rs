//! Classification of a line, and its alternatives.
//!
//! A pure function of the evidence. Order matters: harmonics of the spindle are forced before
//! anything else; lines present in air are not chatter. If the evidence does not distinguish two classes,
//! the second is listed as a rival. Source: research note on vibration monitoring, section 2.6.

use crate::verdict::{Class, ClassSet, State};

/// Evidence on a line for its classification.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Evidence {
    /// Whether the spindle's speed is known.
    pub(crate) speed_known: bool,
    /// Whether the line coincides with a spindle multiple.
    pub(crate) driven: bool,
    /// Whether it coincides with an alias of a spindle multiple.
    pub(crate) aliased: bool,
    /// Whether it coincides with a multiple of the mains frequency.
    pub(crate) on_mains: bool,
    /// Other multiples of the mains are there and were called electrical.
    pub(crate) hums: bool,
    /// Whether a known mode is near.
    pub(crate) near_mode: bool,
    /// Whether two known modes are near, and close to each other.
    pub(crate) two_modes: bool,
    /// Whether the force vector moves on an ellipse in one sense; `None` if unknown.
    pub(crate) turns: Option<bool>,
    /// Whether the line is present in air; `None` if air and cut are not distinguished.
    pub(crate) in_air: Option<bool>,
    /// The line was there before anything was learned.
    pub(crate) from_start: bool,
    /// Whether the line follows the feed; `None` if the feed did not change, or is unknown.
    pub(crate) follows_feed: Option<bool>,
    /// Whether the feed is known, and the line could be a gear's.
    pub(crate) gear_possible: bool,
    /// A wheel of the gear train turns at this frequency.
    pub(crate) on_wheel: bool,
}

/// The most likely class, and its rivals.
pub(crate) fn classify(e: &Evidence) -> (Class, ClassSet) {
    let mut rivals = ClassSet::default();
    let mut rival = |class: Class, possible: bool| {
        if possible {
            rivals.insert(class);
        }
    };
    let self_excited = e.in_air != Some(true);
    let class = if e.driven || e.aliased {
        rival(Class::Electrical, e.on_mains);
        // A true multiple is never chatter; an alias of one may be.
        rival(Class::Chatter, !e.driven && e.near_mode && self_excited);
        Class::Forced
    } else if e.follows_feed == Some(true) {
        Class::Gear
    } else if e.on_mains
        && (e.in_air == Some(true) || e.hums || (e.in_air.is_none() && e.from_start))
    {
        rival(Class::Structural, e.near_mode);
        rival(Class::Chatter, e.in_air == Some(false));
        Class::Electrical
    } else if e.in_air == Some(true) {
        rival(Class::Gear, gear_rival(e));
        Class::Structural
    } else if e.on_wheel && e.follows_feed.is_none() {
        rival(Class::Chatter, e.near_mode || e.in_air == Some(false));
        rival(Class::Structural, e.in_air.is_none());
        Class::Gear
    } else if e.near_mode || e.in_air == Some(false) || (e.speed_known && !e.from_start) {
        // A line that arises during monitoring and is not excited by a spindle of known speed is
        // self-excited; the rivals show how much of that is known.
        rival(Class::Electrical, e.on_mains);
        rival(Class::Forced, !e.speed_known);
        rival(Class::Structural, e.in_air.is_none());
        rival(Class::Gear, !e.near_mode && gear_rival(e));
        if e.two_modes && e.turns == Some(true) {
            rival(Class::Chatter, true);
            Class::ModeCoupling
        } else {
            rival(Class::ModeCoupling, e.two_modes && e.turns.is_none());
            Class::Chatter
        }
    } else {
        // Without a known mode, cut or spindle, self-excitation cannot be concluded.
        rival(Class::Chatter, self_excited && !e.from_start);
        rival(Class::Structural, e.in_air.is_none() && !e.from_start);
        rival(Class::Electrical, e.on_mains);
        rival(Class::Forced, !e.speed_known);
        rival(Class::Gear, gear_rival(e));
        Class::Unknown
    };
    rivals.remove(class);
    (class, rivals)
}

fn gear_rival(e: &Evidence) -> bool {
    e.follows_feed.is_none() && (e.on_wheel || e.gear_possible)
}

/// The highest state that a line of this class may reach: lines known to be harmless remain
/// warnings, because an alarm in every healthy cut would be useless.
pub(crate) fn ceiling(class: Class, rivals: ClassSet, e: &Evidence) -> State {
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
        driven: false,
        aliased: false,
        on_mains: false,
        hums: false,
        near_mode: false,
        two_modes: false,
        turns: None,
        in_air: Some(false),
        from_start: false,
        follows_feed: None,
        gear_possible: false,
        on_wheel: false,
    };

    fn rivals(e: &Evidence) -> Vec<Class> {
        classify(e).1.iter().collect()
    }

    #[test]
    fn each_class_has_its_evidence() {
        let class = |e: Evidence| classify(&e).0;
        assert_eq!(class(Evidence { driven: true, near_mode: true, ..CUT }), Class::Forced);
        assert_eq!(class(Evidence { near_mode: true, ..CUT }), Class::Chatter);
        assert_eq!(class(CUT), Class::Chatter);
        let coupled = Evidence { near_mode: true, two_modes: true, turns: Some(true), ..CUT };
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
        let close = Evidence { near_mode: true, two_modes: true, ..CUT };
        assert_eq!(rivals(&close), [Class::ModeCoupling]);
        let wheel = Evidence { in_air: Some(true), on_wheel: true, ..CUT };
        assert_eq!(rivals(&wheel), [Class::Gear]);
    }

    #[test]
    fn harmless_lines_stay_warnings_and_a_driven_mode_does_not() {
        let top = |e: Evidence| {
            let (class, rivals) = classify(&e);
            ceiling(class, rivals, &e)
        };
        assert_eq!(top(Evidence { driven: true, ..CUT }), State::Warn);
        assert_eq!(top(Evidence { driven: true, near_mode: true, ..CUT }), State::Confirmed);
        assert_eq!(top(Evidence { in_air: Some(true), on_mains: true, ..CUT }), State::Warn);
        assert_eq!(top(CUT), State::Confirmed);
    }
}
