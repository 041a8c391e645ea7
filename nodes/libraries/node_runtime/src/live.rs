//! The live runner: nodes on the ROS graph, with real clocks.

use std::collections::BTreeSet;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context as _, bail};
use tokio::runtime::Runtime;
use tokio::sync::watch;
use tokio::task::JoinSet;
use tracing::Instrument as _;

use crate::arguments::Arguments;
use crate::complain;
use crate::complaint;
use crate::environment::Environment;
use crate::interruption::Interruption;
use crate::log;
use crate::network::Participant;
use crate::node::Node;
use crate::setup::Setup;

mod action_client;
mod action_server;
mod assembly;
mod board;
mod event_time;
pub(crate) mod incoming;
mod logger_levels;
mod owner;
mod parameters;
mod refusals;
mod related;
mod requests;
mod service;
#[doc(hidden)]
pub mod strangers;
mod timers;
mod type_description;

/// Exit code for arguments that cannot be understood.
const USAGE: u8 = 2;

/// How long a node looks for others of its name before it shows itself.
const LOOKING_AROUND: Duration = Duration::from_millis(800);

/// What makes a node of its setup.
pub type Build = Box<dyn FnOnce(&Setup) -> anyhow::Result<Box<dyn Node>>>;

/// One node of a composition.
pub struct Composition {
    /// What the node calls itself before remapping.
    pub name: String,
    /// Arguments as on the command line of its own program, e.g. `--ros-args --params-file …`.
    pub arguments: Vec<String>,
    /// Makes the node.
    pub build: Build,
}

/// Runs one node until SIGINT or SIGTERM: the whole `main` of a node's program.
///
/// `name` is what the node calls itself before remapping. Exit code 0 after a clean stop, 1 when the
/// node cannot start, 2 when the arguments cannot be understood.
pub fn run(
    name: &str,
    build: impl FnOnce(&Setup) -> anyhow::Result<Box<dyn Node>> + 'static,
) -> ExitCode {
    run_composed(vec![Composition {
        name: name.to_owned(),
        arguments: std::env::args().skip(1).collect(),
        build: Box::new(build),
    }])
}

/// Runs many nodes in one process, each as its own participant, until SIGINT or SIGTERM.
///
/// Exit codes as of [`run`].
pub fn run_composed(compositions: Vec<Composition>) -> ExitCode {
    let outcome = prepare(compositions).and_then(|(environment, nodes)| {
        let interruption = Interruption::listen("what was being wound down is cut off")?;
        launch(&environment, nodes)?.until(&interruption)
    });
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => fail(&error),
    }
}

fn fail(error: &anyhow::Error) -> ExitCode {
    complain!("error: {}", complaint::in_words(error));
    if error.is::<crate::arguments::UsageError>() {
        ExitCode::from(USAGE)
    } else {
        ExitCode::FAILURE
    }
}

type Prepared = Vec<(Setup, Box<dyn Node>)>;

fn prepare(compositions: Vec<Composition>) -> anyhow::Result<(Environment, Prepared)> {
    let mut all_arguments = Vec::with_capacity(compositions.len());
    for composition in &compositions {
        all_arguments.push(Arguments::parse(composition.arguments.iter().cloned())?);
    }
    let mut environment = Environment::read()?;
    if let Some(security) = &mut environment.security {
        let mut told = all_arguments.iter();
        let told = || told.find_map(|arguments| arguments.enclave.clone());
        security.enclave = security.enclave.take().or_else(told);
    }
    log::start(&all_arguments.iter().collect::<Vec<_>>(), &environment);
    let mut nodes = Vec::with_capacity(compositions.len());
    for (composition, arguments) in compositions.into_iter().zip(&all_arguments) {
        let setup = Setup::new(&composition.name, arguments)
            .with_context(|| format!("node {}", composition.name))?;
        let node =
            (composition.build)(&setup).with_context(|| format!("node {}", composition.name))?;
        nodes.push((setup, node));
    }
    Ok((environment, nodes))
}

