//! Layouts of rqt, PlotJuggler and Foxglove name only topics and fields that the wire has.

use abbe_msgs::{parts_of, topics};
use serde_json::Value;

use crate::check;
use crate::tree;

/// A topic and what of its message is shown; empty: the whole of it.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Shown {
    topic: String,
    field: String,
}

/// First number in `type_description_interfaces/FieldType` of arrays, behind those of single values.
const FIRST_ARRAY: u8 = 49;

/// Type of the messages of an absolute topic; `None`: there is no such topic.
fn type_of(topic: &str) -> Option<&'static str> {
    let is_named = |entry: &&topics::Entry| {
        let name = format!("/{}", entry.name.trim_start_matches('/'));
        if entry.is_family {
            topic
                .strip_prefix(&name)
                .is_some_and(|member| !member.is_empty() && !member.contains('/'))
        } else {
            topic == name
        }
    };
    let entry = topics::all().iter().find(is_named)?;
    Some(entry.description.type_name)
}

/// What is wrong with a field, steps of which are parted by `.`; an array's element is `name[0]`.
fn wrong_field(type_name: &str, field: &str) -> Option<String> {
    let mut type_name = type_name;
    for step in field.split('.').filter(|step| !step.is_empty()) {
        let (name, is_element) = match step.split_once('[') {
            Some((name, index)) => {
                let number = index
                    .strip_suffix(']')
                    .and_then(|index| index.parse::<u16>().ok());
                if number.is_none() {
                    return Some(format!("{step}: no index"));
                }
                (name, true)
            }
            None => (step, false),
        };
        let parts = parts_of(type_name)?;
        let Some(found) = parts.fields.iter().find(|found| found.name == name) else {
            return Some(format!("{type_name} has no field {name}"));
        };
        let is_array = found.type_id >= FIRST_ARRAY;
        if is_array != is_element {
            return Some(format!(
                "{type_name}: {name}: an index belongs to arrays alone"
            ));
        }
        type_name = found.nested;
    }
    None
}

fn wrong(file: &str, shown: &[Shown]) -> Vec<String> {
    let mut found = Vec::new();
    for Shown { topic, field } in shown {
        match type_of(topic) {
            None => found.push(format!("{file}: {topic}: no such topic")),
            Some(type_name) => {
                let reason = wrong_field(type_name, field);
                found.extend(reason.map(|reason| format!("{file}: {topic}: {reason}")));
            }
        }
    }
    found
}

/// A path of topic and fields parted by slashes: the longest topic that is known before the rest.
fn by_slashes(path: &str) -> Shown {
    let ends = path
        .match_indices('/')
        .map(|(at, _)| at)
        .filter(|at| *at > 0);
    let mut ends: Vec<usize> = ends.chain([path.len()]).collect();
    ends.reverse();
    let end = ends
        .into_iter()
        .find(|end| type_of(&path[..*end]).is_some());
    let (topic, field) = path.split_at(end.unwrap_or(path.len()));
    Shown {
        topic: topic.to_owned(),
        field: field.trim_start_matches('/').replace('/', "."),
    }
}

fn of_plotjuggler(text: &str) -> Vec<Shown> {
    let document = roxmltree::Document::parse(text).unwrap();
    let named = |tag: &str, attribute: &str| -> Vec<String> {
        let elements = document.descendants();
        let elements = elements.filter(|element| element.has_tag_name(tag));
        let values = elements.filter_map(|element| element.attribute(attribute));
        values.map(str::to_owned).collect()
    };
    let curves = named("curve", "name");
    // Its plugin for ROS 2 keeps the topics to listen to in one text.
    let heard = named("selected_topics", "value");
    let heard = heard.iter().flat_map(|topics| topics.split(';'));
    let names = curves.iter().map(String::as_str).chain(heard);
    names.map(by_slashes).collect()
}

/// Every text below a JSON value that begins with a slash, with the key it stands under.
fn paths(value: &Value, out: &mut Vec<String>) {
    match value {
        Value::String(text) if text.starts_with('/') => out.push(text.clone()),
        Value::Array(items) => items.iter().for_each(|item| paths(item, out)),
        Value::Object(fields) => fields.values().for_each(|field| paths(field, out)),
        _ => {}
    }
}

