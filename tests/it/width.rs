//! Texts of the commands in a terminal of 80 columns (needs `script` of util-linux; SKIPPED without it).

use std::path::Path;
use std::process::{Command, Stdio};

use tests::clients::skipped;

use crate::TRUED;
use crate::program::Place;
use crate::surface::profile;

const COLUMNS: usize = 80;

/// The lines that a command shows on a terminal, without colours; states of one line that it overwrites are lines of their own.
fn lines_on_terminal(place: &Place, arguments: &str) -> Vec<String> {
    let line = format!("stty cols {COLUMNS} rows 24; '{TRUED}' {arguments}");
    let output = Command::new("script")
        .args(["-qfec", &line, "/dev/null"])
        .current_dir(place.path(""))
        .env("NO_COLOR", "1")
        .stdin(Stdio::null())
        .output()
        .expect("script");
    // A spinner is cleared by a control sequence, and the next text stands in the same line.
    let text = String::from_utf8_lossy(&output.stdout).replace("\u{1b}[2K", "\r");
    text.split(['\n', '\r']).map(str::to_owned).collect()
}

/// Samples of a force that vibrates.
fn force() -> String {
    let row = |i: usize| {
        let t_s = i as f64 * 2.5e-4;
        let force = 5.0 * (860.8 * t_s).sin() + 0.3 * ((i * 7919 % 101) as f64 / 101.0 - 0.5);
        format!("{t_s:.6},12000,20,{force:.5}\n")
    };
    "t_s,spindle_rpm,feed_mm_s,fx_N\n".to_owned() + &(0..12_000).map(row).collect::<String>()
}

#[test]
fn no_text_is_wider_than_a_terminal_of_eighty_columns() {
    if Command::new("script").arg("--version").output().is_err() {
        return skipped(Path::new(env!("CARGO_TARGET_TMPDIR")), "texts on a terminal", "no script");
    }
    let place = Place::new();
    place.file("profile.csv", &profile("x_um,z_um\n", |i, z| format!("{i},{z:.6}")));
    place.file("other.csv", &profile("x_um,z_um\n", |i, z| format!("{i},{:.6}", 1.1 * z)));
    place.file("force.csv", &force());
    for arguments in [
        "surface profile.csv other.csv --feed-mm-s 10 --spindle-rpm 4000 --teeth 2",
        "gears --model irb1600-6-145-thesis --from 0,10,10,0,30,0 --cut 100,0,0 --lines 0.186,6.69",
        "plan --model irb120 --count 4 --candidates 20 --seed 1",
        "plan --model irb120 --next --candidates 20 --seed 1",
        "plan --model irb120 --check --candidates 40 --seed 1",
        "plan --model irb120 --iso9283 --seed 1",
        "spectrum force.csv --model irb1600-6-145-thesis",
        "check force.csv profile.csv",
        "model show irb1600-6-145-thesis",
        "model presets",
        "correct missing.csv",
    ] {
        let lines = lines_on_terminal(&place, arguments);
        assert!(lines.iter().any(|line| !line.trim().is_empty()), "{arguments}");
        for line in lines {
            assert!(line.chars().count() <= COLUMNS, "{arguments}:\n{line}");
        }
    }
}
