use std::collections::BTreeMap;

use serde::Deserialize;

use super::*;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "only the errors are looked at")]
struct File {
    name: String,
    axes: BTreeMap<char, AxisEntry>,
    #[serde(default)]
    steps: Vec<Step>,
    #[serde(default)]
    is_on: bool,
    #[serde(default)]
    normal: Option<[f64; 3]>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "only the errors are looked at")]
struct AxisEntry {
    lead_mm: f64,
    #[serde(default)]
    travel_mm: [f64; 2],
    #[serde(default)]
    channels: u8,
}

#[derive(Debug, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
#[expect(dead_code, reason = "only the errors are looked at")]
enum Step {
    Wait {
        seconds: f64,
    },
    Run {
        program: String,
    },
    Measure {
        axis: Letter,
        runs: u32,
        #[serde(default)]
        sense: Option<Way>,
        #[serde(default)]
        beams: Vec<[f64; 2]>,
    },
}

#[derive(Debug, Deserialize)]
enum Letter {
    X,
    Y,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Way {
    Clockwise,
}

fn refused(text: &str) -> String {
    read::<File>(text).expect_err(text).to_string()
}

/// Words of the library that no message has.
pub const LIBRARY_WORDS: [&str; 14] = [
    "Option",
    "DuplicateKeyPolicy",
    "from_str",
    "struct ",
    "expected",
    "invalid type",
    "unit variant",
    "missing field",
    "unknown field",
    "deserialize",
    "mapping",
    "sequence",
    "scalar",
    "f64",
];

#[test]
fn a_file_that_is_too_large_or_too_deep_is_refused_with_its_size_and_the_limit() {
    let long = read::<Vec<String>>(&"- a\n".repeat(250_001)).unwrap_err();
    assert!(
        long.rule.contains("keys and values") && long.rule.contains("at most 250000 are read"),
        "{long}"
    );
}

#[test]
#[expect(
    clippy::too_many_lines,
    reason = "a table of cases, read from top to bottom"
)]
fn every_error_names_place_key_value_and_what_belongs_there() {
    let good = "name: m\naxes:\n  X: {lead_mm: 10.0}\n";
    assert!(read::<File>(good).is_ok());
    for (text, wanted) in [
        (
            "name: m\naxes:\n  X: {lead_mm: ten}\n",
            "3:16: axes.X.lead_mm = ten: must be a number, in mm",
        ),
        (
            "name: m\naxes:\n  X: {lead_mm: }\n",
            "3:14: axes.X.lead_mm = nothing: must be a number, in mm",
        ),
        (
            "name: m\naxes:\n  X: {led_mm: 10.0}\n",
            "3:15: axes.X.led_mm: unknown key, is lead_mm meant? the keys here are lead_mm, travel_mm, channels",
        ),
        (
            "name: m\naxes:\n  X: {travel_mm: [0.0, 1.0]}\n",
            "3:3: axes.X.lead_mm: the key lead_mm is missing in axes.X: add it, in mm",
        ),
        (
            "name: m\naxes:\n  X: {lead_mm: 1.0, travel_mm: [0.0]}\n",
            "axes.X.travel_mm",
        ),
        (
            "name: m\naxes:\n  X: {lead_mm: 1.0, travel_mm: 5}\n",
            "3:32: axes.X.travel_mm = 5: must be a list, as [a, b]",
        ),
        (
            "name: m\naxes:\n  X: {lead_mm: 1.0, travel_mm: [0.0, far]}\n",
            "3:38: axes.X.travel_mm[1] = far: must be a number, in mm",
        ),
        (
            "name: m\naxes:\n  X: {lead_mm: 1.0, travel_mm: [-300,0, 300,0]}\n",
            "axes.X.travel_mm = a list of 4: must be a list of 2, in mm; a comma separates values, decimals have a point",
        ),
        (
            "name: m\naxes:\n  X: {lead_mm: 1.0, travel_mm: [0.0, 1.0, 2.0]}\n",
            "axes.X.travel_mm = a list of 3: must be a list of 2, in mm",
        ),
        (
            "name: m\naxes:\n  X: {lead_mm: 1.0, channels: 300}\n",
            "3:31: axes.X.channels = 300: must be a whole number from 0 to 255",
        ),
        (
            "name: m\naxes:\n  X: {lead_mm: 1.0, lead_mm: 2.0}\n",
            "axes.X.lead_mm: the key is there twice, in line 3 and line 3: keep one of them",
        ),
        (
            "name: m\nname: n\naxes: {}\n",
            "name: the key is there twice, in line 1 and line 2: keep one of them",
        ),
        (
            "name: m\naxes: 3\n",
            "2:7: axes = 3: must be keys with values",
        ),
        (
            "name: m\naxes: []\n",
            "axes = a list of 0: must be keys with values",
        ),
        (
            "axes: {}\n",
            "name: the key name is missing in the file: add it",
        ),
        (
            "name:\naxes: {}\n",
            "name = nothing: must be text, and nothing stands there",
        ),
        ("name: [a]\naxes: {}\n", "name = a list of 1: must be text"),
        (
            "name: m\naxes: {XY: {lead_mm: 1.0}}\n",
            "must be one character",
        ),
        (
            "name: m\naxes: {}\nis_on: 3\n",
            "3:8: is_on = 3: must be true or false",
        ),
        (
            "name: m\naxes: {}\nsteps:\n  - {do: wait, seconds: 1.0}\n  - {do: wait, seconds: long}\n",
            "5:25: steps[1].seconds = long: must be a number",
        ),
        (
            "name: m\naxes: {}\nsteps:\n  - {do: wait, second: 1.0}\n",
            "steps[0].second: unknown key, is seconds meant?",
        ),
        (
            "name: m\naxes: {}\nsteps:\n  - {do: wait}\n",
            "steps[0].seconds: the key seconds is missing in steps[0]: add it",
        ),
        (
            "name: m\naxes: {}\nsteps:\n  - {do: sleep}\n",
            "\"sleep\" is not known here: must be one of wait, run",
        ),
        (
            "name: m\naxes: {}\nsteps:\n  - do: measure\n    axis: x\n    runs: 3\n",
            "5:11: steps[0].axis = x: \"x\" is not known here: must be one of X, Y",
        ),
        (
            "name: m\naxes: {}\nsteps:\n  - do: wait\n    seconds: 1\n  - runs:\n    do: measure\n    axis: X\n",
            "6:9: steps[1].runs = nothing: must be a whole number from",
        ),
        (
            "name: m\naxes: {}\nsteps:\n  - {do: measure, axis: X, runs: 2, sense: CW}\n",
            "4:44: steps[0].sense = CW: \"CW\" is not known here: must be one of clockwise",
        ),
        (
            "name: m\naxes: {}\nsteps:\n  - {do: measure, axis: X, runs: 2, beams: [[1, 2], [1, x]]}\n",
            "4:57: steps[0].beams[1][1] = x: must be a number",
        ),
        (
            "name: m\naxes: {}\nsteps:\n  - {do: measure, axis: 'two: ''', runs: x, beams: x}\n",
            "steps[0].axis = \"two: ",
        ),
        (
            "name: m\naxes: {}\nsteps:\n  - {do: wait, seconds: *a}\n",
            "4:25: steps[0].seconds: the name behind `*a` is not defined above by `&a`",
        ),
        (
            "name: m\nis_on: true\naxes: *axes\n",
            "3:7: axes: the name behind `*axes` is not defined above",
        ),
        (
            "name: m\naxes: {X: {lead_mm: 1.0}\nsteps: [\n",
            "the text is no YAML at",
        ),
        ("name: m\n\taxes: {}\n", "line 2 begins with a tab"),
        ("", "the file is empty"),
        ("# nothing\n", ""),
        (
            "name: m\naxes: {}\n---\nname: m\n",
            "a second document begins here",
        ),
    ] {
        let words = refused(text);
        assert!(
            words.contains(wanted),
            "{text}\n  {words}\n  wanted: {wanted}"
        );
        assert!(
            words.split(':').next().unwrap().parse::<usize>().is_ok(),
            "{words}"
        );
        assert_eq!(words.lines().count(), 1, "{words}");
        for word in LIBRARY_WORDS {
            assert!(!words.contains(word), "{word}: {words}");
        }
    }
}

