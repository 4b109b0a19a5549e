//! Displacement files that edits name: relative ones lie beside the JSON file.

use std::path::Path;

use tombolo_deform::surface::{Displacement, Edit};

use super::{Change, Command, Config, Order, Stage, TimedCommand};

/// Takes the files that edits name as lying beside `file`, the JSON file that the edits stand in, where they are relative.
///
/// [`parse`](super::parse) and [`parse_orders`](super::parse_orders) do so by themselves.
///
/// ```
/// use tombolo_deform::surface::Edit;
/// use tombolo_pipelines::language::{place_beside, parse_json};
///
/// let mut edits: Vec<Edit> = parse_json(r#"[{"displacement": {"file": "lift.txt"}}]"#, "cases/edits.json")?;
/// place_beside(&mut edits, "cases/edits.json");
/// let Edit::Displacement(import) = &edits[0] else { unreachable!() };
/// assert_eq!(import.file.as_deref(), Some("cases/lift.txt"));
/// # Ok::<(), tombolo_pipelines::language::LanguageError>(())
/// ```
pub fn place_beside(edits: &mut [Edit], file: &str) {
    for edit in edits {
        if let Edit::Displacement(import) = edit {
            place(import, file);
        }
    }
}

pub(super) fn place_config(config: &mut Config, file: &str) {
    for stage in config.pipelines.iter_mut().flat_map(|pipeline| &mut pipeline.stages) {
        if let Stage::Displacement(import) = stage {
            place(import, file);
        }
    }
}

pub(super) fn place_orders(commands: &mut [TimedCommand], file: &str) {
    for command in commands {
        if let Command::Order(order) = &mut command.command {
            place_beside(order.edits_mut(), file);
        }
    }
}

fn place(import: &mut Displacement, file: &str) {
    let folder = Path::new(file).parent().filter(|folder| !folder.as_os_str().is_empty());
    if let (Some(name), Some(folder)) = (&mut import.file, folder) {
        // An absolute name stays as it is.
        *name = folder.join(&*name).to_string_lossy().into_owned();
    }
}

impl Order {
    /// The edits that the order brings.
    #[must_use]
    pub fn edits(&self) -> &[Edit] {
        match &self.change {
            Change::Edits(edits) | Change::Stack(edits) => edits,
            Change::Undo(_) => &[],
        }
    }

    /// The edits that the order brings.
    #[must_use]
    pub fn edits_mut(&mut self) -> &mut [Edit] {
        match &mut self.change {
            Change::Edits(edits) | Change::Stack(edits) => edits,
            Change::Undo(_) => &mut [],
        }
    }
}

impl Command {
    /// The first edit that names a file, and the file.
    #[must_use]
    pub fn file(&self) -> Option<(usize, &str)> {
        let Command::Order(order) = self else { return None };
        order.edits().iter().enumerate().find_map(|(place, edit)| match edit {
            Edit::Displacement(import) => Some((place, import.file.as_deref()?)),
            _ => None,
        })
    }
}
