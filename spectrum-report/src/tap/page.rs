//! The page of an impact test: modes, their three signs, and the hits used.

use report::{
    Axis, Cell, Column, Multiples, Number, Page, Plot, Series, Table, Tone, fixed, pluralise,
    significant,
};
use spectrum::frf::Response;
use spectrum::modal::MergedMode;

use super::analysis::{Analysis, Function, Test};
use super::model_file::UpdatedModel;
use super::text::{decimals, decimals_of_damping, verdict};

/// Modes named in the verdict.
const NAMED: usize = 3;
/// Hits drawn over each other.
const HITS_MAX: usize = 8;
/// A response below this part of its largest is not seen in a drawing.
const SEEN: f64 = 0.01;
/// Response functions drawn over each other, and each by itself.
const FUNCTIONS_MAX: usize = 8;

impl Analysis {
    /// The page. `renewed`: the model with the modes, if requested.
    #[must_use]
    pub fn page(&self, renewed: Option<&UpdatedModel>) -> Page {
        render(self, renewed)
    }
}

/// The whole page.
fn render(analysis: &Analysis, renewed: Option<&UpdatedModel>) -> Page {
    let [low, high] = analysis.band_hz.map(|hz| significant(hz, 3));
    let found = pluralise(analysis.modes.len(), "mode");
    let rests = match &analysis.test {
        Some(test) => {
            format!("{} of {} found", pluralise(test.tap.frf.hits, "hit"), test.tap.hits.len())
        }
        None => pluralise(analysis.functions.len(), "response function"),
    };
    let verified = analysis.modes.iter().filter(|mode| analysis.is_verified(mode)).count();
    let all = analysis.modes.len();
    let (tone, label) = match (all, verified) {
        (0, _) => (Tone::Caution, "no mode found".to_owned()),
        (all, verified) if all == verified => {
            (Tone::Good, format!("{found}, verified by coherence"))
        }
        (_, 0) => (Tone::Caution, format!("{found}, not verified")),
        (_, verified) => (Tone::Caution, format!("{found}, {verified} of them verified")),
    };
    let mut page = Page::new("Natural frequencies by impact test")
        .kicker(format!("trued tap, {}", analysis.files.join(", ")))
        .verdict(
            tone,
            &label,
            &sentence(analysis, &format!("between {low} and {high} Hz, from {rests}")),
        )
        .numbers(numbers(analysis));
    page = picture(page, analysis);
    page = next(page, analysis, renewed, verified);
    if let Some((first, others)) = analysis.warnings.split_first() {
        page = page.note(Tone::Caution, "Warnings", first);
        if !others.is_empty() {
            page = page.list(others);
        }
    }
    if !analysis.modes.is_empty() {
        page = page.section("Modes").table(&modes(analysis)).text(
            "Frequency and damping are fitted as complex poles; ± is the standard uncertainty from noise and misfit, and from \
             the variation of the result with the band of the fit. The half-power width is given as a check. Mass \
             and stiffness are modal; they are those of the structure if it was struck and measured at the same point \
             in the same direction.",
        );
    }
    page = functions(page, analysis);
    if let Some(test) = &analysis.test {
        page = hits(page, test);
    }
    if let Some(renewed) = renewed {
        page = page.section("Model").text(&format!(
            "{}: {}.",
            renewed.path.display(),
            renewed.line(analysis)
        ));
    }
    page
}

/// Magnitude, phase and coherence of the response functions.
fn picture(page: Page, analysis: &Analysis) -> Page {
    let Some(first) = analysis.functions.first() else { return page };
    let shown = analysis.functions.len().min(FUNCTIONS_MAX);
    let below = if first.frf.coherence.is_some() {
        "its phase and the coherence with its bound (dotted)"
    } else {
        "its phase"
    };
    page.figure(
        &format!(
            "Magnitude of the {}, with the natural frequencies; below, {below}.",
            first.kind().0
        ),
        &response(analysis, shown).render(),
    )
}

fn sentence(analysis: &Analysis, how: &str) -> String {
    let frequencies: Vec<String> = analysis
        .modes
        .iter()
        .map(|mode| {
            let digits = decimals(mode.frequency_sigma_hz);
            format!(
                "{} Hz ({} % damping)",
                fixed(mode.frequency_hz, digits),
                fixed(100.0 * mode.damping, decimals_of_damping(mode))
            )
        })
        .take(NAMED)
        .collect();
    match analysis.modes.len() {
        0 => format!("No natural frequency {how}."),
        all if all > NAMED => {
            format!("{} and {} more, {how}.", frequencies.join(", "), all - NAMED)
        }
        _ => format!("{}, {how}.", frequencies.join(", ")),
    }
}

