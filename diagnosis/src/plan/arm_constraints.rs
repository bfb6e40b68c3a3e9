//! Reachability: joint limits with a margin, and collision checks of links as capsules against base, floor, each other and keep-out boxes.
//!
//! A link is the line segment between two neighbouring joint points, with a radius; the base is a segment along the first joint's axis. Distances
//! between segments: Ericson, Real-Time Collision Detection (2005), 5.1.9. Objects that are not described (fixtures, cables, the body of the spindle)
//! and motions between poses are not checked.

use glam::DVec3;
use physics::{Arm, Chain, JointKind, Joints};

/// Constraints of the arm; SI units, base frame.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmConstraints {
    /// Margin of a revolute joint to its limits, rad.
    pub margin_rad: f64,
    /// Margin of a prismatic joint to its limits, m.
    pub margin_m: f64,
    /// Radius of the capsules around the links, m.
    pub link_radius_m: f64,
    /// Radius of the capsule around the base, m.
    pub base_radius_m: f64,
    /// Height that no link from the third joint on goes below, m; `None`: no floor.
    pub floor_m: Option<f64>,
    /// Boxes that the links must not enter: lowest and highest corner, m.
    pub keep_out: Vec<[DVec3; 2]>,
}

impl ArmConstraints {
    /// Default constraints of an arm: radii of 8 % and 16 % of its length, margins of 5 degrees and 10 mm, a floor at the foot of an upright arm.
    #[must_use]
    pub fn of(arm: &Arm) -> Self {
        let length: f64 = (0..arm.count())
            .map(|i| {
                arm.joints().get(i).map_or(0.0, |joint| joint.point.distance(arm.next_point(i)))
            })
            .sum();
        let is_upright = arm.gravity.try_normalize().is_some_and(|down| down.z < -0.99);
        Self {
            margin_rad: 5.0_f64.to_radians(),
            margin_m: 0.01,
            link_radius_m: 0.08 * length,
            base_radius_m: 0.16 * length,
            floor_m: is_upright.then_some(0.0),
            keep_out: Vec::new(),
        }
    }

    /// Limits of joint `i` reduced by the margin, rad or m; both at the centre if the margin leaves no range.
    #[must_use]
    pub fn limits(&self, arm: &Arm, i: usize) -> (f64, f64) {
        let Some(joint) = arm.joints().get(i) else { return (0.0, 0.0) };
        let margin = match joint.kind {
            JointKind::Revolute => self.margin_rad,
            JointKind::Prismatic => self.margin_m,
        };
        let (low, high) = (joint.limits.0 + margin, joint.limits.1 - margin);
        if low <= high {
            (low, high)
        } else {
            let middle = 0.5 * (low + high);
            (middle, middle)
        }
    }

    /// Whether joint positions `q` satisfy all constraints.
    #[must_use]
    pub fn allows(&self, arm: &Arm, q: &Joints) -> bool {
        let inside = |i: usize| {
            let (low, high) = self.limits(arm, i);
            q.get(i).is_some_and(|q| (low..=high).contains(q))
        };
        (0..arm.count()).all(inside) && self.is_collision_free(arm, &Chain::nominal(arm, q))
    }

    fn is_collision_free(&self, arm: &Arm, chain: &Chain) -> bool {
        let links = links(arm, chain);
        let apart = self.link_radius_m;
        // The first two links are at the base by construction.
        let beyond: Vec<&LinkSegment> = links.iter().filter(|link| link.from >= 2).collect();
        let on_floor = |floor: f64| beyond.iter().any(|l| l.a.z.min(l.b.z) - apart < floor);
        if self.floor_m.is_some_and(on_floor) {
            return false;
        }
        let base = base_axis(arm);
        let meets_base = |base: &LinkSegment| {
            beyond.iter().any(|l| l.distance(base) < apart + self.base_radius_m)
        };
        if base.as_ref().is_some_and(meets_base) {
            return false;
        }
        let is_too_close =
            |link: &&&LinkSegment, corners: &[DVec3; 2]| distance_to_box(link, corners) < apart;
        if self
            .keep_out
            .iter()
            .any(|corners| beyond.iter().any(|link| is_too_close(&link, corners)))
        {
            return false;
        }
        !links_collide(&links, apart)
    }
}

/// Whether two links collide that are separated by at least four radii of arm length. Closer links always touch, and are kept apart by joint limits.
fn links_collide(links: &[LinkSegment], radius_m: f64) -> bool {
    links.iter().enumerate().any(|(i, one)| {
        let mut between = 0.0;
        links.iter().skip(i + 1).any(|other| {
            let meets = between > 4.0 * radius_m && one.distance(other) < 2.0 * radius_m;
            between += other.a.distance(other.b);
            meets
        })
    })
}

/// A line segment between two points, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LinkSegment {
    pub(crate) a: DVec3,
    pub(crate) b: DVec3,
    /// Joint at which the link begins, from 0.
    pub(crate) from: usize,
}

/// The links of the arm as line segments; those of zero length are omitted.
pub(crate) fn links(arm: &Arm, chain: &Chain) -> Vec<LinkSegment> {
    let count = arm.count();
    let point = |i: usize| if i < count { chain.point(i) } else { chain.base_from_tool.origin };
    let lines = (0..count).map(|from| LinkSegment { a: point(from), b: point(from + 1), from });
    lines.filter(|line| line.a.distance(line.b) > 1e-6).collect()
}

