//! The results of a fleet as one table, and the queries on it: DataFusion over the Parquet files of `trued diagnose --batch`.
//!
//! Columns: docs/reference/batch.md. The order of files does not matter: every query orders its rows.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use datafusion::arrow::array::{Array, AsArray, RecordBatch};
use datafusion::arrow::datatypes::{DataType, Float64Type, Int64Type};
use datafusion::prelude::{ParquetReadOptions, SessionConfig, SessionContext};

use crate::error::TrendsError;
use crate::settings::Settings;
use crate::time::day;

/// Parameters of the form of an effect, not of its size: it does not vanish where they are zero, and they are no series.
const FORMS: &str = "'phase_rad', 'cycles_per_rev', 'cycles_per_m', 'reversal_mrad', 'reversal_mm', 'torque_Nm', 'torque_N', 'from_joint', 'time_constant_s', \
     'time_constant_ms', 'lag_s', 'free_length_mm', 'a_mm', 'L_mm', 'angle_deg', 'com_mm', 'frequency_Hz', 'damping_ratio', 'stribeck_speed', 'per_K', \
     'rest_position', 'range_deg', 'pivot_mm', 'reference_C', 'direction', 'axis'";

/// Columns that are needed, each with whether it is text.
const NEEDED: &[(&str, bool)] = &[
    ("key", true),
    ("robot", true),
    ("recorded_at", false),
    ("files", true),
    ("subject", true),
    ("domain", true),
    ("unit", true),
    ("ambient_C", false),
    ("effect", true),
    ("joint", false),
    ("change", true),
    ("claimed", false),
    ("parameter", true),
    ("index", false),
    ("value", false),
    ("low", false),
    ("high", false),
    ("size_rms", false),
    ("size_max", false),
    ("says", true),
];

/// One row for each domain of each recording with a time.
const RECORDINGS: &str = "SELECT key, robot, CAST(recorded_at AS BIGINT) AS at_us, files, domain, unit, MAX(\"ambient_C\") AS ambient_c \
     FROM results WHERE subject = 'recording' AND recorded_at IS NOT NULL \
     GROUP BY key, robot, recorded_at, files, domain, unit ORDER BY robot, domain, at_us, key";

/// Number of recordings of each robot, of refused ones and of those without a time.
const COUNTS: &str = "SELECT robot, COUNT(DISTINCT key) AS recordings, COUNT(DISTINCT CASE WHEN subject = 'refused' THEN key END) AS refused, \
     COUNT(DISTINCT CASE WHEN recorded_at IS NULL THEN key END) AS without_time FROM results GROUP BY robot ORDER BY robot";

/// Which effects each recording names.
const NAMES: &str = "SELECT DISTINCT key, domain, effect, joint FROM results WHERE subject = 'finding' AND claimed AND recorded_at IS NOT NULL \
     ORDER BY key, domain, effect, joint";

/// Parameters by which several effects of one kind at one joint are distinguished, rounded to whole numbers.
const KINDS: &str = "'cycles_per_rev', 'cycles_per_m', 'from_joint'";

