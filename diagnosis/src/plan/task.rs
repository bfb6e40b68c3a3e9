//! Task of a plan: parameters, instruments, constraints; random poses that satisfy the constraints. The same generator gives the same poses. SI
//! units.

use super::PlanError;
use super::arm_constraints::ArmConstraints;
use super::inverse_kinematics::solve_tip_on_surface;
use super::line_of_sight::LineOfSight;
use crate::campaign::{
    Arrival, Campaign, Instrument, Observation, Pose, Reading, ReadingNoise, RecordingInfo,
    ToolPoint,
};
use crate::extrinsics::Extrinsics;
use crate::geometry::{Tolerances, geometry};
use crate::hypothesis::Hypothesis;
use glam::{DMat3, DVec3};
use physics::{AnyEffect, Arm, Chain, Inputs, Joints, Model, ParameterValues};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Largest number of random poses per pose required.
const DRAWS_PER_POSE_MAX: usize = 200;

/// Measurement at each pose.
#[derive(Clone, Debug, PartialEq)]
pub enum MeasurementKind {
    /// Positions of the targets of [`Extrinsics::targets`], or of the TCP if there are none: those visible to the instrument.
    Points {
        /// Minimum number of visible targets; at least 1.
        least: usize,
        /// Standard uncertainty of the tool's orientation, rad, if measured too.
        orientation_rad: Option<f64>,
    },
    /// Distance of the first target (the TCP if there is none) from the first anchor: a ballbar or cable sensor.
    Distance {
        /// Shortest and longest measurable distance, m.
        length_m: [f64; 2],
    },
    /// Contacts of a probe at the first target (the TCP if there is none) with planes and spheres.
    Touch(Vec<TouchSurface>),
}

/// A surface that a probe touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TouchSurface {
    /// A region of a plane of [`Extrinsics::planes`].
    Plane {
        /// Index of the plane.
        plane: usize,
        /// Centre of the region, base frame, m.
        centre: DVec3,
        /// Radius of the region, m.
        radius_m: f64,
    },
    /// A sphere of [`Extrinsics::spheres`], by its index.
    Sphere(usize),
}

/// Parameters, measurement and constraints of a plan.
#[derive(Clone, Debug)]
pub struct Task {
    /// The model with the parameters that are to be fitted.
    pub hypothesis: Hypothesis,
    /// Frames, targets and touched surfaces: approximate positions, known or to be fitted.
    pub surroundings: Extrinsics,
    /// Measurement at each pose.
    pub measurement: MeasurementKind,
    /// Standard uncertainty of lengths.
    pub noise: ReadingNoise,
    /// Line of sight from the instrument; `None` if not required.
    pub sight: Option<LineOfSight>,
    /// Constraints of the arm.
    pub reach: ArmConstraints,
    /// Whether each pose is measured twice, with all joints approaching from below and from above.
    pub both_directions: bool,
    /// Candidate poses, such as those known to be free of collisions; if empty, random poses.
    pub given_poses: Vec<Joints>,
    /// Test poses, at which the tool error is to be small.
    pub test_poses: Vec<Joints>,
}

/// A pose with its simulated measurements.
#[derive(Clone, Debug)]
pub(crate) struct CandidatePose {
    pub(crate) q: Joints,
    pub(crate) poses: Vec<Pose>,
}

/// Hypothesis that `trued calibrate` starts from: the geometry and the effects of `model` with their stated uncertainties, and the compliance of each
/// joint under gravity if masses are stated.
#[must_use]
pub fn calibration_hypothesis(model: &Model, sigma: &[Vec<f64>]) -> Hypothesis {
    let mut hypothesis = geometry(model, sigma);
    let soft = Tolerances::default().compliance;
    let heavy = model.arm.bodies().next().is_some();
    let bends = ["joint_compliance", "gravity_compliance", "gravity_sag", "load_compliance"];
    for joint in 0..model.arm.count() {
        let has =
            |kind: &str| model.effects().any(|e| e.spec().kind == kind && e.joint() == Some(joint));
        if heavy && !bends.iter().any(|kind| has(kind)) {
            let given: &[(&str, &[f64])] = &[("compliance", &[0.0])];
            if let Ok(e) = AnyEffect::build(
                "joint_compliance",
                &model.arm,
                Some(joint),
                ParameterValues(given),
            ) {
                let first = hypothesis.free.len();
                hypothesis.add(e, &[]).unwrap_or_default();
                hypothesis.free[first..].iter_mut().for_each(|free| free.sigma = soft);
            }
        }
    }
    hypothesis
}

