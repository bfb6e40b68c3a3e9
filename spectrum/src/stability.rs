//! Prediction of chatter stability: the axial depth from which chatter grows, from modes, cutter
//! and cutting coefficients.
//!
//! The tool moves on modes `q'' + 2ζω q' + ω² q = ω²/k (u·F)`, `r = Σ u q`. For a tooth at angle φ
//! (from the normal axis, with the rotation) vibration changes the chip thickness by `h = n·(r(t) −
//! r(t − τ))`, `n = (sin φ, cos φ)`, τ: tooth passing period; `F = a W (r(t) − r(t − τ))`, a: axial
//! depth, W: directional coefficients, the sum over the teeth in the cut of `f nᵀ`, `f = (−K_tc cos
//! φ − K_rc sin φ, K_tc sin φ − K_rc cos φ, K_ac)`. Signs, cut axes and coefficients are those of a
//! recording's `[cut]`.
//!
//! Three results: the zeroth-order lobes ([`Lobes`], mean of W; Altintas and Budak 1995), the limit
//! by semi-discretisation ([`Stability::limit`], periodic W; Insperger and Stépán 2002, 2004), the
//! limit of mode coupling without regeneration ([`Lobes::mode_coupling`]).
//!
//! Linear theory: it predicts whether a small vibration grows, not its final amplitude. Not
//! modelled: process damping (limits at low speed are too low), runout and unequal pitch, chip
//! thickness variation by axial motion, modes that change with speed or along the cut.

mod axes;
mod chart;
mod directional_coefficients;
mod lobes;
mod semi_discretisation;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod time_domain_reference;

use crate::Complex;
use directional_coefficients::DirectionalCoefficients;
use nalgebra::{Matrix2x3, Matrix3x2, Vector3};
use std::f64::consts::TAU;

pub use axes::CutAxes;
pub use chart::{
    FeedDirectionLimits, SpeedLimits, limits_by_feed_direction, limits_by_speed, nearest_speed_rpm,
};
pub use lobes::Lobes;

/// Largest number of waves of the highest mode per tooth period: beyond it, process damping
/// determines the limit and the equations do not hold.
pub const WAVES_MAX: f64 = 100.0;
/// Factor between depths in the search for the limit; thinner unstable bands are not found.
const DEPTH_STEP: f64 = 1.04;
/// Factor between depths below `COARSE_DEPTH_PART` of the smallest limit of all speeds (zeroth
/// order), where no lobe is expected.
const COARSE_DEPTH_STEP: f64 = 1.2;
const COARSE_DEPTH_PART: f64 = 0.5;
/// Relative accuracy of the limit.
const DEPTH_TOLERANCE: f64 = 1e-4;
/// Largest number of iterations of the search within a bracket.
const REFINEMENTS: usize = 40;

/// A vibration mode of tool, workpiece and robot, at the tool tip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlexibleMode {
    /// Natural frequency, Hz, above 0.
    pub frequency_hz: f64,
    /// Damping ratio, above 0 and below 1.
    pub damping_ratio: f64,
    /// Modal stiffness at the tool tip along `direction`, N/m, above 0: modal mass times `(2π frequency)²`.
    pub stiffness_n_per_m: f64,
    /// Direction of the tip's motion, of any length but 0, in the frame of the arguments of
    /// [`CutAxes::new`].
    pub direction: [f64; 3],
}

/// Cutter, engagement and cutting coefficients, without the axial depth. Angles as in `[cut]` of a
/// recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cutter {
    /// Number of teeth, equally spaced, from 1.
    pub teeth: u32,
    /// Diameter, m, above 0; used for the helix only.
    pub diameter_m: f64,
    /// Helix angle, rad, within ±π/2.
    pub helix_rad: f64,
    /// Entry angle of a tooth, rad from the normal axis with the rotation.
    pub entry_rad: f64,
    /// Exit angle, rad, above `entry_rad` by at most one revolution.
    pub exit_rad: f64,
    /// Turning: the workpiece rotates and the tool is at φ = 90°; the delay is one revolution.
    pub turning: bool,
    /// Cutting force coefficients `K_tc, K_rc, K_ac`: tangential, radial, axial, N/m².
    pub chip_n_m2: [f64; 3],
}

impl Cutter {
    /// Entry and exit angles of up (conventional) milling, rad; `immersion`: radial depth over
    /// diameter, 0 to 1.
    #[must_use]
    pub fn up_milling(immersion: f64) -> [f64; 2] {
        [0.0, engagement_rad(immersion)]
    }

    /// Entry and exit angles of down (climb) milling, rad; `immersion`: radial depth over diameter,
    /// 0 to 1.
    #[must_use]
    pub fn down_milling(immersion: f64) -> [f64; 2] {
        [0.5 * TAU - engagement_rad(immersion), 0.5 * TAU]
    }