/// Hits of a test whose coherence means something, with some to spare.
const HITS_WANTED: usize = 5;

/// How the test is repeated so that the modes can be verified: the tip follows from where the force is weak.
fn repetition(analysis: &Analysis) -> String {
    let highest_hz = analysis.modes.iter().map(|mode| mode.frequency_hz).fold(0.0, f64::max);
    let excited_hz = analysis.test.as_ref().map(|test| test.tap.excited_to_hz(20.0));
    let tip = match excited_hz.filter(|excited_hz| *excited_hz < highest_hz) {
        Some(excited_hz) => format!(
            ", and with a harder tip: above {} Hz the force is more than 20 dB below its maximum",
            significant(excited_hz, 3)
        ),
        None => ", with the same tip: the force excites these frequencies".to_owned(),
    };
    format!("Repeat with {HITS_WANTED} or more hits{tip}.")
}

fn next(page: Page, analysis: &Analysis, renewed: Option<&UpdatedModel>, verified: usize) -> Page {
    if verified == 0 {
        return page.next(&repetition(analysis), None);
    }
    match renewed {
        Some(renewed) => page.next(
            "Use the model with these modes.",
            Some(&format!(
                "trued check {}",
                report::shell_word(&renewed.path.display().to_string())
            )),
        ),
        None => page.next(
            "Write these modes into the robot model for the daemon.",
            Some("trued tap --model ROBOT.toml --out ROBOT-modes.toml FILES"),
        ),
    }
}

fn numbers(analysis: &Analysis) -> Vec<Number> {
    let verified = analysis.modes.iter().filter(|mode| analysis.is_verified(mode)).count();
    let all = analysis.modes.len();
    let tone = if verified == all && all > 0 { Tone::Good } else { Tone::Caution };
    let mut numbers = vec![
        Number::text("Modes", all.to_string())
            .note(format!("{verified} verified by coherence"))
            .tone(tone),
    ];
    if let Some(test) = &analysis.test {
        let (found, used) = (test.tap.hits.len(), test.tap.frf.hits);
        let tone = if used < 3 { Tone::Caution } else { Tone::Plain };
        numbers.push(
            Number::text("Hits used", used.to_string())
                .note(format!("of {found} found"))
                .tone(tone),
        );
        numbers.push(Number::new("Record per hit", test.tap.block_s, "s"));
        numbers.push(
            Number::new("Excited up to", test.tap.excited_to_hz(20.0), "Hz")
                .note("force within 20 dB"),
        );
    }
    numbers
}

fn modes(analysis: &Analysis) -> Table {
    let several = analysis.functions.len() > 1;
    let heads = [
        "Frequency (Hz)",
        "Damping (%)",
        "Half power (%)",
        "Stiffness (N/µm)",
        "Mass (kg)",
        "Phase (°)",
        if several { "Found in" } else { "Coherence" },
        "",
    ];
    let table = Table::new("Natural frequencies, lowest first", heads);
    analysis.modes.iter().fold(table, |table, mode| {
        let clearest = analysis.most_accurate(mode);
        let of = |value: &dyn Fn(&spectrum::modal::FittedMode) -> Option<f64>| {
            Cell::from(clearest.and_then(value).unwrap_or(f64::NAN))
        };
        let with_sigma = |value: f64, sigma: f64| {
            let decimals = decimals(sigma);
            // Held together by spaces that do not break.
            let (value, sigma) = (fixed(value, decimals), fixed(sigma, decimals));
            Cell::from(format!("{value}\u{a0}±\u{a0}{sigma}"))
        };
        table.row([
            with_sigma(mode.frequency_hz, mode.frequency_sigma_hz),
            with_sigma(100.0 * mode.damping, 100.0 * mode.damping_sigma),
            of(&|one| one.damping_half_power.map(|damping| 100.0 * damping)),
            of(&|one| Some(1e-6 * one.stiffness_n_per_m())),
            of(&|one| Some(one.mass_kg)),
            of(&|one| Some(one.phase_rad.to_degrees().round())),
            if several {
                format!("{} of {}", mode.observations.len(), analysis.functions.len()).into()
            } else {
                of(&|one| one.coherence)
            },
            verdict(analysis, mode).into(),
        ])
    })
}

fn functions(page: Page, analysis: &Analysis) -> Page {
    let mut page = page.section("Response function");
    let shown = analysis.functions.len().min(FUNCTIONS_MAX);
    if shown < analysis.functions.len() {
        page = page.text(&format!("The first {shown} of {} are shown.", analysis.functions.len()));
    }
    page = page.figure(
        "Mode indicators: at a natural frequency, the real part changes sign, the imaginary part peaks, and the coherence is \
         above its bound (dotted).",
        &signs(analysis, shown).render(),
    );
    page
}

