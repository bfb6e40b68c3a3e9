//! A milling cut with regeneration: teeth cut the surface left by the preceding teeth.
//!
//! Tool on modes `q'' + 2ζω q' + ω² q = ω²/k (u·F)`, moved by `r = Σ u q` (exact between steps
//! under a constant force). Per tooth at angle φ, with `n = (sin φ, cos φ)`: chip `h = f_t sin φ +
//! (n·r + ρ) − s(φ)`, ρ: the tooth's runout, `s`: the surface left there by the previous tooth;
//! forces of `h > 0` by [`Cutter`]'s law. A tooth that leaves the cut leaves the surface unchanged
//! and the next one cuts more. The same tool is also simulated over a surface cut by a rigid tool:
//! its vibration is the forced one, and the difference is due to regeneration.
//! Source: Tlusty and Ismail 1981; Altintas, Manufacturing Automation, 2012, chapter 4.
//!
//! Deterministic. Not modelled: helix, process damping, variable speed.

use glam::{DVec2, DVec3};
use libm::sincos;
use std::f64::consts::TAU;

use crate::cutter::Cutter;

/// A mode of tool and robot in the plane of the cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolMode {
    /// Direction of the motion, of unit length: along the feed, across it.
    pub direction: DVec2,
    /// Natural frequency, Hz, above zero.
    pub frequency_hz: f64,
    /// Damping ratio, 0 to below 1.
    pub damping_ratio: f64,
    /// Stiffness, N/m, above zero.
    pub stiffness_n_per_m: f64,
}

/// State of the cut at one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Step {
    /// Force on the tool, cut axes, N.
    pub force: DVec3,
    /// Displacement of the tool, m.
    pub tool: DVec2,
    /// Displacement of a tool over the surface of a rigid tool, m: the forced vibration.
    pub forced: DVec2,
}

/// Displacement and velocity of one mode.
#[derive(Clone, Copy, Debug, Default)]
struct ModeState {
    position: f64,
    speed: f64,
}

/// A tool on its modes, with the surface that it cuts.
struct Tool {
    mode_states: Vec<ModeState>,
    surface: Vec<f64>,
}

/// The simulated cut.
pub struct Regeneration {
    cutter: Cutter,
    feed_per_tooth_m: f64,
    runout_m: Vec<f64>,
    modes: Vec<ToolMode>,
    steps_per_tooth: usize,
    step: usize,
    flexible: Tool,
    rigid: Tool,
}

impl Regeneration {
    /// A tool at rest over a flat surface; `runout_m` is the radius error of each tooth, and a
    /// tooth period has `steps` steps.
    pub fn new(
        cutter: Cutter,
        feed_m_s: f64,
        runout_m: &[f64],
        modes: &[ToolMode],
        steps_per_tooth: usize,
    ) -> Self {
        let steps_per_tooth = steps_per_tooth.max(8);
        let tool = || Tool {
            mode_states: vec![ModeState::default(); modes.len()],
            surface: vec![0.0; steps_per_tooth * cutter.teeth.max(1) as usize],
        };
        Self {
            feed_per_tooth_m: cutter.feed_per_tooth_m(feed_m_s),
            runout_m: runout_m.to_vec(),
            modes: modes.to_vec(),
            steps_per_tooth,
            step: 0,
            flexible: tool(),
            rigid: tool(),
            cutter,
        }
    }

    /// Duration of a step, s.
    pub fn step_s(&self) -> f64 {
        1.0 / (self.cutter.tooth_passing_hz() * self.steps_per_tooth as f64)
    }

    /// The next step at a fraction of the full depth (0: outside the cut), with an additional force
    /// on both tools, N.
    pub fn next(&mut self, depth_part: f64, push: DVec2) -> Step {
        let dt_s = self.step_s();
        let tool = displacement(&self.modes, &self.flexible.mode_states);
        let forced = displacement(&self.modes, &self.rigid.mode_states);
        let force = self.tooth_forces(tool, depth_part, false);
        let rigid_force = self.tooth_forces(DVec2::ZERO, depth_part, true);
        advance(&self.modes, &mut self.flexible.mode_states, force.truncate() + push, dt_s);
        advance(&self.modes, &mut self.rigid.mode_states, rigid_force.truncate() + push, dt_s);
        self.step += 1;
        Step { force, tool, forced }
    }

    /// Force of all teeth at this step, and the surface that they leave.
    fn tooth_forces(&mut self, tool: DVec2, depth_part: f64, is_rigid: bool) -> DVec3 {
        let cutter = self.cutter;
        let surface = if is_rigid { &mut self.rigid.surface } else { &mut self.flexible.surface };
        let places = surface.len();
        let mut sum = DVec3::ZERO;
        for tooth in 0..cutter.teeth as usize {
            let place = (self.step + tooth * self.steps_per_tooth) % places;
            let angle = TAU * place as f64 / places as f64;
            if depth_part <= 0.0 || !(cutter.entry_rad..cutter.exit_rad).contains(&angle) {
                // Outside the cut: the next tooth meets an uncut surface.
                surface[place] = 0.0;
                continue;
            }
            let (sin, cos) = sincos(angle);
            let runout = self.runout_m.get(tooth).copied().unwrap_or(0.0);
            let edge = DVec2::new(sin, cos).dot(tool) + runout;
            let feed = self.feed_per_tooth_m * sin;
            let chip = feed + edge - surface[place];
            if chip <= 0.0 {
                surface[place] -= feed;
                continue;
            }
            surface[place] = edge;
            let law = cutter.chip_n_m2 * chip + cutter.edge_n_m;
            let f = law * (cutter.axial_depth_m * depth_part);
            sum += DVec3::new(-f.x * cos - f.y * sin, f.x * sin - f.y * cos, f.z);
        }
        sum
    }
}

