//! Axis states that come too seldom for what the axes do.

use gap_diagnosis::session::{Input, Reason};
use metrology::Stamp;
use metrology::sample::{GridSample, TestPlane};

use super::Rig;

#[test]
fn readings_between_coarse_states_of_a_sharp_turn_are_left_out_and_no_loss() {
    let mut rig = Rig::new(|_| 0.0);
    rig.circle(1, 0.25);
    // States of every 8 ms, as of a control with a slow interface; the speed leaps by 100 mm/s at every fifth.
    let mut x_mm = 0.0;
    for k in 0..50 {
        let t_s = 8e-3;
        x_mm += f64::from(k / 5 % 2) * 100.0 * t_s;
        rig.tick(x_mm, 50.0);
        let between = Stamp::from_nanos((rig.millis + 3) * 1_000_000);
        rig.builder.take(Input::Grid(GridSample {
            at: between,
            plane: TestPlane::Xy,
            u_mm: x_mm,
            v_mm: 50.0,
            zero_id: 1,
        }));
        rig.millis += 7;
    }
    rig.end(1);
    let (_, account) = rig.builder.finish().expect("a session");
    let uneven = account.count(Reason::TooUneven);
    assert!(uneven >= 8, "{account:?}");
    assert!(!Reason::TooUneven.is_loss() && Reason::InGap.is_loss());
    assert!(account.count(Reason::InGap) <= 2, "{account:?}");
}
