//! Cutting a mesh into domains, and joining domains.

use std::collections::HashMap;

use crate::blueprint::domain::{Domain, gather_values};
use crate::blueprint::mesh::domains;
use crate::error::{Error, Result};
use crate::node::Node;

/// The numbers that VTK gives to shapes, for maps of shapes.
const NUMBERS: [(&str, i32); 9] = [
    ("point", 1),
    ("line", 3),
    ("tri", 5),
    ("polygonal", 7),
    ("quad", 9),
    ("tet", 10),
    ("hex", 12),
    ("wedge", 13),
    ("pyramid", 14),
];

/// Elements of one domain.
type Piece = (usize, Vec<usize>);

/// Makes new domains of a mesh. Without `selections` each domain is a piece; else each selection is one: `explicit` (`elements`),
/// `ranges` (pairs of first and last), `logical` (`start` and `end`), or `field` (an element field that says which piece). Then the
/// pieces are halved or joined until there are `target` domains. Points at the same place become one where domains are joined.
/// One domain is a mesh, several are an object of meshes. `original_element_ids` says where elements come from.
///
/// # Errors
/// A domain cannot be read, or a selection names what is not there.
pub fn partition(mesh: &Node, options: &Node) -> Result<Node> {
    let topology = options.get("topology").and_then(Node::text);
    let read: Result<Vec<_>> =
        domains(mesh).into_iter().map(|domain| Domain::read(domain, topology.as_deref())).collect();
    let read = read?;
    let mut pieces: Vec<Piece> = match options.get("selections").filter(|selections| selections.count() > 0) {
        None => read.iter().enumerate().map(|(index, domain)| (index, (0..domain.elements.len()).collect())).collect(),
        Some(selections) => {
            let mut pieces = Vec::new();
            for (_, selection) in selections.children() {
                select(selection, &read, &mut pieces)?;
            }
            pieces
        }
    };
    pieces.retain(|(_, elements)| !elements.is_empty());
    let target = match options.get("target") {
        None => pieces.len(),
        Some(node) => {
            let target = node.integer().and_then(|target| usize::try_from(target).ok()).filter(|target| *target > 0);
            target.ok_or_else(|| Error::new(format!("{} is no number of domains", node.place())))?
        }
    };
    while pieces.len() < target {
        let largest = (0..pieces.len()).max_by_key(|index| (pieces[*index].1.len(), usize::MAX - index));
        let Some(index) = largest.filter(|index| pieces[*index].1.len() > 1) else {
            break;
        };
        let half = pieces[index].1.len().div_ceil(2);
        let rest = pieces[index].1.split_off(half);
        pieces.insert(index + 1, (pieces[index].0, rest));
    }
    let count = target.min(pieces.len());
    let mut groups: Vec<Vec<Piece>> = (0..count).map(|_| Vec::new()).collect();
    let total = pieces.len();
    for (index, piece) in pieces.into_iter().enumerate() {
        groups[index * count / total].push(piece);
    }
    let mut output = Node::new();
    for (index, group) in groups.iter().enumerate() {
        let domain = if count == 1 { &mut output } else { output.child_named(&format!("domain_{index:05}"))? };
        write(group, &read, domain)?;
        domain.at("state/domain_id")?.set_number(i64::try_from(index).unwrap_or(i64::MAX))?;
    }
    Ok(output)
}

fn indices(node: &Node) -> Result<Vec<usize>> {
    let values = node.numbers().map(|number| number.as_i64().and_then(|value| usize::try_from(value).ok()));
    let all: Option<Vec<_>> = values.collect();
    all.ok_or_else(|| Error::new(format!("{} holds something else than numbers of elements", node.place())))
}

