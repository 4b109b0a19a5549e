//! Rows of different lengths: what `connectivity`, `sizes` and `offsets` describe.

use tombolo::foreign::RunError;
use tombolo::foreign::mesh::{Label, Rows};

use crate::node::Node;

/// Reads `connectivity`, `sizes` and, where it is there, `offsets`.
pub(super) fn read<'call>(node: &Node<'_, 'call>) -> Result<Rows<'call>, RunError> {
    let connectivity = node.need(c"connectivity", "whole numbers, cell after cell")?.array()?;
    let sizes_node = node.need(c"sizes", "the number of entries of each cell")?;
    let sizes = sizes_node.array()?;
    let offsets = match node.child(c"offsets") {
        Some(offsets_node) => {
            let offsets = offsets_node.array()?;
            // Some give the end of the last row too.
            if offsets.len() != sizes.len() && offsets.len() != sizes.len() + 1 {
                return Err(
                    offsets_node.wrong(format!("{} values, as many as in 'sizes'", sizes.len()))
                );
            }
            Some(offsets)
        }
        None => None,
    };
    Ok(Rows::new(connectivity, sizes, offsets, Label::Path(node.path())))
}
