//! `trued challenge`: the blind test. Cases are generated and sealed, a solver answers in separate processes, the answers are hashed, then the truth is published.
//!
//! The solver sees a model and a recording only; the truth is in no file until all answers are
//! hashed; the same seed gives the same cases for any number of threads. No case is dropped because
//! of its answer.

mod drawn;
mod inject;
mod page;
mod solver;
mod told;
mod worth;

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use challenge::answer::Answer;
use challenge::case::Tier;
use challenge::score::{Line, Outcome as Scored, figures};
use challenge::seal;
use challenge::truth::{self, Truth};
use clap::{Args, ValueEnum};
use recording::program;
use serde::Serialize;

use self::drawn::{Domain, Drawn};
use self::inject::Injection;
use self::solver::{Run, Solver};
use crate::atomic::Outputs;
use crate::exit::{Answer as Done, Failure, Outcome};
use crate::input::Reading;
use crate::options::{Seed, Threads};
use crate::output::Console;
use crate::{interrupt, progress};

/// Blind test of a diagnosis: sealed cases, a solver, a score
///
/// Draws robots, motions, instruments and hidden effects from a generator that shares no physics with trued, writes for each case a model and a
/// recording, and tells the hash of the truth. Then it runs the solver on each (`SOLVER --model M --out DIR --seed N RECORDING`, answering with
/// `diagnosis.json` and `model.toml` in DIR), hashes the answers, opens the truth and counts: right effect and joint, false findings, wrong names,
/// unknown and undetermined cases recognised, intervals that hold, the gain on a motion that nobody saw.
#[derive(Debug, Args)]
pub(crate) struct Challenge {
    /// How many cases
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    cases: u32,
    #[command(flatten)]
    seed: Seed,
    /// Where cases, answers, truth and report go; must not hold anything yet
    #[arg(long, value_name = "DIR", default_value = "challenge")]
    out: PathBuf,
    /// What is measured and diagnosed
    #[arg(long, value_name = "DOMAIN", value_enum, default_value_t = Domain::Position)]
    domain: Domain,
    /// Instead of cases: effects of torques added to these real recordings of the robot of --model
    #[arg(long, value_name = "RECORDING", num_args = 1..)]
    inject: Vec<PathBuf>,
    #[command(flatten)]
    reading: Reading,
    /// One kind of case alone; if not given, a mixture
    #[arg(long, value_name = "TIER", value_enum)]
    tier: Option<AskedTier>,
    /// Another program that answers; `trued diagnose` if not given
    #[arg(long, value_name = "CMD")]
    solver: Option<String>,
    /// The longest that the solver may take for a case, s
    #[arg(long, value_name = "SECONDS", default_value_t = 120.0)]
    limit: f64,
    #[command(flatten)]
    threads: Threads,
}

/// [`Tier`] on the command line.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum AskedTier {
    /// Nothing is missing
    Null,
    /// One effect
    Single,
    /// Two or three effects
    Multiple,
    /// Physics that no library has
    Outside,
    /// Effects that the motion cannot part
    Ambiguous,
    /// One effect near the limit of detection
    Limit,
}

impl From<AskedTier> for Tier {
    fn from(asked: AskedTier) -> Self {
        match asked {
            AskedTier::Null => Self::Null,
            AskedTier::Single => Self::Single,
            AskedTier::Multiple => Self::Multiple,
            AskedTier::Outside => Self::Outside,
            AskedTier::Ambiguous => Self::Ambiguous,
            AskedTier::Limit => Self::Limit,
        }
    }
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Commitment<'a> {
    cases: usize,
    sealed_sha256: &'a str,
}

/// The places of a challenge.
struct Folder(PathBuf);

impl Folder {
    fn case(&self, index: usize) -> PathBuf {
        self.0.join("cases").join(name(index))
    }

    fn answer(&self, index: usize) -> PathBuf {
        self.0.join("answers").join(name(index))
    }
}

fn name(index: usize) -> String {
    format!("{index:05}")
}

