//! Inputs that are kept: each had an outcome that none before it had.
//!
//! Those of a target lie in one file, `corpus/TARGET.zst`: behind each other, each behind its length in
//! four bytes, little endian. They are much alike, so that together they take little.

use std::{fs, io, path::PathBuf};

use crate::target::Target;

/// Bytes of a file before it is packed, and inputs in it: every pass begins with all of them.
const MOST_BYTES: usize = 1 << 22;
const MOST_INPUTS: usize = 1000;
/// How hard it is packed.
const LEVEL: i32 = 19;

fn file(target: Target) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("corpus").join(format!("{}.zst", target.name()))
}

/// The inputs of a target; none where it has no file.
///
/// # Errors
/// Where the file cannot be read, or is no corpus.
pub(crate) fn read(target: Target) -> io::Result<Vec<Vec<u8>>> {
    let packed = match fs::read(file(target)) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        packed => packed?,
    };
    let unpacked = zstd::bulk::decompress(&packed, MOST_BYTES)?;
    let (mut rest, mut inputs) = (&unpacked[..], Vec::new());
    while let Some((length, behind)) = rest.split_first_chunk() {
        let length = u32::from_le_bytes(*length) as usize;
        let Some((input, behind)) = behind.split_at_checked(length) else {
            return Err(io::Error::other("the corpus ends in the midst of an input"));
        };
        inputs.push(input.to_vec());
        rest = behind;
    }
    Ok(inputs)
}

/// Writes the inputs of a target, the shortest first. Of more than a thousand only every second, third,
/// ... is kept, and those beyond 4 MiB are left out.
///
/// # Errors
/// Where the file cannot be written.
pub(crate) fn write(target: Target, mut inputs: Vec<Vec<u8>>) -> io::Result<()> {
    inputs.sort_by(|a, b| a.len().cmp(&b.len()).then_with(|| a.cmp(b)));
    inputs.dedup();
    let mut unpacked = Vec::new();
    for input in inputs.iter().step_by(inputs.len().div_ceil(MOST_INPUTS).max(1)) {
        let Ok(length) = u32::try_from(input.len()) else { continue };
        if unpacked.len() + 4 + input.len() > MOST_BYTES {
            break;
        }
        unpacked.extend_from_slice(&length.to_le_bytes());
        unpacked.extend_from_slice(input);
    }
    let file = file(target);
    fs::create_dir_all(file.parent().unwrap_or(&file))?;
    fs::write(file, zstd::bulk::compress(&unpacked, LEVEL)?)
}
