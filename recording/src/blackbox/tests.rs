//! Black boxes, whole and cut off.

use super::*;
use crate::series::{Channel, Need, read_text};
use proptest::prelude::*;
use std::path::Path;

fn header() -> Header {
    Header {
        cell: "demo".to_owned(),
        version: "0.1.0".to_owned(),
        model_hash: 0x0123_4567_89ab_cdef,
        robot: "ABB IRB 1600-6/1.45, serial 1600-00001".to_owned(),
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
        q_command: Few::of(&[q, -q]),
        q_corrected: Few::of(&[q + 1e-4, -q]),
        q_measured: Few::of(&[q, -q + 1e-5]),
        wrench_used: Few::of(&[1.0, 2.0, 3.0, 0.1, 0.2, 0.3]),
        wrench_in_base: 0,
        temperature_c: Few::of(&[20.5, 30.0]),
        residual_m: 1e-12,
        spindle_rpm: f64::NAN,
        feed_m_s: 0.01,
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

fn write_run(path: &Path, cycles: u64) -> BlackBox {
    let mut black_box = BlackBox::create(path, &header()).unwrap();
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
    let next = Header { model_hash: 7, model: "name = \"next\"".to_owned(), ..header() };
    black_box.write_model_change(&next, 123).unwrap();
    black_box.write_cycle(&cycle(21)).unwrap();
    black_box.finish().unwrap();
    let contents = read(&scratch.file()).unwrap();
    assert_eq!(contents.header, header());
    assert_eq!(contents.model_changes, [ModelChange { t_ns: 123, header: next }]);
    let cycles = contents.records.iter().filter(|record| matches!(record, Record::Cycle(_)));
    assert_eq!((cycles.count(), contents.cut), (21, None));
}

#[test]
fn what_is_written_is_read_back() {
    let scratch = Scratch::new("whole");
    let black_box = write_run(&scratch.file(), 100);
    black_box.finish().unwrap();
    let contents = read(&scratch.file()).unwrap();
    assert_eq!(contents.header, header());
    assert_eq!((contents.records.len(), contents.unknown), (103, 0));
    assert!(contents.cut.is_none());
    let Record::Cycle(found) = &contents.records[8] else { panic!() };
    assert_eq!(format!("{found:?}"), format!("{:?}", cycle(7)));
    assert!(BlackBox::create(&scratch.file(), &header()).is_err(), "an old run is not touched");
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
    // As a kill leaves it: what was added since the flush is in no chunk yet.
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
    let text = String::from_utf8(conversion.cycles.to_csv()).unwrap();
    let back = read_text("x.csv", &text, None, None, Need::Measurement).unwrap();
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
        assert_eq!(text("residual_m").parse(), Ok(1e-12));
        assert_eq!(text("status"), ["corrected", "held", "2"][wanted.status as usize]);
    }
    assert_eq!(back.joint_kind(1), JointKind::Prismatic);
    let forces = conversion.forces.unwrap();
    assert_eq!(forces.t_s, [0.0, 0.001, 0.002, 0.003, 0.004, 0.005, 0.006, 0.007]);
    assert_eq!(forces.column(Channel::Wrench(2)).unwrap()[..4], [8.0, 9.0, 10.0, 11.0]);
}

#[test]
fn other_files_are_no_black_box() {
    for bytes in [&b""[..], b"t_s,q1_deg\n", mcap::MAGIC] {
        assert!(read_bytes("x", bytes).is_err());
    }
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
        for (at, byte) in places {
            let at = at % bytes.len();
            bytes[at] = byte;
        }
        let _ = read_bytes("x", &bytes).map(|contents| convert(&contents));
    }
}
