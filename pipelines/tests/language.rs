//! The JSON language as its users meet it: what is read, and where errors point.

mod common;

use common::mutated;
use proptest::prelude::*;
use tombolo_pipelines::language::{
    At, Change, Command, Config, Due, Order, Slice, Stage, config_schema, order_schema, parse,
    parse_json, parse_orders, parse_valid, text,
};

const DESIGN: &str = include_str!("design.json");

#[test]
fn the_example_of_the_design_is_read_and_written_back() {
    let config = parse(DESIGN, "design.json").unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(config.pipelines.len(), 4);
    assert_eq!(config.pipelines[2].due, Due::OnOrder);
    assert_eq!(config.pipelines[3].due, Due::At(At::Time(0.1)));
    assert!(
        matches!(&config.pipelines[0].stages[0], Stage::Slice(Slice::Plane(plane)) if plane.normal == [1.0, 0.0, 0.0])
    );
    let again = parse(&serde_json::to_string_pretty(&config).unwrap(), "again.json").unwrap();
    assert_eq!(config, again);
}

/// (text, line, column, path, part of the message, suggestion)
type Case = (&'static str, usize, usize, &'static str, &'static str, Option<&'static str>);

#[test]
fn errors_point_at_the_token() {
    #[rustfmt::skip]
    let cases: [Case; 45] = [
        ("", 1, 1, "", "found the end of the text, expected a value", None),
        ("{\"version\": 1,\n}", 2, 1, "", "expected a key in double quotes", None),
        (r#"{"version": 1} x"#, 1, 16, "", "after the end of the value", None),
        (r#"{"version": 1, "version": 1}"#, 1, 16, "", "found the key `version` twice", None),
        (r#"{"version": 1e400}"#, 1, 13, "version", "beyond the range", None),
        (r#"{"version": NaN}"#, 1, 13, "version", "expected a finite number", None),
        (r#"{'version': 1}"#, 1, 2, "", "double quotes", None),
        (r#"{"version": 01}"#, 1, 13, "version", "starts with 0", None),
        (r#"{"version": 1.}"#, 1, 15, "version", "found '}', expected a digit", None),
        (r#"{"version": -.5}"#, 1, 14, "version", "found '.', expected a digit", None),
        (r#"{"version": -Infinity}"#, 1, 14, "version", "an infinity, expected a finite number", None),
        (r#"{"version": "x}"#, 1, 13, "version", "does not end", None),
        (r#"{"version": 2}"#, 1, 13, "version", "found version 2, expected 1", None),
        (r#"{"version": "1"}"#, 1, 13, "version", "found \"1\", expected a whole number from 0 to 4294967295", None),
        (r#"{"version": -1}"#, 1, 13, "version", "found -1, expected a whole number from 0 to 4294967295", None),
        (r#"{"version": 1.5}"#, 1, 13, "version", "found 1.5, expected a whole number", None),
        (r#"{"pipelines": []}"#, 1, 1, "", "the key `version` is missing", None),
        (r#"[1]"#, 1, 1, "", "found an array of 1, expected an object", None),
        ("{\"version\": 1,\n \"pipeline\": []}", 2, 2, "pipeline", "unknown key `pipeline`", Some("pipelines")),
        (r#"{"version": 1, "stream": {"listen": "nowhere"}}"#, 1, 37, "stream.listen", "expected ADDRESS:PORT", None),
        (r#"{"version": 1, "stream": {"token": "short"}}"#, 1, 36, "stream.token", "16 to 128", None),
        (r#"{"version": 1, "pipelines": [{"name": "a"}]}"#, 1, 30, "pipelines[0]", "the key `stages` is missing", None),
        (r#"{"version": 1, "pipelines": [{"name": "", "stages": []}]}"#, 1, 39, "pipelines[0].name", "1 to 200", None),
        (r#"{"version": 1, "pipelines": [{"name": "a", "stages": []}, {"name": "a", "stages": []}]}"#, 1, 68, "pipelines[1].name", "two pipelines", None),
        (r#"{"version": 1, "pipelines": [{"name": "a", "every": {"steps": 0}, "stages": []}]}"#, 1, 63, "pipelines[0].every.steps", "found 0, expected a whole number from 1 to ", None),
        (r#"{"version": 1, "pipelines": [{"name": "a", "every": {"time": -1}, "stages": []}]}"#, 1, 62, "pipelines[0].every.time", "above 0", None),
        (r#"{"version": 1, "pipelines": [{"name": "a", "every": {"steps": 1, "time": 1}, "stages": []}]}"#, 1, 53, "pipelines[0].every", "found the keys `steps`, `time`, expected an object with exactly one key", None),
        (r#"{"version": 1, "pipelines": [{"name": "a", "every": {}, "stages": []}]}"#, 1, 53, "pipelines[0].every", "found an empty object", None),
        (r#"{"version": 1, "pipelines": [{"name": "a", "every": {"steps": 1}, "at": {"cycle": 1}, "stages": []}]}"#, 1, 30, "pipelines[0]", "more than one of `every`, `at` and `on`", None),
        (r#"{"version": 1, "pipelines": [{"name": "a", "stages": [{"sclie": {}}]}]}"#, 1, 56, "pipelines[0].stages[0].sclie", "unknown name `sclie`", Some("slice")),
        (r#"{"version": 1, "pipelines": [{"name": "a", "stages": ["surface"]}]}"#, 1, 55, "pipelines[0].stages[0].surface", "found \"surface\", expected an object with this key", None),
        (r#"{"version": 1, "pipelines": [{"name": "a", "stages": [{"slice": {"origin": [0,0], "normal": [0,0,1]}}]}]}"#, 1, 76, "pipelines[0].stages[0].slice.origin", "found 2 values, expected an array of 3 values", None),
        (r#"{"version": 1, "pipelines": [{"name": "a", "stages": [{"slice": {"origin": [0,0,"z"], "normal": [0,0,1]}}]}]}"#, 1, 81, "pipelines[0].stages[0].slice.origin[2]", "found \"z\", expected a number", None),
        (r#"{"version": 1, "pipelines": [{"name": "a", "stages": [{"slice": {"origin": [0,0,0], "normal": [0,0,0]}}]}]}"#, 1, 95, "pipelines[0].stages[0].slice.normal", "length is not 0", None),
        (r#"{"version": 1, "pipelines": [{"name": "a", "stages": [{"quality": {}}, {"surface": {}}]}]}"#, 1, 84, "pipelines[0].stages[1].surface", "must come first", None),
        (r#"{"version": 1, "pipelines": [{"name": "a", "stages": [{"stream": {}}]}]}"#, 1, 66, "pipelines[0].stages[0].stream", "nothing to stream", None),
        (r#"{"version": 1, "pipelines": [{"name": "a", "stages": [{"surface": {}}, {"stream": {"error": {"relative": 0}}}]}]}"#, 1, 106, "pipelines[0].stages[1].stream.error.relative", "above 0", None),
        (r#"{"version": 1, "pipelines": [{"name": "a", "stages": [{"write": {"file": "a-{cylce}.vtu"}}]}]}"#, 1, 74, "pipelines[0].stages[0].write.file", "`{cylce}`", Some("cycle")),
        (r#"{"version": 1, "pipelines": [{"name": "a", "stages": [{"write": {"file": "a.stl"}}]}]}"#, 1, 74, "pipelines[0].stages[0].write.file", "expected one that ends in", None),
        (r#"{"version": 1, "pipelines": [{"name": "a", "stages": [{"guard": {}}]}]}"#, 1, 65, "pipelines[0].stages[0].guard", "\"on\": \"order\"", None),
        (r#"{"version": 1, "pipelines": [{"name": "a", "on": "order", "stages": [{"guard": {"min_scaled_jacobian": 2}}]}]}"#, 1, 104, "pipelines[0].stages[0].guard.min_scaled_jacobian", "from 0 to 1", None),
        (r#"{"version": 1, "pipelines": [{"name": "a", "on": "oder", "stages": []}]}"#, 1, 50, "pipelines[0].on", "unknown name `oder`", Some("order")),
        (r#"{"version": 1, "pipelines": [{"name": "a", "stages": [{"translate": {"features": ["w"], "by": [1,0,0]}}]}]}"#, 1, 69, "pipelines[0].stages[0].translate", "nothing orders", None),
        (r#"{"version": 1, "pipelines": [{"name": "a", "stages": [{"order": {}}]}]}"#, 1, 65, "pipelines[0].stages[0].order", "nothing to order", None),
        (r#"{"version": 1, "pipelines": [{"name": "é", "stages": [{"quality": {}}], "when": "quality.mn < 1", "then": [{"stop": {}}]}]}"#, 1, 81, "pipelines[0].when", "unknown name `quality.mn`", Some("quality.min")),
    ];
    let mut wrong = Vec::new();
    for (text, line, column, path, message, suggestion) in cases {
        let error = parse(text, "views.json").expect_err(text);
        let same = (error.line, error.column, error.path.as_str()) == (line, column, path)
            && error.message.contains(message)
            && error.suggestion.as_deref() == suggestion;
        if !same {
            wrong.push(format!(
                "{text}\n  {error}\n  expected {line}:{column}: {path}: {message} {suggestion:?}"
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn extracts_are_checked_at_the_token() {
    #[rustfmt::skip]
    let cases = [
        (r#"{"slice": {"normal": [1,0,0]}}"#, "", "the key `origin` is missing", None),
        (r#"{"slice": {}}"#, "", "found nothing that cuts, expected `origin` with `normal`, `planes`", None),
        (r#"{"slice": {"plains": []}}"#, ".plains", "unknown key `plains`", Some("planes")),
        (r#"{"slice": {"planes": []}}"#, ".planes", "at least one plane", None),
        (r#"{"slice": {"planes": [{"origin": [0,0,0], "normal": [0,0,0]}]}}"#, ".planes[0].normal", "length is not 0", None),
        (r#"{"slice": {"sphere": {"center": [0,0,0], "radius": -1}}}"#, ".sphere.radius", "found -1, expected a number above 0", None),
        (r#"{"slice": {"sphere": {"centre": [0,0,0], "radius": 1}}}"#, ".sphere.centre", "unknown key", Some("center")),
        (r#"{"slice": {"origin": [0,0,0], "normal": [0,0,1], "sphere": {"center": [0,0,0], "radius": 1}}}"#, "", "found more than one of `origin`", None),
        (r#"{"slice": {"cylinder": {"origin": [0,0,0], "axis": [0,0,0], "radius": 1}}}"#, ".cylinder.axis", "length is not 0", None),
        (r#"{"contour": {"field": "p", "values": []}}"#, ".values", "at least one value", None),
        (r#"{"contour": {"field": "p", "values": [1, 2, 1]}}"#, ".values[2]", "the same value twice", None),
        (r#"{"contour": {"feild": "p", "values": [1]}}"#, ".feild", "unknown key `feild`", Some("field")),
        (r#"{"threshold": {"field": "p"}}"#, "", "expected `min` or `max`", None),
        (r#"{"threshold": {"field": "p", "min": 2, "max": 1}}"#, ".min", "found 2, which is above `max`: 1", None),
        (r#"{"threshold": {"field": "p", "min": 2, "vertices": "some"}}"#, ".vertices", "unknown name `some`", None),
        (r#"{"clip": {}}"#, "", "found nothing to clip by", None),
        (r#"{"clip": {"box": {"lower": [0,0,0], "upper": [1,0,1]}}}"#, ".box.lower[1]", "found 0, expected less than `upper[1]`: 0", None),
        (r#"{"clip": {"field": {"nam": "p", "value": 1}}}"#, ".field.nam", "unknown key", Some("name")),
        (r#"{"probe": {"points": []}}"#, ".points", "at least one point", None),
        (r#"{"probe": {"line": {"from": [0,0,0], "to": [1,0,0], "count": 1}}}"#, ".line.count", "found 1, expected at least 2", None),
        (r#"{"probe": {"grid": {"lower": [0,0,0], "upper": [1,1,1], "counts": [1000,1000,1000]}}}"#, ".grid.counts", "found 1000000000 points, expected at most 1048576", None),
        (r#"{"probe": {"grid": {"lower": [0,0,0], "upper": [1,1,1], "counts": [1,0,1]}}}"#, ".grid.counts[1]", "found 0, expected at least 1 point", None),
        (r#"{"probe": {"points": [[0,0,0]], "method": "linear"}}"#, ".method", "unknown name `linear`", None),
        (r#"{"gradient": {"field": "p", "name": "x"}}"#, ".name", "has a meaning of its own", None),
        (r#"{"gradient": {"feld": "p"}}"#, ".feld", "unknown key", Some("field")),
        (r#"{"expression": {"name": "a", "formula": "p +"}}"#, ".formula", "column 4 of the formula: found the end", None),
        (r#"{"expression": {"name": "a", "components": ["p", "sqr(p)"]}}"#, ".components[1]", "unknown function", Some("sqrt")),
        (r#"{"expression": {"name": "a"}}"#, "", "expected `formula` or `components`", None),
    ];
    for (stage, path, message, suggestion) in cases {
        let text =
            format!(r#"{{"version": 1, "pipelines": [{{"name": "a", "stages": [{stage}]}}]}}"#);
        let error = parse(&text, "views.json").expect_err(stage);
        let name = stage.split('"').nth(1).unwrap();
        assert_eq!(error.path, format!("pipelines[0].stages[0].{name}{path}"), "{error}");
        assert!(error.message.contains(message), "{error}");
        assert_eq!(error.suggestion.as_deref(), suggestion, "{error}");
    }
    let of_stages = |stages: &str| {
        let text =
            format!(r#"{{"version": 1, "pipelines": [{{"name": "a", "stages": [{stages}]}}]}}"#);
        parse(&text, "views.json")
    };
    let gradient = r#"{"gradient": {"field": "p"}}"#;
    let error = of_stages(&format!("{gradient}, {gradient}")).unwrap_err();
    assert_eq!(error.path, "pipelines[0].stages[1].gradient.name");
    assert!(error.message.contains("two stages derive a field `gradient`"), "{error}");
    let error = of_stages(&format!(r#"{{"surface": {{}}}}, {gradient}"#)).unwrap_err();
    assert!(error.message.contains("must come before all others"), "{error}");
    assert!(of_stages(&format!(r#"{gradient}, {{"surface": {{}}}}"#)).is_ok());
    for stages in [
        r#"{"slice": {"planes": [{"origin": [0,0,0], "normal": [0,0,1]}]}}"#,
        r#"{"slice": {"cylinder": {"origin": [0,0,0], "axis": [0,0,1], "radius": 2}}}"#,
        r#"{"expression": {"name": "a", "components": ["p", "q"]}}, {"clip": {"box": {"lower": [0,0,0], "upper": [1,1,1]}, "invert": true}}"#,
        r#"{"expression": {"name": "a", "formula": "p"}}, {"probe": {"grid": {"lower": [0,0,0], "upper": [1,1,1], "counts": [2,3,4]}, "method": "nearest"}}"#,
    ] {
        let config = of_stages(stages).unwrap_or_else(|error| panic!("{error}"));
        let again = parse(&serde_json::to_string(&config).unwrap(), "again.json").unwrap();
        assert_eq!(config, again, "{stages}");
    }
}

#[test]
fn edits_are_checked_at_the_token() {
    #[rustfmt::skip]
    let cases = [
        (r#"{"order": {"edits": [{"rotate": {"features": ["a"], "axis": [0, 0, 0], "degrees": 1}}]}}"#, 61, "order.edits[0].rotate.axis", "length is not 0"),
        (r#"{"order": {"stack": [{"translate": {"by": [0, 0, 0]}}]}}"#, 36, "order.stack[0].translate.features", "there is no handle"),
        (r#"{"order": {"stack": [{"translate": {"by": [0, 0, 0], "region": {"box": {"lower": [0, 3, 0], "upper": [1, 2, 3]}}}}]}}"#, 86, "order.stack[0].translate.region.box.lower[1]", "3 is above"),
        (r#"{"order": {"stack": [{"translate": {"by": [0, 0, 0], "region": {"ball": {}}}}]}}"#, 65, "order.stack[0].translate.region.ball", "unknown name `ball`"),
        (r#"{"order": {"stack": [{"affine": {"features": ["a"], "matrix": [[1, 0, 0], [0, 1], [0, 0, 1]]}}]}}"#, 75, "order.stack[0].affine.matrix[1]", "expected an array of 3"),
        (r#"{"order": {"stack": [{"displacement": {"vertices": [4, 4], "values": [[0, 0, 1], [0, 0, 1]]}}]}}"#, 56, "order.stack[0].displacement.vertices[1]", "vertex 4 is also"),
        (r#"{"order": {"stack": [{"skeleton": {"at": [1, 2, 3]}}]}}"#, 42, "order.stack[0].skeleton.at", "expected either"),
    ];
    for (text, column, path, message) in cases {
        let error = parse_orders(text, "orders.json").expect_err(text);
        assert_eq!(
            (error.line, error.column, error.path.as_str()),
            (1, column, path),
            "{text}: {error}"
        );
        assert!(error.message.contains(message), "{error}");
    }
}

#[test]
fn files_lie_beside_the_json_that_names_them() {
    let order = r#"{"order": {"stack": [{"displacement": {"file": "a.txt"}}, {"displacement": {"file": "/b.txt"}}]}}"#;
    let files = |text: &str, file: &str| match &parse_orders(text, file).unwrap()[0].command {
        Command::Order(order) => serde_json::to_value(order.edits()).unwrap(),
        other => panic!("{other:?}"),
    };
    let expected = |first: &str| serde_json::json!([{"displacement": {"file": first, "fixed": []}}, {"displacement": {"file": "/b.txt", "fixed": []}}]);
    assert_eq!(files(order, "cases/one/orders.json"), expected("cases/one/a.txt"));
    assert_eq!(files(order, "orders.json"), expected("a.txt"));
    let config = r#"{"version": 1, "pipelines": [{"name": "a", "at": {"cycle": 1}, "stages": [{"displacement": {"file": "a.txt"}}, {"order": {}}]}]}"#;
    let Stage::Displacement(import) =
        &parse(config, "cases/views.json").unwrap().pipelines[0].stages[0]
    else {
        panic!()
    };
    assert_eq!(import.file.as_deref(), Some("cases/a.txt"));
}

#[test]
fn bytes_that_are_no_text_are_named() {
    let error = text(b"{\n \"name\": \"\xff\"}", "a.json").unwrap_err();
    assert_eq!((error.line, error.column), (2, 11));
    assert!(error.message.contains("0xff"), "{error}");
}

#[test]
fn deep_nesting_is_an_error() {
    let error = parse_json::<serde_json::Value>(&"[".repeat(1_000_000), "a.json").unwrap_err();
    assert!(error.message.contains("found 65 levels of nesting, expected at most 64"), "{error}");
}

#[test]
fn an_order_is_exactly_one_change() {
    let order: Order = parse_valid(r#"{"undo": 2}"#, "o").unwrap();
    assert_eq!(order, Change::Undo(2.try_into().unwrap()).into());
    for (text, message) in [
        ("{}", "none of `edits`, `stack` and `undo`"),
        (r#"{"undo": 1, "stack": []}"#, "more than one"),
        (r#"{"undo": 0}"#, "a whole number from 1 to 4294967295"),
        (r#"{"edits": []}"#, "at least one edit"),
        (r#"{"edits": [{"translate": {"features": ["a"], "by": [1, 2]}}]}"#, "array of 3 values"),
        (r#"{"undo": 1, "guard": {"min_scaled_jacobian": -1}}"#, "from 0 to 1"),
    ] {
        let error = parse_valid::<Order>(text, "o").expect_err(text);
        assert!(error.message.contains(message), "{error}");
    }
}

#[test]
fn orders_are_read_from_arrays_and_journals() {
    let array = r#"[{"at": {"cycle": 3}, "order": {"undo": 1}}, {"at": {"time": 0.5}, "id": "p", "pause": {}}]"#;
    let orders = parse_orders(array, "orders.json").unwrap();
    assert_eq!(orders[0].at, Some(At::Cycle(3)));
    assert_eq!((orders[1].id.as_deref(), &orders[1].command), (Some("p"), &Command::Pause {}));

    let journal = concat!(
        r#"{"id":"a","status":"accepted","cycle":3,"time":0.3,"order":{"undo":1}}"#,
        "\n",
        r#"{"id":"b","status":"accepted","cycle":4,"time":0.4,"order":{"stack":[]}}"#,
        "\n",
        r#"{"id":"b","status":"rejected","cycle":4,"time":0.4,"reason":"folds"}"#,
        "\n",
        r#"{"id":"a","status":"applied","cycle":7,"time":0.7,"min_scaled_jacobian":0.3}"#,
        "\n",
        r#"{"id":"c","status":"accepted","cycle":9,"time":0.9,"stop":{}}"#,
        "\n",
    );
    let orders = parse_orders(journal, "journal.jsonl").unwrap();
    let places: Vec<_> =
        orders.iter().map(|timed| (timed.id.as_deref().unwrap(), timed.at.unwrap())).collect();
    // The run ended before the last of them took effect.
    assert_eq!(places, [("a", At::Cycle(7))]);

    let error = parse_orders("{\"pause\": {}}\n{\"puase\": {}}\n", "o.jsonl").unwrap_err();
    assert_eq!((error.line, error.column, error.suggestion.as_deref()), (2, 2, Some("pause")));
    assert!(
        parse_orders(r#"[{"order": {"undo": 1}, "pause": {}}]"#, "o")
            .unwrap_err()
            .message
            .contains("exactly one")
    );
    assert!(parse_orders(" \n", "o").unwrap().is_empty());
    assert_eq!(
        parse_orders("{\n \"at\": {\"cycle\": 1},\n \"pause\": {}\n}", "o").unwrap().len(),
        1
    );
    assert!(parse_orders(r#"{"pause": {}"#, "o").is_err(), "one broken line is not a torn journal");
}

#[test]
fn schemas_name_what_the_parser_reads() {
    let schema = config_schema().to_string();
    for name in [
        "scale_direction",
        "harmonic_order",
        "min_scaled_jacobian",
        "listen",
        "background",
        "at most one of",
    ] {
        let lower = schema.to_lowercase();
        assert!(lower.contains(name), "{name} is not in the schema");
    }
    let order = order_schema();
    assert_eq!(order["oneOf"].as_array().map(Vec::len), Some(3), "{order}");
    assert_eq!(order["additionalProperties"], false);
}

proptest! {
    #[test]
    fn no_bytes_make_the_parser_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        if let Ok(text) = text(&bytes, "fuzz") {
            let _ = parse(text, "fuzz");
            let _ = parse_orders(text, "fuzz");
        }
    }

    /// A valid text with some bytes overwritten, removed or doubled is read or refused at a place
    /// that it has.
    #[test]
    fn no_mutation_makes_the_parser_panic(text in mutated(DESIGN)) {
        if let Err(error) = parse(&text, "fuzz") {
            prop_assert!(error.line <= text.lines().count() + 1);
            let line = text.split('\n').nth(error.line - 1).unwrap_or_default();
            prop_assert!(error.column <= line.chars().count() + 1, "{}\n{}", error, text);
        }
        let _ = parse_orders(&text, "fuzz");
    }

    #[test]
    fn what_is_read_is_written_and_read_the_same(steps in 1u64..1000, time in 1e-9f64..1e9, relative in 1e-9f64..0.5) {
        let text = format!(
            r#"{{"version": 1, "pipelines": [{{"name": "v", "every": {{"steps": {steps}}}, "stages":
               [{{"surface": {{}}}}, {{"stream": {{"error": {{"relative": {relative:e}}}}}}}]}},
               {{"name": "w", "at": {{"time": {time:e}}}, "stages": []}}]}}"#
        );
        let config = parse(&text, "a").unwrap();
        let again: Config = parse(&serde_json::to_string(&config).unwrap(), "b").unwrap();
        prop_assert_eq!(config, again);
    }
}

/// Numbers that no list of faces, vertices or steps can hold are told their range; numbers far from
/// 1 are told in a few characters.
#[test]
fn bounds_are_the_true_ones_and_numbers_are_short() {
    let order = |faces: &str| {
        let text = format!(
            r#"{{"edits": [{{"translate": {{"region": {{"faces": [{faces}]}}, "by": [0, 0, 1]}}}}]}}"#
        );
        parse_valid::<Order>(&text, "order").unwrap_err().to_string()
    };
    for faces in ["4294967296", "-1", "1.5", "1e300"] {
        let error = order(faces);
        assert!(
            error.contains(&format!("found {faces}, expected a whole number from 0 to 4294967295")),
            "{error}"
        );
        assert!(error.contains("edits[0].translate.region.faces[0]"), "{error}");
    }
    for (setting, shown) in [
        (
            r#""guard": {"min_scaled_jacobian": 1e308}"#,
            "found 1e308, expected a number from 0 to 1",
        ),
        (r#""deform": {"stiffening": 1e308}"#, "1e308"),
        (r#""deform": {"tolerance": -1e-300}"#, "-1e-300"),
        (
            r#""edits": [{"translate": {"region": {"sphere": {"center": [0, 0, 0], "radius": -1e308}}, "by": [0, 0, 1]}}]"#,
            "-1e308",
        ),
    ] {
        let change = if setting.contains("edits") { "" } else { r#""undo": 1, "# };
        let text = format!("{{{change}{setting}}}");
        let error = parse_valid::<Order>(&text, "order").unwrap_err().to_string();
        assert!(error.contains(shown) && error.len() < 200, "{error}");
    }
}
