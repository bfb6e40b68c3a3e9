//! Runs a set: its recordings copied into a separate folder, the program as a child process, its results cached.
//!
//! A result belongs to this program, these arguments and these input bytes; a run that exceeds its
//! time limit is ended and reported. Nothing is written to the folder of data.

use std::cell::{OnceCell, RefCell};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use report::Svg;
use sha2::{Digest, Sha256};

use super::EvidenceSettings;

/// A drawing of the set, and its caption.
pub(super) struct Figure {
    pub(super) caption: String,
    pub(super) drawing: Svg,
}

/// Outcome of a run.
pub(super) enum RunOutcome {
    /// Done; folder of its files.
    Done(PathBuf),
    /// Ended after this many seconds.
    Late(f64),
    /// Invalid input or a failure, with the program's message.
    Refused(String),
    /// Another set was requested, and no result is stored.
    NotRun,
}

/// Runs the cases of one set.
pub(super) struct SetRunner {
    program: PathBuf,
    data: PathBuf,
    folder: PathBuf,
    limit_s: f64,
    is_selected: bool,
    pub(super) challenge: Option<u32>,
    figure: RefCell<Option<Figure>>,
    /// Hash of the program's bytes.
    digest: OnceCell<Vec<u8>>,
}

impl SetRunner {
    pub(super) fn new(settings: &EvidenceSettings, set: &str) -> Result<Self, String> {
        let whole = |path: &Path| std::path::absolute(path).map_err(|why| why.to_string());
        let folder = whole(&settings.work)?.join(set);
        fs::create_dir_all(&folder).map_err(|why| format!("{}: {why}", folder.display()))?;
        Ok(Self {
            program: whole(&settings.program)?,
            data: whole(&settings.data)?.join(set),
            folder,
            limit_s: settings.limit_s,
            is_selected: settings.only.as_deref().is_none_or(|only| only == set),
            challenge: settings.challenge,
            figure: RefCell::new(None),
            digest: OnceCell::new(),
        })
    }

    /// Missing files of a set.
    pub(super) fn missing_files(&self, needs: &[&str]) -> Vec<String> {
        let absent = needs.iter().filter(|name| !self.data.join(name).is_file());
        absent.map(|name| (*name).to_owned()).collect()
    }

    /// A file of the set.
    pub(super) fn data(&self, name: &str) -> Result<String, String> {
        let path = self.data.join(name);
        fs::read_to_string(&path).map_err(|why| format!("{}: {why}", path.display()))
    }

    /// Copies files of the set unchanged into the folder of its runs.
    pub(super) fn copy(&self, names: &[&str]) -> Result<(), String> {
        names.iter().try_for_each(|name| {
            let bytes = fs::read(self.data.join(name)).map_err(|why| format!("{name}: {why}"))?;
            self.write(name, &bytes)
        })
    }

    /// Writes a file into the folder of the set's runs.
    pub(super) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> Result<(), String> {
        let path = self.folder.join(name);
        fs::write(&path, bytes).map_err(|why| format!("{}: {why}", path.display()))
    }

    /// Content of a file, empty if it does not exist.
    pub(super) fn read(&self, name: &str) -> String {
        fs::read_to_string(self.folder.join(name)).unwrap_or_default()
    }

    /// Stores the drawing of the set: the first one offered by a run.
    pub(super) fn offer_figure(&self, page: &Path, caption: &str, caption_text: &str) {
        let page = fs::read_to_string(page).unwrap_or_default();
        let mut figure = self.figure.borrow_mut();
        if let (None, Some(drawing)) = (figure.as_ref(), Svg::of_page(&page, caption)) {
            *figure = Some(Figure { caption: caption_text.to_owned(), drawing });
        }
    }

    pub(super) fn figure(&self) -> Option<Figure> {
        self.figure.borrow_mut().take()
    }

