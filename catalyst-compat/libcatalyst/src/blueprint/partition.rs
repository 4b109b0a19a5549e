//! Cutting a mesh into domains, and joining domains.

use std::collections::HashMap;

use crate::blueprint::domain::{Domain, gather_values};
use crate::blueprint::mesh::domains;
use crate::error::{Error, Result};
use crate::node::Node;

/// The numbers that VTK gives to shapes, for maps of shapes.
const NUMBERS: [(&str, i32); 10] = [
    ("point", 1),
    ("line", 3),
    ("tri", 5),
    ("polygonal", 7),
    ("quad", 9),
    ("tet", 10),
    ("hex", 12),
    ("wedge", 13),
    ("pyramid", 14),
    ("polyhedral", 42),
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

/// Numbers the vertices of a new domain in the order in which its elements bring them.
#[derive(Default)]
struct Vertices {
    /// Whether vertices of different domains at one place become one.
    joined: bool,
    /// The domain and the vertex there.
    origins: Vec<(usize, usize)>,
    by_vertex: HashMap<(usize, usize), i64>,
    by_place: HashMap<Vec<u64>, i64>,
}

impl Vertices {
    fn number(&mut self, number: usize, vertex: usize, domain: &Domain<'_>) -> i64 {
        let next = length(&self.origins);
        let Self { joined, by_place, .. } = self;
        let new = *self.by_vertex.entry((number, vertex)).or_insert_with(|| {
            // Zero has two signs but is one place.
            let place = || domain.axes.iter().map(|(_, values)| (values[vertex] + 0.0).to_bits()).collect();
            if *joined { *by_place.entry(place()).or_insert(next) } else { next }
        });
        if new == next {
            self.origins.push((number, vertex));
        }
        new
    }
}

/// Entries of different lengths one after the other, as Blueprint writes polygons and what is mixed.
#[derive(Default)]
struct Runs {
    connectivity: Vec<i64>,
    sizes: Vec<i64>,
    offsets: Vec<i64>,
}

impl Runs {
    fn push(&mut self, entries: &[i64]) {
        self.offsets.push(length(&self.connectivity));
        self.sizes.push(length(entries));
        self.connectivity.extend(entries);
    }

    fn write(&self, shapes: &[&str], mixed: bool, output: &mut Node) -> Result<()> {
        let first = shapes.first().copied().unwrap_or_default();
        output.at("shape")?.set_text(if mixed { "mixed" } else { first })?;
        output.at("connectivity")?.set_numbers(&self.connectivity)?;
        if mixed {
            let mut numbers = Vec::new();
            for shape in shapes {
                let number = NUMBERS.iter().find(|(name, _)| name == shape).map_or(0, |(_, number)| *number);
                output.at("shape_map")?.child_named(shape)?.set_number(number)?;
                numbers.push(number);
            }
            output.at("shapes")?.set_numbers(&numbers)?;
        }
        if mixed || first == "polygonal" || first == "polyhedral" {
            output.at("sizes")?.set_numbers(&self.sizes)?;
            output.at("offsets")?.set_numbers(&self.offsets)?;
        }
        Ok(())
    }
}

fn length<T>(values: &[T]) -> i64 {
    i64::try_from(values.len()).unwrap_or(i64::MAX)
}

fn write(group: &[Piece], domains: &[Domain<'_>], output: &mut Node) -> Result<()> {
    let Some(first) = group.first().map(|(number, _)| &domains[*number]) else {
        return Ok(());
    };
    let joined = group.iter().any(|(number, _)| *number != group[0].0);
    let mut vertices = Vertices { joined, ..Vertices::default() };
    let (mut runs, mut faces) = (Runs::default(), Runs::default());
    let mut by_face: HashMap<Vec<i64>, i64> = HashMap::new();
    let (mut shapes, mut elements) = (Vec::new(), Vec::new());
    for (number, chosen) in group {
        let domain = &domains[*number];
        for index in chosen {
            let element = &domain.elements[*index];
            elements.push((*number, *index));
            shapes.push(element.shape.as_str());
            let mut renumbered = |old: &[usize]| -> Vec<i64> {
                old.iter().map(|vertex| vertices.number(*number, *vertex, domain)).collect()
            };
            if element.faces.is_empty() {
                runs.push(&renumbered(&element.vertices));
                continue;
            }
            let of_element = element.faces.iter().map(|face| {
                let face = renumbered(face);
                // Two polyhedra turn the face between them in opposite ways.
                let mut key = face.clone();
                key.sort_unstable();
                *by_face.entry(key).or_insert_with(|| {
                    faces.push(&face);
                    length(&faces.sizes) - 1
                })
            });
            runs.push(&of_element.collect::<Vec<_>>());
        }
    }
    let vertices = vertices.origins;
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
    runs.write(&shapes, mixed, topology.at("elements")?)?;
    if !faces.sizes.is_empty() {
        faces.write(&vec!["polygonal"; faces.sizes.len()], mixed, topology.at("subelements")?)?;
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
