//! Chatter and its sidebands: lines at distances of integer multiples of the spindle speed belong
//! to one event.
//!
//! Each tooth cuts during a part of the revolution only, so that chatter at `f` also appears at `|n
//! f + k f_spindle|` (`n` = ±1 to ±3), often stronger in the force than at `f` itself. The line
//! near a structural mode is the chatter frequency (Insperger et al. 2003); among several, or
//! without a known mode, the one already in alarm, otherwise the strongest. The others remain
//! warnings. Without a known spindle speed, lines are not grouped.

use crate::track::{TRACKS, Track, Tracks};
use crate::verdict::{Class, State};

/// Tolerance of a sideband's frequency, Hz: an eighth of the resolution of the 40 ms window, the
/// accuracy of a new line.
const TOLERANCE_HZ: f64 = 3.0;
/// Tolerance relative to the spindle speed: with a slow spindle, every frequency is near a
/// multiple.
const TOLERANCE_PART: f64 = 0.12;
/// Delay of the alarm of a line away from all known modes, s: the sidebands of sudden chatter
/// appear up to 70 ms before the line near the mode (`cuts 40 1`).
const MODE_PREFERENCE_S: f64 = 0.1;
/// Multiples of the chatter frequency that have sidebands.
const MULTIPLES: [f64; 6] = [1.0, -1.0, 2.0, -2.0, 3.0, -3.0];

/// Limits the sidebands of chatter to warnings, and delays lines that are not near a mode.
/// `near_mode` returns the proximity of a line to a known mode: 2 near it, 1 within the range of
/// its chatter, 0 otherwise.
pub(crate) fn limit_sidebands_to_warnings(
    tracks: &mut Tracks,
    spindle_hz: f64,
    now_s: f64,
    knows_modes: bool,
    near_mode: impl Fn(&Track) -> u8,
) {
    if spindle_hz <= 0.0 {
        return;
    }
    let rank = |track: &Track| (near_mode(track), track.state >= State::Alarm, track.amplitude());
    let mut lines = [None; TRACKS];
    for (place, track) in lines.iter_mut().zip(tracks.iter()) {
        *place = (is_self_excited(track) && track.is_fresh(now_s)).then(|| (*track, rank(track)));
    }
    for track in tracks.iter_mut().filter(|track| is_self_excited(track)) {
        let rank_of_track = rank(track);
        let follows = |(head, other): &(Track, (u8, bool, f64))| {
            head.id != track.id && *other > rank_of_track && is_sideband(track, head, spindle_hz)
        };
        let waits =
            knows_modes && rank_of_track.0 < 2 && now_s - track.first_seen_s < MODE_PREFERENCE_S;
        if waits || lines.iter().flatten().any(follows) {
            track.max_state = State::Warn;
        }
    }
}

pub(crate) fn is_self_excited(track: &Track) -> bool {
    matches!(track.class, Class::Chatter | Class::ModeCoupling | Class::Unknown)
}

fn is_sideband(track: &Track, head: &Track, spindle_hz: f64) -> bool {
    MULTIPLES.iter().any(|n| {
        let apart = track.frequency_hz - n * head.frequency_hz;
        let order = (apart / spindle_hz).round();
        let within = TOLERANCE_HZ.min(TOLERANCE_PART * spindle_hz);
        (apart - order * spindle_hz).abs() < within && (*n != 1.0 || order != 0.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sliding::Detection;

    fn lines(all: &[(f64, f64)]) -> Tracks {
        let mut tracks = Tracks::default();
        for (frequency_hz, amplitude) in all {
            let sighting = Detection {
                channel: 1,
                frequency_hz: *frequency_hz,
                power: amplitude * amplitude,
                ratio: 500.0,
                cell_hz: 2.0,
                three_windows_agree: true,
                learned_share: 0.0,
                is_asynchronous: false,
            };
            tracks.assign(&sighting, 0.0);
        }
        for track in tracks.iter_mut() {
            track.class = Class::Chatter;
        }
        tracks
    }

    fn alarming(tracks: &Tracks) -> Vec<f64> {
        let free = tracks.iter().filter(|track| track.max_state == State::Confirmed);
        free.map(|track| track.frequency_hz).collect()
    }

    #[test]
    fn the_line_near_the_mode_is_the_chatter_although_its_sidebands_are_stronger() {
        // Spindle 50 Hz, chatter at 683 Hz near a mode at 670: 583, 783 and |−683 + 900| = 217 Hz belong to it, 640 does not.
        let mut tracks =
            lines(&[(683.0, 2.0), (583.0, 6.0), (783.0, 4.0), (217.0, 3.0), (640.0, 1.0)]);
        let rank = |track: &Track| 2 * u8::from((track.frequency_hz - 670.0).abs() < 20.0);
        limit_sidebands_to_warnings(&mut tracks, 50.0, 0.0, false, rank);
        assert_eq!(alarming(&tracks), [683.0, 640.0]);
    }

    #[test]
    fn the_line_that_has_alarmed_stays_the_chatter_when_a_sideband_grows_beyond_it() {
        // A chatter at 70.9 Hz between the reaches of two modes, and its sideband two turns of 50.6 Hz above.
        let mut tracks = lines(&[(70.9, 5.0), (172.1, 6.0)]);
        tracks.iter_mut().next().expect("the chatter").state = State::Alarm;
        limit_sidebands_to_warnings(&mut tracks, 50.6, 0.0, false, |_| 0);
        assert_eq!(alarming(&tracks), [70.9]);
        let reach = |track: &Track| u8::from(track.frequency_hz < 100.0);
        let mut tracks = lines(&[(70.9, 5.0), (172.1, 6.0)]);
        limit_sidebands_to_warnings(&mut tracks, 50.6, 0.0, false, reach);
        assert_eq!(alarming(&tracks), [70.9]);
    }

    #[test]
    fn a_line_away_from_all_modes_waits_for_the_chatter_and_then_alarms() {
        let after = |now_s: f64| {
            let mut tracks = lines(&[(217.0, 3.0)]);
            limit_sidebands_to_warnings(&mut tracks, 50.0, now_s, true, |_| 0);
            alarming(&tracks).len()
        };
        assert_eq!((after(0.05), after(0.15)), (0, 1));
    }

    #[test]
    fn without_a_mode_the_strongest_is_the_chatter_and_without_a_speed_all_alarm() {
        let all = [(683.0, 2.0), (583.0, 6.0)];
        let mut tracks = lines(&all);
        limit_sidebands_to_warnings(&mut tracks, 50.0, 0.0, false, |_| 0);
        assert_eq!(alarming(&tracks), [583.0]);
        let mut tracks = lines(&all);
        limit_sidebands_to_warnings(&mut tracks, 0.0, 0.0, false, |_| 0);
        assert_eq!(alarming(&tracks).len(), 2);
    }
}
