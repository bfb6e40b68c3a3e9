//! Surface profiles as a page: the comparison first, then each profile with its spectrum, segments and lines.

use report::{
    Axis, Bars, Cell, Column, Multiples, Number, Page, Plot, Role, Series, Table, Tone, significant,
};

use spectrum::surface::HeightParameters;

use super::Settings;
use super::analysis::{Analysis, ProfileAnalysis, Segments};
use super::result::OF_SEGMENT;

/// Segments that a table shows; more are drawn.
const ROWS_MAX: usize = 16;
/// Of a profile's drawing.
const PROFILE: &str = "The profile without its form, and its waviness; below, the roughness. Dotted: the ends of the evaluation length.";
/// Lines marked in the spectrum.
const MARKS: usize = 5;

impl Analysis {
    /// The page.
    #[must_use]
    pub fn page(&self) -> Page {
        render(&self.settings, &self.profiles)
    }
}

fn render(settings: &Settings, profiles: &[ProfileAnalysis]) -> Page {
    let title = match profiles {
        [one] => format!("Surface profile {}", one.name),
        several => format!("{} surface profiles", several.len()),
    };
    let form = ["the mean", "a line", "an arc of degree 2"];
    let form = form.get(usize::from(settings.form_degree)).copied().unwrap_or("a polynomial");
    let short = settings.short_cut_off_um.map(|um| format!(", without wavelengths below {um} µm"));
    let how = format!(
        "With {form} taken out{}, the Gaussian filter of ISO 16610-21 parts waviness from roughness at {} mm. \
         Parameters are those of ISO 21920-2.",
        short.unwrap_or_default(),
        settings.cut_off_mm
    );
    let page = Page::new(title).kicker("trued surface");
    let page = match profiles {
        [one] => {
            let (tone, label) = if one.rz_um.is_some_and(|(_, lengths)| lengths >= 5) {
                (Tone::Good, "measured over five sampling lengths or more")
            } else {
                (Tone::Caution, "measured, over fewer than five sampling lengths")
            };
            page.verdict(tone, label, &sentence(one))
                .numbers(numbers(one))
                .figure(PROFILE, &profile_plot(one).render())
        }
        several => page
            .verdict(Tone::Plain, "profiles compared", &compared(several))
            .figure("Root mean square of waviness and roughness.", &bars(profiles).render()),
    };
    let mut page = page.next(
        "Compare with the forces of the same cut: lines in both have one cause.",
        Some("trued spectrum FORCES.csv --report spectrum.html"),
    );
    if profiles.len() > 1 {
        page = page.section("The profiles").table(&comparison(profiles));
    }
    for profile in profiles {
        page = profile_part(page, profile, profiles.len() > 1);
    }
    page.footer(how)
}

fn sentence(one: &ProfileAnalysis) -> String {
    let rz = one.rz_um.map_or("–".to_owned(), |(rz, _)| significant(rz, 3));
    let line = one.lines.first().map_or("no line exceeds the floor of its spectrum".to_owned(), |line| {
        format!(
            "the strongest line of its spectrum has a wavelength of {} µm and an amplitude of {} µm",
            significant(line.wavelength_um(), 3),
            significant(line.line.amplitude, 3)
        )
    });
    format!(
        "Waviness Wq {} µm, roughness Rq {} µm, Rz {rz} µm; {line}.",
        significant(one.waviness.rms, 3),
        significant(one.roughness.rms, 3)
    )
}

fn compared(profiles: &[ProfileAnalysis]) -> String {
    let by_roughness =
        |a: &&ProfileAnalysis, b: &&ProfileAnalysis| a.roughness.rms.total_cmp(&b.roughness.rms);
    let ends = profiles.iter().min_by(by_roughness).zip(profiles.iter().max_by(by_roughness));
    ends.map_or(String::new(), |(smoothest, roughest)| {
        format!(
            "{} is smoothest, Rq {} µm; {} is roughest, Rq {} µm.",
            smoothest.name,
            significant(smoothest.roughness.rms, 3),
            roughest.name,
            significant(roughest.roughness.rms, 3)
        )
    })
}

