//! Detection of the field separator of a text table.

/// The separator of the fields of a table's first line: the header, or `of_data`.
pub(super) fn guess_separator(line: &str, of_data: bool) -> u8 {
    let count = |mark: u8| line.bytes().filter(|byte| *byte == mark).count();
    let mut best = b',';
    for mark in [b';', b'\t'] {
        // Commas in numbers that end with another mark are decimal commas, however many there are.
        if count(mark) > count(best) || (of_data && ends_number(line, mark)) {
            best = mark;
        }
    }
    best
}

/// Whether this mark follows a number, outside of quotes, without a comma after it.
fn ends_number(line: &str, mark: u8) -> bool {
    let fields = |text: &str| {
        let fields: Vec<&str> = text.split(char::from(mark)).collect();
        fields.windows(2).any(|pair| {
            let ended = pair[0].trim_end_matches(' ').ends_with(|c: char| c.is_ascii_digit());
            ended && !pair[1].trim_start_matches(' ').starts_with(',')
        })
    };
    line.split('"').step_by(2).any(fields)
}

/// The separator stated in a spreadsheet's first line (`sep=;`), and the start of the table after
/// it.
pub(super) fn separator_line(source: &str, start: usize) -> (Option<u8>, usize) {
    let rest = source.get(start..).unwrap_or_default();
    let line = rest.split_inclusive('\n').next().unwrap_or_default();
    let plain = line.trim_end_matches(['\r', '\n']).trim_matches('"');
    let stated = plain.get(..4).filter(|head| head.eq_ignore_ascii_case("sep="));
    match (stated, plain.get(4..).map(str::as_bytes)) {
        (Some(_), Some([separator])) => (Some(*separator), start + line.len()),
        _ => (None, start),
    }
}
