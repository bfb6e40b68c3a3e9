//! The loop of the RSI bridge.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use recording::bridge::{RsiConfig, RsiCorrection};
use recording::cell::FeedMode;

use super::answer::Answerer;
use crate::error::BridgeError;
use crate::socket::{DATAGRAM_MAX, DRAIN_MAX, bind, receive, wait};
use crate::start::{Options, Resources};

/// The controller's slower cycle, s: the cell must allow it.
const CYCLE_MAX_S: f64 = 0.012;
/// How long the loop waits for a telegram before it checks whether a run has ended.
const WAIT_NS: u32 = 4_000_000;

/// Runs the bridge until it is stopped; calls `ready` once it listens.
///
/// # Errors
/// See [`BridgeError`]; none once it listens.
pub fn run(
    config: RsiConfig,
    options: &Options,
    ready: impl FnOnce(SocketAddr),
) -> Result<(), BridgeError> {
    let socket = bind(config.listen)?;
    let resources = Resources::prepare(&config.common, CYCLE_MAX_S, options)?;
    check_compatibility(&config, &resources)?;
    let adapts = resources.cell.feed.is_some_and(|feed| feed.mode == FeedMode::Adapt);
    match (adapts, &config.feed) {
        (true, None) => tracing::warn!(
            "the cell adapts its feed, but the controller receives no override; set its tag under [feed]"
        ),
        (false, Some(feed)) => tracing::warn!(
            "{} is always 100: the cell does not adapt its feed ([feed] of {})",
            feed.tag,
            resources.cell.cell
        ),
        _ => {}
    }
    let Resources { arm, feed, events, reporter, .. } = resources;
    drop(events);
    let mut answerer = Answerer::new(config, arm, feed, Arc::clone(&options.counts));
    ready(socket.local_addr()?);
    let mut buffer = vec![0; DATAGRAM_MAX];
    while !options.stop.load(Relaxed) {
        wait([Some(&socket), None], WAIT_NS);
        let mut newest = None;
        for _ in 0..DRAIN_MAX {
            let Some((length, from)) = receive(&socket, &mut buffer) else { break };
            let request = answerer.receive(&buffer[..length], from);
            // A late answer to an older telegram is useless: the newest is answered.
            if request.is_some() && std::mem::replace(&mut newest, request).is_some() {
                answerer.count_superseded();
            }
        }
        if let Some(request) = newest
            && let Some((length, to)) = answerer.answer(&request, &mut buffer)
            && socket.send_to(&buffer[..length], to).is_err()
        {
            answerer.count_not_sent();
        }
        answerer.check_connection();
        options.iterations.fetch_add(1, Relaxed);
    }
    drop(answerer);
    // The reporter ends after the last sender of events is dropped and all events were reported.
    let _ = reporter.join();
    Ok(())
}

fn check_compatibility(config: &RsiConfig, resources: &Resources) -> Result<(), BridgeError> {
    let count = resources.arm.count();
    let misfit = |what: &str, names: usize| {
        Err(BridgeError::misfit(
            format!("the model has {count} joints, but [{what}] has {names} axes"),
            format!("set `names` under [{what}], one per joint of the model, in its order"),
        ))
    };
    if config.setpoint.names.len() != count {
        return misfit("setpoint", config.setpoint.names.len());
    }
    match &config.correction {
        RsiCorrection::Axes(group) if group.names.len() != count => {
            misfit("correction", group.names.len())
        }
        _ => Ok(()),
    }
}