fn numbers(one: &ProfileAnalysis) -> Vec<Number> {
    let rz = one.rz_um.map_or(f64::NAN, |(rz, _)| rz);
    let lengths = one.rz_um.map_or(0, |(_, lengths)| lengths);
    let rz = Number::new("Roughness Rz", rz, "µm").note(format!("over {lengths} sampling lengths"));
    let mut numbers = vec![
        Number::new("Waviness Wq", one.waviness.rms, "µm")
            .note(format!("Wt {} µm", significant(one.waviness.total_height, 3))),
        Number::new("Roughness Rq", one.roughness.rms, "µm")
            .note(format!("Ra {} µm", significant(one.roughness.mean_deviation, 3))),
        if lengths < 5 { rz.tone(Tone::Caution) } else { rz },
    ];
    let strongest = one.lines.first();
    numbers.push(match strongest {
        Some(line) => Number::new("Strongest line", line.wavelength_um(), "µm")
            .note(format!("amplitude {} µm", significant(line.line.amplitude, 3))),
        None => Number::text("Strongest line", "none"),
    });
    numbers
}

fn comparison(profiles: &[ProfileAnalysis]) -> Table {
    let heads =
        ["Wt", "Wq", "Rt", "Rz", "Rq", "Ra", "RSm"].map(|name| Column::new(format!("{name} (µm)")));
    let heads =
        [Column::new("Profile")].into_iter().chain(heads).chain([Column::new("Strongest line")]);
    profiles.iter().fold(Table::new("The profiles, evaluated alike", heads), |table, one| {
        let line = one.lines.first().map(|line| {
            let causes = line.causes_text(&one.lines);
            let causes = if causes.is_empty() { causes } else { format!(" ({causes})") };
            format!("{} µm{causes}", significant(line.wavelength_um(), 3))
        });
        let numbers = [
            one.waviness.total_height,
            one.waviness.rms,
            one.roughness.total_height,
            one.rz_um.map_or(f64::NAN, |(rz, _)| rz),
            one.roughness.rms,
            one.roughness.mean_deviation,
            one.rsm_mm.map_or(f64::NAN, |mm| 1e3 * mm),
        ];
        let mut row: Vec<Cell> = vec![one.name.clone().into()];
        row.extend(numbers.map(Cell::from));
        row.push(line.unwrap_or_else(|| "none".to_owned()).into());
        table.row(row)
    })
}

fn bars(profiles: &[ProfileAnalysis]) -> Bars {
    let bars = Bars::new("Waviness and roughness", Axis::new("Root mean square", "µm"))
        .groups(["Wq", "Rq"]);
    profiles
        .iter()
        .fold(bars, |bars, one| bars.row(one.name.clone(), [one.waviness.rms, one.roughness.rms]))
}

fn profile_part(page: Page, profile: &ProfileAnalysis, named: bool) -> Page {
    let heading = if named { profile.name.clone() } else { "The profile".to_owned() };
    let points = profile.source.heights_um.len();
    let mut page = page.section(&heading).text(&format!(
        "{points} points, {} µm apart; parameters over {:.2} mm from {:.2} mm on.",
        significant(1e3 * profile.source.spacing_mm, 3),
        profile.surface.evaluated_mm(),
        profile.start_mm(),
    ));
    if profile.surface.ends_kept() {
        page = page.note(
            Tone::Caution,
            "Short profile",
            "It is too short to leave out half a cut-off at each end, where the filter lacks part of its kernel.",
        );
    }
    if named {
        page = page.figure(PROFILE, &profile_plot(profile).render());
    }
    page = page
        .figure(
            &format!(
                "One-sided power spectra over the evaluated length; the strongest lines are marked. Roughness sums to Rq² = {} µm² \
                 by Parseval; the profile itself gives the same to {:.0e}.",
                significant(profile.rq_by_spectrum_um().powi(2), 3),
                profile.parseval_gap().max(1e-16)
            ),
            &spectrum_plot(profile).render(),
        );
    if !profile.lines.is_empty() {
        page = page.table(&lines(profile));
    }
    page = page.table(&parameters(profile));
    profile.segments.iter().fold(page, |page, segments| segment_part(page, profile, segments))
}

