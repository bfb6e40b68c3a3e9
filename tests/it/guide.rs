//! The guide's commands, in order, as they stand there: whoever follows it meets no surprise.

use crate::TRUED;
use std::fs;
use std::os::unix::fs::symlink;
use std::process::Command;
use tests::clients::root;
use tests::place::Place;

/// What stands in the blocks of that language.
fn blocks(text: &str, language: &str) -> String {
    let start = format!("```{language}\n");
    let block = |rest: &str| rest.split("```").next().unwrap_or_default().to_owned();
    text.split(&start).skip(1).map(block).collect()
}

#[test]
fn the_guide_leads_from_an_empty_machine_to_a_calibrated_cell_in_shadow() {
    let guide = fs::read_to_string(root().join("docs/guide.md")).unwrap();
    let script = blocks(&guide, "sh");
    assert!(script.matches("\ntrued ").count() >= 12, "the guide's commands are found");
    let place = Place::new("shadow", "");
    let (bin, work) = (place.file("bin"), place.file("work"));
    fs::create_dir(&bin).unwrap();
    fs::create_dir(&work).unwrap();
    symlink(TRUED, bin.join("trued")).unwrap();
    let path = format!("{}:{}", bin.display(), std::env::var("PATH").unwrap());
    let output = Command::new("timeout")
        .args(["300", "sh", "-euc", &script])
        .current_dir(&work)
        .env("PATH", path)
        .env(shm_schema::RUNTIME_DIR_ENV, place.root())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{said}\n{}", String::from_utf8_lossy(&output.stderr));
    assert!(said.contains("the model still holds"), "step 5: {said}");
    let advanced = said.lines().find(|line| line.starts_with("advanced")).unwrap();
    let nominal = said.lines().find(|line| line.starts_with("nominal")).unwrap();
    let mean = |line: &str| line.split_whitespace().nth(1).unwrap().parse::<f64>().unwrap();
    assert!(3.0 * mean(advanced) < mean(nominal), "step 4, several times better: {said}");
    assert!(fs::read_dir(work.join("recordings")).unwrap().count() > 0, "step 6 recorded");
}
