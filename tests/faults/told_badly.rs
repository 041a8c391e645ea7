//! Touches, readings, spheres and segments that are doubled, out of order, no numbers or of an hour ago: the nodes that
//! listen say so, and compute what they compute without them.

use std::time::Instant;

use abbe_msgs::msg::{
    BlockMeasurement, GeometryModel, PlanStatus, ProbeLatency, ProbeTrigger, ProbedPoint,
};
use abbe_msgs::{from_cdr, to_cdr, topics};
use abbe_tests::graph::{Graph, now, port};
use abbe_tests::namespace;
use abbe_tests::program::{Process, domain, root};
use abbe_tests::scenario::Scenario;
use recorder::Bag;

use crate::said::{later, state};
use crate::twins::{Twins, Worse, spoiled};

const STATES: &str = topics::AXES_STATE.name;
const TOUCHES: &str = topics::PROBE_TRIGGER.name;
const LATENCY: &str = topics::LATENCY.name;
const SEGMENTS: &str = topics::TEST_SEGMENT.name;
const READINGS: &str = topics::GRID_POSITION.name;
const SPHERES: &str = topics::PROBE_FEATURE.name;
/// Every so many samples of a stream are told twice.
const NOW_AND_THEN: usize = 25;

/// What is told besides each message: the same again, the one before it, and both kinds of worse ones.
#[derive(Default)]
struct Tongue {
    before: Vec<(&'static str, Vec<u8>)>,
    told: usize,
    has_begun: bool,
}

impl Tongue {
    /// The message before on its topic, if there was one.
    fn replaced(&mut self, topic: &'static str, bytes: &[u8]) -> Option<Vec<u8>> {
        match self.before.iter_mut().find(|(known, _)| *known == topic) {
            Some((_, before)) => Some(std::mem::replace(before, bytes.to_vec())),
            None => {
                self.before.push((topic, bytes.to_vec()));
                None
            }
        }
    }

    fn worse(topic: &str, bytes: &[u8]) -> [Vec<u8>; 2] {
        [Worse::NotANumber, Worse::OfAnHourAgo].map(|worse| spoiled(topic, bytes, worse))
    }

    /// Of a stream of positions: a state of an hour ago empties what is kept of them, so before the first run alone.
    fn of_states(&mut self, bytes: &[u8]) -> Vec<Vec<u8>> {
        self.told += 1;
        let mut besides = Vec::new();
        if self.told.is_multiple_of(NOW_AND_THEN) {
            besides.push(bytes.to_vec());
        }
        if !std::mem::replace(&mut self.has_begun, true) {
            besides.extend(Self::worse(STATES, bytes));
            // What follows is no hour ahead of what is kept.
            besides.push(bytes.to_vec());
        }
        besides
    }

