//! Reads a cell's configuration: all keys with ranges and defaults.

use glam::{DMat3, DVec3};
use std::ops::Bound;
use std::path::PathBuf;

use super::{
    CellConfig, CorrectionLimits, Cycle, Dynamic, DynamicMode, Envelope, Feed, FeedLimit, FeedMode,
    Force, Measured, MeasuredMode, Mode, Realtime, Recorder, SCHEMA, Task, Temperature, Vibration,
    WaitMode, Wrench, WrenchSource,
};
use crate::faults::Faults;
use crate::model::read::rotation;
use crate::series::CoordinateFrame;
use crate::toml_reader::{Document, POSITIVE, Table};

pub(super) fn parse(name: &str, text: &str) -> Result<CellConfig, Faults> {
    let document = Document::parse(name, text)?;
    let config = read(&document.root());
    document.finish(config)
}

fn read(root: &Table<'_, '_>) -> Option<CellConfig> {
    root.require("schema", "schema = \"trued.cell/1\"");
    root.require("cell", "a name: a-z, 0-9 and -");
    root.require("model", "the path of a model file");
    root.choice("schema", &[(SCHEMA, ())]);
    let cell = root.text("cell").filter(|cell| is_name(root, cell));
    let model = root.text("model").filter(|model| is_path(root, "model", model));
    let modes = [("shadow", Mode::Shadow), ("limited", Mode::Limited), ("full", Mode::Full)];
    let mode = root.choice("mode", &modes).unwrap_or_default();
    let mode_max = root.choice("mode_max", &modes).unwrap_or(mode);
    if mode_max < mode {
        root.fault("mode_max", "is below `mode`", "the start mode or one that corrects more");
    }
    let cycle = cycle(root.table("cycle").as_ref());
    let envelope = envelope(root.table("envelope").as_ref());
    let task = task(root.table("task").as_ref());
    let wrench = wrench(root.table("wrench").as_ref());
    let temperature = temperature(root.table("temperature").as_ref());
    let measured = root.table("measured").map(|table| measured(&table));
    let feed = root.table("feed").and_then(|table| feed(&table));
    let dynamic = root.table("dynamic").map(|table| dynamic(&table, cycle.period_s));
    check_together(
        root,
        cycle.period_s,
        &wrench,
        measured.as_ref(),
        feed.as_ref(),
        dynamic.as_ref(),
    );
    let force = root.table("force").map(|table| force(&table, &wrench));
    let vibration = root.table("vibration").map(|table| vibration(&table, force));
    let realtime = root.table("realtime").map(|table| realtime(&table)).unwrap_or_default();
    let recorder = root.table("recorder").map(|table| recorder(&table));
    if wrench.source == WrenchSource::Force && force.is_none() {
        root.fault("wrench", "uses the force stream", "a table [force] with its rate_Hz");
    }
    root.close();
    Some(CellConfig {
        cell: cell?.to_owned(),
        model: PathBuf::from(model?),
        mode,
        mode_max,
        cycle,
        envelope,
        task,
        wrench,
        temperature,
        measured,
        feed,
        dynamic,
        force,
        vibration: vibration.flatten(),
        realtime,
        recorder: recorder.flatten(),
    })
}

/// Reports tables that exclude or need one another.
fn check_together(
    root: &Table<'_, '_>,
    period_s: f64,
    wrench: &Wrench,
    measured: Option<&Measured>,
    feed: Option<&Feed>,
    dynamic: Option<&Dynamic>,
) {
    let is_trimmed = measured.is_some_and(|measured| measured.mode != MeasuredMode::Off);
    let is_fed = feed.is_some_and(|feed| feed.mode != FeedMode::Off);
    for (key, is_on, what) in [("measured", is_trimmed, "trim"), ("feed", is_fed, "feed override")]
    {
        if is_on && period_s > LATE_PERIOD_MAX_S {
            let ms = period_s * 1e3;
            let message = format!("needs shorter cycles than {ms} ms for a {what}");
            root.fault(key, message, "cycle.period_ms of 40 or less, or mode = \"off\"");
        }
    }
    let leads = dynamic.is_some_and(|dynamic| dynamic.mode != DynamicMode::Off);
    if leads && is_trimmed {
        // The trim compares a measurement with the target sent `reaction_ms` before; that delay would change with bypass, mode and envelope.
        let message =
            "compensates delay and lag, which the trim of [measured] would interpret as an error";
        root.fault("dynamic", message, "mode = \"off\" in [dynamic] or in [measured]");
    }
    if is_fed && wrench.source == WrenchSource::None {
        root.fault("feed", "needs a force, but the cell has none", "source in [wrench]");
    }
}

