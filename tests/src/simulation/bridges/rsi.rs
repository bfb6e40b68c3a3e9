//! An RSI controller: it owns the clock, counts late answers, and accumulates the corrections.

use super::{CYCLE_NS, ControllerCell, FEED, Summary, VirtualDaemon, model, oracle};
use crate::cell_loop::{JOINTS, path};
use crate::oracle::Oracle;
use crate::rng::TestRng;
use bridge::Counts;
use bridge::corrections::Corrections;
use bridge::rsi::answer::Answerer;
use recording::bridge::{EthernetConfig, RsiConfig};
use std::fmt::Write as _;
use std::net::SocketAddr;
use std::sync::Arc;

/// An answer is written to 1e-6 degrees; sums of increments are off by as much.
const RESOLUTION_RAD: f64 = 1e-6 * std::f64::consts::PI / 180.0;

fn socket_address(address: &str) -> SocketAddr {
    address.parse().expect("an address")
}

pub(super) struct RsiCell {
    answerer: Answerer<VirtualDaemon>,
    oracle: Oracle,
    chance: TestRng,
    summary: Summary,
    is_relative: bool,
    now_ns: u64,
    standing_ns: u64,
    ipoc: u64,
    late: u64,
    /// The count in the newest telegram received.
    told_late: u64,
    /// Accumulated correction added to the programmed axes, rad.
    sum: [f64; JOINTS],
    telegrams: Vec<String>,
    /// The override of the newest answer, percent.
    written: f64,
    /// The override used last by the controller, and its time, ns.
    taken: Option<(f64, u64)>,
}

impl RsiCell {
    pub(super) fn new(seed: u64, is_relative: bool) -> Self {
        let mut chance = TestRng::new(seed);
        let xml = include_str!("../../../../deploy/rsi-ethernet.xml");
        let text = include_str!("../../../../deploy/bridge-rsi.toml");
        let (xml, text) = if is_relative {
            (
                xml.replace("HOLDON=\"1\"", "HOLDON=\"0\""),
                text.replace("\"absolute\"", "\"relative\""),
            )
        } else {
            (xml.to_owned(), text.to_owned())
        };
        let receive = "<RECEIVE>\n      <ELEMENTS>";
        let element = "<ELEMENT TAG=\"OvPro\" TYPE=\"DOUBLE\" INDX=\"8\" HOLDON=\"1\" />";
        let xml = xml.replace(receive, &format!("{receive}{element}"));
        let text = text.replace("[others]", "[feed]\ntag = \"OvPro\"\n[others]");
        let ethernet = EthernetConfig::parse("ethernet.xml", &xml).expect("the shipped file");
        let config = RsiConfig::parse("bridge.toml", &text, ethernet).expect("the shipped file");
        let feed = Corrections::with_link(VirtualDaemon::new(chance.next_u64()));
        let counts = Arc::new(Counts::default());
        Self {
            answerer: Answerer::new(config, model().arm, feed, counts),
            oracle: oracle().with_resolution(2.0 * RESOLUTION_RAD),
            chance,
            summary: Summary { runs: 1, ..Summary::default() },
            is_relative,
            now_ns: 1 << 40,
            standing_ns: 0,
            ipoc: 123_456,
            late: 0,
            told_late: 0,
            sum: [0.0; JOINTS],
            telegrams: Vec::new(),
            written: f64::NAN,
            taken: None,
        }
    }

    /// The feed override of an answer that is used is within its floor and its rates, over the time since the last that was.
    fn takes_override(&mut self) {
        let now = 1e-2 * self.written;
        let (before, before_ns) = self.taken.replace((now, self.now_ns)).unwrap_or((now, 0));
        let dt_s = (self.now_ns - before_ns) as f64 * 1e-9;
        let is_good = (FEED.floor..=1.0).contains(&now)
            && before - now <= FEED.down_per_s * dt_s + 1e-7
            && now - before <= FEED.up_per_s * dt_s + 1e-7;
        if !is_good {
            self.summary.breaks(&format!("the override goes from {before} to {now} in {dt_s} s"));
        }
    }

    /// The answer in time is used.
    fn takes(&mut self, q: &[f64; JOINTS], numbers: &[f64; JOINTS]) {
        self.summary.sent += 1;
        self.takes_override();
        for (sum, degrees) in self.sum.iter_mut().zip(numbers) {
            let before = if self.is_relative { *sum } else { 0.0 };
            *sum = before + degrees.to_radians();
        }
        self.summary.largest = self.sum.iter().fold(self.summary.largest, |m, c| m.max(c.abs()));
        let sent: [f64; JOINTS] = std::array::from_fn(|i| q[i] + self.sum[i]);
        if let Err(violation) = self.oracle.take(self.now_ns, self.now_ns, q, &sent) {
            self.summary.breaks(&violation);
        }
    }

