//! A LinuxCNC that a test plays: `linuxcncrsh`'s answers from a modal state that MDI blocks and programs change.
//!
//! What it does was seen on LinuxCNC 2.9: the line of active codes, `(debug, …)`, M2's and an abort's resets, G92 that
//! stays, M70 and M72.

use std::collections::VecDeque;

/// Groups of codes in the order of LinuxCNC's line.
const GROUPS: [&[&str]; 11] = [
    &["G80", "G0", "G1"],
    &["G17", "G18", "G19"],
    &["G40", "G41", "G42"],
    &["G21", "G20"],
    &["G90", "G91"],
    &["G94", "G93", "G95"],
    &[
        "G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3",
    ],
    &["G49", "G43"],
    &["G61", "G61.1", "G64"],
    &["G91.1", "G90.1"],
    &["G8", "G7"],
];
const SYSTEM: usize = 6;
const TOOL: usize = 7;

/// Everything that a program may find, and must leave.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Which code of each group is active.
    pub active: [usize; GROUPS.len()],
    pub mode: &'static str,
    pub feed: f64,
    pub rpm: f64,
    pub tool_mm: [f64; 6],
    /// Offsets of the nine axes and the rotation, of each work system.
    pub systems: [[f64; 10]; 9],
    pub g92_active: bool,
    pub g92: [f64; 9],
    pub path_tolerance: f64,
}

impl State {
    pub fn usual() -> Self {
        Self {
            active: [0; GROUPS.len()],
            mode: "MANUAL",
            feed: 0.0,
            rpm: 0.0,
            tool_mm: [0.0; 6],
            systems: [[0.0; 10]; 9],
            g92_active: false,
            g92: [0.0; 9],
            path_tolerance: 0.0,
        }
    }

    /// With `code` active.
    pub fn with(mut self, code: &str) -> Self {
        self.set(code);
        self
    }

    pub fn set(&mut self, code: &str) {
        for (group, codes) in GROUPS.iter().enumerate() {
            if let Some(place) = codes.iter().position(|known| *known == code) {
                self.active[group] = place;
            }
        }
    }

    pub fn has(&self, code: &str) -> bool {
        { GROUPS.iter().zip(self.active) }.any(|(codes, active)| codes[active] == code)
    }

    pub fn codes(&self) -> String {
        let codes = { GROUPS.iter().zip(self.active) }.map(|(codes, active)| codes[active]);
        codes.collect::<Vec<_>>().join(" ")
    }

    fn shift_mm(&self) -> [f64; 6] {
        let system = &self.systems[self.active[SYSTEM]];
        std::array::from_fn(|axis| {
            system[axis] + if self.g92_active { self.g92[axis] } else { 0.0 }
        })
    }

    fn parameter(&self, number: usize) -> f64 {
        match number {
            5210 => f64::from(u8::from(self.g92_active)),
            5211..=5219 => self.g92[number - 5211],
            _ => self.systems[(number - 5221) / 20][(number - 5221) % 20],
        }
    }

    /// What the end of a program resets.
    pub fn m2(&mut self) {
        for code in ["G54", "G17", "G90", "G94", "G40", "G1"] {
            self.set(code);
        }
    }

    /// What an abort resets: everything but offsets.
    fn abort(&mut self) {
        self.active = [0; GROUPS.len()];
        self.tool_mm = [0.0; 6];
        (self.feed, self.path_tolerance) = (0.0, 0.0);
    }
}

/// LinuxCNC behind its TCP interface.
pub struct Control {
    pub state: State,
    kept: Option<State>,
    shown: VecDeque<String>,
    pub position_mm: [f64; 6],
    pub running: bool,
    pub paused: bool,
    pub homed: bool,
    pub estop: bool,
    /// The state in which each program began.
    pub began_in: Vec<State>,
    /// Words that MDI does not take effect of, as if something held them.
    pub stubborn: Option<&'static str>,
    /// An offset that no number of LinuxCNC's tells, mm.
    pub hidden_mm: f64,
    /// By how much reported work offsets are still behind, mm.
    pub behind_mm: f64,
    /// Messages go to somebody else.
    pub robbed: bool,
    /// Messages come once this is over.
    pub withheld: bool,
    pub spindle: bool,
    loaded: String,
    pub told: Vec<String>,
}

