//! Writes the rings to the recording (MCAP).
//!
//! Thread `recorder`, 20 times a second. A disk that is full, slow or read-only costs only records,
//! which are counted; when it can be written again a new file is started, and files that were not
//! closed are repaired. A removed file or folder is created again. The newest files are kept and
//! older ones removed; files kept on request or because of an alarm are never removed. The cycle
//! never waits for this thread.

use crate::alarms::Alarms;
use crate::exchange::{CycleRecord, Exchange, RecorderAnswer};
use crate::{records, repair, retention};
use physics::JointKind;
use recording::cell::Recorder as Settings;
use recording::mcap_recording::{
    self, Clocks, ForceRecord, Header, InlineVec, McapRecordingError, McapWriter, ModelChange,
};
use shm_schema::{
    Answer, Command, Corrected, CorrectionStatus, Reason, RecorderAction, RecorderState,
    monotonic_ns,
};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering::Relaxed;
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use tracing::{info, warn};

/// How often the rings are drained: far below the time in which they fill.
const DRAIN_EVERY: Duration = Duration::from_millis(50);
/// Interval at which drained data are flushed, so that they survive a kill: together with a drain
/// interval below the documented half second.
const FLUSH_EVERY: Duration = Duration::from_millis(400);
/// Waiting time after a failure before a new file is tried: recording resumes within a second after
/// the failure ends.
const RETRY_AFTER: Duration = Duration::from_millis(500);
/// A recording that ended within this time before an alarm is kept too. Chosen: a minute of cutting before a chatter alarm shows its cause.
const BEFORE_ALARM: Duration = Duration::from_secs(60);
/// The recording that begins within this time after an alarm is kept too. Chosen: an operator reacts within half a minute.
const AFTER_ALARM: Duration = Duration::from_secs(30);

/// State of the recorder.
pub struct Recorder {
    settings: Settings,
    header: Header,
    joints: usize,
    file: Option<McapWriter>,
    /// The previous recording, to be kept once its repair has ended.
    previous_to_keep: Option<PathBuf>,
    /// The running repair of recordings that were not closed.
    repairing: Option<JoinHandle<()>>,
    /// Whether a file should be written: recording may have been stopped on request.
    is_on: bool,
    alarms: Alarms,
    /// A file that is started before this time is kept too.
    keep_until: Option<Instant>,
    flushed: Instant,
    retry_at: Option<Instant>,
    /// Whether there may be files that were not closed.
    may_repair: bool,
}

impl Recorder {
    /// A recorder without a file.
    pub fn new(settings: Settings, header: Header) -> Self {
        let joints = header.joints.len();
        let now = Instant::now();
        Self {
            joints,
            file: None,
            previous_to_keep: None,
            repairing: None,
            is_on: settings.starts_recording,
            alarms: Alarms::default(),
            keep_until: None,
            flushed: now,
            retry_at: None,
            may_repair: true,
            settings,
            header,
        }
    }

    /// Runs until the exchange is stopped, then writes the remaining records and closes the file.
    pub fn run(&mut self, exchange: &Exchange) {
        if !self.is_on {
            exchange.set_recorder(RecorderState::Stopped);
            let (dir, cell) = (self.settings.dir.clone(), self.header.cell.clone());
            // No file is open, so none is excluded.
            self.repairing = repair::start(dir, cell, PathBuf::new());
            self.may_repair = false;
        }
        while exchange.is_running() {
            self.run_once(exchange);
            std::thread::sleep(DRAIN_EVERY);
        }
        self.run_once(exchange);
        self.finish();
    }

    /// Closes the file with its index; returns whether it could be written.
    fn finish(&mut self) -> bool {
        let Some(Err(fault)) = self.file.take().map(McapWriter::finish) else { return true };
        warn!(%fault, "a recording has no index but can still be read");
        self.may_repair = true;
        false
    }

    fn run_once(&mut self, exchange: &Exchange) {
        exchange.counters.recorder_turn_ns.store(monotonic_ns(), Relaxed);
        self.begin_file(exchange);
        if let Err(fault) = self.drain(exchange) {
            warn!(%fault, "the recorder pauses");
            exchange.set_recorder(RecorderState::Failed);
            (self.file, self.may_repair) = (None, true);
            self.retry_at = Some(Instant::now() + RETRY_AFTER);
        }
        if let Some(action) = exchange.recorder_requests.pop() {
            self.answer(exchange, action);
        }
        self.keep_previous();
    }

