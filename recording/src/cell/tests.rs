//! Configurations of cells, good and bad.

use super::*;
use proptest::prelude::*;

const WHOLE: &str = include_str!("../../../deploy/cell.toml");

fn parse(text: &str) -> Result<CellConfig, Faults> {
    CellConfig::parse("cell.toml", text)
}

#[test]
fn three_lines_are_a_cell_and_it_only_watches() {
    let config = parse("schema = \"trued.cell/1\"\ncell = \"demo\"\nmodel = \"m.toml\"\n").unwrap();
    assert_eq!(config.mode, Mode::Shadow);
    assert_eq!((config.cycle.period_s, config.cycle.stale_s), (0.001, 0.01));
    assert_eq!(config.envelope.limits_of_joint(3, JointKind::Revolute), (0.02, 0.05, 5.0));
    assert_eq!(config.wrench.source, WrenchSource::None);
    assert!(config.recorder.is_none() && config.vibration.is_none() && config.force.is_none());
}

#[test]
fn the_example_that_is_shipped_loads() {
    let config = parse(WHOLE).unwrap();
    assert_eq!(config.vibration.unwrap().teeth, Some(2));
    assert_eq!(config.realtime.fifo_priority, Some(80));
    assert_eq!(config.recorder.unwrap().max_file_bytes, 256_000_000);
    assert!(config.wrench.loop_gain_max <= 0.5);
}

