//! Handles: which vertices of a surface an edit moves and which it holds.

use std::collections::BTreeSet;

use super::error::{EditError, Surroundings};
use super::kinds::{Displacement, Edit};
use super::region::Region;
use crate::bounds::Bounds;
use crate::surface::Surface;
use crate::topology::marks;

/// The role of a vertex in an edit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    Free,
    Handle,
    Fixed,
}

/// The vertices that an edit moves and holds.
#[derive(Debug)]
pub(super) struct Handle {
    /// The role of each surface vertex.
    pub roles: Vec<Role>,
    /// Every vertex of the handle, rising, the fixed ones among them too.
    pub vertices: Vec<u32>,
    /// For each face of the surface, whether it is part of the handle: of its features, and with
    /// all its vertices in the region, or picked.
    pub faces: Vec<bool>,
}

impl Handle {
    /// Finds the vertices of an edit; `index` is that of the edit in its stack, for errors.
    ///
    /// # Errors
    /// [`EditError`] for an edit that is invalid, that names what the surface does not have, or
    /// that moves nothing.
    pub fn find(surface: &Surface, edit: &Edit, index: usize) -> Result<Self, EditError> {
        edit.validate().map_err(|source| EditError::Invalid {
            edit: index,
            name: edit.name(),
            source,
        })?;
        let finder = Finder { surface, edit, index };
        let in_features = finder.features("features", edit.features())?;
        let in_region = edit.region().map(|region| finder.region("region", region)).transpose()?;

        let count = surface.points().len();
        let takes = |vertex: usize| {
            in_features.as_ref().is_none_or(|inside| inside.vertices[vertex])
                && in_region.as_ref().is_none_or(|inside| inside[vertex])
        };
        let mut roles: Vec<Role> = (0..count)
            .map(|vertex| if takes(vertex) { Role::Handle } else { Role::Free })
            .collect();
        let vertices: Vec<u32> = (0..count)
            .filter(|&vertex| roles[vertex] == Role::Handle)
            .map(|vertex| vertex as u32)
            .collect();
        if vertices.is_empty() {
            return Err(EditError::NothingInCommon {
                edit: index,
                name: edit.name(),
                features: edit.features().to_vec(),
                vertices: in_region
                    .map_or(0, |inside| inside.iter().filter(|inside| **inside).count()),
            });
        }
        let mut faces: Vec<bool> = match &in_features {
            Some(inside) => inside.faces.clone(),
            None => vec![true; surface.faces().len()],
        };
        match edit.region() {
            Some(Region::Faces(picked)) => {
                // Known to be there since the region was found.
                let chosen = marks(faces.len(), picked);
                faces.iter_mut().zip(chosen).for_each(|(face, chosen)| *face &= chosen);
            }
            Some(_) => {
                for (face, (_, corners)) in faces.iter_mut().zip(surface.faces().iter()) {
                    *face &= corners.iter().all(|&vertex| roles[vertex as usize] == Role::Handle);
                }
            }
            None => {}
        }

        let fixed = [
            finder.features("fixed", edit.fixed())?.map(|inside| inside.vertices),
            edit.fixed_region().map(|region| finder.region("fixed_region", region)).transpose()?,
        ];
        for inside in fixed.into_iter().flatten() {
            for (role, inside) in roles.iter_mut().zip(inside) {
                if inside {
                    *role = Role::Fixed;
                }
            }
        }
        if vertices.iter().all(|&vertex| roles[vertex as usize] == Role::Fixed) {
            return Err(EditError::HandleFixed {
                edit: index,
                name: edit.name(),
                handle: in_words(edit),
            });
        }
        if let Edit::Displacement(import) = edit {
            check_import(surface, import, index)?;
            let moves = |vertex: &u32| {
                surface
                    .vertices()
                    .binary_search(vertex)
                    .is_ok_and(|local| roles[local] == Role::Handle)
            };
            if !import.vertices.iter().any(moves) {
                return Err(EditError::NothingMoves {
                    edit: index,
                    vertices: import.vertices.len(),
                });
            }
        }
        Ok(Self { roles, vertices, faces })
    }
}

fn check_import(surface: &Surface, import: &Displacement, edit: usize) -> Result<(), EditError> {
    if let Some(file) = &import.file {
        return Err(EditError::Unread { edit, file: file.clone() });
    }
    let missing = |vertex: &u32| surface.vertices().binary_search(vertex).is_err();
    match import.vertices.iter().position(missing) {
        Some(index) => Err(EditError::NotOnSurface { edit, index, vertex: import.vertices[index] }),
        None => Ok(()),
    }
}

/// The vertices and faces of a surface that belong to some features.
struct InFeatures {
    vertices: Vec<bool>,
    faces: Vec<bool>,
}

struct Finder<'a> {
    surface: &'a Surface,
    edit: &'a Edit,
    index: usize,
}

impl Finder<'_> {
    /// `None` where no features are named.
    fn features(
        &self,
        field: &'static str,
        names: &[String],
    ) -> Result<Option<InFeatures>, EditError> {
        let features = self.surface.features();
        let found = names
            .iter()
            .map(|name| features.index(name))
            .collect::<Result<BTreeSet<u32>, _>>()
            .map_err(|source| EditError::UnknownFeature {
                edit: self.index,
                name: self.edit.name(),
                field,
                source,
            })?;
        if found.is_empty() {
            return Ok(None);
        }
        let of_features = found.iter().flat_map(|&feature| features.vertices(feature));
        let vertices = marks(self.surface.points().len(), of_features);
        let faces =
            features.face_features().iter().map(|feature| found.contains(feature)).collect();
        Ok(Some(InFeatures { vertices, faces }))
    }

    fn region(&self, field: &'static str, region: &Region) -> Result<Vec<bool>, EditError> {
        let (edit, name) = (self.index, self.edit.name());
        let found = region.vertices(self.surface).map_err(|source| EditError::Region {
            edit,
            name,
            field,
            source,
        })?;
        if found.is_empty() {
            let points = self.surface.points();
            let nearest = region.nearest(self.surface).map(|(vertex, distance)| {
                (self.surface.vertices()[vertex as usize], points[vertex as usize], distance)
            });
            let surroundings =
                Box::new(Surroundings { nearest, bounds: Bounds::around(points.iter().copied()) });
            return Err(EditError::EmptyRegion { edit, name, field, surroundings });
        }
        Ok(marks(self.surface.points().len(), &found))
    }
}

fn in_words(edit: &Edit) -> String {
    match (edit.features(), edit.region()) {
        ([], Some(_)) => "the region".into(),
        ([], None) => "the surface".into(),
        (features, Some(_)) => format!("the part of {features:?} in the region"),
        (features, None) => format!("{features:?}"),
    }
}
