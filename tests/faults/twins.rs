//! A node twice on one graph: one is told what a bag holds, the other that too and what no good publisher says. What both
//! compute is the same, and the second one says what it refused.
//!
//! Time is the bag's, and stands until everybody has what was told: nothing depends on how busy the computer is.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_msgs::msg::{
    AxisState, GridSample, ProbeLatency, ProbeTrigger, ProbedFeature, ProbedPoint, TestSegment,
};
use abbe_msgs::rosgraph_msgs::msg::Clock;
use abbe_msgs::topics::{self, Entry};
use abbe_msgs::{Message, from_cdr, to_cdr};
use abbe_tests::graph::{Graph, Voice, port};
use abbe_tests::program::Process;
use abbe_tests::scenario::Scenario;
use node_runtime::node::TopicPort;
use recorder::{Bag, Event, Order};

use crate::said::later;

/// Their namespaces.
const TWINS: [&str; 2] = ["good", "bad"];
const BAD: usize = 1;
/// Between two tellings of the time, ns of the bag.
const STEP: i64 = 50_000_000;
const HOUR: i64 = 3_600_000_000_000;
/// How long nodes may take to meet.
const MEETING: Duration = Duration::from_secs(30);
/// How long they may compute with what they were told.
const COMPUTING: Duration = Duration::from_secs(180);
/// After the last message everything is evaluated, s of the bag.
const AFTER_S: i64 = 20;

pub struct Twins {
    pub graph: Graph,
    voice: Voice,
    topics: Vec<&'static str>,
    nodes: Vec<(&'static str, Process)>,
    now: i64,
    /// How often each topic of each twin was told something.
    told: BTreeMap<String, u64>,
}

fn entry(topic: &str) -> &'static Entry {
    let mut all = topics::all().iter();
    all.find(|entry| entry.name == topic).unwrap()
}

fn port_of(namespace: &str, topic: &str) -> TopicPort {
    let entry = entry(topic);
    TopicPort {
        topic: format!("/{namespace}/{topic}"),
        type_name: entry.description.type_name,
        type_hash: entry.description.type_hash,
        definition: entry.description.definition,
        qos: entry.qos,
    }
}

