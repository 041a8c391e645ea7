//! What the nodes tell each other, in millimetres: the inner form of each message.
//!
//! `abbe_msgs` holds the wire form (SI) of each and the only conversion between the two.

mod block;
mod clock;
mod compensation;
mod cycle;
mod feature;
mod frame;
mod gap;
mod geometry;
mod joint;
mod motion;
mod plan;
mod positioning;
mod report;
mod segment;
mod sensor;
mod thermal;
mod touch;

pub use block::{BlockMeasurement, FacePosition, LatencyShare};
pub use clock::{ClockAnswer, ClockExchange, ClockQuestion, HostClock};
pub use compensation::{AxisCompensation, CompensationState};
pub use cycle::{CycleKind, CycleOrder};
pub use feature::{FeatureKind, ProbedFeature};
pub use frame::FrameTransform;
pub use gap::{GapCause, GapParameter, GapStatus, GapSummary};
pub use geometry::{CurveForm, ErrorCurve, EstimableCombination, GeometryModel};
pub use joint::JointSample;
pub use motion::AxisState;
pub use plan::{PlanState, PlanStatus};
pub use positioning::PositioningTable;
pub use report::{MachineValue, Quantity, Verdict};
pub use segment::{Sense, TestKind, TestPlane, TestSegment};
pub use sensor::{
    AngleSample, FARTHEST_FROM_NOMINAL, GridSample, LATE_S, LengthSample, TemperatureSample,
};
pub use thermal::{AxisDrift, DriftGrowth, ThermalModel, UpdateReason, UpdateRequest};
pub use touch::{
    Correction, LatencyMethod, NewTouches, ProbeLatency, ProbeTrigger, ProbedPoint, Rejection,
};
