//! `trued.cell/1`: the configuration of a cell.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

/// Configuration of a cell, `trued.cell/1` (docs/reference/cell.md). Relative paths count from the folder of this file.
#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Cell {
    /// Name and version of the format.
    #[schemars(extend("const" = "trued.cell/1"))]
    schema: String,
    /// Name of the cell, part of the names of its services.
    #[schemars(regex(pattern = "^[a-z0-9-]{1,24}$"))]
    cell: String,
    /// The model file, or the name of a preset.
    #[schemars(length(min = 1))]
    model: String,
    /// Mode after a start. `shadow`: computed and recorded, the command is sent unchanged;
    /// `limited`: within a tenth of the envelope; `full`.
    #[schemars(extend("default" = "shadow"))]
    mode: Option<Mode>,
    /// Highest mode that can be requested at run time; default: as `mode`.
    mode_max: Option<Mode>,
    /// Timing of the commands.
    cycle: Option<Cycle>,
    /// Limits of the correction.
    envelope: Option<Envelope>,
    /// What the task needs of the tool.
    task: Option<Task>,
    /// Source and filtering of the wrench.
    wrench: Option<Wrench>,
    /// How long temperatures are valid.
    temperature: Option<Temperature>,
    /// The instrument that measures the tool.
    measured: Option<Measured>,
    /// How the feed is adapted to the force; needs a `source` in `[wrench]`.
    feed: Option<Feed>,
    /// Compensation of delay, lags and modes of the joints.
    dynamic: Option<Dynamic>,
    /// The force stream.
    force: Option<Force>,
    /// The vibration monitor; needs `[force]`.
    vibration: Option<Vibration>,
    /// Scheduling of the cycle thread.
    realtime: Option<Realtime>,
    /// Recording; without this table nothing is recorded.
    recorder: Option<Recorder>,
}

#[derive(JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Mode {
    Shadow,
    Limited,
    Full,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Cycle {
    /// Time between commands, ms.
    #[schemars(range(min = 0.1, max = 100.0), extend("default" = 1.0))]
    period_ms: Option<f64>,
    /// Age from which a command is stale, ms; above the period.
    #[schemars(range(min = 0.1, max = 10_000.0), extend("default" = 10.0))]
    stale_ms: Option<f64>,
    /// How the thread waits: `sleep`, or `spin` on an isolated core.
    #[schemars(extend("default" = "sleep"))]
    wait: Option<Wait>,
}

#[derive(JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Wait {
    Sleep,
    Spin,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Envelope {
    /// Largest correction of a revolute joint, mrad: one value, or one per joint.
    #[schemars(schema_with = "bound::<200>", extend("default" = 20.0))]
    #[serde(default)]
    angle_mrad: Option<f64>,
    /// Largest rate of the correction of a revolute joint, mrad/s: one value, or one per joint.
    #[schemars(schema_with = "bound::<5000>", extend("default" = 50.0))]
    #[serde(default)]
    rate_mrad_s: Option<f64>,
    /// Largest jerk of the correction of a revolute joint, mrad/s³: one value, or one per joint.
    #[schemars(schema_with = "bound::<10_000_000>", extend("default" = 5000.0))]
    #[serde(default)]
    jerk_mrad_s3: Option<f64>,
    /// Largest correction of a prismatic joint, mm: one value, or one per joint.
    #[schemars(schema_with = "bound::<200>", extend("default" = 20.0))]
    #[serde(default)]
    travel_mm: Option<f64>,
    /// Largest rate of the correction of a prismatic joint, mm/s: one value, or one per joint.
    #[schemars(schema_with = "bound::<5000>", extend("default" = 50.0))]
    #[serde(default)]
    rate_mm_s: Option<f64>,
    /// Largest jerk of the correction of a prismatic joint, mm/s³: one value, or one per joint.
    #[schemars(schema_with = "bound::<10_000_000>", extend("default" = 5000.0))]
    #[serde(default)]
    jerk_mm_s3: Option<f64>,
}

