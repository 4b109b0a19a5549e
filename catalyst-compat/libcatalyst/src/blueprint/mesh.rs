//! Meshes: coordinate sets, topologies, fields, and what refers to them.

use crate::blueprint::parts;
use crate::blueprint::report::{Report, described};
use crate::blueprint::sets;
use crate::datatype::Kind;
use crate::node::Node;

/// Whether a tree holds domains rather than being one; what is empty holds none.
#[must_use]
pub fn is_multi_domain(node: &Node) -> bool {
    let holds = |part: &str| node.get(part).is_some();
    matches!(node.kind(), Kind::Empty | Kind::Object | Kind::List)
        && !holds("coordsets")
        && !holds("topologies")
}

/// The domains of a mesh: itself, or its children.
#[must_use]
pub fn domains(node: &Node) -> Vec<&Node> {
    if is_multi_domain(node) {
        node.children().map(|(_, domain)| domain).collect()
    } else {
        vec![node]
    }
}

/// Verifies a mesh of one domain, several, or none: a rank may have nothing.
pub fn verify(node: &Node, report: &mut Report) {
    if !is_multi_domain(node) {
        return verify_domain(node, report);
    }
    if node.count() == 0 {
        report.remark("a mesh without domains");
    }
    for (number, (name, domain)) in node.children().enumerate() {
        let name = if name.is_empty() { format!("[{number}]") } else { name.to_owned() };
        verify_domain(domain, report.below(&name, "mesh"));
    }
}

type Check = fn(&Node, &mut Report);

fn verify_domain(mesh: &Node, report: &mut Report) {
    if mesh.kind() != Kind::Object {
        return report.wrong(mesh, &format!("a mesh is an object, not {}", described(mesh)));
    }
    let needed: [(&str, &str, Check); 2] =
        [("coordsets", "coordset", parts::coordset), ("topologies", "topology", parts::topology)];
    for (group, protocol, check) in needed {
        if let Some(children) = report.object(mesh, group) {
            each(children, group, protocol, check, report);
        }
    }
    let optional: [(&str, &str, Check); 5] = [
        ("fields", "field", parts::field),
        ("matsets", "matset", sets::matset),
        ("specsets", "specset", sets::specset),
        ("adjsets", "adjset", sets::adjset),
        ("nestsets", "nestset", sets::nestset),
    ];
    for (group, protocol, check) in
        optional.into_iter().filter(|(group, ..)| mesh.get(group).is_some())
    {
        if let Some(children) = report.object(mesh, group) {
            each(children, group, protocol, check, report);
        }
    }
    refer_all(mesh, report);
}

/// Checks what the parts of a mesh, or of an index, name of each other.
pub fn refer_all(mesh: &Node, report: &mut Report) {
    for (group, reference, target) in [
        ("topologies", "coordset", "coordsets"),
        ("topologies", "grid_function", "fields"),
        ("fields", "topology", "topologies"),
        ("matsets", "topology", "topologies"),
        ("adjsets", "topology", "topologies"),
        ("nestsets", "topology", "topologies"),
        ("fields", "matset", "matsets"),
        ("specsets", "matset", "matsets"),
    ] {
        refer(mesh, group, reference, target, report);
    }
}

fn each(children: &Node, group: &str, protocol: &str, check: Check, report: &mut Report) {
    let below = report.below(group, "mesh");
    for (name, child) in children.children() {
        check(child, below.below(name, &format!("mesh/{protocol}")));
    }
}

/// Checks that what the members of a group name is there.
fn refer(mesh: &Node, group: &str, reference: &str, target: &str, report: &mut Report) {
    let Some(members) = mesh.get(group).filter(|members| members.kind() == Kind::Object) else {
        return;
    };
    for (name, member) in members.children() {
        let Some(named) = member.get(reference).and_then(Node::text) else {
            continue;
        };
        if mesh.get(target).is_none_or(|targets| targets.get(&named).is_none()) {
            let known: Vec<_> = mesh
                .get(target)
                .into_iter()
                .flat_map(Node::children)
                .map(|(name, _)| name)
                .collect();
            let message =
                format!("there is no '{named}' in '{target}'; there are [{}]", known.join(", "));
            let place = member.get(reference).unwrap_or(member);
            report.below(group, "mesh").below(name, "mesh").wrong(place, &message);
        }
    }
}
