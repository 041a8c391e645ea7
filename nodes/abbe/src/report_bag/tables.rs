//! Tables of `tests/import` from the import to the figures of the page, against `tests/validation/iso230_tables.py`.

use serde_json::Value;
use tempfile::TempDir;

use super::*;
use crate::import::Import;
mod conditions;
mod instruments;
mod odd;
mod touched;
mod warned;

const REFERENCE: &str = include_str!("../../../../tests/validation/iso230_tables.json");
/// Rounding of made-up motions and of sums; a table has steps of 0.01 µm or 0.1″.
const ROUNDING: f64 = 1e-6;

fn reference(case: &str, name: &str) -> f64 {
    let all: Value = serde_json::from_str(REFERENCE).unwrap();
    let pointer = format!("/{case}/{name}");
    all.pointer(&pointer).and_then(Value::as_f64).unwrap()
}

fn root(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .join(path)
}

/// The page of a table of `tests/import`, as a bag of a machine of `launch_configs`.
fn reported(table: &str, map: &str, machine: &str, budget: Option<&Budget>) -> Report {
    let home = TempDir::new().unwrap();
    let text = text_file::yaml(&root(&format!("tests/import/{map}"))).unwrap();
    reported_by(
        &home,
        &root(&format!("tests/import/{table}")),
        &text,
        machine,
        budget,
    )
}

fn reported_by(
    home: &TempDir,
    table: &Path,
    map: &str,
    machine: &str,
    budget: Option<&Budget>,
) -> Report {
    let (written, bag) = (home.path().join("map.yaml"), home.path().join("bag"));
    std::fs::write(&written, map).unwrap();
    let machine = root(&format!("launch_configs/{machine}/machine.yaml"));
    let import = Import::of(table.to_owned(), written, machine, bag.clone());
    import.execute().unwrap();
    let tests = Tests::of(&Bag::open(&bag).unwrap());
    page("Tests", &tests, budget).unwrap()
}

fn found<'r>(report: &'r Report, key: &str) -> &'r Value {
    let tests = report.figures["tests"].as_array().unwrap();
    let mut with_key = tests.iter().filter_map(|test| test.get(key));
    with_key
        .next()
        .unwrap_or_else(|| panic!("{key}: {}", report.terminal()))
}

fn near(found: &Value, scale: f64, wanted: f64) {
    let value = found.as_f64().unwrap() * scale;
    assert!((value - wanted).abs() < ROUNDING, "{value} {wanted}");
}

const BUDGET: &str = "
grid_encoder: {expanded_uncertainty_um: 0.6, expanded_uncertainty_um_per_m: 1.0, coverage_factor: 2.0}
length_reference: {expanded_uncertainty_um: 0.2, expanded_uncertainty_um_per_m: 0.5, coverage_factor: 2.0}
machine: {temperature_deviation_k: 0.5, temperature_half_width_k: 0.5, expansion_um_per_m_k: 11.0, expansion_half_width_um_per_m_k: 1.0}
device: {temperature_deviation_k: 0.0, temperature_half_width_k: 0.1, expansion_um_per_m_k: 0.0, expansion_half_width_um_per_m_k: 0.0}
misalignment_mm: 0.1
environmental_drift_um: 0.6
";

