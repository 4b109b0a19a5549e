//! The layers that an editor keeps of the stacks that it has evaluated.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::kinds::Edit;
use super::motion::Motion;
use crate::mesh::Vector;
use crate::parallel;

/// How many numbers the kept layers may hold together; the newest is always kept.
const FIELDS_KEPT: usize = 1 << 24;

/// Vertices that one thread adds up in one go.
const CHUNK: usize = 1 << 14;

/// The layers evaluated last, the most recently used at the end.
#[derive(Default)]
pub(super) struct KeptLayers {
    layers: VecDeque<KeptLayer>,
    /// How many numbers they hold for each vertex.
    fields: usize,
}

impl KeptLayers {
    /// One of them, by its index.
    pub(super) fn get(&self, index: usize) -> &KeptLayer {
        &self.layers[index]
    }

    pub(super) fn last(&self) -> Option<&KeptLayer> {
        self.layers.back()
    }

    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Takes one of them out, by its index.
    pub(super) fn take(&mut self, index: usize) -> Option<KeptLayer> {
        let layer = self.layers.remove(index)?;
        self.fields -= layer.fields();
        Some(layer)
    }

    /// Takes out the layers of a stack's edits, by their indices.
    pub(super) fn take_all(&mut self, stack: &[Edit]) -> BTreeMap<usize, KeptLayer> {
        let fits = self.in_common(stack);
        let mut taken = BTreeMap::new();
        for (layer, in_common) in std::mem::take(&mut self.layers).into_iter().zip(fits) {
            if layer.index <= in_common && layer.index < stack.len() {
                self.fields -= layer.fields();
                // Of two the newer one.
                taken.insert(layer.index, layer);
            } else {
                self.layers.push_back(layer);
            }
        }
        taken
    }

    /// Keeps a layer of a surface of so many vertices, and lets the oldest go that there is no room
    /// for beside it.
    pub(super) fn keep(&mut self, layer: KeptLayer, vertices: usize) {
        let room = FIELDS_KEPT / vertices.max(1);
        self.fields += layer.fields();
        self.layers.push_back(layer);
        while self.fields > room && self.layers.len() > 1 {
            let oldest = self.layers.pop_front();
            self.fields -= oldest.map_or(0, |oldest| oldest.fields());
        }
    }

    /// The kept layer that has the most of a stack below it, and best fits the edit above.
    pub(super) fn best_for(&self, stack: &[Edit]) -> Option<usize> {
        let mut best: Option<((usize, bool), usize)> = None;
        for (index, (layer, in_common)) in self.layers.iter().zip(self.in_common(stack)).enumerate()
        {
            let Some(edit) = stack.get(layer.index).filter(|_| layer.index <= in_common) else {
                continue;
            };
            if best.is_some_and(|((index, _), _)| layer.index < index) {
                continue;
            }
            let fits = layer.followed.as_ref().is_some_and(|followed| followed.is_for(edit));
            best = best.max(Some(((layer.index, fits), index)));
        }
        best.map(|(_, index)| index)
    }

    /// For each of them how many edits its stack and this one have in common from the first on.
    fn in_common(&self, stack: &[Edit]) -> Vec<usize> {
        // Layers of one evaluation share their stack, which is compared once.
        let mut compared: Option<(&Arc<[Edit]>, usize)> = None;
        let mut counts = Vec::with_capacity(self.layers.len());
        for KeptLayer { stack: own, .. } in &self.layers {
            let count = match compared {
                Some((other, count)) if Arc::ptr_eq(other, own) => count,
                _ => {
                    #[cfg(test)]
                    tests::COMPARED.set(tests::COMPARED.get() + own.len().min(stack.len()));
                    own.iter().zip(stack).take_while(|(a, b)| a == b).count()
                }
            };
            compared = Some((own, count));
            counts.push(count);
        }
        counts
    }
}

