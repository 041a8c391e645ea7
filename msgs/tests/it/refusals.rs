//! Between millimetres and the wire: nothing without a meaning is let through.

#![expect(
    clippy::unwrap_used,
    reason = "a test fails by panicking, in its helper functions too"
)]

use abbe_msgs::{Message, Wire, action, msg, to_cdr};
use metrology::sample::{
    AngleSample, AxisCompensation, AxisDrift, AxisState, BlockMeasurement, CompensationState,
    GridSample, LengthSample, TestPlane,
};
use metrology::{Axis, AxisSet, PerAxis, Stamp};

fn grid(u_mm: f64) -> GridSample {
    GridSample {
        at: Stamp::from_nanos(0),
        plane: TestPlane::Xy,
        u_mm,
        v_mm: 0.0,
        zero_id: 0,
    }
}

#[test]
fn eq1_a_millimetre_is_a_thousandth_of_a_metre() {
    let message = msg::GridSample::from_inner(&grid(125.0));
    assert_eq!(message.u_m.to_bits(), 0.125_f64.to_bits());
    let mut inner = state();
    inner.commanded[Axis::C] = 0.5;
    let message = msg::AxisState::from_inner(&inner);
    // Rotary axes are radians on both sides.
    assert_eq!(message.commanded[1].to_bits(), 0.5_f64.to_bits());
}

fn state() -> AxisState {
    let zeros = PerAxis([0.0; 6]);
    AxisState {
        received_at: Stamp::from_nanos(1),
        controller_at: Stamp::from_nanos(2),
        axes: [Axis::X, Axis::C].into_iter().collect(),
        commanded: zeros,
        motor: zeros,
        scale: PerAxis([f64::NAN; 6]),
        velocity: zeros,
    }
}

/// What is said of a message after one change to it.
fn complaint<W: Wire>(good: &W, change: impl FnOnce(&mut W)) -> String
where
    W::Inner: std::fmt::Debug,
{
    assert!(good.to_inner().is_ok());
    let mut bad = good.clone();
    change(&mut bad);
    bad.into_inner().unwrap_err().to_string()
}

#[test]
fn axes_that_do_not_fit_are_refused() {
    let good = msg::AxisState::from_inner(&state());
    let name = msg::AxisState::TYPE_NAME;
    assert_eq!(
        complaint(&good, |m| m.axis[1] = "Q".to_owned()),
        format!("{name}: axis[1]: axis \"Q\": must be one of X Y Z A B C")
    );
    assert_eq!(
        complaint(&good, |m| m.axis[1] = "X".to_owned()),
        format!("{name}: axis: axis X appears twice")
    );
    assert_eq!(
        complaint(&good, |m| m.motor.push(0.0)),
        format!("{name}: motor: 3 entries for 2 axes")
    );
    assert!(complaint(&good, |m| m.axis = vec!["X".to_owned(); 100]).contains("twice"));
    let length = LengthSample {
        at: Stamp::from_nanos(0),
        axis: Axis::X,
        displacement_mm: 0.0,
        zero_id: 0,
    };
    assert_eq!(
        complaint(&msg::LengthSample::from_inner(&length), |m| m.axis =
            "C".to_owned()),
        "abbe_msgs/msg/LengthSample: axis[0]: axis \"C\": must be one of X Y Z"
    );
    let angle = AngleSample {
        at: Stamp::from_nanos(0),
        axis: Axis::C,
        angle_rad: 0.0,
        zero_id: 0,
    };
    let angle = msg::AngleSample::from_inner(&angle);
    assert_eq!(
        complaint(&angle, |m| m.axis = "X".to_owned()),
        "abbe_msgs/msg/AngleSample: axis[0]: axis \"X\": must be one of A B C"
    );
    assert_eq!(
        complaint(&angle, |m| m.angle_rad = f64::NAN),
        "abbe_msgs/msg/AngleSample: angle_rad: NaN: must be a finite number"
    );
}

