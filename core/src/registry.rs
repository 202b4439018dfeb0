//! The registry: every strategy by kind and name, with its settings as data, for `list`, for the book, and for finding a
//! mistake in an experiment file at its exact place before serde runs.

use schemars::{JsonSchema, Schema};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Kinds of strategies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Draws.
    Backend,
    /// [`crate::strategy::FarField`].
    FarField,
    /// [`crate::strategy::Partition`].
    Partition,
    /// [`crate::strategy::Scheduler`].
    Scheduler,
    /// [`crate::strategy::SimplificationMetric`].
    SimplificationMetric,
    /// [`crate::strategy::VisibilityMetric`].
    VisibilityMetric,
}

impl Kind {
    /// As experiment files and `list` spell it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Backend => "backend",
            Self::FarField => "far_field",
            Self::Partition => "partition",
            Self::Scheduler => "scheduler",
            Self::SimplificationMetric => "simplification_metric",
            Self::VisibilityMetric => "visibility_metric",
        }
    }
}

/// A registered strategy.
#[derive(Clone, Debug, Serialize)]
pub struct Entry {
    /// Its kind.
    pub kind: Kind,
    /// Its `type` in an experiment file.
    pub name: &'static str,
    /// One line.
    pub summary: &'static str,
    /// Paper, year, section; or what else it follows.
    pub source: &'static str,
    /// Its settings, in the order of their definition.
    pub settings: Vec<Setting>,
}

/// A setting of a strategy.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Setting {
    /// Its key.
    pub name: String,
    /// Its type.
    #[serde(rename = "type")]
    pub ty: SettingType,
    /// Its default; null: none.
    pub default: Value,
    /// It has to be given.
    pub required: bool,
    /// Its unit; empty for a pure number or a name.
    pub unit: String,
    /// What it does.
    pub doc: String,
}

/// Types of settings.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SettingType {
    /// true or false.
    Boolean,
    /// A whole number.
    Integer {
        /// Smallest allowed.
        minimum: Option<f64>,
        /// Largest allowed.
        maximum: Option<f64>,
    },
    /// A number.
    Number {
        /// Smallest allowed.
        minimum: Option<f64>,
        /// Largest allowed.
        maximum: Option<f64>,
        /// Values have to be above this.
        above: Option<f64>,
        /// Values have to be below this.
        below: Option<f64>,
    },
    /// Text.
    Text,
    /// One of some names.
    Choice(Vec<String>),
    /// A list of numbers of this length.
    Numbers(Option<usize>),
    /// A nested strategy: a table with a `type`.
    Strategy(Kind),
}

/// The settings of `T`, read from its JSON schema: doc comments, `#[serde(default)]`, `#[schemars(range(...))]`, and
/// `#[schemars(extend("unit" = "px"))]`. A nested strategy says `#[schemars(with = "Value", extend("strategy" =
/// "visibility_metric"))]`.
///
/// # Panics
/// When a field's schema is not one of [`SettingType`]: a programming error that the registry's test finds.
pub fn settings_of<T: JsonSchema>() -> Vec<Setting> {
    let schema: Schema = schemars::generate::SchemaSettings::draft2020_12()
        .with(|s| s.inline_subschemas = true)
        .into_generator()
        .into_root_schema_for::<T>();
    let Some(fields) = schema.get("properties").and_then(Value::as_object) else { return vec![] };
    let required = |name: &str| {
        schema.get("required").and_then(Value::as_array).is_some_and(|r| r.iter().any(|n| n.as_str() == Some(name)))
    };
    fields.iter().map(|(name, field)| setting(name, field, required(name))).collect()
}

fn setting(name: &str, field: &Value, required: bool) -> Setting {
    let text = |key: &str| field.get(key).and_then(Value::as_str).unwrap_or_default().to_owned();
    Setting {
        name: name.to_owned(),
        ty: setting_type(field).unwrap_or_else(|| panic!("setting {name} has a type that files cannot give: {field}")),
        default: field.get("default").map_or(Value::Null, shortened),
        required,
        unit: text("unit"),
        doc: text("description").replace('\n', " "),
    }
}

