//! Lists of touches, against `tests/validation/touches.py`.

use super::*;
use crate::import::Named;

const OF_NUMPY: &str = include_str!("../../../../../tests/validation/touches.json");
/// Rounding of the search for a centre, mm.
const NEAR_MM: f64 = 1e-8;

fn numpy(pointer: &str) -> f64 {
    let all: Value = serde_json::from_str(OF_NUMPY).unwrap();
    all.pointer(pointer).and_then(Value::as_f64).expect(pointer)
}

fn same(found: &Value, pointer: &str) {
    let (value, wanted) = (found.as_f64().unwrap(), numpy(pointer));
    assert!(
        (value - wanted).abs() < NEAR_MM,
        "{pointer}: {value} {wanted}"
    );
}

/// Shapes and probing errors of a list, run by run.
fn shapes(report: &Report, case: &str, n: usize) {
    let shapes = found(report, "iso230_10_shapes").as_array().unwrap();
    let errors = found(report, "iso230_10_errors").as_array().unwrap();
    assert_eq!(
        (shapes.len(), errors.len()),
        (n, n),
        "{}",
        report.terminal()
    );
    for (k, (shape, error)) in shapes.iter().zip(errors).enumerate() {
        let of = |name: &str| format!("/{case}/runs/{k}/{name}");
        same(&shape["diameter_mm"], &of("diameter"));
        same(&shape["form_mm"], &of("form"));
        same(&error["probing_error_mm"], &of("form"));
    }
}

fn centres(report: &Report, case: &str) {
    let shapes = found(report, "iso230_10_shapes").as_array().unwrap();
    for (k, shape) in shapes.iter().enumerate() {
        for axis in 0..3 {
            let pointer = format!("/{case}/runs/{k}/centre/{axis}");
            same(&shape["centre_mm"][axis], &pointer);
        }
    }
    let location = &found(report, "iso230_10_location")[0];
    for axis in 0..3 {
        let value = &location["repeatability"][axis]["value_mm"];
        same(value, &format!("/{case}/location/{axis}"));
    }
    assert!(
        location["hours"].is_null(),
        "nobody stated times: {location}"
    );
}

#[test]
fn val_spheres_of_a_list_are_those_of_numpy() {
    let (report, lines) = reported_alone(&root("tests/import/touches.csv"));
    shapes(&report, "spheres", 5);
    centres(&report, "spheres");
    let text = report.terminal();
    assert!(
        text.contains("P_FTU,3D 2.97 µm, of 25 points on sphere 25, run 3."),
        "{text}"
    );
    assert!(text.contains("R_SPH X "), "{text}");
    let kept = &found(&report, "iso230_10_list")["sphere 25"];
    same(&kept["probing_error"]["value_mm"], "/spheres/runs/2/form");
    assert!(
        lines
            .iter()
            .any(|line| line.starts_with("assumed: positions of the centre"))
    );
    // Its map gives the same.
    let taken = from_table::of(
        &root("tests/import/touches.csv"),
        Some(&root("tests/import/touches.yaml")),
    );
    let tests = Tests::of(&Bag::open(&taken.unwrap().unwrap().bag).unwrap());
    shapes(&page("Tests", &tests, None).unwrap(), "spheres", 5);
}

#[test]
fn val_a_list_of_linuxcnc_is_parted_into_its_rounds() {
    let (report, lines) = reported_alone(&root("tests/import/touches_linuxcnc.txt"));
    shapes(&report, "linuxcnc", 3);
    centres(&report, "linuxcnc");
    let said = lines.join("\n");
    assert!(
        said.contains("PROBEOPEN") && said.contains("parted into 3 runs"),
        "{said}"
    );
    assert!(said.contains("no unit, read in mm"), "{said}");
}

