//! Every error of a text at once: which are told, in which words, and which are not.

mod common;

use std::fs;
use std::path::Path;

use common::{assert_told, mutated};
use proptest::prelude::*;
use tombolo_deform::edit::Edit;
use tombolo_pipelines::language::{
    Config, Content, Deformation, LanguageError, LanguageErrors, Problem, Trial, check,
    check_content, check_orders, parse, parse_orders, parse_valid,
};

const DESIGN: &str = include_str!("design.json");

/// The errors of a configuration, line by line.
fn told(text: &str) -> String {
    match check(text, "views.json") {
        Ok(_) => "nothing".into(),
        Err(errors) => errors.to_string(),
    }
}

fn told_of_orders(text: &str) -> String {
    match check_orders(text, "orders.json") {
        Ok(_) => "nothing".into(),
        Err(errors) => errors.to_string(),
    }
}

#[test]
fn errors_of_all_places_are_told_in_the_order_of_the_file() {
    let text = r#"{
  "version": "1",
  "steam": {"listen": "nowhere"},
  "pipelines": [
    {"name": "a", "every": {"steps": 0}, "stages": [
      {"slice": {"origin": [0, 0], "normal": [1, 0, 0]}},
      {"slect": {"fields": ["p", "p"]}},
      {"stream": {"error": {"relative": 3}}}]},
    {"nam": "a", "stages": [
      {"surface": {}},
      {"quality": {}},
      {"quality": {}},
      {"write": {"file": "a.stl"}},
      {"contour": {"field": "p", "values": []}}],
      "when": "qality.min < 1 && velocty.max > 2 || quality.min < 0",
      "then": [{"stp": {}}, {"log": {"message": "{quality.mn}"}}, {"set": {"name": "x", "value": "y"}}]},
    {"name": "a", "on": "odrer", "stages": [{"guard": {"min_scaled_jacobian": 2}}, {"surface": {}}]},
    7
  ]
}"#;
    assert_told(
        &told(text),
        r#"
views.json:2:14: version: found "1", expected a whole number from 0 to 4294967295
views.json:3:3: steam: found the unknown key `steam`, expected `version`, `description`, `stream`, `journal`, `record`, `record_megabytes`, `steering`, `watch`, `units` or `pipelines`; did you mean `stream`?
views.json:3:23: steam.listen: found "nowhere", expected ADDRESS:PORT, such as 127.0.0.1:7070, or unix:/PATH
views.json:5:38: pipelines[0].every.steps: found 0, expected a whole number from 1 to 18446744073709551615
views.json:6:28: pipelines[0].stages[0].slice.origin: found 2 values, expected an array of 3 values
views.json:7:8: pipelines[0].stages[1].slect: found the unknown name `slect`, expected `surface`, `slice`, `contour`, `threshold`, `clip`, `probe`, `streamlines`, `glyphs`, `gradient`, `vorticity`, `divergence`, `q_criterion`, `magnitude`, `expression`, `select`, `quality`, `statistics`, `integrate`, `histogram`, `force`, `wall_shear_stress`, `difference`, `time_statistics`, `spectrum`, `decimate`, `stream`, `write`, `csv`, `log`, `render`, `translate`, `rotate`, `scale_direction`, `scale_normals`, `affine`, `displacement`, `skeleton`, `order`, `deform`, `guard`, `schedule`, `pause`, `stop` or `set`; did you mean `select`?
views.json:7:34: pipelines[0].stages[1].slect.fields[1]: found the same field twice
views.json:8:41: pipelines[0].stages[2].stream.error.relative: found 3, expected a number above 0 and at most 0.5
views.json:9:6: pipelines[1].nam: found the unknown key `nam`, expected `name`, `description`, `channel`, `every`, `at`, `on`, `budget`, `stages`, `when`, `for`, `again_after` or `then`; did you mean `name`?
views.json:9:13: pipelines[1].nam: two pipelines are named `a`
views.json:12:19: pipelines[1].stages[2].quality: found twice, expected at most once
views.json:13:26: pipelines[1].stages[3].write.file: found the file `a.stl`, expected one that ends in `.vtu`, `.vtp`, `.vtk`, `.vtpd`, `.pvtu` or `.pvtp`
views.json:14:19: pipelines[1].stages[4].contour: a pipeline has one source stage
views.json:15:15: pipelines[1].when: column 1 of the formula: found the unknown name `qality.min`, expected a monitor; did you mean `quality.min`?
views.json:15:15: pipelines[1].when: column 19 of the formula: found the unknown name `velocty.max`, expected a monitor
views.json:16:17: pipelines[1].then[0].stp: found the unknown name `stp`, expected `pause`, `stop`, `stream`, `write`, `csv`, `log`, `set`, `render` or `order`; did you mean `stop`?
views.json:16:49: pipelines[1].then[1].log.message: found the unknown name `quality.mn`, expected a monitor; did you mean `quality.min`?
views.json:16:98: pipelines[1].then[2].set.value: found "y", expected a number
views.json:17:14: pipelines[2].name: two pipelines are named `a`
views.json:17:25: pipelines[2].on: found the unknown name `odrer`, expected `order`, `viewer` or `end`; did you mean `order`?
views.json:17:79: pipelines[2].stages[0].guard.min_scaled_jacobian: found 2, expected a number from 0 to 1
views.json:17:96: pipelines[2].stages[1].surface: a pipeline with `"on": "order"` has only the stages `deform`, `guard` and `schedule`
views.json:18:5: pipelines[3]: found 7, expected an object
"#,
    );
}

