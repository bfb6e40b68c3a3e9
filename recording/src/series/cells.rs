//! Table columns stored as values: from a Parquet file, or from a text read row by row.

use std::borrow::Cow;

/// A column.
pub(crate) enum Cells {
    /// NaN for an empty cell.
    Numbers(Vec<f64>),
    /// `None` for a null.
    #[cfg(feature = "parquet")]
    Whole(Vec<Option<i64>>),
    /// Empty for an empty cell.
    Texts(Texts),
}

/// Concatenated texts: separate strings would take three times the memory.
#[derive(Debug, Default)]
pub(crate) struct Texts {
    text: String,
    /// Where each ends in `text`.
    ends: Vec<usize>,
}

impl Texts {
    pub(super) fn push(&mut self, text: &str) {
        self.text.push_str(text);
        self.ends.push(self.text.len());
    }

    fn get(&self, index: usize) -> Option<&str> {
        let start = index.checked_sub(1).and_then(|before| self.ends.get(before)).copied();
        self.text.get(start.unwrap_or(0)..*self.ends.get(index)?)
    }

    fn iter(&self) -> impl Iterator<Item = &str> {
        (0..self.ends.len()).filter_map(|index| self.get(index))
    }
}

impl<'t> FromIterator<&'t str> for Texts {
    fn from_iter<I: IntoIterator<Item = &'t str>>(all: I) -> Self {
        let mut texts = Self::default();
        all.into_iter().for_each(|text| texts.push(text));
        texts
    }
}

impl Cells {
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Numbers(all) => all.len(),
            #[cfg(feature = "parquet")]
            Self::Whole(all) => all.len(),
            Self::Texts(all) => all.ends.len(),
        }
    }

    /// The number in a row: NaN if it is empty; `None` for a text.
    pub(crate) fn number(&self, row: usize) -> Option<f64> {
        match self {
            Self::Numbers(all) => Some(all.get(row).copied().unwrap_or(f64::NAN)),
            #[cfg(feature = "parquet")]
            Self::Whole(all) => {
                Some(all.get(row).copied().flatten().map_or(f64::NAN, |v| v as f64))
            }
            Self::Texts(_) => None,
        }
    }

    /// A row as text: for numbers the shortest that reads back to the same one; empty if it is
    /// empty.
    pub(crate) fn text(&self, row: usize) -> Cow<'_, str> {
        let text = match self {
            Self::Numbers(all) => {
                all.get(row).filter(|v| !v.is_nan()).map(|v| format!("{v:?}").into())
            }
            #[cfg(feature = "parquet")]
            Self::Whole(all) => all.get(row).copied().flatten().map(|v| v.to_string().into()),
            Self::Texts(all) => all.get(row).map(Cow::Borrowed),
        };
        text.unwrap_or_default()
    }

    /// Keeps only the rows that are `wanted`.
    pub(crate) fn keep(&mut self, wanted: &[bool]) {
        fn only<T>(all: &mut Vec<T>, wanted: &[bool]) {
            let mut wanted = wanted.iter();
            all.retain(|_| wanted.next() == Some(&true));
        }
        match self {
            Self::Numbers(all) => only(all, wanted),
            #[cfg(feature = "parquet")]
            Self::Whole(all) => only(all, wanted),
            Self::Texts(all) => {
                let kept = all.iter().zip(wanted).filter(|(_, wanted)| **wanted);
                *all = kept.map(|(text, _)| text).collect();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_end_to_end_come_back_one_by_one_and_rows_can_be_left_out() {
        let mut cells = Cells::Texts(["a", "", "äö", "d"].into_iter().collect());
        assert_eq!((cells.len(), cells.text(2), cells.text(4)), (4, "äö".into(), "".into()));
        cells.keep(&[false, true, true, false]);
        assert_eq!((cells.len(), cells.text(0), cells.text(1)), (2, "".into(), "äö".into()));
        let mut numbers = Cells::Numbers(vec![1.5, f64::NAN, -0.0]);
        assert_eq!((numbers.text(0), numbers.text(1)), ("1.5".into(), "".into()));
        numbers.keep(&[false, true, true]);
        assert_eq!(numbers.number(1).map(f64::to_bits), Some((-0.0_f64).to_bits()));
    }
}