    /// Lag angle of the top of a helical tooth behind its tip, rad.
    fn lag_rad(&self, depth_m: f64) -> f64 {
        if self.turning { 0.0 } else { depth_m * self.helix_rad.tan() / (0.5 * self.diameter_m) }
    }

    /// Tooth passing period, s.
    fn delay_s(&self, spindle_rpm: f64) -> f64 {
        60.0 / (spindle_rpm * f64::from(self.teeth))
    }
}

fn engagement_rad(immersion: f64) -> f64 {
    (1.0 - 2.0 * immersion.clamp(0.0, 1.0)).acos()
}

/// A stability limit, and the frequency of the chatter that begins there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit {
    /// Axial depth from which chatter grows, m.
    pub depth_m: f64,
    /// Chatter frequency, Hz.
    pub frequency_hz: f64,
}

/// Invalid input of a stability prediction.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum StabilityError {
    /// No mode.
    #[error("stability: there is no mode; expected at least one")]
    NoMode,
    /// A mode with an invalid parameter.
    #[error(
        "stability: mode {number} has {what} = {value}, expected a finite number above 0 (damping: below 1)"
    )]
    Mode {
        /// Number of the mode, from 1.
        number: usize,
        /// What of it.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A cutter that cannot cut.
    #[error("stability: the cutter has {what} = {value}, expected {expected}")]
    Cutter {
        /// What of it.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What was expected.
        expected: &'static str,
    },
    /// Feed and upward direction do not span a plane.
    #[error(
        "stability: feed and up are parallel, or one of them is 0; expected two directions across each other"
    )]
    Axes,
    /// Feed and upward direction are not at right angles.
    #[error(
        "stability: feed and up are {angle_deg:.1}° apart, expected 90° within 1°: the cut is computed in the plane across up (the tool's axis); \
         keep up and state feed = [{:.4}, {:.4}, {:.4}], or keep feed and state up = [{:.4}, {:.4}, {:.4}]",
        .feed[0], .feed[1], .feed[2], .up[0], .up[1], .up[2]
    )]
    Skew {
        /// Angle between them, degrees.
        angle_deg: f64,
        /// The part of the feed across `up`, unit length.
        feed: [f64; 3],
        /// The part of `up` across the feed, unit length.
        up: [f64; 3],
    },
    /// The spindle speed is too low for the model.
    #[error(
        "stability: at {spindle_rpm} rpm the highest mode swings {waves:.0} times from tooth to tooth, expected at most {WAVES_MAX}: there process \
         damping rules the limit; raise the lowest spindle speed or leave the mode out"
    )]
    TooSlow {
        /// Spindle speed, rev/min.
        spindle_rpm: f64,
        /// Waves of the highest mode per tooth period.
        waves: f64,
    },
}

/// A mode of the tool tip in cut axes.
#[derive(Clone, Copy, Debug)]
struct TipMode {
    omega_rad_s: f64,
    damping_ratio: f64,
    stiffness_n_per_m: f64,
    /// Unit vector: along the feed, across it, up out of the workpiece.
    direction: Vector3<f64>,
}

impl TipMode {
    /// Receptance along its direction, m/N.
    fn receptance(&self, omega_rad_s: f64) -> Complex<f64> {
        let ratio = omega_rad_s / self.omega_rad_s;
        let dynamic = Complex::new(1.0 - ratio * ratio, 2.0 * self.damping_ratio * ratio);
        (self.stiffness_n_per_m * dynamic).inv()
    }
}

/// Chatter stability of a structure, a cutter and a feed direction.
#[derive(Clone, Debug)]
pub struct Stability {
    modes: Vec<FlexibleMode>,
    axes: CutAxes,
    cutter: Cutter,
    tip_modes: Vec<TipMode>,
    /// The smallest limit of all speeds by the zeroth-order solution, m.
    min_depth_m: f64,
}

impl Stability {
    /// For modes and a cutter that is fed along the first of the `axes`.
    ///
    /// # Errors
    /// [`StabilityError`]: the invalid number.
    pub fn new(
        modes: &[FlexibleMode],
        cutter: Cutter,
        axes: CutAxes,
    ) -> Result<Self, StabilityError> {
        check_cutter(&cutter)?;
        if modes.is_empty() {
            return Err(StabilityError::NoMode);
        }
        let swing = |(index, mode): (usize, &FlexibleMode)| {
            check_mode(index + 1, mode)?;
            Ok(TipMode {
                omega_rad_s: TAU * mode.frequency_hz,
                damping_ratio: mode.damping_ratio,
                stiffness_n_per_m: mode.stiffness_n_per_m,
                direction: axes.in_cut_axes(mode.direction).normalize(),
            })
        };
        let tip_modes = modes.iter().enumerate().map(swing).collect::<Result<_, _>>()?;
        let stability = Self { modes: modes.to_vec(), axes, cutter, tip_modes, min_depth_m: 0.0 };
        Ok(stability.with_min_depth())
    }

