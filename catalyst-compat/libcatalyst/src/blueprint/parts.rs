//! The parts that most meshes have: coordinate sets, topologies and fields.

use crate::blueprint::mcarray;
use crate::blueprint::report::{Report, described};
use crate::datatype::Kind;
use crate::node::Node;

/// The types of coordinate sets.
pub const COORDSETS: [&str; 3] = ["uniform", "rectilinear", "explicit"];
/// The types of topologies.
pub const TOPOLOGIES: [&str; 5] =
    ["points", "uniform", "rectilinear", "structured", "unstructured"];
/// The shapes of elements.
pub const SHAPES: [&str; 11] = [
    "point",
    "line",
    "tri",
    "quad",
    "tet",
    "hex",
    "wedge",
    "pyramid",
    "polygonal",
    "polyhedral",
    "mixed",
];
/// Where the values of a field are.
pub const ASSOCIATIONS: [&str; 2] = ["vertex", "element"];
/// The names of coordinates.
pub const AXES: [&str; 6] = ["x", "y", "z", "r", "theta", "phi"];

/// Verifies a text that must be one of some words.
pub fn word(node: &Node, allowed: &[&str], report: &mut Report) {
    match node.text() {
        Some(text) if allowed.contains(&text.as_str()) => {}
        Some(text) => report.wrong(node, &format!("'{text}' is none of {}", allowed.join(", "))),
        None => report.wrong(node, &format!("a text is expected, not {}", described(node))),
    }
}

/// Verifies a coordinate set.
pub fn coordset(node: &Node, report: &mut Report) {
    match report.one_of(node, "type", &COORDSETS).as_deref() {
        Some("uniform") => uniform_coordset(node, report),
        Some("rectilinear") => rectilinear_coordset(node, report),
        Some(_) => explicit_coordset(node, report),
        None => {}
    }
}

/// Verifies a uniform coordinate set: `dims`, and perhaps `origin` and `spacing`.
pub fn uniform_coordset(node: &Node, report: &mut Report) {
    if let Some(dims) = report.object(node, "dims") {
        logical_dims(dims, report);
    }
    for (name, check) in [("origin", origin as fn(&Node, &mut Report)), ("spacing", spacing)] {
        if let Some(values) = node.get(name) {
            check(values, report);
        }
    }
}

/// Verifies where a uniform coordinate set begins: a number for each axis.
pub fn origin(node: &Node, report: &mut Report) {
    along_axes(node, "", report);
}

/// Verifies the steps of a uniform coordinate set: a number `d` and the axis, such as `dx`, for each axis.
pub fn spacing(node: &Node, report: &mut Report) {
    along_axes(node, "d", report);
}

fn along_axes(node: &Node, before: &str, report: &mut Report) {
    if !matches!(node.kind(), Kind::Object | Kind::Empty) {
        return report
            .wrong(node, &format!("an object of numbers is expected, not {}", described(node)));
    }
    for (name, value) in node.children() {
        if !name.strip_prefix(before).is_some_and(|axis| AXES.contains(&axis)) {
            report.remark(&format!(
                "'{name}' is not read; axes are {}, after '{before}'",
                AXES.join(", ")
            ));
        } else if !value.kind().is_number() {
            report.wrong(value, &format!("a number is expected, not {}", described(value)));
        }
    }
}

/// Verifies numbers of points or elements by `i`, `j`, `k`.
pub fn logical_dims(node: &Node, report: &mut Report) {
    if node.kind() != Kind::Object || node.get("i").is_none() {
        return report
            .wrong(node, &format!("'i' (and 'j', 'k') is expected, not {}", described(node)));
    }
    for (name, value) in node.children().filter(|(name, _)| ["i", "j", "k"].contains(name)) {
        match value.integer() {
            _ if !value.kind().is_integer() => {
                report.wrong(value, &format!("an integer is expected, not {}", described(value)));
            }
            Some(count) if count >= 0 => {}
            Some(count) => {
                report.wrong(value, &format!("'{name}' is {count}; it cannot be negative"))
            }
            None => report.wrong(value, "an integer is expected; there is none"),
        }
    }
}

/// Verifies a rectilinear coordinate set: an array for each axis.
pub fn rectilinear_coordset(node: &Node, report: &mut Report) {
    let Some(values) = report.needed(node, "values") else {
        return;
    };
    if !matches!(values.kind(), Kind::Object | Kind::List) || values.count() == 0 {
        return report.wrong(
            values,
            &format!("an array for each axis is expected, not {}", described(values)),
        );
    }
    for (_, value) in values.children().filter(|(_, value)| !value.kind().is_number()) {
        report.wrong(value, &format!("numbers are expected, not {}", described(value)));
    }
}