#[test]
fn val_a_warm_up_logged_once_is_evaluated_by_iso_230_3() {
    let budget = Budget::read(BUDGET, Path::new("budget.yaml")).unwrap();
    let report = reported("drift.csv", "drift.yaml", "first_run", Some(&budget));
    let log = found(&report, "iso230_3_log");
    let figures = &log["figures"];
    // The noise that was written into the table is 0.1 µm; numpy finds this much of it.
    let scatter_um = reference("drift", "scatter");
    assert!((scatter_um - 0.1).abs() < 0.015, "{scatter_um}");
    let contributions = &figures["contributions"];
    let two = 2.0_f64.sqrt();
    near(&contributions["scatter_mm"], 1e3, two * scatter_um);
    // By hand: 0.2 µm with k = 2 twice, and 0.5 µm/m of the 0.024 mm between the readings, which is 6 pm.
    near(&contributions["certificate_mm"], 1e3, two * 0.1);
    near(&contributions["artefact_mm"], 1e3, 0.0);
    let expanded_um = 2.0 * two * 0.1_f64.hypot(scatter_um);
    for (key, wanted) in [
        ("after_1_h", "after_1_h"),
        ("after_3_h", "after_3_h"),
        ("range", "range"),
    ] {
        near(&figures[key]["value_mm"], 1e3, reference("drift", wanted));
        near(&figures[key]["expanded_uncertainty_mm"], 1e3, expanded_um);
    }
    let rate = reference("drift", "rate_per_h");
    near(&figures["final_rate"]["value_mm_s"], 3.6e6, rate);
    assert_eq!(log["cause"], "not_stated");
    let beside = log["temperatures"].as_array().unwrap();
    let names: Vec<&str> = beside
        .iter()
        .filter_map(|one| one["sensor"].as_str())
        .collect();
    assert_eq!(names, ["ambient", "spindle_front"]);
    near(
        &beside[0]["range_k"],
        1.0,
        reference("drift", "ambient_range_k"),
    );
    near(
        &beside[1]["range_k"],
        1.0,
        reference("drift", "spindle_range_k"),
    );
    let text = report.terminal();
    assert!(text.contains("18.77 ± 0.39"), "{text}");
    let parts =
        "0.14 µm by the certificate of length_reference, 0.14 µm by the scatter of two readings";
    assert!(text.contains(parts), "{text}");
    assert!(
        report
            .html()
            .contains("Thermal drift of Z, run 1, ISO 230-3")
    );
}

#[test]
fn a_log_names_its_cause_and_what_it_is_too_short_for() {
    let home = TempDir::new().unwrap();
    let table = home.path().join("short.csv");
    let rows: String = (0..=40).map(|k| format!("{},{}\n", k * 60, k)).collect();
    std::fs::write(&table, format!("t,d\n{rows}")).unwrap();
    let map = "start_s: 1767600000\ntest:\n  log: {axis: Z, cause: environment, time_s: t, displacement_um: d}\n";
    let report = reported_by(&home, &table, map, "first_run", None);
    let text = report.terminal();
    assert!(
        text.contains("ISO 230-3: environmental temperature variation error, E_TVE"),
        "{text}"
    );
    assert!(text.contains("Recorded for 0.67 h: the drift of the first hour and that of three hours are not known."), "{text}");
    assert!(
        text.contains("No temperature was recorded meanwhile"),
        "{text}"
    );
    let log = found(&report, "iso230_3_log");
    near(&log["figures"]["range"]["value_mm"], 1e3, 40.0);
    assert!(log["figures"]["after_1_h"].is_null());
    assert!(log["figures"]["range"]["expanded_uncertainty_mm"].is_null());
}

#[test]
fn val_a_rotary_axis_has_its_figures_in_seconds_of_arc_over_a_turn_that_wraps() {
    let with_angles = format!(
        "{BUDGET}angular_reference: {{expanded_uncertainty_arcsec: 0.4, coverage_factor: 2.0, environmental_drift_arcsec: 0.0}}\n"
    );
    let budget = Budget::read(&with_angles, Path::new("budget.yaml")).unwrap();
    let report = reported("rotary.csv", "rotary.yaml", "five_axis", Some(&budget));
    let figures = &found(&report, "iso230_2_rotary")["figures"];
    let arcsec = 648_000.0 / std::f64::consts::PI;
    for (pointer, name) in [
        ("/both/reversal", "b"),
        ("/both/mean_reversal", "b_mean"),
        ("/both/repeatability", "r"),
        ("/both/systematic_error", "e"),
        ("/both/mean_systematic_error", "m"),
        ("/both/accuracy", "a"),
        ("/up/accuracy", "a_up"),
        ("/up/repeatability", "r_up"),
        ("/down/systematic_error", "e_down"),
        ("/down/accuracy", "a_down"),
    ] {
        let value = &figures.pointer(pointer).unwrap()["value_rad"];
        near(value, arcsec, reference("rotary", name));
    }
    near(
        &figures["both"]["systematic_error"]["expanded_uncertainty_rad"],
        arcsec,
        0.4,
    );
    let text = report.terminal();
    assert!(
        text.contains("13 targets from 0.000 to 360.000 deg, 5 runs up and down."),
        "{text}"
    );
    assert!(text.contains("ISO 230-2 / arcsec"), "{text}");
    assert!(text.contains("24.57 ± 0.40"), "{text}");
}

