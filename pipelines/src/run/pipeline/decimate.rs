//! The stage that leaves fewer triangles.

use std::sync::Arc;

use tombolo_deform::communicator::Reduction;
use tombolo_deform::number::real;

use super::{Prepared, Progress};
use crate::extract::{Decimation, skin};
use crate::language::Decimate;

impl Prepared {
    /// Takes triangles out of what is streamed and written. Collective.
    pub(super) fn decimate(&self, stage: &Decimate, progress: &mut Progress) {
        let mut told = [f64::NEG_INFINITY; 2];
        if let Some(mut extract) = self.finished(progress) {
            match skin(&extract) {
                Ok(Some(outside)) => extract = outside.into(),
                Ok(None) => {}
                Err(error) => progress.errors.push(("skin".into(), error.to_string())),
            }
            if extract.cells.dimension() < 2 {
                told = [0.0; 2];
                progress.decimated = Some(extract);
            } else {
                // As long as the surface does not move it stays the same.
                let known = progress.decimation.take().filter(|known| known.is_of(&extract));
                let made = match known {
                    Some(known) => Ok(known),
                    None => Decimation::new(&extract, stage).map(Arc::new),
                };
                match made {
                    Ok(decimation) => {
                        let left = decimation.apply(&extract);
                        told = [decimation.error, real(left.cells.len())];
                        progress.decimated = Some(Arc::new(left));
                        progress.decimation = Some(decimation);
                    }
                    Err(error) => {
                        progress.errors.push(("decimate".into(), format!("decimate: {error}")));
                    }
                }
            }
        }
        // Rank 0 alone has the whole surface.
        progress.is_decimated = progress.communicator.any(progress.decimated.is_some());
        progress.communicator.reduce(Reduction::Maximum, &mut told);
        progress.values.extend(told.map(|value| if value.is_finite() { value } else { f64::NAN }));
    }
}
