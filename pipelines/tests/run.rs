//! Pipelines over a borrowed mesh: surfaces, slices, monitors, conditions, and what goes wrong.

mod common;

use std::sync::Arc;

use tombolo_deform::communicator::Solo;
use tombolo_deform::mesh::{
    ArrayView, CellType, Cells, CellsView, FeatureSource, Mesh, MeshView, Values, Vector,
};
use tombolo_deform::shapes;
use tombolo_pipelines::extract::{Channel, Extract, FieldView, Input, Kept, Snapshot, Source};
use tombolo_pipelines::language::{Command, Plane, Slice};
use tombolo_pipelines::run::{Output, Runner, ViewKind};

fn runner(pipelines: &str) -> Runner {
    common::runner(pipelines, Arc::new(Solo))
}

/// Twice the area vector of each polygon, summed up along the normal.
fn area(extract: &Extract, normal: Vector) -> f64 {
    let mut sum = 0.0;
    for (_, points) in extract.cells.iter() {
        let at = |index: usize| extract.points[points[index] as usize];
        for index in 1..points.len() - 1 {
            let (a, b, c) = (at(0), at(index), at(index + 1));
            let [u, v]: [Vector; 2] = [b, c].map(|p| std::array::from_fn(|axis| p[axis] - a[axis]));
            let cross =
                [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            let turn: f64 = (0..3).map(|axis| cross[axis] * normal[axis]).sum();
            assert!(turn > 0.0, "polygons turn counter-clockwise about the normal");
            sum += turn / 2.0;
        }
    }
    sum
}

fn cut(mesh: &Mesh, fields: &[FieldView], origin: Vector, normal: Vector) -> Arc<Extract> {
    let channel = Channel { name: "fluid", mesh: MeshView::from(mesh), fields };
    let mut source = Source::new(&channel).unwrap();
    let input = Input { channel: &channel, cycle: 0, wanted: &|_| true, communicator: &Solo };
    let slice = Slice::Plane(Plane { origin, normal });
    source.slice(&input, &slice, &mut Kept::default()).unwrap().extract
}

#[test]
fn a_slice_of_a_box_is_exact() {
    let s = 0.5f64.sqrt();
    for mesh in [
        shapes::box_of_tets([4, 5, 6], [0.0; 3], [1.0, 1.0, 1.0]),
        shapes::box_of_hexahedra([4, 5, 6], [0.0; 3], [1.0, 1.0, 1.0]),
    ] {
        for (normal, expected) in [
            ([1.0, 0.0, 0.0], 1.0),
            ([0.0, -1.0, 0.0], 1.0),
            ([s, s, 0.0], 2f64.sqrt()),
            ([1.0 / 3f64.sqrt(); 3], 3f64.sqrt() * 0.75),
        ] {
            let values: Vec<f64> =
                mesh.points().iter().map(|p| 1.0 + 2.0 * p[0] - 3.0 * p[1] + 0.5 * p[2]).collect();
            let numbers: Vec<f64> = (0..mesh.cells().len()).map(|cell| cell as f64).collect();
            let fields =
                [FieldView::vertex("linear", &values), FieldView::element("cell", &numbers)];
            let slice = cut(&mesh, &fields, [0.5; 3], normal);
            assert!(
                (area(&slice, normal) - expected).abs() < 1e-12,
                "{normal:?}: {}",
                area(&slice, normal)
            );
            for (point, value) in slice.points.iter().zip(&slice.fields[0].values) {
                let distance: f64 = (0..3).map(|axis| (point[axis] - 0.5) * normal[axis]).sum();
                assert!(distance.abs() < 1e-14, "{point:?} is not in the plane");
                let exact = 1.0 + 2.0 * point[0] - 3.0 * point[1] + 0.5 * point[2];
                assert!((value - exact).abs() < 1e-13, "a linear field is interpolated exactly");
            }
            // Each polygon carries the number of a cell that it lies in.
            for ((_, points), &number) in slice.cells.iter().zip(&slice.fields[1].values) {
                let vertices = mesh.cells().vertices(number as usize);
                for axis in 0..3 {
                    let [low, high] = [f64::min, f64::max].map(|pick| {
                        vertices
                            .iter()
                            .map(|&v| mesh.points()[v as usize][axis])
                            .reduce(pick)
                            .unwrap()
                    });
                    assert!(points.iter().all(|&p| {
                        (low - 1e-14..=high + 1e-14).contains(&slice.points[p as usize][axis])
                    }));
                }
            }
        }
    }
}

/// Any cell that the plane through its centre halves gives one closed polygon, whatever its type.
#[test]
fn a_slice_closes_in_every_cell_type() {
    for cell_type in CellType::ALL.into_iter().filter(|cell| cell.dimension() == 3) {
        let mesh = shapes::single_cell(cell_type);
        let count = mesh.points().len() as f64;
        let centre: Vector =
            std::array::from_fn(|axis| mesh.points().iter().map(|p| p[axis]).sum::<f64>() / count);
        for normal in [
            [1.0, 0.1, 0.2],
            [-0.3, 1.0, 0.05],
            [0.2, -0.1, 1.0],
            [1.0, 1.0, 1.0],
            [-1.0, 2.0, -0.7],
        ] {
            let slice = cut(&mesh, &[], centre, normal);
            assert_eq!(slice.cells.len(), 1, "{cell_type} along {normal:?}");
            assert_eq!(
                slice.cells.vertices(0).len(),
                slice.points.len(),
                "{cell_type}: each point once"
            );
            assert!(area(&slice, normal) > 0.0);
        }
    }
}

#[test]
fn a_slice_of_a_surface_is_lines() {
    let mesh = shapes::torus(2.0, 0.5, [400, 200]);
    let slice = cut(&mesh, &[], [0.0; 3], [0.0, 1.0, 0.0]);
    let length: f64 = slice
        .cells
        .iter()
        .map(|(cell_type, ends)| {
            assert_eq!(cell_type, CellType::Line);
            let [a, b] = [ends[0], ends[1]].map(|point| slice.points[point as usize]);
            (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt()
        })
        .sum();
    let circles = 2.0 * std::f64::consts::TAU * 0.5;
    assert!((length - circles).abs() < 1e-3 * circles, "{length} instead of {circles}");
    assert_eq!(slice.points.len(), slice.cells.len(), "two closed rings");
}

#[test]
fn a_slice_beside_the_mesh_is_empty() {
    let mesh = shapes::box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    assert!(cut(&mesh, &[], [5.0, 0.0, 0.0], [1.0, 0.0, 0.0]).cells.is_empty());
}

/// Arrays as a C solver has them: single precision, 64-bit connectivity, coordinates of two
/// components.
#[test]
fn a_surface_follows_borrowed_arrays() {
    let mesh = shapes::box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]);
    let coordinates: Vec<f32> = mesh.points().as_flattened().iter().map(|&x| x as f32).collect();
    let connectivity: Vec<i64> =
        mesh.cells().connectivity().iter().map(|&vertex| i64::from(vertex)).collect();
    let velocity: Vec<f32> = (0..3 * mesh.points().len()).map(|i| i as f32).collect();
    let fields =
        [FieldView::vertex("velocity", ArrayView::interleaved(Values::F32(&velocity), 3).unwrap())];
    let points = ArrayView::interleaved(Values::F32(&coordinates), 3).unwrap();
    let cells =
        CellsView::Uniform { cell_type: CellType::Tetra, connectivity: (&connectivity).into() };
    let channel = Channel { name: "fluid", mesh: MeshView::new(points, cells), fields: &fields };
    let channels = [channel];
    let mut runner = runner(
        r#"{"name": "hull", "stages": [{"surface": {}}, {"quality": {}}, {"select": {"fields": ["velocity", "scaled_jacobian"]}},
            {"stream": {"error": "lossless"}}]}"#,
    );
    assert_eq!(runner.views()[0].kind, ViewKind::Surface);
    let first = frame(runner.run(&Snapshot { cycle: 0, time: 0.0, channels: &channels }));
    assert_eq!(first.points.len(), 56);
    assert_eq!(first.cells.len(), 6 * 18);
    let vertices = first.vertices.as_ref().unwrap();
    for (point, &vertex) in vertices.iter().enumerate() {
        assert_eq!(first.fields[0].values[3 * point], f64::from(3 * vertex));
    }
    assert_eq!(first.fields[1].name, "scaled_jacobian");
    assert!(first.fields[1].values.iter().all(|&value| value > 0.3));

    // The mesh moves: the same topology, by address, at other coordinates.
    let moved: Vec<f32> = coordinates.iter().map(|x| x + 1.0).collect();
    let points = ArrayView::interleaved(Values::F32(&moved), 3).unwrap();
    let channels = [Channel { mesh: MeshView { points, ..channel.mesh }, ..channel }];
    let second = frame(runner.run(&Snapshot { cycle: 1, time: 0.1, channels: &channels }));
    assert!(Arc::ptr_eq(&first.cells, &second.cells));
    assert_eq!(second.points[0][0], first.points[0][0] + 1.0);

    // The solver says that its cells have changed.
    let channels = [Channel { mesh: MeshView { generation: 1, ..channel.mesh }, ..channel }];
    let third = frame(runner.run(&Snapshot { cycle: 2, time: 0.2, channels: &channels }));
    assert!(!Arc::ptr_eq(&first.cells, &third.cells));
}

