//! What a verification found: a tree of `valid`, `errors`, `info` and counts that follows the tree that was verified.

use crate::datatype::Kind;
use crate::error::Result;
use crate::node::Node;

/// The findings about one node and those below it.
#[derive(Debug, Default)]
pub struct Report {
    protocol: String,
    errors: Vec<String>,
    remarks: Vec<String>,
    counts: Vec<(&'static str, i64)>,
    below: Vec<(String, Report)>,
}

impl Report {
    /// No findings yet; the protocol begins each message.
    #[must_use]
    pub fn new(protocol: &str) -> Self {
        Self { protocol: protocol.to_owned(), ..Self::default() }
    }

    /// Whether nothing is wrong, here and below.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        self.errors.is_empty() && self.below.iter().all(|(_, report)| report.is_valid())
    }

    /// Notes that something about a node is wrong.
    pub fn wrong(&mut self, node: &Node, what: &str) {
        self.errors.push(format!("{}: {}: {what}", self.protocol, node.place()));
    }

    /// Notes something that is allowed but worth knowing.
    pub fn remark(&mut self, what: &str) {
        self.remarks.push(what.to_owned());
    }

    /// Notes how many of something there are.
    pub fn count(&mut self, name: &'static str, count: i64) {
        self.counts.push((name, count));
    }

    /// The report on what is below a name.
    pub fn below(&mut self, name: &str, protocol: &str) -> &mut Report {
        let index = self.below.iter().position(|(known, _)| known == name).unwrap_or_else(|| {
            self.below.push((name.to_owned(), Report::new(protocol)));
            self.below.len() - 1
        });
        &mut self.below[index].1
    }

    /// The child of a name, if it is there; else that is wrong.
    pub fn needed<'a>(&mut self, node: &'a Node, name: &str) -> Option<&'a Node> {
        let found = node.get(name);
        if found.is_none() {
            let names: Vec<_> = node.children().take(8).map(|(name, _)| name).collect();
            let has = match node.kind() {
                Kind::Object => format!("it has [{}]", names.join(", ")),
                kind => format!("it holds {}", kind.name()),
            };
            self.wrong(node, &format!("'{name}' is missing; {has}"));
        }
        found
    }

    /// The child of a name, which must be an object with children.
    pub fn object<'a>(&mut self, node: &'a Node, name: &str) -> Option<&'a Node> {
        let found = self.needed(node, name)?;
        if found.kind() == Kind::Object && found.count() > 0 {
            return Some(found);
        }
        self.wrong(
            found,
            &format!("an object with children is expected, not {}", described(found)),
        );
        None
    }

    /// The child of a name, which must be a text.
    pub fn text(&mut self, node: &Node, name: &str) -> Option<String> {
        let found = self.needed(node, name)?;
        let text = found.text();
        if text.is_none() {
            self.wrong(found, &format!("a text is expected, not {}", described(found)));
        }
        text
    }

    /// The child of a name, which must be one of some texts.
    pub fn one_of(&mut self, node: &Node, name: &str, allowed: &[&str]) -> Option<String> {
        let text = self.text(node, name)?;
        if allowed.contains(&text.as_str()) {
            return Some(text);
        }
        let found = node.get(name).unwrap_or(node);
        self.wrong(found, &format!("'{text}' is none of {}", allowed.join(", ")));
        None
    }

    /// The child of a name, which must be an array of integers.
    pub fn integers<'a>(&mut self, node: &'a Node, name: &str) -> Option<&'a Node> {
        let found = self.needed(node, name)?;
        if found.kind().is_integer() {
            return Some(found);
        }
        self.wrong(found, &format!("integers are expected, not {}", described(found)));
        None
    }

    /// The child of a name, which must be numbers.
    pub fn numbers<'a>(&mut self, node: &'a Node, name: &str) -> Option<&'a Node> {
        let found = self.needed(node, name)?;
        if found.kind().is_number() {
            return Some(found);
        }
        self.wrong(found, &format!("numbers are expected, not {}", described(found)));
        None
    }

    /// The findings as a tree.
    ///
    /// # Errors
    /// There is no memory.
    pub fn into_node(self) -> Result<Node> {
        let mut node = Node::new();
        self.write(&mut node)?;
        Ok(node)
    }

    fn write(&self, node: &mut Node) -> Result<()> {
        for (name, report) in &self.below {
            report.write(node.child_named(name)?)?;
        }
        for (name, texts) in [("errors", &self.errors), ("info", &self.remarks)] {
            for text in texts {
                node.child_named(name)?.append()?.set_text(text)?;
            }
        }
        for (name, count) in &self.counts {
            node.child_named(name)?.set_number(*count)?;
        }
        node.child_named("valid")?.set_text(if self.is_valid() { "true" } else { "false" })
    }
}

/// What a node holds, for messages.
#[must_use]
pub fn described(node: &Node) -> String {
    match node.kind() {
        Kind::Text => format!("the text '{}'", node.text().unwrap_or_default()),
        Kind::Empty => "nothing".to_owned(),
        Kind::Object => format!("an object of {}", node.count()),
        Kind::List => format!("a list of {}", node.count()),
        kind => format!("{} {}", node.datatype().elements, kind.name()),
    }
}