/// One value above zero, or one per joint.
fn bound<const MAX: u32>(_: &mut SchemaGenerator) -> Schema {
    let one = json_schema!({ "type": "number", "exclusiveMinimum": 0, "maximum": MAX });
    json_schema!({ "anyOf": [one, { "type": "array", "items": one, "minItems": 1 }] })
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Task {
    /// The tool may turn about its own z axis.
    #[schemars(extend("default" = false))]
    free_tool_axis: Option<bool>,
    /// Distance from the TCP at which an angle counts as a displacement where both are weighed, m.
    #[schemars(range(min = 0.001, max = 10.0), extend("default" = 0.5))]
    length_m: Option<f64>,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Wrench {
    /// `force`: the force stream; `command`: the command carries it; `none`.
    #[schemars(extend("default" = "none"))]
    source: Option<WrenchSource>,
    /// Axes of the wrench.
    #[schemars(extend("default" = "tool"))]
    frame: Option<Frame>,
    /// Corner frequency of the low-pass filter of the wrench, Hz.
    #[schemars(range(min = 0.01, max = 100.0), extend("default" = 3.0))]
    low_pass_Hz: Option<f64>,
    /// Age from which a wrench is ramped to zero, ms.
    #[schemars(range(min = 1.0, max = 60_000.0), extend("default" = 100.0))]
    stale_ms: Option<f64>,
    /// Stiffness of the process, N/µm, for the loop gain; default: estimated.
    #[schemars(extend("exclusiveMinimum" = 0))]
    process_stiffness_N_per_um: Option<f64>,
    /// Largest loop gain of the force compensation.
    #[schemars(range(min = 0.01, max = 0.5), extend("default" = 0.5))]
    loop_gain_max: Option<f64>,
    /// Continue with a wrench of which a channel is stuck or saturated; otherwise the gate closes.
    #[schemars(extend("default" = false))]
    use_faulty_channels: Option<bool>,
}

#[derive(JsonSchema)]
#[serde(rename_all = "lowercase")]
enum WrenchSource {
    Force,
    Command,
    None,
}

#[derive(JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(super) enum Frame {
    Tool,
    Base,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Temperature {
    /// Age from which a temperature counts as unknown, s; 0: never.
    #[schemars(range(min = 0.0, max = 86_400.0), extend("default" = 60.0))]
    stale_s: Option<f64>,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Measured {
    /// `off`: measurements are not read; `observe`: the model's error is estimated and reported; `trim`: it is also corrected.
    #[schemars(extend("default" = "observe"))]
    mode: Option<MeasuredMode>,
    /// Measurements per second.
    #[schemars(range(min = 10.0, max = 1000.0))]
    rate_Hz: f64,
    /// From a measurement to its arrival, ms.
    #[schemars(range(min = 0.0, max = 200.0))]
    latency_ms: f64,
    /// From a command to the motion of the tool, ms.
    #[schemars(range(min = 0.0, max = 200.0), extend("default" = 10.0))]
    reaction_ms: Option<f64>,
    /// Standard deviation of a measurement per axis, mm.
    #[schemars(range(min = 1e-4, max = 10.0))]
    noise_mm: f64,
    /// Rows of the rotation from the instrument's axes to base axes; default: identity.
    base_from_instrument: Option<[[f64; 3]; 3]>,
    /// The instrument's origin, base frame, mm.
    #[schemars(extend("default" = [0.0, 0.0, 0.0]))]
    instrument_mm: Option<[f64; 3]>,
    /// The measured point in tool coordinates, mm.
    #[schemars(extend("default" = [0.0, 0.0, 0.0]))]
    point_mm: Option<[f64; 3]>,
    /// Time constant of the trim, ms; at least twice the sum of latency, interval and reaction. Default: five times that sum.
    #[schemars(range(min = 1.0, max = 60_000.0))]
    time_constant_ms: Option<f64>,
    /// A larger change of the model's error from one measurement to the next is a jump of the instrument, mm.
    #[schemars(range(min = 0.01, max = 100.0), extend("default" = 0.3))]
    jump_mm: Option<f64>,
    /// How long the trim is held without measurements, ms; then it is ramped to zero.
    #[schemars(range(min = 0.0, max = 60_000.0), extend("default" = 500.0))]
    hold_ms: Option<f64>,
    /// The largest trim, mm.
    #[schemars(range(min = 0.01, max = 10.0), extend("default" = 1.0))]
    limit_mm: Option<f64>,
    /// Standard uncertainty of the model per axis, mm; with it, the daemon monitors the estimated error for ageing of the model.
    #[schemars(range(min = 0.001, max = 100.0))]
    model_mm: Option<f64>,
}

#[derive(JsonSchema)]
#[serde(rename_all = "lowercase")]
enum MeasuredMode {
    Off,
    Observe,
    Trim,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{ "required": ["force_limit_N"] }, { "required": ["deflection_limit_mm"] }]))]
