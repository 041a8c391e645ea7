//! Every topic, service and action of Abbe: name, type and quality of service.
//!
//! A name without a slash in front is relative: the machine's namespace is put before it.

use std::marker::PhantomData;

use crate::action::{RunCycle, RunProgram};
use crate::diagnostic_msgs::msg::DiagnosticArray;
use crate::msg::{
    AngleSample, AxisCompensation, AxisState, BlockMeasurement, ClockAnswer, ClockQuestion,
    GapReport, GeometryModel, GridSample, HostClock, LengthSample, MachineValue, PlanStatus,
    PositioningTable, ProbeLatency, ProbeTrigger, ProbedFeature, ProbedPoint, TestSegment,
    ThermalModel, ThermalUpdateRequest,
};
use crate::qos::{Durability, Qos, Reliability};
use crate::rcl_interfaces::msg::{Log, ParameterEvent};
use crate::rosgraph_msgs::msg::Clock;
use crate::sensor_msgs::msg::{JointState, Temperature};
use crate::std_srvs::srv::{SetBool, Trigger};
use crate::tf2_msgs::msg::TFMessage;
use crate::{Action, Description, Message, Service, WireError};

/// Where what a topic carries comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// From outside: what a replay puts in.
    Raw,
    /// From a stage: what a replay computes again and compares.
    Computed,
    /// About the programs themselves: a replay neither puts it in nor compares it.
    Housekeeping,
}

/// A topic that carries messages `M`.
#[derive(Debug)]
pub struct Topic<M: Message> {
    /// Name; relative without a slash in front.
    pub name: &'static str,
    /// Quality of service of either side.
    pub qos: Qos,
    /// Where its messages come from.
    pub origin: Origin,
    message: PhantomData<fn() -> M>,
}

impl<M: Message> Clone for Topic<M> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<M: Message> Copy for Topic<M> {}

impl<M: Message> Topic<M> {
    const fn new(name: &'static str, qos: Qos, origin: Origin) -> Self {
        Self {
            name,
            qos,
            origin,
            message: PhantomData,
        }
    }

    const fn entry(&self) -> Entry {
        Entry {
            name: self.name,
            is_family: false,
            description: M::DESCRIPTION,
            qos: self.qos,
            origin: self.origin,
        }
    }
}

/// Topics that carry messages `M` under one name each, such as one per sensor.
#[derive(Clone, Copy, Debug)]
pub struct TopicFamily<M: Message> {
    /// What stands before each name, with a slash at its end.
    pub base: &'static str,
    /// Quality of service of either side.
    pub qos: Qos,
    /// Where their messages come from.
    pub origin: Origin,
    message: PhantomData<fn() -> M>,
}

impl<M: Message> TopicFamily<M> {
    /// The topic's name for one member.
    ///
    /// # Errors
    /// When `member` is no ROS 2 name: letters, digits and single underscores, no digit in front.
    pub fn of(&self, member: &str) -> Result<String, WireError> {
        let starts_well = member.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
        let holds_only = member
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || c == '_');
        if starts_well && holds_only && !member.contains("__") {
            return Ok(format!("{}{member}", self.base));
        }
        Err(WireError::BadTopicName {
            base: self.base,
            name: member.to_owned(),
        })
    }

    /// The member in a topic's name, without namespace or with any.
    #[must_use]
    pub fn member_of<'a>(&self, topic: &'a str) -> Option<&'a str> {
        let start = topic.rfind(self.base)?;
        let before = &topic[..start];
        let member = &topic[start + self.base.len()..];
        let is_whole = before.is_empty() || before.ends_with('/');
        (is_whole && self.of(member).is_ok()).then_some(member)
    }

    const fn entry(&self) -> Entry {
        Entry {
            name: self.base,
            is_family: true,
            description: M::DESCRIPTION,
            qos: self.qos,
            origin: self.origin,
        }
    }
}

/// A service by its relative name.
#[derive(Clone, Copy, Debug)]
pub struct ServiceName<S: Service> {
    /// Name; relative without a slash in front.
    pub name: &'static str,
    service: PhantomData<fn() -> S>,
}

