//! The layout that all messages share.

use super::error::{DecodeError, error};
use crate::codec::CodecError;
use crate::codec::bytes::{Input, put_block};

/// The first bytes of every message.
const MAGIC: [u8; 4] = *b"TMBL";
/// The version of the layout.
const VERSION: u8 = 2;
/// Bytes before the contents of a message.
pub(super) const PREAMBLE: usize = 8;
/// The longest name of a view, field or feature, in bytes.
const LONGEST_NAME: usize = 4096;

/// The kind of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Positions and fields of a view whose topology the reader has.
    Frame = 1,
    /// The view's topology, and behind it positions and fields.
    FrameWithTopology = 2,
    /// A reference surface.
    Surface = 3,
}

/// The first bytes of a message.
pub(super) const fn preamble(kind: Kind) -> [u8; PREAMBLE] {
    let [a, b, c, d] = MAGIC;
    [a, b, c, d, VERSION, kind as u8, 0, 0]
}

/// Splits the preamble off a message.
pub(super) fn open(message: &[u8]) -> Result<(Kind, Input<'_>), DecodeError> {
    let fault = |message: String| error("preamble", message);
    let (preamble, rest) = message
        .split_first_chunk::<PREAMBLE>()
        .ok_or_else(|| fault("the message is truncated".into()))?;
    let [m0, m1, m2, m3, version, kind, zeros @ ..] = *preamble;
    if [m0, m1, m2, m3] != MAGIC {
        return Err(fault("the message does not begin with TMBL".into()));
    }
    if version != VERSION || zeros != [0, 0] {
        return Err(fault(format!("found version {version}, expected {VERSION}")));
    }
    let kind = match kind {
        1 => Kind::Frame,
        2 => Kind::FrameWithTopology,
        3 => Kind::Surface,
        other => return Err(fault(format!("found kind {other}, expected 1, 2 or 3"))),
    };
    Ok((kind, Input(rest)))
}

/// The most values of a frame, its coordinates among them.
pub(super) const MOST_VALUES: usize = 1 << 27;

/// Checks how many values a frame has.
///
/// # Errors
/// [`CodecError::TooLarge`].
pub(super) fn check_values(found: usize) -> Result<(), CodecError> {
    if found > MOST_VALUES {
        let (found, most) = (found as u64, MOST_VALUES as u64);
        return Err(CodecError::TooLarge { what: "values", found, most });
    }
    Ok(())
}

/// Appends a name, cut off where it is too long.
pub(super) fn put_name(message: &mut Vec<u8>, name: &str) {
    let end = (0..=name.len().min(LONGEST_NAME)).rev().find(|&end| name.is_char_boundary(end));
    put_block(message, &name.as_bytes()[..end.unwrap_or(0)]);
}

/// Reads a name.
pub(super) fn name(input: &mut Input<'_>, part: &str) -> Result<String, DecodeError> {
    let bytes = input.block().map_err(|failure| error(part, failure.to_string()))?;
    if bytes.len() > LONGEST_NAME {
        let message = format!("a name of {} bytes, expected at most {LONGEST_NAME}", bytes.len());
        return Err(error(part, message));
    }
    String::from_utf8(bytes.to_vec()).map_err(|_| error(part, "a name that is not UTF-8"))
}
