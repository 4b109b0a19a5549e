//! The check of a pipeline that is being written.

use serde::Deserialize;
use serde_json::{Value, json};
use tombolo_pipelines::language::{Beside, Pipeline, check_pipeline};

/// A text, and the run that it is for.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Question {
    text: String,
    replaced: Option<String>,
    /// Read one by one: one of a run of another version does not keep the others from being known.
    pipelines: Vec<Value>,
    parameters: Vec<String>,
}

/// The errors of the pipeline in a question, as JSON: none where a run would take it.
///
/// # Errors
/// Where the question is not as [`check_pipeline`](crate::check_pipeline) describes it.
pub(crate) fn check(question: &[u8]) -> Result<String, serde_json::Error> {
    let Question { text, replaced, pipelines, parameters } = serde_json::from_slice(question)?;
    let known = pipelines.into_iter().filter_map(|known| serde_json::from_value(known).ok());
    let pipelines: Vec<Pipeline> = known.collect();
    let parameters: Vec<&str> = parameters.iter().map(String::as_str).collect();
    let beside =
        Beside { pipelines: &pipelines, replaced: replaced.as_deref(), parameters: &parameters };
    let answer = match check_pipeline(&text, "pipeline", &beside) {
        Ok(_) => json!({"errors": [], "more": 0}),
        Err(errors) => json!({"errors": errors.iter().collect::<Vec<_>>(), "more": errors.more()}),
    };
    Ok(answer.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(question: &Value) -> Vec<Value> {
        let answer: Value =
            serde_json::from_str(&check(question.to_string().as_bytes()).unwrap()).unwrap();
        answer["errors"].as_array().unwrap().clone()
    }

    #[test]
    fn errors_have_their_places_and_the_nearest_name() {
        let known = json!([{"name": "a", "stages": []}, {"name": "of another version", "stages": [{"new": {}}]}]);
        let text = "{\"name\": \"a\",\n \"stages\": [{\"surfce\": {}}]}";
        let mut question =
            json!({"text": text, "replaced": "a", "pipelines": known, "parameters": []});
        let found = errors(&question);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!((&found[0]["line"], &found[0]["column"]), (&json!(2), &json!(14)));
        assert_eq!(found[0]["suggestion"], "surface");
        question["text"] = json!(r#"{"name": "a", "stages": []}"#);
        assert!(errors(&question).is_empty());
        question["replaced"] = Value::Null;
        assert_eq!(errors(&question).len(), 1);
        assert!(check(b"{}").is_err());
    }
}
