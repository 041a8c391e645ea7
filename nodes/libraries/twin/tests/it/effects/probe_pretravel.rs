//! Pretravel against the equation of a bent beam, integrated.

use machine::file::StylusEntry;
use nalgebra::Vector3;
use twin::History;

use crate::effects::past::{all_round, integrate, predict, touch, touching};
use crate::effects::scene::{bench, fit, rms};

const ID: (&str, &str) = ("probe_pretravel", "");

/// Deflection of the end of a carbide stem of 3 mm under 0.2 N: E I y'' = F (L - x).
fn bending_mm(length_mm: f64) -> f64 {
    let stiffness_n_mm2 = 600e3 * std::f64::consts::PI / 64.0 * 3.0_f64.powi(4);
    let beam = |x: f64, [_, slope]: [f64; 2]| [slope, 0.2 * (length_mm - x) / stiffness_n_mm2];
    integrate(beam, [0.0; 2], length_mm, 2000)[0]
}

#[test]
fn val_probe_pretravel_cantilever() {
    let mut machine = bench();
    let stylus = |length_mm| StylusEntry {
        radius_mm: 3.0,
        length_mm,
        stem_length_mm: None,
    };
    machine.probe.styli = [("short", 50.0), ("long", 100.0)]
        .map(|(name, length_mm)| (String::from(name), stylus(length_mm)))
        .into();
    machine.probe.mounted = String::from("short");
    let given = [
        ("lateral_um", bending_mm(50.0) * 1e3),
        ("axial_um", 0.0),
        ("length_exponent", 3.0),
    ];
    for (name, length_mm) in [("short", 50.0), ("long", 100.0)] {
        let mut run = touching(vec![touch(
            0.0,
            [0.0; 3],
            Vector3::new(0.6, -0.8, 0.0),
            2.0,
        )]);
        run.segment.stylus = String::from(name);
        let seen = predict(&machine, &History::default(), &run, ID, &given)[0];
        let off = seen / bending_mm(length_mm) - 1.0;
        println!("{name}: {seen} mm, {off:.1e} off");
        assert!(off.abs() < 1e-6, "{name}: {off}");
    }
}

/// Stems of 50 and 100 mm in holders of 140 mm: the stems bend, the holders do not.
#[test]
fn val_probe_pretravel_of_stems_in_long_holders() {
    let mut machine = bench();
    for (name, length_mm, stem_mm) in [("short", 190.0, 50.0), ("long", 240.0, 100.0)] {
        let stylus = StylusEntry {
            radius_mm: 3.0,
            length_mm,
            stem_length_mm: Some(stem_mm),
        };
        machine.probe.styli.insert(String::from(name), stylus);
    }
    machine.probe.mounted = String::from("short");
    let given = [
        ("lateral_um", bending_mm(50.0) * 1e3),
        ("axial_um", 0.0),
        ("length_exponent", 3.0),
    ];
    let mut run = touching(vec![touch(0.0, [0.0; 3], Vector3::x(), 2.0)]);
    run.segment.stylus = String::from("long");
    let seen = predict(&machine, &History::default(), &run, ID, &given)[0];
    let off = seen / bending_mm(100.0) - 1.0;
    assert!(off.abs() < 1e-6, "{seen} mm, {off}");
}

#[test]
fn a_wrong_ball_radius_is_the_same_in_every_direction() {
    let machine = bench();
    let given = [
        ("lateral_um", -2.0),
        ("axial_um", -2.0),
        ("length_exponent", 3.0),
    ];
    let directions = [
        Vector3::x(),
        -Vector3::z(),
        Vector3::new(0.48, 0.6, -0.64),
        Vector3::new(-0.36, 0.48, 0.8),
    ];
    let run = touching(directions.map(|n| touch(0.0, [0.0; 3], n, 2.0)).into());
    for seen in predict(&machine, &History::default(), &run, ID, &given) {
        assert!((seen + 0.002).abs() < 1e-15, "{seen}");
    }
}

