//! `cargo xtask sbom`: components linked into the programs and the C library that are shipped, as
//! CycloneDX 1.5 (JSON), for the packages.
//!
//! Source: `cargo tree` of each package, normal dependencies on x86-64 Linux, and the checksums of
//! `Cargo.lock`. Crates of this workspace are listed without a package URL, because they are not
//! published. The same lock file gives the same bytes, without times or paths of a machine.
//! Procedural macros and build scripts are not linked and not listed.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::{Value, json};

const USAGE: &str = "cargo xtask sbom [--out=DIR]";

/// A program or library that is shipped.
struct Subject {
    /// Folder of its workspace, from the root.
    workspace: &'static str,
    package: &'static str,
    /// Kind of component in CycloneDX.
    kind: &'static str,
    /// Name of the file, without `.cdx.json`.
    file: &'static str,
}

const PROGRAM: Subject =
    Subject { workspace: ".", package: "trued", kind: "application", file: "trued" };
const LIBRARY: Subject =
    Subject { workspace: ".", package: "trued-client-c", kind: "library", file: "libtrued_client" };
const PLANT: Subject =
    Subject { workspace: "plant", package: "bus", kind: "application", file: "trued-plant" };
const SUBJECTS: [Subject; 3] = [PROGRAM, LIBRARY, PLANT];

/// Writes a file for each shipped program and library to `DIR`; `target/package/sbom` unless given.
pub(crate) fn run(arguments: &[&str]) -> Result<bool, String> {
    let out = match arguments {
        [] => root().join("target/package/sbom"),
        [argument] => argument.strip_prefix("--out=").map(PathBuf::from).ok_or(USAGE)?,
        _ => return Err(USAGE.to_owned()),
    };
    fs::create_dir_all(&out).map_err(|why| format!("{}: {why}", out.display()))?;
    for subject in &SUBJECTS {
        let bom = bom(subject)?;
        let path = out.join(format!("{}.cdx.json", subject.file));
        fs::write(&path, format!("{bom:#}\n"))
            .map_err(|why| format!("{}: {why}", path.display()))?;
        let count = bom["components"].as_array().map_or(0, Vec::len);
        println!("{count} components in {}", path.display());
    }
    Ok(true)
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// A crate that is linked.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Crate {
    name: String,
    version: String,
    license: String,
}

impl Crate {
    fn reference(&self) -> String {
        format!("pkg:cargo/{}@{}", self.name, self.version)
    }
}

/// Linked crates, and the dependencies of each.
type DependencyGraph = BTreeMap<Crate, BTreeSet<String>>;

fn bom(subject: &Subject) -> Result<Value, String> {
    let workspace = root().join(subject.workspace);
    let links = parse_tree(&tree(&workspace, subject.package)?)?;
    let checksums = checksums(&workspace)?;
    let top = links.keys().find(|one| one.name == subject.package).ok_or("an empty tree")?;
    let others = links.keys().filter(|one| *one != top);
    let dependency = |(one, names): (&Crate, &BTreeSet<String>)| json!({ "ref": one.reference(), "dependsOn": names });
    Ok(json!({
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": { "component": component(top, subject.kind, &checksums) },
        "components": others.map(|one| component(one, "library", &checksums)).collect::<Vec<_>>(),
        "dependencies": links.iter().map(dependency).collect::<Vec<_>>(),
    }))
}

fn component(one: &Crate, kind: &str, checksums: &BTreeMap<String, String>) -> Value {
    let mut component = json!({
        "type": kind,
        "bom-ref": one.reference(),
        "name": one.name,
        "version": one.version,
        "licenses": [{ "expression": one.license }],
    });
    if let Some(sha256) = checksums.get(&one.reference()) {
        component["purl"] = json!(one.reference());
        component["hashes"] = json!([{ "alg": "SHA-256", "content": sha256 }]);
    }
    component
}

/// `cargo tree` of what is linked into a package.
fn tree(workspace: &Path, package: &str) -> Result<String, String> {
    let linked = ["tree", "--locked", "--package", package, "--edges", "normal,no-proc-macro"];
    let form =
        ["--target", "x86_64-unknown-linux-gnu", "--prefix", "depth", "--format", " {p}\t{l}"];
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let done = Command::new(cargo).args(linked).args(form).current_dir(workspace).output();
    let done = done.map_err(|why| format!("cargo tree: {why}"))?;
    if !done.status.success() {
        return Err(format!("cargo tree: {}", String::from_utf8_lossy(&done.stderr)));
    }
    String::from_utf8(done.stdout).map_err(|why| why.to_string())
}

