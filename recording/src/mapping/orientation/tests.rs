//! Orientations in the forms of robots and instruments, compared with scipy and with rotations composed by hand.

use crate::faults::Faults;
use crate::mapping::Mapping;
use crate::series::{Channel, Recording, RequiredData, read_text};
use proptest::prelude::*;

fn apply(orientation: &str, rows: &str) -> Result<Recording, Faults> {
    let mapping = format!(
        "schema = \"trued.mapping/1\"\nheader = false\nseparator = \"space\"\n[columns]\n\
         t_s = {{ per_row = 1.0 }}\nq1_deg = {{ constant = 0.0 }}\norientation = {{ {orientation} }}\n"
    );
    let mapping = Mapping::parse("m.toml", &mapping)?;
    read_text("x.csv", rows, Some(&mapping), None, RequiredData::Measurement)
}

/// w, x, y, z of the only row, w not below zero.
fn quaternion(orientation: &str, row: &str) -> [f64; 4] {
    let recording = apply(orientation, &format!("{row}\n")).unwrap();
    let read = [0, 1, 2, 3].map(|part| recording.column(Channel::Orientation(part)).unwrap()[0]);
    if read[0] < 0.0 { read.map(|part| -part) } else { read }
}

#[test]
fn each_form_is_the_rotation_that_scipy_makes_of_it() {
    let angles = "175 -40 62.5";
    let matrix =
        "-0.663414 -0.279454 0.694109 0.383022 -0.923721 -0.005813 0.642788 0.262003 0.719846";
    let transposed =
        "-0.663414 0.383022 0.642788 -0.279454 -0.923721 0.262003 0.694109 -0.005813 0.719846";
    let of_matrix = [0.182147965729901, 0.367580119832384, 0.070439337784603, 0.909255340252086];
    // scipy 1.17.1: Rotation.from_euler(sequence, [175, -40, 62.5], degrees=True).as_quat(canonical=True), and from_rotvec, from_matrix.
    for (convention, unit, row, expected) in [
        (
            "ZYX",
            "deg",
            angles,
            [0.142220203473152, -0.313382685155339, -0.474269241045141, -0.810329188273106],
        ),
        (
            "xyz",
            "deg",
            angles,
            [0.142220203473152, -0.810329188273106, -0.474269241045141, -0.313382685155339],
        ),
        (
            "XYZ",
            "deg",
            angles,
            [0.212303854935533, 0.794850333599231, -0.499777604086134, -0.270854881459846],
        ),
        (
            "ZYZ",
            "deg",
            angles,
            [0.451981596834447, -0.284379355970655, 0.19001621072484, -0.823853662783915],
        ),
        (
            "zxz",
            "deg",
            angles,
            [0.451981596834447, 0.19001621072484, -0.284379355970655, -0.823853662783915],
        ),
        (
            "rotation_vector",
            "rad",
            "1.2 -2.1 0.4",
            [0.338226094707613, 0.460642045738645, -0.806123580042628, 0.153547348579548],
        ),
        (
            "rotation_vector",
            "deg",
            "30 -80 10",
            [0.731215296936255, 0.237893847146097, -0.634383592389592, 0.079297949048699],
        ),
        ("matrix_rows", "", matrix, of_matrix),
        ("matrix_columns", "", transposed, of_matrix),
        ("wxyz", "", "0.5 0.1 -0.7 0.5", [0.5, 0.1, -0.7, 0.5]),
        ("xyzw", "", "0.1 -0.7 0.5 0.5", [0.5, 0.1, -0.7, 0.5]),
    ] {
        let from: Vec<String> =
            (1..=row.split(' ').count()).map(|column| column.to_string()).collect();
        let unit = if unit.is_empty() { String::new() } else { format!(", unit = \"{unit}\"") };
        let entry = format!("convention = \"{convention}\", from = [{}]{unit}", from.join(", "));
        let read = quaternion(&entry, row);
        let apart = read.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let rounding = if convention.starts_with("matrix") { 1e-6 } else { 1e-14 };
        assert!(apart < rounding, "{convention}: {read:?}, scipy {expected:?}");
    }
}