fn frame(outputs: Vec<Output>) -> Arc<Extract> {
    let mut frames = outputs.into_iter().filter_map(|output| match output {
        Output::Frame(frame) => Some(frame.extract),
        Output::Error { message, .. } => panic!("{message}"),
        _ => None,
    });
    frames.next().unwrap()
}

fn errors(outputs: &[Output]) -> Vec<&str> {
    outputs
        .iter()
        .filter_map(|output| match output {
            Output::Error { message, .. } => Some(message.as_str()),
            _ => None,
        })
        .collect()
}

#[test]
fn monitors_conditions_and_orders() {
    let mesh = shapes::box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    let mut runner = runner(
        r#"{"name": "health", "every": {"steps": 2}, "stages": [{"quality": {}}, {"statistics": {"field": "speed"}}],
            "when": "speed.max > 3 && quality.inverted == 0 && cycle >= 4", "then": [{"pause": {}}, {"write": {"file": "alert-{cycle}.vtu"}}]},
           {"name": "pinch", "at": {"cycle": 3}, "stages": [
              {"translate": {"features": ["x-min"], "by": [0.1, 0, 0]}}, {"order": {"schedule": {"steps": 4}}}]}"#,
    );
    let mut seen = Vec::new();
    for cycle in 0..7u64 {
        let speed: Vec<f64> = (0..27).map(|vertex| f64::from(vertex % 2) * cycle as f64).collect();
        let fields = [FieldView::vertex("speed", &speed)];
        let channels = [Channel { name: "fluid", mesh: MeshView::from(&mesh), fields: &fields }];
        let time = cycle as f64 * 0.1;
        assert_eq!(runner.is_due(cycle, time), cycle % 2 == 0 || cycle == 3);
        let outputs = runner.run(&Snapshot { cycle, time, channels: &channels });
        for output in outputs {
            seen.push(match output {
                Output::Monitor(monitor) => {
                    let value =
                        |name: &str| monitor.values.iter().find(|value| value.0 == name).unwrap().1;
                    assert_eq!(value("speed.max"), cycle as f64);
                    assert!((value("speed.mean") - cycle as f64 * 13.0 / 27.0).abs() < 1e-14);
                    assert!(
                        (value("speed.l2") - cycle as f64 * (13f64 / 27.0).sqrt()).abs() < 1e-14
                    );
                    assert_eq!((value("speed.min"), value("speed.non_finite")), (0.0, 0.0));
                    assert!(
                        value("quality.min") > 0.3
                            && value("quality.mean") <= value("quality.max") + 1e-12
                    );
                    format!("{cycle} monitor")
                }
                Output::Command { pipeline, command: Command::Pause {} } => {
                    assert_eq!(&*pipeline, "health");
                    format!("{cycle} pause")
                }
                Output::Write { path, extract, .. } => {
                    assert_eq!(extract.cells.len(), mesh.cells().len(), "the whole mesh");
                    format!("{cycle} {path}")
                }
                Output::Command { command: Command::Order(order), .. } => {
                    format!("{cycle} order {}", serde_json::to_string(&order).unwrap())
                }
                other => panic!("{other:?}"),
            });
        }
    }
    let order = r#"3 order {"edits":[{"translate":{"features":["x-min"],"fixed":[],"by":[0.1,0.0,0.0],"harmonic_order":2}}],"schedule":{"steps":4,"every":{"steps":1},"ease":"linear","motion":"spread"}}"#;
    assert_eq!(
        seen,
        [
            "0 monitor",
            "2 monitor",
            order,
            "4 monitor",
            "4 pause",
            "4 alert-000004.vtu",
            "6 monitor",
            "6 pause",
            "6 alert-000006.vtu"
        ]
    );
}

