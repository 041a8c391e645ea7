//! The live view as a browser sees it: its values are those of the bag and of the topics, and the bag is whole.

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

use abbe_msgs::{Wire, msg, topics};
use abbe_tests::graph::{Graph, port};
use abbe_tests::program::{Process, as_given, domain};
use abbe_tests::scenario::Scenario;
use metrology::Axis;
use metrology::sample::{PlanState, PlanStatus};
use metrology::stamp::{Host, Stamp};
use nix::sys::signal::Signal;
use recorder::Bag;
use serde_json::{Map, Value};

use crate::recorded::all;

/// Longest wait for anything, on a busy computer.
const PATIENCE: Duration = Duration::from_secs(60);
/// An address of this computer that nobody listens on.
fn free_address() -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.local_addr().unwrap()
}

/// Sends a request as soon as the server listens. HTTP/1.0 answers end with the connection.
fn request(address: SocketAddr, path: &str) -> BufReader<TcpStream> {
    let deadline = Instant::now() + PATIENCE;
    let mut stream = loop {
        match TcpStream::connect(address) {
            Ok(stream) => break stream,
            Err(error) => assert!(Instant::now() < deadline, "{address}: {error}"),
        }
        std::thread::sleep(Duration::from_millis(10));
    };
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let request = format!("GET {path} HTTP/1.0\r\nHost: localhost\r\n\r\n");
    stream.write_all(request.as_bytes()).unwrap();
    BufReader::new(stream)
}

/// Parts of the page, from events until each wanted one was sent and so many positions of X were.
fn watch(
    events: &mut BufReader<TcpStream>,
    wanted: &[&str],
    least_positions: usize,
) -> Map<String, Value> {
    let (mut parts, mut positions) = (Map::new(), BTreeSet::new());
    for line in events.by_ref().lines() {
        let line = line.unwrap();
        let Some(json) = line.strip_prefix("data: ") else {
            continue;
        };
        let event: Value = serde_json::from_str(json).unwrap();
        parts.extend(event["parts"].as_object().unwrap().clone());
        positions.extend(parts.get("axes").map(|axes| axes["axes"][0].to_string()));
        let has_all = wanted.iter().all(|&part| parts.contains_key(part));
        if has_all && positions.len() >= least_positions {
            return parts;
        }
    }
    panic!("the events ended with {parts:?}");
}

fn ms(at: Stamp<Host>) -> i64 {
    at.nanos().div_euclid(1_000_000)
}

/// The same number but for the last digit of its decimal form; nothing where there is no number, as of a rejected touch.
fn is_same(shown: &Value, recorded: f64) -> bool {
    let is_near = |shown: f64| (shown - recorded).abs() <= 1e-12 * recorded.abs();
    shown.as_f64().map_or(recorded.is_nan(), is_near)
}

/// Position, touch and temperature of the page are those that the bag has at their times.
fn compare(parts: &Map<String, Value>, bag: &Bag) {
    let (shown, at) = (&parts["axes"]["axes"][0], parts["axes"]["at_ms"].as_i64());
    let states = all(bag, &topics::AXES_STATE);
    let at_its_time = states.iter().filter(|s| Some(ms(s.received_at)) == at);
    let mut x = at_its_time.map(|state| state.commanded[Axis::X]);
    assert!(x.any(|x| is_same(&shown["commanded"], x)), "{shown}");
    let shown = &parts["touches"][0];
    let touches = all(bag, &topics::PROBE_POINT);
    let number = shown["sequence"].as_u64();
    let touch = touches
        .iter()
        .find(|t| Some(u64::from(t.sequence)) == number);
    let place = touch.unwrap().point_in_machine_mm;
    for (key, value) in [("x_mm", place.x), ("y_mm", place.y), ("z_mm", place.z)] {
        assert!(is_same(&shown[key], value), "{key}: {shown}");
    }
    let limit_um = &parts["offsets"]["axes"][0]["limit_um"];
    assert!(limit_um.is_number(), "a limit of axis_compensation");
}

#[test]
fn a_run_is_served_while_it_goes_on_and_its_bag_is_whole() {
    let scenario = Scenario::copy_of("first_run");
    let address = free_address();
    let run = scenario.start(&[&format!("--serve={address}"), "--pace", "20"]);
    let mut page = String::new();
    request(address, "/").read_to_string(&mut page).unwrap();
    assert!(page.starts_with("HTTP/1.0 200"), "{page}");
    assert!(page.contains("<h1>Live view</h1>"), "{page}");
    // A browser that reads nothing holds nothing up.
    let stalled = request(address, "/events");
    let mut events = request(address, "/events");
    let wanted = ["axes", "offsets", "temperatures", "touches", "plan"];
    let parts = watch(&mut events, &wanted, 3);
    assert_eq!(parts["plan"]["state"], "running");
    run.signal(Signal::SIGINT);
    let ended = run.ended_within(PATIENCE);
    assert_eq!(ended.status.code(), Some(130), "{}", ended.said);
    let sentence = format!("live view: http://{address}/");
    assert!(ended.said.contains(&sentence), "{}", ended.said);
    events.read_to_end(&mut Vec::new()).unwrap();
    drop(stalled);
    let folder = scenario.new_run(&[]);
    compare(&parts, &Bag::open(folder.join("bag")).unwrap());
}

#[test]
fn a_state_of_the_plan_that_a_cell_has_published_is_served_beside_it() {
    let (domain, address) = (domain(0), free_address());
    let graph = Graph::join(domain);
    let mut voice = graph.voice(&[port(&topics::PLAN_STATUS)]);
    let status = PlanStatus {
        at: Stamp::from_nanos(1_767_600_000_000_000_000),
        state: PlanState::Running,
        step: 2,
        steps: 5,
        activity: "probing block_1".to_owned(),
        run: 1,
        progress: 0.25,
        message: String::new(),
    };
    voice.say(0, &msg::PlanStatus::from_inner(&status));
    let more = ["serve", "--address", &address.to_string()];
    let serve = Process::start(as_given(domain, &more));
    let parts = watch(&mut request(address, "/events"), &["plan"], 0);
    let plan = &parts["plan"];
    assert_eq!(plan["activity"], "probing block_1");
    assert_eq!((&plan["step"], &plan["steps"]), (&2.into(), &5.into()));
    assert_eq!(plan["at_ms"], 1_767_600_000_000_i64);
    let said = serve.stop();
    let sentence = format!("live view: http://{address}/");
    assert!(said.contains(&sentence), "{said}");
    voice.stop();
    drop(graph);
}