impl Challenge {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let seed = self.seed.settle();
        // Hours may pass before there is anything to write.
        let inputs = self.inject.iter().chain(self.reading.files());
        console.outputs().in_folder(&self.out).check(inputs)?;
        let folder = self.folder()?;
        let solver = Solver::of(self.solver.as_deref(), self.limit)?;
        let stop = interrupt::flag()?;
        let count = self.cases as usize;
        let work = Work { threads: self.threads.settle().get(), stop: &stop };
        if self.inject.is_empty()
            && (self.reading.model.is_some() || self.reading.mapping.is_some())
        {
            return Err(Failure::input(
                "--model and --mapping are of the recordings of --inject: give these too",
            ));
        }
        if !self.inject.is_empty() {
            let (reading, recordings) = (&self.reading, self.inject.as_slice());
            let (out, solver) = (folder.0.as_path(), &solver);
            return Injection { reading, recordings, out, seed, solver }.run(console, &work);
        }
        let drawn = work.each(console, count, "drawing cases", |index| {
            let tier = self.tier.map_or_else(|| Tier::mixed(index), |tier| (tier.into(), index));
            let drawn = self.domain.draw(seed, index, tier);
            put(&folder.case(index), &drawn)?;
            Ok(drawn)
        })?;
        let truths: Vec<Truth> =
            drawn.iter().enumerate().map(|(index, drawn)| drawn.truth(&name(index))).collect();
        let text = truth::text(&truths);
        let sealed = seal::sha256(&text);
        commit(&folder, count, &sealed)?;
        console.say(format!("{count} cases of seed {seed}, sealed      {sealed}"))?;
        let runs = work.each(console, count, "solving", |index| {
            solver.answer(&folder.case(index), &folder.answer(index), &stop)
        })?;
        let answers = seal::sha256(&answers_text(&runs));
        console.say(format!("answers                      {answers}"))?;
        seal::open(&text, &sealed).map_err(Failure::system)?;
        write([(folder.0.join("truth.json"), text)])?;
        let errors = work.each(console, count, "proving", |index| {
            Ok(drawn[index].errors(runs[index].model.as_deref()))
        })?;
        let domain = self.domain.word();
        let scored: Vec<Scored> = truths
            .into_iter()
            .zip(runs.iter().zip(errors))
            .map(|(truth, (run, errors))| Scored {
                truth,
                answer: run.diagnosis.as_deref().and_then(|text| Answer::parse(text, domain).ok()),
                errors,
                seconds: run.seconds,
            })
            .collect();
        let figures = figures(seed, &sealed, &answers, &scored);
        let lines: Vec<Line> = scored.iter().map(Scored::line).collect();
        let lines = serde_json::to_string_pretty(&lines).map_err(Failure::system)?;
        let mut outputs = console.outputs();
        outputs.put(&folder.0.join("outcomes.json"), lines + "\n");
        outputs.put_page(&folder.0.join("report.html"), page::render(&figures, &scored));
        console.write(outputs, "trued.challenge/1", &figures)?;
        console.say(told::told(&figures))?;
        console.say(format!("report              {}", folder.0.join("report.html").display()))?;
        Ok(Done::Done)
    }

    fn folder(&self) -> Result<Folder, Failure> {
        let taken = std::fs::read_dir(&self.out).is_ok_and(|mut entries| entries.next().is_some());
        if taken {
            let out = self.out.display();
            return Err(Failure::input(format!(
                "{out} holds something already: give --out another folder"
            )));
        }
        std::fs::create_dir_all(&self.out).map_err(|error| {
            Failure::input(format!("cannot make {}: {error}", self.out.display()))
        })?;
        Ok(Folder(self.out.clone()))
    }
}

fn put(folder: &Path, drawn: &Drawn) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(Failure::system)?;
    write(drawn.files().into_iter().map(|(name, text)| (folder.join(name), text)))
}

fn commit(folder: &Folder, cases: usize, sealed_sha256: &str) -> Result<(), Failure> {
    let said = Commitment { cases, sealed_sha256 };
    let text = program::json("trued.commitment/1", &said).map_err(Failure::system)?;
    write([(folder.0.join("commitment.json"), text + "\n")])
}

/// Writes files to a directory of the challenge's own, where nothing can be replaced.
fn write(files: impl IntoIterator<Item = (PathBuf, String)>) -> Result<(), Failure> {
    let mut outputs = Outputs::default();
    files.into_iter().for_each(|(path, text)| outputs.put(&path, text));
    Ok(outputs.write()?)
}

/// All answers as one text: what was reported and what was written, case by case.
fn answers_text(runs: &[Run]) -> String {
    let mut text = String::new();
    for (index, run) in runs.iter().enumerate() {
        for part in [Some(name(index)), run.diagnosis.clone(), run.model.clone()] {
            text += &part.unwrap_or_default();
            text.push('\n');
        }
    }
    text
}

/// Processes many cases on several threads; results are in the order of the cases.
struct Work<'a> {
    threads: usize,
    stop: &'a AtomicBool,
}

impl Work<'_> {
    fn each<T: Send>(
        &self,
        console: &Console,
        count: usize,
        what: &'static str,
        one: impl Fn(usize) -> Result<T, Failure> + Sync,
    ) -> Result<Vec<T>, Failure> {
        let bar = progress::bar(console, count as u64, what);
        let next = AtomicUsize::new(0);
        let done: Mutex<Vec<(usize, Result<T, Failure>)>> = Mutex::new(Vec::with_capacity(count));
        let work = || {
            loop {
                let index = next.fetch_add(1, Ordering::Relaxed);
                if index >= count {
                    break;
                }
                let result = interrupt::check(self.stop).and_then(|()| one(index));
                let failed = result.is_err();
                bar.inc(1);
                done.lock()
                    .unwrap_or_else(std::sync::PoisonError::into_inner)
                    .push((index, result));
                if failed {
                    next.store(count, Ordering::Relaxed);
                }
            }
        };
        std::thread::scope(|scope| {
            (1..self.threads).for_each(|_| {
                scope.spawn(work);
            });
            work();
        });
        let mut done = done.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        done.sort_by_key(|(index, _)| *index);
        done.into_iter().map(|(_, result)| result).collect()
    }
}

/// The schemas of the results.
#[cfg(feature = "schema")]
pub(crate) fn result_schemas() -> Vec<crate::schemas::ResultSchema> {
    use crate::schemas::ResultSchema;
    vec![
        ResultSchema::of::<challenge::score::Figures>("challenge", "trued.challenge/1"),
        ResultSchema::without_format::<Vec<Line>>("challenge-outcomes"),
        ResultSchema::of::<Commitment<'_>>("challenge-commitment", "trued.commitment/1"),
        inject::result_schema(),
    ]
}
