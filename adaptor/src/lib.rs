//! In situ adaptor: watch a running simulation in a browser and change the shape of its domain
//! while it runs.
//!
//! A solver makes three calls: it starts an [`Adaptor`], calls [`Adaptor::execute`] before each
//! step, and ends with [`Adaptor::finalize`]. This is a whole one, whose mesh is squeezed by an
//! order at cycle 2 and restored by another at cycle 4:
//!
//! ```
//! use tombolo::{Adaptor, Channel, FieldView, MeshView, Step};
//! # use tombolo::{deform::shapes::box_of_tets, pipelines::language::parse_orders};
//! # let directory = tempfile::tempdir()?;
//! # let [pipelines, orders] = ["pipelines.json", "orders.json"].map(|name| directory.path().join(name));
//! # std::fs::write(&pipelines, r#"{"version": 1}"#)?;
//! # std::fs::write(&orders, r#"[
//! #     {"at": {"cycle": 2}, "order": {"edits": [
//! #         {"translate": {"features": ["feature-6"], "fixed": ["feature-1"], "by": [0, 0, -0.2]}}]}},
//! #     {"at": {"cycle": 4}, "order": {"undo": 1}}]"#)?;
//! # let mesh = box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]);
//! # let (mut points, tets) = (mesh.points().to_vec(), mesh.cells().connectivity().to_vec());
//! # let reference = points.clone();
//! let mut temperature = vec![0.0; points.len()];
//! let settings = Adaptor::from_file(&pipelines)?.orders_from_file(&orders)?;
//! let mut adaptor = settings.parameter("heating", 1.0, 0.0..=10.0).start()?;
//! for cycle in 0..6 {
//!     let fields = [FieldView::vertex("temperature", &temperature)];
//!     let solid = Channel::new("solid", MeshView::tets(&points, &tets), &fields);
//!     let step = Step { cycle, time: 0.01 * cycle as f64, time_step: 0.01 };
//!     let steering = adaptor.execute(&step, &[solid])?;
//!     if let Some(motion) = steering.motion {
//!         // A real solver takes its step on the moving mesh here, with `motion.velocity`.
//!         points.copy_from_slice(&motion.coordinates);
//!     }
//!     let heating = adaptor.parameter("heating").unwrap_or(1.0);
//!     temperature.iter_mut().for_each(|value| *value += 0.01 * heating);
//! #   assert_eq!(points == reference, cycle < 2 || cycle >= 4);
//! }
//! let report = adaptor.finalize()?;
//! # assert!(report.orders.iter().all(|order| order.status == tombolo::OrderStatus::Applied));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! With `"stream": {}` in its configuration the same solver is steered from a browser:
//! [`Adaptor::link`] is what to open.
#![warn(missing_docs)]

mod adaptor;
mod allocator;
mod changes;
mod checkpoint;
pub mod client;
mod condition;
mod dial;
mod error;
mod fingerprint;
pub mod foreign;
mod journal;
mod link;
mod lock;
pub mod logging;
mod meeting;
#[cfg(feature = "distributed")]
pub mod mpi;
#[cfg(feature = "distributed")]
pub mod petsc;
pub mod play;
pub mod program;
mod recorder;
pub mod recording;
mod report;
mod settings;
mod stages;
pub mod steering;
mod step;
pub mod stream;
mod table;
mod watch;
mod writer;

pub use adaptor::{Adaptor, Stopper};
pub use checkpoint::{Checkpoint, CheckpointError, Restart};
pub use condition::Condition;
pub use error::{ExecuteError, FinalizeError, InitializeError};
pub use journal::JournalError;
pub use report::{MonitorReport, PipelineReport, Report, Spread};
pub use settings::Settings;
pub use steering::{
    MeshMotion, NotFollowed, ORDERS_KEPT, OrderReport, OrderStatus, Parameter, ParameterError,
    Steering, SurfaceMotion,
};
pub use step::Step;
pub use tombolo_deform as deform;
pub use tombolo_deform::communicator;
pub use tombolo_deform::mesh::{ArrayView, MeshView};
pub use tombolo_pipelines as pipelines;
pub use tombolo_pipelines::extract::{Association, Channel, FieldView};
pub use watch::ConfigurationFile;
