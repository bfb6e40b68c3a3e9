//! Comparison of every link frame of many descriptions with Pinocchio, which reads them by urdfdom:
//! generated trees in the forms of real files, and the folder named by `TRUED_URDF`, if set.
//!
//! Needs `python3` with `venv` and the package `pin` from the package registry; otherwise the test
//! is SKIPPED.
#![expect(clippy::expect_used, clippy::panic, reason = "a test says what failed")]

mod python;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use physics::{Chain, Frame, Joints};
use recording::urdf::{self, ChainEnds};

use python::{answer, environment, scratch};

/// Most that a place (m) and a component of a rotation may differ.
const AGREES: f64 = 1e-9;
const CASES: usize = 40;

/// The interpreter of an environment with Pinocchio, or what this machine lacks.
fn pinocchio() -> Result<PathBuf, String> {
    environment("pinocchio-urdf", &["pin>=4.1,<5"])
}

struct Pose {
    joints: BTreeMap<String, f64>,
    links: BTreeMap<String, Frame>,
}

fn frame(fields: &[&str]) -> Frame {
    let n: Vec<f64> = fields.iter().map(|field| field.parse().expect("number")).collect();
    let rotation =
        glam::DMat3::from_cols_array(&[n[0], n[4], n[8], n[1], n[5], n[9], n[2], n[6], n[10]]);
    Frame::new(rotation, glam::DVec3::new(n[3], n[7], n[11]))
}

