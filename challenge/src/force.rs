//! Blind cases of cutting forces: milling and turning, with hidden edge forces, cutting coefficients, wear, runout, chatter, and errors of the
//! sensor.
//!
//! Teeth are stepped in time. Chip thickness is the distance of an edge beyond the true (trochoidal) path of the preceding tooth, on a tool that
//! moves while it rotates; runout displaces the edges; wear is proportional to the feed path. The forces are measured by a sensor with misalignment,
//! cross-talk, scale error, bias, drift, noise and quantisation.
//!
//! Read in this order: [`kinds`], [`mod@cut`], [`passes`], [`teeth`], [`laws`], [`case`], [`mod@detectability`], [`mod@generate`], [`mod@evaluation`], [`case_files`].
//!
//! The same seed gives the same bytes. No file, no process, and no code of another crate's physics.

pub mod candidates;
pub mod case;
pub mod case_files;
pub mod cut;
pub mod detectability;
pub mod evaluation;
pub mod generate;
pub mod kinds;
pub mod laws;
pub mod passes;
pub mod teeth;
