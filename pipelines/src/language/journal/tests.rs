//! Journals that are read again.

use super::*;

#[test]
fn only_what_took_effect_in_the_newest_run_is_carried_out_again() {
    let text = r#"{"run":{"id":"1","version":"0","began":0,"deform":{},"guard":{},"schedule":{"steps":1}}}
{"id":"a","status":"accepted","cycle":1,"time":0.1,"pause":{}}
{"id":"a","status":"applied","cycle":1,"time":0.1}
{"run":{"id":"2","version":"0","began":0,"deform":{},"guard":{},"schedule":{"steps":2}}}
{"id":"a","status":"accepted","cycle":3,"time":0.3,"order":{"undo":1},"by":{"viewer":"c1"}}
{"id":"b","status":"accepted","cycle":3,"time":0.3,"order":{"undo":2},"by":{"pipeline":"p"}}
{"id":"c","status":"accepted","cycle":3,"time":0.3,"order":{"undo":3},"by":"file"}
{"id":"d","status":"accepted","cycle":3,"time":0.3,"cancel":{"order":"c"}}
{"id":"e","status":"accepted","cycle":3,"time":0.3,"order":{"undo":4}}
{"id":"b","status":"applied","cycle":4,"time":0.4}
{"shape":{"order":"b","shape":1,"cycle":4}}
{"id":"c","status":"rejected","cycle":5,"time":0.5,"reason":"cancelled"}
{"id":"d","status":"applied","cycle":5,"time":0.5}
{"id":"a","status":"applied","cycle":6,"time":0.6}
{"lost":{"lines":2}}
{"end":{"cycle":7,"time":0.7}}
"#;
    let recording = parse_journal(text, "journal.jsonl").unwrap();
    let ids = |commands: &[TimedCommand]| -> Vec<(String, Option<At>)> {
        commands.iter().map(|it| (it.id.clone().unwrap(), it.at)).collect()
    };
    let (b, a) = (("b".to_owned(), Some(At::Cycle(4))), ("a".to_owned(), Some(At::Cycle(6))));
    assert_eq!(ids(&recording.commands), [b, a.clone()]);
    assert_eq!(ids(&super::super::parse_orders(text, "journal.jsonl").unwrap()), [a]);
    assert_eq!((recording.lost, recording.shapes.len()), (2, 1));
    assert_eq!(recording.run.unwrap().id, "2");
    assert!(is_journal(text) && is_journal("") && is_journal("{\"run\":{\"id\":"));
    assert!(!is_journal("{\"version\": 1}\n") && !is_journal("cycle,time\n"));
}

/// An order that is given again after it was rejected is carried out with its new text.
#[test]
fn an_order_that_is_given_again_is_carried_out_as_it_is_then() {
    let text = r#"{"run":{"id":"1","version":"0","began":0,"deform":{},"guard":{},"schedule":{"steps":1}}}
{"id":"a","status":"accepted","cycle":1,"time":0.1,"order":{"undo":1}}
{"id":"a","status":"rejected","cycle":1,"time":0.1,"reason":"the disk has not answered for 2 seconds"}
{"id":"a","status":"accepted","cycle":2,"time":0.2,"order":{"undo":2}}
{"id":"a","status":"applied","cycle":3,"time":0.3}
"#;
    let recording = parse_journal(text, "journal.jsonl").unwrap();
    let [again] = &recording.commands[..] else { panic!("{:?}", recording.commands) };
    assert_eq!((again.id.as_deref(), again.at), (Some("a"), Some(At::Cycle(3))));
    assert_eq!(
        serde_json::to_value(&again.command).unwrap(),
        serde_json::json!({"order": {"undo": 2}})
    );
}

