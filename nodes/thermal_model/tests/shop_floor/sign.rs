//! The sign and the uncertainty, from physics rather than from the formula.

use crate::shop::{Shop, U_MM, config};
use metrology::Axis;
use metrology::Stamp;
use metrology::drift::{Extrapolate, axis_drift_at, drift_standard_uncertainty_mm};
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;
use thermal_model::latency_share::LatencyShares;
use thermal_model::reference::FaceDrift;
use thermal_model::two_block::{SlopeLimit, line};

/// A screw that is held at one end and has grown: where the slide stands when the encoder reads p.
fn slide_mm(reading_mm: f64, grown: f64) -> f64 {
    const FIXED_MM: f64 = -400.0;
    FIXED_MM + (reading_mm - FIXED_MM) * (1.0 + grown)
}

/// The reading at which the slide stands at a place, found by search: no formula of the model.
fn reading_at(place_mm: f64, grown: f64) -> f64 {
    let (mut low, mut high) = (place_mm - 1.0, place_mm + 1.0);
    for _ in 0..200 {
        let middle = low.midpoint(high);
        if slide_mm(middle, grown) < place_mm {
            low = middle
        } else {
            high = middle
        }
    }
    low.midpoint(high)
}

#[test]
fn commanding_p_plus_d_lands_at_the_place_that_p_was_when_cold() {
    // 11.5e-6 per K, 5 K warmer.
    let grown = 11.5e-6 * 5.0;
    let mut shop = Shop::new(config(", relaxation: {enabled: false}"));
    shop.cold();
    shop.wait_s(900.0);
    shop.cycle(false, |axis, corner| match axis {
        Axis::X => reading_at(corner.x, grown),
        _ => corner[axis.index()],
    });
    for p_mm in [-220.0, -60.0, 0.0, 130.0, 220.0, 310.0] {
        let point = Vector3::new(p_mm, 0.0, 0.0);
        let d_mm = axis_drift_at(
            shop.model(),
            Axis::X,
            &point,
            shop.now(),
            Extrapolate::Linear,
        )
        .unwrap();
        let without_um = 1e3 * (slide_mm(p_mm, grown) - p_mm);
        let with_um = 1e3 * (slide_mm(p_mm + d_mm, grown) - p_mm);
        println!("p {p_mm}: error {without_um:.2} µm, compensated {with_um:.6} µm");
        assert!(without_um > 8.0, "the warm screw must be seen");
        assert!(with_um.abs() < 1e-6);
        // Error = actual − commanded is −d to first order.
        assert!((without_um + 1e3 * d_mm).abs() < 0.01);
    }
}

#[test]
fn the_stated_uncertainty_covers_the_truth_in_95_percent_of_seeds() {
    let noise = Normal::new(0.0, U_MM).unwrap();
    let mut rng = Pcg64Mcg::seed_from_u64(1000);
    let limit = SlopeLimit {
        travel_mm: 640.0,
        error_mm: 0.003,
    };
    let truth_mm = |p_mm: f64| 0.012 + 4e-5 * p_mm;
    let points_mm = [-220.0, 0.0, 220.0, 320.0];
    let mut covered = [0; 4];
    let mut shop = Shop::new(config(""));
    shop.cold();
    let mut model = shop.model().clone();
    for _ in 0..1000 {
        let mut face = |x_mm: f64| {
            let (cold, hot) = (noise.sample(&mut rng), noise.sample(&mut rng));
            FaceDrift {
                block: 0,
                axis: Axis::X,
                point_mm: Vector3::new(x_mm, 0.0, 0.0),
                drift_mm: truth_mm(x_mm) + hot - cold,
                standard_uncertainty_mm: U_MM * 2_f64.sqrt(),
                hot_uncertainty_mm: U_MM,
                latency: LatencyShares::default(),
                at: Stamp::from_nanos(0),
            }
        };
        let drift = line(Axis::X, &face(-220.0), &face(220.0), limit).drift;
        for (p_mm, count) in points_mm.iter().zip(&mut covered) {
            let d_mm = drift.k0_mm + drift.slope_mm_per_mm * (p_mm - drift.p0_mm);
            model.axes[Axis::X] = Some(drift);
            let point_mm = Vector3::new(*p_mm, 0.0, 0.0);
            let u_mm =
                drift_standard_uncertainty_mm(&model, Axis::X, &point_mm, Extrapolate::Linear);
            let expanded_mm = 1.96 * u_mm.unwrap();
            *count += usize::from((d_mm - truth_mm(*p_mm)).abs() < expanded_mm);
        }
    }
    println!("covered {covered:?} of 1000");
    assert!(
        covered.iter().all(|c| (930..=970).contains(c)),
        "{covered:?}"
    );
}
