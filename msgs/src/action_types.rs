//! The services and the message that ROS 2 derives from an action.

use std::marker::PhantomData;

use serde::{Deserialize, Serialize};

use crate::builtin_interfaces::msg::Time;
use crate::unique_identifier_msgs::msg::UUID;
use crate::{Action, Description, Message, Service};

/// The service `<action>/_action/send_goal`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SendGoal<A>(PhantomData<A>);

/// The service `<action>/_action/get_result`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GetResult<A>(PhantomData<A>);

/// Asks a server to take on a goal.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct SendGoalRequest<A: Action> {
    /// Chosen by the client.
    pub goal_id: UUID,
    /// What is wanted.
    pub goal: A::Goal,
}

/// Whether a server takes on a goal.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct SendGoalResponse<A: Action> {
    /// True: it does.
    pub accepted: bool,
    /// When it was decided.
    pub stamp: Time,
    /// Which action.
    #[serde(skip)]
    pub action: PhantomData<A>,
}

/// Asks for the result of a goal; answered when the goal has come to its end.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct GetResultRequest<A: Action> {
    /// Which goal.
    pub goal_id: UUID,
    /// Which action.
    #[serde(skip)]
    pub action: PhantomData<A>,
}

/// The result of a goal.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct GetResultResponse<A: Action> {
    /// One of `STATUS_*` of [`crate::action_msgs::msg::GoalStatus`].
    pub status: i8,
    /// What came of it.
    pub result: A::Result,
}

/// How far a goal is, on `<action>/_action/feedback`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct FeedbackMessage<A: Action> {
    /// Which goal.
    pub goal_id: UUID,
    /// How far.
    pub feedback: A::Feedback,
}

macro_rules! described {
    ($($message:ident by $description:ident;)*) => {$(
        impl<A: Action> Message for $message<A> {
            const TYPE_NAME: &'static str = A::$description.type_name;
            const TYPE_HASH: &'static str = A::$description.type_hash;
            const DEFINITION: &'static str = A::$description.definition;
        }
    )*};
}

described! {
    SendGoalRequest by SEND_GOAL_REQUEST;
    SendGoalResponse by SEND_GOAL_RESPONSE;
    GetResultRequest by GET_RESULT_REQUEST;
    GetResultResponse by GET_RESULT_RESPONSE;
    FeedbackMessage by FEEDBACK_MESSAGE;
}

impl<A: Action> Service for SendGoal<A> {
    type Request = SendGoalRequest<A>;
    type Response = SendGoalResponse<A>;
    const TYPE_NAME: &'static str = A::SEND_GOAL.type_name;
    const TYPE_HASH: &'static str = A::SEND_GOAL.type_hash;
    const EVENT: Description = A::SEND_GOAL_EVENT;
}

impl<A: Action> Service for GetResult<A> {
    type Request = GetResultRequest<A>;
    type Response = GetResultResponse<A>;
    const TYPE_NAME: &'static str = A::GET_RESULT.type_name;
    const TYPE_HASH: &'static str = A::GET_RESULT.type_hash;
    const EVENT: Description = A::GET_RESULT_EVENT;
}
