//! From a cut to its verdict, the stability chart and the nearest stable cuts.

use spectrum::stability::{
    CutAxes, Cutter, FeedDirectionLimits, FlexibleMode, Limit, SpeedLimits, Stability,
    StabilityError, limits_by_feed_direction, limits_by_speed, nearest_speed_rpm,
};

use super::input::{Cut, SourcedMode};
use crate::error::Error;

/// Directions of feed over a whole turn.
const DIRECTIONS: usize = 72;

/// A limit that reaches this part of the largest is as good.
const ALIKE: f64 = 0.995;

/// Stability of a cut.
pub struct Analysis {
    /// The cut.
    pub cut: Cut,
    /// Modulus of the multiplier from tooth to tooth; below 1 a vibration decays.
    pub modulus: f64,
    /// Whether the cut is stable, by semi-discretisation.
    pub is_stable: bool,
    /// The limit at the present speed and feed; `None` if it is above the largest depth.
    pub limit: Option<Limit>,
    /// The same by the zeroth order.
    pub zeroth_order: Option<Limit>,
    /// The limit of mode coupling without regeneration; `None` if it is above the largest depth.
    pub mode_coupling: Option<Limit>,
    /// The frequency of chatter of the present cut, or at its limit, Hz.
    pub chatter_hz: Option<f64>,
    /// The limit over spindle speed.
    pub chart: Vec<SpeedLimits>,
    /// The limit over the direction of feed.
    pub directions: Vec<FeedDirectionLimits>,
    /// The nearest stable cuts.
    pub nearest: Nearest,
    pub(super) stability: Stability,
}

/// The nearest cuts that are stable with the margin; each changes one parameter.
pub struct Nearest {
    /// The present cut is one.
    pub is_present: bool,
    /// Spindle speed at the present depth, rev/min; `None`: none on the chart.
    pub spindle_rpm: Option<f64>,
    /// Depth at the present speed, m.
    pub depth_m: f64,
    /// The smallest change of the feed direction that makes the cut stable; `None` if there is
    /// none.
    pub turned: Option<FeedDirectionLimits>,
    /// The direction of feed with the largest limit.
    pub best: Option<FeedDirectionLimits>,
}

/// Computes the stability of a cut, its limits and the nearest stable cuts.
///
/// # Errors
/// [`Error::Input`] if the cut or a mode is impossible.
pub fn analyse(cut: Cut) -> Result<Analysis, Error> {
    Analysis::of(cut).map_err(Error::input)
}

impl Analysis {
    fn of(cut: Cut) -> Result<Self, StabilityError> {
        let stability = stability(&cut)?;
        let file = &cut.file;
        let (rpm, depth_m, deepest_m) =
            (file.spindle_rpm, file.cut.axial_depth_m, file.chart.depth_max_m);
        let multiplier = stability.multiplier(rpm, depth_m)?;
        let is_stable = multiplier.norm() < 1.0;
        let limit = stability.limit(rpm, deepest_m)?;
        let lobes = stability.lobes(deepest_m);
        let chart =
            limits_by_speed(&stability, file.chart.spindle_rpm, file.chart.points, deepest_m)?;
        let directions = limits_by_feed_direction(&stability, rpm, DIRECTIONS, deepest_m)?;
        let required_m = depth_m * (1.0 + file.margin);
        let spindle_rpm = nearest_speed_rpm(&stability, &chart, rpm, required_m, deepest_m)?;
        let nearest = Nearest {
            is_present: is_stable && holds(limit, required_m),
            spindle_rpm,
            depth_m: limit.map_or(deepest_m, |limit| limit.depth_m) / (1.0 + file.margin),
            turned: least_turn(&directions, required_m),
            best: best(&directions),
        };
        let chatter_hz = (!is_stable).then(|| stability.chatter_hz(rpm, multiplier));
        Ok(Self {
            modulus: multiplier.norm(),
            is_stable,
            limit,
            zeroth_order: lobes.limit(rpm),
            mode_coupling: lobes.mode_coupling(),
            chatter_hz: chatter_hz.or(limit.map(|limit| limit.frequency_hz)),
            chart,
            directions,
            nearest,
            stability,
            cut,
        })
    }

    /// Direction of the feed when it is turned by an angle, in the frame of the modes.
    #[must_use]
    pub fn feed(&self, angle_rad: f64) -> [f64; 3] {
        self.stability.axes().rotated(angle_rad).feed()
    }

    /// Direction out of the workpiece, in the frame of the modes, unit length.
    #[must_use]
    pub fn up(&self) -> [f64; 3] {
        self.stability.axes().up()
    }
}

/// Whether a depth is below a limit; `None` is no limit.
pub(super) fn holds(limit: Option<Limit>, depth_m: f64) -> bool {
    limit.is_none_or(|limit| depth_m < limit.depth_m)
}

fn deepest(one: &FeedDirectionLimits) -> f64 {
    one.limit.map_or(f64::INFINITY, |limit| limit.depth_m)
}

/// The direction with the largest limit; of several with about the same, the one closest to the
/// present feed.
fn best(directions: &[FeedDirectionLimits]) -> Option<FeedDirectionLimits> {
    let most_m = directions.iter().map(deepest).fold(0.0, f64::max);
    least_turn(directions, ALIKE * most_m)
}

/// Of the directions that allow a depth, the one closest to the present feed.
fn least_turn(directions: &[FeedDirectionLimits], depth_m: f64) -> Option<FeedDirectionLimits> {
    let turn = |one: &FeedDirectionLimits| signed_rad(one.angle_rad).abs();
    let allowing = directions.iter().copied().filter(|one| holds(one.limit, depth_m));
    allowing.min_by(|a, b| turn(a).total_cmp(&turn(b)))
}

/// An angle from 0 to a turn, as one from −180° to 180°.
pub(super) fn signed_rad(angle_rad: f64) -> f64 {
    let half = std::f64::consts::PI;
    if angle_rad > half { angle_rad - 2.0 * half } else { angle_rad }
}

fn stability(of: &Cut) -> Result<Stability, StabilityError> {
    let (file, cut) = (&of.file, &of.file.cut);
    let cutter = Cutter {
        teeth: cut.teeth,
        diameter_m: cut.diameter_m,
        helix_rad: cut.helix_rad,
        entry_rad: cut.entry_rad,
        exit_rad: cut.exit_rad,
        turning: cut.turning,
        chip_n_m2: cut.cutting_pa,
    };
    let flexible = |one: &SourcedMode| FlexibleMode {
        frequency_hz: one.mode.frequency_hz,
        damping_ratio: one.mode.damping_ratio,
        stiffness_n_per_m: one.mode.stiffness_n_per_m,
        direction: one.mode.direction,
    };
    let flexible: Vec<FlexibleMode> = of.modes.iter().map(flexible).collect();
    Stability::new(&flexible, cutter, CutAxes::new(file.feed, file.up)?)
}
