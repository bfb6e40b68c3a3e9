//! `trued info`: content of a recording of the daemon, and its repair.
//!
//! The file is only read, unless `--repair` is given; then it is replaced by a complete one in one
//! step, or remains unchanged. Where a part cannot be read, the original is kept and the exit code is 1.

use std::path::PathBuf;

use clap::Args;
use recording::mcap_recording::{self, Damage, FileState, Info, Loss, ModelInfo, Repair, Utc};
use report::{TextTable, pluralise};
use serde::Serialize;
use tracing::warn;

use crate::exit::{Answer, Failure, Outcome};
use crate::output::Console;
use crate::table::on_stdout;

/// Show the contents of a recording of the daemon
///
/// Shows times, channels with message counts, models, robot, and whether the file was closed. A file that was not closed (daemon killed, disk full)
/// is read by trued up to its end; other programs need `--repair` first. The daemon repairs the files of its cell at its next start. A chunk that is damaged (a bit that
/// flipped, a bad block) is skipped and named, with the number of its messages; the exit code is 1 then.
#[derive(Debug, Args)]
pub(crate) struct InfoCommand {
    /// Repair a file that was not closed, has an invalid index or damaged chunks: replace it by a complete one with all readable messages. If a part cannot be read, the
    /// original is kept beside it as NAME.damaged.mcap
    #[arg(long)]
    repair: bool,
    /// The recording (MCAP)
    #[arg(value_name = "FILE.mcap")]
    input: PathBuf,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Report<'a> {
    cell: &'a str,
    recorded_by: &'a str,
    robot: Robot<'a>,
    bytes: u64,
    /// `closed`, `being_written`, `cut`, `wrong_index`.
    end: &'static str,
    /// Why it is truncated; `None` if it is complete.
    cut: Option<&'a str>,
    /// Parts that cannot be read; with `--repair`: that could not be read.
    damaged: Vec<DamagedPart>,
    /// The original, kept by this repair because a part of it cannot be read.
    original: Option<String>,
    /// Fault before the repair; none if it was not repaired.
    repaired: Option<&'a str>,
    begin_utc: Option<String>,
    end_utc: Option<String>,
    duration_s: Option<f64>,
    channels: Vec<Channel<'a>>,
    models: Vec<Model<'a>>,
    cycles_of_unknown_models: u64,
}

/// A part of a recording that cannot be read.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct DamagedPart {
    /// Where it begins in the file.
    at_byte: u64,
    bytes: u64,
    /// What is wrong.
    why: String,
    /// Number of its messages; none if it is not known.
    messages_lost: Option<u64>,
    /// Log time of its first message, as the chunk states it.
    begin_utc: Option<String>,
    /// Log time of its last message.
    end_utc: Option<String>,
}

impl From<&Damage> for DamagedPart {
    fn from(damage: &Damage) -> Self {
        Self {
            at_byte: damage.at_byte,
            bytes: damage.bytes,
            why: damage.why.clone(),
            messages_lost: damage.messages,
            begin_utc: damage.between_ns.map(|(begin, _)| Utc(begin).to_string()),
            end_utc: damage.between_ns.map(|(_, end)| Utc(end).to_string()),
        }
    }
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Robot<'a> {
    maker: &'a str,
    #[serde(rename = "type")]
    kind: &'a str,
    serial: &'a str,
    geometry_hash: String,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Channel<'a> {
    topic: &'a str,
    messages: u64,
    per_s: Option<f64>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Model<'a> {
    epoch: u64,
    name: String,
    hash: String,
    robot: &'a str,
    cycles: u64,
}

