//! A robot's loop in each language, with random faults of its own and of the daemon, checked from
//! outside by the targets that it would have sent.
//!
//! `TRUED_LOOP_CYCLES` sets the number of cycles per language.

use super::{LIMIT, built, python};
use crate::TRUED;
use rustix::process::Signal;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tests::clients::{Language, Prefix, root};
use tests::loop_records::{Evaluation, judge};
use tests::place::{CELL, TestDirectory};
use tests::process::Process;
use tests::rng::TestRng;
use trued_client::{Answer, Monitor, RequestError, Response};

/// The loop in Rust.
const FAULTY_LOOP: &str = env!("CARGO_BIN_EXE_faulty-loop");
/// Cycles with faults in the short form, and cycles without at the end, 1 ms each.
const CYCLES: u64 = 8_000;
const CALM: u64 = 10_000;
/// Of these last cycles a fifth has to carry a correction: 9 s after the last fault, however busy the machine.
const TAIL: usize = 1_000;
/// A request has its answer by then, or the daemon is busy with another fault.
const REQUEST: Duration = Duration::from_millis(300);

/// Envelopes of the cell: position, velocity, jerk of a correction, mrad and s.
const ENVELOPES: [[f64; 3]; 3] = [[20.0, 10.0, 5000.0], [2.0, 5.0, 500.0], [20.0, 50.0, 5000.0]];

fn configure(place: &TestDirectory, envelope: [f64; 3], mode: &str) {
    let [position, velocity, jerk] = envelope;
    let text = format!(
        "schema = \"trued.cell/1\"\ncell = \"{CELL}\"\nmodel = \"{}\"\nmode = \"{mode}\"\n\
         [envelope]\nangle_mrad = {position:.1}\nrate_mrad_s = {velocity:.1}\njerk_mrad_s3 = {jerk:.1}\n",
        place.file("model.toml").display()
    );
    place.write("cell.toml", &text);
}

/// The daemon, and its faults while a loop runs.
struct FaultyDaemon<'a> {
    place: &'a TestDirectory,
    daemon: Process,
    chance: TestRng,
    /// Requests that the daemon carried out.
    bypassed: u32,
    swapped: u32,
}

impl<'a> FaultyDaemon<'a> {
    fn start(place: &'a TestDirectory, seed: u64) -> Self {
        configure(place, ENVELOPES[0], "full");
        let daemon = Process::daemon(TRUED, place);
        assert!(daemon.wait_for_output("ready", LIMIT), "{:?}", daemon.lines());
        let _ = place.model("other.toml", "irb1600-6-145");
        Self { place, daemon, chance: TestRng::new(seed), bypassed: 0, swapped: 0 }
    }

    fn restart(&mut self, envelope: [f64; 3], mode: &str) {
        self.daemon.kill();
        std::thread::sleep(Duration::from_millis(self.chance.below(200)));
        configure(self.place, envelope, mode);
        self.daemon = Process::daemon(TRUED, self.place);
        assert!(self.daemon.wait_for_output("ready", LIMIT), "{:?}", self.daemon.lines());
    }

    fn strike(&mut self) {
        let c = &mut self.chance;
        match c.below(8) {
            0 | 1 => {
                let envelope = ENVELOPES[c.below(3) as usize];
                let mode = ["shadow", "limited", "full", "full"][c.below(4) as usize];
                self.restart(envelope, mode);
            }
            2 => {
                self.daemon.signal(Signal::STOP);
                std::thread::sleep(Duration::from_millis(c.below(400)));
                self.daemon.signal(Signal::CONT);
            }
            3..6 => {
                let on = c.below(2) == 0;
                self.bypassed += self.asks(|monitor| monitor.bypass(on, REQUEST));
            }
            _ => {
                let model = ["model.toml", "other.toml"][c.below(2) as usize];
                let path = self.place.file(model);
                let done = self.asks(|monitor| monitor.reload(Some(&path), REQUEST));
                self.swapped += if model == "other.toml" { done } else { 0 };
            }
        }
    }