impl Task {
    pub(crate) fn arm(&self) -> &Arm {
        &self.hypothesis.model.arm
    }

    /// Up to `wanted` poses that satisfy the constraints, at least `minimum`.
    pub(crate) fn draw(
        &self,
        rng: &mut ChaCha8Rng,
        wanted: usize,
        minimum: usize,
    ) -> Result<Vec<CandidatePose>, PlanError> {
        if !self.given_poses.is_empty() {
            let free = self.given_poses.iter().filter(|q| self.reach.allows(self.arm(), q)).count();
            let found: Vec<CandidatePose> =
                self.given_poses.iter().filter_map(|q| self.candidate(q)).collect();
            return self.check_count(self.given_poses.len(), free, found, minimum);
        }
        let (mut drawn, mut free, mut found) = (0, 0, Vec::new());
        while found.len() < wanted && drawn < DRAWS_PER_POSE_MAX * wanted.max(100) {
            drawn += 1;
            let anywhere = self.random_joints(rng);
            let Some(q) = self.move_to_measurable(rng, &anywhere) else { continue };
            free += usize::from(self.reach.allows(self.arm(), &q));
            found.extend(self.candidate(&q));
        }
        self.check_count(drawn, free, found, minimum)
    }

    /// The poses found, if these are as many as are wanted.
    fn check_count(
        &self,
        drawn: usize,
        free: usize,
        found: Vec<CandidatePose>,
        minimum: usize,
    ) -> Result<Vec<CandidatePose>, PlanError> {
        let (found_count, wanted) = (found.len(), minimum.max(1));
        if found_count >= wanted {
            return Ok(found);
        }
        let (origin, remedy) = match (self.given_poses.is_empty(), &self.sight) {
            (false, None) => ("given", "give more poses, or relax what bars a pose"),
            (false, Some(_)) => {
                ("given", "give more poses, move the instrument, or relax what bars a pose")
            }
            (true, None) => ("drawn", "relax what bars a pose"),
            (true, Some(_)) => ("drawn", "move the instrument, or relax what bars a pose"),
        };
        Err(PlanError::TooFewPoses { drawn, origin, free, seen: found_count, wanted, remedy })
    }

    /// Random poses near `q` that satisfy the constraints.
    pub(crate) fn neighbours(
        &self,
        rng: &mut ChaCha8Rng,
        q: &Joints,
        by: f64,
        count: usize,
    ) -> Vec<CandidatePose> {
        let mut found = Vec::new();
        for _ in 0..if self.given_poses.is_empty() { count } else { 0 } {
            let mut perturbed = *q;
            let moved = perturbed.iter_mut().take(self.arm().count());
            moved.for_each(|q| *q += by * (2.0 * rng.random::<f64>() - 1.0));
            found.extend(self.move_to_measurable(rng, &perturbed).and_then(|q| self.candidate(&q)));
        }
        found
    }

    /// Random poses that satisfy the constraints, as a reference for a plan.
    ///
    /// # Errors
    /// [`PlanError`] if fewer than `count` satisfy them.
    pub fn random(&self, count: usize, seed: u64) -> Result<Vec<Joints>, PlanError> {
        let drawn = self.draw(&mut ChaCha8Rng::seed_from_u64(seed), count, count)?;
        Ok(drawn.into_iter().take(count).map(|candidate| candidate.q).collect())
    }

