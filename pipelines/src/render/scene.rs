//! What is drawn: faces, lines and points on a lattice, with their values.

use tombolo_deform::bounds::Bounds;
use tombolo_deform::communicator::Communicator;
use tombolo_deform::mesh::CellType;

use super::lattice::{Lattice, rounded};
use crate::extract::{Association, Field, Shown, is_absent};
use crate::language::Component;

/// The value of what has none.
pub(super) const MISSING: f64 = f64::NAN;

/// The part of a scene that one rank draws.
pub(super) struct Scene {
    /// The points, in steps of the lattice.
    pub(super) points: Vec<[i64; 3]>,
    /// The corners of all faces, and where those of each begin.
    pub(super) corners: Vec<u32>,
    pub(super) offsets: Vec<usize>,
    pub(super) lines: Vec<[u32; 2]>,
    pub(super) dots: Vec<u32>,
    /// The value at each point, where the field has one for each.
    pub(super) of_points: Option<Vec<f64>>,
    /// The value of each face, each line and each dot, where it has one for each cell.
    pub(super) of_faces: Vec<f64>,
    pub(super) of_lines: Vec<f64>,
    pub(super) of_dots: Vec<f64>,
}

impl Scene {
    /// The corners of a face.
    pub(super) fn face(&self, face: usize) -> &[u32] {
        &self.corners[self.offsets[face]..self.offsets[face + 1]]
    }

    pub(super) fn faces(&self) -> usize {
        self.offsets.len() - 1
    }

    /// The points and cells of an extract, with values that lie between 0 and 1.
    ///
    /// The corners of a face begin with the one that comes first in space, so that a face is drawn
    /// alike whoever numbers it.
    pub(super) fn new(shown: &Shown, lattice: &Lattice, values: Option<&Values>) -> Self {
        let extract = &shown.extract;
        let points: Vec<[i64; 3]> =
            extract.points.iter().map(|&point| lattice.point(point)).collect();
        let of_cells = values.filter(|it| it.association == Association::Element);
        let of_cell = |cell: usize| of_cells.map_or(MISSING, |it| it.values[cell]);
        let mut scene = Self {
            points,
            corners: Vec::new(),
            offsets: vec![0],
            lines: Vec::new(),
            dots: Vec::new(),
            of_points: values
                .filter(|it| it.association == Association::Vertex)
                .map(|it| it.values.clone()),
            of_faces: Vec::new(),
            of_lines: Vec::new(),
            of_dots: Vec::new(),
        };
        for (cell, (cell_type, vertices)) in extract.cells.iter().enumerate() {
            let value = of_cell(cell);
            match cell_type {
                CellType::Vertex | CellType::PolyVertex => {
                    scene.dots.extend(vertices);
                    scene.of_dots.extend(vertices.iter().map(|_| value));
                }
                CellType::Line | CellType::PolyLine => {
                    for ends in vertices.windows(2) {
                        scene.lines.push([ends[0], ends[1]]);
                        scene.of_lines.push(value);
                    }
                }
                // Those of volumes are not shown: their faces are.
                _ => extract.cells.for_each_polygon(cell, |polygon| {
                    scene.push(polygon.iter().copied(), value);
                }),
            }
        }
        scene
    }

    fn push(&mut self, corners: impl IntoIterator<Item = u32>, value: f64) {
        let start = self.corners.len();
        self.corners.extend(corners);
        let points = &self.points;
        let face = &mut self.corners[start..];
        let by_place = |&corner: &usize| points[face[corner] as usize];
        let first = (0..face.len()).min_by_key(by_place).unwrap_or(0);
        face.rotate_left(first);
        self.offsets.push(self.corners.len());
        self.of_faces.push(value);
    }
}

/// The box around what all ranks show; `None` where there is nothing. Collective.
pub(super) fn bounds(communicator: &dyn Communicator, shown: &Shown) -> Option<Bounds> {
    let own = Bounds::around(shown.extract.points.iter().copied());
    let all = own.of_ranks(communicator);
    all.corners().as_flattened().iter().all(|x| x.is_finite()).then_some(all)
}

/// The values that colour, one for each point or cell.
pub(super) struct Values {
    pub(super) association: Association,
    pub(super) values: Vec<f64>,
}

impl Values {
    /// A component of a field; NaN where it has no value.
    ///
    /// # Errors
    /// A text where the field has no such component, or no values to colour by.
    pub(super) fn new(field: &Field, component: Component) -> Result<Self, String> {
        let components = field.components;
        let value = |tuple: &[f64]| match (tuple, component) {
            _ if tuple.iter().any(|&value| is_absent(value)) => MISSING,
            ([value], Component::Magnitude) => *value,
            // Not by `hypot`, which is not the same everywhere.
            (tuple, Component::Magnitude) => tuple.iter().map(|x| x * x).sum::<f64>().sqrt(),
            (tuple, Component::Number(number)) => tuple[number],
        };
        match component {
            _ if field.association == Association::Mesh => {
                let name = &field.name;
                Err(format!("field `{name}` has values for the mesh as a whole, not to colour by"))
            }
            Component::Number(number) if number >= components => Err(format!(
                "field `{}` has {components} components, found number {number} from 0",
                field.name
            )),
            _ => {
                let values = field.values.chunks(components.max(1)).map(value).collect();
                Ok(Self { association: field.association, values })
            }
        }
    }

    /// The least and the largest value of all ranks; `None` where there is none. Collective.
    pub(super) fn range(
        communicator: &dyn Communicator,
        values: Option<&Self>,
    ) -> Option<[f64; 2]> {
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        for &value in values.iter().flat_map(|it| &it.values).filter(|value| value.is_finite()) {
            range = [range[0].min(value), range[1].max(value)];
        }
        communicator.join_ranges(std::slice::from_mut(&mut range));
        let [least, largest] = range;
        (least.is_finite() && largest.is_finite()).then_some([least, largest])
    }

    /// The values as parts of a range: 0 at its lower end, 1 at its upper end.
    pub(super) fn within(mut self, [least, largest]: [f64; 2]) -> Self {
        const STEP: f64 = 1.0 / (1 << 24) as f64;
        let width = largest - least;
        for value in &mut self.values {
            let part = if width > 0.0 { (*value - least) / width } else { *value * 0.0 + 0.5 };
            *value = rounded(part, STEP);
        }
        self
    }
}