#[test]
fn the_budget_of_a_shipped_scenario_states_u_of_lengths_and_angles() {
    let path = root("launch_configs/full_closed/budget.yaml");
    let budget = Budget::read(&text_file::yaml(&path).unwrap(), &path).unwrap();
    let report = reported("rotary.csv", "rotary.yaml", "five_axis", Some(&budget));
    let both = &found(&report, "iso230_2_rotary")["figures"]["both"];
    let arcsec = 648_000.0 / std::f64::consts::PI;
    let u_of = |figure: &str| &both[figure]["expanded_uncertainty_rad"];
    // By hand: certificate 0.4″/2, drift at rest 0.1″/(2 √3) in each mean of five runs; B has no part of the certificate.
    let drift2 = (2.0 / 5.0) * 0.01 / 12.0;
    near(u_of("reversal"), arcsec, 2.0 * f64::sqrt(drift2));
    near(
        u_of("systematic_error"),
        arcsec,
        2.0 * f64::sqrt(0.04 + drift2),
    );
}

#[test]
fn val_short_steps_give_the_periodic_error_and_wide_ones_the_reason_why_not() {
    let report = reported("steps.csv", "steps.yaml", "gap_first", None);
    let both = found(&report, "iso230_2_periodic").as_array().unwrap();
    for (one, side) in both.iter().zip(["up", "down"]) {
        assert_eq!(one["direction"], side);
        let of = |name: &str| reference("steps", &format!("{side}/{name}"));
        let result = &one["result"];
        // The reference takes extremes from a grid of 400,000 points.
        let p = result["periodic_error"]["value_mm"].as_f64().unwrap() * 1e3;
        assert!((p - of("p")).abs() < 1e-4, "{p}");
        for harmonic in 0..3 {
            let amplitude = &result["harmonics"][harmonic]["amplitude"]["value_mm"];
            near(amplitude, 1e3, of(&format!("amplitudes/{harmonic}")));
        }
        near(&result["residual_standard_deviation_mm"], 1e3, of("s"));
    }
    let wide = reported("positioning.csv", "positioning.yaml", "gap_first", None);
    let text = wide.terminal();
    assert!(
        text.contains("X, run 1 on: not evaluated: targets lie 40.159 mm apart on the average"),
        "{text}"
    );
    let linear = found(&wide, "iso230_2");
    near(
        &linear["accuracy"]["value_mm"],
        1e3,
        reference("positioning", "a"),
    );
}

#[test]
fn val_one_way_has_the_values_of_its_side_and_says_so() {
    let home = TempDir::new().unwrap();
    let all = std::fs::read_to_string(root("tests/import/positioning.csv")).unwrap();
    let up: Vec<&str> = all
        .lines()
        .filter(|line| !line.contains(";down;"))
        .collect();
    let table = home.path().join("up.csv");
    std::fs::write(&table, up.join("\n")).unwrap();
    let map = text_file::yaml(&root("tests/import/positioning.yaml")).unwrap();
    let report = reported_by(&home, &table, &map, "gap_first", None);
    let one = found(&report, "iso230_2");
    assert_eq!(one["one_sided"], "up");
    for (key, name) in [
        ("accuracy", "a_up"),
        ("systematic_error", "e_up"),
        ("repeatability", "r_up"),
    ] {
        near(
            &one["up"][key]["value_mm"],
            1e3,
            reference("positioning", name),
        );
    }
    assert!(report.terminal().contains("5 runs up only (one-way)"));
}

/// Rows of `positioning.csv`: run, target (mm), deviation (µm), upwards.
fn laser_rows() -> Vec<(u32, f64, f64, bool)> {
    let text = std::fs::read_to_string(root("tests/import/positioning.csv")).unwrap();
    let lines = text.lines().filter(|line| !line.starts_with('#')).skip(1);
    let row = |line: &str| {
        let cells: Vec<String> = line.split(';').map(|cell| cell.replace(',', ".")).collect();
        let number = |k: usize| cells[k].parse::<f64>().unwrap();
        let is_up = cells.iter().any(|cell| cell == "up");
        (cells[0].parse().unwrap(), number(2), number(3), is_up)
    };
    lines.map(row).collect()
}

