//! Log lines to the console and to `/rosout`, from `tracing`.
//!
//! A node's owner runs inside a span that carries its name; a line logged there goes out through that
//! node's `/rosout` writer. Lines of RustDDS, ros2-client and Zenoh reach the console only, and only errors:
//! at `warn` they flood.
//!
//! One filter stands before both. A node for which a level was chosen (`--log-level NAME:=LEVEL`, or
//! its service) has that one for its lines; all else goes by the program's. A node that was told
//! `--disable-stdout-logs` or `--disable-rosout-logs` is silent there.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::fmt::{Debug, Write as _};
use std::io::IsTerminal as _;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use abbe_msgs::rcl_interfaces::msg::Log;
use abbe_msgs::to_cdr;
use metrology::visible::visible;
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::fmt::format::{self, Format};
use tracing_subscriber::fmt::{self, FmtContext, FormatEvent, FormatFields};
use tracing_subscriber::layer::{Context, SubscriberExt as _};
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::util::SubscriberInitExt as _;
use tracing_subscriber::{EnvFilter, Layer};

use crate::arguments::Arguments;
use crate::clock::{self, Clock};
use crate::environment::Environment;
use crate::network::Writer;

mod deaf;
mod levels;
mod shown;
mod undecoded;

pub use deaf::deafness;
use levels::Levels;
pub(crate) use levels::Severity;
pub use undecoded::Undecoded;

/// A node as the speaker of its log lines.
#[derive(Clone)]
struct Speaker {
    name: String,
    /// None: its lines are not wanted on `/rosout`.
    writer: Option<Weak<Writer>>,
    /// The node's time, as `rclcpp` stamps its lines with.
    clock: Clock,
    /// From where on its lines are said, where that was chosen.
    chosen: Option<Severity>,
    is_on_console: bool,
}

/// How a node's lines are said.
pub(crate) struct Speech<'a> {
    /// The node's full name.
    pub node: &'a str,
    /// They go out there as long as it lives.
    pub rosout: Option<&'a Arc<Writer>>,
    /// What they are stamped by.
    pub clock: &'a Clock,
    /// From where on they are said, where that was chosen.
    pub chosen: Option<Severity>,
    /// Whether they are for the console too.
    pub is_on_console: bool,
}

/// Speakers by the spans of their nodes; a span is unique where a name need not be.
static ROSOUT: Mutex<BTreeMap<u64, Speaker>> = Mutex::new(BTreeMap::new());

thread_local! {
    /// Whether this thread is in the middle of a line: what RustDDS logs of it is no line of the node.
    static IS_SPEAKING: Cell<bool> = const { Cell::new(false) };
}

fn speakers() -> MutexGuard<'static, BTreeMap<u64, Speaker>> {
    ROSOUT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What the logger of a node is called.
pub(crate) fn logger(node: &str) -> String {
    node.trim_start_matches('/').replace('/', ".")
}

/// Lets what is logged in the present span out as told.
pub(crate) fn open(speech: &Speech<'_>) {
    if let Some(id) = tracing::Span::current().id() {
        let speaker = Speaker {
            name: logger(speech.node),
            chosen: speech.chosen,
            writer: speech.rosout.map(Arc::downgrade),
            clock: speech.clock.clone(),
            is_on_console: speech.is_on_console,
        };
        speakers().insert(id.into_u64(), speaker);
        levels::changed();
    }
}

/// Ends that.
pub(crate) fn close() {
    if let Some(id) = tracing::Span::current().id() {
        speakers().remove(&id.into_u64());
        levels::changed();
    }
}

/// Chooses from where on the lines of the present span's node are said; `None`: as the program's.
/// Whether there is such a node in this program's log.
pub(crate) fn choose(severity: Option<Severity>) -> bool {
    let Some(id) = tracing::Span::current().id() else {
        return false;
    };
    let is_there = match speakers().get_mut(&id.into_u64()) {
        Some(speaker) => {
            speaker.chosen = severity;
            true
        }
        None => false,
    };
    levels::changed();
    is_there
}

/// What was chosen for the present span's node.
pub(crate) fn chosen() -> Option<Severity> {
    let id = tracing::Span::current().id()?;
    speakers().get(&id.into_u64())?.chosen
}

