//! The arrays that a solver names, kept as addresses until `tombolo_execute` reads them.

use std::ffi::{c_char, c_int, c_void};

use tombolo::deform::mesh::CellType;
use tombolo::pipelines::extract::Association;

use super::{Fault, Handle, answer, handle, text};
use crate::array::{Array, Number};
use crate::error::CatalystError;
use crate::mesh::{Channel, DescribedCells, Description};

/// An array as it was named.
#[derive(Debug, Clone, Copy)]
struct Address {
    first: *const c_void,
    count: usize,
    /// In values.
    stride: usize,
    number: Number,
}

impl Address {
    fn new(what: &str, kind: c_int, first: *const c_void, count: usize, stride: usize) -> Result<Self, Fault> {
        let number = match kind {
            5 => Number::I32,
            6 => Number::I64,
            7 => Number::U8,
            9 => Number::U32,
            10 => Number::U64,
            11 => Number::F32,
            12 => Number::F64,
            other => return Err(Fault::invalid(what, format!("the type {other}"), "one of enum tombolo_type")),
        };
        if count > 0 && first.is_null() {
            return Err(Fault::invalid(what, "a null pointer", format!("the address of {count} values")));
        }
        let bytes = count.checked_mul(stride).and_then(|values| values.checked_mul(number.bytes()));
        if bytes.is_none_or(|bytes| isize::try_from(bytes).is_err()) {
            return Err(Fault::invalid(
                what,
                format!("{count} values, {stride} apart"),
                "a length that memory can have",
            ));
        }
        Ok(Self { first, count, stride, number })
    }

    fn integers(self, what: &str) -> Result<Self, Fault> {
        match self.number {
            Number::F32 | Number::F64 => Err(Fault::invalid(what, self.number.name(), "integers")),
            _ => Ok(self),
        }
    }

    fn part(self, component: usize) -> Self {
        Self { first: self.first.wrapping_byte_add(component * self.number.bytes()), ..self }
    }

    /// # Safety
    /// The array lives, unchanged by others, during `'call`.
    unsafe fn array<'call>(&self) -> Array<'call> {
        let stride = self.stride * self.number.bytes();
        // SAFETY: the caller's promise, and the header's: so many values, so far apart.
        unsafe { Array::new(self.first.cast(), self.count, stride, self.number, false) }
    }
}

/// Cells as they were named.
#[derive(Debug, Clone, Copy)]
enum Cells {
    Uniform(CellType, Address),
    Mixed { types: Address, sizes: Address, connectivity: Address },
}

/// A channel as it was named.
#[derive(Debug, Default)]
pub(super) struct Named {
    name: String,
    axes: Vec<Address>,
    cells: Option<Cells>,
    faces: Option<(CellType, Address, Address)>,
    features: Vec<(i64, String)>,
    fields: Vec<(String, Association, Vec<Address>)>,
    ghosts: Option<*const u8>,
    global_vertices: Option<(c_int, *const c_void)>,
    global_cells: Option<(c_int, *const c_void)>,
}

impl Named {
    /// # Safety
    /// All arrays live, unchanged by others, during `'call`.
    pub(super) unsafe fn channel<'call>(&self) -> Result<Channel<'call>, CatalystError> {
        // SAFETY: the caller's promise.
        let array = |address: &Address| -> Array<'call> { unsafe { address.array() } };
        let vertices = self.axes.first().map_or(0, |axis| axis.count);
        let cells = match &self.cells {
            Some(Cells::Uniform(_, connectivity)) => connectivity.count / self.corners(),
            Some(Cells::Mixed { sizes, .. }) => sizes.count,
            None => vertices,
        };
        let numbers = |given: Option<(c_int, *const c_void)>, count: usize| {
            let (kind, first) = given?;
            Address::new("global numbers", kind, first, count, 1).ok().map(|address| array(&address))
        };
        let description = Description {
            name: self.name.clone(),
            axes: self.axes.iter().map(array).collect(),
            cells: self.cells.as_ref().map(|cells| match cells {
                Cells::Uniform(cell_type, connectivity) => DescribedCells::Uniform(*cell_type, array(connectivity)),
                Cells::Mixed { types, sizes, connectivity } => DescribedCells::Mixed {
                    types: array(types),
                    sizes: array(sizes),
                    connectivity: array(connectivity),
                },
            }),
            faces: self.faces.as_ref().map(|(cell_type, faces, tags)| (*cell_type, array(faces), array(tags))),
            feature_names: self.features.clone(),
            fields: self
                .fields
                .iter()
                .map(|(name, association, components)| {
                    (name.clone(), *association, components.iter().map(array).collect())
                })
                .collect(),
            ghosts: self
                .ghosts
                .and_then(|first| Address::new("ghosts", 7, first.cast(), cells, 1).ok())
                .map(|it| array(&it)),
            global_vertices: numbers(self.global_vertices, vertices),
            global_cells: numbers(self.global_cells, cells),
        };
        description.channel()
    }