    /// The campaign that measures these poses, without values; poses that violate a constraint are omitted.
    #[must_use]
    pub fn campaign(&self, stops: &[Joints]) -> Campaign {
        let poses = stops.iter().filter_map(|q| self.candidate(q)).flat_map(|found| found.poses);
        campaign(poses.collect(), &self.surroundings)
    }

    /// Random joint positions within the limits and free of collisions.
    #[must_use]
    pub fn workspace(&self, count: usize, seed: u64) -> Vec<Joints> {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let mut found = Vec::new();
        for _ in 0..DRAWS_PER_POSE_MAX * count {
            let q = self.random_joints(rng);
            if self.reach.allows(self.arm(), &q) {
                found.push(q);
            }
            if found.len() == count {
                break;
            }
        }
        found
    }

    fn random_joints(&self, rng: &mut ChaCha8Rng) -> Joints {
        let mut q = Joints::default();
        for (i, slot) in q.iter_mut().enumerate().take(self.arm().count()) {
            let (low, high) = self.reach.limits(self.arm(), i);
            *slot = low + (high - low) * rng.random::<f64>();
        }
        q
    }

    /// `q` moved to where a measurement is possible: onto a touched surface, or to a measurable length.
    fn move_to_measurable(&self, rng: &mut ChaCha8Rng, q: &Joints) -> Option<Joints> {
        let arm = self.arm();
        let tip = self.tip();
        match &self.measurement {
            MeasurementKind::Points { .. } => Some(*q),
            MeasurementKind::Distance { length_m: [shortest, longest] } => {
                let anchor = self.surroundings.anchors.first()?.place.value;
                let length = shortest + (longest - shortest) * rng.random::<f64>();
                solve_tip_on_surface(arm, q, tip, |p| {
                    ((p - anchor).length() - length, (p - anchor).normalize_or_zero())
                })
            }
            MeasurementKind::Touch(patches) => {
                let patch = patches.get(rng.random_range(0..patches.len().max(1)))?;
                match *patch {
                    TouchSurface::Plane { plane, .. } => {
                        let plane = self.surroundings.planes.get(plane)?.value;
                        let distance = |p: DVec3| plane.normal.dot(p) - plane.offset_m;
                        solve_tip_on_surface(arm, q, tip, |p| (distance(p), plane.normal))
                    }
                    TouchSurface::Sphere(sphere) => {
                        let sphere = self.surroundings.spheres.get(sphere)?;
                        let (centre, radius) = (sphere.centre.value, sphere.radius_m.value);
                        let distance_and_normal = |p: DVec3| {
                            ((p - centre).length() - radius, (p - centre).normalize_or_zero())
                        };
                        solve_tip_on_surface(arm, q, tip, distance_and_normal)
                    }
                }
            }
        }
    }

    /// The point of the tool at which a ballbar or probe is mounted, tool frame, m.
    fn tip(&self) -> DVec3 {
        self.surroundings.targets.first().map_or(DVec3::ZERO, |target| target.value)
    }

    fn tip_place(&self) -> ToolPoint {
        if self.surroundings.targets.is_empty() { ToolPoint::Tcp } else { ToolPoint::Target(0) }
    }

    /// `q` with the measurements taken there; `None` if a constraint is violated.
    pub(crate) fn candidate(&self, q: &Joints) -> Option<CandidatePose> {
        if !self.reach.allows(self.arm(), q) {
            return None;
        }
        let chain = Chain::nominal(self.arm(), q);
        let readings = self.readings(&chain)?;
        let sides: &[f64] = if self.both_directions { &[1.0, -1.0] } else { &[0.0] };
        let pose = |side: &f64| {
            let mut inputs = Inputs::at_rest(*q);
            inputs.direction.iter_mut().take(self.arm().count()).for_each(|d| *d = *side);
            Pose { inputs, arrival: Arrival::Settled, recording: 0, row: 0, seen: readings.clone() }
        };
        Some(CandidatePose { q: *q, poses: sides.iter().map(pose).collect() })
    }

