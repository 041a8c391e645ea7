//! `abbe schema NAME`: the JSON Schema of a file that people write, from the types that read it.
//!
//! It has keys, types and choices. Ranges and what keys ask of each other are checked by `abbe validate` alone.

use std::process::ExitCode;

use anyhow::Result;
use clap::{Args, ValueEnum};
use machine::MachineFile;
use reports::evaluate::budget::Budget;
use reports::evaluate::limits::Limits;
use schemars::schema_for;
use sequencer::plan::Plan;
use serde_json::{Value, json};

use crate::import::map::Map;
use crate::scenario::ScenarioFile;
use crate::tell::tell;

/// Arguments of `abbe schema`.
#[derive(Args)]
pub struct Schema {
    /// The file.
    name: Name,
}

/// Files that have a schema.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Name {
    /// `machine.yaml`.
    Machine,
    /// `plan.yaml`.
    Plan,
    /// `scenario.yaml`.
    Scenario,
    /// `limits.yaml`.
    Limits,
    /// `budget.yaml`.
    Budget,
    /// The map of `abbe import`.
    ImportMap,
}

impl Schema {
    /// Prints the schema.
    ///
    /// # Errors
    /// When it is no JSON.
    pub fn execute(self) -> Result<ExitCode> {
        tell!("{}", serde_json::to_string_pretty(&schema_of(self.name))?);
        Ok(ExitCode::SUCCESS)
    }
}

/// The schema, draft 2020-12.
fn schema_of(name: Name) -> Value {
    let (title, mut schema) = match name {
        Name::Machine => ("machine.yaml", schema_for!(MachineFile)),
        Name::Plan => ("plan.yaml", schema_for!(Plan)),
        Name::Scenario => ("scenario.yaml", schema_for!(ScenarioFile)),
        Name::Limits => ("limits.yaml", schema_for!(Limits)),
        Name::Budget => ("budget.yaml", schema_for!(Budget)),
        Name::ImportMap => ("map of abbe import", schema_for!(Map)),
    };
    schema.insert("title".to_owned(), title.into());
    with_base(schema.to_value())
}

/// A schema that takes `base` as the only key as well: the path of the file that has the others.
fn with_base(mut schema: Value) -> Value {
    let required = schema
        .as_object_mut()
        .and_then(|all| all.remove("required"));
    schema["properties"]["base"] = json!({
        "description": "Path of the file whose contents this one has, relative to its folder; then the only key.",
        "type": "string",
    });
    schema["if"] = json!({"required": ["base"]});
    schema["then"] = json!({"maxProperties": 1});
    schema["else"] = json!({"required": required.unwrap_or_else(|| json!([]))});
    schema
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn the_written_schemas_are_those_of_the_types() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference/schemas");
        for name in Name::value_variants() {
            let value = name.to_possible_value().unwrap();
            let name_of = value.get_name();
            let path = folder.join(format!("{name_of}.json"));
            let remedy =
                format!("write it: abbe schema {name_of} > docs/reference/schemas/{name_of}.json");
            let text = std::fs::read_to_string(&path)
                .unwrap_or_else(|error| panic!("{}: {error}; {remedy}", path.display()));
            let written: Value = serde_json::from_str(&text).unwrap();
            assert!(
                written == schema_of(*name),
                "{} is not what the types say; {remedy}",
                path.display()
            );
        }
    }

    /// The keys of an object of a schema.
    fn keys<'s>(schema: &'s Value, pointer: &str) -> Vec<&'s str> {
        let object = schema.pointer(pointer).and_then(Value::as_object);
        let object = object.unwrap_or_else(|| panic!("{pointer}: {schema:#}"));
        object.keys().map(String::as_str).collect()
    }

    #[test]
    fn a_schema_refuses_unknown_keys_and_knows_which_axes_turn() {
        let machine = schema_of(Name::Machine);
        assert_eq!(machine["additionalProperties"], false);
        assert_eq!(
            machine["else"]["required"],
            serde_json::json!(["name", "chain", "axes"])
        );
        assert_eq!(machine["then"]["maxProperties"], 1);
        let mut axes = keys(&machine, "/properties/axes/properties");
        axes.sort_unstable();
        assert_eq!(axes, ["A", "B", "C", "X", "Y", "Z"]);
        let of = |axis: &str| &machine["properties"]["axes"]["properties"][axis]["$ref"];
        assert_eq!(of("X"), "#/$defs/LinearAxisEntry");
        assert_eq!(of("C"), "#/$defs/RotaryAxisEntry");
    }

    #[test]
    fn a_map_takes_the_names_of_a_rotary_axis_instead() {
        let map = schema_of(Name::ImportMap);
        let tests = map
            .pointer("/$defs/Test/oneOf")
            .unwrap()
            .as_array()
            .unwrap();
        let mut tests = tests.iter();
        let test = tests.find_map(|test| test.pointer("/properties/positioning"));
        let test = test.unwrap();
        let known = keys(test, "/properties");
        assert!(known.contains(&"target_deg") && known.contains(&"target_mm"));
        let required = serde_json::json!(["axis", "dwell_s"]);
        assert_eq!(test["required"], required);
        assert_eq!(test["allOf"].as_array().unwrap().len(), 7);
    }
}
