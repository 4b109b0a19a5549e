//! Frames for viewers: an extract in few bytes, each number within a stated error, and back.
//!
//! A view is a chain of frames. The first of a chain, a key frame, can be read by whoever has the
//! view's topology, or has it sent along; each later one goes on from the frame before it. Cells,
//! positions and fields are coded by [`codec`](crate::codec); `docs/protocol.md` says how a frame is
//! laid out.
//!
//! The surface that shapes are measured from is sent bit for bit, by [`encode_surface`].
//!
//! ```
//! use std::sync::Arc;
//! use tombolo_deform::mesh::{CellType, Cells};
//! use tombolo_pipelines::encode::{Decoder, Encoder};
//! use tombolo_pipelines::extract::Extract;
//! use tombolo_pipelines::run::{Encoding, Frame};
//!
//! let extract = Extract {
//!     points: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
//!     vertices: None,
//!     cells: Arc::new(Cells::uniform(CellType::Triangle, vec![0, 1, 2])?),
//!     features: None,
//!     fields: vec![],
//! };
//! let frame = Frame { pipeline: "surface".into(), cycle: 7, time: 0.7, extract: extract.into(), encoding: Encoding::default() };
//! let encoded = Encoder::new().encode(&frame, false)?;
//! let decoded = Decoder::new().decode(&encoded.with_topology())?;
//! assert_eq!((decoded.cycle, decoded.points.len()), (7, 3));
//! assert!(decoded.cells.is_some());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[cfg(any(feature = "compression", feature = "decompression"))]
mod blob;
mod decoder;
mod elements;
mod encoder;
mod error;
mod layout;
#[cfg(any(feature = "compression", feature = "decompression"))]
mod surface;

pub use decoder::{DecodedCells, DecodedFrame, Decoder, view_of};
pub use encoder::{Encoded, Encoder};
pub use error::{DecodeError, EncodeError};
#[cfg(any(feature = "compression", feature = "decompression"))]
pub use surface::decode_surface;
#[cfg(feature = "compression")]
pub use surface::encode_surface;
