//! How XML files wrap the bytes of an array: raw or base64, plain or in compressed blocks.

use std::io::Read;

use base64::engine::{GeneralPurpose, GeneralPurposeConfig};
use base64::{DecodeError, Engine as _, alphabet};

use super::super::error::Problem;

/// How the blocks of an array are compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Compressor {
    None,
    Zlib,
    Lz4,
}

/// How the bytes of all arrays of a file are wrapped.
#[derive(Debug, Clone, Copy)]
pub(super) struct Encoding {
    pub big_endian: bool,
    /// Bytes of each number in front of an array: 4 or 8.
    pub header_width: usize,
    pub compressor: Compressor,
}

/// The bytes of an array as they stand in the file, from its first one on; what follows it may be
/// there too.
#[derive(Clone, Copy)]
pub(super) enum Wrapped<'a> {
    Raw(&'a [u8]),
    Base64(&'a [u8]),
}

impl<'a> Wrapped<'a> {
    /// The data from so many bytes on.
    pub fn behind(self, offset: usize) -> Option<Self> {
        match self {
            Wrapped::Raw(bytes) => bytes.get(offset..).map(Wrapped::Raw),
            Wrapped::Base64(text) => text.get(offset..).map(Wrapped::Base64),
        }
    }

    /// At least the first `count` bytes.
    fn first(self, count: u64) -> Result<std::borrow::Cow<'a, [u8]>, Problem> {
        let bytes = match self {
            Wrapped::Raw(bytes) => std::borrow::Cow::Borrowed(bytes),
            Wrapped::Base64(text) => std::borrow::Cow::Owned(decode_base64(text, count)?),
        };
        if (bytes.len() as u64) < count {
            return Err(Problem::Truncated {
                what: "an array".into(),
                needed: count,
                left: bytes.len(),
            });
        }
        Ok(bytes)
    }

    /// The bytes of the array itself.
    pub fn unwrap_array(self, encoding: &Encoding) -> Result<Vec<u8>, Problem> {
        let width = encoding.header_width as u64;
        if encoding.compressor == Compressor::None {
            let header = self.first(width)?;
            let length = encoding.number(&header, 0)?;
            let all = self.first(length.saturating_add(width))?;
            return Ok(slice(&all, width, length)?.to_vec());
        }
        let header = self.first(width)?;
        let blocks = encoding.number(&header, 0)?;
        if blocks == 0 {
            return Ok(Vec::new());
        }
        let header_length = blocks.saturating_add(3).saturating_mul(width);
        let header = self.first(header_length)?;
        let block_length = encoding.number(&header, 1)?;
        let last_length = encoding.number(&header, 2)?;
        // `first` has seen that a number is there for each block.
        let sizes: Result<Vec<u64>, Problem> =
            (0..blocks).map(|block| encoding.number(&header, 3 + block)).collect();
        let sizes = sizes?;
        let total = sizes.iter().fold(header_length, |sum, &size| sum.saturating_add(size));
        let all = self.first(total)?;
        let mut start = header_length;
        let mut array = Vec::new();
        for (block, &size) in (0..blocks).zip(&sizes) {
            let packed = slice(&all, start, size)?;
            let length =
                if block + 1 == blocks && last_length != 0 { last_length } else { block_length };
            let before = array.len() as u64;
            match encoding.compressor {
                Compressor::None => array.extend_from_slice(packed),
                Compressor::Zlib => {
                    flate2::read::ZlibDecoder::new(packed)
                        .take(length)
                        .read_to_end(&mut array)
                        .map_err(|error| {
                            Problem::unexpected(
                                error.to_string().as_bytes(),
                                "zlib-compressed data",
                            )
                        })?;
                }
                Compressor::Lz4 => {
                    // No byte of LZ4 stands for more than 255 bytes.
                    let length = usize::try_from(length)
                        .ok()
                        .filter(|&length| length / 255 <= packed.len())
                        .ok_or_else(|| short_block(packed.len() as u64, length))?;
                    let plain = lz4_flex::block::decompress(packed, length).map_err(|error| {
                        Problem::unexpected(error.to_string().as_bytes(), "LZ4-compressed data")
                    })?;
                    array.extend_from_slice(&plain);
                }
            }
            if array.len() as u64 - before != length {
                return Err(short_block(array.len() as u64 - before, length));
            }
            start += size;
        }
        Ok(array)
    }
}

