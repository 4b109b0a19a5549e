//! A reference surface as a message: every bit of it, so that edits of the copy give what edits of
//! the original give.

use tombolo_deform::mesh::{CellType, Cells};
use tombolo_deform::surface::Surface;

use super::blob::{MOST_BYTES, decompress};
use super::error::{DecodeError, error};
use super::layout::{Kind, name, open};
#[cfg(feature = "compression")]
use super::{
    blob::compress,
    error::EncodeError,
    layout::{preamble, put_name},
};
use crate::codec::bytes::Input;

/// The most features of a surface.
const MOST_FEATURES: usize = 1 << 16;

/// Encodes a surface without loss: points in double precision, mesh vertex numbers, faces and
/// features. About 32 bytes a vertex. With the feature `compression`.
///
/// # Errors
/// [`EncodeError`] where the compressor fails.
///
/// ```
/// use tombolo_deform::{shapes, features::FeatureSettings, surface::Surface};
/// use tombolo_pipelines::encode::{decode_surface, encode_surface};
///
/// let surface = Surface::extract(&shapes::box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]), &FeatureSettings::default())?;
/// let copy = decode_surface(&encode_surface(&surface)?)?;
/// assert_eq!((copy.points(), copy.vertices(), copy.faces()), (surface.points(), surface.vertices(), surface.faces()));
/// assert_eq!(copy.features(), surface.features());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[cfg(feature = "compression")]
pub fn encode_surface(surface: &Surface) -> Result<Vec<u8>, EncodeError> {
    use crate::codec::bytes::{put_block, put_count};
    /// zstd's level: a surface is sent once.
    const LEVEL: i32 = 3;
    let (faces, features) = (surface.faces(), surface.features());
    #[expect(clippy::cast_possible_truncation, reason = "a face has fewer vertices than the mesh")]
    let sizes: Vec<u32> = faces.iter().map(|(_, corners)| corners.len() as u32).collect();
    let mut message = preamble(Kind::Surface).to_vec();
    put_count(&mut message, features.names().len());
    features.names().iter().for_each(|name| put_name(&mut message, name));
    let points = surface.points().as_flattened();
    let axis = |axis: usize| points.iter().skip(axis).step_by(3);
    let coordinates: Vec<u8> =
        (0..3).flat_map(axis).flat_map(|coordinate| coordinate.to_le_bytes()).collect();
    put_count(&mut message, surface.points().len());
    put_block(&mut message, &compress(&coordinates, LEVEL)?);
    for numbers in [surface.vertices(), &sizes, faces.connectivity(), features.face_features()] {
        put_count(&mut message, numbers.len());
        put_block(&mut message, &compress(&differences(numbers), LEVEL)?);
    }
    Ok(message)
}

/// Decodes a surface. Any bytes are answered with a surface or an error, and no more memory is
/// taken than the arrays need that the message says it holds, at most 1 GiB. With the feature
/// `compression` or `decompression`.
///
/// # Errors
/// [`DecodeError`].
pub fn decode_surface(message: &[u8]) -> Result<Surface, DecodeError> {
    let (kind, mut input) = open(message)?;
    if kind != Kind::Surface {
        return Err(error("preamble", "the message holds a frame, expected a surface"));
    }
    let count = input.count().map_err(|failure| error("features", failure.to_string()))?;
    if count > MOST_FEATURES {
        return Err(error("features", format!("{count}, expected at most {MOST_FEATURES}")));
    }
    let mut names = Vec::new();
    for _ in 0..count {
        names.push(name(&mut input, "features")?);
    }
    let mut room = MOST_BYTES;
    let mut bytes = |part: &str, size: usize| array(&mut input, part, size, &mut room);
    let coordinates = bytes("points", 24)?;
    let points = coordinates.len() / 24;
    let coordinate = |index: usize| {
        let (axis, point) = (index % 3, index / 3);
        let start = (axis * points + point) * 8;
        coordinates[start..].first_chunk().map_or(0.0, |bytes| f64::from_le_bytes(*bytes))
    };
    let coordinates: Vec<f64> = (0..3 * points).map(coordinate).collect();
    let mut numbers = |part: &str| bytes(part, 4).map(|bytes| sums(&bytes));
    let (vertices, sizes) = (numbers("vertices")?, numbers("face sizes")?);
    let (corners, features) = (numbers("face points")?, numbers("face features")?);
    if !input.0.is_empty() {
        return Err(error("arrays", format!("{} bytes after the last one", input.0.len())));
    }
    let faces = faces(&sizes, &corners).map_err(|message| error("face sizes", message))?;
    Surface::from_faces(coordinates.as_chunks().0.to_vec(), vertices, faces, names, features)
        .map_err(|failure| error("arrays", failure.to_string()))
}

