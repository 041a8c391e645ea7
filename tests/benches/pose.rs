//! The offset of one pose, by the function that the node calls, beside numpy.

use std::hint::black_box;
use std::io::Write as _;
use std::process::Stdio;
use std::time::Instant;

use axis_compensation::femtometre::{fm_from_mm, mm_from_fm};
use axis_compensation::parts::thermal_parts_at;
use axis_compensation::positioning::deviation_table::DeviationTable;
use axis_compensation::positioning::direction::Direction;
use machine::volumetric::{VolumetricModel, components_of};
use machine::{Chain, Kinematics};
use metrology::drift::Extrapolate;
use metrology::sample::{
    AxisDrift, CurveForm, DriftGrowth, ErrorCurve, GeometryModel, ThermalModel,
};
use metrology::{Axis, ErrorComponent, PerAxis, Stamp};
use nalgebra::{DMatrix, Vector3};
use serde::Deserialize;
use serde_json::json;

use crate::python;

/// Short passes, so that many of them are not interrupted where other work is on the computer.
const PASSES: usize = 8_000;
const POSES: u32 = 250;
/// numpy takes some 300 µs for each.
const PEER_PASSES: usize = 800;
const PEER_POSES: u32 = 2;
/// Points of a positioning table, 15 mm apart.
const POINTS: i32 = 41;
const SPACING_MM: f64 = 15.0;
const ELAPSED_S: f64 = 400.0;
/// mm, rad.
const POSE: [f64; 6] = [12.0, -34.0, 56.0, -0.4, 0.0, 1.2];
const TOOL_OFFSET_MM: [f64; 3] = [0.0, 0.0, -120.0];
const ORIGIN_MM: [f64; 3] = [3.0, -7.0, 50.0];
const CHAIN: &str = "[w C' A' Y' b X Z t]";
/// Both add the same terms in their own order.
const AGREEMENT_MM: f64 = 1e-11;
/// For geometric, thermal and positioning parts of 5 axes.
const BUDGET_NANOS: f64 = 200.0;

#[derive(Deserialize)]
struct PeerFigures {
    nanos_per_pose: f64,
    fastest_nanos_per_pose: f64,
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
        growth: Axis::LINEAR.map(|source| {
            (source == axis).then_some(DriftGrowth {
                rate_mm_s: 1e-6,
                gradient_rate_per_s: Vector3::from_fn(
                    |row, _| {
                        if row == axis.index() { 1e-9 } else { 0.0 }
                    },
                ),
                time_constant_s: 1800.0,
            })
        }),
        ..AxisDrift::default()
    }
}

