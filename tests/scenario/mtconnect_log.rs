//! Two days of real machines, sent as an adapter sends them: what stands in the bag is what stands in the logs.
//!
//! The numbers to be met were counted with awk over the logs themselves (`F` is the log, `gzip -dc`):
//!
//! ```text
//!   values       awk -F'|' 'toupper($3)!="UNAVAILABLE" && KEY' F | wc -l
//!   impossible   awk -F'|' '$2=="Stemp" && $3=="0"' F | wc -l              a sensor in steps of 1 K, never below 25 else
//!   states       awk -F'|' 'POSITION{if($3=="UNAVAILABLE")p=""; else if($1!=p){n++;p=$1}} END{print n}' F
//!   absences     awk -F'|' 'toupper($3)=="UNAVAILABLE"{if(!s[$2])n++; s[$2]=1; next}{s[$2]=0} END{print n}' F
//! ```

use std::f64::consts::PI;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::PathBuf;
use std::process::Command;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use abbe_msgs::topics::{self, TopicFamily};
use abbe_msgs::{Message, Wire, from_cdr};
use abbe_tests::program::root;
use metrology::sample::{AxisState, MachineValue, TemperatureSample, Verdict};
use metrology::{Axis, Stamp};
use mtconnect_bridge::io::host_now;
use node_runtime::arguments::Arguments;
use node_runtime::node::{Emission, Event as NodeEvent};
use node_runtime::{Diagnostic, Level, Node, Setup};
use recorder::{
    Bag, Channel, ChannelId, Directory, Event, MessageStamp, Order, RecorderConfig, Recording,
};
use tempfile::TempDir;

/// Sends `lines` in two connections, cut behind line `cut`, and answers pings.
fn adapter(lines: Vec<String>, cut: usize) -> (u16, JoinHandle<()>) {
    let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let port = listener.local_addr().unwrap().port();
    let thread = std::thread::spawn(move || {
        for part in [&lines[..cut], &lines[cut..]] {
            let (mut socket, _) = listener.accept().unwrap();
            send(&mut socket, part);
        }
    });
    (port, thread)
}

fn send(socket: &mut TcpStream, lines: &[String]) {
    let mut ping = [0_u8; 7];
    socket.read_exact(&mut ping).unwrap();
    assert_eq!(&ping, b"* PING\n");
    socket.write_all(b"* PONG 10000\n").unwrap();
    for some in lines.chunks(500) {
        socket.write_all(some.concat().as_bytes()).unwrap();
    }
}

fn data(file: &str) -> PathBuf {
    root().join("nodes/mtconnect_bridge/tests/data").join(file)
}

fn log(file: &str) -> Vec<String> {
    let unpacked = Command::new("gzip")
        .arg("-dc")
        .arg(data(file))
        .output()
        .unwrap();
    assert!(unpacked.status.success());
    let text = String::from_utf8(unpacked.stdout).unwrap();
    text.lines().map(|line| format!("{line}\n")).collect()
}

/// A node, its bag, and what it reported.
struct Session {
    node: Box<dyn Node>,
    recording: Recording<Directory>,
    channels: Vec<ChannelId>,
    reports: Vec<Diagnostic>,
    folder: TempDir,
}

impl Session {
    fn begin(map: &str, port: u16) -> Self {
        let folder = TempDir::new().unwrap();
        let file = folder.path().join("mtconnect_bridge.yaml");
        let map = data(map);
        let text = format!(
            "/**:\n  ros__parameters:\n    source: shdr\n    host: 127.0.0.1\n    port: {port}\n    map_file: {}\n    connection: {{reconnect_first_s: 0.05}}\n",
            map.display()
        );
        std::fs::write(&file, text).unwrap();
        let arguments = ["--ros-args", "--params-file", file.to_str().unwrap()];
        let arguments = Arguments::parse(arguments.map(str::to_owned)).unwrap();
        let setup = Setup::new("mtconnect_bridge", &arguments).unwrap();
        let node = mtconnect_bridge_node::node(&setup).unwrap();
        let shelf = Directory::create(&folder.path().join("bag")).unwrap();
        let mut recording = Recording::begin(shelf, "bag", RecorderConfig::default()).unwrap();
        let ports = node.ports().publications.iter();
        let channels = ports
            .map(|port| {
                let channel = Channel {
                    topic: format!("/{}", port.topic),
                    type_name: port.type_name.to_owned(),
                    type_hash: port.type_hash.to_owned(),
                    definition: port.definition.to_owned(),
                    qos_yaml: port.qos.offered_qos_profiles(),
                };
                recording.add_channel(&channel).unwrap()
            })
            .collect();
        Self {
            node,
            recording,
            channels,
            reports: Vec::new(),
            folder,
        }
    }

