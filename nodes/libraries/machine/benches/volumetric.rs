//! Time per pose of the volumetric error and its inverse, three and five axes with every component.

use divan::{Bencher, black_box};
use machine::volumetric::{VolumetricModel, components_of};
use machine::{Chain, Kinematics};
use metrology::drift::Extrapolate;
use metrology::sample::{CurveForm, ErrorCurve, GeometryModel};
use metrology::{PerAxis, Stamp};
use nalgebra::{DMatrix, Vector3};

fn main() {
    divan::main();
}

const CHAINS: [&str; 3] = [
    "[w X' Y' b Z t]",
    "[w C' A' Y' b X Z t]",
    "[w b X Y Z C A t]",
];

/// Cubics without constant, and constants for the location errors: 10 µm and 10 µrad at 300 mm.
fn model(chain: &str) -> VolumetricModel {
    let chain: Chain = chain.parse().expect("a chain of the list");
    let curves = components_of(&chain).into_iter().map(|component| {
        let (form, power, coefficient) = if component.is_location {
            (CurveForm::Constant, Vec::new(), vec![1e-5])
        } else {
            (
                CurveForm::Polynomial,
                vec![1, 2, 3],
                vec![3e-8, 1e-10, -3e-13],
            )
        };
        ErrorCurve {
            component,
            form,
            origin: 0.0,
            power,
            position: Vec::new(),
            coefficient,
            standard_uncertainty: Vec::new(),
            estimable: Vec::new(),
            span: (-300.0, 300.0),
        }
    });
    let published = GeometryModel {
        at: Stamp::from_nanos(0),
        chain: chain.to_string(),
        curves: curves.collect(),
        covariance: DMatrix::zeros(0, 0),
        combinations: Vec::new(),
        n_samples: 0,
        n_unknowns: 0,
        rank: 0,
        residual_standard_deviation_mm: 0.0,
        sequence: 0,
    };
    let kinematics = Kinematics::of_chain(chain, PerAxis([[1.0, 2.0, 3.0]; 6]));
    VolumetricModel::new(&kinematics, &published)
        .expect("components of the chain itself")
        .with_extrapolate(Extrapolate::Hold)
}

fn pose() -> (PerAxis<f64>, Vector3<f64>) {
    let positions = PerAxis([12.0, -34.0, 56.0, 0.4, 0.0, 1.2]);
    (
        black_box(positions),
        black_box(Vector3::new(0.0, 0.0, -150.0)),
    )
}

/// The tip's error.
#[divan::bench(args = CHAINS)]
fn tip_error(bencher: Bencher<'_, '_>, chain: &str) {
    let model = model(chain);
    bencher.bench_local(|| {
        let (positions, tool) = pose();
        model.tip_error_mm(&positions, &tool)
    });
}

/// The command that undoes it, one Newton step.
#[divan::bench(args = CHAINS)]
fn command_offset(bencher: Bencher<'_, '_>, chain: &str) {
    let model = model(chain);
    bencher.bench_local(|| {
        let (positions, tool) = pose();
        model.command_offset(&positions, &tool)
    });
}

/// The same, iterated.
#[divan::bench(args = CHAINS)]
fn exact_command_offset(bencher: Bencher<'_, '_>, chain: &str) {
    let model = model(chain);
    bencher.bench_local(|| {
        let (positions, tool) = pose();
        model.exact_command_offset(&positions, &tool)
    });
}
