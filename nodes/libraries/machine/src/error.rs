//! What can be wrong with a machine file, a chain, an orientation or the plan of a touching cycle.

use metrology::Axis;
use metrology::number::{number, quantity, unit_of};
use metrology::yaml::YamlError;

use crate::chain::ChainError;
use crate::poses::PoseError;

/// A machine file that is not a machine.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MachineFileError {
    /// The text is not a machine file; the reason names the key.
    #[error("{source_name}:{source}")]
    Syntax {
        /// File name as the caller gave it.
        source_name: String,
        /// Line, column, key and what belongs there.
        source: YamlError,
    },
    /// A number outside its physical range.
    #[error("{source_name}: {key} = {value}: {rule}", value = quantity(key, *value))]
    Number {
        /// File name, with the place in it where that is known.
        source_name: String,
        /// Path of the key.
        key: String,
        /// Its value, in the unit of the key.
        value: f64,
        /// What holds for it.
        rule: &'static str,
    },
    /// A number or a list out of its bound.
    #[error("{source_name}: {source}")]
    Bound {
        /// File name.
        source_name: String,
        /// Key, value and bound.
        #[source]
        source: metrology::BoundError,
    },
    /// A pair of limits in the wrong order.
    #[error(
        "{source_name}: {key} = [{least}, {greatest}]{unit}: the first must be below the second",
        least = number(*least), greatest = number(*greatest), unit = in_unit(key)
    )]
    Order {
        /// File name.
        source_name: String,
        /// Path of the key.
        key: String,
        /// First value.
        least: f64,
        /// Second value.
        greatest: f64,
    },
    /// A name that breaks a rule or refers to nothing.
    #[error("{source_name}: {key} = \"{name}\": {rule}")]
    Name {
        /// File name.
        source_name: String,
        /// Path of the key.
        key: String,
        /// The name.
        name: String,
        /// What holds for it.
        rule: &'static str,
    },
    /// The chain cannot be read.
    #[error("{source_name}: chain: {error}")]
    Chain {
        /// File name.
        source_name: String,
        /// Where and why.
        #[source]
        error: ChainError,
    },
    /// Chain and axes disagree.
    #[error("{source_name}: axes.{axis}: {rule}")]
    Axis {
        /// File name.
        source_name: String,
        /// The axis.
        axis: Axis,
        /// What holds for it.
        rule: &'static str,
    },
}

fn in_unit(key: &str) -> String {
    unit_of(key).map_or_else(String::new, |unit| format!(" {unit}"))
}

impl MachineFileError {
    /// Path of the key that breaks a rule.
    #[must_use]
    pub fn key(&self) -> String {
        match self {
            Self::Syntax { source, .. } => source.key.clone(),
            Self::Number { key, .. } | Self::Order { key, .. } | Self::Name { key, .. } => {
                key.clone()
            }
            Self::Chain { .. } => "chain".to_owned(),
            Self::Axis { axis, .. } => format!("axes.{axis}"),
            Self::Bound { source, .. } => source.place().to_owned(),
        }
    }

    /// The same with another name of its file, which has the place in it.
    pub(crate) fn placed(mut self, place: &str) -> Self {
        match &mut self {
            Self::Syntax { source_name, .. }
            | Self::Number { source_name, .. }
            | Self::Order { source_name, .. }
            | Self::Name { source_name, .. }
            | Self::Chain { source_name, .. }
            | Self::Axis { source_name, .. }
            | Self::Bound { source_name, .. } => place.clone_into(source_name),
        }
        self
    }
}

