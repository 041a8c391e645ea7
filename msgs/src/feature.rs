//! Shapes fitted to probed points.

use metrology::sample::{FeatureKind, ProbedFeature as Inner};
use nalgebra::Matrix3;

use crate::msg::ProbedFeature;
use crate::wire::{
    Allowed, Reader, metres, millimetres, point, ratios, set_letters, set_positions, time,
};
use crate::{Place, Wire, WireError};

pub(crate) const FEATURE_KINDS: [FeatureKind; 4] = [
    FeatureKind::Plane,
    FeatureKind::Bore,
    FeatureKind::Boss,
    FeatureKind::Sphere,
];

pub(crate) fn kind_code(kind: FeatureKind) -> u8 {
    match kind {
        FeatureKind::Plane => ProbedFeature::KIND_PLANE,
        FeatureKind::Bore => ProbedFeature::KIND_BORE,
        FeatureKind::Boss => ProbedFeature::KIND_BOSS,
        FeatureKind::Sphere => ProbedFeature::KIND_SPHERE,
    }
}

impl Wire for ProbedFeature {
    type Inner = Inner;

    fn set_from_inner(&mut self, inner: &Inner) {
        self.header.stamp = time(inner.at);
        self.feature_id.clone_from(&inner.feature_id);
        self.kind = kind_code(inner.kind);
        self.centre = point(&inner.centre_mm);
        for (idx, out) in self.centre_covariance.iter_mut().enumerate() {
            *out = metres(metres(inner.centre_covariance_mm2[(idx / 3, idx % 3)]));
        }
        self.normal = ratios(&inner.normal);
        self.normal_standard_uncertainty_rad = inner.normal_standard_uncertainty_rad;
        self.radius_m = metres(inner.radius_mm);
        self.radius_standard_uncertainty_m = metres(inner.radius_standard_uncertainty_mm);
        self.form_m = metres(inner.form_mm);
        self.n = inner.n;
        self.n_rejected = inner.n_rejected;
        self.run = inner.run;
        set_letters(&mut self.rotary_axis, inner.rotary_axes);
        set_positions(&mut self.rotary_rad, inner.rotary_axes, &inner.rotary_rad);
    }

    fn to_inner(&self) -> Result<Inner, WireError> {
        let read = Reader::of::<Self>();
        let or_nan = |field, value| read.number(field, Place::Whole, value, Allowed::OrNan);
        let mut centre_covariance_mm2 = Matrix3::zeros();
        for (idx, value_m2) in self.centre_covariance.into_iter().enumerate() {
            let place = Place::Entry(idx);
            let value_m2 = read.number("centre_covariance", place, value_m2, Allowed::Finite)?;
            centre_covariance_mm2[(idx / 3, idx % 3)] = millimetres(millimetres(value_m2));
        }
        let letters = read.rotary_letters("rotary_axis", &self.rotary_axis)?;
        let rotary_rad = read.positions(
            "rotary_rad",
            &letters,
            &self.rotary_rad,
            0.0,
            Allowed::Finite,
        )?;
        Ok(Inner {
            at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            feature_id: read.name("feature_id", &self.feature_id)?,
            kind: read.variant("kind", Place::Whole, self.kind, &FEATURE_KINDS, kind_code)?,
            centre_mm: read.point_mm("centre", &self.centre, Allowed::Finite)?,
            centre_covariance_mm2,
            normal: read.ratios("normal", &self.normal, Allowed::Finite)?,
            normal_standard_uncertainty_rad: or_nan(
                "normal_standard_uncertainty_rad",
                self.normal_standard_uncertainty_rad,
            )?,
            radius_mm: or_nan("radius_m", self.radius_m).map(millimetres)?,
            radius_standard_uncertainty_mm: or_nan(
                "radius_standard_uncertainty_m",
                self.radius_standard_uncertainty_m,
            )
            .map(millimetres)?,
            form_mm: read.length_mm("form_m", self.form_m)?,
            n: self.n,
            n_rejected: self.n_rejected,
            run: self.run,
            rotary_axes: letters.set(),
            rotary_rad,
        })
    }
}