/// An edit as it was evaluated, with what is below it in its stack.
pub(super) struct KeptLayer {
    /// The stack that it was evaluated in, which its other layers share.
    pub(super) stack: Arc<[Edit]>,
    /// How many edits of it are below this one.
    pub(super) index: usize,
    /// The displacement that those lead to.
    pub(super) below: Vec<Vector>,
    pub(super) followed: Option<Followed>,
}

impl KeptLayer {
    /// How many numbers it holds for each vertex.
    fn fields(&self) -> usize {
        3 + self.followed.as_ref().map_or(0, |followed| followed.bases.iter().flatten().count())
    }
}

/// The motion of the whole surface for each base of the motion of a handle.
pub(super) struct Followed {
    /// The edit but for its amount.
    pub(super) setting: Edit,
    /// The unit of its [`Motion`].
    pub(super) unit: f64,
    /// For each base its value at each vertex, once it has been needed.
    pub(super) bases: Vec<Option<Vec<f64>>>,
}

impl Followed {
    pub(super) fn is_for(&self, edit: &Edit) -> bool {
        !edit.muted() && edit.harmonic_order().is_some() && without_amount(edit) == self.setting
    }

    /// The bases that an edit has a part of and that have not been solved for.
    pub(super) fn missing(&self, edit: &Edit) -> impl Iterator<Item = usize> {
        let coefficients = Motion::coefficients(edit, self.unit);
        self.bases
            .iter()
            .zip(coefficients)
            .enumerate()
            .filter(|(_, (base, coefficient))| base.is_none() && *coefficient != [0.0; 3])
            .map(|(base, _)| base)
    }

    pub(super) fn has_bases_of(&self, edit: &Edit) -> bool {
        self.missing(edit).next().is_none()
    }

    /// `displacement` becomes `below` and what an edit adds to it; whether it is everywhere at most
    /// `limit`.
    pub(super) fn add(
        &self,
        edit: &Edit,
        below: &[Vector],
        limit: f64,
        displacement: &mut [Vector],
    ) -> bool {
        let coefficients = Motion::coefficients(edit, self.unit);
        let terms: Vec<(&[f64], Vector)> = self
            .bases
            .iter()
            .zip(coefficients)
            .filter(|(_, coefficient)| *coefficient != [0.0; 3])
            .filter_map(|(base, coefficient)| Some((base.as_deref()?, coefficient)))
            .collect();
        match terms.as_slice() {
            [a] => add_terms([a], below, limit, displacement),
            [a, b] => add_terms([a, b], below, limit, displacement),
            [a, b, c] => add_terms([a, b, c], below, limit, displacement),
            [a, b, c, d] => add_terms([a, b, c, d], below, limit, displacement),
            _ => add_terms([], below, limit, displacement),
        }
    }
}

/// Each base times its coefficient and what is below; whether all of it is at most `limit`.
fn add_terms<const COUNT: usize>(
    terms: [&(&[f64], Vector); COUNT],
    below: &[Vector],
    limit: f64,
    displacement: &mut [Vector],
) -> bool {
    let all_within = AtomicBool::new(true);
    parallel::for_each_chunk(displacement, CHUNK, |chunk, part| {
        let range = CHUNK * chunk..CHUNK * chunk + part.len();
        let terms = terms.map(|(base, coefficient)| (&base[range.clone()], *coefficient));
        let mut within = true;
        for (index, (moved, below)) in part.iter_mut().zip(&below[range.clone()]).enumerate() {
            let mut sum = [0.0; 3];
            for (base, coefficient) in terms {
                for axis in 0..3 {
                    sum[axis] += base[index] * coefficient[axis];
                }
            }
            for axis in 0..3 {
                moved[axis] = below[axis] + sum[axis];
                within &= moved[axis].abs() <= limit;
            }
        }
        if !within {
            all_within.store(false, Ordering::Relaxed);
        }
    });
    all_within.into_inner()
}

