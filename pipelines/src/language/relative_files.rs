//! Displacement files that edits name: relative ones lie beside the JSON file.

use std::path::Path;

use tombolo_deform::edit::{Displacement, Edit};

use super::{Command, Pipeline, Stage};

/// Resolves the files that edits name against the folder of `file`, the JSON file that the edits
/// stand in, where they are relative.
///
/// [`parse`](super::parse) and [`parse_orders`](super::parse_orders) do so by themselves.
///
/// ```
/// use tombolo_deform::edit::Edit;
/// use tombolo_pipelines::language::{resolve_files, parse_json};
///
/// let mut edits: Vec<Edit> = parse_json(r#"[{"displacement": {"file": "lift.txt"}}]"#, "cases/edits.json")?;
/// resolve_files(&mut edits, "cases/edits.json");
/// let Edit::Displacement(import) = &edits[0] else { unreachable!() };
/// assert_eq!(import.file.as_deref(), Some("cases/lift.txt"));
/// # Ok::<(), tombolo_pipelines::language::LanguageError>(())
/// ```
pub fn resolve_files(edits: &mut [Edit], file: &str) {
    for edit in edits {
        if let Edit::Displacement(import) = edit {
            resolve(import, file);
        }
    }
}

/// Does so for the edits and pipelines of a command.
pub(super) fn resolve_command_files(command: &mut Command, file: &str) {
    match command {
        Command::Order(order) => resolve_files(order.edits_mut(), file),
        Command::Pipelines(change) => resolve_pipeline_files(change.pipelines_mut(), file),
        _ => {}
    }
}

pub(super) fn resolve_pipeline_files(pipelines: &mut [Pipeline], file: &str) {
    for stage in pipelines.iter_mut().flat_map(|pipeline| &mut pipeline.stages) {
        if let Stage::Displacement(import) = stage {
            resolve(import, file);
        }
    }
}

fn resolve(import: &mut Displacement, file: &str) {
    let folder = Path::new(file).parent().filter(|folder| !folder.as_os_str().is_empty());
    if let (Some(name), Some(folder)) = (&mut import.file, folder) {
        // An absolute name stays as it is.
        *name = folder.join(&*name).to_string_lossy().into_owned();
    }
}
