//! Commands and targets of a robot loop in any language, cycle by cycle, checked by the [`Oracle`].
//!
//! A record has 144 bytes, little-endian: time and the newest sent stamp, ns (u64); the cell's mode
//! and the correction status, by the numbers of the C interface (u32); the limits of a joint's
//! correction: position, velocity, jerk (f64, rad, s); six commanded joints and six sent ones (f64,
//! rad).

use crate::cell_loop::{JOINTS, STATUS_S};
use crate::oracle::Oracle;
use physics::JOINTS_MAX;
use shm_schema::{JointBounds, Mode};
use std::io::{self, Write};
use trued_client::{Source, Status, Target};

const RECORD: usize = 144;
/// A correction above this is from a responding daemon, rad; without one it ramps to zero.
const CORRECTED_RAD: f64 = 1e-4;
const PLAIN: u32 = 3;

/// Writes the record of a cycle: its time and the newest sent stamp, the daemon's status, the
/// command and the target that would be sent.
///
/// # Errors
/// `out` cannot be written to.
pub fn write(
    out: &mut impl Write,
    [now_ns, stamp_ns]: [u64; 2],
    status: &Status,
    command: &[f64; JOINTS],
    target: &Target,
) -> io::Result<()> {
    let source: u32 = match target.source() {
        Source::Corrected => 0,
        Source::LastCorrection => 1,
        Source::Ramping => 2,
        Source::Plain => PLAIN,
    };
    let JointBounds { angle, rate, jerk, .. } = status.bounds;
    [now_ns, stamp_ns].iter().try_for_each(|ns| out.write_all(&ns.to_le_bytes()))?;
    [status.mode, source].iter().try_for_each(|code| out.write_all(&code.to_le_bytes()))?;
    let numbers = [angle[0], rate[0], jerk[0]].into_iter().chain(*command);
    let mut numbers = numbers.chain(target.joints().iter().copied());
    numbers.try_for_each(|number| out.write_all(&number.to_le_bytes()))
}

/// Evaluation of a file of records.
#[derive(Clone, Debug, Default)]
pub struct Evaluation {
    /// Cycles.
    pub cycles: usize,
    /// The largest correction that was sent, rad.
    pub largest_rad: f64,
    /// Share of the last cycles in which a correction was sent.
    pub corrected_at_the_end: f64,
    /// Every violation, as text.
    pub broken: Vec<String>,
}

struct Record<'a>(&'a [u8]);

impl Record<'_> {
    fn bytes<const N: usize>(&self, offset: usize) -> [u8; N] {
        self.0[offset..offset + N].try_into().expect("a whole record")
    }

    fn number(&self, offset: usize) -> f64 {
        f64::from_le_bytes(self.bytes(offset))
    }

    fn joints(&self, offset: usize) -> [f64; JOINTS] {
        std::array::from_fn(|i| self.number(offset + 8 * i))
    }

    fn bounds(&self) -> JointBounds {
        let [angle, rate, jerk] = [24, 32, 40].map(|offset| [self.number(offset); JOINTS_MAX]);
        JointBounds { min: [0.0; JOINTS_MAX], max: [0.0; JOINTS_MAX], angle, rate, jerk }
    }
}

/// Judges every record; the last `tail` of them are those in which the daemon's corrections have to be back.
#[must_use]
pub fn judge(bytes: &[u8], tail: usize) -> Evaluation {
    let mut judged = Evaluation { cycles: bytes.len() / RECORD, ..Evaluation::default() };
    let mut oracle: Option<Oracle> = None;
    let mut corrected = 0;
    for (cycle, bytes) in bytes.chunks_exact(RECORD).enumerate() {
        let record = Record(bytes);
        let [now_ns, stamp_ns] = [0, 8].map(|offset| u64::from_le_bytes(record.bytes(offset)));
        let [mode, source] = [16, 20].map(|offset| u32::from_le_bytes(record.bytes(offset)));
        let (command, sent) = (record.joints(48), record.joints(96));
        let bounds = record.bounds();
        let oracle = oracle.get_or_insert_with(|| Oracle::new(&bounds, STATUS_S));
        oracle.set_bounds(now_ns, &bounds);
        oracle.set_shadow(now_ns, mode == Mode::Shadow.code() && source != PLAIN);
        if let Err(violation) = oracle.take(now_ns, stamp_ns, &command, &sent) {
            judged.broken.push(format!("cycle {cycle}: {violation}"));
        }
        let largest =
            command.iter().zip(&sent).map(|(q, sent)| (sent - q).abs()).fold(0.0, f64::max);
        judged.largest_rad = judged.largest_rad.max(largest);
        let is_plain = sent.map(f64::to_bits) == command.map(f64::to_bits);
        if source == PLAIN && !is_plain {
            judged.broken.push(format!("cycle {cycle}: plain, but {sent:?} for {command:?}"));
        }
        corrected += usize::from(cycle + tail >= judged.cycles && largest > CORRECTED_RAD);
    }
    judged.corrected_at_the_end = corrected as f64 / tail.max(1) as f64;
    judged
}
