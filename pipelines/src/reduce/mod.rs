//! Reductions: few numbers of an extract or of the whole mesh, which are monitors.

mod integrate;
mod weights;

pub(crate) use integrate::{Region, integrate};