#[test]
fn eq1_run_out_differs_on_opposite_sides() {
    let machine = bench();
    let given = [
        ("lateral_um", 0.0),
        ("axial_um", 0.0),
        ("length_exponent", 3.0),
        ("free_y_um", 1.5),
    ];
    let run = touching(vec![
        touch(0.0, [0.0; 3], Vector3::y(), 2.0),
        touch(1.0, [0.0; 3], -Vector3::y(), 2.0),
    ]);
    let seen = predict(&machine, &History::default(), &run, ID, &given);
    assert!((seen[0] - 0.0015).abs() < 1e-15 && (seen[1] + 0.0015).abs() < 1e-15);
}

/// Pretravel of a stylus in a three-point seat that opens when the moment about an edge of its triangle is that of
/// the spring: the force, times what the stem bends and is compressed along it; um.
fn seat_um(approach: &Vector3<f64>) -> f64 {
    let (spring_n, edge_mm, length_mm) = (1.44, 4.0, 50.0);
    let stiffness_n_mm2 = 600e3 * std::f64::consts::PI / 64.0 * 81.0;
    let bending_mm_per_n = f64::powi(length_mm, 3) / (3.0 * stiffness_n_mm2);
    let compression_mm_per_n = length_mm / (600e3 * std::f64::consts::PI / 4.0 * 9.0);
    // The surface pushes the ball back against the approach; Z towards the spindle.
    let push = -approach;
    let tips = |edge: u32| {
        let (sin, cos) = (0.3 + f64::from(edge) * std::f64::consts::TAU / 3.0).sin_cos();
        (push.x * cos + push.y * sin) * length_mm + push.z * edge_mm
    };
    let lever_mm = (0..3).map(tips).fold(0.0, f64::max);
    let force_n = spring_n * edge_mm / lever_mm;
    let lateral2 = push.x * push.x + push.y * push.y;
    1e3 * force_n * (lateral2 * bending_mm_per_n + push.z * push.z * compression_mm_per_n)
}

#[test]
fn val_probe_pretravel_three_point_seat() {
    let machine = bench();
    // A hemisphere: rings at 0, 20, 45 and 70 degrees above the equator, and the pole.
    let mut directions = vec![-Vector3::z()];
    for height in [0.0_f64, 20.0, 45.0, 70.0] {
        let (sin, cos) = height.to_radians().sin_cos();
        directions.extend(all_round(12).iter().map(|n| n * cos - Vector3::z() * sin));
    }
    let wanted: Vec<f64> = directions.iter().map(seat_um).collect();
    let run = touching(
        directions
            .iter()
            .map(|n| touch(0.0, [0.0; 3], *n, 2.0))
            .collect(),
    );
    let column = |id: &str, name: &str, shapes: &[(&str, f64)]| {
        let mut given = shapes.to_vec();
        given.retain(|(key, _)| *key != name);
        given.push((name, 10.0));
        predict(&machine, &History::default(), &run, (id, ""), &given)
    };
    let zero = [
        ("lateral_um", 0.0),
        ("axial_um", 0.0),
        ("length_exponent", 3.0),
    ];
    let own = |name: &str| column("probe_pretravel", name, &zero);
    let lobes = [("three_cos_um", 0.0), ("three_sin_um", 0.0)];
    let lobe = |name: &str| column("probe_lobing", name, &lobes);
    let narrow = vec![own("lateral_um"), own("axial_um")];
    let mut wide = narrow.clone();
    wide.extend(["free_slant_um", "free_z_um"].map(own));
    wide.extend(
        [
            "three_cos_um",
            "three_sin_um",
            "free_6_cos_um",
            "free_6_sin_um",
        ]
        .map(lobe),
    );
    let share = |columns: &[Vec<f64>]| fit(columns, &wanted).1 / rms(wanted.iter().copied());
    println!(
        "seat: {:.4} left, in the wider form {:.4}",
        share(&narrow),
        share(&wide)
    );
    assert!(share(&narrow) < 0.17 && share(&wide) < 0.03);
}
