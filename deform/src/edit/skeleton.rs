//! Skeleton edits: from points near the skeleton to the motion of a surface.

use std::sync::{Arc, Mutex, PoisonError};

use super::kinds::SkeletonEdit;
use crate::bounds::Bounds;
use crate::cancellation::Cancellation;
use crate::mesh::Vector;
use crate::number::Number;
use crate::skeleton::{
    DragError, Skeleton, SkeletonDrag, SkeletonError, SkeletonSettings, Skin, SkinError, Skinning,
};
use crate::surface::Surface;
use crate::vector::{Position, distance, length};

/// How many bound surfaces are kept, so that changing an amount binds nothing.
const SKINS_KEPT: usize = 4;

/// How far from a node a point may be that still names it, as a part of the diagonal of the nodes'
/// bounding box, where that is more than the radius of the surface there.
const NEAR: f64 = 0.02;

/// Evaluates the skeleton edits of one surface. The skeleton is extracted when the first one needs
/// it.
#[derive(Debug)]
pub(super) struct SkeletonEditor {
    surface: Arc<Surface>,
    /// Shared with whoever extracts it in advance.
    skeleton: Arc<Mutex<Extracted>>,
    cancellation: Cancellation,
    /// How far from each node of the skeleton a point may be that names it.
    near: Vec<f64>,
    /// The most recently used at the end.
    skins: Vec<Bound>,
}

/// The skeleton of a surface, or why it has none; `None` before it was extracted.
type Extracted = Option<Result<Arc<Skeleton>, SkeletonError>>;

#[derive(Debug)]
struct Bound {
    nodes: Vec<usize>,
    held: Vec<bool>,
    skinning: Skinning,
    skin: Skin,
}

impl SkeletonEditor {
    pub fn new(surface: Arc<Surface>) -> Self {
        Self {
            surface,
            skeleton: Arc::default(),
            cancellation: Cancellation::default(),
            near: Vec::new(),
            skins: Vec::new(),
        }
    }

    /// The editor with what has an extraction given up.
    pub fn with_cancellation(self, cancellation: Cancellation) -> Self {
        Self { cancellation, ..self }
    }

    /// The skeleton of the reference surface. Where another thread extracts it just now, waits for
    /// that.
    pub fn skeleton(&self) -> Result<Arc<Skeleton>, SkeletonError> {
        extracted(&self.skeleton, &self.surface, &self.cancellation)
    }

    /// Extracts the skeleton when it is called, on whatever thread that is.
    pub fn in_advance(&self) -> impl FnOnce() + Send + 'static + use<> {
        let (skeleton, surface) = (Arc::clone(&self.skeleton), Arc::clone(&self.surface));
        let cancellation = self.cancellation.clone();
        // Who waits for it is given up with it, and extracts it once it is wanted again.
        move || drop(extracted(&skeleton, &surface, &cancellation))
    }

    /// Takes this skeleton for that of the surface.
    pub fn set(&mut self, skeleton: Arc<Skeleton>) -> Result<(), SkinError> {
        let [vertices, carried] = [self.surface.points().len(), skeleton.node_of_vertex().len()];
        if carried != vertices {
            return Err(SkinError::OtherSurface { vertices, carried, held: vertices });
        }
        self.skeleton = Arc::new(Mutex::new(Some(Ok(skeleton))));
        self.near.clear();
        self.skins.clear();
        Ok(())
    }

    /// The node that each drag of an edit names.
    pub fn nodes(&mut self, edit: &SkeletonEdit) -> Result<Vec<usize>, SkeletonEditError> {
        let skeleton = self.skeleton()?;
        if self.near.is_empty() {
            let least = NEAR * length(Bounds::around(skeleton.nodes().iter().copied()).extent());
            self.near = skeleton
                .radii(self.surface.points())
                .iter()
                .map(|radius| radius.max(least))
                .collect();
        }
        let nodes = edit
            .moves()
            .iter()
            .enumerate()
            .map(|(index, drag)| {
                let node = skeleton.nearest_node(drag.at);
                let nearest = skeleton.nodes()[node];
                let (distance, within) = (distance(nearest, drag.at), self.near[node]);
                if distance <= within {
                    Ok(node)
                } else {
                    Err(SkeletonEditError::Far {
                        field: field(edit, index),
                        at: drag.at,
                        distance,
                        nearest,
                        within,
                    })
                }
            })
            .collect::<Result<Vec<usize>, _>>()?;
        for (index, node) in nodes.iter().enumerate() {
            if let Some(first) = nodes[..index].iter().position(|other| other == node) {
                let [first, second] = [first, index].map(|index| field(edit, index));
                return Err(SkeletonEditError::Same {
                    first,
                    second,
                    node: skeleton.nodes()[*node],
                });
            }
        }
        match SkeletonDrag::new(&skeleton, &nodes) {
            Ok(_) => Ok(nodes),
            Err(source) => {
                let pinned = match &source {
                    DragError::Pinned { node, .. } => nodes.iter().position(|other| other == node),
                    _ => None,
                };
                Err(SkeletonEditError::Drag { field: field(edit, pinned.unwrap_or(0)), source })
            }
        }
    }

    /// The displacement that an edit adds to the one, `below`, that the edits before it have
    /// reached, with some vertices held.
    pub fn displacement(
        &mut self,
        edit: &SkeletonEdit,
        held: Vec<bool>,
        below: &[Vector],
    ) -> Result<Vec<Vector>, SkeletonEditError> {
        let nodes = self.nodes(edit)?;
        let by: Vec<Vector> = edit.moves().iter().map(|drag| drag.by).collect();
        let is_this = |bound: &Bound| {
            bound.nodes == nodes && bound.skinning == edit.skinning && bound.held == held
        };
        let bound = match self.skins.iter().position(is_this) {
            Some(found) => self.skins.remove(found),
            None => {
                let skeleton = self.skeleton()?;
                let drag = SkeletonDrag::new(&skeleton, &nodes)
                    .map_err(|source| SkeletonEditError::Drag { field: field(edit, 0), source })?;
                let skin = Skin::new(self.surface.clone(), skeleton, drag, &held, edit.skinning)?;
                if skin.is_empty() {
                    return Err(SkeletonEditError::NothingFollows);
                }
                Bound { nodes, held, skinning: edit.skinning, skin }
            }
        };
        let displacement = bound.skin.displacement(&by, below);
        if self.skins.len() >= SKINS_KEPT {
            self.skins.remove(0);
        }
        self.skins.push(bound);
        Ok(displacement)
    }
}