/// Puts nodes on the ROS graph, and their log on the console and `/rosout` unless the program has a
/// `tracing` subscriber of its own.
///
/// # Errors
/// When there is no network interface, a name is taken, or an endpoint cannot be made.
pub fn launch(
    environment: &Environment,
    nodes: Vec<(Setup, Box<dyn Node>)>,
) -> anyhow::Result<Running> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .thread_name("node")
        .enable_all()
        .build()
        .context("tokio runtime")?;
    log::start(&[], environment);
    let mut shifts = [Shift::new(), Shift::new()];
    let mut seen = BTreeSet::new();
    for (setup, _) in &nodes {
        let name = setup.names().fully_qualified();
        if !seen.insert(name.clone()) {
            bail!("node {name} is there twice in this process: names must be unique");
        }
    }
    let inside = runtime.enter();
    let joined = nodes
        .into_iter()
        .map(|(setup, mut node)| {
            node.goes_live();
            let (participant, warning) = Participant::join(environment, setup.names())
                .with_context(|| format!("node {}", setup.names().fully_qualified()))?;
            Ok((setup, node, participant, warning))
        })
        .collect::<anyhow::Result<Vec<_>>>()?;
    drop(inside);
    runtime.block_on(async { tokio::time::sleep(LOOKING_AROUND).await });
    for (setup, _, participant, _) in &joined {
        if participant.namesake() {
            let name = setup.names().fully_qualified();
            bail!(
                "node {name} is already running: stop it, or rename this one with -r __node:=NAME"
            );
        }
    }
    for (setup, node, participant, warning) in joined {
        let name = setup.names().fully_qualified();
        let shift = &mut shifts[usize::from(node.stops_last())];
        let _inside = runtime.enter();
        let owner = assembly::assemble(&setup, node, participant)
            .with_context(|| format!("node {name}"))?;
        let span = tracing::error_span!("node", node = name.as_str());
        span.in_scope(|| {
            for line in warning.into_iter().chain(without_effect(&setup)) {
                tracing::warn!("{line}");
            }
        });
        let stopped = shift.stop.subscribe();
        shift
            .tasks
            .spawn_on(owner.run(stopped).instrument(span), runtime.handle());
    }
    Ok(Running { runtime, shifts })
}

/// What was given to a node and does nothing there.
fn without_effect(setup: &Setup) -> Vec<String> {
    let rules = setup.names().unused_rules().into_iter();
    let rules = rules.map(|rule| {
        format!("remap rule `{rule}` has no effect: the node has no topic, service or action of that name")
    });
    setup.unused_files().into_iter().chain(rules).collect()
}

/// How a node is told to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stop {
    /// Not at all.
    No,
    /// In good order: it may take its patience to wind down.
    InOrder,
    /// At once: it closes what is open and leaves.
    AtOnce,
}

/// Nodes that stop together.
struct Shift {
    stop: watch::Sender<Stop>,
    tasks: JoinSet<()>,
}

impl Shift {
    fn new() -> Self {
        Self {
            stop: watch::Sender::new(Stop::No),
            tasks: JoinSet::new(),
        }
    }
}

/// Between two looks at nodes and signals.
const SIGNAL_PERIOD: Duration = Duration::from_millis(20);

/// Nodes that are on the ROS graph.
pub struct Running {
    runtime: Runtime,
    /// In the order in which they stop: controllers last.
    shifts: [Shift; 2],
}

impl Running {
    /// Runs until an end is asked for, then stops; at once when that is asked for.
    ///
    /// # Errors
    /// When a node ended by a panic or hears no more, and the others have been stopped then; when the end was forced.
    pub fn until(mut self, interruption: &Interruption) -> anyhow::Result<()> {
        let mut ended = None;
        let mut undecoded = log::Undecoded::default();
        while !interruption.wait(SIGNAL_PERIOD) {
            if let Some(news) = undecoded.news() {
                tracing::warn!("{news}");
            }
            ended = self.ended();
            if ended.is_some() {
                break;
            }
        }
        let stopped = self.stop_unless_forced(interruption);
        ended.map_or(stopped, Err)
    }

    /// Why a node has ended although nobody asked it to, or hears no more; `None`: all are at work.
    pub fn ended(&mut self) -> Option<anyhow::Error> {
        if let Some(reason) = log::deafness() {
            return Some(anyhow::anyhow!(reason));
        }
        let mut shifts = self.shifts.iter_mut();
        let ended = shifts.find_map(|shift| shift.tasks.try_join_next())?;
        Some(match ended {
            Ok(()) => anyhow::anyhow!("a node ended"),
            Err(error) => anyhow::Error::new(error).context("a node ended by a panic"),
        })
    }

    /// Asks all nodes to stop and waits until they have, controllers last.
    ///
    /// # Errors
    /// When a node ended by a panic.
    pub fn stop(self) -> anyhow::Result<()> {
        self.stop_unless_forced(&Interruption::never())
    }

    /// The same; nodes that still wind down when an end at once is asked for leave without it.
    ///
    /// # Errors
    /// When a node ended by a panic, or the end was forced.
    pub fn stop_unless_forced(mut self, interruption: &Interruption) -> anyhow::Result<()> {
        let mut outcome = Ok(());
        let mut forced = false;
        for shift in &mut self.shifts {
            let mut told = Stop::InOrder;
            let _ = shift.stop.send(told);
            while !shift.tasks.is_empty() {
                if told == Stop::InOrder && interruption.is_forced() {
                    (told, forced) = (Stop::AtOnce, true);
                    let _ = shift.stop.send(told);
                }
                let next = shift.tasks.join_next();
                let ended = self
                    .runtime
                    .block_on(async { tokio::time::timeout(SIGNAL_PERIOD, next).await });
                if let Ok(Some(Err(error))) = ended {
                    outcome = Err(error);
                }
            }
        }
        outcome.context("a node ended by a panic")?;
        if forced {
            bail!("the end was forced: nodes did not wind down");
        }
        Ok(())
    }
}