impl Control {
    pub fn new(state: State) -> Self {
        Self {
            state,
            kept: None,
            shown: VecDeque::new(),
            position_mm: [10.0, -20.0, 30.0, 0.0, 0.0, 0.0],
            running: false,
            paused: false,
            homed: true,
            estop: false,
            began_in: Vec::new(),
            stubborn: None,
            hidden_mm: 0.0,
            behind_mm: 0.0,
            robbed: false,
            withheld: false,
            spindle: false,
            loaded: "NONE".to_owned(),
            told: Vec::new(),
        }
    }

    /// The answer to one line.
    pub fn answer(&mut self, line: &str) -> String {
        if let Some(what) = line.strip_prefix("set ") {
            self.told.push(line.to_owned());
            let (word, value) = what.split_once(' ').unwrap_or((what, ""));
            self.set(word, value);
            if word == "echo" {
                return line.to_owned();
            }
            return format!("SET {} ACK", word.to_uppercase());
        }
        self.get(line)
    }

    fn get(&mut self, line: &str) -> String {
        let on = |on: bool| if on { "ON" } else { "OFF" };
        let list = |values: [f64; 6]| values.map(|value| format!("{value:.6}")).join(" ");
        match line {
            "hello EMC abbe 1.0" => "HELLO ACK EMCNETSVR 1.1".to_owned(),
            "get estop" => format!("ESTOP {}", on(self.estop)),
            "get machine" => format!("MACHINE {}", on(!self.estop)),
            "get mode" => format!("MODE {}", self.state.mode),
            "get error" => "ERROR OK".to_owned(),
            "get operator_display" if self.withheld => "OPERATOR_DISPLAY OK".to_owned(),
            "get operator_display" => {
                let text = self.shown.pop_front().unwrap_or_else(|| "OK".to_owned());
                format!("OPERATOR_DISPLAY {text}")
            }
            "get program_status" => match (self.running, self.paused) {
                (true, true) => "PROGRAM_STATUS PAUSED".to_owned(),
                (true, false) => "PROGRAM_STATUS RUNNING".to_owned(),
                _ => "PROGRAM_STATUS IDLE".to_owned(),
            },
            "get program_codes" => {
                let (feed, rpm) = (self.state.feed.round(), self.state.rpm.round());
                format!(
                    "PROGRAM_CODES {} G99 G97 G92.2 F{feed} S{rpm}",
                    self.state.codes()
                )
            }
            "get abs_cmd_pos" => format!("ABS_CMD_POS {}", list(self.position_mm)),
            "get rel_cmd_pos" => {
                let shift = self.state.shift_mm();
                let relative = std::array::from_fn(|axis| {
                    self.position_mm[axis] - shift[axis] - self.hidden_mm
                });
                format!("REL_CMD_POS {}", list(relative))
            }
            "get pos_offset" => {
                let shift = self.state.shift_mm().map(|mm| mm + self.behind_mm);
                format!("POS_OFFSET {}", list(shift))
            }
            "get joint_homed" => {
                let homed = if self.homed { "YES" } else { "NO" };
                format!("JOINT_HOMED {homed} {homed} {homed} NO NO NO")
            }
            "get joint_limit" => "JOINT_LIMIT OK OK OK OK OK OK".to_owned(),
            "get program" => format!("PROGRAM {}", self.loaded),
            other => panic!("not a question of LinuxCNC's: {other}"),
        }
    }

