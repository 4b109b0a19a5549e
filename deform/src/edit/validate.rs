//! The checks of an edit that need no surface.

use super::error::{InvalidEdit, finite};
use super::kinds::{Displacement, Edit, SkeletonEdit};
use super::region::Region;
use crate::limits::NAME;

impl Edit {
    /// Checks what can be checked without a surface: that there is a handle, that every number is
    /// finite, that directions have a length, that boxes are not turned inside out, that lists fit
    /// each other.
    ///
    /// # Errors
    /// [`InvalidEdit`], naming the field.
    pub fn validate(&self) -> Result<(), InvalidEdit> {
        if self.features().is_empty() && self.region().is_none() && !self.may_take_all() {
            return Err(InvalidEdit::NoHandle);
        }
        for (field, region) in [("region", self.region()), ("fixed_region", self.fixed_region())] {
            region.map_or(Ok(()), |region| check_region(region, field))?;
        }
        if let Some(name) = self.layer_name()
            && (name.trim().is_empty()
                || name.chars().any(char::is_control)
                || NAME.check(name.chars().count()).is_err())
        {
            return Err(InvalidEdit::Name);
        }
        match self {
            Edit::Translate(edit) => finite("by", &edit.by),
            Edit::Rotate(edit) => {
                finite("axis", &edit.axis)?;
                if edit.axis == [0.0; 3] {
                    return Err(InvalidEdit::NoDirection { field: "axis".into() });
                }
                finite("degrees", &[edit.degrees])?;
                edit.center.map_or(Ok(()), |center| finite("center", &center))
            }
            Edit::ScaleDirection(edit) => {
                finite("factors", &edit.factors)?;
                edit.center.map_or(Ok(()), |center| finite("center", &center))
            }
            Edit::ScaleNormals(edit) => finite("distance", &[edit.distance]),
            Edit::Affine(edit) => {
                for (row, values) in edit.matrix.iter().enumerate() {
                    finite(&format!("matrix[{row}]"), values)?;
                }
                finite("translation", &edit.translation)?;
                edit.center.map_or(Ok(()), |center| finite("center", &center))
            }
            Edit::Displacement(edit) => displacement(edit),
            Edit::Skeleton(edit) => skeleton(edit),
        }
    }
}

fn displacement(edit: &Displacement) -> Result<(), InvalidEdit> {
    finite("scale", &[edit.scale])?;
    let either_or = |field: &str| InvalidEdit::EitherOr {
        field: field.into(),
        first: "both `vertices` and `values`",
        second: "`file`, which only a JSON file can name",
    };
    let numbers = !edit.vertices.is_empty() || !edit.values.is_empty();
    match &edit.file {
        Some(_) if numbers => return Err(either_or("file")),
        Some(file) if file.is_empty() => {
            return Err(InvalidEdit::EmptyList {
                field: "file".into(),
                expected: "the name of a file",
            });
        }
        Some(_) => return Ok(()),
        None if !numbers => return Err(either_or("vertices")),
        None => {}
    }
    if edit.vertices.len() != edit.values.len() {
        return Err(InvalidEdit::Lengths {
            vertices: edit.vertices.len(),
            values: edit.values.len(),
        });
    }
    for (index, value) in edit.values.iter().enumerate() {
        finite(&format!("values[{index}]"), value)?;
    }
    let mut indices: Vec<usize> = (0..edit.vertices.len()).collect();
    indices.sort_by_key(|&index| (edit.vertices[index], index));
    let twice = indices.windows(2).filter(|pair| edit.vertices[pair[0]] == edit.vertices[pair[1]]);
    match twice.min_by_key(|pair| pair[1]) {
        Some(pair) => Err(InvalidEdit::VertexTwice {
            vertex: edit.vertices[pair[0]],
            first: pair[0],
            second: pair[1],
        }),
        None => Ok(()),
    }
}

fn skeleton(edit: &SkeletonEdit) -> Result<(), InvalidEdit> {
    let either_or = |field: &str| InvalidEdit::EitherOr {
        field: field.into(),
        first: "both `at` and `by`",
        second: "`moves`",
    };
    match (edit.at, edit.by, edit.moves.is_empty()) {
        (Some(at), Some(by), true) => {
            finite("at", &at)?;
            finite("by", &by)
        }
        (None, None, false) => edit.moves.iter().enumerate().try_for_each(|(index, drag)| {
            finite(&format!("moves[{index}].at"), &drag.at)?;
            finite(&format!("moves[{index}].by"), &drag.by)
        }),
        (Some(_), None, _) => Err(either_or("at")),
        (None, Some(_), _) => Err(either_or("by")),
        (Some(_), Some(_), false) | (None, None, true) => Err(either_or("moves")),
    }
}

/// Checks what can be checked of a region without a surface. `field` is the field that holds it.
fn check_region(region: &Region, field: &str) -> Result<(), InvalidEdit> {
    match region {
        Region::Box(region) => {
            finite(&format!("{field}.box.lower"), &region.lower)?;
            finite(&format!("{field}.box.upper"), &region.upper)?;
            match (0..3).find(|&axis| region.lower[axis] > region.upper[axis]) {
                None => Ok(()),
                Some(axis) => Err(InvalidEdit::TurnedBox {
                    field: format!("{field}.box.lower[{axis}]"),
                    lower: region.lower[axis],
                    upper: region.upper[axis],
                }),
            }
        }
        Region::Sphere(region) => {
            finite(&format!("{field}.sphere.center"), &region.center)?;
            let radius = format!("{field}.sphere.radius");
            finite(&radius, &[region.radius])?;
            if region.radius < 0.0 {
                return Err(InvalidEdit::NegativeRadius { field: radius, radius: region.radius });
            }
            Ok(())
        }
        Region::HalfSpace(region) => {
            finite(&format!("{field}.half_space.origin"), &region.origin)?;
            let normal = format!("{field}.half_space.normal");
            finite(&normal, &region.normal)?;
            if region.normal == [0.0; 3] {
                return Err(InvalidEdit::NoDirection { field: normal });
            }
            Ok(())
        }
        Region::Faces(faces) if faces.is_empty() => Err(InvalidEdit::EmptyList {
            field: format!("{field}.faces"),
            expected: "at least one face",
        }),
        Region::Faces(_) => Ok(()),
    }
}
