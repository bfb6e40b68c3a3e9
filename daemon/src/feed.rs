//! The feed override of a cell: its inputs from force and path, and its report.
//!
//! Runs in the cycle, without allocation; a cell without `[feed]` computes nothing. The equations
//! are in `corrector::Feed`.

use crate::exchange::FeedCounters;
use corrector::{Corrector, CycleInputs, Feed, FeedInput, FeedLimit, FeedSettings};
use glam::DVec3;
use physics::Model;
use shm_schema::Command;

/// The feed of a cell.
#[derive(Debug)]
pub struct CellFeed {
    feed: Feed,
    /// The model's compliance at the tool along the force, m/N; `None` if unknown.
    compliance_m_per_n: Option<f64>,
    /// Whether the newest wrench is in base axes.
    is_in_base: bool,
}

impl CellFeed {
    /// With these settings; `corrects`: whether the cell sends corrections.
    #[must_use]
    pub fn new(settings: FeedSettings, corrects: bool) -> Self {
        Self { feed: Feed::new(settings, corrects), compliance_m_per_n: None, is_in_base: false }
    }

    /// The override of the cycle; `tool_m`: tool position of the command, base frame, `None` if it
    /// was refused.
    pub fn step(
        &mut self,
        world: &CycleInputs,
        command: &Command,
        tool_m: Option<DVec3>,
        now_ns: u64,
        corrects: bool,
    ) -> f64 {
        if let Some(sample) = world.wrench {
            self.is_in_base = sample.in_base;
        }
        self.feed.step(&FeedInput {
            now_ns,
            wrench: world.wrench,
            tool_m,
            compliance_m_per_n: self.compliance_m_per_n,
            corrects,
            client_override: command
                .has(Command::HAS_FEED_OVERRIDE)
                .then_some(command.feed_override),
        })
    }

    /// Computes the model's compliance for later cycles; needed for a deflection limit only.
    pub fn prepare(&mut self, corrector: &Corrector, model: &Model) {
        if matches!(self.feed.settings().limit, FeedLimit::Deflection(_)) {
            let force_n = self.feed.force_n().unwrap_or(DVec3::ZERO);
            self.compliance_m_per_n = corrector.compliance_along(model, force_n, self.is_in_base);
        }
    }

    /// Publishes the state of the feed.
    pub fn publish(&self, counters: &FeedCounters, corrects: bool) {
        let FeedSettings { bounds, hold_s, .. } = self.feed.settings();
        counters.store(
            self.feed.report(),
            bounds,
            *hold_s,
            self.feed.override_without_force(corrects),
        );
    }
}