impl Twins {
    /// Starts two of each node, which hear `topics`.
    pub fn start(
        domain: u16,
        scenario: &Scenario,
        nodes: &[&'static str],
        topics: &[&'static str],
    ) -> Self {
        let graph = Graph::join(domain);
        let mut ports = vec![port(&topics::CLOCK)];
        for namespace in TWINS {
            ports.extend(topics.iter().map(|topic| port_of(namespace, topic)));
        }
        let voice = graph.voice(&ports);
        let mut processes = Vec::new();
        for node in nodes {
            for namespace in TWINS {
                let file = scenario.argument(&format!("{node}.yaml"));
                let namespace = format!("__ns:=/{namespace}");
                let arguments = ["-r", &namespace, "--params-file", &file];
                let time = ["-p", "use_sim_time:=true"];
                let process = Process::node(domain, node, &[&arguments[..], &time].concat());
                processes.push((*node, process));
            }
        }
        for node in nodes {
            for namespace in TWINS {
                graph.alive(&format!("{namespace}/{node}"), Instant::now());
            }
        }
        Self {
            graph,
            voice,
            topics: topics.to_vec(),
            nodes: processes,
            now: 0,
            told: BTreeMap::new(),
        }
    }

    fn tell_time(&mut self, nanos: i64) {
        self.voice.settle();
        self.now = nanos;
        let clock = later(&Time::default(), nanos);
        self.voice.say(0, &Clock { clock });
    }

    fn tell(&mut self, twin: usize, topic: &str, bytes: &[u8]) {
        let name = format!("/{}/{topic}", TWINS[twin]);
        *self.told.entry(name).or_default() += 1;
        let place = self.topics.iter().position(|known| *known == topic);
        let place = 1 + twin * self.topics.len() + place.unwrap();
        self.voice.bytes(place, bytes);
    }

    /// Tells the first message of the first topic, which is of no run, until every node has heard it.
    fn meet(&mut self, bag: &Bag) {
        let topic = self.topics[0];
        let mut events = bag.messages(Order::LogTime);
        let first = loop {
            match events.next_event() {
                Some(Event::Message(message))
                    if bag.topic(message.topic).topic.ends_with(topic) =>
                {
                    break message.data.to_vec();
                }
                Some(_) => {}
                None => panic!("the bag has nothing of {topic}"),
            }
        };
        let since = Instant::now();
        loop {
            for twin in 0..TWINS.len() {
                self.tell(twin, topic, &first);
            }
            std::thread::sleep(Duration::from_millis(200));
            let received = self.received(since);
            let heard = |namespace: &str| {
                let name = format!("/{namespace}/{topic}");
                let counts = received.iter().filter(|((_, of), _)| *of == name);
                counts.map(|(_, count)| count).any(|count| *count > 0)
            };
            if TWINS.into_iter().all(heard) {
                break;
            }
            assert!(since.elapsed() < MEETING, "{topic} is not heard");
        }
        // The other topics are met with the first.
        std::thread::sleep(Duration::from_millis(500));
    }

    /// How many messages each node has taken of each topic, as it told last since `since`.
    fn received(&self, since: Instant) -> BTreeMap<(String, String), u64> {
        let told = self.graph.since(&topics::DIAGNOSTICS, since);
        let statuses = told.iter().flat_map(|(_, array)| &array.status);
        let counts = statuses.flat_map(|status| {
            status.values.iter().filter_map(|value| {
                let topic = value.key.strip_suffix(" received")?;
                let count = value.value.parse().ok()?;
                Some(((status.name.clone(), topic.to_owned()), count))
            })
        });
        counts.collect()
    }

    /// The same once every node has told.
    fn received_by_all(&self) -> BTreeMap<(String, String), u64> {
        let since = Instant::now();
        for (node, _) in &self.nodes {
            for namespace in TWINS {
                self.graph.alive(&format!("{namespace}/{node}"), since);
            }
        }
        self.received(since)
    }

    /// Until every node has taken what it was told since `before`: what has arrived waits with it, topic by topic, and the
    /// time must not run ahead of that.
    fn all_is_taken(&self, before: &BTreeMap<(String, String), u64>) {
        self.graph
            .wait_longer(COMPUTING, "everything is taken", |_| {
                let now = self.received_by_all();
                let is_taken = |(key, count): (&(String, String), &u64)| {
                    let told = self.told.get(&key.1).copied().unwrap_or_default();
                    now.get(key).is_some_and(|now| *now >= count + told)
                };
                before.iter().all(is_taken).then_some(())
            });
    }

    /// Tells both what the bag holds; of each message `worse` says what the second one is told besides.
    pub fn play(&mut self, bag: &Bag, mut worse: impl FnMut(&'static str, &[u8]) -> Vec<Vec<u8>>) {
        self.meet(bag);
        let before = self.received_by_all();
        self.told.clear();
        let mut held = Held::default();
        let mut events = bag.messages(Order::LogTime);
        while let Some(event) = events.next_event() {
            let Event::Message(message) = event else {
                panic!("the bag has lost something");
            };
            let name = bag.topic(message.topic).topic.trim_start_matches('/');
            let mut known = self.topics.iter();
            let Some(topic) = known.find(|topic| **topic == name).copied() else {
                continue;
            };
            let nanos = i64::try_from(message.log_time_nanos).unwrap();
            if nanos >= self.now + STEP {
                self.tell_time(nanos);
            }
            // A node that is behind takes what waits topic by topic: an end that it takes first is the end of a run without
            // readings, however long it is held.
            // A touch is corrected with what came before it, and told again at the node's own time.
            let is_touch = topic == topics::PROBE_TRIGGER.name;
            if is_touch || (topic == topics::TEST_SEGMENT.name && is_end(message.data)) {
                self.all_is_taken(&before);
            }
            for twin in 0..TWINS.len() {
                self.tell(twin, topic, message.data);
            }
            let besides = worse(topic, message.data);
            if topic == topics::LATENCY.name {
                held = Held::new(besides);
                continue;
            }
            for bytes in besides {
                self.tell(BAD, topic, &bytes);
            }
            if is_touch && held.is_due() {
                self.wait_for_a_point_with_latency();
                for bytes in std::mem::take(&mut held.besides) {
                    self.tell(BAD, topics::LATENCY.name, &bytes);
                }
            }
        }
        assert!(
            held.besides.is_empty(),
            "too few touches came after the latency"
        );
        self.all_is_taken(&before);
        for _ in 0..AFTER_S {
            self.tell_time(self.now + 1_000_000_000);
        }
        self.voice.settle();
    }

    /// Until the second one has used the latency that it was told: its topic keeps the last message alone.
    fn wait_for_a_point_with_latency(&self) {
        let name = format!("/{}/{}", TWINS[BAD], topics::PROBE_POINT.name);
        self.graph
            .wait_longer(COMPUTING, "a point with a latency", |graph| {
                let all = graph.bytes_of(&name);
                let has_latency = |bytes: &Vec<u8>| {
                    let point: ProbedPoint = from_cdr(bytes).unwrap();
                    point.applied_latency_s.is_finite()
                };
                all.iter().any(has_latency).then_some(())
            });
    }

    /// What both said on a topic, `n` messages, is the same but for what `own` takes out of each.
    pub fn agree<M: Message>(&self, topic: &str, n: usize, own: impl Fn(&mut M)) {
        let names = TWINS.map(|namespace| format!("/{namespace}/{topic}"));
        // What everybody has is not yet computed with.
        let what = format!("{n} messages on each of {names:?}");
        self.graph.wait_longer(COMPUTING, &what, |graph| {
            let have_all = |name: &String| graph.bytes_of(name).len() >= n;
            names.iter().all(have_all).then_some(())
        });
        let said = |namespace: &str| -> Vec<String> {
            let all = self.graph.bytes_of(&format!("/{namespace}/{topic}"));
            let in_words = |bytes: &Vec<u8>| {
                let mut message: M = from_cdr(bytes).unwrap();
                own(&mut message);
                // NaN, which equals nothing, is a word as well.
                format!("{message:?}")
            };
            all.iter().map(in_words).collect()
        };
        let [good, bad] = TWINS.map(said);
        assert_eq!(good, bad, "{topic}");
        assert_eq!(good.len(), n, "{topic}");
    }

    /// The second one has said a condition; the first one, which told its conditions since, has not.
    pub fn only_bad_says(&self, node: &str, condition: &str, words: &[&str], since: Instant) {
        let [good, bad] = TWINS.map(|namespace| format!("{namespace}/{node}"));
        self.graph.condition(&bad, condition, words, since);
        self.graph.alive(&good, Instant::now());
        let said = self.graph.hears_condition(&good, condition, words, since);
        assert!(said.is_none(), "{said:?}");
    }

    /// All are there, and end in good order.
    pub fn stop(mut self) {
        for (node, process) in &mut self.nodes {
            assert!(process.is_running(), "{node} ended");
        }
        self.voice.stop();
        for (_, process) in self.nodes {
            process.stop();
        }
    }
}

fn is_end(segment: &[u8]) -> bool {
    from_cdr::<TestSegment>(segment).is_ok_and(|segment| !segment.begin)
}

/// What is told besides of a topic that keeps its last message alone, until the one before has been used.
#[derive(Default)]
struct Held {
    besides: Vec<Vec<u8>>,
    touches: usize,
}

impl Held {
    fn new(besides: Vec<Vec<u8>>) -> Self {
        Self {
            besides,
            touches: 0,
        }
    }

    /// With the second touch: all that the first one's point needs was told.
    fn is_due(&mut self) -> bool {
        self.touches += 1;
        self.touches >= 2 && !self.besides.is_empty()
    }
}

/// Of what a message is spoiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Worse {
    NotANumber,
    OfAnHourAgo,
}

fn changed<M: Message>(bytes: &[u8], change: impl Fn(&mut M)) -> Vec<u8> {
    let mut message: M = from_cdr(bytes).unwrap();
    change(&mut message);
    to_cdr(&message)
}

/// A message of a topic, spoiled.
pub fn spoiled(topic: &str, bytes: &[u8], worse: Worse) -> Vec<u8> {
    let nan = worse == Worse::NotANumber;
    let aged = |stamp: &mut Time| {
        if !nan {
            *stamp = later(stamp, -HOUR);
        }
    };
    if topic == topics::AXES_STATE.name {
        changed(bytes, |state: &mut AxisState| {
            aged(&mut state.header.stamp);
            aged(&mut state.controller_stamp);
            if nan {
                state.motor[0] = f64::NAN;
            }
        })
    } else if topic == topics::PROBE_TRIGGER.name {
        changed(bytes, |trigger: &mut ProbeTrigger| {
            aged(&mut trigger.header.stamp);
            aged(&mut trigger.controller_stamp);
            if nan {
                trigger.latched[2] = f64::NAN;
            }
        })
    } else if topic == topics::LATENCY.name {
        changed(bytes, |latency: &mut ProbeLatency| {
            aged(&mut latency.header.stamp);
            latency.latency_s = if nan { f64::NAN } else { 0.001 };
        })
    } else if topic == topics::TEST_SEGMENT.name {
        changed(bytes, |segment: &mut TestSegment| {
            aged(&mut segment.header.stamp);
            if nan {
                segment.feed_m_s = f64::NAN;
                segment.radius_m = f64::NAN;
            }
        })
    } else if topic == topics::GRID_POSITION.name {
        changed(bytes, |sample: &mut GridSample| {
            aged(&mut sample.header.stamp);
            if nan {
                sample.u_m = f64::NAN;
            }
        })
    } else {
        assert_eq!(topic, topics::PROBE_FEATURE.name);
        changed(bytes, |feature: &mut ProbedFeature| {
            aged(&mut feature.header.stamp);
            if nan {
                feature.centre.x = f64::NAN;
            } else {
                feature.centre.x += 1e-4;
            }
        })
    }
}
