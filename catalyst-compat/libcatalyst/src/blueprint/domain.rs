//! One domain of a mesh as points and elements, whatever its coordinate set and topology.

use std::collections::HashSet;

use crate::blueprint::parts::vertices_of;
use crate::error::{Error, Result};
use crate::node::Node;

/// An element: its shape and its vertices.
#[derive(Debug, Clone, PartialEq)]
pub struct Element {
    /// The shape, as Blueprint names it.
    pub shape: String,
    /// The vertices, in the order of the shape; of a polyhedron each once, in the order its faces bring them.
    pub vertices: Vec<usize>,
    /// The faces of a polyhedron by their vertices; none for other shapes.
    pub faces: Vec<Vec<usize>>,
}

impl Element {
    fn new(shape: impl Into<String>, vertices: Vec<usize>) -> Self {
        Self { shape: shape.into(), vertices, faces: Vec::new() }
    }

    fn polyhedron(faces: Vec<Vec<usize>>) -> Self {
        let mut seen = HashSet::new();
        let vertices =
            faces.iter().flatten().copied().filter(|vertex| seen.insert(*vertex)).collect();
        Self { shape: "polyhedral".into(), vertices, faces }
    }
}

/// The name of an axis, and the coordinates of points along it.
pub type Axis = (String, Vec<f64>);

/// Points, elements and fields of a domain.
pub struct Domain<'a> {
    /// The name of the coordinate set.
    pub coordset: String,
    /// The name of the topology.
    pub topology: String,
    /// The axes, each with the coordinates of all points along it.
    pub axes: Vec<Axis>,
    /// The elements.
    pub elements: Vec<Element>,
    /// Numbers of elements along `i`, `j`, `k` where the topology has them.
    pub cells: Option<[usize; 3]>,
    /// The fields of the topology: name, whether they belong to vertices, and the field.
    pub fields: Vec<(String, bool, &'a Node)>,
}

/// The most points that implicit coordinates are written out for.
const MOST_POINTS: usize = 1 << 28;

impl<'a> Domain<'a> {
    /// Reads a domain; without a name its first topology.
    ///
    /// # Errors
    /// Something is missing or refers to what is not there.
    pub fn read(mesh: &'a Node, topology: Option<&str>) -> Result<Self> {
        let topologies = mesh.existing("topologies")?;
        let name = topology.map_or_else(|| topologies.name_of(0).to_owned(), str::to_owned);
        let found = topologies.existing(&name)?;
        let coordset = text(found, "coordset")?;
        let (axes, points) = points(mesh.existing(&format!("coordsets/{coordset}"))?)?;
        let count = axes.first().map_or(0, |(_, values)| values.len());
        let kind = text(found, "type")?;
        let cells = match kind.as_str() {
            "structured" => Some(dims(found.existing("elements/dims")?)?),
            "uniform" | "rectilinear" => Some(points.map(|count| count.saturating_sub(1))),
            _ => None,
        };
        let corners = cells.and_then(|cells| {
            cells
                .iter()
                .try_fold(1_usize, |product, cells| product.checked_mul(cells.checked_add(1)?))
        });
        if cells.is_some() && corners.is_none_or(|corners| corners > count) {
            return Err(Error::new(format!(
                "{}: a grid of {cells:?} elements needs more than {count} points",
                found.place()
            )));
        }
        let elements = match (kind.as_str(), cells) {
            ("points", _) => (0..count).map(|index| Element::new("point", vec![index])).collect(),
            (_, Some(cells)) => grid(cells),
            _ => unstructured(found)?,
        };
        if let Some(wrong) =
            elements.iter().flat_map(|element| &element.vertices).find(|vertex| **vertex >= count)
        {
            return Err(Error::new(format!("{}: vertex {wrong} of {count} points", found.place())));
        }
        let mut fields = Vec::new();
        for (field, node) in mesh.get("fields").into_iter().flat_map(Node::children) {
            let association = node.get("association").and_then(Node::text).unwrap_or_default();
            let here = node.get("topology").and_then(Node::text).as_deref() == Some(name.as_str());
            let Some(values) = node.get("values").filter(|_| here && !association.is_empty())
            else {
                continue;
            };
            let wanted = if association == "vertex" { count } else { elements.len() };
            let fits = |leaf: &Node| usize::try_from(leaf.datatype().elements) == Ok(wanted);
            if !(if values.count() == 0 {
                fits(values)
            } else {
                values.children().all(|(_, leaf)| fits(leaf))
            }) {
                return Err(Error::new(format!(
                    "{}: {wanted} values are expected",
                    values.place()
                )));
            }
            fields.push((field.to_owned(), association == "vertex", node));
        }
        Ok(Self { coordset, topology: name, axes, elements, cells, fields })
    }

    /// The number of points.
    #[must_use]
    pub fn points(&self) -> usize {
        self.axes.first().map_or(0, |(_, values)| values.len())
    }
}

