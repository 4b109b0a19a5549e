//! The index of a mesh: what is in it, without its arrays.

use crate::blueprint::mesh::{domains, refer_all};
use crate::blueprint::parts::{ASSOCIATIONS, AXES, COORDSETS, TOPOLOGIES, whereabouts};
use crate::blueprint::report::Report;
use crate::blueprint::sets::material_map;
use crate::error::{Error, Result};
use crate::node::Node;

/// Builds the index of a mesh whose parts lie below `path`.
///
/// # Errors
/// The mesh has no domain.
pub fn generate(mesh: &Node, path: &str, count: i64) -> Result<Node> {
    let mut index = Node::new();
    let domains = domains(mesh);
    if domains.is_empty() {
        return Err(Error::new("a mesh without domains has no index"));
    }
    let under = |group: &str, name: &str| {
        if path.is_empty() { format!("{group}/{name}") } else { format!("{path}/{group}/{name}") }
    };
    let copy_text =
        |from: &Node, name: &str, to: &mut Node| match from.get(name).and_then(Node::text) {
            Some(text) => to.at(name)?.set_text(text),
            None => Ok(()),
        };
    for mesh in &domains {
        if let Some(state) = mesh.get("state") {
            for name in ["cycle", "time"] {
                if let Some(value) = state.get(name) {
                    index.at("state")?.child_named(name)?.take(value.copy()?)?;
                }
            }
        }
        for (name, coordset) in mesh.get("coordsets").into_iter().flat_map(Node::children) {
            let entry = index.at("coordsets")?.child_named(name)?;
            copy_text(coordset, "type", entry)?;
            let axes = axes(coordset);
            entry.at("coord_system/type")?.set_text(system(&axes))?;
            for axis in axes {
                entry.at("coord_system/axes")?.child_named(axis)?;
            }
            entry.at("path")?.set_text(under("coordsets", name))?;
        }
        for (name, topology) in mesh.get("topologies").into_iter().flat_map(Node::children) {
            let entry = index.at("topologies")?.child_named(name)?;
            for text in ["type", "coordset", "grid_function"] {
                copy_text(topology, text, entry)?;
            }
            entry.at("path")?.set_text(under("topologies", name))?;
        }
        for (name, field) in mesh.get("fields").into_iter().flat_map(Node::children) {
            let entry = index.at("fields")?.child_named(name)?;
            let by_material = || field.get("matset_values").and_then(|values| values.child(0));
            let components =
                field.get("values").or_else(by_material).map_or(1, |values| values.count().max(1));
            entry.at("number_of_components")?.set_number(i64::try_from(components).unwrap_or(1))?;
            for text in ["association", "basis", "topology", "matset", "volume_dependent"] {
                copy_text(field, text, entry)?;
            }
            entry.at("path")?.set_text(under("fields", name))?;
        }
        for group in ["matsets", "specsets", "adjsets", "nestsets"] {
            for (name, set) in mesh.get(group).into_iter().flat_map(Node::children) {
                let entry = index.at(group)?.child_named(name)?;
                for text in ["topology", "association", "matset"] {
                    copy_text(set, text, entry)?;
                }
                if let Some(map) = set.get("material_map") {
                    entry.at("material_map")?.take(map.copy()?)?;
                } else if let Some(fractions) = set.get("volume_fractions") {
                    // Without a map the order of the materials is their numbering.
                    for (number, (material, _)) in (0_i64..).zip(fractions.children()) {
                        entry.at("material_map")?.child_named(material)?.set_number(number)?;
                    }
                }
                if let Some(species) = set.get("matset_values").and_then(|values| values.child(0)) {
                    for (name, _) in species.children() {
                        entry.at("species")?.child_named(name)?;
                    }
                }
                entry.at("path")?.set_text(under(group, name))?;
            }
        }
    }
    index.at("state/number_of_domains")?.set_number(count)?;
    if domains.iter().any(|mesh| mesh.get("state").is_some()) {
        let state = if path.is_empty() { "state".to_owned() } else { format!("{path}/state") };
        index.at("state/path")?.set_text(state)?;
    }
    Ok(index)
}

