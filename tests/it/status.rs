//! Messages to the cell: incompatible versions, a cell that is already served, an invalid runtime
//! directory, shadow mode, bypass.

use crate::TRUED;
use rustix::process::Signal;
use shm_schema::{Command, Corrected, CorrectionStatus, Reason, Role, RoleClaim};
use std::fs;
use std::time::Duration;
use tests::cell_loop::{CellLoop, JOINTS, Tick};
use tests::place::TestDirectory;
use tests::process::Process;
use trued_client::{Answer, Client, ConnectError, Mode, Source};

const LIMIT: Duration = Duration::from_secs(10);
const SYSTEM_FAILED: Option<i32> = Some(3);

#[test]
fn another_contract_is_refused_at_once_and_both_versions_are_named() {
    let place = TestDirectory::new("full", "");
    let daemon = Process::ready_daemon(TRUED, &place);
    // A running daemon would restore what is changed here.
    daemon.signal(Signal::STOP);
    let current = place.cell().dir().join("current");
    let text = fs::read_to_string(&current).unwrap();
    let ours = shm_schema::CONTRACT_VERSION;
    let changed = text
        .replace(&format!("contract {ours}\n"), "contract 97\n")
        .replace(&format!("program {}\n", env!("CARGO_PKG_VERSION")), "program 9.8.7\n");
    assert_ne!(text, changed);
    fs::write(&current, changed).unwrap();
    let refused = Client::connect_to(&place.cell(), LIMIT).err().unwrap();
    assert!(matches!(refused, ConnectError::Refused(_)), "{refused}");
    let message = refused.to_string();
    let mine = format!("trued {} (contract {ours}", env!("CARGO_PKG_VERSION"));
    assert!(message.contains("trued 9.8.7 (contract 97") && message.contains(&mine), "{message}");
}

#[test]
fn a_second_daemon_for_a_cell_is_refused_with_the_process_of_the_first() {
    let place = TestDirectory::new("full", "");
    let mut first = Process::ready_daemon(TRUED, &place);
    let mut second = Process::daemon(TRUED, &place);
    let code = second.wait().code();
    let output = second.lines().join("\n");
    assert_eq!(code, SYSTEM_FAILED, "{output}");
    assert!(output.contains(&format!("process {}", first.id())), "{output}");
    assert!(first.is_running());
    assert!(Client::connect_to(&place.cell(), LIMIT).is_ok(), "the first serves on");
}

#[test]
fn a_daemon_without_a_usable_runtime_directory_fails_and_reports_where() {
    let place = TestDirectory::new("full", "");
    let missing = place.root().join("missing").join("deep");
    let long = place.root().join("x".repeat(120));
    let disk = std::path::PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    for (dir, part) in [
        (missing.as_path(), "could not create the directory"),
        ("relative".as_ref(), "expected an absolute path"),
        (long.as_path(), "set TRUED_RUNTIME_DIR to a shorter one"),
        (disk.as_path(), "expected a directory in memory"),
    ] {
        let config = place.file("cell.toml");
        let done = std::process::Command::new(TRUED)
            .args(["run", "--config"])
            .arg(config)
            .env(shm_schema::RUNTIME_DIR_ENV, dir)
            .output()
            .unwrap();
        let stderr = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(done.status.code(), SYSTEM_FAILED, "{}: {stderr}", dir.display());
        assert!(stderr.contains(part) && stderr.contains(&dir.display().to_string()), "{stderr}");
    }
    assert!(!disk.join("trued-cell").exists(), "a start that fails leaves nothing behind");
}

/// The last answer of the daemon.
fn last_answer(cell: &mut CellLoop) -> Corrected {
    cell.client.newest().unwrap()
}

fn bits(q: &[f64]) -> Vec<u64> {
    q.iter().map(|x| x.to_bits()).collect()
}

#[test]
fn in_shadow_mode_commands_go_out_bit_for_bit_and_what_is_wanted_is_reported() {
    let place = TestDirectory::new("shadow", "");
    let _daemon = Process::ready_daemon(TRUED, &place);
    let mut cell = CellLoop::join(&place.cell(), LIMIT).unwrap();
    let mut answers = 0;
    cell.tick_until(Duration::from_secs(1), |cell, tick| {
        let answer = last_answer(cell);
        assert_eq!(bits(&tick.target), bits(&tick.q_cmd));
        if tick.refused {
            // On a busy machine a command may reach the daemon too late.
            assert_eq!(answer.reason(), Ok(Reason::Stale), "{answer:?}");
        } else if tick.source == Source::Corrected {
            answers += 1;
            assert_eq!(answer.correction(), [0.0; JOINTS]);
            assert_eq!(answer.status(), Ok(CorrectionStatus::Shadow));
            assert_eq!(answer.reason(), Ok(Reason::ShadowMode));
            assert!(answer.wanted[..JOINTS].iter().any(|w| w.abs() > 1e-4), "{answer:?}");
        }
        false
    });
    assert!(answers > 50, "{answers}");
    assert_eq!(cell.client.status().unwrap().mode(), Ok(Mode::Shadow));
    assert_eq!(cell.broken, Vec::<String>::new());
}