/// Another table of the same readings has the same figures.
fn has_the_figures_of_the_laser(table: &str, head: &str, keys: &str) {
    let home = TempDir::new().unwrap();
    let path = home.path().join("table.csv");
    std::fs::write(&path, table).unwrap();
    let map = format!(
        "start_s: 1767600000\nat_mm: {{Y: 0.0, Z: 120.0}}\n{head}\ntest:\n  positioning: {{axis: X, feed_mm_min: 6000.0, dwell_s: 2.0, overrun_mm: 5.0, {keys}}}\n"
    );
    let report = reported_by(&home, &path, &map, "gap_first", None);
    let linear = found(&report, "iso230_2");
    for (key, name) in [
        ("accuracy", "a"),
        ("repeatability", "r"),
        ("reversal", "b"),
        ("systematic_error", "e"),
    ] {
        near(
            &linear[key]["value_mm"],
            1e3,
            reference("positioning", name),
        );
    }
}

#[test]
fn val_passes_numbered_as_runs_unnumbered_and_scattered_targets_have_the_same_figures() {
    let rows = laser_rows();
    type Line<'l> = &'l dyn Fn(usize, &(u32, f64, f64, bool)) -> String;
    let table = |line: Line<'_>| {
        let lines: String = rows
            .iter()
            .enumerate()
            .map(|(k, row)| line(k, row))
            .collect();
        format!("n,t,d,w\n{lines}")
    };
    let word = |up: bool| if up { "forward" } else { "reverse" };
    let passes = table(&|_, (n, t, d, up)| {
        let pass = 2 * n - u32::from(*up);
        format!("{pass},{t},{d},{}\n", word(*up))
    });
    let keys = "run: n, target_mm: t, deviation_um: d";
    has_the_figures_of_the_laser(&passes, "", keys);
    has_the_figures_of_the_laser(&passes, "", &format!("{keys}, direction: w"));
    let unnumbered = "target_mm: t, deviation_um: d, direction: w";
    has_the_figures_of_the_laser(&passes, "", unnumbered);
    // Every target is off by up to 2 µm: in steps of 0.5 µm that no run repeats.
    let scattered = table(&|k, (n, t, d, up)| {
        let off_mm = 0.5e-3 * (((7 * k) % 9) as f64 - 4.0);
        format!("{n},{:.4},{d},{}\n", t + off_mm, word(*up))
    });
    has_the_figures_of_the_laser(&scattered, "", keys);
    has_the_figures_of_the_laser(&scattered, "", &format!("{keys}, direction: w"));
}

#[test]
fn val_measured_positions_inches_and_a_column_for_each_pass_have_the_same_figures() {
    let rows = laser_rows();
    let lines = rows.iter().map(|(n, t, d, _)| {
        let (target, measured) = (t / 25.4, (t + d * 1e-3) / 25.4);
        format!("{n}\t{target:.12}\t{measured:.12}\n")
    });
    let table: String = std::iter::once("Some program\t1.0\nRun\tTarget\tMeasured\n".to_owned())
        .chain(lines)
        .collect();
    has_the_figures_of_the_laser(
        &table.replace('-', "\u{2212}"),
        "separator: \"\\t\"\nunits: {Target: inch, Measured: inch}",
        "run: Run, target_mm: Target, measured_mm: Measured",
    );
    let runs: std::collections::BTreeSet<u32> = rows.iter().map(|row| row.0).collect();
    let passes: Vec<(u32, bool)> =
        { runs.iter().flat_map(|n| [(*n, true), (*n, false)]) }.collect();
    let mut targets: Vec<f64> = rows.iter().map(|row| row.1).collect();
    targets.sort_by(f64::total_cmp);
    targets.dedup();
    let name = |(n, up): &(u32, bool)| format!("Run {n} {}", if *up { '↑' } else { '↓' });
    let names: Vec<String> = passes.iter().map(name).collect();
    let line = |target: &f64| {
        let cell = |(n, up): &(u32, bool)| {
            let mut own = rows.iter();
            let is_own = |row: &&(u32, f64, f64, bool)| {
                row.0 == *n && row.3 == *up && (row.1 - target).abs() < 1e-9
            };
            own.find(is_own).unwrap().2.to_string()
        };
        let cells: Vec<String> = passes.iter().map(cell).collect();
        format!("{target},{}\n", cells.join(","))
    };
    let lines: String = targets.iter().map(line).collect();
    let table = format!("Position,{}\n{lines}", names.join(","));
    let pass = |(name, (_, up)): (&String, &(u32, bool))| {
        let direction = if *up { "up" } else { "down" };
        format!("{{column: {name}, direction: {direction}}}")
    };
    let listed: Vec<String> = names.iter().zip(&passes).map(pass).collect();
    let keys = format!("target_mm: Position, passes_um: [{}]", listed.join(", "));
    has_the_figures_of_the_laser(&table, "", &keys);
}