/// Lines as `2 glam v0.34.0<tab>MIT OR Apache-2.0`, a crate's own dependencies below it at its first mention.
fn parse_tree(tree: &str) -> Result<DependencyGraph, String> {
    let mut links = DependencyGraph::new();
    let mut above: Vec<Crate> = Vec::new();
    for line in tree.lines().filter(|line| !line.trim().is_empty()) {
        let (depth, one) =
            parse_line(line).ok_or_else(|| format!("cargo tree: not understood: {line}"))?;
        above.truncate(depth);
        if let Some(parent) = above.last() {
            links.entry(parent.clone()).or_default().insert(one.reference());
        }
        links.entry(one.clone()).or_default();
        above.push(one);
    }
    Ok(links)
}

fn parse_line(line: &str) -> Option<(usize, Crate)> {
    let (depth, rest) = line.split_once(' ')?;
    let (package, license) = rest.split_once('\t')?;
    let mut fields = package.split_whitespace();
    let name = fields.next()?.to_owned();
    let version = fields.next()?.strip_prefix('v')?.to_owned();
    // Some crates still write `MIT/Apache-2.0`.
    let license = license.trim_end_matches("(*)").trim().replace('/', " OR ");
    Some((depth.parse().ok()?, Crate { name, version, license }))
}

/// Checksums of a workspace's lock file, by reference.
fn checksums(workspace: &Path) -> Result<BTreeMap<String, String>, String> {
    let text = fs::read_to_string(workspace.join("Cargo.lock")).map_err(|why| why.to_string())?;
    let lock: toml::Table = text.parse().map_err(|why| format!("Cargo.lock: {why}"))?;
    let packages = lock.get("package").and_then(toml::Value::as_array);
    let checksum = |package: &toml::Value| {
        let text = |key: &str| package.get(key).and_then(toml::Value::as_str);
        Some((
            format!("pkg:cargo/{}@{}", text("name")?, text("version")?),
            text("checksum")?.to_owned(),
        ))
    };
    Ok(packages.into_iter().flatten().filter_map(checksum).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Required by the schema of CycloneDX 1.5: `bomFormat`, `specVersion`; of a component `type`, `name`; references that exist, each once.
    #[test]
    fn each_bom_has_what_cyclonedx_requires_and_no_path_of_a_machine() {
        for subject in &SUBJECTS {
            let bom = bom(subject).unwrap();
            assert_eq!(
                (&bom["bomFormat"], &bom["specVersion"]),
                (&json!("CycloneDX"), &json!("1.5"))
            );
            assert_eq!(bom["metadata"]["component"]["name"], subject.package);
            let components = bom["components"].as_array().unwrap();
            let all = components.iter().chain([&bom["metadata"]["component"]]);
            let references: Vec<&str> = all.map(|one| one["bom-ref"].as_str().unwrap()).collect();
            let once: BTreeSet<&str> = references.iter().copied().collect();
            assert_eq!(once.len(), references.len(), "each component once");
            for component in components {
                assert!(component["name"].is_string() && component["type"] == "library");
                let license = component["licenses"][0]["expression"].as_str().unwrap();
                assert!(!license.is_empty(), "{component}");
                let is_workspace_member = component["version"] == env!("CARGO_PKG_VERSION")
                    && component["purl"].is_null();
                assert!(
                    is_workspace_member
                        || component["hashes"][0]["content"].as_str().unwrap().len() == 64
                );
            }
            for dependency in bom["dependencies"].as_array().unwrap() {
                let named =
                    dependency["dependsOn"].as_array().unwrap().iter().chain([&dependency["ref"]]);
                named.for_each(|one| assert!(once.contains(one.as_str().unwrap()), "{one}"));
            }
            assert!(
                !bom.to_string().contains(env!("CARGO_MANIFEST_DIR").trim_end_matches("xtask"))
            );
        }
    }

    #[test]
    fn the_program_links_no_schemas_and_the_library_no_program() {
        let names = |subject| {
            let tree = bom(subject).unwrap();
            let components = tree["components"].as_array().unwrap().clone();
            components
                .iter()
                .map(|one| one["name"].as_str().unwrap().to_owned())
                .collect::<Vec<_>>()
        };
        let (program, library) = (names(&PROGRAM), names(&LIBRARY));
        assert!(
            program.contains(&"iceoryx2".to_owned()) && library.contains(&"iceoryx2".to_owned())
        );
        assert!(!program.iter().any(|name| name == "schemars" || name == "jsonschema"));
        assert!(!library.iter().any(|name| name == "diagnosis" || name == "clap"));
    }
}