struct Feed {
    /// `off`: nothing; `observe`: the override is computed and reported, the programmed feed is
    /// used; `adapt`: the override is sent.
    #[schemars(extend("default" = "observe"))]
    mode: Option<FeedMode>,
    /// The process force that is kept, N; this or `deflection_limit_mm`.
    #[schemars(range(min = 1.0, max = 1e5))]
    force_limit_N: Option<f64>,
    /// The deflection of the tool by the model that is kept, mm; this or `force_limit_N`.
    #[schemars(range(min = 0.001, max = 10.0))]
    deflection_limit_mm: Option<f64>,
    /// The least override, percent of the programmed feed.
    #[schemars(range(min = 1.0, max = 100.0), extend("default" = 10.0))]
    floor_percent: Option<f64>,
    /// The override if no force is known, percent; at least `floor_percent`. Default:
    /// `floor_percent`.
    #[schemars(range(min = 0.0, max = 100.0))]
    lost_percent: Option<f64>,
    /// The largest override in the air, percent; from `floor_percent` on.
    #[schemars(range(min = 0.0, max = 100.0), extend("default" = 100.0))]
    air_percent: Option<f64>,
    /// A smaller force is none: the tool is in the air, N.
    #[schemars(range(min = 0.0, max = 1e4), extend("default" = 5.0))]
    air_N: Option<f64>,
    /// How fast the override may fall, percent per second.
    #[schemars(range(min = 1.0, max = 1000.0), extend("default" = 200.0))]
    down_percent_s: Option<f64>,
    /// How fast it may rise, percent per second.
    #[schemars(range(min = 1.0, max = 1000.0), extend("default" = 20.0))]
    up_percent_s: Option<f64>,
    /// Delay from an override to the arrival of the resulting force at the daemon, ms.
    #[schemars(range(min = 1.0, max = 500.0), extend("default" = 100.0))]
    latency_ms: Option<f64>,
    /// Time constant of the estimate, ms; at least twice `latency_ms`. Default: twice.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    time_constant_ms: Option<f64>,
    /// How the force grows with the feed: its exponent.
    #[schemars(range(min = 0.3, max = 1.0), extend("default" = 1.0))]
    exponent: Option<f64>,
    /// A force beyond this multiple of the limit lowers the override at once.
    #[schemars(range(min = 1.05, max = 10.0), extend("default" = 1.25))]
    relief: Option<f64>,
    /// The override is held for this long without a force, ms; then it goes to `lost_percent`.
    #[schemars(range(min = 0.0, max = 10_000.0), extend("default" = 200.0))]
    hold_ms: Option<f64>,
}

