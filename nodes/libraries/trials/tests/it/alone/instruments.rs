//! Effects of the instruments: the clock of the grid encoder, and its plate; a scale that closes the loop.

use fake_cnc::Plant;
use fake_cnc::config::FeedbackSource;
use machine::file::{AxisEntry, MachineFile, PositionFeedback};
use metrology::stamp::{NANOS_PER_S, Span};
use metrology::{Axis, PerAxis, Stamp};
use trials::{Rig, Sample};

use crate::alone::judge::{heard, is_named, is_named_with, told, told_as_heard};
use crate::alone::rigs::{in_both_files, plan, repeating, with_circles};

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

/// A beam put up by eye along a short axis: at the end of its way it is 2.8 mm off the middle of its receiver.
#[test]
fn a_beam_that_leans_reads_too_little() {
    let mut rig = repeating(&[""; 0], 1);
    let way_mm = {
        let beam = rig.control.beam("along_z").unwrap();
        [beam.from_mm[2], beam.to_mm[2]]
    };
    let [from_mm, to_mm] = [way_mm[0] + 10.0, way_mm[1] - 10.0];
    let spacing_mm = (to_mm - from_mm) / 12.0;
    let along = |axis: &str, from_mm: f64, to_mm: f64, spacing_mm: f64| {
        format!(
            "positioning, axis: {axis}, from_mm: {from_mm:.1}, to_mm: {to_mm:.1}, spacing_mm: {spacing_mm:.1}, runs: 5, \
             dwell_s: 0.5, feed_mm_min: 12000.0, overrun_mm: 5.0, beam: along_{}",
            axis.to_lowercase()
        )
    };
    rig.plan = plan(&[
        "grid, placement: side, trajectory: circle, radius_mm: 90.0, feed_mm_min: 3000.0, sense: both, on_the_fly: true, repeats: 3",
        "grid, placement: front, trajectory: circle, radius_mm: 90.0, feed_mm_min: 3000.0, sense: both, on_the_fly: true, repeats: 3",
        &along("Z", from_mm, to_mm, spacing_mm),
        &along("X", -150.0, 150.0, 25.0),
    ]);
    rig.plant.length_reference.misalignment_urad = MISALIGNED_URAD;
    let report = told(&[&rig]);
    let named = ("length_misalignment", "Z");
    is_named_with(&report, named.0, named.1, &[named.0]);
    let parameter = &report.causes[0].parameters[0];
    let told_mm = along_z_mm(&rig, [from_mm, to_mm]);
    rig.plant.length_reference.misalignment_urad = 0.0;
    let short_mm = along_z_mm(&rig, [from_mm, to_mm]) - told_mm;
    let truth_mm2 = 2.0 * short_mm / (to_mm - from_mm) * (way_mm[1] - way_mm[0]).powi(2);
    println!(
        "{:.2} um of {:.0} mm, {truth_mm2:.2} mm2",
        short_mm * 1e3,
        to_mm - from_mm
    );
    assert!(
        (parameter.low..parameter.high).contains(&truth_mm2),
        "{parameter:?}"
    );
}

/// What the laser reads of a way, put up once.
fn along_z_mm(rig: &Rig, [from_mm, to_mm]: [f64; 2]) -> f64 {
    let mut plant = Plant::new(&rig.control, &rig.plant).unwrap();
    let beam = rig.control.beam("along_z").unwrap();
    let mut place = PerAxis::default();
    place[Axis::X] = beam.from_mm[0];
    place[Axis::Y] = beam.from_mm[1];
    place[Axis::Z] = from_mm;
    plant.settle_at(&place);
    plant.mount("along_z");
    plant.zero_length();
    place[Axis::Z] = to_mm;
    plant.settle_at(&place);
    plant.length_reading().unwrap().displacement_mm
}

/// Standard deviation of a direction that is put up by eye.
const MISALIGNED_URAD: f64 = 8_000.0;
