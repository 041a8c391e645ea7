//! LinuxCNC is started once, as told, and leaves nothing behind.

use std::process::Command;

use linuxcnc_bridge::BridgeError;
use linuxcnc_bridge::io::start::Controller;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use procfs::{Current, SharedMemorySegments};
use test_namespaces::isolated;

use crate::linuxcnc::rig::{Rig, scenario};

#[test]
fn a_second_start_is_refused_and_a_wrong_configuration_says_what_is_wrong() {
    isolated(|| {
        let Some(mut rig) = Rig::new("linuxcnc_latency") else {
            return;
        };
        let ini = scenario("linuxcnc_latency").join("controller/latency.ini");
        let second = Controller::start(&rig.config, &ini)
            .map(|_| ())
            .unwrap_err();
        assert!(
            matches!(second, BridgeError::StartedElsewhere { .. }),
            "{second}"
        );
        assert!(second.to_string().contains("only one can"), "{second}");

        rig.end_controller();
        let missing = scenario("linuxcnc_latency").join("controller/absent.ini");
        let absent = Controller::start(&rig.config, &missing)
            .map(|_| ())
            .unwrap_err();
        assert!(absent.to_string().contains("absent.ini"), "{absent}");

        let folder = tempfile::tempdir().unwrap();
        for name in ["latency.ini", "latency.hal", "tool.tbl"] {
            std::fs::copy(ini.with_file_name(name), folder.path().join(name)).unwrap();
        }
        std::fs::write(
            folder.path().join("latency.hal"),
            "loadrt no_such_component\n",
        )
        .unwrap();
        let broken = folder.path().join("latency.ini");
        let ended = Controller::start(&rig.config, &broken)
            .map(|_| ())
            .unwrap_err();
        println!("{ended}");
        assert!(matches!(ended, BridgeError::EndedAtStart { .. }), "{ended}");
        assert!(ended.to_string().contains("no_such_component"), "{ended}");

        // It ends before any process of LinuxCNC's is there to be seen.
        std::fs::write(&broken, "[DISPLAY]\nDISPLAY = linuxcncrsh\n").unwrap();
        let ended = Controller::start(&rig.config, &broken)
            .map(|_| ())
            .unwrap_err();
        println!("{ended}");
        assert!(matches!(ended, BridgeError::EndedAtStart { .. }), "{ended}");

        let mut nobody = rig.config.clone();
        nobody.user = "root".to_owned();
        if nix::unistd::geteuid().is_root() {
            let root = Controller::start(&nobody, &ini).map(|_| ()).unwrap_err();
            assert!(matches!(root, BridgeError::NoSuchUser { .. }), "{root}");
        }
        rig.start_controller();
    });
}

/// Scheduling policies of all threads of the processes called `name`, as `chrt` tells them.
fn policies(name: &str) -> String {
    let pids = Command::new("pidof").arg(name).output().unwrap().stdout;
    String::from_utf8(pids)
        .unwrap()
        .split_whitespace()
        .map(|pid| {
            let told = Command::new("chrt")
                .args(["--all-tasks", "--pid", pid])
                .output()
                .unwrap();
            String::from_utf8(told.stdout).unwrap()
        })
        .collect()
}

#[test]
fn the_servo_thread_cannot_be_stopped_by_other_processes_where_that_may_be_asked_for() {
    isolated(|| {
        let allowed = Command::new("chrt").args(["--fifo", "1", "true"]).status();
        if !allowed.is_ok_and(|status| status.success()) {
            eprintln!("NOT TESTED: real-time priority is forbidden here");
            return;
        }
        let Some(_rig) = Rig::new("linuxcnc_latency") else {
            return;
        };
        let policies = policies("rtapi_app");
        assert!(policies.contains("SCHED_FIFO"), "{policies}");
        assert!(!policies.contains("SCHED_OTHER"), "{policies}");
    });
}

/// Ends every process of LinuxCNC as the system's memory killer does, without a chance to clean up.
fn kill_all() {
    for name in [
        "linuxcnc",
        "rtapi_app",
        "halsampler",
        "milltask",
        "linuxcncsvr",
        "linuxcncrsh",
    ] {
        let pids = Command::new("pidof").args(["-x", name]).output().unwrap();
        for pid in String::from_utf8(pids.stdout).unwrap().split_whitespace() {
            // It may have followed another one in this moment.
            let _ = kill(Pid::from_raw(pid.parse().unwrap()), Signal::SIGKILL);
        }
    }
}

/// Sizes of the sampler's queues that are there, bytes.
fn queues() -> Vec<u64> {
    let segments = SharedMemorySegments::current().unwrap();
    let of_sampler = segments
        .0
        .iter()
        .filter(|segment| segment.key == 0x4853_4130);
    of_sampler.map(|segment| segment.size).collect()
}

#[test]
fn after_a_controller_that_was_killed_one_that_records_more_pins_is_started() {
    isolated(|| {
        let Some(mut rig) = Rig::new("linuxcnc_latency") else {
            return;
        };
        kill_all();
        rig.end_controller();
        let left = queues();
        assert_eq!(left.len(), 1, "nothing was left behind");
        let wider = scenario("linuxcnc_gap").join("controller/gap.ini");
        let started = Controller::start(&rig.config, &wider).unwrap();
        let now = queues();
        assert!(now.len() == 1 && now[0] > left[0], "{left:?} {now:?}");
        drop(started);
        assert_eq!(queues(), Vec::<u64>::new());
    });
}
