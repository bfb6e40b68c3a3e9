//! Compares one correction with Pinocchio's forward kinematics, Jacobian and gravity of the same
//! arm, alternately in one run: `cargo xtask peers`.
//!
//! Pinocchio comes from the package registry (`libpinocchio`, `cmeel-eigen`), with its headers; a
//! small C++ program calls it. If it cannot be installed or built, the comparison is SKIPPED, with
//! a message. Both use the same poses; if TCP or gravity differ, nothing is compared. The lowest of
//! many batches counts, because other load only adds to it.
#![expect(clippy::print_stdout, reason = "its account is what it is for")]

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitCode, Stdio};
use tests::clients::{root, skipped};
use tests::python::{environment, tried};

const PACKAGES: [&str; 2] = ["libpinocchio>=4.1", "cmeel-eigen>=3.4"];
/// Corrections per batch, and batches of each: short, so that many of them are not interrupted.
const BATCH: usize = 200;
const BATCHES: usize = 3000;
/// Required ratio of one correction to Pinocchio's three functions.
const BAR: f64 = 0.9;
/// Tolerance of TCP position and gravity torques, m and Nm.
const AGREES: f64 = 1e-9;

fn main() -> ExitCode {
    let scratch = root().join("target/tmp");
    let done = std::fs::create_dir_all(&scratch).map_err(|e| e.to_string());
    match done.and_then(|()| built(&scratch)) {
        Err(why) => {
            skipped(&scratch, "Pinocchio beside a correction", &why);
            ExitCode::SUCCESS
        }
        Ok(pinocchio) => match compared(&pinocchio) {
            Ok(true) => ExitCode::SUCCESS,
            Ok(false) => ExitCode::from(1),
            Err(why) => {
                println!("peers: {why}");
                ExitCode::from(3)
            }
        },
    }
}

/// Builds the C++ program; the error names what is missing on this machine.
fn built(scratch: &Path) -> Result<PathBuf, String> {
    let python = environment(&scratch.join("pinocchio"), &PACKAGES)?;
    let script = "import sysconfig; print(sysconfig.get_path('purelib'))";
    let output = Command::new(python).args(["-c", script]).output().map_err(|e| e.to_string())?;
    let packages = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    let prefix = PathBuf::from(packages).join("cmeel.prefix");
    let (include, lib) = (prefix.join("include"), prefix.join("lib"));
    let program = scratch.join("pinocchio-beside");
    let mut compiler = Command::new(std::env::var_os("CXX").unwrap_or_else(|| "c++".into()));
    // Optimised for this processor; the limits of its lists are those of its own wheels.
    compiler.args(["-std=c++17", "-O3", "-march=native", "-DNDEBUG", "-w"]);
    compiler.args(["-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS", "-DBOOST_MPL_LIMIT_LIST_SIZE=40"]);
    compiler.arg("-DBOOST_MPL_LIMIT_VECTOR_SIZE=40");
    compiler.arg("-isystem").arg(&include).arg("-isystem").arg(include.join("eigen3"));
    compiler.arg(root().join("corrector/benches/pinocchio.cpp")).arg("-o").arg(&program);
    compiler.arg("-L").arg(&lib).arg(format!("-Wl,-rpath,{}", lib.display()));
    compiler.arg("-lpinocchio_default");
    tried(&mut compiler, "Pinocchio's half does not build")?;
    Ok(program)
}

