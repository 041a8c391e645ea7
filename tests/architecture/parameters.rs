//! Names of a node's parameters, from the table of its README, which a test of the program compares with the node.

use crate::tree;

/// Names of the parameters of a node; empty: its README has no table.
pub fn names(node: &str) -> Vec<String> {
    let readme = tree::text(&format!("nodes/{node}/README.md"));
    readme.as_deref().map(of_table).unwrap_or_default()
}

/// The first column of the table with columns `unit` and `default`.
fn of_table(readme: &str) -> Vec<String> {
    let cells = |line: &str| -> Vec<String> {
        let inner = line.trim().trim_start_matches('|').trim_end_matches('|');
        let cells = inner.split('|').map(|cell| cell.trim().trim_matches('`'));
        cells.map(str::to_owned).collect()
    };
    let is_head = |line: &&str| {
        let head = cells(line);
        ["unit", "default"]
            .iter()
            .all(|name| head.iter().any(|cell| cell == name))
    };
    let after_head = readme.lines().skip_while(|line| !is_head(line)).skip(2);
    let rows = after_head.take_while(|line| line.starts_with('|'));
    rows.filter_map(|line| cells(line).into_iter().next())
        .collect()
}

#[test]
fn names_are_those_of_the_table_with_units_and_defaults() {
    let readme = "| a | b |\n|---|---|\n| `x` | 1 |\n\n| parameter | unit | default |\n|---|---|---|\n| `y_s` | s | 1 |\n| `z` | - | 2 |\n\n| `w` |\n";
    assert_eq!(of_table(readme), ["y_s", "z"]);
    assert_eq!(of_table("none"), Vec::<String>::new());
}