    /// 1 if the daemon carried out the request.
    fn asks(&self, what: impl FnOnce(&mut Monitor) -> Result<Response, RequestError>) -> u32 {
        let mut monitor = Monitor::connect_to(&self.place.cell(), REQUEST).ok();
        let answer = monitor.as_mut().and_then(|monitor| what(monitor).ok());
        u32::from(answer.is_some_and(|response| response.answer() == Ok(Answer::Done)))
    }
}

/// A loop in one language, under faults; returns its evaluation.
fn run(program: &Path, script: Option<PathBuf>, seed: u64) -> Evaluation {
    let given = std::env::var("TRUED_LOOP_CYCLES").ok();
    let cycles = given.map_or(CYCLES, |cycles| cycles.parse().expect("a number of cycles"));
    let place = TestDirectory::new("full", "");
    let mut struck = FaultyDaemon::start(&place, seed);
    let file = place.file("records");
    let mut arguments: Vec<PathBuf> = script.into_iter().collect();
    arguments.push(CELL.into());
    arguments.push(file.clone());
    arguments.extend([cycles, CALM, seed].map(|number| number.to_string().into()));
    let mut robot = Process::start(program.to_str().expect("a plain path"), &arguments, &place);
    let faults = Duration::from_millis(cycles);
    let since = Instant::now();
    while since.elapsed() < faults && robot.is_running() {
        struck.strike();
        let pause = struck.chance.below(700);
        std::thread::sleep(Duration::from_millis(pause));
    }
    assert!(struck.bypassed > 0 && struck.swapped > 0, "no request was carried out");
    struck.restart(ENVELOPES[0], "full");
    let status = robot.wait();
    assert!(status.success(), "{status}: {:#?}", robot.lines());
    let judged = judge(&fs::read(&file).expect("records"), TAIL);
    if !judged.broken.is_empty() {
        let kept = root().join(format!("target/faulty-loop-{seed}.records"));
        fs::copy(&file, &kept).expect("records kept");
        println!("the records are kept in {}", kept.display());
    }
    assert_eq!(judged.cycles as u64, cycles + CALM, "a record per cycle");
    judged
}

fn check(name: &str, judged: &Evaluation) {
    let Evaluation { cycles, largest_rad, corrected_at_the_end: at_the_end, broken } = judged;
    println!(
        "{name}: {cycles} cycles, up to {largest_rad:e} rad, corrected in {at_the_end} of the last"
    );
    assert!(
        broken.is_empty(),
        "{name}: {} rules broken, {:#?}",
        broken.len(),
        &broken[..broken.len().min(20)]
    );
    assert!(*largest_rad > 1e-4, "{name}: nothing was corrected");
    assert!(*at_the_end > 0.2, "{name}: corrected in {at_the_end} of the last cycles");
}

#[test]
fn a_loop_in_rust_sends_no_step_whatever_goes_wrong_in_it_and_the_daemon() {
    check("Rust", &run(Path::new(FAULTY_LOOP), None, 3));
}

#[test]
fn a_loop_in_c_sends_no_step_whatever_goes_wrong_in_it_and_the_daemon() {
    let prefix = Prefix::install("faulty");
    let Some(program) = built(&prefix, Language::C, "faulty_loop") else { return };
    check("C", &run(&program, None, 1));
}

#[test]
fn a_loop_in_cpp_sends_no_step_whatever_goes_wrong_in_it_and_the_daemon() {
    let prefix = Prefix::install("faulty-cpp");
    let Some(program) = built(&prefix, Language::Cpp, "faulty_loop") else { return };
    check("C++", &run(&program, None, 4));
}

#[test]
fn a_loop_in_python_sends_no_step_whatever_goes_wrong_in_it_and_the_daemon() {
    let Some(interpreter) = python::interpreter("a loop with faults in Python") else { return };
    let script = root().join("client/python/tests/faulty_loop.py");
    check("Python", &run(interpreter, Some(script), 2));
}