/// Verifies an explicit coordinate set: arrays of one length.
pub fn explicit_coordset(node: &Node, report: &mut Report) {
    if let Some(values) = report.needed(node, "values") {
        mcarray::verify(values, report);
    }
}

/// Verifies a topology.
pub fn topology(node: &Node, report: &mut Report) {
    report.text(node, "coordset");
    match report.one_of(node, "type", &TOPOLOGIES).as_deref() {
        Some("structured") => structured(node, report),
        Some("unstructured") => unstructured(node, report),
        _ => {}
    }
    if let Some(other) = node.get("grid_function").filter(|name| name.text().is_none()) {
        report.wrong(other, &format!("a text is expected, not {}", described(other)));
    }
}

fn typed(node: &Node, allowed: &str, report: &mut Report) {
    report.text(node, "coordset");
    report.one_of(node, "type", &[allowed]);
}

/// Verifies a topology of points.
pub fn points_topology(node: &Node, report: &mut Report) {
    typed(node, "points", report);
}

/// Verifies a uniform topology.
pub fn uniform_topology(node: &Node, report: &mut Report) {
    typed(node, "uniform", report);
}

/// Verifies a rectilinear topology.
pub fn rectilinear_topology(node: &Node, report: &mut Report) {
    typed(node, "rectilinear", report);
}

/// Verifies a structured topology.
pub fn structured_topology(node: &Node, report: &mut Report) {
    typed(node, "structured", report);
    structured(node, report);
}

/// Verifies an unstructured topology.
pub fn unstructured_topology(node: &Node, report: &mut Report) {
    typed(node, "unstructured", report);
    unstructured(node, report);
}

fn structured(node: &Node, report: &mut Report) {
    if let Some(elements) = report.object(node, "elements")
        && let Some(dims) = report.object(elements, "dims")
    {
        logical_dims(dims, report);
    }
}

fn unstructured(node: &Node, report: &mut Report) {
    let Some(elements) = report.needed(node, "elements") else {
        return;
    };
    if !matches!(elements.kind(), Kind::Object | Kind::List) || elements.count() == 0 {
        return report
            .wrong(elements, &format!("elements are expected, not {}", described(elements)));
    }
    let faces = node.get("subelements");
    if elements.get("shape").is_some() || elements.get("connectivity").is_some() {
        return group(elements, faces, report);
    }
    // Several groups of elements, by name or in a list.
    for (index, (name, member)) in elements.children().enumerate() {
        let (name, of_member) = if name.is_empty() {
            (format!("[{index}]"), faces.and_then(|faces| faces.child(index)))
        } else {
            (name.to_owned(), faces.and_then(|faces| faces.get(name)))
        };
        group(member, of_member, report.below(&name, "mesh/topology"));
    }
}

fn group(elements: &Node, faces: Option<&Node>, report: &mut Report) {
    elements_of(elements, report);
    let polyhedral = elements.get("shape").and_then(Node::text).as_deref() == Some("polyhedral")
        || elements.get("shape_map").is_some_and(|map| map.get("polyhedral").is_some());
    match faces.filter(|_| polyhedral) {
        Some(faces) => faces_of(faces, report.below("subelements", "mesh/topology")),
        None if polyhedral => report.wrong(elements, "polyhedra need their faces in 'subelements'"),
        None => {}
    }
}

fn elements_of(elements: &Node, report: &mut Report) {
    let shape = report.one_of(elements, "shape", &SHAPES);
    let connectivity = report.integers(elements, "connectivity");
    match shape.as_deref() {
        Some("polygonal" | "polyhedral") => {
            sizes_and_offsets(elements, report);
        }
        Some("mixed") => {
            if let Some(map) = report.object(elements, "shape_map") {
                shape_map(map, report);
            }
            let shapes = report.integers(elements, "shapes");
            let mapped = |number: i64| {
                let mut numbers = elements.get("shape_map").into_iter().flat_map(Node::children);
                numbers.any(|(_, value)| value.integer() == Some(number))
            };
            if let Some(shapes) = shapes {
                let mut numbers = shapes.numbers().filter_map(|number| number.as_i64());
                if let Some(unknown) = numbers.find(|number| !mapped(*number)) {
                    report.wrong(shapes, &format!("{unknown} is not in the shape map"));
                }
            }
            let shapes = shapes.map(|shapes| shapes.datatype().elements);
            for name in ["sizes", "offsets"] {
                let found = report
                    .integers(elements, name)
                    .filter(|found| shapes != Some(found.datatype().elements));
                if let (Some(found), Some(shapes)) = (found, shapes) {
                    report.wrong(
                        found,
                        &format!("{} entries for {shapes} shapes", found.datatype().elements),
                    );
                }
            }
        }
        Some(shape) => {
            let size = vertices_of(shape).unwrap_or(1);
            let count = connectivity.map_or(0, |connectivity| connectivity.datatype().elements);
            if count % size != 0 {
                report.remark(&format!(
                    "{count} vertices are no whole number of '{shape}', which has {size}"
                ));
            }
            if elements.get("offsets").is_some() {
                report.remark(&format!(
                    "'offsets' are not read: each '{shape}' has as many vertices"
                ));
            }
        }
        None => {}
    }
}

