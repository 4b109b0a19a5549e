//! Whether the features that a solver names have faces, and those faces are the mesh's.

use std::{borrow::Cow, collections::HashSet};

use tombolo_deform::communicator::Reduction;
use tombolo_deform::{
    features::{MisplacedFaces, check_feature_names, misplaced_faces},
    mesh::{CellsView, FeatureSource, MeshError, TaggedFaces, Vector},
};
use tombolo_pipelines::extract::Channel;

use super::Adaptor;

impl Adaptor {
    /// Refuses faces with features that are none of the mesh, and names of features that no face of
    /// any rank has. Faces that lie inside the mesh make no feature of its surface; that is told.
    /// Collective.
    pub(super) fn check_features(&self, channel: &Channel<'_>) -> Result<(), MeshError> {
        let mut counts = [0; 2];
        let mut numbers: Vec<i64> = Vec::new();
        let mut own = Ok(());
        let (mut found, none) = (MisplacedFaces::default(), TaggedFaces::default());
        let tagged =
            if let FeatureSource::Faces(tagged) = channel.mesh.features { tagged } else { &none };
        if !tagged.tags.is_empty() {
            numbers.extend(&tagged.tags);
            let cells = match channel.mesh.cells {
                CellsView::Owned(cells) => Ok(Cow::Borrowed(cells)),
                _ => channel.mesh.to_mesh().map(|mesh| Cow::Owned(mesh.cells().clone())),
            };
            match cells {
                Ok(cells) => found = misplaced_faces(tagged, &cells),
                Err(error) => own = Err(error),
            }
            counts = [found.inside as u64, tagged.faces.len() as u64];
        }
        self.unite(&mut numbers);
        self.communicator.reduce_integers(Reduction::Sum, &mut counts);
        self.forgive(&mut found, tagged, channel);
        own?;
        found.check(tagged)?;
        if let FeatureSource::Faces(tagged) = channel.mesh.features {
            check_feature_names(&tagged.names, &numbers)?;
        }
        let [inside, faces] = counts;
        if inside > 0 {
            self.complain(&format!(
                "channel '{}': {inside} of {faces} faces with features lie inside the mesh, and make no feature of its surface",
                channel.name
            ));
        }
        Ok(())
    }

    /// Takes the loose faces away that are faces of cells of another rank, which tags them too: a
    /// rank may name every face whose vertices it has. Faces are matched by their centres, to a
    /// millionth of the size of the whole mesh. Collective.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_precision_loss,
        reason = "counts, and millionths of the size"
    )]
    fn forgive(&self, misplaced: &mut MisplacedFaces, tagged: &TaggedFaces, channel: &Channel<'_>) {
        if self.communicator.size() == 1 || self.communicator.total(misplaced.loose.len()) == 0 {
            return;
        }
        let points = channel.mesh.points;
        let centre = |face: usize| -> Vector {
            let vertices = tagged.faces.vertices(face);
            let there = vertices
                .iter()
                .map(|&vertex| vertex as usize)
                .filter(|&vertex| vertex < points.len());
            let sum =
                |axis: usize| there.clone().map(|vertex| points.vector(vertex)[axis]).sum::<f64>();
            [0, 1, 2].map(|axis: usize| sum(axis) / vertices.len().max(1) as f64)
        };
        let mut reach = [0.0_f64];
        (0..tagged.faces.len())
            .flat_map(centre)
            .for_each(|value| reach[0] = reach[0].max(value.abs()));
        self.communicator.reduce(Reduction::Maximum, &mut reach);
        let square = |value: f64| (value / reach[0].max(f64::MIN_POSITIVE) * 1e6).round() as i64;
        let is_loose: HashSet<usize> = misplaced.loose.iter().copied().collect();
        let own: HashSet<[i64; 3]> = (0..tagged.faces.len())
            .filter(|face| !is_loose.contains(face))
            .map(|face| centre(face).map(square))
            .collect();
        let mine: Vec<u8> = misplaced
            .loose
            .iter()
            .flat_map(|&face| centre(face))
            .flat_map(f64::to_le_bytes)
            .collect();
        let all = self.communicator.gather_all(&mine).concat();
        let all: Vec<f64> =
            all.as_chunks::<8>().0.iter().map(|value| f64::from_le_bytes(*value)).collect();
        let mut known: Vec<u64> = all
            .as_chunks::<3>()
            .0
            .iter()
            .map(|centre| {
                let [x, y, z] = centre.map(square);
                let mut around = (0..27).map(|neighbour: i64| {
                    [x + neighbour % 3 - 1, y + neighbour / 3 % 3 - 1, z + neighbour / 9 - 1]
                });
                u64::from(around.any(|square| own.contains(&square)))
            })
            .collect();
        self.communicator.reduce_integers(Reduction::Maximum, &mut known);
        let known: HashSet<[u64; 3]> = all
            .as_chunks::<3>()
            .0
            .iter()
            .zip(known)
            .filter(|(_, known)| *known > 0)
            .map(|(centre, _)| centre.map(f64::to_bits))
            .collect();
        misplaced.loose.retain(|&face| !known.contains(&centre(face).map(f64::to_bits)));
    }

    /// The numbers that any rank has, rising. Collective.
    fn unite(&self, numbers: &mut Vec<i64>) {
        numbers.sort_unstable();
        numbers.dedup();
        if self.communicator.size() == 1 {
            return;
        }
        let bytes = |numbers: &[i64]| {
            numbers.iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<u8>>()
        };
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
