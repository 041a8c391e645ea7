//! Topics to and from Cyclone DDS on plain loopback, values compared.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use abbe_msgs::topics;
use abbe_tests::cyclone::{Cyclone, end, named_end};
use abbe_tests::program::{Process, domain};
use abbe_tests::python::interpreter;
use abbe_tests::scenario::Scenario;
use serde_json::{Value, json};

const DISCOVERY_LIMIT_S: f64 = 3.0;

pub fn seconds(stamp: &Value) -> f64 {
    stamp["sec"].as_f64().unwrap() + stamp["nanosec"].as_f64().unwrap() * 1e-9
}

pub fn numbers(values: &Value) -> Vec<f64> {
    let values = values.as_array().unwrap();
    values
        .iter()
        .map(|value| value.as_f64().unwrap_or(f64::NAN))
        .collect()
}

/// A moment as the wire has it.
pub fn stamp(at: Duration) -> Value {
    json!({"sec": at.as_secs(), "nanosec": at.subsec_nanos()})
}

pub fn now() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap()
}

/// A cell that tells temperatures every half second and positions at 100 Hz.
fn talkative() -> Scenario {
    let scenario = Scenario::copy_of("first_run");
    scenario.replace("machine.yaml", "period_s: 10.0", "period_s: 0.5");
    scenario.replace(
        "fake_cnc.yaml",
        "background_rate_hz: 10.0",
        "background_rate_hz: 100.0",
    );
    scenario
}

#[test]
fn cyclone_receives_custom_and_standard_topics_reliable_and_best_effort() {
    let Some(python) = interpreter("cyclone receives custom and standard topics") else {
        return;
    };
    let (scenario, domain) = (talkative(), domain(0));
    let file = scenario.argument("fake_cnc.yaml");
    let node = Process::node(domain, "fake_cnc", &["--params-file", &file]);
    let temperature = topics::TEMPERATURE.of("ambient").unwrap();
    let (states, joints) = (topics::AXES_STATE.name, topics::JOINT_STATES.name);
    // The node looks for others of its name before it shows itself: that is no discovery.
    std::thread::sleep(Duration::from_secs(2));
    let readers = [
        end(&topics::AXES_STATE),
        end(&topics::JOINT_STATES),
        named_end::<abbe_msgs::sensor_msgs::msg::Temperature>(&temperature, false, false, 10),
    ];
    let mut cyclone = Cyclone::start(&python, domain, &readers, &[]);
    for topic in [states, joints, &temperature] {
        let after_s = cyclone.matched_after_s(topic);
        eprintln!("{topic}: discovered after {after_s:.3} s");
        assert!(after_s < DISCOVERY_LIMIT_S, "{topic}: {after_s} s");
    }
    let states = cyclone.samples_within(states, Duration::from_secs(3));
    check_states(&states);
    check_joints(&cyclone.samples_within(joints, Duration::ZERO), &states);
    let warmth = cyclone.samples_within(&temperature, Duration::ZERO);
    assert!(warmth.len() >= 4, "{} temperatures", warmth.len());
    for sample in &warmth {
        let degc = sample["temperature"].as_f64().unwrap();
        assert!((15.0..30.0).contains(&degc), "{sample}");
        assert!((seconds(&sample["header"]["stamp"]) - now().as_secs_f64()).abs() < 20.0);
    }
    cyclone.stop();
    node.stop();
}

/// At rest at the start position of fake_cnc.yaml, one after the other without a gap.
fn check_states(states: &[Value]) {
    assert!(states.len() > 200, "{} states", states.len());
    for state in states {
        assert_eq!(state["axis"], json!(["X", "Y", "Z", "A", "C"]));
        let (commanded, motor) = (numbers(&state["commanded"]), numbers(&state["motor"]));
        assert_eq!(commanded, [0.0, 0.0, 0.24, 0.0, 0.0]);
        for (commanded, motor) in commanded.iter().zip(&motor) {
            assert!((commanded - motor).abs() < 2e-6, "{state}");
        }
        let has_scale: Vec<bool> = numbers(&state["scale"])
            .iter()
            .map(|v| v.is_finite())
            .collect();
        assert_eq!(has_scale, [true, true, false, false, false]);
        assert_eq!(numbers(&state["velocity"]).len(), 5);
    }
    let stamps: Vec<f64> = states
        .iter()
        .map(|state| seconds(&state["controller_stamp"]))
        .collect();
    for pair in stamps.windows(2) {
        let step_s = pair[1] - pair[0];
        assert!(
            (step_s - 0.01).abs() < 1e-6,
            "a state is missing: {step_s} s"
        );
    }
}