#[test]
fn numbers_that_are_none_are_refused_except_where_they_mean_something() {
    let good = msg::AxisState::from_inner(&state());
    let name = msg::AxisState::TYPE_NAME;
    assert_eq!(
        complaint(&good, |m| m.velocity[1] = f64::NAN),
        format!("{name}: velocity[C]: NaN: must be a finite number")
    );
    assert_eq!(
        complaint(&good, |m| m.commanded[0] = f64::NEG_INFINITY),
        format!("{name}: commanded[X]: -inf: must be a finite number")
    );
    assert_eq!(
        complaint(&good, |m| m.scale[0] = f64::INFINITY),
        format!("{name}: scale[X]: inf: must be a finite number or NaN")
    );
    let drift = (Axis::X, AxisDrift::default());
    let good = msg::AxisDrift::from_inner(&drift);
    let growth = msg::DriftGrowth {
        axis: String::from("X"),
        ..msg::DriftGrowth::default()
    };
    assert_eq!(
        complaint(&growth, |m| m.time_constant_s = f64::NAN),
        "abbe_msgs/msg/DriftGrowth: time_constant_s: NaN: must be a finite number or +inf"
    );
    assert_eq!(
        complaint(&good, |m| m.cross_slope.y = f64::NAN),
        "abbe_msgs/msg/AxisDrift: cross_slope[Y]: NaN: must be a finite number"
    );
    assert_eq!(
        complaint(&good, |m| m.covariance[3] = f64::INFINITY),
        "abbe_msgs/msg/AxisDrift: covariance[3]: inf: must be a finite number"
    );
    // Nothing may be known of an unidentifiable slope; of another entry something must be.
    let mut unknown = good.clone();
    unknown.covariance[5] = f64::INFINITY;
    assert!(unknown.to_inner().is_ok());
    assert_eq!(
        complaint(&unknown, |m| m.slope_identifiable = true),
        "abbe_msgs/msg/AxisDrift: covariance[5]: inf: must be a finite number"
    );
}

#[test]
fn stamps_that_no_clock_shows_are_refused() {
    let good = msg::AxisState::from_inner(&state());
    let name = msg::AxisState::TYPE_NAME;
    let limits = "must be 0 to 4294967295 s (1970 to 2106) and below 1000000000 ns";
    let mut late = good.clone();
    late.header.stamp.sec = -1;
    assert_eq!(
        late.to_inner().unwrap().received_at.nanos(),
        4_294_967_295_000_000_001
    );
    assert_eq!(
        complaint(&good, |m| m.controller_stamp.nanosec = 1_000_000_000),
        format!("{name}: controller_stamp: stamp 0 s 1000000000 ns: {limits}")
    );
    for nanos in [-1, i64::MIN, i64::MAX, (1 << 32) * 1_000_000_000] {
        let inner = AxisState {
            received_at: Stamp::from_nanos(nanos),
            ..state()
        };
        assert_eq!(
            msg::AxisState::as_received(&inner).unwrap_err().to_string(),
            format!("{name}: header.stamp: stamp 4294967295 s 4294967295 ns: {limits}")
        );
    }
}

#[test]
fn values_without_a_meaning_are_refused() {
    let good = msg::GridSample::from_inner(&grid(1.0));
    assert_eq!(
        complaint(&good, |m| m.plane = 4),
        "abbe_msgs/msg/GridSample: plane: value 4: must be 0 to 3"
    );
    let point = msg::ProbedPoint::default();
    assert_eq!(
        complaint(&point, |m| m.rejected = true),
        "abbe_msgs/msg/ProbedPoint: rejected is true but reason is 0"
    );
    assert_eq!(
        complaint(&point, |m| m.reason = msg::ProbedPoint::REJECTION_GAP),
        "abbe_msgs/msg/ProbedPoint: rejected is false but reason is 3"
    );
    let mut model = msg::ThermalModel::default();
    model
        .axes
        .push(msg::AxisDrift::from_inner(&(Axis::Y, AxisDrift::default())));
    assert_eq!(
        complaint(&model, |m| m.axes.push(m.axes[0].clone())),
        "abbe_msgs/msg/ThermalModel: axes: axis Y appears twice"
    );
}

