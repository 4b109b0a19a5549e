//! Blueprint: what a tree must hold to be a mesh, a multi-component array or a table, and what can be made of it then.

pub mod domain;
pub mod flatten;
pub mod index;
pub mod mcarray;
pub mod mesh;
pub mod partition;
pub mod parts;
pub mod protocols;
pub mod report;
pub mod sets;
pub mod table;

use crate::error::Result;
use crate::node::Node;
use report::Report;

/// The protocols that can be verified.
pub const PROTOCOLS: [&str; 5] = ["mesh", "mcarray", "table", "zfparray", "o2mrelation"];

/// The parts of a mesh that can be verified by themselves.
pub const MESH_PARTS: [&str; 8] =
    ["coordset", "topology", "field", "matset", "specset", "adjset", "nestset", "index"];

/// Verifies a tree and fills `info` with what was found.
///
/// # Errors
/// There is no memory for the report.
pub fn verify(protocol: &str, node: &Node, info: &mut Node) -> Result<bool> {
    let (first, rest) = protocol.split_once('/').unwrap_or((protocol, ""));
    let mut report = Report::new(first);
    match (first, rest) {
        ("mesh", "") => mesh::verify(node, &mut report),
        ("mesh", part) => protocols::verify(part, node, &mut report),
        ("mcarray", "") => mcarray::verify(node, &mut report),
        ("table", "") => table::verify(node, &mut report),
        ("zfparray", "") => table::verify_compressed(node, &mut report),
        ("o2mrelation", "") => sets::verify_relation(node, &mut report),
        _ if PROTOCOLS.contains(&first) => {
            report.wrong(node, &format!("'{first}' has no protocol '{rest}' below it"))
        }
        _ => report.wrong(
            node,
            &format!("there is no protocol '{protocol}'; there are {}", PROTOCOLS.join(", ")),
        ),
    }
    let valid = report.is_valid();
    info.replace(report.into_node()?);
    Ok(valid)
}
