//! A codec for meshes of triangles and lines, and for fields on them: few bits, each value within a
//! stated bound, the same bits on every machine.
//!
//! Two kinds of message. The cells and reference positions of a mesh are coded once, as a
//! [`Topology`]: triangle after triangle, each across an edge of one that is known, and each new
//! point where the last two triangles would make a parallelogram. From it encoder and decoder work
//! out the same [`Hierarchy`]: an order of the points from coarse to fine, in which each has up to
//! eight nearest earlier ones, and the weights by which ordinary kriging predicts its value from
//! theirs. A [`Field`] holds values in that order: the difference of each value to its prediction, in
//! steps of twice the bound, coded by rANS with one of forty fixed distributions, chosen by the
//! differences of the points it was predicted from. What earlier frames of the field hold is used
//! where it is known.
//!
//! Guaranteed: no finite value is off by more than the bound, as double precision computes it. NaN,
//! infinity and whatever else no step can reach come back bit by bit. Any bytes are answered with
//! values or with a [`CodecError`], in memory that is bounded by the message and the topology.
//! `docs/codec.md` says it all again for whoever writes another decoder.

mod bits;
pub(crate) mod bytes;
mod cells;
mod connectivity;
mod error;
mod exact;
mod field;
mod graph;
mod grid;
mod hierarchy;
mod known;
mod kriging;
mod mask;
mod motion;
mod node;
mod plane;
mod prediction;
mod ranges;
mod rans;
mod run;
mod tables;
mod temporal;
mod topology;

pub use error::CodecError;
pub use field::{Bound, Field};
pub use hierarchy::Hierarchy;
pub use motion::Motion;
pub(crate) use ranges::ranges;
pub use topology::{Coded, Topology};
