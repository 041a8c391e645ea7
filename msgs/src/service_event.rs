//! What happened to a service call, as ROS 2's service introspection tells it.
//!
//! `<service>/_service_event` carries one message for each of the four steps of a call. A bag that has the requests
//! can be replayed without the node that called.

use serde::{Deserialize, Serialize};

use crate::service_msgs::msg::ServiceEventInfo;
use crate::{Message, Service};

/// What stands behind a service's name in that of its events.
pub const SERVICE_EVENT_SUFFIX: &str = "/_service_event";

/// One step of a call: who, when, and what was asked or answered.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct ServiceEvent<S: Service> {
    /// Which step of which call.
    pub info: ServiceEventInfo,
    /// The request, for the steps of a request; at most one.
    pub request: Vec<S::Request>,
    /// The response, for the steps of a response; at most one.
    pub response: Vec<S::Response>,
}

impl<S: Service> Message for ServiceEvent<S> {
    const TYPE_NAME: &'static str = S::EVENT.type_name;
    const TYPE_HASH: &'static str = S::EVENT.type_hash;
    const DEFINITION: &'static str = S::EVENT.definition;
}
