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
//! ```
//!
//! (1) has the centre c of the trace, which every plate has by how it was put down, and the lost motion b of
//! both axes. What (2) does not grant is a number of the method and not of the machine.
//!
//! # Agreement
//! `val_a_scale_error_alone_is_printed_as_errors_that_are_not_there`: the determined sums hold the truth to
//! 1e-8 mm, while the single numbers are off by a third and more.

use machine::Kinematics;

use crate::error::IdentifyError;
use crate::identify::{
    Disturbed, Identification, IdentifyOptions, Noise, PlateCertificate, identify,
};
use crate::published::{fourteen_unknowns, of_recording, solve};
use crate::recording::Recording;
use crate::spectrum::Visibility;
use crate::unknown::{Nuisances, Unknown};

/// One of the published unknowns.
#[derive(Clone, Debug, PartialEq)]
pub struct Compared {
    /// Which.
    pub unknown: Unknown,
    /// As the source prints it, U = 0, mm at the radius.
    pub published_mm: f64,
    /// As another U prints it, mm at the radius.
    pub other_mm: f64,
    /// Whether the circle determines it, (2).
    pub visibility: Visibility,
    /// Its own unit per mm at the radius.
    pub scale: f64,
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
    let unknowns = (0..system.scale.len()).map(|j| Compared {
        unknown: determined.unknowns[j].clone(),
        published_mm: published.beta_mm[j],
        other_mm: other.beta_mm[j],
        visibility: determined.visibility[j],
        scale: system.scale[j],
    });
    Ok(Some(Comparison {
        unknowns: unknowns.collect(),
        rank: published.rank,
        n_stations: radial_mm.len(),
        left_mm: (left / radial_mm.len().max(1) as f64).sqrt(),
        apart_mm: (&published.trace_mm - &other.trace_mm).amax(),
        determined,
    }))
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
