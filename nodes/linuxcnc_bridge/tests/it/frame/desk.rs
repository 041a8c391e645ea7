//! A bridge and the LinuxCNC that a test plays, on one desk.

use linuxcnc_bridge::condition::Condition;
use linuxcnc_bridge::config::{ConnectionConfig, Prepare};
use linuxcnc_bridge::run::{Ending, Outcome};
use linuxcnc_bridge::stage::{IoCommand, IoEvent};
use linuxcnc_bridge::{BridgeStage, Input, Output, Settings};
use metrology::stamp::{Host, Span, Stamp};
use metrology::{Axis, AxisSet, PerAxis, Stage};

use crate::frame::control::{Control, State};

const SECOND: i64 = 1_000_000_000;
/// The mark of the bridge's machine file.
pub const MARK: u64 = 0x0123_4567_89ab_cdef;

pub fn at(seconds_s: f64) -> Stamp<Host> {
    Stamp::from_nanos(1000 * SECOND) + Span::from_secs_f64(seconds_s)
}

pub struct Desk {
    pub stage: BridgeStage,
    pub control: Control,
    pub now_s: f64,
    pub conditions: Vec<Condition>,
    pub endings: Vec<Ending>,
    /// Texts as they were stored.
    pub stored: Vec<String>,
    /// Lines for HAL.
    pub hal: Vec<String>,
    number: i32,
    /// The last record without its number, and the time at which it was sent, s.
    last: (String, f64),
}

impl Desk {
    pub fn new(state: State) -> Self {
        Self::with(Control::new(state), Prepare::Observe)
    }

    pub fn with(control: Control, prepare: Prepare) -> Self {
        let connection = ConnectionConfig::default();
        let settings = Settings {
            joints: Axis::LINEAR.to_vec(),
            scales: vec![],
            axes: AxisSet::XYZ,
            servo_period: Span::from_nanos(1_000_000),
            prepare,
            connect_password: connection.connect_password,
            enable_password: connection.enable_password,
            poll_period: Span::from_nanos(50_000_000),
            reply_timeout: Span::from_nanos(5 * SECOND),
            reconnect_period: Span::from_nanos(500_000_000),
            homing_timeout: Span::from_nanos(60 * SECOND),
            compensation_limit: PerAxis([0.2; 6]),
            compensation_stale_after: Span::from_nanos(SECOND),
            pulse_mm: 1e-4,
            mark: Some(MARK),
        };
        let mut desk = Self {
            stage: BridgeStage::new(&settings),
            control,
            now_s: 0.0,
            conditions: Vec::new(),
            endings: Vec::new(),
            stored: Vec::new(),
            hal: Vec::new(),
            number: 0,
            last: (String::new(), 0.0),
        };
        desk.tell(Input::Tick);
        desk.tell(Input::Io(IoEvent::Connected));
        desk.later(0.1);
        desk.sample(0.0, 0, 0, 0);
        desk
    }

    /// Tells the stage and plays the controller until neither has anything left to say.
    pub fn tell(&mut self, input: Input) {
        let mut inputs = vec![input];
        while let Some(input) = inputs.pop() {
            let mut out = Vec::new();
            let Ok(()) = self.stage.step(at(self.now_s), input, &mut out);
            for output in out {
                match output {
                    Output::Io(IoCommand::Send(line)) => {
                        let reply = format!("{}\r\n", self.control.answer(line.trim()));
                        inputs.insert(0, Input::Io(IoEvent::Received(reply.into_bytes())));
                    }
                    Output::Io(IoCommand::Store { number, text }) => {
                        self.stored.push(text);
                        let path = format!("/p/abbe_{number}.ngc");
                        inputs.insert(0, Input::Io(IoEvent::Stored { number, path }));
                    }
                    Output::Io(IoCommand::Hal(lines)) => self.hal.push(lines),
                    Output::Condition(condition) => self.conditions.push(condition),
                    Output::Finished { ending, .. } => self.endings.push(ending),
                    Output::Refused { refusal, .. } => self.endings.push(refusal.ending()),
                    _ => {}
                }
            }
        }
    }

    /// Ticks every 5 ms, as the shell does.
    pub fn later(&mut self, seconds_s: f64) {
        let end_s = self.now_s + seconds_s;
        while self.now_s < end_s {
            self.now_s += 0.005;
            self.tell(Input::Tick);
            // The servo thread goes on.
            if self.now_s - self.last.1 > 0.5 && !self.last.0.is_empty() {
                self.record();
            }
        }
    }

    pub fn sample(&mut self, z_mm: f64, probe: u8, motion_type: i32, line: u32) {
        self.last.0 = format!("0 0 {z_mm} 0 0 {z_mm} {probe} {motion_type} {line} 1");
        self.record();
    }

    fn record(&mut self) {
        self.number += 1;
        self.last.1 = self.now_s;
        let text = format!("{} {}\n", self.number, self.last.0);
        self.tell(Input::Io(IoEvent::Sampled(text.into_bytes())));
    }

    /// Hands a program over; it runs when this is back, or is refused.
    pub fn begin(&mut self, program: &str) {
        self.tell(Input::Goal {
            goal: 7,
            program: program.to_owned(),
        });
        // Every exchange is over by then.
        self.later(4.0);
    }

    /// The running program comes to its M2.
    pub fn run_out(&mut self) {
        assert!(self.control.running);
        self.control.state.feed = 120.0;
        self.control.state.m2();
        self.control.running = false;
        self.later(4.0);
    }

    pub fn ending(&self) -> (Outcome, &str) {
        let ending = self.endings.last().expect("no program has ended");
        (ending.outcome, &ending.message)
    }

    pub fn has(&self, name: &str) -> bool {
        self.conditions
            .iter()
            .any(|condition| condition.name() == name)
    }
}
