//! Effects of the instruments: the clock of the grid encoder, and its plate.

use metrology::Stamp;
use metrology::stamp::{NANOS_PER_S, Span};
use trials::Sample;

use crate::judge::{heard, is_named, told, told_as_heard};
use crate::rigs::with_circles;

/// How fast the encoder's clock is, as a share.
const FAST: f64 = 5e-6;

/// The encoder stamps by a clock of its own, which was set when the session began.
#[test]
fn a_clock_that_is_fast_drifts() {
    let rig = with_circles();
    let began = Stamp::from_nanos(rig.start_s * NANOS_PER_S);
    let report = told_as_heard(&[&rig], |mut sample| {
        if let Sample::Grid(reading) = &mut sample {
            let since_s = (reading.at - began).as_secs_f64();
            reading.at += Span::from_secs_f64(FAST * since_s);
        }
        heard(sample)
    });
    let drift_ppm = is_named(&report, "clock_drift", "grid");
    assert!((drift_ppm - 1e6 * FAST).abs() < 0.1, "{drift_ppm}");
}

/// A graduation that is too long reads too little.
#[test]
fn a_plate_that_is_too_long_is_in_error() {
    let mut rig = with_circles();
    rig.plant.grid_encoder.plate_scale_um_per_m = 30.0;
    let scale_um_per_m = is_named(&told(&[&rig]), "plate_error", "");
    assert!((scale_um_per_m + 30.0).abs() < 2.0, "{scale_um_per_m}");
}
