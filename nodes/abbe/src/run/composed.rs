//! A scenario in simulated time: every stage wired directly, in one total order.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use abbe_msgs::{SERVICE_EVENT_SUFFIX, topics};
use anyhow::{Context, Result, bail};
use live_view_node::Feed;
use metrology::epoch;
use metrology::sample::PlanState;
use metrology::stamp::{Host, Span, Stamp};
use node_runtime::harness::Published;
use node_runtime::tap::Selection;
use node_runtime::{Diagnostic, Harness, Interruption, Level, Node, complain};
use recorder::{
    CALL_RECORD, ChannelId, MessageStamp, RecordedCall, Recorder, RecorderSink, RunNode,
};
use reports::evidence::Evidence;

use super::mirror::Mirror;
use super::{INTERRUPTED, NOT_RECORDED, Outcome, bag, serve};
use crate::alarm;
use crate::launch::LaunchNode;
use crate::node;
use crate::progress::Progress;
use crate::scenario::Scenario;
use crate::truth::Truth;

/// How long nodes may take to wind down, in simulated time.
const SHUTDOWN_PATIENCE: Span = Span::from_nanos(120_000_000_000);

/// Nodes evaluate the last program of a plan after its end: this long the run goes on.
const EVALUATION: Span = Span::from_nanos(3_000_000_000);

/// Who says that a run cannot be recorded any more.
const RUN_NAME: &str = "abbe_run";

/// How a scenario is run.
#[derive(Clone, Copy)]
pub struct How<'a> {
    /// No faster than this many times real time; 0: as fast as it can.
    pub pace: f64,
    /// Whether its topics are shown on DDS.
    pub on_dds: bool,
    /// The live view that is shown, if any.
    pub feed: Option<&'a Feed>,
    /// Whether it is to end before its plan does.
    pub interruption: &'a Interruption,
}

/// Runs `scenario` from `start_s` on.
///
/// # Errors
/// When a node cannot be built or the bag not written.
pub fn run(scenario: &Scenario, start_s: i64, bag_path: &Path, how: How<'_>) -> Result<Outcome> {
    let truth = Arc::new(Truth::default());
    let nodes = replayer::sources_first(build(scenario, &truth)?);
    let ran = ran(scenario, &nodes);
    let parameters = nodes
        .iter()
        .map(|node| Ok((node.name().to_owned(), bag::parameters(node.as_ref())?)))
        .collect::<Result<BTreeMap<_, _>>>()?;
    let start = epoch::whole_seconds(start_s, 0)
        .map_err(|error| anyhow::anyhow!("simulated_start_s = {error}"))?;
    let start_nanos = start.nanos().cast_unsigned();
    let mut harness = Harness::compose(nodes, start)?;
    let recorder = bag::begin(bag_path, scenario, parameters, start_nanos, Some(ran))?;
    let unmatched = record(&mut harness, &recorder, &scenario.file.recording.exclude)?;
    let mirror = if how.on_dds {
        Mirror::start(&mut harness)?
    } else {
        None
    };
    if let Some(feed) = how.feed {
        serve::feed(&mut harness, feed);
    }
    let evidence = gather(&mut harness, &truth);
    let watched = Watched {
        evidence: &evidence,
        truth: &truth,
        sink: &recorder.sink(),
    };
    let failure = play(&mut harness, scenario, start, how, watched);
    if !how.interruption.is_forced() {
        recorder
            .sink()
            .note(recorder::END_RECORD, bag::end(harness.now()));
        harness.shutdown(SHUTDOWN_PATIENCE);
    }
    drop(harness);
    if let Some(mirror) = mirror {
        mirror.finish()?;
    }
    let sink = recorder.sink();
    let finished = recorder.finish();
    let stats = sink.stats();
    let evidence = Rc::try_unwrap(evidence)
        .map_err(|_| anyhow::anyhow!("an observer outlived its harness"))?
        .into_inner();
    for pattern in &unmatched {
        complain!("abbe: {}", recorder_node::unmatched(pattern));
    }
    let (failure, trouble) = bag::ended(failure, finished.err());
    Ok(Outcome {
        evidence,
        failure,
        recorded: stats.messages_written,
        lost: stats.messages_lost,
        trouble,
    })
}

