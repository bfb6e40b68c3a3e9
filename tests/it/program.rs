//! The program as started by its users, in a temporary folder of the test.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};

use crate::schemas;

/// A folder on tmpfs: files of the test, and its runtime directory.
pub(crate) struct Place(PathBuf);

/// Exit code and output of the program.
#[derive(Debug)]
pub(crate) struct Done {
    pub(crate) code: Option<i32>,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl Place {
    /// Short, as the transport bounds its paths.
    pub(crate) fn new() -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let path = PathBuf::from(format!("/dev/shm/trued-it-{}-{number}", std::process::id()));
        fs::create_dir_all(path.join("run")).unwrap();
        Self(path)
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    pub(crate) fn file(&self, name: &str, text: &str) -> PathBuf {
        fs::write(self.path(name), text).unwrap();
        self.path(name)
    }

    pub(crate) fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).expect(name)
    }

    pub(crate) fn json(&self, name: &str) -> serde_json::Value {
        serde_json::from_str(&self.read(name)).unwrap()
    }

    /// Contents of the folder, except its runtime directory.
    pub(crate) fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(&self.0).unwrap();
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<_> = names.filter(|name| name != "run").collect();
        names.sort();
        names
    }

    /// Remains of runs in shared memory.
    pub(crate) fn litter(&self) -> Vec<PathBuf> {
        let entries = fs::read_dir(self.path("run")).unwrap();
        entries.map(|entry| entry.unwrap().path()).collect()
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_trued-under-test"));
        command.args(arguments).current_dir(&self.0).stdin(Stdio::null());
        command.env("TRUED_RUNTIME_DIR", self.path("run")).env_remove("NO_COLOR");
        // Pages of all runs are of one time, so that they can be compared.
        command.env("SOURCE_DATE_EPOCH", "1700000000");
        command
    }

    /// Runs the program to its end.
    pub(crate) fn run(&self, arguments: &[&str]) -> Done {
        let done = ended(self.command(arguments));
        self.assert_result_fits(arguments, &done);
        done
    }

    /// Checks the output of `--json` against its schema, for every test.
    fn assert_result_fits(&self, arguments: &[&str], done: &Done) {
        let mut rest = arguments.iter().skip_while(|argument| **argument != "--json").skip(1);
        let Some(name) = rest.next() else { return };
        // Output that is not a result of this run (refused, or truncated) is left to the test.
        if !matches!(done.code, Some(0 | 1)) {
            return;
        }
        let text = if *name == "-" {
            Some(done.out.clone())
        } else {
            fs::read_to_string(self.path(name)).ok()
        };
        if let Some(text) = text.filter(|text| text.starts_with('{')) {
            schemas::assert_result_fits(&text, arguments);
        }
    }

    /// The same within a limited address space, MB. One heap for all threads: glibc otherwise gives
    /// each thread its own, reserving 64 to 128 MB of addresses if available, depending on which
    /// thread is first.
    pub(crate) fn run_within_mb(&self, megabytes: u32, arguments: &[&str]) -> Done {
        let plain = self.command(arguments);
        let mut limited = Command::new("sh");
        limited.arg("-c").arg(format!("ulimit -v {}; exec \"$0\" \"$@\"", 1024 * megabytes));
        limited.arg(plain.get_program()).args(plain.get_args()).current_dir(&self.0);
        limited.env("TRUED_RUNTIME_DIR", self.path("run")).env("MALLOC_ARENA_MAX", "1");
        ended(limited)
    }

    /// The same without the right to real-time scheduling and locked memory, for any user.
    pub(crate) fn run_unprivileged(&self, arguments: &[&str]) -> Done {
        let plain = self.command(arguments);
        if !rustix::process::geteuid().is_root() {
            return ended(plain);
        }
        let mut command = Command::new("prlimit");
        command.args(["--rtprio=0:0", "--memlock=65536:65536", "setpriv"]);
        command.args(["--bounding-set=-sys_nice,-ipc_lock", "--inh-caps=-sys_nice,-ipc_lock"]);
        command.arg(plain.get_program()).args(plain.get_args());
        command.current_dir(&self.0).env("TRUED_RUNTIME_DIR", self.path("run"));
        ended(command)
    }

    /// The same without access to other programs.
    pub(crate) fn run_alone(&self, arguments: &[&str]) -> Done {
        self.run_beside(Path::new("/nowhere"), arguments)
    }

    /// The same with access to the programs of that folder only.
    pub(crate) fn run_beside(&self, folder: &Path, arguments: &[&str]) -> Done {
        let mut command = self.command(arguments);
        command.env("PATH", folder);
        ended(command)
    }

    /// The same with a text on its standard input, which is a pipe.
    pub(crate) fn run_fed(&self, text: &str, arguments: &[&str]) -> Done {
        let mut child = self.command(arguments);
        child.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = child.spawn().unwrap();
        let (mut input, text) = (child.stdin.take().unwrap(), text.to_owned());
        // A program that refuses early leaves the rest of the text.
        let feed = std::thread::spawn(move || {
            drop(std::io::Write::write_all(&mut input, text.as_bytes()));
        });
        let output = child.wait_with_output().unwrap();
        feed.join().unwrap();
        Done::of(output)
    }

    /// The same, and it has to succeed.
    pub(crate) fn succeed(&self, arguments: &[&str]) -> Done {
        let done = self.run(arguments);
        assert_eq!(done.code, Some(0), "{arguments:?}: {done:#?}");
        done
    }

    /// Starts the program.
    pub(crate) fn start(&self, arguments: &[&str]) -> Child {
        let mut command = self.command(arguments);
        command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
    }
}

fn ended(mut command: Command) -> Done {
    Done::of(command.stdin(Stdio::null()).output().unwrap())
}

impl Done {
    fn of(output: Output) -> Self {
        let text = |bytes| String::from_utf8(bytes).unwrap();
        Self { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Sends a signal by its name.
pub(crate) fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill").args([&format!("-{name}"), &child.id().to_string()]).status();
    assert!(sent.unwrap().success());
}

/// A file of the real recordings; none, loudly, where they are not there.
pub(crate) fn real_data(file: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("TRUED_DATA")
        .map_or_else(|| workspace().join("../shared/data"), PathBuf::from);
    let path = folder.join(file);
    if path.is_file() {
        return Some(path);
    }
    eprintln!("SKIPPED: {} is not there (set TRUED_DATA)", path.display());
    None
}

/// The root of the workspace.
pub(crate) fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}
