//! Temperatures and external position references.

use metrology::sample;

use crate::msg::{AngleSample, GridSample, LengthSample};
use crate::segment::{PLANES, plane_code};
use crate::sensor_msgs::msg::Temperature;
use crate::wire::{Reader, metres, time};
use crate::{Place, Wire, WireError};

impl Wire for Temperature {
    type Inner = sample::TemperatureSample;

    fn set_from_inner(&mut self, inner: &Self::Inner) {
        self.header.stamp = time(inner.at);
        self.header.frame_id.clone_from(&inner.sensor);
        self.temperature = inner.temperature_degc;
        self.variance = inner.variance_k2;
    }

    fn to_inner(&self) -> Result<Self::Inner, WireError> {
        let read = Reader::of::<Self>();
        Ok(sample::TemperatureSample {
            at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            sensor: read.name("header.frame_id", &self.header.frame_id)?,
            temperature_degc: read.temperature_degc("temperature", self.temperature)?,
            variance_k2: read.finite("variance", self.variance)?,
        })
    }
}

impl Wire for GridSample {
    type Inner = sample::GridSample;

    fn set_from_inner(&mut self, inner: &Self::Inner) {
        self.header.stamp = time(inner.at);
        self.plane = plane_code(inner.plane);
        self.u_m = metres(inner.u_mm);
        self.v_m = metres(inner.v_mm);
        self.zero_id = inner.zero_id;
    }

    fn to_inner(&self) -> Result<Self::Inner, WireError> {
        let read = Reader::of::<Self>();
        Ok(sample::GridSample {
            at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            plane: read.variant("plane", Place::Whole, self.plane, &PLANES, plane_code)?,
            u_mm: read.length_mm("u_m", self.u_m)?,
            v_mm: read.length_mm("v_m", self.v_m)?,
            zero_id: self.zero_id,
        })
    }
}

impl Wire for AngleSample {
    type Inner = sample::AngleSample;

    fn set_from_inner(&mut self, inner: &Self::Inner) {
        self.header.stamp = time(inner.at);
        self.axis.clear();
        self.axis.push_str(inner.axis.letter());
        self.angle_rad = inner.angle_rad;
        self.zero_id = inner.zero_id;
    }

    fn to_inner(&self) -> Result<Self::Inner, WireError> {
        let read = Reader::of::<Self>();
        Ok(sample::AngleSample {
            at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            axis: read.rotary_axis("axis", 0, &self.axis)?,
            angle_rad: read.finite("angle_rad", self.angle_rad)?,
            zero_id: self.zero_id,
        })
    }
}

impl Wire for LengthSample {
    type Inner = sample::LengthSample;

    fn set_from_inner(&mut self, inner: &Self::Inner) {
        self.header.stamp = time(inner.at);
        self.axis.clear();
        self.axis.push_str(inner.axis.letter());
        self.displacement_m = metres(inner.displacement_mm);
        self.zero_id = inner.zero_id;
    }

    fn to_inner(&self) -> Result<Self::Inner, WireError> {
        let read = Reader::of::<Self>();
        Ok(sample::LengthSample {
            at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            axis: read.linear_axis("axis", 0, &self.axis)?,
            displacement_mm: read.length_mm("displacement_m", self.displacement_m)?,
            zero_id: self.zero_id,
        })
    }
}