/// What a run in simulated time is watched by.
#[derive(Clone, Copy)]
struct Watched<'w> {
    evidence: &'w Rc<RefCell<Evidence>>,
    truth: &'w Truth,
    sink: &'w RecorderSink,
}

impl Watched<'_> {
    /// The reason to call the plan off; a failure of the recording is reported at once.
    fn called_off(&self, harness: &mut Harness, how: How<'_>) -> Option<String> {
        if how.interruption.is_asked() {
            return Some(INTERRUPTED.to_owned());
        }
        let reason = format!("{NOT_RECORDED}: {}", self.sink.stats().failure?);
        complain!("abbe: {reason}");
        let now = harness.now();
        let message = alarm::message(RUN_NAME, &reason, now);
        harness.inject(topics::DIAGNOSTICS.name, &message);
        let diagnostic = Diagnostic::new(Level::Error, "recording", reason.clone());
        self.evidence
            .borrow_mut()
            .condition(now, RUN_NAME, &diagnostic);
        Some(reason)
    }
}

/// Which nodes run, in their order; a composition has no two of one name.
fn ran(scenario: &Scenario, nodes: &[Box<dyn Node>]) -> Vec<RunNode> {
    let executable = |name: &str| {
        let launched = scenario.nodes.iter().find(|launched| launched.name == name);
        launched
            .map_or(name, |launched| launched.exec.as_str())
            .to_owned()
    };
    let node = |name: &str| RunNode {
        name: name.to_owned(),
        executable: executable(name),
    };
    nodes.iter().map(|built| node(built.name())).collect()
}

/// Builds every node of the launch file; the fake machine with the scenario's look at its truth.
fn build(scenario: &Scenario, truth: &Arc<Truth>) -> Result<Vec<Box<dyn Node>>> {
    scenario
        .nodes
        .iter()
        .map(|launched| {
            build_node(launched, truth).with_context(|| format!("node {}", launched.name))
        })
        .collect()
}

fn build_node(launched: &LaunchNode, truth: &Arc<Truth>) -> Result<Box<dyn Node>> {
    let setup = launched.setup()?;
    if launched.exec == "fake_cnc" {
        return fake_cnc_node::witnessed(&setup, Some(truth.witness()));
    }
    match node::builder(&launched.exec) {
        Some(build) => build(&setup),
        None => bail!(
            "exec \"{}\" is unknown (known: {})",
            launched.exec,
            node::names()
        ),
    }
}

/// Where a topic goes.
#[derive(Clone, Copy)]
enum Place {
    Channel(ChannelId),
    /// The calls of a service: a reader such as PyPI `rosbags` opens no bag with such a type.
    Note,
    Nowhere,
}

/// Writes every publication into the bag, in total order; gives the patterns that leave out no topic.
fn record(harness: &mut Harness, recorder: &Recorder, exclude: &[String]) -> Result<Vec<String>> {
    let sink: RecorderSink = recorder.sink();
    let picked = Selection::All.without(exclude.to_vec());
    let topics: Vec<String> = { harness.topics() }
        .map(|port| bag::full_name(&port.topic))
        .collect();
    let unmatched = picked.unmatched(topics.iter().map(String::as_str));
    let mut places = Vec::new();
    let mut names = Vec::new();
    for port in harness.topics() {
        let name = bag::full_name(&port.topic);
        places.push(if port.topic.ends_with(SERVICE_EVENT_SUFFIX) {
            Place::Note
        } else if picked.takes(&name) {
            Place::Channel(sink.add_channel(&bag::channel(name, port))?)
        } else {
            Place::Nowhere
        });
        names.push(port.topic.clone());
    }
    let mut messages = 0;
    harness.observe(Box::new(move |published: Published<'_>| {
        let nanos = published.at.nanos();
        let channel = match places[published.topic] {
            Place::Channel(channel) => Some(channel),
            Place::Note => None,
            Place::Nowhere => return,
        };
        let Some(channel) = channel else {
            let call = RecordedCall {
                after_messages: messages,
                time_nanos: u64::try_from(nanos).unwrap_or(0),
                topic: names[published.topic].clone(),
                event: published.bytes.to_vec(),
            };
            sink.note(CALL_RECORD, call.metadata());
            return;
        };
        messages += 1;
        let stamp = MessageStamp {
            log_time_nanos: nanos,
            publish_time_nanos: nanos,
            sequence: published.sequence,
        };
        sink.push(channel, stamp, published.bytes);
    }));
    Ok(unmatched)
}