#[test]
fn every_fault_of_a_cell_is_reported_at_once() {
    let text = r#"schema = "trued.cell/1"
cell = "my cell"
mode = "on"
[cycle]
period_ms = 20
stale_s = 10
[envelope]
angle_mrad = [20, -1]
rate_deg_s = 3
[recordr]
dir = "x"
"#;
    insta::assert_snapshot!(parse(text).unwrap_err(), @r#"
        error: `model`: is missing
         --> cell.toml:1:1
          |
        1 | schema = "trued.cell/1"
          | ^ expected the path of a model file

        error: `cell`: is "my cell"
         --> cell.toml:2:8
          |
        2 | cell = "my cell"
          |        ^^^^^^^^^ expected 1 to 24 of a-z, 0-9 and -

        error: `mode`: is "on"
         --> cell.toml:3:8
          |
        3 | mode = "on"
          |        ^^^^ expected "shadow" or "limited" or "full"

        error: `cycle.period_ms`: makes every command stale (10 ms with a period of 20 ms)
         --> cell.toml:5:13
          |
        5 | period_ms = 20
          |             ^^ expected stale_ms above period_ms

        error: `cycle.stale_s`: has the unit s, which does not match this key
         --> cell.toml:6:1
          |
        6 | stale_s = 10
          | ^^^^^^^ expected `stale_ms`
          |
          = help: write `stale_ms`, with the value multiplied by 1000

        error: `envelope.angle_mrad`: is -1
         --> cell.toml:8:14
          |
        8 | angle_mrad = [20, -1]
          |              ^^^^^^^^ expected a number above 0, at most 200

        error: `envelope.rate_deg_s`: has the unit deg_s, which does not match this key
         --> cell.toml:9:1
          |
        9 | rate_deg_s = 3
          | ^^^^^^^^^^ expected `rate_mrad_s`
          |
          = help: write `rate_mrad_s`, with the value multiplied by 17.45329252

        error: `recordr`: is an unknown key
          --> cell.toml:10:2
           |
        10 | [recordr]
           |  ^^^^^^^
           |
           = help: did you mean `recorder`?
        "#);
}

#[test]
fn what_does_not_go_together_is_reported() {
    let text = r#"schema = "trued.cell/1"
cell = "a"
model = "m"
[wrench]
source = "force"
loop_gain_max = 0.7
[vibration]
band_Hz = [100, 5]
[realtime]
priority = 50
"#;
    insta::assert_snapshot!(parse(text).unwrap_err(), @r#"
        error: `wrench`: uses the force stream
         --> cell.toml:4:1
          |
        4 | [wrench]
          | ^^^^^^^^ expected a table [force] with its rate_Hz

        error: `wrench.loop_gain_max`: is 0.7
         --> cell.toml:6:17
          |
        6 | loop_gain_max = 0.7
          |                 ^^^ expected a number from 0.01 to 0.5

        error: `vibration`: needs the force stream, but the cell has none
         --> cell.toml:7:1
          |
        7 | [vibration]
          | ^^^^^^^^^^^
          |
          = help: add a table [force]

        error: `vibration.band_Hz`: is [100, 5]
         --> cell.toml:8:11
          |
        8 | band_Hz = [100, 5]
          |           ^^^^^^^^ expected [lowest, highest], both above zero

        error: `realtime.priority`: is given, but the policy has no priority
          --> cell.toml:10:12
           |
        10 | priority = 50
           |            ^^ expected policy = "fifo" as well
        "#);
}

#[test]
fn ages_and_clocks_of_sensors_have_defaults_and_zero_is_never() {
    let head = "schema = \"trued.cell/1\"\ncell = \"a\"\nmodel = \"m\"\n[force]\nrate_Hz = 1000\n";
    let config = parse(head).unwrap();
    let force = config.force.unwrap();
    assert_eq!((force.ahead_s, force.late_s), (0.005, 1.0));
    assert_eq!(config.temperature.stale_s, 60.0);
    assert!(!config.wrench.use_faulty_channels);
    let text = format!(
        "{head}ahead_ms = 0\nlate_ms = 50\n[temperature]\nstale_s = 0\n\
         [wrench]\nuse_faulty_channels = true\n"
    );
    let config = parse(&text).unwrap();
    let force = config.force.unwrap();
    assert_eq!((force.ahead_s, force.late_s), (0.0, 0.05));
    assert_eq!(config.temperature.stale_s, f64::INFINITY);
    assert!(config.wrench.use_faulty_channels);
    let used = format!("{head}[wrench]\nsource = \"force\"\nstale_ms = 200\n");
    assert_eq!(parse(&used).unwrap().force.unwrap().late_s, 0.2, "what comes later is never used");
    assert!(parse(&format!("{head}[temperature]\nstale_s = -1\n")).is_err());
}

#[test]
fn a_list_per_joint_must_fit_the_robot() {
    let text = "schema = \"trued.cell/1\"\ncell = \"a\"\nmodel = \"m\"\n[envelope]\nangle_mrad = [1, 2, 3]";
    let config = parse(text).unwrap();
    assert_eq!(config.envelope.limits_of_joint(1, JointKind::Revolute).0, 0.002);
    assert!(config.check_against("cell.toml", &[JointKind::Revolute; 3]).is_ok());
    assert!(config.check_against("cell.toml", &[JointKind::Revolute; 6]).is_err());
}

proptest! {
    #[test]
    fn no_text_makes_the_reader_panic(offset in any::<usize>(), byte in any::<u8>(), noise in "[ -~\n]{0,40}") {
        let mut text = WHOLE.as_bytes().to_vec();
        let offset = offset % text.len();
        text[offset] = byte;
        let mut text = String::from_utf8_lossy(&text).into_owned();
        let _ = parse(&text).map_err(|faults| faults.plain());
        if text.is_char_boundary(offset) {
            text.insert_str(offset, &noise);
        }
        let _ = parse(&text).map_err(|faults| faults.styled());
    }
}

const MEASURED: &str = "schema = \"trued.cell/1\"\ncell = \"demo\"\nmodel = \"m.toml\"\n\
                        [measured]\nrate_Hz = 100\nlatency_ms = 20\nnoise_mm = 0.02\n";

#[test]
fn an_instrument_is_only_watched_by_default_and_its_registration_moves_points_to_the_base() {
    let text = format!(
        "{MEASURED}base_from_instrument = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]\n\
         instrument_mm = [1000, 0, 500]\npoint_mm = [0, 0, 40]\n"
    );
    let measured = parse(&text).unwrap().measured.expect("an instrument");
    assert_eq!(measured.mode, MeasuredMode::Observe);
    let transformed = measured.base_from_instrument.point(DVec3::X);
    assert!((transformed - DVec3::new(1.0, 1.0, 0.5)).length() < 1e-15, "{transformed}");
    assert_eq!(measured.point_in_tool_m, DVec3::Z * 0.04);
    assert_eq!((measured.interval_s, measured.latency_s, measured.reaction_s), (0.01, 0.02, 0.01));
    assert_eq!((measured.time_constant_s, measured.hold_s), (None, 0.5));
}

#[test]
fn a_time_constant_too_short_for_the_delay_is_refused_and_so_is_what_is_no_rotation() {
    let short = parse(&format!("{MEASURED}time_constant_ms = 79\n")).unwrap_err().to_string();
    assert!(short.contains("time_constant_ms") && short.contains("80 or more"), "{short}");
    assert!(parse(&format!("{MEASURED}time_constant_ms = 81\n")).is_ok());
    let skewed = format!("{MEASURED}base_from_instrument = [[1, 0, 0], [0, 1, 0], [0, 0.1, 1]]\n");
    assert!(parse(&skewed).unwrap_err().to_string().contains("is not a rotation"));
    let incomplete = "schema = \"trued.cell/1\"\ncell = \"demo\"\nmodel = \"m.toml\"\n[measured]\n";
    let faults = parse(incomplete).unwrap_err().to_string();
    assert!(
        ["rate_Hz", "latency_ms", "noise_mm"].iter().all(|key| faults.contains(key)),
        "{faults}"
    );
}

#[test]
fn cycles_too_slow_for_a_trim_are_refused_where_there_is_one() {
    let slow = format!("{MEASURED}[cycle]\nperiod_ms = 50\nstale_ms = 200\n");
    parse(&slow).unwrap_err().assert_say("cycles than 50 ms for a trim");
    assert!(parse(&slow.replace("period_ms = 50", "period_ms = 40")).is_ok());
    assert!(parse(&slow.replace("[measured]", "[measured]\nmode = \"off\"")).is_ok());
}

const DYNAMIC: &str = "schema = \"trued.cell/1\"\ncell = \"demo\"\nmodel = \"m.toml\"\n\
                       [cycle]\nperiod_ms = 4\nstale_ms = 20\n[dynamic]\n";

#[test]
fn joints_lead_by_default_where_the_table_is_given_and_the_commands_are_frequent_enough() {
    let dynamic = parse(DYNAMIC).unwrap().dynamic.expect("a table");
    let expected = Dynamic { mode: DynamicMode::Compensate, bandwidth_hz: 40.0, robust_to: 0.3 };
    assert_eq!(dynamic, expected);
    parse(&format!("{DYNAMIC}bandwidth_Hz = 63\n")).unwrap_err().assert_say("62.5 or less");
    assert!(parse(&format!("{DYNAMIC}bandwidth_Hz = 62.5\n")).is_ok());
    assert!(parse(&format!("{DYNAMIC}bandwidth_Hz = 63\nmode = \"off\"\n")).is_ok());
    parse(&format!("{DYNAMIC}robust_to = 0.6\n")).unwrap_err().assert_say("robust_to");
    parse(&format!("{DYNAMIC}mode = \"on\"\n")).unwrap_err().assert_say("compensate");
}

#[test]
fn a_cell_does_not_lead_its_commands_and_measure_its_tool() {
    let both = format!("{MEASURED}[dynamic]\n");
    parse(&both).unwrap_err().assert_say("would interpret as an error");
    assert!(parse(&format!("{both}mode = \"off\"\n")).is_ok());
    assert!(parse(&both.replace("[measured]", "[measured]\nmode = \"off\"")).is_ok());
}

const FEED: &str = "schema = \"trued.cell/1\"\ncell = \"demo\"\nmodel = \"m.toml\"\n\
                    [wrench]\nsource = \"command\"\n[feed]\n";

#[test]
fn a_feed_is_only_watched_by_default_and_has_exactly_one_limit() {
    let feed = parse(&format!("{FEED}force_limit_N = 200\n")).unwrap().feed.expect("a feed");
    assert_eq!((feed.mode, feed.limit), (FeedMode::Observe, FeedLimit::Force(200.0)));
    assert_eq!((feed.floor, feed.lost, feed.air), (0.1, 0.1, 1.0));
    assert_eq!((feed.down_per_s, feed.up_per_s, feed.hold_s), (2.0, 0.2, 0.2));
    let feed = parse(&format!("{FEED}deflection_limit_mm = 0.1\n")).unwrap().feed.expect("a feed");
    assert_eq!(feed.limit, FeedLimit::Deflection(1e-4));
    parse(FEED).unwrap_err().assert_say("has no limit");
    let both = format!("{FEED}force_limit_N = 200\ndeflection_limit_mm = 0.1\n");
    parse(&both).unwrap_err().assert_say("has two limits");
    let air = |limit_n| format!("{FEED}force_limit_N = {limit_n}\nair_N = 200\n");
    parse(&air(200)).unwrap_err().assert_say("not below force_limit_N");
    assert!(parse(&air(201)).is_ok());
}

#[test]
fn a_feed_without_a_force_and_one_that_cannot_keep_its_floor_are_refused() {
    let feed = format!("{FEED}force_limit_N = 200\n");
    let without = feed.replace("source = \"command\"", "");
    parse(&without).unwrap_err().assert_say("needs a force");
    assert!(parse(&without.replace("[feed]", "[feed]\nmode = \"off\"")).is_ok());
    parse(&format!("{feed}floor_percent = 30\nlost_percent = 20\n"))
        .unwrap_err()
        .assert_say("below floor_percent");
    parse(&format!("{feed}time_constant_ms = 199\n")).unwrap_err().assert_say("200 or more");
    assert!(parse(&format!("{feed}time_constant_ms = 200\n")).is_ok());
    let slow = feed.replace("[feed]", "[cycle]\nperiod_ms = 50\nstale_ms = 200\n[feed]");
    parse(&slow).unwrap_err().assert_say("ms for a feed override");
}
