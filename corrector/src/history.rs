//! Past values for the comparison with delayed measurements: predicted positions of the measured point, or feed overrides.
//!
//! A ring of [`CAPACITY`] points, at least [`SPACING_NS`] apart: it reaches back a second at least, at any rate of commands. Linear interpolation between points, and linear extrapolation beyond
//! the newest by at most its distance from the previous one, because a present measurement lies between the last command and the next.
//! `None` before the first point, later than the extrapolation allows, or across a gap of more than
//! [`GAP_NS`].

use core::ops::{Add, Mul};

/// Points kept.
const CAPACITY: usize = 1024;
/// Points closer than this are dropped, ns: between points 1 ms apart, linear interpolation is off
/// by 0.1 µm per m/s² of acceleration.
const SPACING_NS: u64 = 1_000_000;
/// No interpolation between points further apart, ns: commands have paused, and the robot's motion
/// between them is unknown.
const GAP_NS: u64 = 50_000_000;

#[derive(Clone, Copy, Debug)]
struct Point<V> {
    t_ns: u64,
    value: V,
}

/// The points, newest last.
#[derive(Clone, Debug)]
pub(crate) struct History<V> {
    points: [Point<V>; CAPACITY],
    /// Index of the next point.
    next: usize,
    count: usize,
}

impl<V: Copy + Default + Add<Output = V> + Mul<f64, Output = V>> History<V> {
    pub(crate) fn new() -> Self {
        Self { points: [Point { t_ns: 0, value: V::default() }; CAPACITY], next: 0, count: 0 }
    }

    /// Drops all points.
    pub(crate) fn clear(&mut self) {
        self.count = 0;
    }

    /// Adds a point; one that is not later than the newest clears the ring first.
    pub(crate) fn push(&mut self, t_ns: u64, value: V) {
        match self.nth_newest(0) {
            Some(newest) if t_ns <= newest.t_ns => self.clear(),
            Some(newest) if t_ns - newest.t_ns < SPACING_NS => return,
            _ => {}
        }
        if let Some(place) = self.points.get_mut(self.next) {
            *place = Point { t_ns, value };
        }
        self.next = (self.next + 1) % CAPACITY;
        self.count = (self.count + 1).min(CAPACITY);
    }

    /// The value at time `t_ns`.
    pub(crate) fn at(&self, t_ns: u64) -> Option<V> {
        let mut later = self.nth_newest(0)?;
        for age in 1..self.count {
            let earlier = self.nth_newest(age)?;
            if earlier.t_ns <= t_ns {
                let (since_ns, apart_ns) = (t_ns - earlier.t_ns, later.t_ns - earlier.t_ns);
                let share = since_ns as f64 / apart_ns as f64;
                let reaches = apart_ns <= GAP_NS && since_ns <= 2 * apart_ns;
                return reaches.then(|| earlier.value * (1.0 - share) + later.value * share);
            }
            later = earlier;
        }
        None
    }

    /// The point `age` places before the newest.
    fn nth_newest(&self, age: usize) -> Option<Point<V>> {
        let index = (self.next + CAPACITY).checked_sub(1 + age)? % CAPACITY;
        self.points.get(index).filter(|_| age < self.count).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    const MS: u64 = 1_000_000;

    fn line(every_ns: u64, count: u64) -> History<DVec3> {
        let mut history = History::new();
        (1..=count).for_each(|k| history.push(k * every_ns, DVec3::X * (k * every_ns) as f64));
        history
    }

    #[test]
    fn a_past_point_is_interpolated_and_one_outside_is_not_made_up() {
        let history = line(4 * MS, 100);
        assert_eq!(history.at(10 * MS), Some(DVec3::X * 10e6));
        assert_eq!(history.at(3 * MS), None, "before the first");
        assert_eq!(history.at(400 * MS), Some(DVec3::X * 400e6));
        assert_eq!(history.at(402 * MS), Some(DVec3::X * 402e6), "until the next command");
        assert_eq!(history.at(405 * MS), None, "the next command is late");
    }

    #[test]
    fn at_any_rate_of_commands_it_reaches_back_a_second_and_no_further_than_its_room() {
        for every_ns in [MS / 10, MS, 4 * MS] {
            let last_ns = 8_000 * MS;
            let history = line(every_ns, last_ns / every_ns);
            let position = history.at(last_ns - 1_000 * MS).expect("a second ago");
            assert!((position.x - 7e9).abs() < 1.0, "{position}");
            assert_eq!(history.at(MS / 20), None);
        }
    }

    #[test]
    fn nothing_is_said_of_the_time_in_which_commands_paused() {
        let mut history = line(MS, 10);
        history.push(100 * MS, DVec3::ZERO);
        assert_eq!((history.at(50 * MS), history.at(5 * MS).is_some()), (None, true));
        history.push(90 * MS, DVec3::Y);
        assert_eq!(history.at(5 * MS), None, "time went back: begun anew");
    }
}
