//! Pages of circles that a plate or a ballbar read, with and without what a budget states of them.

use std::f64::consts::TAU;
use std::path::Path;

use metrology::sample::{TestKind, TestSegment};
use metrology::stamp::Stamp;

use super::*;
use crate::evaluate::Tests;
use crate::evaluate::circles::{CirclePoint, EvaluatedTurn, TurnBy};

const RADIUS_MM: f64 = 50.0;
const BUDGET: &str = "
grid_encoder: {expanded_uncertainty_um: 0.4, expanded_uncertainty_um_per_m: 2.0, coverage_factor: 2.0}
length_reference: {expanded_uncertainty_um: 0.1, expanded_uncertainty_um_per_m: 0.5, coverage_factor: 2.0}
machine: {temperature_deviation_k: 0.0, temperature_half_width_k: 0.0, expansion_um_per_m_k: 11.0, expansion_half_width_um_per_m_k: 0.0}
device: {temperature_deviation_k: 0.0, temperature_half_width_k: 0.0, expansion_um_per_m_k: 0.0, expansion_half_width_um_per_m_k: 0.0}
plate: {temperature_deviation_k: 0.0, temperature_half_width_k: 0.0, expansion_um_per_m_k: 0.0, expansion_half_width_um_per_m_k: 0.0}
misalignment_mm: 0.0
environmental_drift_um: 0.0
";
const BALLBAR: &str = "ballbar: {expanded_uncertainty_um: 1.0, expanded_uncertainty_um_per_m: 0.0, coverage_factor: 2.0}";

/// One turn with 3 µm sin 2θ, and noise of 0.02 µm.
fn circle(run: u32, sense: Sense, instrument: Instrument) -> CircleRecording {
    let mut seed = run;
    let mut noise_mm = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        2e-5 * (f64::from(seed >> 8) / f64::from(1_u32 << 24) - 0.5) * 12.0_f64.sqrt()
    };
    let turns = if sense == Sense::Clockwise { -1.0 } else { 1.0 };
    let point = |k: u32| {
        let turned = TAU * (f64::from(k) + 0.5) / 720.0;
        let angle = turns * turned;
        let radius_mm = RADIUS_MM + 0.003 * (2.0 * angle).sin() + noise_mm();
        CirclePoint {
            at_mm: [radius_mm * angle.cos(), radius_mm * angle.sin()],
            time_s: turned,
        }
    };
    recording(
        (0..720).map(point).collect(),
        (run, sense),
        (RADIUS_MM, RADIUS_MM),
        instrument,
    )
}

/// A recording of these points: number and sense of its run, nominal radius in mm and feed in mm/s.
pub(super) fn recording(
    points: Vec<CirclePoint>,
    (run, sense): (u32, Sense),
    (radius_mm, feed_mm_s): (f64, f64),
    instrument: Instrument,
) -> CircleRecording {
    CircleRecording {
        points,
        segment: TestSegment {
            plane: TestPlane::Xy,
            radius_mm,
            feed_mm_s,
            sense,
            zero_id: 1,
            setup_id: 1,
            completed: false,
            ..TestSegment::of_kind(TestKind::Circle, run, Stamp::from_nanos(0))
        },
        turn: EvaluatedTurn {
            by: TurnBy::FullRate,
            left_out_s: 0.0,
            left_out_rad: 0.0,
            n_left_out: 0,
        },
        compensated: false,
        instrument,
    }
}

/// Circle and causes of both senses.
fn page(instrument: Instrument, budget: Option<&str>) -> [Section; 2] {
    let circles = [
        circle(1, Sense::CounterClockwise, instrument),
        circle(2, Sense::Clockwise, instrument),
    ];
    let budget = budget.map(|text| Budget::read(text, Path::new("budget.yaml")).unwrap());
    let all = sections(&circles, budget.as_ref(), &TestConditions::default()).unwrap();
    all.try_into().unwrap()
}

/// The cell of a row in a column of the first table.
fn cell<'s>(section: &'s Section, row: &str, column: &str) -> &'s str {
    let table = &section.tables[0];
    let place = table.head.iter().position(|name| name == column);
    let place = place.unwrap_or_else(|| panic!("{column}: {:?}", table.head));
    let found = table.rows.iter().find(|cells| cells[0].starts_with(row));
    found.unwrap_or_else(|| panic!("{row}: {:?}", table.rows))[place].as_str()
}

/// What stands behind ±.
fn expanded(cell: &str) -> f64 {
    let behind = cell.split('±').nth(1).unwrap_or_else(|| panic!("{cell}"));
    behind.trim().split(' ').next().unwrap().parse().unwrap()
}