fn profile_plot(profile: &ProfileAnalysis) -> Multiples {
    let spacing_mm = profile.surface.spacing_mm;
    let line = |heights: &[f64]| {
        heights.iter().enumerate().map(|(i, z)| (i as f64 * spacing_mm, *z)).collect::<Vec<_>>()
    };
    let plot = |title: &str| {
        let plot = Plot::new(title, Axis::new("Position", "mm"), Axis::new("Height", "µm"));
        let (from, to) = (profile.start_mm(), profile.start_mm() + profile.surface.evaluated_mm());
        if profile.surface.ends_kept() { plot } else { plot.mark_x(from, "").mark_x(to, "") }
    };
    Multiples::new("Profile", 1)
        .plot(
            plot("Profile and waviness")
                .series(Series::line("profile", line(&profile.surface.primary)).role(Role::Before))
                .series(Series::line("waviness", line(&profile.surface.waviness))),
        )
        .plot(
            plot("Roughness")
                .series(Series::line("", []))
                .series(Series::line("roughness", line(&profile.surface.roughness))),
        )
        .own_y()
}

fn spectrum_plot(profile: &ProfileAnalysis) -> Plot {
    let line = |spectrum: &spectrum::welch::Spectrum| {
        // The mean's bin has no place on a logarithmic axis.
        spectrum
            .frequency
            .iter()
            .copied()
            .zip(spectrum.power.iter().copied())
            .skip(1)
            .collect::<Vec<_>>()
    };
    let top = profile.spectra.roughness.power.iter().chain(&profile.spectra.waviness.power);
    let top = top.fold(f64::MIN_POSITIVE, |top, p| top.max(*p));
    let last = profile.spectra.roughness.frequency.last().copied().unwrap_or(1.0);
    let first = profile.spectra.roughness.frequency.get(1).copied().unwrap_or(1.0);
    let plot = Plot::new(
        "Power over cycles per mm",
        Axis::new("Cycles per mm", "1/mm").log().range(first, last),
        Axis::new("Power", "µm²").log().range(1e-6 * top, 2.0 * top),
    )
    .series(Series::line("waviness", line(&profile.spectra.waviness)))
    .series(Series::line("roughness", line(&profile.spectra.roughness)))
    .height(340.0);
    profile.lines.iter().take(MARKS).fold(plot, |plot, line| {
        plot.mark_x(line.line.cycles_per_mm, format!("{} µm", significant(line.wavelength_um(), 3)))
    })
}

fn lines(profile: &ProfileAnalysis) -> Table {
    let timed = profile.lines.iter().any(|line| line.frequency_hz.is_some());
    let mut heads = vec![
        Column::new("Wavelength (µm)"),
        Column::new("Cycles per mm"),
        Column::new("Amplitude (µm)"),
        Column::new("Over its floor"),
    ];
    if timed {
        heads.push(Column::new("At this feed (Hz)"));
    }
    let fitting = profile.lines.iter().any(|line| !line.causes_text(&profile.lines).is_empty());
    if fitting {
        heads.push(Column::new("Fits"));
    }
    let table = Table::new("Lines of the spectrum, strongest first", heads);
    profile.lines.iter().fold(table, |table, line| {
        let numbers = [
            line.wavelength_um(),
            line.line.cycles_per_mm,
            line.line.amplitude,
            line.line.over_floor.round(),
        ];
        let mut row: Vec<Cell> = numbers.map(Cell::from).to_vec();
        if timed {
            row.push(line.frequency_hz.unwrap_or(f64::NAN).into());
        }
        if fitting {
            row.push(line.causes_text(&profile.lines).into());
        }
        table.row(row)
    })
}

