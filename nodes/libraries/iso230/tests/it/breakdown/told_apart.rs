//! Pairs are split when the recordings split them, and given as one row, with what is missing, when not.

use iso230::breakdown::CircularSense::{Clockwise, CounterClockwise};
use iso230::breakdown::{Needed, PlaneBreakdown, ReferenceLength, Row, RowKey};
use metrology::Axis::{X, Y};

use crate::breakdown::machine::{Axis, Drive, Machine, drive, faultless, full_set, with_axis};
use crate::breakdown::{breakdown, printed};

fn row<'a>(plane: &'a PlaneBreakdown, key: &RowKey) -> &'a Row {
    plane
        .row(key)
        .unwrap_or_else(|| panic!("{key:?}\n{}", printed(plane)))
}

fn close(row: &Row, value: f64, within: f64, plane: &PlaneBreakdown) {
    let off = (row.value - value).abs();
    assert!(
        off <= within,
        "{} = {} for {value}\n{}",
        row.name,
        row.value,
        printed(plane)
    );
}

fn tilted() -> Machine {
    let axis = Axis {
        lag_s: 3e-4,
        ..Axis::default()
    };
    Machine {
        squareness_rad: 3e-5,
        ..with_axis(0, axis)
    }
}

#[test]
fn squareness_and_servo_mismatch_are_split_by_both_senses() {
    let plane = breakdown(&tilted().measure_all(&full_set()));
    close(row(&plane, &RowKey::Squareness), 3e-5, 6e-7, &plane);
    close(row(&plane, &RowKey::ServoMismatch), 3e-4, 6e-6, &plane);
}

#[test]
fn squareness_and_servo_mismatch_are_one_row_of_one_sense_and_feed() {
    for sense in [CounterClockwise, Clockwise] {
        let plane = breakdown(&tilted().measure_all(&[drive(100.0, 20.0, sense)]));
        assert!(plane.row(&RowKey::ServoMismatch).is_none());
        let sum = row(&plane, &RowKey::Squareness);
        assert_eq!(sum.aliases[0].key, RowKey::ServoMismatch);
        // −σ v/R of the servo mismatch is in the value: a lag of X closes the angle where the sense is positive.
        assert!((sum.aliases[0].coefficient + sense.sign() * 0.2).abs() < 1e-9);
        close(sum, 3e-5 - sense.sign() * 0.2 * 3e-4, 1e-6, &plane);
        let alone: Vec<_> = sum.aliases[0].needed.iter().map(Vec::as_slice).collect();
        for expected in [Needed::OtherSense, Needed::OtherFeed, Needed::OtherRadius] {
            assert!(alone.contains(&[expected].as_slice()), "{alone:?}");
        }
        assert!(sum.name.contains("squareness") && sum.name.contains("servo mismatch"));
    }
}

fn shrunk() -> Machine {
    let axis = Axis {
        lag_s: 0.02,
        scale: 2e-5,
        ..Axis::default()
    };
    Machine {
        axes: [axis; 2],
        ..faultless()
    }
}

#[test]
fn contraction_and_expansion_are_split_by_two_feeds_and_not_by_one() {
    let at = |feed: f64| [CounterClockwise, Clockwise].map(|sense| drive(100.0, feed, sense));
    let plane = breakdown(&shrunk().measure_all(&[at(50.0), at(20.0)].concat()));
    close(row(&plane, &RowKey::RadialExpansion), 2e-5, 4e-7, &plane);
    close(row(&plane, &RowKey::RadiusContraction), 4e-4, 8e-6, &plane);
    let plane = breakdown(&shrunk().measure_all(&at(50.0)));
    let sum = row(&plane, &RowKey::RadialExpansion);
    assert_eq!(sum.aliases[0].key, RowKey::RadiusContraction);
    assert!(sum.aliases[0].needed.contains(&vec![Needed::OtherFeed]));
    assert!(!sum.aliases[0].needed.contains(&vec![Needed::OtherSense]));
    close(sum, 2e-5 - 0.125 * 4e-4, 1e-6, &plane);
    assert!(plane.scales.is_none());
}

#[test]
fn a_free_reference_takes_the_expansion_with_it_but_leaves_the_contraction_of_two_feeds() {
    let free = |feed, sense| Drive {
        reference: ReferenceLength::Free,
        ..drive(100.0, feed, sense)
    };
    let machine = Machine {
        reference_mm: 0.05,
        ..shrunk()
    };
    let drives = [free(50.0, CounterClockwise), free(20.0, Clockwise)];
    let plane = breakdown(&machine.measure_all(&drives));
    assert!(plane.row(&RowKey::RadialExpansion).is_none());
    let length = row(&plane, &RowKey::ReferenceLength { reference: 0 });
    assert_eq!(length.aliases[0].key, RowKey::RadialExpansion);
    assert!((length.aliases[0].coefficient - 100.0).abs() < 1e-9);
    assert!(
        length.aliases[0]
            .needed
            .contains(&vec![Needed::CalibratedReference])
    );
    close(length, 0.052, 1e-4, &plane);
    close(row(&plane, &RowKey::RadiusContraction), 4e-4, 8e-6, &plane);
    assert!(
        plane
            .cross_checks
            .iter()
            .all(|c| c.mean_radial_deviation_mm.is_none())
    );
}

