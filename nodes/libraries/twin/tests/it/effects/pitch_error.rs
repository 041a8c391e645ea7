//! Pitch error against a screw whose lead is integrated.

use metrology::{Axis, AxisSet};

use crate::effects::scene::{fit, response_of, rms, run, three_axes};

/// A screw whose lead grows from one end to the other, with a place where it was ground twice.
fn lead_deviation_um_per_mm(u_mm: f64) -> f64 {
    0.02 * u_mm / 320.0 + 0.04 * (-((u_mm - 60.0) / 50.0).powi(2)).exp()
}

#[test]
fn val_a_screw_of_drifting_lead() {
    let machine = three_axes("[w X' Y' b Z t]");
    let ticks = 6401_usize;
    let run = run(ticks, AxisSet::XYZ, |t| {
        [-320.0 + 100.0 * t, 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    let mut travelled = vec![0.0_f64; ticks];
    for k in 1..ticks {
        let middle = -320.0 + 0.1 * (k as f64 - 0.5);
        travelled[k] = travelled[k - 1] + 0.1 * lead_deviation_um_per_mm(middle);
    }
    let column = |name: &str| {
        let mut given = vec![("p2_um", 0.0), ("p3_um", 0.0)];
        given.retain(|(other, _)| *other != name);
        given.push((name, 1.0));
        let response = response_of(&machine, &run, "pitch_error", "X", &given);
        response.drive[Axis::X]
            .iter()
            .map(|x| x * 1e3)
            .collect::<Vec<_>>()
    };
    let ones = vec![1.0; ticks];
    let line = run.motion.position[Axis::X].clone();
    let mut columns = vec![ones, line, column("p2_um"), column("p3_um")];
    let (_, narrow) = fit(&columns, &travelled);
    columns.extend(["free_p4_um", "free_p5_um"].map(column));
    columns.extend((1..8).map(|k| column(&format!("free_{k}_of_8_um"))));
    let (_, wide) = fit(&columns, &travelled);
    columns.extend(
        (1..16)
            .step_by(2)
            .map(|k| column(&format!("free_{k}_of_16_um"))),
    );
    let (_, fine) = fit(&columns, &travelled);
    let (_, straight) = fit(&columns[..2], &travelled);
    println!(
        "screw {straight:.2} um: P2, P3 leave {narrow:.3}, the wider form {wide:.3}, to the sixteenth {fine:.3}"
    );
    assert!(narrow < 0.5 * straight && wide < 0.1 * straight && fine < 0.5 * wide);
    assert!(rms(travelled) > 1.0);
}

#[test]
fn eq1_a_parabola_has_two_thirds_of_its_sagitta_in_p2() {
    let machine = three_axes("[w X' Y' b Z t]");
    let run = run(6401, AxisSet::XYZ, |t| {
        [-320.0 + 100.0 * t, 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    let response = response_of(
        &machine,
        &run,
        "pitch_error",
        "X",
        &[("p2_um", 2.0), ("p3_um", 0.0)],
    );
    for (k, error) in response.drive[Axis::X].iter().enumerate() {
        let x = run.motion.position[Axis::X][k] / 320.0;
        assert!((error * 1e3 - (3.0 * x * x - 1.0)).abs() < 1e-9);
    }
}

#[test]
fn eq1_eq2_a_curve_over_a_part_of_the_travel_is_that_of_a_travel_as_long() {
    let machine = three_axes("[w X' Y' b Z t]");
    let run = run(6401, AxisSet::XYZ, |t| {
        [-320.0 + 100.0 * t, 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    let own = [("p2_um", 3.0), ("p3_um", 0.0), ("free_5_of_16_um", 2.0)];
    let drive = |given: &[(&str, f64)]| {
        response_of(&machine, &run, "pitch_error", "X", given).drive[Axis::X].clone()
    };
    let at = |x_mm: f64| {
        let places = run.motion.position[Axis::X].iter();
        places
            .clone()
            .position(|place| (place - x_mm).abs() < 1e-6)
            .unwrap()
    };
    let whole = drive(&own);
    for [from_mm, to_mm] in [[-40.0, 120.0], [0.0, 64.0], [-320.0, 320.0]] {
        let ends = [("free_from_mm", from_mm), ("free_to_mm", to_mm)];
        let part = drive(&[own.as_slice(), &ends].concat());
        for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
            let here_mm = part[at(from_mm + share * (to_mm - from_mm))];
            let there_mm = whole[at(-320.0 + 640.0 * share)];
            assert!((here_mm - there_mm).abs() < 1e-12, "{from_mm} {share}");
        }
    }
}

/// The slope of a position error is the scale's: no part of the curve has any over the travel.
#[test]
fn eq2_no_part_of_a_curve_has_a_slope() {
    let machine = three_axes("[w X' Y' b Z t]");
    let ticks = 6401_usize;
    let run = run(ticks, AxisSet::XYZ, |t| {
        [-320.0 + 100.0 * t, 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    let wide = (1..8).map(|k| format!("free_{k}_of_8_um"));
    let narrow = (1..16).step_by(2).map(|k| format!("free_{k}_of_16_um"));
    let others = ["p3_um", "free_p5_um"].map(str::to_owned);
    for name in wide.chain(narrow).chain(others) {
        let mut given = vec![("p2_um", 0.0), ("p3_um", 0.0)];
        given.retain(|(other, _)| *other != name);
        given.push((&name, 1.0));
        let response = response_of(&machine, &run, "pitch_error", "X", &given);
        let at_mm = &run.motion.position[Axis::X];
        let n = at_mm.len() as f64;
        let middle_mm = at_mm.iter().sum::<f64>() / n;
        let along = at_mm.iter().zip(&response.drive[Axis::X]);
        let along: f64 = along.map(|(x, mm)| (x - middle_mm) * 1e3 * mm).sum();
        let square: f64 = at_mm.iter().map(|x| (x - middle_mm).powi(2)).sum();
        // 1 µm over half of the travel, 320 mm, would be 3.1e-3.
        let um_per_mm = along / square;
        assert!(um_per_mm.abs() < 2e-5, "{name}: {um_per_mm}");
    }
}
