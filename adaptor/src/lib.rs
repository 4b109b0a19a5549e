//! In situ adaptor: watch a running simulation in a browser and change the shape of its domain while it runs.
//!
//! A solver makes three calls: [`Adaptor::initialize`], [`Adaptor::execute`] before each step, [`Adaptor::finalize`]. This is a
//! whole one, whose mesh is squeezed by an order at cycle 2 and restored by another at cycle 4:
//!
//! ```
//! use tombolo::{Adaptor, Settings, Step, deform::{mesh::MeshView, shapes::box_of_tets}};
//! use tombolo::pipelines::{extract::Channel, language::parse_orders};
//!
//! let orders = r#"[
//!     {"at": {"cycle": 2}, "order": {"edits": [
//!         {"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0, 0, -0.2]}}]}},
//!     {"at": {"cycle": 4}, "order": {"undo": 1}}]"#;
//! let mut mesh = box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]);
//! let reference = mesh.clone();
//! let mut adaptor = Adaptor::initialize(Settings { orders: parse_orders(orders, "orders.json")?, ..Settings::default() })?;
//! for cycle in 0..6 {
//!     let step = Step { cycle, time: 0.01 * cycle as f64, time_step: 0.01 };
//!     let channel = Channel { name: "fluid", mesh: MeshView::from(&mesh), fields: &[] };
//!     let steering = adaptor.execute(&step, &[channel])?;
//!     if let Some(motion) = steering.motion {
//!         // A real solver takes its step on the moving mesh here, with `motion.velocity`.
//!         mesh = mesh.with_points(motion.coordinates.to_vec())?;
//!     }
//!     assert_eq!(mesh == reference, cycle < 2 || cycle >= 4);
//! }
//! let report = adaptor.finalize()?;
//! assert!(report.orders.iter().all(|order| order.status == tombolo::OrderStatus::Applied));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! With `"stream": {}` in its configuration the same solver is steered from a browser: [`Adaptor::link`] is what to open.
#![warn(missing_docs)]

mod adaptor;
pub mod comm;
#[cfg(feature = "distributed")]
pub mod distributed;
mod journal;
pub mod logging;
mod report;
mod settings;
mod stages;
pub mod steering;
pub mod stream;
mod writer;

pub use adaptor::Adaptor;
pub use journal::JournalError;
pub use report::{ORDERS_KEPT, OrderReport, OrderStatus, Report, Spread};
pub use settings::{
    ExecuteError, FinalizeError, InitializeError, MeshMotion, Settings, Solvers, Steering, Step,
    SurfaceMotion,
};
pub use steering::{NotFollowed, Parameter, ParameterError};
pub use tombolo_deform as deform;
pub use tombolo_pipelines as pipelines;
