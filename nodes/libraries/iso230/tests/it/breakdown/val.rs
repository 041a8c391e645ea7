//! Published formulas and examples, and closed forms.

use iso230::breakdown::CircularSense::{self, Clockwise, CounterClockwise};
use iso230::breakdown::{CircularPlane, CircularRecording, CircularSample, PlaneBreakdown, RowKey};

use crate::breakdown::machine::{Axis, Drive, Machine, drive, faultless, full_set};
use crate::breakdown::{breakdown, printed};

/// A circle whose points are given in closed form, from the phase of the command.
fn closed(
    radius_mm: f64,
    feed_mm_s: f64,
    sense: CircularSense,
    point: impl Fn(f64) -> [f64; 2],
) -> CircularRecording {
    let omega = sense.sign() * feed_mm_s / radius_mm;
    let samples = (0..=1440).map(|i| {
        let time_s = f64::from(i) / 1440.0 * std::f64::consts::TAU / omega.abs();
        CircularSample::from_point(point(omega * time_s), radius_mm, time_s)
    });
    let samples = samples.collect();
    CircularRecording {
        samples,
        ..drive_only(radius_mm, feed_mm_s, sense)
    }
}

fn drive_only(radius_mm: f64, feed_mm_s: f64, sense: CircularSense) -> CircularRecording {
    let d = drive(radius_mm, feed_mm_s, sense);
    CircularRecording {
        plane: d.plane,
        centre_mm: d.centre_mm,
        radius_mm,
        feed_mm_s,
        sense,
        setup_id: 1,
        zero_id: d.zero_id,
        reference: d.reference,
        samples: Vec::new(),
    }
}

/// Steady answer of first-order lags to a circle: amplitude 1/√(1 + ω²T²), phase −atan(ωT).
fn lagging(
    radius_mm: f64,
    feed_mm_s: f64,
    sense: CircularSense,
    lags_s: [f64; 2],
) -> CircularRecording {
    let omega = sense.sign() * feed_mm_s / radius_mm;
    closed(radius_mm, feed_mm_s, sense, |phase| {
        let [x, y] = lags_s.map(|lag| {
            (
                radius_mm / (1.0 + (omega * lag).powi(2)).sqrt(),
                (omega * lag).atan(),
            )
        });
        [x.0 * (phase - x.1).cos(), y.0 * (phase - y.1).sin()]
    })
}

fn both_senses_two_feeds(lags_s: [f64; 2]) -> PlaneBreakdown {
    let each = [
        (50.0, CounterClockwise),
        (50.0, Clockwise),
        (20.0, CounterClockwise),
        (20.0, Clockwise),
    ];
    breakdown(&each.map(|(feed, sense)| lagging(100.0, feed, sense, lags_s)))
}

#[test]
fn val_first_order_lag_contraction_is_the_closed_form() {
    // R − R/√(1 + ω²T²) = 4.999 µm at 50 mm/s, R 100 mm, T 20 ms, beside v²T²/(2R) = 5 µm.
    let plane = both_senses_two_feeds([0.02; 2]);
    let row = &plane.rows[0];
    assert_eq!(row.key, RowKey::RadiusContraction, "\n{}", printed(&plane));
    assert!((row.value - 4e-4).abs() < 4e-7, "\n{}", printed(&plane));
    assert!(
        (row.peak_to_peak_mm - 0.005).abs() < 1e-5,
        "\n{}",
        printed(&plane)
    );
}

#[test]
fn val_unequal_lags_make_half_the_feed_times_their_difference() {
    // (v/2)(T₁ − T₂) = 5 µm outward at 45° counter-clockwise: 50 mm/s, 0.2 ms.
    let plane = both_senses_two_feeds([1.2e-3, 1e-3]);
    let row = &plane.rows[0];
    assert_eq!(row.key, RowKey::ServoMismatch, "\n{}", printed(&plane));
    assert!((row.value - 2e-4).abs() < 4e-7, "\n{}", printed(&plane));
    assert!(
        (row.peak_to_peak_mm - 0.010).abs() < 2e-5,
        "\n{}",
        printed(&plane)
    );
}

#[test]
fn val_unequal_lags_leak_into_the_scaling_mismatch_as_the_header_says() {
    // Amplitudes R (1 − ω²T²/2) differ by T̄ ΔT v²/R: at one feed that is q = −T̄ ΔT v²/R².
    let (mean, difference) = (0.01, 0.001);
    let lags = [mean + 0.5 * difference, mean - 0.5 * difference];
    let plane = breakdown(&[CounterClockwise, Clockwise].map(|s| lagging(100.0, 50.0, s, lags)));
    let found = plane.row(&RowKey::ScalingMismatch).unwrap().value;
    let expected = -mean * difference * 0.25;
    assert!(
        (found / expected - 1.0).abs() < 0.05,
        "{found} for {expected}"
    );
}