/// A touching cycle that cannot or must not be run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CycleError {
    /// No block or artefact has this id.
    #[error("feature \"{feature}\": the machine file has no {wanted} of this name")]
    UnknownFeature {
        /// The name.
        feature: String,
        /// What was looked for.
        wanted: &'static str,
    },
    /// The machine file has nothing of the kind.
    #[error("the machine file has no {wanted}, so there is nothing to touch")]
    NothingToTouch {
        /// What was looked for.
        wanted: &'static str,
    },
    /// A move would leave the travel.
    #[error(
        "feature \"{feature}\": axis {axis} would go to {} {unit}, its travel is from {} to {} {unit}",
        number(*position), number(*least), number(*greatest), unit = unit_of_axis(*axis)
    )]
    OutsideTravel {
        /// What was to be touched.
        feature: String,
        /// The axis.
        axis: Axis,
        /// Where it would go, mm or deg.
        position: f64,
        /// Least position.
        least: f64,
        /// Greatest position.
        greatest: f64,
    },
    /// The machine lacks a linear axis.
    #[error("axis {axis} is not in the machine file; touching needs X, Y and Z")]
    AxisMissing {
        /// The axis.
        axis: Axis,
    },
    /// The stand-off does not suffice to reach the feed.
    #[error(
        "feature \"{feature}\": feed {feed_mm_min} mm/min needs a stand-off of {needed_mm:.3} mm (acceleration {acceleration_mm_s2} mm/s2), probe.standoff_mm is {standoff_mm}", feed_mm_min = number(*feed_mm_min), standoff_mm = number(*standoff_mm), acceleration_mm_s2 = number(*acceleration_mm_s2))]
    StandoffTooShort {
        /// What was to be touched.
        feature: String,
        /// Feed, mm/min.
        feed_mm_min: f64,
        /// What there is, mm.
        standoff_mm: f64,
        /// What is needed, mm.
        needed_mm: f64,
        /// Acceleration along the approach, mm/s².
        acceleration_mm_s2: f64,
    },
    /// The controller would brake for the end of the move before it touches.
    #[error(
        "feature \"{feature}\": feed {feed_mm_min} mm/min needs an overtravel of {needed_mm:.3} mm to be held at contact (acceleration {acceleration_mm_s2} mm/s2), probe.overtravel_mm is {overtravel_mm}", feed_mm_min = number(*feed_mm_min), overtravel_mm = number(*overtravel_mm), acceleration_mm_s2 = number(*acceleration_mm_s2))]
    OvertravelTooShort {
        /// What was to be touched.
        feature: String,
        /// Feed, mm/min.
        feed_mm_min: f64,
        /// What there is, mm.
        overtravel_mm: f64,
        /// What is needed, mm.
        needed_mm: f64,
        /// Acceleration along the approach, mm/s².
        acceleration_mm_s2: f64,
    },
    /// A feed that is no feed.
    #[error("feeds[{index}] = {feed_mm_min} mm/min: must be a finite number above 0", feed_mm_min = number(*feed_mm_min))]
    FeedNotPositive {
        /// Place in the list.
        index: usize,
        /// Feed, mm/min.
        feed_mm_min: f64,
    },
    /// A feed above an axis' limit.
    #[error("feed {feed_mm_min} mm/min exceeds the limit of axis {axis}, {limit_mm_min} mm/min", feed_mm_min = number(*feed_mm_min), limit_mm_min = number(*limit_mm_min))]
    FeedAboveLimit {
        /// Feed, mm/min.
        feed_mm_min: f64,
        /// The axis.
        axis: Axis,
        /// Its limit, mm/min.
        limit_mm_min: f64,
    },
    /// One feed tells nothing about latency.
    #[error("{n} feeds were given: latency needs at least {least} different feeds")]
    TooFewFeeds {
        /// How many.
        n: usize,
        /// How many are needed.
        least: usize,
    },
    /// Two feeds are the same.
    #[error(
        "feeds[{first}] and feeds[{second}] are both {feed_mm_min} mm/min: latency needs different feeds", feed_mm_min = number(*feed_mm_min))]
    EqualFeeds {
        /// Place of the first.
        first: usize,
        /// Place of the second.
        second: usize,
        /// Feed, mm/min.
        feed_mm_min: f64,
    },
    /// A vertical stylus cannot touch from below.
    #[error("feature \"{feature}\": it would be touched upwards, a vertical stylus cannot")]
    ApproachFromBelow {
        /// What was to be touched.
        feature: String,
    },
    /// The ball does not fit with room to move.
    #[error(
        "feature \"{feature}\": radius {radius_mm} mm leaves {room_mm:.3} mm of room to a ball of radius {ball_radius_mm} mm, a stand-off of {standoff_mm} mm needs more than half of that", radius_mm = number(*radius_mm), ball_radius_mm = number(*ball_radius_mm), standoff_mm = number(*standoff_mm))]
    BoreTooSmall {
        /// The bore.
        feature: String,
        /// Its radius, mm.
        radius_mm: f64,
        /// Radius of the stylus ball, mm.
        ball_radius_mm: f64,
        /// Distance the ball can move from the centre, mm.
        room_mm: f64,
        /// Stand-off of the machine file, mm.
        standoff_mm: f64,
    },
    /// Too few points for the shape.
    #[error("{points} points were asked for: a {shape} needs at least {least}")]
    TooFewPoints {
        /// Which shape.
        shape: &'static str,
        /// How many were asked for.
        points: u32,
        /// How many are needed.
        least: u32,
    },
    /// A plane whose normal is not along an axis.
    #[error(
        "feature \"{feature}\": normal [{x}, {y}, {z}] is not along one axis; a plane cycle probes along one axis", x = number(*x), y = number(*y), z = number(*z))]
    NormalNotAlongAxis {
        /// The plane.
        feature: String,
        /// Normal, X.
        x: f64,
        /// Normal, Y.
        y: f64,
        /// Normal, Z.
        z: f64,
    },
    /// Rotary poses that cannot be used.
    #[error("{source}")]
    Pose {
        /// Which and why.
        source: PoseError,
    },
    /// A sphere that cannot be touched all round at a pose.
    #[error("poses[{index}] ({} deg): {reason}", in_words(pose))]
    PoseUnreachable {
        /// Place in the list.
        index: usize,
        /// Positions of the rotary axes, deg.
        pose: Vec<(Axis, f64)>,
        /// Why.
        reason: &'static str,
    },
    /// A direction of the probe's axis that the machine cannot take.
    #[error("probe_axes[{index}]: {source}")]
    ProbeAxis {
        /// Place in the list.
        index: usize,
        /// Why.
        source: OrientationError,
    },
    /// A sphere that cannot be touched along a direction of the probe's axis.
    #[error("probe_axes[{index}] ({} deg): {reason}", in_words(pose))]
    ProbeAxisUnreachable {
        /// Place in the list.
        index: usize,
        /// Positions of the rotary axes, deg.
        pose: Vec<(Axis, f64)>,
        /// Why.
        reason: &'static str,
    },
    /// A turn that would swing a feature into the tool.
    #[error(
        "feature \"{feature}\": turning would lift it to {highest_mm:.1} mm, the tool waits at {lowest_mm:.1} mm"
    )]
    SwingsIntoTool {
        /// The feature.
        feature: String,
        /// Its highest point during the turn, machine frame, mm.
        highest_mm: f64,
        /// Where the ball's lowest point is then, less a clearance, mm.
        lowest_mm: f64,
    },
}

