//! ISO 230-10: a sphere, and one surface touched again and again, on a machine that drifts.

use std::f64::consts::TAU;

use iso230::ExpandedLength;
use iso230::budget::{DeviceUncertainty, Expansion};
use iso230::probing::{Artefact, Side, single_point, sphere};
use nalgebra::{Matrix4, Vector3, Vector4};
use rand::Rng;
use rand_pcg::Pcg64Mcg;

use super::linear::range;
use super::{Drift, Held, MACHINES, UM, between, hold_clause, machine, normal, shares};

/// Height on the unit sphere and number of the points there: 25, on the half that a probe reaches.
const RINGS: [(f64, u32); 5] = [(1.0, 1), (0.9, 4), (0.7, 6), (0.4, 6), (0.05, 8)];
/// Touches of one surface.
const TOUCHES: u32 = 10;
/// Coefficient of expansion of scale and artefact, 1/K, and half the interval of the scale's.
const ALPHA: f64 = 11.5e-6;
const HALF_ALPHA: f64 = 1e-6;

fn directions() -> Vec<Vector3<f64>> {
    let ring = |(z, n): (f64, u32)| {
        let about = (1.0 - z * z).sqrt();
        (0..n).map(move |k| {
            let (sin, cos) = (TAU * (f64::from(k) + 0.3 * f64::from(n)) / f64::from(n)).sin_cos();
            Vector3::new(about * cos, about * sin, z)
        })
    };
    RINGS.into_iter().flat_map(ring).collect()
}

/// Lobes about Z at a direction; nothing at the pole.
fn lobes(direction: &Vector3<f64>, n: f64, phase: f64) -> f64 {
    let about = direction.y.atan2(direction.x);
    (n * about + phase).cos() * direction.xy().norm()
}

/// Range and mean of radial deviations about the least-squares sphere, in the first order of the deviations.
fn about_own_centre(directions: &[Vector3<f64>], radial_mm: &[f64]) -> [f64; 2] {
    let row = |d: &Vector3<f64>| Vector4::new(d.x, d.y, d.z, 1.0);
    let (mut normal, mut right) = (Matrix4::<f64>::zeros(), Vector4::<f64>::zeros());
    for (d, r) in directions.iter().zip(radial_mm) {
        normal += row(d) * row(d).transpose();
        right += row(d) * *r;
    }
    let fit = normal.lu().solve(&right).unwrap();
    let left = directions
        .iter()
        .zip(radial_mm)
        .map(|(d, r)| r - row(d).dot(&fit));
    [range(&left.collect::<Vec<f64>>()), fit.w]
}

/// What is hidden of one sphere and its probe.
struct Hidden {
    artefact: Artefact,
    /// Radial deviations of the touches as the machine makes them, and with the artefact's own errors, mm.
    radial_mm: [Vec<f64>; 2],
    /// By how much the warm scale counts too little of a length of the artefact, mm/mm.
    growth: f64,
}

