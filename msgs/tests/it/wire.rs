//! Between millimetres and the wire: nothing is lost.

#![expect(
    clippy::unwrap_used,
    reason = "a test fails by panicking, in its helper functions too"
)]

use abbe_msgs::{Wire, from_cdr, msg, sensor_msgs, to_cdr};
use metrology::sample::{
    AngleSample, AxisCompensation, AxisDrift, AxisState, BlockMeasurement, CompensationState,
    Correction, DriftGrowth, FacePosition, FeatureKind, GridSample, LatencyMethod, LatencyShare,
    LengthSample, ProbeLatency, ProbeTrigger, ProbedFeature, ProbedPoint, Rejection, Sense,
    TemperatureSample, TestKind, TestPlane, TestSegment, ThermalModel, UpdateReason, UpdateRequest,
};
use metrology::{Axis, AxisSet, Clock, PerAxis, Stamp};
use nalgebra::{Matrix3, Matrix4, Vector3};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

const CASES: u32 = 300;

/// Lengths in mm whose metres are whole 1/1024, so that (1) and (2) are exact.
fn length_mm() -> impl Strategy<Value = f64> {
    (-10_000_000..10_000_000_i32).prop_map(|k| f64::from(k) * 1000.0 / 1024.0)
}

/// Squares of lengths in mm² of the same kind.
fn square_mm2() -> impl Strategy<Value = f64> {
    (-1_000_000..1_000_000_i32).prop_map(|k| f64::from(k) * 1e6 / 1_048_576.0)
}

/// Numbers that are not converted.
fn number() -> impl Strategy<Value = f64> {
    -1e6..1e6_f64
}

fn or_nan(values: impl Strategy<Value = f64>) -> impl Strategy<Value = f64> {
    (values, any::<bool>()).prop_map(|(value, is_nan)| if is_nan { f64::NAN } else { value })
}

fn stamp<C: Clock>() -> impl Strategy<Value = Stamp<C>> {
    (0..(1_i64 << 31) * 1_000_000_000).prop_map(Stamp::from_nanos)
}

fn axes() -> impl Strategy<Value = AxisSet> {
    prop::collection::vec(prop::sample::select(Axis::ALL.to_vec()), 0..7)
        .prop_map(|axes| axes.into_iter().collect())
}

fn vector(values: impl Strategy<Value = f64> + Clone) -> impl Strategy<Value = Vector3<f64>> {
    (values.clone(), values.clone(), values).prop_map(|(x, y, z)| Vector3::new(x, y, z))
}

fn lengths_mm() -> impl Strategy<Value = Vector3<f64>> {
    (length_mm(), length_mm(), length_mm()).prop_map(|(x, y, z)| Vector3::new(x, y, z))
}

fn per_axis<T: std::fmt::Debug>(
    values: impl Strategy<Value = T>,
) -> impl Strategy<Value = PerAxis<T>> {
    prop::collection::vec(values, 6).prop_map(|values| PerAxis(<[T; 6]>::try_from(values).unwrap()))
}

/// Values of axes that the machine does not have are as a reader fills them.
fn only<T: Copy>(axes: AxisSet, values: &PerAxis<T>, absent: T) -> PerAxis<T> {
    PerAxis::from_fn(|axis| {
        if axes.contains(axis) {
            values[axis]
        } else {
            absent
        }
    })
}

fn one_of<T: Clone + std::fmt::Debug + 'static>(values: &[T]) -> impl Strategy<Value = T> {
    prop::sample::select(values.to_vec())
}

fn text() -> impl Strategy<Value = String> {
    "[a-z_µ ]{0,12}"
}

fn run<S: Strategy>(
    cases: u32,
    strategy: &S,
    test: impl Fn(S::Value) -> Result<(), TestCaseError>,
) {
    let config = Config {
        cases,
        failure_persistence: None,
        ..Config::default()
    };
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &[11; 32]);
    TestRunner::new_with_rng(config, rng)
        .run(strategy, test)
        .unwrap();
}