/// Numbers of effects that are claimed often enough, with the size of the effect on the measured quantity per unit of the number. Candidates are taken with them: their
/// numbers are estimates like the others', and leaving them out would select by size. Rows of one finding share its words.
fn numbers(least_found: usize) -> String {
    format!(
        "WITH finding AS (SELECT DISTINCT key, robot, domain, effect, joint, change, parameter, \"index\", value, low, high, size_rms, size_max, claimed, says \
           FROM results WHERE subject = 'finding' AND recorded_at IS NOT NULL AND value IS NOT NULL), \
         known AS (SELECT *, MAX(CASE WHEN parameter IN ({KINDS}) THEN CAST(ROUND(value) AS BIGINT) END) \
           OVER (PARTITION BY key, domain, effect, joint, change, says) AS form FROM finding), \
         strength AS (SELECT * FROM known WHERE parameter NOT IN ({FORMS})), \
         long AS (SELECT robot, domain, effect, joint, form, change, parameter, \"index\" FROM strength \
           GROUP BY robot, domain, effect, joint, form, change, parameter, \"index\" HAVING SUM(CASE WHEN claimed THEN 1 ELSE 0 END) >= {least_found}), \
         normed AS (SELECT *, SQRT(SUM(value * value) OVER (PARTITION BY key, domain, effect, joint, change, parameter, says)) AS norm FROM strength) \
         SELECT n.key, n.robot, n.domain, n.effect, n.joint, n.form, n.change, n.parameter, n.\"index\" AS place, n.value, (n.high - n.low) / 3.92 AS sigma, \
           n.size_rms / n.norm AS rms_per_unit, n.size_max / n.norm AS max_per_unit \
         FROM normed n JOIN long l ON n.robot = l.robot AND n.domain = l.domain AND n.effect = l.effect AND (n.joint IS NOT DISTINCT FROM l.joint) \
           AND (n.form IS NOT DISTINCT FROM l.form) AND n.change = l.change AND n.parameter = l.parameter AND (n.\"index\" IS NOT DISTINCT FROM l.\"index\") \
         ORDER BY n.robot, n.domain, n.effect, n.joint, n.form, n.change, n.parameter, place, n.key, n.size_max, n.value"
    )
}

/// An effect that a recording claims.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct EffectName {
    /// Effect.
    pub effect: String,
    /// Joint, from 1; none for effects of the whole robot.
    pub joint: Option<i64>,
}

/// A domain of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Key of the result.
    pub key: String,
    /// When it was recorded, µs since 1970 in UTC.
    pub at_us: i64,
    /// Files, as the manifest names them.
    pub files: String,
    /// Mean ambient temperature, °C.
    pub ambient_c: Option<f64>,
    /// Effects that it claims, with their joints.
    pub named: Vec<EffectName>,
}

/// A robot in a domain.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Robot {
    /// Its name.
    pub name: String,
    /// `position`, `torque` or `force`.
    pub domain: String,
    /// Unit of what the domain measures.
    pub unit: String,
}

/// Identifies a parameter of an effect of a robot.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct ParameterKey {
    /// Robot.
    pub robot: String,
    /// Domain.
    pub domain: String,
    /// Effect.
    pub effect: String,
    /// Joint, from 1; none for effects of the whole robot.
    pub joint: Option<i64>,
    /// Which of several effects of this kind at the joint: cycles per revolution (per metre), or the driving joint, as a whole number.
    pub form: Option<i64>,
    /// `new`, or `revised`: a difference to the model.
    pub change: String,
    /// Parameter with its unit.
    pub parameter: String,
    /// Place in the list, from 1.
    pub index: Option<i64>,
}

impl ParameterKey {
    /// Effect, parameter and place: `axis_shift.shift_mm[2]`.
    #[must_use]
    pub fn path(&self) -> String {
        let Self { effect, parameter, .. } = self;
        self.index.map_or_else(
            || format!("{effect}.{parameter}"),
            |index| format!("{effect}.{parameter}[{index}]"),
        )
    }
}

/// A number as one recording found it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Finding {
    /// The number.
    pub value: f64,
    /// Its standard uncertainty; none where no interval was computed.
    pub sigma: Option<f64>,
    /// Size of the effect on the measured quantity per unit of the number, root mean square.
    pub rms_per_unit: Option<f64>,
    /// The same, largest.
    pub max_per_unit: Option<f64>,
}

/// Number of recordings of a robot.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RobotCounts {
    /// Robot.
    pub robot: String,
    /// All.
    pub recordings: usize,
    /// Those that were refused.
    pub refused: usize,
    /// Those without a time: they cannot be placed, and are left out.
    pub without_time: usize,
}

/// Everything read from the results.
#[derive(Debug, Clone, PartialEq)]
pub struct Results {
    /// By robot.
    pub counts: Vec<RobotCounts>,
    /// Recordings of each robot and domain in the order of time.
    pub recordings: BTreeMap<Robot, Vec<Recording>>,
    /// Numbers by series, each by the key of its recording.
    pub numbers: BTreeMap<ParameterKey, BTreeMap<String, Finding>>,
}

