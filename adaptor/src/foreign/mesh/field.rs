//! Fields, and arrays of components as the adaptor is lent them.

use tombolo_deform::mesh::{ArrayView, Values};
use tombolo_pipelines::extract::{Association, GHOST_FIELD};

use crate::foreign::array::{Array, NumberType};

/// Most components that a tuple can have.
pub const COMPONENTS: usize = 9;

/// Values at the vertices of a mesh, in its cells, or of the mesh as a whole.
#[derive(Debug, Clone)]
pub struct Field<'call> {
    /// Its name.
    pub name: String,
    /// Whether it has values at vertices, in cells, or of the mesh.
    pub association: Association,
    /// Its components, of one length.
    pub components: Vec<Array<'call>>,
    /// The type of number in files.
    pub number: NumberType,
}

/// The type of all components; double precision where they differ.
fn number(components: &[Array<'_>]) -> NumberType {
    let first = components.first().map_or(NumberType::F64, Array::number);
    if components.iter().all(|array| array.number() == first) { first } else { NumberType::F64 }
}

/// Components as they lie in the solver's memory, where each can be lent.
pub(super) fn lent<'call>(components: &[Array<'call>]) -> Option<ArrayView<'call>> {
    // Vectors as most solvers have them: looked at as one list, they are read several times as fast.
    if let Some((values, ..)) = Array::interleaved(components).and_then(|all| all.values()) {
        return ArrayView::interleaved(values, components.len()).ok();
    }
    let mut columns: [(Values<'call>, usize, isize); COMPONENTS] =
        [(Values::U8(&[]), 0, 1); COMPONENTS];
    for (column, array) in columns.iter_mut().zip(components) {
        *column = array.values()?;
    }
    ArrayView::strided(components.first()?.len(), columns.get(..components.len())?).ok()
}

impl<'call> Field<'call> {
    /// A field of these components.
    #[must_use]
    pub fn new(name: String, association: Association, components: Vec<Array<'call>>) -> Self {
        Self { name, association, number: number(&components), components }
    }

    /// The field by VTK's name for what says which cells or vertices are ghosts, and of VTK's type.
    #[must_use]
    pub fn of_ghosts(self) -> Self {
        Self { name: GHOST_FIELD.to_owned(), number: NumberType::U8, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tuples_without_a_gap_are_lent_as_one_list() {
        let numbers: Vec<f64> = (0..12).map(f64::from).collect();
        let component = |first: usize, count: usize, stride: usize| {
            let stride = stride * size_of::<f64>();
            let address = numbers[first..].as_ptr().cast();
            // SAFETY: the numbers live to the end of the test, and so many follow the first of these.
            unsafe { Array::new(address, count, stride, NumberType::F64, false) }
        };
        let tuples = [0, 1, 2].map(|first| component(first, 4, 3));
        let seen = lent(&tuples).expect("numbers that can be lent");
        assert_eq!((seen.len(), seen.components()), (4, 3));
        assert_eq!(seen.contiguous(), Some(numbers.as_slice()));
        for others in [
            [1, 0, 2].map(|first| component(first, 4, 3)),
            [0, 1, 2].map(|first| component(first, 3, 4)),
            [0, 4, 8].map(|first| component(first, 4, 1)),
        ] {
            let seen = lent(&others).expect("numbers that can be lent");
            assert_eq!(seen.contiguous(), None);
            for (component, array) in others.iter().enumerate() {
                assert_eq!(seen.len(), array.len());
                assert!(
                    (0..seen.len()).all(|tuple| seen.get(tuple, component) == array.get(tuple))
                );
            }
        }
    }
}