    fn answer(&mut self, telegram: &str, from: &str) -> Option<[f64; JOINTS]> {
        self.answerer.link().now_ns = self.now_ns;
        let request = self.answerer.receive(telegram.as_bytes(), socket_address(from))?;
        let mut buffer = [0; 1000];
        let (length, _) = self.answerer.answer(&request, &mut buffer)?;
        let text = std::str::from_utf8(&buffer[..length]).expect("text");
        let ipoc = telegram.split("<IPOC>").nth(1)?.split('<').next()?;
        if !text.contains(&format!("<IPOC>{ipoc}</IPOC>")) {
            self.summary.breaks(&format!("{text} answers {telegram}"));
        }
        let percent = text.split("<OvPro>").nth(1)?.split('<').next()?;
        self.written = percent.parse().ok()?;
        let number = |i: usize| {
            let value = text.split(&format!(" A{}=\"", i + 1)).nth(1)?.split('"').next()?;
            value.parse::<f64>().ok()
        };
        let numbers: Vec<f64> = (0..JOINTS).filter_map(number).collect();
        numbers.try_into().ok()
    }

    /// The network fails, or the controller waits: up to a second, or longer while it counts late answers.
    fn silence(&mut self) {
        let cycles = self.chance.below(400);
        // A controller that waits has counted before.
        let is_long = self.late != self.told_late || self.chance.below(2) == 0;
        let cycles = if is_long { cycles } else { cycles % 240 };
        self.now_ns += cycles * CYCLE_NS;
        self.standing_ns += cycles * CYCLE_NS;
        self.ipoc += cycles * CYCLE_NS / 1_000_000;
        self.late += if is_long { cycles } else { 0 };
    }

    /// `RSI_ON` again: sums begin at zero, late answers too.
    fn another_run(&mut self) {
        let cycles = 300 + self.chance.below(2000);
        self.now_ns += cycles * CYCLE_NS;
        self.ipoc += cycles * CYCLE_NS / 1_000_000;
        self.late = 0;
        self.sum = [0.0; JOINTS];
        self.oracle.begin(&[]);
        self.summary.runs += 1;
    }
}

impl ControllerCell for RsiCell {
    fn fault(&mut self) {
        match self.chance.below(200) {
            0 => self.silence(),
            1 => self.another_run(),
            2..10 => {
                // Repeated or replayed: an answer to it would be to another cycle, and is not used.
                let place = self.chance.below(self.telegrams.len().max(1) as u64) as usize;
                if let Some(old) = self.telegrams.get(place).cloned() {
                    let answered = self.answer(&old, "192.168.1.2:6008").is_some();
                    if answered {
                        self.summary.breaks(&format!("an old telegram is answered: {old}"));
                    }
                }
            }
            10 => {
                let other = telegram(self.ipoc + 4000, 0, &[0.0; JOINTS]);
                self.answer(&other, "192.168.1.3:6008");
                let half = other.len() / 2;
                self.answerer
                    .receive(&other.as_bytes()[..half], socket_address("192.168.1.2:6008"));
            }
            _ => {}
        }
    }

    /// One cycle of the controller: its answer is in time, late, or lost.
    fn cycle(&mut self) {
        if self.summary.broken.is_some() {
            return;
        }
        self.now_ns += CYCLE_NS;
        self.ipoc += CYCLE_NS / 1_000_000;
        let q = path(self.now_ns - self.standing_ns);
        let telegram = telegram(self.ipoc, self.late, &q);
        let fate = if self.answerer.link().fails { self.chance.below(60) } else { 10 };
        if fate > 0 {
            self.telegrams.push(telegram.clone());
        }
        if self.telegrams.len() > 200 {
            self.telegrams.remove(0);
        }
        let answer = if fate == 0 { None } else { self.answer(&telegram, "192.168.1.2:6008") };
        self.told_late = if fate == 0 { self.told_late } else { self.late };
        match answer.filter(|_| fate != 1) {
            Some(numbers) => self.takes(&q, &numbers),
            None => {
                self.late += 1;
                if answer.is_some() {
                    self.oracle.rests();
                }
            }
        }
    }

    fn daemon(&mut self) -> &mut VirtualDaemon {
        self.answerer.link()
    }

    fn summary(&mut self) -> &mut Summary {
        &mut self.summary
    }
}

fn telegram(ipoc: u64, late: u64, q: &[f64; JOINTS]) -> String {
    let mut axes = String::new();
    for (i, q) in q.iter().enumerate() {
        let _ = write!(axes, " A{}=\"{:.9}\"", i + 1, q.to_degrees());
    }
    format!("<Rob Type=\"KUKA\"><ASPos{axes} /><Delay D=\"{late}\" /><IPOC>{ipoc}</IPOC></Rob>")
}
