//! A fleet as a table of at most 80 columns.

use crate::fleet::{Fleet, Row};

const COLUMNS: usize = 80;

/// The table. A cell has one line, and one more for what is wrong with it.
#[must_use]
pub fn text(fleet: &Fleet) -> String {
    let heads = ["CELL", "STATE", "MODE", "VERSION", "MODEL", "AGE", "LARGEST", "HEARD"];
    let mut lines = vec![line(&heads.map(str::to_owned))];
    for row in &fleet.cells {
        lines.push(line(&cells(row)));
        let mut wrong = row.alarms.join(", ");
        if let Some(away) = &row.away {
            wrong = format!("{wrong}: {away}");
        } else if !wrong.is_empty() && !row.message.is_empty() {
            wrong = format!("{wrong}: {}", row.message);
        }
        lines.extend(wrapped(&wrong));
    }
    for missing in &fleet.missing {
        lines.push(line(&[missing.clone(), "MISSING".to_owned()]));
        lines.extend(wrapped("its bridge does not answer"));
    }
    for why in &fleet.unreadable {
        lines.extend(wrapped(&format!("cannot be read: {why}")));
    }
    lines.join("\n") + "\n"
}

fn cells(row: &Row) -> [String; 8] {
    let or_none = |text: Option<&str>| text.unwrap_or("-").to_owned();
    let state = if row.away.is_some() { Some("AWAY") } else { row.health.as_deref() };
    let mode = if row.bypassed { Some("bypassed") } else { row.mode.as_deref() };
    let share = row.correction_largest_share;
    [
        format!("{}/{}", row.group, row.cell),
        or_none(state),
        or_none(mode),
        or_none(row.daemon_version.as_deref()),
        or_none(row.model_hash.as_deref().and_then(|hash| hash.get(..8))),
        row.model_age_s.map_or("-".to_owned(), duration),
        if share.is_finite() { format!("{:.1} %", 1e2 * share) } else { "-".to_owned() },
        row.heard_s.map_or("-".to_owned(), duration),
    ]
}

/// Columns of fixed width; what is too long is cut.
fn line(cells: &[String]) -> String {
    const WIDTHS: [usize; 8] = [21, 9, 9, 8, 8, 6, 7, 5];
    let cut = |(cell, width): (&String, usize)| {
        let cell: String = cell.chars().take(width).collect();
        format!("{cell:width$}")
    };
    cells.iter().zip(WIDTHS).map(cut).collect::<Vec<_>>().join(" ").trim_end().to_owned()
}

/// Words in lines that are set in.
fn wrapped(text: &str) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        let length = word.chars().count();
        match lines.last_mut().filter(|last| last.chars().count() + 1 + length <= COLUMNS) {
            Some(last) => {
                last.push(' ');
                last.push_str(word);
            }
            None => {
                lines.push(format!("    {}", word.chars().take(COLUMNS - 4).collect::<String>()));
            }
        }
    }
    lines
}

/// A time of at most four characters.
fn duration(seconds: f64) -> String {
    let whole = seconds.max(0.0).round() as u64;
    match whole {
        0..100 => format!("{whole}s"),
        100..6000 => format!("{}m", whole / 60),
        6000..360_000 => format!("{}h", whole / 3600),
        _ => format!("{}d", whole / 86_400),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row() -> Row {
        Row {
            group: "a-line-with-a-long-name".to_owned(),
            cell: "cell-4".to_owned(),
            health: Some("degraded".to_owned()),
            mode: Some("full".to_owned()),
            bypassed: false,
            away: None,
            message: "the force stream is silent since 12:03; ".repeat(5),
            alarms: vec!["degraded".to_owned(), "force_fault".to_owned()],
            daemon_version: Some("0.2.0".to_owned()),
            bridge_version: "0.2.0".to_owned(),
            robot: "KUKA".to_owned(),
            model_hash: Some("0123456789abcdef".to_owned()),
            model_age_s: Some(1e6),
            correction_rms: 1e-3,
            correction_largest_share: 0.341,
            residual_mm: None,
            heard_s: Some(0.04),
        }
    }

    #[test]
    fn the_table_has_80_columns_and_says_what_is_wrong() {
        let away = Row { away: Some("no daemon is there now".to_owned()), ..row() };
        let missing = vec!["line-1/cell-9".to_owned()];
        let fleet = Fleet { schema: "", cells: vec![row(), away], missing, unreadable: Vec::new() };
        let text = text(&fleet);
        assert!(text.lines().all(|line| line.chars().count() <= COLUMNS), "{text}");
        for part in ["degraded, force_fault: the force", "34.1 %", "11d", "AWAY", "MISSING"] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
}
