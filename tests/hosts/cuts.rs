//! The models' link breaks again and again: the controller lets the compensation fade, and has it back soon after the link is.

use std::time::{Duration, Instant};

use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_msgs::msg::AxisState;
use abbe_msgs::topics;

use abbe_tests::cyclone::{Cyclone, end};
use abbe_tests::drift::{self, COMPENSATED_M, FADED_M, FRESH_S};
use abbe_tests::graph::{Graph, Voice, now, port};
use abbe_tests::hosts::network::Network;
use abbe_tests::hosts::switch::{Link, Way};
use abbe_tests::program::Process;
use abbe_tests::python::interpreter;
use serde_json::json;

pub const WAY: Way = Way {
    delay_s: 2.5e-3,
    jitter_s: 0.5e-3,
    loss: 0.0,
    reorder: 0.0,
};
/// Fastest motion of an offset, and creep by friction, in 0.1 s, m.
const FASTEST_M: f64 = 40e-6 * 0.1 + 1.5e-6;
/// Cyclone DDS says of itself that it is gone when it has not been heard for 10 s.
const CYCLONE_CUT: Duration = Duration::from_secs(16);
/// Cyclone DDS announces itself every 8 s, and so do we every 10 s.
const MEETING: Duration = Duration::from_secs(30);
const CUTS: usize = 10;
const CUT: Duration = Duration::from_millis(1500);
/// Participants forget those that they have not heard of for 50 s, five of their announcements.
const LONG_CUT: Duration = Duration::from_secs(58);
/// What is wanted after a cut.
const RECOVERY: Duration = Duration::from_secs(3);

fn seconds(time: &Time) -> f64 {
    f64::from(time.sec) + f64::from(time.nanosec) * 1e-9
}

/// What the controller adds to X.
fn added_m(state: &AxisState) -> f64 {
    state.motor[0] - state.commanded[0]
}

/// A controller on one host and what compensates it on another, with a model that says the same everywhere.
pub struct Cell<'n> {
    network: &'n Network,
    pub controller: Graph,
    pub models: Graph,
    voice: Voice,
    nodes: [Process; 2],
    began: Instant,
}

impl<'n> Cell<'n> {
    /// Starts it, and waits for all of the compensation.
    pub fn start(network: &'n Network) -> Self {
        network.links(Link::even(WAY));
        let scenario = drift::scenario();
        let file = |node: &str| {
            let file = scenario.argument(&format!("{node}.yaml"));
            ["--params-file".to_owned(), file]
        };
        let nodes = [
            network.node("controller", "fake_cnc", &file("fake_cnc")),
            network.node("models", "axis_compensation", &file("axis_compensation")),
        ];
        let controller = network.on("controller", |own| Graph::join_by(own.clone()));
        let models = network.on("models", |own| Graph::join_by(own.clone()));
        let mut voice = network.on("models", |_| models.voice(&[port(&topics::THERMAL_MODEL)]));
        let began = Instant::now();
        for (graph, node) in [(&controller, "fake_cnc"), (&models, "axis_compensation")] {
            graph.alive(node, began);
        }
        voice.say(0, &drift::model(&now()));
        compensated(&controller, began);
        Self {
            network,
            controller,
            models,
            voice,
            nodes,
            began,
        }
    }

    pub fn stop(self) {
        self.voice.stop();
        drop(self.models);
        for node in self.nodes {
            node.stop();
        }
    }
}

/// How long after `since` the controller first has all of the compensation.
fn compensated(controller: &Graph, since: Instant) -> Duration {
    controller.wait("all of the compensation is there", |graph| {
        let states = graph.since(&topics::AXES_STATE, since);
        let found = states
            .iter()
            .find(|(_, state)| added_m(state) > COMPENSATED_M);
        found.map(|(at, _)| at.duration_since(since))
    })
}

/// What one cut was like.
#[derive(Clone, Copy, Default)]
struct Cut {
    /// Least that the controller added before the link was back, m.
    left_m: f64,
    /// From the link to the first compensation at the controller, s.
    first_s: f64,
    /// To one that answers a state of after the cut, s.
    fresh_s: f64,
    /// Until the controller added all of it again, s.
    whole_s: f64,
}

fn cut(cell: &Cell<'_>, lasts: Duration) -> Cut {
    let (network, controller) = (cell.network, &cell.controller);
    let begins = Instant::now();
    network.cut("models", true);
    std::thread::sleep(lasts);
    let back = Instant::now();
    let states = controller.since(&topics::AXES_STATE, begins);
    let left_m = states.last().map_or(f64::NAN, |(_, state)| added_m(state));
    network.cut("models", false);
    let offsets = |graph: &Graph| graph.since(&topics::COMPENSATION, back);
    let first = controller.wait("compensation again", |graph| {
        offsets(graph)
            .first()
            .map(|(at, _)| at.duration_since(back))
    });
    let whole = compensated(controller, back);
    let fresh = controller.wait("a fresh compensation", |graph| {
        offsets(graph).iter().find_map(|(at, offset)| {
            let came_s = seconds(&now()) - at.elapsed().as_secs_f64();
            (came_s - seconds(&offset.header.stamp) < FRESH_S).then(|| at.duration_since(back))
        })
    });
    Cut {
        left_m,
        first_s: first.as_secs_f64(),
        fresh_s: fresh.as_secs_f64(),
        whole_s: whole.as_secs_f64(),
    }
}

