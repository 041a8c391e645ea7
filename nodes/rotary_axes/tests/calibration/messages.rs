//! The published model, read by whoever compensates with it.

use machine::SphereDesign;
use machine::volumetric::VolumetricModel;
use metrology::sample::{CurveForm, TestKind};
use metrology::{Axis, PerAxis};
use nalgebra::Vector3;

use crate::bench::{BALL_MM, Wrong, degrees, file, reading_mm};
use crate::faults::{Rig, good_poses};

#[test]
fn val_the_published_model_undoes_the_machine_that_was_measured() {
    let wrong = Wrong {
        run_out_c: 0.004,
        ..Wrong::drawn(21)
    };
    let twice: Vec<PerAxis<f64>> = good_poses(24)
        .iter()
        .chain(&good_poses(24))
        .copied()
        .collect();
    let mut rig = Rig::new();
    rig.test(TestKind::Rotary, &wrong, &twice, |_, _| true);
    let model = &rig.models()[0];
    assert!(
        model
            .curves
            .iter()
            .any(|curve| curve.form == CurveForm::Table),
        "{:?}",
        rig.said()
    );
    let n: usize = model
        .curves
        .iter()
        .map(|curve| curve.coefficient.len())
        .sum();
    assert_eq!(model.covariance.shape(), (n, n));
    let design = SphereDesign::new(&file()).unwrap();
    let volumetric = VolumetricModel::new(design.kinematics(), model).unwrap();
    let (mut before, mut after) = (0.0_f64, 0.0_f64);
    for (a, c) in [(-50.0, 15.0), (-20.0, 200.0), (10.0, -70.0), (-35.0, 100.0)] {
        let pose = degrees(a, c);
        // Against the place of the sphere with the axes at zero, which a datum would take.
        let truth = reading_mm(&wrong, &BALL_MM, &pose);
        let row = design.row(&BALL_MM, &pose);
        let offset = volumetric
            .command_offset(&row.positions, &Vector3::zeros())
            .unwrap();
        before = before.max((truth - row.centre_mm).norm());
        after = after.max((truth - row.centre_mm - offset.xyz()).norm());
    }
    eprintln!(
        "reading off by {:.2} um, with the offset by {:.2} um",
        before * 1e3,
        after * 1e3
    );
    assert!(after < 0.0012 && before > 10.0 * after, "{before} {after}");
}

#[test]
fn what_is_not_seen_is_not_published_as_a_number_of_its_own() {
    let flat: Vec<_> = (0..12).map(|k| degrees(0.0, f64::from(k) * 30.0)).collect();
    let mut rig = Rig::new();
    rig.test(TestKind::Rotary, &Wrong::drawn(4), &flat, |_, _| true);
    let model = &rig.models()[0];
    for curve in &model.curves {
        let of_a = curve.component.of == Axis::A;
        assert_eq!(curve.estimable[0], !of_a, "{}", curve.component);
        assert_eq!(curve.standard_uncertainty[0].is_nan(), of_a);
    }
    assert!(
        rig.said()
            .iter()
            .any(|line| line.contains("EY0A, EZ0A, EB0A, EC0A cannot be told apart"))
    );
    assert!(rig.said().iter().any(|line| line.starts_with("low_merit")));
    assert_eq!((model.n_unknowns, model.rank), (11, 7));
}
