//! The robot's side of a cell in ten lines: what an integrator adds to a loop of his own.
//!
//! `cargo run -p trued-client --example robot_loop -- CELL`, beside a `trued run` for that cell.

use std::time::Duration;

use trued_client::{Client, monotonic_ns};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let cell = std::env::args().nth(1).unwrap_or_else(|| "cell-1".to_owned());
    let mut trued = Client::connect(&cell, Duration::from_secs(2))?;
    for cycle in 0..10_000 {
        let q_cmd = next_target_rad(cycle);
        let _ = trued.send(&q_cmd.into()); // can fail without a daemon; the next line still works
        let target = trued.target_for(&q_cmd, monotonic_ns())?; // fails only if q_cmd is not finite
        publish_to_robot(target.joints());
        std::thread::sleep(Duration::from_millis(1));
    }
    Ok(())
}

/// Stands for the cell's own path: a slow swing of joint 1.
fn next_target_rad(cycle: u32) -> [f64; 6] {
    let angle = 0.2 * (f64::from(cycle) * 1e-3).sin();
    [angle, -0.5, 0.7, 0.0, 0.4, 0.0]
}

/// Stands for the robot's own interface.
fn publish_to_robot(q: &[f64]) {
    std::hint::black_box(q);
}
