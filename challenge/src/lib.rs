//! Blind test of the diagnosis: sealed random cases, and the score of the answers.
//!
//! The physics here is formulated independently of all other crates and shares no code with them: homogeneous transforms from Denavit-Hartenberg
//! tables, backlash as contact of two faces, hysteresis by elasto-slip elements, temperature by two thermal nodes, gear errors as series with
//! sidebands, autocorrelated noise, quantisation, gaps and outliers.
//!
//! Read in this order: [`mod@law`] (common to all domains), [`kinds`] and [`laws`] (possible hidden effects), [`scene`] (inputs of the robot),
//! [`view`] (instruments), [`mod@draw`] (random cases), [`mod@bench`] (detectability of a case's effects), [`fit`] and [`proof`] (error of an answer
//! on an unseen motion), [`mod@write`] (the files), [`seal`], [`answer`] and [`score`].
//!
//! Other domains: drive torques in [`torque`], cutting forces in [`force`].
//!
//! The same seed gives the same bytes. No file access, no process, no clock.

pub mod answer;
pub mod arm;
pub mod bench;
pub mod bent;
pub mod candidates;
pub mod case;
pub mod chance;
pub mod draw;
pub mod fit;
pub mod force;
pub mod kinds;
pub mod law;
pub mod laws;
pub mod linear;
pub mod proof;
pub mod ride;
pub mod scene;
pub mod score;
pub mod seal;
pub mod space;
pub mod torque;
pub mod truth;
pub mod view;
pub mod weigh;
pub mod write;
