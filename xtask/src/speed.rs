//! Duration of a diagnosis: processor time of `trued diagnose` on paths of 1e5 and 1e6 rows, Parquet in, report out, with its limit.
//!
//! Recordings are made by `trued simulate` from a model with two concealed effects; the time is
//! that of the whole program, including reading and report.
//!
//! Processor time of the program by the kernel, over both of its threads; not wall-clock time.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;

use parquet::data_type::DoubleType;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;

/// Number of rows, and time limit, s.
const SIZES: [(usize, f64); 2] = [(100_000, 3.0), (1_000_000, 20.0)];
/// Number of runs, of which the median is used.
const RUNS: usize = 3;
/// Ticks of the kernel's counts of processor time (`USER_HZ`), 1/s.
const TICKS: f64 = 100.0;
/// Steps of a path, s.
const STEP_S: f64 = 0.004;

/// One kind of recording.
struct RecordingKind {
    name: &'static str,
    model: &'static str,
    /// Concealed effects, missing in the given model.
    hidden: &'static str,
    /// Measured columns, empty before the simulation.
    measured: &'static str,
    noise: [&'static str; 2],
    cut: &'static str,
}

const KINDS: [RecordingKind; 3] = [
    RecordingKind {
        name: "position",
        model: include_str!("../../deploy/presets/irb1600-6-145.toml"),
        hidden: "[[effect]]\nkind = \"backlash\"\njoint = 3\nwidth_mrad = 0.4\n\
                 [[effect]]\nkind = \"joint_compliance\"\njoint = 2\ncompliance_mrad_per_kNm = 1.0\n",
        measured: "x_mm,y_mm,z_mm",
        noise: ["--noise", "0.02"],
        cut: "",
    },
    RecordingKind {
        name: "torque",
        model: include_str!("../../deploy/presets/ur10e.toml"),
        hidden: "[[effect]]\nkind = \"coulomb_friction\"\njoint = 2\nlevel_Nm = 9.0\n\
                 [[effect]]\nkind = \"viscous_friction\"\njoint = 3\ncoefficient = 12.0\n",
        measured: "tau1_Nm,tau2_Nm,tau3_Nm,tau4_Nm,tau5_Nm,tau6_Nm",
        noise: ["--torque-noise", "0.5"],
        cut: "",
    },
    RecordingKind {
        name: "force",
        model: include_str!("../../trued/src/no_arm.toml"),
        hidden: "[[effect]]\nkind = \"wrench_bias\"\nbias_N = [1.5, 0.0, 0.0]\n",
        measured: "fx_N,fy_N,fz_N",
        noise: ["--force-noise", "0.5"],
        cut: "[cut]\nteeth = 2\ndiameter_mm = 6.0\naxial_depth_mm = 0.25\ncoefficients_N_per_mm2 = [800.0, 300.0, 150.0]\ncoefficients_N_per_mm = [8.0, 10.0, 2.0]\n",
    },
];

/// Runs everything and prints it; returns whether the limits are met.
pub(crate) fn run(arguments: &[&str]) -> Result<bool, String> {
    let only = arguments.first().copied();
    let build = ["build", "--release", "--quiet", "--package", "trued"];
    let built = Command::new("cargo").args(build).status().map_err(|why| why.to_string())?;
    if !built.success() {
        return Err("cargo build --release --package trued failed".to_owned());
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."));
    let mut all_met = true;
    for kind in KINDS.iter().filter(|kind| only.is_none_or(|only| only == kind.name)) {
        for (rows, bar) in SIZES {
            let folder = root.join("target/speed").join(format!("{}-{rows}", kind.name));
            let bench = SpeedTest { trued: root.join("target/release/trued"), folder };
            bench.make_recording(kind, rows).map_err(|why| format!("{}: {why}", kind.name))?;
            let mut times = Vec::new();
            for _ in 0..RUNS {
                let before = children_cpu_s()?;
                let arguments =
                    ["diagnose", "--quiet", "--overwrite", "--seed", "1", "--model", "told.toml"];
                bench.run_trued(&[&arguments[..], &["--out", "out", "made.parquet"]].concat())?;
                times.push(children_cpu_s()? - before);
            }
            times.sort_by(f64::total_cmp);
            let median = times[RUNS / 2];
            let met = median <= bar;
            all_met &= met;
            println!(
                "{:8} {rows:8} rows: {median:5.2} s of processor time (bar {bar}, runs {:.2} to {:.2}): {}",
                kind.name,
                times[0],
                times[RUNS - 1],
                if met { "met" } else { "MISSED" }
            );
        }
    }
    Ok(all_met)
}

struct SpeedTest {
    trued: PathBuf,
    folder: PathBuf,
}

impl SpeedTest {
    /// The recording as Parquet, with its TOML and the given model.
    fn make_recording(&self, kind: &RecordingKind, rows: usize) -> Result<(), String> {
        let _ = std::fs::remove_dir_all(&self.folder);
        std::fs::create_dir_all(&self.folder).map_err(|why| why.to_string())?;
        self.write("told.toml", kind.model)?;
        self.write("true.toml", &format!("{}\n{}", kind.model, kind.hidden))?;
        self.write("path.csv", &path(kind, rows))?;
        self.write("path.toml", &format!("schema = \"trued.recording/1\"\n{}", kind.cut))?;
        let arguments =
            ["simulate", "--quiet", "--seed", "3", "--model", "true.toml", "--out", "made"];
        self.run_trued(&[&arguments[..], &kind.noise, &["path.csv"]].concat())?;
        let made = self.folder.join("made.csv");
        let table = std::fs::read_to_string(&made).map_err(|why| why.to_string())?;
        let bytes = parquet_of(&table).map_err(|why| why.to_string())?;
        std::fs::write(self.folder.join("made.parquet"), bytes).map_err(|why| why.to_string())?;
        std::fs::remove_file(made).map_err(|why| why.to_string())
    }

    fn write(&self, name: &str, text: &str) -> Result<(), String> {
        std::fs::write(self.folder.join(name), text).map_err(|why| why.to_string())
    }

    fn run_trued(&self, arguments: &[&str]) -> Result<(), String> {
        let mut program = Command::new(&self.trued);
        let done = program.args(arguments).current_dir(&self.folder).stdout(Stdio::null()).status();
        match done {
            Ok(status) if status.success() => Ok(()),
            Ok(status) => Err(format!("trued {} ended with {status}", arguments.join(" "))),
            Err(why) => Err(why.to_string()),
        }
    }
}

/// Joints that swing by sines of different rates, or a cut with pauses; in ten segments.
fn path(kind: &RecordingKind, rows: usize) -> String {
    let moves = kind.cut.is_empty();
    let inputs = match moves {
        true => "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg",
        false => "spindle_rpm,feed_mm_s",
    };
    let mut text = format!("t_s,segment,{inputs},{}\n", kind.measured);
    let blank = ",".repeat(kind.measured.matches(',').count());
    for row in 0..rows {
        let segment = row * 10 / rows;
        if moves {
            let t = STEP_S * row as f64;
            let swing = |size: f64, rate: f64, phase: f64| {
                size * (rate * t + phase).sin() * (0.02 * t).cos()
            };
            let _ = writeln!(
                text,
                "{t:.4},{segment},{:.6},{:.6},{:.6},{:.6},{:.6},{:.6},{blank}",
                10.0 + swing(40.0, 0.19, 0.0),
                10.0 + swing(25.0, 0.27, 1.0),
                -10.0 + swing(25.0, 0.36, 2.0),
                20.0 + swing(60.0, 0.45, 3.0),
                40.0 + swing(40.0, 0.56, 4.0),
                10.0 + swing(90.0, 0.65, 5.0)
            );
        } else {
            let feed = if row % 20_000 < 4_000 { 0.0 } else { 4.0 };
            let _ = writeln!(text, "{:.4},{segment},3000,{feed},{blank}", 1e-4 * row as f64);
        }
    }
    text
}

/// A table of numbers as Parquet: one row group, plain doubles; empty cells are null.
fn parquet_of(table: &str) -> Result<Vec<u8>, Box<dyn std::error::Error>> {
    let mut lines = table.lines();
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let mut columns = vec![Vec::new(); header.len()];
    for line in lines {
        for (column, cell) in columns.iter_mut().zip(line.split(',')) {
            column.push(cell.parse::<f64>().unwrap_or(f64::NAN));
        }
    }
    let fields: String = header.iter().map(|name| format!("required double {name}; ")).collect();
    let schema = Arc::new(parse_message_type(&format!("message recording {{ {fields} }}"))?);
    let mut writer = SerializedFileWriter::new(Vec::new(), schema, Arc::default())?;
    let mut rows = writer.next_row_group()?;
    for values in &columns {
        let Some(mut column) = rows.next_column()? else { break };
        column.typed::<DoubleType>().write_batch(values, None, None)?;
        column.close()?;
    }
    rows.close()?;
    Ok(writer.into_inner()?)
}

/// Processor time of all programs that this one started and that have ended, s.
fn children_cpu_s() -> Result<f64, String> {
    let stat = std::fs::read_to_string("/proc/self/stat").map_err(|why| why.to_string())?;
    // The name in brackets may contain blanks; user and system time of children are the 14th and
    // 15th field after it.
    let behind = stat.rsplit(')').next().unwrap_or_default();
    let ticks = behind.split_whitespace().skip(13).take(2).map(str::parse::<f64>);
    let ticks: Result<Vec<f64>, _> = ticks.collect();
    ticks.map(|both| both.iter().sum::<f64>() / TICKS).map_err(|why| why.to_string())
}
