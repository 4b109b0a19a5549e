//! Documents at and beyond each limit: the same words whatever reads them, and no abort.

use proptest::prelude::*;
use serde_json::{Value, json};
use tombolo_deform::edit::Edit;
use tombolo_pipelines::language::{
    Change, Config, LanguageError, Message, Order, parse, parse_json, parse_message, parse_orders,
    parse_valid,
};
use tombolo_pipelines::limits::{
    ALL, DEPTH, DOCUMENT, EDITS, FORMULA, LISTED, Limit, PENDING, PENDING_BYTES, SHAPES, TEXT,
    VALUES, WAITING, WAITING_BYTES,
};

fn words(limit: Limit, found: usize) -> String {
    format!("found {found} {}, expected at most {}", limit.what, limit.most)
}

const EDIT: &str = r#"{"translate":{"features":["a"],"by":[0,0,1]}}"#;

fn list(item: &str, count: usize) -> String {
    let mut text = String::with_capacity(count * (item.len() + 1) + 2);
    text.push('[');
    for index in 0..count {
        text.push_str(if index == 0 { "" } else { "," });
        text.push_str(item);
    }
    text + "]"
}

/// What each reader says of an order: a file of one order, of several, of a journal, and a viewer's
/// message.
fn read_everywhere(order: &str) -> Vec<Result<Order, LanguageError>> {
    let of_file = |text: String| {
        parse_orders(&text, "orders.json").map(|mut commands| match commands.remove(0).command {
            tombolo_pipelines::language::Command::Order(order) => order,
            other => panic!("{other:?}"),
        })
    };
    let (_, message) = parse_message(&format!(r#"{{"order":{order}}}"#));
    let message = message.map(|message| match message {
        Message::Command(tombolo_pipelines::language::Command::Order(order)) => order,
        other => panic!("{other:?}"),
    });
    vec![
        parse_valid(order, "edits.json"),
        of_file(format!(r#"[{{"order":{order}}}]"#)),
        of_file(format!(r#"{{"order":{order}}}"#)),
        of_file(format!(r#"{{"id":"a","status":"applied","cycle":3,"time":0.3,"order":{order}}}"#)),
        message,
    ]
}

fn all_say(order: &str, expected: &str) {
    for read in read_everywhere(order) {
        let error = read.expect_err(expected);
        assert_eq!(error.message, expected, "{}", error.path);
    }
}

fn all_take(order: &str) {
    for read in read_everywhere(order) {
        read.unwrap();
    }
}

#[test]
fn an_order_may_hold_so_much() {
    let steps = |steps: usize| format!(r#"{{"edits":[{EDIT}],"schedule":{{"steps":{steps}}}}}"#);
    all_take(&steps(SHAPES.most));
    for beyond in [SHAPES.most + 1, 1_000_000_000, 4_294_967_295] {
        all_say(&steps(beyond), &words(SHAPES, beyond));
        let config = format!(
            r#"{{"version":1,"pipelines":[{{"name":"a","on":"order","stages":[{{"schedule":{{"steps":{beyond}}}}}]}}]}}"#
        );
        let error = parse(&config, "a.json").unwrap_err();
        assert_eq!(
            (error.message, error.path),
            (words(SHAPES, beyond), "pipelines[0].stages[0].schedule.steps".into())
        );
    }
    for key in ["edits", "stack"] {
        all_take(&format!(r#"{{"{key}":{}}}"#, list(EDIT, EDITS.most)));
        all_say(
            &format!(r#"{{"{key}":{}}}"#, list(EDIT, EDITS.most + 1)),
            &words(EDITS, EDITS.most + 1),
        );
    }
    let faces = |count: usize| {
        let region = format!(
            r#"{{"translate":{{"region":{{"faces":{}}},"by":[0,0,1]}}}}"#,
            list("7", count)
        );
        format!(r#"{{"edits":[{region},{region}]}}"#)
    };
    all_take(&faces(LISTED.most / 2));
    all_say(&faces(LISTED.most / 2 + 1), &words(LISTED, LISTED.most + 2));
    let named = |count: usize| {
        let names = list("\"a\"", count);
        format!(r#"{{"edits":[{{"translate":{{"features":{names},"by":[0,0,1]}}}}]}}"#)
    };
    all_take(&named(LISTED.most));
    all_say(&named(LISTED.most + 1), &words(LISTED, LISTED.most + 1));
}

#[test]
fn a_displacement_of_as_many_vertices_as_are_allowed_is_a_document() {
    let count = LISTED.most;
    let value = [-1.0 / 3.0e200; 3];
    let edits: Vec<Edit> =
        serde_json::from_value(json!([{"displacement": {"vertices": [], "file": "x"}}])).unwrap();
    let Edit::Displacement(mut import) = edits[0].clone() else { unreachable!() };
    (import.file, import.values) = (None, vec![value; count].into());
    import.vertices = (4_000_000_000_u32..).take(count).collect();
    let order: Order = Change::Edits(vec![Edit::Displacement(import)]).into();
    let written = serde_json::to_string(&order).unwrap();
    assert!(written.len() <= DOCUMENT.most, "{}", written.len());
    assert!(parse_valid::<Order>(&written, "journal.jsonl").unwrap() == order);
}

#[test]
fn a_document_may_be_so_long_and_deep() {
    let padded = |bytes: usize| format!("{}{{\"undo\":1}}", " ".repeat(bytes - 10));
    parse_valid::<Order>(&padded(DOCUMENT.most), "a").unwrap();
    let long = padded(DOCUMENT.most + 1);
    let error = parse_valid::<Order>(&long, "a").unwrap_err();
    assert_eq!(
        (error.message, error.line, error.column),
        (words(DOCUMENT, DOCUMENT.most + 1), 1, 1)
    );
    assert_eq!(parse_message(&long).1.unwrap_err().message, words(DOCUMENT, DOCUMENT.most + 1));
    assert_eq!(parse(&long, "a").unwrap_err().message, words(DOCUMENT, DOCUMENT.most + 1));

    assert!(parse_json::<Vec<u8>>(&list("1", VALUES.most - 1), "a").is_ok());
    for (item, limit) in [("1", VALUES), ("\"x\"", VALUES), ("{}", VALUES)] {
        let error = parse_json::<Value>(&list(item, VALUES.most), "a").unwrap_err();
        assert_eq!(error.message, words(limit, limit.most + 1));
    }
    let nested = |depth: usize| format!("{}1{}", "[".repeat(depth), "]".repeat(depth));
    parse_json::<Value>(&nested(DEPTH.most), "a").unwrap();
    let error = parse_json::<Value>(&nested(DEPTH.most + 1), "a").unwrap_err();
    assert_eq!(error.message, words(DEPTH, DEPTH.most + 1));
    let error = parse_json::<Value>(&"{\"a\":".repeat(1_000_000), "a").unwrap_err();
    assert_eq!(error.message, words(DEPTH, DEPTH.most + 1));

    let text = |bytes: usize| format!("{:?}", "x".repeat(bytes));
    parse_json::<String>(&text(TEXT.most), "a").unwrap();
    assert_eq!(
        parse_json::<String>(&text(TEXT.most + 1), "a").unwrap_err().message,
        words(TEXT, TEXT.most + 1)
    );
    let formula = |length: usize| -> Result<Config, LanguageError> {
        let when = format!("cycle > 1{}", " ".repeat(length - 9));
        let config = json!({"version": 1, "pipelines": [{"name": "a", "stages": [], "when": when, "then": [{"stop": {}}]}]});
        parse(&config.to_string(), "a")
    };
    formula(FORMULA.most).unwrap();
    let error = formula(FORMULA.most + 1).unwrap_err();
    assert!(error.message.ends_with(&words(FORMULA, FORMULA.most + 1)), "{error}");
}

#[test]
fn so_many_commands_may_wait() {
    let command = r#"{"pause":{}}"#;
    let lines = |count: usize| format!("{command}\n").repeat(count);
    for text in [list(command, WAITING.most), lines(WAITING.most)] {
        assert_eq!(parse_orders(&text, "a").unwrap().len(), WAITING.most);
    }
    for text in [list(command, WAITING.most + 1), lines(WAITING.most + 1)] {
        assert_eq!(parse_orders(&text, "a").unwrap_err().message, words(WAITING, WAITING.most + 1));
    }
    let long = " ".repeat(WAITING_BYTES.most + 1);
    assert_eq!(
        parse_orders(&long, "a").unwrap_err().message,
        words(WAITING_BYTES, WAITING_BYTES.most + 1)
    );
}

#[test]
fn the_limits_of_a_stream_have_ranges_and_defaults() {
    let parsed = |limits: &str| {
        let text = format!(r#"{{"version": 1, "stream": {{"limits": {limits}}}}}"#);
        tombolo_pipelines::language::parse(&text, "a").map(|config| config.stream.unwrap().limits)
    };
    let usual = parsed("{}").unwrap();
    assert_eq!((usual.messages.get(), usual.messages_at_once.get()), (20, 40));
    assert_eq!(usual.pending(), PENDING);
    assert_eq!(usual.pending_bytes(), PENDING_BYTES);
    let keys = ["messages", "messages_at_once", "sessions", "waiting", "waiting_megabytes"];
    let of_connections = ["unknown_connections", "unknown_connections_of_address"];
    for key in keys.into_iter().chain(of_connections) {
        assert!(parsed(&format!(r#"{{"{key}": 10000}}"#)).is_ok(), "{key}");
        let error = parsed(&format!(r#"{{"{key}": 10001}}"#)).unwrap_err();
        assert_eq!(error.path, format!("stream.limits.{key}"));
        assert_eq!(error.message, "found 10001, expected 1 to 10000");
        assert!(parsed(&format!(r#"{{"{key}": 0}}"#)).is_err(), "{key}");
    }
}

#[test]
fn no_more_of_a_file_is_read_than_may_be_in_it() {
    use tombolo_pipelines::language::read_text;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("long.json");
    // As long as it says, and not a byte of it on the disk.
    std::fs::File::create(&file).unwrap().set_len(1 << 40).unwrap();
    let error = read_text(&file, DOCUMENT).unwrap_err().to_string();
    assert!(error.ends_with(&words(DOCUMENT, 1 << 40)), "{error}");
    // One that says nothing of its length.
    if cfg!(unix) {
        let error = read_text("/dev/zero".as_ref(), TEXT).unwrap_err().to_string();
        assert!(error.ends_with(&words(TEXT, TEXT.most + 1)), "{error}");
    }
    assert!(
        read_text(&folder.path().join("none"), DOCUMENT).unwrap_err().to_string().contains("none")
    );
}

#[test]
fn limits_are_told_apart() {
    for (index, limit) in ALL.iter().enumerate() {
        limit.check(limit.most).unwrap();
        assert!(limit.check(limit.most + 1).is_err() && !limit.of.is_empty());
        let name = (limit.what, limit.of);
        assert!(ALL[..index].iter().all(|other| (other.what, other.of) != name), "{name:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// Whatever the number is, an order of a schedule is taken, or refused in words.
    #[test]
    fn no_schedule_is_too_long_to_be_refused(steps in any::<u64>()) {
        let order = format!(r#"{{"edits":[{EDIT}],"schedule":{{"steps":{steps}}}}}"#);
        for read in read_everywhere(&order) {
            prop_assert_eq!(read.is_ok(), (1..=SHAPES.most as u64).contains(&steps));
        }
    }

    /// Whatever opens and never closes, is deep, or stands twice.
    #[test]
    fn no_text_of_brackets_ends_anything(brackets in prop::collection::vec(prop::sample::select(vec!["[", "{\"a\":", "]", "}", ",", "1"]), 0..4000)) {
        let _ = parse_json::<Value>(&brackets.concat(), "a");
        let _ = parse_orders(&brackets.concat(), "a");
        let _ = parse_message(&brackets.concat());
    }
}