/// The axes of a coordinate set.
#[must_use]
pub fn axes(coordset: &Node) -> Vec<&str> {
    let named = coordset.get("values").or_else(|| coordset.get("origin"));
    if let Some(named) = named.filter(|named| named.count() > 0) {
        return named.children().map(|(name, _)| name).collect();
    }
    if let Some(spacing) = coordset.get("spacing").filter(|spacing| spacing.count() > 0) {
        return spacing
            .children()
            .map(|(name, _)| name.strip_prefix('d').unwrap_or(name))
            .collect();
    }
    ["x", "y", "z"].into_iter().take(coordset.get("dims").map_or(3, Node::count)).collect()
}

fn system(axes: &[&str]) -> &'static str {
    match (axes.contains(&"theta") || axes.contains(&"phi"), axes.contains(&"r")) {
        (true, _) => "spherical",
        (false, true) => "cylindrical",
        (false, false) => "cartesian",
    }
}

/// Verifies an index.
pub fn verify(node: &Node, report: &mut Report) {
    type Check = fn(&Node, &mut Report);
    let groups: [(&str, bool, Check); 7] = [
        ("coordsets", true, coordset),
        ("topologies", true, topology),
        ("matsets", false, matset),
        ("specsets", false, specset),
        ("fields", false, field),
        ("adjsets", false, neighbours),
        ("nestsets", false, neighbours),
    ];
    for (group, needed, check) in groups {
        if !needed && node.get(group).is_none() {
            continue;
        }
        for (name, entry) in report.object(node, group).into_iter().flat_map(Node::children) {
            check(entry, report.below(group, "mesh/index").below(name, "mesh/index"));
        }
    }
    refer_all(node, report);
}

/// Verifies the entry of a coordinate set.
pub fn coordset(node: &Node, report: &mut Report) {
    report.one_of(node, "type", &COORDSETS);
    report.text(node, "path");
    if let Some(system) = report.object(node, "coord_system") {
        coord_system(system, report);
    }
}

/// Verifies a coordinate system: its type and the axes of that type.
pub fn coord_system(node: &Node, report: &mut Report) {
    let kind = report.one_of(node, "type", &["cartesian", "cylindrical", "spherical"]);
    let allowed: &[&str] = match kind.as_deref() {
        Some("cartesian") => &["x", "y", "z"],
        Some("cylindrical") => &["r", "z"],
        Some("spherical") => &["r", "theta", "phi"],
        _ => &AXES,
    };
    if let Some(axes) = report.object(node, "axes") {
        for (name, axis) in axes.children().filter(|(name, _)| !allowed.contains(name)) {
            report
                .wrong(axis, &format!("'{name}' is no axis here; axes are {}", allowed.join(", ")));
        }
    }
}

/// Verifies the entry of a topology.
pub fn topology(node: &Node, report: &mut Report) {
    report.one_of(node, "type", &TOPOLOGIES);
    for name in ["coordset", "path"] {
        report.text(node, name);
    }
    if node.get("grid_function").is_some() {
        report.text(node, "grid_function");
    }
}

/// Verifies the entry of a field.
pub fn field(node: &Node, report: &mut Report) {
    whereabouts(node, report);
    for name in ["topology", "matset"].into_iter().filter(|name| node.get(name).is_some()) {
        report.text(node, name);
    }
    report.integers(node, "number_of_components");
    report.text(node, "path");
}

/// Verifies the entry of volume fractions.
pub fn matset(node: &Node, report: &mut Report) {
    report.text(node, "topology");
    report.text(node, "path");
    if node.get("material_map").is_none() {
        report.object(node, "materials");
    } else if let Some(map) = report.object(node, "material_map") {
        material_map(map, report);
    }
}

/// Verifies the entry of mass fractions.
pub fn specset(node: &Node, report: &mut Report) {
    report.text(node, "matset");
    report.text(node, "path");
    report.object(node, "species");
}

/// Verifies the entry of what domains share, or of how they refine each other.
pub fn neighbours(node: &Node, report: &mut Report) {
    report.text(node, "topology");
    report.text(node, "path");
    report.one_of(node, "association", &ASSOCIATIONS);
}
