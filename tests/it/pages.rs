//! Every page in a browser: `tests/pages/audit.mjs` on pages of all commands.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::program::Place;
use crate::{live, spectrum, stability, surface, tap};
use tests::clients::{has, root, skipped};
use tests::python::tried;

const MODEL: &str = "irb1600-6-145";
const INDIVIDUAL: &str = "irb1600-6-145-thesis";

/// The folder with the packages of the audit; installed if it does not exist.
fn packages(scratch: &Path) -> Result<PathBuf, String> {
    if !has("node") || !has("npm") {
        return Err("no `node` and `npm`".to_owned());
    }
    let home = scratch.join("pages");
    let refused = |why: std::io::Error| format!("{}: {why}", home.display());
    fs::create_dir_all(&home).map_err(refused)?;
    let lock = File::create(scratch.join("pages.lock")).map_err(refused)?;
    lock.lock().map_err(refused)?;
    let pinned = fs::read_to_string(root().join("tests/pages/package.json")).map_err(refused)?;
    let installed = home.join("package.json");
    if !fs::read_to_string(&installed).is_ok_and(|found| found == pinned) {
        fs::write(&installed, &pinned).map_err(refused)?;
        let mut npm = Command::new("npm");
        npm.current_dir(&home).args(["install", "--no-audit", "--no-fund", "--no-package-lock"]);
        if let Err(why) = tried(&mut npm, "its packages cannot be installed") {
            fs::remove_file(&installed).map_err(refused)?;
            return Err(why);
        }
    }
    Ok(home)
}

/// The path of a browser.
fn browser() -> Result<String, String> {
    let find = "command -v chromium || command -v chromium-browser || command -v google-chrome";
    let found = Command::new("sh").args(["-c", find]).output().map_err(|why| why.to_string())?;
    let path = String::from_utf8_lossy(&found.stdout).trim().to_owned();
    if path.is_empty() { Err("no Chromium".to_owned()) } else { Ok(path) }
}

/// A planned campaign of a simulated robot and a calibration: `measured.csv`, `calibrated.toml`.
pub(crate) fn calibrate(place: &Place) {
    let plan = "--instrument 3500,-1500,1000 --target 50,0,100,0,0,1 --target=-50,0,100,0,0,1 \
                --target 0,60,80,0,0,1 --sigma-mm 0.03 --seed 1 --out poses";
    let arguments: Vec<&str> = plan.split_whitespace().collect();
    place.succeed(&[&["plan", "--model", MODEL], &arguments[..]].concat());
    let about = place.read("poses/poses.toml");
    let targets =
        "target1_mm = [50, 0, 100]\ntarget2_mm = [-50, 0, 100]\ntarget3_mm = [0, 60, 80]\n";
    place.file("poses/poses.toml", &(about + targets));
    let simulate = ["simulate", "--model", INDIVIDUAL, "--noise", "0.03", "--seed", "1"];
    place.succeed(&[&simulate[..], &["--out", "measured", "poses/poses.csv"]].concat());
    let calibrate = ["calibrate", "--model", MODEL, "--seed", "1", "--out", "calibrated.toml"];
    let report = ["--report", "calibrate.html", "measured.csv"];
    place.succeed(&[&calibrate[..], &report].concat());
}

/// Pages of all commands that make one of files, in the folder.
fn make_pages(place: &Place) {
    calibrate(place);
    place.run(&["diagnose", "--model", MODEL, "--out", "diagnosis", "measured.csv"]);
    place.file("cut.csv", &spectrum::geared_cut().csv());
    place.succeed(&["spectrum", "--model", INDIVIDUAL, "--report", "spectrum.html", "cut.csv"]);
    place.file("profile.csv", &surface::profile("x_um,z_um\n", |i, z| format!("{i},{z:.6}")));
    place.succeed(&["surface", "--report", "surface.html", "profile.csv"]);
    place.file("hits.csv", &tap::four_hits());
    place.succeed(&["tap", "--report", "tap.html", "hits.csv"]);
    place.succeed(&[
        "gears",
        "--model",
        INDIVIDUAL,
        "--from",
        "0,-20,20,0,40,0",
        "--cut",
        "0,400,0",
        "--report",
        "gears.html",
    ]);
    place.file("cut.toml", &stability::blocks("toml")[0]);
    place.run(&["stability", "cut.toml", "--report", "stability.html"]);
    place.succeed(&["plan", "--iso9283", "--model", MODEL, "--out", "iso"]);
    for (domain, out) in [("position", "positions"), ("torque", "torques"), ("force", "forces")] {
        let cases = ["--cases", "1", "--seed", "4", "--domain", domain, "--out", out];
        place.succeed(&[&["challenge"], &cases[..]].concat());
    }
    place.run(&["bench", "--quick", "--out", "bench"]);
    place.file("live.html", &live::saved_report());
}

/// All pages below a folder.
fn pages_in(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(pages_in(&path));
        } else if path.extension().is_some_and(|extension| extension == "html") {
            found.push(path);
        }
    }
    found.sort();
    found
}

#[test]
fn no_page_is_clipped_overlaps_or_bars_a_reader_on_any_screen_or_on_paper() {
    let scratch = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let (home, browser) = match packages(scratch).and_then(|home| Ok((home, browser()?))) {
        Ok(found) => found,
        Err(why) => return skipped(scratch, "pages in a browser", &why),
    };
    let place = Place::new();
    make_pages(&place);
    let pages = pages_in(&place.path("."));
    assert!(pages.len() >= 13, "{pages:?}");
    let audit = root().join("tests/pages/audit.mjs");
    let mut command = Command::new("node");
    let done = command.current_dir(home).arg(audit).arg(browser).args(pages).output().unwrap();
    let stdout = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(done.status.success(), "{stdout}{}", String::from_utf8_lossy(&done.stderr));
}
