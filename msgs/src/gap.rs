//! The diagnosis of simulator against machine.

use metrology::sample::{self, GapStatus};

use crate::msg::{GapCause, GapParameter, GapReport};
use crate::wire::{Allowed, Reader, metres, millimetres, time};
use crate::{Place, Wire, WireError, bounds};

const GAP_STATES: [GapStatus; 3] = [GapStatus::Named, GapStatus::Surrogate, GapStatus::Set];

fn status_code(status: GapStatus) -> u8 {
    match status {
        GapStatus::Named => GapCause::STATUS_NAMED,
        GapStatus::Surrogate => GapCause::STATUS_SURROGATE,
        GapStatus::Set => GapCause::STATUS_SET,
    }
}

impl Wire for GapParameter {
    type Inner = sample::GapParameter;

    fn set_from_inner(&mut self, inner: &Self::Inner) {
        self.name.clone_from(&inner.name);
        (self.value, self.low, self.high) = (inner.value, inner.low, inner.high);
    }

    fn to_inner(&self) -> Result<Self::Inner, WireError> {
        let read = Reader::of::<Self>();
        Ok(sample::GapParameter {
            name: self.name.clone(),
            value: read.finite("value", self.value)?,
            low: read.finite("low", self.low)?,
            high: read.finite("high", self.high)?,
        })
    }
}

impl Wire for GapCause {
    type Inner = sample::GapCause;

    fn set_from_inner(&mut self, inner: &Self::Inner) {
        self.effect.clone_from(&inner.effect);
        self.axis.clone_from(&inner.axis);
        self.status = status_code(inner.status);
        self.confidence = inner.confidence;
        self.whitened_size = inner.whitened_size;
        self.parameters = inner.parameters.iter().map(Wire::from_inner).collect();
    }

    fn to_inner(&self) -> Result<Self::Inner, WireError> {
        let read = Reader::of::<Self>();
        read.at_most("parameters", self.parameters.len(), bounds::CAUSES)?;
        let parameters = self.parameters.iter().map(Wire::to_inner);
        Ok(sample::GapCause {
            effect: self.effect.clone(),
            axis: self.axis.clone(),
            status: read.variant(
                "status",
                Place::Whole,
                self.status,
                &GAP_STATES,
                status_code,
            )?,
            confidence: read.finite("confidence", self.confidence)?,
            whitened_size: read.finite("whitened_size", self.whitened_size)?,
            parameters: parameters.collect::<Result<_, _>>()?,
        })
    }
}

impl Wire for GapReport {
    type Inner = sample::GapSummary;

    fn set_from_inner(&mut self, inner: &Self::Inner) {
        self.header.stamp = time(inner.at);
        self.runs.clone_from(&inner.runs);
        self.rms_m = metres(inner.rms_mm);
        self.p95_m = metres(inner.p95_mm);
        self.floor_m = metres(inner.floor_mm);
        self.above_floor = inner.above_floor;
        self.causes = inner.causes.iter().map(Wire::from_inner).collect();
        self.has_unknown = inner.has_unknown;
        self.unknown_covariate.clone_from(&inner.unknown_covariate);
        self.held_out_runs.clone_from(&inner.held_out_runs);
        self.rms_before_m = metres(inner.rms_before_mm);
        self.rms_after_m = metres(inner.rms_after_mm);
        self.gap_closed = inner.gap_closed;
        self.next_experiment.clone_from(&inner.next_experiment);
        self.json.clone_from(&inner.json);
    }

    fn to_inner(&self) -> Result<Self::Inner, WireError> {
        let read = Reader::of::<Self>();
        let or_nan = |field, value| read.number(field, Place::Whole, value, Allowed::OrNan);
        read.at_most("causes", self.causes.len(), bounds::CAUSES)?;
        read.at_most("runs", self.runs.len(), bounds::RUNS)?;
        read.at_most("held_out_runs", self.held_out_runs.len(), bounds::RUNS)?;
        let causes = self.causes.iter().map(Wire::to_inner);
        Ok(sample::GapSummary {
            at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            runs: self.runs.clone(),
            rms_mm: read.length_mm("rms_m", self.rms_m)?,
            p95_mm: read.length_mm("p95_m", self.p95_m)?,
            floor_mm: read.length_mm("floor_m", self.floor_m)?,
            above_floor: self.above_floor,
            causes: causes.collect::<Result<_, _>>()?,
            has_unknown: self.has_unknown,
            unknown_covariate: self.unknown_covariate.clone(),
            held_out_runs: self.held_out_runs.clone(),
            rms_before_mm: millimetres(or_nan("rms_before_m", self.rms_before_m)?),
            rms_after_mm: millimetres(or_nan("rms_after_m", self.rms_after_m)?),
            gap_closed: or_nan("gap_closed", self.gap_closed)?,
            next_experiment: self.next_experiment.clone(),
            json: self.json.clone(),
        })
    }
}