fn is_name(root: &Table<'_, '_>, cell: &str) -> bool {
    // As shm-schema: the name becomes part of file names of bounded length.
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    let good = (1..=24).contains(&cell.len()) && cell.chars().all(plain);
    if !good {
        root.fault("cell", format!("is \"{cell}\""), "1 to 24 of a-z, 0-9 and -");
    }
    good
}

fn is_path(table: &Table<'_, '_>, key: &str, path: &str) -> bool {
    let good = !path.is_empty() && !path.contains('\0');
    if !good {
        table.fault(key, "is not a path", "a path");
    }
    good
}

/// A number of an optional table, with its default; scaled to SI.
fn number(
    table: Option<&Table<'_, '_>>,
    key: &str,
    range: std::ops::RangeInclusive<f64>,
    default: f64,
) -> f64 {
    table.and_then(|table| table.number(key, range)).unwrap_or(default)
}

fn close(table: Option<&Table<'_, '_>>) {
    if let Some(table) = table {
        table.close();
    }
}

fn cycle(table: Option<&Table<'_, '_>>) -> Cycle {
    let waits = [("sleep", WaitMode::Sleep), ("spin", WaitMode::Spin)];
    let period_ms = number(table, "period_ms", 0.1..=100.0, 1.0);
    let stale_ms = number(table, "stale_ms", 0.1..=10_000.0, 10.0);
    let wait = table.and_then(|table| table.choice("wait", &waits)).unwrap_or_default();
    if let Some(table) = table.filter(|_| stale_ms <= period_ms) {
        let key = if table.has("stale_ms") { "stale_ms" } else { "period_ms" };
        let message =
            format!("makes every command stale ({stale_ms} ms with a period of {period_ms} ms)");
        table.fault(key, message, "stale_ms above period_ms");
    }
    close(table);
    Cycle { period_s: period_ms * 1e-3, stale_s: stale_ms * 1e-3, wait }
}

/// One value, or a list of one per joint, in thousandths of the SI unit.
fn bound(table: Option<&Table<'_, '_>>, key: &str, most: f64, default: f64) -> Vec<f64> {
    let range = (Bound::Excluded(0.0), Bound::Included(most));
    let values = table.filter(|table| table.has(key)).and_then(|table| {
        let is_list = table.raw(key).is_some_and(|value| value.get_ref().is_array());
        if is_list {
            table.numbers(key, range)
        } else {
            table.number(key, range).map(|one| vec![one])
        }
    });
    if let (Some(table), Some(0)) = (table, values.as_ref().map(Vec::len)) {
        table.fault(key, "is an empty list", "one value, or one per joint");
    }
    values.unwrap_or_else(|| vec![default]).into_iter().map(|value| value * 1e-3).collect()
}

fn envelope(table: Option<&Table<'_, '_>>) -> Envelope {
    let envelope = Envelope {
        revolute: CorrectionLimits {
            position: bound(table, "angle_mrad", 200.0, 20.0),
            rate: bound(table, "rate_mrad_s", 5000.0, 50.0),
            jerk: bound(table, "jerk_mrad_s3", 1e7, 5000.0),
        },
        prismatic: CorrectionLimits {
            position: bound(table, "travel_mm", 200.0, 20.0),
            rate: bound(table, "rate_mm_s", 5000.0, 50.0),
            jerk: bound(table, "jerk_mm_s3", 1e7, 5000.0),
        },
    };
    close(table);
    envelope
}

fn task(table: Option<&Table<'_, '_>>) -> Task {
    let free_tool_axis = table.and_then(|table| table.flag("free_tool_axis")).unwrap_or(false);
    let length_m = number(table, "length_m", 0.001..=10.0, 0.5);
    close(table);
    Task { free_tool_axis, length_m }
}