/// How long it takes until a peer of the models' host hears the controller, and until the controller hears it, s.
pub fn met_in(controller: &Graph, cyclone: &mut Cyclone) -> [f64; 2] {
    let begins = Instant::now();
    let (joints, status) = (topics::JOINT_STATES.name, topics::PLAN_STATUS.name);
    cyclone.samples_within(joints, Duration::ZERO);
    let (mut hears, mut heard) = (None, None);
    while begins.elapsed() < MEETING {
        cyclone.write(status, &json!({}));
        let came = cyclone.samples_within(joints, Duration::from_millis(200));
        let after_s = begins.elapsed().as_secs_f64();
        if !came.is_empty() {
            hears.get_or_insert(after_s);
        }
        if !controller.since(&topics::PLAN_STATUS, begins).is_empty() {
            heard.get_or_insert(after_s);
        }
        if let (Some(hears), Some(heard)) = (hears, heard) {
            return [hears, heard];
        }
    }
    panic!("within {MEETING:?}: hears {hears:?}, is heard {heard:?}")
}

#[test]
fn after_a_cut_longer_than_a_lease_hosts_meet_again() {
    let Some(python) = interpreter("a long cut with Cyclone DDS") else {
        return;
    };
    let Some(network) = Network::of(&["controller", "models"], 63, 5) else {
        return;
    };
    let cell = Cell::start(&network);
    let [hears, says] = [end(&topics::JOINT_STATES), end(&topics::PLAN_STATUS)];
    let mut cyclone = network.on("models", |_| {
        Cyclone::on_network(&python, 63, &[hears], &[says])
    });
    met_in(&cell.controller, &mut cyclone);

    cut(&cell, CYCLONE_CUT);
    let met = met_in(&cell.controller, &mut cyclone);
    eprintln!(
        "a cut of {CYCLONE_CUT:?}: {:.1} s until Cyclone DDS hears the controller again, {:.1} s until it is heard",
        met[0], met[1]
    );
    cyclone.stop();

    let seen = cut(&cell, LONG_CUT);
    eprintln!(
        "a cut of {LONG_CUT:?}: first compensation after {:.3} s, fresh after {:.3} s, whole after {:.3} s; left {:.3} um",
        seen.first_s,
        seen.fresh_s,
        seen.whole_s,
        seen.left_m * 1e6
    );
    assert!(seen.left_m.abs() < FADED_M);
    assert!(seen.fresh_s < RECOVERY.as_secs_f64());
    assert!(seen.whole_s < RECOVERY.as_secs_f64());
    cell.stop();
}

#[test]
fn a_cut_link_fades_the_compensation_and_it_is_back_within_three_seconds() {
    let Some(network) = Network::of(&["controller", "models"], 62, 4) else {
        return;
    };
    let cell = Cell::start(&network);
    let cuts: Vec<Cut> = (0..CUTS)
        .map(|_| {
            let seen = cut(&cell, CUT);
            std::thread::sleep(Duration::from_millis(300));
            seen
        })
        .collect();
    let of = |value: fn(&Cut) -> f64| {
        let mut all: Vec<f64> = cuts.iter().map(value).collect();
        all.sort_by(f64::total_cmp);
        (all[all.len() / 2], all[all.len() - 1])
    };
    let words =
        |name: &str, (median, most): (f64, f64)| format!("{name} {median:.3} (at most {most:.3})");
    eprintln!(
        "{CUTS} cuts of {CUT:?}: {}, {}, {}; {}",
        words("first compensation after", of(|cut| cut.first_s)),
        words("fresh after", of(|cut| cut.fresh_s)),
        words("whole after s", of(|cut| cut.whole_s)),
        words("left um", of(|cut| cut.left_m * 1e6)),
    );
    assert!(of(|cut| cut.left_m.abs()).1 < FADED_M, "faded at each cut");
    assert!(of(|cut| cut.first_s).1 < RECOVERY.as_secs_f64());
    assert!(of(|cut| cut.fresh_s).1 < RECOVERY.as_secs_f64());
    assert!(of(|cut| cut.whole_s).1 < RECOVERY.as_secs_f64());
    never_stepped(&cell.controller, cell.began);
    cell.stop();
}

/// What the controller adds moves no faster than its own limit, whatever the link does.
fn never_stepped(controller: &Graph, since: Instant) {
    let states = controller.since(&topics::AXES_STATE, since);
    let at_s = |state: &AxisState| seconds(&state.controller_stamp);
    let mut fastest_m = 0.0_f64;
    let mut later = 0;
    for (_, state) in &states {
        while later + 1 < states.len() && at_s(&states[later].1) < at_s(state) + 0.1 {
            later += 1;
        }
        fastest_m = fastest_m.max((added_m(&states[later].1) - added_m(state)).abs());
    }
    eprintln!(
        "{} states: moved by {:.2} um in 0.1 s at most",
        states.len(),
        fastest_m * 1e6
    );
    assert!(fastest_m <= FASTEST_M, "{fastest_m}");
}
