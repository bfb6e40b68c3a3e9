//! A simulated cell around a real daemon.
