//! Coordinates: uniform, rectilinear, explicit.

use std::ffi::CStr;

use tombolo::deform::mesh::{ArrayView, Vector};

use crate::array::{Array, Fingerprint};
use crate::error::CatalystError;
use crate::node::{Kind, Node};

const AXES: [&CStr; 3] = [c"x", c"y", c"z"];
const COUNTS: [&CStr; 3] = [c"i", c"j", c"k"];
const SPACINGS: [&CStr; 3] = [c"dx", c"dy", c"dz"];

/// Where the vertices lie.
#[derive(Debug, Clone)]
pub(super) enum Coordset<'call> {
    Uniform { points: [usize; 3], origin: Vector, spacing: Vector },
    Rectilinear { axes: Vec<Array<'call>> },
    Explicit { axes: Vec<Array<'call>> },
}

/// Up to three whole numbers at `i`, `j`, `k`; those that are missing are 0.
pub(super) fn counts(node: &Node<'_, '_>) -> Result<([usize; 3], usize), CatalystError> {
    let mut counts = [0; 3];
    let mut dimension = 0;
    for (axis, name) in COUNTS.into_iter().enumerate() {
        if let Some(child) = node.child(name) {
            counts[axis] = usize::try_from(child.count()?).unwrap_or(usize::MAX);
            dimension = axis + 1;
        }
    }
    if dimension == 0 {
        Err(node.wrong("whole numbers i, j, k".into()))
    } else {
        Ok((counts, dimension))
    }
}

impl<'call> Coordset<'call> {
    pub(super) fn read(node: &Node<'_, 'call>) -> Result<Self, CatalystError> {
        let kind = node.need(c"type", "'uniform', 'rectilinear' or 'explicit'")?;
        match &*kind.text()? {
            "uniform" => Self::uniform(node),
            "rectilinear" => Ok(Coordset::Rectilinear { axes: axes(node)? }),
            "explicit" => {
                let axes = axes(node)?;
                if let [first, others @ ..] = axes.as_slice()
                    && let Some(axis) = others.iter().position(|other| other.len() != first.len())
                {
                    let values = node.need(c"values", "an object of x, y, z")?;
                    let name = AXES[axis + 1];
                    let wrong = values.need(name, "the coordinates")?;
                    return Err(wrong.wrong(format!("{} values, as many as in x", first.len())));
                }
                Ok(Coordset::Explicit { axes })
            }
            other => Err(kind.wrong_found(
                format!("'{other}'"),
                "'uniform', 'rectilinear' or 'explicit'".into(),
            )),
        }
    }

    fn uniform(node: &Node<'_, 'call>) -> Result<Self, CatalystError> {
        let dims = node.need(c"dims", "the number of points along i, j, k")?;
        let (mut points, dimension) = counts(&dims)?;
        points.iter_mut().skip(dimension).for_each(|count| *count = 1);
        let product = points.iter().try_fold(1_usize, |product, count| product.checked_mul(*count));
        if product.is_none_or(|product| product > u32::MAX as usize) {
            return Err(dims.wrong_found(
                format!("{points:?} points"),
                format!("at most {} points in all", u32::MAX),
            ));
        }
        let vector =
            |name: &CStr, parts: [&CStr; 3], default: f64| -> Result<Vector, CatalystError> {
                let mut vector = [default; 3];
                if let Some(parent) = node.child(name) {
                    for (value, part) in vector.iter_mut().zip(parts) {
                        if let Some(child) = parent.child(part) {
                            *value = child.number()?;
                            if !value.is_finite() {
                                return Err(
                                    child.wrong_found(format!("{value}"), "a finite number".into())
                                );
                            }
                        }
                    }
                }
                Ok(vector)
            };
        let origin = vector(c"origin", AXES, 0.0)?;
        let spacing = vector(c"spacing", SPACINGS, 1.0)?;
        Ok(Coordset::Uniform { points, origin, spacing })
    }

    /// Points along each axis of a grid; `None` for explicit coordinates.
    pub(super) fn grid(&self) -> Option<[usize; 3]> {
        match self {
            Coordset::Uniform { points, .. } => Some(*points),
            Coordset::Rectilinear { axes } => {
                Some(std::array::from_fn(|axis| axes.get(axis).map_or(1, Array::len)))
            }
            Coordset::Explicit { .. } => None,
        }
    }

    pub(super) fn len(&self) -> usize {
        match self {
            Coordset::Explicit { axes } => axes.first().map_or(0, Array::len),
            _ => self.grid().map_or(0, |points| points.iter().product()),
        }
    }

    /// The coordinates as they lie in the solver's memory, where they can be lent.
    pub(super) fn lent(&self) -> Option<ArrayView<'call>> {
        let Coordset::Explicit { axes } = self else { return None };
        super::field::lent(axes)
    }

    /// Adds the coordinates to a copy.
    pub(super) fn append(&self, points: &mut Vec<Vector>) {
        let place = |array: &Array, index: usize| array.get(index);
        match self {
            Coordset::Explicit { axes } => points.extend((0..self.len()).map(|index| {
                std::array::from_fn(|axis| axes.get(axis).map_or(0.0, |axis| place(axis, index)))
            })),
            Coordset::Uniform { points: counts, origin, spacing, .. } => {
                grid(*counts, |at| {
                    points.push(std::array::from_fn(|axis| {
                        let along =
                            if counts[axis] > 1 { at[axis] as f64 * spacing[axis] } else { 0.0 };
                        origin[axis] + along
                    }));
                });
            }
            Coordset::Rectilinear { axes } => {
                let Some(counts) = self.grid() else { return };
                grid(counts, |at| {
                    points.push(std::array::from_fn(|axis| {
                        axes.get(axis).map_or(0.0, |axis_| place(axis_, at[axis]))
                    }));
                });
            }
        }
    }

    pub(super) fn fingerprint(&self, into: &mut Fingerprint) {
        // Coordinates may move from step to step; only their number makes another mesh.
        into.add(self.len() as u64);
    }

    pub(super) fn arrays(&self) -> &[Array<'call>] {
        match self {
            Coordset::Explicit { axes } | Coordset::Rectilinear { axes } => axes,
            Coordset::Uniform { .. } => &[],
        }
    }
}

/// Calls `visit` with the place of each point of a grid, i fastest.
fn grid(counts: [usize; 3], mut visit: impl FnMut([usize; 3])) {
    for k in 0..counts[2] {
        for j in 0..counts[1] {
            for i in 0..counts[0] {
                visit([i, j, k]);
            }
        }
    }
}

/// The arrays `values/x`, `values/y`, `values/z`, as many as there are.
fn axes<'call>(node: &Node<'_, 'call>) -> Result<Vec<Array<'call>>, CatalystError> {
    let values = node.need(c"values", "an object of x, y, z")?;
    if values.kind() != Kind::Object {
        return Err(values.wrong("an object of x, y, z".into()));
    }
    let mut axes = Vec::with_capacity(3);
    for name in AXES {
        match values.child(name) {
            Some(child) => axes.push(child.array()?),
            None => break,
        }
    }
    if axes.is_empty() || axes.len() != values.len() {
        return Err(values.wrong("the coordinates x, or x and y, or x, y and z".into()));
    }
    Ok(axes)
}
