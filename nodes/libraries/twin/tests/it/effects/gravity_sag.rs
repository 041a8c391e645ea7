//! Sag against a cantilever whose curvature is integrated.

use metrology::AxisSet;

use crate::effects::scene::{response_of, run, three_axes, tip_mm};

/// Sag of the end of a cantilever of this length: curvature M(x) / EI integrated twice.
fn sag(length: f64, moment: impl Fn(f64) -> f64) -> f64 {
    let steps = 4000;
    let dx = length / f64::from(steps);
    let (mut slope, mut down) = (0.0, 0.0);
    for k in 0..steps {
        let bend = moment((f64::from(k) + 0.5) * dx);
        down += slope * dx + 0.5 * bend * dx * dx;
        slope += bend * dx;
    }
    down
}

#[test]
fn val_a_cantilever_integrated() {
    let machine = three_axes("[w b X Y Z t]");
    let run = run(541, AxisSet::XYZ, |t| {
        [0.0, -270.0 + 1000.0 * t, 0.0, 0.0, 0.0, 0.0]
    });
    let end_load = |length: f64| sag(length, |x| length - x);
    let own_weight = |length: f64| sag(length, |x| 0.5 * (length - x).powi(2));
    let cases: [(f64, &dyn Fn(f64) -> f64); 2] = [(3.0, &end_load), (4.0, &own_weight)];
    for (power, of_length) in cases {
        let given = [("sag_um", 12.0), ("power", power)];
        let response = response_of(&machine, &run, "gravity_sag", "ZY", &given);
        let whole = of_length(540.0);
        let mut most = 0.0_f64;
        for tick in [0, 60, 135, 270, 400, 540_u16] {
            let wanted = -12.0 * of_length(f64::from(tick)) / whole;
            let found = tip_mm(&response, tick.into()).z * 1e3;
            most = most.max((found - wanted).abs());
        }
        println!("power {power}: off by {most:.1e} um of 12");
        assert!(most < 1e-5 * 12.0, "{power} {most}");
    }
}

#[test]
fn only_horizontal_axes_sag() {
    let machine = three_axes("[w b X Y Z t]");
    let targets = twin::effects::kind("gravity_sag")
        .unwrap()
        .targets_on(&machine);
    let names: Vec<_> = targets.iter().map(ToString::to_string).collect();
    assert_eq!(names, ["ZX", "ZY"]);
}
