//! `trued challenge`: the blind test. Cases are generated and sealed, a solver answers in separate processes, the answers are hashed, then the truth is published.
//!
//! The solver sees a model and a recording only; the truth is in no file until all answers are
//! hashed; the same seed gives the same cases for any number of threads. No case is dropped because
//! of its answer.

mod inject;
mod solver;

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use challenge::case::Tier;
use challenge_report::{Case, ScoredChallenge, SealedTruth, case_name};
use clap::{Args, ValueEnum};
use report::pluralise;

use self::inject::Injection;
use self::solver::Solver;
use crate::exit::{Answer, Failure, Outcome};
use crate::input::Reading;
use crate::options::{Seed, Threads};
use crate::output::Console;
use crate::pages::Outputs;
use crate::{interrupt, progress, wrap};

/// Blind test of a diagnosis: sealed cases, a solver, a score
///
/// Draws robots, motions, instruments and hidden effects from a generator that shares no physics with trued. Writes a model and a recording for each case, and prints
/// the hash of the truth. Runs the solver on each case (`SOLVER --model M --out DIR --seed N RECORDING`, which writes `diagnosis.json` and `model.toml` to DIR), hashes the
/// answers, reveals the truth and scores: correct effects and joints, false findings, wrong effects, recognition of unknown and undetermined cases, coverage of intervals, and the gain
/// on a motion that was not recorded.
#[derive(Debug, Args)]
#[command(mut_args(|arg| match arg.get_id().as_str() {
    // Clap drops a requirement that conflicts with another given option: these conflict with the same options.
    "model" | "mapping" => {
        arg.requires("inject").conflicts_with_all(["cases", "domain", "tier"])
    }
    _ => arg,
}))]
pub(crate) struct Challenge {
    /// Number of cases
    #[arg(long, value_name = "N", default_value_t = 100, conflicts_with = "inject", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    cases: u32,
    #[command(flatten)]
    seed: Seed,
    /// Output folder for cases, answers, truth and report; must be empty or not exist
    #[arg(long, value_name = "DIR", default_value = "challenge")]
    out: PathBuf,
    /// Domain of the measurements
    #[arg(long, value_name = "DOMAIN", value_enum, default_value_t = Domain::Position, conflicts_with = "inject")]
    domain: Domain,
    /// Instead of generated cases: torque effects added to these real recordings of the robot of --model
    #[arg(long, value_name = "RECORDING", num_args = 1..)]
    inject: Vec<PathBuf>,
    #[command(flatten)]
    reading: Reading,
    /// Kind of the cases; by default a mixture
    #[arg(long, value_name = "TIER", value_enum, conflicts_with = "inject")]
    tier: Option<TierOption>,
    /// Command of another solver; by default `trued diagnose`
    #[arg(long, value_name = "CMD")]
    solver: Option<String>,
    /// Time limit of the solver for a case, s, above 0
    #[arg(long, value_name = "SECONDS", default_value = "120", value_parser = limit)]
    limit: Duration,
    #[command(flatten)]
    threads: Threads,
}

/// Domain of the measurements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Domain {
    /// Positions of the tool
    Position,
    /// Torques of the motors
    Torque,
    /// Forces of a cutter
    Force,
}

impl From<Domain> for challenge_report::Domain {
    fn from(domain: Domain) -> Self {
        match domain {
            Domain::Position => Self::Position,
            Domain::Torque => Self::Torque,
            Domain::Force => Self::Force,
        }
    }
}

/// [`Tier`] on the command line.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum TierOption {
    /// No missing effect
    Null,
    /// One effect
    Single,
    /// Two or three effects
    Multiple,
    /// Physics outside the library
    Outside,
    /// Effects that the motion cannot distinguish
    Ambiguous,
    /// One effect near the limit of detection
    Limit,
}

impl From<TierOption> for Tier {
    fn from(tier: TierOption) -> Self {
        match tier {
            TierOption::Null => Self::Null,
            TierOption::Single => Self::Single,
            TierOption::Multiple => Self::Multiple,
            TierOption::Outside => Self::Outside,
            TierOption::Ambiguous => Self::Ambiguous,
            TierOption::Limit => Self::Limit,
        }
    }
}

/// Parses `--limit`: without time no solver answers, and every case would count as unanswered.
fn limit(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    seconds
        .filter(|limit| !limit.is_zero())
        .ok_or_else(|| "expected a number of seconds above 0".to_owned())
}

/// Folders of a challenge. What it wrote is removed when dropped, unless it is kept: a challenge without all answers
/// cannot be continued, and its folder would bar the next one.
struct Folder {
    path: PathBuf,
    /// Whether it was not there before.
    is_made: bool,
    is_kept: bool,
}

impl Folder {
    fn create(path: &Path) -> Result<Self, Failure> {
        let is_made = !path.exists();
        std::fs::create_dir_all(path)
            .map_err(|error| Failure::input(format!("cannot make {}: {error}", path.display())))?;
        Ok(Self { path: path.to_owned(), is_made, is_kept: false })
    }

