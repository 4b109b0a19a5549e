//! Skinning: how the surface follows its skeleton.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::axis::{Axis, Station};
use super::rotation::smooth_step;
use super::{Skeleton, SkeletonDrag, distance};
use crate::mesh::Vector;
use crate::surface::Surface;
use crate::vector::{add, scale};

/// How the surface follows its skeleton.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Skinning {
    /// With the rotation of the skeleton too, blended along its arc length: cross-sections keep
    /// their shape.
    #[default]
    Smooth,
    /// With the translation of the nearest node alone.
    Nearest,
}

/// A surface bound to the skeleton whose nodes are dragged.
///
/// # How the surface follows
/// With [`Skinning::Nearest`] a vertex moves as the node that carries it does (Wetterer-Nelson,
/// Jansen and Evans). Cross-sections then stay parallel to what they were, and a tube bent by an
/// angle `a` is narrower by the factor `cos a`.
///
/// With [`Skinning::Smooth`] a vertex `x` belongs to the arc length `s` of the curve whose normal
/// plane it lies in, and moves by
///
/// ```text
/// d(s) + (R(s) - 1) (x - c(s)),
/// ```
///
/// `c` the axis, `d` its displacement and `R` the rotation from its tangent to the deformed one.
/// Rotations are carried along both curves in parallel, without twist (Bishop 1975); what twist
/// would be left at the far end is spread evenly. So a cross-section keeps its shape as long as the
/// curve does not bend within its radius. Tangents and `c` are those of parabolas fitted over one
/// local radius, since skeletons are rough.
///
/// # Where the motion ends
/// - Ends and branch nodes are pinned and do not move. At an end the surface turns with the curve,
///   as on a hinge. Within one local radius of a branch node the rotation fades out, so that the
///   surface follows there without a jump; what is carried by other curves follows up to one local
///   radius away from what the moved curve carries.
/// - Held vertices do not move at all, and the motion fades out towards them within one local
///   radius, measured along the surface.
///
/// # What it guarantees
/// Vertices farther away move by exact zeros, and all do where nothing is dragged. Same input, same
/// bits.
///
/// # What it does not
/// Where the curve bends more sharply than the tube is wide, the surface folds on the inner side;
/// surface checks find that.
///
/// # Performance
/// Binding is linear in the surface, but for distances along it, which take as long as sorting
/// those within one radius. A drag is linear in the vertices that move.
///
/// ```
/// use std::sync::Arc;
/// use tombolo_deform::skeleton::{Skeleton, SkeletonDrag, Skin};
/// use tombolo_deform::{shapes, features::FeatureSettings, skeleton::Skinning, surface::Surface};
///
/// // A tube along z with its axis, each ring of vertices carried by the node in its middle.
/// let nodes: Vec<_> = (0..=20).map(|i| [0.0, 0.0, 0.5 * f64::from(i)]).collect();
/// let surface = Surface::extract(&shapes::tube(&nodes, 1.0, 16), &FeatureSettings::default())?;
/// let carriers = surface.points().iter().map(|point| (2.0 * point[2]).round() as u32).collect();
/// let skeleton = Skeleton::new(nodes, vec![(0..=20).collect()], carriers)?;
///
/// let drag = SkeletonDrag::new(&skeleton, &[10])?;
/// let held = vec![false; surface.points().len()];
/// let skin = Skin::new(Arc::new(surface), Arc::new(skeleton), drag, &held, Skinning::Smooth)?;
/// let below = vec![[0.0; 3]; held.len()];
/// let moved = skin.displacement(&[[2.0, 0.0, 0.0]], &below);
/// assert!(moved.iter().any(|moved| moved[0] > 1.9));
/// assert_eq!(skin.displacement(&[[0.0; 3]], &below), below);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Skin {
    surface: Arc<Surface>,
    skeleton: Arc<Skeleton>,
    drag: SkeletonDrag,
    binding: Binding,
}

#[derive(Debug, Clone)]
enum Binding {
    Smooth(Vec<BoundCurve>),
    /// Vertices, their nodes, and how much of the motion they make.
    Nearest(Vec<(u32, u32, f64)>),
}

#[derive(Debug, Clone)]
struct BoundCurve {
    axis: Axis,
    vertices: Vec<BoundVertex>,
}

