//! The JSON of edits.

use std::sync::Arc;

use serde_json::{Value, json};

use super::*;
use crate::cancellation::Cancellation;

fn error(json: &str) -> String {
    serde_json::from_str::<Edit>(json).expect_err(json).to_string()
}

#[test]
fn the_json_of_an_edit_reads_and_writes_back() {
    let json = r#"{"translate":{"features":["a","b"],"fixed":["c"],"by":[1.0,-2.5,0.1],"harmonic_order":3}}"#;
    let edit: Edit = serde_json::from_str(json).unwrap();
    assert_eq!(edit.harmonic_order(), Some(HarmonicOrder::Triharmonic));
    assert_eq!(edit.fixed(), ["c"]);
    assert_eq!(serde_json::to_string(&edit).unwrap(), json);

    let short: Edit =
        serde_json::from_str(r#"{"scale_normals":{"features":["a"],"distance":-1}}"#).unwrap();
    assert_eq!(short.harmonic_order(), Some(HarmonicOrder::Biharmonic));
    assert!(short.fixed().is_empty());
    assert_eq!(
        serde_json::from_str::<Edit>(&serde_json::to_string(&short).unwrap()).unwrap(),
        short
    );
}

#[test]
fn json_that_is_not_an_edit_is_refused_by_name() {
    assert!(
        error(r#"{"translate":{"features":[],"by":[0,0,0]}}"#).contains("at least one feature")
    );
    assert!(error(r#"{"translate":{"features":["a"]}}"#).contains("missing field `by`"));
    assert!(
        error(r#"{"translate":{"features":["a"],"by":[0,0,0],"fix":[]}}"#)
            .contains("unknown field `fix`")
    );
    assert!(error(r#"{"translate":{"features":["a"],"by":[0,0]}}"#).contains("array of length 3"));
    assert!(error(r#"{"turn":{}}"#).contains("unknown variant `turn`"));
    for order in ["0", "4", "-1"] {
        let json = format!(
            r#"{{"translate":{{"features":["a"],"by":[0,0,0],"harmonic_order":{order}}}}}"#
        );
        assert!(error(&json).contains(&format!("harmonic order {order} does not exist")));
    }
}

#[test]
fn numbers_that_are_not_finite_are_refused_by_field() {
    let features = vec!["a".to_string()];
    let scale = ScaleDirection {
        features: features.clone(),
        factors: [1.0, f64::NAN, 1.0],
        ..ScaleDirection::default()
    };
    let message = |edit: Edit| edit.validate().unwrap_err().to_string();
    assert_eq!(
        message(Edit::ScaleDirection(scale.clone())),
        "factors[1]: NaN is not a finite number"
    );
    let scale =
        ScaleDirection { factors: [1.0; 3], center: Some([0.0, 0.0, f64::INFINITY]), ..scale };
    assert_eq!(message(Edit::ScaleDirection(scale)), "center[2]: inf is not a finite number");
    let normals = ScaleNormals { features, distance: f64::NEG_INFINITY, ..ScaleNormals::default() };
    assert_eq!(
        message(Edit::ScaleNormals(normals.clone())),
        "distance: -inf is not a finite number"
    );
    assert!(
        message(Edit::ScaleNormals(ScaleNormals { features: vec![], ..normals }))
            .contains("no handle")
    );
}

#[test]
fn the_schema_shows_defaults_and_bounds() {
    let schema = serde_json::to_value(schemars::schema_for!(Edit)).unwrap();
    let fields = &schema["$defs"]["ScaleDirection"]["properties"];
    assert_eq!(fields["harmonic_order"]["default"], 2);
    assert_eq!(fields["features"]["minItems"], 1);
    assert_eq!(fields["factors"]["maxItems"], 3);
    assert_eq!(schema["$defs"]["HarmonicOrder"]["maximum"], 3);
    assert_eq!(schema["$defs"]["Translate"]["additionalProperties"], false);
    for (name, field) in fields.as_object().unwrap() {
        assert!(field["description"].is_string(), "{name} has no description");
    }
}

/// A form takes a part of an edit by its schema alone: what it knows as amounts is what
/// [`Edit::scaled`] multiplies.
#[test]
fn the_schema_says_what_the_amounts_are() {
    let schema = schemars::schema_for!(Edit).to_value();
    let body = |name: &str| {
        let variants = schema["oneOf"].as_array().unwrap();
        let reference =
            variants.iter().find_map(|variant| variant["properties"].get(name)).unwrap();
        let name = reference["$ref"].as_str().unwrap().rsplit('/').next().unwrap();
        schema["$defs"][name].clone()
    };
    for edit in [
        json!({"translate": {"features": ["a"], "by": [0.25, 0.0, -1.0]}}),
        json!({"rotate": {"features": ["a"], "axis": [0.0, 1.0, 0.0], "degrees": 20.0}}),
        json!({"scale_direction": {"features": ["a"], "factors": [1.0, 2.0, 0.5]}}),
        json!({"scale_normals": {"features": ["a"], "distance": -0.5}}),
        json!({"affine": {"features": ["a"], "matrix": [[2.0, 0.0, 0.0], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]], "translation": [1.0, 0.0, 0.0]}}),
        json!({"displacement": {"vertices": [1], "values": [[0.0, 0.0, 1.0]], "scale": 2.0}}),
        json!({"skeleton": {"moves": [{"at": [1.0, 1.0, 1.0], "by": [0.0, 0.0, 4.0]}]}}),
    ] {
        let edit: Edit = serde_json::from_value(edit).unwrap();
        let mut scaled = serde_json::to_value(&edit).unwrap();
        let name = edit.name();
        scale_by_schema(&mut scaled[name], &body(name), &schema["$defs"], 0.25);
        assert_eq!(serde_json::from_value::<Edit>(scaled).unwrap(), edit.scaled(0.25), "{name}");
    }
}

fn scale_by_schema(value: &mut Value, schema: &Value, definitions: &Value, fraction: f64) {
    let Some(object) = value.as_object_mut() else { return };
    for (name, value) in object {
        let property = &schema["properties"][name];
        if let Some(neutral) = property.get("x-neutral") {
            *value = between(neutral, value, fraction);
        } else if let Some(item) = property["items"]["$ref"].as_str() {
            let item = &definitions[item.rsplit('/').next().unwrap()];
            for entry in value.as_array_mut().into_iter().flatten() {
                scale_by_schema(entry, item, definitions, fraction);
            }
        }
    }
}

fn between(neutral: &Value, value: &Value, fraction: f64) -> Value {
    match (neutral, value) {
        (Value::Array(neutral), Value::Array(values)) => neutral
            .iter()
            .zip(values)
            .map(|(neutral, value)| between(neutral, value, fraction))
            .collect(),
        _ => {
            let [neutral, value] = [neutral, value].map(|number| number.as_f64().unwrap());
            json!(neutral + fraction * (value - neutral))
        }
    }
}

#[test]
fn edits_that_are_given_up_are_evaluated_when_they_are_wanted_again() {
    let mesh = crate::shapes::box_of_tets([8, 2, 2], [0.0; 3], [4.0, 1.0, 1.0]);
    let features = crate::features::FeatureSettings::default();
    let surface = Arc::new(crate::surface::Surface::extract(&mesh, &features).unwrap());
    let cancellation = Cancellation::default();
    let mut editor = Editor::new(surface).unwrap().with_cancellation(cancellation.clone());
    let edit = |edit: Value| [serde_json::from_value::<Edit>(edit).unwrap()];
    for stack in [
        edit(json!({"translate": {"features": ["x-max"], "fixed": ["x-min"], "by": [0, 0, 0.5]}})),
        edit(json!({"skeleton": {"at": [2, 0.5, 0.5], "by": [0, 0, 0.1]}})),
    ] {
        cancellation.cancel();
        assert_eq!(editor.displacement(&stack), Err(EditError::Cancelled));
        cancellation.renew();
        assert_ne!(editor.displacement(&stack), Err(EditError::Cancelled));
    }
}