#[test]
fn val_a_bore_of_a_list_in_inches_is_that_of_numpy_in_its_own_plane() {
    let home = TempDir::new().unwrap();
    let map = home.path().join("map.yaml");
    let text = "start_s: 0\nunits: {x: inch, y: inch, z: inch}\ntest:\n  touches: {x_mm: x, y_mm: y, z_mm: z}\n";
    std::fs::write(&map, text).unwrap();
    let taken = from_table::of(&root("tests/import/touches_dprnt.txt"), Some(&map));
    let tests = Tests::of(&Bag::open(&taken.unwrap().unwrap().bag).unwrap());
    let report = page("Tests", &tests, None).unwrap();
    shapes(&report, "bore", 1);
    let shape = &found(&report, "iso230_10_shapes")[0];
    assert_eq!(shape["normal"], serde_json::json!([0.0, 1.0, 0.0]));
    same(&shape["centre_mm"][0], "/bore/runs/0/centre/0");
    same(&shape["centre_mm"][2], "/bore/runs/0/centre/1");
    assert_eq!(found(&report, "iso230_10_errors")[0]["usual_points"], 36);
}

#[test]
fn a_list_whose_shapes_are_too_small_for_mm_is_asked_about() {
    let taken = from_table::of(&root("tests/import/touches_dprnt.txt"), None);
    let warnings = taken.unwrap().unwrap().warnings().join("\n");
    assert!(
        warnings.contains("no diameter above 1.457 mm: are they inches?"),
        "{warnings}"
    );
}

#[test]
fn val_one_place_touched_again_and_again_is_that_of_numpy() {
    let (report, _) = reported_alone(&root("tests/import/touches_place.txt"));
    let place = &found(&report, "iso230_10_repeatability")[0];
    same(&place["range_mm"], "/place/range");
    same(&place["standard_deviation_mm"], "/place/s");
    same(&place["drift_mm"], "/place/drift");
    let text = report.terminal();
    assert!(
        text.contains(
            "R_SPT 4.10 µm, s 1.37 µm, drift 3.94 µm from first to last, of 10 touches of place"
        ),
        "{text}"
    );
    assert!(text.contains("not stated"), "no feed is made up: {text}");
}

/// Why a list is refused.
fn refusal(name: &str, text: &str) -> String {
    let home = TempDir::new().unwrap();
    let path = home.path().join(name);
    std::fs::write(&path, text).unwrap();
    format!("{:#}", from_table::of(&path, None).err().expect(text))
}

#[test]
fn lists_of_nothing_that_is_evaluated_are_refused_with_what_they_are() {
    let rows = |point: fn(f64) -> [f64; 3], n: u32| -> String {
        let row = |k: u32| point(f64::from(k)).map(|mm| format!("{mm:.4}")).join(",");
        let rows: Vec<String> = (0..n).map(row).collect();
        format!("x_mm,y_mm,z_mm\n{}\n", rows.join("\n"))
    };
    for (text, words) in [
        (rows(|k| [k, 2.0 * k, -3.0 * k], 12), "on one line"),
        (
            rows(|k| [k * k, 7.0 * k, 1.0], 3),
            "a ring needs 4, a sphere 6",
        ),
        (
            rows(|k| [k % 5.0 * 10.0, (k / 5.0).floor() * 10.0, 0.01 * k], 25),
            "× 0 mm: in one plane, and no circle",
        ),
        (
            rows(|_| [1.0, 2.0, 3.0], 4),
            "4 touches of one place: at least 5",
        ),
        (
            "x_mm,y_mm,z_mm\nNaN,1,2\nNaN,2,3\n1,NaN,3\n".to_owned(),
            "must be a number",
        ),
        (
            "x_mm,y_inch,z_mm\n1,2,3\n2,3,4\n3,4,5\n".to_owned(),
            "have one unit",
        ),
        (
            "x_deg,y_deg,z_deg\n1,2,3\n2,3,4\n3,4,5\n".to_owned(),
            "columns x_deg",
        ),
    ] {
        let said = refusal("list.csv", &text);
        assert!(said.contains(words) && said.contains("list.csv"), "{said}");
    }
    // Half of the points of a sphere in inches.
    let text = std::fs::read_to_string(root("tests/import/touches.csv")).unwrap();
    let mixed: Vec<String> = (0..)
        .zip(text.lines())
        .filter(|(k, _)| *k < 27)
        .map(|(k, line)| match line.split(',').collect::<Vec<_>>()[..] {
            [run, name, x, y, z] if k > 14 => {
                let inch = [x, y, z].map(|mm| format!("{:.5}", mm.parse::<f64>().unwrap() / 25.4));
                format!("{run},{name},{}", inch.join(","))
            }
            _ => line.to_owned(),
        })
        .collect();
    let said = refusal("list.csv", &mixed.join("\n"));
    assert!(
        said.contains("of \"sphere 25\"") && said.contains("on no sphere"),
        "{said}"
    );
}