/// An edit but for what its coefficients ([`Motion::coefficients`]) depend on, and for its name.
pub(super) fn without_amount(edit: &Edit) -> Edit {
    let mut edit = edit.clone();
    let name = match &mut edit {
        Edit::Translate(edit) => {
            edit.by = [0.0; 3];
            &mut edit.name
        }
        Edit::Rotate(edit) => {
            (edit.axis, edit.degrees) = ([0.0; 3], 0.0);
            &mut edit.name
        }
        Edit::ScaleDirection(edit) => {
            edit.factors = [0.0; 3];
            &mut edit.name
        }
        Edit::ScaleNormals(edit) => {
            edit.distance = 0.0;
            &mut edit.name
        }
        Edit::Affine(edit) => {
            (edit.matrix, edit.translation) = ([[0.0; 3]; 3], [0.0; 3]);
            &mut edit.name
        }
        Edit::Displacement(_) | Edit::Skeleton(_) => return edit,
    };
    *name = None;
    edit
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::super::Editor;
    use super::*;
    use crate::features::FeatureSettings;
    use crate::shapes::box_of_tets;
    use crate::surface::Surface;

    thread_local! {
        /// Edits that were compared.
        pub(super) static COMPARED: Cell<usize> = const { Cell::new(0) };
    }

    fn lifts(count: usize) -> Vec<Edit> {
        let lift = |index: usize| {
            let by = [0.0, 0.0, 1e-3 * (1 + index % 7) as f64];
            serde_json::from_value(
                serde_json::json!({"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": by}}),
            )
        };
        (0..count).map(|index| lift(index).unwrap()).collect()
    }

    /// Comparisons of edits, and copies of edits that are kept.
    fn cost(count: usize) -> (usize, usize) {
        let surface = Surface::extract(
            &box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]),
            &FeatureSettings::default(),
        )
        .unwrap();
        let mut editor = Editor::new(Arc::new(surface)).unwrap();
        COMPARED.set(0);
        let mut stack = lifts(count);
        let moved = editor.displacement(&stack).unwrap();
        let layers = editor.layers(&stack).unwrap();
        assert_eq!(layers.len(), count);
        assert_eq!(editor.displacement(&stack).unwrap(), moved);
        // Other amounts of the last edit, as when somebody drags.
        for _ in 0..4 {
            stack[count - 1] = lifts(3)[2].clone();
            editor.displacement(&stack).unwrap();
        }
        let mut kept: Vec<&Arc<[Edit]>> = Vec::new();
        for layer in &editor.kept_layers().layers {
            if !kept.iter().any(|known| Arc::ptr_eq(known, &layer.stack)) {
                kept.push(&layer.stack);
            }
        }
        (COMPARED.get(), kept.iter().map(|stack| stack.len()).sum())
    }

    #[test]
    fn a_stack_costs_as_much_as_it_is_long() {
        let ((compared, kept), (compared_twice, kept_twice)) = (cost(100), cost(200));
        assert!(compared <= 10 * 100 && kept <= 2 * 100, "{compared} comparisons, {kept} copies");
        assert!(
            compared_twice <= 2 * compared && kept_twice <= 2 * kept,
            "{compared_twice}, {kept_twice}"
        );
    }

    #[test]
    fn layers_say_the_same_whether_or_not_they_were_evaluated_before() {
        let surface = Arc::new(
            Surface::extract(
                &box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]),
                &FeatureSettings::default(),
            )
            .unwrap(),
        );
        let stack = lifts(12);
        let mut fresh = Editor::new(Arc::clone(&surface)).unwrap();
        let layers = fresh.layers(&stack).unwrap();
        let mut used = Editor::new(surface).unwrap();
        let moved = used.displacement(&stack).unwrap();
        used.displacement(&stack[..5]).unwrap();
        assert_eq!(used.layers(&stack).unwrap(), layers);
        assert_eq!(used.displacement(&stack).unwrap(), moved);
        assert_eq!(fresh.displacement(&stack).unwrap(), moved);
    }
}