/// Whether a file of this name is read as a result.
#[must_use]
pub fn is_result_name(path: &Path) -> bool {
    let is_hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
    !is_hidden && path.extension().is_some_and(|end| end.eq_ignore_ascii_case("parquet"))
}

/// Reads all results in the folders.
///
/// # Errors
///
/// No folder, no result in it, a file that is no result, a recording with two results, no recording with a time.
pub fn read(folders: &[PathBuf], settings: &Settings) -> Result<Results, TrendsError> {
    let files = files(folders)?;
    let runtime = tokio::runtime::Builder::new_current_thread().build();
    let runtime =
        runtime.map_err(|why| TrendsError::Query { query: "start", why: why.to_string() })?;
    runtime.block_on(async {
        let results = match Table::results(files.clone(), settings).await {
            // A query fails where a file is damaged inside: which one?
            Err(failed @ TrendsError::Query { .. }) => {
                return Err(damaged(&files).await.unwrap_or(failed));
            }
            results => results?,
        };
        one_time(&results)?;
        if results.recordings.is_empty() {
            let recordings = results.counts.iter().map(|count| count.recordings).sum();
            return Err(TrendsError::NoTime { recordings });
        }
        Ok(results)
    })
}

/// The result files of the folders, in order, each once. Hidden ones are those of a process that was killed.
fn files(folders: &[PathBuf]) -> Result<Vec<String>, TrendsError> {
    let mut all = Vec::new();
    for folder in folders {
        let fault = |why| TrendsError::Folder { folder: folder.clone(), why };
        let before = all.len();
        for entry in std::fs::read_dir(folder).map_err(fault)? {
            let path = entry.map_err(fault)?.path();
            if is_result_name(&path) {
                check_file(&path)?;
                all.push(path.canonicalize().map_err(fault)?.to_string_lossy().into_owned());
            }
        }
        if all.len() == before {
            return Err(TrendsError::Empty { folder: folder.clone() });
        }
    }
    all.sort_unstable();
    all.dedup();
    Ok(all)
}

/// Checks that there is a file with content behind a name.
fn check_file(path: &Path) -> Result<(), TrendsError> {
    let refused = |what: &str| TrendsError::NoFile { file: path.to_owned(), what: what.to_owned() };
    let found = std::fs::metadata(path).map_err(|why| {
        let what = if path.is_symlink() { "a link to a file that is not there: " } else { "" };
        refused(&format!("{what}{why}"))
    })?;
    if !found.is_file() {
        return Err(refused(if found.is_dir() { "a folder" } else { "no regular file" }));
    }
    if found.len() == 0 {
        let (file, why) = (path.display().to_string(), "the file is empty".to_owned());
        return Err(TrendsError::NotParquet { file, why });
    }
    Ok(())
}

/// Options that accept `.PARQUET` too: the names are checked before.
fn any_ending() -> ParquetReadOptions<'static> {
    ParquetReadOptions::default().file_extension("")
}

struct Table(SessionContext);

/// Where all recordings of each robot have one and the same time, nothing can grow.
fn one_time(results: &Results) -> Result<(), TrendsError> {
    let series = || results.recordings.values().filter(|recordings| recordings.len() > 1);
    if series().next().is_some() && series().all(|recordings| has_one_time(recordings)) {
        let recordings = series().map(Vec::len).sum();
        let at_us = series().next().and_then(|all| all.first()).map_or(0, |one| one.at_us);
        return Err(TrendsError::OneTime { recordings, day: day(at_us) });
    }
    Ok(())
}

/// Whether there are several recordings, all of one time.
pub(crate) fn has_one_time(recordings: &[Recording]) -> bool {
    recordings.len() > 1 && recordings.windows(2).all(|pair| pair[0].at_us == pair[1].at_us)
}

