//! The node: a tree of objects and lists whose leaves are arrays, owned or borrowed.
//!
//! Nodes live on the heap and stay where they are until they are removed, so that the addresses which the C interface hands out
//! hold. A node knows its parent by address: each way to a child first tells the children where the node is now.

use std::cell::Cell;
use std::ptr::{self, NonNull};
use std::sync::Arc;

use crate::children::{Child, Children};
use crate::datatype::{Datatype, Kind};
use crate::error::{Error, Result};
use crate::memory::{Block, Memory};

/// How deep a tree may be; deeper ones are refused, so that walking a tree cannot overflow the stack.
pub const DEEPEST: usize = 1000;

/// One node of a tree.
pub struct Node {
    parent: Cell<*const Node>,
    pub(crate) datatype: Datatype,
    pub(crate) memory: Memory,
    children: Children<Node>,
}

impl Default for Node {
    fn default() -> Self {
        Self::new()
    }
}

impl Node {
    /// An empty node without a parent.
    #[must_use]
    pub fn new() -> Self {
        Self {
            parent: Cell::new(ptr::null()),
            datatype: Datatype::EMPTY,
            memory: Memory::Nothing,
            children: Children::default(),
        }
    }

    /// Whether no other node owns this one.
    #[must_use]
    pub fn is_root(&self) -> bool {
        self.parent.get().is_null()
    }

    /// The node that owns this one; null for a root.
    #[must_use]
    pub fn parent(&self) -> *const Node {
        self.parent.get()
    }

    /// Type and layout.
    #[must_use]
    pub fn datatype(&self) -> &Datatype {
        &self.datatype
    }

    /// The type.
    #[must_use]
    pub fn kind(&self) -> Kind {
        self.datatype.kind
    }

    /// How many children there are; 0 for a leaf.
    #[must_use]
    pub fn count(&self) -> usize {
        self.children.list().len()
    }

    /// The child of a number.
    #[must_use]
    pub fn child(&self, index: usize) -> Option<&Node> {
        self.settle();
        // SAFETY: children are owned by this node and live as long as it; the borrow of `self` keeps them from being changed.
        self.children.list().get(index).map(|child| unsafe { child.node.as_ref() })
    }

    /// The child of a number, to change it.
    pub fn child_mut(&mut self, index: usize) -> Option<&mut Node> {
        self.settle();
        // SAFETY: as in `child`; the unique borrow of `self` makes this one unique.
        self.children.list().get(index).map(|child| unsafe { &mut *child.node.as_ptr() })
    }

    /// The name of the child of a number; empty in a list.
    #[must_use]
    pub fn name_of(&self, index: usize) -> &str {
        self.children.list().get(index).map_or("", |child| &child.name)
    }

    /// The children with their names, which are empty in a list.
    pub fn children(&self) -> impl Iterator<Item = (&str, &Node)> {
        self.settle();
        // SAFETY: as in `child`.
        self.children
            .list()
            .iter()
            .map(|child| (child.name.as_str(), unsafe { child.node.as_ref() }))
    }

    fn position(&self, name: &str) -> Option<usize> {
        if self.kind() == Kind::Object { self.children.position(name) } else { None }
    }