fn select(selection: &Node, domains: &[Domain<'_>], pieces: &mut Vec<Piece>) -> Result<()> {
    let number = selection.get("domain").or_else(|| selection.get("domain_id")).and_then(Node::integer).unwrap_or(0);
    let known = usize::try_from(number).ok().and_then(|number| Some((number, domains.get(number)?)));
    let (number, domain) =
        known.ok_or_else(|| Error::new(format!("{}: there is no domain {number}", selection.place())))?;
    let count = domain.elements.len();
    let kind = selection.existing("type")?.text().unwrap_or_default();
    let chosen: Vec<usize> = match kind.as_str() {
        "explicit" => indices(selection.existing("elements")?)?,
        "ranges" => {
            let ranges = indices(selection.existing("ranges")?)?;
            ranges.chunks_exact(2).flat_map(|range| range[0]..=range[1].min(count)).collect()
        }
        "logical" => {
            let cells =
                domain.cells.ok_or_else(|| Error::new(format!("{}: the domain is no grid", selection.place())))?;
            let many = cells.map(|cells| cells.max(1));
            let (start, end) = (indices(selection.existing("start")?)?, indices(selection.existing("end")?)?);
            let range = |axis: usize| {
                let first = start.get(axis).copied().unwrap_or(0);
                first..=end.get(axis).copied().unwrap_or(first).min(many[axis] - 1)
            };
            let mut chosen = Vec::new();
            for k in range(2) {
                for j in range(1) {
                    chosen.extend(range(0).map(|i| i + many[0] * (j + many[1] * k)));
                }
            }
            chosen
        }
        "field" => {
            let name = selection.existing("field")?.text().unwrap_or_default();
            let field = domain.fields.iter().find(|(known, vertex, _)| *known == name && !*vertex);
            let values = field.and_then(|(_, _, field)| field.get("values"));
            let values = values.ok_or_else(|| Error::new(format!("there is no element field '{name}'")))?;
            let mut by_value: std::collections::BTreeMap<i64, Vec<usize>> = std::collections::BTreeMap::new();
            for (element, value) in values.numbers().enumerate() {
                by_value.entry(value.as_i64().unwrap_or(0)).or_default().push(element);
            }
            pieces.extend(by_value.into_values().map(|elements| (number, elements)));
            return Ok(());
        }
        _ => return Err(Error::new(format!("'{kind}' is none of explicit, ranges, logical, field"))),
    };
    if let Some(wrong) = chosen.iter().find(|element| **element >= count) {
        return Err(Error::new(format!("{}: element {wrong} of {count}", selection.place())));
    }
    pieces.push((number, chosen));
    Ok(())
}

fn write(group: &[Piece], domains: &[Domain<'_>], output: &mut Node) -> Result<()> {
    let Some(first) = group.first().map(|(number, _)| &domains[*number]) else {
        return Ok(());
    };
    let joined = group.iter().any(|(number, _)| *number != group[0].0);
    let mut vertices: Vec<(usize, usize)> = Vec::new();
    let mut by_vertex: HashMap<(usize, usize), i64> = HashMap::new();
    let mut by_place: HashMap<Vec<u64>, i64> = HashMap::new();
    let (mut connectivity, mut sizes, mut offsets, mut shapes) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut elements = Vec::new();
    for (number, chosen) in group {
        let domain = &domains[*number];
        for index in chosen {
            let element = &domain.elements[*index];
            elements.push((*number, *index));
            shapes.push(element.shape.as_str());
            offsets.push(i64::try_from(connectivity.len()).unwrap_or(i64::MAX));
            sizes.push(i64::try_from(element.vertices.len()).unwrap_or(i64::MAX));
            for vertex in &element.vertices {
                let next = i64::try_from(vertices.len()).unwrap_or(i64::MAX);
                let new = *by_vertex.entry((*number, *vertex)).or_insert_with(|| {
                    // Zero has two signs but is one place.
                    let place = || domain.axes.iter().map(|(_, values)| (values[*vertex] + 0.0).to_bits()).collect();
                    if joined { *by_place.entry(place()).or_insert(next) } else { next }
                });
                if new == next {
                    vertices.push((*number, *vertex));
                }
                connectivity.push(new);
            }
        }
    }
    let coordset = output.at("coordsets")?.child_named(&first.coordset)?;
    coordset.at("type")?.set_text("explicit")?;
    for (axis, (name, _)) in first.axes.iter().enumerate() {
        let value = |(number, vertex): &(usize, usize)| {
            domains[*number].axes.get(axis).map_or(0.0, |(_, values)| values[*vertex])
        };
        coordset.at("values")?.child_named(name)?.set_numbers(&vertices.iter().map(value).collect::<Vec<_>>())?;
    }
    let topology = output.at("topologies")?.child_named(&first.topology)?;
    topology.at("type")?.set_text("unstructured")?;
    topology.at("coordset")?.set_text(&first.coordset)?;
    let mixed = shapes.iter().any(|shape| *shape != shapes[0]);
    topology.at("elements/shape")?.set_text(if mixed { "mixed" } else { shapes[0] })?;
    topology.at("elements/connectivity")?.set_numbers(&connectivity)?;
    if mixed {
        let mut numbers = Vec::new();
        for shape in &shapes {
            let number = NUMBERS.iter().find(|(name, _)| name == shape).map_or(0, |(_, number)| *number);
            topology.at("elements/shape_map")?.child_named(shape)?.set_number(number)?;
            numbers.push(number);
        }
        topology.at("elements/shapes")?.set_numbers(&numbers)?;
    }
    if mixed || shapes[0] == "polygonal" {
        topology.at("elements/sizes")?.set_numbers(&sizes)?;
        topology.at("elements/offsets")?.set_numbers(&offsets)?;
    }
    for (name, at_vertices, field) in &first.fields {
        let rows = if *at_vertices { &vertices } else { &elements };
        let values = |number: usize| {
            let found = domains[number].fields.iter().find(|(known, vertex, _)| known == name && vertex == at_vertices);
            found.and_then(|(_, _, field)| field.get("values"))
        };
        let found: Option<Vec<_>> = rows.iter().map(|(number, row)| Some((values(*number)?, *row))).collect();
        // A field that one of the joined domains lacks is left out.
        let Some(found) = found else {
            continue;
        };
        let target = output.at("fields")?.child_named(name)?;
        for (part, value) in field.children().filter(|(part, _)| *part != "values") {
            target.child_named(part)?.take(value.copy()?)?;
        }
        target.child_named("values")?.take(gather_values(&found)?)?;
    }
    let ids = output.at("fields/original_element_ids")?;
    ids.at("association")?.set_text("element")?;
    ids.at("topology")?.set_text(&first.topology)?;
    let number = |value: usize| i64::try_from(value).unwrap_or(i64::MAX);
    ids.at("values/domains")?.set_numbers(&elements.iter().map(|(domain, _)| number(*domain)).collect::<Vec<_>>())?;
    ids.at("values/ids")?.set_numbers(&elements.iter().map(|(_, element)| number(*element)).collect::<Vec<_>>())
}
