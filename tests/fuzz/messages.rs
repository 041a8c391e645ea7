//! Bytes as messages of every type of the wire, and what becomes of them inside.

use abbe_msgs::{Message, Wire, from_cdr, msg, to_cdr};

/// A type's name and what is done with bytes of it.
pub type Decoder = (&'static str, fn(&[u8]));

macro_rules! decoders {
    ($($message:ty),* $(,)?) => {
        /// Every message of the interface package and of ROS 2's own that is used.
        pub const MESSAGES: &[Decoder] = &[$((<$message as Message>::TYPE_NAME, outer::<$message>)),*];
    };
}

macro_rules! with_inner {
    ($($message:ty),* $(,)?) => {
        /// Those that have an inner form.
        pub const INNER: &[Decoder] = &[$((<$message as Message>::TYPE_NAME, inner::<$message>)),*];
    };
}

/// What is read is written again and read again as the same bytes.
fn outer<M: Message>(bytes: &[u8]) {
    if let Ok(message) = from_cdr::<M>(bytes) {
        let written = to_cdr(&message);
        let again = from_cdr::<M>(&written).expect("what was written is read");
        assert_eq!(to_cdr(&again), written, "{}", M::TYPE_NAME);
    }
}

/// What has an inner form has it again after it was on the wire.
fn inner<M: Wire>(bytes: &[u8]) {
    if let Ok(inner) = from_cdr::<M>(bytes).and_then(Wire::into_inner) {
        // A value at the edge of its range may leave it by rounding; then it is refused, and that is all.
        let _ = M::as_received(&inner);
    }
}

decoders![
    abbe_msgs::action::RunCycleFeedback,
    abbe_msgs::action::RunCycleGoal,
    abbe_msgs::action::RunCycleResult,
    abbe_msgs::action::RunProgramFeedback,
    abbe_msgs::action::RunProgramGoal,
    abbe_msgs::action::RunProgramResult,
    abbe_msgs::msg::AngleSample,
    abbe_msgs::msg::AxisCompensation,
    abbe_msgs::msg::AxisDrift,
    abbe_msgs::msg::AxisState,
    abbe_msgs::msg::BlockMeasurement,
    abbe_msgs::msg::ClockAnswer,
    abbe_msgs::msg::ClockQuestion,
    abbe_msgs::msg::DriftGrowth,
    abbe_msgs::msg::ErrorCurve,
    abbe_msgs::msg::EstimableCombination,
    abbe_msgs::msg::GapCause,
    abbe_msgs::msg::GapParameter,
    abbe_msgs::msg::GapReport,
    abbe_msgs::msg::GeometryModel,
    abbe_msgs::msg::GridSample,
    abbe_msgs::msg::HostClock,
    abbe_msgs::msg::LengthSample,
    abbe_msgs::msg::MachineValue,
    abbe_msgs::msg::PlanStatus,
    abbe_msgs::msg::PositioningTable,
    abbe_msgs::msg::ProbeLatency,
    abbe_msgs::msg::ProbeTrigger,
    abbe_msgs::msg::ProbedFeature,
    abbe_msgs::msg::ProbedPoint,
    abbe_msgs::msg::TestSegment,
    abbe_msgs::msg::ThermalModel,
    abbe_msgs::msg::ThermalUpdateRequest,
    abbe_msgs::action_msgs::msg::GoalInfo,
    abbe_msgs::action_msgs::msg::GoalStatus,
    abbe_msgs::action_msgs::msg::GoalStatusArray,
    abbe_msgs::action_msgs::srv::CancelGoalRequest,
    abbe_msgs::action_msgs::srv::CancelGoalResponse,
    abbe_msgs::builtin_interfaces::msg::Duration,
    abbe_msgs::builtin_interfaces::msg::Time,
    abbe_msgs::diagnostic_msgs::msg::DiagnosticArray,
    abbe_msgs::diagnostic_msgs::msg::DiagnosticStatus,
    abbe_msgs::diagnostic_msgs::msg::KeyValue,
    abbe_msgs::geometry_msgs::msg::Point,
    abbe_msgs::geometry_msgs::msg::PointStamped,
    abbe_msgs::geometry_msgs::msg::Pose,
    abbe_msgs::geometry_msgs::msg::PoseStamped,
    abbe_msgs::geometry_msgs::msg::PoseWithCovariance,
    abbe_msgs::geometry_msgs::msg::Quaternion,
    abbe_msgs::geometry_msgs::msg::Transform,
    abbe_msgs::geometry_msgs::msg::TransformStamped,
    abbe_msgs::geometry_msgs::msg::Vector3,
    abbe_msgs::lifecycle_msgs::msg::State,
    abbe_msgs::lifecycle_msgs::msg::Transition,
    abbe_msgs::lifecycle_msgs::msg::TransitionDescription,
    abbe_msgs::lifecycle_msgs::msg::TransitionEvent,
    abbe_msgs::lyrical::lifecycle_msgs::msg::TransitionEvent,
    abbe_msgs::lifecycle_msgs::srv::ChangeStateRequest,
    abbe_msgs::lifecycle_msgs::srv::ChangeStateResponse,
    abbe_msgs::lifecycle_msgs::srv::GetAvailableStatesRequest,
    abbe_msgs::lifecycle_msgs::srv::GetAvailableStatesResponse,
    abbe_msgs::lifecycle_msgs::srv::GetAvailableTransitionsRequest,
    abbe_msgs::lifecycle_msgs::srv::GetAvailableTransitionsResponse,
    abbe_msgs::lifecycle_msgs::srv::GetStateRequest,
    abbe_msgs::lifecycle_msgs::srv::GetStateResponse,
    abbe_msgs::rcl_interfaces::msg::FloatingPointRange,
    abbe_msgs::rcl_interfaces::msg::IntegerRange,
    abbe_msgs::rcl_interfaces::msg::ListParametersResult,
    abbe_msgs::rcl_interfaces::msg::Log,
    abbe_msgs::rcl_interfaces::msg::LoggerLevel,
    abbe_msgs::rcl_interfaces::msg::Parameter,
    abbe_msgs::rcl_interfaces::msg::ParameterDescriptor,
    abbe_msgs::rcl_interfaces::msg::ParameterEvent,
    abbe_msgs::rcl_interfaces::msg::ParameterEventDescriptors,
    abbe_msgs::rcl_interfaces::msg::ParameterType,
    abbe_msgs::rcl_interfaces::msg::ParameterValue,
    abbe_msgs::rcl_interfaces::msg::SetLoggerLevelsResult,
    abbe_msgs::rcl_interfaces::msg::SetParametersResult,
    abbe_msgs::rcl_interfaces::srv::DescribeParametersRequest,
    abbe_msgs::rcl_interfaces::srv::DescribeParametersResponse,
    abbe_msgs::rcl_interfaces::srv::GetLoggerLevelsRequest,
    abbe_msgs::rcl_interfaces::srv::GetLoggerLevelsResponse,
    abbe_msgs::rcl_interfaces::srv::GetParameterTypesRequest,
    abbe_msgs::rcl_interfaces::srv::GetParameterTypesResponse,
    abbe_msgs::rcl_interfaces::srv::GetParametersRequest,
    abbe_msgs::rcl_interfaces::srv::GetParametersResponse,
    abbe_msgs::rcl_interfaces::srv::ListParametersRequest,
    abbe_msgs::rcl_interfaces::srv::ListParametersResponse,
    abbe_msgs::rcl_interfaces::srv::SetLoggerLevelsRequest,
    abbe_msgs::rcl_interfaces::srv::SetLoggerLevelsResponse,
    abbe_msgs::rcl_interfaces::srv::SetParametersAtomicallyRequest,
    abbe_msgs::rcl_interfaces::srv::SetParametersAtomicallyResponse,
    abbe_msgs::rcl_interfaces::srv::SetParametersRequest,
    abbe_msgs::rcl_interfaces::srv::SetParametersResponse,
    abbe_msgs::rosgraph_msgs::msg::Clock,
    abbe_msgs::sensor_msgs::msg::JointState,
    abbe_msgs::sensor_msgs::msg::Temperature,
    abbe_msgs::service_msgs::msg::ServiceEventInfo,
    abbe_msgs::std_msgs::msg::Bool,
    abbe_msgs::std_msgs::msg::Empty,
    abbe_msgs::std_msgs::msg::Float64,
    abbe_msgs::std_msgs::msg::Header,
    abbe_msgs::std_msgs::msg::Int32,
    abbe_msgs::std_msgs::msg::Int64,
    abbe_msgs::std_msgs::msg::String,
    abbe_msgs::std_srvs::srv::EmptyRequest,
    abbe_msgs::std_srvs::srv::EmptyResponse,
    abbe_msgs::std_srvs::srv::SetBoolRequest,
    abbe_msgs::std_srvs::srv::SetBoolResponse,
    abbe_msgs::std_srvs::srv::TriggerRequest,
    abbe_msgs::std_srvs::srv::TriggerResponse,
    abbe_msgs::tf2_msgs::action::LookupTransformFeedback,
    abbe_msgs::tf2_msgs::action::LookupTransformGoal,
    abbe_msgs::tf2_msgs::action::LookupTransformResult,
    abbe_msgs::tf2_msgs::msg::TF2Error,
    abbe_msgs::tf2_msgs::msg::TFMessage,
    abbe_msgs::type_description_interfaces::msg::Field,
    abbe_msgs::type_description_interfaces::msg::FieldType,
    abbe_msgs::type_description_interfaces::msg::IndividualTypeDescription,
    abbe_msgs::type_description_interfaces::msg::KeyValue,
    abbe_msgs::type_description_interfaces::msg::TypeDescription,
    abbe_msgs::type_description_interfaces::msg::TypeSource,
    abbe_msgs::type_description_interfaces::srv::GetTypeDescriptionRequest,
    abbe_msgs::type_description_interfaces::srv::GetTypeDescriptionResponse,
    abbe_msgs::unique_identifier_msgs::msg::UUID,
];

with_inner![
    msg::AngleSample,
    msg::AxisCompensation,
    msg::AxisState,
    msg::BlockMeasurement,
    msg::GapReport,
    msg::GeometryModel,
    msg::GridSample,
    msg::LengthSample,
    msg::MachineValue,
    msg::PlanStatus,
    msg::PositioningTable,
    msg::ProbeLatency,
    msg::ProbeTrigger,
    msg::ProbedFeature,
    msg::ProbedPoint,
    msg::TestSegment,
    msg::ThermalModel,
    msg::ThermalUpdateRequest,
    abbe_msgs::action::RunCycleGoal,
    abbe_msgs::sensor_msgs::msg::Temperature,
];
