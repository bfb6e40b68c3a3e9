//! Many recordings of many robots, diagnosed apart from each other: one Parquet file per recording, named by what it was computed from.
//!
//! Read in this order: [`key`] (the name of a result), [`shard`] (which process does which recordings), [`store`] (the folder of results), [`table`] (their
//! columns), [`run`](run()). Promises: the same recording, model, options and version give the same bytes under the same name, whatever the shards, their order or
//! where they were killed; a file under its final name is whole; a recording that cannot be diagnosed stops none of the others. Never: a diagnosis of its own,
//! or a process, a thread or a network: those belong to the scheduler.

pub mod key;
pub mod run;
pub mod shard;
pub mod store;
pub mod table;

pub use key::Key;
pub use run::{Failed, Item, Job, RunError, Summary, Told, model_of, run};
pub use shard::Shard;
pub use store::{Digest, Existing, Store};
pub use table::{Fact, Recorded, Row, Subject};
