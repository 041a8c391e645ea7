//! The wire: messages, services, actions, topics and QoS of Abbe.
//!
//! `msg/`, `srv/` and `action/` are a ROS 2 interface package that colcon builds as it is; the Rust
//! types, MCAP schema texts and RIHS01 hashes here are made from the same files, and those of ROS 2's
//! own packages from `standard/`. A type of this package is [`msg::AxisState`], one of another
//! package [`sensor_msgs::msg::Temperature`].
//!
//! On the wire everything is SI: metres, radians, seconds, degrees Celsius. Inside Abbe lengths are
//! millimetres. [`Wire`] leads from one to the other, and no other crate converts.
//!
//! [`topics`] is the only place with topic names, types and QoS.

mod action_types;
mod block;
mod bounds;
mod cdr;
mod clock;
mod compensation;
mod cycle;
mod error;
mod feature;
mod frames;
mod gap;
mod geometry;
mod interface;
mod motion;
mod qos;
mod release;
mod report;
mod segment;
mod sensor;
mod service_event;
mod thermal;
pub mod topics;
mod touch;
mod wire;

pub use action_types::{
    FeedbackMessage, GetResult, GetResultRequest, GetResultResponse, SendGoal, SendGoalRequest,
    SendGoalResponse,
};
pub use cdr::{ENCAPSULATION, from_cdr, to_cdr, to_cdr_into};
pub use error::{Defect, Place, WireError};
pub use frames::transforms;
pub use interface::{
    Action, Description, FieldParts, Message, Service, TypeParts, description_of, parts_of,
};
pub use motion::joint_state;
pub use qos::{Durability, Qos, Reliability};
pub use release::{Conversion, Release};
pub use service_event::{SERVICE_EVENT_SUFFIX, ServiceEvent};
pub use wire::{Wire, instant, time};

include!(concat!(env!("OUT_DIR"), "/interfaces.rs"));
