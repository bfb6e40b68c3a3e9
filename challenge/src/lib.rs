//! Blind test of the diagnosis: sealed random cases, and the score of the answers.
//!
//! The physics here is formulated independently of all other crates and shares no code with them: homogeneous transforms from Denavit-Hartenberg
//! tables, backlash as contact of two faces, hysteresis by elasto-slip elements, temperature by two thermal nodes, gear errors as series with
//! sidebands, autocorrelated noise, quantisation, gaps and outliers.
//!
//! Read in this order: [`mod@effect`] (common to all domains), [`kinds`] and [`laws`] (possible hidden effects), [`scene`] (inputs of the robot),
//! [`mod@instrument`] (simulated measurements), [`mod@generate`] (random cases), [`mod@detectability`] (of a case's effects), [`fit`] and
//! [`mod@evaluation`] (error of an answer on an unseen motion), [`case_files`], [`commitment`], [`answer`] and [`score`].
//!
//! Other domains: drive torques in [`torque`], cutting forces in [`force`].
//!
//! The same seed gives the same bytes. No file access, no process, no clock.

pub mod answer;
pub mod arm;
pub mod candidates;
pub mod case;
pub mod case_files;
pub mod commitment;
pub mod comparison;
pub mod detectability;
pub mod deviation;
pub mod effect;
pub mod evaluation;
pub mod fit;
pub mod force;
pub mod generate;
pub mod instrument;
pub mod kinds;
pub mod laws;
pub mod least_squares;
pub mod motion_and_loads;
pub mod rng;
pub mod scene;
pub mod score;
pub mod torque;
pub mod transform;
pub mod truth;