/// Magnitude, phase and coherence under each other, over one axis.
fn response(analysis: &Analysis, shown: usize) -> Multiples {
    let all = Multiples::new("Response function", 1)
        .own_y()
        .plot(sizes(analysis, shown))
        .plot(phases(analysis, shown));
    match coherence(analysis, shown) {
        Some(coherence) => all.plot(coherence),
        None => all,
    }
}

fn marked(plot: Plot, analysis: &Analysis, labelled: bool) -> Plot {
    let label = |mode: &MergedMode| {
        if labelled { format!("{} Hz", significant(mode.frequency_hz, 3)) } else { String::new() }
    };
    analysis.modes.iter().fold(plot, |plot, mode| plot.mark_x(mode.frequency_hz, label(mode)))
}

fn frequency(analysis: &Analysis) -> Axis {
    Axis::new("Frequency", "Hz").range(analysis.band_hz[0], analysis.band_hz[1])
}

/// One line for each function; a single one needs no name.
fn each(
    plot: Plot,
    analysis: &Analysis,
    shown: usize,
    value: impl Fn(&Function) -> Vec<(f64, f64)>,
) -> Plot {
    analysis.functions.iter().take(shown).fold(plot, |plot, one| {
        let name = if analysis.functions.len() > 1 { one.name.as_str() } else { "" };
        plot.series(Series::line(name, value(one)))
    })
}

fn sizes(analysis: &Analysis, shown: usize) -> Plot {
    let (name, unit) = analysis.functions.first().map_or(("", ""), Function::kind);
    let plot = Plot::new("Magnitude", frequency(analysis), Axis::new(name, unit).log());
    let size =
        |one: &Function| one.within(analysis.band_hz).map(|(_, f, h)| (f, h.norm())).collect();
    marked(each(plot, analysis, shown, size), analysis, true)
}

fn phases(analysis: &Analysis, shown: usize) -> Plot {
    let plot =
        Plot::new("Phase", frequency(analysis), Axis::new("Phase", "°").range(-180.0, 180.0));
    // A phase beyond 180° continues at the other end.
    let phase = |one: &Function| {
        let points = one.within(analysis.band_hz).map(|(_, f, h)| (f, h.arg().to_degrees()));
        let mut before = None;
        let mut line = Vec::new();
        for (f, degrees) in points {
            if before.is_some_and(|before: f64| (degrees - before).abs() > 180.0) {
                line.push((f, f64::NAN));
            }
            before = Some(degrees);
            line.push((f, degrees));
        }
        line
    };
    marked(each(plot, analysis, shown, phase), analysis, false)
}

fn signs(analysis: &Analysis, shown: usize) -> Multiples {
    // The signs are those of a displacement or an acceleration; a speed's parts change their roles.
    let part = |one: &Function, part: fn(spectrum::Complex<f64>) -> f64| {
        let wanted = match one.frf.response {
            Response::Acceleration => Response::Acceleration,
            _ => Response::Displacement,
        };
        let h = one.frf.per_force(one.estimator, wanted);
        let inside = one.within(analysis.band_hz);
        inside.filter_map(|(i, f, _)| Some((f, part(*h.get(i)?)))).collect::<Vec<_>>()
    };
    let is_acceleration =
        analysis.functions.iter().any(|one| one.frf.response == Response::Acceleration);
    let (name, unit) =
        if is_acceleration { ("accelerance", "m/s²N") } else { ("receptance", "m/N") };
    let plot = |title: &str| {
        Plot::new(format!("{title} of the {name}"), frequency(analysis), Axis::new(title, unit))
    };
    let real = each(plot("Real part"), analysis, shown, |one| part(one, |h| h.re));
    let imaginary = each(plot("Imaginary part"), analysis, shown, |one| part(one, |h| h.im));
    let signs = Multiples::new("Mode indicators", 1)
        .own_y()
        .plot(marked(real.mark_y(0.0, ""), analysis, true))
        .plot(marked(imaginary, analysis, false));
    match coherence(analysis, shown) {
        Some(coherence) => signs.plot(coherence),
        None => signs,
    }
}

/// The coherence of each function with its limit; `None` if unknown.
fn coherence(analysis: &Analysis, shown: usize) -> Option<Plot> {
    let coherences =
        analysis.functions.iter().filter_map(|one| Some((one, one.frf.coherence.as_ref()?)));
    let coherence =
        Plot::new("Coherence", frequency(analysis), Axis::new("Coherence", "").range(0.0, 1.02));
    let mut any = false;
    let coherence = coherences.take(shown).fold(coherence, |plot, (one, coherence)| {
        any = true;
        let inside = one.within(analysis.band_hz);
        let points = inside.filter_map(|(i, f, _)| Some((f, *coherence.get(i)?)));
        plot.series(Series::line("", points.collect::<Vec<_>>()))
    });
    let coherence_min = analysis.settings.coherence_least;
    any.then(|| {
        marked(coherence.mark_y(coherence_min, significant(coherence_min, 2)), analysis, false)
    })
}