    fn tick(&mut self) {
        let (at, mut said) = (host_now(), Vec::new());
        let timer = NodeEvent::Timer { timer: 0 };
        self.node.handle(at, timer, &mut said).unwrap();
        for emission in said {
            match emission {
                Emission::Publish { publication, bytes } => {
                    let stamp = MessageStamp {
                        log_time_nanos: at.nanos(),
                        publish_time_nanos: at.nanos(),
                        sequence: 0,
                    };
                    let channel = self.channels[publication];
                    self.recording.write(channel, stamp, &bytes).unwrap();
                }
                Emission::Diagnostic(report) => self.reports.push(report),
                other => panic!("{other:?}"),
            }
        }
    }

    fn count(&self, is: impl Fn(&Diagnostic) -> bool) -> usize {
        self.reports.iter().filter(|report| is(report)).count()
    }

    /// Until the line has been lost twice and what was open is told.
    fn hear_all(mut self) -> Told {
        let begin = Instant::now();
        let lost =
            |report: &Diagnostic| report.name == "connection" && report.level == Level::Error;
        while self.count(lost) < 2 {
            assert!(
                begin.elapsed() < Duration::from_secs(300),
                "{:?}",
                self.reports.last()
            );
            self.tick();
            std::thread::sleep(Duration::from_millis(1));
        }
        self.recording.finish().unwrap();
        let bag = self.folder.path().join("bag");
        eprintln!("{}: {:.1} s", bag.display(), begin.elapsed().as_secs_f64());
        Told {
            bag: Bag::open(&bag).unwrap(),
            reports: self.reports,
            _folder: self.folder,
        }
    }
}

/// What came of a log.
struct Told {
    bag: Bag,
    reports: Vec<Diagnostic>,
    _folder: TempDir,
}

impl Told {
    fn each<M: Message + Wire>(&self, is: impl Fn(&str) -> bool) -> Vec<M::Inner> {
        let mut messages = self.bag.messages(Order::LogTime);
        let mut found = Vec::new();
        while let Some(event) = messages.next_event() {
            let Event::Message(message) = event else {
                panic!("the bag has a loss");
            };
            if is(self.bag.topic(message.topic).topic.trim_start_matches('/')) {
                let message: M = from_cdr(message.data).unwrap();
                found.push(message.into_inner().unwrap());
            }
        }
        found
    }

    fn of<M: Message + Wire>(&self, family: &TopicFamily<M>, name: &str) -> Vec<M::Inner> {
        let topic = family.of(name).unwrap();
        self.each::<M>(|told| told == topic)
    }

    fn values(&self) -> Vec<MachineValue> {
        self.each::<abbe_msgs::msg::MachineValue>(|topic| {
            topics::MACHINE.member_of(topic).is_some()
        })
    }

    fn states(&self) -> Vec<AxisState> {
        self.each::<abbe_msgs::msg::AxisState>(|topic| topic == topics::AXES_STATE.name)
    }

    fn reported(&self, name: &str, level: Level) -> usize {
        let is = |report: &&Diagnostic| report.name.starts_with(name) && report.level == level;
        self.reports.iter().filter(is).count()
    }

    /// Good temperatures and the verdicts of all: good, impossible, unconfirmed.
    fn temperatures(&self, name: &str) -> (Vec<TemperatureSample>, [usize; 3]) {
        let all = self.of(&topics::MACHINE, name);
        let with = |verdict| all.iter().filter(|value| value.verdict == verdict).count();
        let verdicts = [Verdict::Good, Verdict::Impossible, Verdict::Unconfirmed].map(with);
        (self.of(&topics::TEMPERATURE, name), verdicts)
    }
}

/// Least and greatest position of an axis among the states that have it.
fn range(states: &[AxisState], axis: Axis) -> (f64, f64) {
    let of_axis = states.iter().filter(|state| state.axes.contains(axis));
    let positions = of_axis.map(|state| state.motor[axis]);
    positions.fold(
        (f64::INFINITY, f64::NEG_INFINITY),
        |(low, high), position| (low.min(position), high.max(position)),
    )
}

fn sum(samples: &[TemperatureSample]) -> f64 {
    samples.iter().map(|sample| sample.temperature_degc).sum()
}

