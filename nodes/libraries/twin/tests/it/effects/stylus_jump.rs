//! A bumped stylus against the geometry of a ring gauge.

use twin::History;

use crate::effects::past::{all_round, predict, touch, touching};
use crate::effects::scene::bench;

#[test]
fn val_stylus_jump_ring_gauge() {
    let machine = bench();
    let (ring_mm, ball_mm) = (20.0_f64, 3.0);
    let (shrunk_mm, shift) = (0.004_f64, nalgebra::Vector3::new(0.012, -0.007, 0.0));
    let given = [
        ("radius_um", 4.0),
        ("at_min", 20.0),
        ("free_x_um", 12.0),
        ("free_y_um", -7.0),
    ];
    for (at_s, happened) in [(1100.0, false), (1300.0, true)] {
        let around = all_round(36);
        let run = touching(
            around
                .iter()
                .map(|n| touch(at_s, [0.0; 3], *n, 2.0))
                .collect(),
        );
        let seen = predict(
            &machine,
            &History::default(),
            &run,
            ("stylus_jump", ""),
            &given,
        );
        let reach_mm = ring_mm - ball_mm;
        for (n, seen) in around.iter().zip(seen) {
            // |s n + shift| = R - (r - shrunk), solved for s.
            let (shrunk_mm, shift) = if happened {
                (shrunk_mm, shift)
            } else {
                (0.0, shift * 0.0)
            };
            let along = n.dot(&shift);
            let across2 = shift.norm_squared() - along * along;
            let way_mm = ((reach_mm + shrunk_mm).powi(2) - across2).sqrt() - along;
            let limit = shift.norm_squared() / reach_mm + 1e-14;
            assert!((seen - (way_mm - reach_mm)).abs() < limit, "{seen}");
        }
    }
}
