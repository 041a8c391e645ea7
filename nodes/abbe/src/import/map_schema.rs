//! Additions to the derived schema of an import map.

use schemars::Schema;
use serde_json::{Value, json};

/// Keys of a positioning test, each with its other name for a rotary axis.
const OTHER_NAMES: [[&str; 2]; 7] = [
    ["feed_mm_min", "feed_deg_min"],
    ["overrun_mm", "overrun_deg"],
    ["target_mm", "target_deg"],
    ["deviation_um", "deviation_arcsec"],
    ["measured_mm", "measured_deg"],
    ["passes_um", "passes_arcsec"],
    ["same_target_um", "same_target_arcsec"],
];

/// Adds the other names, which the derived schema does not know: of each pair a file has one at most, and of those that
/// the test needs one.
pub fn with_other_names(schema: &mut Schema) {
    let tests = schema.get_mut("oneOf").and_then(Value::as_array_mut);
    let positioning = "/properties/positioning";
    let found = tests
        .into_iter()
        .flatten()
        .find_map(|test| test.pointer_mut(positioning)?.as_object_mut());
    let Some(test) = found else {
        return;
    };
    let mut needed = vec![];
    if let Some(required) = test.get_mut("required").and_then(Value::as_array_mut) {
        let named = |key: &Value, name: &str| key.as_str() == Some(name);
        let is_paired = |key: &Value| OTHER_NAMES.iter().any(|[name, _]| named(key, name));
        needed = required
            .iter()
            .filter(|key| is_paired(key))
            .cloned()
            .collect();
        required.retain(|key| !is_paired(key));
    }
    if let Some(keys) = test.get_mut("properties").and_then(Value::as_object_mut) {
        for [name, other] in OTHER_NAMES {
            if let Some(key) = keys.get(name).cloned() {
                keys.insert(other.to_owned(), key);
            }
        }
    }
    let pairs = OTHER_NAMES.map(|names| {
        if needed.iter().any(|key| key.as_str() == Some(names[0])) {
            let one = names.map(|name| json!({ "required": [name] }));
            json!({ "oneOf": one })
        } else {
            json!({ "not": { "required": names } })
        }
    });
    test.insert("allOf".to_owned(), json!(pairs));
}

/// Adds the name that the resolution of an angular reference has.
pub fn with_arcsec(schema: &mut Schema) {
    let keys = schema.get_mut("properties").and_then(Value::as_object_mut);
    if let Some(keys) = keys
        && let Some(key) = keys.get("resolution_um").cloned()
    {
        keys.insert("resolution_arcsec".to_owned(), key);
    }
}
