//! Channels described by arrays themselves, without a node: what the C interface of `tombolo.h` says.

use tombolo::deform::mesh::CellType;
use tombolo::pipelines::extract::{Association, check_field_length};

use super::amr::Mask;
use super::channel::{Block, Channel};
use super::coordset::Coordset;
use super::domain::{Domain, Faces, Roles};
use super::field::Field;
use super::rows::Rows;
use super::topology::Topology;
use crate::array::Array;
use crate::error::CatalystError;

/// The arrays of one channel.
#[derive(Debug, Default)]
pub(crate) struct Description<'call> {
    pub(crate) name: String,
    pub(crate) axes: Vec<Array<'call>>,
    pub(crate) cells: Option<DescribedCells<'call>>,
    pub(crate) faces: Vec<(CellType, Array<'call>, Array<'call>)>,
    pub(crate) feature_names: Vec<(i64, String)>,
    pub(crate) fields: Vec<(String, Association, Vec<Array<'call>>)>,
    pub(crate) ghosts: Option<Array<'call>>,
    pub(crate) global_vertices: Option<Array<'call>>,
    pub(crate) global_cells: Option<Array<'call>>,
}

/// The cells of one channel.
#[derive(Debug, Clone, Copy)]
pub(crate) enum DescribedCells<'call> {
    /// All of one type.
    Uniform(CellType, Array<'call>),
    /// Each of its own: VTK's numbers of the types, the number of vertices of each cell, the vertices.
    Mixed { types: Array<'call>, sizes: Array<'call>, connectivity: Array<'call> },
}

impl<'call> Description<'call> {
    /// The channel that the arrays describe.
    pub(crate) fn channel(self) -> Result<Channel<'call>, CatalystError> {
        let Description {
            name,
            axes,
            cells,
            faces,
            feature_names,
            fields,
            ghosts,
            global_vertices,
            global_cells,
        } = self;
        let wrong = |what: &str, found: String, expected: String| CatalystError::Argument {
            what: format!("channel '{name}', {what}"),
            found,
            expected,
        };
        let coordset = Coordset::Explicit { axes };
        let vertices = coordset.len();
        let uniform = |what: &str, cell_type: CellType, connectivity: Array<'call>| {
            let size = cell_type.vertex_count().unwrap_or(1);
            if connectivity.len().is_multiple_of(size) {
                Ok(Topology::Uniform {
                    cell_type,
                    connectivity,
                    path: format!("channel '{name}', {what}"),
                })
            } else {
                Err(wrong(
                    what,
                    format!("{} vertex numbers", connectivity.len()),
                    format!("a multiple of {size}"),
                ))
            }
        };
        let topology = match cells {
            None => Topology::Points(vertices),
            Some(DescribedCells::Uniform(cell_type, connectivity)) => {
                uniform("cells", cell_type, connectivity)?
            }
            Some(DescribedCells::Mixed { types, sizes, connectivity }) => {
                let map = CellType::ALL
                    .into_iter()
                    .filter(|cell_type| *cell_type != CellType::Polyhedron);
                Topology::Mixed {
                    cells: Rows::of(connectivity, sizes, format!("channel '{name}', cells")),
                    shapes: types,
                    map: map.map(|cell_type| (i64::from(cell_type.vtk()), cell_type)).collect(),
                    faces: None,
                    path: format!("channel '{name}', cell types"),
                }
            }
        };
        let faces: Vec<Faces<'call>> = faces
            .into_iter()
            .map(|(cell_type, connectivity, tags)| {
                Ok(Faces { topology: uniform("faces", cell_type, connectivity)?, tags })
            })
            .collect::<Result<_, CatalystError>>()?;
        let counts = (vertices, topology.len());
        let mut own = Vec::with_capacity(fields.len());
        for (field, association, components) in fields {
            // What has to be copied is copied before the adaptor sees it, so that it is asked here.
            check_field_length(
                &name,
                (&field, association),
                components.first().map_or(0, Array::len),
                counts,
            )?;
            own.push(Field::new(field, association, components));
        }
        let roles = Roles { ghosts, global_vertices, global_cells, vertex_features: None };
        let path = format!("channel '{name}'");
        let domain = Domain::described(coordset, topology, own, faces, roles, path);
        let block = Block { name: String::new(), domain, mask: Mask::default() };
        Ok(Channel { name, blocks: vec![block], feature_names, ..Channel::default() })
    }
}
