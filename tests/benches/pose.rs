//! The offset of one pose, by the function that the node calls, beside numpy.

use std::hint::black_box;
use std::io::Write as _;
use std::process::Stdio;
use std::time::Instant;

use axis_compensation::parts::parts_at;
use metrology::drift::Extrapolate;
use metrology::sample::{AxisDrift, ThermalModel};
use metrology::{Axis, PerAxis, Stamp};
use nalgebra::Vector3;
use serde::Deserialize;
use serde_json::json;

use crate::python;

const PASSES: usize = 9;
const POSES: u32 = 1_000_000;
/// numpy takes some 10 µs for each.
const PEER_POSES: u32 = 20_000;
const ELAPSED_S: f64 = 400.0;
const POSE_MM: [f64; 3] = [12.0, -34.0, 56.0];
/// Both add the same few terms in their own order.
const AGREEMENT_MM: f64 = 1e-12;
/// For 21 geometric errors, thermal and positioning parts of 5 axes; only the thermal part exists.
const BUDGET_NANOS: f64 = 200.0;

#[derive(Deserialize)]
struct PeerFigures {
    nanos_per_pose: f64,
    offsets_mm: [f64; 3],
}

fn drift(axis: Axis) -> AxisDrift {
    let mut cross_slope_mm_per_mm = Vector3::new(1e-5, -2e-5, 3e-5);
    cross_slope_mm_per_mm[axis.index()] = 0.0;
    AxisDrift {
        k0_mm: 0.01,
        slope_mm_per_mm: 5e-5,
        cross_slope_mm_per_mm,
        span_mm: (-220.0, 220.0),
        rate_mm_s: 1e-6,
        slope_rate_per_s: 1e-9,
        time_constant_s: 1800.0,
        ..AxisDrift::default()
    }
}

fn model() -> ThermalModel {
    let mut axes = PerAxis::default();
    for axis in Axis::LINEAR {
        axes[axis] = Some(drift(axis));
    }
    ThermalModel {
        at: Stamp::from_nanos(0),
        axes,
        valid_from: Stamp::from_nanos(0),
        valid_until: Stamp::from_nanos(i64::MAX),
        n_blocks: 4,
        lack_of_fit_p: 0.5,
        quarantined: false,
        sequence: 1,
    }
}

fn offsets_mm(model: &ThermalModel) -> [f64; 3] {
    let p_mm = black_box(Vector3::from(POSE_MM));
    let at = black_box(Stamp::from_nanos((ELAPSED_S * 1e9) as i64));
    Axis::LINEAR.map(|axis| {
        parts_at(model, axis, &p_mm, at, Extrapolate::Hold)
            .unwrap()
            .sum()
    })
}

fn nanos_per_pose(model: &ThermalModel) -> f64 {
    let mut passes = [0.0; PASSES];
    for nanos in &mut passes {
        let begin = Instant::now();
        for _ in 0..POSES {
            black_box(offsets_mm(model));
        }
        *nanos = begin.elapsed().as_secs_f64() * 1e9 / f64::from(POSES);
    }
    passes.sort_by(f64::total_cmp);
    passes[PASSES / 2]
}

fn as_json(model: &ThermalModel) -> String {
    let of = |pick: fn(&AxisDrift) -> f64| {
        Axis::LINEAR.map(|axis| model.axes[axis].as_ref().map_or(f64::NAN, pick))
    };
    let vectors = |pick: fn(&AxisDrift) -> Vector3<f64>| {
        Axis::LINEAR.map(|axis| {
            model.axes[axis].as_ref().map(|drift| {
                let vector = pick(drift);
                [vector.x, vector.y, vector.z]
            })
        })
    };
    json!({
        "p0": of(|d| d.p0_mm),
        "k0": of(|d| d.k0_mm),
        "slope": of(|d| d.slope_mm_per_mm),
        "rate": of(|d| d.rate_mm_s),
        "slope_rate": of(|d| d.slope_rate_per_s),
        "tau": of(|d| d.time_constant_s),
        "lower": of(|d| d.span_mm.0),
        "upper": of(|d| d.span_mm.1),
        "cross": vectors(|d| d.cross_slope_mm_per_mm),
        "cross_origin": vectors(|d| d.cross_origin_mm),
        "pose": POSE_MM,
        "elapsed_s": ELAPSED_S,
    })
    .to_string()
}

fn numpy(model: &ThermalModel) -> Option<PeerFigures> {
    let mut child = python::peer("bench_compensation.py")?
        .args([PEER_POSES.to_string(), PASSES.to_string()])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = child.stdin.take().unwrap();
    input.write_all(as_json(model).as_bytes()).unwrap();
    drop(input);
    let output = child.wait_with_output().unwrap();
    assert!(
        output.status.success(),
        "bench_compensation.py: {}",
        output.status
    );
    Some(serde_json::from_slice(&output.stdout).unwrap())
}

/// Prints ours, numpy's and the ratio, having checked that both compute the same offsets.
pub fn run() {
    let model = model();
    let ours_nanos = nanos_per_pose(&model);
    println!("thermal part of X, Y and Z, per pose, median of {PASSES} passes [ns]");
    println!("ours     {ours_nanos:>9.1}   budget {BUDGET_NANOS} with parts that do not exist yet");
    let Some(peer) = numpy(&model) else {
        return;
    };
    for (ours_mm, numpy_mm) in offsets_mm(&model).into_iter().zip(peer.offsets_mm) {
        let apart_mm = (ours_mm - numpy_mm).abs();
        assert!(apart_mm < AGREEMENT_MM, "{ours_mm} mm, numpy {numpy_mm} mm");
    }
    let ratio = peer.nanos_per_pose / ours_nanos;
    println!("numpy    {:>9.1}   ratio {ratio:.0}", peer.nanos_per_pose);
}