    fn readings(&self, chain: &Chain) -> Option<Vec<Observation>> {
        let mut readings = match &self.measurement {
            MeasurementKind::Points { least, orientation_rad } => {
                self.point_readings(chain, *least, *orientation_rad)?
            }
            MeasurementKind::Distance { .. } => {
                let (place, anchor) = (self.tip_place(), 0);
                vec![(Reading::Distance { place, anchor, length_m: 0.0 }, self.noise, DVec3::ZERO)]
            }
            MeasurementKind::Touch(patches) => {
                vec![(self.touch_reading(chain, patches)?, self.noise, DVec3::ZERO)]
            }
        };
        let observe = |(reading, noise, position): (Reading, ReadingNoise, DVec3)| {
            Some(Observation { reading, whitening: noise.whitening(position)?, instrument: 0 })
        };
        readings.drain(..).map(observe).collect()
    }

    fn point_readings(
        &self,
        chain: &Chain,
        minimum: usize,
        orientation_rad: Option<f64>,
    ) -> Option<Vec<(Reading, ReadingNoise, DVec3)>> {
        let station = self.surroundings.frames.first()?.value.measuring_from_base;
        let frame = self.surroundings.frames.len() - 1;
        let places: Vec<ToolPoint> = match self.surroundings.targets.len() {
            0 => vec![ToolPoint::Tcp],
            count => (0..count).map(ToolPoint::Target).collect(),
        };
        let is_seen = |place: &ToolPoint| {
            let radius = self.reach.link_radius_m;
            self.sight.as_ref().is_none_or(|sight| {
                sight.sees(self.arm(), chain, &self.surroundings, *place, radius)
            })
        };
        let mut readings = Vec::new();
        for place in places.into_iter().filter(is_seen) {
            let on_tool = match place {
                ToolPoint::Tcp => DVec3::ZERO,
                ToolPoint::Target(i) => self.surroundings.targets[i].value,
            };
            let position = station.point(chain.base_from_tool.point(on_tool));
            readings.push((Reading::Point { place, frame, at: position }, self.noise, position));
        }
        if readings.len() < minimum.max(1) {
            return None;
        }
        if let Some(sigma) = orientation_rad {
            let reading = Reading::Orientation { frame, measuring_from_tool: DMat3::IDENTITY };
            readings.push((reading, ReadingNoise::Equal(sigma), DVec3::ZERO));
        }
        Some(readings)
    }

    /// The reading of the surface that the probe touches.
    fn touch_reading(&self, chain: &Chain, patches: &[TouchSurface]) -> Option<Reading> {
        let tip = chain.base_from_tool.point(self.tip());
        let place = self.tip_place();
        let inwards = -(chain.base_from_tool.rotation * DVec3::Z);
        // The probe must point into the surface within 60 degrees.
        let points_in = |normal: DVec3| inwards.dot(normal) > 0.5;
        patches.iter().find_map(|patch| match *patch {
            TouchSurface::Plane { plane, centre, radius_m } => {
                let touched_plane = self.surroundings.planes.get(plane)?.value;
                let on = (touched_plane.normal.dot(tip) - touched_plane.offset_m).abs() < 1e-6;
                let reading = Reading::Plane { place, plane, radius_m: 0.0 };
                (on && tip.distance(centre) <= radius_m && points_in(touched_plane.normal))
                    .then_some(reading)
            }
            TouchSurface::Sphere(sphere) => {
                let touched_sphere = self.surroundings.spheres.get(sphere)?;
                let out = tip - touched_sphere.centre.value;
                let on = (out.length() - touched_sphere.radius_m.value).abs() < 1e-6;
                let reading = Reading::Sphere { place, sphere, radius_m: 0.0 };
                (on && points_in(out.normalize_or_zero())).then_some(reading)
            }
        })
    }
}

/// A campaign of one instrument with known noise.
pub(crate) fn campaign(poses: Vec<Pose>, surroundings: &Extrinsics) -> Campaign {
    let name = "planned".to_owned();
    Campaign {
        poses,
        surroundings: surroundings.clone(),
        instruments: vec![Instrument { name, noise_is_known: true, ..Instrument::default() }],
        recordings: vec![RecordingInfo::of_poses("planned")],
    }
}
