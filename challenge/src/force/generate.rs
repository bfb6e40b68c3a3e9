//! Random cases of forces: cut, passes, sensor and hidden effects, with a size that suits the tier.
//!
//! The same seed, index and tier give the same case; kinds are used in turn. The noise is such that the trochoidal chip thickness of this crate and
//! the sine of the model format are indistinguishable. A solver's answers have no influence.

use crate::case::Tier;
use crate::effect::{BlindCase, EffectKind};
use crate::generate::{first_success, meets_tier, random_target_z, select_hidden_kinds};
use crate::rng::Rng;
use crate::scene::Excitation;
use crate::transform::Vector3;

use super::candidates::is_observable;
use super::case::{ForceCase, ModelledEffect, Noise};
use super::cut::Cut;
use super::detectability::LinearisedCase;
use super::kinds::{Effect, Kind, Requirement};
use super::laws::SimulatedPasses;
use super::passes::{Engagement, Passes};
use super::teeth::ToolShape;

/// A generated case with the detectability of its effects.
pub type GeneratedCase = crate::generate::GeneratedCase<ForceCase>;

/// Largest whitened difference between the two formulations of chip thickness.
const SAME_Z: f64 = 2.0;
/// Largest fraction by which a tangential edge force may be below its stated value.
const KEEPS_RUBBING: f64 = 0.6;
/// Kinds that a poor cut cannot distinguish.
const POORLY_DISTINGUISHED: [Kind; 4] =
    [Kind::EdgeForce, Kind::CuttingForce, Kind::WrenchScale, Kind::WrenchBias];

/// Case `index` of a challenge, of a tier; `turn` selects the kind among those of the tier.
#[must_use]
pub fn generate_case(seed: u64, index: usize, (tier, turn): (Tier, usize)) -> GeneratedCase {
    let number = index as u64;
    let generated =
        first_success(seed, number, turn, |seed, turn, rng| attempt(seed, turn, tier, rng));
    generated.unwrap_or_else(|| {
        let mut rng = Rng::new(seed, number * 1000 + 999);
        GeneratedCase {
            case: case_without_hidden_effects(number, Tier::Null, &[], &mut rng),
            detectabilities: Vec::new(),
        }
    })
}

fn attempt(seed: u64, turn: usize, tier: Tier, rng: &mut Rng) -> Option<GeneratedCase> {
    let kinds = select_hidden_kinds(
        (turn, tier),
        &Kind::DICTIONARY,
        &Kind::OUTSIDE,
        &POORLY_DISTINGUISHED,
        rng,
    );
    let mut case = case_without_hidden_effects(seed, tier, &kinds, rng);
    for (place, kind) in kinds.iter().enumerate() {
        if kinds[..place].contains(kind) || !is_observable(&case.cut, &case.passes, *kind) {
            return None;
        }
        let parameters = random_parameters(&case, *kind, rng);
        case.hidden.push(Effect::of(*kind, 0, &parameters));
    }
    let (cut, scene) = (case.cut, case.passes.clone());
    let ride = SimulatedPasses::of(&cut, &scene);
    let recorded = case.simulate_measurements(&ride, 0).recorded;
    scale_to_target_z(&mut case, &ride, &recorded, rng)?;
    if !case.revisions_exceed_uncertainty() {
        return None;
    }
    let judge = |which| LinearisedCase::of(&case, &ride, &recorded, Some(which)).evaluate(which);
    let detectability: Vec<_> = (0..case.hidden.len()).map(judge).collect();
    meets_tier(tier, &detectability)
        .then_some(GeneratedCase { case, detectabilities: detectability })
}

/// A case without hidden effects.
fn case_without_hidden_effects(seed: u64, tier: Tier, kinds: &[Kind], rng: &mut Rng) -> ForceCase {
    let needs = |need| kinds.iter().any(|kind| kind.needs(need));
    let poor = tier == Tier::Ambiguous;
    let mills =
        needs(Requirement::Teeth) || needs(Requirement::ManyTeeth) || needs(Requirement::Mill);
    let cut = if !mills && rng.bernoulli(if poor { 0.8 } else { 0.25 }) {
        Cut::lathe(rng)
    } else {
        let teeth = match (needs(Requirement::ManyTeeth), needs(Requirement::Teeth)) {
            (true, _) => 4,
            (_, true) => 2,
            _ => 1,
        };
        Cut::mill(teeth, kinds.contains(&Kind::Runout), rng)
    };
    let excitation = if poor { Excitation::Poor } else { Excitation::Full };
    let has_air = if poor && kinds.contains(&Kind::WrenchBias) {
        false
    } else {
        needs(Requirement::Air) || rng.bernoulli(0.85)
    };
    let passes = Passes::random(&cut, excitation, has_air, rng);
    let quiet =
        Noise { sigma: [0.0; 3], quantum: [0.0; 3], autocorrelation: 0.0, drift: 0.0, gaps: 0 };
    let mut case = ForceCase {
        tier,
        cut,
        passes,
        noise: quiet,
        modelled: Vec::new(),
        hidden: Vec::new(),
        seed,
    };
    case.noise = random_noise(&case, rng);
    add_modelled_effects(&mut case, rng);
    case
}

