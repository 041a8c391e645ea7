//! The published separation of one circle beside what the same circle determines.
//!
//! # Model
//!
//! Two members of the general solution of `published`, equation (4), are printed: that with U = 0, which the
//! source takes, and that with another U. Both have one trace, since X [I − (XᵀX)⁻XᵀX] = 0. Beside them stands
//! for each unknown whether the radial readings of the circle determine it by themselves:
//!
//! ```text
//!   ΔR = X β + c_u cos θ + c_v sin θ − ½ Σ_a b_a sign_a n_a                             (1)
//!   unknown j is seen by itself  ⇔  (X⁺X)_jj = 1                                        (2)
//!   station of equation k = 0 to 13:  floor[(k + s) n / 14],   s = 0 and s = 1/2         (3)
//! ```
//!
//! (1) has the centre c of the trace, which every plate has by how it was put down, and the lost motion b of
//! both axes. What (2) does not grant is a number of the method and not of the machine.
//!
//! The source solves any 14 of its 360 equations. Two such choices (3), both spaced evenly and with no station in common,
//! stand beside the solution of all: how far they are apart is what the choice decides.
//!
//! # Agreement
//! `val_a_scale_error_alone_is_printed_as_errors_that_are_not_there`: the determined sums hold the truth to
//! 1e-8 mm, while the single numbers are off by a third and more.

use machine::Kinematics;

use crate::error::IdentifyError;
use crate::identify::{
    Disturbed, Identification, IdentifyOptions, Noise, PlateCertificate, identify,
};
use crate::published::{
    RadialSystem, any_stations, fourteen_unknowns, of_recording, solve, trace_mm,
};
use crate::recording::Recording;
use crate::spectrum::Visibility;
use crate::unknown::{Nuisances, Unknown};

/// Equations that the source solves.
const EQUATIONS: usize = 14;

/// One of the published unknowns.
#[derive(Clone, Debug, PartialEq)]
pub struct Compared {
    /// Which.
    pub unknown: Unknown,
    /// As the source prints it, U = 0, mm at the radius.
    pub published_mm: f64,
    /// As another U prints it, mm at the radius.
    pub other_mm: f64,
    /// As either choice of 14 stations prints it with U = 0, mm at the radius; `None` without [`Comparison::fourteen`].
    pub fourteen_mm: Option<[f64; 2]>,
    /// Standard uncertainty of the published value, (5) of `published`, mm at the radius; means nothing where the circle does not
    /// determine it.
    pub standard_uncertainty_mm: f64,
    /// Whether the circle determines it, (2).
    pub visibility: Visibility,
    /// Its own unit per mm at the radius.
    pub scale: f64,
}

/// Two choices of 14 stations.
#[derive(Clone, Debug, PartialEq)]
pub struct Fourteen {
    /// (3): their numbers in the recording, from 0.
    pub stations: [Vec<usize>; 2],
    /// Greatest distance between the two solutions, mm at the radius.
    pub apart_mm: f64,
    /// Greatest distance between the traces that they predict at all stations, mm.
    pub traces_apart_mm: f64,
    /// Each solution: β of `published`, mm at the radius.
    pub beta_mm: [Vec<f64>; 2],
}

/// Both, unknown by unknown.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// The 14 unknowns of the circle's plane.
    pub unknowns: Vec<Compared>,
    /// Rank of the published equations.
    pub rank: usize,
    /// Stations.
    pub n_stations: usize,
    /// Readings that a station is the mean of, on average.
    pub readings_per_station: f64,
    /// Two choices of 14 stations; `None` where there are not 28.
    pub fourteen: Option<Fourteen>,
    /// What the published fit leaves of the trace, root of the mean square, mm.
    pub left_mm: f64,
    /// Greatest distance between the traces of the two members, mm.
    pub apart_mm: f64,
    /// What the circle determines.
    pub determined: Identification,
}

