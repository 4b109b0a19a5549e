//! Random meshes and edits with absurd values: an answer or an error, never a panic, and never a
//! number that is not finite.

use super::*;
use proptest::prelude::*;
use tombolo_deform::edit::{
    Affine, BoxRegion, Displacement, HalfSpaceRegion, Region, Rotate, SphereRegion,
};
use tombolo_deform::shapes;

/// What all edits have.
struct Layer {
    features: Vec<String>,
    region: Option<Region>,
    fixed: Vec<String>,
    fixed_region: Option<Region>,
    muted: bool,
}

/// The edit of a kind on this layer, with the fields of that kind.
macro_rules! layered {
    ($layer:expr, $kind:ident, $($field:ident: $value:expr),+) => {{
        let Layer { features, region, fixed, fixed_region, muted } = $layer;
        let name = None;
        Edit::$kind($kind {
            features, region, fixed, fixed_region, muted, name, $($field: $value),+
        })
    }};
}

fn absurd() -> BoxedStrategy<f64> {
    prop_oneof![
        4 => -2.0..2.0f64,
        1 => any::<f64>(),
        1 => prop_oneof![
            Just(0.0),
            Just(-0.0),
            Just(f64::NAN),
            Just(f64::INFINITY),
            Just(f64::NEG_INFINITY),
            Just(f64::MAX),
            Just(f64::MIN_POSITIVE),
            Just(5e-324),
            Just(1e150),
        ],
    ]
    .boxed()
}

fn feature() -> impl Strategy<Value = String> {
    prop_oneof![
        8 => (0..6usize).prop_map(|which| shapes::BOX_FEATURES[which].to_string()),
        4 => (0..4usize).prop_map(|which| format!("feature-{which}")),
        1 => ".*",
    ]
}

fn region() -> BoxedStrategy<Region> {
    let vector = || [absurd(), absurd(), absurd()];
    prop_oneof![
        3 => (vector(), vector()).prop_map(|(lower, upper)| Region::Box(BoxRegion { lower, upper })),
        3 => (vector(), absurd()).prop_map(|(center, radius)| Region::Sphere(SphereRegion { center, radius })),
        3 => (vector(), vector()).prop_map(|(origin, normal)| Region::HalfSpace(HalfSpaceRegion { origin, normal })),
        2 => proptest::collection::vec(0..60u32, 0..4).prop_map(Region::Faces),
    ]
    .boxed()
}

/// Any edit but a skeleton, whose cost is that of a skeleton.
fn edit() -> impl Strategy<Value = Edit> {
    let features = || proptest::collection::vec(feature(), 0..3);
    let order = (0..3usize).prop_map(|which| ORDERS[which]);
    let vector = || [absurd(), absurd(), absurd()];
    let regions =
        (proptest::option::weighted(0.2, region()), proptest::option::weighted(0.1, region()));
    let import = proptest::collection::vec((0..100u32, vector()), 0..4);
    let numbers =
        (vector(), [vector(), vector(), vector()], absurd(), proptest::option::of(vector()));
    (features(), features(), regions, order, numbers, import, proptest::bool::weighted(0.2), 0..6)
        .prop_map(
            |(
                features,
                fixed,
                (region, fixed_region),
                harmonic_order,
                numbers,
                import,
                muted,
                kind,
            )| {
                let (vector, matrix, number, center) = numbers;
                let layer = Layer { features, region, fixed, fixed_region, muted };
                match kind {
                    0 => layered!(layer, Translate, by: vector, harmonic_order: harmonic_order),
                    1 => {
                        layered!(layer, ScaleNormals, distance: number, harmonic_order: harmonic_order)
                    }
                    2 => layered!(
                        layer, ScaleDirection,
                        factors: vector, center: center, harmonic_order: harmonic_order
                    ),
                    3 => layered!(
                        layer, Rotate,
                        axis: vector, degrees: number, center: center, harmonic_order: harmonic_order
                    ),
                    4 => layered!(
                        layer, Affine,
                        matrix: matrix, translation: vector, center: center,
                        harmonic_order: harmonic_order
                    ),
                    _ => {
                        let (vertices, values): (Vec<u32>, Vec<Vector>) =
                            import.into_iter().unzip();
                        layered!(
                            layer, Displacement,
                            file: None, vertices: vertices.into(), values: values.into(),
                            scale: number
                        )
                    }
                }
            },
        )
}

