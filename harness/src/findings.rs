//! Results of a bench, as written to the JSON.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::chunks::{BackToBack, TripLatencies};
use crate::cost::Cost;
use crate::empty_cycle::Missed;
use crate::force::Force;
use crate::latencies::{Latencies, Quantiles};
use crate::limit_checks::LimitCheck;
use crate::machine::Machine;
use crate::model_swap::ModelSwap;
use crate::paced::Paced;
use crate::peers::Transport;
use crate::plan::{Load, Plan, Policy, Wait};

/// A part that was not measured.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SkippedPart {
    /// The part.
    pub what: String,
    /// The reason, and the remedy.
    pub why: String,
}

/// Round trips at one rate.
#[derive(Debug, Clone)]
pub struct PacedAtRate {
    /// How the daemon waits.
    pub wait: Wait,
    /// Commands per second.
    pub rate_hz: u32,
    /// The results.
    pub paced: Paced,
}

/// Results for one policy and one load.
#[derive(Debug, Clone)]
pub struct Setting {
    /// The policy.
    pub policy: Policy,
    /// The load; empty: idle.
    pub load: Vec<Load>,
    /// Back-to-back, polled.
    pub flat: Option<BackToBack>,
    /// Back-to-back, woken by the kernel.
    pub woken: Option<BackToBack>,
    /// At given rates.
    pub paced: Vec<PacedAtRate>,
    /// Force blocks.
    pub force: Option<Force>,
}

impl Setting {
    pub(crate) fn new(policy: Policy, load: &[Load]) -> Self {
        let (flat, woken, force) = (None, None, None);
        Self { policy, load: load.to_vec(), flat, woken, paced: Vec::new(), force }
    }

    /// The setting as text.
    #[must_use]
    pub fn name(&self) -> String {
        format!("{}, {}", self.policy.name(), self.load_name())
    }

    /// The load as text.
    #[must_use]
    pub fn load_name(&self) -> String {
        let names: Vec<_> = self.load.iter().map(|load| load.name()).collect();
        if names.is_empty() { "idle".to_owned() } else { names.join("+") }
    }
}

/// Results of a bench.
#[derive(Debug, Clone)]
pub struct Findings {
    /// The machine.
    pub machine: Machine,
    /// Duration of each part, s.
    pub seconds: f64,
    /// The measured cell, if it was not started by the bench.
    pub cell: Option<String>,
    /// Name of the model; unknown for a running cell.
    pub model: Option<&'static str>,
    /// By policy and load, in the order requested.
    pub settings: Vec<Setting>,
    /// Starts of a daemon, to the first corrected target.
    pub starts: Option<Latencies>,
    /// Changes of the model.
    pub swap: Option<ModelSwap>,
    /// Computing time of a correction.
    pub cost: Option<Cost>,
    /// Parts not measured.
    pub skipped: Vec<SkippedPart>,
    /// Acceptance limits of the figures.
    pub judged: Vec<LimitCheck>,
}

impl Findings {
    pub(crate) fn new(machine: Machine, plan: &Plan) -> Self {
        Self {
            machine,
            seconds: plan.seconds,
            cell: plan.cell.clone(),
            model: plan.cell.is_none().then_some(plan.model),
            settings: Vec::new(),
            starts: None,
            swap: None,
            cost: None,
            skipped: Vec::new(),
            judged: Vec::new(),
        }
    }

    /// Cycles missed at the lowest rate measured under the strictest policy, over all loads and
    /// waits.
    #[must_use]
    pub fn missed_cycles(&self) -> u64 {
        let strict = || self.settings.iter().filter(|s| s.policy == self.machine.scheduling);
        let lowest = strict().flat_map(|s| &s.paced).map(|run| run.rate_hz).min();
        let counted = strict().flat_map(|s| &s.paced).filter(|run| Some(run.rate_hz) == lowest);
        counted.map(|run| run.paced.missed).sum()
    }

    /// The object of the schema `trued.bench/1`.
    #[must_use]
    pub fn json(&self) -> BenchReport<'_> {
        let first = |of: fn(&Setting) -> Option<&BackToBack>| self.settings.iter().find_map(of);
        let flat = first(|setting| setting.flat.as_ref());
        BenchReport {
            machine: &self.machine,
            seconds: self.seconds,
            cell: self.cell.as_deref(),
            model: self.model,
            round_trip_ns: flat.map(by_kind),
            round_trip_woken_ns: first(|setting| setting.woken.as_ref()).map(by_kind),
            correction_ns: self.correction(),
            missed_cycles: self.missed_cycles(),
            settings: self.settings.iter().map(setting_report).collect(),
            first_corrected_ns: self.starts.as_ref().map(Latencies::quantiles),
            model_swap: self.swap.as_ref().map(model_swap_report),
            cost: self.cost.as_ref(),
            judged: &self.judged,
            skipped: &self.skipped,
            skipped_count: self.skipped.len(),
        }
    }

    /// Time in the daemon: back-to-back if measured, otherwise at a rate.
    fn correction(&self) -> Option<Quantiles> {
        let flat = self.settings.iter().filter_map(|s| s.flat.as_ref()).map(|f| &f.correction);
        let paced = self.settings.iter().flat_map(|s| &s.paced).map(|run| &run.paced.correction);
        flat.chain(paced).find(|counted| counted.count() > 0).map(Latencies::quantiles)
    }
}

