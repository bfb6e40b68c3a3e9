//! Arms measured by a laser tracker or a total station: from the nominal model to the effects, validated on held-out halves and scenes.
//!
//! The mean distance is that of the written model, run forward by `trued simulate`: the measuring
//! frame is fitted on the training rows; positions of reflectors are those found by the program.
//! Held-out rows remain in the recording without their readings, so that time and the approach to
//! each pose are complete.

use super::super::case::{Case, Errors, LimitCheck, Reference};
use super::super::csv_table::{CsvTable, random_half};
use super::super::diagnosis_result::DiagnosisResult;
use super::super::distance::{Columns, mean_distance};
use super::super::set_runner::{RunOutcome, SetRunner};
use super::Set;

const IRB: &str = include_str!("../../../../deploy/mappings/irb120-tracker.mapping.toml");
const RIGHT: &str = include_str!("../../../../deploy/mappings/motoman-leica-right.mapping.toml");
const LEFT: &str = include_str!("../../../../deploy/mappings/motoman-leica-left.mapping.toml");
const SWEPT: &str = include_str!("../../../../deploy/mappings/kuka-3smr.mapping.toml");
const SCENES: &str = include_str!("../../../../deploy/mappings/hilti.mapping.toml");
const MM: f64 = 1e-3;

pub(super) const IRB120: Set = Set {
    name: "irb120-tracker",
    description: "ABB IRB 120, 1000 settled poses, three reflectors measured by a laser tracker.",
    source: "github.com/icelinker/Robot-Calibration-LaserTracker; no publication names a fit error",
    given_model: "the preset `irb120`: the manufacturer's geometry, no effects.",
    files: &["poses_1000.csv"],
    not_run_reason: None,
    run: irb120,
};

pub(super) const MOTOMAN: Set = Set {
    name: "motoman-leica",
    description: "Motoman with two arms on a rotary table, one reflector measured by a Leica tracker: a free grid of poses, and for the right arm poses that touch tables, a wall and the other arm.",
    source: "github.com/ctu-vras/multirobot-calibration (Stepanova et al., RCIM 73, 2022)",
    given_model: "the presets `motoman-right` and `motoman-left`: the nominal geometry, no masses, no effect.",
    files: &["leica_poses_all.csv"],
    not_run_reason: None,
    run: motoman,
};

pub(super) const SWEEPS: Set = Set {
    name: "kuka-3smr",
    description: "A six-axis arm, 36 poses, one joint at a time, three reflectors. The set does not state the robot; its sweeps match a FANUC R-2000iB.",
    source: "github.com/RABKKK/LaserTrackerPoseData4KinIdent (Boby, Klimchik)",
    given_model: "the preset `fanuc-r2000ib`: published geometry, no effect.",
    files: &["poses_36.csv"],
    not_run_reason: None,
    run: sweeps,
};

pub(super) const HILTI: Set = Set {
    name: "hilti",
    description: "A construction robot, a lifting column with an arm, one prism measured by a total station, seven places, one of them at 9 °C. For all places except `flat`, the stationing points locate the \
           robot; their evaluation points are not used in selection or fit.",
    source: "github.com/Hilti-Research/construction_robot_stationing_datasets, CC BY-NC-SA 3.0 (Kindle et al., RA-L 10(1), 2025)",
    given_model: "the set's own URDF: geometry, masses, no deflection, no backlash, no temperature.",
    files: &["all_measurements.csv", "trailblazer.urdf"],
    not_run_reason: None,
    run: hilti,
};

/// A recording with its description.
struct Campaign<'a> {
    name: &'a str,
    run: &'a str,
    concealed: &'a str,
    model: &'a str,
    mapping: String,
    sheet: CsvTable,
    /// Held-out rows.
    held_out: Vec<bool>,
    /// Measured columns of each point, with the length of their unit, m; then the predicted ones,
    /// as the program writes them.
    points: Vec<([String; 3], [String; 3])>,
    metres: f64,
    station: Option<&'a str>,
}