    /// Carries out a request.
    fn answer(&mut self, exchange: &Exchange, action: RecorderAction) {
        let done = |message: String| RecorderAnswer { answer: Answer::Done, message };
        let answer = match action {
            RecorderAction::Start => {
                self.is_on = true;
                self.retry_at = None;
                self.begin_file(exchange);
                match &self.file {
                    Some(file) => done(format!("recording to {}", file.path().display())),
                    None => refused("the recording cannot be written; see the daemon's log"),
                }
            }
            RecorderAction::Stop => {
                self.is_on = false;
                let path = self.file.as_ref().map(|file| file.path().display().to_string());
                let has_index = self.finish();
                exchange.set_recorder(RecorderState::Stopped);
                done(match path {
                    None => "nothing is being recorded".to_owned(),
                    Some(path) if has_index => format!("stopped; {path} is closed"),
                    Some(path) => format!(
                        "stopped; {path} could not be closed; `trued info --repair` restores its index"
                    ),
                })
            }
            RecorderAction::Keep => self.keep("asked for"),
        };
        exchange.recorder_answers.force_push(answer);
    }

    /// Keeps the present recording, the one just before it, and the one that follows.
    fn keep(&mut self, why: &str) -> RecorderAnswer {
        let Settings { dir, kept_files_max, .. } = &self.settings;
        let Some(file) = &mut self.file else { return refused("nothing is being recorded") };
        let all = retention::recordings(dir, &self.header.cell);
        let mut count = all.iter().filter(|path| retention::is_kept(path)).count();
        let earlier = retention::previous_recording(dir, &self.header.cell, file.path());
        if !retention::is_kept(file.path()) {
            if count >= *kept_files_max {
                return refused(&format!(
                    "{count} recordings are already kept (recorder.kept_files_max); move some of {} elsewhere",
                    dir.display()
                ));
            }
            let kept = retention::kept_path(file.path());
            if let Err(fault) = file.rename(&kept) {
                return refused(&fault.to_string());
            }
            info!(file = %kept.display(), why, "this recording is kept");
            count += 1;
        }
        self.keep_until = Some(Instant::now() + AFTER_ALARM);
        let message = format!("{} is kept", file.path().display());
        let is_wanted = |path: &PathBuf| !retention::is_kept(path) && ended_recently(path);
        if count < *kept_files_max {
            self.previous_to_keep = earlier.filter(is_wanted);
            self.keep_previous();
        }
        RecorderAnswer { answer: Answer::Done, message }
    }

    /// Keeps the recording before the present one, once its repair has ended.
    fn keep_previous(&mut self) {
        if self.repairing.as_ref().is_some_and(|repairing| !repairing.is_finished()) {
            return;
        }
        if let Some(path) = self.previous_to_keep.take() {
            keep_closed(&path);
        }
    }

    /// Keeps the recording that follows a kept one. Only one: short files would use up the allowed
    /// number.
    fn keep_following(&mut self) {
        let RecorderAnswer { answer, message } = self.keep("it follows one that is kept");
        self.keep_until = None;
        if answer != Answer::Done {
            warn!(message, "the recording after a kept one is not kept");
        }
    }

    /// Keeps the recording in which an alarm began.
    fn alarm(&mut self, why: &str) {
        if !self.settings.keeps_alarms || self.file.is_none() {
            return;
        }
        let RecorderAnswer { answer, message } = self.keep(why);
        if answer != Answer::Done {
            warn!(why, message, "the recording of an alarm is not kept");
        }
    }

    /// Starts a file if none is open, or if the present one is full.
    fn begin_file(&mut self, exchange: &Exchange) {
        if !self.is_on || self.retry_at.is_some_and(|instant| Instant::now() < instant) {
            return;
        }
        let full = |file: &McapWriter| file.bytes() >= self.settings.max_file_bytes;
        if self.file.as_ref().is_some_and(|file| !full(file)) {
            return;
        }
        self.finish();
        match self.create() {
            Ok(file) => {
                info!(file = %file.path().display(), "black box");
                exchange.set_recorder(RecorderState::Recording);
                let Settings { dir, keep_files, .. } = &self.settings;
                let cell = &self.header.cell;
                retention::remove_oldest(dir, cell, *keep_files, file.path());
                if std::mem::take(&mut self.may_repair) {
                    self.repairing =
                        repair::start(dir.clone(), cell.clone(), file.path().to_owned());
                }
                (self.file, self.retry_at) = (Some(file), None);
                if self.keep_until.take().is_some_and(|until| Instant::now() < until) {
                    self.keep_following();
                }
            }
            Err(fault) => {
                if exchange.recorder(monotonic_ns()) != RecorderState::Failed {
                    warn!(%fault, "not recording for now");
                }
                exchange.set_recorder(RecorderState::Failed);
                self.retry_at = Some(Instant::now() + RETRY_AFTER);
            }
        }
    }

