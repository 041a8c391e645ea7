//! Conditions of a test that make its figures another quantity: they belong to its title, which distinguishes series.

use serde_json::Value;

/// rad to deg.
const RAD_DEG: f64 = 180.0 / std::f64::consts::PI;
/// Deepest level below a test that is looked at for its targets.
const DEEPEST_CONDITION: usize = 3;

/// A title with the range of the targets, the place of the line and the correction to 20 degC, as far as the test has them.
/// Lengths are in tenths of a mm, angles in tenths of a deg.
pub fn with_conditions(title: &str, test: &Value) -> String {
    let mut text = title.to_owned();
    let place = test["place_mm"].as_object().into_iter().flatten();
    let place = place.filter_map(|(axis, at)| Some(format!("{axis} {}", in_tenths(at.as_f64()?))));
    let place: Vec<String> = place.collect();
    if let Some(range) = range(test, 0) {
        text.push_str(&format!(", {range}"));
    }
    if !place.is_empty() {
        text.push_str(&format!(", at {} mm", place.join(" ")));
    }
    if test["correction_to_20_degc"]["done"] == Value::Bool(true) {
        text.push_str(", at 20 °C");
    }
    text
}

/// Whether `text` names a test of this title: from the begin of a word on, in either case; a single letter, as an axis, is a word
/// of its own. Where a line stood (`, at Y 0 Z 100 mm`) counts for a text with the word "at" alone.
pub fn has_words(title: &str, text: &str) -> bool {
    let text = text.trim().to_ascii_lowercase();
    let title = title.to_ascii_lowercase();
    let is_of_place = text.split(' ').any(|word| word == "at");
    let title = if is_of_place {
        title
    } else {
        without_place(&title)
    };
    let is_letter = text.chars().count() == 1;
    title.match_indices(text.as_str()).any(|(at, found)| {
        let before = title[..at].chars().next_back();
        let behind = title[at + found.len()..].chars().next();
        let ends = |side: Option<char>| !side.is_some_and(char::is_alphanumeric);
        ends(before) && (ends(behind) || !is_letter)
    })
}

/// A title without the place of [`with_conditions`].
fn without_place(title: &str) -> String {
    let is_place = |part: &&str| part.starts_with("at ") && part.ends_with(" mm");
    let parts: Vec<&str> = title.split(", ").filter(|part| !is_place(part)).collect();
    parts.join(", ")
}

/// A number rounded to tenths, half away from zero; no negative zero. It is rounded to hundredths first: targets such as 12.25
/// that scatter by micrometres give one number.
fn in_tenths(number: f64) -> f64 {
    let hundredths = (number * 100.0).round();
    (hundredths / 10.0).round() / 10.0 + 0.0
}