/// Keeps what the report needs.
fn gather(harness: &mut Harness, truth: &Arc<Truth>) -> Rc<RefCell<Evidence>> {
    let evidence = Rc::new(RefCell::new(Evidence::default()));
    let names: Vec<String> = harness.topics().map(|port| port.topic.clone()).collect();
    let wanted: Vec<bool> = names.iter().map(|name| Evidence::wants(name)).collect();
    let (seen, truth) = (Rc::clone(&evidence), Arc::clone(truth));
    harness.observe(Box::new(move |published: Published<'_>| {
        if wanted[published.topic] {
            let mut evidence = seen.borrow_mut();
            settle(&mut evidence, &truth);
            evidence.message(&names[published.topic], published.at, published.bytes);
            truth
                .verifying
                .store(evidence.verifying(), Ordering::Relaxed);
        }
    }));
    let seen = Rc::clone(&evidence);
    harness.observe_conditions(Box::new(move |at, node, diagnostic| {
        seen.borrow_mut().condition(at, node, diagnostic);
    }));
    evidence
}

/// Moves what the witness saw to where it belongs, before the next segment begins.
fn settle(evidence: &mut Evidence, truth: &Truth) {
    let (poses, latency_s) = truth.take();
    for pose in poses {
        evidence.pose(pose);
    }
    evidence.true_latency_s = latency_s.or(evidence.true_latency_s);
}

/// Advances until the plan is over; the reason when it failed.
fn play(
    harness: &mut Harness,
    scenario: &Scenario,
    start: Stamp<Host>,
    how: How<'_>,
    watched: Watched<'_>,
) -> Option<String> {
    let Watched {
        evidence, truth, ..
    } = watched;
    let title = format!("{}: {}", scenario.name, scenario.file.title);
    let mut progress = Progress::new(&title, start);
    let limit = start + Span::from_secs_f64(scenario.file.limit_min * 60.0);
    let began = Instant::now();
    let mut done_at = None;
    let failure = loop {
        let Some(now) = harness.advance() else {
            break Some("no node has a timer: time cannot pass".to_owned());
        };
        if progress.due() {
            settle(&mut evidence.borrow_mut(), truth);
            progress.show(now, &evidence.borrow());
            if let Some(reason) = watched.called_off(harness, how) {
                break Some(reason);
            }
        }
        match evidence
            .borrow()
            .status
            .as_ref()
            .map(|status| (status.state, &status.message))
        {
            Some((PlanState::Done, _)) => {
                done_at.get_or_insert(now);
            }
            Some((PlanState::Failed, message)) => break Some(message.clone()),
            _ => {}
        }
        if done_at.is_some_and(|done| now - done >= EVALUATION) {
            break None;
        }
        if now > limit {
            let limit_min = scenario.file.limit_min;
            let waits = evidence.borrow().waiting_for();
            break Some(format!("limit_min = {limit_min} min have passed{waits}"));
        }
        if how.pace > 0.0 {
            let due = Duration::from_secs_f64((now - start).as_secs_f64() / how.pace);
            std::thread::sleep(due.saturating_sub(began.elapsed()));
        }
    };
    progress.finish(&evidence.borrow());
    failure
}
