//! Time per pose: the thermal part alone, and a whole servo tick of three axes.

use axis_compensation::parts::parts_at;
use axis_compensation::{AxisCompensationConfig, AxisCompensationStage, Input};
use divan::{Bencher, black_box};
use metrology::drift::Extrapolate;
use metrology::sample::{AxisDrift, AxisState, ThermalModel};
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
            rate_mm_s: 1e-6,
            slope_rate_per_s: 1e-9,
            time_constant_s: 1800.0,
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
        Axis::LINEAR.map(|axis| parts_at(&model, axis, &p_mm, at, Extrapolate::Hold))
    });
}

/// One axis state in, one compensation out.
#[divan::bench(sample_size = 1000)]
fn servo_tick(bencher: Bencher<'_, '_>) {
    let machine = include_str!("../../../launch_configs/first_run/machine.yaml");
    let limits =
        "size_limit_um: 100.0, rate_limit_um_per_s: 50.0, acceleration_limit_um_per_s2: 500.0";
    let config: AxisCompensationConfig = serde_saphyr::from_str(&format!(
        "{{axes: {{X: {{{limits}}}, Y: {{{limits}}}, Z: {{{limits}}}}}, extrapolate: hold, \
         physical_rate_um_per_min: 3.0, jump_margin_um: 2.0, hold_s: 1.0, fade_s: 2.0}}"
    ))
    .expect("the configuration above is complete");
    let machine = serde_saphyr::from_str(machine)
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
