//! The first-run machine after four hours of work: how far it drifts, and how much of that a function
//! linear in the axes' positions could explain.

use fake_cnc::Plant;
use fake_cnc::plant::Place;
use metrology::stamp::Span;
use metrology::{Axis, PerAxis};
use nalgebra::{DMatrix, DVector, Matrix4, Vector3, Vector4};

use crate::plant::rig::{Command, PERIOD, PERIOD_S, Servo, machine, truth};

const HOURS: u32 = 4;
const SPINDLE_RPM: f64 = 8000.0;
const LOW_BLOCK: Vector3<f64> = Vector3::new(-220.0, -180.0, 20.0);
const HIGH_BLOCK: Vector3<f64> = Vector3::new(220.0, 180.0, 200.0);

/// Reciprocating production motion: strokes shorter than the travel and away from its middle.
fn production(t_s: f64) -> Command {
    let mut command = Command::default();
    for (axis, middle_mm, stroke_mm, period_s) in [
        (Axis::X, 50.0, 110.0, 4.0),
        (Axis::Y, -30.0, 90.0, 3.7),
        (Axis::Z, 150.0, 60.0, 3.1),
    ] {
        let rate = std::f64::consts::TAU / period_s;
        let (sin, cos) = (rate * t_s).sin_cos();
        command.position[axis] = middle_mm + stroke_mm * sin;
        command.velocity[axis] = stroke_mm * rate * cos;
        command.acceleration[axis] = -stroke_mm * rate * rate * sin;
    }
    command
}

fn work(plant: &mut Plant) {
    plant.settle_at(&production(0.0).position);
    let mut servo = Servo::default();
    for tick in 0..HOURS * 3_600_000 {
        let demand = servo.demand(plant, &production(f64::from(tick) * PERIOD_S));
        plant.step(&demand, SPINDLE_RPM, PERIOD);
    }
}

#[test]
fn val_half_an_hour_of_strokes_in_coarse_steps_warms_as_in_servo_periods() {
    const MINUTES: u32 = 30;
    let fine = {
        let mut plant = Plant::new(&machine(), &truth()).unwrap();
        plant.settle_at(&production(0.0).position);
        let mut servo = Servo::default();
        for tick in 0..MINUTES * 60_000 {
            let demand = servo.demand(&plant, &production(f64::from(tick) * PERIOD_S));
            plant.step(&demand, SPINDLE_RPM, PERIOD);
        }
        plant
    };
    let coarse = {
        let mut plant = Plant::new(&machine(), &truth()).unwrap();
        plant.settle_at(&production(0.0).position);
        for step in 1..=MINUTES * 240 {
            let slides = production(f64::from(step) * 0.25).position;
            plant.work(&slides, SPINDLE_RPM, Span::from_nanos(250_000_000));
        }
        plant
    };
    assert_eq!(fine.elapsed(), coarse.elapsed());
    for axis in Axis::LINEAR {
        let [a, b] = [&fine, &coarse].map(|plant| {
            let growth = screw_growth_um(plant, axis);
            growth[4] - growth[0]
        });
        assert!((b / a - 1.0).abs() < 0.03, "{axis}: {a} {b}");
    }
    for place in [Place::SpindleFront, Place::Head, Place::Bed] {
        let [a, b] = [&fine, &coarse].map(|plant| plant.true_temp_degc(place) - 20.0);
        assert!((a - b).abs() < 0.01, "{place}: {a} {b}");
    }
}

#[test]
fn a_machine_that_is_off_cools_whatever_stands_in_its_file() {
    let mut file = truth();
    file.heat.standing_heat_w.insert(Place::Bed, 500.0);
    file.heat.shop_air.day_amplitude_k = 0.0;
    file.heat.shop_air.draught_k = 0.0;
    let mut plant = Plant::new(&machine(), &file).unwrap();
    let bed_degc = |plant: &mut Plant, is_on: bool, hours: u32| {
        plant.switch(is_on);
        for _ in 0..hours * 60 {
            plant.work(&PerAxis::default(), 0.0, Span::from_nanos(60_000_000_000));
        }
        plant.true_temp_degc(Place::Bed)
    };
    let warm = bed_degc(&mut plant, true, 6);
    let cold = bed_degc(&mut plant, false, 12);
    assert!(
        warm > 21.0 && cold - 20.0 < 0.7 * (warm - 20.0),
        "{warm} {cold}"
    );
}

/// Points of the blocks' span, (-220, -180, 20) to (220, 180, 200).
fn span() -> Vec<Vector3<f64>> {
    let share = |i: u32, n: u32| 2.0 * f64::from(i) / f64::from(n) - 1.0;
    let mut points = Vec::new();
    for i in 0..=8 {
        for j in 0..=8 {
            for k in 0..=4 {
                points.push(Vector3::new(
                    220.0 * share(i, 8),
                    180.0 * share(j, 8),
                    110.0 + 90.0 * share(k, 4),
                ));
            }
        }
    }
    points
}

fn error_um(plant: &Plant, point: &Vector3<f64>) -> Vector3<f64> {
    let pose = PerAxis([point.x, point.y, point.z, 0.0, 0.0, 0.0]);
    plant.tool_error_at_motor_pose_mm(&pose, &pose) * 1e3
}

fn p95(norms: impl Iterator<Item = f64>) -> f64 {
    let mut norms: Vec<f64> = norms.collect();
    norms.sort_by(f64::total_cmp);
    norms[norms.len() * 95 / 100]
}

