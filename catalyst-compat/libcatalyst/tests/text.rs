//! Trees that are written read back the same, and no text or file brings the readers down.

use catalyst::compare::Comparison;
use catalyst::files;
use catalyst::node::Node;
use catalyst::print::{Detail, Style};
use catalyst::schema::{self, Protocol};
use proptest::prelude::*;

/// A description of a tree, from which proptest makes smaller ones.
#[derive(Debug, Clone)]
enum Tree {
    Integers(Vec<i64>),
    Reals(Vec<f64>),
    Small(Vec<u8>),
    Text(String),
    Object(Vec<(String, Tree)>),
    List(Vec<Tree>),
}

fn tree() -> impl Strategy<Value = Tree> {
    let leaf = prop_oneof![
        prop::collection::vec(any::<i64>(), 1..5).prop_map(Tree::Integers),
        prop::collection::vec(prop::num::f64::NORMAL | prop::num::f64::ZERO, 1..5).prop_map(Tree::Reals),
        prop::collection::vec(any::<u8>(), 1..5).prop_map(Tree::Small),
        "[^\u{0}]{0,12}".prop_map(Tree::Text),
    ];
    leaf.prop_recursive(4, 24, 5, |inner| {
        prop_oneof![
            prop::collection::vec(("[^\u{0}]{1,8}", inner.clone()), 1..5).prop_map(Tree::Object),
            prop::collection::vec(inner, 1..5).prop_map(Tree::List),
        ]
    })
}

fn build(tree: &Tree, node: &mut Node) {
    match tree {
        Tree::Integers(values) => node.set_numbers(values),
        Tree::Reals(values) => node.set_numbers(values),
        Tree::Small(values) => node.set_numbers(values),
        Tree::Text(text) => node.set_text(text),
        Tree::Object(children) => {
            node.become_tree(catalyst::datatype::Kind::Object);
            for (name, child) in children {
                build(child, node.child_named(name).expect("shallow"));
            }
            Ok(())
        }
        Tree::List(children) => {
            node.become_tree(catalyst::datatype::Kind::List);
            for child in children {
                build(child, node.append().expect("shallow"));
            }
            Ok(())
        }
    }
    .expect("there is memory");
}

/// What differs between two trees.
fn differences(a: &Node, b: &Node) -> Option<String> {
    let mut info = Node::new();
    let differs = a.difference(b, &mut info, 0.0, Comparison::Same).expect("there is memory");
    differs.then(|| info.to_yaml(&Style::default()))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, ..ProptestConfig::default() })]

    #[test]
    fn what_is_written_reads_back_the_same(tree in tree()) {
        let mut node = Node::new();
        build(&tree, &mut node);
        let style = Style::default();
        let everything = node.to_json(&style, Detail::Everything);
        let read = schema::parse(&everything, Protocol::Schema).expect("what was written is a schema");
        prop_assert_eq!(differences(&node, &read), None, "{}", everything);
        let encoded = schema::to_base64_json(&node).expect("all leaves have data");
        let read = schema::parse(&encoded, Protocol::Base64).expect("what was written is base64 JSON");
        prop_assert_eq!(differences(&node, &read), None, "{}", encoded);
        // Plain text keeps values, not the widths of integers, and a list of one number is that number: after as many rounds as
        // the tree is deep nothing more changes.
        let mut once = schema::parse(&node.to_json(&style, Detail::Values), Protocol::Json).expect("JSON");
        for _ in 0..6 {
            once = schema::parse(&once.to_json(&style, Detail::Values), Protocol::Json).expect("JSON");
        }
        let twice = schema::parse(&once.to_json(&style, Detail::Values), Protocol::Json).expect("JSON");
        prop_assert_eq!(differences(&once, &twice), None);
        let yaml = once.to_yaml(&style);
        let read = schema::parse(&yaml, Protocol::Yaml).map_err(|error| TestCaseError::fail(format!("{error}\n{yaml}")))?;
        prop_assert_eq!(differences(&once, &read), None, "{}", yaml);
    }

    #[test]
    fn no_text_brings_the_readers_down(text in any::<String>(), brackets in "[\\[\\]{}:,\"'a0-9 \n#|>&.-]{0,60}") {
        for protocol in [Protocol::Json, Protocol::Yaml, Protocol::Schema, Protocol::Base64] {
            for text in [&text, &brackets] {
                let _ = schema::parse(text, protocol);
            }
        }
    }

    #[test]
    fn schemas_that_lie_are_refused(
        elements in any::<i64>(), offset in any::<i64>(), stride in any::<i64>(), data in prop::collection::vec(any::<u8>(), 0..64),
    ) {
        let text = format!(
            "{{x: {{dtype: int32, number_of_elements: {elements}, offset: {offset}, stride: {stride}}}}}"
        );
        let mut data = data;
        if let Ok(node) = schema::within(&text, &mut data) {
            prop_assert!(elements >= 0 && node.compact_bytes() <= 4 * 64 * 64);
        }
    }
}

#[test]
fn files_that_are_cut_or_lie_are_refused() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let path = directory.path().join("tree.conduit_bin");
    let path = path.to_str().expect("UTF-8");
    let mut node = Node::new();
    node.at("a/b").expect("a path").set_numbers(&[1.5, 2.5, 3.5]).expect("memory");
    files::save(&node, path, "").expect("the directory can be written");
    assert_eq!(differences(&node, &files::load(path, "").expect("was saved")), None);
    let data = std::fs::read(path).expect("was saved");
    std::fs::write(path, &data[..20]).expect("can be written");
    let error = files::load(path, "").map(|_| ()).expect_err("4 bytes are missing");
    assert!(error.to_string().contains("reach beyond 20 bytes"), "{error}");
    std::fs::remove_file(path).expect("is there");
    assert!(files::load(path, "").is_err());
}

#[test]
fn deep_texts_are_refused_and_deep_trees_let_go() {
    for protocol in [Protocol::Json, Protocol::Yaml, Protocol::Schema] {
        assert!(schema::parse(&"[".repeat(100_000), protocol).is_err());
    }
    let nested = "- ".repeat(5_000) + "1";
    assert!(schema::parse(&nested, Protocol::Yaml).is_err());
    let mut node = Node::new();
    assert!(node.fetch(&"a/".repeat(100_000)).is_err());
    assert!(node.fetch(&"b/".repeat(900)).is_ok());
    let mut deep = node.copy().expect("memory");
    assert!(deep.height() >= 900);
    assert!(
        deep.at("b/b/b").and_then(|place| place.take(node)).is_err(),
        "900 levels and three are more than a thousand"
    );
}
