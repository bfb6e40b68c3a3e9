//! Model files that are written while they are read, and paths that are not files.

use super::at_work;
use std::fs::{self, File};
use std::io::Write;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};
use tests::served_cell::AWAIT_LIMIT;
use trued_client::{Answer, Monitor};

#[test]
fn a_model_that_is_being_written_is_never_taken_by_half() {
    let mut pair = at_work();
    let whole = fs::read_to_string(pair.place.file("model.toml")).unwrap();
    // Half of it is a valid model too, with fewer effects.
    let cut = whole[..whole.len() * 3 / 4].rfind("[[effect]]").expect("effects");
    let half = recording::model::RobotModel::parse("half", &whole[..cut]);
    assert!(half.is_ok(), "the test's own premise: {half:?}");
    let path = pair.place.file("written.toml");
    fs::write(&path, &whole).unwrap();
    let over = Arc::new(AtomicBool::new(false));
    let (end, to) = (over.clone(), path.clone());
    let writer = std::thread::spawn(move || {
        let mut seed = tests::rng::TestRng::new(7);
        while !end.load(Relaxed) {
            if seed.below(3) == 0 {
                // As an editor does that renames.
                let fresh = to.with_extension("fresh");
                fs::write(&fresh, &whole).unwrap();
                fs::rename(&fresh, &to).unwrap();
            } else {
                let mut file = File::create(&to).unwrap();
                file.write_all(&whole.as_bytes()[..cut]).unwrap();
                std::thread::sleep(Duration::from_millis(1 + seed.below(12)));
                file.write_all(&whole.as_bytes()[cut..]).unwrap();
            }
            std::thread::sleep(Duration::from_millis(seed.below(150)));
        }
    });
    let mut monitor = Monitor::connect_to(&pair.place.cell(), AWAIT_LIMIT).unwrap();
    let known = super::wait_for(AWAIT_LIMIT, || monitor.status().is_some());
    assert!(known, "a status");
    let hash = monitor.status().unwrap().model_hash;
    let (mut done, start) = (0, Instant::now());
    while start.elapsed() < Duration::from_secs(4) {
        let answer = monitor.reload(Some(&path), AWAIT_LIMIT).unwrap();
        done += u32::from(answer.answer() == Ok(Answer::Done));
        std::thread::sleep(Duration::from_millis(50));
        assert_eq!(monitor.status().unwrap().model_hash, hash, "half a model: {}", answer.message);
    }
    over.store(true, Relaxed);
    writer.join().unwrap();
    println!("{done} reloads done while the file was written");
    assert!(done > 0);
    drop(monitor);
    pair.wait_answered();
    pair.end();
}

#[test]
fn a_pipe_or_a_device_as_a_model_is_refused_at_once() {
    let mut pair = at_work();
    let pipe = pair.place.file("pipe.toml");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let mut monitor = Monitor::connect_to(&pair.place.cell(), AWAIT_LIMIT).unwrap();
    for path in [pipe.as_path(), "/dev/zero".as_ref(), pair.place.root()] {
        let answer = monitor.reload(Some(path), AWAIT_LIMIT).unwrap();
        assert_eq!(answer.answer(), Ok(Answer::Refused), "{}", answer.message);
        assert!(answer.message.as_str().contains("expected a file"), "{}", answer.message);
    }
    assert_eq!(monitor.ping(AWAIT_LIMIT).unwrap().answer(), Ok(Answer::Done));
    drop(monitor);
    pair.wait_answered();
    pair.end();
}
