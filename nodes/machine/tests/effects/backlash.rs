//! Backlash against a dragged slide, and its wider form against presliding friction.

use metrology::{Axis, AxisSet};

use crate::scene::{TICK_S, fit, greatest, integrate, response_of, rms, run, three_axes};

const CHAIN: &str = "[w X' Y' b Z t]";

fn wave(t: f64) -> f64 {
    2.0 * (3.0 * t).sin() + 0.7 * (7.0 * t).sin()
}

#[test]
fn val_a_slide_dragged_through_a_gap() {
    let machine = three_axes(CHAIN);
    let (width_mm, contact_s) = (0.02, 2e-4);
    let run = run(4000, AxisSet::XYZ, |t| [wave(t), 0.0, 0.0, 0.0, 0.0, 0.0]);
    let drag = |t: f64, slide: &[f64; 1]| {
        let gap = wave(t) - slide[0];
        [(gap - gap.clamp(-0.5 * width_mm, 0.5 * width_mm)) / contact_s]
    };
    let slide = integrate([wave(0.0)], TICK_S / 20.0, 20 * 3999, 20, drag);
    let response = response_of(&machine, &run, "backlash", "X", &[("width_um", 20.0)]);
    let off = (0..run.motion.len()).map(|k| {
        let wanted = slide[k][0] - run.motion.position[Axis::X][k];
        response.drive[Axis::X][k] - wanted
    });
    let off_um = greatest(off) * 1e3;
    println!("play operator off a dragged slide by {off_um:.2} um of 20");
    // The contact of the dragged slide yields by velocity times its time constant: 11 mm/s, 0.2 ms.
    assert!(off_um < 11.0 * 0.2 * 1.05, "{off_um}");
}

#[test]
fn eq2_reversal_value_of_iso_230_2_is_the_width() {
    let machine = three_axes(CHAIN);
    let run = run(4000, AxisSet::XYZ, |t| {
        [
            if t < 2.0 { 30.0 * t } else { 120.0 - 30.0 * t },
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
        ]
    });
    let response = response_of(&machine, &run, "backlash", "X", &[("width_um", 6.0)]);
    for k in 1..20_usize {
        let (up, down) = (100 * k, 4000 - 100 * k);
        assert!(
            (run.motion.position[Axis::X][up] - run.motion.position[Axis::X][down]).abs() < 1e-9
        );
        let reversal = response.drive[Axis::X][up] - response.drive[Axis::X][down];
        assert!((reversal + 0.006).abs() < 1e-12, "{reversal}");
    }
}

#[test]
fn val_the_wider_form_takes_presliding_friction() {
    let machine = three_axes(CHAIN);
    let run = run(6000, AxisSet::XYZ, |t| {
        [3.0 * (2.0 * t).cos(), 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    // A screw that yields by 5 um to a friction which turns over 0.15 mm after a reversal.
    let wanted: Vec<f64> = (0..6000_usize)
        .map(|k| {
            let way = run.motion.since_reversal[Axis::X][k];
            let turned = 1.0 - 2.0 * (-way / 0.15).exp();
            -f64::from(run.motion.sense[Axis::X][k]) * 5.0 * turned
        })
        .collect();
    let column = |name: &str| {
        let mut given = vec![("width_um", 0.0)];
        if name == "width_um" {
            given[0].1 = 1.0;
        } else {
            given.push((name, 1.0));
        }
        let response = response_of(&machine, &run, "backlash", "X", &given);
        response.drive[Axis::X][1600..]
            .iter()
            .map(|x| x * 1e3)
            .collect::<Vec<_>>()
    };
    let names = [
        "width_um",
        "free_0p01mm_um",
        "free_0p03mm_um",
        "free_0p1mm_um",
        "free_0p3mm_um",
        "free_1mm_um",
        "free_3mm_um",
    ];
    let wide: Vec<_> = names.iter().map(|name| column(name)).collect();
    let (_, step_left) = fit(&wide[..1], &wanted[1600..]);
    let (_, wide_left) = fit(&wide, &wanted[1600..]);
    let size = rms(wanted[1600..].iter().copied());
    println!("presliding {size:.2} um: a step leaves {step_left:.2}, hats {wide_left:.2}");
    assert!(wide_left < 0.3 * step_left, "{step_left} {wide_left}");
}
