//! Output files on a real disk: complete, all or none, and never replacing other files.

use std::ffi::OsString;

use super::*;

/// A temporary directory of the test, removed afterwards.
struct Place(PathBuf);

impl Place {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("trued-{name}-{}", std::process::id()));
        fs::create_dir_all(&path).expect("a directory");
        Self(path)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    fn names(&self) -> Vec<OsString> {
        let entries = fs::read_dir(&self.0).expect("readable");
        let mut names: Vec<_> = entries.map(|entry| entry.expect("entry").file_name()).collect();
        names.sort();
        names
    }

    fn text(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).expect("read")
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn written(outputs: Outputs, files: &[(PathBuf, &str)]) -> Result<(), WriteError> {
    let mut outputs = outputs;
    files.iter().for_each(|(path, text)| outputs.put(path, *text));
    outputs.write()
}

#[test]
fn files_appear_whole_and_alone() {
    let place = Place::new("whole");
    let files = [(place.path("a.json"), "{}"), (place.path("b.csv"), "1")];
    written(Outputs::default(), &files).expect("written");
    assert_eq!((place.text("a.json").as_str(), place.text("b.csv").as_str()), ("{}", "1"));
    assert_eq!(place.names(), ["a.json", "b.csv"]);
}

#[test]
fn what_is_there_stays_unless_it_is_empty_or_it_is_asked_for() {
    let place = Place::new("stays");
    fs::write(place.path("b.csv"), "measured").expect("written");
    let files = [(place.path("a.toml"), "new"), (place.path("b.csv"), "new")];
    let refused = written(Outputs::default(), &files).expect_err("refused");
    assert!(matches!(&refused, WriteError::Exists(path) if path.ends_with("b.csv")), "{refused}");
    assert_eq!((place.names().len(), place.text("b.csv").as_str()), (1, "measured"));
    written(Outputs::new(true), &files).expect("with --overwrite");
    assert_eq!((place.text("a.toml").as_str(), place.text("b.csv").as_str()), ("new", "new"));
    fs::write(place.path("empty"), "").expect("written");
    written(Outputs::default(), &[(place.path("empty"), "new")]).expect("nothing is lost");
}

#[test]
fn a_result_takes_the_place_of_an_earlier_result_and_of_nothing_else() {
    let place = Place::new("result");
    let path = place.path("said");
    let again = || written(Outputs::default().result(&path), &[(path.clone(), "new")]);
    let page = format!("<!DOCTYPE html>\n{MADE_BY}\n<html>");
    for ours in ["{\n  \"schema\": \"trued.plan/1\",\n", &page] {
        fs::write(&path, ours).expect("written");
        again().expect("made anew");
        assert_eq!(place.text("said"), "new");
    }
    for theirs in ["pose,x_mm\n1,2.5\n", "{\"my\": 1}", "<!DOCTYPE html>\n<html>"] {
        fs::write(&path, theirs).expect("written");
        assert!(matches!(again(), Err(WriteError::Exists(_))), "{theirs}");
        assert_eq!(place.text("said"), theirs);
    }
    // An ordinary output is never treated as a result.
    fs::write(&path, &page).expect("written");
    assert!(written(Outputs::default(), &[(path.clone(), "new")]).is_err());
}

#[test]
fn what_an_input_names_or_stands_beside_it_is_an_input_too() {
    let place = Place::new("companions");
    let about = "schema = \"trued.recording/1\"\nmodel = \"robot.toml\"\n";
    let texts = [("a.csv", "measured"), ("a.toml", about), ("robot.toml", "calibrated")];
    for (name, text) in texts.into_iter().chain([("a.mapping.toml", "mapped")]) {
        fs::write(place.path(name), text).expect("written");
    }
    for name in ["a.csv", "a.toml", "a.mapping.toml", "robot.toml"] {
        let refused = Outputs::new(true).file(place.path(name)).check([&place.path("a.csv")]);
        assert!(matches!(refused, Err(WriteError::Input(_))), "{name}");
    }
}

#[test]
fn a_link_that_leads_nowhere_is_refused_before_anything_is_computed() {
    let place = Place::new("dangling");
    std::os::unix::fs::symlink(place.path("nowhere/file"), place.path("link")).expect("linked");
    let refused = Outputs::new(true).file(place.path("link")).check([]);
    assert!(matches!(refused, Err(WriteError::Io { .. })), "{refused:?}");
}

