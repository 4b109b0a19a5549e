//! One array's bytes as a zstd frame, and back.

/// The most bytes that a frame's arrays may unfold to: far more than any view, far less than
/// memory.
pub(super) const MOST_BYTES: usize = 1 << 30;

/// Compresses. Level 1 to 3 is a trade of time for size.
#[cfg(feature = "compression")]
pub(super) fn compress(bytes: &[u8], level: i32) -> Result<Vec<u8>, std::io::Error> {
    zstd::bulk::compress(bytes, level)
}

/// The bytes behind a blob, which must be `expected` many. Never holds many more than that.
#[cfg(feature = "compression")]
pub(super) fn decompress(blob: &[u8], expected: usize) -> Result<Vec<u8>, String> {
    use std::io::Read;
    let decoder =
        zstd::stream::read::Decoder::with_buffer(blob).map_err(|error| error.to_string())?;
    let mut bytes = Vec::new();
    decoder.take(expected as u64 + 1).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    check(bytes, expected)
}

/// The bytes behind a blob, which must be `expected` many. Never holds many more than that and one
/// window of zstd.
#[cfg(not(feature = "compression"))]
pub(super) fn decompress(blob: &[u8], expected: usize) -> Result<Vec<u8>, String> {
    use std::io::Read;
    let decoder =
        ruzstd::decoding::StreamingDecoder::new(blob).map_err(|error| error.to_string())?;
    let mut bytes = Vec::with_capacity(expected);
    decoder.take(expected as u64 + 1).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    check(bytes, expected)
}

fn check(bytes: Vec<u8>, expected: usize) -> Result<Vec<u8>, String> {
    if bytes.len() == expected {
        return Ok(bytes);
    }
    let found = if bytes.len() > expected { "more".to_owned() } else { bytes.len().to_string() };
    Err(format!("{found} bytes where the message says {expected}"))
}
