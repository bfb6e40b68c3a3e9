//! The command line: schemas of today, and what it says of input that cannot be used.

use crate::place::{Folder, HERE, endpoint, plant};

#[test]
fn the_schemas_are_of_today() {
    let schemas = [
        ("message", schemars::schema_for!(bus::message::Message)),
        ("history", schemars::schema_for!(bus::message::History)),
        ("fleet", schemars::schema_for!(bus::Fleet)),
        ("models", bus::acceptance::schema()),
    ];
    for (name, schema) in schemas {
        let schema = format!("{:#}\n", serde_json::to_value(schema).unwrap());
        let path = format!("{HERE}/schemas/{name}.schema.json");
        if std::env::var_os("TRUED_BLESS").is_some() {
            std::fs::write(&path, &schema).unwrap();
        }
        let written = std::fs::read_to_string(&path).unwrap_or_default();
        assert_eq!(written, schema, "TRUED_BLESS=1 writes it anew");
    }
}

#[test]
fn input_that_cannot_be_used_is_named_with_a_remedy() {
    let folder = Folder::new();
    let spool = folder.0.join("spool");
    let spool = spool.to_str().unwrap();
    let bridge = ["bridge", "cell", "--spool", spool];
    let cases: [(Vec<&str>, &str); 6] = [
        (bridge.to_vec(), "no endpoint: give --connect"),
        ([&bridge[..], &["--listen", "127.0.0.1:7447"]].concat(), "expected tcp/HOST:PORT"),
        ([&bridge[..], &["--group", "a/b"]].concat(), "group `a/b`: expected 1 to 64"),
        ([&bridge[..], &["--rate-hz", "50"]].concat(), "expected 0.1 to 10"),
        (vec!["fleet", "--expect", "cell", "--connect", "tcp/127.0.0.1:1"], "write GROUP/CELL"),
        (vec!["fleet"], "no endpoint"),
    ];
    for (arguments, expected) in cases {
        let output = plant(&arguments).output().unwrap();
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(
            output.status.code() == Some(2) && text.contains(expected),
            "{arguments:?}: {text}"
        );
    }
    let nobody = endpoint();
    let output = plant(&["fleet", "--connect", &nobody]).output().unwrap();
    assert_eq!(output.status.code(), Some(3), "{output:?}");
}