#[test]
fn the_model_of_a_diagnosis_is_created_again_until_somebody_edits_it() {
    let place = Place::new("edited");
    let (model, diagnosis) = (place.path("model.toml"), place.path("diagnosis.json"));
    let again = || written(Outputs::default().result(&model), &[(model.clone(), "new")]);
    fs::write(&model, "of somebody").expect("written");
    assert!(matches!(again(), Err(WriteError::Exists(_))), "no diagnosis beside it");
    fs::write(&diagnosis, "{\n  \"schema\": \"trued.diagnosis/1\",\n").expect("written");
    again().expect("made anew");
    let later = std::time::SystemTime::now() + 2 * WRITTEN_TOGETHER;
    let edited = File::options().append(true).open(&model).expect("there");
    edited.set_modified(later).expect("set");
    assert!(matches!(again(), Err(WriteError::Exists(_))), "edited");
    assert_eq!(place.text("model.toml"), "new");
}

#[test]
fn an_input_is_never_replaced_and_no_two_outputs_share_a_name() {
    let place = Place::new("apart");
    let (input, link) = (place.path("a.csv"), place.path("link.csv"));
    fs::write(&input, "measured").expect("written");
    std::os::unix::fs::symlink(&input, &link).expect("linked");
    for out in [&input, &link] {
        let refused = Outputs::new(true).file(out).check([&input]);
        assert!(matches!(refused, Err(WriteError::Input(_))), "{}", out.display());
    }
    let model = place.path("model.toml");
    let twice = Outputs::default().file(&model).result(place.path("./model.toml")).check([]);
    assert!(matches!(twice, Err(WriteError::Twice(_))));
    assert!(Outputs::default().file(&model).check([&place.path("none.csv")]).is_ok());
}

#[test]
fn one_file_that_fails_leaves_none_and_no_folder() {
    let place = Place::new("none");
    let folder = place.path("a/b");
    let (good, full) = (folder.join("good.csv"), PathBuf::from("/dev/full"));
    let outputs = Outputs::default().in_folder(&folder);
    let failed = written(outputs, &[(good.clone(), "1"), (full, "2")]).expect_err("no room");
    assert!(matches!(failed, WriteError::Io { .. }), "{failed}");
    assert!(place.names().is_empty(), "{:?}", place.names());
    written(Outputs::default().in_folder(&folder), &[(good, "1")]).expect("written");
    assert_eq!(place.text("a/b/good.csv"), "1");
}

#[test]
fn what_appeared_meanwhile_is_not_replaced_and_the_files_before_it_go_again() {
    let place = Place::new("race");
    let parts = ["a", "b"].map(|name| written_part(&place.path(name), b"new", true).expect("made"));
    fs::write(place.path("b"), "theirs").expect("written");
    assert!(matches!(finish(parts.into()), Err(WriteError::Exists(_))));
    assert_eq!((place.names(), place.text("b")), (vec![OsString::from("b")], "theirs".to_owned()));
}

#[test]
fn what_could_not_be_written_is_known_before_and_asking_leaves_nothing() {
    let place = Place::new("check");
    let check = |path: PathBuf| Outputs::default().file(path).check([]);
    check(place.path("a.json")).expect("can be made");
    assert!(check(place.0.clone()).is_err() && check(place.path("none/a.json")).is_err());
    let folder = place.path("new/folder");
    Outputs::default().in_folder(&folder).file(folder.join("a")).check([]).expect("can be made");
    assert!(place.names().is_empty());
    fs::write(place.path("a.json"), "{}").expect("written");
    assert!(check(place.path("a.json/b.json")).is_err(), "below a file");
    let below = place.path("a.json/folder");
    assert!(Outputs::default().in_folder(&below).file(below.join("a")).check([]).is_err());
}

#[test]
fn a_link_stays_a_link_and_permissions_stay() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let place = Place::new("link");
    let (file, link) = (place.path("file"), place.path("link"));
    fs::write(&file, "before").expect("written");
    fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).expect("set");
    symlink(&file, &link).expect("linked");
    written(Outputs::new(true), &[(link.clone(), "after")]).expect("written");
    assert_eq!(place.text("file"), "after");
    assert_eq!(fs::metadata(&file).expect("there").permissions().mode() & 0o777, 0o600);
    assert!(fs::symlink_metadata(&link).expect("there").is_symlink());
}

#[test]
fn a_missing_directory_is_bad_input() {
    let path = PathBuf::from("/nowhere/at/all.json");
    let failed = written(Outputs::default(), &[(path, "")]).expect_err("fails");
    assert!(failed.to_string().starts_with("cannot write /nowhere/at/all.json"));
    assert!(
        matches!(&failed, WriteError::Io { source, .. } if source.kind() == ErrorKind::NotFound)
    );
}