/// What is left, as p95 of the norm, after a least-squares fit of each component.
fn left_by(
    points: &[Vector3<f64>],
    drift: &[Vector3<f64>],
    regressors: impl Fn(usize, &Vector3<f64>) -> Vec<f64>,
) -> f64 {
    let mut left = drift.to_vec();
    for component in 0..3 {
        let rows: Vec<_> = points
            .iter()
            .map(|point| regressors(component, point))
            .collect();
        let design = DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j]);
        let value = DVector::from_fn(drift.len(), |i, _| drift[i][component]);
        let fit = design.clone().svd(true, true).solve(&value, 1e-12).unwrap();
        for (left, rest) in left.iter_mut().zip((value - design * fit).iter()) {
            left[component] = *rest;
        }
    }
    p95(left.iter().map(Vector3::norm))
}

/// What two blocks on the diagonal predict: a line per axis through what is seen at them.
fn two_blocks(
    seen: impl Fn(&Vector3<f64>) -> Vector3<f64>,
) -> impl Fn(&Vector3<f64>) -> Vector3<f64> {
    let (at_low, at_high) = (seen(&LOW_BLOCK), seen(&HIGH_BLOCK));
    move |point| {
        let share = (point - LOW_BLOCK).component_div(&(HIGH_BLOCK - LOW_BLOCK));
        at_low + share.component_mul(&(at_high - at_low))
    }
}

/// What four blocks predict: the two of the diagonal and low ones at the other corners carry a
/// whole affine field.
fn four_blocks(
    seen: impl Fn(&Vector3<f64>) -> Vector3<f64>,
) -> impl Fn(&Vector3<f64>) -> Vector3<f64> {
    let blocks = [
        LOW_BLOCK,
        HIGH_BLOCK,
        Vector3::new(220.0, -180.0, 20.0),
        Vector3::new(-220.0, 180.0, 20.0),
    ];
    let design = Matrix4::from_fn(|i, j| if j == 0 { 1.0 } else { blocks[i][j - 1] });
    let inverse = design.try_inverse().unwrap();
    let seen = blocks.map(|block| seen(&block));
    move |point| {
        Vector3::from_fn(|component, _| {
            let values = Vector4::from_fn(|i, _| seen[i][component]);
            (inverse * values).dot(&Vector4::new(1.0, point.x, point.y, point.z))
        })
    }
}

#[test]
fn val_four_hours_of_work_drift_in_the_proportions_of_a_machining_centre() {
    let mut plant = Plant::new(&machine(), &truth()).unwrap();
    let cold = plant.clone();
    work(&mut plant);
    let drift_at = |point: &Vector3<f64>| error_um(&plant, point) - error_um(&cold, point);
    let points = span();
    let drift: Vec<_> = points.iter().map(drift_at).collect();
    let left_after = |model: &dyn Fn(&Vector3<f64>) -> Vector3<f64>| {
        p95(points
            .iter()
            .zip(&drift)
            .map(|(point, drift)| (drift - model(point)).norm()))
    };

    let whole = p95(drift.iter().map(Vector3::norm));
    let with_cold_errors = p95(points.iter().map(|point| error_um(&plant, point).norm()));
    let line = left_by(&points, &drift, |component, point| {
        vec![1.0, point[component]]
    });
    let affine = left_by(&points, &drift, |_, point| {
        vec![1.0, point.x, point.y, point.z]
    });
    let two = left_after(&two_blocks(drift_at));
    let four = left_after(&four_blocks(drift_at));
    eprintln!(
        "p95 in the blocks' span, um: drift {whole:.1}, with cold errors {with_cold_errors:.1}; left \
         by the best line per axis {line:.2}, by two blocks {two:.2}, by the best affine field \
         {affine:.2}, by four blocks {four:.2}"
    );
    for corner in [
        LOW_BLOCK,
        Vector3::new(0.0, 0.0, 20.0),
        Vector3::new(0.0, 0.0, 200.0),
        HIGH_BLOCK,
    ] {
        eprintln!("drift at {corner:?}: {:.1?} um", drift_at(&corner));
    }
    assert!(
        (20.0..60.0).contains(&with_cold_errors),
        "{with_cold_errors}"
    );
    assert!(
        two < whole / 5.0 && four < whole / 8.0,
        "{whole} {two} {four}"
    );
    assert!(
        affine > 0.5,
        "the hot zone must leave what no affine field explains: {affine}"
    );

    for axis in Axis::LINEAR {
        let growth = screw_growth_um(&plant, axis);
        eprintln!("screw {axis}, over its travel: {growth:.1?} um");
        let over_travel = (growth[4] - growth[0]).abs();
        assert!((15.0..40.0).contains(&over_travel), "{axis}: {over_travel}");
    }
    let air_k = plant.sensor_reading("ambient").unwrap() - 20.0;
    assert!((1.2..2.8).contains(&air_k), "{air_k}");
}

/// Growth at five places along the travel.
fn screw_growth_um(plant: &Plant, axis: Axis) -> [f64; 5] {
    let [from_mm, to_mm] = machine().linear(axis).unwrap().travel_mm;
    std::array::from_fn(|i| {
        let share = i as f64 / 4.0;
        plant.true_screw_growth_mm(axis, from_mm + share * (to_mm - from_mm)) * 1e3
    })
}
