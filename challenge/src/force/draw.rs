//! Random cases of forces: cut, passes, sensor and hidden effects, with a size that suits the tier.
//!
//! The same seed, index and tier give the same case; kinds are used in turn. The noise is such that the trochoidal chip thickness of this crate and
//! the sine of the model format are indistinguishable. A solver's answers have no influence.

use crate::case::Tier;
use crate::chance::Chance;
use crate::draw::{asks, attempts, hide, wanted_z};
use crate::law::{Law, Trial};
use crate::scene::Richness;
use crate::space::V3;

use super::bench::Bench;
use super::candidates::fits;
use super::case::{Case, Known, Noise};
use super::cut::Cut;
use super::kinds::{Effect, Kind, Need};
use super::laws::Ride;
use super::scene::{Phase, Scene};
use super::teeth::Shape;

/// A generated case with the detectability of its effects.
pub type Drawn = crate::draw::Drawn<Case>;

/// Largest whitened difference between the two formulations of chip thickness.
const SAME_Z: f64 = 2.0;
/// Largest fraction by which a tangential edge force may be below its stated value.
const KEEPS_RUBBING: f64 = 0.6;
/// Kinds that a poor cut cannot distinguish.
const POOR: [Kind; 4] = [Kind::EdgeForce, Kind::CuttingForce, Kind::WrenchScale, Kind::WrenchBias];

/// Case `index` of a challenge, of a tier; `turn` selects the kind among those of the tier.
#[must_use]
pub fn case(seed: u64, index: usize, (tier, turn): (Tier, usize)) -> Drawn {
    let number = index as u64;
    let drawn =
        attempts(seed, number, turn, |seed, turn, chance| attempt_at(seed, turn, tier, chance));
    drawn.unwrap_or_else(|| {
        let mut chance = Chance::new(seed, number * 1000 + 999);
        Drawn { case: empty(number, Tier::Null, &[], &mut chance), judged: Vec::new() }
    })
}

fn attempt_at(seed: u64, turn: usize, tier: Tier, chance: &mut Chance) -> Option<Drawn> {
    let kinds = hide((turn, tier), &Kind::LIBRARY, &Kind::OUTSIDE, &POOR, chance);
    let mut case = empty(seed, tier, &kinds, chance);
    for (place, kind) in kinds.iter().enumerate() {
        if kinds[..place].contains(kind) || !fits(&case.cut, &case.scene, *kind) {
            return None;
        }
        let numbers = numbers(&case, *kind, chance);
        case.hidden.push(Effect::of(*kind, 0, &numbers));
    }
    let (cut, scene) = (case.cut, case.scene.clone());
    let ride = Ride::of(&cut, &scene);
    let there = case.measured(&ride, 0).there;
    size(&mut case, &ride, &there, chance)?;
    if !case.is_certain() {
        return None;
    }
    let judge = |which| Bench::of(&case, &ride, &there, Some(which)).judge(which);
    let judged: Vec<_> = (0..case.hidden.len()).map(judge).collect();
    asks(tier, &judged).then_some(Drawn { case, judged })
}

/// A case without hidden effects.
fn empty(seed: u64, tier: Tier, kinds: &[Kind], chance: &mut Chance) -> Case {
    let needs = |need| kinds.iter().any(|kind| kind.needs(need));
    let poor = tier == Tier::Ambiguous;
    let mills = needs(Need::Teeth) || needs(Need::ManyTeeth) || needs(Need::Mill);
    let cut = if !mills && chance.happens(if poor { 0.8 } else { 0.25 }) {
        Cut::lathe(chance)
    } else {
        let teeth = match (needs(Need::ManyTeeth), needs(Need::Teeth)) {
            (true, _) => 4,
            (_, true) => 2,
            _ => 1,
        };
        Cut::mill(teeth, kinds.contains(&Kind::Runout), chance)
    };
    let richness = if poor { Richness::Poor } else { Richness::Full };
    let has_air = if poor && kinds.contains(&Kind::WrenchBias) {
        false
    } else {
        needs(Need::Air) || chance.happens(0.85)
    };
    let scene = Scene::draw(&cut, richness, has_air, chance);
    let quiet = Noise { sigma: [0.0; 3], digit: [0.0; 3], colour: 0.0, drift: 0.0, gaps: 0 };
    let mut case =
        Case { tier, cut, scene, noise: quiet, known: Vec::new(), hidden: Vec::new(), seed };
    case.noise = noise(&case, chance);
    know(&mut case, chance);
    case
}