fn wrench(table: Option<&Table<'_, '_>>) -> Wrench {
    let sources = [
        ("force", WrenchSource::Force),
        ("command", WrenchSource::Command),
        ("none", WrenchSource::None),
    ];
    let frames = [("tool", CoordinateFrame::Tool), ("base", CoordinateFrame::Base)];
    let stiffness = table.and_then(|table| table.number("process_stiffness_N_per_um", POSITIVE));
    let wrench = Wrench {
        source: table.and_then(|table| table.choice("source", &sources)).unwrap_or_default(),
        low_pass_hz: number(table, "low_pass_Hz", 0.01..=100.0, 3.0),
        stale_s: number(table, "stale_ms", 1.0..=60_000.0, 100.0) * 1e-3,
        frame: table
            .and_then(|table| table.choice("frame", &frames))
            .unwrap_or(CoordinateFrame::Tool),
        process_stiffness_n_per_m: stiffness.map(|per_um| per_um * 1e6),
        loop_gain_max: number(table, "loop_gain_max", 0.01..=0.5, 0.5),
        use_faulty_channels: table
            .and_then(|table| table.flag("use_faulty_channels"))
            .unwrap_or(false),
    };
    close(table);
    wrench
}

/// Structures warm with time constants of minutes to hours: a temperature that is a minute old is
/// still valid.
const TEMPERATURE_STALE_S: f64 = 60.0;
/// A block has the time stamp of its first sample, so that a correct stamp lies in the past; a
/// clock that is synchronised externally deviates by less.
const AHEAD_MS: f64 = 5.0;
/// Without use of the wrench: longer than any buffer of a driver or of the transport holds at
/// normal load.
const LATE_MS: f64 = 1000.0;

fn temperature(table: Option<&Table<'_, '_>>) -> Temperature {
    let stale_s = number(table, "stale_s", 0.0..=86_400.0, TEMPERATURE_STALE_S);
    close(table);
    Temperature { stale_s: if stale_s == 0.0 { f64::INFINITY } else { stale_s } }
}

/// An industrial robot follows its commands by some cycles of its controller: 4 to 40 ms.
const REACTION_MS: f64 = 10.0;
/// More than the model's error changes within an interval on a path (including backlash at a
/// reversal), less than the millimetre by which a lost beam may return displaced.
const JUMP_MM: f64 = 0.3;
/// Longer than it takes to walk through the beam; the model's error hardly changes meanwhile.
const HOLD_MS: f64 = 500.0;
/// The residual error of a calibrated robot is some tenths of a millimetre; a larger one requires a
/// new calibration.
const LIMIT_MM: f64 = 1.0;
/// Shortest time constant in multiples of the stated delay: below it the gain margin at twice that
/// delay is less than 2 (`corrector/src/trim.rs`).
const DELAYS_LEAST: f64 = 2.0;
/// Longest cycle with a trim or a feed override, s: past values are interpolated between cycles,
/// and after 50 ms a pause is assumed.
const LATE_PERIOD_MAX_S: f64 = 0.04;

fn measured(table: &Table<'_, '_>) -> Measured {
    table.require("rate_Hz", "measurements per second");
    table.require("latency_ms", "the time from a measurement to its arrival");
    table.require("noise_mm", "the standard deviation of a measurement, of each axis");
    let modes = [
        ("off", MeasuredMode::Off),
        ("observe", MeasuredMode::Observe),
        ("trim", MeasuredMode::Trim),
    ];
    let vector = |key| if table.has(key) { table.vector::<3>(key) } else { None };
    let metres = |key| DVec3::from_array(vector(key).unwrap_or_default()) * 1e-3;
    let rows = if table.has("base_from_instrument") {
        rotation(table, "base_from_instrument")
    } else {
        None
    };
    let rotation =
        rows.map_or(DMat3::IDENTITY, |rows| DMat3::from_cols_array_2d(&rows).transpose());
    let or = |key, range, default: f64| table.number(key, range).unwrap_or(default);
    let mut measured = Measured {
        mode: table.choice("mode", &modes).unwrap_or_default(),
        base_from_instrument: physics::Frame::new(rotation, metres("instrument_mm")),
        point_in_tool_m: metres("point_mm"),
        interval_s: 1.0 / or("rate_Hz", 10.0..=1000.0, 100.0),
        latency_s: or("latency_ms", 0.0..=200.0, 0.0) * 1e-3,
        reaction_s: or("reaction_ms", 0.0..=200.0, REACTION_MS) * 1e-3,
        time_constant_s: None,
        noise_m: or("noise_mm", 1e-4..=10.0, 1.0) * 1e-3,
        jump_m: or("jump_mm", 0.01..=100.0, JUMP_MM) * 1e-3,
        hold_s: or("hold_ms", 0.0..=60_000.0, HOLD_MS) * 1e-3,
        limit_m: or("limit_mm", 0.01..=10.0, LIMIT_MM) * 1e-3,
        model_sigma_m: table.number("model_mm", 1e-3..=100.0).map(|mm| mm * 1e-3),
    };
    measured.time_constant_s = time_constant(table, &measured);
    table.close();
    measured
}