fn of_foxglove(text: &str) -> Vec<Shown> {
    let mut all = Vec::new();
    paths(&serde_json::from_str(text).unwrap(), &mut all);
    let shown = |path: String| {
        let (topic, field) = path.split_once('.').unwrap_or((&path, ""));
        Shown {
            topic: topic.to_owned(),
            field: field.to_owned(),
        }
    };
    all.into_iter().map(shown).collect()
}

/// Values are Python's `repr` in JSON: lists of texts in single quotes.
fn of_rqt(text: &str) -> Vec<Shown> {
    let whole: Value = serde_json::from_str(text).unwrap();
    let text = whole.to_string();
    let quoted = text.split('\'').filter(|quoted| quoted.starts_with('/'));
    quoted.map(by_slashes).collect()
}

/// Frames that a Foxglove layout's 3D panels name.
fn frames_of_foxglove(text: &str) -> Vec<String> {
    let whole: Value = serde_json::from_str(text).unwrap();
    let panels = whole["configById"].as_object().unwrap();
    let panels = panels.iter().filter(|(id, _)| id.starts_with("3D!"));
    let mut named = Vec::new();
    for (_, panel) in panels {
        let shown = panel["transforms"].as_object().into_iter().flatten();
        named.extend(shown.filter_map(|(key, _)| Some(key.strip_prefix("frame:")?.to_owned())));
        named.extend(panel["followTf"].as_str().map(str::to_owned));
        let layers = panel["layers"].as_object().into_iter().flatten();
        let ids = layers.filter_map(|(_, layer)| layer["frameId"].as_str());
        named.extend(ids.map(str::to_owned));
    }
    named
}

/// What of `named` a machine has no frame of.
fn unknown_frames(named: &[String], machine: &str) -> Vec<String> {
    let file = machine::MachineFile::parse(machine, "machine.yaml").unwrap();
    let tree = machine::FrameTree::new(&file).unwrap();
    let is_known = |name: &String| {
        name == machine::frames::BASE || tree.frames().iter().any(|frame| frame.name() == name)
    };
    let unknown = named.iter().filter(|name| !is_known(name));
    unknown
        .map(|name| format!("{name}: no such frame"))
        .collect()
}

#[test]
fn the_layouts_three_dimensional_panel_names_frames_of_the_cell() {
    let named = frames_of_foxglove(&tree::text("launch_configs/cell.foxglove.json").unwrap());
    assert!(named.len() > 10, "{named:?}");
    let cell = tree::text("launch_configs/first_run/machine.yaml").unwrap();
    check(&unknown_frames(&named, &cell));
    let bad = r#"{"configById": {"3D!a": {"followTf": "bed", "transforms": {"frame:x_slide": {}, "frame:b_rotary": {}}}}}"#;
    assert_eq!(unknown_frames(&frames_of_foxglove(bad), &cell).len(), 2);
}

#[test]
fn arch_layouts_name_only_what_the_wire_has() {
    type Reader = fn(&str) -> Vec<Shown>;
    let readers: [(&str, Reader); 3] = [
        ("launch_configs/cell.plotjuggler.xml", of_plotjuggler),
        ("launch_configs/cell.foxglove.json", of_foxglove),
        ("launch_configs/cell.perspective", of_rqt),
    ];
    for (file, read) in readers {
        let shown = read(&tree::text(file).unwrap());
        assert!(shown.len() > 20, "{file}: {}", shown.len());
        check(&wrong(file, &shown));
    }
    let bad = "<root><curve name=\"/axes/state/comanded[0]\"/><curve name=\"/axes/state/motor\"/>\
               <curve name=\"/axis/state/motor[0]\"/><selected_topics value=\"/latency;/latencies\"/></root>";
    assert_eq!(wrong("a.xml", &of_plotjuggler(bad)).len(), 4);
    let bad =
        r#"{"a": ["/thermal/model.axes[0].k1_m", "/thermal/model.axes[0].k0_m", "/temperature/"]}"#;
    assert_eq!(wrong("a.json", &of_foxglove(bad)).len(), 2);
    let bad = r#"{"topics": {"repr": "['/compensation/totals[0]', '/compensation/total[0]']"}}"#;
    assert_eq!(wrong("a.perspective", &of_rqt(bad)).len(), 1);
}
