//! The spool against a model of it: random records, restarts, torn ends and damaged files, within a byte budget.

use std::collections::{BTreeSet, VecDeque};
use std::fs::OpenOptions;
use std::os::unix::fs::FileExt as _;
use std::path::PathBuf;

use bus::spool::{BUDGET_BYTES_MIN, Spool, SpoolError};
use rand::{RngExt as _, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::place::Folder;

const BUDGET: u64 = BUDGET_BYTES_MIN;

fn files(folder: &Folder) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(&folder.0).unwrap().flatten().map(|entry| entry.path());
    let mut files: Vec<_> = entries.filter(|path| path.extension().is_some()).collect();
    files.sort();
    files
}

fn size(folder: &Folder) -> u64 {
    files(folder).iter().map(|path| path.metadata().unwrap().len()).sum()
}

/// All that is kept, page by page.
fn all(spool: &Spool, page_bytes: usize) -> VecDeque<(u64, Vec<u8>)> {
    let mut records = VecDeque::new();
    let mut from = spool.first();
    while from < spool.next() {
        let page = spool.page(from, page_bytes).unwrap();
        if page.records.is_empty() {
            assert_eq!(page.from, spool.next(), "nothing more");
            break;
        }
        assert!(page.from >= from);
        from = page.from;
        for record in page.records {
            records.push_back((from, record));
            from += 1;
        }
    }
    records
}

#[test]
fn through_restarts_and_torn_ends_what_is_kept_is_what_was_appended_last_in_order_within_the_budget()
 {
    let seed = std::env::var("TRUED_SEED").map_or(1, |seed| seed.parse().unwrap());
    eprintln!("TRUED_SEED={seed}");
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let folder = Folder::new();
    let mut spool = Spool::open(&folder.0, BUDGET, 7).unwrap().0;
    let mut model = VecDeque::<(u64, Vec<u8>)>::new();
    let mut given = BTreeSet::new();
    for restart in 0..3_000 {
        match rng.random_range(0..60) {
            0 => {
                drop(spool);
                let torn = rng.random_range(0..2_u64) * rng.random_range(1..4_000);
                let last = files(&folder).pop().unwrap();
                let length = last.metadata().unwrap().len();
                let left = length.saturating_sub(torn).max(32);
                OpenOptions::new().write(true).open(&last).unwrap().set_len(left).unwrap();
                let found;
                (spool, found) = Spool::open(&folder.0, BUDGET, 8 + restart).unwrap();
                assert!(torn > 0 || !found.is_new_stream);
                if torn > 0 && spool.stream() != 8 + restart {
                    // The file ends with a whole record: what followed it cannot be known.
                    given.retain(|(stream, number)| {
                        *stream != spool.stream() || *number < spool.next()
                    });
                }
                while model.front().is_some_and(|oldest| oldest.0 < spool.first()) {
                    model.pop_front();
                }
                model.truncate(found.records as usize);
            }
            _ => {
                let length = rng.random_range(0..6_000);
                let record: Vec<u8> = (0..length).map(|_| rng.random_range(0..=255)).collect();
                let number = spool.append(&record).unwrap();
                assert!(given.insert((spool.stream(), number)), "given twice: {number}");
                model.push_back((number, record));
            }
        }
        while model.front().is_some_and(|oldest| oldest.0 < spool.first()) {
            model.pop_front();
        }
        assert!(size(&folder) <= BUDGET && spool.bytes() == size(&folder));
    }
    assert!(spool.first() > 1, "something fell out");
    assert!(size(&folder) > BUDGET / 2, "no more than a part of the budget falls out at once");
    for page_bytes in [1, 20_000, 1 << 30] {
        assert_eq!(all(&spool, page_bytes), model);
    }
}

