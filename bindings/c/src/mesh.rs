//! The functions that name the arrays of a channel.

use std::ffi::{c_int, c_void};

use tombolo::deform::mesh::CellType;
use tombolo::foreign::NumberType;
use tombolo::foreign::mesh::COMPONENTS;
use tombolo::pipelines::extract::Association;
use tombolo::pipelines::language::nearest;

use crate::export::{Text, export};
use crate::lent::{Address, Typed, number};
use crate::named::{Cells, Named};
use crate::{Fault, Handle, value, with};

/// Names something of a channel that has points.
fn lend(
    run: *mut Handle,
    channel: Text,
    change: impl FnOnce(&mut Named, &str) -> Result<(), Fault>,
) -> Result<(), Fault> {
    with(run, |run| {
        run.not_ended()?;
        let channel = channel.get("the channel's name")?;
        let mut there = run.channels.iter_mut().filter(|known| !known.is_forgotten);
        if let Some(known) = there.find(|known| known.name == channel) {
            return change(known, &format!("channel '{channel}'"));
        }
        let there = run.channels.iter().filter(|known| !known.is_forgotten);
        let names: Vec<&str> = there.map(|known| known.name.as_str()).collect();
        let expected = match nearest(&channel, names.iter().copied()) {
            Some(near) => format!("one that tombolo_points has named; did you mean '{near}'?"),
            None if names.is_empty() => {
                "one that tombolo_points has named; none has been yet".into()
            }
            None => format!("one that tombolo_points has named: {}", names.join(", ")),
        };
        Err(Fault::invalid("channel", format!("'{channel}'"), expected))
    })
}

/// Names the points of a channel, which is there from then on.
fn lend_points(
    run: *mut Handle,
    channel: Text,
    points: impl FnOnce(&str) -> Result<Vec<Address>, Fault>,
) -> Result<(), Fault> {
    with(run, |run| {
        run.not_ended()?;
        let channel = channel.name("the channel's name")?;
        let points = points(&format!("channel '{channel}', points"))?;
        match run.channels.iter_mut().find(|known| known.name == channel) {
            Some(known) => known.points(points),
            None => run.channels.push(Named::new(channel, points)),
        }
        Ok(())
    })
}

/// Names a field of a channel.
fn lend_field(
    run: *mut Handle,
    channel: Text,
    field: Text,
    of: c_int,
    components: impl FnOnce(&str) -> Result<Vec<Address>, Fault>,
) -> Result<(), Fault> {
    lend(run, channel, |named, what| {
        let field = field.name("the field's name")?;
        let what = format!("{what}, field '{field}'");
        let association = association(&what, of)?;
        named.field(field, association, components(&what)?);
        Ok(())
    })
}

fn fixed_cell(what: &str, number: c_int) -> Result<(CellType, usize), Fault> {
    u8::try_from(number)
        .ok()
        .and_then(CellType::from_vtk)
        .and_then(|cell_type| Some((cell_type, cell_type.vertex_count()?)))
        .ok_or_else(|| {
            let expected = match u8::try_from(number).ok().and_then(CellType::from_vtk) {
                Some(CellType::Polygon) => {
                    "a type whose cells have equally many vertices; polygons are cells of tombolo_mixed_cells"
                }
                _ => "one of enum tombolo_cell_type",
            };
            Fault::invalid(what, format!("the cell type {number}"), expected)
        })
}

/// So many cells of so many vertices each.
fn vertices<T: Typed>(
    what: &str,
    first: *const T,
    cells: usize,
    corners: usize,
) -> Result<Address, Fault> {
    let count = cells.checked_mul(corners).ok_or_else(|| {
        Fault::invalid(what, format!("{cells} cells"), "as many as memory can hold")
    })?;
    Address::beside(what, first, count)
}

fn association(what: &str, number: c_int) -> Result<Association, Fault> {
    match number {
        0 => Ok(Association::Vertex),
        1 => Ok(Association::Element),
        other => Err(Fault::invalid(
            what,
            format!("the association {other}"),
            "TOMBOLO_VERTEX (0) or TOMBOLO_CELL (1)",
        )),
    }
}

fn component_count(
    what: &str,
    components: c_int,
    least: usize,
    most: usize,
) -> Result<usize, Fault> {
    usize::try_from(components).ok().filter(|count| (least..=most).contains(count)).ok_or_else(
        || Fault::invalid(what, format!("{components} components"), format!("{least} to {most}")),
    )
}

/// Tells the Fortran module how many vertices a cell of this type has; 0 of a type that is not
/// known.
#[unsafe(no_mangle)]
pub extern "C" fn tombolo_vertices_of_cell(cell_type: c_int) -> c_int {
    value(0, || {
        Ok(fixed_cell("", cell_type)
            .map_or(0, |(_, vertices)| c_int::try_from(vertices).unwrap_or(0)))
    })
}

