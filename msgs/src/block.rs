//! Reference blocks.

use metrology::sample::{BlockMeasurement as Inner, FacePosition, LatencyShare};
use metrology::{Axis, PerAxis};

use crate::builtin_interfaces::msg::Time;
use crate::msg::BlockMeasurement;
use crate::wire::{Allowed, Reader, metres, millimetres, time};
use crate::{Place, Wire, WireError};

impl Wire for BlockMeasurement {
    type Inner = Inner;

    fn set_from_inner(&mut self, inner: &Inner) {
        self.header.stamp = time(inner.at);
        self.block_id.clone_from(&inner.block_id);
        for (idx, axis) in Axis::LINEAR.into_iter().enumerate() {
            let face = &inner.faces[axis];
            self.position_m[idx] = face.map_or(f64::NAN, |face| metres(face.position_mm));
            self.standard_uncertainty_m[idx] =
                face.map_or(f64::NAN, |face| metres(face.standard_uncertainty_mm));
            let latency = face.map(|face| face.latency);
            self.latency_s[idx] = latency.map_or(f64::NAN, |share| share.latency_s);
            self.latency_standard_uncertainty_s[idx] =
                latency.map_or(f64::NAN, |share| share.standard_uncertainty_s);
            self.latency_sensitivity_m_s[idx] =
                latency.map_or(f64::NAN, |share| metres(share.sensitivity_mm_s));
            self.touched[idx] = face.map_or_else(Time::default, |face| time(face.at));
        }
        self.cold = inner.cold;
        self.run = inner.run;
    }

    fn to_inner(&self) -> Result<Inner, WireError> {
        let read = Reader::of::<Self>();
        let mut faces = PerAxis([None; 6]);
        for (idx, axis) in Axis::LINEAR.into_iter().enumerate() {
            let place = Place::Axis(axis);
            let position_m =
                read.number("position_m", place, self.position_m[idx], Allowed::OrNan)?;
            if position_m.is_nan() {
                continue;
            }
            let uncertainty_m = read.number(
                "standard_uncertainty_m",
                place,
                self.standard_uncertainty_m[idx],
                Allowed::Finite,
            )?;
            let finite =
                |field, values: &[f64; 3]| read.number(field, place, values[idx], Allowed::Finite);
            let uncertainty_s = finite(
                "latency_standard_uncertainty_s",
                &self.latency_standard_uncertainty_s,
            )?;
            let sensitivity_m_s = finite("latency_sensitivity_m_s", &self.latency_sensitivity_m_s)?;
            faces[axis] = Some(FacePosition {
                position_mm: millimetres(position_m),
                standard_uncertainty_mm: millimetres(uncertainty_m),
                at: read.stamp("touched", place, &self.touched[idx])?,
                latency: LatencyShare {
                    latency_s: finite("latency_s", &self.latency_s)?,
                    standard_uncertainty_s: uncertainty_s,
                    sensitivity_mm_s: millimetres(sensitivity_m_s),
                },
            });
        }
        Ok(Inner {
            at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            block_id: read.name("block_id", &self.block_id)?,
            faces,
            cold: self.cold,
            run: self.run,
        })
    }
}
