//! `trued challenge --domain force`: comparison of two formulations of cutting forces and sensor
//! readings; files that are read back.

use std::f64::consts::PI;

use ::challenge::case::Tier;
use ::challenge::effect::EffectKind;
use ::challenge::force::candidates::is_observable;
use ::challenge::force::case::{ForceCase, Noise};
use ::challenge::force::case_files;
use ::challenge::force::cut::Cut;
use ::challenge::force::generate;
use ::challenge::force::kinds::{Effect, Kind};
use ::challenge::force::laws::SimulatedPasses;
use ::challenge::force::passes::{Engagement, Passes};
use ::challenge::rng::Rng;
use ::challenge::scene::Excitation;
use recording::series::{Channel, RequiredData, read};

use crate::challenge_torques::reads_and_repeats;
use crate::program::Place;

/// A case of a cut without noise; it enters the work and leaves it, at three feeds and speeds.
fn case(cut: Cut) -> ForceCase {
    let mut rng = Rng::new(12, 0);
    let passes = Passes::random(&cut, Excitation::Full, true, &mut rng);
    let noise =
        Noise { sigma: [1.0; 3], quantum: [0.0; 3], autocorrelation: 0.0, drift: 0.0, gaps: 0 };
    let (tier, modelled, hidden) = (Tier::Single, Vec::new(), Vec::new());
    ForceCase { tier, cut, passes, noise, modelled, hidden, seed: 1 }
}

/// A fluted slot, a straight mill in down milling, a fluted one in up milling, one in the middle of
/// its arc, and a turned bar.
fn cuts() -> [(&'static str, Cut); 5] {
    let rng = &mut Rng::new(5, 0);
    let slot = Cut { helix_rad: 0.5, entry_rad: 0.0, exit_rad: PI, ..Cut::mill(4, false, rng) };
    let down = Cut { helix_rad: 0.0, entry_rad: 2.0, exit_rad: PI, ..Cut::mill(2, false, rng) };
    let up = Cut { helix_rad: 0.6, entry_rad: 0.0, exit_rad: 1.2, ..Cut::mill(3, false, rng) };
    let side = Cut { helix_rad: 0.6, ..Cut::mill(3, true, rng) };
    [("slot", slot), ("down", down), ("up", up), ("side", side), ("turning", Cut::lathe(rng))]
}

fn sizes(case: &ForceCase, kind: Kind) -> Vec<f64> {
    let (edge, chip) = (case.cut.edge, case.cut.chip);
    match kind {
        Kind::EdgeForce => vec![0.5 * edge[0], -0.4 * edge[0], 0.3 * edge[0]],
        Kind::CuttingForce => vec![-0.2 * chip[0], 0.15 * chip[0], 0.1 * chip[0]],
        Kind::ToolWear => vec![60.0],
        Kind::Runout => vec![0.1 * case.passes.feed_m, 0.7],
        Kind::Chatter => vec![4.0, 0.13 * case.passes.rate_hz],
        Kind::CrossTalk => vec![0.0, 0.05, -0.02, 0.03, 0.0, 0.0, 0.0, 0.04, 0.0],
        Kind::WrenchBias => vec![3.0, -2.0, 1.0, 0.0, 0.0, 0.0],
        Kind::WrenchScale => vec![0.1, -0.07, 0.04, 0.0, 0.0, 0.0],
        _ => vec![0.05, -0.08, 0.11],
    }
}

fn simulated(case: &ForceCase, ride: &SimulatedPasses<'_>, effects: &[Effect]) -> Vec<[f64; 3]> {
    let place = Place::new();
    let mut model = case_files::model(case);
    effects.iter().for_each(|one| model.push_str(&case_files::effect(one, &[])));
    place.file("model.toml", &model);
    place.file("passes.csv", &case_files::command(ride));
    place.file("passes.toml", &case_files::metadata(case));
    place.succeed(&["simulate", "--model", "model.toml", "--out", "seen", "passes.csv", "-q"]);
    let recording =
        read(&place.path("seen.csv"), None, RequiredData::Samples).expect("a recording");
    let columns = [0, 1, 2].map(|axis| recording.column(Channel::Wrench(axis)).expect("there"));
    (0..recording.len()).map(|row| columns.map(|column| column[row])).collect()
}

/// Root mean square of the difference of two lists, over the selected rows.
fn apart(a: &[[f64; 3]], b: &[[f64; 3]], requested: &[bool]) -> f64 {
    let kept = a.iter().zip(b).zip(requested).filter(|(_, is_evaluated)| **is_evaluated);
    let squares = kept.flat_map(|((a, b), _)| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)));
    let count = 3 * requested.iter().filter(|is_evaluated| **is_evaluated).count();
    (squares.sum::<f64>() / count.max(1) as f64).sqrt()
}

