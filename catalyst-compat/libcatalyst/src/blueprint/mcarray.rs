//! Multi-component arrays: objects or lists whose children are arrays of one length.

use crate::blueprint::report::{Report, described};
use crate::datatype::{Datatype, Kind};
use crate::error::Result;
use crate::memory::{Block, Memory};
use crate::node::Node;

/// Verifies a multi-component array.
pub fn verify(node: &Node, report: &mut Report) {
    if !matches!(node.kind(), Kind::Object | Kind::List) || node.count() == 0 {
        return report
            .wrong(node, &format!("an object of arrays is expected, not {}", described(node)));
    }
    let length = node.child(0).map_or(0, |first| first.datatype().elements);
    for (_, component) in node.children() {
        if !component.kind().is_number() {
            report.wrong(component, &format!("numbers are expected, not {}", described(component)));
        } else if component.datatype().elements != length {
            let found = component.datatype().elements;
            report.wrong(
                component,
                &format!("{found} elements, where the first component has {length}"),
            );
        }
    }
}

/// Verifies values that are either one array or several components.
pub fn verify_values(node: &Node, report: &mut Report) {
    if !node.kind().is_number() {
        verify(node, report);
    }
}

/// Whether the components lie in turn in one piece of memory, as Conduit tells it: all have one stride, and each begins where the
/// element of the component before it ends. One component alone is interleaved.
#[must_use]
pub fn is_interleaved(node: &Node) -> bool {
    let mut report = Report::new("mcarray");
    verify(node, &mut report);
    let Some(first) = node.child(0).filter(|_| report.is_valid()) else { return false };
    let mut ahead = 0_isize;
    node.children().all(|(_, component)| {
        let begins = first.element(0).wrapping_offset(ahead);
        ahead = ahead.saturating_add(
            isize::try_from(component.datatype().element_bytes).unwrap_or(isize::MAX),
        );
        component.datatype().stride == first.datatype().stride && component.element(0) == begins
    })
}

/// How components are laid out in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arrangement {
    /// One after the other.
    Contiguous,
    /// In turn.
    Interleaved,
}

/// A copy in another arrangement; components of different types are interleaved by their own sizes.
///
/// # Errors
/// A component has no data.
pub fn arranged(node: &Node, arrangement: Arrangement) -> Result<Option<Node>> {
    let mut report = Report::new("mcarray");
    verify(node, &mut report);
    if !report.is_valid() {
        return Ok(None);
    }
    if arrangement == Arrangement::Contiguous {
        return node.compacted().map(Some);
    }
    let row: i64 = node.children().map(|(_, component)| component.kind().bytes()).sum();
    let block = Block::new(node.compact_bytes())?;
    let mut copy = Node::new();
    copy.become_tree(node.kind());
    let mut offset = 0;
    for (name, component) in node.children() {
        let kind = component.kind();
        let layout = Datatype {
            offset,
            stride: row,
            ..Datatype::compact(kind, component.datatype().elements)
        };
        let target =
            if node.kind() == Kind::Object { copy.child_named(name)? } else { copy.append()? };
        target.within(layout, block.clone());
        target.write_from(component)?;
        offset += kind.bytes();
    }
    copy.memory = Memory::Owned(block);
    Ok(Some(copy))
}
