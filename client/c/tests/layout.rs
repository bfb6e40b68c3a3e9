//! The structs of `trued.h`, byte for byte, as Rust and a C compiler see them: a change here is another `.so`.
//!
//! Only additions at the end are allowed, and then a size here grows.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![expect(unsafe_code, reason = "a text of C is read")]

use core::mem::{offset_of, size_of};
use std::fmt::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use shm_schema as shm;
use trued_client_c::*;

/// Checks a struct, and writes down the same for the C compiler.
macro_rules! pinned {
    ($all:expr, $name:ident: $size:literal bytes, $($field:ident at $offset:literal),*) => {
        assert_eq!(size_of::<$name>(), $size, "size of {}", stringify!($name));
        let all: &mut String = $all;
        writeln!(all, "_Static_assert(sizeof({}) == {}, \"\");", stringify!($name), $size).unwrap();
        $(
            let (name, field) = (stringify!($name), stringify!($field));
            assert_eq!(offset_of!($name, $field), $offset, "{name}.{field}");
            writeln!(all, "_Static_assert(offsetof({name}, {field}) == {}, \"\");", $offset).unwrap();
        )*
    };
}

#[test]
fn every_struct_keeps_its_size_and_offsets_in_rust_and_in_c() {
    let mut all = "#include <stddef.h>\n#include <trued.h>\n".to_owned();
    pinned!(&mut all, trued_setpoint: 352 bytes, struct_size at 0, joints at 4, flags at 8,
        reserved at 12, t_ns at 16, q at 24, wrench at 152, temperature_c at 200, direction at
        336);
    pinned!(&mut all, trued_robot_state: 416 bytes, struct_size at 0, joints at 4, flags at 8,
        reserved at 12, t_ns at 16, q_measured at 24, tau at 152, temperature_c at 280);
    pinned!(&mut all, trued_target: 152 bytes, struct_size at 0, joints at 4, source at 8,
        reserved at 12, q at 16, feed_override at 144);
    pinned!(&mut all, trued_corrected: 608 bytes, struct_size at 0, joints at 4, status at 8,
        reason at 12, wrench_gate at 16, iterations at 20, seq at 24, command_seq at 32, t_ns at
        40, received_ns at 48, made_ns at 56, model_epoch at 64, correction at 72,
        correction_rate at 200, correction_acceleration at 328, wanted at 456, residual_m at 584,
        residual_rad at 592, feed_override at 600);
    pinned!(&mut all, trued_status: 2240 bytes, struct_size at 0, pid at 4, seq at 8, t_ns at
        16, started_ns at 24, model_epoch at 32, model_hash at 40, cycles at 48, missed_cycles
        at 56, commands at 64, rejected at 72, held at 80, stale at 88, commands_lost at 96,
        corrected_lost at 104, force_blocks at 112, force_gaps at 120, force_refused at 128,
        malformed at 136, recorder_dropped at 144, latency_p50_ns at 152, latency_p99_ns at 160,
        latency_p999_ns at 168, latency_max_ns at 176, model_broken_since_ns at 184,
        model_measurements at 192, model_residual_m at 200, wrench_loop_gain at 208, spindle_rpm
        at 216, feed_mm_s at 224, health at 232, mode at 236, bypassed at 240, joints at 244,
        wrench_gate at 248, recorder at 252, watch at 256, in_cut at 260, uncompensated_effects
        at 264, stream_faults at 268, channel_faults at 272, q_min at 296, q_max at 424,
        correction_max at 552, correction_rate_max at 680, correction_jerk_max at 808, message
        at 936, geometry_hash at 1456, stale_temperatures at 1464, reserved at 1468, robot_maker at
        1472, robot_type at 1544, robot_serial at 1616, q_command at 1688,
        correction at 1816, trim_state at 1944, trim_reason at 1948, trim_m at 1952, trim_found_m
        at 1976, trim_measurements at 2000, trim_refused at 2008, feed_state at 2016, feed_reason
        at 2020, feed_override at 2024, feed_wanted at 2032, feed_force_n at 2040,
        feed_programmed_force_n at 2048, feed_limit_n at 2056, feed_speed_m_s at 2064, feed_refused
        at 2072, latency_sum_ns at 2080, latency_counts at 2088,
        lead_state at 2224, horizon_points at 2228, horizon_points_used at 2232, horizons_refused
        at 2236);
    pinned!(&mut all, trued_vibration: 680 bytes, struct_size at 0, state at 4, kind at 8,
        rivals at 12, axis at 16, suspect_alias at 20, advice at 24, sensor_faults at 28,
        advice_lobe at 32, gear_joint at 36, gear_shaft at 40, reserved at 44, seq at 48, t_ns
        at 56, made_ns at 64, event at 72, frequency_hz at 80, amplitude at 88, growth_per_s at
        96, advice_rpm at 104, nearest_mode_hz at 112, mode_distance_hz at 120,
        nearest_harmonic_hz at 128, harmonic_distance_hz at 136, nearest_alias_hz at 144,
        alias_distance_hz at 152, sentence at 160);
    pinned!(&mut all, trued_connection: 544 bytes, struct_size at 0, is_connected at 4, pid at
        8, why at 12, epoch at 16, words at 24);
    pinned!(&mut all, trued_answer: 536 bytes, struct_size at 0, answer at 4, t_ns at 8, message
        at 16);
    pinned!(&mut all, trued_process: 40 bytes, struct_size at 0, teeth at 4, in_cut at 8,
        reserved at 12, holds_ns at 16, spindle_rpm at 24, feed_mm_s at 32);
    pinned!(&mut all, trued_measured: 192 bytes, struct_size at 0, joints at 4, q at 8, point_m
        at 136, sigma_m at 160, ambient_c at 168, direction at 176);
    pinned!(&mut all, trued_force_samples: 48 bytes, struct_size at 0, channels at 4, count at
        8, in_base at 12, t_ns at 16, rate_hz at 24, doubles at 32, floats at 40);
    compiles(&all);
}

