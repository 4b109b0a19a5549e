//! The faces of the surface with what lies behind them.

use tombolo_deform::mesh::Cells;

use super::source::Source;

/// Faces of the surface, with the cell behind each.
pub(crate) struct Walls<'a> {
    pub(crate) faces: &'a Cells,
    /// The vertex of the mesh that each number in the faces means, where it is not that itself.
    vertices: Option<&'a [u32]>,
    pub(crate) owners: &'a [u32],
}

impl Walls<'_> {
    /// The mesh's vertices of a face.
    pub(crate) fn face(&self, face: usize) -> impl Iterator<Item = u32> + '_ {
        let numbers = self.faces.vertices(face).iter();
        numbers.map(|&number| self.vertices.map_or(number, |all| all[number as usize]))
    }
}

impl Source {
    /// The faces of the surface that this rank has, in the order of its extract; `None` before there
    /// is one.
    pub(crate) fn walls(&self) -> Option<Walls<'_>> {
        if let Some(whole) = &self.whole {
            let boundary = &whole.boundary;
            let (faces, owners) = (boundary.faces(), boundary.face_cells());
            return Some(Walls { faces, vertices: None, owners });
        }
        self.boundary.as_ref().map(|boundary| Walls {
            faces: &boundary.cells,
            vertices: Some(&boundary.vertices),
            owners: &boundary.owners,
        })
    }
}
