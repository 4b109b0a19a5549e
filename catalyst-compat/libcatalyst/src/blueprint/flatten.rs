//! A mesh as tables: a row for each vertex and for each element.

use crate::blueprint::domain::{Domain, Element, numbers_of};
use crate::blueprint::mesh::domains;
use crate::datatype::Kind;
use crate::error::{Error, Result};
use crate::leaf::Number;
use crate::node::Node;

/// Makes the tables `vertex_data` and `element_data`. Their columns are the coordinates (below the name of the coordinate set, and
/// of the centres of elements below `element_centers`), the fields, `domain_id`, and `vertex_id` or `element_id`; a table
/// without columns is left out. Where a domain has no such field its rows hold the fill value.
///
/// Options: `topology`, a name; `field_names`, a list; `fill_value`, a number or one for `int` and one for `float`;
/// `add_vertex_locations`, `add_element_centers` and `add_domain_info`, where 0 leaves out.
///
/// # Errors
/// A domain cannot be read, the domains have different axes, or an option is of another type.
pub fn flatten(mesh: &Node, options: &Node) -> Result<Node> {
    let wanted = Wanted::read(options)?;
    let sources = domains(mesh);
    let read: Result<Vec<_>> =
        sources.iter().map(|domain| Domain::read(domain, wanted.topology.as_deref())).collect();
    let read = read?;
    let mut tables = Node::new();
    let (Some(source), Some(first)) = (sources.first(), read.first()) else {
        return Ok(tables);
    };
    let names =
        |domain: &Domain<'_>| domain.axes.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    if let Some(other) = read.iter().position(|domain| names(domain) != names(first)) {
        let place = sources[other].place();
        return Err(Error::new(format!(
            "{place}: its axes are not those of the first domain, {}",
            names(first).join(", ")
        )));
    }
    let coordset = source.get("coordsets").and_then(|coordsets| coordsets.get(&first.coordset));
    let numbers = numbers_of(&sources);
    for (of_vertices, table) in [(true, "vertex_data"), (false, "element_data")] {
        let count =
            |domain: &Domain<'_>| if of_vertices { domain.points() } else { domain.elements.len() };
        let mut columns = Node::new();
        if of_vertices && wanted.locations || !of_vertices && wanted.centers {
            let (group, kind) = if of_vertices {
                (first.coordset.as_str(), coordset.map_or(Kind::Float64, coordinate_kind))
            } else {
                ("element_centers", Kind::Float64)
            };
            for (axis, (name, _)) in first.axes.iter().enumerate() {
                let values = read.iter().flat_map(|domain| coordinates(domain, axis, of_vertices));
                fill(
                    columns.child_named(group)?.child_named(name)?,
                    kind,
                    values.map(Number::Double),
                )?;
            }
        }
        for name in wanted.fields_of(&read) {
            let of = |domain| values_of(domain, &name, of_vertices);
            let Some(reference) = read.iter().find_map(of) else {
                continue;
            };
            let kind = widest(&mut leaves(reference)).unwrap_or(Kind::Float64);
            let otherwise = if kind.is_floating() {
                Number::Double(wanted.float)
            } else {
                Number::Signed(wanted.int)
            };
            let rows = |component: Option<usize>| {
                read.iter().flat_map(move |domain| {
                    let leaf = of(domain).and_then(|values| match component {
                        Some(index) if reference.kind() == Kind::Object => {
                            values.get(reference.name_of(index))
                        }
                        Some(index) => values.child(index),
                        None => Some(values),
                    });
                    let there = leaf.into_iter().flat_map(Node::numbers);
                    there.chain(std::iter::repeat(otherwise)).take(count(domain))
                })
            };
            let column = columns.child_named(&name)?;
            if reference.count() == 0 {
                fill(column, kind, rows(None))?;
            }
            for (index, (component, _)) in reference.children().enumerate() {
                let target = if reference.kind() == Kind::List {
                    column.append()?
                } else {
                    column.child_named(component)?
                };
                fill(target, kind, rows(Some(index)))?;
            }
        }
        if columns.count() == 0 {
            continue;
        }
        if wanted.domain_info {
            let row = |domain: &Domain<'_>| {
                (0..count(domain)).map(|row| i64::try_from(row).unwrap_or(i64::MAX))
            };
            let of_domains: Vec<i64> = read
                .iter()
                .zip(&numbers)
                .flat_map(|(domain, number)| row(domain).map(|_| *number))
                .collect();
            let rows: Vec<i64> = read.iter().flat_map(row).collect();
            columns.child_named("domain_id")?.set_numbers(&of_domains)?;
            columns
                .child_named(if of_vertices { "vertex_id" } else { "element_id" })?
                .set_numbers(&rows)?;
        }
        tables.child_named(table)?.child_named("values")?.take(columns)?;
    }
    Ok(tables)
}

/// What the tables are to hold.
struct Wanted {
    topology: Option<String>,
    fields: Option<Vec<String>>,
    float: f64,
    int: i64,
    locations: bool,
    centers: bool,
    domain_info: bool,
}

