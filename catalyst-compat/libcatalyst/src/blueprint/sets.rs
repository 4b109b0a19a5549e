//! What some meshes have beside: materials, species, neighbours, refinements, and relations of one to many.

use crate::blueprint::mcarray;
use crate::blueprint::parts::{ASSOCIATIONS, logical_dims};
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
        for (name, values) in fractions.children() {
            if values.kind() == Kind::Object {
                verify_relation(values, report.below(name, "o2mrelation"));
            } else if !values.kind().is_number() {
                report.wrong(values, &format!("numbers are expected, not {}", described(values)));
            }
        }
        if node.get("material_map").is_some()
            && let Some(map) = report.object(node, "material_map")
        {
            material_map(map, report);
            for (name, number) in map.children().filter(|(name, _)| fractions.get(name).is_none()) {
                report.wrong(number, &format!("there are no volume fractions of '{name}'"));
            }
        }
    } else {
        return report
            .wrong(fractions, &format!("fractions are expected, not {}", described(fractions)));
    }
    if let Some(ids) = node.get("element_ids") {
        element_ids(ids, fractions, report);
    }
}

/// Verifies the numbers of the elements that have a material, which follow the volume fractions.
fn element_ids(ids: &Node, fractions: &Node, report: &mut Report) {
    let integers = |node: &Node, report: &mut Report| {
        if !node.kind().is_integer() {
            report.wrong(node, &format!("integers are expected, not {}", described(node)));
        }
    };
    if fractions.kind().is_number() {
        return integers(ids, report);
    }
    let same = ids.count() == fractions.count()
        && ids.children().all(|(name, _)| fractions.get(name).is_some());
    if ids.kind() != Kind::Object || !same {
        return report.wrong(ids, "the materials of 'volume_fractions' are expected");
    }
    for (_, of_material) in ids.children() {
        integers(of_material, report);
    }
}

/// Verifies the numbers of materials.
pub fn material_map(map: &Node, report: &mut Report) {
    for (_, number) in map.children().filter(|(_, number)| !number.kind().is_integer()) {
        report.wrong(number, &format!("an integer is expected, not {}", described(number)));
    }
}

/// Verifies mass fractions of species.
pub fn specset(node: &Node, report: &mut Report) {
    report.text(node, "matset");
    let Some(values) = report.object(node, "matset_values") else {
        return;
    };
    let mut length = None;
    for (name, material) in values.children() {
        let below = report.below(name, "mesh/specset");
        mcarray::verify(material, below);
        if let Some(first) = material.child(0) {
            let found = first.datatype().elements;
            let expected = *length.get_or_insert(found);
            if found != expected {
                below.wrong(
                    material,
                    &format!("{found} values, where the first material has {expected}"),
                );
            }
        }
    }
}

/// Verifies which domains share what.
pub fn adjset(node: &Node, report: &mut Report) {
    report.text(node, "topology");
    report.one_of(node, "association", &ASSOCIATIONS);
    let Some(groups) = report.needed(node, "groups") else {
        return;
    };
    if groups.kind() != Kind::Object {
        return report.wrong(groups, &format!("an object is expected, not {}", described(groups)));
    }
    for (name, group) in groups.children() {
        let below = report.below(name, "mesh/adjset");
        below.integers(group, "neighbors");
        if group.get("values").is_some() {
            below.integers(group, "values");
        } else if group.get("windows").is_none() {
            below.remark("neither 'values' nor 'windows' is there");
        } else if let Some(windows) = below.object(group, "windows") {
            for (name, of_domain) in windows.children() {
                window(
                    of_domain,
                    &["origin", "dims", "ratio"],
                    &[],
                    below.below(name, "mesh/adjset"),
                );
            }
            if group.get("orientation").is_some() {
                below.integers(group, "orientation");
            }
        }
    }
}

/// Verifies how domains refine each other.
pub fn nestset(node: &Node, report: &mut Report) {
    report.text(node, "topology");
    report.one_of(node, "association", &ASSOCIATIONS);
    let Some(windows) = report.object(node, "windows") else {
        return;
    };
    for (name, of_domain) in windows.children() {
        let below = report.below(name, "mesh/nestset");
        below.integers(of_domain, "domain_id");
        below.one_of(of_domain, "domain_type", &["parent", "child"]);
        window(of_domain, &["ratio"], &["origin", "dims"], below);
    }
}

/// Verifies a box of vertices or elements: numbers by `i`, `j`, `k`, as many in each of its parts.
fn window(node: &Node, needed: &[&str], optional: &[&str], report: &mut Report) {
    let mut directions = None;
    let there = |name: &&&str| needed.contains(name) || node.get(name).is_some();
    for name in needed.iter().chain(optional).filter(there) {
        let Some(part) = report.needed(node, name) else {
            continue;
        };
        logical_dims(part, report);
        let expected = *directions.get_or_insert(part.count());
        if part.count() != expected {
            report.wrong(
                part,
                &format!("{} directions, where the first part has {expected}", part.count()),
            );
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
    let entries = |name| node.get(name).map(|found| found.datatype().elements);
    match (entries("sizes"), entries("offsets")) {
        (Some(sizes), Some(offsets)) if sizes != offsets => {
            report.wrong(node, &format!("{sizes} sizes, but {offsets} offsets"));
        }
        (Some(_), None) | (None, Some(_)) => {
            report.wrong(node, "'sizes' and 'offsets' go together, but one is missing");
        }
        _ => {}
    }
    let data = |name: &str| !["sizes", "offsets", "indices"].contains(&name);
    if !node.children().any(|(name, child)| data(name) && child.kind().is_number()) {
        report.wrong(node, "there are no data that it relates");
    }
}
