//! Shapes and plans in a form that can be written down, so that a run that is restarted goes on from
//! where it was, to the bit.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::plan::{CurrentShape, Plan, Shape};
use super::{ShapeSeconds, Target};
use crate::communicator::{Garbled, Reader, Writer};
use crate::limits::SHAPES;
use crate::mesh::Vector;
use crate::quality::{PathQuality, ShapeQuality};
use crate::schedule::Schedule;

/// The coordinates that saved shapes are made of: each once, however many shapes have them. The
/// first are the reference's.
///
/// ```
/// use std::sync::Arc;
/// use tombolo_deform::communicator::{Reader, Writer};
/// use tombolo_deform::shape::{CurrentShape, SavedPoints};
///
/// let reference: Arc<[_]> = vec![[0.0; 3], [1.0, 0.0, 0.0]].into();
/// let shape: Arc<[_]> = vec![[0.0; 3], [1.5, 0.0, 0.0]].into();
/// let here = CurrentShape { back: vec![Arc::clone(&reference)], ..CurrentShape::from(shape) };
///
/// let mut points = SavedPoints::new(&reference);
/// let saved = here.save(&mut points);
/// let mut writer = Writer::default();
/// points.write(&mut writer);
///
/// let points = SavedPoints::read(&mut Reader::new(0, &writer.into_bytes()))?;
/// let again = CurrentShape::restored(&saved, &points)?;
/// assert_eq!(again, here);
/// assert!(Arc::ptr_eq(&again.back[0], points.reference()));
/// # Ok::<(), tombolo_deform::communicator::Garbled>(())
/// ```
#[derive(Debug, Clone)]
pub struct SavedPoints {
    all: Vec<Arc<[Vector]>>,
}

impl SavedPoints {
    /// With the coordinates of the reference alone.
    #[must_use]
    pub fn new(reference: &Arc<[Vector]>) -> Self {
        Self { all: vec![Arc::clone(reference)] }
    }

    /// The coordinates of the reference.
    #[must_use]
    pub fn reference(&self) -> &Arc<[Vector]> {
        &self.all[0]
    }

    /// Puts the reference of a [`Shaper`](super::Shaper) in the place of the one that was read, whose
    /// coordinates are the same.
    #[must_use]
    pub fn with_reference(mut self, reference: &Arc<[Vector]>) -> Self {
        self.all[0] = Arc::clone(reference);
        self
    }

    /// Adds coordinates, unless they are there; their number.
    pub fn add(&mut self, points: &Arc<[Vector]>) -> u32 {
        let known = self.all.iter().position(|known| Arc::ptr_eq(known, points));
        let index = known.unwrap_or_else(|| {
            self.all.push(Arc::clone(points));
            self.all.len() - 1
        });
        // There are no more of them than a few ways have corners.
        u32::try_from(index).unwrap_or(u32::MAX)
    }

    /// The coordinates of this number.
    ///
    /// # Errors
    /// [`Garbled`] where there are none.
    pub fn get(&self, index: u32) -> Result<&Arc<[Vector]>, Garbled> {
        self.all.get(index as usize).ok_or(Garbled { rank: 0 })
    }

    fn all_of(&self, indices: &[u32]) -> Result<Vec<Arc<[Vector]>>, Garbled> {
        indices.iter().map(|&index| self.get(index).map(Arc::clone)).collect()
    }

    /// Writes all of them down.
    pub fn write(&self, writer: &mut Writer) {
        writer.u64(self.reference().len() as u64);
        writer.u64(self.all.len() as u64);
        self.all.iter().for_each(|points| writer.f64s(points.as_flattened()));
    }

    /// Reads what [`SavedPoints::write`] wrote; takes no more memory than that has bytes.
    ///
    /// # Errors
    /// [`Garbled`] where something is missing, or a coordinate is not finite.
    pub fn read(reader: &mut Reader<'_>) -> Result<Self, Garbled> {
        let vertices = reader.count(0)?;
        let bytes = vertices.checked_mul(size_of::<Vector>()).ok_or(reader.garbled())?;
        // Of an empty part there may be any number of empty arrays, of which each takes memory.
        let count = reader.count(bytes)?;
        if count == 0 || count > SHAPES.most {
            return Err(reader.garbled());
        }
        let mut all = Vec::new();
        for _ in 0..count {
            let values = reader.f64s(3 * vertices)?;
            let (vectors, rest) = values.as_chunks();
            if !rest.is_empty() || values.iter().any(|value| !value.is_finite()) {
                return Err(reader.garbled());
            }
            all.push(vectors.into());
        }
        Ok(Self { all })
    }
}

/// A [`CurrentShape`], with numbers into its [`SavedPoints`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SavedShape {
    points: u32,
    back: Vec<u32>,
    surface_only: bool,
}

