//! Repairs recordings that were not closed: when the daemon starts, and when its disk has room again.
//!
//! Runs in a separate thread, which ends with the last file. The file that is being written and the
//! files of other cells are not touched. A file that cannot be repaired is left unchanged, with a
//! warning in the log; of one that is damaged inside the original is kept, with a warning for each part. The recorder does not wait for this thread.

use crate::{recording_log, retention};
use recording::mcap_recording::{Repair, is_closed, repair};
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;
use tracing::{info, warn};

/// Repairs this cell's recordings in the folder, except the `current` one.
pub fn repair_unclosed(dir: &Path, cell: &str, current: &Path) {
    retention::remove_unfinished(dir, cell);
    for path in retention::recordings(dir, cell) {
        if path == current || is_being_written(&path) || is_closed(&path).unwrap_or(true) {
            continue;
        }
        let file = path.display();
        if fs::metadata(&path).is_ok_and(|file| file.len() == 0) {
            // An empty file: the daemon was killed between creating and writing it.
            let _ = fs::remove_file(&path);
            continue;
        }
        match repair(&path) {
            Ok(Repair::NotNeeded) => {}
            Ok(Repair::Done { was, messages, loss: None }) => {
                info!(%file, messages, was, "a recording that was not closed was repaired");
            }
            Ok(Repair::Done { was, messages, loss: Some(loss) }) => {
                for damage in &loss.damage {
                    warn!(%file, "{damage}");
                }
                let lost =
                    loss.messages.map_or_else(|| "unknown".to_owned(), |lost| lost.to_string());
                let original = loss.original.display();
                warn!(%file, messages, lost, was, %original, "a recording that was not closed was repaired with loss; the original is kept");
            }
            Err(why) => warn!(%why, "a recording that was not closed could not be repaired"),
        }
    }
}

/// Whether the recorder is writing it: a recording may have been started or renamed since this
/// repair began.
fn is_being_written(path: &Path) -> bool {
    File::open(path).is_ok_and(|file| matches!(file.try_lock(), Err(TryLockError::WouldBlock)))
}

/// The same in a separate thread; `None` if the system refuses one.
#[must_use]
pub fn start(dir: PathBuf, cell: String, current: PathBuf) -> Option<JoinHandle<()>> {
    let book = recording_log::attached_exchange();
    let body = move || {
        book.iter().for_each(recording_log::attach_thread);
        repair_unclosed(&dir, &cell, &current);
    };
    std::thread::Builder::new()
        .name("repair".to_owned())
        .spawn(body)
        .inspect_err(|why| {
            warn!(%why, "cannot start a thread to repair recordings; use `trued info FILE --repair`");
        })
        .ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::mcap_recording::{Clocks, CycleRecord, Header, McapWriter, read};

    #[test]
    fn of_a_damaged_recording_the_original_is_kept_and_not_repaired_again() {
        let dir = std::env::temp_dir().join(format!("trued-repair-bit-{}", std::process::id()));
        fs::create_dir_all(&dir).unwrap();
        let path = dir.join("a-0000000001-0001.mcap");
        let mut made = McapWriter::create(&path, &Header::default(), Clocks::default()).unwrap();
        let mut ends = Vec::new();
        for _ in 0..3 {
            (0..10).for_each(|_| made.write_cycle(&CycleRecord::default()).unwrap());
            made.flush().unwrap();
            ends.push(made.bytes() as usize);
        }
        let mut bytes = fs::read(&path).unwrap();
        bytes[ends[0] + 200] ^= 1;
        drop(made);
        fs::write(&path, &bytes).unwrap();
        for _ in 0..2 {
            repair_unclosed(&dir, "a", Path::new(""));
            assert_eq!(read(&path).unwrap().records.len(), 20);
            let original = dir.join("a-0000000001-0001.damaged.mcap");
            assert_eq!(fs::read(original).unwrap(), bytes);
            assert_eq!(fs::read_dir(&dir).unwrap().count(), 2);
        }
        fs::remove_dir_all(&dir).unwrap();
    }

    #[test]
    fn what_a_kill_left_is_whole_again_and_what_is_written_now_is_not_touched() {
        let dir = std::env::temp_dir().join(format!("trued-repair-{}", std::process::id()));
        fs::create_dir_all(&dir).unwrap();
        let file = |count: u32| dir.join(format!("a-0000000001-{count:04}.mcap"));
        let write = |path: &Path| {
            let mut made = McapWriter::create(path, &Header::default(), Clocks::default()).unwrap();
            made.write_cycle(&CycleRecord::default()).unwrap();
            made.flush().unwrap();
            made
        };
        let current = write(&file(4));
        write(&file(1)).finish().unwrap();
        let whole = fs::read(file(1)).unwrap();
        let cut = fs::read(file(4)).unwrap();
        fs::write(file(2), &cut).unwrap();
        fs::write(file(3), "").unwrap();
        fs::write(dir.join("a-0000000001-0002.mcap.repair"), &cut[..20]).unwrap();
        fs::write(dir.join("b-0000000001-0001.mcap"), &cut).unwrap();
        // Started since, and still empty.
        let begun = File::create(file(5)).unwrap();
        begun.lock().unwrap();
        repair_unclosed(&dir, "a", &file(4));
        assert_eq!(fs::read(file(1)).unwrap(), whole);
        let mended = read(&file(2)).unwrap();
        assert_eq!((mended.records.len(), mended.cut), (1, None));
        assert_eq!(fs::read(file(4)).unwrap(), cut, "being written");
        assert_eq!(fs::read(dir.join("b-0000000001-0001.mcap")).unwrap(), cut, "another cell's");
        assert!(file(5).exists(), "another recorder's");
        assert_eq!(fs::read_dir(&dir).unwrap().count(), 5, "nothing empty or unfinished is left");
        drop((current, begun));
        fs::remove_dir_all(&dir).unwrap();
    }
}
