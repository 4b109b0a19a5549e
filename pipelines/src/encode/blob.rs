//! One array's bytes as a zstd frame, and back.

/// The most bytes that a frame's arrays may unfold to: far more than any view, far less than
/// memory.
pub(super) const MOST_BYTES: usize = 1 << 30;

/// The first bytes of a zstd frame (RFC 8878).
#[cfg(any(test, not(feature = "compression")))]
const ZSTD_MAGIC: [u8; 4] = 0xFD2F_B528_u32.to_le_bytes();
/// The largest block of a zstd frame.
#[cfg(any(test, not(feature = "compression")))]
const BLOCK: usize = 128 * 1024;

/// Compresses. Level 1 to 3 is a trade of time for size.
#[cfg(feature = "compression")]
pub(super) fn compress(bytes: &[u8], level: i32) -> Result<Vec<u8>, std::io::Error> {
    zstd::bulk::compress(bytes, level)
}

/// Wraps the bytes as they are: this build has no compressor.
#[cfg(not(feature = "compression"))]
pub(super) fn compress(bytes: &[u8], _: i32) -> Result<Vec<u8>, std::io::Error> {
    store(bytes)
}

/// A zstd frame whose blocks are not compressed.
#[cfg(any(test, not(feature = "compression")))]
fn store(bytes: &[u8]) -> Result<Vec<u8>, std::io::Error> {
    let size = u32::try_from(bytes.len()).map_err(std::io::Error::other)?;
    let mut frame = Vec::with_capacity(bytes.len() + 16);
    frame.extend(ZSTD_MAGIC);
    // A single segment whose size is given in four bytes; no checksum, no dictionary.
    frame.push(0b1010_0000);
    frame.extend(size.to_le_bytes());
    let blocks = bytes.len().div_ceil(BLOCK).max(1);
    for block in 0..blocks {
        let part = &bytes[block * BLOCK..bytes.len().min((block + 1) * BLOCK)];
        #[expect(clippy::cast_possible_truncation, reason = "at most BLOCK")]
        let header = (part.len() as u32) << 3 | u32::from(block + 1 == blocks);
        frame.extend(&header.to_le_bytes()[..3]);
        frame.extend(part);
    }
    Ok(frame)
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
#[cfg(all(not(feature = "compression"), feature = "decompression"))]
pub(super) fn decompress(blob: &[u8], expected: usize) -> Result<Vec<u8>, String> {
    use std::io::Read;
    let decoder =
        ruzstd::decoding::StreamingDecoder::new(blob).map_err(|error| error.to_string())?;
    let mut bytes = Vec::with_capacity(expected);
    decoder.take(expected as u64 + 1).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    check(bytes, expected)
}

/// The bytes behind a blob of blocks that are not compressed: this build has no decompressor.
#[cfg(not(any(feature = "compression", feature = "decompression")))]
pub(super) fn decompress(blob: &[u8], expected: usize) -> Result<Vec<u8>, String> {
    unstore(blob, expected)
}

#[cfg(any(test, not(any(feature = "compression", feature = "decompression"))))]
fn unstore(blob: &[u8], expected: usize) -> Result<Vec<u8>, String> {
    const COMPRESSED: &str = "the blob is compressed, and this build has no zstd";
    let mut rest = blob.strip_prefix(&ZSTD_MAGIC).ok_or("the blob is no zstd frame")?;
    rest = rest
        .strip_prefix(&[0b1010_0000])
        .ok_or(COMPRESSED)?
        .get(4..)
        .ok_or("the blob is truncated")?;
    let mut bytes = Vec::new();
    loop {
        let (header, after) = rest.split_first_chunk::<3>().ok_or("the blob is truncated")?;
        let header = u32::from_le_bytes([header[0], header[1], header[2], 0]);
        if header >> 1 & 3 != 0 {
            return Err(COMPRESSED.into());
        }
        let (part, after) =
            after.split_at_checked((header >> 3) as usize).ok_or("the blob is truncated")?;
        bytes.extend(part);
        rest = after;
        if header & 1 == 1 || bytes.len() > expected {
            return check(bytes, expected);
        }
    }
}

fn check(bytes: Vec<u8>, expected: usize) -> Result<Vec<u8>, String> {
    if bytes.len() == expected {
        return Ok(bytes);
    }
    let found = if bytes.len() > expected { "more".to_owned() } else { bytes.len().to_string() };
    Err(format!("{found} bytes where the message says {expected}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stored_frames_are_zstd_frames() {
        for size in [0, 1, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK] {
            let bytes: Vec<u8> = (0..size).map(|i| (i * 31 % 251) as u8).collect();
            let frame = store(&bytes).unwrap();
            assert_eq!(unstore(&frame, size).unwrap(), bytes);
            assert_eq!(decompress(&frame, size).unwrap(), bytes);
            assert!(unstore(&frame[..frame.len() - 1], size).is_err());
            assert!(decompress(&frame, size + 1).is_err());
        }
    }
}
