//! Tests: the page of an imported table warns of an instrument that does not follow.

use tempfile::TempDir;

use super::{reported_alone, root};

/// The page of a table, as a terminal shows it.
fn page_of(name: &str, table: &str) -> String {
    let home = TempDir::new().unwrap();
    let path = home.path().join(name);
    std::fs::write(&path, table).unwrap();
    reported_alone(&path).0.terminal()
}

#[test]
fn a_thermometer_that_dies_during_a_log_is_on_its_page() {
    let whole = std::fs::read_to_string(root("tests/import/drift.csv")).unwrap();
    // From the second hour on the wire is broken.
    let dead: String = { whole.lines() }
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            match cells[..] {
                [time_s, um, _, ambient] if time_s.parse::<u32>().is_ok_and(|s| s >= 7200) => {
                    format!("{time_s},{um},0.0,{ambient}\n")
                }
                _ => format!("{line}\n"),
            }
        })
        .collect();
    let said = page_of("drift.csv", &dead);
    assert!(
        said.contains("Dead instrument: thermometer spindle"),
        "{said}"
    );
    assert!(said.contains("reads 0 °C"), "{said}");
    let said = page_of("drift.csv", &whole);
    assert!(!said.contains("Dead instrument"), "{said}");
}

#[test]
fn readings_at_the_end_of_a_range_are_on_their_page() {
    let clipped_at = |end_um: f64| {
        let rows: String = (0..5)
            .flat_map(|run| (0..11).flat_map(move |k| [true, false].map(|up| (run, k, up))))
            .map(|(run, k, up)| {
                let scatter_um = f64::from((run * 7 + k * 5) % 11) * 0.1;
                let um = f64::from(k) * 1.5 - if up { 0.0 } else { 1.2 } + scatter_um;
                let direction = if up { "up" } else { "down" };
                format!("{run},{},{direction},{:.1}\n", 50 * k, um.min(end_um))
            })
            .collect();
        page_of(
            "laser.csv",
            &format!("run,target_mm,direction,deviation_um\n{rows}"),
        )
    };
    let said = clipped_at(10.0);
    assert!(said.contains("are 10 µm, an end of all"), "{said}");
    let said = clipped_at(100.0);
    assert!(!said.contains("an end of all"), "{said}");
}
