//! Which offers a cell takes: each reason to refuse one, and that a refused one changes nothing.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use bus::acceptance::{Acceptance, Reason, Refusal};
use bus::offer::Statement;
use minisign::KeyPair;

use crate::place::{Folder, HERE};

pub(crate) const SERIAL: &str = "1600-00001";
const NOW: u64 = 1_800_000_000_000;

/// A model of the thesis robot with this serial number; `tcp_mm` tells one calibration from another.
pub(crate) fn model(serial: &str, tcp_mm: f64) -> String {
    let preset = Path::new(HERE).join("../../deploy/presets/irb1600-6-145-thesis.toml");
    let text = std::fs::read_to_string(preset).unwrap();
    let named = text.replacen("[robot]\n", &format!("[robot]\nserial = \"{serial}\"\n"), 1);
    let model = named.replacen("tcp_mm = [815.0,", &format!("tcp_mm = [{tcp_mm:.1},"), 1);
    assert!(model.contains(serial) && (tcp_mm == 815.0 || model != named));
    model
}

/// The cell of an owner who has a key, and accepts what it signed.
pub(crate) struct Owner {
    pub(crate) folder: Folder,
    pub(crate) keys: KeyPair,
}

impl Owner {
    pub(crate) fn new(accept: &str) -> Self {
        let owner =
            Self { folder: Folder::new(), keys: KeyPair::generate_unencrypted_keypair().unwrap() };
        std::fs::write(owner.folder.0.join("robot.toml"), model(SERIAL, 815.0)).unwrap();
        owner.write(accept, &owner.keys);
        owner
    }

    fn write(&self, accept: &str, keys: &KeyPair) {
        let key = keys.pk.to_base64();
        let text = format!(
            "schema = \"trued.models/1\"\naccept = \"{accept}\"\nrobot = \"robot.toml\"\nfolder = \"models\"\nkeys = [\"{key}\"]\n"
        );
        std::fs::write(self.file(), text).unwrap();
    }

    pub(crate) fn file(&self) -> PathBuf {
        self.folder.0.join("models.toml")
    }

    fn acceptance(&self) -> Acceptance {
        Acceptance::read(&self.file()).unwrap()
    }

    /// A signature of `model` with its own statement.
    pub(crate) fn sign(&self, model: &str, counter: u64, expires_unix_ms: u64) -> String {
        let statement = Statement::of(model.as_bytes(), counter, expires_unix_ms).unwrap();
        self.sign_as(model, &serde_json::to_string(&statement).unwrap())
    }

    fn sign_as(&self, model: &str, comment: &str) -> String {
        let reader = Cursor::new(model.as_bytes());
        let signed = minisign::sign(None, &self.keys.sk, reader, Some(comment), Some("untrusted"));
        signed.unwrap().into_string()
    }

    /// All files of the folder of offered models.
    pub(crate) fn kept(&self) -> BTreeMap<String, Vec<u8>> {
        let entries = std::fs::read_dir(self.folder.0.join("models")).unwrap().flatten();
        let named = entries.map(|entry| {
            let name = entry.file_name().to_string_lossy().into_owned();
            (name, std::fs::read(entry.path()).unwrap_or_default())
        });
        named.filter(|(name, _)| name != "lock").collect()
    }

    /// Checks and stages; a refusal must leave no trace.
    fn offer(&self, model: &str, signature: &str) -> Result<PathBuf, Refusal> {
        let mut acceptance = self.acceptance();
        let before = self.kept();
        let checked = acceptance.check(model.as_bytes(), signature, NOW);
        let taken = checked.and_then(|checked| acceptance.stage(&checked));
        if taken.is_err() {
            assert_eq!(self.kept(), before, "nothing changed");
        }
        taken
    }

    fn refused(&self, model: &str, signature: &str, reason: Reason, part: &str) {
        let refusal = self.offer(model, signature).unwrap_err();
        assert_eq!(refusal.reason, reason, "{refusal}");
        assert!(refusal.message.contains(part), "{part}: {refusal}");
    }
}

#[test]
fn a_signed_model_is_staged_by_its_hash_with_its_signature() {
    let owner = Owner::new("stage");
    let model = model(SERIAL, 820.0);
    let signature = owner.sign(&model, 7, NOW + 1);
    let path = owner.offer(&model, &signature).unwrap();
    assert!(path.is_absolute(), "the daemon has a folder of its own");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), model);
    let name = path.file_name().unwrap().to_str().unwrap().to_owned();
    assert_eq!(name.len(), 64 + ".toml".len());
    let expected = BTreeMap::from([
        ("counter".to_owned(), b"7\n".to_vec()),
        (format!("{name}.minisig"), signature.into_bytes()),
        (name, model.into_bytes()),
    ]);
    assert_eq!(owner.kept(), expected);
}

