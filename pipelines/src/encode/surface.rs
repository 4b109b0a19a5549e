//! A reference surface as a frame: every bit of it, so that edits of the copy give what edits of
//! the original give.

use tombolo_deform::mesh::{CellType, Cells};
use tombolo_deform::surface::Surface;

use super::arrays::{DecodeError, error, unpacked, values};
use super::encoder::{EncodeError, Message, TOPOLOGY_LEVEL};
use super::wire::{SURFACE, SurfaceHeader, integers};
use crate::extract::Association;
use crate::language::ErrorBound;

/// Encodes a surface without loss: points in double precision, mesh vertex numbers, faces and
/// features. About 32 bytes a vertex.
///
/// # Errors
/// [`EncodeError`] where the compressor fails.
///
/// ```
/// use tombolo_deform::{shapes, features::FeatureSettings, surface::Surface};
/// use tombolo_pipelines::encode::{Decoded, decode, encode_surface};
///
/// let surface = Surface::extract(&shapes::box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]), &FeatureSettings::default())?;
/// let Decoded::Surface(copy) = decode(&encode_surface(&surface)?)? else { panic!() };
/// assert_eq!((copy.points(), copy.vertices(), copy.faces()), (surface.points(), surface.vertices(), surface.faces()));
/// assert_eq!(copy.features(), surface.features());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn encode_surface(surface: &Surface) -> Result<Vec<u8>, EncodeError> {
    let (faces, features) = (surface.faces(), surface.features());
    #[expect(clippy::cast_possible_truncation, reason = "a face has fewer vertices than the mesh")]
    let sizes: Vec<u32> = faces.iter().map(|(_, corners)| corners.len() as u32).collect();
    let mut message = Message::new(TOPOLOGY_LEVEL);
    let points = surface.points().as_flattened();
    message.values("points", Association::Vertex, points, 3, ErrorBound::Lossless, 0.0)?;
    message.integers("vertices", surface.vertices(), 1)?;
    message.integers("face_sizes", &sizes, 1)?;
    message.integers("face_points", faces.connectivity(), 1)?;
    message.integers("face_features", features.face_features(), 1)?;
    message.finish(SURFACE, |arrays| {
        serde_json::to_vec(&SurfaceHeader { features: features.names().to_vec(), arrays })
    })
}

pub(super) fn decode(header: SurfaceHeader, blobs: &[u8]) -> Result<Surface, DecodeError> {
    let mut points = Vec::new();
    let [mut vertices, mut sizes, mut corners, mut features] = [const { Vec::new() }; 4];
    for (array, bytes) in unpacked(header.arrays, blobs)? {
        let part = format!("array `{:.60}`", array.name);
        let (target, components) = match array.name.as_str() {
            "points" => (None, 3),
            "vertices" => (Some(&mut vertices), 1),
            "face_sizes" => (Some(&mut sizes), 1),
            "face_points" => (Some(&mut corners), 1),
            "face_features" => (Some(&mut features), 1),
            _ => continue,
        };
        if array.components != components {
            return Err(error(
                part,
                format!("{} components, expected {components}", array.components),
            ));
        }
        match target {
            Some(target) => {
                *target = integers(&bytes, array.kind, array.filter)
                    .ok_or_else(|| error(part, "expected integers"))?;
            }
            None => points = values(&array, &bytes)?.as_chunks().0.to_vec(),
        }
    }
    let faces = faces(&sizes, &corners).map_err(|message| error("array `face_sizes`", message))?;
    Surface::from_faces(points, vertices, faces, header.features, features)
        .map_err(|failure| error("arrays", failure.to_string()))
}

/// Faces from the number of points of each, and all their points.
fn faces(sizes: &[u32], mut corners: &[u32]) -> Result<Cells, String> {
    let mut faces = Cells::new();
    for &size in sizes {
        let (face, rest) =
            corners.split_at_checked(size as usize).ok_or("more points than `face_points` has")?;
        corners = rest;
        let cell_type = match size {
            3 => CellType::Triangle,
            4 => CellType::Quad,
            _ => CellType::Polygon,
        };
        faces.push(cell_type, face).map_err(|failure| failure.to_string())?;
    }
    if corners.is_empty() {
        Ok(faces)
    } else {
        Err(format!("fewer points than `face_points`, by {}", corners.len()))
    }
}

#[cfg(test)]
mod tests {
    use tombolo_deform::mesh::{FeatureSource, Mesh};
    use tombolo_deform::{features::FeatureSettings, shapes};

    use super::super::{Decoded, decode};
    use super::*;

    /// Triangles, a quadrilateral and a pentagon; a vertex of the mesh that is not on the surface.
    fn mixed() -> Surface {
        let points = vec![
            [9.0; 3],
            [0.0, 0.1, 1.0 / 3.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
            [2.0, 0.0, 1e-300],
            [3.0, 0.5, 0.0],
            [2.0, 1.0, -0.0],
        ];
        let mut cells = Cells::new();
        cells.push(CellType::Quad, &[1, 2, 3, 4]).unwrap();
        cells.push(CellType::Polygon, &[2, 5, 6, 7, 3]).unwrap();
        let mesh = Mesh::new(points, cells, FeatureSource::SharpEdges).unwrap();
        Surface::extract(&mesh, &FeatureSettings::default()).unwrap()
    }

    #[test]
    fn every_bit_comes_back() {
        let box_ = shapes::box_of_tets([5, 4, 3], [0.0; 3], [1.0, 0.3, 0.7]);
        for surface in [mixed(), Surface::extract(&box_, &FeatureSettings::default()).unwrap()] {
            let Decoded::Surface(copy) = decode(&encode_surface(&surface).unwrap()).unwrap() else {
                panic!()
            };
            let bits = |surface: &Surface| -> Vec<u64> {
                surface.points().as_flattened().iter().map(|value| value.to_bits()).collect()
            };
            assert_eq!(bits(&copy), bits(&surface));
            assert_eq!((copy.vertices(), copy.faces()), (surface.vertices(), surface.faces()));
            assert_eq!(
                (copy.triangles(), copy.triangle_faces()),
                (surface.triangles(), surface.triangle_faces())
            );
            assert_eq!(copy.features(), surface.features());
        }
    }

    #[test]
    fn damaged_surfaces_are_errors() {
        let bytes = encode_surface(&mixed()).unwrap();
        let sound = decode(&bytes).unwrap();
        for length in 0..bytes.len() {
            assert!(decode(&bytes[..length]).is_err(), "cut to {length} bytes");
        }
        for byte in 0..bytes.len() {
            for bit in 0..8 {
                let mut damaged = bytes.clone();
                damaged[byte] ^= 1 << bit;
                // Whatever it says: no panic, and nothing that is no surface.
                if let Ok(Decoded::Surface(surface)) = decode(&damaged) {
                    assert!(
                        surface
                            .triangles()
                            .as_flattened()
                            .iter()
                            .all(|&v| (v as usize) < surface.points().len())
                    );
                }
            }
        }
        assert!(matches!(sound, Decoded::Surface(_)));
        let wrong = |sizes: &[u32], corners: &[u32]| faces(sizes, corners).unwrap_err();
        assert!(wrong(&[3, 4], &[0, 1, 2, 0]).contains("more points"));
        assert!(wrong(&[3], &[0, 1, 2, 3]).contains("fewer points"));
        assert!(wrong(&[2], &[0, 1]).contains("2 vertices"));
    }
}