/// Root mean square of the nominal forces during full engagement, over all axes, N.
fn loudness(case: &Case) -> f64 {
    let ride = Ride::of(&case.cut, &case.scene);
    let told = ride.read(&[]);
    let cuts = ride.rows.iter().zip(&told).filter(|(row, _)| row.phase == Phase::Cut);
    let (sum, count) = cuts.fold((0.0, 0.0), |(sum, count), (_, f)| {
        (sum + f.iter().map(|x| x * x).sum::<f64>(), count + 1.0)
    });
    (sum / f64::max(3.0 * count, 1.0)).sqrt()
}

/// Norm of the difference between the two formulations of chip thickness over rows of full engagement, N.
fn ways_apart(case: &Case) -> f64 {
    let ride = Ride::of(&case.cut, &case.scene);
    let ideal = ride.read_by(&[], Shape { ideal: true, ..Shape::default() });
    let rows = ride.rows.iter().zip(ride.read(&[])).zip(ideal);
    let apart = |(a, b): (V3, V3)| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>();
    let cuts = rows.filter(|((row, _), _)| row.phase == Phase::Cut);
    cuts.map(|((_, a), b)| apart((a, b))).sum::<f64>().sqrt()
}

fn noise(case: &Case, chance: &mut Chance) -> Noise {
    let colour = if chance.happens(0.5) { chance.between(0.2, 0.7) } else { 0.0 };
    let whitening = f64::sqrt((1.0 + colour) / (1.0 - colour));
    let least = ways_apart(case) * whitening / SAME_Z;
    let share = chance.log_between(0.02, 0.1);
    let base = (share * loudness(case)).max(least);
    let sigma = std::array::from_fn(|_| base * chance.between(1.0, 1.4));
    let coarse = [0.02, 0.2, 0.8][chance.pick(3)];
    Noise {
        sigma,
        digit: sigma.map(|sigma| coarse * sigma),
        colour,
        drift: if chance.happens(0.4) { chance.between(0.02, 0.15) } else { 0.0 },
        gaps: if chance.happens(0.2) { 1 + chance.pick(3) } else { 0 },
    }
}

/// Adds effects to the model, with errors within their uncertainty.
fn know(case: &mut Case, chance: &mut Chance) {
    let (edge, chip) = (case.cut.edge, case.cut.chip);
    let mut known = Vec::new();
    if chance.happens(0.4) {
        known.push((Kind::EdgeForce, edge, 0.3));
    }
    if chance.happens(0.4) {
        known.push((Kind::CuttingForce, chip, 0.1));
    }
    for (kind, told, share) in known {
        let nominal: Vec<f64> =
            told.iter().map(|x| share * x * chance.between(-1.0, 1.0)).collect();
        let doubt = chance.between(0.01, 0.05);
        let sigma: Vec<f64> = told.iter().map(|x| doubt * x).collect();
        let real: Vec<f64> =
            nominal.iter().zip(&sigma).map(|(x, s)| x + s * chance.normal_within_two()).collect();
        let of = |numbers: &[f64]| Effect::of(kind, 0, numbers);
        case.known.push(Known { nominal: of(&nominal), real: of(&real), sigma });
    }
}