    fn create(&mut self) -> Result<McapWriter, McapRecordingError> {
        let dir = &self.settings.dir;
        fs::create_dir_all(dir).map_err(|source| McapRecordingError::Io {
            action: "create the folder",
            path: dir.clone(),
            source,
        })?;
        McapWriter::create(&retention::next_path(dir, &self.header.cell), &self.header, clocks())
    }

    /// Stores a change of the model: new files begin with it, and it is written to the open one.
    fn change_model(&mut self, change: ModelChange) -> Result<(), McapRecordingError> {
        let Header { cell, config, .. } = std::mem::take(&mut self.header);
        self.header = Header { cell, config, ..change.header };
        match &mut self.file {
            Some(file) => file.write_model_change(&self.header, change.t_ns),
            None => Ok(()),
        }
    }

    /// Counts a lost record, unless recording is off.
    fn count_dropped(&self, exchange: &Exchange) {
        if self.is_on {
            exchange.counters.recorder_dropped.fetch_add(1, Relaxed);
        }
    }

    /// Empties the rings. Without a file, their content is dropped, and counted if there should be
    /// one.
    fn drain(&mut self, exchange: &Exchange) -> Result<(), McapRecordingError> {
        while let Some(change) = exchange.model_changes.pop() {
            self.change_model(*change)?;
        }
        while let Some(cycle) = exchange.cycles.pop() {
            match &mut self.file {
                Some(file) => file.write_cycle(&cycle_record(&cycle, self.joints))?,
                None => self.count_dropped(exchange),
            }
        }
        while let Some(block) = exchange.blocks.pop() {
            let record = self.file.is_some().then(|| force_record(&block));
            let _ = exchange.empty_blocks.push(block);
            match (&mut self.file, record) {
                (Some(file), Some(record)) => file.write_force(&record)?,
                _ => self.count_dropped(exchange),
            }
        }
        while let Some(verdict) = exchange.verdicts.pop() {
            if let Some(why) = self.alarms.new_alarm(&verdict) {
                self.alarm(&why);
            }
            match &mut self.file {
                Some(file) => file.write_verdict(&records::verdict(&verdict))?,
                None => self.count_dropped(exchange),
            }
        }
        self.drain_log(exchange)?;
        if self.flushed.elapsed() >= FLUSH_EVERY {
            self.flush()?;
        }
        Ok(())
    }

    /// Writes log lines and states. Without a file they wait in their rings, so that the next file
    /// contains what happened meanwhile.
    fn drain_log(&mut self, exchange: &Exchange) -> Result<(), McapRecordingError> {
        let Some(file) = &mut self.file else { return Ok(()) };
        while let Some(state) = exchange.states.pop() {
            file.write_status(&state)?;
        }
        while let Some(line) = exchange.lines.pop() {
            file.write_log(&line)?;
        }
        Ok(())
    }

    /// Flushes the file to protect it from a kill, and checks that it still exists.
    fn flush(&mut self) -> Result<(), McapRecordingError> {
        self.flushed = Instant::now();
        let Some(file) = &mut self.file else { return Ok(()) };
        file.set_clocks(clocks())?;
        file.flush()?;
        if !file.is_linked() {
            warn!(file = %file.path().display(), "the recording was removed; a new one is started");
            self.file = None;
        }
        Ok(())
    }
}

fn refused(message: &str) -> RecorderAnswer {
    RecorderAnswer { answer: Answer::Refused, message: message.to_owned() }
}

/// Whether a recording ended less than [`BEFORE_ALARM`] ago.
fn ended_recently(path: &Path) -> bool {
    let changed = fs::metadata(path).and_then(|file| file.modified());
    // If the clock was set back since, its end is in the future: this also counts as recent.
    changed.is_ok_and(|time| time.elapsed().unwrap_or_default() < BEFORE_ALARM)
}

