//! Surface shaping and volume mesh motion: the geometry kernel of Tombolo.
//!
//! This crate has no input or output, knows no MPI and insists on no threads, so that the same code runs inside a solver and,
//! as WebAssembly, in a browser.
#![warn(missing_docs)]

pub mod limits;
pub mod linear;
pub mod mesh;
pub mod number;
pub mod partition;
pub mod quality;
pub mod schedule;
pub mod shapes;
pub mod skeleton;
pub mod surface;
pub mod volume;
pub mod warps;

mod lanes;
mod parallel;
mod vector;