#[test]
fn what_follows_from_an_error_alone_is_not_told() {
    let of_pipelines =
        |pipelines: &str| told(&format!(r#"{{"version": 1, "pipelines": [{pipelines}]}}"#));
    for (pipelines, expected) in [
        // A source stage that cannot be read is one all the same.
        (
            r#"{"name": "a", "stages": [{"slice": 3}, {"stream": {}}, {"write": {"file": "a.vtp"}}]}"#,
            "views.json:1:65: pipelines[0].stages[0].slice: found 3, expected an object",
        ),
        // So is a stage whose monitors a condition, a table and another pipeline name.
        (
            r#"{"name": "a", "stages": [{"integrate": {"name": "in", "field": 3, "features": 4}}, {"csv": {"file": "a.csv", "monitors": ["in.mean"]}}],
                "when": "in.mean > 0 && out.mean > 0", "then": [{"stop": {}}]},
               {"name": "b", "stages": [], "when": "{a/in.mean} < in.size", "then": [{"stop": {}}]}"#,
            "views.json:1:93: pipelines[0].stages[0].integrate.field: found 3, expected a string
             views.json:1:108: pipelines[0].stages[0].integrate.features: found 4, expected an array
             views.json:2:25: pipelines[0].when: column 16 of the formula: found the unknown name `out.mean`, expected a monitor",
        ),
        // A misspelt key is taken for the one that was meant.
        (
            r#"{"name": "a", "stages": [{"statistics": {"feild": "p"}}], "when": "p.max > 1 && p.mix > 1", "then": [{"stop": {}}]}"#,
            "views.json:1:71: pipelines[0].stages[0].statistics.feild: found the unknown key `feild`, expected `field`, `name` or `unit`; did you mean `field`?
             views.json:1:96: pipelines[0].when: column 14 of the formula: found the unknown name `p.mix`, expected a monitor; did you mean `p.min`?",
        ),
        // What an object lacks because a part of it is wrong.
        (
            r#"{"name": "a", "stages": [{"threshold": {"field": "p", "min": "low"}}, {"clip": {"spher": {"center": [0, 0, 0], "radius": "r"}}}]}"#,
            "views.json:1:91: pipelines[0].stages[0].threshold.min: found \"low\", expected a number
             views.json:1:110: pipelines[0].stages[1].clip.spher: found the unknown key `spher`, expected `plane`, `box`, `sphere`, `field` or `invert`; did you mean `sphere`?
             views.json:1:151: pipelines[0].stages[1].clip.spher.radius: found \"r\", expected a number",
        ),
        // A pipeline without a name, or that is due at odds, has stages and a condition.
        (
            r#"{"every": {"steps": 1}, "at": {"cycle": 2}, "stages": [{"surface": {"x": 1}}, {"guard": {}}], "when": "a < ", "then": []}"#,
            "views.json:1:30: pipelines[0]: the key `name` is missing
             views.json:1:98: pipelines[0].stages[0].surface.x: found the unknown key `x`, expected no key at all
             views.json:1:132: pipelines[0].when: column 5 of the formula: found the end of the formula, expected a number, a name or '('",
        ),
        // An edit that is wrong can be ordered, and an order that is wrong takes it up.
        (
            r#"{"name": "a", "stages": [{"translate": {"features": ["w"], "by": [1, 0]}}, {"order": {}}]},
               {"name": "b", "stages": [{"translate": {"features": ["w"], "by": [1, 0, 0]}}, {"order": 1}]}"#,
            "views.json:1:95: pipelines[0].stages[0].translate.by: found 2 values, expected an array of 3 values
             views.json:2:104: pipelines[1].stages[1].order: found 1, expected an object",
        ),
    ] {
        assert_told(&of_pipelines(pipelines), expected);
    }
    assert_told(
        &told(r#"{"version": 1, "stream": 3, "steering": {"wait_for_viewer": true}}"#),
        "views.json:1:26: stream: found 3, expected an object",
    );
    assert_told(
        &told(r#"{"pipelines": [{"name": "a", "stages": [{"quality": {}}, {"quality": {}}]}]}"#),
        "views.json:1:1: the key `version` is missing
         views.json:1:70: pipelines[0].stages[1].quality: found twice, expected at most once",
    );
    // Where the text is not JSON, nothing else is known of it.
    assert_told(
        &told("{\"version\": 2,\n \"pipelines\": [}"),
        "views.json:2:16: pipelines[0]: found '}', expected a value",
    );
    assert_told(&told("[1]"), "views.json:1:1: found an array of 1, expected an object");
}

#[test]
fn what_is_beyond_a_limit_is_told_and_not_made() {
    // Each would have as many monitors as it has bins or samples.
    let text = r#"{"version": 1, "pipelines": [{"name": "a", "stages": [
        {"statistics": {"field": "p"}},
        {"histogram": {"field": "p", "name": "h", "bins": 4294967295}},
        {"spectrum": {"monitor": "p.max", "name": "s", "samples": 4294967295}}], "when": "h.lower > 0", "then": [{"stop": {}}]}]}"#;
    let told = told(text);
    assert!(
        told.contains("histogram.bins: found 4294967295 bins, expected at most 1024"),
        "{told}"
    );
    assert!(told.contains("spectrum.samples: found 4294967295"), "{told}");
    assert_eq!(told.lines().count(), 2, "{told}");
}