/// The numbers of the domains: what each says of itself in `state/domain_id`, or its place where one says nothing.
#[must_use]
pub fn numbers_of(domains: &[&Node]) -> Vec<i64> {
    let said = |domain: &&Node| {
        domain.find("state/domain_id").filter(|id| id.kind().is_integer()).and_then(Node::integer)
    };
    let said: Option<Vec<i64>> = domains.iter().map(said).collect();
    said.unwrap_or_else(|| (0..).take(domains.len()).collect())
}

fn text(node: &Node, name: &str) -> Result<String> {
    let found = node.existing(name)?;
    found.text().ok_or_else(|| Error::new(format!("{} is no text", found.place())))
}

/// Numbers by `i`, `j`, `k`; 1 where there is none.
fn dims(node: &Node) -> Result<[usize; 3]> {
    let mut dims = [1; 3];
    for (dim, name) in dims.iter_mut().zip(["i", "j", "k"]) {
        if let Some(value) = node.get(name) {
            let count = value.integer().and_then(|count| usize::try_from(count).ok());
            *dim = count.ok_or_else(|| {
                Error::new(format!("{} is no number of points or elements", value.place()))
            })?;
        }
    }
    if node.get("j").is_none() {
        dims[1] = 0;
    }
    if node.get("k").is_none() {
        dims[2] = 0;
    }
    Ok(dims)
}

/// The axes of a coordinate set with all coordinates, and the numbers of points along each, 1 where there is no such direction.
#[expect(clippy::cast_precision_loss, reason = "no grid has so many points along one axis")]
fn points(coordset: &Node) -> Result<(Vec<Axis>, [usize; 3])> {
    const NAMES: [&str; 3] = ["x", "y", "z"];
    let along: Vec<Axis> = match text(coordset, "type")?.as_str() {
        "uniform" => {
            let dims = dims(coordset.existing("dims")?)?;
            let number = |path: String, otherwise: f64| {
                coordset
                    .find(&path)
                    .and_then(|node| node.number(0))
                    .map_or(otherwise, |number| number.as_f64())
            };
            let named = crate::blueprint::index::axes(coordset);
            let axis = |(index, count): (usize, &usize)| {
                let name = named.get(index).copied().unwrap_or(NAMES[index]);
                let (first, step) = (
                    number(format!("origin/{name}"), 0.0),
                    number(format!("spacing/d{name}"), 1.0),
                );
                (
                    name.to_owned(),
                    (0..(*count).min(MOST_POINTS))
                        .map(|point| first + step * point as f64)
                        .collect(),
                )
            };
            dims.iter().enumerate().filter(|(_, count)| **count > 0).map(axis).collect()
        }
        kind => {
            let values = coordset.existing("values")?;
            let axes: Vec<_> = values
                .children()
                .map(|(name, leaf)| {
                    (
                        name.to_owned(),
                        leaf.numbers().map(|number| number.as_f64()).collect::<Vec<_>>(),
                    )
                })
                .collect();
            if kind == "explicit" {
                let count = axes.first().map_or(0, |(_, values)| values.len());
                if axes.iter().any(|(_, values)| values.len() != count) {
                    return Err(Error::new(format!(
                        "{}: components of different lengths",
                        values.place()
                    )));
                }
                return Ok((axes, [count, 1, 1]));
            }
            axes
        }
    };
    let mut counts = [1; 3];
    for (count, (_, values)) in counts.iter_mut().zip(&along) {
        *count = values.len();
    }
    let total = counts.iter().try_fold(1_usize, |product, count| product.checked_mul(*count));
    let total =
        total.filter(|total| *total <= MOST_POINTS).ok_or_else(|| Error::new("too many points"))?;
    let stride = [1, counts[0], counts[0] * counts[1]];
    let spread = |(axis, (name, values)): (usize, (String, Vec<f64>))| {
        let all = (0..total).map(|point| values[point / stride[axis] % counts[axis]]).collect();
        (name, all)
    };
    Ok((along.into_iter().take(3).enumerate().map(spread).collect(), counts))
}

/// The elements of a grid, with `i` fastest.
fn grid(cells: [usize; 3]) -> Vec<Element> {
    let dimension = cells.iter().filter(|count| **count > 0).count();
    let shape = ["point", "line", "quad", "hex"][dimension];
    let row = cells[0] + 1;
    let layer = row * (cells[1] + 1);
    let corners: &[usize] = &[0, 1, 1 + row, row, layer, layer + 1, layer + 1 + row, layer + row];
    let many = cells.map(|count| count.max(1));
    let mut elements = Vec::new();
    for k in 0..many[2] {
        for j in 0..many[1] {
            for i in 0..many[0] {
                let first = i + j * row + k * layer;
                let vertices =
                    corners.iter().take(1 << dimension).map(|corner| first + corner).collect();
                elements.push(Element::new(shape, vertices));
            }
        }
    }
    elements
}

/// The elements of an unstructured topology: one group of them, or several by name.
fn unstructured(topology: &Node) -> Result<Vec<Element>> {
    let elements = topology.existing("elements")?;
    let faces = topology.get("subelements");
    if elements.get("shape").is_some() || elements.get("connectivity").is_some() {
        return group(elements, faces);
    }
    let mut all = Vec::new();
    for (index, (name, member)) in elements.children().enumerate() {
        let of_member = faces
            .and_then(|faces| if name.is_empty() { faces.child(index) } else { faces.get(name) });
        all.extend(group(member, of_member)?);
    }
    Ok(all)
}

