//! Meshes and fields of Python, lent to the adaptor for the length of a call.

use std::sync::Arc;

use numpy::PyUntypedArray;
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyMapping, PyString, PyTuple};
use tombolo::deform::mesh::{CellType, Vector};
use tombolo::foreign::mesh::{
    Block, COMPONENTS, Channel, Coordset, Domain, Faces, Field, Label, Lending, Mask, Roles, Rows,
    Topology, Types,
};
use tombolo::foreign::{Array, NumberType};
use tombolo::pipelines::extract::{Association, check_field_length};
use tombolo::pipelines::language::nearest;

use crate::array::{Layout, as_array};
use crate::error::argument;
use crate::given::{Given, MESH, Read, entries, is_mapping, is_mesh, name, part, python};

/// The parts of a mesh, as the class `tombolo.Mesh` and a dict call them.
const PARTS: [&str; 8] = [
    "points",
    "cells",
    "fields",
    "faces",
    "vertex_features",
    "ghost_cells",
    "global_vertices",
    "global_cells",
];
/// How cells of several types are given as VTK has them.
const OF_VTK: [&str; 3] = ["connectivity", "offsets", "types"];

/// Keeps alive whatever of Python's is lent, and the numbers of Rust's that go with it.
#[derive(Default)]
pub(crate) struct Lender {
    owners: Vec<Py<PyAny>>,
    /// Numbers of features, to each of which an array without a stride points.
    numbers: Vec<Arc<[i64]>>,
}

/// The channels of a call, lent while other threads of Python run.
pub(crate) struct Channels<'call>(pub(crate) Vec<Channel<'call>>);

impl Channels<'_> {
    /// The name of each channel, and how many coordinates a vertex of it has.
    pub(crate) fn dimensions(&self) -> impl Iterator<Item = (&str, usize)> {
        let dimension = |channel: &Channel<'_>| {
            channel.blocks.first().map_or(3, |block| block.domain.coordset.dimension())
        };
        self.0.iter().map(move |channel| (channel.name.as_str(), dimension(channel)))
    }
}

// SAFETY: the addresses within are those of arrays that a `Lender` keeps alive; any thread can read
// them. Whoever changes a solver's arrays while it shows them breaks the solver's own promise.
unsafe impl Send for Channels<'_> {}

/// Whether somebody looks at the fields and features of a channel, of which the rest is lent.
type Reads<'a> = &'a dyn Fn(&Channel<'_>) -> bool;
/// Faces by the numbers of their features, and the names of those.
type NamedFaces<'call> = (Vec<Faces<'call>>, Vec<(i64, String)>);

/// A cell type by VTK's number or by its name.
fn cell_type(given: &Given<'_>, what: &str) -> Read<(CellType, usize)> {
    let text = given.to_string();
    let known = CellType::ALL
        .into_iter()
        .filter_map(|cell_type| Some((cell_type, cell_type.vertex_count()?)));
    // A text is no number: to find that out costs more than all else here.
    let found = match given.cast::<PyString>() {
        Ok(_) => CellType::ALL.into_iter().find(|cell_type| cell_type.name() == text),
        Err(_) => given.extract::<u8>().ok().and_then(CellType::from_vtk),
    };
    let found = found.and_then(|found| Some((found, found.vertex_count()?)));
    found.ok_or_else(|| {
        if is_curved(given, &text) {
            let found = format!("cells of type '{text}'");
            return argument(what, found, "linear cells: of PyVista's, mesh.linear_copy()").into();
        }
        let names: Vec<&str> = known.map(|(cell_type, _)| cell_type.name()).collect();
        let near = nearest(&text, names.iter().copied());
        let near = near.map_or_else(String::new, |near| format!(" (did you mean '{near}'?)"));
        let expected = format!("one of: {}{near}; or VTK's number of one", names.join(", "));
        argument(what, format!("cells of type '{text}'"), expected).into()
    })
}