#[derive(Debug, Clone, Copy)]
struct BoundVertex {
    vertex: u32,
    station: Station,
    /// How much of the motion it makes.
    weight: f64,
}

impl Skin {
    /// Binds a surface to its skeleton. `held` says of each surface vertex (`[v]`) whether it stays
    /// where it is.
    ///
    /// # Errors
    /// [`SkinError`], where the skeleton or `held` is not one of this surface.
    pub fn new(
        surface: Arc<Surface>,
        skeleton: Arc<Skeleton>,
        drag: SkeletonDrag,
        held: &[bool],
        skinning: Skinning,
    ) -> Result<Self, SkinError> {
        let vertices = surface.points().len();
        let [carried, held_count] = [skeleton.node_of_vertex().len(), held.len()];
        if carried != vertices || held_count != vertices {
            return Err(SkinError::OtherSurface { vertices, carried, held: held_count });
        }
        let radii = skeleton.radii(surface.points());
        let binding = match skinning {
            Skinning::Smooth => {
                let curves = drag
                    .curves()
                    .map(|curve| BoundCurve::new(&surface, &skeleton, curve, &radii, held));
                Binding::Smooth(curves.collect())
            }
            Skinning::Nearest => {
                Binding::Nearest(bind_to_nodes(&surface, &skeleton, &drag, &radii, held))
            }
        };
        Ok(Self { surface, skeleton, drag, binding })
    }

    /// The displacement that dragging the nodes of the [`SkeletonDrag`] by `by` adds at each
    /// surface vertex to `below` (`[v]`), the displacement from the reference that has been reached
    /// before.
    ///
    /// The curve bends as it does on the reference. What turns is the shape that has been reached,
    /// about the axis that has been reached: each node of it is taken to have moved by the mean of
    /// the vertices that it carries. `below` of another length is taken as far as it goes.
    #[must_use]
    pub fn displacement(&self, by: &[Vector], below: &[Vector]) -> Vec<Vector> {
        let moved = self.drag.displacement(by);
        let mut displacement = vec![[0.0; 3]; self.surface.points().len()];
        match &self.binding {
            Binding::Nearest(bound) => {
                for &(vertex, node, weight) in bound {
                    displacement[vertex as usize] = scale(moved[node as usize], weight);
                }
            }
            Binding::Smooth(curves) => {
                if by.iter().all(|by| *by == [0.0; 3]) {
                    return displacement;
                }
                let nodes = self.moved_below(below);
                for curve in curves {
                    let along = |node: &u32| *node as usize;
                    let reached: Vec<_> =
                        curve.axis.nodes().iter().map(|node| nodes[along(node)]).collect();
                    let moved: Vec<_> =
                        curve.axis.nodes().iter().map(|node| moved[along(node)]).collect();
                    let bent = curve.axis.bend(&reached, &moved);
                    for bound in &curve.vertices {
                        let vertex = bound.vertex as usize;
                        let point = add(
                            self.surface.points()[vertex],
                            below.get(vertex).copied().unwrap_or_default(),
                        );
                        let own = scale(bent.displacement(bound.station, point), bound.weight);
                        displacement[vertex] = add(displacement[vertex], own);
                    }
                }
            }
        }
        displacement
    }

    /// Whether no vertex moves, whatever is dragged by whatever amount.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        match &self.binding {
            Binding::Nearest(bound) => bound.is_empty(),
            Binding::Smooth(curves) => curves.iter().all(|curve| curve.vertices.is_empty()),
        }
    }

    /// For each node the mean displacement of the vertices it carries.
    fn moved_below(&self, below: &[Vector]) -> Vec<Vector> {
        let mut sums = vec![([0.0; 3], 0u32); self.skeleton.nodes().len()];
        for (&moved, &node) in below.iter().zip(self.skeleton.node_of_vertex()) {
            let (sum, count) = &mut sums[node as usize];
            *sum = add(*sum, moved);
            *count += 1;
        }
        sums.into_iter().map(|(sum, count)| scale(sum, 1.0 / f64::from(count.max(1)))).collect()
    }
}