/// Keeps a recording that is already closed.
fn keep_closed(path: &Path) {
    match fs::rename(path, retention::kept_path(path)) {
        Ok(()) => info!(file = %path.display(), "the previous recording is kept too"),
        Err(why) => {
            warn!(%why, file = %path.display(), "the previous recording could not be kept");
        }
    }
}

/// Both clocks, now.
fn clocks() -> Clocks {
    let wall = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let wall_ns = u64::try_from(wall.as_nanos()).unwrap_or(u64::MAX);
    Clocks { monotonic_ns: monotonic_ns(), wall_ns }
}

/// Header of the recording: properties of the run as a whole.
pub fn header(
    cell: &str,
    model: &recording::model::RobotModel,
    model_epoch: u64,
    config: String,
) -> Header {
    let name = |name: &Option<String>| name.clone().unwrap_or_default();
    let joints: Vec<JointKind> =
        model.physics.arm.joints().iter().map(|joint| joint.kind).collect();
    Header {
        cell: cell.to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        model_hash: model.hash,
        robot: model.file.robot.to_string(),
        robot_maker: name(&model.file.robot.maker),
        robot_type: name(&model.file.robot.kind),
        robot_serial: name(&model.file.robot.serial),
        model_epoch,
        geometry_hash: model.file.identity().geometry_hash(),
        model: model.file.to_toml(),
        config,
        joints,
        status_words: CorrectionStatus::ALL.iter().map(ToString::to_string).collect(),
        reason_words: Reason::ALL.iter().map(ToString::to_string).collect(),
    }
}

fn cycle_record(cycle: &CycleRecord, joints: usize) -> mcap_recording::CycleRecord {
    let (command, corrected): (&Command, &Corrected) = (&cycle.command, &cycle.corrected);
    let warmth = &cycle.celsius[..=joints];
    let known = warmth.iter().any(|celsius| !celsius.is_nan());
    let (trim, measured) = (cycle.trim, cycle.trim.and_then(|(_, newest)| newest));
    let wrench_is_known = !cycle.wrench[0].is_nan();
    mcap_recording::CycleRecord {
        t_ns: command.t_ns,
        seq: command.seq,
        session: command.session,
        received_ns: corrected.received_ns,
        published_ns: corrected.made_ns,
        status: corrected.status,
        reason: corrected.reason,
        segment: 0,
        steps: corrected.iterations,
        q_command: InlineVec::from_slice(command.joints()),
        q_corrected: InlineVec::from_slice(
            &corrected.added_to(command.joints())[..command.joints().len()],
        ),
        q_measured: InlineVec::EMPTY,
        tau: InlineVec::EMPTY,
        wrench_used: if wrench_is_known {
            InlineVec::from_slice(&cycle.wrench)
        } else {
            InlineVec::EMPTY
        },
        wrench_in_base: u8::from(cycle.wrench_in_base),
        temperature_c: if known { InlineVec::from_slice(warmth) } else { InlineVec::EMPTY },
        residual_m: corrected.residual_m,
        residual_rad: corrected.residual_rad,
        spindle_rpm: f64::NAN,
        feed_m_s: f64::NAN,
        model_epoch: corrected.model_epoch,
        q_wanted: InlineVec::from_slice(&corrected.wanted[..joints.min(corrected.wanted.len())]),
        trim_m: trim.map_or(InlineVec::EMPTY, |(trim_m, _)| InlineVec::from_slice(&trim_m)),
        measured_m: measured
            .map_or(InlineVec::EMPTY, |point| InlineVec::from_slice(&point.point_m)),
        measured_ns: measured.map_or(0, |point| point.t_ns),
        feed_override: corrected.feed_override,
    }
}

