//! Everything that the library can do, once, with figures that are the same in every language.
//!
//! `cargo run -p trued-client --example every_call -- CELL [TARGETS]`
//!
//! The cell: six joints, `run --lockstep`, mode "full", force of 3 channels at 10 kHz with the vibration monitor, a recorder.
#![expect(clippy::print_stdout, reason = "the figures are what it is for")]

use std::error::Error;
use std::path::Path;
use std::time::Duration;

use trued_client::{
    Answer, Client, CorrectionStatus, ForceSamples, ForceSource, HORIZON_POINTS_MAX, Instrument,
    Mode, Monitor, ProcessState, RecorderAction, RecorderState, RobotState, Samples, Setpoint,
    Verdict, VibrationState, WrenchFrame, monotonic_ns,
};

const JOINTS: usize = 6;
const BLOCKS: u32 = 350;
const BLOCK: u32 = 100;
const LIMIT: Duration = Duration::from_secs(10);

type Done<T = ()> = Result<T, Box<dyn Error>>;

fn main() -> Done {
    let cell = std::env::args().nth(1).unwrap_or_else(|| "cell-1".to_owned());
    let targets = std::env::args().nth(2).map_or(Ok(10_000), |n| n.parse())?;
    let mut client = Client::connect(&cell, LIMIT)?;
    let mut monitor = Monitor::connect(&cell, LIMIT)?;
    let mut force = ForceSource::connect(&cell, LIMIT)?;
    correct(&mut client, targets)?;
    listen(&mut force, &mut monitor)?;
    request_all(&mut client, &mut monitor)?;
    steer(&mut client, &mut monitor)?;
    measure(&cell, &mut client)
}

/// The path: numbers that every language writes with the same bits.
fn target_of(k: usize) -> [f64; JOINTS] {
    let base = [200_000, 300_000, -200_000, 300_000, 800_000, 100_000];
    core::array::from_fn(|i| {
        let turn = ((k + 500 * i) % 4000) as i32 - 2000;
        f64::from(base[i] + 20 * turn.abs()) / 1_048_576.0
    })
}

