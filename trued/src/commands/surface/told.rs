//! Output of `trued surface`: text and JSON.

use report::{TextTable, significant};
use serde::Serialize;
use spectrum::surface::Parameters;

use super::Surface;
use super::measured::{Measured, Segments, Told};
use crate::table::on_stdout;

/// Number of lines on the console for each profile.
const LINES_TOLD: usize = 3;

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Report<'a> {
    unit: &'static str,
    cut_off_mm: f64,
    short_cut_off_um: Option<f64>,
    form_degree: u8,
    feed_mm_s: Option<f64>,
    profiles: Vec<ProfileReport<'a>>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct ProfileReport<'a> {
    file: String,
    column: &'a str,
    points: usize,
    spacing_um: f64,
    length_mm: f64,
    evaluated_from_mm: f64,
    evaluated_mm: f64,
    /// The profile is too short to leave out its ends, where the filter lacks part of its kernel.
    ends_kept: bool,
    primary: Heights,
    waviness: Heights,
    roughness: Heights,
    #[serde(rename = "Rz_um")]
    rz_um: Option<f64>,
    #[serde(rename = "Rz_sampling_lengths")]
    rz_lengths: usize,
    #[serde(rename = "RSm_um")]
    rsm_um: Option<f64>,
    #[serde(rename = "Rq_by_spectrum_um")]
    rq_by_spectrum_um: f64,
    segments: Vec<SegmentsReport>,
    lines: Vec<LineReport>,
}

/// `Xa`, `Xq`, … of ISO 21920-2, where `X` is P, W or R by the profile.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Heights {
    a_um: f64,
    q_um: f64,
    t_um: f64,
    p_um: f64,
    v_um: f64,
    sk: f64,
    ku: f64,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct SegmentsReport {
    length_mm: f64,
    each: Vec<SegmentReport>,
    mean: Option<SegmentReport>,
    spread: Option<SegmentReport>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "the keys are the standard's names")]
struct SegmentReport {
    #[serde(skip_serializing_if = "Option::is_none")]
    from_mm: Option<f64>,
    Wt_um: f64,
    Wq_um: f64,
    Rt_um: f64,
    Rq_um: f64,
    Ra_um: f64,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "Hz is the unit's name")]
struct LineReport {
    cycles_per_mm: f64,
    sigma_cycles_per_mm: f64,
    wavelength_um: f64,
    amplitude_um: f64,
    over_floor: f64,
    frequency_Hz: Option<f64>,
    fits: String,
}

pub(super) type Pair = (Parameters, Parameters);
/// The figures of each segment: waviness first.
pub(super) const OF_SEGMENT: [fn(&Pair) -> f64; 5] = [
    |each| each.0.total_height,
    |each| each.0.rms,
    |each| each.1.total_height,
    |each| each.1.rms,
    |each| each.1.mean_deviation,
];

impl<'a> Report<'a> {
    pub(super) fn of(command: &Surface, profiles: &'a [Measured]) -> Self {
        Self {
            unit: "um",
            cut_off_mm: command.cut_off_mm,
            short_cut_off_um: command.short_cut_off_um,
            form_degree: command.form,
            feed_mm_s: command.feed_mm_s,
            profiles: profiles.iter().map(ProfileReport::of).collect(),
        }
    }
}

impl<'a> ProfileReport<'a> {
    fn of(measured: &'a Measured) -> Self {
        let points = measured.profile.heights_um.len();
        Self {
            file: measured.profile.file.display().to_string(),
            column: &measured.profile.column,
            points,
            spacing_um: 1e3 * measured.profile.spacing_mm,
            length_mm: points as f64 * measured.profile.spacing_mm,
            evaluated_from_mm: measured.start_mm(),
            evaluated_mm: measured.surface.evaluated_mm(),
            ends_kept: measured.surface.ends_kept(),
            primary: Heights::of(&measured.p),
            waviness: Heights::of(&measured.w),
            roughness: Heights::of(&measured.r),
            rz_um: measured.rz.map(|(rz, _)| rz),
            rz_lengths: measured.rz.map_or(0, |(_, lengths)| lengths),
            rsm_um: measured.rsm_mm.map(|mm| 1e3 * mm),
            rq_by_spectrum_um: measured.rq_by_spectrum_um(),
            segments: measured.segments.iter().map(|s| SegmentsReport::of(s, measured)).collect(),
            lines: measured.lines.iter().map(|l| LineReport::of(l, &measured.lines)).collect(),
        }
    }
}

impl Heights {
    fn of(p: &Parameters) -> Self {
        Self {
            a_um: p.mean_deviation,
            q_um: p.rms,
            t_um: p.total_height,
            p_um: p.peak,
            v_um: p.valley,
            sk: p.skewness,
            ku: p.kurtosis,
        }
    }
}