/// Of polygons and polyhedra: both or neither, as many of the one as of the other.
fn sizes_and_offsets(elements: &Node, report: &mut Report) {
    if elements.get("sizes").is_none() && elements.get("offsets").is_none() {
        return report.remark("without 'sizes' and 'offsets' nothing says where one element ends");
    }
    let sizes = report.integers(elements, "sizes").map(|sizes| sizes.datatype().elements);
    let offsets = report.integers(elements, "offsets");
    if let (Some(sizes), Some(offsets)) = (sizes, offsets)
        && offsets.datatype().elements != sizes
    {
        report
            .wrong(offsets, &format!("{} offsets for {sizes} sizes", offsets.datatype().elements));
    }
}

/// The faces of polyhedra: polygons of any size, or all of one shape.
fn faces_of(faces: &Node, report: &mut Report) {
    if faces.kind() != Kind::Object {
        return report.wrong(faces, &format!("an object is expected, not {}", described(faces)));
    }
    if report.one_of(faces, "shape", &["polygonal", "tri", "quad", "mixed"]).is_some() {
        elements_of(faces, report);
    }
}

/// Verifies a map from the names of shapes to numbers.
pub fn shape_map(node: &Node, report: &mut Report) {
    if node.kind() != Kind::Object || node.count() == 0 {
        return report.wrong(
            node,
            &format!("shapes with their numbers are expected, not {}", described(node)),
        );
    }
    for (name, value) in node.children() {
        if !SHAPES.contains(&name) || name == "mixed" {
            report.wrong(value, &format!("'{name}' is none of {}", SHAPES[..10].join(", ")));
        } else if !value.kind().is_integer() {
            report.wrong(value, &format!("an integer is expected, not {}", described(value)));
        }
    }
}

/// How many vertices an element of a shape has; `None` where that differs.
#[must_use]
pub fn vertices_of(shape: &str) -> Option<i64> {
    Some(match shape {
        "point" => 1,
        "line" => 2,
        "tri" => 3,
        "quad" | "tet" => 4,
        "pyramid" => 5,
        "wedge" => 6,
        "hex" => 8,
        _ => return None,
    })
}

/// Verifies a field.
pub fn field(node: &Node, report: &mut Report) {
    whereabouts(node, report);
    if node
        .get("volume_dependent")
        .is_some_and(|flag| !matches!(flag.text().as_deref(), Some("true" | "false")))
    {
        report.remark("'volume_dependent' is neither 'true' nor 'false'");
    }
    for (reference, values) in [("topology", "values"), ("matset", "matset_values")] {
        match (node.get(reference), node.get(values)) {
            (None, None) => {}
            (Some(_), None) | (None, Some(_)) => {
                report.wrong(
                    node,
                    &format!("'{reference}' and '{values}' go together, but one is missing"),
                );
            }
            (Some(_), Some(found)) if values == "values" => {
                report.text(node, reference);
                mcarray::verify_values(found, report);
            }
            (Some(_), Some(found)) => {
                report.text(node, reference);
                by_material(found, 2, report);
            }
        }
    }
}

/// Checks what a field, or its entry in an index, says of where its values are.
pub fn whereabouts(node: &Node, report: &mut Report) {
    if node.get("association").is_none() && node.get("basis").is_none() {
        report.wrong(node, "neither 'association' nor 'basis' is there");
    }
    if node.get("association").is_some() {
        report.one_of(node, "association", &ASSOCIATIONS);
    }
    if node.get("basis").is_some() {
        report.text(node, "basis");
    }
    if node.get("topology").is_none() && node.get("matset").is_none() {
        report.wrong(node, "neither 'topology' nor 'matset' is there");
    }
}

/// Values for each material, which may have components.
fn by_material(node: &Node, depth: usize, report: &mut Report) {
    if node.kind().is_number() {
        return;
    }
    if depth == 0 || !matches!(node.kind(), Kind::Object | Kind::List) || node.count() == 0 {
        return report
            .wrong(node, &format!("values by material are expected, not {}", described(node)));
    }
    for (_, child) in node.children() {
        by_material(child, depth - 1, report);
    }
}