    /// The child of a name, which may hold slashes.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Node> {
        self.child(self.position(name)?)
    }

    /// The child of a name, made if it is not there. A node that is no object becomes an empty one first.
    ///
    /// # Errors
    /// The tree would be deeper than [`DEEPEST`].
    pub fn child_named(&mut self, name: &str) -> Result<&mut Node> {
        self.become_tree(Kind::Object);
        let index = match self.position(name) {
            Some(index) => index,
            None => self.push(name)?,
        };
        self.child_mut(index).ok_or_else(|| Error::new("a child that was just made is not there"))
    }

    /// A new child at the end of the list. A node that is no list becomes an empty one first.
    ///
    /// # Errors
    /// The tree would be deeper than [`DEEPEST`].
    pub fn append(&mut self) -> Result<&mut Node> {
        self.become_tree(Kind::List);
        let index = self.push("")?;
        self.child_mut(index).ok_or_else(|| Error::new("a child that was just made is not there"))
    }

    fn push(&mut self, name: &str) -> Result<usize> {
        if self.depth() >= DEEPEST {
            return Err(Error::new(format!("'{name}' would lie deeper than {DEEPEST} levels")));
        }
        self.settle();
        let node = Node::new();
        node.parent.set(ptr::from_ref(self));
        let node = NonNull::from(Box::leak(Box::new(node)));
        self.children.push(Child { name: name.to_owned(), node });
        Ok(self.count() - 1)
    }

    /// Makes this an object or a list; what it held is let go unless it is one already.
    pub fn become_tree(&mut self, kind: Kind) {
        if self.kind() != kind {
            self.reset();
            self.datatype = Datatype { kind, ..Datatype::EMPTY };
        }
    }

    /// Lets go of everything: the node is empty afterwards.
    pub fn reset(&mut self) {
        self.release_children();
        self.memory = Memory::Nothing;
        self.datatype = Datatype::EMPTY;
    }

    fn release_children(&mut self) {
        let mut left = std::mem::take(&mut self.children).into_list();
        while let Some(child) = left.pop() {
            // SAFETY: the pointer came from `Box::leak` in `push` and was taken out of the only list that holds it.
            let mut node = unsafe { Box::from_raw(child.node.as_ptr()) };
            left.append(&mut std::mem::take(&mut node.children).into_list());
        }
    }

    /// How many nodes own this one, directly or not.
    #[must_use]
    pub fn depth(&self) -> usize {
        let mut depth = 0;
        let mut above = self.parent.get();
        // SAFETY: a parent lives as long as its children; only addresses and the field `parent` are read.
        while let Some(node) = unsafe { above.as_ref() } {
            depth += 1;
            above = node.parent.get();
        }
        depth
    }

    /// How many levels lie below this node.
    #[must_use]
    pub fn height(&self) -> usize {
        self.children().map(|(_, child)| child.height() + 1).max().unwrap_or(0)
    }

    /// Whether this node is `other` or owns it, directly or not.
    #[must_use]
    pub fn holds(&self, other: &Node) -> bool {
        let mut above = ptr::from_ref(other);
        // SAFETY: as in `depth`.
        while let Some(node) = unsafe { above.as_ref() } {
            if ptr::eq(node, self) {
                return true;
            }
            above = node.parent.get();
        }
        false
    }

    /// The node's name in its parent: `[3]` in a list, `{a/b}` for one with a slash in it, which is no path; empty for a root.
    #[must_use]
    pub fn name(&self) -> String {
        // SAFETY: as in `depth`.
        let Some(parent) = (unsafe { self.parent.get().as_ref() }) else {
            return String::new();
        };
        let Some(index) =
            parent.children.list().iter().position(|child| ptr::eq(child.node.as_ptr(), self))
        else {
            return String::new();
        };
        match parent.name_of(index) {
            _ if parent.kind() == Kind::List => format!("[{index}]"),
            name if name.contains('/') => format!("{{{name}}}"),
            name => name.to_owned(),
        }
    }

    /// The names from the root to this node, joined by slashes; empty for a root.
    #[must_use]
    pub fn path(&self) -> String {
        let mut names = Vec::new();
        let mut node = self;
        // SAFETY: as in `depth`.
        while let Some(parent) = unsafe { node.parent.get().as_ref() } {
            names.push(node.name());
            node = parent;
        }
        names.reverse();
        names.join("/")
    }

    /// The path, for messages.
    #[must_use]
    pub fn place(&self) -> String {
        let path = self.path();
        if path.is_empty() { "the node".to_owned() } else { format!("'{path}'") }
    }

    /// The node at a path, if it is there. `..` is the parent, empty names are skipped, `[3]` is a child of a list.
    #[must_use]
    pub fn find(&self, path: &str) -> Option<&Node> {
        let mut node = self;
        let mut any = false;
        for name in path.split('/').filter(|name| !name.is_empty()) {
            any = true;
            node = match (name, node.kind()) {
                // SAFETY: as in `depth`.
                ("..", _) => unsafe { node.parent.get().as_ref() }?,
                (_, Kind::List) => node.child(list_index(name)?)?,
                _ => node.get(name)?,
            };
        }
        any.then_some(node)
    }

    /// As [`Node::find`], but says what is missing.
    ///
    /// # Errors
    /// The path is empty, or names what is not there.
    #[track_caller]
    pub fn existing(&self, path: &str) -> Result<&Node> {
        match self.find(path) {
            Some(node) => Ok(node),
            None => Err(Error::new(self.why_not(path))),
        }
    }

    fn why_not(&self, path: &str) -> String {
        let mut node = self;
        for name in path.split('/').filter(|name| !name.is_empty()) {
            match node.find(name) {
                Some(next) => node = next,
                None if name == ".." => return format!("'{path}' goes above the root"),
                None => {
                    let names: Vec<_> = node.children().take(12).map(|(name, _)| name).collect();
                    let has = match node.kind() {
                        Kind::Object => format!("has the children [{}]", names.join(", ")),
                        Kind::List => format!("is a list of {}", node.count()),
                        kind => format!("holds {}", kind.name()),
                    };
                    return format!("'{path}' is not there: {} {has}, not '{name}'", node.place());
                }
            }
        }
        "an empty path names no node".to_owned()
    }

    /// The node at a path, made if it is not there.
    ///
    /// # Errors
    /// The path is empty, goes above the root, or would be deeper than [`DEEPEST`].
    pub fn fetch(&mut self, path: &str) -> Result<*mut Node> {
        let mut node: *mut Node = self;
        let mut any = false;
        for name in path.split('/').filter(|name| !name.is_empty()) {
            any = true;
            // SAFETY: `node` is `self` or a node reached from it, live, and no other borrow of it is held in this loop.
            let here = unsafe { &mut *node };
            here.settle();
            node = if name == ".." {
                if here.parent.get().is_null() {
                    return Err(Error::new(format!("'{path}' goes above the root")));
                }
                here.parent.get().cast_mut()
            } else {
                let listed = if here.kind() == Kind::List {
                    list_index(name).filter(|index| *index < here.count())
                } else {
                    None
                };
                match listed.and_then(|index| here.children.list().get(index)) {
                    Some(child) => child.node.as_ptr(),
                    None => here.child_named(name)?,
                }
            };
        }
        if any { Ok(node) } else { Err(Error::new("an empty path names no node")) }
    }

    /// As [`Node::fetch`], for paths that stay below this node.
    ///
    /// # Errors
    /// As [`Node::fetch`].
    pub fn at(&mut self, path: &str) -> Result<&mut Node> {
        if path.split('/').any(|name| name == "..") {
            return Err(Error::new(format!("'{path}' leaves {}", self.place())));
        }
        let node = self.fetch(path)?;
        // SAFETY: `fetch` returned a live node below `self`, which the unique borrow of `self` covers.
        Ok(unsafe { &mut *node })
    }

    /// Removes the child of a number.
    ///
    /// # Errors
    /// There is no such child.
    pub fn remove(&mut self, index: usize) -> Result<()> {
        let Some(child) = self.children.remove(index) else {
            return Err(Error::new(format!(
                "{} has {} children, none of number {index}",
                self.place(),
                self.count()
            )));
        };
        // SAFETY: as in `release_children`.
        drop(unsafe { Box::from_raw(child.node.as_ptr()) });
        Ok(())
    }

    /// Removes the child of a name, which may hold slashes.
    ///
    /// # Errors
    /// There is no such child.
    pub fn remove_named(&mut self, name: &str) -> Result<()> {
        match self.position(name) {
            Some(index) => self.remove(index),
            None => Err(Error::new(self.why_not(name))),
        }
    }

    /// Removes the node at a path.
    ///
    /// # Errors
    /// There is none, or it is this node or above it.
    pub fn remove_path(&mut self, path: &str) -> Result<()> {
        let found = self.existing(path)?;
        if found.holds(self) {
            return Err(Error::new(format!("'{path}' would remove the node that it starts from")));
        }
        let (found, owner) = (ptr::from_ref(found), found.parent.get().cast_mut());
        // SAFETY: the owner of a node that is there lives; `found` was only borrowed to be looked up.
        let Some(owner) = (unsafe { owner.as_mut() }) else {
            return Err(Error::new(format!("'{path}' is a root")));
        };
        match owner.children.list().iter().position(|child| ptr::eq(child.node.as_ptr(), found)) {
            Some(index) => owner.remove(index),
            None => Err(Error::new(format!("'{path}' is not there"))),
        }
    }

    /// Gives a child another name.
    ///
    /// # Errors
    /// This is no object, the child is not there, or the new name is taken.
    pub fn rename(&mut self, old: &str, new: &str) -> Result<()> {
        if self.kind() != Kind::Object {
            let message = format!(
                "{} holds {}; only an object's children have names",
                self.place(),
                self.kind().name()
            );
            return Err(Error::new(message));
        }
        if self.position(new).is_some() {
            return Err(Error::new(format!("{} has a child '{new}' already", self.place())));
        }
        match self.position(old) {
            Some(index) => {
                self.children.rename(index, new);
                Ok(())
            }
            None => Err(Error::new(self.why_not(old))),
        }
    }

    /// Tells the children where their parent is, if this node has been moved since they were told.
    fn settle(&self) {
        let here = ptr::from_ref(self);
        // SAFETY: children are owned by this node and live; only their cells are written.
        let told = |child: &Child<Node>| unsafe { child.node.as_ref() }.parent.get();
        if self.children.list().first().is_some_and(|first| !ptr::eq(told(first), here)) {
            for child in self.children.list() {
                // SAFETY: as above.
                unsafe { child.node.as_ref() }.parent.set(here);
            }
        }
    }

    /// Exchanges the contents of two nodes; each keeps its name and place.
    ///
    /// # Errors
    /// One holds the other.
    pub fn swap(&mut self, other: &mut Node) {
        std::mem::swap(&mut self.datatype, &mut other.datatype);
        std::mem::swap(&mut self.memory, &mut other.memory);
        std::mem::swap(&mut self.children, &mut other.children);
        self.settle();
        other.settle();
    }

    /// Takes over the contents of a node that is given away.
    pub fn replace(&mut self, mut other: Node) {
        self.swap(&mut other);
    }

    /// A leaf over a part of a block that others may share.
    pub(crate) fn within(&mut self, datatype: Datatype, block: Arc<Block>) {
        self.reset();
        self.memory = Memory::Within(block);
        self.datatype = datatype;
    }
}

fn list_index(name: &str) -> Option<usize> {
    name.strip_prefix('[')?.strip_suffix(']')?.parse().ok()
}

impl Drop for Node {
    fn drop(&mut self) {
        self.release_children();
    }
}
