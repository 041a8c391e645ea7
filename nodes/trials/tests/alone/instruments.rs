//! Effects of the instruments: the clock of the grid encoder, and its plate; a scale that closes the loop.

use fake_cnc::config::FeedbackSource;
use machine::file::{AxisEntry, MachineFile, PositionFeedback};
use metrology::stamp::{NANOS_PER_S, Span};
use metrology::{Axis, Stamp};
use trials::Sample;

use crate::judge::{heard, is_named, told, told_as_heard};
use crate::rigs::{in_both_files, repeating, with_circles};

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

/// Signal periods of 20 um that the control divides unevenly, which X follows where it goes slowly. Circles of a tenth of a
/// millimetre have stations that are shorter than a period.
#[test]
fn a_scale_that_divides_its_periods_unevenly_leads_the_slide() {
    const SLOW: &str = "grid, placement: middle, trajectory: circle, radius_mm: 0.1, feed_mm_min: 6.0, sense: both, on_the_fly: true, repeats: 3";
    const QUICK: &str = "grid, placement: middle, trajectory: circle, radius_mm: 0.2, feed_mm_min: 15.0, sense: both, on_the_fly: true, repeats: 3";
    let mut rig = repeating(&[SLOW, QUICK], 1);
    let with_scale = |file: &mut MachineFile| {
        let Some(AxisEntry::Linear(x)) = file.axes.get_mut(&Axis::X) else {
            unreachable!("X is linear")
        };
        x.scale_resolution_um = Some(0.005);
        x.position_feedback = PositionFeedback::Scale;
    };
    in_both_files(&mut rig, with_scale);
    rig.config.feedback.insert(Axis::X, FeedbackSource::Scale);
    rig.plant.linear_scales.interpolation_um = 0.4;
    let sin_um = is_named(&told(&[&rig]), "interpolation_error", "X");
    assert!((sin_um - 0.4).abs() < 0.04, "{sin_um}");
}
