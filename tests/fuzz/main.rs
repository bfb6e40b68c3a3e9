//! Every parser of foreign input, run on examples, on earlier findings, and on a bounded number of
//! mutations.
//!
//! A separate program, because its allocator counts. The functions are those of `cargo fuzz`
//! (`fuzz/README.md`), which runs without limit; `TRUED_FUZZ=N` multiplies the number of mutations
//! here by N.
#![expect(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on fails")]
#![expect(clippy::print_stdout, reason = "what was measured is said")]

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use tests::clients::root;
use tests::fuzz::{ALL, Target};
use tests::mutator::Mutator;

/// Changed inputs of a target with a share of 100.
const INPUTS: u64 = 1500;
/// No input takes a hundredth of this; the machine may be busy.
const LIMIT: Duration = Duration::from_secs(60);
/// What a reader may take from the heap at any time, whatever the input.
const MEMORY_FREE: u64 = 4 << 20;
/// And for each byte of the input.
const MEMORY_PER_BYTE: u64 = 400;

/// Files of a folder with that ending; any where it is empty.
fn files(folder: &Path, ending: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let fits = |path: &PathBuf| {
        path.is_file() && (ending.is_empty() || path.extension().is_some_and(|e| e == ending))
    };
    let mut found: Vec<_> = entries.filter(fits).collect();
    found.sort();
    found
}

fn examples(target: &Target) -> Vec<Vec<u8>> {
    let mut paths = files(&root().join("fuzz/seeds").join(target.name), "");
    for (folder, ending) in target.examples {
        paths.extend(files(&root().join(folder), ending));
    }
    paths.iter().map(|path| fs::read(path).unwrap()).collect()
}

/// Runs one input; returns what is wrong with the result.
fn verdict(target: &Target, bytes: &[u8]) -> Result<u64, String> {
    let mut outcome = Ok(());
    let heap = allocation_counter::measure(|| {
        outcome = catch_unwind(AssertUnwindSafe(|| (target.run)(bytes)));
    });
    if let Err(panic) = outcome {
        let message = panic.downcast_ref::<String>().map(String::as_str);
        return Err(message.or(panic.downcast_ref().copied()).unwrap_or("a panic").to_owned());
    }
    let most = MEMORY_FREE + MEMORY_PER_BYTE * bytes.len() as u64;
    if heap.bytes_max > most {
        return Err(format!("{} bytes from the heap, expected at most {most}", heap.bytes_max));
    }
    Ok(heap.bytes_max)
}

/// All inputs of a target, in a separate thread: an endless loop is reported too.
fn hold(name: &'static str) {
    let target = *ALL.iter().find(|target| target.name == name).unwrap();
    let examples = examples(&target);
    assert!(!examples.is_empty(), "{name} has no example");
    let times: u64 = std::env::var("TRUED_FUZZ").map_or(1, |times| times.parse().unwrap());
    let inputs = INPUTS * times * target.share / 100;
    let (tell, messages) = channel();
    std::thread::spawn(move || {
        // Shared data are created once, which must not count for the first input.
        let _ = verdict(&target, &examples[0]);
        let mut mutator = Mutator::new(&examples, 7);
        let changed = (0..inputs).map(|_| mutator.next_input());
        for bytes in examples.iter().cloned().chain(changed) {
            let _ = tell.send(MessageWriter::Tries(bytes.clone()));
            let _ = tell.send(MessageWriter::Found(verdict(&target, &bytes)));
        }
    });
    let (mut tried, mut most) = (Vec::new(), 0);
    loop {
        match messages.recv_timeout(LIMIT) {
            Ok(MessageWriter::Tries(bytes)) => tried = bytes,
            Ok(MessageWriter::Found(Ok(bytes))) => most = most.max(bytes),
            Ok(MessageWriter::Found(Err(fault))) => broken(name, &tried, &fault),
            Err(RecvTimeoutError::Timeout) => broken(name, &tried, "it does not come to an end"),
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    println!("{name}: {inputs} inputs, at most {} kB from the heap", most / 1024);
}

/// Messages of the running thread.
enum MessageWriter {
    Tries(Vec<u8>),
    Found(Result<u64, String>),
}

fn broken(name: &str, bytes: &[u8], fault: &str) -> ! {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("fuzzed-{name}"));
    fs::write(&path, bytes).unwrap();
    panic!("{name}: {fault}\nthe input stands in {}", path.display());
}

macro_rules! targets {
    ($($name:ident)*) => {
        $(#[test]
        fn $name() {
            hold(stringify!($name));
        })*

        #[test]
        fn every_target_is_tried() {
            let tried = [$(stringify!($name)),*];
            for target in ALL {
                assert!(tried.contains(&target.name), "{} is not", target.name);
                let program = root().join(format!("fuzz/fuzz_targets/{}.rs", target.name));
                assert!(program.is_file(), "no program for `cargo fuzz` in {}", program.display());
            }
        }
    };
}
targets!(
    model cell cut manifest about mapping recording black_box waves urdf commands force messages rsi egm bridge answer request
);
