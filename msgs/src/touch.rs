//! Touches of the probe and the latency that corrects them.

use metrology::sample;
use metrology::sample::{Correction, LatencyMethod, Rejection};

use crate::msg::{ProbeLatency, ProbeTrigger, ProbedPoint};
use crate::wire::{
    Allowed, Reader, metres, millimetres, point, ratios, set_letters, set_positions, time,
};
use crate::{Place, Wire, WireError, bounds};

impl Wire for ProbeTrigger {
    type Inner = sample::ProbeTrigger;

    fn set_from_inner(&mut self, inner: &Self::Inner) {
        self.header.stamp = time(inner.received_at);
        self.controller_stamp = time(inner.controller_at);
        self.feature_id.clone_from(&inner.feature_id);
        self.approach = ratios(&inner.approach);
        self.feed_m_s = metres(inner.feed_mm_s);
        set_letters(&mut self.axis, inner.axes);
        set_positions(&mut self.latched, inner.axes, &inner.latched);
        self.sequence = inner.sequence;
    }

    fn to_inner(&self) -> Result<Self::Inner, WireError> {
        let read = Reader::of::<Self>();
        let letters = read.letters("axis", &self.axis)?;
        Ok(sample::ProbeTrigger {
            received_at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            controller_at: read.stamp("controller_stamp", Place::Whole, &self.controller_stamp)?,
            feature_id: read.name("feature_id", &self.feature_id)?,
            approach: read.ratios("approach", &self.approach, Allowed::Finite)?,
            feed_mm_s: read.length_mm("feed_m_s", self.feed_m_s)?,
            axes: letters.set(),
            latched: read.positions("latched", &letters, &self.latched, 0.0, Allowed::Finite)?,
            sequence: self.sequence,
        })
    }
}

pub(crate) const REJECTIONS: [Rejection; 8] = [
    Rejection::None,
    Rejection::BeforeQueue,
    Rejection::AfterQueue,
    Rejection::Gap,
    Rejection::NotFinite,
    Rejection::ClockWentBack,
    Rejection::StandoffTooShort,
    Rejection::NoLatency,
];

pub(crate) fn rejection_code(rejection: Rejection) -> u8 {
    match rejection {
        Rejection::None => ProbedPoint::REJECTION_NONE,
        Rejection::BeforeQueue => ProbedPoint::REJECTION_BEFORE_QUEUE,
        Rejection::AfterQueue => ProbedPoint::REJECTION_AFTER_QUEUE,
        Rejection::Gap => ProbedPoint::REJECTION_GAP,
        Rejection::NotFinite => ProbedPoint::REJECTION_NOT_FINITE,
        Rejection::ClockWentBack => ProbedPoint::REJECTION_CLOCK_WENT_BACK,
        Rejection::StandoffTooShort => ProbedPoint::REJECTION_STANDOFF_TOO_SHORT,
        Rejection::NoLatency => ProbedPoint::REJECTION_NO_LATENCY,
    }
}

pub(crate) const CORRECTIONS: [Correction; 3] =
    [Correction::None, Correction::Queue, Correction::Feed];

pub(crate) fn correction_code(correction: Correction) -> u8 {
    match correction {
        Correction::None => ProbedPoint::CORRECTION_NONE,
        Correction::Queue => ProbedPoint::CORRECTION_QUEUE,
        Correction::Feed => ProbedPoint::CORRECTION_FEED,
    }
}

impl Wire for ProbedPoint {
    type Inner = sample::ProbedPoint;

    fn set_from_inner(&mut self, inner: &Self::Inner) {
        self.header.stamp = time(inner.received_at);
        self.feature_id.clone_from(&inner.feature_id);
        self.point = point(&inner.point_in_machine_mm);
        self.point_in_workpiece = point(&inner.point_in_workpiece_mm);
        set_letters(&mut self.axis, inner.axes);
        set_positions(
            &mut self.axes_at_contact,
            inner.axes,
            &inner.axes_at_contact,
        );
        self.applied_latency_s = inner.applied_latency_s;
        self.correction = correction_code(inner.correction);
        self.standard_uncertainty_m = metres(inner.standard_uncertainty_mm);
        self.approach = ratios(&inner.approach);
        self.feed_m_s = metres(inner.feed_mm_s);
        self.rejected = inner.rejection != Rejection::None;
        self.reason = rejection_code(inner.rejection);
        self.sequence = inner.sequence;
    }

