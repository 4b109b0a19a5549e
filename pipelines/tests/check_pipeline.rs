//! Every error of a pipeline that is to be set in a run.

use tombolo_pipelines::language::{
    Beside, LanguageError, Pipeline, PipelineChange, check_pipeline, parse, parse_json,
};

fn run() -> Vec<Pipeline> {
    let text = r#"{"version": 1, "pipelines": [
        {"name": "inlet", "stages": [{"statistics": {"field": "pressure", "name": "inlet"}}]},
        {"name": "drop", "stages": [{"statistics": {"field": "pressure", "name": "outlet"}},
            {"difference": {"name": "drop", "of": "inlet.mean", "minus": "outlet.mean"}}]},
        {"name": "shape", "on": "order", "stages": [{"schedule": {"steps": 3}}]}]}"#;
    parse(text, "test.json").unwrap().pipelines
}

fn errors(text: &str, replaced: Option<&str>) -> Vec<LanguageError> {
    let pipelines = run();
    let beside = Beside { pipelines: &pipelines, replaced, parameters: &["valve"] };
    match check_pipeline(text, "pipeline", &beside) {
        Ok(_) => Vec::new(),
        Err(errors) => errors.iter().cloned().collect(),
    }
}

fn told(text: &str, replaced: Option<&str>) -> Vec<String> {
    let errors = errors(text, replaced);
    let told = errors.iter().map(|error| format!("{}: {}", error.path, error.message));
    told.collect()
}

#[test]
fn a_sound_pipeline_has_no_errors() {
    let cut = r#"{"name": "cut", "stages": [{"slice": {"origin": [0, 0, 0], "normal": [1, 0, 0]}}, {"stream": {}}]}"#;
    assert!(errors(cut, None).is_empty());
    let inlet = r#"{"name": "inlet", "stages": [{"statistics": {"field": "p", "name": "inlet"}}],
        "when": "drop > 3 && parameter.valve > 0", "then": [{"set": {"name": "valve", "value": 1}}]}"#;
    assert!(errors(inlet, Some("inlet")).is_empty(), "{:?}", errors(inlet, Some("inlet")));
}

#[test]
fn all_errors_are_told_at_their_tokens_with_the_nearest_name() {
    let text = "{\"name\": \"cut\", \"evry\": {\"steps\": 5},\n \"stages\": [\n  {\"slice\": {\"origin\": [0, 0, 0], \"nromal\": [1, 0, 0]}},\n  {\"sream\": {}}]}";
    let found = errors(text, None);
    let places: Vec<_> = found
        .iter()
        .map(|error| {
            (error.line, error.column, error.path.as_str(), error.suggestion.as_deref().unwrap())
        })
        .collect();
    assert_eq!(
        places,
        [
            (1, 17, "evry", "every"),
            (3, 35, "stages[0].slice.nromal", "normal"),
            (4, 4, "stages[1].sream", "stream"),
        ]
    );
}

#[test]
fn it_must_go_with_the_other_pipelines() {
    let cases: [(&str, Option<&str>, &str); 9] = [
        (r#"{"name": "drop", "stages": []}"#, None, "name: two pipelines are named `drop`"),
        (
            r#"{"name": "inlet", "stages": [{"quality": {}}]}"#,
            Some("inlet"),
            ": pipeline `drop` could not go on: stages[1].difference.of: found the unknown name `inlet.mean`",
        ),
        (
            r#"{"name": "halt", "stages": [], "when": "inlt.mean > 1", "then": [{"stop": {}}]}"#,
            None,
            "when: column 1 of the formula: found the unknown name `inlt.mean`",
        ),
        (
            r#"{"name": "open", "stages": [{"set": {"name": "valbe", "value": 1}}]}"#,
            None,
            "stages[0].set.name: the solver has no parameter `valbe`",
        ),
        (
            r#"{"name": "more", "on": "order", "stages": []}"#,
            None,
            "on: two pipelines run on orders",
        ),
        (
            r#"{"name": "shape", "on": "order", "channel": "solid", "stages": []}"#,
            Some("shape"),
            "channel: the channel whose mesh orders change would be `solid`",
        ),
        (
            r#"{"name": "out", "stages": [{"write": {"file": "/etc/out.vtu"}}]}"#,
            None,
            "stages[0].write.file: found `/etc/out.vtu`",
        ),
        (r#"{"name": "", "stages": []}"#, None, "name: expected a name"),
        (r#"{"name": "cut", "stages": ["#, None, "stages"),
    ];
    for (text, replaced, expected) in cases {
        let told = told(text, replaced);
        assert!(told.len() == 1 && told[0].starts_with(expected), "{text}: {told:?}");
    }
    // Of one that cannot be read whole nobody knows what others will miss.
    let told = told(
        r#"{"name": "inlet", "stages": [{"statistcs": {"field": "p", "name": "inlet"}}]}"#,
        Some("inlet"),
    );
    assert!(told.len() == 1 && told[0].contains("statistcs"), "{told:?}");
}

/// Texts that are refused here are those that a run refuses, with its first error among them.
#[test]
fn it_agrees_with_the_change_that_it_stands_for() {
    let pipelines = run();
    let config = parse(
        &format!(
            r#"{{"version": 1, "pipelines": {}}}"#,
            serde_json::to_string(&pipelines).unwrap()
        ),
        "run.json",
    )
    .unwrap();
    for stages in [
        r#"[{"quality": {}}]"#,
        r#"[{"statistics": {"field": "pressure", "name": "inlet"}}]"#,
        r#"[{"surface": {}}, {"surface": {}}]"#,
        r#"[{"slice": {}}]"#,
        r#"[{"order": {}}]"#,
        r#"[{"write": {"file": "../a.vtu"}}]"#,
        r#"[{"statistics": {"field": "pressure", "name": "inlet"}}, {"pause": {"x": 1}}]"#,
    ] {
        let text = format!(r#"{{"name": "inlet", "stages": {stages}}}"#);
        let beside = Beside { pipelines: &pipelines, replaced: Some("inlet"), parameters: &[] };
        let here = check_pipeline(&text, "pipeline", &beside);
        let there = parse_json::<PipelineChange>(&format!(r#"{{"set": [{text}]}}"#), "change")
            .map_err(|error| error.message)
            .and_then(|change| {
                change.check_files().map_err(|problem| problem.to_string())?;
                change.after(&config, &[]).map(drop).map_err(|problem| problem.to_string())
            });
        assert_eq!(here.is_ok(), there.is_ok(), "{text}: {here:?} {there:?}");
    }
}