    fn set(&mut self, word: &str, value: &str) {
        match (word, value) {
            ("mode", "manual") => self.state.mode = "MANUAL",
            ("mode", "auto") => self.state.mode = "AUTO",
            ("mode", "mdi") => self.state.mode = "MDI",
            ("mdi", block) => {
                assert_eq!(self.state.mode, "MDI", "{block}");
                assert!(!self.running, "{block}");
                self.mdi(block);
            }
            ("open", path) => self.loaded = path.to_owned(),
            ("run", _) => {
                assert_eq!(self.state.mode, "AUTO");
                self.began_in.push(self.state.clone());
                self.running = true;
            }
            ("abort", _) => {
                if self.running {
                    self.state.abort();
                    self.kept = None;
                }
                (self.running, self.paused) = (false, false);
            }
            _ => {}
        }
    }

    /// `#<_x>` and `#<_abs_x>` and their kin, in the units that are active.
    fn position(&self, name: &str) -> f64 {
        let name = name.trim_start_matches("#<_").trim_end_matches('>');
        let letter = name.trim_start_matches("abs_");
        let axis = ["x", "y", "z", "a", "b", "c"]
            .iter()
            .position(|known| *known == letter)
            .unwrap();
        let offset = self.state.shift_mm()[axis] + self.state.tool_mm[axis];
        let program = if name.starts_with("abs_") {
            0.0
        } else {
            offset
        };
        (self.position_mm[axis] - program) / if self.state.has("G20") { 25.4 } else { 1.0 }
    }

    fn mdi(&mut self, block: &str) {
        if let Some(inquiry) = block.strip_prefix("(debug,") {
            let words = inquiry
                .trim_end_matches(')')
                .split(' ')
                .map(|word| match word {
                    "#<_feed>" => format!("{:.6}", self.state.feed),
                    "#<_rpm>" => format!("{:.6}", self.state.rpm),
                    "#<_spindle_on>" => format!("{}.000000", u8::from(self.spindle)),
                    word if word.starts_with("#<_") => format!("{:.6}", self.position(word)),
                    word => match word.strip_prefix('#') {
                        Some(number) => {
                            format!("{:.6}", self.state.parameter(number.parse().unwrap()))
                        }
                        None => word.to_owned(),
                    },
                });
            let text = words.collect::<Vec<_>>().join(" ");
            assert!(
                text.len() < 255,
                "LinuxCNC's messages are cut there: {text}"
            );
            if !self.robbed {
                self.shown.push_back(text);
            }
            return;
        }
        if block == "M70" {
            self.kept = Some(self.state.clone());
            return;
        }
        if block == "M72" {
            let kept = self.kept.clone().expect("M72 without M70 is an error");
            let tool_mm = kept.tool_mm.map(|_| 0.0);
            self.state = State {
                mode: self.state.mode,
                // Its offset is that of the tool table, which is empty here.
                tool_mm,
                ..kept
            };
            return;
        }
        self.words(block);
    }

    fn words(&mut self, block: &str) {
        let is_tool = block.contains("G43");
        for word in block.split(' ') {
            let value = word[1..].parse::<f64>().unwrap_or(0.0);
            match &word[..1] {
                "G" if Some(word) == self.stubborn => {}
                "G" => {
                    let before = self.state.clone();
                    self.state.set(if word == "G43.1" { "G43" } else { word });
                    if word == "G49" {
                        self.state.tool_mm = [0.0; 6];
                    }
                    if word == "G64" {
                        self.state.path_tolerance = 0.0;
                    }
                    let inch = |state: &State| state.has("G20");
                    match (inch(&before), inch(&self.state)) {
                        (false, true) => self.state.feed /= 25.4,
                        (true, false) => self.state.feed *= 25.4,
                        _ => {}
                    }
                }
                "F" => self.state.feed = value,
                "S" => self.state.rpm = value,
                letter if is_tool => {
                    let axis = ["X", "Y", "Z", "A", "B", "C"]
                        .iter()
                        .position(|l| *l == letter);
                    assert!(self.state.has("G21"), "offsets are given in mm: {block}");
                    self.state.tool_mm[axis.unwrap()] = value;
                    self.state.active[TOOL] = 1;
                }
                other => panic!("{other} in {block}"),
            }
        }
    }
}
