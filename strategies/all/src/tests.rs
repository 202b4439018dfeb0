//! The list against what serde knows.

use farfield_core::registry::SettingType;
use farfield_core::strategy::{FarField, Partition, Scheduler, SimplificationMetric, VisibilityMetric};
use serde_json::{Map, Value, json};

use super::*;

/// The names that typetag knows, from its complaint about one that it does not.
fn known(complaint: Result<(), serde_json::Error>) -> Vec<String> {
    let text = complaint.unwrap_err().to_string();
    let mut names: Vec<String> = text.split('`').skip(3).step_by(2).map(str::to_owned).collect();
    names.sort();
    names
}

fn parse(kind: Kind, table: Value) -> Result<Value, serde_json::Error> {
    fn back<T: serde::de::DeserializeOwned + serde::Serialize>(v: Value) -> Result<Value, serde_json::Error> {
        serde_json::to_value(serde_json::from_value::<T>(v)?)
    }
    match kind {
        Kind::Backend => panic!("backends are no serde objects"),
        Kind::FarField => back::<Box<dyn FarField>>(table),
        Kind::Partition => back::<Box<dyn Partition>>(table),
        Kind::Scheduler => back::<Box<dyn Scheduler>>(table),
        Kind::SimplificationMetric => back::<Box<dyn SimplificationMetric>>(table),
        Kind::VisibilityMetric => back::<Box<dyn VisibilityMetric>>(table),
    }
}

const KINDS: [Kind; 5] =
    [Kind::FarField, Kind::Partition, Kind::Scheduler, Kind::SimplificationMetric, Kind::VisibilityMetric];

#[test]
fn the_list_is_sorted_and_is_what_serde_knows() {
    let all = registry();
    assert_eq!(all.len(), link());
    assert!(all.is_sorted_by_key(|e| (e.kind.name(), e.name)));
    for kind in KINDS {
        let listed: Vec<&str> = all.iter().filter(|e| e.kind == kind).map(|e| e.name).collect();
        let complaint = parse(kind, json!({ "type": "no such strategy" })).map(|_| ());
        assert_eq!(known(complaint), listed, "{kind:?}");
    }
}

/// The least table of a strategy: its name and the settings that have no default, each with a value its type allows.
fn least(e: &Entry) -> Map<String, Value> {
    let mut table = Map::from_iter([("type".to_owned(), json!(e.name))]);
    match e.name {
        "adaptive-grid" => drop(table.insert("budget".into(), json!(150_000))),
        "hex-cells" => drop(table.insert("edge".into(), json!(50.0))),
        _ => {}
    }
    table
}

#[test]
fn every_strategy_reads_its_defaults_and_says_them_back() {
    for e in registry() {
        let resolved = parse(e.kind, Value::Object(least(&e))).unwrap_or_else(|err| panic!("{}: {err}", e.name));
        assert_eq!(resolved["type"], e.name);
        for s in &e.settings {
            let said = resolved.get(&s.name).unwrap_or_else(|| panic!("{} says nothing of {}", e.name, s.name));
            if !s.default.is_null() {
                let close = |a: &Value, b: &Value| match (a.as_f64(), b.as_f64()) {
                    (Some(a), Some(b)) => (a - b).abs() < 1e-6,
                    _ => a == b,
                };
                assert!(close(said, &s.default), "{}.{}: {said} is not {}", e.name, s.name, s.default);
            }
            assert!(!s.doc.is_empty(), "{}.{} has no doc", e.name, s.name);
        }
        let fields = resolved.as_object().unwrap().keys().filter(|k| *k != "type").count();
        assert_eq!(fields, e.settings.len(), "{}", e.name);
    }
}

#[test]
fn unknown_keys_are_refused_everywhere() {
    for e in registry() {
        let mut table = least(&e);
        table.insert("no_such_key".into(), json!(1));
        let complaint = parse(e.kind, Value::Object(table)).unwrap_err().to_string();
        assert!(complaint.contains("no_such_key"), "{}: {complaint}", e.name);
    }
}

#[test]
fn nested_strategies_have_their_kind_and_their_default_by_name() {
    let all = registry();
    let textured = all.iter().find(|e| e.name == "textured-lod-mesh").unwrap();
    let of = |name: &str| textured.settings.iter().find(|s| s.name == name).unwrap();
    assert_eq!(of("view_test").ty, SettingType::Strategy(Kind::VisibilityMetric));
    assert_eq!(of("view_test").default["type"], "self-occlusion");
    assert_eq!(of("collapse").ty, SettingType::Strategy(Kind::SimplificationMetric));
    assert_eq!(of("edge_px").unit, "px");
    assert_eq!(of("facing").ty, SettingType::Choice(vec!["any-corner".into(), "all-corners".into()]));
}

#[test]
fn settings_that_only_frames_depend_on_are_settings() {
    for e in registry().into_iter().filter(|e| e.kind == Kind::FarField) {
        let far: Box<dyn FarField> = serde_json::from_value(Value::Object(least(&e))).unwrap();
        for name in far.frame_settings() {
            assert!(e.settings.iter().any(|s| s.name == *name), "{} has no setting {name}", e.name);
        }
    }
}