#[test]
fn causes_by_a_plate_have_its_squareness_and_waves_in_quadrature_by_hand() {
    let text = format!("{BUDGET}plate_squareness_urad: 2.0\n");
    let [_, causes] = page(Instrument::GridEncoder, Some(&text));
    let squareness = expanded(cell(&causes, "squareness", "value ± U (k = 2)"));
    // 2 µrad, and (2/50 mm) 0.4 µm √0.1168 = 5.47 µrad of waves: 5.82 µrad. The fit has 0.03 µrad.
    assert!((squareness - 5.82).abs() < 0.15, "{squareness}");
    // √2 · 2 µm/m for two axes, waves of order 2 as above in µm/m, steps 0.257 · 2 U₀ U₁ R: √(8 + 29.9 + 33.0) = 8.4 µm/m.
    let mismatch = expanded(cell(&causes, "scaling mismatch", "value ± U (k = 2)"));
    assert!((mismatch - 8.4).abs() < 0.3, "{mismatch}");
    let words = causes.lines.join(" ");
    assert!(words.contains("its squareness, drift."), "{words}");
    let [_, without] = page(Instrument::GridEncoder, Some(BUDGET));
    let words = without.lines.join(" ");
    assert!(words.contains("no plate_squareness_urad"), "{words}");
    assert!(expanded(cell(&without, "squareness", "value ± U (k = 2)")) < 5.7);
}

#[test]
fn causes_without_a_budget_are_headed_as_scatter() {
    for (instrument, budget) in [
        (Instrument::GridEncoder, None),
        (Instrument::Ballbar, None),
        (Instrument::Ballbar, Some(BUDGET)),
    ] {
        let [_, causes] = page(instrument, budget);
        assert_eq!(causes.tables[0].head[1], "value ± 2 s of the fit");
        let words = causes.lines.join(" ");
        assert!(words.contains(causes::SCATTER_ALONE), "{words}");
    }
}

#[test]
fn a_wave_within_the_limits_of_a_ballbar_is_no_reason_to_look_at_the_machine() {
    let [_, causes] = page(Instrument::Ballbar, Some(&format!("{BUDGET}{BALLBAR}\n")));
    // 1 µm sin 2θ over 50 mm: 40 µrad. The circle has 3 µm, 120 µrad.
    let cell = cell(&causes, "squareness", "value ± U (k = 2)");
    assert!((expanded(cell) - 40.0).abs() < 1.0, "{cell}");
    let coarse = BALLBAR.replace(
        "expanded_uncertainty_um: 1.0",
        "expanded_uncertainty_um: 4.0",
    );
    let [_, causes] = page(Instrument::Ballbar, Some(&format!("{BUDGET}{coarse}\n")));
    let look = causes.tables.get(1);
    let named =
        look.is_some_and(|rows| rows.rows.iter().any(|row| row[0].starts_with("squareness")));
    assert!(!named, "{look:?}");
}

#[test]
fn a_ballbar_without_a_calibrated_length_has_u_of_g_and_h_alone() {
    let [circle, _] = page(Instrument::Ballbar, Some(&format!("{BUDGET}{BALLBAR}\n")));
    // 2 √2 U₀/2 for G, and for H, which is a difference of two readings as well.
    for column in ["G", "H (1996)"] {
        let cell = cell(&circle, "both", column);
        assert!((expanded(cell) - 1.41).abs() < 0.006, "{cell}");
    }
    for (row, column) in [
        ("both", "D"),
        ("clockwise", "F max"),
        ("clockwise", "F min"),
    ] {
        let cell = cell(&circle, row, column);
        assert!(!cell.contains('±') && cell.parse::<f64>().is_ok(), "{cell}");
    }
    let all = &circle.figures["iso230_4"];
    assert!(all["both"]["mean_radial_deviation"]["expanded_uncertainty_mm"].is_null());
    assert!(
        all["counter_clockwise"]["least_radial_deviation"]["expanded_uncertainty_mm"].is_null()
    );
    let g = &all["clockwise"]["circular_error"]["expanded_uncertainty_mm"];
    assert!(
        (g.as_f64().unwrap() - 2.0_f64.sqrt() * 1e-3).abs() < 1e-9,
        "{g}"
    );
    assert_eq!(circle.figures["correction_to_20_degc"]["done"], false);
    assert!(circle.figures["no_verdict"].is_null());
    let why = circle.figures["no_verdict_on_radii"].as_str().unwrap();
    assert!(why.contains("calibrated length"), "{why}");
    assert!(
        circle.answers[0].ends_with("µm (k = 2)."),
        "{:?}",
        circle.answers
    );
    let kinds: Vec<&str> = circle.warnings.iter().map(|one| one.kind).collect();
    assert_eq!(kinds, [NOT_CORRECTED]);
    assert!(circle.tables[0].note.contains("environmental_unrest_um"));
}

