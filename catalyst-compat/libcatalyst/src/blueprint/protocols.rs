//! The protocols of the parts of a mesh.

use crate::blueprint::report::{Report, described};
use crate::blueprint::{index, parts, sets};
use crate::node::Node;

/// Verifies a part of a mesh by its protocol, such as `coordset` or `topology/shape`.
pub fn verify(protocol: &str, node: &Node, report: &mut Report) {
    let check: fn(&Node, &mut Report) = match protocol {
        "coordset" => parts::coordset,
        "coordset/uniform" => parts::uniform_coordset,
        "coordset/rectilinear" => parts::rectilinear_coordset,
        "coordset/explicit" => parts::explicit_coordset,
        "coordset/uniform/origin" => parts::origin,
        "coordset/uniform/spacing" => parts::spacing,
        "coordset/type" => |node, report| parts::word(node, &parts::COORDSETS, report),
        "coordset/coord_system" => index::coord_system,
        "topology" => parts::topology,
        "topology/points" => parts::points_topology,
        "topology/uniform" => parts::uniform_topology,
        "topology/rectilinear" => parts::rectilinear_topology,
        "topology/structured" => parts::structured_topology,
        "topology/unstructured" => parts::unstructured_topology,
        "topology/type" => |node, report| parts::word(node, &parts::TOPOLOGIES, report),
        "topology/shape" => |node, report| parts::word(node, &parts::SHAPES, report),
        "topology/shape_map" => parts::shape_map,
        "field" => parts::field,
        "field/association" | "association" => {
            |node, report| parts::word(node, &parts::ASSOCIATIONS, report)
        }
        "field/basis" => |node, report| {
            if node.text().is_none() {
                report.wrong(node, &format!("a text is expected, not {}", described(node)));
            }
        },
        "logical_dims" => parts::logical_dims,
        "matset" => sets::matset,
        "specset" => sets::specset,
        "adjset" => sets::adjset,
        "nestset" => sets::nestset,
        "index" => index::verify,
        "coordset/index" | "index/coordset" => index::coordset,
        "topology/index" | "index/topology" => index::topology,
        "field/index" | "index/field" => index::field,
        "matset/index" | "index/matset" => index::matset,
        "specset/index" | "index/specset" => index::specset,
        "adjset/index" | "nestset/index" | "index/adjset" | "index/nestset" => index::neighbours,
        _ => return report.wrong(node, &format!("a mesh has no part '{protocol}'")),
    };
    check(node, report);
}