/// A layer that moves a box of [4, 2, 2] cells and 2 by 1 by 1 in size.
fn layer() -> BoxedStrategy<Edit> {
    let vector = || [-1.0..1.0f64, -1.0..1.0, -1.0..1.0];
    let plane = proptest::option::weighted(0.3, 0.1..1.9f64);
    (
        0..6usize,
        0..6usize,
        0..3usize,
        0..5,
        (vector(), -180.0..180.0f64),
        plane,
        proptest::bool::weighted(0.2),
    )
        .prop_filter("a handle that is not fixed", |(handle, fixed, ..)| handle != fixed)
        .prop_map(|(handle, fixed, order, kind, (vector, number), plane, muted)| {
            let features = names(&[shapes::BOX_FEATURES[handle]]);
            let fixed = names(&[shapes::BOX_FEATURES[fixed]]);
            let fixed_region = plane.map(|x| {
                Region::HalfSpace(HalfSpaceRegion {
                    origin: [x, 0.0, 0.0],
                    normal: [1.0, 0.0, 0.0],
                })
            });
            let harmonic_order = ORDERS[order];
            let layer = Layer { features, region: None, fixed, fixed_region, muted };
            match kind {
                0 => layered!(layer, Translate, by: vector, harmonic_order: harmonic_order),
                1 => layered!(
                    layer, Rotate,
                    axis: [vector[0], vector[1], 1.0], degrees: number, center: None,
                    harmonic_order: harmonic_order
                ),
                2 => layered!(
                    layer, ScaleDirection,
                    factors: vector, center: None, harmonic_order: harmonic_order
                ),
                3 => layered!(
                    layer, ScaleNormals,
                    distance: number / 500.0, harmonic_order: harmonic_order
                ),
                _ => layered!(
                    layer, Affine,
                    matrix: [[1.0, 0.0, vector[0]], [0.0, 1.0, vector[1]], [vector[2], 0.0, 1.0]],
                    translation: vector, center: None, harmonic_order: harmonic_order
                ),
            }
        })
        .boxed()
}

fn set_muted(edit: &mut Edit, muted: bool) {
    match edit {
        Edit::Translate(edit) => edit.muted = muted,
        Edit::Rotate(edit) => edit.muted = muted,
        Edit::ScaleDirection(edit) => edit.muted = muted,
        Edit::ScaleNormals(edit) => edit.muted = muted,
        Edit::Affine(edit) => edit.muted = muted,
        Edit::Displacement(edit) => edit.muted = muted,
        Edit::Skeleton(edit) => edit.muted = muted,
    }
}

