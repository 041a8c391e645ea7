//! Thermal models and tests that come in.

use metrology::sample::{
    AxisDrift, DriftGrowth, Sense, TestKind, TestPlane, TestSegment, ThermalModel,
};
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
        at,
        run: 1,
        begin,
        kind: TestKind::Positioning,
        plane: TestPlane::None,
        centre_mm: Vector3::zeros(),
        radius_mm: 0.0,
        feed_mm_s: 1.0,
        sense: Sense::None,
        repeat: 0,
        stylus: String::new(),
        zero_id: 0,
        setup_id: 0,
        tool_offset_mm: Vector3::zeros(),
        stations: 0,
        cold: false,
        features: Vec::new(),
        completed,
    }
}