/// The first file that cannot be read to its end.
async fn damaged(files: &[String]) -> Option<TrendsError> {
    for file in files {
        let context = SessionContext::new();
        let rows = match context.read_parquet(file, any_ending()).await {
            Ok(frame) => frame.collect().await.map(drop),
            Err(why) => Err(why),
        };
        if let Err(why) = rows {
            return Some(not_parquet(file, &why));
        }
    }
    None
}

fn not_parquet(file: &str, why: &datafusion::error::DataFusionError) -> TrendsError {
    let why = why.strip_backtrace().lines().next().unwrap_or_default().to_owned();
    TrendsError::NotParquet { file: file.to_owned(), why }
}

impl Table {
    async fn results(files: Vec<String>, settings: &Settings) -> Result<Results, TrendsError> {
        let table = Self::open(files).await?;
        Ok(Results {
            counts: table.counts().await?,
            recordings: table.recordings().await?,
            numbers: table.numbers(settings.least_found).await?,
        })
    }

    async fn open(files: Vec<String>) -> Result<Self, TrendsError> {
        let config = SessionConfig::new()
            .with_target_partitions(1)
            .set_bool("datafusion.execution.parquet.schema_force_view_types", false)
            // Writers of one format write one schema; a reader accepts further columns.
            .set_bool("datafusion.execution.parquet.skip_metadata", true);
        let context = SessionContext::new_with_config(config);
        for file in &files {
            check(&context, file).await?;
        }
        let options = any_ending();
        let frame = context.read_parquet(files, options).await;
        let registered =
            frame.and_then(|frame| context.register_table("results", frame.into_view()));
        registered.map_err(|why| TrendsError::Query { query: "results", why: why.to_string() })?;
        Ok(Self(context))
    }

    async fn rows(&self, query: &'static str, sql: &str) -> Result<Vec<Columns>, TrendsError> {
        let fault = |why: datafusion::error::DataFusionError| TrendsError::Query {
            query,
            why: why.to_string(),
        };
        let frame = self.0.sql(sql).await.map_err(fault)?;
        Ok(frame.collect().await.map_err(fault)?.into_iter().map(Columns).collect())
    }

    async fn counts(&self) -> Result<Vec<RobotCounts>, TrendsError> {
        let mut counts = Vec::new();
        for batch in self.rows("counts", COUNTS).await? {
            let whole = |name, row| {
                batch.whole(name, row).and_then(|count| usize::try_from(count).ok()).unwrap_or(0)
            };
            counts.extend((0..batch.len()).map(|row| RobotCounts {
                robot: batch.text("robot", row),
                recordings: whole("recordings", row),
                refused: whole("refused", row),
                without_time: whole("without_time", row),
            }));
        }
        Ok(counts)
    }

    async fn recordings(&self) -> Result<BTreeMap<Robot, Vec<Recording>>, TrendsError> {
        let mut named: BTreeMap<(String, String), Vec<EffectName>> = BTreeMap::new();
        for batch in self.rows("names", NAMES).await? {
            for row in 0..batch.len() {
                let recording = (batch.text("key", row), batch.text("domain", row));
                let name = EffectName {
                    effect: batch.text("effect", row),
                    joint: batch.whole("joint", row),
                };
                named.entry(recording).or_default().push(name);
            }
        }
        let mut robots: BTreeMap<Robot, Vec<Recording>> = BTreeMap::new();
        for batch in self.rows("recordings", RECORDINGS).await? {
            for row in 0..batch.len() {
                let [key, domain] = ["key", "domain"].map(|name| batch.text(name, row));
                let robot = Robot {
                    name: batch.text("robot", row),
                    domain: domain.clone(),
                    unit: batch.text("unit", row),
                };
                let recording = Recording {
                    at_us: batch.whole("at_us", row).unwrap_or_default(),
                    files: batch.text("files", row),
                    ambient_c: batch.number("ambient_c", row),
                    named: named.remove(&(key.clone(), domain)).unwrap_or_default(),
                    key,
                };
                robots.entry(robot).or_default().push(recording);
            }
        }
        for (robot, recordings) in &robots {
            check_unique(&robot.name, recordings)?;
        }
        Ok(robots)
    }