/// FNV-1a over the bits of numbers.
fn hashed(hash: u64, numbers: &[f64]) -> u64 {
    let bytes = numbers.iter().flat_map(|number| number.to_bits().to_le_bytes());
    bytes.fold(hash, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// Commands a path, and takes each answer.
fn correct(client: &mut Client, targets: usize) -> Done {
    let (mut hash, mut corrected) = (0xcbf2_9ce4_8422_2325, 0);
    let mut took_ns = Vec::with_capacity(targets);
    client.start_anew();
    for k in 0..targets {
        let q = target_of(k);
        let start_ns = monotonic_ns();
        let seq = client.send(&Setpoint::new(&q).at_ns((k as u64 + 1) * 1_000_000))?;
        let answer = client.wait_corrected(seq, LIMIT).ok_or("no answer")?;
        took_ns.push(monotonic_ns() - start_ns);
        hash = hashed(hash, answer.correction());
        corrected += u32::from(answer.status()? == CorrectionStatus::Corrected);
        let _ = client.target_for(&q, monotonic_ns());
    }
    took_ns.sort_unstable();
    let us = |index: usize| took_ns.get(index).map_or(f64::NAN, |ns| *ns as f64 * 1e-3);
    println!("targets {targets}\ncorrected {corrected}\nhash {hash:016x}");
    println!("round_trip_us_p50 {:.3}", us(targets / 2));
    println!("round_trip_us_p99 {:.3}", us(targets * 99 / 100));
    Ok(())
}

/// Waits until something is there.
fn comes_to<T>(mut poll: impl FnMut() -> Option<T>) -> Option<T> {
    (0..10_000).find_map(|_| {
        let found = poll();
        if found.is_none() {
            std::thread::sleep(Duration::from_millis(1));
        }
        found
    })
}

/// Sends noise, then a tone of 72 Hz on y; the watch says what rings.
fn listen(force: &mut ForceSource, monitor: &mut Monitor) -> Done {
    let mut ringing = None;
    let hear = |monitor: &mut Monitor, ringing: &mut Option<Verdict>| {
        let verdicts = std::iter::from_fn(|| monitor.vibration());
        let confirmed =
            verdicts.filter(|verdict| verdict.state() == Ok(VibrationState::Confirmed)).last();
        *ringing = confirmed.or(*ringing);
        *ringing
    };
    // The first status comes a moment after connecting.
    let before = comes_to(|| monitor.status()).ok_or("no status came")?.force_blocks;
    let taken = |monitor: &mut Monitor, blocks: u32| {
        let enough = |blocks_taken| (blocks_taken >= before + u64::from(blocks)).then_some(());
        comes_to(|| enough(monitor.status()?.force_blocks))
            .ok_or("the daemon does not take the force blocks")
    };
    let (mut chance, start_ns) = (11_u64, monotonic_ns());
    for k in 0..BLOCKS {
        let mut sample = |i: u32| {
            chance = chance
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            let t_s = f64::from(BLOCK * k + i / 3) * 1e-4;
            let rings = i % 3 == 1 && k > 200;
            let tone = if rings { 4.0 * (std::f64::consts::TAU * 72.0 * t_s).sin() } else { 0.0 };
            (chance >> 11) as f64 / 9_007_199_254_740_992.0 - 0.5 + tone
        };
        let samples: Vec<f64> = (0..3 * BLOCK).map(&mut sample).collect();
        force.send(&ForceSamples {
            t_ns: start_ns + u64::from(k) * 10_000_000,
            rate_hz: 10_000.0,
            channels: 3,
            frame: WrenchFrame::Tool,
            samples: Samples::F64(&samples),
        })?;
        if k % 32 == 31 {
            taken(monitor, k + 1)?;
        }
        hear(monitor, &mut ringing);
    }
    taken(monitor, BLOCKS)?;
    let rings = comes_to(|| hear(monitor, &mut ringing)).ok_or("nothing rings")?;
    println!("force_blocks {BLOCKS}\nforce_lost {}", force.lost());
    println!("rings_hz {:.0}\nrings_axis {}", rings.frequency_hz, rings.axis);
    Ok(())
}

/// Changes the mode and the recording, and back.
fn steer(client: &mut Client, monitor: &mut Monitor) -> Done {
    let is = |client: &mut Client, mode: Mode, recorder: RecorderState| {
        let status = comes_to(|| {
            let status = client.status()?;
            let wanted = [mode.code(), recorder.code()];
            ([status.mode, status.recorder] == wanted).then_some(())
        });
        status.is_some()
    };
    let mut done = is(client, Mode::Full, RecorderState::Recording);
    client.mode(Mode::Limited, LIMIT)?;
    done &= is(client, Mode::Limited, RecorderState::Recording);
    monitor.mode(Mode::Shadow, LIMIT)?;
    client.mark("part 7", LIMIT)?;
    monitor.mark("part 8", LIMIT)?;
    client.record(RecorderAction::Keep, LIMIT)?;
    monitor.record(RecorderAction::Stop, LIMIT)?;
    done &= is(client, Mode::Shadow, RecorderState::Stopped);
    let answer = monitor.mark("part 9", LIMIT)?;
    client.record(RecorderAction::Start, LIMIT)?;
    monitor.arm(true, LIMIT)?;
    done &= is(client, Mode::Full, RecorderState::Recording);
    let refused = answer.answer() == Ok(Answer::Refused);
    println!("steered {}\nmark_refused {}", u32::from(done), u32::from(refused));
    Ok(())
}

/// Sends measured points of the tool. The cell has no `[measured]`: they are taken, and nothing is trimmed.
fn measure(cell: &str, client: &mut Client) -> Done {
    let mut instrument = Instrument::connect(cell, LIMIT)?;
    let sent = [None, Some(monotonic_ns())].map(|t_ns| instrument.send([1.0, 0.5, 0.25], t_ns));
    let count = sent.iter().filter(|sent| sent.is_ok()).count();
    let status = client.status().ok_or("no status")?;
    println!("points_sent {count}\npoints_lost {}", instrument.lost());
    println!("trim_state {}\ntrim_points {}", status.trim_state, status.trim_measurements);
    Ok(())
}

/// Asks for everything that may be asked for.
fn request_all(client: &mut Client, monitor: &mut Monitor) -> Done {
    let before = client.status().ok_or("no status")?;
    let bypassed_is = |client: &mut Client, on: u32| {
        comes_to(|| (client.status()?.bypassed == on).then_some(())).is_some()
    };
    client.ping(LIMIT)?;
    client.bypass(true, LIMIT)?;
    let mut bypassed = bypassed_is(client, 1);
    monitor.bypass(false, LIMIT)?;
    bypassed &= bypassed_is(client, 0);
    client.reload(None, LIMIT)?;
    let answer = monitor.reload(Some(Path::new("/nowhere/model.toml")), LIMIT)?;
    let process = ProcessState { spindle_rpm: 12_000.0, teeth: 2, ..ProcessState::default() };
    client.process_state(&process, LIMIT)?;
    let state = RobotState {
        joints: JOINTS as u32,
        flags: RobotState::HAS_Q,
        t_ns: monotonic_ns(),
        ..RobotState::default()
    };
    client.send_state(&state)?;
    // The setpoints after the next command: more than are sent.
    let ahead: Vec<_> = (1..=HORIZON_POINTS_MAX + 2).map(target_of).collect();
    let horizon = client.set_horizon(&ahead)?;
    println!("joints {}\nmode {}\nbypassed {}", before.joints, before.mode, u32::from(bypassed));
    println!("reload_refused {}", u32::from(answer.answer() == Ok(Answer::Refused)));
    println!("horizon {horizon}");
    Ok(())
}