    fn case(&self, index: usize) -> PathBuf {
        self.path.join("cases").join(case_name(index))
    }

    fn answer(&self, index: usize) -> PathBuf {
        self.path.join("answers").join(case_name(index))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if self.is_kept {
            return;
        }
        // Nothing more can be done here: the error that led here is reported to the user.
        for name in ["cases", "answers"] {
            let _ = std::fs::remove_dir_all(self.path.join(name));
        }
        let _ = std::fs::remove_file(self.path.join("commitment.json"));
        if self.is_made {
            let _ = std::fs::remove_dir(&self.path);
        }
    }
}

impl Challenge {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let seed = self.seed.resolve();
        // Hours may pass before there is anything to write.
        let inputs = self.inject.iter().chain(self.reading.files());
        console.outputs().in_folder(&self.out).check(inputs)?;
        let solver = Solver::new(self.solver.as_deref(), self.limit)?;
        let mut folder = self.folder()?;
        let stop = interrupt::flag()?;
        let count = self.cases as usize;
        let work = ParallelWork { threads: self.threads.resolve().get(), stop: &stop };
        if !self.inject.is_empty() {
            let (reading, recordings) = (&self.reading, self.inject.as_slice());
            let (out, solver) = (folder.path.as_path(), &solver);
            let answer =
                Injection { reading, recordings, out, seed, solver }.run(console, &work)?;
            folder.is_kept = true;
            return Ok(answer);
        }
        let domain = self.domain.into();
        let cases = work.map_cases(console, count, "drawing cases", |index| {
            let tier = self.tier.map_or_else(|| Tier::mixed(index), |tier| (tier.into(), index));
            let case = Case::generate(domain, seed, index, tier);
            write_case(&folder.case(index), &case)?;
            Ok(case)
        })?;
        let truth = SealedTruth::of(&cases);
        let commitment = truth.commitment().map_err(Failure::system)?;
        write([(folder.path.join("commitment.json"), commitment)])?;
        console.say(format!(
            "{} of seed {seed}, sealed      {}",
            pluralise(count, "case"),
            truth.sha256
        ))?;
        let answers = work.map_cases(console, count, "solving", |index| {
            solver.answer(&folder.case(index), &folder.answer(index), &stop)
        })?;
        folder.is_kept = true;
        let answers_sha256 = challenge_report::answers_sha256(&answers);
        console.say(format!("answers                      {answers_sha256}"))?;
        let text = truth.open().map_err(Failure::system)?.to_owned();
        write([(folder.path.join("truth.json"), text)])?;
        let errors = work.map_cases(console, count, "proving", |index| {
            Ok(cases[index].errors(answers[index].model.as_deref()))
        })?;
        let scored = ScoredChallenge::of(seed, domain, truth, &answers, errors);
        let outcomes = scored.outcomes_json().map_err(Failure::system)?;
        let page = folder.path.join("report.html");
        let mut outputs = console.outputs();
        outputs.put(&folder.path.join("outcomes.json"), outcomes);
        outputs.put_page(&page, scored.page());
        console.write(outputs, "trued.challenge/1", &scored.figures)?;
        console.say(scored.text(wrap::columns_of_stdout()))?;
        console.say(format!("report              {}", page.display()))?;
        Ok(Answer::Done)
    }

    fn folder(&self) -> Result<Folder, Failure> {
        let taken = std::fs::read_dir(&self.out).is_ok_and(|mut entries| entries.next().is_some());
        if taken {
            let out = self.out.display();
            return Err(Failure::input(format!(
                "{out} holds something already: give --out another folder"
            )));
        }
        Folder::create(&self.out)
    }
}

fn write_case(folder: &Path, case: &Case) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(Failure::system)?;
    write(case.files().into_iter().map(|(name, text)| (folder.join(name), text)))
}

/// Writes files to a directory of the challenge's own, where nothing can be replaced.
fn write(files: impl IntoIterator<Item = (PathBuf, String)>) -> Result<(), Failure> {
    let mut outputs = Outputs::default();
    files.into_iter().for_each(|(path, text)| outputs.put(&path, text));
    Ok(outputs.write()?)
}

/// Processes many cases on several threads; results are in the order of the cases.
struct ParallelWork<'a> {
    threads: usize,
    stop: &'a AtomicBool,
}

impl ParallelWork<'_> {
    fn map_cases<T: Send>(
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
    use challenge_report::Commitment;
    use challenge_report::injection::InjectionReport;
    vec![
        ResultSchema::of::<challenge::score::ChallengeStatistics>("challenge", "trued.challenge/1"),
        ResultSchema::without_format::<Vec<challenge::score::CaseSummary>>("challenge-outcomes"),
        ResultSchema::of::<Commitment<'_>>("challenge-commitment", "trued.commitment/1"),
        ResultSchema::of::<InjectionReport>("challenge-injection", "trued.injection/1"),
    ]
}
