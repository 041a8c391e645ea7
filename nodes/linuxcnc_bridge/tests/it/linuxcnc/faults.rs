//! What stops a program, and what becomes of it.

use std::time::Duration;

use linuxcnc_bridge::condition::Condition;
use linuxcnc_bridge::fault::FaultKind;
use linuxcnc_bridge::live::LiveInput;
use linuxcnc_bridge::run::Outcome;
use test_namespaces::isolated;

use crate::linuxcnc::rig::Rig;

#[test]
fn each_fault_ends_the_program_with_its_own_outcome() {
    isolated(|| {
        let Some(mut rig) = Rig::new("linuxcnc_latency") else {
            return;
        };

        let missed = rig.run("G21 G90\nG0 X0 Y0 Z10\nG38.2 Z8 F300\nM2\n");
        assert_eq!(
            (missed.outcome, missed.line),
            (Outcome::ProbeMissed, 3),
            "{missed:?}"
        );
        assert!(
            missed.message.contains("without making contact"),
            "{missed:?}"
        );

        let limit = rig.run("G21 G90\nG1 X5 F600\nG1 X400 F600\nM2\n");
        assert_eq!(limit.outcome, Outcome::Limit, "{limit:?}");
        assert!(
            limit
                .message
                .contains("line 3 would exceed X's positive limit"),
            "{limit:?}"
        );

        let malformed = rig.run("G21 G90\nG1 X1O F600\nM2\n");
        assert_eq!(malformed.outcome, Outcome::Refused, "{malformed:?}");

        let empty = rig.run("  \n");
        assert_eq!(
            (empty.outcome, empty.message.as_str()),
            (Outcome::Refused, "the program is empty")
        );

        let short = rig.run("G21 G90\nM2\n");
        assert_eq!((short.outcome, short.message.as_str()), (Outcome::Done, ""));

        called_off(&mut rig);
        stuck_probe(&mut rig);
        emergency_stop(&mut rig);
    });
}

fn called_off(rig: &mut Rig) {
    let goal = rig.begin("G21 G90\nG1 X0 Y0 Z10 F3000\nG1 X100 F300\nM2\n");
    let busy = rig.run("G21\nM2\n");
    assert_eq!(busy.message, "another program is running");
    rig.turn_for(Duration::from_secs(3));
    rig.tell(LiveInput::Cancel { goal });
    let stopped = rig.finish(goal);
    assert_eq!(
        (stopped.outcome, stopped.line),
        (Outcome::Stopped, 3),
        "{stopped:?}"
    );
    assert!(rig.lines.contains(&3));
}

fn stuck_probe(rig: &mut Rig) {
    rig.halcmd(&["unlinkp", "motion.probe-input"]);
    rig.halcmd(&["setp", "motion.probe-input", "1"]);
    let stuck = rig.run("G21 G90\nG1 X1 F600\nG38.2 X3 F60\nM2\n");
    assert_eq!(stuck.outcome, Outcome::ProbeStuck, "{stuck:?}");
    rig.halcmd(&["setp", "motion.probe-input", "0"]);
    rig.halcmd(&["net", "probe-signal", "motion.probe-input"]);
}

fn emergency_stop(rig: &mut Rig) {
    rig.conditions.clear();
    let goal = rig.begin("G21 G90\nG1 X0 Y0 Z10 F3000\nG1 X100 F300\nM2\n");
    rig.turn_for(Duration::from_secs(2));
    // A person hits the button.
    rig.halcmd(&["unlinkp", "iocontrol.0.emc-enable-in"]);
    rig.halcmd(&["setp", "iocontrol.0.emc-enable-in", "0"]);
    let stopped = rig.finish(goal);
    assert_eq!(stopped.outcome, Outcome::Fault, "{stopped:?}");
    assert!(
        stopped.message.contains("emergency stop is on"),
        "{stopped:?}"
    );
    assert!(rig.conditions.contains(&Condition::Estop { on: true }));
    let refused = rig.run("G21\nM2\n");
    assert_eq!(
        (refused.outcome, refused.message.as_str()),
        (Outcome::Refused, "emergency stop is on")
    );
}

#[test]
fn a_drive_that_lags_ends_the_program_and_a_restarted_controller_is_found_again() {
    isolated(|| {
        let Some(mut rig) = Rig::new("linuxcnc_latency") else {
            return;
        };
        rig.run("G21 G90\nG1 X10 F1200\nM2\n");
        rig.halcmd(&["unlinkp", "joint.0.motor-pos-fb"]);
        let lagging = rig.run("G21 G90\nG1 X60 F1200\nM2\n");
        assert_eq!(lagging.outcome, Outcome::Fault, "{lagging:?}");
        assert!(
            lagging.message.contains("joint 0 following error"),
            "{lagging:?}"
        );
        assert!(rig.conditions.iter().any(|condition| matches!(
            condition,
            Condition::ControllerError {
                kind: FaultKind::FollowingError,
                ..
            }
        )));

        rig.end_controller();
        let refused = rig.run("G21\nM2\n");
        assert_eq!(refused.message, "not connected to the controller");
        rig.start_controller();
        let done = rig.run("G21 G90\nG1 X10 F1200\nM2\n");
        assert_eq!(done.outcome, Outcome::Done, "{done:?}");
        for pair in rig.states.windows(2) {
            assert!((pair[1].controller_at - pair[0].controller_at).nanos() > 0);
        }

        let goal = rig.begin("G21 G90\nG1 X200 F60\nM2\n");
        rig.turn_for(Duration::from_secs(2));
        rig.end_controller();
        let lost = rig.finish(goal);
        assert_eq!(lost.outcome, Outcome::Fault, "{lost:?}");
        assert!(
            lost.message
                .contains("connection to the controller was lost"),
            "{lost:?}"
        );
    });
}