/// An action by its relative name.
#[derive(Clone, Copy, Debug)]
pub struct ActionName<A: Action> {
    /// Name; relative without a slash in front.
    pub name: &'static str,
    action: PhantomData<fn() -> A>,
}

/// What [`all`] tells of a topic or a family of topics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Name, or what stands before the names of a family.
    pub name: &'static str,
    /// Whether it is a family.
    pub is_family: bool,
    /// Type, hash and schema text.
    pub description: Description,
    /// Quality of service of either side.
    pub qos: Qos,
    /// Where its messages come from.
    pub origin: Origin,
}

macro_rules! topics {
    ($($(#[$doc:meta])* $name:ident: $message:ty = $text:literal, $qos:expr, $origin:ident;)*) => {
        $($(#[$doc])* pub const $name: Topic<$message> = Topic::new($text, $qos, Origin::$origin);)*

        /// Every topic, then every family, in the order of this file.
        #[must_use]
        pub const fn all() -> &'static [Entry] {
            const { &[$($name.entry(),)* TEMPERATURE.entry(), MACHINE.entry()] }
        }
    };
}

topics! {
    /// Positions of all axes at every servo tick.
    AXES_STATE: AxisState = "axes/state", Qos::RELIABLE_DEEP, Raw;
    /// Positions for everybody's tools, at 50 Hz.
    JOINT_STATES: JointState = "joint_states", Qos::SENSOR_DATA, Raw;
    /// Touches as the controller reports them.
    PROBE_TRIGGER: ProbeTrigger = "probe/trigger", Qos::RELIABLE, Raw;
    /// Touches after correction.
    PROBE_POINT: ProbedPoint = "probe/point", Qos::RELIABLE, Computed;
    /// Shapes fitted to corrected touches.
    PROBE_FEATURE: ProbedFeature = "probe/feature", Qos::RELIABLE, Computed;
    /// Latency of the probe signal.
    LATENCY: ProbeLatency = "latency", Qos::LATCHED, Computed;
    /// Corners of the reference blocks.
    BLOCKS_MEASUREMENT: BlockMeasurement = "blocks/measurement", Qos::RELIABLE, Computed;
    /// Drift since the cold reference.
    THERMAL_MODEL: ThermalModel = "thermal/model", Qos::LATCHED, Computed;
    /// Asks for a block cycle.
    THERMAL_UPDATE_REQUEST: ThermalUpdateRequest = "thermal/update_request", Qos::RELIABLE, Computed;
    /// Readings of the grid encoder.
    GRID_POSITION: GridSample = "grid/position", Qos::RELIABLE_DEEP, Raw;
    /// Readings of the length reference.
    LENGTH_POSITION: LengthSample = "length/position", Qos::RELIABLE_DEEP, Raw;
    /// Readings of the angular reference of a rotary axis.
    ANGLE_POSITION: AngleSample = "angle/position", Qos::RELIABLE_DEEP, Raw;
    /// Geometric errors of the linear axes.
    GEOMETRY_MODEL: GeometryModel = "geometry/model", Qos::LATCHED, Computed;
    /// Geometric errors of the rotary axes.
    GEOMETRY_ROTARY: GeometryModel = "geometry/rotary", Qos::LATCHED, Computed;
    /// Positioning deviations, one message per axis.
    POSITIONING_TABLE: PositioningTable = "positioning/table", POSITIONING_QOS, Computed;
    /// Offsets added to the commands, at every servo tick.
    COMPENSATION: AxisCompensation = "compensation", Qos::RELIABLE_DEEP, Computed;
    /// Where simulator and machine differ.
    GAP_REPORT: GapReport = "gap/report", Qos::LATCHED, Housekeeping;
    /// Begin and end of tests.
    TEST_SEGMENT: TestSegment = "test/segment", Qos::RELIABLE, Raw;
    /// A host asks what time it is; best effort, for a question that is sent again tells nothing.
    CLOCK_QUESTION: ClockQuestion = "host_clock/question", CLOCK_QOS, Housekeeping;
    /// The answer of the reference.
    CLOCK_ANSWER: ClockAnswer = "host_clock/answer", CLOCK_QOS, Raw;
    /// How a host's clock stands to the reference's.
    HOST_CLOCK: HostClock = "host_clock/map", Qos::LATCHED, Computed;
    /// What the sequencer is doing.
    PLAN_STATUS: PlanStatus = "sequencer/status", Qos::LATCHED, Housekeeping;
    /// Health of the nodes.
    DIAGNOSTICS: DiagnosticArray = "/diagnostics", Qos::RELIABLE, Housekeeping;
    /// Log lines; ROS 2's own profile without its lifespan.
    ROSOUT: Log = "/rosout", Qos { depth: 1000, ..Qos::LATCHED }, Housekeeping;
    /// Simulated time; best effort as ROS 2's own publishers and subscriptions.
    CLOCK: Clock = "/clock", CLOCK_QOS, Housekeeping;
    /// Moving frames.
    TF: TFMessage = "tf", Qos::RELIABLE, Housekeeping;
    /// Fixed frames.
    TF_STATIC: TFMessage = "tf_static", Qos::LATCHED, Housekeeping;
    /// Changes of parameters; ROS 2's own profile.
    PARAMETER_EVENTS: ParameterEvent = "/parameter_events", PARAMETER_EVENTS_QOS, Housekeeping;
}

const CLOCK_QOS: Qos = Qos {
    reliability: Reliability::BestEffort,
    durability: Durability::Volatile,
    depth: 10,
};

/// A late joiner gets the latest of each of six axes.
const POSITIONING_QOS: Qos = Qos {
    depth: 6,
    ..Qos::LATCHED
};

const PARAMETER_EVENTS_QOS: Qos = Qos {
    depth: 1000,
    ..Qos::RELIABLE
};

/// Temperatures, one topic per sensor.
pub const TEMPERATURE: TopicFamily<Temperature> = TopicFamily {
    base: "temperature/",
    qos: Qos::SENSOR_DATA,
    origin: Origin::Raw,
    message: PhantomData,
};

/// What a machine reports of itself, one topic per value.
pub const MACHINE: TopicFamily<MachineValue> = TopicFamily {
    base: "machine/",
    qos: Qos::RELIABLE_DEEP,
    origin: Origin::Raw,
    message: PhantomData,
};

/// Switches the compensation on or off.
pub const SET_COMPENSATION: ServiceName<SetBool> = ServiceName {
    name: "axis_compensation/enable",
    service: PhantomData,
};

/// Holds the program that a control runs: its axes come to rest.
pub const PAUSE_PROGRAM: ServiceName<Trigger> = ServiceName {
    name: "cnc/pause",
    service: PhantomData,
};

/// Lets a program that waits go on.
pub const RESUME_PROGRAM: ServiceName<Trigger> = ServiceName {
    name: "cnc/resume",
    service: PhantomData,
};

/// Lets a program that waits go on for one block.
pub const STEP_PROGRAM: ServiceName<Trigger> = ServiceName {
    name: "cnc/step",
    service: PhantomData,
};

/// Homes every axis of a control anew, once no compensation is in effect.
pub const HOME: ServiceName<Trigger> = ServiceName {
    name: "cnc/home",
    service: PhantomData,
};

/// Lets a bag that is played stand.
pub const PAUSE_PLAYING: ServiceName<Trigger> = ServiceName {
    name: "replayer/pause",
    service: PhantomData,
};

/// Lets it go on.
pub const RESUME_PLAYING: ServiceName<Trigger> = ServiceName {
    name: "replayer/resume",
    service: PhantomData,
};

/// Sends its next message while it stands.
pub const STEP_PLAYING: ServiceName<Trigger> = ServiceName {
    name: "replayer/step",
    service: PhantomData,
};

/// Writes what a recorder keeps in memory into a bag.
pub const SAVE_RECORDING: ServiceName<Trigger> = ServiceName {
    name: "recorder/save",
    service: PhantomData,
};

/// Runs a program on the controller.
pub const RUN_PROGRAM: ActionName<RunProgram> = ActionName {
    name: "cnc/run_program",
    action: PhantomData,
};

/// Runs a measuring cycle.
pub const RUN_CYCLE: ActionName<RunCycle> = ActionName {
    name: "sequencer/run_cycle",
    action: PhantomData,
};
