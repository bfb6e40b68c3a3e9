//! The rows of a table of text: all fields concatenated in one text. A separate record per row would take four times the memory.

/// Largest size of the text, bytes; positions in it are 32-bit numbers.
const BYTES_MAX: usize = u32::MAX as usize;

/// Rows of any number of fields each.
#[derive(Debug, Default)]
pub(super) struct Rows {
    text: String,
    /// Where each field ends in `text`.
    ends: Vec<u32>,
    rows: Vec<Row>,
}

#[derive(Debug, Clone, Copy)]
struct Row {
    /// Its first field, among all.
    first: u32,
    fields: u32,
    /// Where it begins in the source.
    byte: usize,
}

/// More text than can be stored.
#[derive(Debug, Clone, Copy)]
pub(super) struct TooLarge;

impl Rows {
    /// Adds a row that begins at `byte` of the source; blanks around fields are removed.
    pub(super) fn push<'f>(
        &mut self,
        byte: usize,
        fields: impl Iterator<Item = &'f str>,
    ) -> Result<(), TooLarge> {
        let first = self.ends.len();
        for field in fields {
            self.text.push_str(field.trim());
            self.ends.push(u32::try_from(self.text.len()).map_err(|_| TooLarge)?);
        }
        let fields = u32::try_from(self.ends.len() - first).map_err(|_| TooLarge)?;
        let first = u32::try_from(first).map_err(|_| TooLarge)?;
        self.rows.push(Row { first, fields, byte });
        Ok(())
    }

    pub(super) fn len(&self) -> usize {
        self.rows.len()
    }

    /// The content of a cell; `None` if the row is too short.
    pub(super) fn cell(&self, row: usize, column: usize) -> Option<&str> {
        let Row { first, fields, .. } = *self.rows.get(row)?;
        let cell = first as usize + column;
        let start = cell.checked_sub(1).and_then(|before| self.ends.get(before)).copied();
        let range = start.unwrap_or(0) as usize..*self.ends.get(cell)? as usize;
        self.text.get(range).filter(|_| column < fields as usize)
    }

    /// How many fields a row has.
    pub(super) fn width(&self, row: usize) -> usize {
        self.rows.get(row).map_or(0, |row| row.fields as usize)
    }

    /// Where a row begins in the source.
    pub(super) fn byte(&self, row: usize) -> usize {
        self.rows.get(row).map_or(0, |row| row.byte)
    }

    /// Keeps only the first rows.
    pub(super) fn keep_first(&mut self, rows: usize) {
        self.rows.truncate(rows);
    }

    /// Keeps only the rows that are `wanted`.
    pub(super) fn keep(&mut self, wanted: &[bool]) {
        let mut wanted = wanted.iter();
        self.rows.retain(|_| wanted.next() == Some(&true));
    }
}

/// The error for more than a table can hold.
pub(super) fn too_large() -> crate::faults::Fault {
    crate::faults::Fault::new("", "is too large")
        .expected(format!("at most {} GiB of text", BYTES_MAX.div_ceil(1 << 30)))
        .help("split the file, or convert it to Parquet")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_text_is_named_in_whole_gibibytes() {
        assert_eq!(too_large().expected, "at most 4 GiB of text");
    }
}
