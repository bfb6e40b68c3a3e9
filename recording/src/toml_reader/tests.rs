//! Reading of TOML: all errors at once, each with its location.

use super::*;
use proptest::prelude::*;

#[test]
fn every_fault_of_a_file_is_reported_at_once() {
    let text = "name = 3\nperiod_s = 1.0\nrate = -1\nanlge = 1\n[wrench]\nsource = \"fource\"\n";
    let document = Document::parse("cell.toml", text).unwrap();
    let root = document.root();
    root.text("name");
    root.require("period_ms", "a time");
    root.number("period_ms", POSITIVE);
    root.number("rate", 0.0..=1.0);
    root.number("angle", ..);
    root.require("model", "a path");
    root.text("model");
    let wrench = root.table("wrench").unwrap();
    wrench.choice("source", &[("force", 1), ("none", 2)]);
    wrench.close();
    root.close();
    insta::assert_snapshot!(document.finish(Some(())).unwrap_err(), @r#"
        error: `model`: is missing
         --> cell.toml:1:1
          |
        1 | name = 3
          | ^ expected a path

        error: `name`: is of type integer
         --> cell.toml:1:8
          |
        1 | name = 3
          |        ^ expected a string

        error: `period_s`: has the unit s, which does not match this key
         --> cell.toml:2:1
          |
        2 | period_s = 1.0
          | ^^^^^^^^ expected `period_ms`
          |
          = help: write `period_ms`, with the value multiplied by 1000

        error: `rate`: is -1
         --> cell.toml:3:8
          |
        3 | rate = -1
          |        ^^ expected a number from 0 to 1

        error: `anlge`: is an unknown key
         --> cell.toml:4:1
          |
        4 | anlge = 1
          | ^^^^^
          |
          = help: did you mean `angle`?

        error: `wrench.source`: is "fource"
         --> cell.toml:6:10
          |
        6 | source = "fource"
          |          ^^^^^^^^ expected "force" or "none" (did you mean "force"?)
        "#);
}

#[test]
fn faults_of_syntax_are_reported_with_their_line() {
    let faults = Document::parse("a.toml", "a = 1\nb = = 2\n[c\n").err().unwrap();
    assert!(faults.len() >= 2);
    assert_eq!(faults.list()[0].location.as_ref().unwrap().line, 2);
}

#[test]
fn a_key_is_no_other_key_without_unit() {
    let document = Document::parse("a.toml", "names = 1").unwrap();
    let root = document.root();
    root.text("from_joint");
    root.close();
    let faults = document.finish(Some(())).unwrap_err();
    assert_eq!(faults.list()[0].message, "is an unknown key");
}

proptest! {
    #[test]
    fn no_text_makes_the_walker_panic(text in "[ -~\n\u{e9}]{0,120}") {
        if let Ok(document) = Document::parse("x", &text) {
            let root = document.root();
            let keys: Vec<&str> = root.keys().collect();
            for key in keys {
                root.number(key, ..);
                root.whole(key, 0..5);
                root.rows(key);
                root.texts(key);
                root.table(key);
            }
            root.close();
            let _ = document.finish(Some(())).map_err(|faults| faults.plain());
        }
    }
}