    async fn numbers(
        &self,
        least_found: usize,
    ) -> Result<BTreeMap<ParameterKey, BTreeMap<String, Finding>>, TrendsError> {
        let mut series: BTreeMap<ParameterKey, BTreeMap<String, Finding>> = BTreeMap::new();
        for batch in self.rows("numbers", &numbers(least_found)).await? {
            for row in 0..batch.len() {
                let [robot, domain, effect, change, parameter] =
                    ["robot", "domain", "effect", "change", "parameter"]
                        .map(|name| batch.text(name, row));
                let [joint, form, index] =
                    ["joint", "form", "place"].map(|name| batch.whole(name, row));
                let number =
                    ParameterKey { robot, domain, effect, joint, form, change, parameter, index };
                let [sigma, rms_per_unit, max_per_unit] = ["sigma", "rms_per_unit", "max_per_unit"]
                    .map(|name| batch.number(name, row).filter(|value| value.is_finite()));
                let Some(value) = batch.number("value", row).filter(|value| value.is_finite())
                else {
                    continue;
                };
                let found = Finding { value, sigma, rms_per_unit, max_per_unit };
                series.entry(number).or_default().insert(batch.text("key", row), found);
            }
        }
        Ok(series)
    }
}

/// Checks that no recording has two results.
fn check_unique(robot: &str, recordings: &[Recording]) -> Result<(), TrendsError> {
    let mut known: BTreeMap<(i64, &str), &str> = BTreeMap::new();
    for recording in recordings {
        if let Some(first) = known.insert((recording.at_us, &recording.files), &recording.key) {
            return Err(TrendsError::DiagnosedTwice {
                robot: robot.to_owned(),
                files: recording.files.clone(),
                recorded_at: day(recording.at_us),
                first: first.to_owned(),
                second: recording.key.clone(),
            });
        }
    }
    Ok(())
}

/// Checks that a file is a result.
async fn check(context: &SessionContext, file: &str) -> Result<(), TrendsError> {
    let frame = context.read_parquet(file, any_ending()).await;
    let frame = frame.map_err(|why| not_parquet(file, &why))?;
    for (column, is_text) in NEEDED {
        let fault = |what: String| TrendsError::Column { file: shown(file), column, what };
        let field = frame.schema().fields().iter().find(|field| field.name() == column);
        let Some(field) = field else { return Err(fault("is missing".to_owned())) };
        let fits = match field.data_type() {
            DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View => *is_text,
            DataType::Int64 | DataType::Float64 | DataType::Boolean | DataType::Timestamp(..) => {
                !is_text
            }
            _ => false,
        };
        if !fits {
            return Err(fault(format!("has the type {}", field.data_type())));
        }
    }
    Ok(())
}

fn shown(file: &str) -> String {
    Path::new(file)
        .file_name()
        .map_or_else(|| file.to_owned(), |name| name.to_string_lossy().into_owned())
}

/// Rows of a query result, with its columns by name.
struct Columns(RecordBatch);

impl Columns {
    fn len(&self) -> usize {
        self.0.num_rows()
    }

    fn column(&self, name: &str, row: usize) -> Option<&dyn Array> {
        self.0.column_by_name(name).map(AsRef::as_ref).filter(|column| column.is_valid(row))
    }

    /// Empty where there is none.
    fn text(&self, name: &str, row: usize) -> String {
        let column = self.column(name, row);
        column
            .and_then(|column| column.as_string_opt::<i32>())
            .map(|column| column.value(row).to_owned())
            .unwrap_or_default()
    }

    fn number(&self, name: &str, row: usize) -> Option<f64> {
        let column = self.column(name, row)?;
        column.as_primitive_opt::<Float64Type>().map(|column| column.value(row))
    }

    fn whole(&self, name: &str, row: usize) -> Option<i64> {
        let column = self.column(name, row)?;
        column.as_primitive_opt::<Int64Type>().map(|column| column.value(row))
    }
}