fn hits(page: Page, test: &Test) -> Page {
    let windows = match (test.tap.windows.force, test.tap.windows.decay_per_s) {
        (false, _) => "as recorded, without windows".to_owned(),
        (true, 0.0) => "force set to zero outside the contact".to_owned(),
        (true, decay) => format!(
            "force set to zero outside the contact, both under an exponential window of {} 1/s",
            significant(decay, 2)
        ),
    };
    page.section("Hits")
        .table(&hit_table(test))
        .figure("Force of each hit around its contact.", &forces(test).render())
        .figure(&format!("Response of each hit, {windows}."), &responses(test).render())
        .figure(
            "Force spectrum, RMS over the hits: results are uncertain where it is weak.",
            &force_spectrum(test).render(),
        )
}

fn hit_table(test: &Test) -> Table {
    let heads = ["File", "Time (s)", "Peak (N)", "Contact (ms)", ""].map(Column::new);
    test.tap.hits.iter().fold(Table::new("Hits found, in order", heads), |table, hit| {
        let (file, t_s) = test.hit_location(hit);
        let why = hit.rejection.map_or_else(|| "used".to_owned(), |why| format!("rejected: {why}"));
        table.row([
            file.into(),
            Cell::from(fixed(t_s, 3)),
            hit.peak_n.into(),
            (1e3 * hit.contact_s).into(),
            why.into(),
        ])
    })
}

fn forces(test: &Test) -> Plot {
    let used = || test.tap.hits.iter().filter(|hit| hit.rejection.is_none());
    let longest_s = used().map(|hit| hit.contact_s).fold(0.0, f64::max);
    // The contact begins two of its lengths after the block, where the record has them.
    let until = (6.0 * longest_s * test.hits.rate_hz) as usize;
    let axis = Axis::new("Time from the record's start", "ms");
    let plot = Plot::new("Force", axis, Axis::new("Force", "N")).height(220.0);
    test.tap.blocks.iter().take(HITS_MAX).enumerate().fold(plot, |plot, (k, (force, _))| {
        let ms = 1e3 / test.hits.rate_hz;
        let points = force.iter().take(until.max(32)).enumerate();
        plot.series(Series::line(
            hit_name(test, k),
            points.map(|(i, f)| (i as f64 * ms, *f)).collect::<Vec<_>>(),
        ))
    })
}

fn hit_name(test: &Test, k: usize) -> String {
    if test.tap.blocks.len() > 1 { format!("hit {}", k + 1) } else { String::new() }
}

fn responses(test: &Test) -> Plot {
    let (name, unit) = match test.hits.response {
        Response::Displacement => ("Displacement", "m"),
        Response::Velocity => ("Speed", "m/s"),
        Response::Acceleration => ("Acceleration", "m/s²"),
    };
    let until = rung_down(test);
    let plot = Plot::new(name, Axis::new("Time", "s"), Axis::new(name, unit)).height(220.0);
    test.tap.blocks.iter().take(HITS_MAX).enumerate().fold(plot, |plot, (k, (_, response))| {
        let points = response.iter().take(until).enumerate();
        let points = points.map(|(i, x)| (i as f64 / test.hits.rate_hz, *x));
        plot.series(Series::line(hit_name(test, k), points.collect::<Vec<_>>()))
    })
}

/// Number of samples after which nothing of a response is visible in a drawing.
fn rung_down(test: &Test) -> usize {
    let last = |response: &Vec<f64>| {
        let largest = response.iter().fold(0.0_f64, |top, x| top.max(x.abs()));
        response.iter().rposition(|x| x.abs() > SEEN * largest).map_or(0, |index| index + index / 3)
    };
    let longest = test.tap.blocks.iter().map(|(_, response)| last(response)).max();
    longest.unwrap_or(0).max(64)
}

fn force_spectrum(test: &Test) -> Plot {
    let points =
        test.tap.frf.frequency_hz.iter().copied().zip(test.tap.force_spectrum.iter().copied());
    let to_hz = 1.2 * test.tap.excited_to_hz(40.0);
    let points: Vec<_> = points.filter(|(f, _)| *f <= to_hz).collect();
    Plot::new("Force over frequency", Axis::new("Frequency", "Hz"), Axis::new("Force", "Ns").log())
        .series(Series::line("", points))
        .mark_x(test.tap.excited_to_hz(20.0), "−20 dB")
        .height(200.0)
}
