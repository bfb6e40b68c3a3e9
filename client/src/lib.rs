//! What cell software links: send commanded joint targets, take corrected ones.
