//! Reductions: few numbers of an extract or of the whole mesh, which are monitors; and of monitors
//! and fields over time.

mod force;
mod histogram;
mod integrate;
mod over_time;
mod region;
mod spectrum;
mod weights;

pub(crate) use force::{force, traction_of};
pub(crate) use histogram::histogram;
pub(crate) use integrate::integrate;
pub(crate) use over_time::OverTime;
pub(crate) use region::Region;
pub(crate) use spectrum::Samples;