impl InfoCommand {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let loss = if self.repair { self.repair(console)? } else { None };
        let info = mcap_recording::info(&self.input).map_err(Failure::input)?;
        let mut report = report(&info);
        if let Some(loss) = &loss {
            report.damaged = loss.damage.iter().map(DamagedPart::from).collect();
            report.original = Some(loss.original.display().to_string());
        }
        console.json_of([&self.input], "trued.info/1", &report)?;
        self.print_info(console, &info, &report)?;
        for damage in &info.damage {
            warn!("{}: {damage}", self.input.display());
        }
        let is_whole = loss.is_none() && info.damage.is_empty();
        Ok(if is_whole { Answer::Done } else { Answer::No })
    }

    /// What was lost by the repair.
    fn repair(&self, console: &mut Console) -> Result<Option<Loss>, Failure> {
        use mcap_recording::McapRecordingError::{InUse, NotOurs};
        let repaired = mcap_recording::repair(&self.input).map_err(|why| match why {
            InUse { .. } | NotOurs { .. } => Failure::input(why),
            why => Failure::system(why),
        })?;
        match repaired {
            Repair::NotNeeded => {
                console.say("the file is complete; nothing to repair")?;
                Ok(None)
            }
            Repair::Done { messages, loss, .. } => {
                let recovered = count_u64(messages, "message");
                console.say(format!("repaired: {recovered} recovered"))?;
                if let Some(loss) = &loss {
                    self.print_loss(console, loss)?;
                }
                Ok(loss)
            }
        }
    }

    fn print_loss(&self, console: &mut Console, loss: &Loss) -> Result<(), Failure> {
        for damage in &loss.damage {
            warn!("{}: {damage}", self.input.display());
        }
        let lost = match loss.messages {
            Some(count) => format!("{} lost", count_u64(count, "message")),
            None => "an unknown number of messages lost".to_owned(),
        };
        console.say(format!("{lost}; the original is kept as {}", loss.original.display()))
    }

    fn print_info(&self, console: &mut Console, info: &Info, report: &Report<'_>) -> Outcome {
        let (header, robot) = (&info.header, &report.robot);
        let stated =
            |name: &str| if name.is_empty() { "not stated".to_owned() } else { name.to_owned() };
        let mib = info.bytes as f64 / f64::from(1 << 20);
        console.say(format!("file      {} ({mib:.1} MiB)", self.input.display()))?;
        console.say(format!("cell      {}, recorded by trued {}", header.cell, header.version))?;
        console.say(format!("robot     {}", stated(&header.robot)))?;
        console.say(format!("geometry  {}", robot.geometry_hash))?;
        if let (Some(begin), Some(end)) = (&report.begin_utc, &report.end_utc) {
            let seconds = report.duration_s.unwrap_or(0.0);
            console.say(format!("time      {begin} to {end} ({seconds:.1} s)"))?;
        }
        console.say(format!("closed    {}", ending(info)))?;
        let mut channels = TextTable::new(["channel", "messages", "per s"]);
        for channel in &report.channels {
            let rate = channel.per_s.map_or(String::new(), |rate| format!("{rate:.1}"));
            channels = channels.row([channel.topic.to_owned(), channel.messages.to_string(), rate]);
        }
        console.say(format!("\n{}", on_stdout(&channels)))?;
        let mut models = TextTable::new(["model", "epoch", "hash", "cycles"]);
        for model in &report.models {
            let Model { epoch, name, hash, cycles, .. } = model;
            models =
                models.row([name.clone(), epoch.to_string(), hash.clone(), cycles.to_string()]);
        }
        console.say(format!("\n{}", on_stdout(&models)))?;
        if report.cycles_of_unknown_models > 0 {
            let cycles = count_u64(report.cycles_of_unknown_models, "cycle");
            console.say(format!("{cycles} with models that the file does not contain"))?;
        }
        Ok(Answer::Done)
    }
}

fn report(info: &Info) -> Report<'_> {
    let header = &info.header;
    let times = info.channels.iter().filter(|channel| channel.messages > 0);
    let begin_ns = times.clone().map(|channel| channel.first_ns).min();
    let end_ns = times.map(|channel| channel.last_ns).max();
    let span = begin_ns.zip(end_ns).map(|(begin, end)| (end - begin) as f64 * 1e-9);
    let channels = info.channels.iter().map(|channel| {
        let span_s = channel.last_ns.saturating_sub(channel.first_ns) as f64 * 1e-9;
        let intervals = channel.messages.saturating_sub(1) as f64;
        let per_s = (span_s > 0.0).then(|| intervals / span_s);
        Channel { topic: &channel.topic, messages: channel.messages, per_s }
    });
    Report {
        cell: &header.cell,
        recorded_by: &header.version,
        robot: Robot {
            maker: &header.robot_maker,
            kind: &header.robot_type,
            serial: &header.robot_serial,
            geometry_hash: format!("{:016x}", header.geometry_hash),
        },
        bytes: info.bytes,
        end: match info.end {
            FileState::Closed => "closed",
            FileState::BeingWritten => "being_written",
            FileState::Cut(_) => "cut",
            FileState::WrongIndex => "wrong_index",
        },
        cut: if let FileState::Cut(why) = &info.end { Some(why) } else { None },
        damaged: info.damage.iter().map(DamagedPart::from).collect(),
        original: None,
        repaired: info.repaired.as_deref(),
        begin_utc: begin_ns.map(|ns| Utc(ns).to_string()),
        end_utc: end_ns.map(|ns| Utc(ns).to_string()),
        duration_s: span,
        channels: channels.collect(),
        models: info.models.iter().map(model).collect(),
        cycles_of_unknown_models: info.cycles_of_unknown_models,
    }
}

fn model(model: &ModelInfo) -> Model<'_> {
    let header = &model.header;
    let parsed = recording::model::RobotModel::parse("model", &header.model);
    Model {
        epoch: header.model_epoch,
        name: parsed.map_or_else(|_| "unreadable".to_owned(), |model| model.file.name),
        hash: format!("{:016x}", header.model_hash),
        robot: &header.robot,
        cycles: model.cycles,
    }
}

/// How the file ends, and a remedy.
fn ending(info: &Info) -> String {
    match (&info.end, &info.repaired) {
        (FileState::Closed, _) if !info.damage.is_empty() => {
            "yes, with damage inside; `trued info --repair` makes a file that other programs read"
                .to_owned()
        }
        (FileState::Closed, None) => "yes".to_owned(),
        (FileState::Closed, Some(was)) => format!("by a repair ({was})"),
        (FileState::BeingWritten, _) => "no: a daemon is writing it".to_owned(),
        (FileState::Cut(_), _) => "no; repair it with `trued info --repair`".to_owned(),
        (FileState::WrongIndex, _) => {
            "yes, with an invalid index; repair it with `trued info --repair`".to_owned()
        }
    }
}

fn count_u64(number: u64, what: &str) -> String {
    pluralise(usize::try_from(number).unwrap_or(usize::MAX), what)
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<Report<'_>>("info", "trued.info/1")
}
