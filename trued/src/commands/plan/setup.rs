//! Options for instruments, their positions, and constraints on poses: mm and degrees here, SI in [`MeasuringSetup`].

use std::fmt;
use std::num::NonZeroUsize;
use std::str::FromStr;

use clap::Args;
use diagnosis::plan::setup::{
    Ballbar, Floor, LENGTH_SIGMA_M, MeasuringSetup, ToolTarget, TouchedPatch, TouchedSphere,
};
use glam::DVec3;

use crate::exit::Failure;
use crate::options::in_unit;

/// A millimetre, m.
const MM: f64 = 1e-3;
/// A degree, rad.
const DEG: f64 = std::f64::consts::PI / 180.0;

/// Numbers separated by commas.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CommaTuple<const N: usize>(pub(super) [f64; N]);

impl<const N: usize> FromStr for CommaTuple<N> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts: Vec<&str> = text.split(',').collect();
        let mut numbers = [0.0; N];
        if parts.len() != N {
            return Err(format!(
                "expected {N} numbers with commas between them, found {}",
                parts.len()
            ));
        }
        for (slot, part) in numbers.iter_mut().zip(parts) {
            let number = part.trim().parse().ok().filter(|number: &f64| number.is_finite());
            *slot = number.ok_or_else(|| format!("`{part}` is not a number"))?;
        }
        Ok(Self(numbers))
    }
}

impl<const N: usize> fmt::Display for CommaTuple<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.map(|number| number.to_string()).join(","))
    }
}

fn targets_seen_least() -> NonZeroUsize {
    NonZeroUsize::new(MeasuringSetup::default().targets_seen_least).unwrap_or(NonZeroUsize::MIN)
}

/// A target: its position on the tool, and the direction that it faces if stated.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Target {
    place_mm: [f64; 3],
    facing: Option<[f64; 3]>,
}

impl FromStr for Target {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Ok(CommaTuple(place_mm)) = text.parse() {
            return Ok(Self { place_mm, facing: None });
        }
        let CommaTuple([x, y, z, a, b, c]) = text.parse().map_err(|_| {
            "expected X,Y,Z or X,Y,Z,A,B,C: the place on the tool in mm, and the direction that it looks".to_owned()
        })?;
        Ok(Self { place_mm: [x, y, z], facing: Some([a, b, c]) })
    }
}