/// A default as one would write it: 0.1 for a 32-bit 0.1, which JSON spells 0.10000000149011612.
fn shortened(v: &Value) -> Value {
    match v {
        Value::Number(n) if n.is_f64() => {
            let wide = n.as_f64().unwrap_or_default();
            let short = (wide as f32).to_string().parse().unwrap_or(wide);
            Value::from(if f64::from(wide as f32) == wide { short } else { wide })
        }
        Value::Array(a) => a.iter().map(shortened).collect(),
        Value::Object(o) => o.iter().map(|(k, v)| (k.clone(), shortened(v))).collect(),
        _ => v.clone(),
    }
}

fn setting_type(field: &Value) -> Option<SettingType> {
    let number = |key: &str| field.get(key).and_then(Value::as_f64);
    if let Some(kind) = field.get("strategy") {
        return serde_json::from_value(kind.clone()).ok().map(SettingType::Strategy);
    }
    let names = |list: &Value| -> Option<Vec<String>> {
        list.as_array()?
            .iter()
            .filter(|v| !v.is_null())
            .map(|v| v.as_str().or_else(|| v.get("const")?.as_str()).map(str::to_owned))
            .collect()
    };
    if let Some(choices) = field.get("enum").or_else(|| field.get("oneOf")).and_then(names) {
        return Some(SettingType::Choice(choices));
    }
    // Option<enum> gives anyOf [the enum, null].
    if let Some(any) = field.get("anyOf").and_then(Value::as_array) {
        return any.iter().find(|f| f.get("type").and_then(Value::as_str) != Some("null")).and_then(setting_type);
    }
    match field.get("type")? {
        Value::String(t) => match t.as_str() {
            "boolean" => Some(SettingType::Boolean),
            "integer" => Some(SettingType::Integer { minimum: number("minimum"), maximum: number("maximum") }),
            "number" => Some(SettingType::Number {
                minimum: number("minimum"),
                maximum: number("maximum"),
                above: number("exclusiveMinimum"),
                below: number("exclusiveMaximum"),
            }),
            "string" => Some(SettingType::Text),
            "array" => Some(SettingType::Numbers(number("maxItems").map(|n| n as usize))),
            _ => None,
        },
        // Option<T> gives ["number", "null"].
        Value::Array(types) => {
            let mut inner = field.clone();
            inner["type"] = types.iter().find(|t| t.as_str() != Some("null"))?.clone();
            setting_type(&inner)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Default, Serialize, Deserialize, JsonSchema)]
    enum Choice {
        #[default]
        #[serde(rename = "any-corner")]
        Any,
        #[serde(rename = "all-corners")]
        All,
    }

    /// Settings.
    #[derive(Serialize, Deserialize, JsonSchema)]
    struct Example {
        /// Edge of a cell.
        #[schemars(extend("unit" = "scene units", "exclusiveMinimum" = 0.0))]
        edge: f32,
        /// A count.
        #[serde(default)]
        count: u32,
        /// Which reading.
        #[serde(default)]
        reading: Choice,
        /// A test.
        #[schemars(with = "Value", extend("strategy" = "visibility_metric"))]
        test: Option<Value>,
        /// Perhaps.
        limit: Option<f32>,
        /// Perhaps a reading.
        perhaps: Option<Choice>,
        /// A share.
        #[serde(default = "a_tenth")]
        share: f32,
    }
    fn a_tenth() -> f32 {
        0.1
    }

    #[test]
    fn a_settings_table_is_read_from_the_schema() {
        let s = settings_of::<Example>();
        let by = |n: &str| s.iter().find(|x| x.name == n).unwrap();
        assert_eq!(by("edge").ty, SettingType::Number { minimum: None, maximum: None, above: Some(0.0), below: None });
        assert_eq!((by("edge").unit.as_str(), by("edge").doc.as_str()), ("scene units", "Edge of a cell."));
        assert_eq!(by("edge").default, Value::Null);
        assert_eq!(by("count").default, Value::from(0));
        assert_eq!(by("reading").ty, SettingType::Choice(vec!["any-corner".into(), "all-corners".into()]));
        assert_eq!(by("test").ty, SettingType::Strategy(Kind::VisibilityMetric));
        assert!(matches!(by("limit").ty, SettingType::Number { .. }));
        assert_eq!(by("perhaps").ty, by("reading").ty);
        assert_eq!(by("share").default, Value::from(0.1));
        let required: Vec<&str> = s.iter().filter(|x| x.required).map(|x| x.name.as_str()).collect();
        assert_eq!(required, ["edge", "test"]);
    }
}
