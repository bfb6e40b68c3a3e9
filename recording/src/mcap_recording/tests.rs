//! MCAP recordings, complete and truncated.

use super::*;
use crate::series::{Channel, RequiredData, read_text};
use proptest::prelude::*;
use std::path::Path;

fn header() -> Header {
    Header {
        cell: "demo".to_owned(),
        version: "0.1.0".to_owned(),
        model_hash: 0x0123_4567_89ab_cdef,
        robot: "ABB IRB 1600-6/1.45, serial 1600-00001".to_owned(),
        robot_maker: "ABB".to_owned(),
        robot_type: "IRB 1600-6/1.45".to_owned(),
        robot_serial: "1600-00001".to_owned(),
        model_epoch: 1,
        geometry_hash: 0xfedc_ba98_7654_3210,
        model: "schema = \"trued.model/1\"\n".to_owned(),
        config: String::new(),
        joints: vec![JointKind::Revolute, JointKind::Prismatic],
        status_words: vec!["corrected".to_owned(), "held".to_owned()],
        reason_words: Vec::new(),
    }
}

fn cycle(seq: u64) -> CycleRecord {
    let q = seq as f64 * 1e-3 + 1.0 / 3.0;
    CycleRecord {
        t_ns: 1_700_000_000_000_000_000 + seq * 1_000_000,
        seq,
        session: 7,
        received_ns: seq * 1_000_000 + 17,
        published_ns: seq * 1_000_000 + 900,
        status: (seq % 3) as u32,
        q_command: InlineVec::from_slice(&[q, -q]),
        q_corrected: InlineVec::from_slice(&[q + 1e-4, -q]),
        q_measured: InlineVec::from_slice(&[q, -q + 1e-5]),
        wrench_used: InlineVec::from_slice(&[1.0, 2.0, 3.0, 0.1, 0.2, 0.3]),
        wrench_in_base: 0,
        temperature_c: InlineVec::from_slice(&[20.5, 30.0]),
        residual_m: 1e-12,
        spindle_rpm: f64::NAN,
        feed_m_s: 0.01,
        model_epoch: 1,
        q_wanted: InlineVec::from_slice(&[2e-4, 0.0]),
        ..CycleRecord::default()
    }
}

