//! Cutting a mesh into domains, and joining domains.

use std::collections::{BTreeMap, HashMap};

use crate::blueprint::domain::{Domain, gather_values, numbers_of};
use crate::blueprint::mesh::domains;
use crate::datatype::Kind;
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

/// Pieces, and the number of the domain that they are to be part of, where one is given.
type Selected = Vec<(Option<i64>, Piece)>;

/// Makes new domains of a mesh. Without `selections` each domain is a piece; else each selection is one: `explicit` (`elements`),
/// `ranges` (pairs of first and last), `logical` (`start` and `end`), or `field` (an element field that says to which domain an
/// element goes). A selection takes from the domain whose number is its `domain_id`, 0 if it says none, and from each if it says
/// `any`; it goes to `destination_domain`, if it says one. Then the other pieces are halved or joined until there are
/// `target` domains. Points at the same place become one where domains are joined. One domain is a mesh, several are an object
/// of meshes; all are unstructured.
///
/// Of the fields those in the list `fields` are taken, or all. `original_element_ids` and `original_vertex_ids` say where elements
/// and vertices come from; the options of these names name them otherwise, and `mapping: 0` leaves them out.
///
/// # Errors
/// A domain cannot be read, or a selection names elements or a field that are not there.
pub fn partition(mesh: &Node, options: &Node) -> Result<Node> {
    let topology = options.get("topology").and_then(Node::text);
    let sources = domains(mesh);
    let read: Result<Vec<_>> =
        sources.iter().map(|domain| Domain::read(domain, topology.as_deref())).collect();
    let numbers = numbers_of(&sources);
    let mut source = Source { domains: read?, numbers };
    if let Some(wanted) = options.get("fields").filter(|fields| fields.kind() == Kind::List) {
        let wanted: Vec<_> = wanted.children().filter_map(|(_, name)| name.text()).collect();
        source
            .domains
            .iter_mut()
            .for_each(|domain| domain.fields.retain(|(name, ..)| wanted.contains(name)));
    }
    let mut selected = Selected::new();
    match options.get("selections").filter(|selections| selections.count() > 0) {
        None => {
            let all = source.domains.iter().map(|domain| (0..domain.elements.len()).collect());
            selected.extend(all.enumerate().map(|piece| (None, piece)));
        }
        Some(selections) => {
            for (_, selection) in selections.children() {
                select(selection, &source, &mut selected)?;
            }
        }
    }
    let mut groups: BTreeMap<i64, Vec<Piece>> = BTreeMap::new();
    let mut pieces = Vec::new();
    for (destination, piece) in
        selected.into_iter().filter(|(_, (_, elements))| !elements.is_empty())
    {
        match destination {
            Some(number) => groups.entry(number).or_default().push(piece),
            None => pieces.push(piece),
        }
    }
    let target = options
        .get("target")
        .and_then(Node::integer)
        .and_then(|target| usize::try_from(target).ok());
    let target = target
        .filter(|target| *target > 0)
        .map(|target| target.saturating_sub(groups.len()).max(1));
    let free = arranged(pieces, target);
    let mut unused = (0..)
        .filter(|number| !groups.contains_key(number))
        .take(free.len())
        .collect::<Vec<_>>()
        .into_iter();
    groups.extend(free.into_iter().filter_map(|group| Some((unused.next()?, group))));
    let mapping = options.get("mapping").and_then(Node::integer) != Some(0);
    let count = groups.len();
    let mut output = Node::new();
    for (number, group) in &groups {
        let domain = if count == 1 {
            &mut output
        } else {
            output.child_named(&format!("domain_{number:05}"))?
        };
        let origins = write(group, &source.domains, domain)?;
        if mapping {
            origins.write(group, &source, options, domain)?;
        }
        domain.at("state/domain_id")?.set_number(*number)?;
    }
    Ok(output)
}

/// Halves pieces, or joins them, until there are as many as wanted.
fn arranged(mut pieces: Vec<Piece>, target: Option<usize>) -> Vec<Vec<Piece>> {
    let target = target.unwrap_or(pieces.len());
    while pieces.len() < target {
        let largest =
            (0..pieces.len()).max_by_key(|index| (pieces[*index].1.len(), usize::MAX - index));
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
    groups
}

/// The domains that are cut, and their numbers.
struct Source<'a> {
    domains: Vec<Domain<'a>>,
    numbers: Vec<i64>,
}

/// Where the vertices of a new domain come from: the domain, and the vertex there.
struct Origins {
    topology: String,
    vertices: Vec<(usize, usize)>,
}

