//! The statistics that all domains of the diagnosis share: data split, normal equations, information criterion, stepwise search, noise model,
//! cluster-robust covariance, validation, attribution, posterior probabilities, verdict.
//!
//! The modules operate on rows and columns; they know no robot, file or effect. Thresholds that depend on the domain are fields of a settings type
//! with defaults.

pub(crate) mod attribution;
pub(crate) mod criterion;
pub(crate) mod dictionary;
pub(crate) mod noise;
pub(crate) mod normal_equations;
pub(crate) mod partial_cholesky;
pub(crate) mod posterior;
pub(crate) mod product_cache;
pub(crate) mod regression_data;
pub(crate) mod sandwich;
pub(crate) mod split;
pub(crate) mod statistics;
pub(crate) mod stepwise;
pub(crate) mod validation;
pub(crate) mod verdict;
