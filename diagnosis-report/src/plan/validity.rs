//! Test whether a model is still valid, by measurements of check poses.

use diagnosis::campaign_import;
use diagnosis::plan::check::{self, CheckResult, DetectableDamage, ErrorRates, SuspectedDamage};
use diagnosis::plan::setup::MeasuringSetup;
use report::{TextLine, Tone, fixed, pluralise, significant};
use serde::Serialize;

use super::{DetectableReport, MILLI, Robot, assumptions, damage_unit, detectable_table};
use crate::error::Error;

/// A judged model: `trued.plan/1` (docs/reference/results.md).
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ValidityReport<'a> {
    does: &'static str,
    model: &'a str,
    alarm: f64,
    holds: bool,
    poses: usize,
    sum: f64,
    freedom: usize,
    p: f64,
    scatter: Option<f64>,
    unseen: Vec<String>,
    suspects: Vec<SuspectReport>,
    is_explained: bool,
    power: f64,
    detectable: Vec<DetectableReport>,
    warnings: &'a [String],
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct SuspectReport {
    damage: String,
    unit: &'static str,
    size: Vec<f64>,
    sigma: f64,
    gain: f64,
}

/// Result of the test whether a model is still valid.
#[derive(Clone, Debug)]
pub struct ValidityTest<'a> {
    robot: Robot<'a>,
    terms: ErrorRates,
    /// Number of poses with measurements.
    pub poses: usize,
    /// Results of the statistical tests.
    pub found: CheckResult,
    /// Assumptions made where nothing was stated, and circumstances that may hide damage.
    pub warnings: Vec<String>,
}

/// Tests whether the model is still valid for the recordings. Of `setup`, only measuring frame and targets are used.
///
/// ```no_run
/// use diagnosis::plan::check::ErrorRates;
/// use diagnosis::plan::setup::MeasuringSetup;
/// use diagnosis_report::plan::{Robot, test_validity};
/// use recording::model::RobotModel;
/// use recording::series::{RequiredData, read};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let model = RobotModel::read("irb120".as_ref())?;
/// let recordings = [read("poses.csv".as_ref(), None, RequiredData::Measurement)?];
/// let robot = Robot { model: &model, recordings: &recordings };
/// let rates = ErrorRates { alarm: 0.01, power: 0.9 };
/// let judged = test_validity(robot, &MeasuringSetup::default(), &rates)?;
/// println!("{}", if judged.found.holds { "valid" } else { "damaged" });
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// [`Error::Input`] if recordings cannot be used.
pub fn test_validity<'a>(
    robot: Robot<'a>,
    setup: &MeasuringSetup,
    terms: &ErrorRates,
) -> Result<ValidityTest<'a>, Error> {
    let Robot { model, recordings } = robot;
    let mut campaign =
        campaign_import::campaign(&model.physics.arm, recordings).map_err(Error::input)?;
    setup.add_to(&mut campaign);
    let mut warnings = assumptions(robot);
    if campaign.surroundings.targets.iter().any(|target| target.free) {
        warnings.push(
            "the position of a target on the tool is fitted, so that a bent tool cannot be detected: state its previous position (`target1_mm` in the recording's TOML, or --target with --targets-known)".to_owned(),
        );
    }
    let found = check::check_model(&campaign, &model.physics, &model.sigma, terms);
    warnings.extend(found.scatter.map(overstated));
    let poses = campaign.poses.iter().filter(|pose| !pose.seen.is_empty()).count();
    Ok(ValidityTest { robot, terms: *terms, poses, found, warnings })
}

impl ValidityTest<'_> {
    /// The result as an object.
    #[must_use]
    pub fn report(&self) -> ValidityReport<'_> {
        let Self { robot: Robot { model, .. }, terms, poses, found, warnings } = self;
        let suspect = |found: &SuspectedDamage| SuspectReport {
            damage: found.damage.says(),
            unit: damage_unit(&model.physics, &found.damage),
            size: found.size.iter().map(|size| MILLI * size).collect(),
            sigma: MILLI * found.sigma,
            gain: found.gain,
        };
        ValidityReport {
            does: "check",
            model: &model.file.name,
            alarm: terms.alarm,
            holds: found.holds,
            poses: *poses,
            sum: found.sum,
            freedom: found.freedom,
            p: found.p,
            scatter: found.scatter,
            unseen: undetectable(&found.detectable),
            suspects: found.suspects.iter().map(suspect).collect(),
            is_explained: found.is_explained,
            power: terms.power,
            detectable: DetectableReport::all(&model.physics, &found.detectable),
            warnings,
        }
    }

    /// The result in lines of text, its table at most `width_max` characters wide.
    #[must_use]
    pub fn text(&self, width_max: Option<usize>) -> Vec<TextLine> {
        let found = &self.found;
        let sum = format!(
            "; {}: sum of squares {} for {} expected (p {})",
            pluralise(self.poses, "pose"),
            fixed(found.sum, 0),
            found.freedom,
            significant(found.p, 2)
        );
        if found.holds { self.undamaged(sum, width_max) } else { self.damaged(sum) }
    }

    fn undamaged(&self, sum: String, width_max: Option<usize>) -> Vec<TextLine> {
        let found = &self.found;
        let head = if found.is_informative() {
            TextLine::with_head(Tone::Good, "the model still holds", sum)
        } else {
            TextLine::with_head(Tone::Caution, "not judged: these poses reveal no damage", sum)
        };
        let mut lines = vec![head];
        let unseen = undetectable(&found.detectable);
        if !unseen.is_empty() {
            let rest = format!(
                ": {} (absorbed by the fitted targets or measuring frame)",
                unseen.join("; ")
            );
            lines.push(TextLine::with_head(Tone::Caution, "not detectable by this check", rest));
        }
        if let Some(scatter) = found.scatter {
            let rest = format!(": {}", overstated(scatter));
            lines.push(TextLine::with_head(Tone::Caution, "noise overstated", rest));
        }
        lines.push("damage that these poses would have revealed:".into());
        let model = &self.robot.model.physics;
        lines.push(detectable_table(model, &found.detectable, width_max).into());
        lines
    }

    fn damaged(&self, sum: String) -> Vec<TextLine> {
        let found = &self.found;
        let mut lines = vec![TextLine::with_head(Tone::Bad, "the model does not hold", sum)];
        if found.suspects.is_empty() {
            lines.push("no single joint or tool explains it: calibrate again".into());
        }
        for (place, suspect) in found.suspects.iter().enumerate() {
            let size = suspect.size.iter().map(|size| size * size).sum::<f64>().sqrt();
            let or = if place == 0 { "" } else { "or: " };
            let line = format!(
                "{or}{} by {} ± {} {}",
                suspect.damage.says(),
                significant(MILLI * size, 3),
                significant(MILLI * suspect.sigma, 2),
                damage_unit(&self.robot.model.physics, &suspect.damage)
            );
            lines.push(line.into());
        }
        if !found.suspects.is_empty() && !found.is_explained {
            lines.push("this does not explain all of it: there is more than one cause".into());
        }
        lines
    }
}

/// Damage that these poses cannot detect, whatever its size.
fn undetectable(detectable: &[DetectableDamage]) -> Vec<String> {
    let unseen = detectable.iter().filter(|found| found.least.is_none());
    unseen.map(|found| found.damage.says()).collect()
}

fn overstated(scatter: f64) -> String {
    format!(
        "the readings scatter less than is stated, which hides damage: {} of the stated `sigma` explains them",
        significant(scatter, 2)
    )
}
