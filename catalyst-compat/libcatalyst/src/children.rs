//! The children of a node in their order, found by name without looking at each where there are many.

use std::collections::HashMap;
use std::ptr::NonNull;

/// Of so many children each is looked at.
const FEW: usize = 16;

/// A child: its name, which is empty in a list, and the node.
pub struct Child<N> {
    /// The name.
    pub name: String,
    /// The node, which whoever has the child owns.
    pub node: NonNull<N>,
}

/// Children in order.
#[derive(Default)]
pub struct Children<N> {
    list: Vec<Child<N>>,
    /// The number of each name, as soon as there are many.
    numbers: Option<HashMap<String, usize>>,
}

impl<N> Children<N> {
    /// The children in order.
    #[must_use]
    pub fn list(&self) -> &[Child<N>] {
        &self.list
    }

    /// The children alone.
    #[must_use]
    pub fn into_list(self) -> Vec<Child<N>> {
        self.list
    }

    /// The number of the first child of a name.
    #[must_use]
    pub fn position(&self, name: &str) -> Option<usize> {
        match &self.numbers {
            Some(numbers) => numbers.get(name).copied(),
            None => self.list.iter().position(|child| child.name == name),
        }
    }

    /// Appends a child.
    pub fn push(&mut self, child: Child<N>) {
        let number = self.list.len();
        if let Some(numbers) = &mut self.numbers {
            numbers.entry(child.name.clone()).or_insert(number);
        }
        self.list.push(child);
        if self.numbers.is_none() {
            self.number();
        }
    }

    /// Takes out a child; those behind it move up.
    pub fn remove(&mut self, index: usize) -> Option<Child<N>> {
        if index >= self.list.len() {
            return None;
        }
        let child = self.list.remove(index);
        self.number();
        Some(child)
    }

    /// Gives a child another name.
    pub fn rename(&mut self, index: usize, name: &str) {
        if let Some(child) = self.list.get_mut(index) {
            name.clone_into(&mut child.name);
            self.number();
        }
    }

    fn number(&mut self) {
        self.numbers = (self.list.len() > FEW).then(|| {
            let mut numbers = HashMap::with_capacity(2 * self.list.len());
            for (number, child) in self.list.iter().enumerate() {
                numbers.entry(child.name.clone()).or_insert(number);
            }
            numbers
        });
    }
}