impl Campaign<'_> {
    fn case(&self, bench: &SetRunner) -> Result<(Case, Option<DiagnosisResult>), String> {
        let file = format!("{}.csv", self.run);
        bench.write(&format!("{}.mapping.toml", self.run), &self.mapping)?;
        let mut whole = file.clone();
        if self.mapping.contains("\nheldout = ") {
            bench.write(&file, self.sheet.text())?;
        } else {
            // A separate segment would restart time and lose the approach to a pose.
            let columns: Vec<&String> =
                self.points.iter().flat_map(|(columns_of_point, _)| columns_of_point).collect();
            bench.write(&file, self.sheet.clear_cells(&columns, &self.held_out).text())?;
            whole = format!("{}-all.csv", self.run);
            bench.write(&whole, self.sheet.text())?;
            bench.write(&format!("{}-all.mapping.toml", self.run), &self.mapping)?;
        }
        let arguments =
            ["diagnose", "--model", self.model, "--seed", "1", "--out", "OUT", file.as_str()];
        let answer = bench.run_trued(self.run, &arguments)?;
        let (mut case, result) =
            Case::from_diagnosis(self.name, self.concealed, &arguments, &answer, "position");
        let (Some(result), RunOutcome::Done(folder)) = (result, &answer) else {
            return Ok((case, None));
        };
        bench.offer_figure(
            &folder.join("report.html"),
            "Errors of the readings, before and after",
            &format!(
                "{}: measured minus model over time, with the given model and with the findings.",
                self.name
            ),
        );
        let found = format!("{}/model.toml", self.run);
        let before = self.distance(bench, "given", self.model, &whole)?;
        let after = self.distance(bench, "found", &found, &whole)?;
        if let (Some(before), Some(after)) = (before, after) {
            case.errors = Some(Errors {
                before,
                after,
                unit: "mm",
                quantity: "mean distance on unseen rows",
            });
        }
        Ok((case, Some(result)))
    }

    /// Mean distance on held-out rows of a model run forward, mm.
    fn distance(
        &self,
        bench: &SetRunner,
        which: &str,
        model: &str,
        file: &str,
    ) -> Result<Option<f64>, String> {
        let run = format!("{}-{which}", self.run);
        let arguments = ["simulate", "--model", model, "--seed", "1", "--out", "OUT/sim", file];
        let RunOutcome::Done(folder) = bench.run_trued(&run, &arguments)? else { return Ok(None) };
        let text =
            std::fs::read_to_string(folder.join("sim.csv")).map_err(|why| why.to_string())?;
        let columns: Vec<Columns> = self
            .points
            .iter()
            .map(|(measured, predicted)| {
                let in_mm = predicted[0].ends_with("_mm");
                let metres = [self.metres, if in_mm { MM } else { 1.0 }];
                Columns { measured: measured.clone(), predicted: predicted.clone(), metres }
            })
            .collect();
        let m = mean_distance(
            &self.sheet,
            &CsvTable::read(&text),
            &columns,
            self.station,
            &self.held_out,
        );
        Ok(m.is_finite().then_some(m / MM))
    }
}

/// `PREFIX_x_UNIT` and so on.
fn axes(prefix: &str, unit: &str) -> [String; 3] {
    ["x", "y", "z"].map(|axis| format!("{prefix}{axis}_{unit}"))
}

fn reflectors() -> Vec<([String; 3], [String; 3])> {
    (1..=3).map(|k| (axes(&format!("smr{k}_"), "mm"), axes(&format!("target{k}_"), "mm"))).collect()
}

