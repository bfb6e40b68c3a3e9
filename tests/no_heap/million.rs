//! A million cycles of the daemon's own cycle, over a link without waiting.

use crate::heap_of;
use corrector::{Corrector, Mode, Settings};
use daemon::cycle::Cycle;
use daemon::exchange::{Exchange, LoadedModel};
use daemon::robot::{Link, Robot};
use daemon::setup;
use envelope::Limits;
use joint_dynamics::plant::{Plant, Plants, UncertainValue};
use joint_dynamics::{Filter, FilterTaps, TapsSettings};
use physics::Model;
use recording::cell::CellConfig;
use recording::model::presets::preset;
use shm_schema::{
    Command, Corrected, DaemonPorts, Horizon, JOINTS_MAX, LeadState, MeasuredPoint, PortError,
    RobotState, SendOutcome, Status,
};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use tests::cell_loop::{JOINTS, TICK_NS, path};
use tests::place::MODEL;

const CYCLES: u64 = 1_000_000;

/// Commands at an even pace, some of them invalid, with occasional pauses; models and orders as
/// from the supervisor.
struct SteadyLink {
    exchange: Arc<Exchange>,
    now_ns: u64,
    seq: u64,
    sent: u64,
    measured: u64,
    models: [Option<Box<LoadedModel>>; 2],
}

impl Link for SteadyLink {
    fn now_ns(&self) -> u64 {
        self.now_ns
    }

    fn wait_command(&mut self, deadline_ns: u64) -> Option<(Command, u64)> {
        if self.sent >= CYCLES {
            self.exchange.stop();
            return None;
        }
        self.seq += 1;
        if self.seq % 5_000 < 30 {
            self.now_ns = deadline_ns;
            return None;
        }
        self.trouble();
        self.now_ns += TICK_NS;
        let mut q = [0.0; JOINTS_MAX];
        q[..JOINTS].copy_from_slice(&path(self.now_ns));
        if self.seq.is_multiple_of(97) {
            q[0] = f64::NAN;
        }
        let (seq, now_ns, joints) = (self.seq, self.now_ns, JOINTS as u32);
        let command = Command {
            seq,
            session: 1,
            t_ns: now_ns,
            sent_ns: now_ns,
            joints,
            q,
            flags: Command::HAS_WRENCH,
            wrench: [if seq.is_multiple_of(89) { f64::NAN } else { 50.0 }; 6],
            ..Command::default()
        };
        Some((command, now_ns))
    }

    fn take_state(&mut self) -> Option<RobotState> {
        None
    }

    fn take_measured(&mut self) -> Option<MeasuredPoint> {
        let seq = self.seq / 4;
        if seq == self.measured {
            return None;
        }
        self.measured = seq;
        let point_m = [1.0, 0.1, if seq.is_multiple_of(13) { f64::NAN } else { 1.2 }];
        let (t_ns, flags) = (self.now_ns - 2 * TICK_NS, MeasuredPoint::HAS_TIME);
        Some(MeasuredPoint { seq, t_ns, flags, point_m, ..MeasuredPoint::default() })
    }

    /// Every 20 commands the setpoints of the next 100; every third time those of another path.
    fn take_horizon(&mut self, into: &mut Horizon) -> bool {
        if !self.seq.is_multiple_of(20) {
            return false;
        }
        into.layout = Horizon::default().layout;
        (into.session, into.command_seq, into.count) = (1, self.seq, 100);
        let elsewhere = if self.seq.is_multiple_of(60) { 0.1 } else { 0.0 };
        for (ahead, point) in (1..).zip(&mut into.points[..100]) {
            point[..JOINTS].copy_from_slice(&path(self.now_ns + ahead * TICK_NS));
            point[0] += elsewhere;
        }
        true
    }

    fn send(&mut self, _: &Corrected) -> SendOutcome {
        self.sent += 1;
        SendOutcome::Delivered
    }

    fn rejoin(&mut self, _: &DaemonPorts) -> Result<(), PortError> {
        Ok(())
    }
}

