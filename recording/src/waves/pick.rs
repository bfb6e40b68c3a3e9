//! Selection of columns by name or number.

use crate::faults::{Fault, Faults, nearest};

/// The indices of the requested columns in `names`; a missing one is a fault with the nearest name.
///
/// A column is requested by its name, by its number from 1, or by its name without the unit or in
/// different case if that is unique.
pub(super) fn columns(names: &[String], asked: &[String], faults: &mut Faults) -> Vec<usize> {
    let mut found = Vec::new();
    for wanted in asked {
        match place(names, wanted) {
            Some(at) if found.contains(&at) => {}
            Some(at) => found.push(at),
            None => faults.push(missing(names, wanted)),
        }
    }
    found
}

fn place(names: &[String], wanted: &str) -> Option<usize> {
    if let Some(at) = names.iter().position(|name| name == wanted) {
        return Some(at);
    }
    if let Ok(number) = wanted.parse::<usize>() {
        return number.checked_sub(1).filter(|at| *at < names.len());
    }
    let like = |name: &String| {
        name.eq_ignore_ascii_case(wanted)
            || super::names::split(name).0.eq_ignore_ascii_case(wanted)
    };
    let mut fitting = names.iter().enumerate().filter(|(_, name)| like(name));
    match (fitting.next(), fitting.next()) {
        (Some((at, _)), None) => Some(at),
        _ => None,
    }
}

fn missing(names: &[String], wanted: &str) -> Fault {
    let near = nearest(wanted, names.iter().map(String::as_str));
    let help = near.map(|near| format!("did you mean `{near}`?"));
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
        let asked = ["fy", "2", "Fx_N", "Fx_M"].map(str::to_owned);
        assert_eq!(columns(&names, &asked, &mut faults), [2, 1]);
        assert_eq!(faults.list().len(), 1);
        assert_eq!(faults.list()[0].help, "did you mean `Fx_N`?");
    }
}
