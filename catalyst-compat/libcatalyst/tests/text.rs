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
        prop::collection::vec(prop::num::f64::NORMAL | prop::num::f64::ZERO, 1..5)
            .prop_map(Tree::Reals),
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
    fn no_text_brings_the_readers_down(text in any::<String>(), brackets in "[\\[\\]{}:,\"'a0-9 \n#|>&*!?%+.\\\\-]{0,60}") {
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

/// The same tree as YAML in other words and as JSON.
#[test]
fn yaml_is_read_as_it_is_meant() {
    let same = [
        ("a: 1\nb: two words", r#"{"a": 1, "b": "two words"}"#),
        ("%YAML 1.2\n--- # begins\na: 1\n...\nb: 2", r#"{"a": 1}"#),
        ("a: 1\n---\na: 2", r#"{"a": 1}"#),
        ("--- {a: 1}", r#"{"a": 1}"#),
        (
            "base: &b {x: 1, y: [1, 2]}\ncopy: *b\n",
            r#"{"base": {"x": 1, "y": [1, 2]}, "copy": {"x": 1, "y": [1, 2]}}"#,
        ),
        ("a: &list\n  - 1\n  - 2\nb: [*list, *list]", r#"{"a": [1, 2], "b": [[1, 2], [1, 2]]}"#),
        ("- &one\n  k: v\n- *one", r#"[{"k": "v"}, {"k": "v"}]"#),
        ("a: !!str 12\nb: !thing {c: 1}\nd: ! text", r#"{"a": "12", "b": {"c": 1}, "d": "text"}"#),
        (
            "a: {b: two words, c: http://here:80/x, 'd e': \"f\\tg\", h}",
            r#"{"a": {"b": "two words", "c": "http://here:80/x", "d e": "f\tg", "h": null}}"#,
        ),
        ("a: [one: 1, 'C:\\new', it's]", r#"{"a": [{"one": 1}, "C:\\new", "it's"]}"#),
        ("a: [1, # one\n  2,\n\n  3]\nb: 4", r#"{"a": [1, 2, 3], "b": 4}"#),
        (
            "a: goes\n  on and\n\n  on\nb: \"so\n  does # this\\\n   one\"",
            r#"{"a": "goes on and\non", "b": "so does # thisone"}"#,
        ),
        (
            "a: |\n  one\n    two\n\nb: |-\n  three\nc: >\n  four\n  five\n\n  six\nd: |+\n  seven\n\n",
            r#"{"a": "one\n  two\n", "b": "three", "c": "four five\nsix\n", "d": "seven\n\n"}"#,
        ),
        ("a: |1\n  one", r#"{"a": " one\n"}"#),
        ("- - 1\n  - x\n- y", r#"[[1, "x"], "y"]"#),
        ("\"a: b\": 1\n'it''s': 2\n\"\\x41\\u00e9\": 3", r#"{"a: b": 1, "it's": 2, "A\u00e9": 3}"#),
        (
            "a: 'one : two'\nb: http://x:1\nc: 12:30 # d: e",
            r#"{"a": "one : two", "b": "http://x:1", "c": "12:30"}"#,
        ),
        (
            "a: true\nb: {c: true}\nd: +3\ne: 1e3",
            r#"{"a": "true", "b": {"c": "true"}, "d": 3, "e": 1000.0}"#,
        ),
        ("{a: [1, 2],\n b: {c: text}}", r#"{"a": [1, 2], "b": {"c": "text"}}"#),
    ];
    for (yaml, json) in same {
        let read =
            schema::parse(yaml, Protocol::Yaml).unwrap_or_else(|error| panic!("{yaml}\n{error}"));
        let wanted = schema::parse(json, Protocol::Json).expect("JSON");
        assert_eq!(differences(&wanted, &read), None, "{yaml}");
    }
    for (yaml, told) in [
        ("a: 1\n  b: 2", "line 2: a name is not expected here"),
        ("a: a text with a colon : in it", "line 1: a name is not expected here"),
        ("a:\n- one: two: three", "line 2: a name is not expected here"),
        ("a: *b", "there is no anchor 'b'"),
        ("a: &a [*a]", "there is no anchor 'a'"),
        ("? a\n: b", "no scalars"),
        ("a: 'open\nb: 1", "the end of the quoted text"),
        ("a: [1, 2\nb: 1", "line 2: ',' or ']' is expected"),
        ("a: {b: 1} c", "the end of the line is expected"),
        ("a: \"\\q\"", "'\\q' is no escape"),
        ("a: 1\nb: 2\na: 3", "the name 'a' is there twice"),
        ("  a: 1\nb: 2", "less indentation"),
    ] {
        let error = schema::parse(yaml, Protocol::Yaml).map(|_| ()).expect_err(yaml);
        assert!(error.to_string().contains(told), "{yaml}: {error}");
    }
    assert!(schema::parse(r#"{"a": 1, "a": 2}"#, Protocol::Json).is_err());
    assert!(schema::parse("{a: int32, a: int64}", Protocol::Schema).is_err());
    // A few lines that would stand for 10 to the power of 12 values, and anchors that would nest without end.
    let lines: Vec<String> = (1..13)
        .map(|i| format!("a{i}: &a{i} [{}]", vec![format!("*a{}", i - 1); 10].join(", ")))
        .collect();
    let error = schema::parse(&format!("a0: &a0 [x]\n{}", lines.join("\n")), Protocol::Yaml)
        .map(|_| ())
        .expect_err("too much");
    assert!(error.to_string().contains("stand for too much"), "{error}");
    let lines: Vec<String> = (1..5000).map(|i| format!("a{i}: &a{i} [*a{}]", i - 1)).collect();
    assert!(schema::parse(&format!("a0: &a0 [x]\n{}", lines.join("\n")), Protocol::Yaml).is_err());
}

/// JSON has no such numbers; what stands for them is read among numbers as the numbers that were written.
#[test]
fn arrays_that_are_not_finite_stay_arrays() {
    let mut node = Node::new();
    for (name, values) in
        [("some", [f64::NAN, 1.0, f64::NEG_INFINITY]), ("all", [f64::INFINITY, f64::NAN, f64::NAN])]
    {
        node.at(name).expect("a path").set_numbers(&values).expect("memory");
    }
    for (text, protocol) in [
        (node.to_json(&Style::default(), Detail::Values), Protocol::Json),
        (node.to_yaml(&Style::default()), Protocol::Yaml),
    ] {
        let read = schema::parse(&text, protocol).expect("what was written");
        for (name, written) in node.children() {
            let found: Vec<f64> = read
                .get(name)
                .expect("it is there")
                .numbers()
                .map(|number| number.as_f64())
                .collect();
            let written: Vec<f64> = written.numbers().map(|number| number.as_f64()).collect();
            assert_eq!(format!("{found:?}"), format!("{written:?}"), "{text}");
        }
    }
    let read = schema::parse(r#"["nan", 0, 1]"#, Protocol::Json).expect("JSON");
    assert_eq!((read.kind(), read.datatype().elements), (catalyst::datatype::Kind::Float64, 3));
    let read =
        schema::parse(r#"{"a": "nan", "b": ["nan", "text"]}"#, Protocol::Json).expect("JSON");
    assert_eq!(read.get("a").and_then(Node::text).as_deref(), Some("nan"));
    assert_eq!(read.get("b").map(Node::kind), Some(catalyst::datatype::Kind::List));
}

/// Children are found by name whether few or many, after any of them has gone, come or changed its name.
#[test]
fn many_children_are_found_by_name() {
    let mut node = Node::new();
    let mut names: Vec<String> = Vec::new();
    let check = |node: &Node, names: &[String]| {
        assert_eq!(node.children().map(|(name, _)| name).collect::<Vec<_>>(), names);
        for (index, name) in names.iter().enumerate() {
            let found = node.get(name).expect("it is there");
            assert!(std::ptr::eq(found, node.child(index).expect("it is there")), "{name}");
            assert_eq!(
                found.name(),
                if name.contains('/') { format!("{{{name}}}") } else { name.clone() }
            );
        }
        assert!(node.get("nothing").is_none());
    };
    for step in 0..200_usize {
        match step % 5 {
            3 => {
                let index = step * 7 % names.len();
                node.remove_named(&names.remove(index)).expect("it is there");
            }
            4 => {
                let (index, new) = (step * 3 % names.len(), format!("new/{step}"));
                node.rename(&names[index], &new).expect("it is there and the name is free");
                names[index] = new;
            }
            _ => {
                names.push(format!("name {step}"));
                node.child_named(&format!("name {step}")).expect("shallow");
            }
        }
        assert!(node.rename(&names[0], &names[names.len() - 1]).is_err() || names.len() == 1);
        check(&node, &names);
    }
    let copy = node.copy().expect("memory");
    check(&copy, &names);
    while names.len() > 1 {
        node.remove(0).expect("it is there");
        names.remove(0);
        check(&node, &names);
    }
}
