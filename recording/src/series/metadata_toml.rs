//! Writes the metadata of a recording as TOML.

use super::metadata::{
    CoordinateFrame, Cut, DirectionSource, HeldOut, InputKind, RecordingKind, SCHEMA,
};
use super::{FileUnits, Recording};
use crate::toml_text::{line, list, number, string};

impl Recording {
    /// The TOML of the recording; it reads back to the same [`Recording::metadata`].
    #[must_use]
    pub fn about_toml(&self) -> String {
        let about = &self.metadata;
        let mut out = String::new();
        line(&mut out, "schema", &string(SCHEMA));
        if let Some(model) = &about.model {
            line(&mut out, "model", &string(model));
        }
        let keywords = [
            ("kind", (about.kind == RecordingKind::Poses).then_some("poses")),
            ("input", about.input.map(|i| if i == InputKind::Motor { "qa" } else { "q" })),
            ("measuring_frame", about.measured_in_base.then_some("base")),
            (
                "wrench_frame",
                about
                    .wrench_frame
                    .map(|f| if f == CoordinateFrame::Base { "base" } else { "tool" }),
            ),
            ("approach", approach(about.approach)),
        ];
        for (key, keyword) in keywords {
            if let Some(keyword) = keyword {
                line(&mut out, key, &string(keyword));
            }
        }
        if !about.torque_per_ampere.is_empty() {
            line(&mut out, "torque_per_ampere", &list(&about.torque_per_ampere));
        }
        for (target, place) in &about.targets_tool {
            let mm = place.map(|m| m / 1e-3);
            line(&mut out, &format!("target{}_mm", target + 1), &list(&mm));
        }
        for (target, link) in &about.targets_on_link {
            line(&mut out, &format!("target{}_on_link", target + 1), &link.to_string());
        }
        match &about.heldout {
            HeldOut::Unspecified => {}
            HeldOut::All => line(&mut out, "heldout", "\"all\""),
            HeldOut::Segments(segments) => line(&mut out, "heldout", &format!("{segments:?}")),
        }
        if !about.sigma.is_empty() {
            line(&mut out, "sigma", &self.sigma_text());
        }
        if let Some(cut) = &about.cut {
            write_cut(&mut out, cut);
        }
        out += &about.gauges.toml();
        out
    }

    fn sigma_text(&self) -> String {
        let pair = |(channel, sigma): (&super::Channel, &f64)| {
            let kind = self.joint_kind(channel.joint().unwrap_or(0));
            let unit = channel.unit_in(FileUnits::SI, kind);
            let value = unit.map_or(*sigma, |unit| unit.from_si(*sigma));
            format!("{} = {}", channel.name(unit), number(value))
        };
        let pairs: Vec<String> = self.metadata.sigma.iter().map(pair).collect();
        format!("{{ {} }}", pairs.join(", "))
    }
}

fn approach(approach: DirectionSource) -> Option<&'static str> {
    match approach {
        DirectionSource::Columns => Some("columns"),
        DirectionSource::Sequence => Some("sequence"),
        DirectionSource::Unknown => None,
    }
}

fn write_cut(out: &mut String, cut: &Cut) {
    out.push_str("\n[cut]\n");
    if cut.turning {
        line(out, "operation", "\"turning\"");
    }
    line(out, "teeth", &cut.teeth.to_string());
    for (key, value) in [
        ("diameter_mm", cut.diameter_m / 1e-3),
        ("helix_deg", cut.helix_rad.to_degrees()),
        ("axial_depth_mm", cut.axial_depth_m / 1e-3),
        ("entry_deg", cut.entry_rad.to_degrees()),
        ("exit_deg", cut.exit_rad.to_degrees()),
    ] {
        line(out, key, &number(value));
    }
    line(out, "coefficients_N_per_mm2", &list(&cut.cutting_pa.map(|value| value / 1e6)));
    line(out, "coefficients_N_per_mm", &list(&cut.edge_n_per_m.map(|value| value / 1e3)));
}
