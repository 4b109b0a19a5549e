//! Copying, borrowing, updating and compacting whole trees.

use std::sync::Arc;

use crate::datatype::{Datatype, Kind};
use crate::error::{Error, Result};
use crate::memory::{Block, Memory};
use crate::node::{DEEPEST, Node};

impl Node {
    /// A copy of the whole tree that owns its data, each leaf compact and in a block of its own.
    ///
    /// # Errors
    /// A leaf describes data that is not there, or there is not so much memory.
    pub fn copy(&self) -> Result<Node> {
        let mut copy = Node::new();
        self.copy_into(&mut copy)?;
        Ok(copy)
    }

    fn copy_into(&self, copy: &mut Node) -> Result<()> {
        match self.kind() {
            Kind::Empty => {}
            Kind::Object => {
                copy.become_tree(Kind::Object);
                for (name, child) in self.children() {
                    child.copy_into(copy.child_named(name)?)?;
                }
            }
            Kind::List => {
                copy.become_tree(Kind::List);
                for (_, child) in self.children() {
                    child.copy_into(copy.append()?)?;
                }
            }
            kind if self.data().is_null() => {
                // One element at a null address is how an array is said to be absent.
                copy.borrow_elements(kind, std::ptr::null_mut(), *self.datatype())?;
            }
            kind => {
                copy.make_room(Datatype::compact(kind, self.datatype().elements))?;
                copy.write_from(self)?;
            }
        }
        Ok(())
    }

    /// A tree of the same shape whose leaves borrow the data of this one's.
    ///
    /// # Errors
    /// None that a sound tree could cause.
    pub fn mirror(&self) -> Result<Node> {
        let mut mirror = Node::new();
        self.mirror_into(&mut mirror)?;
        Ok(mirror)
    }

    fn mirror_into(&self, mirror: &mut Node) -> Result<()> {
        match self.kind() {
            Kind::Empty => mirror.reset(),
            Kind::Object => {
                mirror.reset();
                mirror.become_tree(Kind::Object);
                for (name, child) in self.children() {
                    child.mirror_into(mirror.child_named(name)?)?;
                }
            }
            Kind::List => {
                mirror.reset();
                mirror.become_tree(Kind::List);
                for (_, child) in self.children() {
                    child.mirror_into(mirror.append()?)?;
                }
            }
            _ => mirror.replace(Node::over(self.data(), *self.datatype())),
        }
        Ok(())
    }

    /// Takes over a tree that was built apart.
    ///
    /// # Errors
    /// It would reach deeper than [`DEEPEST`].
    pub fn take(&mut self, tree: Node) -> Result<()> {
        let (above, below) = (self.depth(), tree.height());
        if above + below > DEEPEST {
            return Err(Error::new(format!(
                "{below} levels below {} would be deeper than {DEEPEST}",
                self.place()
            )));
        }
        self.replace(tree);
        Ok(())
    }

    /// Adds what `other` holds: numbers are written over in place where they fit, what is only here stays.
    ///
    /// # Errors
    /// As [`Node::copy`].
    pub fn update(&mut self, other: &Node) -> Result<()> {
        match other.kind() {
            Kind::Empty => Ok(()),
            Kind::Object => {
                self.become_tree(Kind::Object);
                other.children().try_for_each(|(name, child)| self.child_named(name)?.update(child))
            }
            Kind::List => {
                self.become_tree(Kind::List);
                for (index, (_, child)) in other.children().enumerate() {
                    match self.child_mut(index) {
                        Some(here) => here.update(child)?,
                        None => self.append()?.update(child)?,
                    }
                }
                Ok(())
            }
            _ if self.datatype.compatible(&other.datatype) && !self.data().is_null() => {
                self.write_from(other)
            }
            _ => self.take(other.copy()?),
        }
    }

    /// As [`Node::update`], but only what is here already and has room changes.
    ///
    /// # Errors
    /// A leaf describes data that is not there.
    pub fn update_compatible(&mut self, other: &Node) -> Result<()> {
        match (self.kind(), other.kind()) {
            (Kind::Object, Kind::Object) => {
                for index in 0..self.count() {
                    let name = self.name_of(index).to_owned();
                    if let (Some(here), Some(child)) = (self.child_mut(index), other.get(&name)) {
                        here.update_compatible(child)?;
                    }
                }
                Ok(())
            }
            (Kind::List, Kind::List) => {
                for (index, (_, child)) in other.children().enumerate() {
                    if let Some(here) = self.child_mut(index) {
                        here.update_compatible(child)?;
                    }
                }
                Ok(())
            }
            (kind, _) if kind.is_leaf() && self.datatype.compatible(&other.datatype) => {
                self.write_from(other)
            }
            _ => Ok(()),
        }
    }