/// The JSON object.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BenchReport<'a> {
    machine: &'a Machine,
    seconds: f64,
    cell: Option<&'a str>,
    model: Option<&'a str>,
    round_trip_ns: Option<BTreeMap<&'static str, RoundTripReport>>,
    round_trip_woken_ns: Option<BTreeMap<&'static str, RoundTripReport>>,
    correction_ns: Option<Quantiles>,
    missed_cycles: u64,
    settings: Vec<SettingReport<'a>>,
    first_corrected_ns: Option<Quantiles>,
    model_swap: Option<ModelSwapReport>,
    cost: Option<&'a Cost>,
    judged: &'a [LimitCheck],
    skipped: &'a [SkippedPart],
    skipped_count: usize,
}

/// Round trips of one transport.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct RoundTripReport {
    #[serde(flatten)]
    all: Quantiles,
    near: Quantiles,
    far: Quantiles,
    lost: u64,
    /// Number of chunks: near, far, mixed.
    chunks: [u64; 3],
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct BackToBackReport {
    round_trip_ns: BTreeMap<&'static str, RoundTripReport>,
    reference_near_ns: u64,
    reference_far_ns: u64,
    far_above_ns: Option<f64>,
    correction_ns: Quantiles,
    around_correction_ns: Quantiles,
    answers: BTreeMap<&'static str, u64>,
    answers_solved: u64,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct PacedReport<'a> {
    wait: Wait,
    rate_hz: u32,
    cycles: u64,
    scheduled_ns: Quantiles,
    actual_ns: Quantiles,
    empty_ns: Quantiles,
    missed: u64,
    unanswered: u64,
    empty_missed: u64,
    missed_beyond_empty: u64,
    /// The first of them, with their time by stages.
    beyond: &'a [Missed],
    correction_ns: Quantiles,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct ForceReport {
    scheduled_ns: Quantiles,
    actual_ns: Quantiles,
    one_way_ns: Quantiles,
    blocks: u64,
    taken: u64,
    lost: u64,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct SettingReport<'a> {
    policy: Policy,
    load: Vec<Load>,
    flat: Option<BackToBackReport>,
    woken: Option<BackToBackReport>,
    paced: Vec<PacedReport<'a>>,
    force: Option<ForceReport>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct ModelSwapReport {
    swaps: u64,
    epochs_seen: u64,
    cycles: u64,
    missed: u64,
    empty_missed: u64,
    missed_beyond_empty: u64,
    step_over_bound: f64,
    jump_wanted: f64,
}

fn by_kind(flat: &BackToBack) -> BTreeMap<&'static str, RoundTripReport> {
    let measured = Transport::ALL.into_iter().zip(&flat.counted);
    let measured = measured.filter(|(_, counted)| counted.chunks != [0; 3]);
    measured.map(|(kind, counted)| (kind.name(), trips(counted))).collect()
}

fn trips(counted: &TripLatencies) -> RoundTripReport {
    let TripLatencies { all, near, far, lost, chunks } = counted;
    let (all, near, far) = (all.quantiles(), near.quantiles(), far.quantiles());
    RoundTripReport { all, near, far, lost: *lost, chunks: *chunks }
}

fn back_to_back_report(flat: &BackToBack) -> BackToBackReport {
    BackToBackReport {
        round_trip_ns: by_kind(flat),
        reference_near_ns: flat.reference[0].at(0.5),
        reference_far_ns: flat.reference[1].at(0.5),
        far_above_ns: flat.sorter.threshold_ns,
        correction_ns: flat.correction.quantiles(),
        around_correction_ns: flat.around.quantiles(),
        answers: flat.by_status.clone(),
        answers_solved: flat.solved,
    }
}

fn paced_report(run: &PacedAtRate) -> PacedReport<'_> {
    let paced = &run.paced;
    PacedReport {
        wait: run.wait,
        rate_hz: run.rate_hz,
        cycles: paced.cycles,
        scheduled_ns: paced.scheduled.quantiles(),
        actual_ns: paced.actual.quantiles(),
        empty_ns: paced.empty.quantiles(),
        missed: paced.missed,
        unanswered: paced.unanswered,
        empty_missed: paced.empty_missed,
        missed_beyond_empty: paced.missed_beyond_empty,
        beyond: &paced.beyond,
        correction_ns: paced.correction.quantiles(),
    }
}

fn setting_report(setting: &Setting) -> SettingReport<'_> {
    SettingReport {
        policy: setting.policy,
        load: setting.load.clone(),
        flat: setting.flat.as_ref().map(back_to_back_report),
        woken: setting.woken.as_ref().map(back_to_back_report),
        paced: setting.paced.iter().map(paced_report).collect(),
        force: setting.force.as_ref().map(|force| ForceReport {
            scheduled_ns: force.scheduled.quantiles(),
            actual_ns: force.actual.quantiles(),
            one_way_ns: force.one_way.quantiles(),
            blocks: force.blocks,
            taken: force.taken,
            lost: force.lost,
        }),
    }
}

fn model_swap_report(swap: &ModelSwap) -> ModelSwapReport {
    ModelSwapReport {
        swaps: swap.swaps,
        epochs_seen: swap.epochs_seen,
        cycles: swap.paced.cycles,
        missed: swap.paced.missed,
        empty_missed: swap.paced.empty_missed,
        missed_beyond_empty: swap.paced.missed_beyond_empty,
        step_over_bound: swap.step_over_bound,
        jump_wanted: swap.jump_wanted,
    }
}
