//! What a parameter of a node means: name, unit, sentence and limits, read from the field that holds it.
//!
//! A parameter is one field of a node's configuration. Its doc comment is the description, its name ends with the unit,
//! `#[schemars(range(min = …, max = …))]` gives the limits, and `Default` the default. The table that ROS serves, the check of
//! a file and the README follow from the field.
//!
//! Some fields need a word more: `#[schemars(extend("unit" = "…"))]` where the name has no unit,
//! `#[schemars(extend("keys" = ["X", "Y"]))]` for the entries of a map.

use std::borrow::Cow;

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::Serialize;
use serde_json::Value;

use crate::bound::BoundError;
use crate::leaves;
use crate::number::unit_of;

/// One parameter in a node's table.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterDoc {
    /// Name, nested keys joined by dots; ends with the unit.
    pub name: Cow<'static, str>,
    /// Unit as a person writes it, e.g. `µm/m`; empty for a number without one.
    pub unit: Cow<'static, str>,
    /// Meaning, one sentence.
    pub description: Cow<'static, str>,
    /// Least and greatest value, both allowed, where it is a number with limits.
    pub range: Option<(f64, f64)>,
}

/// The table of the parameters that `T` holds, in the order of their names.
///
/// The entries of a map have a row each for the keys that its field names.
#[must_use]
pub fn parameters_of<T: JsonSchema>() -> Vec<ParameterDoc> {
    let settings = SchemaSettings::draft2020_12().with(|settings| {
        settings.inline_subschemas = true;
        settings.meta_schema = None;
    });
    let schema = settings.into_generator().into_root_schema_for::<T>();
    let mut table = vec![];
    fields(schema.as_value(), "", &mut table);
    table
}

/// Refuses the first number of `config` that is outside the limits of its field.
///
/// # Errors
/// Names the parameter with value, limits and unit.
pub fn check_parameters<T: JsonSchema + Serialize>(config: &T) -> Result<(), BoundError> {
    check_parameters_below("", config)
}

/// The same of a part of a configuration, whose names begin with `above`.
///
/// # Errors
/// As [`check_parameters`].
pub fn check_parameters_below<T: JsonSchema + Serialize>(
    above: &str,
    config: &T,
) -> Result<(), BoundError> {
    let table = parameters_of::<T>();
    let mut first = Ok(());
    leaves::each_number_and_count(config, &mut |path, value| {
        // The numbers of a list have the limits of the list.
        let name = path.split('[').next().unwrap_or(path);
        let Some(doc) = table.iter().find(|doc| doc.name == name) else {
            return;
        };
        if let (Ok(()), Some(range)) = (&first, doc.range) {
            first = check_between(&format!("{above}{name}"), value, range);
        }
    });
    first
}

/// Refuses a `value` of the parameter `name` outside of limits, both allowed; for limits that another value narrows.
///
/// # Errors
/// Names the parameter with value, limits and unit.
pub fn check_between(
    name: &str,
    value: f64,
    (least, greatest): (f64, f64),
) -> Result<(), BoundError> {
    if (least..=greatest).contains(&value) {
        return Ok(());
    }
    Err(BoundError::Number {
        place: name.to_owned(),
        value,
        least,
        greatest,
        unit: unit_of(name)
            .map_or_else(String::new, |unit| format!(" {unit}"))
            .into(),
    })
}

/// The rows of the fields of a structure whose keys begin with `above`.
fn fields(schema: &Value, above: &str, table: &mut Vec<ParameterDoc>) {
    let Some(properties) = schema.get("properties").and_then(Value::as_object) else {
        return;
    };
    for (key, field) in properties {
        let name = format!("{above}{key}");
        let inner = inner(field);
        if let Some(keys) = field.get("keys").and_then(Value::as_array) {
            // A map whose keys are an enumeration has a property for each, another one the same for all.
            let of_each = |entry: &str| inner.get("properties").and_then(|all| all.get(entry));
            let of_all = inner.get("additionalProperties").unwrap_or(&Value::Null);
            for entry in keys.iter().filter_map(Value::as_str) {
                let of_entry = of_each(entry).unwrap_or(of_all);
                one(of_entry, field, format!("{name}.{entry}"), table);
            }
        } else {
            one(inner, field, name, table);
        }
    }
}

/// The rows of one field: those of a structure, or its own.
fn one(schema: &Value, field: &Value, name: String, table: &mut Vec<ParameterDoc>) {
    if schema.get("properties").is_some() {
        return fields(schema, &format!("{name}."), table);
    }
    let text = |key: &str| field.get(key).and_then(Value::as_str);
    let limit = |key: &str| {
        let of_items = schema.get("items").and_then(|items| items.get(key));
        let own = field.get(key).or_else(|| schema.get(key)).or(of_items);
        own.and_then(Value::as_f64)
    };
    let of_map = || unit_of(name.rsplit_once('.')?.0);
    let named = || unit_of(&name).or_else(of_map);
    let unit = text("unit").map(str::to_owned).or_else(named);
    table.push(ParameterDoc {
        unit: unit.unwrap_or_default().into(),
        description: text("description")
            .unwrap_or_default()
            .replace('\n', " ")
            .replace('`', "")
            .into(),
        range: limit("minimum").zip(limit("maximum")),
        name: name.into(),
    });
}

