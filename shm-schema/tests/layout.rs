//! Every byte that both sides share, pinned: a change here is a change of the contract.

use core::mem::{align_of, offset_of, size_of};

use shm_schema::*;

macro_rules! pinned {
    ($payload:ident: $size:literal bytes, hash $hash:literal, $($field:ident at $offset:literal),* $(,)?) => {
        assert_eq!(size_of::<$payload>(), $size, "size of {}", $payload::NAME);
        assert_eq!(align_of::<$payload>(), 8);
        $(assert_eq!(offset_of!($payload, $field), $offset, "{}.{}", $payload::NAME, stringify!($field));)*
        assert_eq!($payload::LAYOUT_HASH, $hash, "hash of {}: {:#018x}", $payload::NAME, $payload::LAYOUT_HASH);
        assert_eq!($payload::default().layout, $payload::LAYOUT);
    };
}

#[test]
fn the_layout_of_status_stands() {
    pinned!(Status: 2408 bytes, hash 0xebb3_3ae6_3752_2a69,
        seq at 0, t_ns at 8, started_ns at 16, model_epoch at 24, model_hash at 32,
        geometry_hash at 40, cycles at 48, missed_cycles at 56, commands at 64, rejected
        at 72, held at 80, stale at 88, commands_lost at 96, corrected_lost at 104,
        force_blocks at 112, force_gaps at 120, force_refused at 128, malformed at 136,
        recorder_dropped at 144, latency_p50_ns at 152, latency_p99_ns at 160,
        latency_p999_ns at 168, latency_max_ns at 176, wrench_loop_gain at 184,
        spindle_rpm at 192, feed_mm_s at 200, model_broken_since_ns at 208,
        model_measurements at 216, model_residual_m at 224, layout at 232, pid at 236,
        health at 240, mode at 244, bypassed at 248, joints at 252, wrench_gate at 256,
        recorder at 260, watch at 264, uncompensated_effects at 268, in_cut at 272,
        stream_faults at 276, channel_faults at 280, verdict at 304,
        stale_temperatures at 464, reserved at 468, trim_state at 472, trim_reason at 476, trim_m at 480,
        trim_found_m at 504, trim_measurements at 528, trim_refused at 536,
        feed_state at 544, feed_reason at 548, feed_override at 552, feed_wanted at 560, feed_force_n at
        568, feed_programmed_force_n at 576, feed_limit_n at 584, feed_speed_m_s at 592, feed_refused
        at 600, feed_bounds at 608, lead_state at 648, horizon_points at 652, horizon_points_used at 656,
        horizons_refused at 660, latency_sum_ns at 664, latency_counts at 672, bounds at 808,
        q_command at 1448, correction at 1576, robot_maker at 1704, robot_type at 1768,
        robot_serial at 1832, message at 1896);
}

#[test]
fn the_layout_of_command_stands() {
    pinned!(Command: 384 bytes, hash 0x28f9_4d6f_2b01_8dba,
        seq at 0, session at 8, t_ns at 16, sent_ns at 24, layout at 32, joints at 36,
        flags at 40, direction at 44, reserved at 60, q at 64, wrench at 192,
        temperature_c at 240, feed_override at 376);
}

#[test]
fn the_layout_of_corrected_stands() {
    pinned!(Corrected: 616 bytes, hash 0x729d_afdc_02a1_7424,
        seq at 0, command_seq at 8, command_session at 16, t_ns at 24, received_ns at 32,
        made_ns at 40, model_epoch at 48, layout at 56, joints at 60, status at 64, reason
        at 68, wrench_gate at 72, iterations at 76, correction at 80,
        correction_rate at 208, correction_acceleration at 336, wanted at 464, residual_m
        at 592, residual_rad at 600, feed_override at 608);
}

#[test]
fn the_layout_of_force_block_stands() {
    pinned!(ForceBlock: 24640 bytes, hash 0xe90a_5ac8_6231_feaa,
        seq at 0, session at 8, t_ns at 16, sent_ns at 24, samples_before at 32, rate_hz
        at 40, layout at 48, channels at 52, samples at 56, flags at 60, data at 64);
}

#[test]
fn the_layout_of_robot_state_stands() {
    pinned!(RobotState: 440 bytes, hash 0x0388_c646_985f_19e8,
        seq at 0, session at 8, t_ns at 16, sent_ns at 24, layout at 32, joints at 36,
        flags at 40, reserved at 44, q_measured at 48, tau at 176, temperature_c at 304);
}

#[test]
fn the_layout_of_horizon_stands() {
    assert_eq!(Horizon::POINTS_MAX, 128);
    pinned!(Horizon: 16424 bytes, hash 0xefe3_eeb3_bf25_7a1f,
        seq at 0, session at 8, command_seq at 16, sent_ns at 24, layout at 32, count at 36, points at 40);
}

#[test]
fn the_layout_of_measured_point_stands() {
    pinned!(MeasuredPoint: 64 bytes, hash 0x9c89_975a_d906_a735,
        seq at 0, session at 8, t_ns at 16, sent_ns at 24, layout at 32, flags at 36, point_m at 40);
}

#[test]
fn the_layout_of_verdict_stands() {
    pinned!(Verdict: 160 bytes, hash 0xc80c_4c44_19f0_1a89,
        seq at 0, t_ns at 8, made_ns at 16, event at 24, frequency_hz at 32, amplitude
        at 40, advice_rpm at 48, growth_per_s at 56, nearest_mode_hz at 64,
        mode_distance_hz at 72, nearest_harmonic_hz at 80, harmonic_distance_hz at 88,
        nearest_alias_hz at 96, alias_distance_hz at 104, layout at 112, state at 116,
        class at 120, rivals at 124, axis at 128, suspect_alias at 132, advice at 136,
        sensor_faults at 140, advice_lobe at 144, gear_joint at 148, gear_shaft at
        152, reserved at 156);
}

