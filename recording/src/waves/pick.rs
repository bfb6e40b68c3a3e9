//! Selection of columns by name or number.

use crate::faults::{Fault, Faults, nearest};

/// The indices of the requested columns in `names`; a missing one is a fault with the nearest name.
///
/// A column is requested by its name, by its number from 1, or by its name without the unit or in
/// different case if that is unique.
pub(super) fn columns(names: &[String], requested: &[String], faults: &mut Faults) -> Vec<usize> {
    let mut found = Vec::new();
    for wanted in requested {
        match place(names, wanted) {
            Some(column) if found.contains(&column) => {}
            Some(column) => found.push(column),
            None => faults.push(missing(names, wanted)),
        }
    }
    found
}

fn place(names: &[String], wanted: &str) -> Option<usize> {
    if let Some(column) = names.iter().position(|name| name == wanted) {
        return Some(column);
    }
    if let Ok(number) = wanted.parse::<usize>() {
        return number.checked_sub(1).filter(|column| *column < names.len());
    }
    let like = |name: &String| {
        name.eq_ignore_ascii_case(wanted)
            || super::names::split(name).0.eq_ignore_ascii_case(wanted)
    };
    let mut fitting = names.iter().enumerate().filter(|(_, name)| like(name));
    match (fitting.next(), fitting.next()) {
        (Some((column, _)), None) => Some(column),
        _ => None,
    }
}

fn missing(names: &[String], wanted: &str) -> Fault {
    let nearest_name = nearest(wanted, names.iter().map(String::as_str));
    let help = nearest_name.map(|nearest_name| format!("did you mean `{nearest_name}`?"));
    Fault::new(wanted, "is not a column of this file")
        .expected(format!("one of: {}, or its number from 1", names.join(", ")))
        .help(help.unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_found_by_name_number_and_name_without_unit() {
        let names = ["t_s", "Fx_N", "Fy_N"].map(str::to_owned);
        let mut faults = Faults::new("x.csv");
        let requested = ["fy", "2", "Fx_N", "Fx_M"].map(str::to_owned);
        assert_eq!(columns(&names, &requested, &mut faults), [2, 1]);
        assert_eq!(faults.list().len(), 1);
        assert_eq!(faults.list()[0].help, "did you mean `Fx_N`?");
    }
}
