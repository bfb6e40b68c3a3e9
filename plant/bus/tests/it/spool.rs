//! The spool against a model of it: random records, restarts, torn ends and damaged files, within a byte budget.

use std::collections::VecDeque;
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
        assert_eq!(page.from, from);
        assert!(!page.records.is_empty());
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
    for _ in 0..3_000 {
        match rng.random_range(0..60) {
            0 => {
                drop(spool);
                let torn = rng.random_range(0..2_u64) * rng.random_range(1..4_000);
                let last = files(&folder).pop().unwrap();
                let length = last.metadata().unwrap().len();
                let left = length.saturating_sub(torn).max(32);
                OpenOptions::new().write(true).open(&last).unwrap().set_len(left).unwrap();
                let found;
                (spool, found) = Spool::open(&folder.0, BUDGET, 8).unwrap();
                assert_eq!(found.torn_bytes, left - last.metadata().unwrap().len());
                model.truncate(
                    (spool.next() - model.front().map_or(spool.next(), |one| one.0)) as usize,
                );
            }
            _ => {
                let length = rng.random_range(0..6_000);
                let record: Vec<u8> = (0..length).map(|_| rng.random_range(0..=255)).collect();
                let number = spool.append(&record).unwrap();
                model.push_back((number, record));
            }
        }
        while model.front().is_some_and(|oldest| oldest.0 < spool.first()) {
            model.pop_front();
        }
        assert!(size(&folder) <= BUDGET && spool.bytes() == size(&folder));
    }
    assert_eq!(spool.stream(), 7, "the series goes on");
    assert!(spool.first() > 1, "something fell out");
    assert!(size(&folder) > BUDGET / 2, "no more than a part of the budget falls out at once");
    for page_bytes in [1, 20_000, 1 << 30] {
        assert_eq!(all(&spool, page_bytes), model);
    }
}

#[test]
fn a_record_that_was_not_written_whole_is_removed_and_told_and_its_number_is_given_again() {
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
    let (mut spool, found) = Spool::open(&folder.0, BUDGET, 8).unwrap();
    assert_eq!((found.records, found.torn_bytes), (2, 8 + 4));
    assert_eq!(spool.append(b"new").unwrap(), 3);
    assert_eq!(spool.page(3, 10).unwrap().records, [b"new".to_vec()]);
}

#[test]
fn damage_in_an_older_file_removes_what_is_older_so_that_numbers_stay_without_gaps() {
    let folder = Folder::new();
    let mut spool = Spool::open(&folder.0, BUDGET, 7).unwrap().0;
    for number in 0..40_u8 {
        spool.append(&vec![number; 10_000]).unwrap();
    }
    drop(spool);
    let files = files(&folder);
    assert!(files.len() >= 4);
    let damaged = OpenOptions::new().write(true).open(&files[1]).unwrap();
    damaged.write_all_at(b"x", 15_000).unwrap();
    let (spool, found) = Spool::open(&folder.0, BUDGET, 8).unwrap();
    assert!(found.torn_bytes > 20_000, "{found:?}");
    let kept = all(&spool, 1 << 20);
    assert!(kept.len() < 40 && kept.back().unwrap().0 == 40, "{}", kept.len());
    assert!(kept.iter().all(|(number, record)| record[0] == (*number - 1) as u8));
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
