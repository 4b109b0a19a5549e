//! Frames for viewers: an extract as few bytes, each number within a stated error, and back.
//!
//! A frame is `TMBL`, version 1, kind (1 topology, 2 data, 3 reference surface), two zero bytes,
//! the length of a JSON header (32 bits, little endian), the header, and one blob for each of its
//! arrays, each a zstd frame of its own. A value is `offset + quantum * integer`; the integers
//! stand component after component, each as the zigzag of its difference to the one before (with
//! wrap-around in the array's type). Arrays of type `f32` and `f64` hold the values themselves.
//!
//! Without the feature `compression` the blobs are zstd frames that hold their bytes as they are;
//! compressed ones are read with the feature `decompression`, which is written in Rust alone.
//!
//! ```
//! use std::sync::Arc;
//! use tombolo_deform::mesh::{CellType, Cells};
//! use tombolo_pipelines::encode::{Decoded, decode, encode};
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
//! let encoded = encode(&frame)?;
//! let Decoded::Data(data) = decode(&encoded.data)? else { panic!() };
//! assert_eq!((data.cycle, data.points.len()), (7, 3));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod arrays;
mod blob;
mod decode;
mod encoder;
mod quantize;
mod surface;
mod wire;

pub use arrays::DecodeError;
pub use decode::{DataFrame, Decoded, TopologyFrame, decode};
pub use encoder::{EncodeError, Encoded, Encoder, encode};
pub use surface::encode_surface;
