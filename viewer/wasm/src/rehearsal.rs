//! A first edit that nobody waits for.
//!
//! An engine of WebAssembly begins with code that it made in a hurry, and compiles a function well
//! only once it has run for a while: the first edit of a session would take twice as long as those
//! after it. So the caller has a small one made while nobody looks, and what is compiled by it
//! stays compiled.

use std::sync::Arc;

use serde_json::json;
use tombolo_deform::edit::{Edit, Editor};
use tombolo_deform::shapes;
use tombolo_deform::surface::Surface;

/// Faces around the ring and around the tube: enough that every loop of the kernel runs for long,
/// few enough that all of it takes some 50 milliseconds.
const FACES: [usize; 2] = [64, 32];

/// Opens a torus and moves one side of it, at every harmonic order. Returns the displacement of the
/// last.
pub fn rehearse() -> Vec<[f64; 3]> {
    let torus = shapes::torus(1.0, 0.4, FACES);
    let (points, faces) = (torus.points().to_vec(), torus.cells().clone());
    let (vertices, features) = ((0..).take(points.len()).collect(), vec![0; faces.len()]);
    let Ok(surface) = Surface::from_faces(points, vertices, faces, vec!["torus".into()], features)
    else {
        return Vec::new();
    };
    let Ok(mut editor) = Editor::new(Arc::new(surface)) else { return Vec::new() };
    let mut displacement = Vec::new();
    for order in 1..=3 {
        let stack = json!([{"translate": {
            "region": {"half_space": {"origin": [0.9, 0, 0], "normal": [1, 0, 0]}},
            "fixed_region": {"half_space": {"origin": [-0.9, 0, 0], "normal": [-1, 0, 0]}},
            "by": [0.1, 0.05, 0.3], "harmonic_order": order,
        }}]);
        let Ok(stack) = serde_json::from_value::<Vec<Edit>>(stack) else { continue };
        displacement = editor.displacement(&stack).unwrap_or_default();
    }
    displacement
}

#[cfg(test)]
mod tests {
    #[test]
    fn rehearses_a_whole_edit() {
        let displacement = super::rehearse();
        assert_eq!(displacement.len(), super::FACES[0] * super::FACES[1]);
        assert!(displacement.contains(&[0.1, 0.05, 0.3]));
    }
}