impl Wanted {
    fn read(options: &Node) -> Result<Self> {
        let text = |node: &Node| {
            node.text().ok_or_else(|| Error::new(format!("{} is no text", node.place())))
        };
        let number = |node: &Node| {
            node.number(0).ok_or_else(|| Error::new(format!("{} is no number", node.place())))
        };
        let flag = |name: &str| {
            options
                .get(name)
                .map_or(Ok(true), |node| number(node).map(|value| value.as_f64().abs() >= 1.0))
        };
        let fields = match options.get("field_names") {
            Some(names) if names.kind() != Kind::List => {
                return Err(Error::new(format!("{} is no list of names", names.place())));
            }
            names => names.map(|names| {
                names.children().map(|(_, name)| text(name)).collect::<Result<Vec<_>>>()
            }),
        };
        let of_kind = |name: &str| match options.get("fill_value") {
            Some(each) if each.kind() == Kind::Object => each.get(name).map(number).transpose(),
            all => all.map(number).transpose(),
        };
        Ok(Self {
            topology: options.get("topology").map(text).transpose()?,
            fields: fields.transpose()?.filter(|names| !names.is_empty()),
            float: of_kind("float")?.map_or(0.0, Number::as_f64),
            int: of_kind("int")?.map_or(0, integer),
            locations: flag("add_vertex_locations")?,
            centers: flag("add_element_centers")?,
            domain_info: flag("add_domain_info")?,
        })
    }

    /// The names of the fields: as the options have them, else as the domains bring them.
    fn fields_of(&self, read: &[Domain<'_>]) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for name in read.iter().flat_map(|domain| &domain.fields).map(|(name, ..)| name) {
            if !names.contains(name) {
                names.push(name.clone());
            }
        }
        match &self.fields {
            Some(wanted) => wanted.iter().filter(|name| names.contains(name)).cloned().collect(),
            None => names,
        }
    }
}

/// The values of a field that belongs to vertices, or to elements.
fn values_of<'a>(domain: &Domain<'a>, name: &str, of_vertices: bool) -> Option<&'a Node> {
    let (.., field) =
        domain.fields.iter().find(|(known, at, _)| known == name && *at == of_vertices)?;
    field.get("values")
}

/// A tree's leaves with numbers.
fn leaves(node: &Node) -> Box<dyn Iterator<Item = &Node> + '_> {
    if node.kind().is_number() {
        return Box::new(std::iter::once(node));
    }
    Box::new(node.children().flat_map(|(_, child)| leaves(child)))
}

/// The widest type: a floating one if there is any, else a signed one.
fn widest(leaves: &mut dyn Iterator<Item = &Node>) -> Option<Kind> {
    leaves.map(Node::kind).max_by_key(|kind| (kind.is_floating(), kind.is_signed(), kind.bytes()))
}

/// The type of a coordinate set's coordinates.
fn coordinate_kind(coordset: &Node) -> Kind {
    let parts = ["values", "origin", "spacing"].into_iter().filter_map(|name| coordset.get(name));
    widest(&mut parts.flat_map(leaves)).unwrap_or(Kind::Float64)
}

#[expect(clippy::cast_precision_loss, reason = "no element has so many vertices")]
fn coordinates(domain: &Domain<'_>, axis: usize, of_vertices: bool) -> Vec<f64> {
    let Some((_, values)) = domain.axes.get(axis) else {
        return Vec::new();
    };
    if of_vertices {
        return values.clone();
    }
    let mean = |vertices: &mut dyn Iterator<Item = &usize>| {
        let (sum, count) = vertices
            .fold((0.0, 0_usize), |(sum, count), vertex| (sum + values[*vertex], count + 1));
        sum / count.max(1) as f64
    };
    // A vertex of a polyhedron counts as often as faces have it.
    let centre = |element: &Element| match element.faces.as_slice() {
        [] => mean(&mut element.vertices.iter()),
        faces => mean(&mut faces.iter().flatten()),
    };
    domain.elements.iter().map(centre).collect()
}

#[expect(clippy::cast_possible_truncation, reason = "what does not fit becomes what is nearest")]
fn integer(number: Number) -> i64 {
    number.as_i64().unwrap_or_else(|| number.as_f64() as i64)
}

/// Sets an array of a type.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the type is the widest of the first domain's"
)]
fn fill(target: &mut Node, kind: Kind, values: impl Iterator<Item = Number>) -> Result<()> {
    let unsigned = |number: Number| {
        if let Number::Unsigned(value) = number { value } else { integer(number) as u64 }
    };
    match kind {
        Kind::Int8 => {
            target.set_numbers(&values.map(|value| integer(value) as i8).collect::<Vec<_>>())
        }
        Kind::Int16 => {
            target.set_numbers(&values.map(|value| integer(value) as i16).collect::<Vec<_>>())
        }
        Kind::Int32 => {
            target.set_numbers(&values.map(|value| integer(value) as i32).collect::<Vec<_>>())
        }
        Kind::Int64 => target.set_numbers(&values.map(integer).collect::<Vec<_>>()),
        Kind::Uint8 => {
            target.set_numbers(&values.map(|value| unsigned(value) as u8).collect::<Vec<_>>())
        }
        Kind::Uint16 => {
            target.set_numbers(&values.map(|value| unsigned(value) as u16).collect::<Vec<_>>())
        }
        Kind::Uint32 => {
            target.set_numbers(&values.map(|value| unsigned(value) as u32).collect::<Vec<_>>())
        }
        Kind::Uint64 => target.set_numbers(&values.map(unsigned).collect::<Vec<_>>()),
        Kind::Float32 => {
            target.set_numbers(&values.map(|value| value.as_f64() as f32).collect::<Vec<_>>())
        }
        _ => target.set_numbers(&values.map(Number::as_f64).collect::<Vec<_>>()),
    }
}