impl SteadyLink {
    /// Actions of the other threads on a cycle, with boxes allocated before.
    fn trouble(&mut self) {
        if self.seq % 10_000 == 777 {
            let turn = self.seq / 10_000;
            let place = (turn % 2) as usize;
            if let Some(next) = self.models[place].take() {
                let _ = self.exchange.next_model.push(next);
            }
            self.exchange.bypassed.store(turn.is_multiple_of(3), Relaxed);
        }
        if let Some(back) = self.exchange.retired_models.pop() {
            let place = self.models.iter().position(Option::is_none);
            match place {
                Some(place) => self.models[place] = Some(back),
                None => std::mem::forget(back),
            }
        }
        if self.seq.is_multiple_of(3) {
            while self.exchange.cycles.pop().is_some() {}
        }
        while self.exchange.path.pop().is_some() {}
    }
}

/// Joints with a delay of 4 ms and a lag of 12 ms.
fn filter() -> Box<Filter> {
    let of = |value| vec![UncertainValue { value, sigma: 0.0 }];
    let plant = Plant { delays_s: of(0.004), lags_s: of(0.012), modes: Vec::new() };
    let plants = Plants { joints: vec![plant; JOINTS], left_out: Vec::new() };
    let taps = FilterTaps::new(&plants, 1e-9 * TICK_NS as f64, &TapsSettings::default()).unwrap();
    Box::new(Filter::new(taps, [f64::INFINITY; JOINTS_MAX]))
}

#[test]
fn a_million_cycles_take_nothing_from_the_heap() {
    let limits = Limits::new(0.02, 0.05, 5.0).unwrap();
    let settings = Settings { stale_ns: 3_000_000, ..Settings::with_envelope(limits) };
    let physics = preset(MODEL).unwrap().model().unwrap().physics;
    let exchange = Arc::new(Exchange::new(Mode::Full, true));
    let loaded = |physics, epoch| {
        Box::new(LoadedModel { filter: Some(filter()), ..LoadedModel::new(physics, epoch) })
    };
    let models = [Some(loaded(Model::nominal(physics.arm), 2)), Some(loaded(physics, 3))];
    let (exchange_of_link, now_ns) = (Arc::clone(&exchange), 1 << 40);
    let link =
        SteadyLink { exchange: exchange_of_link, now_ns, seq: 0, sent: 0, measured: 0, models };
    let text = format!(
        "schema = \"trued.cell/1\"\ncell = \"cell\"\nmodel = \"{MODEL}\"\n[measured]\nmode = \"trim\"\n\
         rate_Hz = 250\nlatency_ms = 2\nnoise_mm = 0.02\njump_mm = 100\n\
         [wrench]\nsource = \"command\"\n[feed]\nmode = \"adapt\"\ndeflection_limit_mm = 0.1\n"
    );
    let config = CellConfig::parse("cell.toml", &text).unwrap();
    assert!(setup::deflection_limit_fault(&config, &physics).is_none());
    let mut cycle = Cycle {
        robot: Robot::with_link(link),
        corrector: Corrector::new(settings),
        model: loaded(physics, 1),
        sensor_inputs: setup::sensor_inputs(&config, false).with_lead(Some(Box::default())),
        stale_ns: settings.stale_ns,
        period_ns: settings.period_ns,
        lockstep: false,
    };
    let heap = heap_of(|| cycle.run(&exchange));
    let counters = &exchange.counters;
    let [cycles, rejected, stale] = [&counters.cycles, &counters.rejected, &counters.stale]
        .map(|counter| counter.load(Relaxed));
    assert!(cycles >= CYCLES && rejected > 1000 && stale > 100, "{cycles}, {rejected}, {stale}");
    let mut status = Status::default();
    counters.trim.write_status(&mut status);
    assert!(status.trim_measurements > 200_000 && status.trim_refused > 1000, "{status:?}");
    counters.lead.write_status(&mut status);
    assert_eq!(status.lead_state(), Ok(LeadState::ShortHorizon));
    assert!(status.horizons_refused > 1000, "{status:?}");
    counters.feed.write_status(&mut status);
    assert!(status.feed_refused > 1000 && status.feed_limit_n > 0.0, "{status:?}");
    assert!(counters.model_epoch.load(Relaxed) > 1, "models were swapped");
    assert_eq!((heap.count_total, heap.bytes_total), (0, 0), "{heap:?}");
}