proptest! {
    #[test]
    fn angles_are_the_product_of_turns_about_single_axes(a in -180.0..180.0_f64, b in -180.0..180.0_f64, c in -180.0..180.0_f64) {
        // Each rotation is written out, independently of the code under test.
        let x = |d: f64| { let (s, c) = d.to_radians().sin_cos(); [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]] };
        let y = |d: f64| { let (s, c) = d.to_radians().sin_cos(); [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]] };
        let z = |d: f64| { let (s, c) = d.to_radians().sin_cos(); [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]] };
        let times = |a: [[f64; 3]; 3], b: [[f64; 3]; 3]| {
            [0, 1, 2].map(|i| [0, 1, 2].map(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum::<f64>()))
        };
        // KUKA: A about Z, then B about the new Y, then C about the new X. Fanuc: W about X, P about the fixed Y, R about the fixed Z.
        for (convention, matrix) in [
            ("ZYX", times(times(z(a), y(b)), x(c))),
            ("xyz", times(times(z(c), y(b)), x(a))),
            ("XYZ", times(times(x(a), y(b)), z(c))),
            ("ZYZ", times(times(z(a), y(b)), z(c))),
        ] {
            let entry = format!("convention = \"{convention}\", from = [1, 2, 3], unit = \"deg\"");
            let [w, i, j, k] = quaternion(&entry, &format!("{a} {b} {c}"));
            let read = [
                [1.0 - 2.0 * (j * j + k * k), 2.0 * (i * j - w * k), 2.0 * (i * k + w * j)],
                [2.0 * (i * j + w * k), 1.0 - 2.0 * (i * i + k * k), 2.0 * (j * k - w * i)],
                [2.0 * (i * k - w * j), 2.0 * (j * k + w * i), 1.0 - 2.0 * (i * i + j * j)],
            ];
            for (row, expected) in read.iter().flatten().zip(matrix.iter().flatten()) {
                prop_assert!((row - expected).abs() < 1e-12, "{convention} {read:?} {matrix:?}");
            }
        }
    }
}

#[test]
fn a_row_without_an_orientation_is_one_that_was_not_taken() {
    let entry = "convention = \"xyz\", from = [1, 2, 3], unit = \"deg\"";
    let recording = apply(entry, "10 20 30\nnan nan nan\n1 2 3\n").unwrap();
    let w = recording.column(Channel::Orientation(0)).unwrap();
    assert!(w[0].is_finite() && w[1].is_nan() && w[2].is_finite());
}

#[test]
fn an_orientation_that_is_not_said_or_is_none_is_refused() {
    for (entry, rows, message) in [
        ("from = [1, 2, 3], unit = \"deg\"", "1 2 3", "orientation.convention`: is missing"),
        ("from = [1, 2, 3], convention = \"ZYX\"", "1 2 3", "orientation.unit`: is missing"),
        ("from = [1, 2, 3], convention = \"rpy\", unit = \"deg\"", "1 2 3", "roll pitch yaw"),
        ("from = [1, 2, 3], convention = \"ZyX\", unit = \"deg\"", "1 2 3", "is \"ZyX\""),
        ("from = [1, 2, 3], convention = \"XXY\", unit = \"deg\"", "1 2 3", "is \"XXY\""),
        ("from = [1, 2, 3], convention = \"ZYX\", unit = \"mm\"", "1 2 3", "a unit of angle"),
        ("from = [1, 2, 3, 4], convention = \"wxyz\", unit = \"deg\"", "1 0 0 0", "no unit here"),
        ("from = [1, 2], convention = \"ZYX\", unit = \"deg\"", "1 2", "has 2 columns"),
        ("from = [1, 1, 2], convention = \"ZYX\", unit = \"deg\"", "1 2 3", "lists `1` twice"),
        ("from = [1, 2, 7], convention = \"ZYX\", unit = \"deg\"", "1 2 3", "`7`: is not a column"),
        ("from = [1, 2, 3, 4], convention = \"xyzw\"", "1 1 0 0", "the quaternion's length"),
        (
            "from = [1,2,3,4,5,6,7,8,9], convention = \"matrix_rows\"",
            "1 0 0 0 1 0 0 0 -1",
            "is not a rotation",
        ),
        (
            "from = [1,2,3,4,5,6,7,8,9], convention = \"matrix_rows\"",
            "1 0 0 0 1.01 0 0 0 1",
            "x.csv:1:1",
        ),
        ("from = \"a\", convention = \"ZYX\", unit = \"deg\"", "1 2 3", "is not a list of columns"),
    ] {
        apply(entry, &format!("{rows}\n")).unwrap_err().assert_say(message);
    }
}
