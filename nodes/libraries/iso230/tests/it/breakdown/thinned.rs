//! A search that takes samples together finds what a search among all of them finds.

use iso230::breakdown::{BreakdownConfig, PlaneBreakdown, RowKey, evaluate};

use crate::breakdown::machine::{Axis, Friction, Machine, drive};
use crate::breakdown::printed;

/// Samples a turn: ten to a row.
const DENSE: usize = 12_000;

/// Every effect that is searched for, one of them above what the rows of the search can show.
fn machine(vibration_hz: f64) -> Machine {
    let friction = Friction {
        coulomb_mm_s2: 200.0,
        bristle_per_s2: 2e5,
    };
    let x = Axis {
        friction: Some(friction),
        screw: Some((0.0015, 10.0, 0.4)),
        scale: 2e-5,
        ..Axis::default()
    };
    let y = Axis {
        play_mm: 0.003,
        lateral_mm: 0.001,
        vibration: Some((0.0006, vibration_hz)),
        ..Axis::default()
    };
    Machine {
        axes: [x, y],
        squareness_rad: 1e-5,
        noise_mm: 2e-4,
        ..Machine::default()
    }
}

fn plane(vibration_hz: f64, search_samples: usize) -> PlaneBreakdown {
    use iso230::breakdown::CircularSense::{Clockwise, CounterClockwise};
    let drives = [CounterClockwise, Clockwise].map(|sense| drive(50.0, 50.0, sense));
    let recordings = drives.map(|one| machine(vibration_hz).measure_densely(&one, DENSE));
    let config = BreakdownConfig {
        search_samples,
        ..BreakdownConfig::default()
    };
    evaluate(&recordings, &config).unwrap().planes.remove(0)
}

/// What a row is about, without the numbers that a search finds.
fn kind(key: &RowKey) -> String {
    match key {
        RowKey::Vibration { along, .. }
        | RowKey::Lobes { along, .. }
        | RowKey::VibrationOrLobes { along, .. } => format!("tone {along:?}"),
        other => format!("{other:?}"),
    }
}

fn agree(thin: &PlaneBreakdown, whole: &PlaneBreakdown) {
    let both = format!("{}\n\n{}", printed(thin), printed(whole));
    assert_eq!(thin.rows.len(), whole.rows.len(), "{both}");
    for row in &whole.rows {
        let same = thin.rows.iter().find(|r| kind(&r.key) == kind(&row.key));
        let found = same.unwrap_or_else(|| panic!("{}\n{both}", row.name));
        let (off, u) = (found.value - row.value, row.standard_uncertainty);
        assert!(
            off.abs() < 0.25 * u,
            "{}: {off:e} of {u:e}\n{both}",
            row.name
        );
        let ratio = found.standard_uncertainty / u;
        assert!((0.9..1.1).contains(&ratio), "{}: {ratio}\n{both}", row.name);
    }
}

#[test]
fn samples_taken_together_give_the_rows_of_all_samples() {
    agree(&plane(37.0, 1440), &plane(37.0, usize::MAX));
}

#[test]
fn vibration_that_the_rows_of_the_search_cannot_show_is_found_in_all_samples() {
    // Rows of the search stand 4.4 ms apart.
    let found = plane(310.0, 1440);
    let tone = found.rows.iter().find_map(|row| match row.key {
        RowKey::VibrationOrLobes { hz, .. } => Some((hz, row.value)),
        _ => None,
    });
    let (hz, amplitude_mm) = tone.unwrap_or_else(|| panic!("{}", printed(&found)));
    assert!((hz - 310.0).abs() < 0.01, "{hz}");
    assert!((amplitude_mm - 0.0006).abs() < 3e-5, "{amplitude_mm}");
}