/// Instruments and targets, and constraints on poses.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "What measures, and what bars a pose")]
pub(super) struct Setup {
    /// Position of the instrument, base frame, mm; without it, the line of sight is not checked
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, conflicts_with_all = ["anchor", "plane", "sphere"])]
    instrument: Option<CommaTuple<3>>,
    /// Position of a target on the tool, tool frame, mm, optionally with the direction that it faces (a reflector); may be repeated. By default the TCP is measured
    #[arg(long, value_name = "X,Y,Z[,A,B,C]", allow_hyphen_values = true)]
    target: Vec<Target>,
    /// Minimum number of targets visible at a pose
    #[arg(long, value_name = "N", default_value_t = targets_seen_least(), requires = "target")]
    least_targets: NonZeroUsize,
    /// The positions of the targets are known; by default they are estimated along
    #[arg(long, requires = "target")]
    targets_known: bool,
    /// The measuring frame is the robot's base frame; by default it is estimated along
    #[arg(long)]
    frame_known: bool,
    /// Largest angle between a reflector's direction and the beam, degrees
    #[arg(long, value_name = "DEG", default_value_t = in_unit(MeasuringSetup::default().acceptance_rad, DEG), requires = "instrument", conflicts_with_all = ["anchor", "plane", "sphere"])]
    accept_deg: f64,
    /// Smallest and largest distance that the instrument can measure, mm
    #[arg(long, value_name = "MIN,MAX", default_value_t = CommaTuple(MeasuringSetup::default().range_m.map(|m| in_unit(m, MM))), requires = "instrument", conflicts_with_all = ["anchor", "plane", "sphere"])]
    range_mm: CommaTuple<2>,
    #[arg(long, value_name = "MM", help = format!("Standard uncertainty of a measured length, mm; by default that of the recordings, else {}", in_unit(LENGTH_SIGMA_M, MM)))]
    sigma_mm: Option<f64>,
    /// Standard uncertainty of the measured tool orientation, mrad; by default the orientation is not measured
    #[arg(long, value_name = "MRAD", conflicts_with_all = ["anchor", "plane", "sphere"])]
    orientation_sigma_mrad: Option<f64>,
    /// Approximate position of the fixed end of a ballbar or cable, base frame, mm
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, requires = "length_mm")]
    anchor: Option<CommaTuple<3>>,
    /// Shortest and longest length of the ballbar or cable, mm
    #[arg(long, value_name = "MIN,MAX", requires = "anchor", conflicts_with_all = ["instrument", "plane", "sphere", "orientation_sigma_mrad"])]
    length_mm: Option<CommaTuple<2>>,
    /// Plane touched by a probe: a point, the outward normal, and the extent around the point; base frame, mm; may be repeated
    #[arg(
        long,
        value_name = "X,Y,Z,A,B,C,R",
        allow_hyphen_values = true,
        conflicts_with = "anchor"
    )]
    plane: Vec<CommaTuple<7>>,
    /// Sphere touched by a probe: centre and radius, base frame, mm; may be repeated
    #[arg(long, value_name = "X,Y,Z,R", allow_hyphen_values = true, conflicts_with = "anchor")]
    sphere: Vec<CommaTuple<4>>,
    /// Margin to the joint limits, degrees
    #[arg(long, value_name = "DEG", default_value_t = in_unit(MeasuringSetup::default().margin_rad, DEG))]
    margin_deg: f64,
    /// Radius around each link, mm; by default 8 % of the arm's length
    #[arg(long, value_name = "MM")]
    link_radius_mm: Option<f64>,
    /// Radius around the column of the base, mm; by default 16 % of the arm's length
    #[arg(long, value_name = "MM")]
    base_radius_mm: Option<f64>,
    /// Height of the floor, base frame, mm; `none`: no floor. By default at the foot of a standing arm
    #[arg(long, value_name = "Z|none", allow_hyphen_values = true, value_parser = floor)]
    floor_mm: Option<Floor>,
    /// Box that the arm must not enter: two corners, base frame, mm; may be repeated
    #[arg(long, value_name = "X,Y,Z,X,Y,Z", allow_hyphen_values = true)]
    keep_out: Vec<CommaTuple<6>>,
}

fn floor(text: &str) -> Result<Floor, String> {
    if text == "none" {
        return Ok(Floor::None);
    }
    let height = text.parse().ok().filter(|height: &f64| height.is_finite());
    height
        .map(|mm| Floor::At(1e-3 * mm))
        .ok_or_else(|| format!("`{text}` is neither a height in mm nor `none`"))
}

fn metres(mm: [f64; 3]) -> DVec3 {
    1e-3 * DVec3::from_array(mm)
}

/// Least and largest corner of a box that two corners in mm give, m.
pub(super) fn corners_m(CommaTuple([a, b, c, d, e, f]): &CommaTuple<6>) -> [DVec3; 2] {
    let (one, other) = (metres([*a, *b, *c]), metres([*d, *e, *f]));
    [one.min(other), one.max(other)]
}

impl Setup {
    fn check(&self) -> Result<(), Failure> {
        let above = [
            ("--sigma-mm", self.sigma_mm),
            ("--accept-deg", Some(self.accept_deg)),
            ("--orientation-sigma-mrad", self.orientation_sigma_mrad),
            ("--link-radius-mm", self.link_radius_mm),
            ("--base-radius-mm", self.base_radius_mm),
        ];
        let wrong = above
            .iter()
            .find(|(_, value)| value.is_some_and(|value| !(value > 0.0 && value.is_finite())));
        if let Some((name, _)) = wrong {
            return Err(Failure::input(format!("{name}: expected a number above 0")));
        }
        let ranges = [("--range-mm", Some(self.range_mm)), ("--length-mm", self.length_mm)];
        let turned = ranges
            .iter()
            .find(|(_, r)| r.is_some_and(|CommaTuple([low, high])| !(low >= 0.0 && low <= high)));
        if let Some((name, _)) = turned {
            return Err(Failure::input(format!(
                "{name}: expected the smaller number first, neither below 0"
            )));
        }
        let (targets_min, targets) = (self.least_targets.get(), self.target.len().max(1));
        if targets_min > targets {
            return Err(Failure::input(format!(
                "--least-targets is {targets_min}, but {targets} are given with --target"
            )));
        }
        if !(0.0..=90.0).contains(&self.margin_deg) {
            return Err(Failure::input("--margin-deg: expected 0 to 90"));
        }
        Ok(())
    }