impl SegmentReport {
    fn of(from_mm: Option<f64>, [wt, wq, rt, rq, ra]: [f64; 5]) -> Self {
        Self { from_mm, Wt_um: wt, Wq_um: wq, Rt_um: rt, Rq_um: rq, Ra_um: ra }
    }
}

impl SegmentsReport {
    fn of(segments: &Segments, measured: &Measured) -> Self {
        let place = |k: usize| Some(measured.start_mm() + k as f64 * segments.length_mm);
        let each = segments.each.iter().enumerate();
        let each = each.map(|(k, each)| SegmentReport::of(place(k), OF_SEGMENT.map(|f| f(each))));
        let all = OF_SEGMENT.map(|value| segments.of_all(value));
        let spread = all.map(|(_, spread)| spread.unwrap_or(f64::NAN));
        Self {
            length_mm: segments.length_mm,
            each: each.collect(),
            mean: (!segments.each.is_empty())
                .then(|| SegmentReport::of(None, all.map(|(mean, _)| mean))),
            spread: (segments.each.len() > 1).then(|| SegmentReport::of(None, spread)),
        }
    }
}

impl LineReport {
    fn of(told: &Told, all: &[Told]) -> Self {
        Self {
            cycles_per_mm: told.line.cycles_per_mm,
            sigma_cycles_per_mm: told.line.sigma_cycles_per_mm,
            wavelength_um: told.wavelength_um(),
            amplitude_um: told.line.amplitude,
            over_floor: told.line.over_floor,
            frequency_Hz: told.frequency_hz,
            fits: told.words(all),
        }
    }
}

/// The lines on the console.
pub(super) fn told(profiles: &[Measured]) -> String {
    let mut table = TextTable::new(["µm", "Wt", "Wq", "Rt", "Rz", "Rq", "Ra", "RSm", "evaluated"]);
    for measured in profiles {
        let n = |value: f64| significant(value, 3);
        let missing = || "–".to_owned();
        table = table.row([
            measured.name.clone(),
            n(measured.w.total_height),
            n(measured.w.rms),
            n(measured.r.total_height),
            measured.rz.map_or_else(missing, |(rz, _)| n(rz)),
            n(measured.r.rms),
            n(measured.r.mean_deviation),
            measured.rsm_mm.map_or_else(missing, |mm| n(1e3 * mm)),
            format!("{:.2} mm", measured.surface.evaluated_mm()),
        ]);
    }
    let mut text = on_stdout(&table);
    for measured in profiles {
        let head = if profiles.len() > 1 { format!("{}: ", measured.name) } else { String::new() };
        for line in remarks(measured) {
            text += &format!("{head}{line}\n");
        }
    }
    text
}

fn remarks(measured: &Measured) -> Vec<String> {
    let mut lines = Vec::new();
    if measured.surface.ends_kept() {
        lines.push(
            "too short to leave its ends out: the filter lacks part of its kernel there".to_owned(),
        );
    }
    if let Some((_, lengths)) = measured.rz.filter(|(_, lengths)| *lengths < 5) {
        lines.push(format!("Rz over {lengths} sampling lengths only, the standard wants 5"));
    }
    for segments in &measured.segments {
        lines.push(segments_told(segments));
    }
    if measured.lines.is_empty() {
        lines.push("no line stands out of the spectrum".to_owned());
    }
    for told in measured.lines.iter().take(LINES_TOLD) {
        lines.push(line_told(told, &measured.lines));
    }
    let rq = significant(measured.rq_by_spectrum_um(), 3);
    lines.push(format!(
        "Rq from the spectrum (Parseval) is {rq} µm, equal to {:.0e}",
        measured.parseval_gap().max(1e-16)
    ));
    lines
}

fn segments_told(segments: &Segments) -> String {
    let (length_mm, count) = (segments.length_mm, segments.each.len());
    if count == 0 {
        return format!("shorter than a segment of {length_mm} mm");
    }
    let of = |value: fn(&Pair) -> f64| {
        let (mean, spread) = segments.of_all(value);
        let spread = spread.map(|s| format!(" ± {}", significant(s, 2))).unwrap_or_default();
        format!("{}{spread}", significant(mean, 3))
    };
    let [wt, wq, rt, rq, ra] = OF_SEGMENT.map(of);
    let segments = report::count(count, "segment");
    format!("{segments} of {length_mm} mm: Wt {wt}, Wq {wq}, Rt {rt}, Rq {rq}, Ra {ra}")
}

fn line_told(told: &Told, all: &[Told]) -> String {
    let words = told.words(all);
    let words = if words.is_empty() { words } else { format!(": {words}") };
    let hz = told.frequency_hz.map(|hz| format!(", {} Hz", significant(hz, 3))).unwrap_or_default();
    let (wavelength, cycles) =
        (significant(told.wavelength_um(), 3), significant(told.line.cycles_per_mm, 3));
    let amplitude = significant(told.line.amplitude, 3);
    format!("line of {wavelength} µm ({cycles} cycles/mm{hz}), amplitude {amplitude} µm{words}")
}