#[derive(JsonSchema)]
#[serde(rename_all = "lowercase")]
enum FeedMode {
    Off,
    Observe,
    Adapt,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Dynamic {
    /// `off`: nothing; `compensate`: delay, lags and modes of the joints are compensated by the model.
    #[schemars(extend("default" = "compensate"))]
    mode: Option<DynamicMode>,
    /// Where the weight of the correction's third derivative equals that of the path's error, Hz; at most a quarter of the rate of the commands.
    #[schemars(range(min = 1.0, max = 100.0), extend("default" = 40.0))]
    bandwidth_Hz: Option<f64>,
    /// Share by which delay, lags, frequencies and damping of the model may deviate without making the RMS error of a path known ahead larger.
    #[schemars(range(min = 0.0, max = 0.5), extend("default" = 0.3))]
    robust_to: Option<f64>,
}

#[derive(JsonSchema)]
#[serde(rename_all = "lowercase")]
enum DynamicMode {
    Off,
    Compensate,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Force {
    /// Samples per second.
    #[schemars(range(min = 10.0, max = 1e6))]
    rate_Hz: f64,
    /// Number of channels: the first of Fx Fy Fz Mx My Mz.
    #[schemars(range(min = 3, max = 6), extend("default" = 6))]
    channels: Option<u32>,
    /// Range of the sensor, N: samples at its end are reported as saturated.
    #[schemars(extend("exclusiveMinimum" = 0))]
    full_scale_N: Option<f64>,
    /// Range of the sensor, Nm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    full_scale_Nm: Option<f64>,
    /// How far the stamp of a block may lie ahead of the daemon's `CLOCK_MONOTONIC`, ms.
    #[schemars(range(min = 0.0, max = 60_000.0), extend("default" = 5.0))]
    ahead_ms: Option<f64>,
    /// Largest delay of a block after its last sample, ms; default: `wrench.stale_ms` with
    /// `wrench.source = "force"`, otherwise 1000.
    #[schemars(range(min = 1.0, max = 3.6e6))]
    late_ms: Option<f64>,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Vibration {
    /// Whether the monitor runs.
    #[schemars(extend("default" = true))]
    enabled: Option<bool>,
    /// Lowest and highest frequency, Hz, up to half the force rate; default: 5 to 2000.
    band_Hz: Option<[f64; 2]>,
    /// Weaker lines are not reported, N.
    #[schemars(range(min = 0.0), extend("default" = 0.5))]
    least_amplitude_N: Option<f64>,
    /// Weaker lines are not reported, Nm.
    #[schemars(range(min = 0.0), extend("default" = 0.05))]
    least_amplitude_Nm: Option<f64>,
    /// Scales the power over the noise floor that counts as a line: lower values find weaker lines
    /// and raise more false alarms.
    #[schemars(range(min = 0.25, max = 10.0), extend("default" = 1.0))]
    threshold: Option<f64>,
    /// Spindle speed if it is constant, rev/min; values that the cell sends at run time take
    /// precedence.
    #[schemars(extend("exclusiveMinimum" = 0))]
    spindle_rpm: Option<f64>,
    /// Number of teeth of the cutter.
    #[schemars(range(min = 1, max = 999))]
    teeth: Option<u32>,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Realtime {
    /// Scheduling policy; `fifo`: `SCHED_FIFO`.
    #[schemars(extend("default" = "other"))]
    policy: Option<Policy>,
    /// Priority, with `fifo` only; default: 80.
    #[schemars(range(min = 1, max = 99))]
    priority: Option<u32>,
    /// Core of the cycle thread; default: any.
    #[schemars(range(min = 0, max = 4095))]
    core: Option<u32>,
    /// Lock and touch the memory; default: true with `fifo`.
    lock_memory: Option<bool>,
    /// Refuse to start if one of these settings is refused; otherwise it is reported and the daemon
    /// continues.
    #[schemars(extend("default" = false))]
    enforce: Option<bool>,
}

#[derive(JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Policy {
    Other,
    Fifo,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Recorder {
    /// Folder of the recordings.
    #[schemars(length(min = 1))]
    dir: String,
    /// Size at which a new file begins, MB.
    #[schemars(range(min = 1.0, max = 100_000.0), extend("default" = 256.0))]
    max_file_MB: Option<f64>,
    /// Number of files beyond which the oldest are removed; kept ones are not counted.
    #[schemars(range(min = 1, max = 99_999), extend("default" = 20))]
    keep_files: Option<u32>,
    /// Whether recording begins with the daemon; otherwise with `trued record start`.
    #[schemars(extend("default" = true))]
    start: Option<bool>,
    /// Whether an alarm of the vibration monitor causes the recording to be kept.
    #[schemars(extend("default" = true))]
    keep_alarms: Option<bool>,
    /// Number of kept files from which on no further one is kept.
    #[schemars(range(max = 99_999), extend("default" = 20))]
    kept_files_max: Option<u32>,
}
