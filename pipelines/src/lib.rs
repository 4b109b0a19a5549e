//! The JSON language of Tombolo and its stages: extract, edit, deform, monitor, encode, write.
//!
//! A solver's step is borrowed as a [`extract::Snapshot`]; the pipelines that are due make
//! [`extract::Extract`]s of it (compact copies that another thread may keep), monitors, and orders.
//! Nothing here opens a socket or insists on a thread, and without its features the crate builds
//! for WebAssembly.
#![warn(missing_docs)]

pub mod codec;
mod derive;
pub mod encode;
pub mod expression;
pub mod extract;
#[cfg(feature = "files")]
pub mod files;
mod interpolation;
pub mod language;
mod reduce;
pub mod render;
pub mod run;

pub use tombolo_deform::limits;