    /// The same cut with another feed direction: rotated about the upward axis, counterclockwise
    /// seen from above; the modes are unchanged.
    #[must_use]
    pub fn with_feed_rotated(&self, angle_rad: f64) -> Self {
        let axes = self.axes.rotated(angle_rad);
        let mut other = self.clone();
        for (swing, mode) in other.tip_modes.iter_mut().zip(&self.modes) {
            swing.direction = axes.in_cut_axes(mode.direction).normalize();
        }
        Self { axes, ..other }.with_min_depth()
    }

    fn with_min_depth(self) -> Self {
        let min_depth_m = self.lobes(0.0).min_depth_m();
        Self { min_depth_m, ..self }
    }

    /// The axes of the cut.
    #[must_use]
    pub fn axes(&self) -> &CutAxes {
        &self.axes
    }

    /// Zeroth-order lobes and the limit of mode coupling, up to a depth in m.
    #[must_use]
    pub fn lobes(&self, depth_max_m: f64) -> Lobes {
        Lobes::new(&self.tip_modes, &self.mean_coefficients(), self.cutter, depth_max_m)
    }

    /// The Floquet multiplier of largest modulus, per tooth period: vibration grows if it is
    /// outside the unit circle.
    ///
    /// First-order semi-discretisation: in each step the directional coefficients are replaced by
    /// their mean and the delayed displacement by a straight line; everything else is exact.
    ///
    /// # Errors
    /// [`StabilityError::TooSlow`].
    pub fn multiplier(
        &self,
        spindle_rpm: f64,
        depth_m: f64,
    ) -> Result<Complex<f64>, StabilityError> {
        self.check_speed(spindle_rpm)?;
        Ok(semi_discretisation::multiplier(&self.tip_modes, &self.cutter, spindle_rpm, depth_m))
    }

    /// The smallest depth at which the cut becomes unstable by semi-discretisation, searched
    /// upwards; `None` if it is stable up to `depth_max_m`.
    ///
    /// The search step is 4 % of the depth: a narrower unstable range of depths below the limit may
    /// be missed.
    ///
    /// # Errors
    /// [`StabilityError::TooSlow`].
    pub fn limit(
        &self,
        spindle_rpm: f64,
        depth_max_m: f64,
    ) -> Result<Option<Limit>, StabilityError> {
        self.check_speed(spindle_rpm)?;
        let multiplier = |depth_m: f64| {
            semi_discretisation::multiplier(&self.tip_modes, &self.cutter, spindle_rpm, depth_m)
        };
        let mut stable = (self.stable_depth_m().min(depth_max_m), -1.0);
        loop {
            if stable.0 >= depth_max_m {
                return Ok(None);
            }
            let is_below = stable.0 < COARSE_DEPTH_PART * self.min_depth_m;
            let step = if is_below { COARSE_DEPTH_STEP } else { DEPTH_STEP };
            let depth_m = (step * stable.0).min(depth_max_m);
            let multiplier_at_depth = multiplier(depth_m);
            let excess = multiplier_at_depth.norm() - 1.0;
            if excess > 0.0 {
                let depth_m =
                    find_crossing(stable, (depth_m, excess), |m| multiplier(m).norm() - 1.0);
                let frequency_hz = self.chatter_hz(spindle_rpm, multiplier(depth_m));
                return Ok(Some(Limit { depth_m, frequency_hz }));
            }
            stable = (depth_m, excess);
        }
    }

    /// The chatter frequency of a multiplier, Hz: of the frequencies that differ by multiples of
    /// the tooth passing frequency, the one with the largest response of the structure.
    #[must_use]
    pub fn chatter_hz(&self, spindle_rpm: f64, multiplier: Complex<f64>) -> f64 {
        let tooth_hz = 1.0 / self.cutter.delay_s(spindle_rpm);
        let turn = multiplier.arg() / TAU;
        let highest_hz = self.highest_hz();
        let multiples = (1.2 * highest_hz / tooth_hz).ceil() as i32 + 1;
        let answer = |hz: &f64| -> f64 {
            let one = |swing: &TipMode| {
                let in_plane = swing.direction.xy().norm_squared();
                in_plane * swing.receptance(TAU * hz).norm()
            };
            self.tip_modes.iter().map(one).sum()
        };
        (-multiples..=multiples)
            .map(|k| ((turn + f64::from(k)) * tooth_hz).abs())
            .max_by(|a, b| answer(a).total_cmp(&answer(b)))
            .unwrap_or(0.0)
    }