fn hidden(rng: &mut Pcg64Mcg, directions: &[Vector3<f64>]) -> Hidden {
    let warm_k = between(rng, -3.0, 7.0);
    let half_width_k = between(rng, 0.1, 0.5);
    let (form_mm, u_form_mm) = (UM * between(rng, 0.05, 0.5), UM * between(rng, 0.02, 0.1));
    let u_diameter_mm = UM * between(rng, 0.1, 0.4);
    let (lobing, scatter_mm) = (
        [UM * between(rng, 0.0, 1.5), between(rng, 0.0, TAU)],
        UM * between(rng, 0.05, 0.5),
    );
    let size_mm = UM * normal(rng);
    let own = [f64::from(rng.random_range(2..6_u8)), between(rng, 0.0, TAU)];
    let shape: Vec<f64> = directions
        .iter()
        .map(|d| lobes(d, own[0], own[1]))
        .collect();
    let true_form = (form_mm + u_form_mm * normal(rng)) / range(&shape);
    let off_mm = u_diameter_mm * normal(rng);
    let touched: Vec<f64> = directions
        .iter()
        .map(|d| lobing[0] * lobes(d, 3.0, lobing[1]) + scatter_mm * normal(rng) + size_mm / 2.0)
        .collect();
    let with_artefact = touched.iter().zip(&shape);
    let read = with_artefact.map(|(r, f)| r + true_form * f + off_mm / 2.0);
    let read = read.collect();
    let scale_per_k = ALPHA + HALF_ALPHA * between(rng, -1.0, 1.0);
    let scale_k = warm_k + half_width_k * between(rng, -1.0, 1.0);
    Hidden {
        artefact: Artefact {
            diameter_mm: between(rng, 20.0, 40.0),
            diameter_uncertainty: DeviceUncertainty {
                expanded_uncertainty_mm: 2.0 * u_diameter_mm,
                expanded_uncertainty_per_length: 0.0,
                coverage_factor: 2.0,
            },
            form_mm,
            form_standard_uncertainty_mm: u_form_mm,
            expansion: Expansion {
                temperature_deviation_k: warm_k,
                temperature_half_width_k: half_width_k,
                expansion_per_k: ALPHA,
                expansion_half_width_per_k: HALF_ALPHA,
            },
            stylus_radius_mm: 0.0,
            side: Side::Outside,
        },
        radial_mm: [touched, read],
        growth: ALPHA * warm_k - scale_per_k * scale_k,
    }
}

fn held(name: &'static str, figure: ExpandedLength, truth: f64) -> Held {
    Held {
        name,
        value: figure.value_mm,
        expanded: figure.expanded_uncertainty_mm,
        truth,
    }
}

fn tested(seed: u64) -> Vec<Held> {
    let mut rng = machine(seed, 6);
    let directions = directions();
    let Hidden {
        artefact,
        radial_mm: [touched, read],
        growth,
    } = hidden(&mut rng, &directions);
    let size_mm = UM * between(&mut rng, 0.05, 0.4);
    let drifts = [0; 3].map(|_| Drift::draw(&mut rng, size_mm));
    let watched = [0, 1, 2].map(|i| drifts[i].watched_mm(&mut rng));
    let n = directions.len() as f64;
    let mut points = vec![];
    for (k, (d, r)) in directions.iter().zip(&read).enumerate() {
        let drift = [0, 1, 2].map(|i| drifts[i].at(k as f64 / n, &mut rng));
        let radius_mm = artefact.diameter_mm / 2.0 * (1.0 + growth) + r;
        points.push(d * radius_mm + Vector3::from(drift));
    }
    let greatest_mm = watched.into_iter().fold(f64::MIN, f64::max);
    let found = sphere(&points, &artefact, greatest_mm).unwrap();
    let [form_mm, mean_mm] = about_own_centre(&directions, &touched);
    // One surface, a moment later.
    let scatter_mm = UM * between(&mut rng, 0.05, 0.5);
    let drift = Drift::draw(&mut rng, size_mm);
    let watched_mm = drift.watched_mm(&mut rng);
    let (mut truth_mm, mut read_mm) = (vec![], vec![]);
    for k in 0..TOUCHES {
        let at_mm = scatter_mm * normal(&mut rng);
        truth_mm.push(at_mm);
        read_mm.push(at_mm + drift.at(f64::from(k) / f64::from(TOUCHES), &mut rng));
    }
    let one = single_point(&read_mm, watched_mm).unwrap();
    vec![
        held("P_FTU,3D", found.form_error, form_mm),
        held("size error", found.size_error, 2.0 * mean_mm),
        held("R_SPT", one.repeatability, range(&truth_mm)),
    ]
}

#[test]
fn iso230_10_u_holds_what_an_exact_sphere_at_rest_would_have_shown() {
    let all: Vec<Vec<Held>> = (0..MACHINES).map(tested).collect();
    // Shares by numpy: `tests/validation/coverage_of_u.py`.
    hold_clause(&shares("ISO 230-10", &all), &[]);
}
