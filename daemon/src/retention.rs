//! The recording files of a cell: names, kept files, removal of old files.
//!
//! A kept file is called `CELL-SECONDS-COUNT.kept.mcap` and is never removed. Names sort by time
//! even if the system's clock was set back; the file being written and files of other cells are
//! never removed. The original of a damaged recording (`….damaged.mcap`) goes with its recording. This
//! module does not write files.

use recording::mcap_recording::{UNFINISHED, original_path};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};
use tracing::warn;

/// When a file was started, s since 1970, and its number within that second: the sort key of its
/// name.
type FileNumber = (u64, u32);

/// Suffix of a recording.
const EXTENSION: &str = ".mcap";
/// Suffix of a kept recording.
const KEPT_EXTENSION: &str = ".kept.mcap";

/// Path of the next file of this cell: sorts after all existing ones.
pub fn next_path(dir: &Path, cell: &str) -> PathBuf {
    let now_s = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let newest = files(dir, cell).last().map(|(number, _)| *number);
    let (seconds, count) = next_number(newest, now_s);
    dir.join(format!("{cell}-{seconds:010}-{count:04}{EXTENSION}"))
}

/// This cell's files, oldest first.
pub fn recordings(dir: &Path, cell: &str) -> Vec<PathBuf> {
    files(dir, cell).into_iter().map(|(_, path)| path).collect()
}

