//! How the clocks of hosts stand to each other.

use metrology::ClockMap;
use metrology::sample;

use crate::msg::{ClockAnswer, ClockQuestion, HostClock};
use crate::wire::{Reader, time};
use crate::{Place, Wire, WireError};

impl Wire for ClockQuestion {
    type Inner = sample::ClockQuestion;

    fn set_from_inner(&mut self, inner: &Self::Inner) {
        self.header.stamp = time(inner.asked_at);
        self.host.clone_from(&inner.host);
        self.sequence = inner.sequence;
    }

    fn to_inner(&self) -> Result<Self::Inner, WireError> {
        let read = Reader::of::<Self>();
        Ok(sample::ClockQuestion {
            asked_at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            host: read.name("host", &self.host)?,
            sequence: self.sequence,
        })
    }
}

impl Wire for ClockAnswer {
    type Inner = sample::ClockAnswer;

    fn set_from_inner(&mut self, inner: &Self::Inner) {
        self.header.stamp = time(inner.answered_at);
        self.received = time(inner.received_at);
        self.reference.clone_from(&inner.reference);
        self.host.clone_from(&inner.host);
        self.sequence = inner.sequence;
        self.asked = time(inner.asked_at);
    }

    fn to_inner(&self) -> Result<Self::Inner, WireError> {
        let read = Reader::of::<Self>();
        Ok(sample::ClockAnswer {
            answered_at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            received_at: read.stamp("received", Place::Whole, &self.received)?,
            reference: read.name("reference", &self.reference)?,
            host: read.name("host", &self.host)?,
            sequence: self.sequence,
            asked_at: read.stamp("asked", Place::Whole, &self.asked)?,
        })
    }
}

impl Wire for HostClock {
    type Inner = sample::HostClock;

    fn set_from_inner(&mut self, inner: &Self::Inner) {
        self.header.stamp = time(inner.newest.returned_at);
        self.host.clone_from(&inner.host);
        self.reference.clone_from(&inner.reference);
        self.at = time(inner.map.at());
        self.there = time(inner.map.there());
        self.drift = inner.map.drift();
        self.standard_uncertainty_s = inner.standard_uncertainty_s;
        self.drift_standard_uncertainty = inner.drift_standard_uncertainty;
        self.bound_s = inner.bound_s;
        self.least_round_trip_s = inner.least_round_trip_s;
        self.n = inner.n;
        self.span_s = inner.span_s;
        self.steps = inner.steps;
        self.asked = time(inner.newest.asked_at);
        self.received = time(inner.newest.received_at);
        self.answered = time(inner.newest.answered_at);
        self.returned = time(inner.newest.returned_at);
    }

    fn to_inner(&self) -> Result<Self::Inner, WireError> {
        let read = Reader::of::<Self>();
        let at = read.stamp("at", Place::Whole, &self.at)?;
        let there = read.stamp("there", Place::Whole, &self.there)?;
        Ok(sample::HostClock {
            host: read.name("host", &self.host)?,
            reference: read.name("reference", &self.reference)?,
            map: ClockMap::new(at, there, read.finite("drift", self.drift)?),
            standard_uncertainty_s: read
                .finite("standard_uncertainty_s", self.standard_uncertainty_s)?,
            drift_standard_uncertainty: read.finite(
                "drift_standard_uncertainty",
                self.drift_standard_uncertainty,
            )?,
            bound_s: read.finite("bound_s", self.bound_s)?,
            least_round_trip_s: read.finite("least_round_trip_s", self.least_round_trip_s)?,
            n: self.n,
            span_s: read.finite("span_s", self.span_s)?,
            steps: self.steps,
            newest: sample::ClockExchange {
                asked_at: read.stamp("asked", Place::Whole, &self.asked)?,
                received_at: read.stamp("received", Place::Whole, &self.received)?,
                answered_at: read.stamp("answered", Place::Whole, &self.answered)?,
                returned_at: read.stamp("returned", Place::Whole, &self.returned)?,
            },
        })
    }
}
