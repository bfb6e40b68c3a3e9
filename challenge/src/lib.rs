//! The blind test: sealed cases, and the score of the answers.
//!
//! The physics here is formulated otherwise than anywhere else in the house, and shares nothing with it: homogeneous transforms from
//! Denavit–Hartenberg tables, play as a contact of two faces, hysteresis by springs that slip, warmth by two nodes, gear errors as series with
//! sidebands, noise with colour, a last digit, gaps and outliers.
//!
//! Read in this order: [`mod@law`] (what all domains have in common), [`kinds`] and [`laws`] (what may be hidden), [`scene`] (what the robot does), [`view`] (what is seen),
//! [`mod@draw`] (cases by chance), [`mod@bench`] (what can be known of a case before anyone answers), [`fit`] and [`proof`] (what an answer is worth on a
//! motion that nobody saw), [`mod@write`] (the files), [`seal`], [`answer`] and [`score`].
//!
//! What the motors feel instead of where the tool goes: [`torque`]; what a cutter exerts: [`force`].
//!
//! Promises: the same seed gives the same bytes. Never: a file read or written, a process, a clock.

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