fn irb120(bench: &SetRunner) -> Result<Vec<Case>, String> {
    let sheet = CsvTable::read(&bench.data("poses_1000.csv")?);
    let count = sheet.len();
    let in_time: Vec<bool> = (0..count).map(|k| k >= count / 2).collect();
    let by_chance = random_half(count, 1);
    let mut cases = Vec::new();
    let halves = [
        ("first half in time to the second", "in-time", in_time.clone()),
        ("a random half to the other", "by-chance", by_chance),
    ];
    for (name, run, held_out) in halves {
        let campaign = Campaign {
            name,
            run,
            concealed: "everything except the manufacturer's geometry",
            model: "irb120",
            mapping: IRB.to_owned(),
            sheet: sheet.clone(),
            held_out,
            points: reflectors(),
            metres: MM,
            station: None,
        };
        let (mut case, result) = campaign.case(bench)?;
        case.reference = Some(Reference {
            value: Some(0.19),
            text: "0.19 mm with the geometry of every joint (the set's note; the authors state none)",
        });
        if result.is_some() {
            let after = case.errors.as_ref().map_or(f64::NAN, |errors| errors.after);
            case.checks.push(LimitCheck::at_most(
                "mean distance on unseen poses",
                after,
                0.045,
                "mm",
            ));
        }
        cases.push(case);
    }
    let read_back = Campaign {
        name: "measured instead of commanded joint positions",
        run: "read-back",
        concealed: "that these positions were read before the arm had settled",
        model: "irb120",
        mapping: IRB.replace("\"q*_deg\" = { from = \"cmd_q*_deg\" }\n", ""),
        sheet: sheet.clone(),
        held_out: in_time,
        points: reflectors(),
        metres: MM,
        station: None,
    };
    cases.push(with_feedback_check(read_back.case(bench)?));
    let arguments = ["diagnose", "--model", "ur10e", "--seed", "1", "--out", "OUT", "in-time.csv"];
    let answer = bench.run_trued("other-robot", &arguments)?;
    let concealed = "that the recording is of another robot: the model is of the UR10e";
    let (mut case, result) = Case::from_diagnosis(
        "a model of another robot",
        concealed,
        &arguments,
        &answer,
        "position",
    );
    if let Some(result) = result {
        case.checks.push(check_several_mismatches(&result));
        case.statements.extend(result.unexplained().map(str::to_owned));
        case.shortfall_notes.clear();
    }
    cases.push(case);
    Ok(cases)
}

/// Requires several mismatches, or no claim.
pub(super) fn check_several_mismatches(result: &DiagnosisResult) -> LimitCheck {
    let count = result.findings().count();
    let is_claimed = matches!(result.verdict(), "missing_physics" | "consistent");
    let verdict = format!("{}, {count} named", result.verdict().replace('_', " "));
    LimitCheck::new(
        "no single finding",
        verdict,
        "no missing physics, or five findings or more",
        !is_claimed || count >= 5,
    )
}

fn with_feedback_check((mut case, result): (Case, Option<DiagnosisResult>)) -> Case {
    if let Some(result) = result {
        let markers = ["measured joint positions", "feedback", "settled"];
        let notes = result.list("notes").iter().filter_map(|note| note.as_str());
        let all: Vec<&str> = notes.chain(result.unexplained()).collect();
        let reason = all.iter().find(|text| markers.iter().any(|marker| text.contains(marker)));
        case.statements.extend(reason.map(|text| super::super::case::sentence(text)));
        let answer = if reason.is_some() { "said" } else { "not said" };
        case.checks.push(LimitCheck::new(
            "that the measured joint positions are wrong",
            answer,
            "said",
            reason.is_some(),
        ));
    }
    case
}

fn motoman(bench: &SetRunner) -> Result<Vec<Case>, String> {
    let whole = CsvTable::read(&bench.data("leica_poses_all.csv")?);
    let arms = [
        ("right arm, a random half to the other", "right", RIGHT),
        ("left arm, a random half to the other", "left", LEFT),
    ];
    let mut cases = Vec::new();
    for (name, run, mapping) in arms {
        let files = whole.texts("source_file");
        let kept = mapping.lines().find(|line| line.starts_with("keep = ")).unwrap_or("");
        let sheet = whole.filter_rows(|k| kept.contains(&format!("\"{}\"", files[k])));
        let held_out = random_half(sheet.len(), 1);
        let station = station_of(&sheet, mapping);
        let campaign = Campaign {
            name,
            run,
            concealed: "everything except the nominal geometry",
            model: if run == "right" { "motoman-right" } else { "motoman-left" },
            mapping: mapping.to_owned(),
            sheet: sheet.with_column("station_of_row", |k| station[k].clone()),
            held_out,
            points: vec![(axes("leica_", "m"), axes("target1_", "m"))],
            metres: 1.0,
            station: Some("station_of_row"),
        };
        let (mut case, result) = campaign.case(bench)?;
        case.reference = Some(Reference {
            value: Some(0.32),
            text: "0.32 mm, free grid of the right arm, rigid fit of the nominal geometry (the set's note)",
        });
        if result.is_some() {
            let after = case.errors.as_ref().map_or(f64::NAN, |errors| errors.after);
            case.checks.push(LimitCheck::at_most(
                "mean distance on unseen poses",
                after,
                0.32,
                "mm",
            ));
        }
        cases.push(case);
    }
    Ok(cases)
}

