//! Coordinates: uniform, rectilinear, explicit.

use std::ffi::CStr;

use tombolo::deform::mesh::Vector;
use tombolo::foreign::mesh::Coordset;
use tombolo::foreign::{Array, RunError};

use crate::node::{Kind, Node};

const AXES: [&CStr; 3] = [c"x", c"y", c"z"];
const COUNTS: [&CStr; 3] = [c"i", c"j", c"k"];
const SPACINGS: [&CStr; 3] = [c"dx", c"dy", c"dz"];

/// Up to three whole numbers at `i`, `j`, `k`; those that are missing are 0.
pub(super) fn counts(node: &Node<'_, '_>) -> Result<([usize; 3], usize), RunError> {
    let mut counts = [0; 3];
    let mut dimension = 0;
    for (axis, name) in COUNTS.into_iter().enumerate() {
        if let Some(child) = node.child(name) {
            counts[axis] = usize::try_from(child.count()?).unwrap_or(usize::MAX);
            dimension = axis + 1;
        }
    }
    if dimension == 0 { Err(node.wrong("whole numbers i, j, k")) } else { Ok((counts, dimension)) }
}

/// Reads a coordset.
pub(super) fn read<'call>(node: &Node<'_, 'call>) -> Result<Coordset<'call>, RunError> {
    let kind = node.need(c"type", "'uniform', 'rectilinear' or 'explicit'")?;
    match &*kind.text()? {
        "uniform" => uniform(node),
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
        other => {
            Err(kind.wrong_found(format!("'{other}'"), "'uniform', 'rectilinear' or 'explicit'"))
        }
    }
}

fn uniform<'call>(node: &Node<'_, 'call>) -> Result<Coordset<'call>, RunError> {
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
    let vector = |name: &CStr, parts: [&CStr; 3], default: f64| -> Result<Vector, RunError> {
        let mut vector = [default; 3];
        if let Some(parent) = node.child(name) {
            for (value, part) in vector.iter_mut().zip(parts) {
                if let Some(child) = parent.child(part) {
                    *value = child.number()?;
                    if !value.is_finite() {
                        return Err(child.wrong_found(format!("{value}"), "a finite number"));
                    }
                }
            }
        }
        Ok(vector)
    };
    let origin = vector(c"origin", AXES, 0.0)?;
    let spacing = vector(c"spacing", SPACINGS, 1.0)?;
    Ok(Coordset::Uniform { points, origin, spacing, dimension })
}

/// The arrays `values/x`, `values/y`, `values/z`, as many as there are.
fn axes<'call>(node: &Node<'_, 'call>) -> Result<Vec<Array<'call>>, RunError> {
    let values = node.need(c"values", "an object of x, y, z")?;
    if values.kind() != Kind::Object {
        return Err(values.wrong("an object of x, y, z"));
    }
    let mut axes = Vec::with_capacity(3);
    for name in AXES {
        match values.child(name) {
            Some(child) => axes.push(child.array()?),
            None => break,
        }
    }
    if axes.is_empty() || axes.len() != values.len() {
        return Err(values.wrong("the coordinates x, or x and y, or x, y and z"));
    }
    Ok(axes)
}
