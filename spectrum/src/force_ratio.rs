//! Ratio of a line's power to that of the cutting force: small for vibration excited by noise in a
//! stable cut, large for chatter.
//!
//! Chatter grows until teeth leave the workpiece, so that its force becomes comparable to the mean
//! cutting force; the broadband part of the force of a stable cut excites the modes too, above the
//! noise floor learned in air, but only to a few per cent of that. Source: energy ratio, Caliskan,
//! Kilic and Altintas 2018. Valid in the cut and for force channels only: a line detected in
//! moments only is not limited.

use crate::sidebands::is_self_excited;
use crate::track::{Track, Tracks};
use crate::verdict::State;

/// Number of force channels; moments follow.
const FORCES: usize = 3;

/// Limits self-excited lines to warnings while their mean square is less than `least_share` of
/// `energy`, the mean square of the forces relative to those in air, N². `None` in air: the last
/// result from the cut is kept while a line rings down.
pub(crate) fn limit_weak_lines_to_warnings(
    tracks: &mut Tracks,
    energy: Option<f64>,
    least_share: f64,
) {
    for track in tracks.iter_mut().filter(|track| is_self_excited(track)) {
        if let Some(energy) = energy {
            track.is_weak = track.channel < FORCES && mean_square(track) < least_share * energy;
        }
        if track.is_weak {
            track.max_state = State::Warn;
        }
    }
}

/// Mean square of a line over the force channels: half of the squared amplitudes, N².
fn mean_square(track: &Track) -> f64 {
    0.5 * track.power[..FORCES].iter().sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sliding::Detection;
    use crate::verdict::Class;

    fn ceiling(channel: usize, amplitude: f64, class: Class) -> State {
        let sighting = Detection {
            channel,
            frequency_hz: 400.0,
            power: amplitude * amplitude,
            ratio: 500.0,
            cell_hz: 10.0,
            three_windows_agree: true,
            learned_share: 0.0,
            is_asynchronous: false,
        };
        let mut tracks = Tracks::default();
        tracks.assign(&sighting, 0.0);
        tracks.iter_mut().for_each(|track| track.class = class);
        // Forces of 100 N mean and 100 N rms.
        limit_weak_lines_to_warnings(&mut tracks, Some(2e4), 0.004);
        tracks.iter_mut().for_each(|track| track.max_state = State::Confirmed);
        limit_weak_lines_to_warnings(&mut tracks, None, 0.004);
        tracks.iter().next().expect("one line").max_state
    }

    #[test]
    fn a_line_of_a_few_per_cent_of_the_force_is_no_chatter_nor_is_it_when_the_cut_ends_and_one_of_a_tenth_is()
     {
        assert_eq!(ceiling(1, 5.0, Class::Chatter), State::Warn);
        assert_eq!(ceiling(1, 20.0, Class::Chatter), State::Confirmed);
    }

    #[test]
    fn neither_forced_lines_nor_moments_are_judged_by_their_share() {
        assert_eq!(ceiling(1, 5.0, Class::Forced), State::Confirmed);
        assert_eq!(ceiling(4, 5.0, Class::Chatter), State::Confirmed);
    }
}
