//! The memory behind a leaf.

use std::alloc::{Layout, alloc_zeroed, dealloc};
use std::ptr::{self, NonNull};
use std::sync::Arc;

use crate::error::{Error, Result};

const ALIGNMENT: usize = 16;

/// Zeroed memory of a fixed length that is aligned for every type of element.
#[derive(Debug)]
pub struct Block {
    start: NonNull<u8>,
    layout: Layout,
    bytes: usize,
}

// SAFETY: a block is plain memory; nodes hand its address out, and as with any array that C code shares it is the caller who must
// not write from two threads at once.
unsafe impl Send for Block {}
// SAFETY: as for `Send`.
unsafe impl Sync for Block {}

impl Block {
    /// A block of so many bytes.
    ///
    /// # Errors
    /// There is not so much memory.
    pub fn new(bytes: i64) -> Result<Arc<Block>> {
        let refused = || Error::new(format!("{bytes} bytes cannot be allocated"));
        let bytes = usize::try_from(bytes).map_err(|_| refused())?;
        let layout = Layout::from_size_align(bytes.max(1), ALIGNMENT).map_err(|_| refused())?;
        // SAFETY: the layout's size is at least 1.
        let start = NonNull::new(unsafe { alloc_zeroed(layout) }).ok_or_else(refused)?;
        Ok(Arc::new(Block { start, layout, bytes }))
    }

    /// The first byte.
    #[must_use]
    pub fn start(&self) -> *mut u8 {
        self.start.as_ptr()
    }

    /// How many bytes there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.bytes
    }

    /// Whether there are no bytes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bytes == 0
    }
}

impl Drop for Block {
    fn drop(&mut self) {
        // SAFETY: allocated in `new` with this layout, and freed once.
        unsafe { dealloc(self.start.as_ptr(), self.layout) }
    }
}

/// Where the elements of a leaf are.
#[derive(Debug, Clone, Default)]
pub enum Memory {
    /// Nowhere.
    #[default]
    Nothing,
    /// In a block of the node's own.
    Owned(Arc<Block>),
    /// In a block that another node of the tree accounts for.
    Within(Arc<Block>),
    /// In memory of the caller, who keeps it alive.
    Borrowed(*mut u8),
}

impl Memory {
    /// The first byte; null where there is none.
    #[must_use]
    pub fn start(&self) -> *mut u8 {
        match self {
            Memory::Nothing => ptr::null_mut(),
            Memory::Owned(block) | Memory::Within(block) => block.start(),
            Memory::Borrowed(start) => *start,
        }
    }

    /// How many bytes are known to be there; `None` where only the caller knows.
    #[must_use]
    pub fn known_length(&self) -> Option<usize> {
        match self {
            Memory::Nothing => Some(0),
            Memory::Owned(block) | Memory::Within(block) => Some(block.len()),
            Memory::Borrowed(_) => None,
        }
    }
}
