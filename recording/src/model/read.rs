//! Reads a model document: every key is checked, every error reported with its line.

use physics::{JOINTS_MAX, JointKind};
use toml::de::{DeTable, DeValue};
use toml::{Table as FreeTable, Value};

use super::effects::read_effect;
use super::{BodyEntry, JointEntry, ModeEntry, ModelFile, RobotEntry, SCHEMA, ToolEntry};
use crate::faults::{Faults, Location};
use crate::toml_reader::{Document, POSITIVE, Table};

const GRAVITY_M_S2: [f64; 3] = [0.0, 0.0, -9.80665];

/// A document, and the positions of its effects.
pub(super) struct Parsed {
    pub(super) file: ModelFile,
    pub(super) effect_places: Vec<Location>,
}

pub(super) fn parse(name: &str, text: &str) -> Result<Parsed, Faults> {
    let document = Document::parse(name, text)?;
    let root = document.root();
    let file = read(&root);
    let effect_places = root.tables("effect").iter().map(Table::place).collect();
    document.finish(file.map(|file| Parsed { file, effect_places }))
}

fn read(root: &Table<'_, '_>) -> Option<ModelFile> {
    root.require("schema", "schema = \"trued.model/1\"");
    root.choice("schema", &[(SCHEMA, ())]);
    let name = root.text("name").unwrap_or_default().to_owned();
    let robot = root.table("robot").map(|table| RobotEntry::read(&table)).unwrap_or_default();
    let meta = root.free_table("meta").map(free_table).unwrap_or_default();
    let gravity = if root.has("gravity_m_s2") {
        root.vector::<3>("gravity_m_s2")
    } else {
        Some(GRAVITY_M_S2)
    };
    root.require("joint", "tables headed [[joint]], base to flange");
    let tables = root.tables("joint");
    if tables.len() > JOINTS_MAX {
        root.fault("joint", format!("has {} entries", tables.len()), "1 to 16 joints");
    }
    let joints: Vec<Option<JointEntry>> = tables.iter().map(joint).collect();
    root.require("tool", "a table [tool] with tcp_mm");
    let tool = root.table("tool").map(|table| tool(&table));
    let modes: Vec<Option<ModeEntry>> = root.tables("mode").iter().map(mode).collect();
    let kinds: Vec<JointKind> = tables.iter().map(kind_of).collect();
    let effects: Vec<_> = root.tables("effect").iter().map(|t| read_effect(t, &kinds)).collect();
    root.close();
    Some(ModelFile {
        name,
        robot,
        meta,
        gravity_m_s2: gravity?,
        joints: joints.into_iter().collect::<Option<_>>()?,
        tool: tool??,
        modes: modes.into_iter().collect::<Option<_>>()?,
        effects: effects.into_iter().collect::<Option<_>>()?,
    })
}

const KINDS: [(&str, JointKind); 2] =
    [("revolute", JointKind::Revolute), ("prismatic", JointKind::Prismatic)];

/// The kind of a joint, without a fault: reading the joint itself reports it.
fn kind_of(table: &Table<'_, '_>) -> JointKind {
    let kind = table.raw("kind").and_then(|value| value.get_ref().as_str());
    if kind == Some("prismatic") { JointKind::Prismatic } else { JointKind::Revolute }
}

fn joint(table: &Table<'_, '_>) -> Option<JointEntry> {
    table.require("kind", "\"revolute\" or \"prismatic\"");
    let kind = table.choice("kind", &KINDS).unwrap_or_else(|| kind_of(table));
    let (limits_key, speed_key) = match kind {
        JointKind::Revolute => ("limits_deg", "max_speed_deg_s"),
        JointKind::Prismatic => ("limits_mm", "max_speed_mm_s"),
    };
    table.require("axis", "a unit vector [x, y, z], base frame");
    table.require(limits_key, "[minimum, maximum]");
    if kind == JointKind::Revolute {
        table.require("point_mm", "a point [x, y, z] on the axis, base frame");
    }
    let name = table.text("name").unwrap_or_default().to_owned();
    let axis = table.vector::<3>("axis").filter(|axis| is_unit(table, axis));
    let point_mm = table.vector::<3>("point_mm");
    let limits = table.vector::<2>(limits_key);
    if let Some([low, high]) = limits.filter(|[low, high]| low >= high) {
        table.fault(limits_key, format!("is [{low}, {high}]"), "the lower limit first");
    }
    let max_speed = table.number(speed_key, POSITIVE);
    let gear_teeth = gear_teeth(table);
    let link = table.table("link").map(|link| {
        let body = body(&link, true);
        link.close();
        body
    });
    table.close();
    Some(JointEntry {
        name,
        kind,
        axis: axis?,
        point_mm,
        limits: limits?,
        max_speed,
        gear_teeth: gear_teeth?,
        link: link.flatten(),
    })
}

fn is_unit(table: &Table<'_, '_>, axis: &[f64; 3]) -> bool {
    let length = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
    let unit = (length - 1.0).abs() <= 1e-6;
    if !unit {
        table.fault("axis", format!("has length {length}"), "unit length within 1e-6");
    }
    unit
}