/// From the least to the greatest target.
fn range(value: &Value, depth: usize) -> Option<String> {
    let entries = value.as_object().filter(|_| depth <= DEEPEST_CONDITION)?;
    let points = entries.get("points").and_then(Value::as_array);
    for (key, size, unit) in [("target_mm", 1.0, "mm"), ("target_rad", RAD_DEG, "deg")] {
        let targets = points.into_iter().flatten();
        let targets: Vec<f64> = targets.filter_map(|point| point[key].as_f64()).collect();
        if !targets.is_empty() {
            let least = targets.iter().copied().fold(f64::INFINITY, f64::min);
            let most = targets.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let [least, most] = [least, most].map(|target| in_tenths(size * target));
            return Some(format!("{least} to {most} {unit}"));
        }
    }
    let mut below = entries.values();
    below.find_map(|value| range(value, depth + 1))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_text_names_tests_by_their_words_and_a_place_by_at() {
        let x = "Positioning X: not compensated, by the length reference, 0 to 250 mm, at Y 0 Z 100 mm, at 20 °C";
        let y = "Positioning Y: not compensated, by the length reference, 0 to 250 mm, at X 30 mm";
        let circle = "Circle XY, R 100.000 mm: compensated";
        for (text, wanted) in [
            ("Y", [false, true, false]),
            ("x", [true, false, false]),
            ("positioning", [true, true, false]),
            ("Pos", [true, true, false]),
            ("circle X", [false, false, true]),
            ("xy", [false, false, true]),
            ("at Y 0", [true, false, false]),
            ("at X", [false, true, false]),
            ("at 20 °C", [true, false, false]),
            ("length reference", [true, true, false]),
            ("ference", [false, false, false]),
            (" Y ", [false, true, false]),
            ("z", [false, false, false]),
        ] {
            let found = [x, y, circle].map(|title| has_words(title, text));
            assert_eq!(found, wanted, "{text}");
        }
    }

    fn test(targets_mm: &[f64]) -> Value {
        let points: Vec<Value> = targets_mm
            .iter()
            .map(|at| json!({"target_mm": at}))
            .collect();
        json!({"iso230_2": {"n_runs": 5, "points": points}})
    }

    #[test]
    fn range_place_and_correction_tell_series_apart_and_repetitions_do_not() {
        let base = test(&[0.0, 50.1, 249.9]);
        let of = |test: &Value| with_conditions("Positioning X", test);
        assert_eq!(of(&base), "Positioning X, 0 to 249.9 mm");
        let with = |key: &str, value: Value| {
            let mut other = base.clone();
            other[key] = value;
            of(&other)
        };
        for other in [
            of(&test(&[0.0, 10.0, 49.98])),
            of(&test(&[-250.0, 0.0])),
            of(&test(&[0.0, 249.8])),
            with("place_mm", json!({"Y": 0.0, "Z": 120.0})),
            with("place_mm", json!({"Y": 300.0, "Z": 120.0})),
            with("correction_to_20_degc", json!({"done": true})),
        ] {
            assert_ne!(other, of(&base), "{other}");
        }
        for same in [
            of(&test(&[0.0002, 50.1, 249.9004])),
            of(&test(&[-0.0002, 50.1, 249.8997])),
            with("correction_to_20_degc", json!({"done": false})),
            with("place_mm", Value::Null),
        ] {
            assert_eq!(same, of(&base));
        }
        let all = json!({
            "place_mm": {"Y": -0.2, "Z": 119.9998},
            "correction_to_20_degc": {"done": true},
            "iso230_2": {"points": [{"target_mm": 0.0}, {"target_mm": 600.0}]},
        });
        assert_eq!(
            of(&all),
            "Positioning X, 0 to 600 mm, at Y -0.2 Z 120 mm, at 20 °C"
        );
        let turn = json!({"iso230_2_rotary": {"figures": {"points": [{"target_rad": 0.0}, {"target_rad": 1.221_7}]}}});
        assert_eq!(with_conditions("C", &turn), "C, 0 to 70 deg");
        assert_eq!(
            with_conditions("Drift", &json!({"iso230_3_log": {}})),
            "Drift"
        );
    }

    #[test]
    fn repetitions_about_usual_targets_and_places_have_one_title() {
        let of = |at_mm: f64| {
            let mut test = test(&[at_mm, at_mm + 100.0]);
            test["place_mm"] = json!({"Y": at_mm});
            with_conditions("X", &test)
        };
        for k in -4000_i32..4000 {
            // Every 0.05 mm from -200 mm on, with a scatter of 1 µm and more.
            let target_mm = f64::from(k) / 20.0;
            for off_mm in [-0.004, -0.001, -0.0004, 0.0003, 0.001, 0.004] {
                assert_eq!(
                    of(target_mm + off_mm),
                    of(target_mm),
                    "{target_mm} {off_mm}"
                );
            }
        }
        for (at_mm, title) in [
            (12.4996, "X, 12.5 to 112.5 mm, at Y 12.5 mm"),
            (12.5003, "X, 12.5 to 112.5 mm, at Y 12.5 mm"),
            (-0.0004, "X, 0 to 100 mm, at Y 0 mm"),
            (-0.05, "X, -0.1 to 100 mm, at Y -0.1 mm"),
            (33.333, "X, 33.3 to 133.3 mm, at Y 33.3 mm"),
        ] {
            assert_eq!(of(at_mm), title);
        }
    }
}