/// Through the wire's bytes and back: every field exactly as it was.
fn check<W: Wire>(strategy: &impl Strategy<Value = W::Inner>)
where
    W::Inner: std::fmt::Debug,
{
    run(CASES, strategy, |inner| {
        let bytes = to_cdr(&W::from_inner(&inner));
        let back = from_cdr::<W>(&bytes).unwrap().into_inner().unwrap();
        // Debug prints every f64 in full and, unlike ==, finds NaN equal to NaN.
        prop_assert_eq!(format!("{back:?}"), format!("{inner:?}"));
        let mut reused = W::default();
        reused.set_from_inner(&W::as_received(&inner).unwrap());
        reused.set_from_inner(&inner);
        prop_assert_eq!(to_cdr(&reused), bytes);
        Ok(())
    });
}

#[test]
fn prop_axis_state_comes_back() {
    let values = per_axis(length_mm());
    let scale = per_axis(or_nan(length_mm()));
    let strategy = (
        (stamp(), stamp(), axes()),
        (values, scale, per_axis(length_mm())),
    )
        .prop_map(
            |((received_at, controller_at, axes), (a, scale, b))| AxisState {
                received_at,
                controller_at,
                axes,
                commanded: only(axes, &a, 0.0),
                motor: only(axes, &b, 0.0),
                scale: only(axes, &scale, f64::NAN),
                velocity: only(axes, &PerAxis(a.0.map(|v| -v)), 0.0),
            },
        );
    check::<msg::AxisState>(&strategy);
}

#[test]
fn prop_probe_trigger_comes_back() {
    let strategy = (
        (stamp(), stamp(), axes(), text()),
        (vector(-1.0..1.0), length_mm(), per_axis(length_mm())),
        any::<u32>(),
    )
        .prop_map(
            |(
                (received_at, controller_at, axes, feature_id),
                (approach, feed_mm_s, latched),
                n,
            )| {
                ProbeTrigger {
                    received_at,
                    controller_at,
                    feature_id,
                    approach,
                    feed_mm_s,
                    axes,
                    latched: only(axes, &latched, 0.0),
                    sequence: n,
                }
            },
        );
    check::<msg::ProbeTrigger>(&strategy);
}

const REJECTIONS: [Rejection; 8] = [
    Rejection::None,
    Rejection::BeforeQueue,
    Rejection::AfterQueue,
    Rejection::Gap,
    Rejection::NotFinite,
    Rejection::ClockWentBack,
    Rejection::StandoffTooShort,
    Rejection::NoLatency,
];

#[test]
fn prop_probed_point_comes_back() {
    let strategy = (
        (stamp(), text(), axes(), per_axis(length_mm())),
        (lengths_mm(), number(), length_mm(), vector(-1.0..1.0)),
        (length_mm(), one_of(&REJECTIONS), any::<u32>()),
        one_of(&[Correction::None, Correction::Queue, Correction::Feed]),
    )
        .prop_map(
            |(
                (at, feature_id, axes, contact),
                (point, s, u, approach),
                (feed, why, n),
                correction,
            )| {
                // What a rejected touch could not form is NaN.
                let formed = |v: f64| if why == Rejection::None { v } else { f64::NAN };
                ProbedPoint {
                    received_at: at,
                    feature_id,
                    axes_at_contact: only(axes, &PerAxis(contact.0.map(formed)), 0.0),
                    axes,
                    point_in_machine_mm: point.map(formed),
                    point_in_workpiece_mm: -point.map(formed),
                    applied_latency_s: formed(s),
                    correction,
                    standard_uncertainty_mm: formed(u),
                    approach,
                    feed_mm_s: feed,
                    rejection: why,
                    sequence: n,
                }
            },
        );
    check::<msg::ProbedPoint>(&strategy);
}

