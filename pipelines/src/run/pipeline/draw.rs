//! The stage that draws pictures.

use std::sync::Arc;

use tombolo_deform::communicator::agree;

use super::{Output, Prepared, Progress};
use crate::extract::{Snapshot, shown, unknown_field};
use crate::language::{Render, picture_pattern};
use crate::render::{Subject, render};

impl Prepared {
    /// Draws the extract, or the outside of the whole mesh. Collective.
    pub(super) fn render(&self, stage: &Render, progress: &mut Progress) {
        self.take_whole(progress);
        let communicator = progress.communicator;
        let extracted = progress.extracted.as_ref();
        // Where the extract could not be taken, its error has been reported already.
        if !communicator.all(extracted.is_some()) {
            return;
        }
        let Some(extracted) = extracted else { return };
        let whole = progress.source.whole_mesh();
        let mut extracted = extracted.clone();
        // Fields that no other stage is to see may colour.
        Arc::make_mut(&mut extracted.extract).fields.extend(progress.unselected.iter().cloned());
        let fail = |message: String| ("render".to_owned(), format!("render: {message}"));
        let shown = shown(communicator, whole, &extracted);
        let shown = match agree(communicator, shown) {
            Ok(shown) => shown,
            Err(error) => return progress.errors.push(fail(error.message)),
        };
        let fields = &shown.extract.fields;
        let is_bare = shown.extract.cells.is_empty();
        let field = match &stage.field {
            None => Ok(None),
            Some(name) => match fields.iter().find(|field| field.name == *name) {
                Some(field) => Ok(Some(field)),
                None if is_bare => Ok(None),
                None => Err(unknown_field(name, fields.iter().map(|field| field.name.as_str()))),
            },
        };
        let Snapshot { cycle, time, .. } = *progress.snapshot;
        let field = match agree(communicator, field) {
            Ok(field) => field,
            Err(error) => {
                if error.rank == communicator.rank() {
                    progress.errors.push(fail(error.message));
                }
                return;
            }
        };
        if progress.is_trial {
            return;
        }
        match render(stage, &Subject { shown: &shown, field, cycle, time }, communicator) {
            Ok(pictures) => {
                for picture in pictures {
                    match picture_pattern(&stage.file, cycle, time, &picture.camera) {
                        Ok(path) => progress.outputs.push(Output::Picture {
                            pipeline: Arc::clone(&self.name),
                            path,
                            cycle,
                            time,
                            picture: picture.into(),
                        }),
                        Err(problem) => progress.errors.push(fail(problem.to_string())),
                    }
                }
            }
            Err(message) => {
                if communicator.rank() == 0 {
                    progress.errors.push(fail(message));
                }
            }
        }
    }
}
