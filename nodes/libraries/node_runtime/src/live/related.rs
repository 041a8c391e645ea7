//! A node whose stamps are taken over to the reference's clock, by the map that the host clock tells.

use metrology::Stamp;
use metrology::sample::HostClock;
use metrology::stamp::{Host, Span};

use super::event_time::EventTime;
use super::owner::Owner;
use crate::clock::{Change, Clock, HostTime};
use crate::diagnostic::{Diagnostic, Level};
use crate::setup::Setup;

/// How well the clock is known.
const CONDITION: &str = "clock_relation";
/// A map whose newest exchange is older is told of.
const OLD: Span = Span::from_nanos(10_000_000_000);

/// How the node's clock is related.
pub(super) struct Related {
    /// The node goes by its computer's clock as it is.
    pub keeps_own_time: bool,
    /// Whose map is meant; empty: none.
    host: String,
    time: HostTime,
}

impl Related {
    pub fn of(setup: &Setup, clock: &Clock, keeps_own_time: bool) -> Self {
        let is_real = !clock.is_simulated();
        Self {
            keeps_own_time: keeps_own_time && is_real,
            host: if is_real && !keeps_own_time {
                setup.clock_host().to_owned()
            } else {
                String::new()
            },
            time: setup.host_time(),
        }
    }

    /// Whether maps are to be listened to.
    pub const fn listens(&self) -> bool {
        !self.host.is_empty()
    }

    /// The computer's clock as it is.
    pub fn own_now(&self) -> Stamp<Host> {
        self.time.own_now()
    }
}

impl Owner {
    /// Goes by a map, if it is of this node's host.
    pub(super) fn relate(&mut self, clock: HostClock) {
        if clock.host != self.relation.host {
            return;
        }
        let reference = clock.reference.clone();
        if let Change::Steps(by) = self.relation.time.relate(clock) {
            // The step is meant: what comes next is not late.
            self.event_time = EventTime::new();
            let by_s = by.as_secs_f64();
            tracing::info!(by_s, "the clock goes by that of host {reference} now");
        }
        self.tell_relation();
    }

    /// Says how well the node's clock is known, once a second.
    pub(super) fn tell_relation(&mut self) {
        if !self.relation.listens() {
            return;
        }
        let host = &self.relation.host;
        let told = match self.relation.time.related() {
            None => {
                let message = format!("no map of host {host} yet: stamps are by its own clock");
                Diagnostic::new(Level::Warn, CONDITION, message)
            }
            Some((clock, age)) => {
                let is_old = age > OLD;
                let at = self.relation.own_now();
                let offset_s = clock.map.offset(at).as_secs_f64();
                let uncertainty_s = clock.standard_uncertainty_at_s(at);
                let message = format!(
                    "host {} is {offset_s:.6} s ahead of {host}, standard uncertainty {uncertainty_s:.6} s{}",
                    clock.reference,
                    if is_old { ", by an old map" } else { "" }
                );
                let level = if is_old { Level::Warn } else { Level::Ok };
                Diagnostic::new(level, CONDITION, message)
                    .with("offset_s", format!("{offset_s:.9}"))
                    .with("standard_uncertainty_s", format!("{uncertainty_s:.9}"))
                    .with("bound_s", format!("{:.9}", clock.bound_s))
                    .with("drift_us_per_s", format!("{:.4}", clock.map.drift() * 1e6))
                    .with("age_s", format!("{:.3}", age.as_secs_f64()))
                    .staying()
            }
        };
        self.board.report(told, tokio::time::Instant::now());
    }
}