struct Scratch(std::path::PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let dir = std::env::temp_dir().join(format!("trued-box-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&dir).unwrap();
        Self(dir)
    }

    fn file(&self) -> std::path::PathBuf {
        self.0.join("run.mcap")
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A reading of both clocks: the wall clock is at noon of 2026-01-02.
const NOW: Clocks = Clocks { monotonic_ns: 5_000_000, wall_ns: 1_767_355_200_000_000_000 };

fn write_run(path: &Path, cycles: u64) -> McapWriter {
    let mut black_box = McapWriter::create(path, &header(), NOW).unwrap();
    black_box.write_log(&LogRecord { says: "started".to_owned(), ..LogRecord::default() }).unwrap();
    for seq in 0..cycles {
        black_box.write_cycle(&cycle(seq)).unwrap();
    }
    let data = (0..12).map(f64::from).collect();
    for seq in 1..3 {
        let block = ForceRecord {
            seq,
            rate_hz: 1000.0,
            channels: 3,
            t_ns: seq * 4_000_000,
            data: Vec::clone(&data),
            session: 1,
        };
        black_box.write_force(&block).unwrap();
    }
    black_box
}

#[test]
fn a_change_of_the_model_stands_in_the_file_and_the_header_stays_the_first_one() {
    let scratch = Scratch::new("model");
    let mut black_box = write_run(&scratch.file(), 20);
    let next =
        Header { model_hash: 7, model_epoch: 2, model: "name = \"next\"".to_owned(), ..header() };
    black_box.write_model_change(&next, 123).unwrap();
    // The cycle activates a model before the recorder is informed, and cycles of the previous one
    // may come later.
    for (seq, model_epoch) in [(20, 2), (21, 1), (22, 3)] {
        black_box.write_cycle(&CycleRecord { model_epoch, ..cycle(seq) }).unwrap();
    }
    black_box.finish().unwrap();
    let contents = read(&scratch.file()).unwrap();
    assert_eq!(contents.header, header());
    let Conversion { runs, .. } = convert(&contents);
    let found: Vec<_> = runs
        .iter()
        .map(|run| (run.cycles.len(), run.header.as_ref().map(|header| header.model.as_str())))
        .collect();
    let (first, second) = (header().model, next.model.clone());
    let wanted = [(20, Some(&*first)), (1, Some(&*second)), (1, Some(&*first)), (1, None)];
    assert_eq!(found, wanted);
    assert_eq!(contents.model_changes, [ModelChange { t_ns: 123, header: next }]);
    let cycles = contents.records.iter().filter(|record| matches!(record, Record::Cycle(_)));
    assert_eq!((cycles.count(), contents.cut), (23, None));
}

#[test]
fn written_records_are_read_back() {
    let scratch = Scratch::new("whole");
    let black_box = write_run(&scratch.file(), 100);
    black_box.finish().unwrap();
    let contents = read(&scratch.file()).unwrap();
    assert_eq!(contents.header, header());
    assert_eq!((contents.records.len(), contents.unknown), (103, 0));
    assert!(contents.cut.is_none());
    let Record::Cycle(found) = &contents.records[8] else { panic!() };
    assert_eq!(format!("{found:?}"), format!("{:?}", cycle(7)));
    assert!(
        McapWriter::create(&scratch.file(), &header(), NOW).is_err(),
        "an old run is not touched"
    );
}

#[test]
fn a_file_that_is_cut_anywhere_gives_its_whole_chunks() {
    let scratch = Scratch::new("cut");
    let mut black_box = write_run(&scratch.file(), 50);
    black_box.flush().unwrap();
    let after_first = black_box.bytes() as usize;
    for seq in 50..80 {
        black_box.write_cycle(&cycle(seq)).unwrap();
    }
    // As after a kill: data added since the flush is not in a chunk yet.
    let bytes = std::fs::read(scratch.file()).unwrap();
    assert_eq!(bytes.len(), after_first);
    assert_eq!(read_bytes("x", &bytes).unwrap().records.len(), 53);
    black_box.finish().unwrap();
    let bytes = std::fs::read(scratch.file()).unwrap();
    for end in (after_first..bytes.len()).step_by(97) {
        let found = read_bytes("x", &bytes[..end]).unwrap().records.len();
        assert!(found == 53 || found == 83, "{found} at {end}");
    }
}

#[test]
fn a_black_box_becomes_a_recording_without_loss() {
    let scratch = Scratch::new("convert");
    write_run(&scratch.file(), 20).finish().unwrap();
    let conversion = convert(&read(&scratch.file()).unwrap());
    let [run] = &conversion.runs[..] else { panic!("{} runs", conversion.runs.len()) };
    let text = String::from_utf8(run.cycles.to_csv()).unwrap();
    let back = read_text("x.csv", &text, None, None, RequiredData::Measurement).unwrap();
    for (row, seq) in (0..20).enumerate() {
        let wanted = cycle(seq);
        let column = |channel| back.column(channel).unwrap()[row];
        let text = |name: &str| {
            let (_, cells) = back.other.iter().find(|(other, _)| other == name).unwrap();
            cells[row].clone()
        };
        assert_eq!(text("command_ns").parse(), Ok(wanted.t_ns));
        assert_eq!(text("published_ns").parse(), Ok(wanted.published_ns));
        assert_eq!(column(Channel::Command(1)), wanted.q_command.as_slice()[1]);
        assert_eq!(column(Channel::Motor(0)), wanted.q_measured.as_slice()[0]);
        assert_eq!(text("c1_rad").parse(), Ok(wanted.q_corrected.as_slice()[0]));
        assert_eq!(text("c2_m").parse(), Ok(wanted.q_corrected.as_slice()[1]));
        assert_eq!(column(Channel::JointTemperature(0)), 30.0);
        assert_eq!(column(Channel::Feed), 0.01);
        assert_eq!(text("wanted1_rad").parse(), Ok(2e-4));
        assert_eq!(text("model_epoch"), "1");
        assert_eq!(text("residual_m").parse(), Ok(1e-12));
        assert_eq!(text("status"), ["corrected", "held", "2"][wanted.status as usize]);
    }
    assert_eq!(back.joint_kind(1), JointKind::Prismatic);
    let forces = conversion.forces.unwrap();
    assert_eq!(forces.t_s, [0.0, 0.001, 0.002, 0.003, 0.004, 0.005, 0.006, 0.007]);
    assert_eq!(forces.column(Channel::Wrench(2)).unwrap()[..4], [8.0, 9.0, 10.0, 11.0]);
}

#[test]
fn forces_that_began_later_than_the_cycles_count_from_the_first_cycle_too() {
    let late = |t_ns: u64, seq: u64| {
        let data = vec![1.0, 2.0];
        let block =
            ForceRecord { seq, rate_hz: 1000.0, channels: 1, t_ns, data, ..Default::default() };
        Record::Force(block)
    };
    let start_ns = cycle(0).t_ns;
    let cycles = (0..3).map(|seq| Record::Cycle(Box::new(cycle(seq))));
    let forces = [late(start_ns + 3_167_000_000, 1), late(start_ns + 3_169_000_000, 2)];
    let mut contents = Contents {
        header: header(),
        records: cycles.chain(forces).collect(),
        ..Contents::default()
    };
    let made = convert(&contents);
    let times: Vec<f64> = made.forces.unwrap().t_s.iter().map(|t_s| t_s * 1e3).collect();
    assert_eq!(
        times.iter().map(|t| t.round()).collect::<Vec<_>>(),
        [3167.0, 3168.0, 3169.0, 3170.0]
    );
    assert!(!made.forces_by_own_clock);
    // Before the first cycle: negative. Without cycles: from the first sample.
    contents.records.insert(0, late(start_ns - 2_000_000_000, 0));
    assert_eq!(convert(&contents).forces.unwrap().t_s[0], -2.0);
    contents.records.retain(|record| matches!(record, Record::Force(_)));
    assert_eq!(convert(&contents).forces.unwrap().t_s[0], 0.0);
    // The clock of another machine.
    contents.records = vec![Record::Cycle(Box::new(cycle(0))), late(5, 1)];
    let made = convert(&contents);
    assert!(made.forces_by_own_clock && made.forces.unwrap().t_s[0] == 0.0);
}

#[test]
fn a_file_of_a_version_without_epochs_gives_each_cycle_the_last_model_before_it() {
    let scratch = Scratch::new("older");
    let none = |header: Header| Header { model_epoch: 0, ..header };
    let mut black_box = McapWriter::create(&scratch.file(), &none(header()), NOW).unwrap();
    let next = none(Header { model: "name = \"next\"".to_owned(), ..header() });
    black_box.write_model_change(&next, 5_000_000).unwrap();
    for seq in [4, 5] {
        black_box.write_cycle(&CycleRecord { model_epoch: 0, ..cycle(seq) }).unwrap();
    }
    black_box.finish().unwrap();
    let contents = read(&scratch.file()).unwrap();
    let models = contents.records.iter().filter_map(|record| match record {
        Record::Cycle(cycle) => contents.model_of(cycle).map(|header| header.model.clone()),
        _ => None,
    });
    assert_eq!(models.collect::<Vec<_>>(), [header().model, next.model]);
}

#[test]
fn a_message_of_a_version_with_fewer_fields_is_read() {
    let mut out = cdr::CdrWriter::default();
    out.begin();
    let full = StatusRecord { cycles: 7, mode: "full".to_owned(), ..StatusRecord::default() };
    records::Message::put(&full, &mut out);
    // Two empty lists; before them mode, bypass, epoch and latency.
    let without_joints = out.bytes().len() - 2 * 4;
    let without_mode = without_joints - 5 * 8 - 4 - 12;
    let plain = StatusRecord { mode: String::new(), ..full.clone() };
    for (length, wanted) in [(without_joints, full), (without_mode, plain)] {
        let read = Record::decode("/trued/status", &out.bytes()[..length]);
        assert_eq!(read, Some(Record::Status(wanted)));
    }
}

#[test]
fn log_times_are_wall_clock_and_follow_a_clock_that_is_set() {
    let scratch = Scratch::new("clocks");
    let mut black_box = write_run(&scratch.file(), 10);
    let set = Clocks { monotonic_ns: 20_000_000, wall_ns: NOW.wall_ns + 3_600_000_000_000 };
    black_box.set_clocks(set).unwrap();
    black_box.write_cycle(&cycle(20)).unwrap();
    black_box.finish().unwrap();
    let info = info(&scratch.file()).unwrap();
    assert_eq!(info.clocks, [NOW, set]);
    let cycles = &info.channels[0];
    assert_eq!((cycles.topic.as_str(), cycles.messages), ("/trued/cycle", 11));
    // The first was received 5 ms before the clocks were read.
    assert_eq!(cycles.first_ns, NOW.wall_ns - 5_000_000 + 17);
    assert_eq!(cycles.last_ns, set.wall_ns + 17);
}

#[test]
fn a_file_that_was_not_closed_is_made_whole_with_all_that_can_be_read() {
    let scratch = Scratch::new("repair");
    let path = scratch.file();
    let mut black_box = write_run(&path, 50);
    black_box.flush().unwrap();
    assert!(matches!(repair(&path), Err(McapRecordingError::InUse { .. })), "it is being written");
    assert_eq!(info(&path).unwrap().end, FileState::BeingWritten);
    let before = std::fs::read(&path).unwrap();
    black_box.finish().unwrap();
    let whole = std::fs::read(&path).unwrap();
    assert_eq!((repair(&path).unwrap(), is_closed(&path).unwrap()), (Repair::NotNeeded, true));
    for end in [before.len(), before.len() + 20, whole.len() - 300, whole.len() - 1] {
        std::fs::write(&path, &whole[..end]).unwrap();
        assert!(matches!(info(&path).unwrap().end, FileState::Cut(_)), "{end}");
        assert!(!is_closed(&path).unwrap());
        let Repair::Done { messages, .. } = repair(&path).unwrap() else { panic!("{end}") };
        let contents = read(&path).unwrap();
        assert_eq!((messages, contents.records.len(), contents.cut), (53, 53, None), "{end}");
        let info = info(&path).unwrap();
        assert_eq!((info.end, info.models[0].cycles), (FileState::Closed, 50), "{end}");
        assert!(info.repaired.is_some());
        assert_eq!(repair(&path).unwrap(), Repair::NotNeeded);
        assert_eq!(std::fs::read_dir(&scratch.0).unwrap().count(), 1, "nothing is left beside it");
    }
}

/// Where the first chunk begins.
fn first_chunk(bytes: &[u8]) -> u64 {
    let mut offset = mcap::MAGIC.len();
    while bytes[offset] != mcap::records::op::CHUNK {
        offset +=
            9 + u64::from_le_bytes(bytes[offset + 1..offset + 9].try_into().unwrap()) as usize;
    }
    offset as u64
}

#[test]
fn an_index_that_points_elsewhere_is_seen_and_mended() {
    let scratch = Scratch::new("index");
    let path = scratch.file();
    write_run(&path, 50).finish().unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    let chunk = first_chunk(&bytes).to_le_bytes();
    let place = bytes.windows(8).rposition(|window| window == chunk).unwrap();
    // As written by versions that queried the file while its opening was buffered.
    bytes[place..place + 8].fill(0);
    std::fs::write(&path, &bytes).unwrap();
    assert_eq!(info(&path).unwrap().end, FileState::WrongIndex);
    assert!(matches!(repair(&path), Ok(Repair::Done { messages: 53, .. })));
    assert_eq!(info(&path).unwrap().end, FileState::Closed);
}

#[test]
fn a_file_that_cannot_be_repaired_stays_as_it_is() {
    let scratch = Scratch::new("no-repair");
    for bytes in [&b""[..], b"t_s,q1_deg\n0,1\n", mcap::MAGIC] {
        std::fs::write(scratch.file(), bytes).unwrap();
        assert!(repair(&scratch.file()).is_err());
        assert_eq!(std::fs::read(scratch.file()).unwrap(), bytes);
    }
}

#[test]
fn a_file_that_was_removed_is_noticed() {
    let scratch = Scratch::new("gone");
    let black_box = write_run(&scratch.file(), 1);
    assert!(black_box.is_linked());
    std::fs::remove_file(scratch.file()).unwrap();
    assert!(!black_box.is_linked());
}

#[test]
fn other_files_are_no_black_box() {
    for bytes in [&b""[..], b"t_s,q1_deg\n", mcap::MAGIC] {
        assert!(read_bytes("x", bytes).is_err());
    }
}

/// Where the chunk records begin, and their lengths.
fn chunks(bytes: &[u8]) -> Vec<(usize, usize)> {
    let (mut at, mut found) = (mcap::MAGIC.len(), Vec::new());
    while let Some(length) = bytes.get(at + 1..at + 9) {
        let length = 9 + u64::from_le_bytes(length.try_into().unwrap()) as usize;
        if bytes[at] == mcap::records::op::CHUNK {
            found.push((at, length));
        }
        at += length;
    }
    found
}

/// A recording of three chunks of 20 cycles each after the chunk of the definitions, closed or not.
fn three_chunks(path: &Path, is_closed: bool) -> Vec<u8> {
    let _ = std::fs::remove_file(path);
    let mut black_box = McapWriter::create(path, &header(), NOW).unwrap();
    for seq in 0..60 {
        black_box.write_cycle(&cycle(seq)).unwrap();
        if seq % 20 == 19 {
            black_box.flush().unwrap();
        }
    }
    let cut = std::fs::read(path).unwrap();
    black_box.finish().unwrap();
    if is_closed { std::fs::read(path).unwrap() } else { cut }
}

fn seqs(contents: &Contents) -> Vec<u64> {
    let seq = |record: &Record| match record {
        Record::Cycle(cycle) => Some(cycle.seq),
        _ => None,
    };
    contents.records.iter().filter_map(seq).collect()
}

#[test]
fn a_damaged_chunk_is_named_counted_and_skipped_and_the_original_stays_beside_the_repaired_file() {
    for is_closed in [true, false] {
        let scratch = Scratch::new("damaged");
        let path = scratch.file();
        let mut bytes = three_chunks(&path, is_closed);
        let (at, length) = chunks(&bytes)[2];
        bytes[at + length / 2] ^= 4;
        std::fs::write(&path, &bytes).unwrap();
        let contents = read(&path).unwrap();
        let rest: Vec<u64> = (0..20).chain(40..60).collect();
        assert_eq!(seqs(&contents), rest);
        let [damage] = contents.damage.as_slice() else { panic!("{:?}", contents.damage) };
        assert_eq!((damage.at_byte, damage.bytes), (at as u64, length as u64));
        assert_eq!(damage.messages, Some(20), "by the message index");
        assert!(damage.to_string().contains("20 messages lost"), "{damage}");
        assert_eq!(info(&path).unwrap().damage, contents.damage);
        let Repair::Done { messages: 40, loss: Some(loss), .. } = repair(&path).unwrap() else {
            panic!("not repaired")
        };
        assert_eq!((loss.messages, &loss.original), (Some(20), &original_path(&path, 1)));
        assert_eq!(std::fs::read(&loss.original).unwrap(), bytes, "the original");
        let repaired = read(&path).unwrap();
        assert_eq!((seqs(&repaired), repaired.cut, repaired.damage), (rest, None, Vec::new()));
        assert_eq!(repair(&path).unwrap(), Repair::NotNeeded);
        // Another file of that name: the first original is not overwritten.
        std::fs::write(&path, &bytes).unwrap();
        assert!(matches!(repair(&path).unwrap(), Repair::Done { loss: Some(second), .. }
            if second.original == original_path(&path, 2)));
        assert_eq!(std::fs::read(&loss.original).unwrap(), bytes);
    }
}

#[test]
fn a_bit_flipped_anywhere_in_the_head_of_a_chunk_costs_no_other_chunk_and_no_loss_is_silent() {
    let scratch = Scratch::new("heads");
    for is_closed in [true, false] {
        let whole = three_chunks(&scratch.file(), is_closed);
        let (at, _) = chunks(&whole)[2];
        for (place, bit) in (at..at + 49).flat_map(|place| [0, 3, 7].map(|bit| (place, bit))) {
            let mut bytes = whole.clone();
            bytes[place] ^= 1 << bit;
            let contents = read_bytes("x", &bytes).unwrap();
            let found = seqs(&contents);
            let others = (0..20).chain(40..60).filter(|seq| found.contains(seq)).count();
            assert_eq!(others, 40, "byte {} bit {bit}: {:?}", place - at, contents.damage);
            let is_named = !contents.damage.is_empty();
            assert!(found.len() == 60 || is_named, "byte {} bit {bit}", place - at);
        }
    }
}

#[test]
fn where_the_chunk_of_the_definitions_is_damaged_the_messages_are_read_nevertheless() {
    let scratch = Scratch::new("definitions");
    for is_closed in [true, false] {
        let mut bytes = three_chunks(&scratch.file(), is_closed);
        let (at, length) = chunks(&bytes)[0];
        bytes[at + length / 2] ^= 1;
        let contents = read_bytes("x", &bytes).unwrap();
        assert_eq!((seqs(&contents).len(), contents.damage.len()), (60, 1));
    }
}

#[test]
fn the_part_of_a_chunk_that_a_kill_leaves_at_the_end_is_no_damage() {
    let scratch = Scratch::new("partial");
    let path = scratch.file();
    let bytes = three_chunks(&path, false);
    let (at, length) = chunks(&bytes)[3];
    let cut = &bytes[..at + length - 10];
    std::fs::write(&path, cut).unwrap();
    let done = repair(&path).unwrap();
    assert!(matches!(done, Repair::Done { messages: 40, loss: None, .. }), "{done:?}");
    assert!(!original_path(&path, 1).exists());
}

#[test]
fn compressed_chunks_are_no_damage_and_such_a_file_is_not_repaired() {
    let scratch = Scratch::new("compressed");
    let whole = three_chunks(&scratch.file(), false);
    let (at, _) = chunks(&whole)[0];
    let mut chunk = [0; 28].to_vec();
    chunk.extend([4, 0, 0, 0]);
    chunk.extend(b"zstd");
    chunk.extend([0; 8]);
    let mut bytes = whole[..at].to_vec();
    bytes.push(mcap::records::op::CHUNK);
    bytes.extend((chunk.len() as u64).to_le_bytes());
    bytes.extend(chunk);
    std::fs::write(scratch.file(), &bytes).unwrap();
    let why = repair(&scratch.file()).unwrap_err().to_string();
    assert!(why.contains("compressed (zstd)"), "{why}");
    assert_eq!(std::fs::read(scratch.file()).unwrap(), bytes);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn no_bytes_make_the_reader_panic(places in prop::collection::vec((any::<usize>(), any::<u8>()), 1..6)) {
        static WHOLE: std::sync::OnceLock<Vec<u8>> = std::sync::OnceLock::new();
        let whole = WHOLE.get_or_init(|| {
            let scratch = Scratch::new("fuzz");
            write_run(&scratch.file(), 5).finish().unwrap();
            std::fs::read(scratch.file()).unwrap()
        });
        let mut bytes = whole.clone();
        for (offset, byte) in places {
            let offset = offset % bytes.len();
            bytes[offset] = byte;
        }
        let _ = read_bytes("x", &bytes).map(|contents| convert(&contents));
        let scratch = Scratch::new("fuzzed");
        std::fs::write(scratch.file(), &bytes).unwrap();
        let _ = info(&scratch.file());
        if let Ok(Repair::Done { .. }) = repair(&scratch.file()) {
            assert!(is_closed(&scratch.file()).unwrap());
        }
    }
}
