//! What `catalyst_results` hands back, as meshes of the Blueprint in the two layouts that solvers
//! read.
//!
//! `catalyst/<channel>` is there in the calls after which the mesh moves, and only then: points at
//! the new `coordinates`, with the fields `displacement` and `velocity`; the boundary's vertices
//! once more as a topology `surface`, with their numbers, for solvers that move their volume by
//! themselves. `catalyst/steering` is always there: one point with a field for each parameter, and
//! `stop`, `moving`, `shape`, `shapes`.

use tombolo::MeshMotion;
use tombolo::foreign::Asked;

use crate::node::NodeMut;

/// The name of the mesh of parameters; no channel may bear it.
pub(crate) const STEERING: &str = "steering";
/// Fields that every solver finds beside its parameters, which may not bear these names.
pub(crate) const RESERVED: [&str; 4] = ["stop", "moving", "shape", "shapes"];

/// A topology and its coordset.
type Names = (&'static str, &'static str);
/// The names of the topology and the coordset of all vertices.
const MESH: Names = ("mesh", "coords");
/// The names of the boundary's topology and coordset.
const SURFACE: Names = ("surface", "surface");

/// Fills in what was asked. `blocks` are the names of the steered channel's meshes and how many
/// vertices each has; none of a rank without data, which is answered with a mesh of no points, or
/// without any mesh where its channel is said to have several (`has_blocks`).
pub(crate) fn fill(
    node: &mut NodeMut<'_>,
    asked: &Asked,
    channel: &str,
    blocks: &[(String, usize)],
    has_blocks: bool,
) {
    // What an earlier call left would be taken for new.
    node.remove(&format!("catalyst/{STEERING}"));
    if !channel.is_empty() {
        node.remove(&format!("catalyst/{channel}"));
    }
    settings(node, asked);
    let Some(motion) = &asked.motion else { return };
    let root = format!("catalyst/{channel}");
    let mut first = 0;
    let without_data = [(String::new(), 0)];
    let blocks = if blocks.is_empty() && !has_blocks { &without_data } else { blocks };
    let is_single = matches!(blocks, [(name, _)] if name.is_empty());
    for (name, count) in blocks {
        let end = first + count;
        let place = if is_single { root.clone() } else { format!("{root}/{name}") };
        points(node, &place, motion, first..end);
        if !is_single {
            // A block lies below `data` too, as a whole.
            node.set_same(&format!("{root}/data/{name}"), &place);
        }
        first = end;
    }
    if is_single {
        second_layout(node, &root);
    } else {
        node.set_text(&format!("{root}/type"), "multimesh");
    }
    let state = format!("{root}/state");
    node.set_text(&format!("{state}/order"), &motion.order);
    node.set_integers(&format!("{state}/shape"), &[i64::from(motion.shape.0)]);
    node.set_integers(&format!("{state}/shapes"), &[i64::from(motion.shape.1)]);
}

/// The parameters, and what else is one number.
fn settings(node: &mut NodeMut<'_>, asked: &Asked) {
    let root = format!("catalyst/{STEERING}");
    let origin = [[0.0; 3]];
    coordinates(node, &root, MESH, &origin);
    let shape = asked.motion.as_ref().map_or((0, 0), |motion| motion.shape);
    let flags = [
        ("stop", f64::from(u8::from(asked.stop))),
        ("moving", f64::from(u8::from(asked.motion.is_some()))),
        ("shape", f64::from(shape.0)),
        ("shapes", f64::from(shape.1)),
    ];
    let parameters = asked.parameters.iter().map(|(name, value)| (name.as_str(), *value));
    for (name, value) in flags.into_iter().chain(parameters) {
        let field = field(node, &root, MESH, name);
        node.set_number(&format!("{field}/values"), value);
    }
    second_layout(node, &root);
}

fn points(node: &mut NodeMut<'_>, root: &str, motion: &MeshMotion, range: std::ops::Range<usize>) {
    let part = |vectors: &'_ [[f64; 3]]| vectors.get(range.clone()).unwrap_or_default().to_vec();
    coordinates(node, root, MESH, &part(&motion.coordinates));
    for (name, vectors) in [("displacement", &motion.displacement), ("velocity", &motion.velocity)]
    {
        let field = field(node, root, MESH, name);
        axes(node, &field, &part(vectors));
    }
    surface(node, root, motion, &range);
}

/// The boundary's vertices among those of `range`, by their numbers in it.
fn surface(
    node: &mut NodeMut<'_>,
    root: &str,
    motion: &MeshMotion,
    range: &std::ops::Range<usize>,
) {
    let surface = &motion.surface;
    let places: Vec<usize> = (0..surface.vertices.len())
        .filter(|&place| range.contains(&(surface.vertices[place] as usize)))
        .collect();
    let part = |vectors: &[[f64; 3]]| -> Vec<[f64; 3]> {
        places.iter().map(|&place| vectors.get(place).copied().unwrap_or_default()).collect()
    };
    coordinates(node, root, SURFACE, &part(&surface.coordinates));
    for (name, vectors) in
        [("surface_displacement", &surface.displacement), ("surface_velocity", &surface.velocity)]
    {
        let field = field(node, root, SURFACE, name);
        axes(node, &field, &part(vectors));
    }
    let number = |&place: &usize| {
        i64::from(surface.vertices[place]) - i64::try_from(range.start).unwrap_or_default()
    };
    let numbers: Vec<i64> = places.iter().map(number).collect();
    let field = field(node, root, SURFACE, "surface_vertices");
    node.set_integers(&format!("{field}/values"), &numbers);
}

fn coordinates(
    node: &mut NodeMut<'_>,
    root: &str,
    (topology, coordset): Names,
    points: &[[f64; 3]],
) {
    let values = format!("{root}/coordsets/{coordset}");
    node.set_text(&format!("{values}/type"), "explicit");
    axes(node, &values, points);
    let topology = format!("{root}/topologies/{topology}");
    node.set_text(&format!("{topology}/type"), "points");
    node.set_text(&format!("{topology}/coordset"), coordset);
}

/// Begins a field on the vertices; where it stands.
fn field(node: &mut NodeMut<'_>, root: &str, (topology, _): Names, name: &str) -> String {
    let field = format!("{root}/fields/{name}");
    node.set_text(&format!("{field}/association"), "vertex");
    node.set_text(&format!("{field}/topology"), topology);
    node.set_text(&format!("{field}/volume_dependent"), "false");
    field
}

fn axes(node: &mut NodeMut<'_>, root: &str, vectors: &[[f64; 3]]) {
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        node.set_axis(&format!("{root}/values/{name}"), vectors, axis);
    }
}

/// Shows a mesh below `data` too, without a second copy.
fn second_layout(node: &mut NodeMut<'_>, root: &str) {
    node.set_text(&format!("{root}/type"), "mesh");
    for part in ["coordsets", "topologies", "fields"] {
        node.set_same(&format!("{root}/data/{part}"), &format!("{root}/{part}"));
    }
}
