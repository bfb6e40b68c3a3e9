//! A long table read in a separate process, whose peak memory the kernel reports.

use std::fmt::Write as _;
use std::fs;

use recording::series::{Channel, RequiredData, read};

const ROWS: usize = 1_000_000;

/// Peak memory of this process, MB; `None` if the kernel does not report it.
fn most_mb() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().trim_end_matches("kB").trim().parse::<u64>().ok()? / 1024)
}

/// Five columns of numbers are 40 MB, as many again while they are checked; the text alone is 67 MB.
#[test]
fn a_million_rows_are_read_within_bounded_memory() {
    let path = std::env::temp_dir().join(format!("trued-large-{}.csv", std::process::id()));
    let mut text = String::from("t_s,q1_deg,x_mm,y_mm,z_mm\n");
    let mut file = fs::File::create(&path).unwrap();
    for row in 0..ROWS {
        let (t, x) = (row as f64 * 1e-3, row as f64 / 3.0);
        writeln!(text, "{t:.3},{x:.9},{:.9},{:.9},{:.9}", 0.5 * x, x - 1.0, -x).unwrap();
        if text.len() > 1 << 20 || row + 1 == ROWS {
            std::io::Write::write_all(&mut file, text.as_bytes()).unwrap();
            text.clear();
        }
    }
    let read = read(&path, None, RequiredData::Measurement);
    fs::remove_file(&path).unwrap();
    let read = read.unwrap();
    assert_eq!((read.len(), read.t_s[ROWS - 1]), (ROWS, 999.999));
    let z = read.column(Channel::Position(2)).unwrap()[ROWS - 1];
    assert!((z + 333.333).abs() < 1e-9, "{z}");
    match most_mb() {
        Some(most) => assert!(most < 130, "{most} MB"),
        None => println!("SKIPPED: this kernel does not tell how much memory a process held"),
    }
}
