//! The thermal drift model and the request for an update.

use metrology::sample;
use metrology::sample::UpdateReason;
use metrology::{Axis, PerAxis};
use nalgebra::Matrix4;

use crate::msg::{AxisDrift, DriftGrowth, ThermalModel, ThermalUpdateRequest};
use crate::wire::{Allowed, Reader, metres, millimetres, point, ratios, time};
use crate::{Place, Wire, WireError};

impl Wire for AxisDrift {
    type Inner = (Axis, sample::AxisDrift);

    fn set_from_inner(&mut self, (axis, drift): &Self::Inner) {
        self.axis.clear();
        self.axis.push_str(axis.letter());
        self.p0_m = metres(drift.p0_mm);
        self.k0_m = metres(drift.k0_mm);
        self.slope = drift.slope_mm_per_mm;
        for (idx, value) in self.covariance.iter_mut().enumerate() {
            let (row, column) = (idx / 4, idx % 4);
            let lengths = u32::from(row == 0) + u32::from(column == 0);
            *value = (0..lengths).fold(drift.covariance[(row, column)], |v, _| metres(v));
        }
        self.cross_slope = ratios(&drift.cross_slope_mm_per_mm);
        self.cross_origin = point(&drift.cross_origin_mm);
        self.span_m = [metres(drift.span_mm.0), metres(drift.span_mm.1)];
        self.offset_identifiable = drift.offset_identifiable;
        self.slope_identifiable = drift.slope_identifiable;
        self.growth.clear();
        let sources = Axis::LINEAR.into_iter().zip(drift.growth);
        self.growth.extend(sources.filter_map(|(source, growth)| {
            growth.map(|growth| DriftGrowth::from_inner(&(source, growth)))
        }));
        self.measured = time(drift.measured_at);
    }

    fn to_inner(&self) -> Result<Self::Inner, WireError> {
        let read = Reader::of::<Self>();
        let entry =
            |field, idx, value| read.number(field, Place::Entry(idx), value, Allowed::Finite);
        let axis = read.linear_axis("axis", 0, &self.axis)?;
        let mut covariance = Matrix4::zeros();
        for (idx, value) in self.covariance.iter().enumerate() {
            let (row, column) = (idx / 4, idx % 4);
            let own = row == column && row == axis.index() + 1;
            let allowed = if own && !self.slope_identifiable {
                Allowed::OrInfinite
            } else {
                Allowed::Finite
            };
            let value = read.number("covariance", Place::Entry(idx), *value, allowed)?;
            let lengths = u32::from(row == 0) + u32::from(column == 0);
            covariance[(row, column)] = (0..lengths).fold(value, |v, _| millimetres(v));
        }
        let mut growth = [None; 3];
        for entry in &self.growth {
            let (source, entry) = entry.to_inner()?;
            if growth[source.index()].replace(entry).is_some() {
                return Err(read.duplicate("growth", source));
            }
        }
        let span_mm = (
            millimetres(entry("span_m", 0, self.span_m[0])?),
            millimetres(entry("span_m", 1, self.span_m[1])?),
        );
        let drift = sample::AxisDrift {
            p0_mm: read.length_mm("p0_m", self.p0_m)?,
            k0_mm: read.length_mm("k0_m", self.k0_m)?,
            slope_mm_per_mm: read.finite("slope", self.slope)?,
            covariance,
            cross_slope_mm_per_mm: read.ratios(
                "cross_slope",
                &self.cross_slope,
                Allowed::Finite,
            )?,
            cross_origin_mm: read.point_mm("cross_origin", &self.cross_origin, Allowed::Finite)?,
            span_mm,
            offset_identifiable: self.offset_identifiable,
            slope_identifiable: self.slope_identifiable,
            growth,
            measured_at: read.stamp("measured", Place::Whole, &self.measured)?,
        };
        Ok((axis, drift))
    }
}

impl Wire for DriftGrowth {
    type Inner = (Axis, sample::DriftGrowth);