impl Encoding {
    fn number(&self, header: &[u8], index: u64) -> Result<u64, Problem> {
        let width = self.header_width as u64;
        let bytes = slice(header, index.saturating_mul(width), width)?;
        let push = |number: u64, &byte: &u8| (number << 8) | u64::from(byte);
        Ok(if self.big_endian {
            bytes.iter().fold(0, push)
        } else {
            bytes.iter().rev().fold(0, push)
        })
    }
}

fn short_block(found: u64, expected: u64) -> Problem {
    Problem::Count { what: "bytes of a compressed block".into(), found, expected }
}

fn slice(bytes: &[u8], start: u64, length: u64) -> Result<&[u8], Problem> {
    let range = usize::try_from(start).ok().zip(usize::try_from(start.saturating_add(length)).ok());
    range.and_then(|(start, end)| bytes.get(start..end)).ok_or_else(|| Problem::Truncated {
        what: "an array".into(),
        needed: start.saturating_add(length),
        left: bytes.len(),
    })
}

/// Base64 as any writer has it: bits that no byte needs are not looked at.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_allow_trailing_bits(true),
);

/// Decodes base64 until there are at least `count` bytes or the text ends. Padding may end any
/// group of four characters: writers encode the header of an array apart from its blocks.
fn decode_base64(text: &[u8], count: u64) -> Result<Vec<u8>, Problem> {
    let mut text = text.iter().copied().filter(|character| !character.is_ascii_whitespace());
    let mut bytes = Vec::new();
    loop {
        // No more than is wanted, and up to padding, behind which another text begins.
        let wanted = count.saturating_sub(bytes.len() as u64).div_ceil(3);
        let mut part = Vec::new();
        while (part.len() as u64) < wanted.saturating_mul(4)
            && !(part.len() % 4 == 0 && part.last() == Some(&b'='))
        {
            let Some(character) = text.next() else { break };
            part.push(character);
        }
        if part.is_empty() {
            return Ok(bytes);
        }
        // Characters that begin a group and do not fill it are no bytes.
        part.truncate(part.len() / 4 * 4);
        BASE64.decode_vec(&part, &mut bytes).map_err(|error| match error {
            DecodeError::InvalidByte(at, _) if part[at] != b'=' && !part[..at].contains(&b'=') => {
                Problem::unexpected(&part[at..=at], "base64")
            }
            _ => Problem::unexpected(b"=", "base64 padding at the end of a group"),
        })?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_decoded_across_padding() {
        assert_eq!(decode_base64(b"Zg==Zm8=Zm9v", 100).unwrap(), b"ffofoo");
        assert_eq!(decode_base64(b" Z g\n==", 1).unwrap(), b"f");
        assert!(decode_base64(b"Z=g=", 9).is_err());
        assert!(decode_base64(b"Zm9*", 9).is_err());
    }

    #[test]
    fn announced_lengths_are_not_believed() {
        let plain = Encoding { big_endian: false, header_width: 8, compressor: Compressor::None };
        assert!(Wrapped::Raw(&[0xff; 20]).unwrap_array(&plain).is_err());
        for compressor in [Compressor::Zlib, Compressor::Lz4] {
            let packed = Encoding { compressor, ..plain };
            assert!(Wrapped::Raw(&[0xff; 60]).unwrap_array(&packed).is_err());
            assert!(
                Wrapped::Raw(&[1, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff]).unwrap_array(&packed).is_err()
            );
        }
    }
}