fn is_within(value: f64, wanted: f64, tolerance: f64) {
    assert!((value - wanted).abs() <= tolerance, "{value}: {wanted}");
}

/// The line is cut where the machine is off: what is then absent already, is not lost.
#[test]
fn val_nist_a_day_of_a_mill_turn_centre_is_in_the_bag() {
    let lines = log("mazak01_20161129.shdr.gz");
    let is_off = |line: &String| line.ends_with("|UNAVAILABLE\n");
    let off = (25_000..).find(|at| is_off(&lines[at - 1]) && !is_off(&lines[*at]));
    let (port, thread) = adapter(lines, off.unwrap());
    let told = Session::begin("mazak01_map.yaml", port).hear_all();
    thread.join().unwrap();

    let values = told.values();
    assert_eq!(values.len(), 32_962);
    let states = told.states();
    assert_eq!(states.len(), 9_360);
    // 22 values 15 times, the 23rd key is a condition.
    assert_eq!(told.reported("unavailable/", Level::Warn), 330);
    assert_eq!(told.reported("alarm/coolant_temperature", Level::Warn), 15);
    assert_eq!(told.reported("alarm/coolant_temperature", Level::Ok), 14);

    // No value is a zero that was not told: every one has its words.
    assert!(
        values
            .iter()
            .all(|value| !value.text.is_empty() && value.text != "UNAVAILABLE")
    );
    let (good, verdicts) = told.temperatures("spindle");
    assert_eq!((good.len(), verdicts), (1_478, [1_478, 558, 0]));
    is_within(sum(&good), 69_327.0, 1e-6);
    assert_eq!(
        told.reported("impossible/spindle", Level::Warn),
        558 + 1_648
    );
    let (good, verdicts) = told.temperatures("spindle_2");
    // The last zero before an absence has no neighbour behind it.
    assert_eq!((good.len(), verdicts), (5_633, [5_633, 1_648, 1]));
    is_within(sum(&good), 205_901.0, 1e-6);
    let coldest = good
        .iter()
        .map(|sample| sample.temperature_degc)
        .fold(99.0, f64::min);
    is_within(coldest, 25.0, 0.0);

    let speeds = told.of(&topics::MACHINE, "spindle_speed");
    let rpm: f64 = speeds.iter().map(|value| value.value * 30.0 / PI).sum();
    assert_eq!(speeds.len(), 223);
    is_within(rpm, 414_552.0, 1e-6);
    let (low, high) = range(&states, Axis::X);
    is_within(low, -40.001_952, 1e-9);
    is_within(high, 932.966_13, 1e-9);

    // Two clocks: the machine's day, and a minute of this host at most.
    let first: Stamp<_> = values[0].machine_at;
    let last = values.last().unwrap();
    assert!((last.machine_at - first).as_secs_f64() > 10.0 * 3600.0);
    assert!((last.received_at - values[0].received_at).as_secs_f64() < 60.0);
}

/// The line is cut while the machine moves: everything is absent once more, and nothing is told twice.
#[test]
fn val_nist_half_a_day_of_a_five_axis_machine_is_in_the_bag() {
    let lines = log("gfagie01_20160513.shdr.gz");
    let stamp = |at: usize| lines[at].split('|').next().unwrap().to_owned();
    let cut = (30_000..).find(|at| stamp(at - 1) != stamp(*at)).unwrap();
    let (port, thread) = adapter(lines, cut);
    let told = Session::begin("gfagie01_map.yaml", port).hear_all();
    thread.join().unwrap();

    assert_eq!(told.values().len(), 15_783);
    let states = told.states();
    assert_eq!(states.len(), 18_810);
    assert_eq!(told.reported("unavailable/", Level::Warn), 20 + 10);
    assert_eq!(told.reported("impossible/", Level::Warn), 0);
    assert_eq!(told.reported("machine_clock", Level::Warn), 0);
    let (low, high) = range(&states, Axis::A);
    is_within(low.to_degrees(), -121.0503, 1e-9);
    is_within(high.to_degrees(), 89.99, 1e-9);
}

#[test]
fn the_logs_are_small_enough_to_stay() {
    let folder = data("");
    let sizes = std::fs::read_dir(folder).unwrap();
    let total: u64 = sizes
        .map(|entry| entry.unwrap().metadata().unwrap().len())
        .sum();
    assert!(total < 1 << 20, "{total}");
}