export! {
    fn tombolo_points_strided(
        run: *mut Handle,
        channel: Text,
        kind: c_int,
        axes: *const *const c_void,
        dimension: c_int,
        count: usize,
        stride: isize,
    ) {
        lend_points(run, channel, |what| {
            let number = number(what, kind)?;
            if !matches!(number, NumberType::F32 | NumberType::F64) {
                return Err(Fault::invalid(what, format!("the type {}", number.name()), "float32 or float64"));
            }
            let dimension = component_count(what, dimension, 2, 3)?;
            // SAFETY: as the crate's page says.
            unsafe { Address::separate(what, number, axes, dimension, count, stride) }
        })
    }

    fn tombolo_point_cells(run: *mut Handle, channel: Text) {
        lend(run, channel, |named, _| named.cells(Cells::Points))
    }

    fn tombolo_feature(run: *mut Handle, channel: Text, number: i64, feature: Text) {
        lend(run, channel, |named, _| named.feature(number, feature.name("the feature's name")?))
    }

    fn tombolo_forget(run: *mut Handle, channel: Text, name: Text) {
        lend(run, channel, |named, _| {
            if name.is_null() {
                named.forget_all();
                return Ok(());
            }
            named.forget(&name.get("the name of what to forget")?)
        })
    }

    fn tombolo_ghost_cells(run: *mut Handle, channel: Text, ghosts: *const u8, cells: usize) {
        lend(run, channel, |named, what| {
            named.ghosts = Some(Address::beside(&format!("{what}, ghost cells"), ghosts, cells)?);
            Ok(())
        })
    }

    fn tombolo_field_strided(
        run: *mut Handle,
        channel: Text,
        field: Text,
        of: c_int,
        kind: c_int,
        components: *const *const c_void,
        component_number: c_int,
        count: usize,
        stride: isize,
    ) {
        lend_field(run, channel, field, of, |what| {
            let number = number(what, kind)?;
            let component_number = component_count(what, component_number, 1, COMPONENTS)?;
            // SAFETY: as the crate's page says.
            unsafe { Address::separate(what, number, components, component_number, count, stride) }
        })
    }
}

macro_rules! points {
    ($($function:ident: $type:ty),*) => { export! { $(
        fn $function(run: *mut Handle, channel: Text, points: *const $type, count: usize) {
            lend_points(run, channel, |what| Address::interleaved(what, points, count, 3))
        }
    )* } };
}

points!(tombolo_points_f32: f32, tombolo_points_f64: f64);

macro_rules! fields {
    ($($function:ident: $type:ty),*) => { export! { $(
        fn $function(
            run: *mut Handle,
            channel: Text,
            field: Text,
            of: c_int,
            values: *const $type,
            count: usize,
            components: c_int,
        ) {
            lend_field(run, channel, field, of, |what| {
                let components = component_count(what, components, 1, COMPONENTS)?;
                Address::interleaved(what, values, count, components)
            })
        }
    )* } };
}

fields!(
    tombolo_field_f32: f32,
    tombolo_field_f64: f64,
    tombolo_field_i32: i32,
    tombolo_field_i64: i64,
    tombolo_field_u8: u8
);

macro_rules! integers {
    ($($cells:ident, $mixed:ident, $faces:ident, $vertices:ident, $numbers:ident: $type:ty),*) => { export! { $(
        fn $cells(
            run: *mut Handle,
            channel: Text,
            cell_type: c_int,
            connectivity: *const $type,
            cells: usize,
        ) {
            lend(run, channel, |named, what| {
                let what = format!("{what}, cells");
                let (cell_type, corners) = fixed_cell(&what, cell_type)?;
                named.cells(Cells::Uniform(cell_type, vertices(&what, connectivity, cells, corners)?))
            })
        }

        fn $mixed(
            run: *mut Handle,
            channel: Text,
            cell_types: *const u8,
            sizes: *const $type,
            cells: usize,
            connectivity: *const $type,
            length: usize,
        ) {
            lend(run, channel, |named, what| {
                named.cells(Cells::Mixed {
                    types: Address::beside(&format!("{what}, cell types"), cell_types, cells)?,
                    sizes: Address::beside(&format!("{what}, sizes of cells"), sizes, cells)?,
                    connectivity: Address::beside(&format!("{what}, cells"), connectivity, length)?,
                })
            })
        }

        fn $faces(
            run: *mut Handle,
            channel: Text,
            face_type: c_int,
            connectivity: *const $type,
            features: *const $type,
            faces: usize,
        ) {
            lend(run, channel, |named, what| {
                let what = format!("{what}, faces");
                let (face_type, corners) = fixed_cell(&what, face_type)?;
                if !matches!(face_type, CellType::Triangle | CellType::Quad) {
                    return Err(Fault::invalid(what, face_type, "TOMBOLO_TRIANGLE or TOMBOLO_QUAD"));
                }
                let connectivity = vertices(&what, connectivity, faces, corners)?;
                let features = Address::beside(&format!("{what}, features"), features, faces)?;
                named.faces(face_type, connectivity, features);
                Ok(())
            })
        }

        fn $vertices(run: *mut Handle, channel: Text, numbers: *const $type, count: usize) {
            lend(run, channel, |named, what| {
                named.global_vertices = Some(Address::beside(&format!("{what}, global vertices"), numbers, count)?);
                Ok(())
            })
        }

        fn $numbers(run: *mut Handle, channel: Text, numbers: *const $type, count: usize) {
            lend(run, channel, |named, what| {
                named.global_cells = Some(Address::beside(&format!("{what}, global cells"), numbers, count)?);
                Ok(())
            })
        }
    )* } };
}

integers!(
    tombolo_cells_i32, tombolo_mixed_cells_i32, tombolo_faces_i32, tombolo_global_vertices_i32, tombolo_global_cells_i32: i32,
    tombolo_cells_i64, tombolo_mixed_cells_i64, tombolo_faces_i64, tombolo_global_vertices_i64, tombolo_global_cells_i64: i64
);
