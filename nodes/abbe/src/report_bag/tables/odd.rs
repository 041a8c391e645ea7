//! Tables with odd cells, and logs whose times have no unit.

use super::*;

/// Five runs over five targets both ways; `odd`: line and column (from 0) of a cell with another word.
fn stops_with(odd: Option<(usize, usize, &str)>) -> String {
    let mut lines = vec!["run,target mm,deviation um,direction".to_owned()];
    for run in 1..=5 {
        let ways = (0..5)
            .map(|k| (k, "up"))
            .chain((0..5).rev().map(|k| (k, "down")));
        lines.extend(ways.map(|(k, way)| format!("{run},{},{run}.{k},{way}", 100 * k)));
    }
    if let Some((line, column, word)) = odd {
        let mut cells: Vec<&str> = lines[line - 1].split(',').collect();
        cells[column] = word;
        lines[line - 1] = cells.join(",");
    }
    lines.join("\n")
}

#[test]
fn an_odd_cell_is_named_and_costs_its_row_or_reading_and_no_column() {
    let home = TempDir::new().unwrap();
    let table = home.path().join("X.csv");
    let taken = |text: &str| {
        std::fs::write(&table, text).unwrap();
        from_table::of(&table, None)
    };
    assert_eq!(taken(&stops_with(None)).unwrap().unwrap().n_odd, 0);
    for (line, column, word, name, what) in [
        (15, 3, "x", "direction", "row"),
        (2, 3, "north", "direction", "row"),
        (51, 3, "7", "direction", "row"),
        (20, 0, "four", "run", "row"),
        (20, 1, "3oo", "target mm", "row"),
        (33, 2, "oops", "deviation um", "reading"),
    ] {
        let taken = taken(&stops_with(Some((line, column, word))))
            .unwrap()
            .unwrap();
        let lines = taken.lines.join("\n");
        assert_eq!(taken.n_odd, 1, "{lines}");
        let cell = format!("line {line}, column \"{name}\": \"{word}\": must be");
        assert!(lines.contains(&cell), "{cell}: {lines}");
        assert!(
            lines.contains(&format!(": the {what} is left out")),
            "{lines}"
        );
        assert!(!lines.contains("does not name it"), "{lines}");
    }
    // A column of other words is no column of directions.
    let refused = stops_with(None).replace(",3.", ",x3.");
    let refused = format!("{:#}", taken(&refused).err().unwrap());
    assert!(refused.contains("10 such cells in 50 rows"), "{refused}");
}

#[test]
fn a_log_without_a_unit_of_its_time_is_read_in_the_likely_one_and_says_so() {
    let home = TempDir::new().unwrap();
    let table = home.path().join("Z.csv");
    for (per_minute, unit, head) in [
        (1.0, "min", "time"),
        (1.0 / 60.0, "h", "elapsed"),
        (1.0 / 1440.0, "d", "time"),
        (1.0 / 1440.0, "d", "time [d]"),
        (60_000.0, "ms", "time"),
        (60.0, "s", "time"),
    ] {
        let row = |k: u32| {
            format!(
                "{},{},20.5\n",
                f64::from(k) * per_minute,
                0.1 * f64::from(k)
            )
        };
        let head = head.replace("elapsed", "time elapsed");
        let text: String = (0..240).map(row).collect();
        std::fs::write(
            &table,
            format!("{head},displacement um,spindle temp\n{text}"),
        )
        .unwrap();
        let (report, lines) = reported_alone(&table);
        let lines = lines.join("\n");
        let named = format!("column \"{head}\" is in {unit}");
        assert!(lines.contains(&named), "{named}: {lines}");
        let asked = format!(
            "column \"{head}\": no unit in its name, read in {unit}: in {unit} it lasts 14340 s with a row every 60 s"
        );
        assert_eq!(lines.contains(&asked), !head.contains('['), "{lines}");
        let log = found(&report, "iso230_3_log");
        near(&log["figures"]["range"]["value_mm"], 1e3, 23.9);
    }
    let same = "time,displacement um\n0,1\n0,2\n0,3\n";
    std::fs::write(&table, same).unwrap();
    let refused = format!("{:#}", from_table::of(&table, None).err().unwrap());
    assert!(
        refused.contains("all 3 rows have the time 0 s"),
        "{refused}"
    );
}

/// A log along X of a mandrel at two heights: 1.5 µm/h at 110 mm, 3 µm/h at 260 mm, every 10 minutes for two hours.
fn two_heights(map: &str) -> anyhow::Result<Report> {
    let home = TempDir::new().unwrap();
    let table = home.path().join("tilt.csv");
    let row = |k: i32| {
        format!(
            "{},{},{}\n",
            600 * k,
            0.25 * f64::from(k),
            0.5 * f64::from(k)
        )
    };
    let rows: String = (0..=12).map(row).collect();
    std::fs::write(&table, format!("t,x1,x2\n{rows}")).unwrap();
    let (written, bag) = (home.path().join("map.yaml"), home.path().join("bag"));
    let map =
        format!("start_s: 1767600000\ntest:\n  log: {{time_s: t, displacement_um: x1, {map}}}\n");
    std::fs::write(&written, map).unwrap();
    let machine = root("launch_configs/first_run/machine.yaml");
    Import::of(table, written, machine, bag.clone()).execute()?;
    page("Tests", &Tests::of(&Bag::open(&bag).unwrap()), None)
}

#[test]
fn a_log_at_two_heights_has_its_tilt_by_hand() {
    for (axis, about, sign) in [("X", "B", 1.0), ("Y", "A", -1.0)] {
        let map = format!(
            "axis: {axis}, cause: spindle, second_displacement_um: x2, heights_mm: [110.0, 260.0]"
        );
        let report = two_heights(&map).unwrap();
        let tilt = found(&report, "iso230_3_tilt");
        assert_eq!(tilt["about"], about);
        assert_eq!(tilt["readings"], 13);
        // 1.5 µm over 150 mm in an hour: 10 µrad.
        near(&tilt["figures"]["after_1_h"]["value_rad"], 1e6, sign * 10.0);
        near(&tilt["figures"]["range"]["value_rad"], 1e6, 20.0);
        let logs = report.figures["tests"].as_array().unwrap();
        let heights: Vec<_> = { logs.iter() }
            .filter_map(|test| test["iso230_3_log"]["height_mm"].as_f64())
            .collect();
        assert_eq!(heights, [110.0, 260.0]);
    }
}

#[test]
fn heights_that_make_no_tilt_are_refused_with_the_key() {
    for (map, words) in [
        (
            "axis: X, second_displacement_um: x2",
            "two different heights",
        ),
        (
            "axis: X, second_displacement_um: x2, heights_mm: [110.0, 110.0]",
            "two different heights",
        ),
        ("axis: X, heights_mm: [110.0, 260.0]", "has 2 heights"),
        (
            "axis: Z, second_displacement_um: x2, heights_mm: [110.0, 260.0]",
            "make no tilt",
        ),
        (
            "axis: X, second_displacement_um: x2, heights_mm: [110.0, 26000.0]",
            "heights_mm[1] = 26000 mm",
        ),
    ] {
        let error = two_heights(map).map(|_| ()).unwrap_err();
        let error = format!("{error:#}");
        assert!(error.contains(words), "{map}: {error}");
    }
}
