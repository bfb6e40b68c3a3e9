//! Surface profiles as text.

use report::{TextTable, significant};

use super::analysis::{Analysis, ExplainedLine, ProfileAnalysis, Segments};
use super::result::{OF_SEGMENT, Pair};

/// Lines of the spectrum that are listed for each profile.
const LINES_MAX: usize = 3;

impl Analysis {
    /// The result as text; its table is at most `width_max` characters wide.
    #[must_use]
    pub fn text(&self, width_max: Option<usize>) -> String {
        let profiles = &self.profiles;
        let mut text = table(profiles).render(width_max);
        for profile in profiles {
            let head =
                if profiles.len() > 1 { format!("{}: ", profile.name) } else { String::new() };
            for line in remarks(profile) {
                text += &format!("{head}{line}\n");
            }
        }
        text
    }
}

fn table(profiles: &[ProfileAnalysis]) -> TextTable {
    let mut table = TextTable::new(["µm", "Wt", "Wq", "Rt", "Rz", "Rq", "Ra", "RSm", "evaluated"]);
    for profile in profiles {
        let n = |value: f64| significant(value, 3);
        let missing = || "–".to_owned();
        table = table.row([
            profile.name.clone(),
            n(profile.waviness.total_height),
            n(profile.waviness.rms),
            n(profile.roughness.total_height),
            profile.rz_um.map_or_else(missing, |(rz, _)| n(rz)),
            n(profile.roughness.rms),
            n(profile.roughness.mean_deviation),
            profile.rsm_mm.map_or_else(missing, |mm| n(1e3 * mm)),
            format!("{:.2} mm", profile.surface.evaluated_mm()),
        ]);
    }
    table
}

fn remarks(profile: &ProfileAnalysis) -> Vec<String> {
    let mut lines = Vec::new();
    if profile.surface.ends_kept() {
        lines.push(
            "too short to exclude its ends, where the filter lacks part of its kernel".to_owned(),
        );
    }
    if let Some((_, lengths)) = profile.rz_um.filter(|(_, lengths)| *lengths < 5) {
        lines.push(format!("Rz over {lengths} sampling lengths only, the standard requires 5"));
    }
    for segments in &profile.segments {
        lines.push(segments_text(segments));
    }
    if profile.lines.is_empty() {
        lines.push("no line exceeds the floor of the spectrum".to_owned());
    }
    for line in profile.lines.iter().take(LINES_MAX) {
        lines.push(line_text(line, &profile.lines));
    }
    let rq = significant(profile.rq_by_spectrum_um(), 3);
    lines.push(format!(
        "Rq from the spectrum (Parseval) is {rq} µm, {}",
        agreement(profile.parseval_gap())
    ));
    lines
}

/// How well the two values of Rq agree. `gap`: their difference, relative.
fn agreement(gap: f64) -> String {
    match report::beside(gap, 1.0) {
        0.0 => "equal".to_owned(),
        gap => format!("different by {} %", significant(100.0 * gap, 2)),
    }
}

fn segments_text(segments: &Segments) -> String {
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
    let segments = report::pluralise(count, "segment");
    format!("{segments} of {length_mm} mm: Wt {wt}, Wq {wq}, Rt {rt}, Rq {rq}, Ra {ra}")
}

fn line_text(line: &ExplainedLine, all: &[ExplainedLine]) -> String {
    let causes = line.causes_text(all);
    let causes = if causes.is_empty() { causes } else { format!(": {causes}") };
    let hz = line.frequency_hz.map(|hz| format!(", {} Hz", significant(hz, 3))).unwrap_or_default();
    let (wavelength, cycles) =
        (significant(line.wavelength_um(), 3), significant(line.line.cycles_per_mm, 3));
    let amplitude = significant(line.line.amplitude, 3);
    format!("line of {wavelength} µm ({cycles} cycles/mm{hz}), amplitude {amplitude} µm{causes}")
}