#[test]
fn every_effect_of_forces_is_the_same_in_two_formulations_that_share_nothing() {
    let mut faults = Vec::new();
    for (name, cut) in cuts() {
        let case = case(cut);
        let ride = SimulatedPasses::of(&case.cut, &case.passes);
        let is_evaluated: Vec<bool> =
            ride.rows.iter().map(|row| row.engagement == Engagement::Full).collect();
        let (exact, theirs) = (ride.measured_forces(&[]), simulated(&case, &ride, &[]));
        let whole = apart(&exact, &vec![[0.0; 3]; exact.len()], &is_evaluated);
        let stated = apart(&exact, &theirs, &is_evaluated);
        // A chip along the tool's path is the sine's but for feed over radius.
        let may = if case.cut.turning { 1e-9 } else { case.passes.feed_m / case.cut.radius_m };
        if stated > may * whole {
            faults.push(format!("{name}: told law {stated:.2e} of {whole:.2e}, may {may:.1e}"));
        }
        // For thin chips a tooth with runout leaves the work: here chips are never negative, but
        // the library's law continues.
        let asks = |kind: &Kind| {
            is_observable(&case.cut, &case.passes, *kind)
                && (*kind != Kind::Runout || name == "side")
        };
        for kind in Kind::DICTIONARY.into_iter().filter(asks) {
            let effect = Effect::of(kind, 0, &sizes(&case, kind));
            assert_eq!(effect.parameters.len(), kind.count());
            let with = ride.measured_forces(std::slice::from_ref(&effect));
            let difference = apart(&with, &simulated(&case, &ride, &[effect]), &is_evaluated);
            let size = apart(&with, &exact, &is_evaluated);
            if size < 0.05 || difference > 0.03 * size + 1.5 * stated {
                faults.push(format!(
                    "{name}, {kind:?}: {difference:.2e} of {size:.2e}, told {stated:.1e}"
                ));
            }
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

#[test]
fn in_air_both_are_silent_and_a_bias_is_read_by_both() {
    for (name, cut) in cuts() {
        let case = case(cut);
        let ride = SimulatedPasses::of(&case.cut, &case.passes);
        let air: Vec<bool> = ride
            .rows
            .iter()
            .map(|row| row.has_defined_forces() && row.engagement == Engagement::Air)
            .collect();
        assert!(air.iter().any(|air| *air), "{name}");
        let bias = Effect::of(Kind::WrenchBias, 0, &sizes(&case, Kind::WrenchBias));
        for effects in [Vec::new(), vec![bias]] {
            let (exact, theirs) =
                (ride.measured_forces(&effects), simulated(&case, &ride, &effects));
            assert!(apart(&exact, &theirs, &air) < 1e-6, "{name}");
        }
    }
}

#[test]
fn every_model_and_recording_of_forces_that_is_handed_out_reads_and_repeats() {
    reads_and_repeats(|index| {
        case_files::files(&generate::generate_case(8, index, Tier::mixed(index)).case)
    });
}