fn extracted(
    skeleton: &Mutex<Extracted>,
    surface: &Surface,
    cancellation: &Cancellation,
) -> Result<Arc<Skeleton>, SkeletonError> {
    // It is put there whole, or not at all.
    let mut known = skeleton.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = &*known {
        return known.clone();
    }
    let settings = SkeletonSettings::default();
    let found = Skeleton::extract_unless(surface, &settings, cancellation).map(Arc::new);
    if found != Err(SkeletonError::Cancelled) {
        *known = Some(found.clone());
    }
    found
}

/// The field that holds the point of a drag.
fn field(edit: &SkeletonEdit, index: usize) -> String {
    if edit.at.is_some() { "at".into() } else { format!("moves[{index}].at") }
}

/// Why a skeleton edit cannot be evaluated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SkeletonEditError {
    /// The surface has no skeleton.
    #[error(transparent)]
    Extraction(#[from] SkeletonError),
    /// A point that is nowhere near the skeleton.
    #[error(
        "{field}: {} is {:.5} away from the nearest node of the skeleton, at {}: expected a point within {:.5} of a node",
        Position(*at), Number(*distance), Position(*nearest), Number(*within)
    )]
    Far {
        /// The field that holds the point.
        field: String,
        /// The point.
        at: Vector,
        /// How far it is from the nearest node.
        distance: f64,
        /// Where that node is.
        nearest: Vector,
        /// How far it may be: the radius of the surface about the node.
        within: f64,
    },
    /// Two drags of one node.
    #[error("{second}: means the same node of the skeleton as {first}, the one at {}", Position(*node))]
    Same {
        /// The field of one drag.
        first: String,
        /// The field of the other.
        second: String,
        /// Where the node is.
        node: Vector,
    },
    /// A node that cannot be dragged.
    #[error("{field}: {source}")]
    Drag {
        /// The field that holds its point.
        field: String,
        /// Why.
        source: DragError,
    },
    /// No vertex of the handle is on what moves.
    #[error(
        "nothing follows: all that the dragged curve carries is fixed, or outside of the features and the region"
    )]
    NothingFollows,
    /// The skeleton is not one of this surface.
    #[error(transparent)]
    Skin(#[from] SkinError),
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::edit::{Edit, Editor};
    use crate::features::FeatureSettings;
    use crate::shapes;

    /// A tube of radius 1 along z from 0 to 10, its curve of 40 segments.
    fn editor() -> Editor {
        let nodes: Vec<Vector> = (0..=40).map(|node| [0.0, 0.0, 0.25 * f64::from(node)]).collect();
        let mesh = shapes::tube(&nodes, 1.0, 16);
        let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default()).unwrap());
        let carriers =
            surface.points().iter().map(|point| (4.0 * point[2]).round() as u32).collect();
        let skeleton = Skeleton::new(nodes, vec![(0..=40).collect()], carriers).unwrap();
        Editor::new(surface).unwrap().with_skeleton(Arc::new(skeleton)).unwrap()
    }

    fn stack(edits: serde_json::Value) -> Vec<Edit> {
        serde_json::from_value(edits).unwrap()
    }

    fn refusal(edit: serde_json::Value) -> String {
        editor().displacement(&stack(json!([{ "skeleton": edit }]))).unwrap_err().to_string()
    }

    #[test]
    fn what_cannot_be_dragged_is_named() {
        assert_eq!(
            refusal(json!({ "at": [0, 3, 5.1], "by": [1, 0, 0] })),
            "edit 0 (skeleton): at: (0, 3, 5.1) is 3.0017 away from the nearest node of the skeleton, at (0, 0, 5): expected a point \
             within 1 of a node"
        );
        assert_eq!(
            refusal(
                json!({ "moves": [{ "at": [0, 0, 5], "by": [1, 0, 0] }, { "at": [0, 0, 9.9], "by": [1, 0, 0] }] })
            ),
            "edit 0 (skeleton): moves[1].at: node 40 of the skeleton is the end of a curve and is pinned; the nearest node that can \
             be dragged is node 39 at (0, 0, 9.75)"
        );
        let same = refusal(
            json!({ "moves": [{ "at": [0, 0, 5], "by": [1, 0, 0] }, { "at": [0.1, 0, 5], "by": [0, 0, 0] }] }),
        );
        assert!(
            same.contains("moves[1].at: means the same node of the skeleton as moves[0].at"),
            "{same}"
        );
        let half = json!({ "half_space": { "origin": [0, 0, 20], "normal": [0, 0, 1] } });
        assert!(
            refusal(json!({ "at": [0, 0, 5], "by": [1, 0, 0], "region": half }))
                .starts_with("edit 0 (skeleton): region")
        );
        let far = Editor::new(editor().surface().clone()).unwrap();
        let other = Skeleton::new(vec![[0.0; 3]], vec![], vec![0; 3]).unwrap();
        assert!(far.with_skeleton(Arc::new(other)).is_err());
    }

    #[test]
    fn a_stack_depends_on_its_edits_alone() {
        let first = json!({ "skeleton": { "at": [0, 0, 4], "by": [0, 2, 0] } });
        let second =
            json!({ "skeleton": { "at": [0, 0, 7], "by": [1, 0, 0], "skinning": "nearest" } });
        let mut muted = second.clone();
        muted["skeleton"]["muted"] = true.into();
        let mut used = editor();
        let both = used.displacement(&stack(json!([first, second]))).unwrap();
        assert_eq!(editor().displacement(&stack(json!([first, second]))).unwrap(), both);
        assert_ne!(used.displacement(&stack(json!([first]))).unwrap(), both);
        let alone = editor().displacement(&stack(json!([first]))).unwrap();
        assert_eq!(used.displacement(&stack(json!([muted, first, muted]))).unwrap(), alone);
        let doubled = json!({ "skeleton": { "at": [0, 0, 4], "by": [0, 4, 0] } });
        assert_eq!(
            used.displacement(&stack(json!([doubled]))).unwrap(),
            editor().displacement(&stack(json!([doubled]))).unwrap()
        );
        assert!(used.displacement(&[]).unwrap().iter().all(|moved| *moved == [0.0; 3]));
        // Nothing of a stack is evaluated where one edit is wrong.
        assert!(
            used.displacement(&stack(
                json!([first, { "skeleton": { "at": [0, 0, 0], "by": [0, 1, 0] } }])
            ))
            .is_err()
        );
    }

    #[test]
    fn what_is_fixed_or_outside_of_the_region_stays() {
        let below = json!({ "half_space": { "origin": [0, 0, 2], "normal": [0, 0, -1] } });
        let above = json!({ "half_space": { "origin": [0, 0, 6], "normal": [0, 0, -1] } });
        let edits = json!([{ "skeleton": { "at": [0, 0, 4], "by": [0, 2, 0], "region": above, "fixed_region": below } }]);
        let mut editor = editor();
        let moved = editor.displacement(&stack(edits)).unwrap();
        for (point, moved) in editor.surface().points().iter().zip(&moved) {
            assert_eq!(
                *moved == [0.0; 3],
                !(2.01..=6.01).contains(&point[2]),
                "{point:?} {moved:?}"
            );
        }
    }
}
