//! A scenario in real time: its nodes on the ROS graph, in this process or one process each.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::{Context, Result, bail};
use live_view_node::{Feed, Receiver};
use metrology::sample::PlanState;
use metrology::stamp::{Host, Stamp};
use node_runtime::complain;
use node_runtime::environment::Environment;
use node_runtime::names::NodeNames;
use node_runtime::tap::{Selection, TapEvent};
use node_runtime::{HostTime, Interruption, Node, Running, Setup};
use recorder::Recorder;
use recorder_node::{Capture, Time};

use super::{INTERRUPTED, NOT_RECORDED, Outcome, bag};
use crate::alarm::Alarm;
use crate::launch::LaunchNode;
use crate::node;
use crate::progress::Progress;
use crate::scenario::Scenario;

mod graph;
mod processes;

use graph::GraphEvidence;
use processes::Processes;

/// Between two looks at the plan, the nodes and the signals.
const WATCH_PERIOD: Duration = Duration::from_millis(50);
/// What the last program leads to is evaluated and recorded within this.
const AFTERMATH: Duration = Duration::from_secs(1);
/// Who says that a run cannot be recorded any more.
const RUN_NAME: &str = "abbe_run";
/// The recorder's own name on the graph.
const TAP: &str = "abbe_run_tap";

/// Runs `scenario` until its plan is over.
///
/// # Errors
/// When a node cannot be started, there is no network, or the bag cannot be begun.
pub fn run(
    scenario: &Scenario,
    bag_path: &Path,
    separate: bool,
    feed: Option<Feed>,
    interruption: &Interruption,
) -> Result<Outcome> {
    let environment = Environment::read()?;
    let prepared = prepare(scenario, separate)?;
    let recorder = begin_bag(scenario, bag_path, &prepared)?;
    let evidence = Arc::<Mutex<GraphEvidence>>::default();
    let seen = Arc::clone(&evidence);
    let mut receiver = feed.map(|feed| Receiver::new("/", feed, HostTime::default()));
    let capture = Capture::start(
        &environment,
        &NodeNames::new(TAP, &[])?,
        Selection::All.without(scenario.file.recording.exclude.clone()),
        recorder,
        Time::default(),
        move |event| {
            if let TapEvent::Sample(sample) = event {
                if let Some(receiver) = &mut receiver {
                    receiver.take(sample);
                }
                lock(&seen).take(sample);
            }
        },
    )?;
    let mut cast = match prepared {
        Prepared::Here(nodes) => Cast::Here(node_runtime::launch(&environment, nodes)?),
        Prepared::Separate(_) => Cast::Separate(Processes::start(&scenario.nodes)?),
    };
    let mut alarm = None;
    let failed = || {
        let reason = format!("{NOT_RECORDED}: {}", capture.stats().failure?);
        alarm.get_or_insert_with(|| Alarm::raise(&environment, RUN_NAME, &reason));
        Some(reason)
    };
    let failure = play(scenario, &evidence, &mut cast, interruption, failed);
    let _ = interruption.wait_until_forced(AFTERMATH);
    let stopped = cast.stop(interruption);
    let captured = capture.finish()?;
    alarm.into_iter().for_each(Alarm::end);
    for word in capture_words(&captured) {
        complain!("abbe: {word}");
    }
    let failure = failure.or_else(|| stopped.err().map(|error| format!("{error:#}")));
    let (failure, trouble) = bag::ended(failure, captured.bag.err());
    let evidence = std::mem::take(&mut *lock(&evidence)).into_evidence();
    Ok(Outcome {
        evidence,
        failure,
        recorded: captured.stats.messages_written,
        lost: captured.stats.messages_lost + captured.lost_on_network,
        trouble,
    })
}

fn capture_words(captured: &recorder_node::Captured) -> Vec<String> {
    let mut words = captured.unrecorded.clone();
    words.extend(captured.unmatched.iter().cloned());
    if captured.lost_on_network > 0 {
        words.push(format!(
            "{} messages were lost on their way to the recorder",
            captured.lost_on_network
        ));
    }
    words
}

fn lock(evidence: &Mutex<GraphEvidence>) -> MutexGuard<'_, GraphEvidence> {
    // A panic elsewhere leaves whole messages behind.
    evidence.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Nodes before the start.