#[test]
fn a_row_without_a_number_is_left_out_and_named() {
    let text = std::fs::read_to_string(root("tests/import/touches.csv")).unwrap();
    let home = TempDir::new().unwrap();
    let path = home.path().join("list.csv");
    std::fs::write(&path, text.replacen("209.9999", "NaN", 1)).unwrap();
    let (report, lines) = reported_alone(&path);
    let errors = found(&report, "iso230_10_errors").as_array().unwrap();
    assert_eq!(
        (errors[0]["points"].clone(), errors[1]["points"].clone()),
        (24.into(), 25.into())
    );
    assert!(
        lines
            .iter()
            .any(|line| line.contains("line 3, column \"x_mm\"")),
        "{lines:?}"
    );
    let text = report.terminal();
    assert!(
        text.contains("24 points; the standard asks for 25"),
        "{text}"
    );
}

#[test]
fn places_that_are_touched_by_turns_are_told_apart() {
    let home = TempDir::new().unwrap();
    let path = home.path().join("list.csv");
    let row = |k: u32| {
        let (round, place) = (k / 3, k % 3);
        let height = -10.0 + 0.001 * f64::from(round * (place + 1));
        format!("{},{},{height:.4}", 40 * place, 7 * place * place)
    };
    let rows: Vec<String> = (0..18).map(row).collect();
    std::fs::write(&path, format!("X,Y,Z\n{}\n", rows.join("\n"))).unwrap();
    let (report, lines) = reported_alone(&path);
    let places = found(&report, "iso230_10_repeatability")
        .as_array()
        .unwrap();
    let ranges: Vec<f64> = places
        .iter()
        .map(|place| (place["range_mm"].as_f64().unwrap() * 1e6).round())
        .collect();
    assert_eq!(ranges, [5000.0, 10_000.0, 15_000.0], "{lines:?}");
}

#[test]
fn a_list_has_nothing_to_diagnose() {
    let machine = Named {
        place: "machine.yaml".to_owned(),
        text: std::fs::read_to_string(root("launch_configs/first_run/machine.yaml")).unwrap(),
    };
    let refused = from_table::of_machine(&root("tests/import/touches.csv"), None, (machine, None));
    let said = refused.err().unwrap().to_string();
    assert!(
        said.contains("touches.csv: a list of touches") && said.contains("abbe report"),
        "{said}"
    );
}

#[test]
fn val_targets_across_have_the_figures_of_the_usual_layout() {
    for (table, left_out) in [
        ("across.csv", "\"x̄ ↑\" (line 14)"),
        ("across.xlsx", "\"B_i\""),
    ] {
        let (report, lines) = reported_alone(&root(&format!("tests/import/{table}")));
        let linear = found(&report, "iso230_2");
        for (key, name) in [("accuracy", "a"), ("repeatability", "r"), ("reversal", "b")] {
            near(
                &linear[key]["value_mm"],
                1e3,
                reference("positioning", name),
            );
        }
        let said = lines.join("\n");
        assert!(said.contains("targets across: 15 of them"), "{said}");
        assert!(said.contains(left_out), "{said}");
    }
}

#[test]
fn targets_across_in_inches_with_a_reading_that_is_missing_are_read() {
    let home = TempDir::new().unwrap();
    let path = home.path().join("a.csv");
    let text = "Axis Y\nTarget (inch),0,1,2,3\nRun 1 forward (thou),0.1,0.2,0.3,0.4\nRun 1 reverse (thou),0.2,n/a,0.4,0.5\nRun 2 forward (thou),0.1,0.2,0.3,0.4\nRun 2 reverse (thou),0.2,0.3,0.4,0.5\nMean forward,9,9,9,9\n";
    std::fs::write(&path, text).unwrap();
    let (report, lines) = reported_alone(&path);
    let said = lines.join("\n");
    assert!(
        said.contains("1 readings: their cells are empty or no number"),
        "{said}"
    );
    assert!(said.contains("\"Mean forward\" (line 7)"), "{said}");
    let linear = found(&report, "iso230_2");
    // By hand: the forward mean rises by 0.3 thou, the reversal is 0.1 thou.
    near(&linear["reversal"]["value_mm"], 1e3, 2.54);
}
