//! Batch diagnosis of generated recordings: one digest for any shards and kills, and the throughput compared with single diagnoses.
//!
//! Recordings are made by `trued simulate`: four robots, the last of which has increasing lost
//! motion at joint 3 from recording to recording. A recording has [`ROWS`] rows, so that thousands
//! take minutes. Single diagnoses: one process per core, each `trued diagnose` of one recording on
//! one thread.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Measured rows of a recording.
const ROWS: u32 = 100;
/// Default number of recordings.
const RECORDINGS: usize = 200;
const ROBOTS: usize = 4;
const SHARDS: usize = 8;
/// Largest time of a batch relative to that of single diagnoses.
const TIME_RATIO_MAX: f64 = 1.1;
/// Times after which successive runs of a shard are killed, ms, until one ends by itself.
const KILL_TIMES_MS: [u64; 6] = [50, 150, 400, 900, 2000, 4000];

const MODEL: &str = include_str!("../../deploy/presets/irb1600-6-145.toml");

/// Runs everything and prints it; returns whether all digests are equal and the limit is met.
pub(crate) fn run(arguments: &[&str]) -> Result<bool, String> {
    let count = match arguments.first() {
        Some(argument) => {
            argument.parse().map_err(|_| format!("{argument} is not a number of recordings"))?
        }
        None => RECORDINGS,
    };
    let build = ["build", "--release", "--quiet", "--package", "trued"];
    let built = Command::new("cargo").args(build).status().map_err(|why| why.to_string())?;
    if !built.success() {
        return Err("cargo build --release --package trued failed".to_owned());
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."));
    let folder = root.join("target/batch");
    let bench = BatchTest { trued: root.join("target/release/trued"), folder, count };
    bench.make_recordings()?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let by_hand = bench.single_diagnoses_s(cores)?;
    let begun = Instant::now();
    bench.shards("parts-of-cores", cores, cores)?;
    let in_batch = begun.elapsed().as_secs_f64();
    let ratio = in_batch / by_hand;
    println!(
        "{count} recordings of {ROWS} rows on {cores} cores: by hand {by_hand:.1} s, {cores} shards {in_batch:.1} s ({:.1} recordings per second and core); \
         ratio {ratio:.3} (bar {TIME_RATIO_MAX}): {}",
        count as f64 / in_batch / cores as f64,
        if ratio <= TIME_RATIO_MAX { "met" } else { "MISSED" }
    );
    bench.shards("one", 1, 1)?;
    bench.shards("eight", SHARDS, cores)?;
    let kills = bench.run_with_kills("killed")?;
    let digests = ["parts-of-cores", "one", "eight", "killed"]
        .map(|folder| Ok::<_, String>((folder, bench.digest(folder)?)));
    let mut all: Vec<String> = Vec::new();
    for digest in digests {
        let (folder, digest) = digest?;
        println!("{folder:15} {digest}");
        all.push(digest);
    }
    let is_one = all.iter().all(|digest| *digest == all[0]);
    println!("killed {kills} times; digests: {}", if is_one { "one" } else { "DIFFERENT" });
    Ok(is_one && ratio <= TIME_RATIO_MAX)
}

struct BatchTest {
    trued: PathBuf,
    folder: PathBuf,
    count: usize,
}

impl BatchTest {
    fn names(&self) -> Vec<String> {
        (0..self.count)
            .map(|number| format!("r{}-{:05}", number % ROBOTS, number / ROBOTS))
            .collect()
    }

    /// Generates the recordings and their manifest.
    fn make_recordings(&self) -> Result<(), String> {
        let _ = std::fs::remove_dir_all(&self.folder);
        std::fs::create_dir_all(&self.folder).map_err(|why| why.to_string())?;
        self.write("told.toml", MODEL)?;
        self.write("path.csv", &path())?;
        self.write("path.toml", "schema = \"trued.recording/1\"\nmeasuring_frame = \"base\"\n")?;
        let mut manifest = String::from("schema = \"trued.manifest/1\"\nseed = 1\n");
        for robot in 0..ROBOTS {
            let _ = write!(manifest, "[[robot]]\nname = \"R{robot}\"\nmodel = \"told.toml\"\n");
        }
        let visits = self.count.div_ceil(ROBOTS).max(1);
        for (number, name) in self.names().iter().enumerate() {
            let (robot, visit) = (number % ROBOTS, number / ROBOTS);
            let wear = if robot + 1 == ROBOTS { visit as f64 / visits as f64 } else { 0.0 };
            let width = 0.2 + 0.4 * wear;
            let truth = format!(
                "{MODEL}\n[[effect]]\nkind = \"backlash\"\njoint = 3\nwidth_mrad = {width}\n"
            );
            self.write("truth.toml", &truth)?;
            let seed = number.to_string();
            let arguments = ["simulate", "--quiet", "--model", "truth.toml", "--noise", "0.03"];
            self.run_trued(
                &[&arguments[..], &["--seed", &seed, "--out", name, "path.csv"]].concat(),
            )?;
            let sigma = "sigma = { x_mm = 0.03, y_mm = 0.03, z_mm = 0.03 }";
            self.write(
                &format!("{name}.toml"),
                &format!("schema = \"trued.recording/1\"\n{sigma}\n"),
            )?;
            let day = 1 + visit % 28;
            let month = 1 + visit / 28 % 12;
            let year = 2020 + visit / 336;
            let _ = write!(
                manifest,
                "[[recording]]\nrobot = \"R{robot}\"\nfiles = [\"{name}.csv\"]\nrecorded_at = \"{year}-{month:02}-{day:02}T06:00:00Z\"\n"
            );
        }
        self.write("manifest.toml", &manifest)
    }

    /// Seconds that single diagnoses take, as many at a time as there are cores.
    fn single_diagnoses_s(&self, cores: usize) -> Result<f64, String> {
        let (names, next) = (self.names(), AtomicUsize::new(0));
        let work = || -> Result<(), String> {
            while let Some(name) = names.get(next.fetch_add(1, Ordering::Relaxed)) {
                let (out, file) = (format!("by-hand/{name}"), format!("{name}.csv"));
                let arguments = ["diagnose", "--quiet", "--seed", "1", "--threads", "1"];
                let files = ["--model", "told.toml", "--out", &out, &file];
                self.run_trued(&[&arguments[..], &files].concat())?;
            }
            Ok(())
        };
        std::fs::create_dir_all(self.folder.join("by-hand")).map_err(|why| why.to_string())?;
        let begun = Instant::now();
        std::thread::scope(|scope| {
            let threads: Vec<_> = (0..cores).map(|_| scope.spawn(work)).collect();
            threads.into_iter().try_for_each(|thread| {
                thread.join().map_err(|_| "a thread of the benchmark broke".to_owned())?
            })
        })?;
        Ok(begun.elapsed().as_secs_f64())
    }

    fn batch(&self, out: &str, shard: &str) -> Command {
        let mut command = Command::new(&self.trued);
        let arguments =
            ["diagnose", "--quiet", "--batch", "manifest.toml", "--resume", "--threads", "1"];
        command.args(arguments).args(["--out", out, "--shard", shard]);
        command.current_dir(&self.folder).stdout(Stdio::null());
        command
    }

    /// All shards, a number of them at a time.
    fn shards(&self, out: &str, shards: usize, at_once: usize) -> Result<(), String> {
        let all: Vec<String> = (1..=shards).map(|index| format!("{index}/{shards}")).collect();
        for some in all.chunks(at_once) {
            let started: Result<Vec<Child>, _> =
                some.iter().map(|shard| self.batch(out, shard).spawn()).collect();
            for mut child in started.map_err(|why| why.to_string())? {
                let status = child.wait().map_err(|why| why.to_string())?;
                if !status.success() {
                    return Err(format!("a shard of {out}: {status}"));
                }
            }
        }
        Ok(())
    }

    /// The whole manifest by a process that is killed repeatedly, and then runs to its end; returns
    /// how often it was killed.
    fn run_with_kills(&self, out: &str) -> Result<usize, String> {
        let mut kills = 0;
        for ms in KILL_TIMES_MS {
            let mut child = self.batch(out, "1/1").spawn().map_err(|why| why.to_string())?;
            std::thread::sleep(Duration::from_millis(ms));
            if child.try_wait().map_err(|why| why.to_string())?.is_none() {
                kills += 1;
            }
            child.kill().and_then(|()| child.wait()).map_err(|why| why.to_string())?;
        }
        self.shards(out, 1, 1)?;
        Ok(kills)
    }

    /// The digest of a folder, by standard tools.
    fn digest(&self, out: &str) -> Result<String, String> {
        let mut command = Command::new("sh");
        command.args(["-c", "sha256sum *.parquet | sha256sum"]);
        let done = command.current_dir(self.folder.join(out)).output();
        let output = done.map_err(|why| why.to_string())?.stdout;
        let output = String::from_utf8_lossy(&output).into_owned();
        output.split_whitespace().next().map(str::to_owned).ok_or_else(|| "no digest".to_owned())
    }

    fn write(&self, name: &str, text: &str) -> Result<(), String> {
        std::fs::write(self.folder.join(name), text).map_err(|why| format!("{name}: {why}"))
    }

    fn run_trued(&self, arguments: &[&str]) -> Result<(), String> {
        let mut command = Command::new(&self.trued);
        command.args(arguments).current_dir(&self.folder).stdout(Stdio::null());
        let status = command.status().map_err(|why| why.to_string())?;
        if status.success() { Ok(()) } else { Err(format!("trued {arguments:?}: {status}")) }
    }
}

/// All joints oscillate, each at its own frequency.
fn path() -> String {
    let mut text = String::from("t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm\n");
    for row in 0..ROWS {
        let t = 0.05 * f64::from(row);
        let swings =
            [(60.0, 0.61), (35.0, 0.97), (35.0, 0.79), (90.0, 1.63), (70.0, 1.31), (120.0, 1.9)];
        let q = swings.map(|(span, pace): (f64, f64)| (span * (pace * t + span).sin()).to_string());
        let _ = writeln!(text, "{t},{},1,2,3", q.join(","));
    }
    text
}