/// Compares both on one recorded circle; `other_mm` is every element of the other U, mm at the radius. `None`
/// where the recording is no circle about a centre.
///
/// # Errors
/// As [`identify`].
pub fn compare(
    kinematics: &Kinematics,
    recording: &Recording,
    other_mm: f64,
) -> Result<Option<Comparison>, IdentifyError> {
    let system = of_recording(kinematics, recording);
    let (Some((system, radial_mm)), Some(components)) =
        (system, fourteen_unknowns(&recording.place))
    else {
        return Ok(None);
    };
    let options = IdentifyOptions {
        components,
        nuisances: Nuisances {
            zero_offset: true,
            lost_motion: true,
            ..Nuisances::NONE
        },
        radial_only: true,
        rank_tolerance: 1e-6,
        outlier_limit: 4.5,
        recording_noise: false,
        noise: Noise::FromResiduals,
        disturbed: Disturbed::Ignored,
        certificate: PlateCertificate::EXACT,
    };
    let determined = identify(kinematics, std::slice::from_ref(recording), &options)?;
    let published = solve(&system, &radial_mm, &[]);
    let other = solve(&system, &radial_mm, &vec![other_mm; system.scale.len()]);
    let left: f64 = published
        .trace_mm
        .iter()
        .zip(&radial_mm)
        .map(|(fitted, measured)| (measured - fitted).powi(2))
        .sum();
    let fourteen = fourteen(&system, &radial_mm);
    let readings = recording
        .points
        .iter()
        .map(|point| f64::from(point.n_readings));
    let unknowns = (0..system.scale.len()).map(|j| Compared {
        fourteen_mm: fourteen
            .as_ref()
            .map(|two| two.beta_mm.each_ref().map(|beta| beta[j])),
        unknown: determined.unknowns[j].clone(),
        published_mm: published.beta_mm[j],
        other_mm: other.beta_mm[j],
        standard_uncertainty_mm: published.standard_uncertainty_mm[j],
        visibility: determined.visibility[j],
        scale: system.scale[j],
    });
    Ok(Some(Comparison {
        unknowns: unknowns.collect(),
        rank: published.rank,
        n_stations: radial_mm.len(),
        readings_per_station: readings.sum::<f64>() / radial_mm.len().max(1) as f64,
        left_mm: (left / radial_mm.len().max(1) as f64).sqrt(),
        apart_mm: (&published.trace_mm - &other.trace_mm).amax(),
        determined,
        fourteen,
    }))
}

/// The solutions of two choices (3).
fn fourteen(system: &RadialSystem, radial_mm: &[f64]) -> Option<Fourteen> {
    let n = radial_mm.len();
    if n < 2 * EQUATIONS {
        return None;
    }
    // In halves: (2 k + 2 s) n / 28 is whole arithmetic.
    let stations = [0, 1].map(|half| {
        let of = |k: usize| (2 * k + half) * n / (2 * EQUATIONS);
        (0..EQUATIONS).map(of).collect::<Vec<usize>>()
    });
    let solutions = stations.each_ref().map(|idx| {
        let (chosen, of_chosen) = any_stations(system, radial_mm, idx);
        solve(&chosen, &of_chosen, &[])
    });
    let [first, second] = &solutions;
    Some(Fourteen {
        apart_mm: (&first.beta_mm - &second.beta_mm).amax(),
        traces_apart_mm: (trace_mm(system, first) - trace_mm(system, second)).amax(),
        beta_mm: solutions
            .each_ref()
            .map(|solution| solution.beta_mm.iter().copied().collect()),
        stations,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preflight::planned;
    use crate::recording::Place;
    use metrology::PerAxis;
    use metrology::sample::TestPlane;
    use nalgebra::Vector3;

    /// A circle of 50 mm on a machine whose X is 100 µm/m too long, and nothing else.
    fn long_x() -> (Kinematics, Recording) {
        let kinematics =
            Kinematics::of_chain("[w X' Y' b Z t]".parse().unwrap(), PerAxis::default());
        let place = Place::circle(TestPlane::Xy, Vector3::zeros(), 50.0, 36);
        let mut recording = planned(1, &place, 1e-5);
        for point in &mut recording.points {
            point.reading_mm[0] *= 1.0 + 1e-4;
        }
        (kinematics, recording)
    }

    #[test]
    fn val_a_scale_error_alone_is_printed_as_errors_that_are_not_there() {
        let (kinematics, recording) = long_x();
        let found = compare(&kinematics, &recording, 0.005).unwrap().unwrap();
        assert_eq!((found.unknowns.len(), found.rank), (14, 10));
        let of = |name: &str| {
            let mut all = found.unknowns.iter();
            all.find(|c| c.unknown.to_string() == name).unwrap()
        };
        // EXX1 is 5 µm at the radius; the rest is not there.
        assert!((of("EXX1").published_mm - 0.005).abs() > 1e-3);
        assert!(of("EYY1").published_mm.abs() > 1e-3);
        assert_eq!(of("EXX1").visibility, Visibility::Mixed);
        assert!(found.apart_mm < 1e-9, "{}", found.apart_mm);
        let moved = found
            .unknowns
            .iter()
            .map(|c| (c.other_mm - c.published_mm).abs());
        assert!(moved.fold(0.0, f64::max) > 1e-3);
        let determined = &found.determined;
        assert!(!determined.combinations.is_empty());
        let exx1 = determined.find("EXX1").unwrap();
        for sum in &determined.combinations {
            let weight = sum.weights.iter().find(|(idx, _)| *idx == exx1);
            let truth_mm = weight.map_or(0.0, |(_, weight)| weight * 1e-4);
            let off = (sum.value_mm - truth_mm).abs();
            assert!(off < 1e-8, "{}: {off}", determined.name_of(sum));
        }
    }

    #[test]
    fn what_is_no_circle_is_not_compared() {
        let (kinematics, mut recording) = long_x();
        recording.place.radius_mm = 0.0;
        assert_eq!(compare(&kinematics, &recording, 0.0), Ok(None));
    }
}