#[test]
fn trouble_is_told_once_by_name_and_stops_nothing() {
    let mesh = shapes::box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    let mut pipelines = runner(
        r#"{"name": "hull", "stages": [{"surface": {}}, {"statistics": {"field": "pressure"}}, {"stream": {}}]},
           {"name": "lost", "channel": "fluids", "stages": [{"quality": {}}]},
           {"name": "typo", "stages": [{"surface": {}}, {"select": {"fields": ["presure"]}}, {"stream": {}}]}"#,
    );
    let mut pressure = vec![1.0; 27];
    let velocity = vec![[1.0; 3]; 27];
    let run = |pressure: &[f64], pipelines: &mut Runner, cycle| {
        let fields =
            [FieldView::vertex("pressure", pressure), FieldView::vertex("velocity", &velocity)];
        let channels = [Channel { name: "fluid", mesh: MeshView::from(&mesh), fields: &fields }];
        pipelines.run(&Snapshot { cycle, time: 0.0, channels: &channels })
    };
    let first = run(&pressure, &mut pipelines, 0);
    let told = errors(&first).join("\n");
    assert!(
        told.contains("no channel `fluids`; its channels are fluid; did you mean `fluid`?"),
        "{told}"
    );
    assert!(
        told.contains(
            "no field `presure`; its fields are pressure, velocity; did you mean `pressure`?"
        ),
        "{told}"
    );
    assert_eq!(errors(&run(&pressure, &mut pipelines, 1)), [""; 0], "told once");

    pressure[4] = f64::NAN;
    let broken = run(&pressure, &mut pipelines, 2);
    let told = errors(&broken);
    assert_eq!(
        told,
        [
            "cycle 2: field `pressure` is NaN at vertex 4; it is left out of the extract",
            "cycle 2: field `pressure` is not finite in 1 places, first NaN at vertex 4"
        ]
    );
    let frames: Vec<_> = broken
        .iter()
        .filter_map(|output| match output {
            Output::Frame(frame) => Some(
                frame.extract.fields.iter().map(|field| field.name.as_str()).collect::<Vec<_>>(),
            ),
            _ => None,
        })
        .collect();
    assert_eq!(frames, [vec!["velocity"], vec![]], "what is sound is still sent");
    assert_eq!(errors(&run(&pressure, &mut pipelines, 3)), [""; 0]);
    pressure[4] = 1.0;
    assert_eq!(errors(&run(&pressure, &mut pipelines, 4)), [""; 0]);
    pressure[4] = f64::NEG_INFINITY;
    assert_eq!(errors(&run(&pressure, &mut pipelines, 5)).len(), 2, "it has come back");

    let short = vec![1.0; 26];
    let told = run(&short, &mut pipelines, 6);
    assert!(
        errors(&told).iter().any(|message| message.contains("26 tuples, the mesh has 27")),
        "{told:?}"
    );
}

