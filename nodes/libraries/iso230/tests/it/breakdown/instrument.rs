//! What a plate or a ballbar adds to the uncertainty of a row, by hand and by numbers that numpy integrated.

use iso230::breakdown::CircularSense::{Clockwise, CounterClockwise};
use iso230::breakdown::{
    BreakdownConfig, BreakdownError, CircularRecording, Instrument, PlaneBreakdown, RowKey,
    evaluate, evaluate_with,
};
use iso230::budget::DeviceUncertainty;

use crate::breakdown::machine::{drive, faultless};

/// Both senses at one feed over R = 50 mm.
pub fn both_senses() -> Vec<CircularRecording> {
    let drives = [CounterClockwise, Clockwise].map(|sense| drive(50.0, 20.0, sense));
    faultless().measure_all(&drives)
}

/// Linear rows alone.
pub fn linear() -> BreakdownConfig {
    BreakdownConfig {
        pitches: Vec::new(),
        most_tones: 0,
        ..BreakdownConfig::default()
    }
}

const NOTHING: DeviceUncertainty = DeviceUncertainty {
    expanded_uncertainty_mm: 0.0,
    expanded_uncertainty_per_length: 0.0,
    coverage_factor: 2.0,
};
const PLATE: Instrument = Instrument::Plate {
    certificate: NOTHING,
    squareness_rad: 0.0,
    drift_mm: 0.0,
};

fn read_by(instrument: Instrument) -> PlaneBreakdown {
    let found = evaluate_with(&both_senses(), &[instrument; 2], &linear()).unwrap();
    found.planes.into_iter().next().unwrap()
}

/// What the instrument adds to the standard uncertainty of a row.
fn added(plane: &PlaneBreakdown, key: RowKey) -> f64 {
    let row = plane.row(&key).unwrap();
    let squares = row.standard_uncertainty.powi(2) - row.standard_uncertainty_of_fit.powi(2);
    assert!(squares >= -1e-24, "{row:?}");
    squares.max(0.0).sqrt()
}

fn near(what: &str, found: f64, by_hand: f64, share: f64) {
    assert!(
        (found - by_hand).abs() <= share * by_hand.abs() + 1e-9,
        "{what}: found {found:e}, by hand {by_hand:e}"
    );
}

#[test]
fn eq2_the_squareness_of_a_plate_is_in_ec0y_with_sensitivity_1() {
    let plane = read_by(Instrument::Plate {
        certificate: NOTHING,
        squareness_rad: 1e-6,
        drift_mm: 0.0,
    });
    // U = 2 µrad of a certificate with k = 2.
    near("EC0Y", added(&plane, RowKey::Squareness), 1e-6, 1e-3);
    near("mismatch", added(&plane, RowKey::ScalingMismatch), 0.0, 0.0);
    near("servo", added(&plane, RowKey::ServoMismatch), 0.0, 0.0);
}

#[test]
fn eq3_eq4_the_scale_of_each_axis_of_a_plate_is_in_both_scales_of_the_circle() {
    let plane = read_by(Instrument::Plate {
        certificate: DeviceUncertainty {
            expanded_uncertainty_per_length: 2e-6,
            ..NOTHING
        },
        squareness_rad: 0.0,
        drift_mm: 0.0,
    });
    // 2 µm/m with k = 2 for each axis: U(q) = √2 · 2 µm/m = 2.83 µm/m, U(m) = 2 µm/m.
    let mismatch = added(&plane, RowKey::ScalingMismatch);
    near("mismatch", 2.0 * mismatch, 2.828e-6, 1e-3);
    near(
        "expansion",
        added(&plane, RowKey::RadialExpansion),
        1e-6,
        1e-3,
    );
    near("EC0Y", added(&plane, RowKey::Squareness), 0.0, 0.0);
}

#[test]
fn eq7_waves_over_a_plate_are_in_ec0y_by_their_order_2() {
    let plane = read_by(Instrument::Plate {
        certificate: DeviceUncertainty {
            expanded_uncertainty_mm: 4e-4,
            ..NOTHING
        },
        squareness_rad: 0.0,
        drift_mm: 0.0,
    });
    // numpy: the mean of J₁² + J₃² over 2000 wavelengths is 0.1168. (2/50 mm) 0.2 µm √0.1168 = 2.73 µrad.
    near("EC0Y", added(&plane, RowKey::Squareness), 2.734e-6, 0.03);
    // What is read at the same place in both senses cannot look like a lag.
    let of_servo_s = added(&plane, RowKey::ServoMismatch);
    assert!(of_servo_s * 20.0 / 2.0 < 0.02e-3, "{of_servo_s}");
}

#[test]
fn eq8_a_ballbar_is_in_ec0y_by_a_sine_of_order_2_within_its_limits() {
    let plane = read_by(Instrument::Ballbar {
        reading_mm: 5e-4,
        drift_mm: 0.0,
    });
    // 1 µm sin 2θ over 50 mm is 2 · 1 µm/50 mm = 40 µrad = U.
    let squareness = added(&plane, RowKey::Squareness);
    near("EC0Y", 2.0 * squareness, 40e-6, 0.02);
    // The same of each sense, taken for v (T₁ − T₂)/2: 2 · 1 µm/20 mm/s = 0.1 ms. Backlash and play lie beside it.
    let servo_s = added(&plane, RowKey::ServoMismatch);
    assert!(2.0 * servo_s >= 0.098e-3, "{servo_s}");
}

#[test]
fn drift_is_new_in_every_turn() {
    let one = read_by(Instrument::Plate {
        certificate: NOTHING,
        squareness_rad: 0.0,
        drift_mm: 1e-4,
    });
    // Along x a wave of one turn, √2 u sin θ cos θ = (u/√2) sin 2θ at most, is one of six, at a phase of its own: u²/24 of
    // either axis. The wave of three turns has as much; those of half turns leak into it. Two turns: half of the variance.
    let u_mm = added(&one, RowKey::Squareness) * 50.0 / 2.0;
    let whole_waves_mm = 1e-4 * (4.0 / 24.0 / 2.0_f64).sqrt();
    assert!(
        (0.9 * whole_waves_mm..1.8 * whole_waves_mm).contains(&u_mm),
        "{u_mm:e} {whole_waves_mm:e}"
    );
}

#[test]
fn without_an_instrument_rows_have_the_scatter_of_the_fit_alone() {
    let alone = evaluate(&both_senses(), &linear()).unwrap();
    let exact = evaluate_with(&both_senses(), &[PLATE; 2], &linear()).unwrap();
    assert_eq!(alone, exact);
    let rows = &alone.planes[0].rows;
    for row in rows {
        let apart = row.standard_uncertainty - row.standard_uncertainty_of_fit;
        assert!(apart.abs() <= 1e-12 * row.standard_uncertainty, "{row:?}");
    }
}

#[test]
fn instruments_that_are_none_are_refused() {
    let recordings = both_senses();
    let one = evaluate_with(&recordings, &[PLATE], &linear()).unwrap_err();
    assert_eq!(
        one,
        BreakdownError::InstrumentCount {
            n: 1,
            recordings: 2
        }
    );
    let negative = Instrument::Ballbar {
        reading_mm: -1e-4,
        drift_mm: 0.0,
    };
    let refused = evaluate_with(&recordings, &[PLATE, negative], &linear()).unwrap_err();
    assert!(
        matches!(
            refused,
            BreakdownError::Negative {
                recording: 1,
                quantity: "reading_mm",
                ..
            }
        ),
        "{refused}"
    );
}
