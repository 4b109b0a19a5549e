//! Cells as tetrahedra or triangles between their vertices.
//!
//! A cell is decomposed by its vertex of the lowest key, and each of its faces by the lowest of the
//! face, so that two cells decompose the face between them alike (J. Dompierre et al., *How to
//! subdivide pyramids, prisms and hexahedra into tetrahedra*, 1999).

use tombolo_deform::mesh::Cells;

/// The faces of one cell.
#[derive(Default)]
pub(super) struct Faces {
    ends: Vec<usize>,
    vertices: Vec<u32>,
}

impl Faces {
    pub(super) fn clear(&mut self) {
        self.ends.clear();
        self.vertices.clear();
    }

    pub(super) fn push(&mut self, face: &[u32]) {
        self.vertices.extend(face);
        self.ends.push(self.vertices.len());
    }

    fn iter(&self) -> impl Iterator<Item = &[u32]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| &self.vertices[start..end])
    }

    /// The tetrahedra of a cell of dimension 3, the triangles of one of dimension 2.
    pub(super) fn decompose<K: Ord>(
        &mut self,
        cells: &Cells,
        cell: usize,
        key: impl Fn(u32) -> K,
        simplices: &mut Vec<[u32; 4]>,
    ) {
        self.clear();
        if cells.cell_type(cell).dimension() == 3 {
            cells.for_each_face(cell, |face| self.push(face));
            return self.tetrahedra(key, simplices);
        }
        cells.for_each_polygon(cell, |polygon| self.push(polygon));
        self.triangles(key, simplices);
    }

    /// The triangles of each face, all with its corner of the lowest key.
    pub(super) fn triangles<K: Ord>(&self, key: impl Fn(u32) -> K, triangles: &mut Vec<[u32; 4]>) {
        for face in self.iter() {
            let Some(start) = (0..face.len()).min_by_key(|&corner| key(face[corner])) else {
                continue;
            };
            let at = |corner: usize| face[(start + corner) % face.len()];
            for corner in 1..face.len() - 1 {
                let [a, b, c] = [at(0), at(corner), at(corner + 1)];
                if a != b && b != c && c != a {
                    triangles.push([a, b, c, u32::MAX]);
                }
            }
        }
    }

    /// The tetrahedra between the corner of the lowest key and the triangles of the faces that it
    /// is not in.
    pub(super) fn tetrahedra<K: Ord>(
        &self,
        key: impl Fn(u32) -> K,
        tetrahedra: &mut Vec<[u32; 4]>,
    ) {
        let Some(apex) = self.vertices.iter().copied().min_by_key(|&vertex| key(vertex)) else {
            return;
        };
        self.triangles(key, tetrahedra);
        tetrahedra.retain_mut(|tetrahedron| {
            let is_beyond = !tetrahedron.contains(&apex);
            tetrahedron[3] = apex;
            is_beyond
        });
    }
}
