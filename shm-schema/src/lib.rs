//! The bytes that both sides share, their versions and their service names.