#[test]
fn a_ballbar_that_the_budget_does_not_state_has_no_uncertainty_at_all() {
    let [circle, _] = page(Instrument::Ballbar, Some(BUDGET));
    let cells = circle.tables[0].rows.iter().flatten();
    assert!(cells.into_iter().all(|cell| !cell.contains('±')));
    assert!(!circle.answers[0].contains("k = 2"), "{:?}", circle.answers);
    let said = circle.warnings.iter().any(|warning| {
        warning
            .line
            .contains("no uncertainty of the ballbar is stated")
    });
    assert!(said, "{:?}", circle.warnings);
    let g = &circle.figures["iso230_4"]["both"]["circular_error"]["expanded_uncertainty_mm"];
    assert!(g.is_null(), "{g}");
    // Limits decide nothing of it.
    assert!(circle.figures["no_verdict"].is_string());
}

#[test]
fn what_decides_whether_a_radius_may_be_used_is_a_warning() {
    let silent = BUDGET.replacen("plate:", "# plate:", 1);
    let [circle, _] = page(Instrument::GridEncoder, Some(&silent));
    assert_eq!(circle.warnings[0].kind, NOT_CORRECTED);
    assert!(circle.warnings[0].line.contains("states no plate"));
    let [corrected, _] = page(Instrument::GridEncoder, Some(BUDGET));
    assert!(corrected.warnings.is_empty(), "{:?}", corrected.warnings);
}

#[test]
fn causes_and_circle_state_one_circular_error() {
    let [circle, causes] = page(Instrument::GridEncoder, Some(BUDGET));
    let of = |row: &str| -> f64 {
        let cell = cell(&circle, row, "G");
        cell.split(' ').next().unwrap().parse().unwrap()
    };
    let greatest = of("clockwise").max(of("counter-clockwise"));
    let words = format!("greatest circular error G of a sense {greatest:.2} µm");
    assert!(
        causes.answers[0].contains(&words),
        "{:?} {words}",
        causes.answers
    );
}

#[test]
fn u_of_h_names_the_unrest_that_it_lacks() {
    let [without, _] = page(Instrument::GridEncoder, Some(BUDGET));
    assert!(without.tables[0].note.contains(NO_UNREST));
    let stated = format!("{BUDGET}environmental_unrest_um: 0.1\n");
    let [with, _] = page(Instrument::GridEncoder, Some(&stated));
    assert!(!with.tables[0].note.contains(NO_UNREST));
}

#[test]
fn conditions_name_the_ballbar_and_count_no_radius_without_its_length_as_corrected() {
    let mut seen = TestConditions::default();
    seen.has_length = true;
    let of = |budget: &str| {
        let budget = Budget::read(budget, Path::new("budget.yaml")).unwrap();
        let tests = Tests {
            circles: vec![circle(1, Sense::Clockwise, Instrument::Ballbar)],
            ..Tests::default()
        };
        let found = crate::test_conditions::of(&seen, Some(&budget), Some(&tests));
        found.terminal()
    };
    let named = format!("{BUDGET}{BALLBAR}\ninstruments: {{ballbar: {{serial_number: 12-3}}}}\n");
    let words = of(&named);
    assert!(words.contains("ballbar, serial number 12-3"), "{words}");
    assert!(!words.contains("length reference"), "{words}");
    let wanted =
        "done for 0 of 1 circles (D and F); the calibrated length of the ballbar is not stated";
    assert!(words.contains(wanted), "{words}");
    let parts = "length: {expanded_uncertainty_um: 0.5, expanded_uncertainty_um_per_m: 1.0, coverage_factor: 2.0}, body: {temperature_deviation_k: 0.0, temperature_half_width_k: 0.1, expansion_um_per_m_k: 0.0, expansion_half_width_um_per_m_k: 0.0}";
    let whole = named.replacen(
        "coverage_factor: 2.0}\ninstruments",
        &format!("coverage_factor: 2.0, {parts}}}\ninstruments"),
        1,
    );
    assert!(whole.contains("body:"));
    let words = of(&whole);
    assert!(
        words.contains("done for 1 of 1 circles (D and F)"),
        "{words}"
    );
}