/// Axis of the base: along the first joint's axis from the foot to the height of the second joint; `None` if the first joint is prismatic.
fn base_axis(arm: &Arm) -> Option<LinkSegment> {
    let first = arm.joints().first().filter(|joint| joint.kind == JointKind::Revolute)?;
    let on_axis = |p: DVec3| first.point + first.axis * first.axis.dot(p - first.point);
    Some(LinkSegment { a: on_axis(DVec3::ZERO), b: on_axis(arm.next_point(0)), from: 0 })
}

impl LinkSegment {
    /// Smallest distance of two line segments, m.
    pub(crate) fn distance(&self, other: &Self) -> f64 {
        let (d1, d2, r) = (self.b - self.a, other.b - other.a, self.a - other.a);
        let (a, e, f) = (d1.length_squared(), d2.length_squared(), d2.dot(r));
        let (c, b) = (d1.dot(r), d1.dot(d2));
        let share =
            |x: f64, range: f64| if range > 0.0 { (x / range).clamp(0.0, 1.0) } else { 0.0 };
        let mut s = share(b * f - c * e, a * e - b * b);
        let mut t = share(b * s + f, e);
        s = share(b * t - c, a);
        t = share(b * s + f, e);
        (self.a + d1 * s).distance(other.a + d2 * t)
    }

    fn at(&self, share: f64) -> DVec3 {
        self.a + (self.b - self.a) * share
    }
}

/// Distance of a line segment from a box, m, by ternary search: the distance is a convex function along the segment.
fn distance_to_box(line: &LinkSegment, [low, high]: &[DVec3; 2]) -> f64 {
    let distance = |share: f64| {
        let point = line.at(share);
        point.distance(point.clamp(*low, *high))
    };
    let (mut from, mut to) = (0.0, 1.0);
    for _ in 0..40 {
        let (one, two) = (from + (to - from) / 3.0, to - (to - from) / 3.0);
        if distance(one) <= distance(two) {
            to = two;
        } else {
            from = one;
        }
    }
    distance(0.5 * (from + to))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_campaigns::nominal_robot;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-1.0..1.0_f64).prop_map(DVec3::from_array)
    }

    proptest! {
        #[test]
        fn two_lines_are_as_far_apart_as_their_nearest_points(a in point(), b in point(), c in point(), d in point()) {
            let (one, two) = (LinkSegment { a, b, from: 0 }, LinkSegment { a: c, b: d, from: 0 });
            let shares = || (0..=60).map(|k| f64::from(k) / 60.0);
            let all = shares().flat_map(|s| shares().map(move |t| (s, t)));
            let minimum = all.map(|(s, t)| one.at(s).distance(two.at(t))).fold(f64::INFINITY, f64::min);
            let found = one.distance(&two);
            prop_assert!(found <= minimum + 1e-12 && found > minimum - 0.06, "{found} {minimum}");
        }

        #[test]
        fn a_box_is_as_far_as_its_nearest_point(a in point(), b in point()) {
            let corners = [DVec3::splat(-0.2), DVec3::splat(0.2)];
            let line = LinkSegment { a, b, from: 0 };
            let minimum = (0..=1000).map(|k| line.at(f64::from(k) * 1e-3)).map(|p| p.distance(p.clamp(corners[0], corners[1])));
            let minimum = minimum.fold(f64::INFINITY, f64::min);
            prop_assert!((distance_to_box(&line, &corners) - minimum).abs() < 3e-3);
        }
    }

    #[test]
    fn an_arm_that_stretches_out_is_free_and_one_in_its_base_is_not() {
        let arm = nominal_robot().arm;
        let reach = ArmConstraints::of(&arm);
        let q = |degrees: [f64; 6]| {
            let mut q = Joints::default();
            q.iter_mut().zip(degrees).for_each(|(q, d)| *q = d.to_radians());
            q
        };
        assert!(reach.allows(&arm, &q([0.0; 6])), "the zero configuration");
        assert!(!reach.allows(&arm, &q([179.0, 0.0, 0.0, 0.0, 0.0, 0.0])), "at a limit");
        // Joint 2 down and joint 3 folded back brings the wrist to the column.
        assert!(!reach.allows(&arm, &q([0.0, 100.0, 60.0, 0.0, 0.0, 0.0])), "in the floor");
        assert!(
            !reach.allows(&arm, &q([0.0, -40.0, 60.0, 0.0, 100.0, 0.0])) || {
                let chain = Chain::nominal(&arm, &q([0.0, -40.0, 60.0, 0.0, 100.0, 0.0]));
                chain.base_from_tool.origin.truncate().length() > 0.2
            }
        );
        let tcp = Chain::nominal(&arm, &Joints::default()).base_from_tool.origin;
        let boxed = ArmConstraints { keep_out: vec![[tcp, tcp + DVec3::splat(0.1)]], ..reach };
        assert!(!boxed.allows(&arm, &Joints::default()), "in a box");
    }

    #[test]
    fn no_pose_that_is_let_through_has_its_tool_in_the_base() {
        let arm = nominal_robot().arm;
        let reach = ArmConstraints::of(&arm);
        let mut inside = 0;
        for k in 0..4000_u32 {
            let mut q = Joints::default();
            for (i, q) in q.iter_mut().enumerate().take(6) {
                let (low, high) = reach.limits(&arm, i);
                let share = (f64::from(k + 1)
                    * [0.7548, 0.5698, 0.6180, 0.8191, 0.6711, 0.5497][i])
                    .fract();
                *q = low + (high - low) * share;
            }
            let tcp = Chain::nominal(&arm, &q).base_from_tool.origin;
            let in_base = tcp.truncate().length() < 0.2 && tcp.z < 0.4865;
            inside += usize::from(in_base);
            assert!(!(in_base && reach.allows(&arm, &q)), "{q:?}");
        }
        assert!(inside > 20, "the test asks for poses that are inside: {inside}");
    }
}
