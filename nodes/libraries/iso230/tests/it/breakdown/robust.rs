//! Spikes of the reader, unequal spacing, coloured residuals, arcs and bad input.

use iso230::breakdown::CircularSense::{Clockwise, CounterClockwise};
use iso230::breakdown::{
    Breakdown, BreakdownConfig, BreakdownError, CircularPlane, RowKey, evaluate,
};
use metrology::Axis::{X, Y, Z};

use crate::breakdown::machine::{Axis, Drive, Machine, drive, faultless, full_set, with_axis};
use crate::breakdown::{breakdown, printed};

#[test]
fn spikes_of_the_reader_are_left_out_counted_and_change_nothing() {
    let machine = Machine {
        squareness_rad: 3e-5,
        ..faultless()
    };
    let clean = machine.measure_all(&full_set());
    let mut spiked = clean.clone();
    for at in [100, 250, 251, 433, 700] {
        spiked[1].samples[at].radial_deviation_mm += 0.04;
    }
    let (clean, spiked) = (breakdown(&clean), breakdown(&spiked));
    assert_eq!(clean.recordings[1].n_outliers, 0);
    assert_eq!(spiked.recordings[1].n_outliers, 5, "\n{}", printed(&spiked));
    let value = |p: &iso230::breakdown::PlaneBreakdown| p.row(&RowKey::Squareness).unwrap().value;
    assert!((value(&clean) - value(&spiked)).abs() < 1e-8);
    let off = clean.recordings[1].circularity_mm - spiked.recordings[1].circularity_mm;
    assert!(off.abs() < 2e-5, "{off}");
}

#[test]
fn unequal_spacing_changes_values_within_their_uncertainty() {
    let machine = Machine {
        squareness_rad: 3e-5,
        ..with_axis(
            1,
            Axis {
                play_mm: 0.006,
                ..Axis::default()
            },
        )
    };
    let mut recordings = machine.measure_all(&full_set());
    for recording in &mut recordings {
        let mut at = 0_u32;
        // Every sample in one half of the circle, one in five in the other.
        recording.samples.retain(|s| {
            at += 1;
            s.angle_rad.sin() > 0.0 || at.is_multiple_of(5)
        });
    }
    let plane = breakdown(&recordings);
    let row = plane.row(&RowKey::Squareness).unwrap();
    assert!(
        (row.value - 3e-5).abs() < 4.0 * row.standard_uncertainty,
        "\n{}",
        printed(&plane)
    );
}

#[test]
fn residuals_that_drag_on_are_said_and_widen_the_intervals() {
    let mut recordings = faultless().measure_all(&full_set());
    for recording in &mut recordings {
        let mut state = 0.0;
        for sample in &mut recording.samples {
            state = 0.9 * state + sample.radial_deviation_mm;
            sample.radial_deviation_mm = state;
        }
    }
    let plane = breakdown(&recordings);
    assert!(plane.noise.whiteness < 0.5 && plane.noise.whiteness_score < -10.0);
    assert!(plane.noise.inflation > 4.0, "\n{}", printed(&plane));
}

#[test]
fn every_plane_names_its_own_axes() {
    for (plane, first, second) in [(CircularPlane::Yz, Y, Z), (CircularPlane::Zx, Z, X)] {
        let machine = with_axis(
            1,
            Axis {
                lateral_mm: 0.006,
                ..Axis::default()
            },
        );
        let drives: Vec<_> = full_set()
            .into_iter()
            .map(|d| Drive { plane, ..d })
            .collect();
        let found = breakdown(&machine.measure_all(&drives));
        assert_eq!(found.axes, [first, second]);
        assert_eq!(
            found.rows[0].key,
            RowKey::LateralPlay { axis: second },
            "\n{}",
            printed(&found)
        );
        assert!(found.rows[0].name.ends_with(second.letter()));
    }
}

#[test]
fn planes_are_broken_down_apart_and_written_and_read_back() {
    let of = |plane| Drive {
        plane,
        ..drive(100.0, 20.0, CounterClockwise)
    };
    let drives = [of(CircularPlane::Zx), of(CircularPlane::Xy)];
    let found = evaluate(
        &faultless().measure_all(&drives),
        &BreakdownConfig::default(),
    )
    .unwrap();
    let planes: Vec<_> = found.planes.iter().map(|p| p.plane).collect();
    assert_eq!(planes, [CircularPlane::Xy, CircularPlane::Zx]);
    assert_eq!(found.planes[0].recordings[0].recording, 1);
    let text = serde_json::to_string(&found).unwrap();
    let read: Breakdown = serde_json::from_str(&text).unwrap();
    assert_eq!(read.planes[1].rows.len(), found.planes[1].rows.len());
}

#[test]
fn an_arc_gives_combinations_and_asks_for_the_whole_circle() {
    let machine = Machine {
        squareness_rad: 3e-5,
        ..faultless()
    };
    let mut recordings = machine.measure_all(&[
        drive(100.0, 20.0, CounterClockwise),
        drive(100.0, 20.0, Clockwise),
    ]);
    for recording in &mut recordings {
        recording
            .samples
            .retain(|s| s.angle_rad > 0.1 && s.angle_rad < 1.4);
    }
    let plane = breakdown(&recordings);
    let combined = plane
        .rows
        .iter()
        .chain(&plane.setting_up)
        .filter(|r| !r.aliases.is_empty());
    assert!(combined.count() > 2, "\n{}", printed(&plane));
    for row in &plane.rows {
        assert!(row.value.is_finite() && row.standard_uncertainty.is_finite());
    }
}

#[test]
fn bad_input_is_refused_with_its_place() {
    let config = BreakdownConfig::default();
    assert_eq!(evaluate(&[], &config), Err(BreakdownError::NoRecordings));
    let mut recordings = faultless().measure_all(&[drive(100.0, 20.0, CounterClockwise)]);
    recordings[0].samples[5].angle_rad = f64::INFINITY;
    let refused = evaluate(&recordings, &config).unwrap_err();
    assert_eq!(
        refused,
        BreakdownError::SampleNotFinite {
            recording: 0,
            sample: 5
        }
    );
}
