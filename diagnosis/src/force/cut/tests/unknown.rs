//! Forces that no effect explains: reported as unknown structure with their covariates.

use super::*;

#[test]
fn a_force_that_no_name_has_is_unknown_structure() {
    let mut recording = MADE.recorded("");
    let along = recording.column(Channel::Wrench(0)).expect("made").to_vec();
    // A sensor with a compressive nonlinearity: large forces are underestimated.
    let soft = along.iter().map(|force| force - 1.5e-3 * force * force.abs()).collect();
    recording.set(Channel::Wrench(0), soft);
    let found = of(&recording);
    assert_eq!(found.verdict, Verdict::UnknownStructure, "{:?}", found.cut_comparison);
    let rest = found.cut_comparison.expect("compared").unexplained.expect("a law");
    assert_eq!((rest.axis, rest.depends_on[0].as_str()), (0, "wrench"));
}

#[test]
fn a_force_that_rises_and_falls_from_turn_to_turn_is_unknown_structure_over_time() {
    let found = of(&partly(&|t_s| 1.0 + 0.3 * (9.0 * t_s).fract()));
    assert_eq!(found.verdict, Verdict::UnknownStructure, "{:?}", found.cut_comparison);
    let rest = found.cut_comparison.expect("compared").unexplained.expect("a law");
    assert_eq!(rest.depends_on, ["t_s"]);
}

#[test]
fn an_amplifier_that_drifts_further_than_any_does_is_no_bias() {
    let mut recording = MADE.recorded("");
    let last = recording.t_s.last().copied().expect("rows");
    let column = recording.column(Channel::Wrench(2)).expect("forces").to_vec();
    let times = recording.t_s.clone();
    let crept = column.iter().zip(times).map(|(force, t_s)| force + 2.0 * MADE.noise * t_s / last);
    recording.set(Channel::Wrench(2), crept.collect());
    let found = of(&recording).cut_comparison.expect("compared");
    assert_eq!(found.verdict, Verdict::UnknownStructure);
    assert_eq!(found.unexplained.expect("told").depends_on, ["t_s"]);
}

/// Passes in succession, each as a segment.
fn joined(passes: &[Recording]) -> Recording {
    let first = &passes[0];
    let times = passes.iter().flat_map(|pass| pass.t_s.iter().copied());
    let mut whole = Recording::new(times.collect());
    let channels: Vec<Channel> = first.channels().collect();
    for channel in channels {
        let column = |pass: &Recording| pass.column(channel).expect("the same channels").to_vec();
        whole.set(channel, passes.iter().flat_map(column).collect());
    }
    let segments = passes.iter().zip(0..).flat_map(|(pass, k)| vec![k; pass.len()]);
    whole.segment = segments.collect();
    whole.metadata = first.metadata.clone();
    whole
}

#[test]
fn edges_that_plough_the_more_the_faster_they_go_follow_the_speed_and_not_the_feed() {
    // With three speeds and three feeds, a piecewise linear function of the feed can reproduce a linear function of the speed.
    let pass = |rpm: f64, feeds_m_s: &'static [f64]| {
        let more = 2.0 * (rpm / RPM - 1.0);
        let rubs = [8.0, 10.0, 2.0].map(|number| number * more);
        Made { rpm, feeds_m_s, lasts_s: 1.0, ..MADE }
            .recorded(&effect("edge_force", &format!("coefficient_N_per_mm = {rubs:?}")))
    };
    let passes = [pass(3300.0, &[0.0, 8e-3]), pass(RPM, &[16e-3]), pass(4800.0, &[6e-3])];
    let found = of(&joined(&passes));
    assert_eq!(found.verdict, Verdict::UnknownStructure);
    let rest = found.cut_comparison.expect("compared").unexplained.expect("a law");
    assert_eq!(rest.depends_on, ["spindle_rpm", "wrench"]);
}
