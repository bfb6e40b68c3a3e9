//! The analyses as a Rust program calls them: known signals give their numbers, and object, text and page agree.
#![expect(clippy::unwrap_used, reason = "in a test a panic is the message")]

use std::f64::consts::{SQRT_2, TAU};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use recording::model::RobotModel;
use spectrum_report::{gears, stability, surface, vibration};

/// A file that is removed at the end of a test.
struct Temporary(PathBuf);

impl Temporary {
    fn new(name: &str, text: &str) -> Self {
        let path = std::env::temp_dir().join(format!("from-rust-{}-{name}", std::process::id()));
        fs::write(&path, text).unwrap();
        Self(path)
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        // A file that stays in the temporary folder harms nobody.
        let _ = fs::remove_file(&self.0);
    }
}

/// Uniform noise from −1 to 1: a linear congruential generator.
fn noise(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

#[test]
fn a_tone_that_begins_has_its_time_frequency_and_amplitude() {
    let (rate_hz, tone_hz, begin_s, amplitude_n) = (2000.0, 137.0, 2.0, 5.0);
    let (mut text, mut state) = ("t_s,fx_N\n".to_owned(), 1);
    for row in 0..10_000 {
        let t_s = f64::from(row) / rate_hz;
        let tone = if t_s < begin_s { 0.0 } else { amplitude_n * (TAU * tone_hz * t_s).sin() };
        writeln!(text, "{t_s},{:.6}", tone + 0.2 * noise(&mut state)).unwrap();
    }
    let file = Temporary::new("tone.csv", &text);
    let source = vibration::read(&file.0, &vibration::Inputs::default()).unwrap();
    let analysis = vibration::analyse(source, &vibration::Settings::default()).unwrap();
    let worst = &analysis.episodes[0];
    assert!(worst.is_alarm() && (worst.from_s - begin_s).abs() < 0.3, "{worst:?}");
    assert!((worst.frequency_hz - tone_hz).abs() < 0.2, "{worst:?}");
    assert!((worst.amplitude / amplitude_n - 1.0).abs() < 0.03, "{worst:?}");
    let in_sentences = format!("{:.1}\u{a0}Hz", worst.frequency_hz);
    assert!(analysis.text(None, str::to_owned).contains(&in_sentences));
    assert!(analysis.page().unwrap().render().contains(&in_sentences));
    let json: serde_json::Value = serde_json::from_str(&analysis.json().unwrap()).unwrap();
    assert_eq!(json["schema"], "trued.spectrum/1");
    assert_eq!(json["episodes"][0]["frequency_Hz"], worst.frequency_hz);
    assert!(matches!(
        vibration::read("absent.csv", &vibration::Inputs::default()),
        Err(spectrum_report::Error::File(_))
    ));
}

#[test]
fn a_sine_of_roughness_has_its_rms_and_its_wavelength() {
    let (amplitude_um, wavelength_mm) = (0.8, 0.15);
    let mut text = "x_um,z_um\n".to_owned();
    for row in 0..12_000 {
        let x_mm = f64::from(row) * 0.001;
        let z_um = 7.0 * x_mm + amplitude_um * (TAU * x_mm / wavelength_mm).sin();
        writeln!(text, "{row},{z_um:.6}").unwrap();
    }
    let file = Temporary::new("sine.csv", &text);
    let profile = surface::read(&file.0, &surface::Format::default()).unwrap();
    let analysis = surface::analyse(vec![profile], &surface::Settings::default()).unwrap();
    let profile = &analysis.profiles[0];
    // The Gaussian filter takes 2 % of a wavelength of a fifth of its cut-off for waviness.
    assert!((profile.roughness.rms * SQRT_2 / amplitude_um - 1.0).abs() < 0.03);
    assert!((profile.lines[0].wavelength_um() / 150.0 - 1.0).abs() < 0.005);
    assert!(analysis.text(None).contains("line of 150 µm"), "{}", analysis.text(None));
    assert!(analysis.page().render().contains("wavelength of 150 µm"));
    assert!(analysis.json().unwrap().contains("trued.surface/1"));
}

fn cut(spindle_rpm: f64, depth_mm: f64) -> String {
    format!(
        r#"schema = "trued.cut/1"
spindle_rpm = {spindle_rpm}
feed = [0.0, 1.0, 0.0]

[cut]
teeth = 4
diameter_mm = 20.0
axial_depth_mm = {depth_mm}
entry_deg = 90.0
exit_deg = 180.0
coefficients_N_per_mm2 = [800.0, 300.0, 150.0]
coefficients_N_per_mm = [8.0, 10.0, 2.0]

[chart]
spindle_from_rpm = 700.0
spindle_to_rpm = 1600.0
points = 60

[[mode]]
frequency_Hz = 67.0
damping_ratio = 0.03
stiffness_N_per_um = 1.5
direction = [0.94, 0.34, 0.0]
"#
    )
}

fn stability_of(name: &str, spindle_rpm: f64, depth_mm: f64) -> stability::Analysis {
    let file = Temporary::new(name, &cut(spindle_rpm, depth_mm));
    stability::analyse(stability::read(&file.0).unwrap()).unwrap()
}

#[test]
fn a_cut_that_chatters_is_stable_at_the_proposed_speed_and_at_the_proposed_depth() {
    let chatters = stability_of("deep.toml", 1200.0, 0.6);
    assert!(!chatters.is_stable && chatters.text().contains("not stable"), "{}", chatters.text());
    assert!(chatters.page().render().contains("not stable"));
    assert!(chatters.json().unwrap().contains(r#""stable": false"#));
    let depth_mm = 1e3 * chatters.nearest.depth_m;
    assert!(stability_of("shallow.toml", 1200.0, depth_mm).is_stable);
    let spindle_rpm = chatters.nearest.spindle_rpm.expect("a stable speed on the chart");
    assert!(stability_of("speed.toml", spindle_rpm, 0.6).is_stable, "{spindle_rpm} rpm");
}

#[test]
fn across_the_arm_joint_one_turns_by_one_over_its_lever_and_its_mesh_fits_its_line() {
    let model = RobotModel::read(Path::new("irb1600-6-145-thesis")).unwrap();
    let pose_deg = [0.0, 0.0, 0.0, 0.0, 90.0, 0.0];
    let path = gears::straight(&model.physics.arm, &pose_deg, &[0.0, 2.0, 0.0], 4).unwrap();
    let mut analysis = gears::analyse(model, path, &gears::Settings::default()).unwrap();
    let train = &analysis.trains[0];
    // The wrist is 750 mm from axis 1.
    assert!((train.turns_per_mm * TAU * 750.0 - 1.0).abs() < 1e-5, "{train:?}");
    let (_, mesh) = train.shafts().next().unwrap();
    let mesh = *mesh;
    analysis.match_lines(gears::Lines::given(&[mesh.cycles_per_mm]));
    let best = analysis.lines[0].fits[0];
    assert_eq!((best.wheel, best.multiple), (mesh, 1));
    let fits = format!("{mesh} (+0.0 %)");
    assert!(analysis.text(None).contains(&fits), "{}", analysis.text(None));
    assert!(analysis.page().render().contains(&fits));
    assert!(analysis.json().unwrap().contains("trued.gears/1"));
}
