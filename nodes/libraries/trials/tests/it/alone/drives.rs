//! Effects of the drives: a position loop that is softer than the machine file says, guides that hold fast at slow feeds.

use machine::file::AxisEntry;
use metrology::Axis;

use crate::alone::judge::{is_named, is_named_with, told};
use crate::alone::rigs::with_circles;

/// A softer loop whose feed-forward leaves the lag in velocity what it was.
#[test]
fn a_soft_position_loop_is_a_lag_in_acceleration() {
    let mut rig = with_circles();
    let Some(AxisEntry::Linear(entry)) = rig.control.axes.get_mut(&Axis::X) else {
        unreachable!("X is linear")
    };
    let lag_s = (1.0 - entry.velocity_feedforward) / entry.position_gain_per_s;
    let soft_per_s = 35.0;
    entry.position_gain_per_s = soft_per_s;
    entry.velocity_feedforward = 1.0 - lag_s * soft_per_s;
    is_named(&told(&[&rig]), "acceleration_lag", "X");
}

/// Guides that break away at 300 N and slide at 8 N stretch the screw the more the slower the axis goes. The motor has to
/// turn that friction over at each reversal, and its spike is to be named as well.
#[test]
fn guides_that_hold_fast_are_lost_motion_that_goes_with_the_feed() {
    let mut rig = with_circles();
    let drive = rig.plant.linear_drives.get_mut(&Axis::X).unwrap();
    drive.guide_friction.breakaway_n = 300.0;
    drive.guide_friction.stribeck_velocity_mm_s = 15.0;
    is_named_with(&told(&[&rig]), "feed_lost_motion", "X", &["reversal_spike"]);
}
