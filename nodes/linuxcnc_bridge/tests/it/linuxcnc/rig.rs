//! Starts LinuxCNC with a scenario's configuration and drives the bridge in real time.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use linuxcnc_bridge::condition::Condition;
use linuxcnc_bridge::fault::QUEUE_FAULT;
use linuxcnc_bridge::io::account::Account;
use linuxcnc_bridge::io::start::{Controller, require_installed};
use linuxcnc_bridge::io::{Address, BridgeIo, host_now};
use linuxcnc_bridge::live::{LiveBridge, LiveInput};
use linuxcnc_bridge::run::{Ending, Outcome};
use linuxcnc_bridge::{BridgeConfig, BridgeStage, Output, Settings};
use machine::file::MachineFile;
use metrology::Stage;
use metrology::sample::{AxisState, ProbeTrigger};
use serde::Deserialize;

/// How often a program of touches is tried.
const ATTEMPTS: u32 = 3;

#[derive(Deserialize)]
struct NodeParameters {
    #[serde(rename = "ros__parameters")]
    parameters: BridgeConfig,
}

/// A bridge and the LinuxCNC that it was started for.
pub struct Rig {
    pub bridge: LiveBridge,
    pub controller: Option<Controller>,
    pub states: Vec<AxisState>,
    pub triggers: Vec<ProbeTrigger>,
    pub conditions: Vec<Condition>,
    pub endings: Vec<(u64, Ending)>,
    pub lines: Vec<u32>,
    pub at_rest: bool,
    pub machine: MachineFile,
    pub config: BridgeConfig,
    ini: PathBuf,
    next_goal: u64,
}

pub fn scenario(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../launch_configs")
        .join(name)
}

pub fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Whether LinuxCNC can be tested here; on CI it must be possible.
pub fn installed() -> bool {
    let Err(error) = require_installed() else {
        return true;
    };
    let on_ci = std::env::var("CI").is_ok_and(|value| value == "true");
    assert!(!on_ci, "{error}");
    eprintln!("NOT TESTED: {error}");
    false
}

fn start(config: &BridgeConfig, ini: &Path) -> Controller {
    Controller::start(config, ini).unwrap_or_else(|error| panic!("{error}"))
}

fn pause(time: Duration) {
    std::thread::sleep(time);
}

impl Rig {
    /// LinuxCNC running, homed, and seen by the bridge; `None` where it is not installed.
    pub fn new(scenario_name: &str) -> Option<Self> {
        Self::of_folder(&scenario(scenario_name))
    }

    /// The same with the scenario in any folder.
    pub fn of_folder(folder: &Path) -> Option<Self> {
        if !installed() {
            return None;
        }
        let file: BTreeMap<String, NodeParameters> =
            serde_saphyr::from_str(&read(&folder.join("linuxcnc_bridge.yaml"))).unwrap();
        let config = file.into_values().next().unwrap().parameters;
        let machine =
            MachineFile::parse(&read(&folder.join("machine.yaml")), "machine.yaml").unwrap();
        let settings = Settings::new(&config, &machine).unwrap();
        let ini = folder.join(config.start_ini.clone().unwrap());
        let controller = start(&config, &ini);
        let address = Address {
            host: config.connection.host.clone(),
            port: config.connection.port,
            account: Account::ordinary(&config.user).unwrap(),
        };
        let bridge = LiveBridge::new(
            BridgeStage::new(&settings),
            BridgeIo::start(address).unwrap(),
            None,
        );
        let mut rig = Self {
            bridge,
            controller: Some(controller),
            states: Vec::new(),
            triggers: Vec::new(),
            conditions: Vec::new(),
            endings: Vec::new(),
            lines: Vec::new(),
            at_rest: false,
            machine,
            config,
            ini,
            next_goal: 0,
        };
        rig.wait_ready();
        Some(rig)
    }

    pub fn wait_ready(&mut self) {
        self.until(
            "a homed machine whose positions come",
            Duration::from_secs(30),
            |rig| {
                let has = |condition: &Condition| rig.conditions.contains(condition);
                has(&Condition::Homed { homed: true })
                    && has(&Condition::Sampling)
                    && has(&Condition::Drives { on: true })
            },
        );
        self.turn_for(Duration::from_millis(300));
    }

    pub fn tell(&mut self, input: LiveInput) {
        let mut out = Vec::new();
        self.bridge.step(host_now(), input, &mut out).unwrap();
        for output in out {
            match output {
                Output::State(state) => self.states.push(state),
                Output::Trigger(trigger) => self.triggers.push(trigger),
                Output::Condition(condition) => self.conditions.push(condition),
                Output::Finished { goal, ending } => self.endings.push((goal, ending)),
                Output::Feedback { line, .. } => self.lines.push(line),
                Output::Refused { goal, refusal } => self.endings.push((goal, refusal.ending())),
                Output::AtRest => self.at_rest = true,
                Output::Accepted { .. } | Output::Joints(_) | Output::Stopped | Output::Io(_) => {}
            }
        }
    }

    pub fn turn(&mut self) {
        self.tell(LiveInput::Tick);
        pause(Duration::from_millis(5));
    }

    pub fn turn_for(&mut self, time: Duration) {
        let deadline = Instant::now() + time;
        while Instant::now() < deadline {
            self.turn();
        }
    }

    pub fn until(&mut self, what: &str, limit: Duration, done: impl Fn(&Self) -> bool) {
        let deadline = Instant::now() + limit;
        while !done(self) {
            assert!(
                Instant::now() < deadline,
                "no {what}; conditions: {:#?}",
                self.conditions
            );
            self.turn();
        }
    }

    pub fn begin(&mut self, program: &str) -> u64 {
        self.next_goal += 1;
        let goal = self.next_goal;
        self.tell(LiveInput::Goal {
            goal,
            program: program.to_owned(),
        });
        goal
    }

    pub fn finish(&mut self, goal: u64) -> Ending {
        let ended = |rig: &Self| rig.endings.iter().any(|(ended, _)| *ended == goal);
        self.until("end of the program", Duration::from_secs(180), ended);
        let (_, ending) = self
            .endings
            .iter()
            .find(|(ended, _)| *ended == goal)
            .unwrap();
        ending.clone()
    }

    pub fn run(&mut self, program: &str) -> Ending {
        let goal = self.begin(program);
        self.finish(goal)
    }

    /// Runs a program of touches to its end. Where LinuxCNC gives it up over its own queue, which is said, it is run again.
    pub fn touch(&mut self, program: &str) {
        for _ in 0..ATTEMPTS {
            self.triggers.clear();
            let ending = self.run(program);
            if !ending.message.contains(QUEUE_FAULT) {
                let ended = (ending.outcome, ending.message.as_str());
                assert_eq!(ended, (Outcome::Done, ""));
                return;
            }
            println!("{}; once more", ending.message);
        }
        panic!("LinuxCNC refused to go on after probing at every attempt");
    }

    pub fn halcmd(&self, arguments: &[&str]) -> String {
        self.controller
            .as_ref()
            .unwrap()
            .command("halcmd", arguments)
            .unwrap()
    }

    /// Ends LinuxCNC and waits until the bridge has noticed.
    pub fn end_controller(&mut self) {
        self.controller = None;
        self.until(
            "word of the lost connection",
            Duration::from_secs(10),
            |rig| {
                rig.conditions
                    .iter()
                    .any(|condition| matches!(condition, Condition::Disconnected(_)))
            },
        );
    }

    pub fn start_controller(&mut self) {
        self.conditions.clear();
        self.controller = Some(start(&self.config, &self.ini));
        self.wait_ready();
    }
}