#[test]
fn after_a_record_that_was_not_written_whole_another_stream_begins_so_that_no_number_names_two() {
    let folder = Folder::new();
    let (mut spool, found) = Spool::open(&folder.0, BUDGET, 7).unwrap();
    assert_eq!((found.records, found.torn_bytes, spool.first(), spool.next()), (0, 0, 1, 1));
    for record in ["one", "two", "three"] {
        spool.append(record.as_bytes()).unwrap();
    }
    drop(spool);
    let last = files(&folder).pop().unwrap();
    let length = last.metadata().unwrap().len();
    OpenOptions::new().write(true).open(&last).unwrap().set_len(length - 1).unwrap();
    // Its clock was set back: still another stream.
    let (mut spool, found) = Spool::open(&folder.0, BUDGET, 3).unwrap();
    assert_eq!((found.records, found.torn_bytes, found.is_new_stream), (2, 8 + 4, true));
    assert_eq!((spool.stream(), spool.append(b"new").unwrap()), (8, 3));
    let page = spool.page(1, 1 << 20).unwrap();
    assert_eq!((page.stream, page.from, page.records.len()), (7, 1, 2), "the former stream");
    let page = spool.page(3, 1 << 20).unwrap();
    assert_eq!((page.stream, page.from, page.records), (8, 3, vec![b"new".to_vec()]));
    // A reader that had received the third record of the former stream, and one that knows neither.
    assert_eq!([spool.position(7, 4), spool.position(7, 2), spool.position(5, 9)], [3, 2, 1]);
    drop(spool);
    let (spool, found) = Spool::open(&folder.0, BUDGET, 9).unwrap();
    assert_eq!((spool.stream(), found.records), (8, 3), "it goes on");
}

/// As a message of the bridge: it states its stream and number.
fn message(number: u64) -> Vec<u8> {
    let filler = "x".repeat(9_900);
    format!("{{\"stream\":7,\"number\":{number},\"body\":\"{filler}\"}}").into_bytes()
}

/// Thirteen fit in a file: several in the newest one too.
const MESSAGES: u64 = 46;

/// Messages in several files.
fn several(folder: &Folder) -> Vec<PathBuf> {
    let mut spool = Spool::open(&folder.0, BUDGET, 7).unwrap().0;
    (1..=MESSAGES).for_each(|number| assert_eq!(spool.append(&message(number)).unwrap(), number));
    files(folder)
}

/// Damages a file at this place.
fn damage(file: &PathBuf, at: u64, bytes: &[u8]) {
    OpenOptions::new().write(true).open(file).unwrap().write_all_at(bytes, at).unwrap();
}

#[test]
fn damage_costs_the_damaged_record_alone_and_no_number_names_two() {
    let size = 8 + message(10).len() as u64;
    // Content; the length of a record; the header of a file; the file is cut within its second record.
    type Damage = fn(&PathBuf, u64);
    let kinds: [(&str, Damage, u64); 4] = [
        ("content", |file, size| damage(file, 32 + size + 100, b"\0"), 1),
        ("length", |file, size| damage(file, 32 + size, &[0xff; 4]), 1),
        ("header", |file, _| damage(file, 3, b"?"), 0),
        (
            "cut",
            |file, size| {
                let file = OpenOptions::new().write(true).open(file).unwrap();
                file.set_len(32 + size + 200).unwrap();
            },
            u64::MAX,
        ),
    ];
    for (what, damaging, lost) in kinds {
        for is_newest in [false, true] {
            let folder = Folder::new();
            let files = several(&folder);
            assert!(files.len() >= 4);
            let place = if is_newest { files.len() - 1 } else { 1 };
            damaging(&files[place], size);
            let (mut spool, found) = Spool::open(&folder.0, BUDGET, 8).unwrap();
            assert!(found.torn_bytes > 0, "{what}");
            assert_eq!(found.is_new_stream, is_newest, "{what}");
            let kept = all(&spool, 1 << 20);
            assert_eq!(kept.len() as u64, found.records, "{what}");
            assert!(kept.iter().all(|(number, record)| *record == message(*number)), "{what}");
            if lost != u64::MAX {
                assert_eq!(found.records, MESSAGES - lost, "{what} {is_newest}");
            }
            let number = spool.append(b"new").unwrap();
            assert_eq!(spool.stream(), if is_newest { 8 } else { 7 }, "{what}");
            assert!(kept.iter().all(|(known, _)| *known < number), "{what}");
            drop(spool);
            let (spool, again) = Spool::open(&folder.0, BUDGET, 9).unwrap();
            assert_eq!(
                (all(&spool, 1).len() as u64, again.is_new_stream),
                (found.records + 1, false)
            );
        }
    }
}

#[test]
fn a_folder_has_one_user_a_record_fits_and_a_budget_is_large_enough() {
    let folder = Folder::new();
    let mut spool = Spool::open(&folder.0, BUDGET, 7).unwrap().0;
    assert!(matches!(Spool::open(&folder.0, BUDGET, 7), Err(SpoolError::Taken(_))));
    let large = vec![0; BUDGET as usize / 8];
    assert!(matches!(spool.append(&large), Err(SpoolError::TooLarge { .. })));
    assert_eq!(spool.next(), 1);
    assert!(matches!(Spool::open(&folder.0, 1000, 7), Err(SpoolError::Budget(1000))));
}
