//! Meshes as solvers in other languages show them, and how they are lent to the adaptor.
//!
//! A [`Channel`] borrows the solver's arrays for the length of one call. What cannot be lent as it
//! lies in the solver's memory is kept over the steps, in a copy.

mod channel;
mod coordset;
mod domain;
mod field;
mod kept;
mod levels;
mod polyhedron;
mod rows;
mod topology;

pub use channel::{Block, Channel};
pub use coordset::Coordset;
pub use domain::{Domain, Faces, Lending, Roles};
pub use field::{COMPONENTS, Field};
pub(super) use kept::Kept;
pub use levels::{Grid, Mask};
pub use rows::Rows;
pub use topology::{Topology, Types};

pub use super::label::Label;
