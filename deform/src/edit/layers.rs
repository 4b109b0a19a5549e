//! The effect of each layer of a stack, for reports.

use std::sync::Arc;

use serde::Serialize;

use super::editor::Editor;
use super::error::EditError;
use super::handle::{Handle, Role};
use super::kinds::Edit;
use crate::vector::subtract;

/// The effect of one edit of a stack.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Layer {
    /// The kind of edit, as JSON has it.
    pub edit: &'static str,
    /// The name that the layer was given.
    pub name: Option<String>,
    /// Whether it is passed over.
    pub muted: bool,
    /// How many vertices its handle has, those among them that are fixed too.
    pub handle_vertices: usize,
    /// How many vertices it holds where they are. Where there are none, whole pieces of the surface
    /// go with the handle.
    pub fixed_vertices: usize,
    /// How far this layer alone moves a vertex at most, in units of the mesh; 0 where it is muted.
    pub largest_displacement: f64,
}

impl Editor {
    /// The effect of each edit of a stack, from the oldest to the newest.
    ///
    /// Costs an evaluation of every layer.
    ///
    /// # Errors
    /// As [`Editor::displacement`].
    ///
    /// ```
    /// use std::sync::Arc;
    /// use tombolo_deform::{shapes, edit::{Edit, Editor}, features::FeatureSettings, surface::Surface};
    ///
    /// let mesh = shapes::box_of_tets([4, 2, 2], [0.0; 3], [2.0, 1.0, 1.0]);
    /// let mut editor = Editor::new(Arc::new(Surface::extract(&mesh, &FeatureSettings::default())?))?;
    /// let stack: Vec<Edit> = serde_json::from_str(r#"[
    ///     { "translate": { "features": ["x-max"], "fixed": ["x-min"], "by": [0, 3, 4], "name": "lift the outlet" } }
    /// ]"#)?;
    /// let layers = editor.layers(&stack)?;
    /// let layer = &layers[0];
    /// assert_eq!((layer.handle_vertices, layer.fixed_vertices, layer.largest_displacement), (9, 9, 5.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn layers(&mut self, stack: &[Edit]) -> Result<Vec<Layer>, EditError> {
        let surface = Arc::clone(self.surface());
        let mut layers = Vec::with_capacity(stack.len());
        let mut displacement = vec![[0.0; 3]; surface.points().len()];
        let known = self.take_layers(stack);
        self.evaluate(stack, 0, known, None, &mut displacement, |index, below, reached| {
            let edit = &stack[index];
            let handle = Handle::find(&surface, edit, index)?;
            let lengths = reached.iter().zip(below).map(|(reached, below)| {
                subtract(*reached, *below).iter().fold(0.0f64, |length, part| length.hypot(*part))
            });
            layers.push(Layer {
                edit: edit.name(),
                name: edit.layer_name().map(str::to_owned),
                muted: edit.muted(),
                handle_vertices: handle.vertices.len(),
                fixed_vertices: handle.roles.iter().filter(|role| **role == Role::Fixed).count(),
                largest_displacement: lengths.fold(0.0, f64::max),
            });
            Ok(())
        })?;
        Ok(layers)
    }
}