impl CurrentShape {
    /// The shape in a form that can be written down beside `points`.
    pub fn save(&self, points: &mut SavedPoints) -> SavedShape {
        SavedShape {
            points: points.add(&self.points),
            back: self.back.iter().map(|shape| points.add(shape)).collect(),
            surface_only: self.surface_only,
        }
    }

    /// The shape that was saved.
    ///
    /// # Errors
    /// [`Garbled`] where it is none of these points.
    pub fn restored(saved: &SavedShape, points: &SavedPoints) -> Result<Self, Garbled> {
        Ok(Self {
            points: Arc::clone(points.get(saved.points)?),
            back: points.all_of(&saved.back)?,
            surface_only: saved.surface_only,
        })
    }
}

/// A [`Plan`], with numbers into its [`SavedPoints`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SavedPlan {
    way: Vec<u32>,
    shapes: Vec<(usize, f64)>,
    asked: Schedule,
    schedule: Schedule,
    /// The bits of the floor and the least scaled Jacobian.
    quality: [u64; 2],
    /// The bits of the numbers of each shape's quality.
    qualities: Vec<[u64; 3]>,
    back: Vec<u32>,
    target: SavedTarget,
    largest_displacement: f64,
    seconds: ShapeSeconds,
    surface_only: bool,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct SavedTarget {
    points: u32,
    way: Vec<u32>,
    fraction: f64,
    seconds: ShapeSeconds,
    iterations: usize,
    sub_steps: usize,
    surface_only: bool,
}

impl Plan {
    /// The plan in a form that can be written down beside `points`.
    pub fn save(&self, points: &mut SavedPoints) -> SavedPlan {
        let mut all = |shapes: &[Arc<[Vector]>]| -> Vec<u32> {
            shapes.iter().map(|shape| points.add(shape)).collect()
        };
        let PathQuality { floor, min_scaled_jacobian, shapes } = &self.quality;
        let of_shape = |it: &ShapeQuality| [it.fraction, it.min, it.mean].map(f64::to_bits);
        SavedPlan {
            way: all(&self.way),
            shapes: self.shapes.iter().map(|shape| (shape.piece, shape.fraction)).collect(),
            asked: self.asked,
            schedule: self.schedule,
            quality: [*floor, *min_scaled_jacobian].map(f64::to_bits),
            qualities: shapes.iter().map(of_shape).collect(),
            back: all(&self.back),
            target: SavedTarget {
                way: all(&self.target.way),
                points: points.add(&self.target.points),
                fraction: self.target.fraction,
                seconds: self.target.seconds,
                iterations: self.target.iterations,
                sub_steps: self.target.sub_steps,
                surface_only: self.target.surface_only,
            },
            largest_displacement: self.largest_displacement,
            seconds: self.seconds,
            surface_only: self.surface_only,
        }
    }

    /// The plan that was saved.
    ///
    /// # Errors
    /// [`Garbled`] where it makes no sense with these points.
    pub fn restored(saved: &SavedPlan, points: &SavedPoints) -> Result<Self, Garbled> {
        let garbled = Garbled { rank: 0 };
        let pieces = saved.way.len().checked_sub(1).filter(|pieces| *pieces > 0).ok_or(garbled)?;
        let shape = |&(piece, fraction): &(usize, f64)| {
            let is_there = piece < pieces && (0.0..=1.0).contains(&fraction);
            is_there.then_some(Shape { piece, fraction }).ok_or(garbled)
        };
        let of_shape = |bits: &[u64; 3]| {
            let [fraction, min, mean] = bits.map(f64::from_bits);
            ShapeQuality { fraction, min, mean }
        };
        saved.schedule.check().map_err(|_| garbled)?;
        let [floor, min_scaled_jacobian] = saved.quality.map(f64::from_bits);
        let target = &saved.target;
        Ok(Self {
            way: points.all_of(&saved.way)?,
            shapes: saved.shapes.iter().map(shape).collect::<Result<_, _>>()?,
            asked: saved.asked,
            schedule: saved.schedule,
            quality: PathQuality {
                floor,
                min_scaled_jacobian,
                shapes: saved.qualities.iter().map(of_shape).collect(),
            },
            back: points.all_of(&saved.back)?,
            target: Target {
                points: Arc::clone(points.get(target.points)?),
                reference: Arc::clone(points.reference()),
                way: points.all_of(&target.way)?,
                fraction: target.fraction,
                seconds: target.seconds,
                iterations: target.iterations,
                sub_steps: target.sub_steps,
                surface_only: target.surface_only,
            },
            largest_displacement: saved.largest_displacement,
            seconds: saved.seconds,
            surface_only: saved.surface_only,
        })
    }
}