#[test]
fn the_layout_of_spectrum_stands() {
    assert_eq!(SPECTRUM_BINS_MAX, 256);
    pinned!(Spectrum: 2104 bytes, hash 0xe4d0_e8cc_a7d5_d94d,
        seq at 0, t_ns at 8, made_ns at 16, window_s at 24, first_hz at 32, bin_hz at 40, layout at 48,
        bins at 52, amplitude_n at 56);
}

#[test]
fn a_spectrum_is_read_only_where_its_bins_can_be() {
    let mut spectrum = Spectrum { bins: 3, first_hz: 10.0, bin_hz: 5.0, ..Spectrum::default() };
    assert_eq!(spectrum.check(), Ok(()));
    assert_eq!((spectrum.amplitudes_n().len(), spectrum.frequency_hz(2)), (3, 20.0));
    for bins in [0, 257, u32::MAX] {
        spectrum.bins = bins;
        assert_eq!(spectrum.check().unwrap_err().field, "bins");
        assert!(spectrum.amplitudes_n().len() <= SPECTRUM_BINS_MAX);
    }
}

#[test]
fn the_layout_of_request_stands() {
    pinned!(Request: 512 bytes, hash 0x2ecb_a7f9_e68f_2291,
        seq at 0, session at 8, t_ns at 16, spindle_rpm at 24, feed_mm_s at 32, sigma_m
        at 40, ambient_c at 48, point_m at 56, q at 80, layout at 208, operation at 212,
        on at 216, teeth at 220, in_cut at 224, holds_ms at 228, joints at 232, other_robot at 236, direction
        at 240, path at 256);
}

#[test]
fn the_layout_of_response_stands() {
    pinned!(Response: 288 bytes, hash 0xfa92_7c40_7e4a_1e91,
        seq at 0, session at 8, t_ns at 16, layout at 24, answer at 28, message at 32);
}

#[test]
fn the_bounds_inside_a_status_stand() {
    assert_eq!(size_of::<JointBounds>(), 640);
    assert_eq!(offset_of!(JointBounds, min), 0);
    assert_eq!(offset_of!(JointBounds, max), 128);
    assert_eq!(offset_of!(JointBounds, angle), 256);
    assert_eq!(offset_of!(JointBounds, rate), 384);
    assert_eq!(offset_of!(JointBounds, jerk), 512);
}

#[test]
fn the_bounds_of_the_feed_inside_a_status_stand() {
    assert_eq!(size_of::<FeedBounds>(), 40);
    assert_eq!(offset_of!(FeedBounds, floor), 0);
    assert_eq!(offset_of!(FeedBounds, lost), 8);
    assert_eq!(offset_of!(FeedBounds, down_per_s), 16);
    assert_eq!(offset_of!(FeedBounds, up_per_s), 24);
    assert_eq!(offset_of!(FeedBounds, hold_s), 32);
}

#[test]
fn a_message_is_read_from_bytes_in_the_order_of_its_offsets() {
    let mut bytes = vec![0; size_of::<Command>()];
    bytes[36..40].copy_from_slice(&6_u32.to_ne_bytes());
    bytes[44] = 0xff;
    bytes[64 + 8..64 + 16].copy_from_slice(&0.5_f64.to_ne_bytes());
    let command = Command::from_bytes(&bytes).unwrap();
    assert_eq!((command.joints, command.direction[0], command.q[1]), (6, -1, 0.5));
    assert!(command.check().is_err(), "layout version 0");
    assert!(Command::from_bytes(&bytes[1..]).is_none());
    bytes.push(0);
    assert!(Command::from_bytes(&bytes).is_none());
}

#[test]
fn a_horizon_is_read_only_where_its_count_can_be_and_its_points_are_numbers() {
    let mut horizon = Horizon { count: 2, ..Horizon::default() };
    horizon.points[2][0] = f64::NAN;
    assert_eq!(horizon.check(), Ok(()), "a point that is not set");
    horizon.points[1][JOINTS_MAX - 1] = f64::INFINITY;
    assert!(horizon.check().unwrap_err().field.starts_with("points"));
    horizon.count = Horizon::POINTS_MAX as u32 + 1;
    assert_eq!(horizon.check().unwrap_err().field, "count");
    assert_eq!(horizon.points().len(), Horizon::POINTS_MAX);
    assert!(Horizon { layout: 2, ..Horizon::default() }.check().is_err());
    assert_eq!(Horizon::default().check(), Ok(()), "an empty one");
}

#[test]
fn a_horizon_is_copied_without_the_points_that_are_not_set() {
    let mut sent = Horizon { seq: 7, session: 8, command_seq: 9, count: 2, ..Horizon::default() };
    sent.points[..3].fill([1.0; JOINTS_MAX]);
    let mut copy = Horizon::default();
    copy.points[2] = [5.0; JOINTS_MAX];
    sent.copy_into(&mut copy);
    assert_eq!((copy.points(), copy.points[2]), (sent.points(), [5.0; JOINTS_MAX]));
    copy.points = sent.points;
    assert_eq!(copy, sent);
    sent.count = u32::MAX;
    sent.copy_into(&mut copy);
    assert_eq!((copy.count, copy.points == sent.points), (u32::MAX, true));
}

#[test]
fn the_contract_stands() {
    assert_eq!(CONTRACT_VERSION, 7);
    assert_eq!(CONTRACT_HASH, 0xae3d_2452_67fe_44ac, "{CONTRACT_HASH:#018x}");
}
