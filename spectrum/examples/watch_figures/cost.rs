//! Computing time of the vibration monitor: share of a core, and a hop compared with plain
//! transforms. Measured by the thread's own processor time, so that other load on the machine
//! counts only through its caches.

use realfft::RealFftPlanner;
use realfft::num_complex::Complex;
use rustix::time::{ClockId, clock_gettime};
use spectrum::{Block, ConfigError, MonitorConfig, ProcessState, VibrationMonitor};
use std::hint::black_box;

/// Processor time of this thread so far, s.
fn spent_s() -> f64 {
    let spent = clock_gettime(ClockId::ThreadCPUTime);
    spent.tv_sec as f64 + 1e-9 * spent.tv_nsec as f64
}

/// Share of one core that 6 channels at 50 kHz take, whole chain: best of several runs of 4 s.
fn share_of_a_core() -> Result<(f64, f64), ConfigError> {
    let config = MonitorConfig { rate_hz: 50_000.0, channels: 6, ..MonitorConfig::default() };
    let mut watch = VibrationMonitor::new(config)?;
    watch.set_process_state(ProcessState { spindle_rpm: 28_000.0, teeth: 2, ..Default::default() });
    let frames = 500_usize;
    let mut state = 1_u64;
    let samples: Vec<f64> = (0..frames * 6 * 20)
        .map(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f64 / 1e6
        })
        .collect();
    let mut seq = 0;
    let mut shares = Vec::new();
    for _ in 0..7 {
        let begun = spent_s();
        for k in 0..400 {
            let part = &samples[(k % 20) * frames * 6..][..frames * 6];
            let t_ns = seq * 10_000_000;
            let block = Block {
                seq,
                t_ns,
                rate_hz: 50_000.0,
                channels: 6,
                samples: part,
                ..Block::default()
            };
            black_box(watch.push(&block));
            seq += 1;
        }
        shares.push((spent_s() - begun) / 4.0);
    }
    shares.sort_by(f64::total_cmp);
    Ok((shares[0], shares[3]))
}

/// One hop of the full-rate window at N = 4096 over six channels, and six plain transforms,
/// alternating so that both see the same load. Microseconds: least and middle of each.
fn hop_beside_plain() -> Option<[f64; 4]> {
    let mut bench = spectrum::bench::HopBench::new(4096, 50_000.0, 6);
    let plan = RealFftPlanner::<f64>::new().plan_fft_forward(4096);
    let inputs: Vec<Vec<f64>> =
        (0..6).map(|c| (0..4096).map(|i| ((i * (c + 3)) as f64 * 0.37).sin()).collect()).collect();
    let mut input = plan.make_input_vec();
    let mut output: Vec<Complex<f64>> = plan.make_output_vec();
    let mut scratch = plan.make_scratch_vec();
    let (mut hops, mut plains) = (Vec::new(), Vec::new());
    for _ in 0..4000 {
        let begun = spent_s();
        black_box(bench.hop());
        hops.push((spent_s() - begun) * 1e6);
        let begun = spent_s();
        for samples in &inputs {
            // realfft destroys its input: a copy belongs to every plain transform too.
            input.copy_from_slice(samples);
            plan.process_with_scratch(&mut input, &mut output, &mut scratch).ok()?;
            black_box(&output);
        }
        plains.push((spent_s() - begun) * 1e6);
    }
    hops.sort_by(f64::total_cmp);
    plains.sort_by(f64::total_cmp);
    Some([hops[0], hops[2000], plains[0], plains[2000]])
}

pub(crate) fn table() -> Result<String, ConfigError> {
    let (minimum, median) = share_of_a_core()?;
    let [hop_min, hop, plain_min, plain] = hop_beside_plain().unwrap_or([f64::NAN; 4]);
    Ok(format!(
        "{{\"channels\": 6, \"rate_Hz\": 50000, \"share_of_core\": {{\"min\": {minimum:.5}, \"p50\": {median:.5}}}, \
         \"hop_4096_us\": {{\"min\": {hop_min:.2}, \"p50\": {hop:.2}}}, \"six_plain_us\": {{\"min\": {plain_min:.2}, \
         \"p50\": {plain:.2}}}, \"ratio\": {{\"min\": {:.3}, \"p50\": {:.3}}}}}",
        hop_min / plain_min,
        hop / plain
    ))
}