/// Parameters of a kind, the leading ones of size one or in their natural proportion.
fn numbers(case: &Case, kind: Kind, chance: &mut Chance) -> Vec<f64> {
    let sign = if kind.facts().not_negative { 1.0 } else { chance.sign() };
    let mut around = || chance.between(-1.0, 1.0);
    let mut like = |told: V3| told.map(|x| x / told[0] * around()).to_vec();
    let padded = |mut numbers: Vec<f64>| {
        numbers.resize(kind.count(), 0.0);
        numbers
    };
    match kind {
        Kind::EdgeForce => like(case.cut.edge),
        Kind::CuttingForce => like(case.cut.chip),
        Kind::WrenchBias | Kind::WrenchScale | Kind::WrenchMisalignment => padded(like([1.0; 3])),
        Kind::Runout => {
            // With two teeth only its cosine is observable.
            let half_turn = if chance.happens(0.5) { std::f64::consts::PI } else { 0.0 };
            let wide = if case.cut.teeth == 2 { 0.7 } else { 1.5 };
            vec![1.0, half_turn + chance.between(-wide, wide)]
        }
        Kind::Chatter => vec![1.0, lone_tone(case, chance)],
        Kind::CrossTalk => {
            let mut matrix = vec![0.0; 9];
            matrix[[1, 2, 3, 5, 6, 7][chance.pick(6)]] = sign;
            if chance.happens(0.3) {
                matrix[[1, 2, 3, 5, 6, 7][chance.pick(6)]] = chance.between(-1.0, 1.0);
            }
            matrix
        }
        Kind::BrokenTooth => vec![1.0],
        _ => vec![sign],
    }
}

/// A random frequency that is neither a multiple of any pass' spindle speed nor an odd multiple of half its tooth passing frequency.
fn lone_tone(case: &Case, chance: &mut Chance) -> f64 {
    let scene = &case.scene;
    let (low, high) = (0.05 * scene.rate_hz, 0.42 * scene.rate_hz);
    let is_alone = |hz: f64| {
        scene.passes.iter().all(|pass| {
            let orders = hz / pass.spindle_hz;
            let halves = 2.0 * orders / case.cut.teeth as f64;
            let off = |orders: f64| (orders - orders.round()).abs();
            off(orders) > 0.12 && off(halves) > 0.04
        })
    };
    let mut hz = chance.between(low, high);
    for _ in 0..1000 {
        if is_alone(hz) {
            break;
        }
        hz = chance.between(low, high);
    }
    hz
}

/// Largest physically possible leading parameter of a cut.
fn most(case: &Case, hidden: &Effect, loud: f64) -> f64 {
    let (cut, kind) = (&case.cut, hidden.kind);
    let passes = case.scene.passes.iter();
    let way = passes.map(|pass| pass.way(pass.times_s.last().copied().unwrap_or(0.0)));
    match kind {
        Kind::EdgeForce => {
            // An edge always dissipates power: its tangential force must remain positive.
            let down = (-hidden.numbers[0] / hidden.lead().max(1e-300)).max(0.0);
            f64::min(2.0, KEEPS_RUBBING / down.max(1e-9)) * cut.edge[0]
        }
        Kind::CuttingForce => 0.7 * cut.chip[0],
        Kind::ToolWear => 2.0 / way.fold(0.0, f64::max),
        // Every tooth still cuts: adjacent edges differ by less than twice this.
        Kind::Runout => 0.12 * case.scene.least_feed(cut),
        Kind::CrossTalk => 0.25,
        Kind::WrenchScale => 0.3,
        Kind::WrenchMisalignment => 0.15,
        Kind::BrokenTooth => 0.8,
        Kind::PloughingSpeed => 4.0,
        Kind::BuiltUpEdge => 0.8,
        _ => loud,
    }
}