#[test]
fn a_broken_mesh_is_an_error() {
    let mesh = shapes::box_of_tets([1, 1, 1], [0.0; 3], [1.0; 3]);
    let connectivity = [0i32, 1, 2, 99];
    let cells =
        CellsView::Uniform { cell_type: CellType::Tetra, connectivity: connectivity[..].into() };
    let channels = [Channel {
        name: "fluid",
        mesh: MeshView::new(ArrayView::vectors(mesh.points()), cells),
        fields: &[],
    }];
    let mut pipelines = runner(r#"{"name": "a", "stages": [{"surface": {}}, {"stream": {}}]}"#);
    let outputs = pipelines.run(&Snapshot { cycle: 0, time: 0.0, channels: &channels });
    assert!(errors(&outputs)[0].contains("vertex 99 does not exist"), "{outputs:?}");
    let outputs = pipelines.run(&Snapshot { cycle: 1, time: 0.0, channels: &[] });
    assert!(errors(&outputs).is_empty(), "the pipeline is still without its channel");

    let mut points = mesh.points().to_vec();
    points[3][2] = f64::NAN;
    let moved = MeshView { points: ArrayView::vectors(&points), ..MeshView::from(&mesh) };
    let channels = [Channel { name: "fluid", mesh: moved, fields: &[] }];
    let mut pipelines = runner(
        r#"{"name": "a", "stages": [{"slice": {"origin": [0.5,0,0], "normal": [1,0,0]}}, {"stream": {}}]}"#,
    );
    let outputs = pipelines.run(&Snapshot { cycle: 9, time: 0.0, channels: &channels });
    assert_eq!(errors(&outputs), ["cycle 9: a coordinate of vertex 3 is NaN"]);
}

#[derive(serde::Deserialize)]
struct Table {
    mesh: TableMesh,
    slices: Vec<TableSlice>,
}

#[derive(serde::Deserialize)]
struct TableMesh {
    points: Vec<Vector>,
    cells: Vec<[u32; 4]>,
}

#[derive(serde::Deserialize)]
struct TableSlice {
    origin: Vector,
    normal: Vector,
    area: f64,
    element_integral: f64,
    /// Coordinates and vertex field.
    points: Vec<[f64; 4]>,
}

/// The table that tests/vtk/slice.py writes: vtkCutter on a box of irregular tetrahedra.
#[test]
fn slices_are_those_of_vtk() {
    let table: Table = serde_json::from_str(include_str!("slice.json")).unwrap();
    let cells = Cells::uniform(CellType::Tetra, table.mesh.cells.as_flattened().to_vec()).unwrap();
    let numbers: Vec<f64> = (0..cells.len()).map(|cell| (cell % 17) as f64).collect();
    let mesh = Mesh::new(table.mesh.points, cells, FeatureSource::SharpEdges).unwrap();
    let values: Vec<f64> = mesh.points().iter().map(|[x, y, z]| x * y + z * z - 0.5 * x).collect();
    let fields = [FieldView::vertex("vertex", &values), FieldView::element("element", &numbers)];
    for theirs in table.slices {
        let ours = cut(&mesh, &fields, theirs.origin, theirs.normal);
        let length = theirs.normal.iter().map(|x| x * x).sum::<f64>().sqrt();
        let normal = theirs.normal.map(|x| x / length);
        let area = |extract: &Extract| area(extract, normal);
        assert!((area(&ours) - theirs.area).abs() < 1e-12, "{} and {}", area(&ours), theirs.area);
        let integral: f64 = (0..ours.cells.len())
            .map(|cell| {
                let mut one = Cells::new();
                one.push(ours.cells.cell_type(cell), ours.cells.vertices(cell)).unwrap();
                area(&Extract { cells: one.into(), ..Extract::clone(&ours) })
                    * ours.fields[1].values[cell]
            })
            .sum();
        assert!(
            (integral - theirs.element_integral).abs() < 1e-11,
            "{integral} and {}",
            theirs.element_integral
        );
        assert_eq!(ours.points.len(), theirs.points.len());
        for point in &theirs.points {
            let same =
                |other: &Vector| (0..3).all(|axis| (other[axis] - point[axis]).abs() < 1e-12);
            let index =
                ours.points.iter().position(same).unwrap_or_else(|| panic!("{point:?} is missing"));
            assert!((ours.fields[0].values[index] - point[3]).abs() < 1e-12);
        }
    }
}
