//! An angular error of a slide, measured at two heights, as whoever looks for one does.

use fake_cnc::plant::GuideFormEntry;
use machine::file::{BeamEntry, GridPlacement};
use metrology::Axis;

use crate::alone::judge::{is_named, told};
use crate::alone::rigs::{in_both_files, plan, repeating};

/// The slide pitches by a bow and an S; plate and beam are put up low and 200 mm higher.
#[test]
fn a_slide_that_pitches_reads_otherwise_at_another_height() {
    let mut rig = repeating(&[""; 0], 1);
    in_both_files(&mut rig, |file| {
        let grid = file.grid_encoder.as_mut().unwrap();
        let low: GridPlacement = grid.placements[0].clone();
        grid.placements.push(GridPlacement {
            id: "high".to_owned(),
            centre_mm: [low.centre_mm[0], low.centre_mm[1], low.centre_mm[2] + 200.0],
            ..low
        });
        let length = file.length_reference.as_mut().unwrap();
        let low: BeamEntry = length.beams[0].clone();
        let up = |[x, y, z]: [f64; 3]| [x, y, z + 160.0];
        length.beams.push(BeamEntry {
            id: "along_x_high".to_owned(),
            from_mm: up(low.from_mm),
            to_mm: up(low.to_mm),
            ..low
        });
    });
    let beam = rig.control.beam("along_x").unwrap();
    let [from_mm, to_mm] = [beam.from_mm[0] + 20.0, beam.to_mm[0] - 20.0];
    let spacing_mm = (to_mm - from_mm) / 12.0;
    let along = |beam: &str| {
        format!(
            "positioning, axis: X, from_mm: {from_mm:.1}, to_mm: {to_mm:.1}, spacing_mm: {spacing_mm:.1}, runs: 5, \
             dwell_s: 0.5, feed_mm_min: 12000.0, overrun_mm: 5.0, beam: {beam}"
        )
    };
    let circle = |placement: &str| {
        format!(
            "grid, placement: {placement}, trajectory: circle, radius_mm: 90.0, feed_mm_min: 3000.0, sense: both, \
             on_the_fly: true, repeats: 3"
        )
    };
    let steps = [
        circle("middle"),
        along("along_x"),
        circle("high"),
        along("along_x_high"),
        circle("side"),
    ];
    rig.plan = plan(&steps.each_ref().map(String::as_str));
    let slide = rig.plant.geometry.linear.get_mut(&Axis::X).unwrap();
    slide.form.push(GuideFormEntry {
        component: Axis::B,
        bow_um_urad: 30.0,
        wave_um_urad: 15.0,
        dent_um_urad: 0.0,
        dent_at_mm: 0.0,
        dent_width_mm: 10.0,
    });
    let report = told(&[&rig]);
    is_named(&report, "angular_error", "BX");
    // A bow of 30 is two thirds of that in P2.
    let sizes = &report.causes[0].parameters;
    let p2_urad = sizes.iter().find(|p| p.name == "p2_urad").unwrap().value;
    assert!((p2_urad - 20.0).abs() < 3.0, "{p2_urad}");
}
