//! Waveforms of real instruments, compared with their documentation.
//!
//! The recordings are not part of the tree: they are searched next to the workspace or in
//! `TRUED_DATA`; without them a test prints SKIPPED.

#![expect(
    clippy::print_stderr,
    clippy::expect_used,
    reason = "a test tells what it finds, and fails by it"
)]

use std::path::PathBuf;

use recording::unit::Quantity;
use recording::waves::{Grid, Options, Waves, read};

fn waves(path: &str, options: &Options) -> Option<Waves> {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let data = std::env::var_os("TRUED_DATA").map_or(beside, PathBuf::from);
    let path = data.join(path);
    if !path.is_file() {
        eprintln!("SKIPPED: {} is not there (set TRUED_DATA)", path.display());
        return None;
    }
    let waves = read(&path, options).expect("the file is read");
    eprintln!("{}: {:?}", path.display(), waves.notes);
    Some(waves)
}

fn shape(waves: &Waves) -> (Vec<&str>, Vec<usize>) {
    let record = waves.records.first().expect("a record");
    let names = record.channels.iter().map(|wave| wave.name.as_str()).collect();
    (names, waves.records.iter().map(recording::waves::Record::len).collect())
}

#[test]
fn a_milling_accelerometer_is_one_channel_of_no_unit() {
    let Some(waves) = waves("milling-chatter/N255_S5000_accY.csv", &Options::default()) else {
        return;
    };
    assert_eq!(shape(&waves), (vec!["acc_y_raw"], vec![80_018]));
    let record = &waves.records[0];
    assert_eq!(record.grid, Grid::Time { start_s: 0.0, rate_hz: 10_000.0 });
    assert_eq!((record.channels[0].axis, record.channels[0].unit.as_str()), (Some(1), "1"));
}

#[test]
fn a_dynamometer_gives_three_forces_with_the_tacho_beside() {
    let Some(waves) = waves("turning-force/f416_a100.csv", &Options::default()) else { return };
    assert_eq!(shape(&waves), (vec!["Fx_N", "Fy_N", "Fz_N"], vec![65_000]));
    let axes: Vec<_> = waves.records[0].channels.iter().map(|wave| wave.axis).collect();
    assert_eq!(axes, [Some(0), Some(1), Some(2)]);
    assert_eq!(waves.records[0].auxiliary.len(), 1);
}

#[test]
fn a_thinned_labview_file_has_the_rate_of_its_times_and_the_units_of_its_header() {
    let Some(waves) = waves("beam-tone/test_2_ds16.lvm", &Options::default()) else { return };
    assert_eq!(shape(&waves).0, ["Voltage", "Force", "Acceleration"]);
    let record = &waves.records[0];
    assert_eq!(record.grid, Grid::Time { start_s: 0.0, rate_hz: 3200.0 });
    let units: Vec<_> = record.channels.iter().map(|wave| wave.unit.as_str()).collect();
    assert_eq!(units, ["Volts", "Pounds", "g"]);
    assert_eq!(record.channels[2].quantity(), Some((Quantity::Acceleration, 9.806_65)));
    assert!(waves.notes.iter().any(|note| note.contains("the column takes precedence")));
}

#[test]
fn a_tap_test_without_header_has_its_time_in_the_first_column() {
    let file = "tap-test/impact_time_Point1_Channel1_CH1.txt";
    let Some(waves) = waves(file, &Options::default()) else { return };
    assert_eq!(shape(&waves), (vec!["2", "3"], vec![51_200]));
    assert_eq!(waves.records[0].grid, Grid::Time { start_s: 0.0, rate_hz: 51_200.0 });
}

#[test]
fn a_stylus_profile_stands_over_its_length() {
    let Some(waves) = waves("surface-profile/mill_profile.csv", &Options::default()) else {
        return;
    };
    assert_eq!(shape(&waves), (vec!["z_um"], vec![22_401]));
    let Grid::Length { step_mm, .. } = waves.records[0].grid else {
        panic!("{:?}", waves.records[0].grid)
    };
    assert!((step_mm - 0.000_25).abs() < 1e-12);
}