/// Root mean square of the nominal forces during full engagement, over all axes, N.
fn nominal_force_rms(case: &ForceCase) -> f64 {
    let ride = SimulatedPasses::of(&case.cut, &case.passes);
    let stated = ride.measured_forces(&[]);
    let cuts = ride.rows.iter().zip(&stated).filter(|(row, _)| row.engagement == Engagement::Full);
    let (sum, count) = cuts.fold((0.0, 0.0), |(sum, count), (_, f)| {
        (sum + f.iter().map(|x| x * x).sum::<f64>(), count + 1.0)
    });
    (sum / f64::max(3.0 * count, 1.0)).sqrt()
}

/// Norm of the difference between the two formulations of chip thickness over rows of full engagement, N.
fn chip_formulation_difference(case: &ForceCase) -> f64 {
    let ride = SimulatedPasses::of(&case.cut, &case.passes);
    let ideal = ride.measured_forces_with_shape(
        &[],
        ToolShape { circular_paths: true, ..ToolShape::default() },
    );
    let rows = ride.rows.iter().zip(ride.measured_forces(&[])).zip(ideal);
    let apart = |(a, b): (Vector3, Vector3)| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>();
    let cuts = rows.filter(|((row, _), _)| row.engagement == Engagement::Full);
    cuts.map(|((_, a), b)| apart((a, b))).sum::<f64>().sqrt()
}

fn random_noise(case: &ForceCase, rng: &mut Rng) -> Noise {
    let autocorrelation = if rng.bernoulli(0.5) { rng.uniform_between(0.2, 0.7) } else { 0.0 };
    let whitening = f64::sqrt((1.0 + autocorrelation) / (1.0 - autocorrelation));
    let sigma_min = chip_formulation_difference(case) * whitening / SAME_Z;
    let share = rng.log_uniform_between(0.02, 0.1);
    let base = (share * nominal_force_rms(case)).max(sigma_min);
    let sigma = std::array::from_fn(|_| base * rng.uniform_between(1.0, 1.4));
    let coarse = [0.02, 0.2, 0.8][rng.uniform_index(3)];
    Noise {
        sigma,
        quantum: sigma.map(|sigma| coarse * sigma),
        autocorrelation,
        drift: if rng.bernoulli(0.4) { rng.uniform_between(0.02, 0.15) } else { 0.0 },
        gaps: if rng.bernoulli(0.2) { 1 + rng.uniform_index(3) } else { 0 },
    }
}

/// Adds effects to the model, with errors within their uncertainty.
fn add_modelled_effects(case: &mut ForceCase, rng: &mut Rng) {
    let (edge, chip) = (case.cut.edge, case.cut.chip);
    let mut modelled = Vec::new();
    if rng.bernoulli(0.4) {
        modelled.push((Kind::EdgeForce, edge, 0.3));
    }
    if rng.bernoulli(0.4) {
        modelled.push((Kind::CuttingForce, chip, 0.1));
    }
    for (kind, stated, share) in modelled {
        let nominal: Vec<f64> =
            stated.iter().map(|x| share * x * rng.uniform_between(-1.0, 1.0)).collect();
        let relative_sigma = rng.uniform_between(0.01, 0.05);
        let sigma: Vec<f64> = stated.iter().map(|x| relative_sigma * x).collect();
        let real: Vec<f64> =
            nominal.iter().zip(&sigma).map(|(x, s)| x + s * rng.truncated_normal()).collect();
        let effect = |parameters: &[f64]| Effect::of(kind, 0, parameters);
        case.modelled.push(ModelledEffect {
            nominal: effect(&nominal),
            true_effect: effect(&real),
            sigma,
        });
    }
}