impl BoundCurve {
    fn new(
        surface: &Surface,
        skeleton: &Skeleton,
        curve: usize,
        radii: &[f64],
        held: &[bool],
    ) -> Self {
        let axis = Axis::new(skeleton, curve, radii, surface.points());
        // Branch nodes carry what several curves share.
        let mut indices = vec![None; skeleton.nodes().len()];
        for (index, &node) in axis.nodes().iter().enumerate() {
            if skeleton.degree(node as usize) <= 2 {
                indices[node as usize] = Some(index);
            }
        }
        let own = |vertex: u32| indices[skeleton.node_of_vertex()[vertex as usize] as usize];
        let all = 0..surface.points().len() as u32;
        let reach = axis.largest_radius();
        let from_own = distance::from_vertices(
            surface.points(),
            surface.triangles(),
            all.clone().filter(|&vertex| own(vertex).is_some()),
            reach,
        );
        let from_held = Held::new(surface, held, reach);
        let mut vertices: Vec<BoundVertex> = Vec::new();
        let mut stations: Vec<Option<Station>> = vec![None; surface.points().len()];
        for vertex in all.clone() {
            stations[vertex as usize] =
                own(vertex).map(|index| axis.station(surface.points()[vertex as usize], index));
        }
        for vertex in all {
            let Some((away, source)) = from_own[vertex as usize] else { continue };
            let Some(at_source) = stations[source as usize] else { continue };
            let (station, follows) = match stations[vertex as usize] {
                Some(station) => (station, 1.0),
                None => {
                    let station =
                        axis.station(surface.points()[vertex as usize], axis.nearest(at_source));
                    (station, 1.0 - share(away, axis.radius(at_source)))
                }
            };
            let weight = follows * from_held.fade(vertex, axis.radius(station));
            if weight > 0.0 {
                vertices.push(BoundVertex { vertex, station, weight });
            }
        }
        Self { axis, vertices }
    }
}

fn bind_to_nodes(
    surface: &Surface,
    skeleton: &Skeleton,
    drag: &SkeletonDrag,
    radii: &[f64],
    held: &[bool],
) -> Vec<(u32, u32, f64)> {
    let mut moves = vec![false; skeleton.nodes().len()];
    let mut reach = 0.0f64;
    for &node in drag.curves().flat_map(|curve| skeleton.curves()[curve].nodes()) {
        moves[node as usize] = true;
        reach = reach.max(radii[node as usize]);
    }
    let from_held = Held::new(surface, held, reach);
    skeleton
        .node_of_vertex()
        .iter()
        .zip(0..)
        .filter(|&(&node, _)| moves[node as usize])
        .map(|(&node, vertex)| (vertex, node, from_held.fade(vertex, radii[node as usize])))
        .filter(|&(_, _, weight)| weight > 0.0)
        .collect()
}

/// Distances along the surface from what is held.
struct Held(Option<Vec<Option<(f64, u32)>>>);

impl Held {
    fn new(surface: &Surface, held: &[bool], farthest: f64) -> Self {
        let sources = || (0..held.len() as u32).filter(|&vertex| held[vertex as usize]);
        Self(sources().next().map(|_| {
            distance::from_vertices(surface.points(), surface.triangles(), sources(), farthest)
        }))
    }

    /// How much of the motion a vertex makes: nothing where it is held, all of it one radius away.
    fn fade(&self, vertex: u32, radius: f64) -> f64 {
        match &self.0 {
            None => 1.0,
            Some(distances) => {
                distances[vertex as usize].map_or(1.0, |(away, _)| share(away, radius))
            }
        }
    }
}

/// From 0 at no distance to 1 at that of a radius and farther.
fn share(away: f64, radius: f64) -> f64 {
    if away <= 0.0 {
        0.0
    } else if away >= radius {
        1.0
    } else {
        smooth_step(away / radius)
    }
}

/// Why a surface cannot be bound to a skeleton.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SkinError {
    /// The numbers of vertices differ.
    #[error(
        "the surface has {vertices} vertices, but the skeleton carries {carried}, and {held} were said to be held or not"
    )]
    OtherSurface {
        /// Of the surface.
        vertices: usize,
        /// Of the skeleton.
        carried: usize,
        /// In the list of held ones.
        held: usize,
    },
}

#[cfg(test)]
#[path = "skinning_tests.rs"]
mod tests;
