//! The page of `trued surface`: the comparison first, then each profile with its spectrum, segments and lines.

use report::{
    Axis, Bars, Cell, Column, Multiples, Number, Page, Plot, Role, Series, Table, Tone, significant,
};

use super::Surface;
use super::measured::{Measured, Segments};

/// Segments that a table shows; more are drawn.
const ROWS_MAX: usize = 16;
/// Of a profile's drawing.
const PROFILE: &str = "The profile without its form and its waviness; below, the roughness. Dotted: where the evaluated length begins and ends.";
/// Lines marked in the spectrum.
const MARKS: usize = 5;

/// The whole page.
pub(super) fn render(command: &Surface, profiles: &[Measured]) -> Page {
    let title = match profiles {
        [one] => format!("Surface profile {}", one.name),
        several => format!("{} surface profiles", several.len()),
    };
    let form = ["the mean", "a line", "an arc of degree 2"];
    let form = form.get(usize::from(command.form)).copied().unwrap_or("a polynomial");
    let short =
        command.short_cut_off_um.map(|um| format!(", without what is shorter than {um} µm"));
    let how = format!(
        "With {form} taken out{}, the Gaussian filter of ISO 16610-21 parts waviness from roughness at {} mm. \
         Parameters are those of ISO 21920-2.",
        short.unwrap_or_default(),
        command.cut_off_mm
    );
    let page = Page::new(title).kicker("trued surface");
    let page = match profiles {
        [one] => {
            let (tone, word) = if one.rz.is_some_and(|(_, lengths)| lengths >= 5) {
                (Tone::Good, "measured over five sampling lengths or more")
            } else {
                (Tone::Caution, "measured, over fewer than five sampling lengths")
            };
            page.verdict(tone, word, &sentence(one))
                .numbers(numbers(one))
                .figure(PROFILE, &profile(one).render())
        }
        several => page
            .verdict(Tone::Plain, "profiles compared", &compared(several))
            .figure("Root mean square of waviness and roughness.", &bars(profiles).render()),
    };
    let mut page = page.next(
        "Compare with the forces of the same cut: what stands in both has one cause.",
        Some("trued spectrum FORCES.csv --report spectrum.html"),
    );
    if profiles.len() > 1 {
        page = page.section("The profiles").table(&comparison(profiles));
    }
    for measured in profiles {
        page = one(page, measured, profiles.len() > 1);
    }
    page.footer(how)
}

fn sentence(one: &Measured) -> String {
    let rz = one.rz.map_or("–".to_owned(), |(rz, _)| significant(rz, 3));
    let line = one.lines.first().map_or("no line stands out of its spectrum".to_owned(), |told| {
        format!(
            "the strongest line of its spectrum has a wavelength of {} µm and an amplitude of {} µm",
            significant(told.wavelength_um(), 3),
            significant(told.line.amplitude, 3)
        )
    });
    format!(
        "Waviness Wq {} µm, roughness Rq {} µm, Rz {rz} µm; {line}.",
        significant(one.w.rms, 3),
        significant(one.r.rms, 3)
    )
}

fn compared(profiles: &[Measured]) -> String {
    let by_roughness = |a: &&Measured, b: &&Measured| a.r.rms.total_cmp(&b.r.rms);
    let ends = profiles.iter().min_by(by_roughness).zip(profiles.iter().max_by(by_roughness));
    ends.map_or(String::new(), |(least, most)| {
        format!(
            "{} is smoothest, Rq {} µm; {} is roughest, Rq {} µm.",
            least.name,
            significant(least.r.rms, 3),
            most.name,
            significant(most.r.rms, 3)
        )
    })
}

fn numbers(one: &Measured) -> Vec<Number> {
    let rz = one.rz.map_or(f64::NAN, |(rz, _)| rz);
    let lengths = one.rz.map_or(0, |(_, lengths)| lengths);
    let rz = Number::new("Roughness Rz", rz, "µm").note(format!("over {lengths} sampling lengths"));
    let mut numbers = vec![
        Number::new("Waviness Wq", one.w.rms, "µm")
            .note(format!("Wt {} µm", significant(one.w.total_height, 3))),
        Number::new("Roughness Rq", one.r.rms, "µm")
            .note(format!("Ra {} µm", significant(one.r.mean_deviation, 3))),
        if lengths < 5 { rz.tone(Tone::Caution) } else { rz },
    ];
    let strongest = one.lines.first();
    numbers.push(match strongest {
        Some(told) => Number::new("Strongest line", told.wavelength_um(), "µm")
            .note(format!("amplitude {} µm", significant(told.line.amplitude, 3))),
        None => Number::text("Strongest line", "none"),
    });
    numbers
}

