//! The page of `trued calibrate`: the proof, what was found of each joint, and what remains open.

use diagnosis::proof::Errors;
use report::{Axis, Cell, Column, Histogram, Number, Page, Table, Tone, significant};

use super::Calibrate;
use super::alone::Alone;
use super::found::{Approached, Found, MODELS, OfRecording};
use super::numbers::Entry;
use super::things::{lines, things};
use super::told::{mm, moves_in, words};
use crate::input::count;
use crate::output::made_by;

/// Outliers in the table.
const OUTLIERS: usize = 50;

/// The whole page.
pub(super) fn render(command: &Calibrate, found: &Found, alone: &Alone) -> String {
    let [nominal, calibrated, advanced] = found.errors.each_ref().map(|e| mm(e.mean()));
    let names: Vec<&str> =
        (0..found.campaign.recordings.len()).map(|place| found.recording(place)).collect();
    let lead = format!(
        "On poses that no fit has seen the tool is {} mm from where the advanced model puts it, in the mean; {} mm with calibrated geometry alone, {} mm \
         with the model as it was.",
        significant(advanced, 2),
        significant(calibrated, 2),
        significant(nominal, 2)
    );
    let mut page = Page::new(format!("Calibration of {}", found.base.file.name))
        .kicker(format!("trued calibrate, {}", names.join(", ")))
        .lead(&lead)
        .numbers(numbers(found));
    page = notes(page, found).section("The proof").table(&errors(found)).figure(
        "Distances of measured points from where each model sees them, on held-out poses.",
        &histogram(found),
    );
    if found.of_recordings.len() > 1 {
        page = page.table(&of_recordings(found));
    }
    if !found.stationed.is_empty() {
        page = page.table(&stations(found));
    }
    if !found.approached.is_empty() {
        page = page.table(&approach(&found.approached));
    }
    page = page
        .section("What was found")
        .table(&parameters(found))
        .text("± is the standard uncertainty; `–` where the data tell nothing and the number stayed where it was. `Moves the tool` is the root mean square over the measured poses, each effect against the same model without it.");
    let around = lines(&things(&found.last));
    if !around.is_empty() {
        page = page.text("Around the robot, in its base frame, as found:").list(&around);
    }
    let nests = found.nests();
    if !nests.is_empty() {
        page = page.list(&nests);
    }
    let by_themselves = alone.lines();
    if !by_themselves.is_empty() {
        page = page
            .section("Joints and loads by themselves")
            .text("From the runs in which one joint moves alone, and from poses measured with and without a load: what the fit of everything can be held against.")
            .list(&by_themselves);
    }
    page = open(page, found);
    let seed = found.seed.map_or("none: the recordings say".to_owned(), |seed| seed.to_string());
    page.section("Made from")
        .facts([
            ("Recordings", names.join(", ")),
            ("Split", found.split.says.clone()),
            ("Seed", seed),
            (
                "Model written",
                format!("{}, fitted to {}", command.written(found), count(found.poses, "pose")),
            ),
        ])
        .footer(made_by("calibrate"))
        .render()
}

/// What speaks against the model, and what is to be looked at.
fn notes(mut page: Page, found: &Found) -> Page {
    for reason in &found.refused {
        page = page.note(Tone::Bad, "Not proven", reason);
    }
    if let Some((first, others)) = found.warnings.split_first() {
        page = page.note(Tone::Caution, "To be looked at", first);
        if !others.is_empty() {
            page = page.list(others);
        }
    }
    page
}

fn numbers(found: &Found) -> Vec<Number> {
    let gained = found.errors[2].mean() < found.errors[0].mean();
    let of = |k: usize| {
        let errors = &found.errors[k];
        let note = format!("95 % within {} mm", significant(mm(errors.quantile(0.95)), 2));
        Number::new(format!("Mean error, {}", MODELS[k]), mm(errors.mean()), "mm").note(note)
    };
    let tone = if gained { Tone::Good } else { Tone::Bad };
    let effects = found.entries.iter().filter(|entry| !entry.is_empty()).count();
    vec![of(0), of(1), of(2).tone(tone), Number::text("Effects in the model", effects.to_string())]
}

fn errors(found: &Found) -> Table {
    let heads = ["Model", "Mean (mm)", "Median (mm)", "95 % (mm)", "Largest (mm)", "Points"];
    // The smallest of three models is what counts: a digit more for it.
    let heads = heads.map(|head| Column::new(head).digits(4));
    let table = Table::new("Errors on held-out poses", heads);
    MODELS.iter().zip(&found.errors).fold(table, |table, (name, errors)| {
        let points = Cell::from(errors.sorted_m.len() as f64);
        table.row(std::iter::once(Cell::from(*name)).chain(four(errors)).chain([points]))
    })
}

