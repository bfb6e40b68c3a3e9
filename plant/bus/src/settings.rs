//! Rates and sizes of a bridge, with unit, range, default and origin.

use std::time::Duration;

/// Settings of a bridge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Summaries per second. 0.1 to 10; default 1. Origin: the daemon states its status 25 times a second; dashboards and historians of plants store once a second.
    pub summaries_hz: f64,
    /// Size of the kept messages on disk, bytes. 1 MiB and more; default 256 MiB. Origin: about a day of summaries of six joints at 1 Hz (3 kB each).
    pub spool_bytes: u64,
    /// Size of the messages in one answer to a query of the history, bytes. Above 0; default 512 KiB. Origin: below the buffers of Zenoh's links, and read from disk
    /// within milliseconds.
    pub page_bytes: usize,
    /// Period at which the daemon's status is polled. 1 to 1000 ms, default 20 ms. Origin: half the time between two statuses.
    pub look_every: Duration,
    /// Timeout of an attempt to connect to the daemon; then its absence is reported and the next attempt starts. 10 ms to 10 s, default 500 ms. Origin: above the time in which a daemon starts.
    pub connect_within: Duration,
    /// Period in which at most one offered model is judged; another one is told to come again. 0 to 1 h, default 1 s. Origin: every judgement is a message, and a flood of offers must not displace
    /// the kept messages faster than summaries do.
    pub offer_every: Duration,
    /// Timeout of the daemon's answer when it is asked to load a model; no summary is made meanwhile. 1 to 60 s, default 5 s. Origin: as of `trued reload`.
    pub load_within: Duration,
    /// Timeout of the MQTT broker's answers; then the connection counts as lost. 1 to 60 s, default 5 s. Origin: above the time in which a broker writes its state to disk.
    pub broker_within: Duration,
    /// Pause after a lost connection to the broker. 0.1 to 60 s, default 1 s. Origin: a restarted broker is found within a summary or two, and one that is away is not flooded.
    pub broker_retry_every: Duration,
    /// Silence after which the broker asks whether the node is there, and sends its death after one and a half of it. 1 s to 1 h, default 10 s. Origin: a historian marks the values of a lost cell as stale within 15 s.
    pub broker_keep_alive: Duration,
    /// Size of the kept messages that are sent before the broker has to answer, bytes. Above 0; default 64 KiB. Origin: about twenty summaries, which are sent again after a lost connection.
    pub broker_page_bytes: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            summaries_hz: 1.0,
            spool_bytes: 256 << 20,
            page_bytes: 512 << 10,
            look_every: Duration::from_millis(20),
            connect_within: Duration::from_millis(500),
            offer_every: Duration::from_secs(1),
            load_within: Duration::from_secs(5),
            broker_within: Duration::from_secs(5),
            broker_retry_every: Duration::from_secs(1),
            broker_keep_alive: Duration::from_secs(10),
            broker_page_bytes: 64 << 10,
        }
    }
}
