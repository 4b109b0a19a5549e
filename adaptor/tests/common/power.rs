//! A disk that keeps only what was synced when the power goes.
//!
//! `fdatasync` of the test's program stands before that of the system, and takes note of how long the
//! file was when it was called. What was written behind that may be lost; a test loses it by cutting
//! the file there. A call takes a while, so that who does not wait for it is found out.

use std::{
    collections::HashMap,
    ffi::c_int,
    fs::{File, Metadata},
    mem::ManuallyDrop,
    os::{fd::FromRawFd, unix::fs::MetadataExt},
    path::Path,
    sync::Mutex,
    time::Duration,
};

/// A slow disk's time for a call.
const TIME: Duration = Duration::from_millis(2);

/// How many bytes of which file were synced, by device and number.
static SYNCED: Mutex<Option<HashMap<(u64, u64), u64>>> = Mutex::new(None);

fn number(file: &Metadata) -> (u64, u64) {
    (file.dev(), file.ino())
}

#[unsafe(no_mangle)]
extern "C" fn fdatasync(descriptor: c_int) -> c_int {
    // SAFETY: the caller's descriptor is open during the call, and is not closed here.
    let file = ManuallyDrop::new(unsafe { File::from_raw_fd(descriptor) });
    let before = file.metadata();
    std::thread::sleep(TIME);
    // SAFETY: the system's own call, with the caller's descriptor.
    let result = unsafe { libc::syscall(libc::SYS_fdatasync, descriptor) };
    if let (0, Ok(before)) = (result, before) {
        let mut synced = SYNCED.lock().unwrap();
        synced.get_or_insert_default().insert(number(&before), before.len());
    }
    if result == 0 { 0 } else { -1 }
}

/// A file as a disk has it whose power goes now.
pub struct OnDisk {
    /// All that was written.
    pub text: String,
    /// The bytes of it that were synced, and that no loss of power takes.
    pub synced: usize,
}

impl OnDisk {
    /// The file as it is now.
    pub fn of(file: &Path) -> Self {
        let known = number(&std::fs::metadata(file).unwrap());
        let synced = SYNCED.lock().unwrap().get_or_insert_default().get(&known).copied();
        let text = std::fs::read_to_string(file).unwrap();
        let synced = usize::try_from(synced.unwrap_or(0)).unwrap().min(text.len());
        Self { text, synced }
    }
}