fn force_record(block: &shm_schema::ForceBlock) -> ForceRecord {
    let count = (block.channels * block.samples) as usize;
    ForceRecord {
        t_ns: block.t_ns,
        seq: block.seq,
        session: block.session,
        rate_hz: block.rate_hz,
        channels: block.channels,
        data: block.data.get(..count).unwrap_or_default().to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_schema::{Verdict, VibrationState};

    /// A recorder that starts a file at each iteration.
    fn of_short_files(name: &str) -> (PathBuf, Recorder) {
        let dir =
            std::env::temp_dir().join(format!("trued-recorder-{}-{name}", std::process::id()));
        let settings = Settings {
            dir: dir.clone(),
            max_file_bytes: 1,
            keep_files: 2,
            starts_recording: true,
            keeps_alarms: true,
            kept_files_max: 4,
        };
        (dir, Recorder::new(settings, Header { cell: "a".to_owned(), ..Header::default() }))
    }

    #[test]
    fn an_alarm_keeps_its_recording_the_one_before_and_the_one_after_and_no_more_than_allowed() {
        let (dir, mut recorder) = of_short_files("alarm");
        let exchange = Exchange::new(corrector::Mode::Full, true);
        let kept = || {
            retention::recordings(&dir, "a").iter().filter(|path| retention::is_kept(path)).count()
        };
        recorder.run_once(&exchange);
        recorder.run_once(&exchange);
        assert_eq!(kept(), 0);
        let state = VibrationState::Alarm.code();
        exchange.verdicts.push(Verdict { event: 1, state, ..Verdict::default() }).unwrap();
        recorder.run_once(&exchange);
        // The one before it is kept as soon as the repair of recordings, a thread of its own, has ended.
        while recorder.previous_to_keep.is_some() {
            std::thread::yield_now();
            recorder.keep_previous();
        }
        assert_eq!(kept(), 2, "with the one before it");
        recorder.run_once(&exchange);
        assert_eq!(kept(), 3, "what follows");
        for _ in 0..4 {
            recorder.run_once(&exchange);
        }
        assert_eq!(kept(), 3, "one that follows, no more");
        let all = retention::recordings(&dir, "a").len();
        assert_eq!(all, 5, "the others are removed as ever");
        assert_eq!(recorder.keep("asked for").answer, Answer::Done);
        assert_eq!(kept(), 4, "as many as are allowed: without the one before it");
        recorder.run_once(&exchange);
        assert_eq!(recorder.keep("asked for").answer, Answer::Refused);
        assert_eq!(kept(), 4);
        fs::remove_dir_all(&dir).unwrap();
    }

    #[test]
    fn without_recording_no_losses_are_counted() {
        let (dir, mut recorder) = of_short_files("stopped");
        recorder.is_on = false;
        let exchange = Exchange::new(corrector::Mode::Full, true);
        exchange.verdicts.push(Verdict::default()).unwrap();
        recorder.run_once(&exchange);
        assert!(!dir.exists() && exchange.verdicts.is_empty());
        assert_eq!(exchange.counters.recorder_dropped.load(Relaxed), 0);
        recorder.answer(&exchange, RecorderAction::Start);
        assert_eq!(retention::recordings(&dir, "a").len(), 1);
        recorder.answer(&exchange, RecorderAction::Stop);
        assert_eq!(exchange.recorder(monotonic_ns()), RecorderState::Stopped);
        fs::remove_dir_all(&dir).unwrap();
    }

    #[test]
    fn the_recording_before_is_kept_once_its_repair_has_ended() {
        let (dir, mut recorder) = of_short_files("repairing");
        let exchange = Exchange::new(corrector::Mode::Full, true);
        recorder.run_once(&exchange);
        recorder.run_once(&exchange);
        let [earlier, _] = retention::recordings(&dir, "a").try_into().unwrap();
        let (end, ended) = std::sync::mpsc::channel::<()>();
        recorder.repairing = Some(std::thread::spawn(move || _ = ended.recv()));
        assert_eq!(recorder.keep("asked for").answer, Answer::Done);
        recorder.keep_previous();
        assert!(earlier.exists(), "it is being repaired");
        end.send(()).unwrap();
        while recorder.repairing.as_ref().is_some_and(|repairing| !repairing.is_finished()) {
            std::thread::yield_now();
        }
        recorder.keep_previous();
        assert!(!earlier.exists() && retention::kept_path(&earlier).exists());
        fs::remove_dir_all(&dir).unwrap();
    }

    #[test]
    fn a_recording_that_ended_long_ago_did_not_lead_to_an_alarm() {
        let (dir, mut recorder) = of_short_files("long-ago");
        let exchange = Exchange::new(corrector::Mode::Full, true);
        recorder.run_once(&exchange);
        recorder.run_once(&exchange);
        let [earlier, _] = retention::recordings(&dir, "a").try_into().unwrap();
        let long_ago = SystemTime::now() - BEFORE_ALARM - Duration::from_secs(1);
        fs::File::open(&earlier).unwrap().set_modified(long_ago).unwrap();
        assert_eq!(recorder.keep("asked for").answer, Answer::Done);
        assert!(earlier.exists(), "not kept");
        fs::remove_dir_all(&dir).unwrap();
    }
}
