//! What takes bytes from outside, one function each: it returns, whatever the bytes are.

use std::path::Path;

use fake_cnc::rs274::registers::WorkSystem;
use fake_cnc::rs274::{self, Envelope, Registers};
use linuxcnc_bridge::config::{ConnectionConfig, Prepare};
use machine::MachineFile;
use metrology::stamp::{Host, Span};
use metrology::{Axis, AxisSet, PerAxis, Stage, Stamp};
use mtconnect_bridge::config::{AgentConfig, Source};
use mtconnect_bridge::mapping::{MapFile, Mapping};
use node_runtime::live::strangers;
use recorder::{Bag, Event, Order, Reflector};

use crate::import;
use crate::messages;

/// A target's name, which is that of its corpus, and its function.
pub type Target = (&'static str, fn(&[u8]));

/// Every target.
pub const TARGETS: [Target; 15] = [
    ("cdr", cdr),
    ("definition", definition),
    ("mcap", mcap),
    ("gcode", gcode),
    ("machine_file", machine_file),
    ("csv_import", csv_import),
    ("laser_file", laser_file),
    ("linuxcnc", linuxcnc),
    ("shdr", shdr),
    ("agent", agent),
    ("mapping", mapping),
    ("rtps", rtps),
    ("token", token),
    ("attachment", attachment),
    ("call", call),
];

/// Ends a piece of what comes over a wire in several pieces.
const PIECE_END: u8 = 0x1e;
const SECOND_NANOS: i64 = 1_000_000_000;

fn instant(seconds: i64) -> Stamp<Host> {
    Stamp::from_nanos((1_767_600_000 + seconds) * SECOND_NANOS)
}

/// The bytes as a message of every type.
pub fn cdr(data: &[u8]) {
    for (_, decode) in messages::MESSAGES.iter().chain(messages::INNER) {
        decode(data);
    }
}

/// A definition, then a message of it.
pub fn definition(data: &[u8]) {
    let mut parts = data.splitn(2, |byte| *byte == PIECE_END);
    let text = String::from_utf8_lossy(parts.next().unwrap_or_default());
    let message = parts.next().unwrap_or_default();
    if let Ok(reflector) = Reflector::new("abbe_msgs/msg/Any", "ros2msg", &text) {
        let _ = reflector.decode(message);
    }
}

/// The bytes as a bag: every message in both orders, every attachment, and its JSON lines.
pub fn mcap(data: &[u8]) {
    thread_local! {
        static HOME: tempfile::TempDir = tempfile::tempdir().expect("a folder for bags");
    }
    HOME.with(|home| read_bag(&home.path().join("bag_0.mcap"), data));
}

#[expect(clippy::disallowed_methods, reason = "a bag is a file")]
fn read_bag(path: &Path, data: &[u8]) {
    std::fs::write(path, data).expect("room for a bag");
    let Ok(bag) = Bag::open(path) else {
        return;
    };
    for order in [Order::File, Order::LogTime] {
        let mut events = bag.messages(order);
        let mut bytes = 0;
        while let Some(event) = events.next_event() {
            if let Event::Message(message) = event {
                bytes += message.data.len();
            }
        }
        std::hint::black_box(bytes);
    }
    let names: Vec<String> = bag.attachment_names().map(str::to_owned).collect();
    for name in names {
        let _ = bag.attachment(&name);
    }
    let _ = recorder::RecordedRun::of(&bag);
    let _ = recorder::dump_json(&bag, &mut std::io::sink());
}

/// The text as a program for a five-axis machine, just switched on and after a job.
pub fn gcode(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    let axes = [Axis::X, Axis::Y, Axis::Z, Axis::A, Axis::C];
    let envelope = Envelope {
        axes: axes.into_iter().collect(),
        travel: PerAxis::from_fn(|_| [-2000.0, 2000.0]),
        speed: PerAxis::from_fn(|_| 300.0),
        spindle_limit_rpm: Some(12_000.0),
        tool_lengths_mm: vec![80.0],
    };
    let start = PerAxis::default();
    let _ = rs274::read(&text, &envelope, &start);
    let mut used = Registers::default();
    used.systems[0] = WorkSystem {
        origin: PerAxis::from_fn(|_| 3.0),
        rotation_deg: 30.0,
    };
    let _ = rs274::read_in(&text, &envelope, &start, &used);
}

/// The text as a machine file; one that is taken is used.
pub fn machine_file(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    if let Ok(machine) = MachineFile::parse(&text, "machine.yaml") {
        let _ = machine.mounted_stylus();
        let _ = machine.ball_radius_mm();
        let _ = machine.axis_set();
        let _ = machine::Kinematics::new(&machine);
    }
}

const MAPS: [&str; 4] = [
    include_str!("../import/ballbar.yaml"),
    include_str!("../import/positioning.yaml"),
    include_str!("../import/drift.yaml"),
    include_str!("../import/touches.yaml"),
];

/// The machine that the tables of the maps are of.
const MEASURED: &str = include_str!("../../launch_configs/first_run/machine.yaml");

/// A byte for the kind of measurement, then its table.
pub fn csv_import(data: &[u8]) {
    let Some((kind, text)) = data.split_first() else {
        return;
    };
    let map: import::map::Map = serde_saphyr::from_str(MAPS[usize::from(*kind) % MAPS.len()])
        .expect("the maps of the examples");
    let machine = MachineFile::parse(MEASURED, "machine.yaml").expect("the machine of a scenario");
    import::limits::check(&map, &machine).expect("the examples are of this machine");
    let ranges = import::limits::ranges(&map.test, &machine);
    let text = import::encoding::decode(text);
    let sheet = text.map(|read| import::sheet::Sheet::of_text(&read.text, map.separator));
    if let Ok(Ok(sheet)) = sheet
        && let Ok(sheet) = import::turned::applied(sheet, map.decimal)
        && let Ok(table) = import::table::Table::of(&sheet, &map, &ranges)
        && let Ok(runs) = import::runs::of(&map.test, &table)
    {
        let mut writer = import::writer::Writer::default();
        let _ = match &map.test {
            import::map::Test::Touches { .. } => {
                import::touch_bag::write(&runs, &table.features, &mut writer)
            }
            _ => import::motion::write(&map, &runs, &mut writer),
        };
    }
}

/// A file of a laser's program, or a list of touches as a control writes it.
pub fn laser_file(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    if import::probe_log::is_linuxcnc(&text) {
        let _ = import::probe_log::linuxcnc(&text);
    }
    if import::probe_log::is_lettered(&text) {
        let _ = import::probe_log::lettered(&text);
    }
    if import::renishaw_laser::is_one(&text) {
        let _ = import::renishaw_laser::cells(&text);
    }
}

/// What LinuxCNC's server and its sampler say, by turns, to a bridge with a program to run.
pub fn linuxcnc(data: &[u8]) {
    use linuxcnc_bridge::stage::IoEvent;
    use linuxcnc_bridge::{BridgeStage, Input, Settings};
    let connection = ConnectionConfig::default();
    let mut stage = BridgeStage::new(&Settings {
        joints: Axis::LINEAR.to_vec(),
        scales: vec![Axis::X],
        axes: AxisSet::XYZ,
        servo_period: Span::from_nanos(1_000_000),
        prepare: Prepare::PowerOnAndHome,
        connect_password: connection.connect_password,
        enable_password: connection.enable_password,
        poll_period: Span::from_nanos(50_000_000),
        reply_timeout: Span::from_nanos(5 * SECOND_NANOS),
        reconnect_period: Span::from_nanos(500_000_000),
        homing_timeout: Span::from_nanos(60 * SECOND_NANOS),
        compensation_limit: PerAxis([0.2; 6]),
        compensation_stale_after: Span::from_nanos(SECOND_NANOS),
        pulse_mm: 1e-4,
        mark: None,
    });
    let mut out = Vec::new();
    let mut tell = |at: i64, input: Input| {
        let Ok(()) = stage.step(instant(at), input, &mut out);
        out.clear();
    };
    tell(0, Input::Tick);
    tell(0, Input::Io(IoEvent::Connected));
    let program = "G21 G90\nG1 X1 F60\nM2\n".to_owned();
    tell(0, Input::Goal { goal: 1, program });
    for (place, piece) in data.split(|byte| *byte == PIECE_END).enumerate() {
        let at = i64::try_from(place).unwrap_or(0);
        let event = match piece.split_first() {
            Some((b's', rest)) => IoEvent::Sampled(rest.to_vec()),
            _ => IoEvent::Received(piece.to_vec()),
        };
        tell(at, Input::Io(event));
        tell(at, Input::Tick);
    }
    tell(1_000, Input::Shutdown);
}

const MAP: &str = "values:
  Xabs: {is: position, axis: X, unit: MILLIMETER}
  Xcom: {is: commanded_position, axis: X, unit: MILLIMETER}
  Bdeg: {is: position, axis: B, unit: DEGREE}
  Fact: {is: feed, name: feed, unit: MILLIMETER/MINUTE}
  Stemp: {is: temperature, name: spindle, unit: CELSIUS, change: {step: 1.0, rate_limit_per_s: 1.0, sample_period_s: 1.5}}
  vib: {is: load, name: vibration, unit: PERCENT, series: true}
  sc: {is: condition, name: spindle_heat}
  msg: {is: message, name: words}
  avail: {is: ignored}
";

fn bridge_settings(source: Source) -> mtconnect_bridge::Settings {
    let config = mtconnect_bridge::BridgeConfig {
        source,
        host: "mill".to_owned(),
        port: 7878,
        log_file: (source == Source::Log).then(String::new),
        log_longest_pause_s: mtconnect_bridge::BridgeConfig::default_longest_pause_s(),
        map_file: String::new(),
        connection: mtconnect_bridge::config::ConnectionConfig::default(),
        agent: AgentConfig::default(),
    };
    let map = MapFile::from_yaml(MAP).expect("the map above");
    mtconnect_bridge::Settings::new(&config, &map).expect("the settings above")
}

fn bridge(source: Source) -> mtconnect_bridge::BridgeStage {
    mtconnect_bridge::BridgeStage::new(&bridge_settings(source))
}

/// The bytes of an adapter, in pieces; and the same as a log, whose every line is replayed in the end.
pub fn shdr(data: &[u8]) {
    use mtconnect_bridge::Input;
    use mtconnect_bridge::stage::IoEvent;
    let (mut stage, mut out) = (bridge(Source::Shdr), Vec::new());
    let mut tell = |at: i64, input: Input| {
        let Ok(()) = stage.step(instant(at), input, &mut out);
        out.clear();
    };
    tell(0, Input::Tick);
    tell(0, Input::Io(IoEvent::Connected));
    for (place, piece) in data.split(|byte| *byte == PIECE_END).enumerate() {
        let at = i64::try_from(place).unwrap_or(0);
        tell(at, Input::Io(IoEvent::Received(piece.to_vec())));
        tell(at, Input::Tick);
    }
    tell(1_000, Input::Shutdown);
    shdr_log(data);
}

fn shdr_log(data: &[u8]) {
    use mtconnect_bridge::condition::Condition;
    use mtconnect_bridge::{Input, Output};
    let settings = bridge_settings(Source::Log);
    let mut stage = mtconnect_bridge::BridgeStage::of_log(&settings, data);
    let mut out = Vec::new();
    // No pause is longer than the longest, so a lifetime is enough for any log; many lines take several ticks.
    let Ok(()) = stage.step(instant(0), Input::Tick, &mut out);
    for _ in 0..=data.len() / 10_000 {
        let Ok(()) = stage.step(Stamp::from_nanos(i64::MAX), Input::Tick, &mut out);
    }
    let Ok(()) = stage.step(Stamp::from_nanos(i64::MAX), Input::Shutdown, &mut out);
    let is_left = |output: &Output| matches!(output, Output::Condition(Condition::LogLeft { .. }));
    assert!(!out.iter().any(is_left), "lines that were not replayed");
}

/// What an agent says: its answers to `probe` and `current`, then a stream in pieces.
pub fn agent(data: &[u8]) {
    use mtconnect_bridge::Input;
    use mtconnect_bridge::stage::IoEvent;
    let (mut stage, mut out) = (bridge(Source::Agent), Vec::new());
    let mut tell = |at: i64, input: Input| {
        let Ok(()) = stage.step(instant(at), input, &mut out);
        out.clear();
    };
    tell(0, Input::Tick);
    for (place, piece) in data.split(|byte| *byte == PIECE_END).enumerate() {
        let at = i64::try_from(place).unwrap_or(0);
        let text = || String::from_utf8_lossy(piece).into_owned();
        let event = match place {
            0 | 1 => IoEvent::Answered {
                status: 200,
                body: piece.to_vec(),
            },
            2 => IoEvent::Began {
                content_type: text(),
            },
            _ => IoEvent::Received(piece.to_vec()),
        };
        tell(at, Input::Io(event));
        tell(at, Input::Tick);
    }
    tell(1_000, Input::Shutdown);
}

/// The text as a mapping, and as an agent's `probe` of which one is proposed.
pub fn mapping(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    if let Ok(file) = MapFile::from_yaml(&text) {
        let _ = Mapping::new(&file);
    }
    if let Ok(mtconnect_bridge::document::Answer::Devices { devices, items, .. }) =
        mtconnect_bridge::document::read(data)
    {
        let items = mtconnect_bridge::proposal::of_device(&devices, &items, None).unwrap_or(items);
        let proposed = mtconnect_bridge::proposal::propose(&items);
        let _ = mtconnect_bridge::proposal::text_of(&proposed);
    }
}

/// A datagram that somebody sends to where participants announce themselves, and what an endpoint says of its type.
pub fn rtps(data: &[u8]) {
    strangers::datagram(data);
    strangers::user_data(data);
}

/// The text as what somebody calls a topic, and as a key of Zenoh's graph.
pub fn token(data: &[u8]) {
    strangers::name(&String::from_utf8_lossy(data));
}

/// The bytes as what stands beside a sample on Zenoh.
pub fn attachment(data: &[u8]) {
    strangers::attachment(data);
}

/// The bytes as a request to a node and as the answer to one of its own.
pub fn call(data: &[u8]) {
    strangers::call(data);
}
