//! Parts of an edit.

use super::Edit;
use crate::vector::scale;

impl Edit {
    /// The same edit with a fraction of its amount: 1 is the edit itself, 0 moves nothing. Distances, angles, and how far
    /// factors and matrices are from the identity, are multiplied.
    ///
    /// ```
    /// use tombolo_deform::surface::Edit;
    ///
    /// let edit: Edit = serde_json::from_str(r#"{"scale_direction": {"features": ["throat"], "factors": [1, 1, 0.5]}}"#)?;
    /// let Edit::ScaleDirection(half) = edit.scaled(0.5) else { panic!() };
    /// assert_eq!(half.factors, [1.0, 1.0, 0.75]);
    /// assert_eq!(edit.scaled(1.0), edit);
    /// # Ok::<(), serde_json::Error>(())
    /// ```
    #[must_use]
    pub fn scaled(&self, fraction: f64) -> Self {
        let mut edit = self.clone();
        if fraction == 1.0 {
            return edit;
        }
        match &mut edit {
            Edit::Translate(edit) => edit.by = scale(edit.by, fraction),
            Edit::Rotate(edit) => edit.degrees *= fraction,
            Edit::ScaleDirection(edit) => {
                edit.factors = edit.factors.map(|factor| 1.0 + fraction * (factor - 1.0))
            }
            Edit::ScaleNormals(edit) => edit.distance *= fraction,
            Edit::Affine(edit) => {
                for (place, row) in edit.matrix.iter_mut().enumerate() {
                    for (column, value) in row.iter_mut().enumerate() {
                        let identity = f64::from(u8::from(place == column));
                        *value = identity + fraction * (*value - identity);
                    }
                }
                edit.translation = scale(edit.translation, fraction);
            }
            Edit::Displacement(edit) => edit.scale *= fraction,
            Edit::Skeleton(edit) => {
                edit.by = edit.by.map(|by| scale(by, fraction));
                for drag in &mut edit.moves {
                    drag.by = scale(drag.by, fraction);
                }
            }
        }
        edit
    }
}
