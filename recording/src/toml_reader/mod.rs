//! Reading of TOML files: typed getters that collect all errors instead of stopping.
//!
//! A getter returns the value if it is valid, otherwise `None` after adding a fault. Closing a
//! table reports unknown keys (with the nearest known one, or the same name with the right unit)
//! and missing ones. Never panics.

#[cfg(test)]
mod tests;
mod words;

use std::cell::RefCell;
use std::ops::{Bound, Range, RangeBounds};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::faults::{Fault, Faults, Location, nearest};
use words::{describe, unknown_key};

/// A parsed TOML text and the faults found in it so far.
pub(crate) struct Document<'s> {
    source: &'s str,
    root: Spanned<DeTable<'s>>,
    faults: RefCell<Faults>,
}

impl<'s> Document<'s> {
    /// Parses a text; faults of syntax stop here, all at once.
    pub(crate) fn parse(name: &str, source: &'s str) -> Result<Self, Faults> {
        let (root, errors) = DeTable::parse_recoverable(source);
        let mut faults = Faults::new(name);
        for error in &errors {
            let mut fault = Fault::new("", format!("not TOML: {}", error.message().trim()));
            if let Some(span) = error.span() {
                fault = fault.at(Location::from_span(source, &span));
            }
            faults.push(fault);
        }
        if faults.is_empty() {
            Ok(Self { source, root, faults: RefCell::new(faults) })
        } else {
            faults.into_result(None)
        }
    }

    /// The root table.
    pub(crate) fn root<'d>(&'d self) -> Table<'d, 's> {
        Table::new(self, self.root.get_ref(), String::new(), 0..0)
    }

    /// The result, or every fault found.
    pub(crate) fn finish<T>(self, value: Option<T>) -> Result<T, Faults> {
        self.faults.into_inner().into_result(value)
    }

    fn note(&self, fault: Fault, span: &Range<usize>) {
        self.faults.borrow_mut().push(fault.at(Location::from_span(self.source, span)));
    }
}

type Value<'s> = Spanned<DeValue<'s>>;

/// A table being read, with the keys requested so far.
pub(crate) struct Table<'d, 's> {
    document: &'d Document<'s>,
    table: &'d DeTable<'s>,
    path: String,
    span: Range<usize>,
    known_keys: RefCell<Vec<String>>,
    required: RefCell<Vec<(String, String)>>,
}

impl<'d, 's> Table<'d, 's> {
    fn new(
        document: &'d Document<'s>,
        table: &'d DeTable<'s>,
        path: String,
        span: Range<usize>,
    ) -> Self {
        let (known_keys, required) = (RefCell::default(), RefCell::default());
        Self { document, table, path, span, known_keys, required }
    }

    /// Path of a key in this table, as faults name it.
    pub(crate) fn path_of(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }

    /// Adds a fault of a key's value.
    pub(crate) fn fault(&self, key: &str, message: impl Into<String>, expected: impl Into<String>) {
        let span = self.table.get(key).map_or_else(|| self.span.clone(), Spanned::span);
        let fault = Fault::new(self.path_of(key), message).expected(expected);
        self.document.note(fault, &span);
    }

    /// Position of the table.
    pub(crate) fn place(&self) -> Location {
        Location::from_span(self.document.source, &self.span)
    }

    /// Adds a fault of the whole table.
    pub(crate) fn fault_here(&self, message: impl Into<String>, help: impl Into<String>) {
        let fault = Fault::new(self.path.clone(), message).help(help);
        self.document.note(fault, &self.span);
    }

    /// Number of faults noted so far in the whole document.
    pub(crate) fn fault_count(&self) -> usize {
        self.document.faults.borrow().len()
    }

    /// Whether the table has the key (which counts as requested).
    pub(crate) fn has(&self, key: &str) -> bool {
        self.raw(key).is_some()
    }

    /// Makes a key required; reported when the table is closed.
    pub(crate) fn require(&self, key: &str, expected: &str) {
        self.required.borrow_mut().push((key.to_owned(), expected.to_owned()));
    }

    /// A key's raw value.
    pub(crate) fn raw(&self, key: &str) -> Option<&'d Value<'s>> {
        self.known_keys.borrow_mut().push(key.to_owned());
        self.table.get(key)
    }

