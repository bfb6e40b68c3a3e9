//! Columns named after a quantity of the format, with a suffix that is not one of its units:
//! `q1_grad`, `x_inch`.

use super::RequiredData;
use super::build::Builder;
use super::channel::{Channel, expected_names};
use super::units_line::is_unit;
use crate::faults::Fault;
use crate::unit::UNITS;

/// Units and spellings of units that recordings of other programs carry in the names of columns, in lower case.
const SPELLINGS: &[&str] = &[
    "degree",
    "degrees",
    "degs",
    "grad",
    "grads",
    "grade",
    "gon",
    "gons",
    "radian",
    "radians",
    "rads",
    "bogenmass",
    "arcmin",
    "arcsec",
    "urad",
    "turn",
    "turns",
    "rev",
    "revs",
    "rot",
    "count",
    "ticks",
    "incr",
    "increments",
    "inch",
    "inches",
    "in",
    "ft",
    "feet",
    "mil",
    "mils",
    "thou",
    "cm",
    "dm",
    "nm",
    "km",
    "meter",
    "meters",
    "metre",
    "metres",
    "millimeter",
    "millimetre",
    "millimeters",
    "millimetres",
    "mn",
    "dan",
    "newton",
    "newtons",
    "kgf",
    "kp",
    "lb",
    "lbf",
    "ozf",
    "ncm",
    "nmm",
    "mnm",
    "danm",
    "lbft",
    "ftlb",
    "inlb",
    "lbf_in",
    "lbf_ft",
    "amp",
    "amps",
    "ampere",
    "amperes",
    "ka",
    "f",
    "degf",
    "fahrenheit",
    "degc",
    "celsius",
    "kelvin",
    "degk",
    "hz",
    "rps",
    "rev_min",
    "u_min",
    "1_min",
    "mm_min",
    "m_min",
    "in_min",
    "inch_min",
    "ipm",
    "mps",
    "mm_per_s",
    "mm_per_min",
    "m_per_s2",
    "mm_s2",
    "mps2",
    "g0",
    "gs",
    "gal",
    "ms2",
    "m_s^2",
    "m_ss",
];

/// Whether a suffix is a unit, not another word (`x_status`).
fn looks_like_a_unit(suffix: &str) -> bool {
    let lower = suffix.to_lowercase();
    let ours = || UNITS.iter().any(|unit| unit.name.to_lowercase() == lower);
    is_unit(suffix) || ours() || SPELLINGS.contains(&lower.as_str())
}

impl Builder<'_, '_> {
    /// Faults of columns whose suffix is a unit that is not supported, where no other column has the quantity: the
    /// recording would be read without it. For samples alone any column is accepted.
    pub(super) fn judge_suffixes(&mut self, need: RequiredData) {
        if need == RequiredData::Samples {
            return;
        }
        for name in self.kept().map(str::to_owned).collect::<Vec<_>>() {
            let Some((channel, suffix)) = Channel::misnamed(&name) else { continue };
            if self.columns.contains_key(&channel) || !looks_like_a_unit(suffix) {
                continue;
            }
            let message = format!("is `{}` in the unknown unit `{suffix}`", channel.base());
            let fault = Fault::new(&name, message)
                .expected(expected_names(channel, channel.units()))
                .help("convert the values and rename the column, or state the factor in a mapping (`scale`)");
            self.kept_fault(&name, fault);
        }
    }
}

/// The note on those of the unused columns that look like a quantity of the format.
pub(super) fn note<'n>(unused: impl Iterator<Item = &'n str>) -> Option<String> {
    let suggestion = |name: &str| {
        let (channel, _) = Channel::misnamed(name)?;
        Some(format!(
            "`{name}` (a unit is missing or unknown: {})",
            expected_names(channel, channel.units())
        ))
    };
    let suggestions: Vec<String> = unused.filter_map(suggestion).collect();
    (!suggestions.is_empty()).then(|| {
        format!("not read as a quantity because of the suffix: {}", suggestions.join(", "))
    })
}

#[cfg(test)]
mod tests {
    use crate::series::{Recording, RequiredData, read_text};

    fn read(head: &str, need: RequiredData) -> Result<Recording, String> {
        let cells = vec!["1"; head.split(',').count() - 1].join(",");
        let text = format!("{head}\n0,{cells}\n1,{cells}\n");
        read_text("x.csv", &text, None, None, need).map_err(|faults| faults.plain())
    }

    #[test]
    fn a_quantity_in_an_unknown_unit_is_refused_where_it_is_in_no_other_column() {
        for (column, unit, expected) in [
            ("q2_grad", "grad", "`q2_deg` or `q2_rad` or `q2_mm` or `q2_m`"),
            ("ql1_rads", "rads", "`ql1_deg` or"),
            ("q2_Degrees", "Degrees", "`q2_deg` or"),
            ("x_inch", "inch", "`x_mm` or `x_m`"),
            ("target1_x_in", "in", "`target1_x_mm` or"),
            ("fx_lbf", "lbf", "`fx_N`"),
            ("tau1_nm", "nm", "`tau1_Nm` or `tau1_N`"),
            ("temp_K", "K", "`temp_C`"),
        ] {
            let message = read(&format!("t_s,q1_deg,{column}"), RequiredData::Path).unwrap_err();
            assert!(message.contains(&format!("in the unknown unit `{unit}`")), "{message}");
            assert!(message.contains(expected), "{message}");
            assert!(
                read(&format!("t_s,q1_deg,{column}"), RequiredData::Samples).is_ok(),
                "{column}"
            );
        }
    }

    #[test]
    fn beside_the_quantity_itself_and_with_another_word_it_is_noted() {
        for head in ["t_s,q1_deg,q1_grad", "t_s,q1_deg,x_status", "t_s,q1_deg,q1_raw"] {
            let notes = read(head, RequiredData::Path).unwrap().notes;
            assert!(notes.iter().any(|note| note.contains("because of the suffix")), "{notes:?}");
            assert!(!notes.iter().any(|note| note.contains("unused columns")), "{notes:?}");
        }
        assert_eq!(
            read("t_s,q1_deg,remark", RequiredData::Path).unwrap().notes,
            ["unused columns: remark"]
        );
    }
}