/// The station of each row, numbered by the mapping from its source file.
fn station_of(sheet: &CsvTable, mapping: &str) -> Vec<String> {
    let numbers = mapping.lines().find(|line| line.starts_with("station = ")).unwrap_or("");
    let number = |file: &String| {
        let after = numbers.split_once(&format!("{file} = ")).map_or("0", |(_, rest)| rest);
        after.chars().take_while(char::is_ascii_digit).collect()
    };
    sheet.texts("source_file").iter().map(number).collect()
}

fn sweeps(bench: &SetRunner) -> Result<Vec<Case>, String> {
    let sheet = CsvTable::read(&bench.data("poses_36.csv")?);
    // One pose of each sweep of six.
    let held_out: Vec<bool> = (0..sheet.len()).map(|k| k % 6 == 2).collect();
    let campaign = Campaign {
        name: "one pose of each sweep held out",
        run: "sweeps",
        concealed: "everything except the published geometry",
        model: "fanuc-r2000ib",
        mapping: SWEPT.to_owned(),
        sheet: sheet.clone(),
        held_out,
        points: reflectors(),
        metres: MM,
        station: None,
    };
    Ok(vec![campaign.case(bench)?.0])
}

fn hilti(bench: &SetRunner) -> Result<Vec<Case>, String> {
    bench.copy(&["trailblazer.urdf"])?;
    let arguments = [
        "model",
        "import",
        "--base",
        "base_link",
        "--tip",
        "prism",
        "--out",
        "OUT/hilti.toml",
        "trailblazer.urdf",
    ];
    let imported = bench.run_trued("imported", &arguments)?;
    let RunOutcome::Done(folder) = imported else {
        return Ok(vec![
            Case::from_diagnosis("all scenes", "all", &arguments, &imported, "position").0,
        ]);
    };
    let model =
        std::fs::read_to_string(folder.join("hilti.toml")).map_err(|why| why.to_string())?;
    bench.write("hilti.toml", model)?;
    let sheet = CsvTable::read(&bench.data("all_measurements.csv")?);
    let [scenes, kinds] = ["dataset", "kind"].map(|name| sheet.texts(name));
    let held_out: Vec<bool> =
        (0..sheet.len()).map(|k| scenes[k] != "flat" && kinds[k] == "evaluation").collect();
    let campaign = Campaign {
        name: "evaluation points of all scenes but flat",
        run: "scenes",
        concealed: "deflection, backlash, tilt, temperature",
        model: "hilti.toml",
        mapping: SCENES.to_owned(),
        sheet,
        held_out,
        points: vec![(axes("prism_", "m"), axes("", "m"))],
        metres: 1.0,
        station: Some("dataset"),
    };
    let (mut case, result) = campaign.case(bench)?;
    case.reference = Some(Reference {
        value: None,
        text: "6.9 to 9.9 mm, URDF and a rigid base for each height (the set's note); the paper's tables were not found",
    });
    if result.is_some()
        && let Some(Errors { before, after, .. }) = case.errors
    {
        case.checks.push(LimitCheck::at_most(
            "mean distance on unseen points",
            after,
            before / 3.0,
            "mm",
        ));
    }
    Ok(vec![case])
}