/// Whether a cell type has vertices on its edges too: meshio calls it after a linear one and how
/// many there are, and VTK counts it from 21 on.
fn is_curved(given: &Given<'_>, text: &str) -> bool {
    let name = text.trim_end_matches(|end: char| end.is_ascii_digit());
    let is_named = name.len() < text.len()
        && CellType::ALL.into_iter().any(|cell_type| cell_type.name() == name);
    is_named || given.extract::<u8>().is_ok_and(|number| (21..=37).contains(&number))
}

impl Lender {
    /// Where an array lies; it stays there as long as this lives.
    fn layout(&mut self, given: &Given<'_>, what: &str) -> Read<Layout> {
        let array = as_array(given, what)?;
        let layout = Layout::of(&array, what)?;
        self.owners.push(array.into_any().unbind());
        Ok(layout)
    }

    /// One number for each vertex or cell.
    fn list<'call>(&mut self, given: &Given<'_>, what: &str) -> Read<Array<'call>> {
        let layout = self.layout(given, what)?;
        if layout.axes != 1 {
            let found = format!("an array of shape {}", layout.shape_text());
            return Err(argument(what, found, "an array of one axis").into());
        }
        // SAFETY: this keeps the array alive, and the caller of `Run.execute` leaves it as it is.
        Ok(unsafe { layout.component(0, 0) })
    }

    /// The components of tuples: an array of one axis or more, or one array for each component.
    fn components<'call>(&mut self, given: &Given<'_>, what: &str) -> Read<Vec<Array<'call>>> {
        let separate: Vec<Given<'_>> = match (given.cast::<PyTuple>(), given.cast::<PyList>()) {
            (Ok(tuple), _) => tuple.iter().collect(),
            (_, Ok(list)) => list.iter().take(COMPONENTS + 1).collect(),
            _ => Vec::new(),
        };
        // A list of numbers is an array.
        let is_separate = separate.iter().all(|one| one.cast::<PyUntypedArray>().is_ok());
        if is_separate && (1..=COMPONENTS).contains(&separate.len()) {
            let arrays: Vec<Array<'call>> = separate
                .iter()
                .enumerate()
                .map(|(index, one)| self.list(one, &format!("{what}, component {index}")))
                .collect::<Read<_>>()?;
            let first = arrays.first().map_or(0, Array::len);
            if let Some(other) = arrays.iter().find(|array| array.len() != first) {
                let found = format!("components of {first} and of {} values", other.len());
                return Err(argument(what, found, "components of one length").into());
            }
            return Ok(arrays);
        }
        let layout = self.layout(given, what)?;
        let [_, rows, columns] = layout.shape;
        if layout.axes == 0 || rows * columns > COMPONENTS {
            let found = format!("an array of shape {}", layout.shape_text());
            let expected = format!("(n,), or (n, k) of at most {COMPONENTS} components");
            return Err(argument(what, found, expected).into());
        }
        let every = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
        // SAFETY: as in `list`; the components are those of the shape.
        Ok(every.map(|(row, column)| unsafe { layout.component(row, column) }).collect())
    }

    /// Cells of one type, a row each.
    fn uniform<'call>(
        &mut self,
        (cell_type, vertices): (CellType, usize),
        given: &Given<'_>,
        what: String,
    ) -> Read<Topology<'call>> {
        let layout = self.layout(given, &what)?;
        // An empty list, as a rank without any of these has it, is an array of one axis for NumPy.
        let is_empty = layout.axes == 1 && layout.shape[0] == 0;
        if !is_empty && (layout.axes != 2 || layout.shape[1] != vertices) {
            let found = format!("an array of shape {}", layout.shape_text());
            let expected = format!("(m, {vertices}), a row for each {cell_type}");
            return Err(argument(what, found, expected).into());
        }
        if layout.is_truth || layout.number.is_real() && layout.shape[0] > 0 {
            let name = if layout.is_truth { "bool" } else { layout.number.name() };
            let found = format!("an array of {name}");
            return Err(
                argument(what, found, "vertex numbers: int32, int64 or another integer").into()
            );
        }
        // SAFETY: as in `list`.
        let connectivity = unsafe { layout.table() };
        Ok(Topology::Uniform { cell_type, connectivity, label: Label::Words(what) })
    }

    /// Cells: by their types, or as VTK has them.
    fn topology<'call>(
        &mut self,
        given: Option<&Given<'_>>,
        vertices: usize,
        what: &str,
    ) -> Read<Topology<'call>> {
        let Some(given) = given else { return Ok(Topology::Points(vertices)) };
        let expected = "a dict from cell types to arrays (m, k), such as {'tetra': tets}";
        let mut entries = entries(given, what, expected)?;
        let named = |name: &str, entries: &[[Given<'_>; 2]]| {
            entries.iter().position(|[key, _]| key.eq(name).unwrap_or(false))
        };
        if named(OF_VTK[0], &entries).is_some() {
            let is_known =
                |key: &Given<'_>| OF_VTK.iter().any(|name| key.eq(name).unwrap_or(false));
            if let Some([other, _]) = entries.iter().find(|[key, _]| !is_known(key)) {
                let found = format!("'{other}' beside 'connectivity'");
                return Err(argument(what, found, "'connectivity', 'offsets' and 'types'").into());
            }
            let mut arrays = Vec::with_capacity(OF_VTK.len());
            for name in OF_VTK {
                let missing = || {
                    let expected = "'connectivity', 'offsets' and 'types'";
                    argument(what, format!("cells without '{name}'"), expected)
                };
                let [_, value] = &entries[named(name, &entries).ok_or_else(missing)?];
                arrays.push(self.list(value, &format!("{what}, {name}"))?);
            }
            let [connectivity, offsets, types] = arrays[..] else {
                return Err(argument(what, "other arrays", "three").into());
            };
            if offsets.len() != types.len() + 1 {
                let found = format!("{} offsets of {} cells", offsets.len(), types.len());
                let expected = "one more offset than there are cells, the first of them 0";
                return Err(argument(what, found, expected).into());
            }
            let map = CellType::ALL.into_iter().filter(|of| *of != CellType::Polyhedron);
            return Ok(Topology::Mixed {
                cells: Rows::between(connectivity, offsets, Label::Words(what.to_owned())),
                shapes: types,
                map: map.map(|cell_type| (i64::from(cell_type.vtk()), cell_type)).collect(),
                faces: None,
                label: Label::Words(format!("{what}, types")),
                expected: "VTK's number of a type of linear cells",
            });
        }
        if let [[key, value]] = &entries[..] {
            return self.uniform(cell_type(key, what)?, value, format!("{what}['{key}']"));
        }
        let of_types = entries.drain(..).map(|[key, value]| {
            self.uniform(cell_type(&key, what)?, &value, format!("{what}['{key}']"))
        });
        Ok(Topology::Types(Types::new(of_types.collect::<Read<_>>()?)))
    }

    /// The named parts of the boundary, and the names by their numbers.
    fn faces<'call>(&mut self, given: &Given<'_>, what: &str) -> Read<NamedFaces<'call>> {
        let expected = "a dict from names to faces: arrays (m, 3) or (m, 4)";
        let (mut faces, mut names) = (Vec::new(), Vec::new());
        let parts = entries(given, what, expected)?;
        let numbers: Arc<[i64]> = (0..).take(parts.len()).collect();
        self.numbers.push(Arc::clone(&numbers));
        for (number, [key, value]) in numbers.iter().zip(parts) {
            let part = name(&key, what)?;
            let what = format!("{what}['{part}']");
            names.push((*number, part));
            let mut topologies = Vec::new();
            if value.cast::<PyMapping>().is_ok() {
                for [key, value] in entries(&value, &what, expected)? {
                    let of = cell_type(&key, &what)?;
                    topologies.push(self.uniform(of, &value, format!("{what}['{key}']"))?);
                }
            } else {
                let layout = Layout::of(&as_array(&value, &what)?, &what)?;
                let of = match (layout.axes, layout.shape[1]) {
                    (2, 4) => (CellType::Quad, 4),
                    _ => (CellType::Triangle, 3),
                };
                topologies.push(self.uniform(of, &value, what)?);
            }
            for topology in topologies {
                let first: *const i64 = number;
                // SAFETY: one number, over and over; this keeps it alive.
                let tags = unsafe {
                    Array::new(first.cast(), topology.cell_count(), 0, NumberType::I64, false)
                };
                faces.push(Faces { topology, tags });
            }
        }
        Ok((faces, names))
    }

    fn field<'call>(
        &mut self,
        channel: &str,
        [key, value]: &[Given<'_>; 2],
        counts: (usize, usize),
    ) -> Read<Field<'call>> {
        let field = name(key, &format!("channel '{channel}', the name of a field"))?;
        let what = format!("channel '{channel}', field '{field}'");
        // A `tombolo.Field` states where its values are.
        let is_array = value.cast::<PyUntypedArray>().is_ok();
        let association =
            if is_array { Ok(None) } else { value.getattr_opt(intern!(value.py(), "association")) };
        let stated = match association.map_err(python(&what))? {
            Some(association) => Some((
                value.getattr(intern!(value.py(), "values")).map_err(python(&what))?,
                association,
            )),
            None => None,
        };
        let components =
            self.components(stated.as_ref().map_or(value, |(values, _)| values), &what)?;
        let length = components.first().map_or(0, Array::len);
        let (vertices, cells) = counts;
        let association = match stated {
            Some((_, stated)) => match stated.to_string().as_str() {
                "vertex" => Association::Vertex,
                "element" => Association::Element,
                other => {
                    let found = format!("the association '{other}'");
                    return Err(argument(what, found, "'vertex' or 'element'").into());
                }
            },
            None if length == vertices && length == cells && length > 0 => {
                let found = format!("{length} values, as many as there are vertices and cells");
                let expected =
                    "tombolo.Field(values, 'vertex') or tombolo.Field(values, 'element')";
                return Err(argument(what, found, expected).into());
            }
            None if length == vertices => Association::Vertex,
            None if length == cells => Association::Element,
            None => {
                let expected = format!("{vertices} for its vertices, or {cells} for its cells");
                return Err(argument(what, format!("{length} values"), expected).into());
            }
        };
        check_field_length(channel, (&field, association), length, counts)?;
        Ok(Field::new(field, association, components))
    }

    /// A channel, whose fields and features are lent where somebody `reads` it.
    fn channel<'call>(
        &mut self,
        channel: String,
        mesh: &Given<'_>,
        reads: Reads<'_>,
    ) -> Read<Channel<'call>> {
        let py = mesh.py();
        let path = format!("channel '{channel}'");
        if is_mapping(mesh, &path)? {
            for [key, _] in entries(mesh, &path, MESH)? {
                let key = key.to_string();
                if !PARTS.contains(&key.as_str()) {
                    let near = nearest(&key, PARTS).map_or_else(
                        || format!("one of: {}", PARTS.join(", ")),
                        |near| format!("one of: {} (did you mean '{near}'?)", PARTS.join(", ")),
                    );
                    return Err(argument(path, format!("the part '{key}'"), near).into());
                }
            }
        }
        let points = part(mesh, &path, intern!(py, "points"))?;
        let points = points.ok_or_else(|| argument(&path, "no points", "an array (n, 3)"))?;
        let axes = self.axes(&points, &format!("{path}, points"))?;
        let coordset = Coordset::Explicit { axes };
        let vertices = coordset.vertex_count();
        let cells = part(mesh, &path, intern!(py, "cells"))?;
        let topology = self.topology(cells.as_ref(), vertices, &format!("{path}, cells"))?;
        let label = Label::Words(path);
        let domain = Domain {
            coordset,
            topology,
            fields: Vec::new(),
            faces: Vec::new(),
            roles: Roles::default(),
            label: label.clone(),
        };
        let mut channel = Channel {
            name: channel,
            blocks: vec![Block { name: String::new(), domain, mask: Mask::default() }],
            label,
            ..Channel::default()
        };
        if reads(&channel) {
            self.lend_rest(&mut channel, mesh)?;
        }
        Ok(channel)
    }

    /// Lends what a channel has beside its points and cells.
    fn lend_rest<'call>(&mut self, channel: &mut Channel<'call>, mesh: &Given<'_>) -> Read<()> {
        let py = mesh.py();
        let Channel { name, blocks, feature_names, label, .. } = channel;
        let path = label.to_string();
        for Block { domain, .. } in blocks {
            let counts = (domain.coordset.vertex_count(), domain.topology.cell_count());
            if let Some(given) = part(mesh, &path, intern!(py, "fields"))? {
                let what = format!("{path}, fields");
                for entry in entries(&given, &what, "a dict from names to arrays")? {
                    domain.fields.push(self.field(name, &entry, counts)?);
                }
            }
            if let Some(given) = part(mesh, &path, intern!(py, "faces"))? {
                (domain.faces, *feature_names) = self.faces(&given, &format!("{path}, faces"))?;
            }
            let mut list = |name: &Bound<'_, PyString>| -> Read<Option<Array<'call>>> {
                let given = part(mesh, &path, name)?;
                given.map(|given| self.list(&given, &format!("{path}, {name}"))).transpose()
            };
            domain.roles = Roles {
                ghosts: list(intern!(py, "ghost_cells"))?,
                global_vertices: list(intern!(py, "global_vertices"))?,
                global_cells: list(intern!(py, "global_cells"))?,
                vertex_features: list(intern!(py, "vertex_features"))?,
            };
        }
        Ok(())
    }

    /// The coordinates of vertices, along two or three axes.
    fn axes<'call>(&mut self, given: &Given<'_>, what: &str) -> Read<Vec<Array<'call>>> {
        let axes = self.components(given, what)?;
        if !(2..=3).contains(&axes.len()) {
            let found = format!("{} coordinate(s) for each vertex", axes.len());
            return Err(argument(what, found, "2 or 3: an array (n, 2) or (n, 3)").into());
        }
        Ok(axes)
    }

    /// Coordinates, copied, and along how many axes they are given; 0 along the others.
    pub(crate) fn points(&mut self, given: &Given<'_>, what: &str) -> Read<(Vec<Vector>, usize)> {
        let axes = self.axes(given, what)?;
        let at = |row: usize| {
            std::array::from_fn(|axis| axes.get(axis).map_or(0.0, |along| along.get(row)))
        };
        Ok(((0..axes.first().map_or(0, Array::len)).map(at).collect(), axes.len()))
    }

    /// The channels of a step: one mesh, or a dict from names to meshes.
    /// Their fields and features are lent where somebody `reads` them.
    pub(crate) fn channels<'call>(
        &mut self,
        given: &Given<'_>,
        reads: Reads<'_>,
    ) -> Read<Channels<'call>> {
        if is_mesh(given)? {
            return Ok(Channels(vec![self.channel("mesh".to_owned(), given, reads)?]));
        }
        let expected = "a tombolo.Mesh, or a dict from names to meshes";
        let channels = entries(given, "channels", expected)?.into_iter().map(|[key, mesh]| {
            let name = name(&key, "the name of a channel")?;
            self.channel(name, &mesh, reads)
        });
        channels.collect::<Read<_>>().map(Channels)
    }
}

/// How the arrays of a mesh are lent: of each its name, its address, the numbers in it, and whether it
/// is borrowed as it lies there or has to be copied. For tests and for the curious.
#[pyfunction]
pub(crate) fn lent(mesh: &Given<'_>) -> PyResult<Vec<(String, usize, usize, bool)>> {
    let mut lender = Lender::default();
    let channels = lender.channels(mesh, &|_| true)?;
    let mut found = Vec::new();
    for block in channels.0.iter().flat_map(|channel| &channel.blocks) {
        found.extend(block.domain.lending().into_iter().map(
            |Lending { name, address, count, is_borrowed }| (name, address, count, is_borrowed),
        ));
    }
    Ok(found)
}