#[test]
fn val_a_worksheet_as_reports_print_it_has_the_same_figures() {
    let pass = |n: u32| {
        let name = |way: char| format!("Run {n} {way}");
        let (up, down) = (name('↑'), name('↓'));
        format!("{{column: {up}, direction: up}}, {{column: {down}, direction: down}}")
    };
    let passes: Vec<String> = (1..=5).map(pass).collect();
    let map = format!(
        "start_s: 1767600000\nat_mm: {{Y: 0.0, Z: 120.0}}\ntest:\n  positioning: {{axis: X, feed_mm_min: 6000.0, dwell_s: 2.0, overrun_mm: 5.0, target_mm: \"Position [mm]\", passes_um: [{}]}}\n",
        passes.join(", ")
    );
    let home = TempDir::new().unwrap();
    let report = reported_by(
        &home,
        &root("tests/import/wide.xlsx"),
        &map,
        "gap_first",
        None,
    );
    let linear = found(&report, "iso230_2");
    for (key, name) in [("accuracy", "a"), ("repeatability", "r"), ("reversal", "b")] {
        near(
            &linear[key]["value_mm"],
            1e3,
            reference("positioning", name),
        );
    }
}

/// The page of a table alone: no map, no machine file.
fn reported_alone(table: &Path) -> (Report, Vec<String>) {
    let taken = from_table::of(table, None).unwrap().unwrap();
    let tests = Tests {
        machine: None,
        ..Tests::of(&Bag::open(&taken.bag).unwrap())
    };
    let mut report = page("Tests", &tests, None).unwrap();
    report.begin_with_table(&taken.lines);
    (report, taken.lines.clone())
}

#[test]
fn val_a_table_alone_has_the_figures_of_its_standard() {
    for table in ["positioning.csv", "wide.xlsx"] {
        let (report, lines) = reported_alone(&root(&format!("tests/import/{table}")));
        let linear = found(&report, "iso230_2");
        for (key, name) in [("accuracy", "a"), ("repeatability", "r"), ("reversal", "b")] {
            near(
                &linear[key]["value_mm"],
                1e3,
                reference("positioning", name),
            );
        }
        let text = report.terminal();
        assert!(
            text.starts_with(&format!("Tests\n\n{}", lines[0])),
            "{text}"
        );
        assert!(
            lines
                .iter()
                .any(|line| line.starts_with("not in the table: axis")),
            "{lines:?}"
        );
    }
    let (report, lines) = reported_alone(&root("tests/import/drift.csv"));
    let log = found(&report, "iso230_3_log");
    near(
        &log["figures"]["after_1_h"]["value_mm"],
        1e3,
        reference("drift", "after_1_h"),
    );
    assert!(lines.contains(&"axis Z".to_owned()), "{lines:?}");
    let (report, _) = reported_alone(&root("tests/import/rotary.csv"));
    let figures = &found(&report, "iso230_2_rotary")["figures"];
    let arcsec = 648_000.0 / std::f64::consts::PI;
    near(
        &figures["both"]["accuracy"]["value_rad"],
        arcsec,
        reference("rotary", "a"),
    );
    let (report, lines) = reported_alone(&root("tests/import/ballbar.csv"));
    // Squareness and scale rest on the radius, which nobody stated.
    assert!(
        lines[0].starts_with("warning, radius_mm = 100.0"),
        "{lines:?}"
    );
    assert!(
        report.terminal().contains("ISO 230-4"),
        "{}",
        report.terminal()
    );
}