#[test]
fn prop_probe_latency_comes_back() {
    let methods = [
        LatencyMethod::TwoFeedSingle,
        LatencyMethod::TwoFeedMulti,
        LatencyMethod::WeightedLeastSquares,
    ];
    let strategy = (
        (stamp(), one_of(&methods), number(), number()),
        (or_nan(number()), or_nan(number()), or_nan(number())),
        prop::collection::vec(length_mm(), 0..6),
        (any::<u32>(), length_mm(), length_mm(), any::<bool>()),
    )
        .prop_map(
            |((at, method, latency_s, u_s), (two, wls, p), feeds_mm_s, (n, a_mm, u_mm, neg))| {
                ProbeLatency {
                    at,
                    method,
                    latency_s,
                    standard_uncertainty_s: u_s,
                    two_feed_latency_s: two,
                    least_squares_latency_s: wls,
                    feeds_mm_s,
                    n,
                    intercept_mm: a_mm,
                    intercept_uncertainty_mm: u_mm,
                    lack_of_fit_p: p,
                    negative: neg,
                }
            },
        );
    check::<msg::ProbeLatency>(&strategy);
}

#[test]
fn prop_probed_feature_comes_back() {
    let kinds = [
        FeatureKind::Plane,
        FeatureKind::Bore,
        FeatureKind::Boss,
        FeatureKind::Sphere,
    ];
    let strategy = (
        (stamp(), text(), one_of(&kinds), lengths_mm()),
        prop::collection::vec(square_mm2(), 9),
        (vector(-1.0..1.0), or_nan(number()), length_mm()),
        (or_nan(length_mm()), or_nan(length_mm())),
        (any::<u32>(), any::<u32>(), any::<u32>()),
        per_axis(number()),
    )
        .prop_map(
            |(
                (at, feature_id, kind, centre_mm),
                c,
                (normal, u_rad, form_mm),
                (r, u_r),
                n,
                positions,
            )| {
                let rotary_axes: AxisSet = [Axis::A, Axis::C].into_iter().collect();
                ProbedFeature {
                    at,
                    feature_id,
                    kind,
                    centre_mm,
                    centre_covariance_mm2: Matrix3::from_row_slice(&c),
                    normal,
                    normal_standard_uncertainty_rad: u_rad,
                    radius_mm: r,
                    radius_standard_uncertainty_mm: u_r,
                    form_mm,
                    n: n.0,
                    n_rejected: n.1,
                    run: n.2,
                    rotary_axes,
                    rotary_rad: only(rotary_axes, &positions, 0.0),
                }
            },
        );
    check::<msg::ProbedFeature>(&strategy);
}

#[test]
fn prop_block_measurement_comes_back() {
    let latency = (number(), number(), length_mm()).prop_map(
        |(latency_s, standard_uncertainty_s, sensitivity_mm_s)| LatencyShare {
            latency_s,
            standard_uncertainty_s,
            sensitivity_mm_s,
        },
    );
    let face = prop::option::of((length_mm(), length_mm(), stamp(), latency).prop_map(
        |(position_mm, standard_uncertainty_mm, at, latency)| FacePosition {
            position_mm,
            standard_uncertainty_mm,
            at,
            latency,
        },
    ));
    let linear: AxisSet = Axis::LINEAR.into_iter().collect();
    let strategy = (stamp(), text(), per_axis(face), any::<bool>(), any::<u32>()).prop_map(
        move |(at, block_id, faces, cold, run)| BlockMeasurement {
            at,
            block_id,
            faces: only(linear, &faces, None),
            cold,
            run,
        },
    );
    check::<msg::BlockMeasurement>(&strategy);
}

fn growth() -> impl Strategy<Value = DriftGrowth> {
    (length_mm(), vector(-1.0..1.0), number(), any::<bool>()).prop_map(
        |(rate_mm_s, gradient_rate_per_s, tau_s, lasting)| DriftGrowth {
            rate_mm_s,
            gradient_rate_per_s,
            time_constant_s: if lasting { f64::INFINITY } else { tau_s },
        },
    )
}

