//! A small fixed set that must not fall below what it has reached: machines whose drawing never changes, diagnosed
//! by whatever the diagnosis has become.

use serde_json::Value;

use crate::series::{folder, run};

/// The rate of an arm, k of n.
fn rate(table: &Value, arm: &str, what: &str) -> (u64, u64) {
    let arms = table["arms"].as_array().unwrap();
    let own = arms.iter().find(|tally| tally["arm"] == arm).unwrap();
    let rates = own["rates"].as_array().unwrap();
    let found = rates.iter().find(|rate| rate["what"] == what);
    let count = &found.unwrap_or_else(|| panic!("{what}: {rates:?}"))["count"];
    (count["k"].as_u64().unwrap(), count["n"].as_u64().unwrap())
}

#[test]
fn a_machine_with_nothing_hidden_gets_no_name() {
    let folder = folder();
    let arguments = ["--arm", "iv", "--n", "3", "--seed", "11", "--in-process"];
    let (table, said) = run(folder.path(), &arguments);
    assert_eq!(rate(&table, "null", "diagnosed"), (3, 3), "{said}");
    assert_eq!(rate(&table, "null", "nothing named"), (3, 3), "{said}");
}
