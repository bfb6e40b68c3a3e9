//! `trued challenge --domain force`: comparison of two formulations of cutting forces and sensor
//! readings; files that are read back.

use std::f64::consts::PI;

use ::challenge::case::Tier;
use ::challenge::chance::Chance;
use ::challenge::force::candidates::fits;
use ::challenge::force::case::{Case, Noise};
use ::challenge::force::cut::Cut;
use ::challenge::force::draw;
use ::challenge::force::kinds::{Effect, Kind};
use ::challenge::force::laws::Ride;
use ::challenge::force::scene::{Phase, Scene};
use ::challenge::force::write;
use ::challenge::law::Law;
use ::challenge::scene::Richness;
use recording::series::{Channel, Need, read};

use crate::challenge_torques::reads_and_repeats;
use crate::program::Place;

/// A case of a cut without noise; it enters the work and leaves it, at three feeds and speeds.
fn case(cut: Cut) -> Case {
    let mut chance = Chance::new(12, 0);
    let scene = Scene::draw(&cut, Richness::Full, true, &mut chance);
    let noise = Noise { sigma: [1.0; 3], digit: [0.0; 3], colour: 0.0, drift: 0.0, gaps: 0 };
    let (tier, known, hidden) = (Tier::Single, Vec::new(), Vec::new());
    Case { tier, cut, scene, noise, known, hidden, seed: 1 }
}

/// A fluted slot, a straight mill in down milling, a fluted one in up milling, one in the middle of
/// its arc, and a turned bar.
fn cuts() -> [(&'static str, Cut); 5] {
    let chance = &mut Chance::new(5, 0);
    let slot = Cut { helix_rad: 0.5, entry_rad: 0.0, exit_rad: PI, ..Cut::mill(4, false, chance) };
    let down = Cut { helix_rad: 0.0, entry_rad: 2.0, exit_rad: PI, ..Cut::mill(2, false, chance) };
    let up = Cut { helix_rad: 0.6, entry_rad: 0.0, exit_rad: 1.2, ..Cut::mill(3, false, chance) };
    let side = Cut { helix_rad: 0.6, ..Cut::mill(3, true, chance) };
    [("slot", slot), ("down", down), ("up", up), ("side", side), ("turning", Cut::lathe(chance))]
}

fn sizes(case: &Case, kind: Kind) -> Vec<f64> {
    let (edge, chip) = (case.cut.edge, case.cut.chip);
    match kind {
        Kind::EdgeForce => vec![0.5 * edge[0], -0.4 * edge[0], 0.3 * edge[0]],
        Kind::CuttingForce => vec![-0.2 * chip[0], 0.15 * chip[0], 0.1 * chip[0]],
        Kind::ToolWear => vec![60.0],
        Kind::Runout => vec![0.1 * case.scene.feed_m, 0.7],
        Kind::Chatter => vec![4.0, 0.13 * case.scene.rate_hz],
        Kind::CrossTalk => vec![0.0, 0.05, -0.02, 0.03, 0.0, 0.0, 0.0, 0.04, 0.0],
        Kind::WrenchBias => vec![3.0, -2.0, 1.0, 0.0, 0.0, 0.0],
        Kind::WrenchScale => vec![0.1, -0.07, 0.04, 0.0, 0.0, 0.0],
        _ => vec![0.05, -0.08, 0.11],
    }
}

fn simulated(case: &Case, ride: &Ride<'_>, effects: &[Effect]) -> Vec<[f64; 3]> {
    let place = Place::new();
    let mut model = write::model(case);
    effects.iter().for_each(|one| model.push_str(&write::effect(one, &[])));
    place.file("model.toml", &model);
    place.file("passes.csv", &write::command(ride));
    place.file("passes.toml", &write::about(case));
    place.succeed(&["simulate", "--model", "model.toml", "--out", "seen", "passes.csv", "-q"]);
    let seen = read(&place.path("seen.csv"), None, Need::Samples).expect("a recording");
    let columns = [0, 1, 2].map(|axis| seen.column(Channel::Wrench(axis)).expect("there"));
    (0..seen.len()).map(|row| columns.map(|column| column[row])).collect()
}

/// Root mean square of the difference of two lists, over the selected rows.
fn apart(a: &[[f64; 3]], b: &[[f64; 3]], asked: &[bool]) -> f64 {
    let kept = a.iter().zip(b).zip(asked).filter(|(_, asked)| **asked);
    let squares = kept.flat_map(|((a, b), _)| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)));
    let count = 3 * asked.iter().filter(|asked| **asked).count();
    (squares.sum::<f64>() / count.max(1) as f64).sqrt()
}

#[test]
fn every_effect_of_forces_is_the_same_in_two_formulations_that_share_nothing() {
    let mut faults = Vec::new();
    for (name, cut) in cuts() {
        let case = case(cut);
        let ride = Ride::of(&case.cut, &case.scene);
        let asked: Vec<bool> = ride.rows.iter().map(|row| row.phase == Phase::Cut).collect();
        let (own, theirs) = (ride.read(&[]), simulated(&case, &ride, &[]));
        let whole = apart(&own, &vec![[0.0; 3]; own.len()], &asked);
        let told = apart(&own, &theirs, &asked);
        // A chip along the tool's path is the sine's but for feed over radius.
        let may = if case.cut.turning { 1e-9 } else { case.scene.feed_m / case.cut.radius_m };
        if told > may * whole {
            faults.push(format!("{name}: told law {told:.2e} of {whole:.2e}, may {may:.1e}"));
        }
        // For thin chips a tooth with runout leaves the work: here chips are never negative, but
        // the library's law continues.
        let asks = |kind: &Kind| {
            fits(&case.cut, &case.scene, *kind) && (*kind != Kind::Runout || name == "side")
        };
        for kind in Kind::LIBRARY.into_iter().filter(asks) {
            let effect = Effect::of(kind, 0, &sizes(&case, kind));
            assert_eq!(effect.numbers.len(), kind.count());
            let with = ride.read(std::slice::from_ref(&effect));
            let off = apart(&with, &simulated(&case, &ride, &[effect]), &asked);
            let size = apart(&with, &own, &asked);
            if size < 0.05 || off > 0.03 * size + 1.5 * told {
                faults.push(format!("{name}, {kind:?}: {off:.2e} of {size:.2e}, told {told:.1e}"));
            }
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

#[test]
fn in_air_both_are_silent_and_a_bias_is_read_by_both() {
    for (name, cut) in cuts() {
        let case = case(cut);
        let ride = Ride::of(&case.cut, &case.scene);
        let air: Vec<bool> =
            ride.rows.iter().map(|row| row.is_lawful() && row.phase == Phase::Air).collect();
        assert!(air.iter().any(|air| *air), "{name}");
        let bias = Effect::of(Kind::WrenchBias, 0, &sizes(&case, Kind::WrenchBias));
        for effects in [Vec::new(), vec![bias]] {
            let (own, theirs) = (ride.read(&effects), simulated(&case, &ride, &effects));
            assert!(apart(&own, &theirs, &air) < 1e-6, "{name}");
        }
    }
}

#[test]
fn every_model_and_recording_of_forces_that_is_handed_out_reads_and_repeats() {
    reads_and_repeats(|index| write::files(&draw::case(8, index, Tier::mixed(index)).case));
}