#[test]
fn units_that_cannot_be_right_are_asked_about() {
    let home = TempDir::new().unwrap();
    let (table, map) = (home.path().join("a.csv"), home.path().join("a.yaml"));
    std::fs::write(&table, "t,d,w\n0,0.001,up\n0.12,-0.004,up\n0.24,0.003,up\n").unwrap();
    let text = |units: &str| {
        format!(
            "start_s: 0\n{units}test:\n  positioning: {{axis: X, feed_mm_min: 1000.0, dwell_s: 2.0, overrun_mm: 1.0, target_mm: t, deviation_um: d, direction: w}}\n"
        )
    };
    let lines = |units: &str| {
        std::fs::write(&map, text(units)).unwrap();
        from_table::of(&table, Some(&map))
            .unwrap()
            .unwrap()
            .lines
            .join("\n")
    };
    let asked = lines("");
    assert!(
        asked.contains("at most 0.004 um") && asked.contains("are they mm?"),
        "{asked}"
    );
    assert!(
        asked.contains("reach to 0.24 mm alone: are they m?"),
        "{asked}"
    );
    let right = lines("units: {t: m, d: mm}\n");
    assert!(!right.contains("are they"), "{right}");
}

#[test]
fn a_map_for_a_bag_is_refused_and_a_folder_is_a_bag() {
    let folder = from_table::of(Path::new("runs/a.bag"), None).unwrap();
    assert!(folder.is_none());
    let Err(refused) = from_table::of(Path::new("bag"), Some(Path::new("map.yaml"))) else {
        panic!("taken");
    };
    assert!(
        refused.to_string().contains("--map does nothing"),
        "{refused}"
    );
}

#[test]
fn a_rotary_axis_without_a_reference_says_why_it_has_no_figures() {
    let test = reports::evaluate::angular::RotaryTest {
        axis: metrology::Axis::C,
        first_run: 3,
        targets_rad: vec![],
        up_rad: vec![],
        down_rad: vec![],
        mean_rad: 0.0,
        began: metrology::stamp::Stamp::from_nanos(0),
        outlying: Default::default(),
        left_out: vec![],
        longest_rest: Some(metrology::stamp::Span::from_nanos(2_000_000_000)),
        has_readings: false,
    };
    let tests = Tests {
        rotary_positioning: vec![test],
        ..Tests::default()
    };
    let text = page("Tests", &tests, None).unwrap().terminal();
    assert!(
        text.contains("Not evaluated: no angular reference was read (topic angle/position)"),
        "{text}"
    );
}

#[test]
fn every_form_of_a_page_names_the_defaults_that_its_figures_use_and_no_others() {
    let home = TempDir::new().unwrap();
    let stated = text_file::yaml(&root("launch_configs/gap_first/machine.yaml")).unwrap();
    // The leads of all three axes and the gain of X are left out: 10 mm and 60 1/s, docs/reference/machine-file.md.
    let silent = stated.replace(" lead_mm: 10.0,", "");
    let silent = silent.replacen(" position_gain_per_s: 60.0,", "", 1);
    let import = |name: &str, text: &str| {
        let folder = home.path().join(name);
        std::fs::create_dir(&folder).unwrap();
        let (machine, bag) = (folder.join("machine.yaml"), folder.join("bag"));
        std::fs::write(&machine, text).unwrap();
        let [table, map] = ["csv", "yaml"].map(|end| root(&format!("tests/import/steps.{end}")));
        Import::of(table, map, machine, bag.clone())
            .execute()
            .unwrap();
        page("Tests", &Tests::of(&Bag::open(&bag).unwrap()), None).unwrap()
    };
    let report = import("silent", &silent);
    let line = "Defaults of the machine file in these figures: axes.X.lead_mm = 10.0.";
    assert!(report.terminal().contains(line), "{}", report.terminal());
    assert!(report.html().contains(line));
    let listed = &report.figures["machine_defaults"];
    assert_eq!(*listed, serde_json::json!(["axes.X.lead_mm = 10.0"]));
    let report = import("stated", &stated);
    assert_eq!(report.figures["machine_defaults"], serde_json::json!([]));
    assert!(!report.terminal().contains("Defaults of the machine file"));
}

#[test]
fn wide_targets_have_the_reason_and_none_at_all_say_nothing_twice() {
    let bag = Bag::open(root("bags/dual_loop")).unwrap();
    let text = page("Tests", &Tests::of(&bag), None).unwrap().terminal();
    let why = "Not evaluated: the command rested for";
    assert!(text.contains(why), "{text}");
    assert!(!text.contains("Periodic positioning error"), "{text}");
}
