//! Feed-dependent lost motion against a drive with Stribeck friction, integrated until it is steady.

use metrology::{Axis, AxisSet};

use crate::effects::scene::{integrate, response_of, run, three_axes};

#[test]
fn val_a_drive_with_stribeck_friction() {
    let machine = three_axes("[w X' Y' b Z t]");
    let (natural, stribeck_mm_s) = (200.0_f64, 4.0);
    // Friction over mass, mm/s2: Coulomb, what breaking away adds, viscous per mm/s.
    let (coulomb, more, viscous) = (120.0, 80.0, 0.4);
    let friction =
        |v: f64| (coulomb + more * (-v.abs() / stribeck_mm_s).exp()) * v.signum() + viscous * v;
    let per_force_um = 1e3 / (natural * natural);
    let given = [
        ("width_um", 2.0 * more * per_force_um),
        ("speed_mm_s", stribeck_mm_s),
        ("free_viscous_um", 2.0 * 100.0 * viscous * per_force_um),
    ];
    let mut most = 0.0_f64;
    for feed in [0.5, 2.0, -4.0, 10.0, -50.0] {
        let drive = |t: f64, y: &[f64; 2]| {
            let pull = natural * natural * (feed * t - y[0]) + 2.0 * natural * (feed - y[1]);
            [y[1], pull - friction(y[1])]
        };
        let slide = integrate([0.0, feed], 1e-4, 3000, 3000, drive);
        let lag_um = (slide[1][0] - feed * 0.3) * 1e3;
        let run = run(100, AxisSet::XYZ, |t| [feed * t, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let response = response_of(&machine, &run, "feed_lost_motion", "X", &given);
        let wanted = lag_um + coulomb * per_force_um * f64::signum(feed);
        most = most.max((response.drive[Axis::X][50] * 1e3 - wanted).abs());
    }
    println!(
        "lost motion off by {most:.1e} um of {:.1}",
        more * per_force_um
    );
    assert!(most < 1e-4 * 2.0 * more * per_force_um, "{most}");
}