/// The own growth of a drift.
fn growth(drift: &AxisDrift) -> DriftGrowth {
    let mut own = drift.growth.iter().flatten();
    *own.next().expect("every drift above has one")
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

/// Coefficients of powers 1 to 3, or the constant: some 10 µm and 10 µrad, all different.
fn coefficients(component: ErrorComponent) -> Vec<f64> {
    let varied =
        1.0 + 0.1 * component.direction.index() as f64 - 0.15 * component.of.index() as f64;
    if component.is_location {
        vec![1e-5 * varied]
    } else if component.of.is_linear() {
        vec![3e-8 * varied, 1e-10, -3e-13 * varied]
    } else {
        vec![1e-5 * varied, -3e-6, 2e-6 * varied]
    }
}

fn geometry() -> VolumetricModel {
    let chain: Chain = CHAIN.parse().unwrap();
    let curves = components_of(&chain)
        .into_iter()
        .map(|component| ErrorCurve {
            component,
            form: if component.is_location {
                CurveForm::Constant
            } else {
                CurveForm::Polynomial
            },
            origin: 0.0,
            power: if component.is_location {
                Vec::new()
            } else {
                vec![1, 2, 3]
            },
            position: Vec::new(),
            coefficient: coefficients(component),
            standard_uncertainty: Vec::new(),
            estimable: Vec::new(),
            span: (-300.0, 300.0),
        });
    let published = GeometryModel {
        at: Stamp::from_nanos(0),
        chain: CHAIN.to_owned(),
        curves: curves.collect(),
        covariance: DMatrix::zeros(0, 0),
        combinations: Vec::new(),
        n_samples: 0,
        n_unknowns: 0,
        rank: 0,
        residual_standard_deviation_mm: 0.0,
        sequence: 0,
    };
    let kinematics = Kinematics::of_chain(chain, PerAxis([ORIGIN_MM; 6]));
    VolumetricModel::new(&kinematics, &published)
        .unwrap()
        .with_extrapolate(Extrapolate::Hold)
}

/// Deviation of a slide at a point of its table, up, mm.
fn deviation_mm(axis: Axis, point: i32) -> f64 {
    1e-3 * f64::from((7 * point + 3 * axis.index() as i32) % 11 - 5)
}

fn points_mm() -> Vec<f64> {
    let from_middle = |point| SPACING_MM * f64::from(point - POINTS / 2);
    (0..POINTS).map(from_middle).collect()
}

fn tables() -> [DeviationTable; 3] {
    Axis::LINEAR.map(|axis| {
        let up: Vec<f64> = (0..POINTS).map(|point| deviation_mm(axis, point)).collect();
        let down: Vec<f64> = up.iter().map(|deviation| deviation - 0.002).collect();
        DeviationTable::new(axis, &points_mm(), &up, &down).unwrap()
    })
}

/// All that one pose needs.
struct Compensation {
    thermal: ThermalModel,
    geometry: VolumetricModel,
    positioning: [DeviationTable; 3],
}

fn offsets_mm(of: &Compensation) -> [f64; 3] {
    let positions = black_box(PerAxis(POSE));
    let at = black_box(Stamp::from_nanos((ELAPSED_S * 1e9) as i64));
    let tool_mm = Vector3::from(TOOL_OFFSET_MM);
    let geometric = of.geometry.command_offset(&positions, &tool_mm).unwrap();
    let p_mm = positions.xyz();
    let thermal = thermal_parts_at(&of.thermal, &p_mm, at, Extrapolate::Hold);
    let sum_of = |axis: Axis| {
        let mut parts = thermal[axis.index()].unwrap();
        let commanded_fm = fm_from_mm(positions[axis]).unwrap();
        let table = &of.positioning[axis.index()];
        parts.positioning = -mm_from_fm(table.deviation_fm(commanded_fm, Some(Direction::Up)));
        parts.geometric = geometric[axis];
        parts.sum()
    };
    [sum_of(Axis::X), sum_of(Axis::Y), sum_of(Axis::Z)]
}

/// Time per pose, ns: median of the fastest quarter of all passes, and of all.
fn nanos_per_pose(of: &Compensation) -> (f64, f64) {
    let mut passes = [0.0; PASSES];
    for nanos in &mut passes {
        let begin = Instant::now();
        for _ in 0..POSES {
            black_box(offsets_mm(of));
        }
        *nanos = begin.elapsed().as_secs_f64() * 1e9 / f64::from(POSES);
    }
    passes.sort_by(f64::total_cmp);
    (passes[PASSES / 8], passes[PASSES / 2])
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
    let chain: Chain = CHAIN.parse().unwrap();
    let members = (chain
        .workpiece_side()
        .iter()
        .map(|axis| (axis.index(), true)))
    .chain(chain.tool_side().iter().map(|axis| (axis.index(), false)));
    let has = components_of(&chain);
    let of_component =
        |component: ErrorComponent| has.contains(&component).then(|| coefficients(component));
    let motion = |axis, direction| {
        of_component(ErrorComponent::motion(direction, axis)).unwrap_or_else(|| vec![0.0; 3])
    };
    let location = |axis, direction| {
        of_component(ErrorComponent::location(direction, axis)).map_or(0.0, |values| values[0])
    };
    json!({
        "geometry": {
            "chain": members.collect::<Vec<_>>(),
            "tool_offset": TOOL_OFFSET_MM,
            "origin": vec![ORIGIN_MM; 6],
            "coefficients": Axis::ALL.map(|axis| Axis::ALL.map(|direction| motion(axis, direction))),
            "location": Axis::ALL.map(|axis| Axis::ALL.map(|direction| location(axis, direction))),
        },
        "p0": of(|d| d.p0_mm),
        "k0": of(|d| d.k0_mm),
        "slope": of(|d| d.slope_mm_per_mm),
        "rate": of(|d| growth(d).rate_mm_s),
        "slope_rate": of(|d| growth(d).gradient_rate_per_s.sum()),
        "tau": of(|d| growth(d).time_constant_s),
        "lower": of(|d| d.span_mm.0),
        "upper": of(|d| d.span_mm.1),
        "cross": vectors(|d| d.cross_slope_mm_per_mm),
        "cross_origin": vectors(|d| d.cross_origin_mm),
        "pose": POSE,
        "elapsed_s": ELAPSED_S,
        "points": points_mm(),
        "deviation": Axis::LINEAR.map(|axis| {
            (0..POINTS).map(|point| deviation_mm(axis, point)).collect::<Vec<f64>>()
        }),
    })
    .to_string()
}

fn numpy(model: &ThermalModel) -> Option<PeerFigures> {
    let mut child = python::peer("bench_compensation.py")?
        .args([PEER_POSES.to_string(), PEER_PASSES.to_string()])
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
    let of = Compensation {
        thermal: model(),
        geometry: geometry(),
        positioning: tables(),
    };
    let (fastest, median) = nanos_per_pose(&of);
    println!(
        "thermal, geometric and positioning part, {CHAIN}, 41 components, per pose [ns]: fastest quarter of {PASSES} passes, median of all"
    );
    println!("ours     {fastest:>9.1} {median:>9.1}   budget {BUDGET_NANOS}");
    let Some(peer) = numpy(&of.thermal) else {
        return;
    };
    for (ours_mm, numpy_mm) in offsets_mm(&of).into_iter().zip(peer.offsets_mm) {
        let apart_mm = (ours_mm - numpy_mm).abs();
        assert!(apart_mm < AGREEMENT_MM, "{ours_mm} mm, numpy {numpy_mm} mm");
    }
    let (peer_fastest, peer_median) = (peer.fastest_nanos_per_pose, peer.nanos_per_pose);
    println!(
        "numpy    {peer_fastest:>9.1} {peer_median:>9.1}   ratio {:.0}",
        peer_fastest / fastest
    );
}
