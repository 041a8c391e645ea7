//! What time it is: the computer's clock, or `/clock` where time is simulated.
#![expect(clippy::disallowed_methods, reason = "the clock that stamps events")]

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::{SystemTime, UNIX_EPOCH};

use abbe_msgs::builtin_interfaces::msg::Time;
use metrology::stamp::Host;
use metrology::{Stamp, epoch};

mod host_time;

pub use host_time::HostTime;
pub(crate) use host_time::{Change, ClockError};

/// The computer's clock.
pub(crate) fn host_now() -> Stamp<Host> {
    let nanos = match SystemTime::now().duration_since(UNIX_EPOCH) {
        Ok(since) => i64::try_from(since.as_nanos()).unwrap_or(i64::MAX),
        Err(before) => -i64::try_from(before.duration().as_nanos()).unwrap_or(i64::MAX),
    };
    Stamp::from_nanos(nanos)
}

/// A node's time.
#[derive(Clone, Debug)]
pub(crate) enum Clock {
    /// The computer's, taken over to the reference's where it is related to it.
    Host(HostTime),
    /// The last `/clock`; 0 before the first.
    Simulated(Arc<AtomicI64>),
}

impl Clock {
    pub fn new(use_sim_time: bool, host: HostTime) -> Self {
        if use_sim_time {
            Self::Simulated(Arc::default())
        } else {
            Self::Host(host)
        }
    }

    pub fn now(&self) -> Stamp<Host> {
        match self {
            Self::Host(host) => host.now(),
            Self::Simulated(nanos) => Stamp::from_nanos(nanos.load(Ordering::Relaxed)),
        }
    }

    /// Takes a `/clock` in; the time before it.
    pub fn set(&self, now: Stamp<Host>) -> Stamp<Host> {
        match self {
            Self::Host(host) => host.now(),
            Self::Simulated(nanos) => Stamp::from_nanos(nanos.swap(now.nanos(), Ordering::Relaxed)),
        }
    }

    /// What this clock showed when the computer's clock was at `computer`.
    pub fn taken_over(&self, computer: Stamp<Host>) -> Stamp<Host> {
        match self {
            Self::Host(host) => host.shown(computer),
            Self::Simulated(_) => self.now(),
        }
    }

    /// What a sample is stamped with when it is sent; `None`: the computer's clock as it is.
    pub fn source(&self) -> Option<Stamp<Host>> {
        match self {
            Self::Host(host) if !host.is_plain() => Some(host.now()),
            _ => None,
        }
    }

    pub const fn is_simulated(&self) -> bool {
        matches!(self, Self::Simulated(_))
    }
}

/// A stamp as ROS writes it; times before 1970 or after 2106 come out as zero.
pub(crate) fn ros_time(at: Stamp<Host>) -> Time {
    if epoch::holds(at) {
        abbe_msgs::time(at)
    } else {
        Time::default()
    }
}
