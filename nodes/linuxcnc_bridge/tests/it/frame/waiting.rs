//! A program that waits is reported at once with its line, and again when it goes on.

use linuxcnc_bridge::condition::Condition;
use linuxcnc_bridge::waiting::Wait;

use crate::frame::control::State;
use crate::frame::desk::Desk;

const PROGRAM: &str = "G21 G90\nG0 X5\nM0\nG0 X6\nT1 M6\nG1 X7 F60\nM2\n";

fn waits(desk: &Desk) -> Vec<Option<Wait>> {
    { desk.conditions.iter() }
        .filter_map(|condition| match condition {
            Condition::ProgramWaits(wait) => Some(Some(*wait)),
            Condition::ProgramGoesOn => Some(None),
            _ => None,
        })
        .collect()
}

#[test]
fn a_pause_a_tool_change_and_a_held_feed_are_told_with_their_lines() {
    let mut desk = Desk::new(State::usual());
    desk.begin(PROGRAM);
    desk.sample(1.0, 0, 1, 2);
    desk.sample(1.0, 0, 0, 0);
    desk.control.paused = true;
    desk.later(0.1);
    let stopped = Wait::Stopped {
        line: 3,
        word: "M0",
    };
    assert_eq!(waits(&desk), [Some(stopped)]);
    assert_eq!(
        stopped.to_string(),
        "the program is paused at line 3 (M0): resume it at the control"
    );
    desk.later(5.0);
    assert_eq!(waits(&desk).len(), 1, "it is said once");
    desk.control.paused = false;
    desk.later(0.1);
    assert_eq!(waits(&desk).last(), Some(&None));

    desk.sample(2.0, 0, 1, 4);
    desk.sample(2.0, 0, 0, 0);
    desk.later(1.2);
    assert_eq!(
        waits(&desk).last(),
        Some(&Some(Wait::ToolChange { line: 5 }))
    );
    desk.sample(2.0, 0, 2, 6);
    desk.later(0.1);
    assert_eq!(waits(&desk).last(), Some(&None));

    desk.later(1.2);
    assert_eq!(waits(&desk).last(), Some(&Some(Wait::FeedHeld { line: 6 })));
    desk.sample(2.1, 0, 2, 6);
    desk.control.paused = true;
    desk.later(0.1);
    assert_eq!(waits(&desk).last(), Some(&Some(Wait::Paused { line: 6 })));
    // It ends while it waits: that is over, too.
    (desk.control.paused, desk.control.running) = (false, false);
    desk.later(1.0);
    assert_eq!(waits(&desk).last(), Some(&None));
}