fn histogram(found: &Found) -> report::Svg {
    let plot = Histogram::new("Held-out errors", Axis::new("Error", "mm").log());
    MODELS
        .iter()
        .zip(&found.errors)
        .fold(plot, |plot, (name, errors)| {
            plot.values(*name, errors.sorted_m.iter().map(|error| mm(*error)))
        })
        .render()
}

/// Mean, median, 95 % and largest, mm.
fn four(errors: &Errors) -> [Cell; 4] {
    [errors.mean(), errors.quantile(0.5), errors.quantile(0.95), errors.max()]
        .map(|error| Cell::from(mm(error)))
}

fn of_recordings(found: &Found) -> Table {
    let heads =
        ["Recording", "Poses", "Model", "Mean (mm)", "Median (mm)", "95 % (mm)", "Largest (mm)"];
    let table = Table::new("Errors on held-out poses, by recording", heads);
    let rows = |one: &OfRecording, table: Table| {
        MODELS.iter().zip(&one.errors).fold(table, |table, (name, errors)| {
            let head = [
                found.recording(one.recording).into(),
                moves_in(one.planar).into(),
                (*name).into(),
            ];
            table.row(head.into_iter().chain(four(errors)))
        })
    };
    found.of_recordings.iter().fold(table, |table, one| rows(one, table))
}

fn stations(found: &Found) -> Table {
    let heads = [
        "Station",
        "Recording",
        "Nominal, mean (mm)",
        "Calibrated, mean (mm)",
        "Advanced, mean (mm)",
        "Advanced, 95 % (mm)",
        "Advanced, largest (mm)",
        "Points",
    ];
    let table = Table::new("Held-out errors by station of the instrument", heads);
    found.stationed.iter().fold(table, |table, one| {
        let [nominal, calibrated, advanced] = &one.errors;
        let means = [nominal, calibrated, advanced].map(Errors::mean);
        let cells = means.into_iter().chain([advanced.quantile(0.95), advanced.max()]);
        let named =
            [Cell::from((one.frame + 1).to_string()), found.recording(one.recording).into()];
        let points = Cell::from(advanced.sorted_m.len() as f64);
        table.row(named.into_iter().chain(cells.map(|error| Cell::from(mm(error)))).chain([points]))
    })
}

fn approach(approached: &[Approached]) -> Table {
    let heads =
        ["Joint", "Arrived", "Model", "Mean (mm)", "Median (mm)", "95 % (mm)", "Largest (mm)"];
    let mut table = Table::new("Held-out errors by the direction in which a joint arrived", heads);
    for one in approached {
        for (side, way) in ["rising", "falling"].into_iter().enumerate() {
            for (name, errors) in MODELS.iter().zip(&one.errors) {
                let head = [(one.joint + 1).to_string().into(), way.into(), (*name).into()];
                table = table.row(head.into_iter().chain(four(&errors[side])));
            }
        }
    }
    table
}

fn parameters(found: &Found) -> Table {
    let heads = [
        Column::new("Joint"),
        Column::new("Effect"),
        Column::new("Parameter"),
        Column::new("Value"),
        Column::new("±"),
        Column::new("Moves the tool (mm)"),
    ];
    let mut table = Table::new("Parameters, in the units of the model file", heads);
    let mut entries: Vec<&Entry> = found.entries.iter().collect();
    entries.sort_by(|a, b| {
        (a.joint(), b.share_m)
            .partial_cmp(&(b.joint(), a.share_m))
            .unwrap_or(std::cmp::Ordering::Equal)
    });
    for entry in entries {
        for number in &entry.numbers {
            let joint = entry.joint().map_or("robot".to_owned(), |joint| joint.to_string());
            let index = number.index.map(|index| format!(" {index}")).unwrap_or_default();
            let sigma = number.sigma.map_or("–".to_owned(), |sigma| significant(sigma, 2));
            table = table.row([
                joint.into(),
                words(entry.kind()).into(),
                format!("{}{index}", number.key).into(),
                significant(number.value, 4).into(),
                sigma.into(),
                mm(entry.share_m).into(),
            ]);
        }
    }
    table
}

fn open(mut page: Page, found: &Found) -> Page {
    let undetermined = found.undetermined();
    if !undetermined.is_empty() {
        page = page
            .section("What these data cannot tell")
            .text("These numbers cannot be told one by one: of all that explain the readings alike, the model holds the smallest. Other poses, a known measuring frame or known places of the reflectors may tell them. In short:")
            .list(found.left_open())
            .text("Number by number:")
            .list(undetermined);
    }
    if !found.outliers.is_empty() {
        let heads = ["Recording", "Row", "Off (mm)"];
        let words = format!("{} weigh less than half", count(found.outliers.len(), "pose"));
        let outliers = found.outliers.iter().take(OUTLIERS);
        let table = outliers.fold(Table::new(words, heads), |table, outlier| {
            table.row([
                found.recording(outlier.recording).into(),
                (outlier.row as f64).into(),
                mm(outlier.off_m).into(),
            ])
        });
        page = page.section("Outliers").table(&table);
    }
    page
}
