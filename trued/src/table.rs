//! Tables of text as wide as standard output.

use report::TextTable;

use crate::wrap;

/// A table as text for standard output.
#[must_use]
pub(crate) fn on_stdout(table: &TextTable) -> String {
    table.render(wrap::columns_of_stdout())
}
