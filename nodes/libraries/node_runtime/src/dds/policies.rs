//! Quality of service in DDS's terms.

use abbe_msgs::{Durability as RosDurability, Qos, Reliability as RosReliability};
use rustdds::policy::{Durability, History, Reliability, ResourceLimits};
use rustdds::{Duration, QosPolicies, QosPolicyBuilder};

/// Which end an endpoint is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Reader,
    Writer,
}

/// RustDDS's reader cache has this ceiling whenever less is asked for.
const DDS_READER_FLOOR: i32 = 64;

/// Samples that may wait for an acknowledgement. A subscriber that was killed acknowledges nothing
/// until its lease (60 s) is over, and RustDDS refuses every write when 8,192 wait, which at 1 kHz is
/// 8 s: so five times the depth, which is 100 s at the rate for which a depth is chosen.
const UNACKNOWLEDGED_PER_DEPTH: i32 = 5;

/// And never fewer than RustDDS's own limit.
const LEAST_UNACKNOWLEDGED: i32 = 8_192;

/// A latched writer without readers keeps all samples up to its limit, not up to its depth, and late
/// joiners get them all: so a low limit, which still takes a burst.
const LEAST_UNACKNOWLEDGED_LATCHED: i32 = 256;

/// Writing never waits: a sample that has no room is counted as lost by the caller.
const MAX_BLOCKING: Duration = Duration::ZERO;

pub(super) fn policies(qos: Qos, side: Side) -> QosPolicies {
    let depth = i32::try_from(qos.depth).unwrap_or(i32::MAX).max(1);
    let durability = match qos.durability {
        RosDurability::Volatile => Durability::Volatile,
        RosDurability::TransientLocal => Durability::TransientLocal,
    };
    let reliability = match qos.reliability {
        RosReliability::Reliable => Reliability::Reliable {
            max_blocking_time: MAX_BLOCKING,
        },
        RosReliability::BestEffort => Reliability::BestEffort,
    };
    let builder = QosPolicyBuilder::new()
        .durability(durability)
        .reliability(reliability)
        .history(History::KeepLast { depth });
    match side {
        Side::Reader => {
            let limit = depth.max(DDS_READER_FLOOR);
            builder.resource_limits(limits(limit)).build()
        }
        Side::Writer => {
            let least = match qos.durability {
                RosDurability::Volatile => LEAST_UNACKNOWLEDGED,
                RosDurability::TransientLocal => LEAST_UNACKNOWLEDGED_LATCHED,
            };
            let limit = depth.saturating_mul(UNACKNOWLEDGED_PER_DEPTH).max(least);
            builder.resource_limits(limits(limit)).build()
        }
    }
}

const fn limits(samples: i32) -> ResourceLimits {
    ResourceLimits {
        max_samples: samples,
        max_instances: 1,
        max_samples_per_instance: samples,
    }
}

pub(super) fn graph_reader() -> QosPolicies {
    policies(
        Qos {
            depth: 1_000,
            ..Qos::LATCHED
        },
        Side::Reader,
    )
}

pub(super) fn is_reliable(reliability: Option<Reliability>) -> bool {
    matches!(reliability, Some(Reliability::Reliable { .. }))
}

pub(super) fn is_latched(durability: Option<Durability>) -> bool {
    durability.is_some_and(|durability| durability >= Durability::TransientLocal)
}
