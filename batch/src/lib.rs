//! Batch diagnosis of many recordings: one Parquet file per recording, named by a hash of its inputs.
//!
//! Read in this order: [`key`] (the name of a result), [`shard`] (which process does which recordings), [`store`] (the folder of results), [`table`] (their
//! columns), [`run`](run()). The same recording, model, options and version give the same bytes
//! under the same name, for any number and order of shards and
//! after any kill; a file under its final name is complete; a recording that cannot be diagnosed
//! does not affect the others. The crate itself contains no diagnosis, process, thread or network
//! access: these belong to the scheduler.

pub mod check;
pub mod key;
pub mod run;
pub mod shard;
pub mod store;
pub mod table;

pub use key::Key;
pub use run::{
    DiagnosisError, Item, Job, RunError, Summary, UndiagnosedRecording, robot_model_path, run,
};
pub use shard::Shard;
pub use store::{Digest, Existing, Store};
pub use table::{FindingParameter, ResultHeader, Row, Subject};