/// Scales every hidden effect to a random target z; `None` if it is not observable.
fn size(case: &mut Case, ride: &Ride<'_>, there: &[bool], chance: &mut Chance) -> Option<()> {
    let loud = loudness(case);
    for which in 0..case.hidden.len() {
        let wanted = wanted_z(case.tier, chance);
        let most = most(case, &case.hidden[which], loud);
        let lead = case.hidden[which].lead().max(1e-300);
        case.hidden[which] = case.hidden[which].scaled(1e-2 * most / lead);
        let bench = Bench::of(case, ride, there, Some(which));
        let mut sized = case.hidden[which].clone();
        let span = bench.nuisances(&sized);
        // Two iterations, because misalignment and tooth breakage are not linear.
        for _ in 0..2 {
            let factor = wanted / bench.strength(&sized, &span);
            if !factor.is_finite() {
                return None;
            }
            sized = sized.scaled(factor.min(most / sized.lead()));
        }
        case.hidden[which] = sized;
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::weigh::APART;

    #[test]
    fn a_bias_shows_as_the_root_of_its_rows_over_the_noise() {
        // A lathe with and without contact, white noise, no nuisance parameters: z is the norm of the bias times the square root of the number of
        // rows over σ.
        let mut chance = Chance::new(4, 0);
        let cut = Cut::lathe(&mut chance);
        let scene = Scene::draw(&cut, Richness::Full, true, &mut chance);
        let noise = Noise { sigma: [2.0; 3], digit: [0.0; 3], colour: 0.0, drift: 0.0, gaps: 0 };
        let hidden = vec![Effect::of(Kind::WrenchBias, 0, &[0.3, -0.4, 1.2, 0.0, 0.0, 0.0])];
        let case =
            Case { tier: Tier::Single, cut, scene, noise, known: Vec::new(), hidden, seed: 1 };
        let ride = Ride::of(&case.cut, &case.scene);
        let there = vec![true; ride.rows.len()];
        let judged = Bench::of(&case, &ride, &there, Some(0)).judge(0);
        let counts = ride.rows.iter().filter(|row| row.phase != Phase::Between).count() as f64;
        let z = 1.3 * counts.sqrt() / 2.0;
        assert!((judged.z / z - 1.0).abs() < 1e-6, "{} not {z}", judged.z);
        assert_eq!(judged.determined, [true, true, true, false, false, false]);
    }

    #[test]
    fn turned_at_one_feed_an_edge_and_a_chip_are_one_and_at_three_they_are_two() {
        let mut chance = Chance::new(9, 0);
        let cut = Cut::lathe(&mut chance);
        let noise = Noise { sigma: [1.0; 3], digit: [0.0; 3], colour: 0.0, drift: 0.0, gaps: 0 };
        let mut rivals = |richness| {
            let scene = Scene::draw(&cut, richness, true, &mut chance);
            let hidden = vec![Effect::of(Kind::EdgeForce, 0, &cut.edge)];
            let (tier, known) = (Tier::Ambiguous, Vec::new());
            let case = Case { tier, cut, scene, noise, known, hidden, seed: 1 };
            let ride = Ride::of(&case.cut, &case.scene);
            let there = vec![true; ride.rows.len()];
            Bench::of(&case, &ride, &there, Some(0)).judge(0).rivals
        };
        assert!(rivals(Richness::Poor).contains(&("cutting_force", None)));
        assert!(!rivals(Richness::Full).contains(&("cutting_force", None)));
    }

    #[test]
    fn edges_resist_the_cut_whatever_is_hidden() {
        let cases = (0..60).map(|index| case(5, 8 * index, (Tier::Single, 0)).case);
        let edges = cases.filter(|case| case.hidden.iter().any(|h| h.kind == Kind::EdgeForce));
        let mut count = 0;
        for case in edges {
            let off = case
                .real()
                .iter()
                .filter(|e| e.kind == Kind::EdgeForce)
                .map(|e| e.numbers[0])
                .sum::<f64>();
            assert!(case.cut.edge[0] + off > 0.0, "{off} of {}", case.cut.edge[0]);
            count += usize::from(off < 0.0);
        }
        assert!(count > 10, "{count}");
    }

    #[test]
    fn singles_of_every_kind_are_drawn_and_can_be_told() {
        for turn in 0..Kind::LIBRARY.len() {
            let one = case(3, turn, (Tier::Single, turn));
            assert_eq!(one.case.hidden.first().map(|h| h.kind), Some(Kind::LIBRARY[turn]));
            assert!(one.judged.iter().all(|j| j.z >= 8.0 && j.least_gain >= APART));
        }
    }
}