fn comparison(profiles: &[Measured]) -> Table {
    let heads =
        ["Wt", "Wq", "Rt", "Rz", "Rq", "Ra", "RSm"].map(|name| Column::new(format!("{name} (µm)")));
    let heads =
        [Column::new("Profile")].into_iter().chain(heads).chain([Column::new("Strongest line")]);
    profiles.iter().fold(Table::new("The profiles, evaluated alike", heads), |table, one| {
        let line = one.lines.first().map(|told| {
            let words = told.words(&one.lines);
            let words = if words.is_empty() { words } else { format!(" ({words})") };
            format!("{} µm{words}", significant(told.wavelength_um(), 3))
        });
        let numbers = [
            one.w.total_height,
            one.w.rms,
            one.r.total_height,
            one.rz.map_or(f64::NAN, |(rz, _)| rz),
            one.r.rms,
            one.r.mean_deviation,
            one.rsm_mm.map_or(f64::NAN, |mm| 1e3 * mm),
        ];
        let mut row: Vec<Cell> = vec![one.name.clone().into()];
        row.extend(numbers.map(Cell::from));
        row.push(line.unwrap_or_else(|| "none".to_owned()).into());
        table.row(row)
    })
}

fn bars(profiles: &[Measured]) -> Bars {
    let bars = Bars::new("Waviness and roughness", Axis::new("Root mean square", "µm"))
        .groups(["Wq", "Rq"]);
    profiles.iter().fold(bars, |bars, one| bars.row(one.name.clone(), [one.w.rms, one.r.rms]))
}

fn one(page: Page, measured: &Measured, named: bool) -> Page {
    let heading = if named { measured.name.clone() } else { "The profile".to_owned() };
    let points = measured.profile.heights_um.len();
    let mut page = page.section(&heading).text(&format!(
        "{points} points, {} µm apart; parameters over {:.2} mm from {:.2} mm on.",
        significant(1e3 * measured.profile.spacing_mm, 3),
        measured.surface.evaluated_mm(),
        measured.start_mm(),
    ));
    if measured.surface.ends_kept() {
        page = page.note(
            Tone::Caution,
            "Short profile",
            "It is too short to leave out half a cut-off at each end, where the filter lacks part of its kernel.",
        );
    }
    if named {
        page = page.figure(PROFILE, &profile(measured).render());
    }
    page = page
        .figure(
            &format!(
                "One-sided power spectra over the evaluated length; the strongest lines are marked. Roughness sums to Rq² = {} µm² \
                 by Parseval; the profile itself gives the same to {:.0e}.",
                significant(measured.rq_by_spectrum_um().powi(2), 3),
                measured.parseval_gap().max(1e-16)
            ),
            &spectrum(measured).render(),
        );
    if !measured.lines.is_empty() {
        page = page.table(&lines(measured));
    }
    page = page.table(&parameters(measured));
    measured.segments.iter().fold(page, |page, segments| segment_part(page, measured, segments))
}

fn profile(measured: &Measured) -> Multiples {
    let spacing_mm = measured.surface.spacing_mm;
    let line = |heights: &[f64]| {
        heights.iter().enumerate().map(|(i, z)| (i as f64 * spacing_mm, *z)).collect::<Vec<_>>()
    };
    let plot = |title: &str| {
        let plot = Plot::new(title, Axis::new("Place", "mm"), Axis::new("Height", "µm"));
        let (from, to) =
            (measured.start_mm(), measured.start_mm() + measured.surface.evaluated_mm());
        if measured.surface.ends_kept() { plot } else { plot.mark_x(from, "").mark_x(to, "") }
    };
    Multiples::new("Profile", 1)
        .plot(
            plot("Profile and waviness")
                .series(Series::line("profile", line(&measured.surface.primary)).role(Role::Before))
                .series(Series::line("waviness", line(&measured.surface.waviness))),
        )
        .plot(
            plot("Roughness")
                .series(Series::line("", []))
                .series(Series::line("roughness", line(&measured.surface.roughness))),
        )
        .own_y()
}

