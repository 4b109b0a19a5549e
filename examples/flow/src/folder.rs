//! The folders that files go to.

use std::io;
use std::path::Path;

/// Makes the folder of a file, where it is missing.
///
/// # Errors
/// Where it cannot be made.
pub(crate) fn make_folder_of(file: &Path) -> io::Result<()> {
    match file.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        Some(folder) => std::fs::create_dir_all(folder),
        None => Ok(()),
    }
}
