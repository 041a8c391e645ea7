//! Scale error against the expansion of steel and the slope of a positioning test.

use std::collections::BTreeMap;

use metrology::{Axis, AxisSet};
use twin::{History, Session, Twin};

use crate::effects::scene::{bench, effect, fit, response_of, run, three_axes};

/// ISO 1: lengths are those at 20 degC. Steel of 11.5 um/(m K), 300 mm from zero, at 30 degC: 34.5 um.
#[test]
fn val_steel_off_the_reference_temperature_of_iso_1() {
    let machine = bench();
    let run = run(100, AxisSet::XYZ, |_| [300.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let session = Session {
        history: History {
            step_s: 60.0,
            temperature_degc: BTreeMap::from([(String::from("nut_x"), vec![30.0; 5])]),
            ..History::default()
        },
        runs: vec![run],
        first_bag_ends: None,
    };
    let given = [("scale_um_per_m", 0.0), ("free_expansion_um_per_m_k", 11.5)];
    let twin = Twin::new(&machine).unwrap();
    for (on, axis, wanted_mm) in [("X", Axis::X, 0.0345), ("Y", Axis::Y, 0.0)] {
        let warm = effect(&machine, "scale_error", on, &given);
        let response = twin.respond(&session, &session.runs[0], &[warm.as_ref()]);
        assert!((response.drive[axis].get(50).copied().unwrap_or(0.0) - wanted_mm).abs() < 1e-12);
    }
}

#[test]
fn eq1_the_slope_of_a_positioning_test_is_the_scale() {
    let machine = three_axes("[w X' Y' b Z t]");
    let run = run(2000, AxisSet::XYZ, |t| {
        [-200.0 + 200.0 * t, 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    let response = response_of(
        &machine,
        &run,
        "scale_error",
        "X",
        &[("scale_um_per_m", 25.0)],
    );
    let metres: Vec<_> = run.motion.position[Axis::X]
        .iter()
        .map(|u| u * 1e-3)
        .collect();
    let um: Vec<_> = response.drive[Axis::X].iter().map(|e| e * 1e3).collect();
    let (found, left) = fit(&[vec![1.0; 2000], metres], &um);
    assert!(left < 1e-9 && found[0].abs() < 1e-9 && (found[1] - 25.0).abs() < 1e-9);
}