fn spectrum(measured: &Measured) -> Plot {
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
    let top = measured.spectra.roughness.power.iter().chain(&measured.spectra.waviness.power);
    let top = top.fold(f64::MIN_POSITIVE, |top, p| top.max(*p));
    let last = measured.spectra.roughness.frequency.last().copied().unwrap_or(1.0);
    let first = measured.spectra.roughness.frequency.get(1).copied().unwrap_or(1.0);
    let plot = Plot::new(
        "Power over cycles per mm",
        Axis::new("Cycles per mm", "1/mm").log().range(first, last),
        Axis::new("Power", "µm²").log().range(1e-6 * top, 2.0 * top),
    )
    .series(Series::line("waviness", line(&measured.spectra.waviness)))
    .series(Series::line("roughness", line(&measured.spectra.roughness)))
    .height(340.0);
    measured.lines.iter().take(MARKS).fold(plot, |plot, told| {
        plot.mark_x(told.line.cycles_per_mm, format!("{} µm", significant(told.wavelength_um(), 3)))
    })
}

fn lines(measured: &Measured) -> Table {
    let timed = measured.lines.iter().any(|told| told.frequency_hz.is_some());
    let mut heads = vec![
        Column::new("Wavelength (µm)"),
        Column::new("Cycles per mm"),
        Column::new("Amplitude (µm)"),
        Column::new("Over its floor"),
    ];
    if timed {
        heads.push(Column::new("At this feed (Hz)"));
    }
    let fitting = measured.lines.iter().any(|told| !told.words(&measured.lines).is_empty());
    if fitting {
        heads.push(Column::new("Fits"));
    }
    let table = Table::new("Lines that stand out of the spectrum, strongest first", heads);
    measured.lines.iter().fold(table, |table, told| {
        let numbers = [
            told.wavelength_um(),
            told.line.cycles_per_mm,
            told.line.amplitude,
            told.line.over_floor.round(),
        ];
        let mut row: Vec<Cell> = numbers.map(Cell::from).to_vec();
        if timed {
            row.push(told.frequency_hz.unwrap_or(f64::NAN).into());
        }
        if fitting {
            row.push(told.words(&measured.lines).into());
        }
        table.row(row)
    })
}

fn parameters(measured: &Measured) -> Table {
    let heads = ["", "a (µm)", "q (µm)", "t (µm)", "p (µm)", "v (µm)", "sk", "ku"];
    let rows =
        [("Profile P", &measured.p), ("Waviness W", &measured.w), ("Roughness R", &measured.r)];
    let caption = "Mean deviation, root mean square, total height, highest peak, deepest valley, skewness, kurtosis";
    rows.into_iter().fold(Table::new(caption, heads), |table, (name, p)| {
        let numbers =
            [p.mean_deviation, p.rms, p.total_height, p.peak, p.valley, p.skewness, p.kurtosis];
        let mut row: Vec<Cell> = vec![name.into()];
        row.extend(numbers.map(Cell::from));
        table.row(row)
    })
}

fn segment_part(page: Page, measured: &Measured, segments: &Segments) -> Page {
    let (length_mm, count) = (segments.length_mm, segments.each.len());
    if count == 0 {
        return page
            .text(&format!("The evaluated length is shorter than a segment of {length_mm} mm."));
    }
    let page = if count > ROWS_MAX {
        page.figure(
            &format!("Segments of {length_mm} mm: root mean square of each."),
            &over_segments(measured, segments).render(),
        )
    } else {
        page
    };
    page.table(&segment_table(measured, segments))
}

fn over_segments(measured: &Measured, segments: &Segments) -> Plot {
    let place = |k: usize| measured.start_mm() + (k as f64 + 0.5) * segments.length_mm;
    let line = |value: fn(&Measured, usize, &Segments) -> f64| {
        (0..segments.each.len()).map(move |k| (place(k), value(measured, k, segments)))
    };
    Plot::new("Segments", Axis::new("Place", "mm"), Axis::new("Root mean square", "µm"))
        .series(Series::line("Wq", line(|_, k, s| s.each[k].0.rms)))
        .series(Series::line("Rq", line(|_, k, s| s.each[k].1.rms)))
        .height(220.0)
}

fn segment_table(measured: &Measured, segments: &Segments) -> Table {
    let heads = ["Segment", "Wt (µm)", "Wq (µm)", "Rt (µm)", "Rq (µm)", "Ra (µm)"];
    let values: [fn(&(_, _)) -> f64; 5] = super::told::OF_SEGMENT;
    let row = |name: String, numbers: [f64; 5]| {
        let mut row: Vec<Cell> = vec![name.into()];
        row.extend(numbers.map(Cell::from));
        row
    };
    let caption = format!("Segments of {} mm", segments.length_mm);
    let mut table = Table::new(caption, heads);
    if segments.each.len() <= ROWS_MAX {
        for (k, each) in segments.each.iter().enumerate() {
            let from = measured.start_mm() + k as f64 * segments.length_mm;
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
