//! Number and unit formats of waveform tables.

use super::tests::parsed;
use super::*;

#[test]
fn numbers_with_thousands_and_typographic_minus_signs_are_rows_of_the_table() {
    let mut thousands = "time [s];F [N]\n".to_owned();
    for i in 0..20 {
        let force = if i < 10 { "1.588,66" } else { "588,66" };
        thousands += &format!("0,{i:03};{force}\n");
    }
    let waves = parsed(&thousands, &Options::default()).unwrap();
    let channel = &waves.records[0].channels[0];
    assert_eq!((channel.name.as_str(), channel.unit.as_str()), ("F [N]", "N"));
    assert_eq!(channel.values, [[1588.66; 10], [588.66; 10]].concat());
    let minus = "time;acc\nms;g\n0;\u{2212}0,9090\n1;\u{2212}0,3475\n2;0,1012\n3;0,2\n";
    let waves = parsed(minus, &Options::default()).unwrap();
    assert_eq!(waves.records[0].grid, Grid::Time { start_s: 0.0, rate_hz: 1000.0 });
    let channel = &waves.records[0].channels[0];
    assert_eq!((channel.unit.as_str(), &channel.values[..2]), ("g", &[-0.909, -0.3475][..]));
}

#[test]
fn dots_that_may_group_thousands_are_refused_until_a_cell_shows_the_decimal_mark() {
    let dots = "Zeit [ms];a [N]\n0;5.596\n1;7.210\n2;7.980\n";
    let fault = parsed(dots, &Options::default()).unwrap_err().to_string();
    assert!(fault.contains("`5.596` is ambiguous: 5596 or 5.596"), "{fault}");
    let values = |last: &str| {
        let waves = parsed(&format!("{dots}{last}"), &Options::default());
        waves.map(|waves| waves.records[0].channels[0].values.clone())
    };
    assert_eq!(values("3;7.61\n").unwrap(), [5.596, 7.21, 7.98, 7.61]);
    assert!(values("3;7,61\n").is_err(), "a decimal comma does not say that dots group thousands");
}

#[test]
fn a_line_of_units_counts_beside_a_column_of_text_too() {
    let read = |head: &str| {
        let text = format!("{head};remark\nms;kN;-\n0;1,5;a\n1;2,5;b\n2;3,5;c\n");
        parsed(&text, &Options::default()).unwrap().records.swap_remove(0)
    };
    for (head, name) in [("time;F", "F [kN]"), ("time [ms];F_kN", "F_kN")] {
        let record = read(head);
        assert_eq!(record.grid, Grid::Time { start_s: 0.0, rate_hz: 1000.0 });
        let force = &record.channels[0];
        assert_eq!((force.name.as_str(), force.quantity()), (name, Some((Quantity::Force, 1e3))));
        assert_eq!(force.values, [1.5, 2.5, 3.5]);
    }
}
