//! Start of both bridges: cell, model, connection to the daemon, and messages on what is (not) corrected.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use physics::JointKind;
use recording::bridge::CommonConfig;
use recording::cell::CellConfig;
use recording::model::RobotModel;

use crate::corrections::Corrections;
use crate::counts::Counts;
use crate::daemon_link::{DaemonLink, LinkEvent};
use crate::error::BridgeError;
use crate::reporter;

/// Time between a controller's cycles, s.
pub(crate) const CYCLE_S: f64 = 0.004;

/// Options of a bridge besides its configuration.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Ends the bridge once set.
    pub stop: Arc<AtomicBool>,
    /// Counters.
    pub counts: Arc<Counts>,
    /// Incremented in every iteration of the loop, with or without datagrams: 250 times a second or
    /// more.
    pub iterations: Arc<AtomicU64>,
}

/// Common resources of a bridge's loop.
pub(crate) struct Resources {
    pub(crate) cell: CellConfig,
    pub(crate) arm: physics::Arm,
    pub(crate) feed: Corrections,
    pub(crate) events: Sender<LinkEvent>,
    pub(crate) reporter: JoinHandle<()>,
}

impl Resources {
    /// Reads the cell and its model, checks them for a bridge that commands every `period_s`, and
    /// starts joining.
    pub(crate) fn prepare(
        common: &CommonConfig,
        period_s: f64,
        options: &Options,
    ) -> Result<Self, BridgeError> {
        let cell = CellConfig::read(&common.cell)?;
        let arm = RobotModel::read(&cell.model)?.physics.arm;
        check_compatibility(&common.cell, &cell, &arm, period_s)?;
        if common.absolute_accuracy {
            tracing::warn!(
                "absolute_accuracy = \"on\": the controller compensates its robot itself, so trued must not correct it as well. \
                 The daemon receives every target, but its correction is not sent. To correct, switch the controller's \
                 compensation off, calibrate the model in that state, and set absolute_accuracy = \"off\""
            );
        }
        let (events, receiver) = channel();
        let reporter = reporter::start(Arc::clone(&options.counts), receiver)?;
        let within = Duration::from_secs_f64(common.answer_within_s);
        let fresh = Duration::from_secs_f64((2.5 * period_s).max(0.01));
        let lost_feed = cell.fallback_feed_override();
        let link = DaemonLink::start(&cell.cell, within, fresh, lost_feed, events.clone())?;
        let feed = Corrections::with_link(link);
        Ok(Self { cell, arm, feed, events, reporter })
    }
}

fn check_compatibility(
    path: &Path,
    cell: &CellConfig,
    arm: &physics::Arm,
    period_s: f64,
) -> Result<(), BridgeError> {
    if arm.joints().iter().any(|joint| joint.kind != JointKind::Revolute) {
        return Err(BridgeError::misfit(
            format!("the model of {} has a linear joint", path.display()),
            "use an arm with revolute joints only, since both protocols transmit degrees",
        ));
    }
    if cell.cycle.stale_s <= 2.0 * period_s {
        return Err(BridgeError::misfit(
            format!(
                "[cycle] stale_ms = {} in {}, but commands arrive every {} ms",
                cell.cycle.stale_s * 1e3,
                path.display(),
                period_s * 1e3
            ),
            format!("set it to {} or more", 5.0 * period_s * 1e3),
        ));
    }
    Ok(())
}
