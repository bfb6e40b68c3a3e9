//! Motion profile of a stroke: from rest to rest with bounded speed, acceleration and jerk.
//!
//! Seven phases of constant jerk (`+j, 0, −j, 0, −j, 0, +j`), symmetric in time; phases that do not
//! fit into a short stroke have zero duration. Source: the double-S profile of Biagiotti and
//! Melchiorri, Trajectory Planning, 2008, 3.4.
//!
//! It starts and ends at rest, never exceeds the limits, and ends exactly at the length. The
//! geometry is in [`crate::path`].

use libm::{cbrt, sqrt};

/// Bounds of the motion along a stroke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest acceleration along the path, m/s², above zero.
    pub acceleration_m_s2: f64,
    /// Largest jerk along the path, m/s³, above zero.
    pub jerk_m_s3: f64,
}

impl Default for Limits {
    /// A moderate machining motion: 0.2 m/s², 5 m/s³ (10 mm/s is reached in 90 ms).
    fn default() -> Self {
        Self { acceleration_m_s2: 0.2, jerk_m_s3: 5.0 }
    }
}

/// State of the motion at a time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Distance from the start, m.
    pub distance_m: f64,
    /// Speed, m/s.
    pub speed_m_s: f64,
}

/// The motion over one stroke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    length: f64,
    speed: f64,
    jerk: f64,
    jerk_time: f64,
    ramp_time: f64,
    duration: f64,
}

impl Profile {
    /// The motion over `length_m` at `feed_m_s`, if the length suffices for that feed; all values
    /// above zero.
    pub fn new(length_m: f64, feed_m_s: f64, limits: Limits) -> Self {
        let (a, jerk) = (limits.acceleration_m_s2, limits.jerk_m_s3);
        let speed = feed_m_s.min(reachable_speed(length_m, a, jerk));
        let jerk_time = (a / jerk).min(sqrt(speed / jerk));
        let ramp_time = speed / (jerk * jerk_time) + jerk_time;
        let cruise_time = (length_m / speed - ramp_time).max(0.0);
        let duration = 2.0 * ramp_time + cruise_time;
        Self { length: length_m, speed, jerk, jerk_time, ramp_time, duration }
    }

    /// Its duration, s.
    pub const fn duration_s(&self) -> f64 {
        self.duration
    }

    /// The state `t_s` after its start; at rest before the start and after the end.
    pub fn at(&self, t_s: f64) -> Motion {
        let left = self.duration - t_s;
        if t_s <= 0.0 {
            Motion::default()
        } else if left <= 0.0 {
            Motion { distance_m: self.length, speed_m_s: 0.0 }
        } else if left < t_s {
            let mirrored = self.first_half(left);
            Motion { distance_m: self.length - mirrored.distance_m, ..mirrored }
        } else {
            self.first_half(t_s)
        }
    }

    fn first_half(&self, t: f64) -> Motion {
        let (j, tj) = (self.jerk, self.jerk_time);
        let to_go = self.ramp_time - t;
        let (distance_m, speed_m_s) = if to_go <= 0.0 {
            (self.speed * (0.5 * self.ramp_time - to_go), self.speed)
        } else if t < tj {
            (j * t * t * t / 6.0, 0.5 * j * t * t)
        } else if to_go < tj {
            let half = 0.5 * self.speed * self.ramp_time;
            let distance = half - self.speed * to_go + j * to_go * to_go * to_go / 6.0;
            (distance, self.speed - 0.5 * j * to_go * to_go)
        } else {
            let u = t - tj;
            let (v1, s1) = (0.5 * j * tj * tj, j * tj * tj * tj / 6.0);
            (s1 + v1 * u + 0.5 * j * tj * u * u, v1 + j * tj * u)
        };
        Motion { distance_m, speed_m_s }
    }
}

/// The speed at which both ramps together fill the length.
fn reachable_speed(length: f64, a: f64, jerk: f64) -> f64 {
    let without_plateau = cbrt(0.25 * length * length * jerk);
    if without_plateau <= a * a / jerk {
        return without_plateau;
    }
    let jerk_time = a / jerk;
    0.5 * a * (sqrt(jerk_time * jerk_time + 4.0 * length / a) - jerk_time)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn speed_acceleration_and_jerk_stay_bounded_and_the_end_is_reached(
            length in 1e-5..0.5_f64, feed in 1e-3..0.1_f64, acceleration_m_s2 in 0.01..2.0_f64, jerk_m_s3 in 0.1..50.0_f64,
        ) {
            let limits = Limits { acceleration_m_s2, jerk_m_s3 };
            let profile = Profile::new(length, feed, limits);
            let n = 2000;
            let dt = profile.duration_s() / f64::from(n);
            let speed = |k: i32| profile.at(f64::from(k) * dt).speed_m_s;
            for k in 1..n {
                let acceleration = (speed(k + 1) - speed(k - 1)) / (2.0 * dt);
                let jerk = (speed(k + 1) - 2.0 * speed(k) + speed(k - 1)) / (dt * dt);
                prop_assert!(speed(k) <= feed * (1.0 + 1e-12));
                prop_assert!(acceleration.abs() <= acceleration_m_s2 * (1.0 + 1e-6));
                prop_assert!(jerk.abs() <= jerk_m_s3 * (1.0 + 1e-4), "jerk {jerk}");
                let moved = profile.at(f64::from(k + 1) * dt).distance_m - profile.at(f64::from(k - 1) * dt).distance_m;
                prop_assert!((moved / (2.0 * dt) - speed(k)).abs() <= jerk_m_s3 * dt * dt, "speed is the slope of distance");
            }
            prop_assert_eq!(profile.at(profile.duration_s()).distance_m, length);
        }
    }

    #[test]
    fn a_long_stroke_cruises_at_the_feed() {
        let profile = Profile::new(0.1, 0.01, Limits::default());
        let middle = profile.at(0.5 * profile.duration_s());
        assert_eq!(middle.speed_m_s, 0.01);
        assert!((middle.distance_m - 0.05).abs() < 1e-15);
    }
}