#[test]
fn a_key_is_found_by_its_path_and_one_that_is_not_there_by_what_is_around_it() {
    let text = "a: 1\nb:\n  c:\n    - {d: 2}\n    - {d: 3}\n  e.f: 4\n";
    let places = Places::of(text);
    for (key, line, column) in [
        ("a", 1, 4),
        ("b", 2, 1),
        ("b.c", 3, 3),
        ("b.c[1].d", 5, 11),
        ("b.e.f", 6, 8),
        ("b.c[1].x", 5, 7),
        ("b.c[7]", 3, 3),
        ("z.y", 1, 1),
    ] {
        assert_eq!(places.find(key), Some(Place { line, column }), "{key}");
    }
    assert_eq!(Places::of("").find("a"), None);
}

#[test]
fn deep_and_broken_texts_end_soon() {
    for text in [
        "[".repeat(100_000),
        "{a: ".repeat(50_000),
        "- ".repeat(50_000),
    ] {
        let error = read::<File>(&text).expect_err("no file");
        assert!(error.to_string().chars().count() < 600, "{error}");
    }
}

#[test]
fn a_message_about_a_key_is_given_its_place() {
    let text = "a: 1\nsteps:\n  - {do: wait}\n  - {do: run}\n";
    for (message, wanted) in [
        (
            "steps[1].runs = 0: must be 1 or above",
            "p.yaml:4:5: steps[1].runs = 0: must be 1 or above",
        ),
        ("steps[0]: too short", "p.yaml:3:5: steps[0]: too short"),
        (
            "3:5: a = b: must be a number",
            "p.yaml:3:5: a = b: must be a number",
        ),
        ("nobody answers", "p.yaml: nobody answers"),
        ("zeta = 3: must not be", "p.yaml: zeta = 3: must not be"),
    ] {
        assert_eq!(placed("p.yaml", text, message), wanted);
    }
}