/// The schema of a field's value where it is there: what stands beside `null`.
fn inner(field: &Value) -> &Value {
    let choices = field.get("anyOf").and_then(Value::as_array);
    let is_value = |choice: &&Value| choice.get("type").and_then(Value::as_str) != Some("null");
    choices
        .and_then(|choices| choices.iter().find(is_value))
        .unwrap_or(field)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use serde::Deserialize;

    use super::*;
    use crate::axis::Axis;

    #[derive(Serialize, Deserialize, JsonSchema)]
    struct Probe {
        /// Time that a touch
        /// waits.
        #[schemars(range(min = 0.5, max = LONGEST_MS))]
        hold_ms: f64,
        /// Positions that are kept.
        #[schemars(range(min = 2, max = 1000))]
        kept: usize,
        /// Given, not calibrated.
        #[schemars(range(min = 0.0, max = 10.0))]
        latency_ms: Option<f64>,
        /// Each tool's.
        #[schemars(inner(range(min = -100.0, max = 100.0)))]
        lengths_mm: Vec<f64>,
        /// Per second.
        #[schemars(range(min = 1.0, max = 9.0), extend("unit" = "1/s"))]
        gain: f64,
        /// Not in the table by itself.
        inner: Option<Inner>,
        /// Of each axis.
        #[schemars(extend("keys" = ["X", "Z"]))]
        axes: BTreeMap<Axis, Inner>,
        /// Which one.
        mode: Mode,
    }

    const LONGEST_MS: f64 = 200.0;

    #[derive(Clone, Serialize, Deserialize, JsonSchema)]
    struct Inner {
        /// Greatest size.
        #[schemars(range(min = 0.1, max = 5.0))]
        limit_um: f64,
    }

    #[derive(Clone, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "snake_case")]
    enum Mode {
        /// The first.
        First,
        /// The second.
        Second,
    }

    fn example() -> Probe {
        Probe {
            hold_ms: 1.0,
            kept: 3,
            latency_ms: None,
            lengths_mm: vec![1.0, 2.0],
            gain: 2.0,
            inner: None,
            axes: BTreeMap::from([(Axis::Z, Inner { limit_um: 1.0 })]),
            mode: Mode::First,
        }
    }

    #[test]
    fn the_table_follows_from_the_fields() {
        let table = parameters_of::<Probe>();
        let shown: Vec<String> = table
            .iter()
            .map(|doc| {
                format!(
                    "{}|{}|{}|{:?}",
                    doc.name, doc.unit, doc.description, doc.range
                )
            })
            .collect();
        assert_eq!(
            shown,
            [
                "axes.X.limit_um|µm|Greatest size.|Some((0.1, 5.0))",
                "axes.Z.limit_um|µm|Greatest size.|Some((0.1, 5.0))",
                "gain|1/s|Per second.|Some((1.0, 9.0))",
                "hold_ms|ms|Time that a touch waits.|Some((0.5, 200.0))",
                "inner.limit_um|µm|Greatest size.|Some((0.1, 5.0))",
                "kept||Positions that are kept.|Some((2.0, 1000.0))",
                "latency_ms|ms|Given, not calibrated.|Some((0.0, 10.0))",
                "lengths_mm|mm|Each tool's.|Some((-100.0, 100.0))",
                "mode||Which one.|None",
            ]
        );
    }

    #[test]
    fn every_number_outside_its_limits_is_refused_by_name() {
        assert_eq!(check_parameters(&example()), Ok(()));
        let refused = |change: &dyn Fn(&mut Probe)| {
            let mut config = example();
            change(&mut config);
            check_parameters(&config).unwrap_err().to_string()
        };
        assert_eq!(
            refused(&|config| config.hold_ms = f64::NAN),
            "hold_ms = NaN ms: must be from 0.5 to 200 ms"
        );
        assert_eq!(
            refused(&|config| config.kept = 1),
            "kept = 1: must be from 2 to 1000"
        );
        assert_eq!(
            refused(&|config| config.latency_ms = Some(f64::INFINITY)),
            "latency_ms = inf ms: must be from 0 to 10 ms"
        );
        assert_eq!(
            refused(&|config| config.lengths_mm[1] = 101.0),
            "lengths_mm = 101 mm: must be from -100 to 100 mm"
        );
        assert_eq!(
            refused(&|config| config.axes.get_mut(&Axis::Z).unwrap().limit_um = 0.0),
            "axes.Z.limit_um = 0 µm: must be from 0.1 to 5 µm"
        );
    }
}