fn drift() -> impl Strategy<Value = AxisDrift> {
    (
        (length_mm(), length_mm(), number(), stamp()),
        (square_mm2(), length_mm(), length_mm(), number()),
        (vector(-1.0..1.0), lengths_mm(), length_mm(), length_mm()),
        (any::<bool>(), any::<bool>()),
        prop::array::uniform3(prop::option::of(growth())),
    )
        .prop_map(
            |((p0, k0, slope, at), c, (cross, origin, low, high), flags, growth)| AxisDrift {
                p0_mm: p0,
                k0_mm: k0,
                slope_mm_per_mm: slope,
                covariance: Matrix4::from_fn(|i, j| match (i, j) {
                    (0, 0) => c.0,
                    (0, _) => c.1,
                    (_, 0) => c.2,
                    _ => c.3,
                }),
                cross_slope_mm_per_mm: cross,
                cross_origin_mm: origin,
                span_mm: (low, high),
                offset_identifiable: flags.0,
                slope_identifiable: flags.1,
                growth,
                measured_at: at,
            },
        )
}

#[test]
fn prop_thermal_model_comes_back() {
    let linear: AxisSet = Axis::LINEAR.into_iter().collect();
    let strategy = (
        (stamp(), stamp(), stamp()),
        per_axis(prop::option::of(drift())),
        (any::<u32>(), or_nan(0.0..1.0), any::<bool>(), any::<u32>()),
    )
        .prop_map(
            move |((at, from, until), axes, (n, p, quarantined, sequence))| ThermalModel {
                at,
                axes: only(linear, &axes, None),
                valid_from: from,
                valid_until: until,
                n_blocks: n,
                lack_of_fit_p: p,
                quarantined,
                sequence,
            },
        );
    check::<msg::ThermalModel>(&strategy);
}

#[test]
fn prop_update_request_comes_back() {
    let reasons = [
        UpdateReason::Period,
        UpdateReason::PredictedDrift,
        UpdateReason::LoadChange,
        UpdateReason::Confirmation,
    ];
    let strategy =
        (stamp(), one_of(&reasons), number()).prop_map(|(at, reason, elapsed_s)| UpdateRequest {
            at,
            reason,
            elapsed_s,
        });
    check::<msg::ThermalUpdateRequest>(&strategy);
}

#[test]
fn prop_axis_compensation_comes_back() {
    let states = [
        CompensationState::Off,
        CompensationState::Active,
        CompensationState::Holding,
        CompensationState::Fading,
        CompensationState::Limited,
    ];
    let part = || per_axis(length_mm());
    let strategy = (
        (stamp(), axes()),
        (part(), part(), part(), part(), part()),
        (per_axis(any::<i64>()), per_axis(one_of(&states))),
    )
        .prop_map(|((at, axes), parts, (pulses, state))| AxisCompensation {
            at,
            axes,
            total: only(axes, &parts.0, 0.0),
            thermal: only(axes, &parts.1, 0.0),
            geometric: only(axes, &parts.2, 0.0),
            positioning: only(axes, &parts.3, 0.0),
            pulses: only(axes, &pulses, 0),
            remainder: only(axes, &parts.4, 0.0),
            state: only(axes, &state, CompensationState::Off),
        });
    check::<msg::AxisCompensation>(&strategy);
}

const PLANES: [TestPlane; 4] = [TestPlane::None, TestPlane::Xy, TestPlane::Yz, TestPlane::Zx];

const KINDS: [TestKind; 20] = [
    TestKind::Latency,
    TestKind::Block,
    TestKind::Touch,
    TestKind::Plane,
    TestKind::Bore,
    TestKind::Sphere,
    TestKind::Circle,
    TestKind::Line,
    TestKind::Corner,
    TestKind::Positioning,
    TestKind::Dwell,
    TestKind::Production,
    TestKind::Verification,
    TestKind::Arc,
    TestKind::Spike,
    TestKind::ArcWithLine,
    TestKind::TwoArcs,
    TestKind::Diagonal,
    TestKind::Rotary,
    TestKind::RotaryVerification,
];