/// Runs ticks until the daemon reports this status and the correction is (or is not) zero; all
/// intermediate targets are within the limits.
fn until(cell: &mut CellLoop, status: CorrectionStatus, zero: bool) -> u32 {
    let mut ramping = 0;
    let reached = cell.tick_until(LIMIT, |cell, tick: &Tick| {
        let answer = last_answer(cell);
        ramping += u32::from(answer.status() == Ok(CorrectionStatus::Ramping));
        let is_reached = answer.status() == Ok(status) && tick.source == Source::Corrected;
        is_reached && (tick.largest() == 0.0) == zero
    });
    assert!(reached, "{status}: {:?}", last_answer(cell));
    assert_eq!(cell.broken, Vec::<String>::new());
    ramping
}

#[test]
fn arming_and_bypass_ramp_the_correction_in_and_out() {
    let place = TestDirectory::new("full", "");
    let _daemon = Process::ready_daemon(TRUED, &place);
    let mut cell = CellLoop::join(&place.cell(), LIMIT).unwrap();
    until(&mut cell, CorrectionStatus::Corrected, false);
    cell.client.arm(false, LIMIT).unwrap();
    assert!(until(&mut cell, CorrectionStatus::Shadow, true) > 5, "out by a ramp");
    cell.client.arm(true, LIMIT).unwrap();
    assert!(until(&mut cell, CorrectionStatus::Corrected, false) > 5, "in by a ramp");
    cell.client.bypass(true, LIMIT).unwrap();
    assert!(until(&mut cell, CorrectionStatus::Bypassed, true) > 5, "out by a ramp");
    assert_eq!(last_answer(&mut cell).reason(), Ok(Reason::Bypass));
    cell.client.bypass(false, LIMIT).unwrap();
    assert!(until(&mut cell, CorrectionStatus::Corrected, false) > 5, "in again");
}

#[test]
fn a_cell_that_is_configured_to_look_on_refuses_to_be_armed_and_states_the_remedy() {
    let place = TestDirectory::new("shadow", "");
    let _daemon = Process::ready_daemon(TRUED, &place);
    let mut cell = CellLoop::join(&place.cell(), LIMIT).unwrap();
    until(&mut cell, CorrectionStatus::Shadow, true);
    let answer = cell.client.arm(true, LIMIT).unwrap();
    assert_eq!(answer.answer(), Ok(Answer::Refused));
    let message = answer.message.as_str();
    assert!(
        message.contains("configured for shadow mode") && message.contains("mode = "),
        "{message}"
    );
    assert_eq!(cell.client.arm(false, LIMIT).unwrap().answer(), Ok(Answer::Done));
    until(&mut cell, CorrectionStatus::Shadow, true);
}

#[test]
fn an_armed_cell_goes_back_to_the_configured_mode_and_no_further() {
    let place = TestDirectory::new("limited", "");
    let _daemon = Process::ready_daemon(TRUED, &place);
    let mut cell = CellLoop::join(&place.cell(), LIMIT).unwrap();
    for on in [false, true] {
        assert_eq!(cell.client.arm(on, LIMIT).unwrap().answer(), Ok(Answer::Done));
    }
    let is_limited = cell.tick_until(LIMIT, |cell, _| {
        cell.client.status().is_some_and(|status| status.mode() == Ok(Mode::Limited))
    });
    assert!(is_limited, "{:?}", cell.client.status());
}

#[test]
fn a_role_that_is_taken_is_refused_with_the_process_that_has_it() {
    let place = TestDirectory::new("shadow", "");
    let _daemon = Process::ready_daemon(TRUED, &place);
    let _first = Client::connect_to(&place.cell(), LIMIT).unwrap();
    let mut second = RoleClaim::new(&place.cell(), Role::Cell);
    let refused = second.join().and_then(|joined| Ok(joined.publisher::<Command>()?));
    let message = refused.err().unwrap().to_string();
    assert!(message.contains(&format!("process {}", std::process::id())), "{message}");
}