#[test]
fn without_the_owners_consent_nothing_is_taken() {
    let owner = Owner::new("never");
    let model = model(SERIAL, 820.0);
    let signature = owner.sign(&model, 7, NOW + 1);
    owner.refused(&model, &signature, Reason::NotAccepted, "`accept` is \"never\"");
    let text = std::fs::read_to_string(owner.file()).unwrap();
    std::fs::write(owner.file(), text.replace("accept = \"never\"\n", "")).unwrap();
    owner.refused(&model, &signature, Reason::NotAccepted, "`accept` is \"never\"");
}

#[test]
fn what_another_key_signed_is_refused_also_under_the_number_of_the_owners_key() {
    let owner = Owner::new("load");
    let model = model(SERIAL, 820.0);
    let stranger = Owner::new("load");
    let signature = stranger.sign(&model, 7, NOW + 1);
    owner.refused(&model, &signature, Reason::NotSigned, "not signed by any of the accepted keys");
    // The number of a key is not secret: minisign compares it, and it proves nothing.
    let mut raw = owner.keys.pk.to_bytes();
    raw.splice(10.., stranger.keys.pk.to_bytes()[10..].iter().copied());
    let mixed = KeyPair { pk: minisign::PublicKey::from_bytes(&raw).unwrap(), ..stranger.keys };
    owner.write("load", &mixed);
    let signature = owner.sign(&model, 7, NOW + 1);
    owner.refused(&model, &signature, Reason::NotSigned, "not signed by any of the accepted keys");
}

#[test]
fn a_statement_that_was_not_signed_with_the_model_is_refused() {
    let owner = Owner::new("load");
    let model = model(SERIAL, 820.0);
    let signature = owner.sign(&model, 7, NOW + 1);
    let raised = signature.replace("\"counter\":7", "\"counter\":8");
    assert_ne!(raised, signature);
    owner.refused(&model, &raised, Reason::NotSigned, "not signed by any of the accepted keys");
    let longer = signature.replace(&(NOW + 1).to_string(), &(NOW + 9).to_string());
    assert_ne!(longer, signature);
    owner.refused(&model, &longer, Reason::NotSigned, "not signed by any of the accepted keys");
}

#[test]
fn a_torn_model_is_refused_even_where_what_is_left_is_a_model() {
    let owner = Owner::new("load");
    let whole = model(SERIAL, 820.0);
    let signature = owner.sign(&whole, 7, NOW + 1);
    let cut = whole.rfind("[[effect]]").unwrap();
    assert!(bus::offer::read_model(&whole.as_bytes()[..cut]).is_ok(), "the test's own premise");
    owner.refused(&whole[..cut], &signature, Reason::Torn, "is incomplete or was changed");
}

#[test]
fn an_expired_offer_is_refused() {
    let owner = Owner::new("load");
    let model = model(SERIAL, 820.0);
    owner.refused(&model, &owner.sign(&model, 7, NOW), Reason::Expired, "expired 0 s ago");
    let signature = owner.sign(&model, 7, NOW - 90_000);
    owner.refused(&model, &signature, Reason::Expired, "expired 90 s ago");
}

#[test]
fn an_older_offer_and_the_same_one_again_are_refused_also_after_a_restart() {
    let owner = Owner::new("load");
    let (old, new) = (model(SERIAL, 820.0), model(SERIAL, 821.0));
    let old_signature = owner.sign(&old, 7, NOW + 1);
    let new_signature = owner.sign(&new, 8, NOW + 1);
    owner.offer(&old, &old_signature).unwrap();
    owner.offer(&new, &new_signature).unwrap();
    // Each offer reads the owner's file and the counter anew, as a new process does.
    owner.refused(&old, &old_signature, Reason::Replayed, "counter 7 is not above 8");
    owner.refused(&new, &new_signature, Reason::Replayed, "counter 8 is not above 8");
    let mut acceptance = owner.acceptance();
    let next = owner.sign(&old, 9, NOW + 1);
    let checked = acceptance.check(old.as_bytes(), &next, NOW).unwrap();
    acceptance.stage(&checked).unwrap();
    let again = acceptance.check(old.as_bytes(), &next, NOW).unwrap_err();
    assert_eq!(again.reason, Reason::Replayed, "without a restart too");
}

#[test]
fn an_offer_whose_model_could_not_be_written_is_used_up_all_the_same() {
    let owner = Owner::new("load");
    let model = model(SERIAL, 820.0);
    let signature = owner.sign(&model, 7, NOW + 1);
    let name = format!("{}.toml", bus::offer::sha256(model.as_bytes()));
    let mut acceptance = owner.acceptance();
    // A folder stands where the model would be renamed to.
    std::fs::create_dir_all(owner.folder.0.join("models").join(&name).join("inside")).unwrap();
    let checked = acceptance.check(model.as_bytes(), &signature, NOW).unwrap();
    assert_eq!(acceptance.stage(&checked).unwrap_err().reason, Reason::Storage);
    drop(acceptance);
    owner.refused(&model, &signature, Reason::Replayed, "counter 7 is not above 7");
}