/// The same positions as the states of the same instant.
fn check_joints(joints: &[Value], states: &[Value]) {
    let mut compared = 0;
    for joint in joints {
        assert_eq!(joint["name"], json!(["X", "Y", "Z", "A", "C"]));
        let stamp = &joint["header"]["stamp"];
        let same = states
            .iter()
            .find(|state| state["header"]["stamp"] == *stamp);
        if let Some(state) = same {
            assert_eq!(joint["position"], state["motor"]);
            assert_eq!(joint["velocity"], state["velocity"]);
            compared += 1;
        }
    }
    eprintln!("{} joint states, {compared} compared", joints.len());
    assert!(compared > 50, "{compared} of {}", joints.len());
}

/// What Cyclone sends to the compensation: a model, latched, and then one state every 10 ms.
#[test]
fn cyclone_sends_states_and_a_latched_model_and_gets_the_compensation() {
    let Some(python) = interpreter("cyclone sends states and a model") else {
        return;
    };
    let (scenario, domain) = (Scenario::copy_of("first_run"), domain(1));
    scenario.replace("axis_compensation.yaml", "enabled: false", "enabled: true");
    // A node that is told to stop takes its time to fade.
    scenario.replace("axis_compensation.yaml", "fade_s: 30.0", "fade_s: 1.0");
    let file = scenario.argument("axis_compensation.yaml");
    let writers = [end(&topics::AXES_STATE), end(&topics::THERMAL_MODEL)];
    let readers = [end(&topics::COMPENSATION)];
    let mut cyclone = Cyclone::start(&python, domain, &readers, &writers);
    let start = now();
    cyclone.write(topics::THERMAL_MODEL.name, &model(start));
    std::thread::sleep(Duration::from_millis(500));
    let node = Process::node(domain, "axis_compensation", &["--params-file", &file]);
    for topic in [topics::AXES_STATE.name, topics::COMPENSATION.name] {
        cyclone.matched_after_s(topic);
    }
    let (first, period) = (now(), Duration::from_millis(10));
    for tick in 0..300_u32 {
        let at = first + tick * period;
        std::thread::sleep(at.saturating_sub(now()));
        let state = json!({
            "header": {"stamp": stamp(now())}, "controller_stamp": stamp(at),
            "axis": ["X", "Y", "Z"], "commanded": POSITION_M, "motor": POSITION_M,
            "scale": ["NaN", "NaN", "NaN"], "velocity": [0.0, 0.0, 0.0],
        });
        cyclone.write(topics::AXES_STATE.name, &state);
    }
    let answers = cyclone.samples_within(topics::COMPENSATION.name, Duration::from_secs(1));
    eprintln!("{} states sent, {} compensations came", 300, answers.len());
    assert!(answers.len() >= 290, "{} of 300", answers.len());
    let last = answers.last().unwrap();
    assert_eq!(last["axis"], json!(["X", "Y", "Z"]));
    let (thermal, total) = (numbers(&last["thermal"]), numbers(&last["total"]));
    for (axis, (position, (k0, slope))) in POSITION_M.iter().zip(DRIFT).enumerate() {
        let drift = k0 + slope * position;
        assert!((thermal[axis] - drift).abs() < 1e-15, "{last}");
        assert!((total[axis] - drift).abs() < 0.1e-6, "{last}");
    }
    for answer in &answers {
        for (part, whole) in numbers(&answer["remainder"])
            .iter()
            .zip(&numbers(&answer["total"]))
        {
            assert!(part.abs() <= 0.1e-6 && whole.abs() <= 150e-6, "{answer}");
        }
    }
    cyclone.stop();
    node.stop();
}

const POSITION_M: [f64; 3] = [0.1, -0.05, 0.2];
/// Offset at zero [m] and slope of each axis.
const DRIFT: [(f64, f64); 3] = [(5e-6, 2e-5), (-3e-6, 4e-5), (8e-6, -1e-5)];

fn model(at: Duration) -> Value {
    let mut covariance = [0.0; 16];
    covariance[0] = 1e-14;
    let axes: Vec<Value> = ["X", "Y", "Z"]
        .iter()
        .zip(DRIFT)
        .map(|(axis, (k0, slope))| {
            json!({
                "axis": axis, "p0_m": 0.0, "k0_m": k0, "slope": slope,
                "covariance": covariance, "span_m": [-0.25, 0.25],
                "offset_identifiable": true, "slope_identifiable": true,
            })
        })
        .collect();
    let minute = Duration::from_secs(60);
    json!({
        "header": {"stamp": stamp(at)}, "axes": axes, "valid_from": stamp(at),
        "valid_until": stamp(at + 40 * minute), "n_blocks": 2, "lack_of_fit_p": 1.0,
        "quarantined": false, "sequence": 1,
    })
}
