//! The trajectories on the plant, measured by its grid encoder and its laser.

use machine::trajectory::{diagonal, planar, positioning};

use super::*;

#[test]
fn on_a_perfect_machine_the_grid_reads_where_the_axes_are_in_every_plane() {
    let mut bench = Bench::new(&perfect());
    let machine = machine();
    let pace = Pace::Stationwise {
        stations: 8,
        dwell_s: 0.4,
    };
    for (run, (placement, [u, v])) in [
        ("table", [0, 1]),
        ("upright_x", [1, 2]),
        ("upright_y", [2, 0]),
    ]
    .into_iter()
    .enumerate()
    {
        let circle = Shape::Circle {
            radius_mm: 30.0,
            from_rad: 0.0,
        };
        let circle = planar(&machine, &order(placement, circle, pace)).unwrap();
        let recorded = bench.measure(&circle);
        assert_eq!(recorded.outcome, Outcome::Done, "{}", recorded.message);
        assert!(recorded.grid.len() > 30, "{}", recorded.grid.len());
        let mut worst_mm = 0.0_f64;
        for (sample, at) in &recorded.grid {
            assert_eq!(
                (sample.plane, sample.zero_id),
                (circle.plane, run as u32 + 1)
            );
            let from_zero = at - circle.centre_mm;
            let short = (sample.u_mm - from_zero[u]).hypot(sample.v_mm - from_zero[v]);
            worst_mm = worst_mm.max(short);
        }
        // Play and presliding of the drives, at the zero and at the station.
        assert!(worst_mm < 0.012, "{placement}: {worst_mm}");
    }
}

#[test]
fn a_count_lives_until_the_head_leaves_the_plate() {
    let mut bench = Bench::new(&perfect());
    let zeroed = "G21 G90\n(mount: table)\nG0 X10 Y0\nG0 Z30\nG4 P1\n(zero: grid)\nG4 P0.2\n";
    let still = bench.run(&format!("{zeroed}G0 X60\nG4 P0.5\nM2\n"));
    assert!(still.grid.iter().all(|(sample, _)| sample.zero_id == 1));
    assert!((still.grid.last().unwrap().0.u_mm - 50.0).abs() < 0.01);
    let lost = bench.run("G21 G90\nG0 X150\nG4 P0.5\nG0 X60\nG4 P0.5\nM2\n");
    assert!(
        lost.grid.iter().all(|(_, at)| at.x < 120.0),
        "off the plate"
    );
    assert!(
        !lost
            .grid
            .iter()
            .rev()
            .take(3)
            .any(|(_, at)| (at.x - 60.0).abs() < 1e-9),
        "back on the plate without a count"
    );
    let again = bench.run("G21 G90\n(zero: grid)\nG4 P0.5\nM2\n");
    let (sample, _) = again.grid.last().unwrap();
    assert_eq!(sample.zero_id, 2);
    assert!(sample.u_mm.abs() < 1e-3);
    let lifted = bench.run("G21 G90\nG0 Z33\nG4 P0.5\nM2\n");
    assert!(lifted.grid.is_empty(), "lifted off by 3 mm");
}

#[test]
fn an_unknown_placement_is_refused_with_its_place_before_anything_moves() {
    let mut bench = Bench::new(&perfect());
    let refused = bench.run("G21 G90\n(mount: shelf)\nG0 X10\nM2\n");
    assert_eq!(refused.outcome, Outcome::Refused);
    assert!(
        refused.message.starts_with("line 2, column 1") && refused.message.contains("shelf"),
        "{}",
        refused.message
    );
    let refused = bench.run("G21 G90\n(zero: probe)\nM2\n");
    assert!(
        refused.message.contains("grid or length"),
        "{}",
        refused.message
    );
}