#[test]
fn anchors_aliases_and_merge_keys_are_refused_without_words_of_the_library() {
    for (text, wanted) in [
        (
            "name: &a m\naxes:\n  X: {lead_mm: *a}\n",
            "3:16: axes.X.lead_mm = *: must be a number, in mm",
        ),
        (
            "name: m\naxes: &a\n  X: *a\n",
            "stands inside of its own anchor",
        ),
        ("name: *a\naxes: {}\n", "is not defined above by `&a`"),
        (
            "name: m\naxes:\n  X: &x {lead_mm: 1.0}\n  Y: {<<: *x, <<: 3}\n",
            "",
        ),
        (
            "name: m\naxes:\n  X: {<<: 3, lead_mm: 1.0}\n",
            "the merge key `<<` needs an alias",
        ),
        ("name: m\naxes:\n  X: &x {led_mm: 1.0}\n  Y: *x\n", "led_mm"),
        (
            "name: m\naxes: {}\nsteps: [&a {do: wait, seconds: *b}]\n",
            "is not defined above by `&b`",
        ),
    ] {
        let words = refused(text);
        assert!(words.contains(wanted), "{text}: {words}");
        assert_eq!(words.lines().count(), 1, "{words}");
        for word in LIBRARY_WORDS {
            assert!(!words.contains(word), "{word}: {words}");
        }
    }
}

#[test]
fn a_count_is_refused_with_the_range_of_its_key() {
    for (key, kind, words) in [
        ("steps[1].runs", "u32", "a whole number from 1 to 10000"),
        ("steps[1].repeats", "u32", "a whole number from 1 to 10000"),
        (
            "steps[1].stations",
            "u32",
            "a whole number from 1 to 100000",
        ),
        ("steps[1].points", "u32", "a whole number from 1 to 1000"),
        ("steps[1].targets", "u32", "a whole number from 2 to 100000"),
        ("channels", "u8", "a whole number from 0 to 255"),
        ("anything", "u32", "a whole number from 0 to 4294967295"),
        ("seed", "u64", "a whole number, 0 or above"),
    ] {
        assert_eq!(wanted(kind, key), words, "{key}");
    }
}

#[test]
fn a_base_is_a_path_and_the_only_key_of_its_file() {
    for (text, wanted) in [
        (
            "# shared\nbase: ../first_run/machine.yaml\n",
            Some("../first_run/machine.yaml"),
        ),
        ("\"base\": 'a b.yaml'\n", Some("a b.yaml")),
        ("{base: m.yaml}", Some("m.yaml")),
        ("name: base\naxes: {base: x}\n", None),
        ("- base: x\n", None),
        ("base", None),
        ("", None),
    ] {
        assert_eq!(base_of(text).unwrap().as_deref(), wanted, "{text}");
    }
    for (text, wanted) in [
        (
            "base: m.yaml\nname: mill\n",
            "1:7: base = m.yaml: must be the only key of its file",
        ),
        ("name: mill\nbase: m.yaml\n", "but name stands beside it"),
        ("base: m.yaml\nbase: n.yaml\n", "but base stands beside it"),
        (
            "base:\n",
            "base = nothing: must be the path of a file, relative to the folder of this one",
        ),
        ("base: [m.yaml]\n", "base = a list of 1: must be the path"),
        ("\nbase: {path: m.yaml}\n", "2:1: base = 1 keys: must be"),
    ] {
        let error = base_of(text).unwrap_err().to_string();
        assert!(error.contains(wanted), "{text}: {error}");
    }
}
