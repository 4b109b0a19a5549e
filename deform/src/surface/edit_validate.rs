//! What can be checked of an edit without a surface.

use super::edit_error::{InvalidEdit, finite};
use super::{Displacement, Edit, Skeleton};
use crate::limits::NAME;

impl Edit {
    /// Checks what can be checked without a surface: that there is a handle, that every number is finite, that directions have a
    /// length, that boxes are not turned inside out, that lists fit each other.
    ///
    /// # Errors
    /// [`InvalidEdit`], naming the field.
    pub fn validate(&self) -> Result<(), InvalidEdit> {
        if self.features().is_empty() && self.region().is_none() && !self.may_take_all() {
            return Err(InvalidEdit::NoHandle);
        }
        for (field, region) in [("region", self.region()), ("fixed_region", self.fixed_region())] {
            region.map_or(Ok(()), |region| region.validate(field))?;
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
        first: "`file`",
        second: "both `vertices` and `values`",
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
    let mut places: Vec<usize> = (0..edit.vertices.len()).collect();
    places.sort_by_key(|&place| (edit.vertices[place], place));
    let twice = places.windows(2).filter(|pair| edit.vertices[pair[0]] == edit.vertices[pair[1]]);
    match twice.min_by_key(|pair| pair[1]) {
        Some(pair) => Err(InvalidEdit::VertexTwice {
            vertex: edit.vertices[pair[0]],
            first: pair[0],
            second: pair[1],
        }),
        None => Ok(()),
    }
}

fn skeleton(edit: &Skeleton) -> Result<(), InvalidEdit> {
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