/// The committed header through a C compiler.
fn compiles(text: &str) {
    let include = Path::new(env!("CARGO_MANIFEST_DIR")).join("include");
    let mut compiler = Command::new("cc")
        .args(["-std=c11", "-fsyntax-only", "-x", "c", "-I"])
        .arg(include)
        .arg("-")
        .stdin(Stdio::piped())
        .spawn()
        .unwrap();
    std::io::Write::write_all(&mut compiler.stdin.take().unwrap(), text.as_bytes()).unwrap();
    assert!(compiler.wait().unwrap().success(), "the C compiler sees another layout");
}

/// Every code of a list under its name in C, with its number.
macro_rules! listed {
    ($($list:ident $c:literal),* $(,)?) => {{
        let mut all = Vec::new();
        $(all.extend(shm::$list::ALL.iter().map(|code| {
            (format!("TRUED_{}_{}", $c, code.name().to_uppercase()), code.code())
        }));)*
        all
    }};
}

#[test]
fn the_lists_have_the_numbers_of_the_messages() {
    let header = include_str!("../include/trued.h");
    let all = listed!(
        CorrectionStatus "CORRECTION_STATUS", Reason "REASON", WrenchGate "WRENCH_GATE",
        Health "HEALTH", Mode "MODE", WatchState "WATCH_STATE", RecorderState "RECORDER_STATE", RecorderAction "RECORDER_ACTION",
        TrimState "TRIM_STATE", TrimReason "TRIM_REASON", FeedState "FEED_STATE", FeedReason "FEED_REASON", LeadState "LEAD_STATE",
        VibrationState "VIBRATION_STATE", VibrationClass "VIBRATION_CLASS", Advice "ADVICE",
        SensorFault "SENSOR_FAULT", InCut "IN_CUT", Answer "ANSWER_CODE",
    );
    for (name, number) in &all {
        let line = format!("{name} = {number},");
        assert!(header.lines().any(|l| l.trim() == line), "not in trued.h: {line}");
    }
    // None too many either: every list's entries are counted.
    let lists = ["TRUED_SOURCE_", "TRUED_ERROR_", "TRUED_OK", "TRUED_NOTHING"];
    let entries = header
        .lines()
        .map(str::trim)
        .filter(|line| line.starts_with("TRUED_") && line.contains(" = ") && line.ends_with(','));
    let count = entries.filter(|line| !lists.iter().any(|list| line.starts_with(list))).count();
    assert_eq!(count, all.len());
}

#[test]
fn every_code_of_the_header_is_known_by_name() {
    let header = include_str!("../include/trued.h");
    let mut found = 0;
    for line in header.lines().map(str::trim) {
        let Some((name, number)) = line.trim_end_matches(',').split_once(" = ") else { continue };
        if !name.starts_with("TRUED_ERROR_") && name != "TRUED_OK" && name != "TRUED_NOTHING" {
            continue;
        }
        let known = trued_code_name(number.parse().unwrap());
        // SAFETY: the function's own promise: a text that ends with zero and stays.
        let known = unsafe { std::ffi::CStr::from_ptr(known) };
        assert_eq!(known.to_str(), Ok(name));
        found += 1;
    }
    assert!(found > 20, "{found} codes in the header");
}