    fn set_from_inner(&mut self, (source, growth): &Self::Inner) {
        self.axis.clear();
        self.axis.push_str(source.letter());
        self.rate_m_s = metres(growth.rate_mm_s);
        self.gradient_rate_per_s = ratios(&growth.gradient_rate_per_s);
        self.time_constant_s = growth.time_constant_s;
    }

    fn to_inner(&self) -> Result<Self::Inner, WireError> {
        let read = Reader::of::<Self>();
        let growth = sample::DriftGrowth {
            rate_mm_s: read.length_mm("rate_m_s", self.rate_m_s)?,
            gradient_rate_per_s: read.ratios(
                "gradient_rate_per_s",
                &self.gradient_rate_per_s,
                Allowed::Finite,
            )?,
            time_constant_s: read.number(
                "time_constant_s",
                Place::Whole,
                self.time_constant_s,
                Allowed::OrInfinite,
            )?,
        };
        Ok((read.linear_axis("axis", 0, &self.axis)?, growth))
    }
}

impl Wire for ThermalModel {
    type Inner = sample::ThermalModel;

    fn set_from_inner(&mut self, inner: &Self::Inner) {
        self.header.stamp = time(inner.at);
        self.axes.clear();
        self.axes.extend(Axis::ALL.into_iter().filter_map(|axis| {
            inner.axes[axis].map(|drift| AxisDrift::from_inner(&(axis, drift)))
        }));
        self.valid_from = time(inner.valid_from);
        self.valid_until = time(inner.valid_until);
        self.n_blocks = inner.n_blocks;
        self.lack_of_fit_p = inner.lack_of_fit_p;
        self.quarantined = inner.quarantined;
        self.sequence = inner.sequence;
    }

    fn to_inner(&self) -> Result<Self::Inner, WireError> {
        let read = Reader::of::<Self>();
        let mut axes = PerAxis([None; 6]);
        for drift in &self.axes {
            let (axis, drift) = drift.to_inner()?;
            if axes[axis].replace(drift).is_some() {
                return Err(read.duplicate("axes", axis));
            }
        }
        Ok(sample::ThermalModel {
            at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            axes,
            valid_from: read.stamp("valid_from", Place::Whole, &self.valid_from)?,
            valid_until: read.stamp("valid_until", Place::Whole, &self.valid_until)?,
            n_blocks: self.n_blocks,
            lack_of_fit_p: read.number(
                "lack_of_fit_p",
                Place::Whole,
                self.lack_of_fit_p,
                Allowed::OrNan,
            )?,
            quarantined: self.quarantined,
            sequence: self.sequence,
        })
    }
}

pub(crate) const REASONS: [UpdateReason; 4] = [
    UpdateReason::Period,
    UpdateReason::PredictedDrift,
    UpdateReason::LoadChange,
    UpdateReason::Confirmation,
];

pub(crate) fn reason_code(reason: UpdateReason) -> u8 {
    match reason {
        UpdateReason::Period => ThermalUpdateRequest::REASON_PERIOD,
        UpdateReason::PredictedDrift => ThermalUpdateRequest::REASON_PREDICTED_DRIFT,
        UpdateReason::LoadChange => ThermalUpdateRequest::REASON_LOAD_CHANGE,
        UpdateReason::Confirmation => ThermalUpdateRequest::REASON_CONFIRMATION,
    }
}

impl Wire for ThermalUpdateRequest {
    type Inner = sample::UpdateRequest;

    fn set_from_inner(&mut self, inner: &Self::Inner) {
        self.header.stamp = time(inner.at);
        self.reason = reason_code(inner.reason);
        self.elapsed_s = inner.elapsed_s;
    }

    fn to_inner(&self) -> Result<Self::Inner, WireError> {
        let read = Reader::of::<Self>();
        Ok(sample::UpdateRequest {
            at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            reason: read.variant("reason", Place::Whole, self.reason, &REASONS, reason_code)?,
            elapsed_s: read.finite("elapsed_s", self.elapsed_s)?,
        })
    }
}