/// Starts logging for the process, unless the program has its own already.
pub(crate) fn start(arguments: &[&Arguments], environment: &Environment) {
    let mut levels = arguments.iter().flat_map(|arguments| &arguments.log_levels);
    let level =
        levels
            .rfind(|(logger, _)| logger.is_none())
            .map_or("info", |(_, level)| match level.as_str() {
                "fatal" => "off",
                level => level,
            });
    // RustDDS complains of multicast groups when it leaves a loopback that has none.
    // And, once a clock was set back, of each sample of best effort: that is a condition of the node's.
    // And, when a node ends, of every end that its busy event loop is not told of: the participant is gone a moment later.
    let silent = "rustdds::network::udp_listener=off,rustdds::structure::dds_cache=off,rustdds::dds::pubsub=off";
    // The OPC UA client calls it an error that a connection without security has no certificate; what ends a connection is a
    // condition of the bridge.
    let opcua = "opcua_client=off,opcua_core=off,opcua_crypto=off";
    // Reading CDR it warns of every text that lacks its end, of every message: the node reports what becomes of such a message.
    let quiet =
        format!("rustdds=error,{silent},ros2_client=error,cdr_encoding=error,zenoh=error,{opcua}");
    let default = format!("{level},{quiet}");
    let filter = environment
        .log_filter
        .as_deref()
        .and_then(|directives| EnvFilter::try_new(deaf::heard(directives)).ok())
        .unwrap_or_else(|| EnvFilter::new(default));
    // Before its node speaks the lines of a program are those of all its nodes.
    let mut outputs = arguments.iter().map(|arguments| arguments.log_outputs);
    let is_wanted = arguments.is_empty() || outputs.any(|outputs| outputs.stdout);
    let console = fmt::layer()
        .with_writer(|| shown::Shown(std::io::stderr()))
        .with_ansi(std::io::stderr().is_terminal())
        .event_format(Console {
            is_wanted,
            // Where DDS is secured it complains of every message of whoever is not; what cannot be decrypted is counted.
            has_strangers: environment.security.is_none() || environment.log_filter.is_some(),
            line: fmt::format().with_target(false),
        });
    // A program that composes nodes may have a subscriber of its own: its lines are its affair then.
    let _ = tracing_subscriber::registry()
        .with(Levels::above(filter))
        .with(deaf::LastWords::of_process())
        .with(undecoded::Count::of_process())
        .with(console)
        .with(Rosout)
        .try_init();
}

/// Lines on the console, but those of nodes that are silent there.
struct Console {
    /// Whether any line is wanted there.
    is_wanted: bool,
    /// Whether the library's lines about strangers' messages are wanted.
    has_strangers: bool,
    line: Format,
}

impl<S, N> FormatEvent<S, N> for Console
where
    S: Subscriber + for<'lookup> LookupSpan<'lookup>,
    N: for<'writer> FormatFields<'writer> + 'static,
{
    fn format_event(
        &self,
        context: &FmtContext<'_, S, N>,
        writer: format::Writer<'_>,
        event: &Event<'_>,
    ) -> std::fmt::Result {
        let mut spans = context.event_scope().into_iter().flatten();
        let is_silent = spans.any(|span| {
            let id = span.id().into_u64();
            let speakers = speakers();
            speakers.get(&id).is_some_and(|node| !node.is_on_console)
        });
        let is_silent = is_silent || (!self.has_strangers && undecoded::is_of_strangers(event));
        if !self.is_wanted || is_silent {
            return Ok(());
        }
        self.line.format_event(context, writer, event)
    }
}

struct Rosout;

#[derive(Default)]
struct Fields {
    message: String,
    others: String,
}

impl Visit for Fields {
    fn record_str(&mut self, field: &Field, value: &str) {
        match field.name() {
            "message" => value.clone_into(&mut self.message),
            name => {
                let _ = write!(self.others, " {name}={value}");
            }
        }
    }

    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        self.record_str(field, &format!("{value:?}"));
    }
}

impl<S> Layer<S> for Rosout
where
    S: Subscriber + for<'lookup> LookupSpan<'lookup>,
{
    fn on_event(&self, event: &Event<'_>, context: Context<'_, S>) {
        let speaker = context.event_scope(event).and_then(|scope| {
            let speakers = speakers();
            scope
                .into_iter()
                .find_map(|span| speakers.get(&span.id().into_u64()).cloned())
        });
        let Some(speaker) = speaker else {
            return;
        };
        let Some(writer) = speaker.writer.and_then(|writer| writer.upgrade()) else {
            return;
        };
        if IS_SPEAKING.replace(true) {
            return;
        }
        let mut fields = Fields::default();
        event.record(&mut fields);
        let metadata = event.metadata();
        let message = Log {
            stamp: clock::ros_time(speaker.clock.now()),
            level: severity(*metadata.level()),
            name: speaker.name,
            msg: visible(&(fields.message + &fields.others)).into_owned(),
            file: metadata.file().unwrap_or_default().to_owned(),
            function: String::new(),
            line: metadata.line().unwrap_or(0),
        };
        // A line that finds no room is on the console all the same.
        let _ = writer.publish(&Arc::from(to_cdr(&message)), None);
        IS_SPEAKING.set(false);
    }
}

const fn severity(level: Level) -> u8 {
    match level {
        Level::TRACE | Level::DEBUG => Log::DEBUG,
        Level::INFO => Log::INFO,
        Level::WARN => Log::WARN,
        Level::ERROR => Log::ERROR,
    }
}
