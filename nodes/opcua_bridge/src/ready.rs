//! Ready mappings for companion specifications, by namespaces and browse names.

/// What stands before the name of a ready mapping in `map_file`.
const BEFORE: &str = "ready:";

/// Names of the ready mappings with their files.
pub const ALL: [(&str, &str); 3] = [
    ("cnc", include_str!("../mappings/cnc.yaml")),
    (
        "machine_tool",
        include_str!("../mappings/machine_tool.yaml"),
    ),
    ("machinery", include_str!("../mappings/machinery.yaml")),
];

/// The text of a ready mapping where `map_file` names one; `None`: it is a path.
///
/// # Errors
/// When there is no ready mapping of that name.
pub fn of(map_file: &str) -> Option<Result<&'static str, String>> {
    let name = map_file.strip_prefix(BEFORE)?;
    let found = ALL.iter().find(|(known, _)| *known == name);
    let names = ALL.map(|(name, _)| format!("{BEFORE}{name}")).join(", ");
    Some(
        found
            .map(|(_, text)| *text)
            .ok_or_else(|| format!("map_file = {map_file:?}: must be a path or one of {names}")),
    )
}

#[cfg(test)]
mod tests {
    use machine_report::{MapFile, Mapping};

    use super::*;
    use crate::node_key::NodeKey;

    #[test]
    fn ready_mappings_are_mappings_of_paths() {
        for (name, text) in ALL {
            let file = MapFile::from_yaml(text).unwrap_or_else(|error| panic!("{name}: {error}"));
            let mapping = Mapping::new(&file).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert!(mapping.uses().count() > 2, "{name}");
            for (key, _) in mapping.uses() {
                let read = NodeKey::read(key).unwrap();
                assert!(matches!(read, NodeKey::Path(_)), "{name}: {key}");
                assert_eq!(read.text(), key, "{name}");
            }
        }
    }

    #[test]
    fn a_name_that_is_none_is_refused_with_those_that_are() {
        assert!(of("map.yaml").is_none());
        assert!(of("ready:machinery").unwrap().is_ok());
        let refused = of("ready:mill").unwrap().unwrap_err();
        assert!(
            refused.contains("ready:cnc, ready:machine_tool, ready:machinery"),
            "{refused}"
        );
    }
}
