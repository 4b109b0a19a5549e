//! Asks the system whether memory can be read before it is read: a pointer to a graphics card's
//! memory, or one that was freed and unmapped, is answered with an error and not with the end of
//! the solver.

use crate::foreign::array::Array;
use crate::foreign::error::RunError;
use crate::foreign::label::Label;

/// Whether the bytes from `address` on can be read. Where the system will not say, they are taken
/// to be.
#[cfg(target_os = "linux")]
fn is_readable(address: *const u8, bytes: usize) -> bool {
    let mut copy = [0_u8; 8];
    let local = libc::iovec { iov_base: copy.as_mut_ptr().cast(), iov_len: bytes.min(copy.len()) };
    let remote =
        libc::iovec { iov_base: address.cast_mut().cast(), iov_len: bytes.min(copy.len()) };
    // SAFETY: the system copies from this process into `copy`, which is as long as is said; what
    // cannot be read is answered with EFAULT, not with a signal.
    let read = unsafe {
        libc::process_vm_readv(libc::getpid(), &raw const local, 1, &raw const remote, 1, 0)
    };
    if read >= 0 {
        return read as usize == bytes.min(8);
    }
    std::io::Error::last_os_error().raw_os_error() != Some(libc::EFAULT)
}

/// Whether the bytes from `address` on can be read, which this system is not asked.
#[cfg(not(target_os = "linux"))]
fn is_readable(_: *const u8, _: usize) -> bool {
    true
}

/// Refuses an array whose memory cannot be read: its first and last value are looked at. Errors
/// call it by its `label`.
pub(super) fn check(array: &Array<'_>, label: impl FnOnce() -> Label) -> Result<(), RunError> {
    let unreadable = |&(address, bytes): &(*const u8, usize)| !is_readable(address, bytes);
    let Some((address, _)) = array.ends().and_then(|ends| ends.into_iter().find(unreadable)) else {
        return Ok(());
    };
    Err(label().wrong(
        format_args!("{} values whose memory at {address:p} cannot be read", array.len()),
        "values in the main memory of this process, not in that of a graphics card",
    ))
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn memory_that_is_not_there_is_told() {
        let there = [0.0_f64; 4];
        assert!(is_readable(there.as_ptr().cast(), 8));
        assert!(!is_readable(std::ptr::without_provenance(4096), 8));
        // A page that may not be read, as a driver maps a card's memory.
        // SAFETY: a new mapping that nothing else uses; it is unmapped below.
        let page = unsafe {
            libc::mmap(
                std::ptr::null_mut(),
                4096,
                libc::PROT_NONE,
                libc::MAP_PRIVATE | libc::MAP_ANONYMOUS,
                -1,
                0,
            )
        };
        assert_ne!(page, libc::MAP_FAILED);
        assert!(!is_readable(page.cast(), 8));
        // SAFETY: mapped above.
        unsafe { libc::munmap(page, 4096) };
    }
}
