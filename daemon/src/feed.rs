//! The feed of a cell: what the cycle knows of force and path on its way into the feed override, and what that says on its way out.
//!
//! In the cycle. Promises: no allocation; in a cell without `[feed]` nothing is computed. Never: an equation of the override.

use crate::exchange::FeedCounters;
use corrector::{Corrector, Feed, FeedInput, FeedLimit, FeedSettings, World};
use glam::DVec3;
use physics::Model;

/// The feed of a cell.
#[derive(Debug)]
pub struct CellFeed {
    feed: Feed,
    /// How far the tool gives way along the force, by the model, m/N; none where it does not tell.
    compliance_m_per_n: Option<f64>,
    /// The axes of the newest wrench are those of the base.
    is_in_base: bool,
}

impl CellFeed {
    /// One with these settings, in a cell that sends corrections or does not.
    #[must_use]
    pub fn new(settings: FeedSettings, corrects: bool) -> Self {
        Self { feed: Feed::new(settings, corrects), compliance_m_per_n: None, is_in_base: false }
    }

    /// The override of the cycle; `tool_m`: where the command puts the tool, base frame, none where it was refused.
    pub fn step(
        &mut self,
        world: &World,
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
        })
    }

    /// Asks the model how far the tool gives way, for later cycles; only a limit of the deflection needs it.
    pub fn prepare(&mut self, corrector: &Corrector, model: &Model) {
        if matches!(self.feed.settings().limit, FeedLimit::Deflection(_)) {
            let force_n = self.feed.force_n().unwrap_or(DVec3::ZERO);
            self.compliance_m_per_n = corrector.compliance_along(model, force_n, self.is_in_base);
        }
    }

    /// Shows how the feed is.
    pub fn show(&self, counters: &FeedCounters, corrects: bool) {
        let FeedSettings { bounds, hold_s, .. } = self.feed.settings();
        counters.show(self.feed.report(), bounds, *hold_s, self.feed.lost(corrects));
    }
}
