//! What a mapping takes and refuses.

use super::*;

fn mapping(values: &str) -> Result<Mapping, String> {
    let file = MapFile::from_yaml(&format!("values:\n{values}")).map_err(|e| e.to_string())?;
    Mapping::new(&file).map_err(|error| error.to_string())
}

#[test]
fn a_key_is_found_by_id_by_name_and_behind_its_device() {
    let mapping = mapping("  Yabs: {is: position, axis: Y, unit: MILLIMETER}\n").unwrap();
    let found = |key, name| mapping.find(key, name).map(|(key, _)| key.to_owned());
    assert_eq!(found("Yabs", None).as_deref(), Some("Yabs"));
    assert_eq!(found("mill:Yabs", None).as_deref(), Some("Yabs"));
    assert_eq!(found("y1", Some("Yabs")).as_deref(), Some("Yabs"));
    assert_eq!(found("y1", None), None);
}

#[test]
fn what_does_not_fit_is_refused_by_key() {
    for (values, said) in [
        (
            "  C: {is: position, axis: C, unit: MILLIMETER}\n",
            "C: MILLIMETER does not measure a rotary axis",
        ),
        (
            "  F: {is: feed, unit: CELSIUS}\n",
            "F: CELSIUS does not measure a feed",
        ),
        (
            "  a: {is: position, axis: X, unit: INCH}\n  b: {is: path_position, unit: INCH}\n",
            "b: axis X is reported by another key",
        ),
        (
            "  a: {is: commanded_position, axis: X, unit: INCH}\n",
            "axis X: a commanded position alone",
        ),
        (
            "  \"\": {is: ignored}\n",
            "values: name \"\": no data item has an empty key: write its id, or take the key out",
        ),
        (
            "  F: {is: text}\n  f: {is: execution}\n",
            "f: name \"f\": another key has it",
        ),
        (
            "  F: {is: text, name: Feed-1}\n",
            "F: name \"Feed-1\": must be small letters, digits and single underscores",
        ),
        (
            "  T: {is: temperature, unit: CELSIUS, change: {step: 1.0, rate_limit_per_s: 0.0, sample_period_s: 1.0}}\n",
            "T: change.rate_limit_per_s = 0 1/s: must be from 1e-9 to 1000000000 1/s",
        ),
    ] {
        assert_eq!(mapping(values).unwrap_err(), said);
    }
    let unknown = mapping("  a: {is: text, nam: b}\n").unwrap_err();
    assert!(unknown.contains("nam"), "{unknown}");
    let unknown = mapping("  a: {is: wish}\n").unwrap_err();
    assert!(unknown.contains("wish"), "{unknown}");
}

#[test]
fn keys_become_names_that_ros_takes() {
    for (key, name) in [
        ("Stemp", "stemp"),
        ("mill:S2 rpm", "mill_s2_rpm"),
        ("1st", "v_1st"),
        ("_x_", "x"),
    ] {
        assert_eq!(name_of(key), name);
        assert!(is_name(name), "{name}");
    }
}

#[test]
fn a_rule_in_fahrenheit_is_one_in_kelvin_inside() {
    let mapping = mapping("  T: {is: temperature, unit: FAHRENHEIT, change: {step: 1.8, rate_limit_per_s: 9.0, sample_period_s: 1.0}}\n").unwrap();
    let Some((
        _,
        Use::Number {
            rule: Some(rule), ..
        },
    )) = mapping.find("T", None)
    else {
        panic!("no rule");
    };
    assert!((rule.step - 1.0).abs() < 1e-12 && (rule.rate_limit_per_s - 5.0).abs() < 1e-12);
}