/// Parameters of a kind, the leading ones of size one or in their natural proportion.
fn random_parameters(case: &ForceCase, kind: Kind, rng: &mut Rng) -> Vec<f64> {
    let sign = if kind.spec().non_negative { 1.0 } else { rng.random_sign() };
    let mut around = || rng.uniform_between(-1.0, 1.0);
    let mut like = |stated: Vector3| stated.map(|x| x / stated[0] * around()).to_vec();
    let padded = |mut parameters: Vec<f64>| {
        parameters.resize(kind.count(), 0.0);
        parameters
    };
    match kind {
        Kind::EdgeForce => like(case.cut.edge),
        Kind::CuttingForce => like(case.cut.chip),
        Kind::WrenchBias | Kind::WrenchScale | Kind::WrenchMisalignment => padded(like([1.0; 3])),
        Kind::Runout => {
            // With two teeth only its cosine is observable.
            let half_turn = if rng.bernoulli(0.5) { std::f64::consts::PI } else { 0.0 };
            let wide = if case.cut.teeth == 2 { 0.7 } else { 1.5 };
            vec![1.0, half_turn + rng.uniform_between(-wide, wide)]
        }
        Kind::Chatter => vec![1.0, random_chatter_frequency_hz(case, rng)],
        Kind::CrossTalk => {
            let mut matrix = vec![0.0; 9];
            matrix[[1, 2, 3, 5, 6, 7][rng.uniform_index(6)]] = sign;
            if rng.bernoulli(0.3) {
                matrix[[1, 2, 3, 5, 6, 7][rng.uniform_index(6)]] = rng.uniform_between(-1.0, 1.0);
            }
            matrix
        }
        Kind::BrokenTooth => vec![1.0],
        _ => vec![sign],
    }
}

/// A random frequency that is neither a multiple of any pass' spindle speed nor an odd multiple of half its tooth passing frequency.
fn random_chatter_frequency_hz(case: &ForceCase, rng: &mut Rng) -> f64 {
    let scene = &case.passes;
    let (low, high) = (0.05 * scene.rate_hz, 0.42 * scene.rate_hz);
    let is_alone = |hz: f64| {
        scene.passes.iter().all(|pass| {
            let orders = hz / pass.spindle_hz;
            let halves = 2.0 * orders / case.cut.teeth as f64;
            let distance_from_integer = |orders: f64| (orders - orders.round()).abs();
            distance_from_integer(orders) > 0.12 && distance_from_integer(halves) > 0.04
        })
    };
    let mut hz = rng.uniform_between(low, high);
    for _ in 0..1000 {
        if is_alone(hz) {
            break;
        }
        hz = rng.uniform_between(low, high);
    }
    hz
}

/// Largest physically possible leading parameter of a cut.
fn max_linear_parameter(case: &ForceCase, hidden: &Effect, force_rms: f64) -> f64 {
    let (cut, kind) = (&case.cut, hidden.kind);
    let passes = case.passes.passes.iter();
    let way = passes.map(|pass| pass.feed_position_m(pass.times_s.last().copied().unwrap_or(0.0)));
    match kind {
        Kind::EdgeForce => {
            // An edge always dissipates power: its tangential force must remain positive.
            let down = (-hidden.parameters[0] / hidden.linear_magnitude().max(1e-300)).max(0.0);
            f64::min(2.0, KEEPS_RUBBING / down.max(1e-9)) * cut.edge[0]
        }
        Kind::CuttingForce => 0.7 * cut.chip[0],
        Kind::ToolWear => 2.0 / way.fold(0.0, f64::max),
        // Every tooth still cuts: adjacent edges differ by less than twice this.
        Kind::Runout => 0.12 * case.passes.min_feed_per_tooth_m(cut),
        Kind::CrossTalk => 0.25,
        Kind::WrenchScale => 0.3,
        Kind::WrenchMisalignment => 0.15,
        Kind::BrokenTooth => 0.8,
        Kind::PloughingSpeed => 4.0,
        Kind::BuiltUpEdge => 0.8,
        _ => force_rms,
    }
}

