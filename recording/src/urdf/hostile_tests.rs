//! Malicious and rounded files: no panic, no deep recursion, and exported files can be imported.

use proptest::prelude::*;

use super::tests::{ARM, read};
use crate::model::RobotModel;

#[test]
fn moments_that_rounding_made_too_small_still_make_a_model_file() {
    let rod = ARM.replace(
        "ixx=\"0.1\" ixy=\"0\" ixz=\"0\" iyy=\"0.1\"",
        "ixx=\"0.0833\" ixy=\"0\" ixz=\"0\" iyy=\"0.0834\"",
    );
    let rod = rod.replace("izz=\"0.05\"", "izz=\"0\"");
    let model = read(&rod).unwrap().model;
    assert_eq!(RobotModel::parse("x", &model.file.to_toml()).unwrap(), model);
}

#[test]
fn a_tower_of_elements_is_read_without_a_deep_stack() {
    let tower =
        format!("<robot name='x'>{}{}</robot>", "<x>".repeat(60_000), "</x>".repeat(60_000));
    assert!(read(&tower).unwrap_err().plain().contains("has no link"));
    let long: String = (0..20_000)
        .map(|i| format!("<link name='l{i}'/><joint name='j{i}' type='fixed'><parent link='l{i}'/><child link='l{}'/></joint>", i + 1))
        .collect();
    let text = format!("<robot name='x'>{long}<link name='l20000'/></robot>");
    assert!(read(&text).unwrap_err().plain().contains("has no moving joint"));
    let crowd = format!("<robot name='x'>{}</robot>", "<a/>".repeat(300_000));
    assert!(read(&crowd).unwrap_err().plain().contains("nodes limit"));
}

proptest! {
    #[test]
    fn no_text_makes_the_reader_panic(offset in any::<usize>(), byte in any::<u8>(), cut in any::<usize>(), number in any::<f64>()) {
        let mut text = ARM.as_bytes().to_vec();
        let length = text.len();
        text[offset % length] = byte;
        let _ = read(&String::from_utf8_lossy(&text)).map_err(|faults| faults.plain());
        text.drain(cut % length..(cut % length + offset % 40).min(length));
        let _ = read(&String::from_utf8_lossy(&text)).map_err(|faults| faults.styled());
        let numbers: Vec<usize> = ARM.match_indices("=\"0").map(|(offset, _)| offset + 2).collect();
        let mut text = ARM.to_owned();
        text.replace_range(numbers[offset % numbers.len()]..=numbers[offset % numbers.len()], &number.to_string());
        if let Ok(import) = read(&text) {
            prop_assert!(RobotModel::parse("x", &import.model.file.to_toml()).is_ok(), "{}", text);
        }
    }
}