#[test]
fn a_calibrated_reference_gives_its_uncertainty_to_the_expansion_and_to_nothing_else() {
    let with = |u: f64| {
        let reference = ReferenceLength::Calibrated {
            standard_uncertainty_mm: u,
        };
        let drives: Vec<_> = full_set()
            .into_iter()
            .map(|d| Drive { reference, ..d })
            .collect();
        breakdown(&faultless().measure_all(&drives))
    };
    let (exact, stated) = (with(0.0), with(0.0001));
    let u = |plane: &PlaneBreakdown, key: RowKey| row(plane, &key).standard_uncertainty;
    assert!(
        u(&stated, RowKey::RadialExpansion) > 5e-7 && u(&exact, RowKey::RadialExpansion) < 5e-8
    );
    for key in [
        RowKey::Squareness,
        RowKey::ScalingMismatch,
        RowKey::ServoMismatch,
    ] {
        assert!((u(&stated, key) / u(&exact, key) - 1.0).abs() < 0.05);
    }
}

#[test]
fn bow_and_pitch_error_are_split_by_two_radii_about_one_zero() {
    let mut machine = faultless();
    machine.axes[0].bow_per_mm = 2e-6;
    machine.axes[1].stretch_per_mm = -1e-6;
    let both = |zero: fn(f64) -> u32| {
        let of = |radius: f64| Drive {
            zero_id: zero(radius),
            ..drive(radius, 20.0, CounterClockwise)
        };
        breakdown(&machine.measure_all(&[of(100.0), of(50.0)]))
    };
    let one_zero = both(|_| 7);
    close(
        row(&one_zero, &RowKey::Straightness { axis: X }),
        2e-6,
        6e-8,
        &one_zero,
    );
    close(
        row(&one_zero, &RowKey::QuadraticPitch { axis: Y }),
        -1e-6,
        6e-8,
        &one_zero,
    );
    let own_zeros = both(|radius| radius as u32);
    let sum = row(&own_zeros, &RowKey::Straightness { axis: X });
    close(sum, 3e-6, 6e-8, &own_zeros);
    assert_eq!(sum.aliases[0].key, RowKey::QuadraticPitch { axis: Y });
    assert!(
        sum.aliases[0]
            .needed
            .contains(&vec![Needed::OtherRadiusSameZero])
    );
}

#[test]
fn vibration_is_told_from_lobes_by_another_angular_speed_only() {
    let machine = with_axis(
        0,
        Axis {
            vibration: Some((0.002, 9.3)),
            ..Axis::default()
        },
    );
    let at = |feed: f64| [CounterClockwise, Clockwise].map(|sense| drive(100.0, feed, sense));
    let plane = breakdown(&machine.measure_all(&at(20.0)));
    let RowKey::VibrationOrLobes { hz, per_turn, .. } = plane.rows[0].key else {
        panic!("\n{}", printed(&plane))
    };
    assert!((hz - 9.3).abs() < 0.005 && (per_turn - 9.3 * std::f64::consts::TAU * 5.0).abs() < 0.2);
    let plane = breakdown(&machine.measure_all(&[at(20.0), at(30.0)].concat()));
    assert!(
        matches!(plane.rows[0].key, RowKey::Vibration { .. }),
        "\n{}",
        printed(&plane)
    );
}

#[test]
fn cyclic_error_backlash_spiked_by_vibration_and_squareness_are_all_found_together() {
    let mut machine = Machine {
        squareness_rad: -2e-5,
        ..faultless()
    };
    machine.axes[0] = Axis {
        play_mm: 0.005,
        screw: Some((0.002, 12.0, -1.0)),
        ..Axis::default()
    };
    machine.axes[1] = Axis {
        lateral_mm: -0.004,
        vibration: Some((0.001, 11.7)),
        ..Axis::default()
    };
    let plane = breakdown(&machine.measure_all(&full_set()));
    close(row(&plane, &RowKey::Squareness), -2e-5, 1e-6, &plane);
    close(
        row(
            &plane,
            &RowKey::Cyclic {
                axis: X,
                pitch_mm: 12.0,
            },
        ),
        0.002,
        1e-4,
        &plane,
    );
    close(
        row(&plane, &RowKey::LateralPlay { axis: Y }),
        -0.004,
        1e-4,
        &plane,
    );
    for end in [
        iso230::breakdown::BacklashEnd::Positive,
        iso230::breakdown::BacklashEnd::Negative,
    ] {
        close(
            row(&plane, &RowKey::Backlash { axis: X, end }),
            0.005,
            2e-4,
            &plane,
        );
    }
    let tone = plane
        .rows
        .iter()
        .find(|r| matches!(r.key, RowKey::Vibration { along: Some(Y), .. }));
    close(
        tone.unwrap_or_else(|| panic!("\n{}", printed(&plane))),
        0.001,
        1e-4,
        &plane,
    );
    assert!(plane.noise.residual_mm < 1.3e-4, "\n{}", printed(&plane));
}