/// An array's bytes, of so many for each entry.
fn array(
    input: &mut Input<'_>,
    part: &str,
    size: usize,
    room: &mut usize,
) -> Result<Vec<u8>, DecodeError> {
    let wrong = |message: String| error(part, message);
    let count = input.count().map_err(|failure| wrong(failure.to_string()))?;
    let blob = input.block().map_err(|failure| wrong(failure.to_string()))?;
    let bytes = count.checked_mul(size).filter(|bytes| bytes <= room);
    let bytes = bytes.ok_or_else(|| wrong(format!("more than {MOST_BYTES} bytes in all")))?;
    *room -= bytes;
    decompress(blob, bytes).map_err(wrong)
}

/// Each number as the zigzag of its difference to the one before.
#[cfg(feature = "compression")]
fn differences(numbers: &[u32]) -> Vec<u8> {
    let mut previous = 0u32;
    let difference = |&number: &u32| {
        let difference =
            number.wrapping_sub(std::mem::replace(&mut previous, number)).cast_signed();
        (difference << 1 ^ difference >> 31).to_le_bytes()
    };
    numbers.iter().flat_map(difference).collect()
}

/// The numbers behind the zigzags of their differences.
fn sums(bytes: &[u8]) -> Vec<u32> {
    let mut number = 0u32;
    let sum = |&bytes: &[u8; 4]| {
        let zigzag = u32::from_le_bytes(bytes);
        number = number.wrapping_add(zigzag >> 1 ^ (zigzag & 1).wrapping_neg());
        number
    };
    bytes.as_chunks().0.iter().map(sum).collect()
}

/// Faces from the number of points of each, and all their points.
fn faces(sizes: &[u32], mut corners: &[u32]) -> Result<Cells, String> {
    let mut faces = Cells::new();
    for &size in sizes {
        let (face, rest) =
            corners.split_at_checked(size as usize).ok_or("more points than the faces have")?;
        corners = rest;
        let cell_type = CellType::of_polygon(face.len());
        faces.push(cell_type, face).map_err(|failure| failure.to_string())?;
    }
    if corners.is_empty() {
        Ok(faces)
    } else {
        Err(format!("fewer points than the faces have, by {}", corners.len()))
    }
}

#[cfg(all(test, feature = "compression"))]
mod tests {
    use tombolo_deform::mesh::{FeatureSource, Mesh};
    use tombolo_deform::{features::FeatureSettings, shapes};

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
            let copy = decode_surface(&encode_surface(&surface).unwrap()).unwrap();
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
        for length in 0..bytes.len() {
            assert!(decode_surface(&bytes[..length]).is_err(), "cut to {length} bytes");
        }
        for byte in 0..bytes.len() {
            for bit in 0..8 {
                let mut damaged = bytes.clone();
                damaged[byte] ^= 1 << bit;
                // Whatever it says: no panic, and nothing that is no surface.
                if let Ok(surface) = decode_surface(&damaged) {
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
        let wrong = |sizes: &[u32], corners: &[u32]| faces(sizes, corners).unwrap_err();
        assert!(wrong(&[3, 4], &[0, 1, 2, 0]).contains("more points"));
        assert!(wrong(&[3], &[0, 1, 2, 3]).contains("fewer points"));
        assert!(wrong(&[2], &[0, 1]).contains("2 vertices"));
    }
}