fn displacement(modes: &[ToolMode], states: &[ModeState]) -> DVec2 {
    modes.iter().zip(states).map(|(mode, state)| mode.direction * state.position).sum()
}

/// Advances all modes by a step under a constant force.
fn advance(modes: &[ToolMode], states: &mut [ModeState], force: DVec2, dt_s: f64) {
    for (mode, state) in modes.iter().zip(states) {
        let omega = TAU * mode.frequency_hz;
        let decay = mode.damping_ratio * omega;
        let omega_d = omega * libm::sqrt(1.0 - mode.damping_ratio * mode.damping_ratio);
        let rest = mode.direction.dot(force) / mode.stiffness_n_per_m;
        let (x, v) = (state.position - rest, state.speed);
        let (sin, cos) = sincos(omega_d * dt_s);
        let fade = libm::exp(-decay * dt_s);
        state.position = rest + (x * cos + (v + x * decay) * (sin / omega_d)) * fade;
        state.speed = (v * cos - (v * decay + x * omega * omega) * (sin / omega_d)) * fade;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    const MODE: ToolMode = ToolMode {
        direction: DVec2::Y,
        frequency_hz: 100.0,
        damping_ratio: 0.03,
        stiffness_n_per_m: 1e6,
    };

    fn cutter(spindle_hz: f64, axial_depth_m: f64) -> Cutter {
        Cutter { teeth: 4, spindle_hz, axial_depth_m, ..Cutter::default() }
    }

    /// Whether the motion beyond the forced vibration persists: in a stable cut less than four
    /// fifths remain a quarter of a second later. (In an unstable cut it is bounded, because the
    /// teeth leave the cut.)
    fn lasts(spindle_hz: f64, axial_depth_m: f64) -> bool {
        let mut cut = Regeneration::new(cutter(spindle_hz, axial_depth_m), 0.01, &[], &[MODE], 200);
        let steps = (1.0 / cut.step_s()) as usize;
        let mut sums = [0.0; 2];
        for k in 0..steps {
            let push = if k == 0 { DVec2::Y * 1e-3 } else { DVec2::ZERO };
            let step = cut.next(1.0, push);
            let regenerative = (step.tool - step.forced).length_squared();
            sums[usize::from(k > 3 * steps / 4)] += if k > steps / 2 { regenerative } else { 0.0 };
        }
        sums[1] > 0.8 * sums[0]
    }

    /// The largest stable depth at a speed, up to 1 mm, m.
    fn limit_m(spindle_hz: f64) -> f64 {
        let (mut low, mut high) = (0.0, 1e-3);
        for _ in 0..12 {
            let middle = 0.5 * (low + high);
            if lasts(spindle_hz, middle) { high = middle } else { low = middle }
        }
        0.5 * (low + high)
    }

    #[test]
    fn the_limit_of_stability_is_that_of_the_lobes() {
        // In a slot the mean force of N teeth is −(N K_rc/4) b across the feed per Δy; the lowest
        // limit is that of the most negative real part of the receptance, −1/(4 k ζ (1 + ζ))
        // (Altintas 2012, 3.7): it occurs for 1.75 waves of the chatter per tooth period, hence at
        // a tooth passing frequency of 59 Hz.
        let (k, zeta) = (MODE.stiffness_n_per_m, MODE.damping_ratio);
        let least_m = 8.0 * k * zeta * (1.0 + zeta) / (4.0 * Cutter::default().chip_n_m2.y);
        let worst = [14.2, 14.5, 14.8, 15.1].map(limit_m).into_iter().fold(1.0, f64::min);
        assert!((worst / least_m - 1.0).abs() < 0.15, "{worst} m for {least_m} m");
        // In the lobe with one oscillation per tooth period the stable depth is far larger.
        assert!(limit_m(25.3) > 2.0 * least_m, "{} m", limit_m(25.3));
    }

    #[test]
    fn a_rigid_tool_feels_the_cutters_own_force_and_nothing_more() {
        let stiff = ToolMode { stiffness_n_per_m: 1e15, ..MODE };
        let cutter = cutter(25.0, 1e-3);
        let mut cut = Regeneration::new(cutter, 0.01, &[], &[stiff], 400);
        let steps = 4 * 400;
        for _ in 0..steps {
            cut.next(1.0, DVec2::ZERO);
        }
        let mean = (0..steps).map(|_| cut.next(1.0, DVec2::ZERO).force).sum::<DVec3>();
        let error = mean / f64::from(steps) - cutter.mean_force(0.01);
        assert!(error.length() < 0.01 * cutter.mean_force(0.01).length(), "{error}");
    }

    #[test]
    fn a_tool_that_leaves_the_work_makes_the_next_tooth_cut_more() {
        let stiff = ToolMode { stiffness_n_per_m: 1e15, ..MODE };
        // One tooth is so far inside that it never cuts: the other three share its feed.
        let mut cut = Regeneration::new(cutter(25.0, 1e-3), 0.01, &[-1.0], &[stiff], 100);
        let mut sum = DVec3::ZERO;
        for k in 0..800_u32 {
            let force = cut.next(1.0, DVec2::ZERO).force;
            sum += if k >= 400 { force } else { DVec3::ZERO };
        }
        let teeth = Cutter { teeth: 3, edge_n_m: DVec3::ZERO, ..cutter(25.0, 1e-3) };
        let edges = Cutter { chip_n_m2: DVec3::ZERO, teeth: 3, ..cutter(25.0, 1e-3) };
        let expected = teeth.mean_force(0.01) + edges.mean_force(0.01);
        assert!((sum / 400.0 - expected).length() < 0.02 * expected.length(), "{sum} {expected}");
        assert!((PI - cut.cutter.exit_rad).abs() < 1e-12);
    }
}
