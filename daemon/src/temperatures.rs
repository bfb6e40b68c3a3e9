//! Present temperatures: the newest value of each, until it is stale.
//!
//! In the cycle, without allocation. A value is used until a newer one arrives or it reaches its
//! age limit; then it counts as unknown and its bit in [`Temperatures::stale`] is set. Plausibility
//! is not checked.

use shm_schema::JOINTS_MAX;

/// Number of temperatures: ambient, then one per joint.
const PLACES: usize = JOINTS_MAX + 1;

/// The ambient temperature and those of the joints.
#[derive(Debug)]
pub struct Temperatures {
    celsius: [f64; PLACES],
    valid_until_ns: [u64; PLACES],
    /// When the first of them expires.
    expires_ns: u64,
    stale: u32,
    /// Age limit; `None`: a recording, in which each row contains all known values.
    age_limit_ns: Option<u64>,
}

impl Temperatures {
    /// Without values yet. Without a limit each message contains all known values, as in a
    /// recording.
    #[must_use]
    pub fn new(age_limit_ns: Option<u64>) -> Self {
        Self {
            celsius: [f64::NAN; PLACES],
            valid_until_ns: [u64::MAX; PLACES],
            expires_ns: u64::MAX,
            stale: 0,
            age_limit_ns,
        }
    }

    /// Takes a message. A value that it does not contain (NaN) keeps the previous one until that
    /// expires.
    pub fn update(&mut self, celsius: &[f64; PLACES], now_ns: u64) {
        let Some(limit_ns) = self.age_limit_ns else {
            self.celsius = *celsius;
            return;
        };
        for (place, value) in celsius.iter().enumerate().filter(|(_, value)| !value.is_nan()) {
            self.celsius[place] = *value;
            self.valid_until_ns[place] = now_ns.saturating_add(limit_ns);
            self.stale &= !(1 << place);
        }
        self.find_expiry();
    }

    /// Temperatures known now, °C; NaN where unknown.
    pub fn valid_at(&mut self, now_ns: u64) -> &[f64; PLACES] {
        if now_ns > self.expires_ns {
            for place in 0..PLACES {
                if now_ns > self.valid_until_ns[place] {
                    self.celsius[place] = f64::NAN;
                    self.valid_until_ns[place] = u64::MAX;
                    self.stale |= 1 << place;
                }
            }
            self.find_expiry();
        }
        &self.celsius
    }

    /// Temperatures at the last call of [`Self::valid_at`].
    #[must_use]
    pub fn newest(&self) -> [f64; PLACES] {
        self.celsius
    }

    /// Those that have expired: bit 0 the ambient one, bit `n` that of joint `n`.
    #[must_use]
    pub fn stale(&self) -> u32 {
        self.stale
    }

    fn find_expiry(&mut self) {
        self.expires_ns = self.valid_until_ns.iter().copied().min().unwrap_or(u64::MAX);
    }
}

/// The names in a bit set of temperatures: "ambient, joint 2".
#[must_use]
pub fn place_names(set: u32) -> String {
    let name = |place| if place == 0 { "ambient".to_owned() } else { format!("joint {place}") };
    let names: Vec<String> = (0..PLACES).filter(|place| set & 1 << place != 0).map(name).collect();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    fn message(pairs: &[(usize, f64)]) -> [f64; PLACES] {
        let mut celsius = [f64::NAN; PLACES];
        pairs.iter().for_each(|(place, value)| celsius[*place] = *value);
        celsius
    }

    #[test]
    fn each_temperature_holds_until_it_is_too_old_and_is_then_named_stale() {
        let mut known = Temperatures::new(Some(60 * S));
        known.update(&message(&[(0, 21.0), (2, 35.0)]), S);
        known.update(&message(&[(2, 36.0)]), 50 * S);
        assert_eq!((known.valid_at(61 * S)[0], known.valid_at(61 * S)[2]), (21.0, 36.0));
        assert_eq!(known.stale(), 0, "nothing is stale, and what was never told is not stale");
        assert!(known.valid_at(61 * S + 1)[0].is_nan());
        assert_eq!((known.valid_at(110 * S)[2], known.stale()), (36.0, 1));
        assert!(known.valid_at(110 * S + 1)[2].is_nan());
        assert_eq!(
            (known.stale(), place_names(known.stale())),
            (0b101, "ambient, joint 2".to_owned())
        );
        known.update(&message(&[(0, 22.0)]), 200 * S);
        assert_eq!((known.valid_at(200 * S)[0], known.stale()), (22.0, 0b100));
    }

    #[test]
    fn a_limit_of_never_keeps_the_last_number() {
        let mut known = Temperatures::new(Some(u64::MAX));
        known.update(&message(&[(1, 30.0)]), S);
        known.update(&message(&[]), 2 * S);
        assert_eq!((known.valid_at(u64::MAX)[1], known.stale()), (30.0, 0));
    }

    #[test]
    fn a_row_of_a_recording_is_the_whole_account() {
        let mut known = Temperatures::new(None);
        known.update(&message(&[(0, 21.0)]), S);
        assert_eq!(known.valid_at(u64::MAX)[0], 21.0);
        known.update(&message(&[(1, 30.0)]), 2 * S);
        assert!(known.valid_at(2 * S)[0].is_nan());
    }
}
