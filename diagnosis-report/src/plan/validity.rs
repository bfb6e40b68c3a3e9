//! Test whether a model is still valid, by measurements of check poses.

use diagnosis::campaign_import;
use diagnosis::plan::check::{self, CheckResult, DetectableDamage, ErrorRates, SuspectedDamage};
use diagnosis::plan::setup::MeasuringSetup;
use report::{
    Axis, Bar, Bars, Column, Number, Page, Table, TextLine, Tone, capitalised, fixed, pluralise,
    probability, significant,
};
use serde::Serialize;

use super::{
    DetectableReport, MILLI, Robot, assumptions, damage_unit, detectable_table, minimum_detectable,
};
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
            probability(found.p)
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
            let or = if place == 0 { "" } else { "or: " };
            lines.push(format!("{or}{}", self.suspected(suspect)).into());
        }
        if !found.suspects.is_empty() && !found.is_explained {
            lines.push("this does not explain all of it: there is more than one cause".into());
        }
        lines
    }
}

impl ValidityTest<'_> {
    /// The page.
    #[must_use]
    pub fn page(&self) -> Page {
        let Self { robot: Robot { model, .. }, found, .. } = self;
        let (tone, label) = match (found.holds, found.is_informative()) {
            (true, true) => (Tone::Good, "the model still holds"),
            (true, false) => (Tone::Caution, "not judged"),
            (false, _) => (Tone::Bad, "the model does not hold"),
        };
        let mut page = Page::new(format!("Check of {}", model.file.name))
            .kicker("trued plan --check")
            .robot(model.file.identity().to_string())
            .verdict(tone, label, &self.sentence())
            .numbers(self.numbers());
        if let Some(bars) = self.suspected_bars() {
            page = page.figure(
                "Damage that alone would explain the readings best, with 95 % intervals; the most likely first.",
                &bars.render(),
            );
        }
        let (says, command) = self.next();
        page = page.next(says, command);
        if let Some((first, others)) = self.warnings.split_first() {
            page = page.note(Tone::Caution, "Warnings", &capitalised(first));
            if !others.is_empty() {
                page = page.list(others);
            }
        }
        page.section("Detectable damage")
            .text(&format!(
                "The smallest damage that these poses reveal in {} of 100 cases, with {} false alarms in 1000 undamaged robots.",
                fixed(100.0 * self.terms.power, 0),
                significant(1e3 * self.terms.alarm, 2)
            ))
            .table(&self.detectable())
    }

    /// The verdict as sentences.
    fn sentence(&self) -> String {
        let found = &self.found;
        let scatter = format!(
            "The residuals of {} have a sum of squares of {}, {} expected of an undamaged robot",
            pluralise(self.poses, "pose"),
            fixed(found.sum, 0),
            found.freedom
        );
        if found.holds && !found.is_informative() {
            return format!("{scatter}, but these poses reveal no damage.");
        }
        if found.holds {
            return format!("{scatter}: nothing has changed that these poses would reveal.");
        }
        let cause = match found.suspects.first() {
            None => "No single joint or tool explains it.".to_owned(),
            Some(suspect) => {
                let all = if found.is_explained {
                    ""
                } else {
                    " This does not explain all of it: there is more than one cause."
                };
                format!("Most likely {}.{all}", self.suspected(suspect))
            }
        };
        format!("{scatter}. {cause}")
    }

    /// `joint 3 has a zero offset by 0.795 ± 0.021 mrad`.
    fn suspected(&self, suspect: &SuspectedDamage) -> String {
        format!(
            "{} by {} ± {} {}",
            suspect.damage.says(),
            significant(MILLI * size(suspect), 3),
            significant(MILLI * suspect.sigma, 2),
            damage_unit(&self.robot.model.physics, &suspect.damage)
        )
    }

    fn numbers(&self) -> Vec<Number> {
        let found = &self.found;
        let tone = if found.holds { Tone::Good } else { Tone::Bad };
        let ratio = found.sum / found.freedom.max(1) as f64;
        vec![
            Number::text("Poses measured", self.poses.to_string()),
            Number::new("Squared error over its expectation", ratio, "").tone(tone),
            Number::text("Probability if undamaged", probability(found.p))
                .note(format!("alarm below {}", significant(self.terms.alarm, 2))),
        ]
    }

    /// Size of each suspected damage; none if the units differ, or nothing is suspected.
    fn suspected_bars(&self) -> Option<Bars> {
        let unit = |one: &SuspectedDamage| damage_unit(&self.robot.model.physics, &one.damage);
        let first = unit(self.found.suspects.first()?);
        let alike = self.found.suspects.iter().filter(|one| unit(one) == first);
        let bars = Bars::new("Suspected damage", Axis::new("Size", first));
        Some(alike.fold(bars, |bars, one| {
            let (value, reach) = (MILLI * size(one), COVERAGE * MILLI * one.sigma);
            let bar = Bar::new(value).between(value - reach, value + reach);
            bars.row(one.damage.says(), [bar])
        }))
    }

    fn next(&self) -> (&'static str, Option<&'static str>) {
        match (self.found.holds, self.found.is_informative()) {
            (true, true) => {
                ("Nothing to change. Repeat the check after the next collision or repair.", None)
            }
            (true, false) => (
                "Plan check poses for this set-up, and measure these.",
                Some("trued plan --check --model MODEL.toml --out check"),
            ),
            (false, _) => (
                "Repair the cause, or calibrate again with recordings of the robot as it is now; stop correcting with this model until then.",
                Some("trued calibrate --model MODEL.toml --out calibrated.toml RECORDING.csv"),
            ),
        }
    }

    fn detectable(&self) -> Table {
        let heads = ["Damage", "Minimum detectable change"].map(Column::new);
        let model = &self.robot.model.physics;
        self.found.detectable.iter().fold(
            Table::new("Minimum detectable damage", heads),
            |table, one| {
                table.row([one.damage.says().into(), minimum_detectable(model, one).into()])
            },
        )
    }
}

/// Coverage factor of a 95 % interval, in standard uncertainties.
const COVERAGE: f64 = 1.96;

/// Size of a suspected damage, rad or m.
fn size(suspect: &SuspectedDamage) -> f64 {
    suspect.size.iter().map(|size| size * size).sum::<f64>().sqrt()
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
