//! Result of a torque diagnosis.
//!
//! Promises: SI, joints from 0. Never: a unit of a file, a sentence.

use crate::diagnose::Verdict;

use crate::size::Size;

use super::{Law, Number, Refit, Rival, Trace, Zone};

/// Something that is missing in the model of the drives, or wrong in it.
#[derive(Clone, Debug)]
pub struct Finding {
    /// A name of the contract.
    pub kind: &'static str,
    /// From 0; none for the whole robot.
    pub joint: Option<usize>,
    /// The one recording in which it acts, from 0; none: all.
    pub recording: Option<usize>,
    /// Whether the model has the effect, and this is what its numbers are off by.
    pub is_change: bool,
    /// SI.
    pub numbers: Vec<Number>,
    /// The probability that the name is right.
    pub confidence: f64,
    /// By how much log-likelihood is higher with it than without.
    pub gain: f64,
    /// Other names.
    pub rivals: Vec<Rival>,
    /// Held-out root mean square without it (all before it in the list at work) and with it, N m or N.
    pub heldout: [f64; 2],
    /// Held-out root mean square where it alone is left out and all else is fitted anew, N m or N.
    pub heldout_without: f64,
    /// What it alone does to the torques or forces that it acts on, N m or N.
    pub size: Size,
}

/// The proof of one joint, N m or N.
#[derive(Clone, Debug, PartialEq)]
pub struct JointProof {
    /// From 0.
    pub joint: usize,
    /// Root mean square of the torque itself on held-out rows.
    pub torque: f64,
    /// What the model as given is off by, its open masses fitted.
    pub before: f64,
    /// What it is off by with all that was found.
    pub after: f64,
    /// The same without the zones of low speed.
    pub after_outside: f64,
    /// Noise: what no effect explains on rows that train.
    pub noise: f64,
}

/// All that was found in torque.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The verdict.
    pub verdict: Verdict,
    /// What is claimed, most important first.
    pub findings: Vec<Finding>,
    /// Less probable than that: no claims. The fit, the proof and the model hold them too.
    pub candidates: Vec<Finding>,
    /// The model's own numbers of stated uncertainty, fitted along: no findings, but what the proof is with.
    pub refits: Vec<Refit>,
    /// Structure beyond them.
    pub unexplained: Option<Law>,
    /// Where the torque follows no known law, set apart.
    pub zones: Vec<Zone>,
    /// Held-out root mean square as given and with what was found, N m or N; see the contract for joints of different noise.
    pub heldout: [f64; 2],
    /// The noise likewise.
    pub noise: f64,
    /// Per joint.
    pub by_joint: Vec<JointProof>,
    /// Root mean square of the torque on held-out rows, all joints.
    pub signal: f64,
    /// The filter's band, Hz.
    pub band_hz: f64,
    /// Rows of one joint.
    pub rows: usize,
    /// How rows were held out.
    pub says: String,
    /// What could not have shown: effect, joint from 0, why.
    pub not_tested: Vec<(&'static str, Option<usize>, &'static str)>,
    /// Whether joints turn or slide: N m or N.
    pub slides: bool,
    /// What was done with the data, in words.
    pub notes: Vec<String>,
    /// Torque over time, for the page.
    pub traces: Vec<Trace>,
}