/// The elements of a group; polyhedra name their faces, which are a group too.
fn group(elements: &Node, faces: Option<&Node>) -> Result<Vec<Element>> {
    let integers = |name: &str| -> Result<Vec<i64>> {
        let node = elements.existing(name)?;
        let all: Option<Vec<i64>> = node.numbers().map(|number| number.as_i64()).collect();
        all.ok_or_else(|| {
            Error::new(format!("{} holds something else than integers", node.place()))
        })
    };
    let shape = text(elements, "shape")?;
    let connectivity = integers("connectivity")?;
    let entries = |from: i64, count: i64| -> Result<Vec<usize>> {
        let end = from.checked_add(count);
        let range = usize::try_from(from).ok().zip(end.and_then(|end| usize::try_from(end).ok()));
        let found = range.and_then(|(from, end)| connectivity.get(from..end));
        let found = found.ok_or_else(|| {
            Error::new(format!("{}: an element reaches beyond the connectivity", elements.place()))
        })?;
        let all: Option<Vec<usize>> =
            found.iter().map(|entry| usize::try_from(*entry).ok()).collect();
        all.ok_or_else(|| {
            Error::new(format!("{}: the connectivity has a negative entry", elements.place()))
        })
    };
    if let Some(size) = vertices_of(&shape) {
        let count = i64::try_from(connectivity.len()).unwrap_or(i64::MAX);
        if count % size != 0 {
            return Err(Error::new(format!(
                "{}: {count} vertices are no whole number of '{shape}', which has {size}",
                elements.place()
            )));
        }
        return (0..count / size)
            .map(|index| Ok(Element::new(shape.clone(), entries(index * size, size)?)))
            .collect();
    }
    let sizes = integers("sizes")?;
    let offsets = match elements.get("offsets") {
        Some(_) => integers("offsets")?,
        None => sizes
            .iter()
            .scan(0_i64, |sum, size| Some(std::mem::replace(sum, sum.saturating_add(*size))))
            .collect(),
    };
    let shapes: Vec<String> = if shape == "mixed" {
        let map: Vec<_> = elements.existing("shape_map")?.children().collect();
        let name = |number: &i64| {
            map.iter()
                .find(|(_, value)| value.integer() == Some(*number))
                .map(|(name, _)| (*name).to_owned())
        };
        let named: Option<Vec<_>> = integers("shapes")?.iter().map(name).collect();
        named.ok_or_else(|| {
            Error::new(format!("{}: a shape is not in the shape map", elements.place()))
        })?
    } else {
        vec![shape; sizes.len()]
    };
    if shapes.len() != sizes.len() || offsets.len() != sizes.len() {
        return Err(Error::new(format!(
            "{}: sizes, offsets and shapes of different lengths",
            elements.place()
        )));
    }
    let known = match faces.filter(|_| shapes.iter().any(|shape| shape == "polyhedral")) {
        Some(faces) => group(faces, None)?,
        None => Vec::new(),
    };
    let face = |index: usize| {
        let found = known.get(index).map(|face| face.vertices.clone());
        found.ok_or_else(|| {
            Error::new(format!(
                "{}: face {index} of {} in 'subelements'",
                elements.place(),
                known.len()
            ))
        })
    };
    let each = shapes.into_iter().zip(offsets.iter().zip(&sizes));
    each.map(|(shape, (offset, size))| {
        let entries = entries(*offset, *size)?;
        if shape == "polyhedral" {
            return Ok(Element::polyhedron(entries.into_iter().map(face).collect::<Result<_>>()?));
        }
        Ok(Element::new(shape, entries))
    })
    .collect()
}

/// Gathers rows of leaves of one type into a new leaf.
///
/// # Errors
/// The leaves are of different types, or a row is not there.
pub fn gather(rows: &[(&Node, usize)]) -> Result<Node> {
    let mut gathered = Node::new();
    let Some((first, _)) = rows.first() else {
        return Ok(gathered);
    };
    let count = i64::try_from(rows.len()).unwrap_or(i64::MAX);
    gathered.make_room(crate::datatype::Datatype::compact(first.kind(), count))?;
    for (index, (leaf, row)) in rows.iter().enumerate() {
        let to = i64::try_from(index).unwrap_or(i64::MAX);
        gathered.write_one(to, leaf, i64::try_from(*row).unwrap_or(i64::MAX))?;
    }
    Ok(gathered)
}

/// As [`gather`], for values that may have components.
///
/// # Errors
/// As [`gather`], or a component is missing.
pub fn gather_values(rows: &[(&Node, usize)]) -> Result<Node> {
    let Some((first, _)) = rows.first() else {
        return Ok(Node::new());
    };
    if first.count() == 0 {
        return gather(rows);
    }
    let mut gathered = Node::new();
    for (name, _) in first.children() {
        let components: Result<Vec<_>> =
            rows.iter().map(|(values, row)| Ok((values.existing(name)?, *row))).collect();
        gathered.child_named(name)?.take(gather(&components?)?)?;
    }
    Ok(gathered)
}