/// One of the two compared programs.
struct ComparedProgram {
    child: Child,
    orders: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl ComparedProgram {
    fn start(command: &mut Command) -> Result<Self, String> {
        let started = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
        let mut child = started.map_err(|e| format!("{command:?}: {e}"))?;
        let pipes = child.stdin.take().zip(child.stdout.take());
        let (orders, answers) = pipes.ok_or("no pipes")?;
        Ok(Self { child, orders, answers: BufReader::new(answers) })
    }

    fn tell(&mut self, text: &str) -> Result<(), String> {
        self.orders.write_all(text.as_bytes()).map_err(|e| e.to_string())
    }

    fn numbers(&mut self) -> Result<Vec<f64>, String> {
        let mut line = String::new();
        self.answers.read_line(&mut line).map_err(|e| e.to_string())?;
        let fields = line.split_whitespace().map(str::parse);
        let numbers: Result<Vec<f64>, _> = fields.collect();
        numbers.ok().filter(|n| !n.is_empty()).ok_or_else(|| format!("expected numbers: {line}"))
    }

    fn batch(&mut self) -> Result<Vec<f64>, String> {
        self.tell(&format!("batch {BATCH}\n"))?;
        self.numbers()
    }
}

impl Drop for ComparedProgram {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Compares alternately; returns whether the limit is met.
fn compared(pinocchio: &Path) -> Result<bool, String> {
    let program = ours()?;
    let arm = Command::new(&program).arg("arm").output().map_err(|e| e.to_string())?;
    let arm = String::from_utf8(arm.stdout).map_err(|e| e.to_string())?;
    let mut ours = ComparedProgram::start(Command::new(&program).arg("correct"))?;
    let mut theirs = ComparedProgram::start(&mut Command::new(pinocchio))?;
    theirs.tell(&arm)?;
    let first: usize = arm.lines().next().and_then(|n| n.trim().parse().ok()).unwrap_or(0);
    // Joints, tool, gravity, followed by the number of poses.
    let poses: usize = arm.lines().nth(first + 3).and_then(|n| n.trim().parse().ok()).unwrap_or(0);
    let apart = apart(&mut ours, &mut theirs, poses)?;
    println!("TCP and gravity of {poses} poses agree to {apart:.1e} m, Nm");
    if apart.is_nan() || apart > AGREES {
        return Err(format!("they are {apart} apart, expected {AGREES}: nothing is compared"));
    }
    let (mut best, mut steps, mut ratios) = ([f64::INFINITY; 2], 0.0, Vec::new());
    for _ in 0..BATCHES {
        let (a, b) = (ours.batch()?, theirs.batch()?);
        steps = a.get(1).copied().unwrap_or(f64::NAN);
        best = [best[0].min(a[0]), best[1].min(b[0])];
        ratios.push(a[0] / b[0]);
    }
    ratios.sort_by(f64::total_cmp);
    let (ratio, load) = (best[0] / best[1], std::fs::read_to_string("/proc/loadavg"));
    println!(
        "lowest of {BATCHES} batches of {BATCH}, by turns; load {}",
        load.unwrap_or_default().trim()
    );
    println!(
        "one correction, 20 effects, gravity, wrench, {steps:.2} Newton steps  {:>8.0} ns",
        best[0]
    );
    println!("Pinocchio: forward kinematics, Jacobian, gravity            {:>8.0} ns", best[1]);
    println!("ratio {ratio:.2} (median of the turns {:.2}), at most {BAR}", ratios[BATCHES / 2]);
    Ok(ratio <= BAR)
}

/// Largest difference between the two.
fn apart(
    ours: &mut ComparedProgram,
    theirs: &mut ComparedProgram,
    poses: usize,
) -> Result<f64, String> {
    let mut most = 0.0_f64;
    ours.tell("look\n")?;
    theirs.tell("look\n")?;
    for _ in 0..poses {
        let (a, b) = (ours.numbers()?, theirs.numbers()?);
        if a.len() != b.len() {
            return Err(format!("{} numbers beside {}", a.len(), b.len()));
        }
        // NaN does not agree.
        let differences = a.iter().zip(&b).map(|(a, b)| (a - b).abs());
        most = differences.fold(most, |most, difference| {
            if difference.is_nan() { f64::NAN } else { most.max(difference) }
        });
    }
    Ok(most)
}

/// The correction's half, built as it is shipped.
fn ours() -> Result<String, String> {
    let bench = ["bench", "--package", "corrector", "--bench", "beside", "--no-run"];
    let built = Command::new("cargo").args(bench).output().map_err(|why| why.to_string())?;
    let stderr = String::from_utf8_lossy(&built.stderr);
    let line = stderr.lines().find(|line| line.trim_start().starts_with("Executable"));
    let path = line.and_then(|line| line.split_once('(')?.1.strip_suffix(')'));
    path.map(str::to_owned).ok_or_else(|| format!("cargo built nothing:\n{stderr}"))
}