enum Prepared {
    Here(Vec<(Setup, Box<dyn Node>)>),
    /// Parameters by node, as the node's own process will resolve them.
    Separate(BTreeMap<String, String>),
}

impl Prepared {
    fn parameters(&self) -> Result<BTreeMap<String, String>> {
        match self {
            Self::Here(nodes) => nodes
                .iter()
                .map(|(setup, node)| {
                    let parameters = bag::parameters(node.as_ref())?;
                    Ok((setup.name().to_owned(), parameters))
                })
                .collect(),
            Self::Separate(parameters) => Ok(parameters.clone()),
        }
    }
}

fn prepare(scenario: &Scenario, separate: bool) -> Result<Prepared> {
    let known = |launched: &LaunchNode| match node::builder(&launched.exec) {
        Some(build) => Ok(build),
        None => bail!(
            "exec \"{}\" is unknown (known: {})",
            launched.exec,
            node::names()
        ),
    };
    let mut given = BTreeMap::new();
    let mut built = Vec::new();
    for launched in &scenario.nodes {
        let context = || format!("node {}", launched.name);
        let build = known(launched).with_context(context)?;
        let setup = launched.setup()?;
        if separate {
            let parameters = setup.resolved_by(build).with_context(context)?;
            given.insert(
                launched.name.clone(),
                bag::listed(&launched.name, &parameters)?,
            );
        } else {
            let node = build(&setup).with_context(context)?;
            built.push((setup, node));
        }
    }
    Ok(if separate {
        Prepared::Separate(given)
    } else {
        Prepared::Here(built)
    })
}

fn begin_bag(scenario: &Scenario, path: &Path, prepared: &Prepared) -> Result<Recorder> {
    let now = SystemTime::now().duration_since(UNIX_EPOCH)?;
    let start_nanos = u64::try_from(now.as_nanos()).context("the computer's clock")?;
    bag::begin(path, scenario, prepared.parameters()?, start_nanos, None)
}

/// Nodes at work.
enum Cast {
    Here(Running),
    Separate(Processes),
}

impl Cast {
    /// Why the plan cannot go on, where a node that it needs has ended.
    fn ended(&mut self) -> Option<String> {
        match self {
            Self::Here(running) => running.ended().map(|error| format!("{error:#}")),
            Self::Separate(processes) => processes.look().or_else(node_runtime::deafness),
        }
    }

    fn stop(self, interruption: &Interruption) -> Result<()> {
        match self {
            Self::Here(running) => running.stop_unless_forced(interruption),
            Self::Separate(processes) => {
                processes.stop(interruption);
                Ok(())
            }
        }
    }
}

/// Waits until the plan is over; the reason when it failed.
fn play(
    scenario: &Scenario,
    evidence: &Mutex<GraphEvidence>,
    cast: &mut Cast,
    interruption: &Interruption,
    mut not_recorded: impl FnMut() -> Option<String>,
) -> Option<String> {
    let title = format!("{}: {}", scenario.name, scenario.file.title);
    let mut progress = Progress::new(&title, Stamp::<Host>::from_nanos(0));
    let began = Instant::now();
    let limit = Duration::from_secs_f64(scenario.file.limit_min * 60.0);
    let failure = loop {
        if interruption.wait(WATCH_PERIOD) {
            complain!("abbe: interrupted: the nodes wind down; a second Ctrl-C ends at once");
            break Some(INTERRUPTED.to_owned());
        }
        if let Some(reason) = not_recorded() {
            break Some(reason);
        }
        let elapsed = began.elapsed();
        {
            let seen = lock(evidence);
            if progress.due() {
                let nanos = i64::try_from(elapsed.as_nanos()).unwrap_or(i64::MAX);
                progress.show(Stamp::from_nanos(nanos), seen.evidence());
            }
            let status = seen.evidence().status.as_ref();
            match status.map(|status| (status.state, &status.message)) {
                Some((PlanState::Done, _)) => break None,
                Some((PlanState::Failed, message)) => break Some(message.clone()),
                _ => {}
            }
        }
        if let Some(reason) = cast.ended() {
            break Some(reason);
        }
        if elapsed > limit {
            let limit_min = scenario.file.limit_min;
            let waits = lock(evidence).evidence().waiting_for();
            break Some(format!("limit_min = {limit_min} min have passed{waits}"));
        }
    };
    progress.finish(lock(evidence).evidence());
    failure
}
