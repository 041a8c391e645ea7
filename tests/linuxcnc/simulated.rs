//! A LinuxCNC with simulated axes in the place of our simulator: a machine is diagnosed against its recording.
//!
//! Both are LinuxCNC, its planner and its servo thread, and neither is of our making; they differ in `effect.hal` alone.

use std::path::PathBuf;
use std::process::Command;

use abbe_tests::namespace::isolated;
use abbe_tests::program::abbe;
use abbe_tests::scenario::Scenario;
use serde_json::Value;

use crate::{DOMAIN, installed, root};

/// Width of the gap that the scenario's HAL file has, and the one that the simulator gets, µm.
const MACHINE_UM: f64 = 9.0;
const SIMULATOR_UM: f64 = 3.0;

/// Runs the scenario with a gap of this width; its files, which go with it, and its bag.
fn recorded(width_um: f64) -> (Scenario, PathBuf) {
    let scenario = Scenario::copy_of("linuxcnc_gap");
    let controller = scenario.path("controller");
    std::fs::create_dir(&controller).unwrap();
    let shipped = root().join("launch_configs/linuxcnc_gap/controller");
    for entry in std::fs::read_dir(shipped).unwrap() {
        let from = entry.unwrap();
        std::fs::copy(from.path(), controller.join(from.file_name())).unwrap();
    }
    let half_mm = width_um / 2e3;
    let hal =
        format!("setp slide-least.x.offset -{half_mm}\nsetp slide-greatest.x.offset {half_mm}\n");
    std::fs::write(controller.join("effect.hal"), hal).unwrap();
    let ended = Command::new(abbe())
        .args(["run", "--full"])
        .arg(scenario.folder())
        .arg("--runs")
        .arg(scenario.out())
        .env("ROS_DOMAIN_ID", DOMAIN)
        .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success(), "{width_um} um: {said}");
    let mut runs = std::fs::read_dir(scenario.out()).unwrap();
    let bag = runs.next().unwrap().unwrap().path().join("bag");
    (scenario, bag)
}

#[test]
fn val_linuxcnc_as_the_simulator_leaves_the_lost_motion_that_the_machine_has_more() {
    isolated(|| {
        if !installed() {
            return;
        }
        let home = tempfile::tempdir().unwrap();
        let (_machine, real) = recorded(MACHINE_UM);
        let (_simulator, simulator) = recorded(SIMULATOR_UM);
        let json = home.path().join("gap.json");
        let machine = root().join("launch_configs/linuxcnc_gap/machine.yaml");
        let ended = Command::new(abbe())
            .arg("diagnose")
            .arg(&real)
            .arg("--simulated")
            .arg(&simulator)
            .arg("--machine")
            .arg(&machine)
            .arg("--json")
            .arg(&json)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(0), "{said}");
        let gap: Value = serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
        let causes = gap["causes"].as_array().unwrap().iter();
        let named: Vec<&Value> = causes.filter(|cause| cause["status"] == "named").collect();
        let [play] = named[..] else {
            panic!("{:#}", gap["causes"]);
        };
        assert_eq!(
            (&play["effect"], &play["axis"]),
            (&"backlash".into(), &"X".into())
        );
        let width_um = play["parameters"][0]["value"].as_f64().unwrap();
        let more_um = MACHINE_UM - SIMULATOR_UM;
        println!("backlash X {width_um:.3} um; the machine has {more_um} um more");
        assert!((width_um - more_um).abs() < 0.2, "{width_um}");
        let closed = gap["shrink"]["gap_closed"]["low"].as_f64().unwrap();
        assert!(closed > 0.95, "{closed}");
        assert_eq!(
            gap["simulated"]["runs"]["matched"],
            gap["simulated"]["runs"]["of"]
        );
    });
}
