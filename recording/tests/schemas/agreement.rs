//! Comparison of schemas and readers: files of each format with one change, thousands of them.
//!
//! Files refused by a schema are refused by the reader. Unknown keys, missing keys, types and
//! ranges of single numbers refused by the reader are refused by the schema.

use recording::bridge::{EgmConfig, EthernetConfig, RsiConfig};
use recording::cell::CellConfig;
use recording::cut::CutFile;
use recording::faults::{Fault, Faults};
use recording::manifest::Manifest;
use recording::mapping::Mapping;
use recording::model::RobotModel;
use recording::series::RecordingMetadata;
use serde_json::Value;

use super::{faults, known, known_as, mutations, read, root, samples};

/// A reader of a format.
type Reader = fn(&str) -> Result<(), Faults>;

fn reader(format: &str) -> Reader {
    match format {
        "trued.model/1" => |text| RobotModel::parse("model.toml", text).map(drop),
        "trued.recording/1" => |text| RecordingMetadata::parse("recording.toml", text).map(drop),
        "trued.mapping/1" => |text| Mapping::parse("mapping.toml", text).map(drop),
        "trued.cell/1" => |text| CellConfig::parse("cell.toml", text).map(drop),
        "trued.cut/1" => |text| CutFile::parse("cut.toml", text).map(drop),
        "trued.manifest/1" => |text| Manifest::parse("manifest.toml", text).map(drop),
        "trued.bridge-egm/1" => |text| EgmConfig::parse("egm.toml", text).map(drop),
        "trued.bridge-rsi/1" => |text| RsiConfig::parse("rsi.toml", text, ethernet()).map(drop),
        _ => panic!("no reader of {format}"),
    }
}

fn ethernet() -> EthernetConfig {
    EthernetConfig::parse("rsi-ethernet.xml", &read(&root().join("deploy/rsi-ethernet.xml")))
        .unwrap()
}

/// A fault of a single key.
fn is_of_one_key(fault: &Fault) -> bool {
    let starts =
        |text: &str, prefixes: &[&str]| prefixes.iter().any(|prefix| text.starts_with(prefix));
    let message = ["is an unknown key", "is missing", "is of type", "has the unit", "has no unit"];
    let number =
        ["a number from", "a number of", "a number above", "a number below", "a whole number from"];
    let parameter = ["0 or more", "above 0", "between "];
    // The number of joints depends on the whole file.
    if fault.key.ends_with(".joint") && fault.expected == "a whole number from 1 to 3" {
        return false;
    }
    starts(&fault.message, &message)
        || starts(&fault.expected, &number)
        || starts(&fault.expected, &parameter) && fault.message.starts_with("is ")
}

#[test]
fn a_schema_and_its_reader_refuse_the_same_changes_of_a_file() {
    let samples = samples();
    // The owner's file of offered models has its reader in the workspace `plant`.
    for known in known().iter().filter(|known| known.format != "trued.models/1") {
        let bounds = mutations::bounds(&known.schema);
        let of_format = samples.iter().filter(|sample| sample.format == known.format);
        // A preset is a longer version of the example in the reference.
        let is_short =
            |value: &Value| value["joint"].as_array().is_none_or(|joints| joints.len() < 4);
        let goods: Vec<&Value> =
            of_format.map(|sample| &sample.value).filter(|value| is_short(value)).collect();
        let mutants: Vec<_> = goods.iter().flat_map(|good| mutations::of(good, &bounds)).collect();
        let disagreements: Vec<String> =
            mutants.iter().filter_map(|mutant| disagreement(&known.format, mutant)).collect();
        println!("{}: {} changes of {} files", known.format, mutants.len(), goods.len());
        assert!(mutants.len() > 100, "{}: {} changes only", known.format, mutants.len());
        assert!(disagreements.is_empty(), "{}:\n{}", known.format, disagreements.join("\n"));
    }
}

fn disagreement(format: &str, mutant: &mutations::Mutant) -> Option<String> {
    let text = mutations::toml(&mutant.value);
    let by_reader = reader(format)(&text);
    let by_schema = faults(format, &mutant.value);
    let change = &mutant.change;
    match by_reader {
        Ok(()) if !by_schema.is_empty() => {
            Some(format!("{change}: the schema alone: {by_schema:?}"))
        }
        Err(faults) if by_schema.is_empty() => {
            let is_of_change = |fault: &&Fault| fault.key.contains(&mutant.key);
            let fault =
                faults.list().iter().filter(is_of_change).find(|fault| is_of_one_key(fault))?;
            Some(format!("{change}: the reader alone: {fault:?}"))
        }
        _ => None,
    }
}

#[test]
fn every_kind_of_effect_that_the_schema_lists_is_known_to_the_reader() {
    let format = "trued.model/1";
    let forms = known_as(format).schema["$defs"]["Effect"]["anyOf"].as_array().unwrap();
    let example = samples().into_iter().find(|sample| sample.value["name"] == "three-joint arm");
    let arm = example.unwrap().value;
    for form in forms {
        let mut model = arm.clone();
        model["effect"] = Value::Array(vec![effect(form)]);
        let joint = &mut model["joint"][0];
        if is_for_prismatic(form) {
            joint["kind"] = "prismatic".into();
            joint.as_object_mut().unwrap().remove("max_speed_deg_s");
            joint["limits_mm"] = joint.as_object_mut().unwrap().remove("limits_deg").unwrap();
        }
        assert_eq!(faults(format, &model), Vec::<String>::new(), "{form}");
        if let Err(faults) = RobotModel::parse("model.toml", &mutations::toml(&model)) {
            let of_one_key: Vec<_> = faults.list().iter().filter(|f| is_of_one_key(f)).collect();
            assert!(of_one_key.is_empty(), "{form}: {of_one_key:?}");
        }
    }
    assert!(forms.len() > 60, "{}", forms.len());
}

/// All keys of a form, each with a number in its range.
fn effect(form: &Value) -> Value {
    let properties = form["properties"].as_object().unwrap();
    let keys = properties.iter().filter(|(key, _)| *key != "sigma");
    keys.map(|(key, schema)| (key.clone(), example(schema)))
        .collect::<serde_json::Map<_, _>>()
        .into()
}

fn example(schema: &Value) -> Value {
    match schema["type"].as_str() {
        Some("array") => {
            let count = schema["minItems"].as_u64().unwrap();
            // Carried bodies: joint 1 of three carries three links and the tool.
            let count = if schema["maxItems"] == 51 { 12 } else { count };
            Value::Array((0..count).map(|_| example(&schema["items"])).collect())
        }
        Some("integer") => 1.into(),
        Some("string") => "q".into(),
        Some(_) => {
            let low = schema["exclusiveMinimum"].as_f64().unwrap_or(0.0);
            let high = schema["exclusiveMaximum"].as_f64().unwrap_or(low + 1.0);
            (0.5 * (low + high)).into()
        }
        None => schema["const"].clone(),
    }
}

/// Whether the keys are those of a prismatic joint, and the form for a revolute one has others.
fn is_for_prismatic(form: &Value) -> bool {
    form["title"].as_str().is_some_and(|title| title.ends_with("(prismatic joint)"))
}