    fn to_inner(&self) -> Result<Self::Inner, WireError> {
        let read = Reader::of::<Self>();
        let reason = self.reason;
        let rejection =
            read.variant("reason", Place::Whole, reason, &REJECTIONS, rejection_code)?;
        if self.rejected != (rejection != Rejection::None) {
            return Err(read.contradiction(("rejected", self.rejected), ("reason", reason)));
        }
        // A rejected touch tells why and when; what could not be formed is NaN.
        let allowed = if self.rejected {
            Allowed::Anything
        } else {
            Allowed::Finite
        };
        let number = |field, value| read.number(field, Place::Whole, value, allowed);
        let letters = read.letters("axis", &self.axis)?;
        let contact = &self.axes_at_contact;
        Ok(sample::ProbedPoint {
            received_at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            feature_id: read.name("feature_id", &self.feature_id)?,
            axes_at_contact: read.positions("axes_at_contact", &letters, contact, 0.0, allowed)?,
            axes: letters.set(),
            point_in_machine_mm: read.point_mm("point", &self.point, allowed)?,
            point_in_workpiece_mm: read.point_mm(
                "point_in_workpiece",
                &self.point_in_workpiece,
                allowed,
            )?,
            applied_latency_s: number("applied_latency_s", self.applied_latency_s)?,
            correction: read.variant(
                "correction",
                Place::Whole,
                self.correction,
                &CORRECTIONS,
                correction_code,
            )?,
            standard_uncertainty_mm: number("standard_uncertainty_m", self.standard_uncertainty_m)
                .map(millimetres)?,
            approach: read.ratios("approach", &self.approach, allowed)?,
            feed_mm_s: number("feed_m_s", self.feed_m_s).map(millimetres)?,
            rejection,
            sequence: self.sequence,
        })
    }
}

pub(crate) const METHODS: [LatencyMethod; 3] = [
    LatencyMethod::TwoFeedSingle,
    LatencyMethod::TwoFeedMulti,
    LatencyMethod::WeightedLeastSquares,
];

pub(crate) fn method_code(method: LatencyMethod) -> u8 {
    match method {
        LatencyMethod::TwoFeedSingle => ProbeLatency::METHOD_TWO_FEED_SINGLE,
        LatencyMethod::TwoFeedMulti => ProbeLatency::METHOD_TWO_FEED_MULTI,
        LatencyMethod::WeightedLeastSquares => ProbeLatency::METHOD_WEIGHTED_LEAST_SQUARES,
    }
}

impl Wire for ProbeLatency {
    type Inner = sample::ProbeLatency;

    fn set_from_inner(&mut self, inner: &Self::Inner) {
        self.header.stamp = time(inner.at);
        self.method = method_code(inner.method);
        self.latency_s = inner.latency_s;
        self.standard_uncertainty_s = inner.standard_uncertainty_s;
        self.two_feed_latency_s = inner.two_feed_latency_s;
        self.least_squares_latency_s = inner.least_squares_latency_s;
        self.feeds_m_s.clear();
        self.feeds_m_s
            .extend(inner.feeds_mm_s.iter().copied().map(metres));
        self.n = inner.n;
        self.intercept_m = metres(inner.intercept_mm);
        self.intercept_uncertainty_m = metres(inner.intercept_uncertainty_mm);
        self.lack_of_fit_p = inner.lack_of_fit_p;
        self.negative = inner.negative;
    }

    fn to_inner(&self) -> Result<Self::Inner, WireError> {
        let read = Reader::of::<Self>();
        let or_nan = |field, value| read.number(field, Place::Whole, value, Allowed::OrNan);
        read.at_most("feeds_m_s", self.feeds_m_s.len(), bounds::TOUCHES)?;
        let feeds_mm_s = (self.feeds_m_s.iter().enumerate())
            .map(|(idx, feed)| {
                read.number("feeds_m_s", Place::Entry(idx), *feed, Allowed::Finite)
                    .map(millimetres)
            })
            .collect::<Result<_, _>>()?;
        Ok(sample::ProbeLatency {
            at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            method: read.variant("method", Place::Whole, self.method, &METHODS, method_code)?,
            latency_s: read.finite("latency_s", self.latency_s)?,
            standard_uncertainty_s: read
                .finite("standard_uncertainty_s", self.standard_uncertainty_s)?,
            two_feed_latency_s: or_nan("two_feed_latency_s", self.two_feed_latency_s)?,
            least_squares_latency_s: or_nan(
                "least_squares_latency_s",
                self.least_squares_latency_s,
            )?,
            feeds_mm_s,
            n: self.n,
            intercept_mm: read.length_mm("intercept_m", self.intercept_m)?,
            intercept_uncertainty_mm: read
                .length_mm("intercept_uncertainty_m", self.intercept_uncertainty_m)?,
            lack_of_fit_p: or_nan("lack_of_fit_p", self.lack_of_fit_p)?,
            negative: self.negative,
        })
    }
}