#[test]
fn prop_test_segment_comes_back() {
    let senses = [Sense::None, Sense::Clockwise, Sense::CounterClockwise];
    let strategy = (
        (stamp(), one_of(&KINDS), one_of(&PLANES), one_of(&senses)),
        (
            lengths_mm(),
            lengths_mm(),
            length_mm(),
            length_mm(),
            any::<[u32; 5]>(),
        ),
        (text(), prop::collection::vec(text(), 0..5)),
        any::<[bool; 3]>(),
    )
        .prop_map(
            |(
                (at, kind, plane, sense),
                (centre_mm, tool, radius, feed, n),
                (stylus, features),
                b,
            )| {
                TestSegment {
                    at,
                    run: n[0],
                    begin: b[0],
                    kind,
                    plane,
                    centre_mm,
                    radius_mm: radius,
                    feed_mm_s: feed,
                    sense,
                    repeat: n[1],
                    stylus,
                    tool_offset_mm: tool,
                    stations: n[4],
                    zero_id: n[2],
                    setup_id: n[3],
                    cold: b[1],
                    features,
                    completed: b[2],
                }
            },
        );
    check::<msg::TestSegment>(&strategy);
}

#[test]
fn prop_sensor_samples_come_back() {
    let temperature = (stamp(), text(), -200.0..1600.0, 0.0..1.0).prop_map(
        |(at, sensor, temperature_degc, variance_k2)| TemperatureSample {
            at,
            sensor,
            temperature_degc,
            variance_k2,
        },
    );
    check::<sensor_msgs::msg::Temperature>(&temperature);
    let grid = (
        stamp(),
        one_of(&PLANES),
        length_mm(),
        length_mm(),
        any::<u32>(),
    )
        .prop_map(|(at, plane, u_mm, v_mm, zero_id)| GridSample {
            at,
            plane,
            u_mm,
            v_mm,
            zero_id,
        });
    check::<msg::GridSample>(&grid);
    let length = (stamp(), one_of(&Axis::LINEAR), length_mm(), any::<u32>()).prop_map(
        |(at, axis, displacement_mm, zero_id)| LengthSample {
            at,
            axis,
            displacement_mm,
            zero_id,
        },
    );
    check::<msg::LengthSample>(&length);
    let angle = (stamp(), one_of(&Axis::ROTARY), -100.0..100.0, any::<u32>()).prop_map(
        |(at, axis, angle_rad, zero_id)| AngleSample {
            at,
            axis,
            angle_rad,
            zero_id,
        },
    );
    check::<msg::AngleSample>(&angle);
}

fn grid(u_mm: f64) -> GridSample {
    GridSample {
        at: Stamp::from_nanos(0),
        plane: TestPlane::Xy,
        u_mm,
        v_mm: 0.0,
        zero_id: 0,
    }
}

/// (1) and (2) for every length that a machine can have.
#[test]
fn prop_eq2_gives_a_length_back_within_one_ulp_and_then_the_same_bits() {
    let lengths_mm = prop_oneof![
        -1e5..1e5_f64,
        -1e-3..1e-3_f64,
        (-15.0..9.0_f64, any::<bool>()).prop_map(|(exponent, is_negative)| {
            let length_mm = 10_f64.powf(exponent);
            if is_negative { -length_mm } else { length_mm }
        }),
    ];
    run(100 * CASES, &lengths_mm, |length_mm| {
        let once = msg::GridSample::as_received(&grid(length_mm)).unwrap();
        let ulp = length_mm.abs().next_up() - length_mm.abs();
        prop_assert!(
            (once.u_mm - length_mm).abs() <= ulp,
            "{} {}",
            once.u_mm,
            length_mm
        );
        let twice = msg::GridSample::as_received(&once).unwrap();
        prop_assert_eq!(twice.u_mm.to_bits(), once.u_mm.to_bits());
        Ok(())
    });
}