/// Rounded up to a tenth, so that the stated value is accepted.
fn tenth(ms: f64) -> f64 {
    // A difference below a nanosecond is due to the binary form of a decimal number.
    ((ms - 1e-6) * 10.0).ceil() / 10.0
}

fn time_constant(table: &Table<'_, '_>, measured: &Measured) -> Option<f64> {
    let time_constant_ms = table.number("time_constant_ms", 1.0..=60_000.0)?;
    let delay_s = measured.latency_s + measured.interval_s + measured.reaction_s;
    let least_ms = DELAYS_LEAST * delay_s * 1e3;
    if time_constant_ms < least_ms {
        let message = format!("is {time_constant_ms} with a delay of {} ms", tenth(delay_s * 1e3));
        let expected = format!(
            "{} or more: twice the sum of latency, interval and reaction, so that the gain margin stays above 2 at twice that delay",
            tenth(least_ms)
        );
        table.fault("time_constant_ms", message, expected);
    }
    Some(time_constant_ms * 1e-3)
}

/// Several times the first modes of industrial arms (5 to 20 Hz), and a sixth of the rate of a controller with 4 ms.
const BANDWIDTH_HZ: f64 = 40.0;
/// Variation of a delay or a natural frequency over an arm's workspace.
const ROBUST_TO: f64 = 0.3;
/// Commands per period of the bandwidth that the filter needs (`joint-dynamics/src/taps.rs`).
const COMMANDS_PER_PERIOD: f64 = 4.0;

fn dynamic(table: &Table<'_, '_>, period_s: f64) -> Dynamic {
    let modes = [("off", DynamicMode::Off), ("compensate", DynamicMode::Compensate)];
    let or = |key, range, default: f64| table.number(key, range).unwrap_or(default);
    let dynamic = Dynamic {
        mode: table.choice("mode", &modes).unwrap_or_default(),
        bandwidth_hz: or("bandwidth_Hz", 1.0..=100.0, BANDWIDTH_HZ),
        robust_to: or("robust_to", 0.0..=0.5, ROBUST_TO),
    };
    let highest_hz = 1.0 / (COMMANDS_PER_PERIOD * period_s);
    if dynamic.mode != DynamicMode::Off && dynamic.bandwidth_hz > highest_hz * (1.0 + 1e-9) {
        let message = format!(
            "is {} Hz with a command period of {} ms",
            dynamic.bandwidth_hz,
            period_s * 1e3
        );
        let expected = format!(
            "{} or less: four commands per period of the bandwidth",
            (highest_hz * 10.0).floor() / 10.0
        );
        table.fault("bandwidth_Hz", message, expected);
    }
    table.close();
    dynamic
}

/// The slowest feed at which a cutter of common geometry still cuts rather than rubs is about a
/// tenth of its nominal one.
const FLOOR_PERCENT: f64 = 10.0;
/// Above the noise and the drift of a force sensor on a flange (some newtons), below any cut that bends a robot.
const AIR_N: f64 = 5.0;
/// From the programmed feed to a tenth within half a second: the time in which path planners of
/// controllers follow an override.
const DOWN_PERCENT_S: f64 = 200.0;
/// A tenth of that: a cut that has become lighter for a moment hardly raises the feed.
const UP_PERCENT_S: f64 = 20.0;
/// An override takes effect after some of a controller's cycles and its smoothing of the path; the
/// resulting force arrives with the sensor's block and its transport.
const FEED_LATENCY_MS: f64 = 100.0;
/// A force beyond this share of the limit is not a ripple of the cut.
const RELIEF: f64 = 1.25;
/// Longer than one or two lost blocks, and a shorter distance than a cutter needs to reach another
/// depth.
const FEED_HOLD_MS: f64 = 200.0;
/// Shortest time constant in multiples of the latency: below it the gain margin at twice that
/// latency is less than 2 (`corrector/src/feed.rs`).
const FEED_DELAYS_LEAST: f64 = 2.0;