fn gear_teeth(table: &Table<'_, '_>) -> Option<Vec<[u32; 2]>> {
    if !table.has("gear_teeth") {
        return Some(Vec::new());
    }
    let rows = table.rows("gear_teeth")?;
    let teeth = |number: f64| {
        (number.fract() == 0.0 && (1.0..1e5).contains(&number)).then_some(number as u32)
    };
    let stage = |row: &Vec<f64>| match row.as_slice() {
        [driver, driven] => Some([teeth(*driver)?, teeth(*driven)?]),
        _ => None,
    };
    let stages: Option<Vec<[u32; 2]>> = rows.iter().map(stage).collect();
    if stages.is_none() {
        table.fault(
            "gear_teeth",
            "is not a list of stages",
            "[[driver, driven], …], whole numbers",
        );
    }
    stages
}

/// Mass, centre of mass and, for links, inertia; `None` where the table has no mass.
fn body(table: &Table<'_, '_>, is_link: bool) -> Option<BodyEntry> {
    if is_link || table.has("mass_kg") || table.has("com_mm") {
        table.require("mass_kg", "a mass of 0 or more");
        table.require("com_mm", "the centre of mass [x, y, z], base frame, zero configuration");
    }
    let mass = table.number("mass_kg", 0.0..);
    let com = table.vector::<3>("com_mm");
    let inertia = table.vector::<6>("inertia_kgm2");
    if let Some(inertia) = inertia.filter(|inertia| !is_inertia(inertia)) {
        let found = format!("is {inertia:?}, which is not a physical inertia");
        table.fault("inertia_kgm2", found, "[Ixx, Iyy, Izz, Ixy, Ixz, Iyz], positive moments");
    }
    Some(BodyEntry { mass_kg: mass?, com_mm: com?, inertia_kgm2: inertia })
}

/// Moments not negative, and each at most the sum of the other two.
fn is_inertia([xx, yy, zz, ..]: &[f64; 6]) -> bool {
    let slack = 1e-9 * (xx + yy + zz).abs();
    let fits = |a: &f64, b: &f64, c: &f64| *a >= 0.0 && *a <= b + c + slack;
    fits(xx, yy, zz) && fits(yy, zz, xx) && fits(zz, xx, yy)
}

fn tool(table: &Table<'_, '_>) -> Option<ToolEntry> {
    table.require("tcp_mm", "the tool centre point [x, y, z], base frame, zero configuration");
    let tcp_mm = table.vector::<3>("tcp_mm");
    let rotation = if table.has("base_from_tool") {
        rotation(table, "base_from_tool").map(Some)
    } else {
        Some(None)
    };
    let body = body(table, false);
    table.close();
    Some(ToolEntry { tcp_mm: tcp_mm?, base_from_tool: rotation?, body })
}

/// Three rows of a rotation.
pub(crate) fn rotation(table: &Table<'_, '_>, key: &str) -> Option<[[f64; 3]; 3]> {
    let rows = table.rows(key)?;
    let expected = "three rows of a right-handed rotation, orthonormal within 1e-6";
    let rows: Option<Vec<[f64; 3]>> =
        rows.into_iter().map(|row| <[f64; 3]>::try_from(row).ok()).collect();
    let rows = rows.and_then(|rows| <[[f64; 3]; 3]>::try_from(rows).ok());
    let Some(rows) = rows else {
        table.fault(key, "is not three rows of three numbers", expected);
        return None;
    };
    if !is_rotation(&rows) {
        table.fault(key, "is not a rotation", expected);
        return None;
    }
    Some(rows)
}

fn is_rotation([x, y, z]: &[[f64; 3]; 3]) -> bool {
    let dot = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let cross = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
    let is_close = |found: f64, wanted: f64| (found - wanted).abs() <= 1e-6;
    let unit = [x, y, z].iter().all(|row| is_close(dot(row, row), 1.0));
    unit && is_close(dot(x, y), 0.0)
        && is_close(dot(y, z), 0.0)
        && is_close(dot(x, z), 0.0)
        && is_close(dot(&cross, z), 1.0)
}

fn mode(table: &Table<'_, '_>) -> Option<ModeEntry> {
    table.require("frequency_Hz", "a number above zero");
    let frequency = table.number("frequency_Hz", POSITIVE);
    let damping_ratio = table.number("damping_ratio", 0.0..1.0);
    let direction = table.vector::<3>("direction");
    if direction.is_some_and(|direction| direction.iter().all(|x| *x == 0.0)) {
        table.fault("direction", "has no length", "a direction [x, y, z], base frame");
    }
    table.close();
    Some(ModeEntry { frequency_hz: frequency?, damping_ratio, direction })
}

fn free_table(table: &DeTable<'_>) -> FreeTable {
    let pair = |(key, value): (&toml::Spanned<_>, &toml::Spanned<DeValue<'_>>)| {
        let key: &std::borrow::Cow<'_, str> = key.get_ref();
        (key.to_string(), free_value(value.get_ref()))
    };
    table.iter().map(pair).collect()
}

fn free_value(value: &DeValue<'_>) -> Value {
    match value {
        DeValue::String(text) => Value::String(text.to_string()),
        DeValue::Integer(number) => i64::from_str_radix(number.as_str(), number.radix())
            .map_or_else(|_| Value::String(number.as_str().to_owned()), Value::Integer),
        DeValue::Float(number) => Value::Float(number.as_str().parse().unwrap_or(f64::NAN)),
        DeValue::Boolean(flag) => Value::Boolean(*flag),
        DeValue::Datetime(time) => Value::Datetime(*time),
        DeValue::Array(list) => {
            Value::Array(list.iter().map(|item| free_value(item.get_ref())).collect())
        }
        DeValue::Table(table) => Value::Table(free_table(table)),
    }
}