#[test]
fn a_restarted_run_begins_with_the_lines_before_its_checkpoint() {
    let header = |id: &str, restart: &str| {
        format!(
            r#"{{"run":{{"id":"{id}","version":"0","began":0,"deform":{{}},"guard":{{}},"schedule":{{"steps":{}}}{restart}}}}}"#,
            id.trim_start_matches('r')
        )
    };
    let restart = |run: &str, checkpoint: &str| {
        format!(r#","restart":{{"run":"{run}","checkpoint":"{checkpoint}","cycle":3}}"#)
    };
    let entry = |id: &str, cycle: u64| {
        format!(
            r#"{{"id":"{id}","status":"accepted","cycle":{cycle},"time":0,"order":{{"undo":1}}}}
{{"id":"{id}","status":"applied","cycle":{cycle},"time":0}}
{{"shape":{{"order":"{id}","shape":1,"cycle":{cycle}}}}}"#
        )
    };
    let checkpoint = |id: &str| format!(r#"{{"checkpoint":{{"id":"{id}","cycle":3,"time":0}}}}"#);
    let text = [
        header("r1", ""),
        entry("a", 2),
        checkpoint("k1"),
        entry("gone", 4),
        header("r2", &restart("r1", "k1")),
        entry("b", 5),
        checkpoint("k2"),
        entry("gone", 6),
        header("r3", &restart("r2", "k2")),
        entry("c", 7),
        // Its line about the checkpoint was lost.
        header("r4", &restart("r3", "k3")),
        entry("d", 8),
    ]
    .join("\n");
    let recording = parse_journal(&text, "journal.jsonl").unwrap();
    let ids: Vec<_> = recording.commands.iter().map(|it| it.id.clone().unwrap()).collect();
    assert_eq!(ids, ["a", "b", "c", "d"]);
    let cycles: Vec<u64> = recording.shapes.iter().map(|shape| shape.cycle).collect();
    assert_eq!(cycles, [2, 5, 7, 8]);
    assert_eq!(recording.run.unwrap().schedule.steps.get(), 1);
    let alone = [header("r2", &restart("r1", "k1")), entry("b", 5)].join("\n");
    let error = parse_journal(&alone, "journal.jsonl").unwrap_err();
    assert!(error.message.contains("run r1") && error.path == "run.restart", "{error}");
}

#[test]
fn a_restarted_run_is_not_stopped_where_the_one_before_was() {
    let header = |id: &str, restart: &str| {
        format!(
            r#"{{"run":{{"id":"{id}","version":"0","began":0,"deform":{{}},"guard":{{}},"schedule":{{"steps":1}}{restart}}}}}"#
        )
    };
    let applied = |id: &str, command: &str, cycle: u64| {
        format!(
            r#"{{"id":"{id}","status":"accepted","cycle":{cycle},"time":0,"{command}":{{}},"by":"program"}}
{{"id":"{id}","status":"applied","cycle":{cycle},"time":0}}"#
        )
    };
    let heating = r#"{"id":"p","status":"accepted","cycle":1,"time":0,"parameter":{"name":"heating","value":1}}
{"id":"p","status":"applied","cycle":1,"time":0}"#;
    let first = [
        header("r1", ""),
        heating.to_owned(),
        applied("pause", "pause", 2),
        applied("resume", "resume", 2),
        applied("pause again", "pause", 3),
        applied("stop", "stop", 3),
    ];
    let second = [
        r#"{"checkpoint":{"id":"k1","cycle":3,"time":0}}"#.to_owned(),
        r#"{"end":{"cycle":3,"time":0}}"#.to_owned(),
        header("r2", r#","restart":{"run":"r1","checkpoint":"k1","cycle":3}"#),
        applied("own stop", "stop", 8),
    ];
    let ids = |commands: Vec<TimedCommand>| -> Vec<String> {
        commands.into_iter().filter_map(|timed| timed.id).collect()
    };
    let [first, both] = [first.join("\n"), [&first[..], &second[..]].concat().join("\n")];
    for (text, expected) in [
        (&first, &["p", "pause", "resume", "pause again", "stop"][..]),
        (&both, &["p", "own stop"][..]),
    ] {
        assert_eq!(ids(parse_journal(text, "journal.jsonl").unwrap().commands), expected);
        assert_eq!(ids(super::super::parse_orders(text, "journal.jsonl").unwrap()), expected);
    }
}

#[test]
fn an_order_that_has_replaced_another_replaces_none_in_a_file_of_orders() {
    let journal = r#"{"id":"a","status":"accepted","cycle":3,"time":0.3,"order":{"undo":1}}
{"id":"b","status":"accepted","cycle":4,"time":0.4,"order":{"undo":2,"replaces":"a"}}
{"id":"a","status":"rejected","cycle":5,"time":0.5,"reason":"replaced by order b"}
{"id":"b","status":"applied","cycle":5,"time":0.5}
{"at":{"cycle":9},"id":"c","order":{"undo":1,"replaces":"d"}}
"#;
    let replaces = |commands: Vec<TimedCommand>| -> Vec<Option<String>> {
        let replaces = |timed: TimedCommand| match timed.command {
            Command::Order(order) => order.replaces,
            _ => None,
        };
        commands.into_iter().map(replaces).collect()
    };
    let (a, d) = (Some("a".to_owned()), Some("d".to_owned()));
    let orders = super::super::parse_orders(journal, "journal.jsonl").unwrap();
    assert_eq!(replaces(orders), [None, d.clone()]);
    // A run that is carried out again says what the first one said.
    let recording = parse_journal(journal, "journal.jsonl").unwrap();
    assert_eq!(replaces(recording.commands), [a, d]);
}

#[test]
fn one_torn_line_is_a_journal_of_nothing() {
    for text in ["{\"run\":{\"id\":\"1\",\"ver", "{\"id\":\"a\",\"status\":\"acc"] {
        assert_eq!(parse_journal(text, "journal.jsonl").unwrap(), Recording::default());
    }
}
