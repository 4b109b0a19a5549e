//! What the data of a tree take of memory, and whose it is.

use crate::error::Result;
use crate::memory::Memory;
use crate::node::Node;

impl Node {
    /// A report: `mem_spaces` with the `path` and `type` of each piece of memory by its address, the `bytes` of those that are
    /// the tree's own, and the totals.
    ///
    /// # Errors
    /// There is no memory for the report.
    pub fn information(&self) -> Result<Node> {
        let mut report = Node::new();
        report.at("mem_spaces")?;
        self.spaces("", &mut report)?;
        report.at("total_bytes_allocated")?.set_number(self.allocated_bytes())?;
        report.at("total_bytes_mmaped")?.set_number(0_i64)?;
        report.at("total_bytes_compact")?.set_number(self.compact_bytes())?;
        report.at("total_strided_bytes")?.set_number(self.strided_bytes())?;
        Ok(report)
    }

    fn spaces(&self, path: &str, report: &mut Node) -> Result<()> {
        let kind = match &self.memory {
            Memory::Nothing | Memory::Within(_) => None,
            Memory::Owned(block) => Some(("allocated", Some(block.len()))),
            Memory::Borrowed(_) => Some(("external", None)),
        };
        if let Some((kind, bytes)) = kind {
            let space = report.at("mem_spaces")?.child_named(&format!("{:p}", self.data()))?;
            space.at("path")?.set_text(path)?;
            space.at("type")?.set_text(kind)?;
            if let Some(bytes) = bytes {
                space.at("bytes")?.set_number(i64::try_from(bytes).unwrap_or(i64::MAX))?;
            }
        }
        for (index, (name, child)) in self.children().enumerate() {
            let name = if name.is_empty() { format!("[{index}]") } else { name.to_owned() };
            let below = if path.is_empty() { name } else { format!("{path}/{name}") };
            child.spaces(&below, report)?;
        }
        Ok(())
    }
}
