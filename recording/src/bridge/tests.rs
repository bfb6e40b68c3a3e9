//! Configurations of bridges, good and bad.
