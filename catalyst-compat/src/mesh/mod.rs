//! Meshes of the Blueprint as nodes describe them, and what the adaptor is lent of them.
//!
//! [`Channel::read`] takes a channel's node apart without looking at an array's values; [`Kept`] holds over the steps what cannot
//! be lent as it lies in the solver's memory.

mod amr;
mod channel;
mod coordset;
mod described;
mod domain;
mod field;
mod kept;
mod polyhedron;
mod rows;
mod topology;

pub(crate) use amr::Grid;
pub(crate) use channel::{Block, Channel};
pub(crate) use described::{DescribedCells, Description};
pub(crate) use kept::Kept;
