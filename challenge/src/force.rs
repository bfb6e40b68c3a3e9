//! Blind cases of cutting forces: milling and turning, with hidden edge forces, coefficients, wear, runout, chatter, and faults of the sensor.
//!
//! Teeth are stepped in time. A chip is as thick as its edge stands beyond the path that the tooth before it really took, both on a tool that moves on while
//! it turns; runout is an edge that stands elsewhere; wear is a share of the way. A sensor of its own reads it: turned, leaking, scaled, off, drifting,
//! noisy, with a last digit.
//!
//! Read in this order: [`kinds`], [`mod@cut`], [`scene`], [`teeth`], [`laws`], [`case`], [`mod@bench`], [`mod@draw`], [`proof`], [`mod@write`].
//!
//! Promises: the same seed gives the same bytes. Never: a file, a process, a line of another crate's physics.

pub mod bench;
pub mod candidates;
pub mod case;
pub mod cut;
pub mod draw;
pub mod kinds;
pub mod laws;
pub mod proof;
pub mod scene;
pub mod teeth;
pub mod write;