/// Results of Pinocchio for these files; `None` for one that it refuses.
fn frames(python: &Path, files: &[PathBuf]) -> Vec<(PathBuf, Option<Vec<Pose>>)> {
    let names: String = files.iter().map(|file| format!("{}\n", file.display())).collect();
    let mut found: Vec<(PathBuf, Option<Vec<Pose>>)> = Vec::new();
    for line in answer(python, "urdf/frames.py", names).lines() {
        let fields: Vec<&str> = line.split('\t').collect();
        match fields.as_slice() {
            ["file", path, state] => {
                found.push((PathBuf::from(path), (*state == "loaded").then(Vec::new)));
            }
            ["pose", joints @ ..] => {
                let pair = |pair: &[&str]| (pair[0].to_owned(), pair[1].parse().expect("number"));
                let joints = joints.chunks_exact(2).map(pair).collect();
                let poses = found.last_mut().and_then(|(_, poses)| poses.as_mut()).expect("a file");
                poses.push(Pose { joints, links: BTreeMap::new() });
            }
            ["link", name, place @ ..] => {
                let pose = found.last_mut().and_then(|(_, poses)| poses.as_mut()?.last_mut());
                pose.expect("a pose").links.insert((*name).to_owned(), frame(place));
            }
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(found.len(), files.len(), "Pinocchio ended early");
    found
}

/// How a file was read: chains compared, and why the others were refused.
#[derive(Default)]
struct Account {
    chains: usize,
    most: f64,
    refused: BTreeMap<String, usize>,
}

fn compare(file: &Path, poses: &[Pose], account: &mut Account) {
    let links: Vec<&String> =
        poses.first().map(|pose| pose.links.keys().collect()).unwrap_or_default();
    let named = |link: &&&String| matches!(link.as_str(), "base" | "base_link");
    let bases: Vec<Option<&str>> =
        std::iter::once(None).chain(links.iter().filter(named).map(|l| Some(l.as_str()))).collect();
    for base in bases {
        for tip in &links {
            let import = match urdf::read(file, &ChainEnds { base, tip: Some(tip) }) {
                Ok(import) => import,
                Err(error) => {
                    let message = error.to_string();
                    let message = message.lines().next().unwrap_or_default().to_owned();
                    *account.refused.entry(message).or_default() += 1;
                    continue;
                }
            };
            if import.notes.iter().any(|note| note.contains("move together")) {
                // Pinocchio moves every stage of a telescope by itself.
                continue;
            }
            let arm = &import.model.physics.arm;
            for pose in poses {
                let mut q = Joints::default();
                for (q, joint) in q.iter_mut().zip(&import.model.file.joints) {
                    *q = pose.joints[&joint.name];
                }
                let found = Chain::nominal(arm, &q).base_from_tool;
                let [root_from_base, root_from_tip] =
                    [&import.base, &import.tip].map(|link| pose.links[link]);
                let wanted = root_from_base.inverse().after(&root_from_tip);
                let turn = (found.rotation - wanted.rotation).to_cols_array();
                let error = turn.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
                let error = error.max((found.origin - wanted.origin).length());
                let (file, base) = (file.display(), &import.base);
                assert!(error < AGREES, "{file}: `{base}` to `{tip}` is off by {error}");
                account.most = account.most.max(error);
            }
            account.chains += 1;
        }
    }
}

/// Reproducible pseudo-random numbers.
struct Chance(u64);

impl Chance {
    fn unit(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn below(&mut self, count: usize) -> usize {
        ((self.unit() * count as f64) as usize).min(count - 1)
    }

    fn three(&mut self, size: f64) -> String {
        let mut one = || format!("{:.6}", (2.0 * self.unit() - 1.0) * size);
        format!("{} {} {}", one(), one(), one())
    }
}

const MASSES: [&str; 5] = [
    "",
    "<inertial><mass value='1e-8'/><inertia ixx='1e-8' ixy='1e-8' ixz='1e-8' iyy='1e-8' iyz='1e-8' izz='1e-8'/></inertial>",
    "<inertial><mass value='0'/><inertia ixx='0' ixy='0' ixz='0' iyy='0' iyz='0' izz='0'/></inertial>",
    "<inertial><origin xyz='0 0 1'/><mass value='2'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='9'/></inertial>",
    "<inertial><mass value='2'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial>",
];
const KINDS: [&str; 4] = ["revolute", "continuous", "prismatic", "fixed"];

/// A tree of links with the controller's `base` as a leaf, in one of the forms of real files.
fn made(case: usize, chance: &mut Chance) -> Vec<u8> {
    let count = 3 + chance.below(8);
    let mut body = String::from(
        "<link name='base_link'/><link name='base'/><joint name='to_base' type='fixed'>\
         <parent link='base_link'/><child link='base'/><origin xyz='0 0.1 0.45' rpy='0 0 3.1'/></joint>",
    );
    for i in 0..count {
        // Mostly a chain, sometimes a branch.
        let parent = if chance.below(4) == 0 { chance.below(i + 1) } else { i };
        let parent = if parent == 0 { "base_link".to_owned() } else { format!("l{parent}") };
        let (kind, mass) = (KINDS[chance.below(KINDS.len())], MASSES[chance.below(MASSES.len())]);
        let (xyz, rpy, axis) = (chance.three(1.0), chance.three(3.0), chance.three(2.0));
        body += &format!(
            "<link name='l{n}'>{mass}</link>\n<joint name='j{n}' type='{kind}'><parent link='{parent}'/><child link='l{n}'/>\
             <origin xyz='{xyz}' rpy='{rpy}'/><axis xyz='{axis}'/><limit lower='-3' upper='3' effort='1' velocity='1'/></joint>\n",
            n = i + 1
        );
    }
    let (head, inside) = match case % 6 {
        0 => ("<?xml version='1.0' encoding='ISO-8859-1'?>", "<!-- M\u{fc}nchen -->"),
        1 => ("<!DOCTYPE robot>", ""),
        2 => ("<?xml version='1.0'?><!-- a -- b -->", "<!-- 1 --- 2 -->"),
        3 => ("", "<sensor:gazebo body:x='a:b'/>"),
        4 => ("", "<gazebo xmlns:s='urn:s'><s:plugin/></gazebo>"),
        _ => ("", ""),
    };
    let text = format!("{head}<robot name='made'>{inside}{body}</robot>");
    // Latin-1: every character here is one byte.
    text.chars().map(|c| c as u8).collect()
}

#[test]
fn every_link_frame_of_every_form_of_file_is_that_of_pinocchio() {
    let python = match pinocchio() {
        Ok(python) => python,
        Err(why) => {
            eprintln!("SKIPPED: link frames beside Pinocchio: {why}");
            return;
        }
    };
    let folder = scratch().join("urdf-peers");
    std::fs::create_dir_all(&folder).expect("a folder");
    let mut chance = Chance(31);
    let mut files = Vec::new();
    for case in 0..CASES {
        let file = folder.join(format!("{case}.urdf"));
        std::fs::write(&file, made(case, &mut chance)).expect("written");
        files.push(file);
    }
    let mut account = Account::default();
    let mut loaded = 0;
    for (file, poses) in frames(&python, &files) {
        let poses = poses.unwrap_or_else(|| panic!("Pinocchio refuses {}", file.display()));
        compare(&file, &poses, &mut account);
        loaded += 1;
    }
    eprintln!("{loaded} made files, {} chains, at most {:.1e} apart", account.chains, account.most);
    // Only files without a moving joint between the ends are refused.
    let wrong = account.refused.keys().find(|message| !message.contains("has 0 moving joints"));
    assert_eq!(wrong, None);
    assert!(account.chains > 10 * CASES, "{}", account.chains);
}

#[test]
fn every_link_frame_of_a_folder_of_descriptions_is_that_of_pinocchio() {
    let Some(folder) = std::env::var_os("TRUED_URDF") else {
        eprintln!("SKIPPED: a folder of descriptions beside Pinocchio: set TRUED_URDF");
        return;
    };
    let python = pinocchio().expect("Pinocchio");
    let (mut files, mut open) = (Vec::new(), vec![PathBuf::from(folder)]);
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
            let path = entry.path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|extension| extension == "urdf") {
                files.push(path);
            }
        }
    }
    let mut account = Account::default();
    let (mut loaded, mut whole) = (0, 0);
    for (file, poses) in frames(&python, &files) {
        let Some(poses) = poses else { continue };
        loaded += 1;
        let before = account.chains;
        compare(&file, &poses, &mut account);
        whole += usize::from(account.chains > before);
    }
    let Account { chains, most, refused } = account;
    eprintln!(
        "{} files, {loaded} loaded by Pinocchio, {whole} with chains, {chains} chains, at most {most:.1e} apart",
        files.len()
    );
    for (message, count) in refused {
        eprintln!("{count} x {message}");
    }
}