fn random_mesh() -> impl Strategy<Value = Mesh> {
    let counts = [1..5usize, 1..5, 1..5];
    let size = prop_oneof![Just(0.0), Just(1e-300), Just(1e-9), Just(1.0), Just(1e12), Just(1e300)];
    (0..4, counts, size.clone(), size.clone(), size).prop_map(|(kind, [i, j, k], x, y, z)| {
        match kind {
            0 => shapes::box_of_tets([i, j, k], [0.0; 3], [x, y, z]),
            1 => shapes::box_of_hexahedra([i, j, k], [-x, y, 0.0], [x, 2.0 * y, z]),
            2 => shapes::torus(x, y, [3 * i, 3 * j]),
            _ => tagged(&shapes::plate([i, j], [0.0, 0.0], [x, y]), |point| {
                (point[0] / x.max(1e-300) * 4.0) as i64
            }),
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_stack_on_any_mesh_is_answered(mesh in random_mesh(), stack in proptest::collection::vec(edit(), 0..4)) {
        let surface = Arc::new(extract(&mesh));
        let mut editor = Editor::new(Arc::clone(&surface)).expect("a manifold");
        match editor.displacement(&stack) {
            Ok(displacement) => {
                prop_assert!(moved(&surface, &displacement).iter().flatten().all(|value| value.is_finite()));
                prop_assert_eq!(&editor.displacement(&stack).unwrap(), &displacement, "again");
                prop_assert_eq!(
                    &Editor::new(Arc::clone(&surface)).unwrap().displacement(&stack).unwrap(), &displacement, "anew"
                );
                for edit in &stack {
                    let finite = serde_json::from_str::<Edit>(&serde_json::to_string(edit).unwrap()).unwrap();
                    prop_assert_eq!(&finite, edit);
                }
            }
            Err(error) => prop_assert!(error.to_string().starts_with("edit ")),
        }
        prop_assert!(editor.displacement(&[]).unwrap().iter().flatten().all(|value| value.to_bits() == 0));
    }

    /// Layers are muted, reordered, removed and put back on one editor: what comes out is what a
    /// new editor makes of the stack.
    #[test]
    fn the_result_depends_on_the_stack_alone(
        layers in proptest::collection::vec(layer(), 1..5),
        turns in proptest::collection::vec((0..4usize, 0..4usize, any::<bool>()), 1..6),
    ) {
        let mesh = shapes::box_of_tets([4, 2, 2], [0.0; 3], [2.0, 1.0, 1.0]);
        let surface = Arc::new(extract(&mesh));
        let fresh = |stack: &[Edit]| Editor::new(Arc::clone(&surface)).unwrap().displacement(stack);
        let mut editor = Editor::new(Arc::clone(&surface)).unwrap();
        let mut stack = layers.clone();
        for (from, to, mute) in turns {
            let (from, to) = (from % stack.len(), to % stack.len());
            let mut layer = stack.remove(from);
            if mute {
                let muted = layer.muted();
                set_muted(&mut layer, !muted);
            }
            stack.insert(to, layer);
            let displacement = editor.displacement(&stack);
            prop_assert_eq!(&displacement, &fresh(&stack));
            let heard: Vec<Edit> = stack.iter().filter(|layer| !layer.muted()).cloned().collect();
            // A muted layer is still checked, so that it may be what is refused.
            if displacement.is_ok() {
                prop_assert_eq!(&displacement, &fresh(&heard));
            }
        }
        let zeros = editor.displacement(&[]).unwrap();
        prop_assert!(zeros.iter().flatten().all(|value| value.to_bits() == 0));
        prop_assert_eq!(editor.displacement(&layers), fresh(&layers));
    }

    #[test]
    fn prescribed_vertices_move_exactly(
        counts in [1..5usize, 1..5, 1..5],
        by in [-1e3..1e3f64, -1e3..1e3f64, -1e3..1e3f64],
        handle in 0..6usize,
        fixed in 0..6usize,
        order in 0..3usize,
    ) {
        prop_assume!(handle != fixed);
        let mesh = shapes::box_of_tets(counts, [0.0; 3], [1.0, 2.0, 3.0]);
        let mut editor = editor(&mesh);
        let [handle, fixed] = [handle, fixed].map(|side| shapes::BOX_FEATURES[side]);
        let displacement = editor.displacement(&[translate(&[handle], &[fixed], by, ORDERS[order])]);
        let features = editor.surface().features();
        let held = features.vertices(features.index(fixed).unwrap());
        let displacement = displacement.unwrap();
        for &vertex in features.vertices(features.index(handle).unwrap()) {
            let expected = if held.contains(&vertex) { [0.0; 3] } else { by };
            prop_assert_eq!(displacement[vertex as usize], expected);
        }
        for &vertex in held {
            prop_assert_eq!(displacement[vertex as usize], [0.0; 3]);
        }
    }
}