    /// Runs `trued WORDS` in the set's folder; `run` is its name, `OUT` in the words is its output
    /// folder.
    pub(super) fn run_trued(&self, run: &str, arguments: &[&str]) -> Result<RunOutcome, String> {
        let out = self.folder.join(run);
        let kept = self.folder.join(format!("{run}.kept"));
        let key = self.cache_key(arguments)?;
        let before = fs::read_to_string(&kept).unwrap_or_default();
        if let Some(outcome) = before.strip_prefix(&format!("{key}\n")) {
            return Ok(parse_outcome(outcome, out));
        }
        if !self.is_selected {
            return Ok(RunOutcome::NotRun);
        }
        if out.exists() {
            fs::remove_dir_all(&out).map_err(|why| format!("{}: {why}", out.display()))?;
        }
        let place = run.to_owned();
        let arguments_filled: Vec<String> =
            arguments.iter().map(|argument| argument.replace("OUT", &place)).collect();
        // A command that writes single files needs the folder; one that requires an empty folder
        // gets it too.
        fs::create_dir_all(&out).map_err(|why| format!("{}: {why}", out.display()))?;
        let outcome = self.run(run, &arguments_filled)?;
        fs::write(&kept, format!("{key}\n{outcome}")).map_err(|why| why.to_string())?;
        Ok(parse_outcome(&outcome, out))
    }

    /// `done`, `late SECONDS` or `refused WHY`.
    fn run(&self, run: &str, arguments: &[String]) -> Result<String, String> {
        let log = self.folder.join(format!("{run}.log"));
        let file = fs::File::create(&log).map_err(|why| format!("{}: {why}", log.display()))?;
        let mut command = Command::new(&self.program);
        command.args(arguments).current_dir(&self.folder).env("NO_COLOR", "1");
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(file);
        let child = command.spawn().map_err(|why| format!("{}: {why}", self.program.display()))?;
        let Some(status) = wait_with_limit(child, self.limit_s)? else {
            return Ok(format!("late {}", self.limit_s));
        };
        let output = fs::read_to_string(&log).unwrap_or_default();
        // Exit code 1 is a result too: a check that found faults.
        Ok(match status.code() {
            Some(0 | 1) => "done".to_owned(),
            _ => {
                // The first of several faults is below a line with their number.
                let why = output.lines().find_map(|line| line.strip_prefix("error: "));
                let why = why.unwrap_or("without a word").trim_start_matches("error: ");
                format!("refused {why}")
            }
        })
    }

    /// The program, the arguments, and the bytes of every file named by an argument, with its
    /// mapping and its TOML.
    fn cache_key(&self, arguments: &[&str]) -> Result<String, String> {
        let mut hash = Sha256::new();
        if self.digest.get().is_none() {
            let program = fs::read(&self.program)
                .map_err(|why| format!("{}: {why}", self.program.display()))?;
            self.digest.get_or_init(|| Sha256::digest(program).to_vec());
        }
        hash.update(self.digest.get().map_or(&[][..], Vec::as_slice));
        for argument in arguments {
            hash.update(argument.as_bytes());
            let path = self.folder.join(argument);
            for path in
                [path.clone(), path.with_extension("mapping.toml"), path.with_extension("toml")]
            {
                if path.is_file() {
                    hash.update(fs::read(&path).map_err(|why| why.to_string())?);
                }
            }
            hash.update([0]);
        }
        Ok(hash.finalize().iter().fold(String::new(), |mut text, byte| {
            let _ = write!(text, "{byte:02x}");
            text
        }))
    }
}

fn parse_outcome(outcome: &str, out: PathBuf) -> RunOutcome {
    match outcome.split_once(' ') {
        Some(("late", seconds)) => RunOutcome::Late(seconds.parse().unwrap_or(0.0)),
        Some(("refused", why)) => RunOutcome::Refused(why.to_owned()),
        _ => RunOutcome::Done(out),
    }
}

/// Exit status of a child process; `None` if it exceeded the time limit and was ended.
fn wait_with_limit(mut child: Child, limit_s: f64) -> Result<Option<ExitStatus>, String> {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait().map_err(|why| why.to_string())? {
            return Ok(Some(status));
        }
        if start.elapsed().as_secs_f64() > limit_s {
            child.kill().map_err(|why| why.to_string())?;
            child.wait().map_err(|why| why.to_string())?;
            return Ok(None);
        }
        std::thread::sleep(Duration::from_millis(200));
    }
}

/// The JSON of a file; null if it does not exist.
pub(super) fn json(path: &Path) -> serde_json::Value {
    let text = fs::read_to_string(path).unwrap_or_default();
    serde_json::from_str(&text).unwrap_or_default()
}