#[test]
fn a_face_that_was_not_measured_needs_no_uncertainty() {
    let inner = BlockMeasurement {
        at: Stamp::from_nanos(0),
        block_id: "low".to_owned(),
        faces: PerAxis([None; 6]),
        cold: false,
        run: 1,
    };
    let message = msg::BlockMeasurement::from_inner(&inner);
    assert!(message.position_m.iter().all(|position| position.is_nan()));
    assert_eq!(message.clone().into_inner().unwrap(), inner);
    assert_eq!(
        complaint(&message, |m| m.position_m[2] = 0.1),
        "abbe_msgs/msg/BlockMeasurement: standard_uncertainty_m[Z]: NaN: must be a finite number"
    );
}

/// Number of constants of a message file whose names begin with `prefix`.
fn n_constants(file: &str, prefix: &str) -> u8 {
    let start = format!("uint8 {prefix}");
    let n = file.lines().filter(|line| line.starts_with(&start)).count();
    assert!(n > 1, "{prefix}");
    u8::try_from(n).unwrap()
}

/// Every constant is read, the number after the last is not.
fn check_codes<W: Wire>(n: u8, mut message: W, set: impl Fn(&mut W, u8))
where
    W::Inner: std::fmt::Debug,
{
    for code in 0..n {
        set(&mut message, code);
        let inner = message.to_inner().unwrap();
        assert_eq!(to_cdr(&W::from_inner(&inner)), to_cdr(&message));
    }
    set(&mut message, n);
    let refusal = message.to_inner().unwrap_err().to_string();
    let expected = format!("value {n}: must be 0 to {}", n - 1);
    assert!(refusal.ends_with(&expected), "{refusal}");
}

#[test]
fn every_constant_of_a_message_has_an_inner_form() {
    let file = include_str!("../../msg/TestSegment.msg");
    let segment = msg::TestSegment::default;
    check_codes(n_constants(file, "KIND_"), segment(), |m, v| m.kind = v);
    check_codes(n_constants(file, "PLANE_"), segment(), |m, v| m.plane = v);
    check_codes(n_constants(file, "SENSE_"), segment(), |m, v| m.sense = v);
    let n = n_constants(include_str!("../../msg/GridSample.msg"), "PLANE_");
    check_codes(n, msg::GridSample::default(), |m, v| m.plane = v);
    let n = n_constants(include_str!("../../msg/ProbedFeature.msg"), "KIND_");
    check_codes(n, msg::ProbedFeature::default(), |m, v| m.kind = v);
    let n = n_constants(include_str!("../../msg/ProbeLatency.msg"), "METHOD_");
    check_codes(n, msg::ProbeLatency::default(), |m, v| m.method = v);
    let n = n_constants(
        include_str!("../../msg/ThermalUpdateRequest.msg"),
        "REASON_",
    );
    check_codes(n, msg::ThermalUpdateRequest::default(), |m, v| m.reason = v);
    let n = n_constants(include_str!("../../msg/ProbedPoint.msg"), "REJECTION_");
    check_codes(n, msg::ProbedPoint::default(), |m, v| {
        m.reason = v;
        m.rejected = v != 0;
    });
    let n = n_constants(include_str!("../../msg/ProbedPoint.msg"), "CORRECTION_");
    check_codes(n, msg::ProbedPoint::default(), |m, v| m.correction = v);
    let n = n_constants(include_str!("../../msg/PlanStatus.msg"), "STATE_");
    check_codes(n, msg::PlanStatus::default(), |m, v| m.state = v);
    let n = n_constants(include_str!("../../action/RunCycle.action"), "CYCLE_");
    check_codes(n, action::RunCycleGoal::default(), |m, v| m.cycle = v);
    let n = n_constants(include_str!("../../msg/AxisCompensation.msg"), "STATE_");
    let inner = AxisCompensation {
        at: Stamp::from_nanos(0),
        axes: AxisSet::EMPTY.with(Axis::X),
        total: PerAxis([0.0; 6]),
        thermal: PerAxis([0.0; 6]),
        geometric: PerAxis([0.0; 6]),
        positioning: PerAxis([0.0; 6]),
        pulses: PerAxis([0; 6]),
        remainder: PerAxis([0.0; 6]),
        state: PerAxis([CompensationState::Off; 6]),
    };
    check_codes(n, msg::AxisCompensation::from_inner(&inner), |m, v| {
        m.state[0] = v
    });
}
