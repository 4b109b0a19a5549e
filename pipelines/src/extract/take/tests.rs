//! Coordinates that a stage which keeps nothing looks at.

use tombolo_deform::communicator::Solo;
use tombolo_deform::mesh::{ArrayView, MeshView, Values};
use tombolo_deform::shapes::box_of_tets;

use super::*;
use crate::extract::{Channel, Extract};

fn contour(input: &Input, source: &mut Source) -> Result<Arc<Extract>, ExtractError> {
    let stage = Contour { field: "x".into(), values: vec![0.4] };
    source.contour(input, &stage).map(|extracted| extracted.extract)
}

fn threshold(input: &Input, source: &mut Source) -> Result<Arc<Extract>, ExtractError> {
    let stage =
        Threshold { field: "x".into(), min: Some(0.2), max: Some(0.8), vertices: Quantifier::All };
    source.threshold(input, &stage).map(|extracted| extracted.extract)
}

type Take = fn(&Input, &mut Source) -> Result<Arc<Extract>, ExtractError>;

#[test]
fn a_vertex_whose_coordinates_are_not_finite_is_named_where_it_is_come_by() {
    let mesh = box_of_tets([4; 3], [0.0; 3], [1.0; 3]);
    let x: Vec<f64> = mesh.points().iter().map(|point| point[0]).collect();
    let fields = [FieldView::vertex("x", &x)];
    let at = |place: Vector| mesh.points().iter().position(|point| *point == place).unwrap();
    let near = at([0.5, 0.25, 0.75]);
    let far = at([1.0, 0.25, 0.75]);
    let stages: [(Take, &str); 2] = [(contour, "contour"), (threshold, "threshold")];
    for (take, name) in stages {
        let taken = |points: ArrayView| {
            let view = MeshView { points, ..MeshView::from(&mesh) };
            let channel = Channel::new("fluid", view, &fields);
            let wanted = |_: &str| true;
            let input = Input { channel: &channel, cycle: 3, wanted: &wanted, communicator: &Solo };
            take(&input, &mut Source::new(&channel).unwrap())
        };
        let expected = taken(ArrayView::vectors(mesh.points())).unwrap();
        assert!(!expected.cells.is_empty(), "{name}");
        // In single precision, and axis by axis.
        let single: Vec<f32> = mesh.points().as_flattened().iter().map(|&x| x as f32).collect();
        let found = taken(ArrayView::interleaved(Values::F32(&single), 3).unwrap()).unwrap();
        assert_eq!(found, expected, "{name}");
        let planes: Vec<f64> =
            (0..3).flat_map(|axis| mesh.points().iter().map(move |point| point[axis])).collect();
        let count = mesh.points().len();
        let planes: Vec<&[f64]> = planes.chunks(count).collect();
        let columns = [0, 1, 2].map(|axis| (Values::F64(planes[axis]), 0, 1));
        let strided = ArrayView::strided(count, &columns);
        assert_eq!(taken(strided.unwrap()).unwrap(), expected, "{name}");
        for (vertex, value) in [(near, f64::NAN), (near, f64::INFINITY), (far, f64::NAN)] {
            let mut points = mesh.points().to_vec();
            points[vertex][1] = value;
            let found = taken(ArrayView::vectors(&points));
            if vertex == far {
                assert_eq!(found.unwrap(), expected, "{name}");
                let single: Vec<f32> = points.as_flattened().iter().map(|&x| x as f32).collect();
                let found = taken(ArrayView::interleaved(Values::F32(&single), 3).unwrap());
                assert_eq!(found.unwrap(), expected, "{name}");
                continue;
            }
            let error = found.unwrap_err();
            let is_named = matches!(
                error,
                ExtractError::PointNotFinite { vertex, cycle: 3, .. } if vertex == near
            );
            assert!(is_named, "{name}: {error}");
        }
    }
}