#[test]
fn plate_errors_are_smooth_and_of_their_size_and_a_new_mounting_moves_the_plate() {
    let mut truth = perfect();
    truth.grid_encoder.plate_error_um = 0.3;
    truth.grid_encoder.rotation_urad = 400.0;
    let mut bench = Bench::new(&truth);
    let text = "G21 G90\nG0 X0 Y0\nG0 Z30\n(mount: table)\nG4 P1\n(zero: grid)\nG1 X60 F1000\nG4 P0.5\nM2\n";
    let turns: Vec<f64> = (0..6)
        .map(|_| bench.run(text).grid.last().unwrap().0.v_mm / 60.0 * 1e6)
        .collect();
    let spread = turns
        .iter()
        .fold(0.0_f64, |most, turn| most.max(turn.abs()));
    assert!((100.0..2000.0).contains(&spread), "{turns:?}");
    assert!(
        turns.windows(2).all(|pair| (pair[0] - pair[1]).abs() > 1.0),
        "{turns:?}"
    );
}

#[test]
fn the_laser_reads_displacement_along_axis_and_diagonal() {
    let machine = machine();
    let mut bench = Bench::new(&perfect());
    let run = positioning(
        &machine,
        &AxisRun {
            runs: 1,
            ..run(Some("along_x"))
        },
    )
    .unwrap();
    let recorded = bench.measure(&run);
    assert_eq!(recorded.outcome, Outcome::Done, "{}", recorded.message);
    assert!(recorded.length.len() > 30);
    for (sample, at) in &recorded.length {
        assert_eq!((sample.axis, sample.zero_id), (Axis::X, 1));
        let from_zero_mm = at.x + 300.0;
        let short_mm = sample.displacement_mm - from_zero_mm;
        assert!(short_mm.abs() < 0.01, "{at} {short_mm}");
    }
    let run = diagonal(&machine, &corner_to_corner()).unwrap();
    let recorded = bench.measure(&run);
    let from = Vector3::new(-200.0, -150.0, 50.0);
    assert!(
        recorded
            .length
            .iter()
            .any(|(sample, _)| sample.displacement_mm > 540.0)
    );
    for (sample, at) in &recorded.length {
        let short_mm = sample.displacement_mm - (at - from).norm();
        assert!(
            sample.zero_id == 2 && short_mm.abs() < 0.02,
            "{at} {short_mm}"
        );
    }
}

#[test]
fn the_laser_errs_as_dead_path_wavelength_and_cosine_say() {
    let machine = machine();
    let last_mm = |truth: &PlantFile| {
        let mut bench = Bench::new(truth);
        let text = "G21 G90\nG0 Z100\nG0 X-300 Y20\n(mount: along_x)\nG4 P1\n(zero: length)\nG1 X300 F6000\nG4 P1\nM2\n";
        bench.run(text).length.last().unwrap().0.displacement_mm
    };
    let clean_mm = last_mm(&perfect());
    let mut truth = perfect();
    truth.length_reference.wavelength_error_ppm = 2.0;
    // A constant error stretches the path measured, not the dead path.
    assert!((last_mm(&truth) - clean_mm - 600.0 * 2e-6).abs() < 1e-5);
    let mut truth = perfect();
    truth.length_reference.wavelength_drift_ppm_per_h = 3600.0;
    truth.length_reference.dead_path_mm = 0.0;
    let without_mm = last_mm(&truth);
    truth.length_reference.dead_path_mm = 1000.0;
    // 1 ppm per second over the 7 s from zero to the end, on 1000 mm of dead path.
    let dead_mm = last_mm(&truth) - without_mm;
    assert!((0.006..0.010).contains(&dead_mm), "{dead_mm}");
    let mut truth = perfect();
    truth.length_reference.misalignment_urad = 3000.0;
    truth.length_reference.beam_radius_mm = 20.0;
    let cosine_mm = last_mm(&truth) - clean_mm;
    // 600 mm theta^2 / 2 is 2.7 um at 3 mrad.
    assert!((-0.05..-1e-5).contains(&cosine_mm), "{cosine_mm}");
    assert!(machine.beam("along_x").is_some());
}