#[test]
fn a_model_of_another_robot_is_refused_with_the_difference() {
    let owner = Owner::new("load");
    let sister = model("1600-00002", 820.0);
    let signature = owner.sign(&sister, 7, NOW + 1);
    let difference = "serial \"1600-00002\" instead of \"1600-00001\"";
    owner.refused(&sister, &signature, Reason::OtherRobot, difference);
    let displaced = model(SERIAL, 820.0).replacen(
        "point_mm = [0.0, 0.0, 486.5]",
        "point_mm = [0.5, 0.0, 486.5]",
        1,
    );
    let signature = owner.sign(&displaced, 7, NOW + 1);
    let difference = "the axis of joint 1 is displaced by 0.500 mm";
    owner.refused(&displaced, &signature, Reason::OtherRobot, difference);
}

#[test]
fn a_statement_for_another_robot_than_the_model_and_a_model_without_serial_are_refused() {
    let owner = Owner::new("load");
    let mine = model(SERIAL, 820.0);
    let mut statement = Statement::of(mine.as_bytes(), 7, NOW + 1).unwrap();
    statement.robot.serial = "1600-00002".to_owned();
    let signature = owner.sign_as(&mine, &serde_json::to_string(&statement).unwrap());
    owner.refused(&mine, &signature, Reason::OtherRobot, "for another robot than the model");
    let nameless = mine.replacen(&format!("serial = \"{SERIAL}\"\n"), "", 1);
    statement.robot.serial = SERIAL.to_owned();
    statement.sha256 = bus::offer::sha256(nameless.as_bytes());
    let signature = owner.sign_as(&nameless, &serde_json::to_string(&statement).unwrap());
    owner.refused(&nameless, &signature, Reason::OtherRobot, "states no serial number");
}

#[test]
fn signed_bytes_that_are_no_model_are_refused_and_so_is_what_is_no_statement() {
    let owner = Owner::new("load");
    let mine = model(SERIAL, 820.0);
    let broken = mine.replacen("axis = [0.0, 1.0, 0.0]", "axis = [0.0, 0.0]", 1);
    let mut statement = Statement::of(mine.as_bytes(), 7, NOW + 1).unwrap();
    statement.sha256 = bus::offer::sha256(broken.as_bytes());
    let signature = owner.sign_as(&broken, &serde_json::to_string(&statement).unwrap());
    owner.refused(&broken, &signature, Reason::NotAModel, "axis");
    let unstated = owner.sign_as(&mine, "timestamp:1800000000");
    owner.refused(&mine, &unstated, Reason::Unreadable, "`trued-plant statement` prints");
    statement.schema = "trued.offer/2".to_owned();
    let later = owner.sign_as(&mine, &serde_json::to_string(&statement).unwrap());
    owner.refused(&mine, &later, Reason::Unreadable, "instead of `trued.offer/1`");
    for garbage in ["", "a\nb\nc\nd\n", "untrusted comment: x\nRUQ\ntrusted comment: \nAA==\n"] {
        owner.refused(&mine, garbage, Reason::Unreadable, "the signature cannot be read");
    }
}

#[test]
fn an_owners_file_that_cannot_be_used_is_refused_with_what_is_wrong() {
    let owner = Owner::new("load");
    let good = std::fs::read_to_string(owner.file()).unwrap();
    let key = owner.keys.pk.to_base64();
    let cases = [
        ("trued.models/1", "trued.models/2".to_owned(), "expected `trued.models/1`"),
        ("\"load\"", "\"always\"".to_owned(), "always"),
        ("accept", "acept".to_owned(), "acept"),
        (&key, "RWQ".to_owned(), "second line of a minisign.pub"),
        ("robot.toml", "none.toml".to_owned(), "none.toml"),
    ];
    for (from, to, part) in cases {
        std::fs::write(owner.file(), good.replace(from, &to)).unwrap();
        let message = Acceptance::read(&owner.file()).unwrap_err().to_string();
        assert!(message.contains(part) && message.contains("models.toml"), "{part}: {message}");
    }
    std::fs::write(owner.file(), good.replace(&format!("\"{key}\""), "")).unwrap();
    assert!(Acceptance::read(&owner.file()).unwrap_err().to_string().contains("at least one"));
    std::fs::write(owner.file(), &good).unwrap();
    let held = owner.acceptance();
    let message = Acceptance::read(&owner.file()).unwrap_err().to_string();
    assert!(message.contains("another bridge uses this folder"), "{message}");
    drop(held);
    // A counter that cannot be read must not count as none.
    std::fs::write(owner.folder.0.join("models/counter"), "seven").unwrap();
    assert!(Acceptance::read(&owner.file()).unwrap_err().to_string().contains("expected a number"));
    let nameless = model(SERIAL, 815.0).replacen(&format!("serial = \"{SERIAL}\"\n"), "", 1);
    std::fs::write(owner.folder.0.join("robot.toml"), nameless).unwrap();
    let message = Acceptance::read(&owner.file()).unwrap_err().to_string();
    assert!(message.contains("states no serial number"), "{message}");
}
