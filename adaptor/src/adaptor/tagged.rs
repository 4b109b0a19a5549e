//! Whether the features that a solver names have faces, and those faces are the mesh's.

use std::borrow::Cow;

use tombolo_deform::{
    mesh::{CellsView, FeatureSource, MeshError},
    surface::{check_feature_names, check_tagged_faces},
};
use tombolo_pipelines::{communicator::Reduction, extract::Channel};

use super::Adaptor;

impl Adaptor {
    /// Refuses faces with features that are none of the mesh, and names of features that no face of any rank has. Faces that lie
    /// inside the mesh make no feature of its surface; that is told. Collective.
    pub(super) fn check_features(&self, channel: &Channel<'_>) -> Result<(), MeshError> {
        let mut counts = [0.0; 2];
        let mut numbers: Vec<i64> = Vec::new();
        let mut own = Ok(());
        if let FeatureSource::Faces(tagged) = channel.mesh.features {
            numbers.extend(&tagged.tags);
            let cells = match channel.mesh.cells {
                CellsView::Owned(cells) => Ok(Cow::Borrowed(cells)),
                _ => channel.mesh.to_mesh().map(|mesh| Cow::Owned(mesh.cells().clone())),
            };
            let inside = cells.and_then(|cells| check_tagged_faces(tagged, &cells));
            #[expect(clippy::cast_precision_loss, reason = "counts below 2^53")]
            match inside {
                Ok(inside) => counts = [inside as f64, tagged.faces.len() as f64],
                Err(error) => own = Err(error),
            }
        }
        self.unite(&mut numbers);
        self.communicator.reduce(Reduction::Sum, &mut counts);
        own?;
        if let FeatureSource::Faces(tagged) = channel.mesh.features {
            check_feature_names(&tagged.names, &numbers)?;
        }
        let [inside, faces] = counts;
        if inside > 0.0 {
            self.complain(&format!(
                "channel '{}': {inside} of {faces} faces with features lie inside the mesh, and make no feature of its surface",
                channel.name
            ));
        }
        Ok(())
    }

    /// The numbers that any rank has, rising. Collective.
    fn unite(&self, numbers: &mut Vec<i64>) {
        numbers.sort_unstable();
        numbers.dedup();
        if self.communicator.size() == 1 {
            return;
        }
        let bytes = |numbers: &[i64]| numbers.iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<u8>>();
        let read = |bytes: &[u8]| -> Vec<i64> {
            bytes.as_chunks::<8>().0.iter().map(|number| i64::from_le_bytes(*number)).collect()
        };
        let mut all = bytes(numbers);
        if let Some(parts) = self.communicator.gather(0, &all) {
            let mut united: Vec<i64> = parts.iter().flat_map(|part| read(part)).collect();
            united.sort_unstable();
            united.dedup();
            all = bytes(&united);
        }
        self.communicator.broadcast(0, &mut all);
        *numbers = read(&all);
    }
}