    fn besides(&mut self, topic: &'static str, bytes: &[u8]) -> Vec<Vec<u8>> {
        if topic == STATES {
            return self.of_states(bytes);
        }
        let mut besides = vec![bytes.to_vec()];
        // A segment out of its order is another plan; what is doubled and senseless of them is told.
        if topic == SEGMENTS {
            let is_end = from_cdr::<abbe_msgs::msg::TestSegment>(bytes).is_ok_and(|s| !s.begin);
            besides.truncate(usize::from(is_end));
            besides.push(spoiled(topic, bytes, Worse::NotANumber));
            return besides;
        }
        besides.extend(self.replaced(topic, bytes));
        besides.extend(Self::worse(topic, bytes));
        besides
    }
}

#[test]
fn touches_that_are_told_badly_change_no_point_and_no_block() {
    namespace::alone("touches told badly", || {
        let scenario = Scenario::copy_of("cold_reference");
        // On a busy computer the time runs ahead of positions that have arrived and were not taken yet.
        let patient = "ros__parameters:\n    hold_ms: 2000.0";
        scenario.replace("probe.yaml", "ros__parameters:", patient);
        let topics = [STATES, TOUCHES, LATENCY, SEGMENTS];
        let mut twins = Twins::start(domain(11), &scenario, &["probe"], &topics);
        let began = Instant::now();
        let mut tongue = Tongue::default();
        let bag = Bag::open(root().join("bags/cold_reference")).unwrap();
        twins.play(&bag, |topic, bytes| tongue.besides(topic, bytes));
        twins.agree::<ProbedPoint>(topics::PROBE_POINT.name, 18, |_| ());
        twins.agree::<BlockMeasurement>(topics::BLOCKS_MEASUREMENT.name, 4, |_| ());
        twins.only_bad_says("probe", "told_before", &["told before"], began);
        twins.only_bad_says("probe", "latency_older", &["3600.0 s before"], began);
        twins.only_bad_says("probe", "input_refused", &[], began);
        twins.only_bad_says("probe", "clock_went_back", &["went back"], began);
        twins.stop();
    });
}

#[test]
fn touches_that_are_told_badly_change_no_latency() {
    namespace::alone("touches of a calibration told badly", || {
        let scenario = Scenario::copy_of("cold_reference");
        let (node, topics) = ("latency_calibrator", [STATES, TOUCHES, SEGMENTS]);
        let mut twins = Twins::start(domain(15), &scenario, &[node], &topics);
        let began = Instant::now();
        let mut tongue = Tongue::default();
        let bag = Bag::open(root().join("bags/cold_reference")).unwrap();
        twins.play(&bag, |topic, bytes| tongue.besides(topic, bytes));
        // It is stamped when it was computed.
        let stamp = |latency: &mut ProbeLatency| latency.header = Default::default();
        twins.agree::<ProbeLatency>(LATENCY, 1, stamp);
        twins.only_bad_says(node, "calibration", &["told before"], began);
        twins.only_bad_says(node, "input_refused", &[], began);
        twins.only_bad_says(node, "clock_went_back", &["went back"], began);
        twins.stop();
    });
}

#[test]
fn readings_that_are_told_badly_change_no_model_of_the_geometry() {
    namespace::alone("readings told badly", || {
        let scenario = Scenario::copy_of("grid_xy");
        let text = "/**:\n  ros__parameters: {machine_file: machine.yaml}\n";
        scenario.write("gap_diagnosis.yaml", text);
        // On a busy computer the time runs ahead of readings that have arrived and were not taken yet.
        let patient = "ros__parameters:\n    hold_ms: 2000.0";
        scenario.replace("grid_encoder.yaml", "ros__parameters:", patient);
        let nodes = ["grid_encoder", "gap_diagnosis"];
        let topics = [STATES, READINGS, SEGMENTS];
        let mut twins = Twins::start(domain(12), &scenario, &nodes, &topics);
        let began = Instant::now();
        let mut tongue = Tongue::default();
        let bag = Bag::open(root().join("bags/grid_circles")).unwrap();
        let mut told = 0;
        twins.play(&bag, |topic, bytes| {
            told += 1;
            if topic == READINGS && !told_again(told) {
                return Vec::new();
            }
            tongue.besides(topic, bytes)
        });
        let stamp = |model: &mut GeometryModel| model.header = Default::default();
        twins.agree::<GeometryModel>(topics::GEOMETRY_MODEL.name, 4, stamp);
        twins.only_bad_says("grid_encoder", "recording", &["told before"], began);
        twins.only_bad_says("grid_encoder", "input_refused", &[], began);
        twins.stop();
    });
}

const fn told_again(told: usize) -> bool {
    told.is_multiple_of(NOW_AND_THEN)
}

/// One sphere at eight poses, twice.
const SPHERE: &str = "title: one sphere
steps:
  - {do: latency, feature: top, feeds_mm_min: [60.0, 120.0, 240.0, 480.0], repeats: 2}
  - {do: rotary, sphere: high, planned: 8, points: 6, repeats: 2}
";

#[test]
fn spheres_that_are_told_badly_change_no_model_of_the_rotary_axes() {
    namespace::alone("spheres told badly", || {
        let scenario = Scenario::copy_of("five_axis");
        scenario.write("plan.yaml", SPHERE);
        let bag = Bag::open(scenario.run().join("bag")).unwrap();
        let mut twins = Twins::start(
            domain(13),
            &scenario,
            &["rotary_axes"],
            // The first segment is of the latency's run, which is none of this node's.
            &[SEGMENTS, SPHERES],
        );
        let began = Instant::now();
        let mut tongue = Tongue::default();
        twins.play(&bag, |topic, bytes| tongue.besides(topic, bytes));
        let stamp = |model: &mut GeometryModel| model.header = Default::default();
        twins.agree::<GeometryModel>(topics::GEOMETRY_ROTARY.name, 1, stamp);
        for (condition, words) in [
            ("told_before", "told before"),
            ("of_another_time", "before the run began"),
            ("input_refused", ""),
        ] {
            twins.only_bad_says("rotary_axes", condition, &[words], began);
        }
        twins.stop();
    });
}

/// A cell at work, in which each touch is told again by somebody, and an hour old, and without sense.
#[test]
fn touches_that_are_told_badly_do_not_count_for_the_sequencer() {
    namespace::alone("touches of a plan told badly", || {
        let (scenario, domain) = (Scenario::copy_of("short_cell"), domain(14));
        let plan = "title: two blocks\nsteps:\n  - {do: blocks, cold: true}\n";
        scenario.write("plan.yaml", plan);
        let graph = Graph::join(domain);
        let mut voice = graph.voice(&[port(&topics::PROBE_TRIGGER), port(&topics::AXES_STATE)]);
        let nodes = ["fake_cnc", "sequencer"].map(|node| {
            let file = scenario.argument(&format!("{node}.yaml"));
            Process::node(domain, node, &["--params-file", &file])
        });
        let began = Instant::now();
        let mut told = 0;
        let end = graph.wait_longer(
            std::time::Duration::from_secs(120),
            "the plan's end",
            |graph| {
                let heard = graph.since(&topics::PROBE_TRIGGER, began);
                // Our own are among them.
                let own = heard
                    .iter()
                    .filter(|(_, touch)| touch.feature_id.starts_with("block"));
                let mut sequences: Vec<u32> = own.map(|(_, touch)| touch.sequence).collect();
                sequences.dedup();
                if let Some((_, touch)) = heard.last().filter(|_| sequences.len() > told) {
                    told = sequences.len();
                    tell_badly(&mut voice, touch);
                }
                let all = graph.since(&topics::PLAN_STATUS, began);
                let is_over = |status: &PlanStatus| status.state >= PlanStatus::STATE_DONE;
                all.into_iter().map(|(_, status)| status).find(is_over)
            },
        );
        assert_eq!(end.state, PlanStatus::STATE_DONE, "{end:?}");
        graph.condition("sequencer", "told_before", &["not counted"], began);
        graph.condition("sequencer", "input_refused", &["probe/trigger"], began);
        let segments = graph.since(&topics::TEST_SEGMENT, began);
        assert!(segments.iter().any(|(_, segment)| segment.completed));
        voice.stop();
        nodes.into_iter().for_each(|node| drop(node.stop()));
    });
}

fn tell_badly(voice: &mut abbe_tests::graph::Voice, touch: &ProbeTrigger) {
    voice.say(0, touch);
    for worse in [Worse::NotANumber, Worse::OfAnHourAgo] {
        voice.bytes(0, &spoiled(TOUCHES, &to_cdr(touch), worse));
    }
    // A state that is none, for whoever keeps positions.
    let mut senseless = state(&later(&now(), 0), f64::NAN);
    senseless.motor[1] = f64::INFINITY;
    voice.say(1, &senseless);
}