    /// The setup in SI; `both_ways`: whether each pose is measured twice.
    pub(super) fn described(&self, both_ways: bool) -> Result<MeasuringSetup, Failure> {
        self.check()?;
        let m = |mm: f64| 1e-3 * mm;
        let facing = |target: &Target| DVec3::from_array(target.facing?).try_normalize();
        let target = |target: &Target| ToolTarget {
            place_tool_m: metres(target.place_mm),
            facing_tool: facing(target),
        };
        let patch = |CommaTuple([x, y, z, a, b, c, r]): &CommaTuple<7>| {
            let normal = DVec3::new(*a, *b, *c).try_normalize();
            let normal_base =
                normal.ok_or_else(|| Failure::input("--plane: its direction is 0,0,0"))?;
            Ok(TouchedPatch { middle_base_m: metres([*x, *y, *z]), normal_base, within_m: m(*r) })
        };
        let sphere = |CommaTuple([x, y, z, r]): &CommaTuple<4>| TouchedSphere {
            centre_base_m: metres([*x, *y, *z]),
            radius_m: m(*r),
        };
        let ballbar = self.anchor.zip(self.length_mm);
        Ok(MeasuringSetup {
            instrument_base_m: self.instrument.map(|CommaTuple(position)| metres(position)),
            range_m: self.range_mm.0.map(m),
            acceptance_rad: self.accept_deg.to_radians(),
            targets: self.target.iter().map(target).collect(),
            targets_seen_least: self.least_targets.get(),
            targets_known: self.targets_known,
            frame_known: self.frame_known,
            length_sigma_m: self.sigma_mm.map(m),
            orientation_sigma_rad: self.orientation_sigma_mrad.map(|mrad| 1e-3 * mrad),
            ballbar: ballbar.map(|(CommaTuple(anchor), CommaTuple(length_mm))| Ballbar {
                anchor_base_m: metres(anchor),
                length_m: length_mm.map(m),
            }),
            planes: self.plane.iter().map(patch).collect::<Result<_, Failure>>()?,
            spheres: self.sphere.iter().map(sphere).collect(),
            margin_rad: self.margin_deg.to_radians(),
            link_radius_m: self.link_radius_mm.map(m),
            base_radius_m: self.base_radius_mm.map(m),
            floor: self.floor_mm.unwrap_or(Floor::OfArm),
            keep_out: self.keep_out.iter().map(corners_m).collect(),
            both_ways,
        })
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;
    use diagnosis::plan::arm_constraints::ArmConstraints;
    use recording::model::RobotModel;

    use crate::cli::Cli;

    #[test]
    fn the_radii_that_the_help_states_are_those_of_the_constraints() {
        let model = RobotModel::read("irb120".as_ref()).expect("a preset");
        let arm = &model.physics.arm;
        let link = |i: usize| arm.joints()[i].point.distance(arm.next_point(i));
        let length_m: f64 = (0..arm.count()).map(link).sum();
        let usual = ArmConstraints::of(arm);
        let command = Cli::command();
        let plan = command.find_subcommand("plan").expect("the command");
        for (name, radius_m) in
            [("link_radius_mm", usual.link_radius_m), ("base_radius_mm", usual.base_radius_m)]
        {
            let option = plan.get_arguments().find(|option| option.get_id() == name);
            let help = option.and_then(clap::Arg::get_help).expect(name).to_string();
            let stated =
                format!("by default {:.0} % of the arm's length", 100.0 * radius_m / length_m);
            assert!(help.ends_with(&stated), "{help}: {stated}");
        }
    }
}