    fn corners(&self) -> usize {
        match &self.cells {
            Some(Cells::Uniform(cell_type, _)) => cell_type.vertex_count().unwrap_or(1),
            _ => 1,
        }
    }
}

/// Names something of a channel, which is there from the first time on that it is named.
///
/// # Safety
/// As the module says.
unsafe fn name(
    run: *mut Handle,
    channel: *const c_char,
    change: impl FnOnce(&mut Named) -> Result<(), Fault>,
) -> c_int {
    answer(|| {
        // SAFETY: as the module says.
        let (run, channel) = unsafe { (handle(run)?, text(channel, "channel")?) };
        if let Some(known) = run.channels.iter_mut().find(|known| known.name == channel) {
            return change(known);
        }
        let mut new = Named { name: channel, ..Named::default() };
        change(&mut new)?;
        run.channels.push(new);
        Ok(())
    })
}

fn fixed_cell(number: c_int) -> Result<(CellType, usize), Fault> {
    u8::try_from(number)
        .ok()
        .and_then(CellType::from_vtk)
        .and_then(|cell_type| Some((cell_type, cell_type.vertex_count()?)))
        .ok_or_else(|| Fault::invalid("cell type", number, "one of enum tombolo_cell"))
}

fn product(what: &str, count: usize, each: usize) -> Result<usize, Fault> {
    count.checked_mul(each).ok_or_else(|| Fault::invalid(what, count, "a number that memory can hold"))
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_mesh(
    run: *mut Handle,
    channel: *const c_char,
    kind: c_int,
    coordinates: *const c_void,
    vertices: usize,
    dimension: c_int,
    stride: usize,
) -> c_int {
    let change = |named: &mut Named| {
        let dimension = usize::try_from(dimension).ok().filter(|it| (1..=3).contains(it) && *it <= stride);
        let dimension = dimension.ok_or_else(|| {
            Fault::invalid(
                "coordinates",
                format!("a stride of {stride}"),
                "2 or 3 values, and a stride of as many or more",
            )
        })?;
        let all = Address::new("coordinates", kind, coordinates, vertices, stride)?;
        named.axes = (0..dimension).map(|axis| all.part(axis)).collect();
        Ok(())
    };
    // SAFETY: as the module says.
    unsafe { name(run, channel, change) }
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_cells(
    run: *mut Handle,
    channel: *const c_char,
    cell: c_int,
    kind: c_int,
    connectivity: *const c_void,
    cells: usize,
) -> c_int {
    let change = |named: &mut Named| {
        let (cell_type, corners) = fixed_cell(cell)?;
        let count = product("cells", cells, corners)?;
        let address = Address::new("connectivity", kind, connectivity, count, 1)?.integers("connectivity")?;
        named.cells = Some(Cells::Uniform(cell_type, address));
        Ok(())
    };
    // SAFETY: as the module says.
    unsafe { name(run, channel, change) }
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_mixed_cells(
    run: *mut Handle,
    channel: *const c_char,
    cell_types: *const u8,
    kind: c_int,
    sizes: *const c_void,
    cells: usize,
    connectivity: *const c_void,
    length: usize,
) -> c_int {
    let change = |named: &mut Named| {
        named.cells = Some(Cells::Mixed {
            types: Address::new("cell types", 7, cell_types.cast(), cells, 1)?,
            sizes: Address::new("sizes", kind, sizes, cells, 1)?.integers("sizes")?,
            connectivity: Address::new("connectivity", kind, connectivity, length, 1)?.integers("connectivity")?,
        });
        Ok(())
    };
    // SAFETY: as the module says.
    unsafe { name(run, channel, change) }
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_faces(
    run: *mut Handle,
    channel: *const c_char,
    cell: c_int,
    kind: c_int,
    connectivity: *const c_void,
    features: *const c_void,
    faces: usize,
) -> c_int {
    let change = |named: &mut Named| {
        let (cell_type, corners) = fixed_cell(cell)?;
        if cell_type.dimension() != 2 {
            return Err(Fault::invalid("faces", cell_type, "TOMBOLO_TRIANGLE or TOMBOLO_QUAD"));
        }
        let count = product("faces", faces, corners)?;
        let connectivity = Address::new("faces", kind, connectivity, count, 1)?.integers("faces")?;
        let tags = Address::new("features of faces", kind, features, faces, 1)?.integers("features of faces")?;
        named.faces = Some((cell_type, connectivity, tags));
        Ok(())
    };
    // SAFETY: as the module says.
    unsafe { name(run, channel, change) }
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_feature(
    run: *mut Handle,
    channel: *const c_char,
    number: i64,
    feature: *const c_char,
) -> c_int {
    let change = |named: &mut Named| {
        // SAFETY: as the module says.
        let feature = unsafe { text(feature, "the feature's name") }?;
        named.features.retain(|(known, _)| *known != number);
        named.features.push((number, feature));
        Ok(())
    };
    // SAFETY: as the module says.
    unsafe { name(run, channel, change) }
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_global_numbers(
    run: *mut Handle,
    channel: *const c_char,
    kind: c_int,
    vertices: *const c_void,
    cells: *const c_void,
) -> c_int {
    let change = |named: &mut Named| {
        Address::new("global numbers", kind, vertices, 0, 1)?.integers("global numbers")?;
        named.global_vertices = (!vertices.is_null()).then_some((kind, vertices));
        named.global_cells = (!cells.is_null()).then_some((kind, cells));
        Ok(())
    };
    // SAFETY: as the module says.
    unsafe { name(run, channel, change) }
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_ghosts(run: *mut Handle, channel: *const c_char, ghosts: *const u8) -> c_int {
    let change = |named: &mut Named| {
        named.ghosts = (!ghosts.is_null()).then_some(ghosts);
        Ok(())
    };
    // SAFETY: as the module says.
    unsafe { name(run, channel, change) }
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_field(
    run: *mut Handle,
    channel: *const c_char,
    field: *const c_char,
    association: c_int,
    kind: c_int,
    values: *const c_void,
    components: c_int,
    stride: usize,
) -> c_int {
    let change = |named: &mut Named| {
        // SAFETY: as the module says.
        let field = unsafe { text(field, "the field's name") }?;
        let what = format!("field '{field}'");
        let association = match association {
            0 => Association::Vertex,
            1 => Association::Element,
            other => {
                return Err(Fault::invalid(
                    &what,
                    format!("the association {other}"),
                    "TOMBOLO_VERTEX or TOMBOLO_ELEMENT",
                ));
            }
        };
        let components = usize::try_from(components).ok().filter(|it| (1..=9).contains(it) && *it <= stride);
        let components = components.ok_or_else(|| {
            Fault::invalid(&what, format!("a stride of {stride}"), "1 to 9 components, and a stride of as many or more")
        })?;
        let count = match (association, &named.cells) {
            (Association::Element, Some(Cells::Mixed { sizes, .. })) => sizes.count,
            (Association::Element, Some(Cells::Uniform(_, connectivity))) => connectivity.count / named.corners(),
            _ => named.axes.first().map_or(0, |axis| axis.count),
        };
        let all = Address::new(&what, kind, values, count, stride)?;
        named.fields.retain(|(known, ..)| *known != field);
        named.fields.push((field, association, (0..components).map(|component| all.part(component)).collect()));
        Ok(())
    };
    // SAFETY: as the module says.
    unsafe { name(run, channel, change) }
}
