//! What reads bytes of strangers, by itself: for tests that spoil them (`tests/fuzz`). Each returns, whatever the bytes are.

use std::hint::black_box;

use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_msgs::{Release, from_cdr};
use metrology::Stamp;

use super::action_client::ActionClient;
use super::action_server::{ActionServer, GoalService};
use super::logger_levels::LoggerService;
use super::parameters::ParameterService;
use super::service::{self, ReplyTo, shared};
use super::type_description;
use crate::arguments::Arguments;
use crate::dds::{self, CYCLONE_VENDOR};
use crate::network::{Guid, RequestIdentity, Sample};
use crate::node::Bytes;
use crate::setup::Setup;

/// A datagram on the port of announcements.
pub fn datagram(bytes: &[u8]) {
    black_box(dds::is_announcement(bytes));
}

/// What an endpoint on DDS says of its type.
pub fn user_data(bytes: &[u8]) {
    black_box(dds::has_type_hash(bytes));
}

/// What somebody calls a topic on DDS, and writes into a key of Zenoh's graph.
pub fn name(text: &str) {
    black_box(dds::role_of(text));
    #[cfg(feature = "zenoh")]
    black_box(crate::zenoh::is_read(text));
}

/// What stands beside a sample on Zenoh; nothing does where that is not built in.
pub fn attachment(bytes: &[u8]) {
    #[cfg(feature = "zenoh")]
    black_box(crate::zenoh::is_attachment(bytes));
    #[cfg(not(feature = "zenoh"))]
    black_box(bytes);
}

/// A request to a node and an answer to one of its own, in either mapping of services.
pub fn call(bytes: &[u8]) {
    let mut cyclone: Guid = [7; 16];
    cyclone[..2].copy_from_slice(&CYCLONE_VENDOR);
    let identity = |sequence| RequestIdentity {
        writer: [9; 16],
        sequence,
    };
    for (writer, related) in [
        (cyclone, None),
        ([7; 16], None),
        ([7; 16], Some(identity(3))),
        ([7; 16], Some(identity(-1))),
    ] {
        let sample = || Sample {
            bytes: shared(bytes),
            writer,
            sequence: 1,
            source: None,
            received: Stamp::from_nanos(0),
            related,
        };
        if let Some((to, request)) = service::request(sample()) {
            serve(to, &request);
        }
        if let Some((_, reply)) = service::reply(sample()) {
            follow(&reply);
        }
    }
}

/// As a request to every service that each node has.
fn serve(to: ReplyTo, request: &Bytes) {
    let mut actions = ActionServer::default();
    if let Ok((goal, _)) = actions.propose(to, request) {
        black_box(actions.decide(goal, true, Time::default()));
        black_box(actions.result(to, request));
    }
    if let Ok(request) = from_cdr(request) {
        black_box(actions.cancel(to, &request));
    }
    black_box(actions.status());
    let setup = Setup::new("node", &Arguments::default()).expect("a node may be called so");
    let parameters = setup.runtime_parameters();
    for (service, ..) in ParameterService::ALL {
        let _ = service.answer(&parameters, request);
    }
    for (service, ..) in LoggerService::ALL {
        let _ = service.answer("/node", request);
    }
    let _ = type_description::answer(Release::default(), request);
}

/// As an answer to each question of an action's client, and as news of its goal.
fn follow(reply: &Bytes) {
    for service in [
        GoalService::SendGoal,
        GoalService::CancelGoal,
        GoalService::GetResult,
    ] {
        let mut goals = ActionClient::default();
        goals.send(1, [7; 16], reply);
        black_box(goals.feedback(reply));
        black_box(goals.replied(service, 1, Some(reply)));
    }
}