fn feed(table: &Table<'_, '_>) -> Option<Feed> {
    let modes =
        [("off", FeedMode::Off), ("observe", FeedMode::Observe), ("adapt", FeedMode::Adapt)];
    let or = |key, range, default: f64| table.number(key, range).unwrap_or(default);
    let mode = table.choice("mode", &modes).unwrap_or_default();
    let limit = feed_limit(table);
    let floor_percent = or("floor_percent", 1.0..=100.0, FLOOR_PERCENT);
    let above_floor = |key, default: f64| {
        let percent = or(key, 0.0..=100.0, default);
        if percent < floor_percent {
            let message = format!("is {percent}, below floor_percent = {floor_percent}");
            table.fault(key, message, "floor_percent to 100");
        }
        percent * 1e-2
    };
    let mut feed = Feed {
        mode,
        limit: FeedLimit::Force(f64::INFINITY),
        floor: floor_percent * 1e-2,
        lost: above_floor("lost_percent", floor_percent),
        air: above_floor("air_percent", 100.0),
        air_n: or("air_N", 0.0..=1e4, AIR_N),
        down_per_s: or("down_percent_s", 1.0..=1000.0, DOWN_PERCENT_S) * 1e-2,
        up_per_s: or("up_percent_s", 1.0..=1000.0, UP_PERCENT_S) * 1e-2,
        latency_s: or("latency_ms", 1.0..=500.0, FEED_LATENCY_MS) * 1e-3,
        time_constant_s: None,
        exponent: or("exponent", 0.3..=1.0, 1.0),
        relief: or("relief", 1.05..=10.0, RELIEF),
        hold_s: or("hold_ms", 0.0..=10_000.0, FEED_HOLD_MS) * 1e-3,
    };
    feed.time_constant_s = table.number("time_constant_ms", 1.0..=10_000.0).map(|ms| ms * 1e-3);
    if let Some(time_constant_s) = feed.time_constant_s
        && time_constant_s < FEED_DELAYS_LEAST * feed.latency_s
    {
        let message = format!("is {}", time_constant_s * 1e3);
        let least_ms = tenth(FEED_DELAYS_LEAST * feed.latency_s * 1e3);
        let expected = format!(
            "{least_ms} or more: twice latency_ms, so that the gain margin stays above 2 at twice that latency"
        );
        table.fault("time_constant_ms", message, expected);
    }
    if let Some(FeedLimit::Force(limit_n)) = limit
        && feed.air_n >= limit_n
    {
        let message = format!("is {}, not below force_limit_N = {limit_n}", feed.air_n);
        table.fault(
            "air_N",
            message,
            "a force below the limit (below air_N, the tool is not cutting)",
        );
    }
    table.close();
    Some(Feed { limit: limit?, ..feed })
}

/// Exactly one of the limits.
fn feed_limit(table: &Table<'_, '_>) -> Option<FeedLimit> {
    let force_n = table.number("force_limit_N", 1.0..=1e5);
    let deflection_mm = table.number("deflection_limit_mm", 1e-3..=10.0);
    match (table.has("force_limit_N"), table.has("deflection_limit_mm")) {
        (true, false) => force_n.map(FeedLimit::Force),
        (false, true) => deflection_mm.map(|mm| FeedLimit::Deflection(mm * 1e-3)),
        (both, _) => {
            let message = if both { "has two limits" } else { "has no limit" };
            table.fault_here(message, "either force_limit_N or deflection_limit_mm");
            None
        }
    }
}

