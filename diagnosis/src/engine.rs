//! The statistics that all domains share, one of each: data split, normal equations, information criterion, search, noise model, cluster-robust covariance, validation,
//! attribution, posterior probabilities, verdict.
//!
//! Promises: knows rows and columns, no robot, no file, no effect. Never: a domain's threshold; each has a settings type with its defaults.

pub(crate) mod attribution;
pub(crate) mod criterion;
pub(crate) mod library;
pub(crate) mod noise;
pub(crate) mod normal_equations;
pub(crate) mod partial_cholesky;
pub(crate) mod posterior;
pub(crate) mod sandwich;
pub(crate) mod split;
pub(crate) mod statistics;
pub(crate) mod stepwise;
pub(crate) mod sums;
pub(crate) mod table;
pub(crate) mod validation;
pub(crate) mod verdict;
