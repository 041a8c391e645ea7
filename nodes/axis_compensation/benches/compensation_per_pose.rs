//! Time per pose: thermal and positioning parts alone, and a whole servo tick of three axes.

use axis_compensation::femtometre::{fm_from_mm, mm_from_fm};
use axis_compensation::parts::thermal_parts_at;
use axis_compensation::positioning::config::PositioningConfig;
use axis_compensation::positioning::deviation_table::DeviationTable;
use axis_compensation::positioning::direction::Direction;
use axis_compensation::positioning::dual_loop::{AxisReading, DualLoop};
use axis_compensation::positioning::offset::{OffsetSum, Reading};
use axis_compensation::{AxisCompensationConfig, AxisCompensationStage, Input};
use divan::{Bencher, black_box};
use metrology::drift::Extrapolate;
use metrology::sample::{AxisDrift, AxisState, DriftGrowth, ThermalModel};
use metrology::{Axis, AxisSet, PerAxis, Stage, Stamp};
use nalgebra::Vector3;

fn main() {
    divan::main();
}

fn model() -> ThermalModel {
    let mut axes = PerAxis::default();
    for axis in Axis::LINEAR {
        let mut cross = Vector3::new(1e-5, -2e-5, 3e-5);
        cross[axis.index()] = 0.0;
        axes[axis] = Some(AxisDrift {
            k0_mm: 0.01,
            slope_mm_per_mm: 5e-5,
            cross_slope_mm_per_mm: cross,
            span_mm: (-220.0, 220.0),
            growth: Axis::LINEAR.map(|source| {
                (source == axis).then_some(DriftGrowth {
                    rate_mm_s: 1e-6,
                    gradient_rate_per_s: Vector3::from_fn(|row, _| {
                        if row == axis.index() { 1e-9 } else { 0.0 }
                    }),
                    time_constant_s: 1800.0,
                })
            }),
            ..AxisDrift::default()
        });
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

/// The thermal part of X, Y and Z with cross terms and extrapolation in time.
#[divan::bench]
fn thermal_part(bencher: Bencher<'_, '_>) {
    let model = model();
    bencher.bench_local(|| {
        let p_mm = black_box(Vector3::new(12.0, -34.0, 56.0));
        let at = black_box(Stamp::from_nanos(400_000_000_000));
        thermal_parts_at(&model, &p_mm, at, Extrapolate::Hold)
    });
}

/// Both directions apart, 41 points, a mean of 2 µm.
fn table() -> DeviationTable {
    let positions_mm: Vec<_> = (0..41).map(|j| -300.0 + 15.0 * f64::from(j)).collect();
    let wave = |x_mm: f64| 5e-3 * (x_mm / 80.0).sin();
    let up_mm: Vec<_> = positions_mm.iter().map(|x_mm| wave(*x_mm)).collect();
    let down_mm: Vec<_> = positions_mm.iter().map(|x_mm| wave(*x_mm) + 4e-3).collect();
    DeviationTable::new(Axis::X, &positions_mm, &up_mm, &down_mm).expect("it ascends by 15 mm")
}

/// The positioning part of one pose of one axis: place in the table, straight line, sign.
#[divan::bench(sample_size = 10000)]
fn positioning_part(bencher: Bencher<'_, '_>) {
    let table = table();
    let sum = OffsetSum::new(Reading::RefreshedTable, 0.3, 0.2);
    bencher.bench_local(|| {
        let p_fm = fm_from_mm(black_box(12.3)).unwrap_or_default();
        let table_fm = table.deviation_fm(p_fm, black_box(Some(Direction::Up)));
        mm_from_fm(sum.offset_fm(table_fm))
    });
}

/// The dual loop of one axis at one state: direction, pass of points, offset.
#[divan::bench(sample_size = 10000)]
fn dual_loop_state(bencher: Bencher<'_, '_>) {
    let machine = serde_saphyr::from_str(MACHINE)
        .expect("the machine file of the first run is read by its tests");
    let config: PositioningConfig =
        serde_saphyr::from_str(POSITIONING).expect("the configuration is complete");
    let mut dual_loop = DualLoop::new(Axis::X, &config, &machine, 100_000_000)
        .expect("its numbers are inside their limits");
    let mut k = 0_u32;
    bencher.bench_local(|| {
        k = (k + 1) % 60_000;
        // Slow enough to refresh each point that is passed.
        let commanded_mm = 0.01 * f64::from(k) - 300.0;
        let reading = AxisReading {
            at: Stamp::from_nanos(0),
            dt_s: Some(1e-3),
            commanded_mm,
            motor_mm: commanded_mm,
            scale_mm: commanded_mm + 1e-3,
            others_mm: 0.0,
            is_on: true,
            follows: true,
        };
        dual_loop.observe(&reading, &mut |_| {});
        dual_loop.offset_mm()
    });
}

const MACHINE: &str = include_str!("../../../launch_configs/first_run/machine.yaml");

const POSITIONING: &str = "{reading: refreshed_table, weight: 0.3, directions: apart, thermal_part: true, \
     measured_limit_um: 50.0, start_points_mm: [-30.0, -15.0, 0.0, 15.0, 30.0, 45.0], \
     start_deviations_um: [1.0, 2.0, 3.0, 2.0, 1.0, 0.0]}";

/// One axis state in, one compensation out, with a dual loop on no, one or two axes.
#[divan::bench(args = ["", "X", "X Y"], sample_size = 1000)]
fn servo_tick(bencher: Bencher<'_, '_>, dual_loops: &str) {
    let of_axis = |axis: &str| format!("{axis}: {POSITIONING}");
    let positioning: Vec<_> = dual_loops.split_whitespace().map(of_axis).collect();
    let positioning = positioning.join(", ");
    let limits =
        "size_limit_um: 100.0, rate_limit_um_per_s: 50.0, acceleration_limit_um_per_s2: 500.0";
    let config: AxisCompensationConfig = serde_saphyr::from_str(&format!(
        "{{axes: {{X: {{{limits}}}, Y: {{{limits}}}, Z: {{{limits}}}}}, extrapolate: hold, \
         physical_rate_um_per_min: 3.0, jump_margin_um: 2.0, expanded_uncertainty_limit_um: 1000.0, hold_s: 1.0, fade_s: 2.0, positioning: {{{positioning}}}}}"
    ))
    .expect("the configuration above is complete");
    let machine = serde_saphyr::from_str(MACHINE)
        .expect("the machine file of the first run is read by its tests");
    let mut stage = AxisCompensationStage::new(&config, &machine).expect("its limits are inside");
    let mut out = Vec::with_capacity(16);
    let Ok(()) = stage.step(
        Stamp::from_nanos(0),
        Input::Model(Box::new(model())),
        &mut out,
    );
    let mut nanos = 0;
    bencher.bench_local(|| {
        nanos += 1_000_000;
        out.clear();
        let commanded = PerAxis([12.0, -34.0, 56.0, 0.0, 0.0, 0.0]);
        let state = AxisState {
            received_at: Stamp::from_nanos(nanos),
            controller_at: Stamp::from_nanos(nanos),
            axes: AxisSet::XYZ,
            commanded: black_box(commanded),
            motor: commanded,
            scale: commanded,
            velocity: PerAxis::default(),
        };
        let Ok(()) = stage.step(Stamp::from_nanos(nanos), Input::State(state), &mut out);
        black_box(&out);
    });
}
