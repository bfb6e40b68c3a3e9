//! The client library as installed by users: under a prefix, linked by programs built outside the tree.
//!
//! Missing tools of a machine are reported as SKIPPED and counted in `target/tmp/skipped`.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The repository.
#[must_use]
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("a parent").to_path_buf()
}

/// Says that something is not tested here, and why.
pub fn skipped(scratch: &Path, what: &str, why: &str) {
    let line = format!("SKIPPED: {what}: {why}\n");
    let mut stderr = std::io::stderr();
    let _ = stderr.write_all(line.as_bytes());
    let file = fs::OpenOptions::new().create(true).append(true).open(scratch.join("skipped"));
    file.and_then(|mut file| file.write_all(line.as_bytes())).expect("a writable target folder");
}

/// Whether a program can be started here.
#[must_use]
pub fn has(program: &str) -> bool {
    Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success())
}

/// Runs a command to its end; on failure its whole output is reported.
pub fn run(command: &mut Command) -> Output {
    let output = command.output().expect("a program that can be started");
    assert!(
        output.status.success(),
        "{command:?}: {}\n{}{}",
        output.status,
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    output
}

/// `name value` per line, as the examples print.
#[must_use]
pub fn figures(output: &Output) -> BTreeMap<String, String> {
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let pair = |line: &str| line.split_once(' ').map(|(a, b)| (a.to_owned(), b.to_owned()));
    text.lines().filter_map(pair).collect()
}

/// C or C++.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Language {
    /// C11.
    C,
    /// C++17.
    Cpp,
}

impl Language {
    /// The compiler, by the name that every system has.
    #[must_use]
    pub fn compiler(self) -> &'static str {
        if self == Self::C { "cc" } else { "c++" }
    }

    fn extension(self) -> &'static str {
        if self == Self::C { "c" } else { "cpp" }
    }

    fn standard(self) -> &'static str {
        if self == Self::C { "-std=c11" } else { "-std=c++17" }
    }
}

/// Warnings that a header must not cause in users' programs.
const STRICT: [&str; 7] =
    ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Werror"];

/// An installed client library, and a folder to build programs in.
#[derive(Debug)]
pub struct Prefix {
    folder: PathBuf,
    prefix: PathBuf,
}

impl Prefix {
    /// Installs the build products into a new folder outside the tree.
    #[must_use]
    pub fn install(name: &str) -> Self {
        let session = shm_schema::new_session();
        let folder = std::env::temp_dir().join(format!("trued-{name}-{session:016x}"));
        let prefix = folder.join("prefix");
        fs::create_dir_all(&folder).expect("a temporary folder");
        let built = std::env::current_exe().expect("a path");
        run(Command::new(root().join("client/c/install.sh"))
            .args([OsStr::new("--prefix"), prefix.as_os_str(), OsStr::new("--from")])
            .arg(built.parent().expect("a folder")));
        Self { folder, prefix }
    }

    /// Path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.prefix
    }

    /// Where programs are built.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Moves it; nothing of the old folder is left.
    pub fn move_away(&mut self) {
        let to = self.folder.join("moved/else where");
        fs::create_dir_all(to.parent().expect("a parent")).expect("a folder");
        fs::rename(&self.prefix, &to).expect("a rename within a folder");
        self.prefix = to;
    }

    /// A copy of an example, away from the tree.
    fn source(&self, language: Language, source: &str) -> PathBuf {
        let name = format!("{source}.{}", language.extension());
        let copy = self.folder.join(&name);
        let examples = root().join("client/c/examples").join(&name);
        let programs = root().join("client/c/tests/programs").join(&name);
        let from = if examples.exists() { examples } else { programs };
        fs::copy(&from, &copy).expect("an example of that name");
        copy
    }

    /// Builds an example with the flags of `pkg-config`.
    #[must_use]
    pub fn build(&self, language: Language, source: &str) -> PathBuf {
        let name = format!("{source}-{language:?}");
        self.build_of(language, &[self.source(language, source)], &[], &name)
    }

    /// Builds a program of these sources, with these folders of headers, with the flags of
    /// `pkg-config`.
    #[must_use]
    pub fn build_of(
        &self,
        language: Language,
        sources: &[PathBuf],
        headers: &[PathBuf],
        name: &str,
    ) -> PathBuf {
        let flags = run(Command::new("pkg-config")
            .args(["--cflags", "--libs", "trued_client"])
            .env("PKG_CONFIG_PATH", self.prefix.join("lib/pkgconfig")));
        let flags = String::from_utf8(flags.stdout).expect("UTF-8");
        let program = self.folder.join(name);
        // Blanks within a path are escaped by a backslash.
        let flags = flags.trim().replace("\\ ", "\u{1}");
        run(Command::new(language.compiler())
            .args([language.standard(), "-O2", "-g", "-D_POSIX_C_SOURCE=200809L"])
            .args(STRICT)
            .args(headers.iter().map(|folder| format!("-I{}", folder.display())))
            .args(sources)
            .args(flags.split_whitespace().map(|flag| flag.replace('\u{1}', " ")))
            .args(["-lm", "-pthread"])
            .arg(format!("-Wl,-rpath,{}", self.prefix.join("lib").display()))
            .arg("-o")
            .arg(&program));
        program
    }

    /// Builds an example in both languages by `find_package`, linked to the shared and to the static library.
    #[must_use]
    pub fn build_by_cmake(&self, source: &str) -> Vec<PathBuf> {
        let project = self.folder.join("cmake");
        fs::create_dir_all(&project).expect("a folder");
        let (c, cpp) = (self.source(Language::C, source), self.source(Language::Cpp, source));
        let text = format!(
            "cmake_minimum_required(VERSION 3.16)\nproject(outside C CXX)\n\
             set(CMAKE_CXX_STANDARD 17)\nset(CMAKE_C_STANDARD 11)\n\
             find_package(trued_client 1.0 REQUIRED)\n\
             add_executable(shared_c {c:?})\nadd_executable(shared_cpp {cpp:?})\nadd_executable(static_c {c:?})\n\
             target_compile_definitions(shared_c PRIVATE _POSIX_C_SOURCE=200809L)\n\
             target_compile_definitions(static_c PRIVATE _POSIX_C_SOURCE=200809L)\n\
             target_link_libraries(shared_c trued::client m)\ntarget_link_libraries(shared_cpp trued::client)\n\
             target_link_libraries(static_c trued::client_static m)\n"
        );
        fs::write(project.join("CMakeLists.txt"), text).expect("a file");
        let build = project.join("build");
        let _ = fs::remove_dir_all(&build);
        let prefix = format!("-DCMAKE_PREFIX_PATH={}", self.prefix.display());
        run(Command::new("cmake").arg("-S").arg(&project).arg("-B").arg(&build).arg(prefix));
        run(Command::new("cmake").arg("--build").arg(&build));
        ["shared_c", "shared_cpp", "static_c"].map(|name| build.join(name)).to_vec()
    }
}

impl Drop for Prefix {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.folder);
    }
}
