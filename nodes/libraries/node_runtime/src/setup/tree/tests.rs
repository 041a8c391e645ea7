use super::*;

#[derive(Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
struct Config {
    rate_hz: f64,
    #[serde(default)]
    count: Option<u32>,
    #[serde(default)]
    inner: Vec<Inner>,
    #[serde(default)]
    kind: Kind,
}

#[derive(Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
struct Inner {
    width_mm: f64,
}

#[derive(Debug, Default, Deserialize, PartialEq)]
#[serde(rename_all = "snake_case")]
enum Kind {
    #[default]
    Hold,
    Fade {
        seconds_s: f64,
    },
}

fn place(yaml: &str) -> (String, String) {
    let error = read::<Config>(&Tree::from_yaml(yaml).unwrap()).unwrap_err();
    (error.place(), error.reason())
}

#[test]
fn a_configuration_is_read_with_all_kinds_of_values() {
    let yaml = "rate_hz: 10.0\ncount: 3\ninner: [{width_mm: 0.5}]\nkind: {fade: {seconds_s: 2.0}}";
    let config: Config = read(&Tree::from_yaml(yaml).unwrap()).unwrap();
    let expected = Config {
        rate_hz: 10.0,
        count: Some(3),
        inner: vec![Inner { width_mm: 0.5 }],
        kind: Kind::Fade { seconds_s: 2.0 },
    };
    assert_eq!(config, expected);
    let dotted = "rate_hz: 1e1\nkind.fade.seconds_s: 2.0";
    let config: Config = read(&Tree::from_yaml(dotted).unwrap()).unwrap();
    assert_eq!(config.kind, Kind::Fade { seconds_s: 2.0 });
}

#[test]
fn errors_name_the_place_and_the_value() {
    assert_eq!(
        place("rate_hz: 10"),
        (
            "rate_hz".into(),
            "expected a double, got the integer 10: write 10.0".into()
        )
    );
    let (where_, reason) = place("rate_hz: 1.0\ninner: [{width_mm: 0.5}, {width_um: 1.0}]");
    assert_eq!(where_, "inner[1].width_um");
    assert_eq!(
        reason,
        "unknown key, is width_mm meant? the keys here are width_mm"
    );
    let (where_, reason) = place("rate_hz: 1.0\ncount: many");
    assert_eq!(where_, "count");
    assert_eq!(reason, "must be a whole number from 0 to 4294967295");
    let (_, reason) = place("rate_hz: fast");
    assert_eq!(reason, "must be a number, in Hz");
    let (_, reason) = place("rate_hz: 1.0\nkind: drop");
    assert_eq!(
        reason,
        "\"drop\" is not known here: must be one of hold, fade"
    );
    assert!(place("count: 1").1.contains("rate_hz"));
}

#[test]
fn later_values_override_and_maps_merge() {
    let mut tree = Tree::from_yaml("a: {b: 1, c: 2}").unwrap();
    tree.insert("a", Tree::from_yaml("{c: 3, d: [1.5]}").unwrap());
    tree.insert("a.b", Tree::Bool(true));
    let names: Vec<_> = tree
        .leaves()
        .into_iter()
        .map(|(n, v)| format!("{n}={v}"))
        .collect();
    assert_eq!(names, ["a.b=true", "a.c=3", "a.d=a list of 1"]);
}
