//! Recordings as texts: added columns, removed rows. Existing values are copied as text.

/// A table of comma-separated texts with a header.
#[derive(Clone)]
pub(super) struct CsvTable {
    head: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl CsvTable {
    pub(super) fn read(text: &str) -> Self {
        let cells = |line: &str| line.split(',').map(|cell| cell.trim().to_owned()).collect();
        let mut lines =
            text.lines().filter(|line| !line.trim().is_empty() && !line.starts_with('#'));
        let head: Vec<String> = lines.next().map(cells).unwrap_or_default();
        let rows = lines.map(cells).filter(|row: &Vec<String>| row.len() == head.len()).collect();
        Self { head, rows }
    }

    pub(super) fn len(&self) -> usize {
        self.rows.len()
    }

    /// A column as numbers; NaN for missing ones.
    pub(super) fn numbers(&self, name: &str) -> Vec<f64> {
        let column = self.head.iter().position(|head| head == name);
        let number = |row: &Vec<String>| {
            column.and_then(|column| row.get(column)?.parse().ok()).unwrap_or(f64::NAN)
        };
        self.rows.iter().map(number).collect()
    }

    /// A column of texts.
    pub(super) fn texts(&self, name: &str) -> Vec<String> {
        let column = self.head.iter().position(|head| head == name);
        let text = |row: &Vec<String>| {
            column.and_then(|column| row.get(column).cloned()).unwrap_or_default()
        };
        self.rows.iter().map(text).collect()
    }

    /// The rows for which `kept` is true.
    pub(super) fn filter_rows(&self, kept: impl Fn(usize) -> bool) -> Self {
        let rows = self.rows.iter().enumerate().filter(|(k, _)| kept(*k));
        Self { head: self.head.clone(), rows: rows.map(|(_, row)| row.clone()).collect() }
    }

    /// The column `name`, replacing an existing one.
    pub(super) fn with_column(mut self, name: &str, value: impl Fn(usize) -> String) -> Self {
        let column = self.head.iter().position(|head| head == name).unwrap_or_else(|| {
            self.head.push(name.to_owned());
            self.head.len() - 1
        });
        for (k, row) in self.rows.iter_mut().enumerate() {
            row.resize(self.head.len(), String::new());
            row[column] = value(k);
        }
        self
    }

    /// The same rows with the cells of `columns` emptied in the rows `gone`.
    pub(super) fn clear_cells(&self, columns: &[&String], cleared: &[bool]) -> Self {
        let mut sheet = self.clone();
        let places: Vec<usize> =
            (0..self.head.len()).filter(|k| columns.contains(&&self.head[*k])).collect();
        for (row, _) in sheet.rows.iter_mut().zip(cleared).filter(|(_, cleared)| **cleared) {
            places.iter().for_each(|k| row[*k].clear());
        }
        sheet
    }

    pub(super) fn text(&self) -> String {
        let lines = std::iter::once(&self.head).chain(&self.rows);
        lines.flat_map(|row| [row.join(","), "\n".to_owned()]).collect()
    }
}

/// A mapping with an additional line in `[recording]`.
pub(super) fn with_recording_line(mapping: &str, line: &str) -> String {
    match mapping.contains("\n[recording]\n") {
        true => mapping.replacen("\n[recording]\n", &format!("\n[recording]\n{line}\n"), 1),
        false => format!("{mapping}\n[recording]\n{line}\n"),
    }
}

/// A half of `count`, drawn by `seed` (a linear congruential generator sorts the rows); the same everywhere.
pub(super) fn random_half(count: usize, seed: u64) -> Vec<bool> {
    let mut state = seed;
    let mut drawn: Vec<(u64, usize)> = (0..count)
        .map(|k| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 20, k)
        })
        .collect();
    drawn.sort_unstable();
    let mut half = vec![false; count];
    drawn.iter().take(count / 2).for_each(|(_, k)| half[*k] = true);
    half
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_is_added_and_the_rest_stays_as_it_was_written() {
        let sheet = CsvTable::read("a,b\n1.50,x\n2.0,y\n").with_column("half", |k| k.to_string());
        assert_eq!(sheet.text(), "a,b,half\n1.50,x,0\n2.0,y,1\n");
        assert_eq!(sheet.numbers("a"), [1.5, 2.0]);
    }

    #[test]
    fn a_random_half_is_half_and_follows_its_seed() {
        let one = random_half(100, 1);
        assert_eq!(one.iter().filter(|is_chosen| **is_chosen).count(), 50);
        assert_eq!(one, random_half(100, 1));
        assert_ne!(one, random_half(100, 2));
    }

    #[test]
    fn readings_go_and_the_rest_of_a_row_stays() {
        let sheet = CsvTable::read("q,x\n1.0,5\n2.0,6\n");
        let column = "x".to_owned();
        assert_eq!(sheet.clear_cells(&[&column], &[false, true]).text(), "q,x\n1.0,5\n2.0,\n");
    }

    #[test]
    fn what_a_mapping_says_of_the_recording_stays() {
        let text =
            with_recording_line("[columns]\n\n[recording]\nkind = \"poses\"\n", "heldout = [1]");
        assert!(text.contains("heldout = [1]\nkind = \"poses\""), "{text}");
        let text = with_recording_line("[columns]\n", "heldout = [1]");
        assert!(text.ends_with("[recording]\nheldout = [1]\n"), "{text}");
    }
}