impl Origins {
    fn write(
        &self,
        group: &[Piece],
        source: &Source<'_>,
        options: &Node,
        output: &mut Node,
    ) -> Result<()> {
        let elements = group
            .iter()
            .flat_map(|(domain, elements)| elements.iter().map(|element| (*domain, *element)));
        for (name, association, rows) in [
            ("original_element_ids", "element", elements.collect::<Vec<_>>()),
            ("original_vertex_ids", "vertex", self.vertices.clone()),
        ] {
            let named = options.get(name).and_then(Node::text).unwrap_or_else(|| name.to_owned());
            let ids = output.at("fields")?.child_named(&named)?;
            ids.at("association")?.set_text(association)?;
            ids.at("topology")?.set_text(&self.topology)?;
            let of_domains: Vec<i64> =
                rows.iter().map(|(domain, _)| source.numbers[*domain]).collect();
            let numbers: Vec<i64> =
                rows.iter().map(|(_, row)| i64::try_from(*row).unwrap_or(i64::MAX)).collect();
            ids.at("values/domains")?.set_numbers(&of_domains)?;
            ids.at("values/ids")?.set_numbers(&numbers)?;
        }
        Ok(())
    }
}

fn indices(node: &Node) -> Result<Vec<usize>> {
    let values =
        node.numbers().map(|number| number.as_i64().and_then(|value| usize::try_from(value).ok()));
    let all: Option<Vec<_>> = values.collect();
    all.ok_or_else(|| {
        Error::new(format!("{} holds something else than numbers of elements", node.place()))
    })
}

fn select(selection: &Node, source: &Source<'_>, selected: &mut Selected) -> Result<()> {
    let said = selection.get("domain_id").or_else(|| selection.get("domain"));
    let any = said.and_then(Node::text).as_deref() == Some("any");
    let wanted = said.and_then(Node::integer).unwrap_or(0);
    let destination = selection.get("destination_domain").and_then(Node::integer);
    for (index, (domain, number)) in source.domains.iter().zip(&source.numbers).enumerate() {
        if any || *number == wanted {
            choose(selection, index, domain, destination, selected)?;
        }
    }
    Ok(())
}

fn choose(
    selection: &Node,
    number: usize,
    domain: &Domain<'_>,
    destination: Option<i64>,
    selected: &mut Selected,
) -> Result<()> {
    let count = domain.elements.len();
    let kind = selection.existing("type")?.text().unwrap_or_default();
    let chosen: Vec<usize> = match kind.as_str() {
        "explicit" => indices(selection.existing("elements")?)?,
        "ranges" => {
            let ranges = indices(selection.existing("ranges")?)?;
            ranges.chunks_exact(2).flat_map(|range| range[0]..=range[1].min(count)).collect()
        }
        "logical" => {
            let cells = domain.cells.ok_or_else(|| {
                Error::new(format!("{}: the domain is no grid", selection.place()))
            })?;
            let many = cells.map(|cells| cells.max(1));
            let (start, end) =
                (indices(selection.existing("start")?)?, indices(selection.existing("end")?)?);
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
            let values =
                values.ok_or_else(|| Error::new(format!("there is no element field '{name}'")))?;
            let mut by_value: BTreeMap<i64, Vec<usize>> = BTreeMap::new();
            for (element, value) in values.numbers().enumerate() {
                by_value.entry(value.as_i64().unwrap_or(0)).or_default().push(element);
            }
            selected.extend(
                by_value.into_iter().map(|(value, elements)| (Some(value), (number, elements))),
            );
            return Ok(());
        }
        _ => {
            return Err(Error::new(format!(
                "'{kind}' is none of explicit, ranges, logical, field"
            )));
        }
    };
    if let Some(wrong) = chosen.iter().find(|element| **element >= count) {
        return Err(Error::new(format!("{}: element {wrong} of {count}", selection.place())));
    }
    selected.push((destination, (number, chosen)));
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
            let place =
                || domain.axes.iter().map(|(_, values)| (values[vertex] + 0.0).to_bits()).collect();
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
                let number =
                    NUMBERS.iter().find(|(name, _)| name == shape).map_or(0, |(_, number)| *number);
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

/// Writes a new domain of at least one piece.
fn write(group: &[Piece], domains: &[Domain<'_>], output: &mut Node) -> Result<Origins> {
    let first = &domains[group[0].0];
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
        coordset
            .at("values")?
            .child_named(name)?
            .set_numbers(&vertices.iter().map(value).collect::<Vec<_>>())?;
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
            let found = domains[number]
                .fields
                .iter()
                .find(|(known, vertex, _)| known == name && vertex == at_vertices);
            found.and_then(|(_, _, field)| field.get("values"))
        };
        let found: Option<Vec<_>> =
            rows.iter().map(|(number, row)| Some((values(*number)?, *row))).collect();
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
    Ok(Origins { topology: first.topology.clone(), vertices })
}
