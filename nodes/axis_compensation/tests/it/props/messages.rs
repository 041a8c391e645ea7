//! Thermal models and tests that come in.

use metrology::sample::{AxisDrift, DriftGrowth, TestKind, TestSegment, ThermalModel};
use metrology::{Axis, Host, PerAxis, Stamp};
use nalgebra::Vector3;

pub fn model(
    sequence: u32,
    at: Stamp<Host>,
    k0_mm: f64,
    slope: f64,
    life_s: f64,
    rate_mm_s: f64,
) -> ThermalModel {
    let drift = AxisDrift {
        p0_mm: -220.0,
        k0_mm,
        slope_mm_per_mm: slope,
        cross_slope_mm_per_mm: Vector3::new(0.0, slope, 0.0),
        span_mm: (-220.0, 220.0),
        offset_identifiable: true,
        slope_identifiable: true,
        growth: [
            Some(DriftGrowth {
                rate_mm_s,
                gradient_rate_per_s: Vector3::zeros(),
                time_constant_s: 1800.0,
            }),
            None,
            None,
        ],
        measured_at: at,
        ..AxisDrift::default()
    };
    let mut axes = PerAxis::default();
    for axis in Axis::LINEAR {
        let mut own = drift;
        own.cross_slope_mm_per_mm[axis.index()] = 0.0;
        axes[axis] = Some(own);
    }
    ThermalModel {
        at,
        axes,
        valid_from: at,
        valid_until: at + metrology::stamp::Span::from_secs_f64(life_s),
        n_blocks: 2,
        lack_of_fit_p: f64::NAN,
        quarantined: false,
        sequence,
    }
}

pub fn segment(at: Stamp<Host>, begin: bool, completed: bool) -> TestSegment {
    TestSegment {
        begin,
        feed_mm_s: 1.0,
        completed,
        ..TestSegment::of_kind(TestKind::Positioning, 1, at)
    }
}
