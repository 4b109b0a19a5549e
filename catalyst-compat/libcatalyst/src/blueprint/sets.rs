//! What some meshes have beside: materials, species, neighbours, refinements, and relations of one to many.

use crate::blueprint::mcarray;
use crate::blueprint::report::{Report, described};
use crate::datatype::Kind;
use crate::node::Node;

/// Verifies volume fractions of materials.
pub fn matset(node: &Node, report: &mut Report) {
    report.text(node, "topology");
    let Some(fractions) = report.needed(node, "volume_fractions") else {
        return;
    };
    if fractions.kind().is_number() {
        // All materials in one array, sorted by element.
        report.integers(node, "material_ids");
        if let Some(map) = report.object(node, "material_map") {
            material_map(map, report);
        }
        verify_relation(node, report);
    } else if fractions.kind() == Kind::Object && fractions.count() > 0 {
        for (_, values) in fractions.children() {
            let values = values.get("values").unwrap_or(values);
            if !values.kind().is_number() {
                report.wrong(values, &format!("numbers are expected, not {}", described(values)));
            }
        }
        if let Some(map) = node.get("material_map") {
            material_map(map, report);
        }
    } else {
        report.wrong(fractions, &format!("fractions are expected, not {}", described(fractions)));
    }
}

fn material_map(map: &Node, report: &mut Report) {
    for (_, number) in map.children().filter(|(_, number)| !number.kind().is_integer()) {
        report.wrong(number, &format!("an integer is expected, not {}", described(number)));
    }
}

/// Verifies mass fractions of species.
pub fn specset(node: &Node, report: &mut Report) {
    report.text(node, "matset");
    if let Some(values) = report.needed(node, "matset_values") {
        for (_, material) in values.children() {
            mcarray::verify(material, report);
        }
    }
}

/// Verifies which domains share what.
pub fn adjset(node: &Node, report: &mut Report) {
    report.text(node, "topology");
    report.one_of(node, "association", &["vertex", "element"]);
    if let Some(groups) = report.needed(node, "groups") {
        for (name, group) in groups.children() {
            let below = report.below(name, "mesh/adjset");
            below.integers(group, "neighbors");
            if group.get("values").is_some() {
                below.integers(group, "values");
            } else if group.get("windows").is_none() {
                below.wrong(group, "neither 'values' nor 'windows' is there");
            }
        }
    }
}

/// Verifies how domains refine each other.
pub fn nestset(node: &Node, report: &mut Report) {
    report.text(node, "topology");
    report.one_of(node, "association", &["vertex", "element"]);
    let Some(windows) = report.object(node, "windows") else {
        return;
    };
    for (name, window) in windows.children() {
        let below = report.below(name, "mesh/nestset");
        below.integers(window, "domain_id");
        below.one_of(window, "domain_type", &["parent", "child"]);
        for group in ["ratio", "origin", "dims"] {
            if let Some(values) = window.get(group) {
                for (_, value) in values.children().filter(|(_, value)| !value.kind().is_integer()) {
                    below.wrong(value, &format!("an integer is expected, not {}", described(value)));
                }
            } else if group == "ratio" {
                below.needed(window, group);
            }
        }
    }
}

/// Verifies a relation of one to many: `sizes` and `offsets` of the many, perhaps through `indices`.
pub fn verify_relation(node: &Node, report: &mut Report) {
    if node.kind() != Kind::Object || node.count() == 0 {
        return report.wrong(node, &format!("an object is expected, not {}", described(node)));
    }
    for name in ["sizes", "offsets", "indices"] {
        if node.get(name).is_some() {
            report.integers(node, name);
        }
    }
    if let (Some(sizes), Some(offsets)) = (node.get("sizes"), node.get("offsets"))
        && sizes.datatype().elements != offsets.datatype().elements
    {
        let (sizes, offset) = (sizes.datatype().elements, offsets.datatype().elements);
        report.wrong(node, &format!("{sizes} sizes, but {offset} offsets"));
    }
    let data = |name: &str| !["sizes", "offsets", "indices"].contains(&name);
    if !node.children().any(|(name, child)| data(name) && (child.kind().is_number() || child.count() > 0)) {
        report.wrong(node, "there are no data that it relates");
    }
}