/// Scales every hidden effect to a random target z; `None` if it is not observable.
fn scale_to_target_z(
    case: &mut ForceCase,
    ride: &SimulatedPasses<'_>,
    recorded: &[bool],
    rng: &mut Rng,
) -> Option<()> {
    let force_rms = nominal_force_rms(case);
    for which in 0..case.hidden.len() {
        let wanted = random_target_z(case.tier, rng);
        let most = max_linear_parameter(case, &case.hidden[which], force_rms);
        let lead = case.hidden[which].linear_magnitude().max(1e-300);
        case.hidden[which] = case.hidden[which].scaled(1e-2 * most / lead);
        let linearised = LinearisedCase::of(case, ride, recorded, Some(which));
        let mut sized = case.hidden[which].clone();
        let basis = linearised.nuisances(&sized);
        // Two iterations, because misalignment and tooth breakage are not linear.
        for _ in 0..2 {
            let factor = wanted / linearised.strength(&sized, &basis);
            if !factor.is_finite() {
                return None;
            }
            sized = sized.scaled(factor.min(most / sized.linear_magnitude()));
        }
        case.hidden[which] = sized;
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::DISTINGUISHABLE_GAIN;

    #[test]
    fn a_bias_shows_as_the_root_of_its_rows_over_the_noise() {
        // A lathe with and without contact, white noise, no nuisance parameters: z is the norm of the bias times the square root of the number of
        // rows over σ.
        let mut rng = Rng::new(4, 0);
        let cut = Cut::lathe(&mut rng);
        let passes = Passes::random(&cut, Excitation::Full, true, &mut rng);
        let noise =
            Noise { sigma: [2.0; 3], quantum: [0.0; 3], autocorrelation: 0.0, drift: 0.0, gaps: 0 };
        let hidden = vec![Effect::of(Kind::WrenchBias, 0, &[0.3, -0.4, 1.2, 0.0, 0.0, 0.0])];
        let case = ForceCase {
            tier: Tier::Single,
            cut,
            passes,
            noise,
            modelled: Vec::new(),
            hidden,
            seed: 1,
        };
        let ride = SimulatedPasses::of(&case.cut, &case.passes);
        let recorded = vec![true; ride.rows.len()];
        let detectability = LinearisedCase::of(&case, &ride, &recorded, Some(0)).evaluate(0);
        let counts =
            ride.rows.iter().filter(|row| row.engagement != Engagement::Partial).count() as f64;
        let z = 1.3 * counts.sqrt() / 2.0;
        assert!((detectability.z / z - 1.0).abs() < 1e-6, "{} not {z}", detectability.z);
        assert_eq!(detectability.determined, [true, true, true, false, false, false]);
    }

    #[test]
    fn turned_at_one_feed_an_edge_and_a_chip_are_one_and_at_three_they_are_two() {
        let mut rng = Rng::new(9, 0);
        let cut = Cut::lathe(&mut rng);
        let noise =
            Noise { sigma: [1.0; 3], quantum: [0.0; 3], autocorrelation: 0.0, drift: 0.0, gaps: 0 };
        let mut rivals = |excitation| {
            let passes = Passes::random(&cut, excitation, true, &mut rng);
            let hidden = vec![Effect::of(Kind::EdgeForce, 0, &cut.edge)];
            let (tier, modelled) = (Tier::Ambiguous, Vec::new());
            let case = ForceCase { tier, cut, passes, noise, modelled, hidden, seed: 1 };
            let ride = SimulatedPasses::of(&case.cut, &case.passes);
            let recorded = vec![true; ride.rows.len()];
            LinearisedCase::of(&case, &ride, &recorded, Some(0)).evaluate(0).rivals
        };
        assert!(rivals(Excitation::Poor).contains(&("cutting_force", None)));
        assert!(!rivals(Excitation::Full).contains(&("cutting_force", None)));
    }

    #[test]
    fn edges_resist_the_cut_whatever_is_hidden() {
        let cases = (0..60).map(|index| generate_case(5, 8 * index, (Tier::Single, 0)).case);
        let edges = cases.filter(|case| case.hidden.iter().any(|h| h.kind == Kind::EdgeForce));
        let mut count = 0;
        for case in edges {
            let change = case
                .true_effects()
                .iter()
                .filter(|e| e.kind == Kind::EdgeForce)
                .map(|e| e.parameters[0])
                .sum::<f64>();
            assert!(case.cut.edge[0] + change > 0.0, "{change} of {}", case.cut.edge[0]);
            count += usize::from(change < 0.0);
        }
        assert!(count > 10, "{count}");
    }

    #[test]
    fn singles_of_every_kind_are_drawn_and_can_be_told() {
        for turn in 0..Kind::DICTIONARY.len() {
            let one = generate_case(3, turn, (Tier::Single, turn));
            assert_eq!(one.case.hidden.first().map(|h| h.kind), Some(Kind::DICTIONARY[turn]));
            assert!(
                one.detectabilities
                    .iter()
                    .all(|j| j.z >= 8.0 && j.least_gain >= DISTINGUISHABLE_GAIN)
            );
        }
    }
}
