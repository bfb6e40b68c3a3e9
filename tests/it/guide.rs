//! The guide's commands, in order and unchanged.

use crate::TRUED;
use std::fs;
use std::os::unix::fs::symlink;
use std::process::Command;
use tests::clients::root;
use tests::place::TestDirectory;

/// Content of the blocks in that language.
pub(crate) fn blocks(text: &str, language: &str) -> String {
    let start = format!("```{language}\n");
    let block = |rest: &str| rest.split("```").next().unwrap_or_default().to_owned();
    text.split(&start).skip(1).map(block).collect()
}

#[test]
fn the_guide_leads_from_an_empty_machine_to_a_calibrated_cell_in_shadow() {
    let guide = fs::read_to_string(root().join("docs/guide.md")).unwrap();
    let script = blocks(&guide, "sh");
    assert!(script.matches("\ntrued ").count() >= 12, "the guide's commands are found");
    let place = TestDirectory::new("shadow", "");
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
    let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{stdout}\n{}", String::from_utf8_lossy(&output.stderr));
    assert!(stdout.contains("the model still holds"), "step 5: {stdout}");
    let advanced = stdout.lines().find(|line| line.starts_with("advanced")).unwrap();
    let nominal = stdout.lines().find(|line| line.starts_with("nominal")).unwrap();
    let mean = |line: &str| line.split_whitespace().nth(1).unwrap().parse::<f64>().unwrap();
    assert!(3.0 * mean(advanced) < mean(nominal), "step 4, several times better: {stdout}");
    bent_by_a_millimetre(&work);
    assert!(fs::read_dir(work.join("recordings")).unwrap().count() > 0, "step 6 recorded");
}

/// After the guide's steps: the tool is bent by 1 mm, and step 5 is measured and evaluated again as
/// in the guide.
fn bent_by_a_millimetre(work: &std::path::Path) {
    let trued = |arguments: &[&str]| {
        Command::new(TRUED).args(arguments).current_dir(work).output().unwrap()
    };
    let places = [
        ("[50, 0, 100]", "[51, 0, 100]"),
        ("[-50, 0, 100]", "[-49, 0, 100]"),
        ("[0, 60, 80]", "[1, 60, 80]"),
    ];
    let truth_text = fs::read_to_string(work.join("there.toml")).unwrap();
    let bent = places.iter().fold(truth_text.clone(), |text, (from, to)| text.replace(from, to));
    assert_eq!(places.iter().filter(|(_, to)| bent.contains(to)).count(), 3, "{truth_text}");
    fs::write(work.join("bent.toml"), bent).unwrap();
    fs::copy(work.join("there.csv"), work.join("bent.csv")).unwrap();
    let truth = ["simulate", "--model", "irb1600-6-145-thesis", "--noise", "0.03", "--seed", "3"];
    assert!(trued(&[&truth[..], &["--out", "hit", "bent.csv"]].concat()).status.success());
    fs::copy(work.join("checked.toml"), work.join("hit.toml")).unwrap();
    let judged = trued(&["plan", "--check", "--model", "calibrated.toml", "hit.csv"]);
    let stdout = String::from_utf8_lossy(&judged.stdout);
    assert_eq!(judged.status.code(), Some(1), "{stdout}");
    let shifted_mm: Option<f64> = stdout
        .split_once("the tool was shifted by ")
        .and_then(|(_, rest)| rest.split_whitespace().next()?.parse().ok());
    assert!(shifted_mm.is_some_and(|mm| (mm - 1.0).abs() < 0.15), "{stdout}");
}
