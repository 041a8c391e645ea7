//! The volumetric error against its own formulas written out, and against a matrix product of its own.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod bodies;
mod inverse;
mod model;
mod sensitivity;

use machine::{Chain, Kinematics};
use metrology::sample::{ErrorCurve, GeometryModel};
use metrology::{Axis, PerAxis, Stamp};
use nalgebra::DMatrix;

/// Chains of every kind: three axes in each order of tables and heads, both rotary axes on tables,
/// in the head, and one of each.
const CHAINS: [&str; 14] = [
    "[w X' Y' b Z t]",
    "[w Y' X' b Z t]",
    "[w b X Y Z t]",
    "[w X' Y' Z' b t]",
    "[w Y' b Z X t]",
    "[w C' A' Y' b X Z t]",
    "[w C' B' X' b Y Z t]",
    "[w A' C' X' b Y Z t]",
    "[w b X Y Z C A t]",
    "[w X' b Y Z C B t]",
    "[w b Z Y X A C t]",
    "[w C' Y' b X Z A t]",
    "[w C' X' b Y Z B t]",
    "[w X' C' Y' b Z B t]",
];

fn chain(text: &str) -> Chain {
    text.parse().unwrap()
}

/// A machine whose lines of rotation meet in no point.
fn machine(text: &str) -> Kinematics {
    let mut origin_mm = PerAxis::<[f64; 3]>::default();
    origin_mm[Axis::A] = [3.0, -17.0, 50.0];
    origin_mm[Axis::B] = [-20.0, 5.0, 35.0];
    origin_mm[Axis::C] = [12.0, 8.0, -4.0];
    Kinematics::of_chain(chain(text), origin_mm)
}

/// As it is published.
fn model(chain: &str, curves: Vec<ErrorCurve>) -> GeometryModel {
    GeometryModel {
        at: Stamp::from_nanos(0),
        chain: chain.to_owned(),
        curves,
        covariance: DMatrix::zeros(0, 0),
        combinations: Vec::new(),
        n_samples: 0,
        n_unknowns: 0,
        rank: 0,
        residual_standard_deviation_mm: 0.0,
        sequence: 0,
    }
}
