//! A robot's loop in Rust with random faults: its commands and the targets it would send to the
//! robot are written to a file, one record per cycle, for the test that checks them.
//!
//! `faulty-loop CELL FILE CYCLES CALM SEED`: CYCLES cycles with random faults, then CALM cycles without.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::time::Duration;
use tests::cell_loop::{JOINTS, TICK_NS, path};
use tests::loop_records;
use tests::rng::TestRng;
use trued_client::{Client, SendError, Setpoint, monotonic_ns};

type Fault = Box<dyn std::error::Error>;

/// Change of the clock that stamps commands, ns.
const CLOCKS_NS: [u64; 5] = [0, 300_000_000, 600_000_000, 2_000_000_000, 3_600_000_000_000];
const PATIENCE: Duration = Duration::from_micros(500);

/// The faults of the loop itself, one cycle after the other.
struct Faults {
    chance: TestRng,
    clock_ns: u64,
    phase_ns: u64,
    joint: usize,
    /// Cycles for which a joint stays outside its limits.
    outside: u64,
    is_silent: bool,
    jumps: bool,
}

impl Faults {
    fn strike(&mut self, client: &mut Client) -> Result<(), Fault> {
        let c = &mut self.chance;
        let fault = c.below(10_000);
        (self.is_silent, self.jumps) = ((20..40).contains(&fault), fault == 6);
        match fault {
            0..3 => std::thread::sleep(Duration::from_nanos(c.below(300_000_000))),
            3 => self.phase_ns += c.below(2_000_000_000),
            4 => self.clock_ns = CLOCKS_NS[c.below(5) as usize],
            5 => client.start_anew(),
            10..14 => no_number(client, c)?,
            14..17 => {
                self.joint = c.below(JOINTS as u64) as usize;
                self.outside = 1 + c.below(1000);
            }
            _ => {}
        }
        Ok(())
    }

    fn end(&mut self) {
        (self.clock_ns, self.outside, self.is_silent, self.jumps) = (0, 0, false, false);
    }

    fn command(&mut self) -> [f64; JOINTS] {
        let mut q = path(monotonic_ns() + self.phase_ns);
        if self.jumps {
            q[self.chance.below(JOINTS as u64) as usize] += 1.0;
        }
        if self.outside > 0 {
            q[self.joint] += 7.0;
            self.outside -= 1;
        }
        q
    }
}

/// A NaN or infinite command has to return an error and change nothing.
fn no_number(client: &mut Client, rng: &mut TestRng) -> Result<(), Fault> {
    let before = client.last_target();
    let mut q = path(0);
    q[rng.below(JOINTS as u64) as usize] =
        [f64::NAN, f64::INFINITY, -f64::INFINITY][rng.below(3) as usize];
    if client.send(&Setpoint::new(&q)).is_ok() || client.target_for(&q, monotonic_ns()).is_ok() {
        return Err("no number was answered".into());
    }
    if client.last_target().map(|target| target.joints().to_vec())
        != before.map(|target| target.joints().to_vec())
    {
        return Err("what was sent last has changed".into());
    }
    Ok(())
}

fn main() -> Result<(), Fault> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [cell, file, faulty, calm, seed] = &arguments[..] else {
        return Err("faulty-loop CELL FILE CYCLES CALM SEED".into());
    };
    let faulty: u64 = faulty.parse()?;
    let calm: u64 = calm.parse()?;
    let mut file = BufWriter::new(File::create(file)?);
    let mut client = Client::connect(cell, Duration::from_secs(10))?;
    let chance = TestRng::new(seed.parse()?);
    let mut wrong = Faults {
        chance,
        clock_ns: 0,
        phase_ns: 0,
        joint: 0,
        outside: 0,
        is_silent: false,
        jumps: false,
    };
    let (mut due_ns, mut stamp_ns) = (monotonic_ns(), 0);
    for k in 0..faulty + calm {
        if k < faulty {
            wrong.strike(&mut client)?;
        } else if k == faulty {
            wrong.end();
        }
        due_ns = (due_ns + TICK_NS).max(monotonic_ns());
        std::thread::sleep(Duration::from_nanos(due_ns.saturating_sub(monotonic_ns())));
        let command = wrong.command();
        if !wrong.is_silent {
            // Time of the cycle, as stamped by a cell's own clock.
            let t_ns = due_ns + wrong.clock_ns;
            let sent = client.send(&Setpoint::new(&command).at_ns(t_ns));
            if matches!(sent, Ok(_) | Err(SendError::Lost)) {
                stamp_ns = t_ns;
            }
            if let Ok(seq) = sent {
                client.wait_corrected(seq, PATIENCE);
            }
        }
        let now_ns = monotonic_ns();
        let target = client.target_for(&command, now_ns)?;
        let status = client.status().ok_or("no status")?;
        loop_records::write(&mut file, [now_ns, stamp_ns], &status, &command, &target)?;
    }
    Ok(file.flush()?)
}
