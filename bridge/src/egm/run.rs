//! The loop of the EGM bridge: its sockets, and the order in which they are read.

use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use recording::bridge::{EgmConfig, Guidance};
use trued_client::monotonic_ns;

use super::classification::ClassifiedTarget;
use super::force::ForceForwarder;
use super::forwarder::{Forwarder, Settings};
use super::joints::JointOrder;
use crate::error::BridgeError;
use crate::settings::RunRules;
use crate::socket::{DATAGRAM_MAX, DRAIN_MAX, bind, receive, wait};
use crate::start::{CYCLE_S, Options, Resources};

/// How long the loop waits for a datagram before it checks whether a run has ended.
const WAIT_NS: u32 = 4_000_000;
/// Largest relative difference between the cell's force rate and the controller's.
const RATE_TOLERANCE: f64 = 0.1;

/// Runs the bridge until it is stopped; calls `ready` once it listens.
///
/// # Errors
/// See [`BridgeError`]; none once it listens.
pub fn run(
    config: &EgmConfig,
    options: &Options,
    ready: impl FnOnce(SocketAddr),
) -> Result<(), BridgeError> {
    let period_s = match config.guidance {
        Guidance::Joints => CYCLE_S,
        Guidance::Path => config.path_period_s,
    };
    let robot = bind(config.listen)?;
    let application = config.application.map(|(_, ours)| bind(ours)).transpose()?;
    let resources = Resources::prepare(&config.common, period_s, options)?;
    check_compatibility(config, &resources)?;
    let force = match (config.force, resources.cell.force) {
        (Some(frame), Some(force)) => Some(ForceForwarder::start(
            &resources.cell.cell,
            force.rate_hz,
            frame,
            resources.events.clone(),
        )?),
        _ => None,
    };
    let settings = Settings {
        robot: config.common.robot,
        robot_port: config.robot_port,
        application: config.application.map(|(theirs, _)| theirs),
        guidance: config.guidance,
        order: JointOrder { count: resources.arm.count(), seventh_after: config.seventh_after },
        is_shadow: config.common.absolute_accuracy,
        path_period_ns: (config.path_period_s * 1e9) as u64,
        runs: RunRules::from_config(&config.common),
    };
    let Resources { arm, feed, events, reporter, .. } = resources;
    drop(events);
    let counts = Arc::clone(&options.counts);
    let forwarder = Forwarder::new(settings, arm, feed, force, counts);
    ready(robot.local_addr()?);
    let mut sides = EgmLoop {
        robot,
        application: application.zip(settings.application),
        forwarder,
        buffer: vec![0; DATAGRAM_MAX].into(),
        target_buffer: vec![0; DATAGRAM_MAX].into(),
    };
    while !options.stop.load(Relaxed) {
        wait([Some(&sides.robot), sides.application.as_ref().map(|(ours, _)| ours)], WAIT_NS);
        sides.run_once();
        options.iterations.fetch_add(1, Relaxed);
    }
    drop(sides);
    // The reporter ends after the last sender of events is dropped and all events were reported.
    let _ = reporter.join();
    Ok(())
}

fn check_compatibility(config: &EgmConfig, resources: &Resources) -> Result<(), BridgeError> {
    let count = resources.arm.count();
    let on_wire = count - usize::from(config.seventh_after.is_some()).min(count);
    if on_wire > 6 || config.seventh_after.is_some_and(|after| after > on_wire) {
        return Err(BridgeError::misfit(
            format!("the model has {count} joints, but EGM supports 6 and external axes"),
            "for a seven-axis arm, set `seventh_after` under [robot], the number of axes before the seventh",
        ));
    }
    if config.force.is_none() {
        return Ok(());
    }
    let rate_hz = 1.0 / 0.004_032;
    let fits =
        |force: recording::cell::Force| (force.rate_hz / rate_hz - 1.0).abs() < RATE_TOLERANCE;
    if !resources.cell.force.is_some_and(|force| fits(force) && force.channels == 6) {
        return Err(BridgeError::misfit(
            "[force] of the bridge sends the controller's force to the vibration monitor, but the cell expects a different stream",
            "set [force] rate_Hz = 248.0 and channels = 6 in the cell, or enabled = false in the bridge's [force]",
        ));
    }
    Ok(())
}

struct EgmLoop {
    robot: UdpSocket,
    /// Socket towards the application, and its address.
    application: Option<(UdpSocket, SocketAddr)>,
    forwarder: Forwarder,
    buffer: Box<[u8]>,
    target_buffer: Box<[u8]>,
}

impl EgmLoop {
    /// One iteration over both sides: the controller first, because the application answers it.
    fn run_once(&mut self) {
        self.receive_from_robot();
        self.receive_from_application();
        self.forwarder.check_connection();
    }

    fn receive_from_robot(&mut self) {
        let mut is_received = false;
        for _ in 0..DRAIN_MAX {
            let Some((length, from)) = receive(&self.robot, &mut self.buffer) else { break };
            let datagram = &self.buffer[..length];
            let passes = self.forwarder.receive_from_robot(datagram, from, monotonic_ns());
            is_received |= passes;
            if let (true, Some((ours, theirs))) = (passes, &self.application)
                && ours.send_to(datagram, theirs).is_err()
            {
                self.forwarder.count_not_sent();
            }
        }
        if is_received
            && let Some((length, to)) =
                self.forwarder.own_path_correction(&mut self.target_buffer, monotonic_ns())
            && self.robot.send_to(&self.target_buffer[..length], to).is_err()
        {
            self.forwarder.count_not_sent();
        }
    }

    /// Of several targets the newest is answered, because the controller uses the newest.
    fn receive_from_application(&mut self) {
        let Some((ours, _)) = &self.application else { return };
        let mut newest: Option<(ClassifiedTarget, usize)> = None;
        for _ in 0..DRAIN_MAX {
            let Some((length, from)) = receive(ours, &mut self.buffer) else { break };
            let now_ns = monotonic_ns();
            let Some(screened) =
                self.forwarder.receive_from_application(&self.buffer[..length], from, now_ns)
            else {
                continue;
            };
            if newest.replace((screened, length)).is_some() {
                self.forwarder.count_superseded();
            }
            std::mem::swap(&mut self.buffer, &mut self.target_buffer);
        }
        let Some((screened, length)) = newest else { return };
        let datagram = &mut self.target_buffer[..length];
        if let Some(to) = self.forwarder.answer(datagram, &screened)
            && self.robot.send_to(datagram, to).is_err()
        {
            self.forwarder.count_not_sent();
        }
    }
}
