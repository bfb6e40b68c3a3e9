//! Threads, shared memory, time, health, reload and black box of trued run.