/// A pipeline may name the monitors of all others: were they listed for each, this would take minutes.
#[test]
fn as_many_pipelines_and_monitors_as_there_may_be_are_checked() {
    let pipelines: Vec<String> = (0..1024)
        .map(|number| {
            format!(
                r#"{{"name": "p{number}", "stages": [
                    {{"histogram": {{"field": "p", "name": "h", "bins": 1024}}}}]}}"#
            )
        })
        .collect();
    let text = format!(r#"{{"version": 1, "pipelines": [{}]}}"#, pipelines.join(","));
    assert_eq!(told(&text), "nothing");
    assert!(parse(&text, "views.json").is_ok());
}

#[test]
fn all_errors_of_orders_are_told() {
    assert_told(
        &told_of_orders(
            r#"[
  {"at": {"cycl": 3}, "order": {"edits": [{"translate": {"features": ["a"], "by": [1, 2]}}, {"rotat": {"features": ["a"], "axis": [0, 0, 0], "degrees": 1}}]}},
  {"pause": {}, "stop": {}},
  {"id": "x", "parameter": {"name": "inflow", "value": "3"}},
  {"order": {"stack": [{"translate": {"by": [0, 0, 0]}}], "guard": {"min_scaled_jacobian": 2}}},
  {"order": {"undo": 0}}, {}
]"#,
        ),
        r#"
orders.json:2:11: [0].at.cycl: found the unknown name `cycl`, expected `cycle` or `time`; did you mean `cycle`?
orders.json:2:83: [0].order.edits[0].translate.by: found 2 values, expected an array of 3 values
orders.json:2:94: [0].order.edits[1].rotat: found the unknown name `rotat`, expected `translate`, `rotate`, `scale_direction`, `scale_normals`, `affine`, `displacement` or `skeleton`; did you mean `rotate`?
orders.json:2:131: [0].order.edits[1].rotat.axis: expected a direction, whose length is not 0
orders.json:3:3: [1]: found 2 commands, expected exactly one of `order`, `pause`, `resume`, `stop`, `parameter`, `pipelines` and `cancel`
orders.json:4:56: [2].parameter.value: found "3", expected a number
orders.json:5:38: [3].order.stack[0].translate.features: there is no handle; expected features, a region, or both
orders.json:5:92: [3].order.guard.min_scaled_jacobian: found 2, expected a number from 0 to 1
orders.json:6:22: [4].order.undo: found 0, expected a whole number from 1 to 4294967295
orders.json:6:27: [5]: found no command, expected one of `order`, `pause`, `resume`, `stop`, `parameter`, `pipelines` and `cancel`
"#,
    );
    // Of lines each is a text of its own; the last may be torn.
    assert_told(
        &told_of_orders(
            r#"{"id":"a","status":"accepted","cycle":3,"time":0.3,"order":{"undo":1,"gard":{"otherwise":"pray"}}}
{"id":"b","status":"acepted","cycle":"4","time":0.4,"order":{"edits":[]}}

{"puase": {}
{"id":"c","stauts":"applied","cycle":9,"time":0.9}
{"id":"c","stat"#,
        ),
        r#"
orders.json:1:70: order.gard: found the unknown key `gard`, expected `edits`, `stack`, `undo`, `schedule`, `deform`, `guard`, `replaces` or `deadline`; did you mean `guard`?
orders.json:1:90: order.gard.otherwise: found the unknown name `pray`, expected `reject`, `untangle` or `clamp`
orders.json:2:20: status: found the unknown name `acepted`, expected `accepted`, `applied`, `rejected`, `not_followed` or `not_confirmed`; did you mean `accepted`?
orders.json:2:38: cycle: found "4", expected a whole number from 0 to 18446744073709551615
orders.json:4:13: found the end of the text, expected ',' or '}'
orders.json:5:11: stauts: found the unknown key `stauts`, expected `id`, `status`, `cycle`, `time`, `by`, `reason`, `min_scaled_jacobian`, `fraction`, `order`, `pause`, `resume`, `stop`, `parameter`, `pipelines` or `cancel`; did you mean `status`?
"#,
    );
    // What is written over several lines is one text.
    assert_told(
        &told_of_orders("{\n  \"at\": {\"cycle\": 3},\n  \"pause\": {},\n}"),
        "orders.json:4:1: found '}', expected a key in double quotes",
    );
}

#[test]
fn a_file_is_read_as_what_its_keys_say() {
    let kind = |text: &str| match check_content(text, "file", None) {
        Ok(Content::Configuration(_)) => "configuration".to_owned(),
        Ok(Content::Orders(orders)) => format!("{} orders", orders.len()),
        Ok(Content::Order(_)) => "order".to_owned(),
        Ok(Content::Edits(edits)) => format!("{} edits", edits.len()),
        Err(errors) => errors.first().message.clone(),
    };
    assert_eq!(kind(DESIGN), "configuration");
    let edit = r#"{"translate": {"features": ["a"], "by": [1, 0, 0]}}"#;
    assert_eq!(kind(&format!("[{edit}, {edit}]")), "2 edits");
    assert_eq!(kind(&format!(r#"{{"edits": [{edit}]}}"#)), "order");
    assert_eq!(kind(r#"{"undo": 1, "schedule": {"steps": 2}}"#), "order");
    assert_eq!(kind(r#"{"order": {"undo": 1}}"#), "1 orders");
    assert_eq!(kind(r#"[{"order": {"undo": 1}}, {"at": {"cycle": 1}, "stop": {}}]"#), "2 orders");
    assert_eq!(kind("[]"), "0 orders");
    assert_eq!(kind("{\"pause\": {}}\n{\"resume\": {}}\n"), "2 orders");
    assert_eq!(
        kind(r#"{"id":"a","status":"applied","cycle":3,"time":0.3,"order":{"undo":1}}"#),
        "1 orders"
    );
    for (text, expected) in [
        (r#"{"pipelnes": []}"#, "the key `version` is missing"),
        (r#"{"edit": []}"#, "found the unknown key `edit`, expected `edits`,"),
        (r#"[{"translat": {}}]"#, "found the unknown name `translat`"),
        (r#"[{"odrer": {}}]"#, "found the unknown key `odrer`, expected `at`,"),
        (r#"[{}]"#, "found no command"),
        ("{}", "the key `version` is missing"),
        (" ", "found the end of the text, expected a value"),
        ("3", "found 3, expected an object"),
    ] {
        assert!(kind(text).starts_with(expected), "{text}: {}", kind(text));
    }
}

#[test]
fn of_very_many_errors_the_first_are_told() {
    let stages = r#"{"slice": 3},"#.repeat(111) + r#"{"slice": 4}"#;
    let text = format!(r#"{{"version": 1, "pipelines": [{{"name": "a", "stages": [{stages}]}}]}}"#);
    let errors = check(&text, "a").unwrap_err();
    assert_eq!((errors.iter().count(), errors.more(), errors.count()), (100, 12, 112));
    let text = errors.to_string();
    assert_eq!(text.lines().count(), 101);
    assert!(text.ends_with("\nand 12 more"), "{text}");
    // Lines add up.
    let errors = check_orders(&"{\"puase\": 1}\n".repeat(103), "a").unwrap_err();
    assert_eq!((errors.iter().count(), errors.count()), (100, 206));
    assert_eq!(errors.iter().last().map(|error| error.line), Some(50));
    // Objects of very many keys and very many values end as well.
    let keys: Vec<String> = (0..3000).map(|key| format!(r#""k{key}": {key}"#)).collect();
    let text = format!(r#"{{"version": 1, {}}}"#, keys.join(", "));
    assert!(check(&text, "a").unwrap_err().count() > 10);
    let many = format!("[{}]", "3,".repeat(20_000) + "3");
    let text = format!(r#"{{"version": 1, "pipelines": {many}}}"#);
    assert_eq!(check(&text, "a").unwrap_err().count(), 20_001);
}

/// Whether the first error that reading it at once comes upon is among all errors.
fn has(errors: &LanguageErrors, first: &LanguageError) -> bool {
    errors.more() > 0 || errors.iter().any(|error| error == first)
}

#[test]
fn files_of_the_book_are_well() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/pipelines");
    let mut count = 0;
    for entry in fs::read_dir(folder).expect("the folder is there") {
        let path = entry.expect("it can be read").path();
        if path.extension().is_some_and(|extension| extension == "json") {
            let text = fs::read_to_string(&path).expect("a text");
            let content = check_content(&text, &path.display().to_string(), None);
            assert!(matches!(content, Ok(Content::Configuration(_))), "{content:?}");
            count += 1;
        }
    }
    assert!(count >= 5);
}

/// Texts from which broken ones are made: the design's, and one of each kind of stage and setting.
fn sources() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/pipelines");
    let mut files: Vec<_> = fs::read_dir(folder)
        .expect("the folder is there")
        .map(|entry| entry.expect("it can be read").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "json"))
        .collect();
    files.sort();
    let texts = files.iter().map(|path| fs::read_to_string(path).expect("a text"));
    std::iter::once(DESIGN.to_owned()).chain(texts).collect()
}

const ORDERS: &str = r#"[
  {"at": {"cycle": 3}, "id": "a", "order": {"edits": [{"translate": {"features": ["a"], "by": [1, 2, 3]}},
    {"rotate": {"features": ["a"], "axis": [0, 0, 1], "degrees": 1}}], "guard": {"otherwise": "clamp"}}},
  {"pause": {}}, {"parameter": {"name": "inflow", "value": 3}}, {"at": {"time": 0.5}, "order": {"undo": 1}},
  {"order": {"stack": []}}
]"#;

/// A change of a value somewhere in a tree.
#[derive(Debug, Clone)]
enum Slip {
    /// The value becomes another.
    Value(serde_json::Value),
    /// A key, or an item, is gone.
    Gone,
    /// The key gets another letter.
    Misspelt,
    /// Another key stands beside it.
    Beside,
}

fn slip() -> impl Strategy<Value = Slip> {
    let values = [
        serde_json::json!(null),
        serde_json::json!(-1),
        serde_json::json!(1e300),
        serde_json::json!("velocty.mx > 3"),
        serde_json::json!({}),
        serde_json::json!({"surface": {}}),
        serde_json::json!([]),
        serde_json::json!([{"quality": {}}]),
        serde_json::json!(true),
    ];
    prop_oneof![
        prop::sample::select(values.to_vec()).prop_map(Slip::Value),
        Just(Slip::Gone),
        Just(Slip::Misspelt),
        Just(Slip::Beside),
    ]
}

/// All ways to a value.
fn ways(value: &serde_json::Value, way: &mut Vec<String>, all: &mut Vec<Vec<String>>) {
    let mut below = |key: String, value: &serde_json::Value| {
        way.push(key);
        all.push(way.clone());
        ways(value, way, all);
        way.pop();
    };
    match value {
        serde_json::Value::Array(items) => {
            items.iter().enumerate().for_each(|(index, item)| below(index.to_string(), item));
        }
        serde_json::Value::Object(members) => {
            members.iter().for_each(|(key, member)| below(key.clone(), member));
        }
        _ => {}
    }
}

fn slipped(text: &str, slips: &[(prop::sample::Index, Slip)]) -> String {
    let mut value: serde_json::Value = serde_json::from_str(text).expect("JSON");
    for (place, slip) in slips {
        let mut all = Vec::new();
        ways(&value, &mut Vec::new(), &mut all);
        if all.is_empty() {
            break;
        }
        let way = place.get(&all);
        let (last, above) = way.split_last().expect("a way");
        let parent = above.iter().fold(&mut value, |value, key| match value {
            serde_json::Value::Array(items) => &mut items[key.parse::<usize>().expect("an index")],
            value => &mut value[key.as_str()],
        });
        match (parent, slip) {
            (serde_json::Value::Array(items), Slip::Value(new)) => {
                items[last.parse::<usize>().expect("an index")] = new.clone();
            }
            (serde_json::Value::Array(items), Slip::Gone) => {
                items.remove(last.parse().expect("an index"));
            }
            (serde_json::Value::Array(items), Slip::Beside) => items.push(3.into()),
            (serde_json::Value::Array(items), Slip::Misspelt) => items.push(items[0].clone()),
            (serde_json::Value::Object(members), slip) => match slip {
                Slip::Value(new) => {
                    members.insert(last.clone(), new.clone());
                }
                Slip::Gone => {
                    members.remove(last);
                }
                Slip::Misspelt => {
                    let member = members.remove(last).expect("a member");
                    members.insert(format!("{last}x"), member);
                }
                Slip::Beside => {
                    members.insert("beside".into(), 3.into());
                }
            },
            _ => unreachable!(),
        }
    }
    serde_json::to_string_pretty(&value).expect("JSON")
}

/// A trial that finds nothing.
struct Nothing;

impl Trial for Nothing {
    fn configuration(&mut self, _: &Config, _: &dyn Fn(usize) -> bool) -> Vec<Problem> {
        Vec::new()
    }

    fn edits(&mut self, _: &[Edit]) -> Vec<Problem> {
        Vec::new()
    }

    fn deformation(&mut self, _: &Deformation) -> Vec<Problem> {
        Vec::new()
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, failure_persistence: None, ..ProptestConfig::default() })]

    /// What is accepted is the same as without the collecting, and of what is refused the error
    /// that comes first there is told.
    #[test]
    fn the_same_texts_are_accepted_as_at_once(
        source in any::<prop::sample::Index>(),
        slips in proptest::collection::vec((any::<prop::sample::Index>(), slip()), 0..5),
    ) {
        let sources = sources();
        let text = slipped(&sources[source.index(sources.len())], &slips);
        // What is read in pieces for a trial is what is read at once.
        prop_assert_eq!(check_content(&text, "a", Some(&mut Nothing)), check_content(&text, "a", None));
        match (parse_valid::<Config>(&text, "a"), check(&text, "a")) {
            (Ok(_), found) => prop_assert_eq!(found, parse(&text, "a").map_err(LanguageErrors::from)),
            (Err(first), Ok(_)) => prop_assert!(false, "{}\n{}", first, text),
            (Err(first), Err(errors)) => {
                prop_assert!(has(&errors, &first), "{}\nnot among\n{}\n{}", first, errors, text);
                let places: Vec<_> = errors.iter().map(|error| (error.line, error.column)).collect();
                prop_assert!(places.is_sorted(), "{}", errors);
            }
        }
        let text = slipped(ORDERS, &slips);
        match (parse_orders(&text, "a"), check_orders(&text, "a")) {
            (Ok(orders), found) => prop_assert_eq!(Ok(orders), found),
            (Err(first), Ok(_)) => prop_assert!(false, "{}\n{}", first, text),
            (Err(first), Err(errors)) => {
                prop_assert!(has(&errors, &first), "{}\nnot among\n{}\n{}", first, errors, text);
            }
        }
        prop_assert_eq!(check_content(&text, "a", Some(&mut Nothing)), check_content(&text, "a", None));
    }

    /// One slip is one error, or none: what follows from it is not told.
    #[test]
    fn one_slip_is_told_once(
        source in any::<prop::sample::Index>(),
        place in any::<prop::sample::Index>(),
    ) {
        let sources = sources();
        let text = slipped(&sources[source.index(sources.len())], &[(place, Slip::Beside)]);
        if let Err(errors) = check(&text, "a") {
            prop_assert_eq!(errors.count(), 1, "{}\n{}", errors, text);
        }
    }

    /// Bytes overwritten, removed or doubled: never a panic, and always a place in the text.
    #[test]
    fn no_mutation_makes_the_check_panic(text in mutated(DESIGN)) {
        let plain = parse_valid::<Config>(&text, "fuzz");
        prop_assert_eq!(plain.is_ok(), check(&text, "fuzz").is_ok());
        if let (Err(errors), Err(first)) = (check(&text, "fuzz"), plain) {
            prop_assert!(has(&errors, &first), "{}\nnot among\n{}\n{}", first, errors, text);
            for error in errors.iter() {
                let line = text.split('\n').nth(error.line - 1).unwrap_or_default();
                prop_assert!(error.column <= line.chars().count() + 1, "{}\n{}", error, text);
            }
        }
        let _ = check_content(&text, "fuzz", None);
    }
}