    /// All keys of the table, in alphabetical order, without counting them as requested.
    pub(crate) fn keys(&self) -> impl Iterator<Item = &'d str> {
        self.table.keys().map(|key| key.get_ref().as_ref())
    }

    fn wrong_type(&self, key: &str, value: &Value<'s>, expected: &str) {
        let found = value.get_ref().type_str();
        self.fault(key, format!("is of type {found}"), expected);
    }

    /// A string.
    pub(crate) fn text(&self, key: &str) -> Option<&'d str> {
        let value = self.raw(key)?;
        let text = value.get_ref().as_str();
        if text.is_none() {
            let is_time = value.get_ref().is_datetime();
            self.wrong_type(key, value, if is_time { "a string, in quotes" } else { "a string" });
        }
        text
    }

    /// True or false.
    pub(crate) fn flag(&self, key: &str) -> Option<bool> {
        let value = self.raw(key)?;
        let flag = value.get_ref().as_bool();
        if flag.is_none() {
            self.wrong_type(key, value, "true or false");
        }
        flag
    }

    /// A finite number within a range.
    pub(crate) fn number(&self, key: &str, range: impl RangeBounds<f64>) -> Option<f64> {
        let value = self.raw(key)?;
        self.number_in(key, value, &range)
    }

    fn number_in(
        &self,
        key: &str,
        value: &Value<'s>,
        range: &impl RangeBounds<f64>,
    ) -> Option<f64> {
        match number_of(value.get_ref()) {
            None => {
                self.wrong_type(key, value, "a number");
                None
            }
            Some(number) if number.is_finite() && range.contains(&number) => Some(number),
            Some(number) => {
                self.fault(key, format!("is {number}"), describe(range));
                None
            }
        }
    }

    /// A whole number within a range.
    pub(crate) fn whole(&self, key: &str, range: Range<i64>) -> Option<i64> {
        let value = self.raw(key)?;
        let number = value
            .get_ref()
            .as_integer()
            .and_then(|number| i64::from_str_radix(number.as_str(), number.radix()).ok());
        if let Some(number) = number.filter(|number| range.contains(number)) {
            return Some(number);
        }
        let found = match number {
            Some(number) => format!("is {number}"),
            None => format!("is of type {}", value.get_ref().type_str()),
        };
        let last = range.end.saturating_sub(1);
        self.fault(key, found, format!("a whole number from {} to {last}", range.start));
        None
    }

    /// A list of numbers of any length, each within a range.
    pub(crate) fn numbers(&self, key: &str, range: impl RangeBounds<f64>) -> Option<Vec<f64>> {
        let value = self.raw(key)?;
        let Some(list) = value.get_ref().as_array() else {
            self.wrong_type(key, value, "a list of numbers");
            return None;
        };
        list.iter().map(|item| self.number_in(key, item, &range)).collect()
    }

    /// A list with exactly `N` numbers.
    pub(crate) fn vector<const N: usize>(&self, key: &str) -> Option<[f64; N]> {
        let list = self.numbers(key, ..)?;
        let length = list.len();
        let vector = list.try_into().ok();
        if vector.is_none() {
            self.fault(key, format!("has {length} numbers"), format!("{N} numbers"));
        }
        vector
    }

    /// Rows of numbers: a list of lists.
    pub(crate) fn rows(&self, key: &str) -> Option<Vec<Vec<f64>>> {
        let value = self.raw(key)?;
        let Some(list) = value.get_ref().as_array() else {
            self.wrong_type(key, value, "a list of lists of numbers");
            return None;
        };
        let row = |item: &Value<'s>| match item.get_ref().as_array() {
            Some(row) => row.iter().map(|number| self.number_in(key, number, &..)).collect(),
            None => {
                self.wrong_type(key, item, "a list of lists of numbers");
                None
            }
        };
        list.iter().map(row).collect()
    }

    /// A list of whole numbers, each within a range.
    pub(crate) fn wholes(&self, key: &str, range: Range<i64>) -> Option<Vec<i64>> {
        let list = self.numbers(key, range.start as f64..range.end as f64)?;
        if let Some(broken) = list.iter().find(|number| number.fract() != 0.0) {
            self.fault(key, format!("holds {broken}"), "whole numbers");
            return None;
        }
        Some(list.into_iter().map(|number| number as i64).collect())
    }

    /// A list of strings.
    pub(crate) fn texts(&self, key: &str) -> Option<Vec<&'d str>> {
        let value = self.raw(key)?;
        let texts = value.get_ref().as_array().and_then(|list| {
            list.iter().map(|item| item.get_ref().as_str()).collect::<Option<Vec<_>>>()
        });
        if texts.is_none() {
            self.wrong_type(key, value, "a list of strings");
        }
        texts
    }

    /// One of several strings, each with its value.
    pub(crate) fn choice<T: Copy>(&self, key: &str, choices: &[(&str, T)]) -> Option<T> {
        let text = self.text(key)?;
        let found = choices.iter().find(|(name, _)| *name == text).map(|(_, value)| *value);
        if found.is_none() {
            let names: Vec<String> =
                choices.iter().map(|(name, _)| format!("\"{name}\"")).collect();
            let nearest_name =
                nearest(text, choices.iter().map(|(name, _)| *name)).filter(|_| choices.len() > 1);
            let hint =
                nearest_name.map(|name| format!(" (did you mean \"{name}\"?)")).unwrap_or_default();
            self.fault(key, format!("is \"{text}\""), format!("{}{hint}", names.join(" or ")));
        }
        found
    }

    /// The table under a key.
    pub(crate) fn table(&self, key: &str) -> Option<Table<'d, 's>> {
        let value = self.raw(key)?;
        let Some(table) = value.get_ref().as_table() else {
            self.wrong_type(key, value, "a table");
            return None;
        };
        Some(Table::new(self.document, table, self.path_of(key), value.span()))
    }

    /// The tables of an array of tables; paths count from 1, as joints do.
    pub(crate) fn tables(&self, key: &str) -> Vec<Table<'d, 's>> {
        let Some(value) = self.raw(key) else { return Vec::new() };
        let Some(list) = value.get_ref().as_array() else {
            self.wrong_type(key, value, &format!("tables, each headed [[{}]]", self.path_of(key)));
            return Vec::new();
        };
        let mut tables = Vec::new();
        for (index, item) in list.iter().enumerate() {
            let path = format!("{}[{}]", self.path_of(key), index + 1);
            match item.get_ref().as_table() {
                Some(table) => {
                    tables.push(Table::new(self.document, table, path, item.span()));
                }
                None => self.wrong_type(key, item, "a table"),
            }
        }
        tables
    }

    /// A free table (`[meta]`) with arbitrary content.
    pub(crate) fn free_table(&self, key: &str) -> Option<&'d DeTable<'s>> {
        let value = self.raw(key)?;
        let table = value.get_ref().as_table();
        if table.is_none() {
            self.wrong_type(key, value, "a table");
        }
        table
    }

    /// Reports unknown keys and missing ones. To be called once, after all keys were requested.
    pub(crate) fn close(&self) {
        let known_keys = self.known_keys.borrow();
        let known_keys: Vec<&str> = known_keys.iter().map(String::as_str).collect();
        let is_missing = |known: &&str| !self.table.contains_key(*known);
        let missing: Vec<&str> = known_keys.iter().copied().filter(is_missing).collect();
        let mut found_otherwise = Vec::new();
        for key in self.table.keys() {
            let name = key.get_ref().as_ref();
            if !known_keys.contains(&name) {
                let (fault, meant) = unknown_key(self.path_of(name), name, &missing, &known_keys);
                found_otherwise.extend(meant);
                self.document.note(fault, &key.span());
            }
        }
        for (key, expected) in self.required.borrow().iter() {
            let otherwise = found_otherwise.contains(&key.as_str());
            if !self.table.contains_key(key.as_str()) && !otherwise {
                let fault = Fault::new(self.path_of(key), "is missing").expected(expected);
                self.document.note(fault, &self.span);
            }
        }
    }
}

/// A TOML integer or float as a number; `None` for any other type.
pub(crate) fn number_of(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Integer(integer) => {
            i64::from_str_radix(integer.as_str(), integer.radix()).ok().map(|i| i as f64)
        }
        DeValue::Float(float) => float.as_str().parse().ok(),
        _ => None,
    }
}

/// Numbers above zero, for [`Table::number`].
pub(crate) const POSITIVE: (Bound<f64>, Bound<f64>) = (Bound::Excluded(0.0), Bound::Unbounded);