    /// As [`Node::update`], but the leaves of `other` are borrowed.
    ///
    /// # Errors
    /// The tree would be deeper than [`DEEPEST`].
    pub fn update_external(&mut self, other: &Node) -> Result<()> {
        match other.kind() {
            Kind::Empty => Ok(()),
            Kind::Object => {
                self.become_tree(Kind::Object);
                other
                    .children()
                    .try_for_each(|(name, child)| self.child_named(name)?.update_external(child))
            }
            Kind::List => {
                self.become_tree(Kind::List);
                for (index, (_, child)) in other.children().enumerate() {
                    match self.child_mut(index) {
                        Some(here) => here.update_external(child)?,
                        None => self.append()?.update_external(child)?,
                    }
                }
                Ok(())
            }
            _ => self.take(other.mirror()?),
        }
    }

    /// A copy of the whole tree in one block without gaps.
    ///
    /// # Errors
    /// As [`Node::copy`].
    pub fn compacted(&self) -> Result<Node> {
        let block = Block::new(self.compact_bytes())?;
        let mut copy = Node::new();
        let mut used = 0;
        self.compact_into(&mut copy, &block, &mut used)?;
        if self.kind() != Kind::Empty {
            copy.memory = Memory::Owned(block);
        }
        Ok(copy)
    }

    fn compact_into(&self, copy: &mut Node, block: &Arc<Block>, used: &mut i64) -> Result<()> {
        match self.kind() {
            Kind::Empty => {}
            Kind::Object => {
                copy.become_tree(Kind::Object);
                for (name, child) in self.children() {
                    child.compact_into(copy.child_named(name)?, block, used)?;
                }
            }
            Kind::List => {
                copy.become_tree(Kind::List);
                for (_, child) in self.children() {
                    child.compact_into(copy.append()?, block, used)?;
                }
            }
            kind => {
                let datatype =
                    Datatype { offset: *used, ..Datatype::compact(kind, self.datatype().elements) };
                copy.within(datatype, Arc::clone(block));
                copy.write_from(self)?;
                *used += datatype.compact_bytes();
            }
        }
        Ok(())
    }

    /// Bytes of all elements without gaps.
    #[must_use]
    pub fn compact_bytes(&self) -> i64 {
        if self.kind().is_leaf() {
            return self.datatype.compact_bytes();
        }
        self.children().fold(0, |sum, (_, child)| child.compact_bytes().saturating_add(sum))
    }

    /// Bytes from the first to the last element of each leaf.
    #[must_use]
    pub fn strided_bytes(&self) -> i64 {
        if self.kind().is_leaf() {
            return self.datatype.strided_bytes();
        }
        self.children().fold(0, |sum, (_, child)| child.strided_bytes().saturating_add(sum))
    }

    /// Bytes that the tree has allocated itself.
    #[must_use]
    pub fn allocated_bytes(&self) -> i64 {
        let own = if let Memory::Owned(block) = &self.memory {
            i64::try_from(block.len()).unwrap_or(i64::MAX)
        } else {
            0
        };
        self.children().fold(own, |sum, (_, child)| child.allocated_bytes().saturating_add(sum))
    }

    /// Whether no leaf has gaps.
    #[must_use]
    pub fn is_compact(&self) -> bool {
        self.datatype.is_compact() && self.children().all(|(_, child)| child.is_compact())
    }

    /// Whether each leaf begins where the one before it ends, the first at `start`, or anywhere if that is null. Gives the end.
    #[must_use]
    pub fn contiguous_from(&self, start: *const u8) -> Option<*const u8> {
        if self.kind().is_leaf() {
            let here = self.element(0).cast_const();
            if here.is_null() || (!start.is_null() && here != start) {
                return None;
            }
            return Some(
                here.wrapping_offset(isize::try_from(self.datatype.strided_bytes()).ok()?),
            );
        }
        self.children().try_fold(start, |end, (_, child)| child.contiguous_from(end))
    }
}