/// Removes unfinished files of an interrupted repair, for this cell.
pub fn remove_unfinished(dir: &Path, cell: &str) {
    for entry in fs::read_dir(dir).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let of_file = name.to_str().and_then(|name| name.strip_suffix(UNFINISHED));
        if of_file.is_some_and(|name| file_number(name, cell).is_some()) {
            // If removal fails, the next repair overwrites the file.
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Whether a recording is kept.
pub fn is_kept(path: &Path) -> bool {
    path.file_name()
        .and_then(|name| name.to_str())
        .is_some_and(|name| name.ends_with(KEPT_EXTENSION))
}

/// The name of a recording once it is kept.
pub fn kept_path(path: &Path) -> PathBuf {
    if is_kept(path) { path.to_owned() } else { path.with_extension(&KEPT_EXTENSION[1..]) }
}

/// The recording of this cell before `current`, if any.
pub fn previous_recording(dir: &Path, cell: &str, current: &Path) -> Option<PathBuf> {
    let recordings = recordings(dir, cell);
    let place = recordings.iter().position(|path| path == current)?;
    recordings.get(place.checked_sub(1)?).cloned()
}

/// Removes this cell's oldest files beyond `keep`; never `current` and kept ones.
pub fn remove_oldest(dir: &Path, cell: &str, keep: usize, current: &Path) {
    let mut files = files(dir, cell);
    files.retain(|(_, file)| !is_kept(file));
    let surplus = files.len().saturating_sub(keep.max(1));
    for (_, file) in files.into_iter().take(surplus).filter(|(_, file)| file != current) {
        if let Err(why) = fs::remove_file(&file) {
            warn!(%why, file = %file.display(), "an old recording could not be removed");
            continue;
        }
        for original in (1..).map(|count| original_path(&file, count)) {
            // The numbers have no gap: the first that is missing is the end.
            if fs::remove_file(original).is_err() {
                break;
            }
        }
    }
}

fn next_number(newest: Option<FileNumber>, now_s: u64) -> FileNumber {
    match newest {
        Some((seconds, count)) if seconds >= now_s => (seconds, count.saturating_add(1)),
        _ => (now_s, 1),
    }
}

/// This cell's files, oldest first.
fn files(dir: &Path, cell: &str) -> Vec<(FileNumber, PathBuf)> {
    let Ok(entries) = fs::read_dir(dir) else { return Vec::new() };
    let numbered = |path: PathBuf| Some((file_number(path.file_name()?.to_str()?, cell)?, path));
    let mut files: Vec<_> = entries.flatten().filter_map(|entry| numbered(entry.path())).collect();
    files.sort();
    files
}

/// Parses a name `CELL-SECONDS-COUNT.mcap`, kept or not; the name of another cell may have the same
/// beginning.
fn file_number(name: &str, cell: &str) -> Option<FileNumber> {
    let numbers = name.strip_prefix(cell)?.strip_prefix('-')?;
    let numbers =
        numbers.strip_suffix(KEPT_EXTENSION).or_else(|| numbers.strip_suffix(EXTENSION))?;
    let (seconds, count) = numbers.split_once('-')?;
    Some((seconds.parse().ok()?, count.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_set_back_does_not_make_the_next_file_the_oldest() {
        assert_eq!(next_number(None, 5), (5, 1));
        assert_eq!(next_number(Some((4, 7)), 5), (5, 1));
        assert_eq!(next_number(Some((5, 1)), 5), (5, 2), "two within a second");
        assert_eq!(next_number(Some((9_000_000_000, 1)), 5), (9_000_000_000, 2), "from the future");
    }

    #[test]
    fn files_of_a_cell_whose_name_begins_alike_are_not_ours() {
        assert_eq!(file_number("a-0000000005-0002.mcap", "a"), Some((5, 2)));
        for foreign in ["a-b-0000000005-0002.mcap", "a-0000000005.mcap", "a-0000000005-0002.csv"] {
            assert_eq!(file_number(foreign, "a"), None, "{foreign}");
        }
    }

    #[test]
    fn a_kept_file_is_a_recording_of_its_cell_and_is_never_removed() {
        let dir = std::env::temp_dir().join(format!("trued-retention-kept-{}", std::process::id()));
        fs::create_dir_all(&dir).unwrap();
        let [first, second, third] =
            ["0001", "0002", "0003"].map(|n| dir.join(format!("a-0000000005-{n}.mcap")));
        for path in [&first, &second, &third] {
            fs::write(path, "").unwrap();
        }
        let first_kept = kept_path(&first);
        fs::rename(&first, &first_kept).unwrap();
        assert_eq!(kept_path(&first_kept), first_kept, "once more changes nothing");
        assert_eq!(recordings(&dir, "a"), [first_kept.clone(), second.clone(), third.clone()]);
        assert_eq!(previous_recording(&dir, "a", &second), Some(first_kept.clone()));
        assert_eq!(previous_recording(&dir, "a", &first_kept), None);
        assert_eq!(next_path(&dir, "a").extension(), third.extension());
        remove_oldest(&dir, "a", 1, &third);
        assert_eq!(recordings(&dir, "a"), [first_kept, third]);
        fs::remove_dir_all(&dir).unwrap();
    }

    #[test]
    fn the_oldest_go_and_the_one_being_written_stays() {
        let dir = std::env::temp_dir().join(format!("trued-retention-{}", std::process::id()));
        fs::create_dir_all(&dir).unwrap();
        let file = |seconds: u64, count: u32| dir.join(format!("a-{seconds:010}-{count:04}.mcap"));
        let other = dir.join("a-b-0000000001-0001.mcap");
        let gone = [1, 2].map(|count| original_path(&file(5, 2), count));
        let kept_original = original_path(&file(7, 1), 1);
        let paths = [file(5, 1), file(5, 2), file(7, 1), other.clone()];
        for path in paths.iter().chain(&gone).chain([&kept_original]) {
            fs::write(path, "").unwrap();
        }
        remove_oldest(&dir, "a", 1, &file(5, 1));
        let kept: Vec<_> = files(&dir, "a").into_iter().map(|(number, _)| number).collect();
        assert_eq!(kept, [(5, 1), (7, 1)]);
        assert!(other.exists() && kept_original.exists());
        assert!(!gone.iter().any(|original| original.exists()));
        fs::remove_dir_all(&dir).unwrap();
    }
}
