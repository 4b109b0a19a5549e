//! What a drag of the skeleton does, as JSON for `scripts/pictures`: the surface and its skeleton
//! before and after.
//!
//! cargo run -p tombolo-pipelines --example skeleton_picture -- meshes/bypass-0.msh
//! examples/flow/orders/bypass-angle.json

use std::error::Error;
use std::path::Path;
use std::sync::Arc;

use serde_json::json;
use tombolo_deform::edit::{Edit, Editor};
use tombolo_deform::features::FeatureSettings;
use tombolo_deform::mesh::Vector;
use tombolo_deform::skeleton::SkeletonDrag;
use tombolo_deform::surface::Surface;
use tombolo_pipelines::files::read_mesh;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [mesh, orders] = arguments.as_slice() else {
        return Err("expected a mesh and a file of orders".into());
    };
    let orders: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(orders)?)?;
    let edits: Vec<Edit> = serde_json::from_value(orders[0]["order"]["edits"].clone())?;
    let Some(Edit::Skeleton(edit)) = edits.first() else {
        return Err("the first edit of the first order is none of the skeleton".into());
    };

    let surface = Surface::extract(&read_mesh(Path::new(mesh))?.mesh, &FeatureSettings::default())?;
    let mut editor = Editor::new(Arc::new(surface))?;
    let displacement = editor.displacement(&edits)?;
    let skeleton = editor.skeleton()?;
    let nodes: Vec<usize> =
        edit.moves().iter().map(|drag| skeleton.nearest_node(drag.at)).collect();
    let by: Vec<Vector> = edit.moves().iter().map(|drag| drag.by).collect();
    let moved = SkeletonDrag::new(&skeleton, &nodes)?.displacement(&by);

    let shape = |points: &[Vector], moved: &[Vector]| -> Vec<Vector> {
        points
            .iter()
            .zip(moved)
            .map(|(point, moved)| [0, 1, 2].map(|axis| point[axis] + moved[axis]))
            .collect()
    };
    let picture = json!({
        "triangles": editor.surface().triangles(),
        "points": [editor.surface().points(), shape(editor.surface().points(), &displacement)],
        "curves": skeleton.curves().iter().map(|curve| curve.nodes()).collect::<Vec<_>>(),
        "nodes": [skeleton.nodes(), shape(skeleton.nodes(), &moved)],
        "dragged": nodes,
    });
    println!("{picture}");
    Ok(())
}