const fn unit_of_axis(axis: Axis) -> &'static str {
    if axis.is_linear() { "mm" } else { "deg" }
}

/// Rotary positions in degrees, for a message.
fn in_words(pose: &[(Axis, f64)]) -> String {
    let words: Vec<String> = pose
        .iter()
        .map(|(axis, position_deg)| format!("{axis} {position_deg:.3}"))
        .collect();
    words.join(", ")
}

/// A probe axis that cannot be reached.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OrientationError {
    /// The chain cannot be read.
    #[error("chain: {error}")]
    Chain {
        /// Where and why.
        #[source]
        error: ChainError,
    },
    /// The rotary axes are not C, then A, from workpiece to tool.
    #[error("chain {chain}: probe angles are solved for C between the workpiece and A, without B")]
    OtherForm {
        /// The chain.
        chain: String,
    },
    /// A rotary axis is not described.
    #[error("axis {axis} stands in the chain but is not described")]
    AxisMissing {
        /// The axis.
        axis: Axis,
    },
    /// A component or a position is not a finite number.
    #[error("probe axis or present position is not finite")]
    NotFinite,
    /// The vector has no direction.
    #[error("probe axis of length {length} has no direction; give a vector from the ball to the spindle", length = number(*length))]
    NoDirection {
        /// Its length.
        length: f64,
    },
    /// Both solutions lie outside the travel.
    #[error(
        "no solution inside the travel: A = {a_deg:.3} deg or its opposite, travel of A [{:.3}, {:.3}] deg, of C [{:.3}, {:.3}] deg",
        .travel_a_deg[0], .travel_a_deg[1], .travel_c_deg[0], .travel_c_deg[1]
    )]
    OutsideTravel {
        /// Position of A in the first solution, deg.
        a_deg: f64,
        /// Travel of A, deg.
        travel_a_deg: [f64; 2],
        /// Travel of C, deg.
        travel_c_deg: [f64; 2],
    },
}