    fn highest_hz(&self) -> f64 {
        self.tip_modes.iter().map(|swing| swing.omega_rad_s / TAU).fold(0.0, f64::max)
    }

    fn check_speed(&self, spindle_rpm: f64) -> Result<(), StabilityError> {
        let waves = self.highest_hz() * self.cutter.delay_s(spindle_rpm);
        let holds = spindle_rpm > 0.0 && waves <= WAVES_MAX;
        if holds { Ok(()) } else { Err(StabilityError::TooSlow { spindle_rpm, waves }) }
    }

    /// Mean of W over a revolution, N/m².
    fn mean_coefficients(&self) -> Matrix3x2<f64> {
        let pitch_rad = TAU / f64::from(self.cutter.teeth);
        DirectionalCoefficients::new(&self.cutter, 0.0)
            .mean_over_teeth(self.cutter.entry_rad, pitch_rad)
    }

    /// A depth up to which the cut is stable at any speed: the loop gain `2 a |G| |W|` is below 1
    /// (small-gain theorem).
    fn stable_depth_m(&self) -> f64 {
        let answer = |swing: &TipMode| {
            // The peak of a receptance is at most 1/(2kζ sqrt(1 − ζ²)), or 1/k beyond ζ = 0.7.
            let zeta = swing.damping_ratio.min(std::f64::consts::FRAC_1_SQRT_2);
            let peak = 1.0 / (2.0 * zeta * (1.0 - zeta * zeta).sqrt() * swing.stiffness_n_per_m);
            peak * swing.direction.xy().norm()
        };
        let answer: f64 = self.tip_modes.iter().map(answer).sum();
        let arc_rad = self.cutter.exit_rad - self.cutter.entry_rad;
        let teeth = (arc_rad / TAU * f64::from(self.cutter.teeth)).floor() + 1.0;
        let force = Vector3::from(self.cutter.chip_n_m2).norm();
        let gain = 2.0 * teeth.min(f64::from(self.cutter.teeth)) * answer * force;
        // Without feedback the search begins at a depth beyond any practical one.
        1.0 / gain.max(1e-6)
    }
}

/// Zero of a function within a bracket of positive depths, negative at the lower end (regula falsi,
/// Illinois variant).
fn find_crossing(low: (f64, f64), high: (f64, f64), value: impl Fn(f64) -> f64) -> f64 {
    let ((mut a, mut fa), (mut b, mut fb)) = (low, high);
    for _ in 0..REFINEMENTS {
        if b - a < DEPTH_TOLERANCE * b {
            break;
        }
        let part = (fa / (fa - fb)).clamp(0.01, 0.99);
        let middle = a + part * (b - a);
        let f = value(middle);
        if f > 0.0 {
            (b, fb) = (middle, f);
            fa *= 0.5;
        } else {
            (a, fa) = (middle, f);
            fb *= 0.5;
        }
    }
    0.5 * (a + b)
}

fn check_mode(number: usize, mode: &FlexibleMode) -> Result<(), StabilityError> {
    let length = Vector3::from(mode.direction).norm();
    let all = [
        ("frequency_hz", mode.frequency_hz, f64::INFINITY),
        ("damping_ratio", mode.damping_ratio, 1.0),
        ("stiffness_n_per_m", mode.stiffness_n_per_m, f64::INFINITY),
        ("length of direction", length, f64::INFINITY),
    ];
    let bad = all.iter().find(|(_, value, below)| !(*value > 0.0 && value < below));
    bad.map_or(Ok(()), |&(what, value, _)| Err(StabilityError::Mode { number, what, value }))
}

fn check_cutter(cutter: &Cutter) -> Result<(), StabilityError> {
    let arc_rad = cutter.exit_rad - cutter.entry_rad;
    let force = Vector3::from(cutter.chip_n_m2).norm();
    let straight = 0.25 * TAU;
    let all = [
        ("teeth", f64::from(cutter.teeth), cutter.teeth > 0, "at least 1"),
        ("diameter_m", cutter.diameter_m, cutter.diameter_m > 0.0, "a number above 0"),
        (
            "helix_rad",
            cutter.helix_rad,
            cutter.helix_rad.abs() < straight,
            "less than a right angle",
        ),
        (
            "exit_rad − entry_rad",
            arc_rad,
            arc_rad > 0.0 && arc_rad < 1.000_001 * TAU,
            "an arc above 0, at most a turn",
        ),
        ("|chip_n_m2|", force, force.is_finite(), "finite numbers"),
    ];
    let bad = all.iter().find(|(.., good, _)| !good);
    bad.map_or(Ok(()), |&(what, value, _, expected)| {
        Err(StabilityError::Cutter { what, value, expected })
    })
}

/// Projection of a vector in cut axes onto the plane of the cut.
fn in_plane() -> Matrix2x3<f64> {
    Matrix2x3::identity()
}
