//! The JSON of edits.

use super::*;

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