fn force(table: &Table<'_, '_>, wrench: &Wrench) -> Force {
    table.require("rate_Hz", "samples per second");
    let rate_hz = table.number("rate_Hz", 10.0..=1e6).unwrap_or(1000.0);
    let channels = table.whole("channels", 3..7).and_then(|n| usize::try_from(n).ok());
    let full_scale = |key| table.number(key, POSITIVE).unwrap_or(f64::INFINITY);
    let (full_scale_n, full_scale_nm) = (full_scale("full_scale_N"), full_scale("full_scale_Nm"));
    let ahead_ms = table.number("ahead_ms", 0.0..=60_000.0).unwrap_or(AHEAD_MS);
    let is_used = wrench.source == WrenchSource::Force;
    // A block later than the age limit of a wrench is never used; the fault reports why.
    let late_default_ms = if is_used { wrench.stale_s * 1e3 } else { LATE_MS };
    let late_ms = table.number("late_ms", 1.0..=3.6e6).unwrap_or(late_default_ms);
    table.close();
    Force {
        rate_hz,
        channels: channels.unwrap_or(6),
        full_scale_n,
        full_scale_nm,
        ahead_s: ahead_ms * 1e-3,
        late_s: late_ms * 1e-3,
    }
}

fn vibration(table: &Table<'_, '_>, force: Option<Force>) -> Option<Vibration> {
    let enabled = table.flag("enabled").unwrap_or(true);
    let nyquist = force.map_or(f64::INFINITY, |force| force.rate_hz / 2.0);
    let band = if table.has("band_Hz") { table.vector::<2>("band_Hz") } else { None };
    let [low, high] = band.unwrap_or([5.0, nyquist.min(2000.0)]);
    if !(0.0 < low && low < high && high <= nyquist) {
        let expected = match force {
            Some(_) => format!("[lowest, highest], up to half the force rate ({nyquist} Hz)"),
            None => "[lowest, highest], both above zero".to_owned(),
        };
        table.fault("band_Hz", format!("is [{low}, {high}]"), expected);
    }
    let teeth = table.whole("teeth", 1..1000).and_then(|teeth| u32::try_from(teeth).ok());
    let vibration = Vibration {
        band_hz: (low, high),
        least_amplitude_n: table.number("least_amplitude_N", 0.0..).unwrap_or(0.5),
        least_amplitude_nm: table.number("least_amplitude_Nm", 0.0..).unwrap_or(0.05),
        threshold: table.number("threshold", 0.25..=10.0).unwrap_or(1.0),
        spindle_rpm: table.number("spindle_rpm", POSITIVE),
        teeth,
    };
    if enabled && force.is_none() {
        table.fault_here("needs the force stream, but the cell has none", "add a table [force]");
    }
    table.close();
    enabled.then_some(vibration)
}

fn realtime(table: &Table<'_, '_>) -> Realtime {
    let fifo = table.choice("policy", &[("other", false), ("fifo", true)]).unwrap_or_default();
    let priority = table.whole("priority", 1..100).and_then(|number| u8::try_from(number).ok());
    if priority.is_some() && !fifo {
        table.fault(
            "priority",
            "is given, but the policy has no priority",
            "policy = \"fifo\" as well",
        );
    }
    let realtime = Realtime {
        fifo_priority: fifo.then(|| priority.unwrap_or(80)),
        core: table.whole("core", 0..4096).and_then(|core| usize::try_from(core).ok()),
        lock_memory: table.flag("lock_memory").unwrap_or(fifo),
        enforce: table.flag("enforce").unwrap_or(false),
    };
    table.close();
    realtime
}

fn recorder(table: &Table<'_, '_>) -> Option<Recorder> {
    table.require("dir", "a folder for the recordings");
    let dir = table.text("dir").filter(|dir| is_path(table, "dir", dir));
    let max_mb = table.number("max_file_MB", 1.0..=100_000.0).unwrap_or(256.0);
    let keep = table.whole("keep_files", 1..100_000).and_then(|n| usize::try_from(n).ok());
    let starts_recording = table.flag("start").unwrap_or(true);
    let keeps_alarms = table.flag("keep_alarms").unwrap_or(true);
    let kept = table.whole("kept_files_max", 0..100_000).and_then(|n| usize::try_from(n).ok());
    table.close();
    Some(Recorder {
        dir: PathBuf::from(dir?),
        max_file_bytes: (max_mb * 1e6) as u64,
        keep_files: keep.unwrap_or(20),
        starts_recording,
        keeps_alarms,
        kept_files_max: kept.unwrap_or(20),
    })
}