#[test]
fn val_renishaw_help_scaling_error_of_minus_25_ppm() {
    // Renishaw ball bar help, "Scaling error": −25 ppm at a radius of 150 mm shortens the travel of
    // 300 mm by 7.5 µm.
    let mut machine = faultless();
    machine.axes[0].scale = -25e-6;
    let drives = [
        (50.0, CounterClockwise),
        (50.0, Clockwise),
        (20.0, CounterClockwise),
        (20.0, Clockwise),
    ];
    let plane = breakdown(&machine.measure_all(&drives.map(|(f, s)| drive(150.0, f, s))));
    let [x, y] = plane.scales.unwrap();
    assert!(
        (x.0 * 300.0 + 0.0075).abs() < 5e-5 && (y.0 * 300.0).abs() < 5e-5,
        "{x:?} {y:?}"
    );
}

#[test]
fn val_mts_four_point_squareness_and_diameters() {
    // MTS: squareness is the difference of the diameters at 45° and 135° over the nominal diameter. With 40 µrad more
    // than 90° between X+ and Y+ the diameter at 135° is the longer one, and E_C0Y is +40 µrad.
    let mut machine = Machine {
        squareness_rad: 4e-5,
        ..faultless()
    };
    machine.axes[0] = Axis {
        scale: 2e-5,
        play_mm: 0.006,
        ..Axis::default()
    };
    let plane = breakdown(&machine.measure_all(&full_set()));
    let check = &plane.cross_checks[0];
    // Play of one sense is in it, b cos 45°/R; the mean of both senses, as MTS asks for, is free of it.
    let one_sense = check.four_point_squareness_rad.unwrap();
    assert!(
        (one_sense - 4e-5 + 0.006 * 0.5_f64.sqrt() / 100.0).abs() < 2e-6,
        "{check:?}"
    );
    let squareness = plane.four_point_squareness_rad.unwrap();
    assert!((squareness - 4e-5).abs() < 1e-6, "{squareness}");
    // Play moves both sides of a reversal by half of it, one out and one in, so the mean is free of it.
    let diameter_mm = check.diameter_deviation_mm[0].unwrap();
    assert!((diameter_mm - 2e-5 * 200.0).abs() < 3e-4, "{check:?}");
}

#[test]
fn val_squareness_of_every_plane_is_the_component_of_iso_230_1() {
    // 40 µrad more than 90° between the positive directions of the plane's axes. By the right-hand rule that is a turn of
    // Y about Z by +40 µrad, of Z about X by +40 µrad, and of Z about Y by −40 µrad.
    for (plane, component, angle_rad) in [
        (CircularPlane::Xy, "XY (EC0Y)", 4e-5),
        (CircularPlane::Yz, "YZ (EA0Z)", 4e-5),
        (CircularPlane::Zx, "ZX (EB0Z)", -4e-5),
    ] {
        let machine = Machine {
            squareness_rad: 4e-5,
            ..faultless()
        };
        let drives = full_set().into_iter().map(|d| Drive { plane, ..d });
        let found = breakdown(&machine.measure_all(&drives.collect::<Vec<_>>()));
        let row = found.row(&RowKey::Squareness).unwrap();
        assert_eq!(row.name, format!("squareness {component}"));
        assert!((row.value - angle_rad).abs() < 4e-7, "{}", printed(&found));
        assert!(row.cause.contains("more than 90°"), "{}", row.cause);
        let four = found.four_point_squareness_rad.unwrap();
        assert!((four - angle_rad).abs() < 2e-6, "{four}");
    }
}

#[test]
fn val_circularity_is_that_of_the_orthogonal_circle_fit() {
    // An oval of 8 µm about a centre that is 3 µm off, against the circle of least orthogonal distances.
    let recording = closed(100.0, 20.0, CounterClockwise, |phase| {
        let r = 100.0 + 0.004 * (2.0 * phase).cos() + 0.001 * (5.0 * phase).sin();
        [r * phase.cos() + 0.003, r * phase.sin()]
    });
    let points: Vec<_> = recording
        .samples
        .iter()
        .map(|s| {
            let r = 100.0 + s.radial_deviation_mm;
            nalgebra::Vector2::new(r * s.angle_rad.cos(), r * s.angle_rad.sin())
        })
        .collect();
    let form_mm = metrology::fit::fit_round(&points, &vec![1.0; points.len()])
        .unwrap()
        .form_mm;
    let plane = breakdown(std::slice::from_ref(&recording));
    let found_mm = plane.recordings[0].circularity_mm;
    assert!((found_mm - form_mm).abs() < 1e-6, "{found_mm} {form_mm}");
}
