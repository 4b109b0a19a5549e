//! Surface shaping and volume mesh motion: the geometry kernel of Tombolo.
//!
//! This crate has no input or output, knows no MPI and insists on no threads, so that the same code
//! runs inside a solver and, as WebAssembly, in a browser. Every answer is deterministic: the same
//! input gives the same bits on any number of threads.
//!
//! # A guided tour
//! An engineer wants an outlet twice as wide while the solver runs. The way there has six steps,
//! and a module for each.
//!
//! **1. A mesh.** A solver lends its arrays as a [`mesh::MeshView`]; files and tests own a
//! [`mesh::Mesh`]. The [`shapes`] are small meshes with known geometry. Here is a channel of 3 by 1
//! by 1:
//!
//! ```
//! use tombolo_deform::shapes;
//!
//! let mesh = shapes::box_of_tets([6, 2, 2], [0.0; 3], [3.0, 1.0, 1.0]);
//! assert_eq!((mesh.points().len(), mesh.cells().len()), (7 * 3 * 3, 6 * 24));
//! ```
//!
//! **2. Its boundary.** [`surface::Surface::extract`] finds the faces that belong to one cell only.
//! Surface vertices are numbered anew, and know the mesh vertex that they are.
//!
//! **3. Its features.** Every boundary face belongs to one of the [`features`], which the mesh
//! names, or which sharp edges part. Edits name features.
//!
//! ```
//! # use tombolo_deform::shapes;
//! # let mesh = shapes::box_of_tets([6, 2, 2], [0.0; 3], [3.0, 1.0, 1.0]);
//! use tombolo_deform::{features::FeatureSettings, surface::Surface};
//!
//! let surface = Surface::extract(&mesh, &FeatureSettings::default())?;
//! assert_eq!(surface.features().names(), ["x-min", "x-max", "y-min", "y-max", "z-min", "z-max"]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! **4. An edit.** An [`edit::Edit`] says what is moved and what is held; the rest of the surface
//! follows smoothly, by a polyharmonic equation ([`harmonic`]). An [`edit::Editor`] turns a stack
//! of edits into one displacement for each surface vertex. It is always measured from the
//! reference, so that an empty stack gives the reference back exactly. A surface can also be
//! dragged by its [`skeleton`].
//!
//! ```
//! # use tombolo_deform::{features::FeatureSettings, shapes, surface::Surface};
//! # let mesh = shapes::box_of_tets([6, 2, 2], [0.0; 3], [3.0, 1.0, 1.0]);
//! # let surface = Surface::extract(&mesh, &FeatureSettings::default())?;
//! use std::sync::Arc;
//! use tombolo_deform::edit::{Edit, Editor};
//!
//! let stack: Vec<Edit> = serde_json::from_str(
//!     r#"[{ "scale_direction": { "features": ["x-max"], "fixed": ["x-min"], "factors": [1, 2, 1] } }]"#,
//! )?;
//! let mut editor = Editor::new(Arc::new(surface))?;
//! let displacement = editor.displacement(&stack)?;
//! let corner = editor.surface().points().iter().position(|point| *point == [3.0, 1.0, 1.0]).unwrap();
//! assert_eq!(displacement[corner], [0.0, 0.5, 0.0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! **5. The volume.** A [`volume::VolumeOperator`] is set up once for the reference mesh and
//! carries any motion of the boundary to all vertices. It rests on the sparse matrices and solvers
//! of [`linear`].
//!
//! **6. The guard and the schedule.** Before the first shape is handed out, [`quality::judge`]
//! checks the whole path to the new one: no element may turn inside out on the way, nor fall below
//! the quality floor. A [`schedule::Schedule`] says in how many shapes, and when, the new one is
//! reached.
//!
//! ```
//! # use std::sync::Arc;
//! # use tombolo_deform::edit::{Edit, Editor};
//! # use tombolo_deform::{features::FeatureSettings, shapes, surface::Surface};
//! # let mesh = shapes::box_of_tets([6, 2, 2], [0.0; 3], [3.0, 1.0, 1.0]);
//! # let surface = Surface::extract(&mesh, &FeatureSettings::default())?;
//! # let stack: Vec<Edit> = serde_json::from_str(
//! #     r#"[{ "scale_direction": { "features": ["x-max"], "fixed": ["x-min"], "factors": [1, 2, 1] } }]"#,
//! # )?;
//! # let mut editor = Editor::new(Arc::new(surface))?;
//! # let displacement = editor.displacement(&stack)?;
//! use tombolo_deform::quality::{Guard, judge};
//! use tombolo_deform::schedule::Schedule;
//! use tombolo_deform::vector::add;
//! use tombolo_deform::volume::{Deform, VolumeOperator};
//!
//! let operator = VolumeOperator::new(&mesh, editor.surface().vertices(), &Deform::default())?;
//! let moved = operator.solve(&displacement)?.displacement;
//! let shape: Vec<_> = mesh.points().iter().zip(&moved).map(|(point, moved)| add(*point, *moved)).collect();
//!
//! let schedule: Schedule = serde_json::from_str(r#"{ "steps": 4, "every": { "steps": 10 } }"#)?;
//! let path = judge(&mesh, mesh.points(), &shape, &schedule.fractions(), &Guard::default())?;
//! assert_eq!(path.shapes.len(), 4);
//! assert!(path.min_scaled_jacobian >= path.floor);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # The modules
//! | module | holds |
//! |---|---|
//! | [`mesh`] | meshes of any linear cells, owned or borrowed from a solver |
//! | [`surface`] | the boundary of a mesh, and the flaws of a deformed one |
//! | [`features`] | the named parts of a surface: tagged, or between sharp edges |
//! | [`edit`] | edits, stacks of edits, and the editor that evaluates them |
//! | [`harmonic`] | the polyharmonic equations by which a surface follows |
//! | [`skeleton`] | curve skeletons: extraction, dragging, skinning |
//! | [`volume`] | the motion of the volume: operators, untangling, improvement |
//! | [`quality`] | the quality of cells, and the guard that lets no broken mesh through |
//! | [`shape`] | the whole way of a request: the shape of a stack of edits, the way there, the guard, the forecast |
//! | [`schedule`] | when each shape on the way to a new one is due |
//! | [`linear`] | sparse matrices and their solvers |
//! | [`communicator`] | the ranks that share a mesh, and what they say to each other |
//! | [`distributed`] | meshes of which each rank has a part |
//! | [`topology`] | how cells, faces and edges meet, whatever their points |
//! | [`vector`], [`bounds`] | arithmetic of vectors, boxes along the axes |
//! | [`limits`], [`names`], [`number`] | limits of what comes from outside; misspelt names; numbers in messages |
//! | [`shapes`], [`warps`] | meshes and motions for tests, examples and benchmarks |
#![warn(missing_docs)]

pub mod bounds;
pub mod cancellation;
pub mod communicator;
pub mod distributed;
pub mod edit;
pub mod features;
pub mod harmonic;
pub mod lanes;
pub mod limits;
pub mod linear;
pub mod mesh;
pub mod names;
pub mod number;
pub mod quality;
pub mod schedule;
pub mod shape;
pub mod shapes;
pub mod skeleton;
pub mod surface;
pub mod topology;
pub mod vector;
pub mod volume;
pub mod warps;

mod parallel;
