//! The client library for Python.
//!
//! Promise: no call waits longer than its timeout, and none holds the GIL while it waits; arguments are
//! checked, and every error has its own exception class. Never: rules of its own; these are in `trued_client`.

mod client;
mod errors;
mod force;
mod held;
mod instrument;
mod monitor;
mod told;

use pyo3::prelude::*;

/// CLOCK_MONOTONIC, ns: the one clock of all times here.
#[pyfunction]
fn monotonic_ns() -> u64 {
    trued_client::monotonic_ns()
}

/// The version of the library, with the contract that it shares with the daemon.
#[pyfunction]
fn contract() -> String {
    trued_client::contract()
}

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<client::Client>()?;
    module.add_class::<monitor::Monitor>()?;
    module.add_class::<force::ForceSource>()?;
    module.add_class::<instrument::Instrument>()?;
    module.add_class::<told::Target>()?;
    module.add_class::<told::Corrected>()?;
    module.add_class::<told::Status>()?;
    module.add_class::<told::Vibration>()?;
    module.add_class::<told::Connection>()?;
    module.add_class::<told::Answer>()?;
    module.add_function(wrap_pyfunction!(monotonic_ns, module)?)?;
    module.add_function(wrap_pyfunction!(contract, module)?)
}
