//! The robot as equations: geometry, and one file per physical effect behind one trait.