/// A row of the table of parameters: suffix and unit of their names, value, meaning.
type ParameterRow = (&'static str, &'static str, fn(&HeightParameters) -> f64, &'static str);

fn parameters(profile: &ProfileAnalysis) -> Table {
    let heads = ["Parameter", "Profile P", "Waviness W", "Roughness R", "Meaning"];
    let each = [&profile.primary, &profile.waviness, &profile.roughness];
    let rows: [ParameterRow; 7] = [
        ("a", "µm", |p| p.mean_deviation, "mean deviation"),
        ("q", "µm", |p| p.rms, "root mean square"),
        ("t", "µm", |p| p.total_height, "total height"),
        ("p", "µm", |p| p.peak, "highest peak"),
        ("v", "µm", |p| p.valley, "deepest valley"),
        ("sk", "", |p| p.skewness, "skewness"),
        ("ku", "", |p| p.kurtosis, "kurtosis"),
    ];
    let table = Table::new("Parameters of ISO 4287 of the three profiles", heads);
    rows.into_iter().fold(table, |table, (suffix, unit, value, meaning)| {
        let names: Vec<String> =
            ["P", "W", "R"].map(|profile| format!("{profile}{suffix}")).to_vec();
        let unit = if unit.is_empty() { String::new() } else { format!(" ({unit})") };
        let values = each.map(|p| Cell::from(significant(value(p), 3)));
        let name = Cell::from(format!("{}{unit}", names.join(", ")));
        table.row([name].into_iter().chain(values).chain([meaning.into()]))
    })
}

fn segment_part(page: Page, profile: &ProfileAnalysis, segments: &Segments) -> Page {
    let (length_mm, count) = (segments.length_mm, segments.each.len());
    if count == 0 {
        return page
            .text(&format!("The evaluated length is shorter than a segment of {length_mm} mm."));
    }
    let page = if count > ROWS_MAX {
        page.figure(
            &format!("Segments of {length_mm} mm: root mean square of each."),
            &over_segments(profile, segments).render(),
        )
    } else {
        page
    };
    page.table(&segment_table(profile, segments))
}

fn over_segments(profile: &ProfileAnalysis, segments: &Segments) -> Plot {
    let place = |k: usize| profile.start_mm() + (k as f64 + 0.5) * segments.length_mm;
    let line = |value: fn(&ProfileAnalysis, usize, &Segments) -> f64| {
        (0..segments.each.len()).map(move |k| (place(k), value(profile, k, segments)))
    };
    Plot::new("Segments", Axis::new("Position", "mm"), Axis::new("Root mean square", "µm"))
        .series(Series::line("Wq", line(|_, k, s| s.each[k].0.rms)))
        .series(Series::line("Rq", line(|_, k, s| s.each[k].1.rms)))
        .height(220.0)
}

fn segment_table(profile: &ProfileAnalysis, segments: &Segments) -> Table {
    let heads = ["Segment", "Wt (µm)", "Wq (µm)", "Rt (µm)", "Rq (µm)", "Ra (µm)"];
    let values = OF_SEGMENT;
    let row = |name: String, numbers: [f64; 5]| {
        let mut row: Vec<Cell> = vec![name.into()];
        row.extend(numbers.map(Cell::from));
        row
    };
    let caption = format!("Segments of {} mm", segments.length_mm);
    let mut table = Table::new(caption, heads);
    if segments.each.len() <= ROWS_MAX {
        for (k, each) in segments.each.iter().enumerate() {
            let from = profile.start_mm() + k as f64 * segments.length_mm;
            let name = format!("{from:.2} to {:.2} mm", from + segments.length_mm);
            table = table.row(row(name, values.map(|value| value(each))));
        }
    }
    if segments.each.len() > 1 {
        let all = values.map(|value| segments.of_all(value));
        let spread = all.map(|(_, spread)| spread.unwrap_or(f64::NAN));
        table = table
            .row(row(format!("mean of {}", segments.each.len()), all.map(|(mean, _)| mean)))
            .row(row("standard deviation".to_owned(), spread));
    }
    table
}