/// Two circles of both senses; the readings of each run are moved outwards by so many mm.
fn moved(slips: &[(u32, usize, f64)]) -> Vec<Section> {
    let mut circles: Vec<CircleRecording> = [(1, 1), (2, 1), (3, 2), (4, 2)]
        .into_iter()
        .map(|(run, zero_id)| {
            let sense = if run % 2 == 1 {
                Sense::CounterClockwise
            } else {
                Sense::Clockwise
            };
            let mut circle = circle(run, sense, Instrument::Ballbar);
            circle.segment.zero_id = zero_id;
            circle
        })
        .collect();
    for (run, at, mm) in slips {
        let circle = circles
            .iter_mut()
            .find(|one| one.segment.run == *run)
            .unwrap();
        let [u, v] = circle.points[*at].at_mm;
        let longer = 1.0 + mm / u.hypot(v);
        circle.points[*at].at_mm = [u * longer, v * longer];
    }
    sections(&circles, None, &TestConditions::default()).unwrap()
}

#[test]
fn an_outlier_refuses_its_run_by_name_in_figures_and_causes_and_the_others_are_evaluated() {
    let sound = moved(&[]);
    for (at, mm) in [(0, 90.0), (283, -3.0), (719, 2.6)] {
        let found = moved(&[(2, at, mm)]);
        assert_eq!(found.len(), sound.len());
        let words = all_words(&found[0]);
        let named = format!("Not evaluated: run 2: reading {} of 720, ", at + 1);
        assert!(words.contains(&named), "{words}");
        assert!(
            words.contains("at most 2.5 mm (5 % of the radius)"),
            "{words}"
        );
        assert!(found[0].title.contains("run 1:"), "{}", found[0].title);
        let lines = found[0].figures["not_evaluated"].as_array().unwrap();
        assert!(
            lines[0].as_str().is_some_and(|line| words.contains(line)),
            "{lines:?}"
        );
        assert_eq!(found[1].figures, sound[1].figures);
        // The other sense has the figure that it has without it.
        let g = |section: &Section| cell(section, "counter-clockwise", "G").to_owned();
        assert_eq!(g(&found[0]), g(&sound[0]));
        assert_eq!(g(&found[1]), g(&sound[1]));
        let causes = &found[2];
        assert!(causes.title.starts_with("Causes in XY"), "{}", causes.title);
        assert!(
            causes.answers[0].contains("in 3 recordings"),
            "{:?}",
            causes.answers
        );
        assert!(
            all_words(causes).contains("Left out: run 2: reading"),
            "{}",
            all_words(causes)
        );
    }
}

#[test]
fn a_circle_that_cannot_be_broken_down_leaves_the_causes_of_the_others() {
    type Change = fn(&mut CircleRecording);
    let ways: [(Change, &str); 3] = [
        (
            |it| it.segment.feed_mm_s = -1000.0,
            "run 2: feed_mm_s = -1000",
        ),
        (|it| it.points.clear(), "run 2: 0 samples"),
        (
            |it| it.segment.sense = Sense::CounterClockwise,
            "run 2: angles sweep",
        ),
    ];
    for (change, words) in ways {
        let mut circles = [
            circle(1, Sense::CounterClockwise, Instrument::Ballbar),
            circle(2, Sense::Clockwise, Instrument::Ballbar),
        ];
        change(&mut circles[1]);
        let found = sections(&circles, None, &TestConditions::default()).unwrap();
        let causes = found.last().unwrap();
        assert!(
            causes.answers[0].contains("in 1 recordings"),
            "{:?}",
            causes.answers
        );
        let words = format!("Left out: {words}");
        assert!(
            all_words(causes).contains(&words),
            "{words}: {}",
            all_words(causes)
        );
    }
}

#[test]
fn where_no_circle_is_sound_nothing_is_evaluated_and_each_reason_is_named() {
    let slips: Vec<(u32, usize, f64)> = (1..=4).map(|run| (run, 7, 9.0)).collect();
    let found = moved(&slips);
    for section in &found[..2] {
        assert!(section.tables.is_empty());
        assert_eq!(all_words(section).matches("reading 8 of 720").count(), 2);
    }
    let words = all_words(&found[2]);
    assert!(
        words.contains("Not evaluated: no circle can be broken down"),
        "{words}"
    );
    assert_eq!(words.matches("Left out: run").count(), 4, "{words}");
}

fn all_words(section: &Section) -> String {
    section.terminal()
}
