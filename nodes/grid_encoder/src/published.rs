//! The published separation of 14 unknowns from the radial errors of one circle, with its general solution.
//!
//! # Model
//!
//! In a machine whose table moves X on Y, at Z = 0 and without tool offset, on a circle about the
//! origin of the machine, counted from +X towards +Y:
//!
//! ```text
//!   C_x = EXX(x) + EXY(y) − EC0Y y − y ECY(y),   C_y = EYY(y) + EYX(x)                     (1)
//!   EXX, EYY, ECY: powers 1 to 3;  EXY, EYX: powers 2 and 3:  14 unknowns with EC0Y        (2)
//!   ΔR = (x C_x + y C_y) / R                                                               (3)
//!   Y = X β,   G = (XᵀX)⁻,   β = G Xᵀ Y + [I − G XᵀX] U                                    (4)
//!   u²(β_j) = s² G_jj,   s² = |Y − X β|² / (stations − rank)                               (5)
//! ```
//!
//! (5) is the uncertainty of an unknown that the stations determine; of any other it is a number of the method.
//!
//! (3) and (4) are printed in the source; (1) and (2) were images that are lost, and are derived: cubic
//! polynomials without constant term, one parameter for squareness and 14 unknowns leave this reading.
//! Other chains put their levers into (1) through `machine::volumetric`. The source averages 55 readings at each
//! of 360 stations and then takes any 14 of the 360 equations; [`any_stations`] and [`solve`] do the same.
//!
//! # What it cannot do
//! X has rank 10 on one circle, 9 without ECY3, whatever stations are taken: ΔR holds harmonics 0 to 5. (4)
//! fits the trace for every U, and every single error in it depends on U and on the generalised inverse that
//! was used. `single_errors_depend_on_what_the_caller_chose` shows it. `identify` prints what does not.
//!
//! # Agreement
//! `eq4_fits_the_trace_for_every_choice`: 1e-12 mm between any two members and any 14 stations.
//!
//! # References
//! \[1\] Plane grid encoder (KGM) separation with the generalised inverse, trade article of 2010, in Chinese; section 3.
//! \[2\] C. R. Rao, S. K. Mitra, Generalized Inverse of Matrices and its Applications, Wiley 1971, 2.3: (4).

use machine::Kinematics;
use machine::volumetric::sensitivity;
use metrology::{ErrorComponent, PerAxis};
use nalgebra::{DMatrix, DVector};

use crate::basis::{Basis, ModelComponent};
use crate::identify::default_basis;
use crate::recording::{Place, Recording, in_plane, plane_axes};
use crate::trace::measured_trace;

/// Share of the greatest eigenvalue of XᵀX below which one counts as zero.
const NO_EIGENVALUE: f64 = 1e-12;

/// The radial equations of a circle.
#[derive(Clone, Debug, PartialEq)]
pub struct RadialSystem {
    /// Components and powers, in the order of the columns.
    pub components: Vec<ModelComponent>,
    /// X of (4), one row per station; unknowns in mm at the radius.
    pub design: DMatrix<f64>,
    /// mm at the radius → own unit, per column.
    pub scale: Vec<f64>,
}

/// A member of the general solution.
#[derive(Clone, Debug, PartialEq)]
pub struct PublishedSolution {
    /// β of (4), in mm at the radius.
    pub beta_mm: DVector<f64>,
    /// The same in own units (mm/mm^k, rad/mm^k).
    pub coefficients: Vec<f64>,
    /// ΔR that it predicts at the stations it was solved from, mm.
    pub trace_mm: DVector<f64>,
    /// (5), mm at the radius; zero without a station beyond the rank.
    pub standard_uncertainty_mm: Vec<f64>,
    /// Rank of X.
    pub rank: usize,
}

/// The 14 unknowns of (2) for the plane of a circle: both positionings, both straightnesses, the
/// squareness of its second axis to its first, and the turn of the second axis about the normal.
#[must_use]
pub fn fourteen_unknowns(place: &Place) -> Option<Vec<ModelComponent>> {
    let [u, v] = plane_axes(place.plane)?;
    let normal = ErrorComponent::SQUARENESS
        .into_iter()
        .find(|c| crate::recording::plane_of_turn(c.direction) == place.plane)?;
    let powers = |component| ModelComponent {
        component,
        basis: default_basis(component, 0.0, 3),
    };
    Some(vec![
        powers(ErrorComponent::motion(u, u)),
        powers(ErrorComponent::motion(v, v)),
        powers(ErrorComponent::motion(u, v)),
        powers(ErrorComponent::motion(v, u)),
        ModelComponent {
            component: normal,
            basis: Basis::Constant,
        },
        powers(ErrorComponent::motion(normal.direction, v)),
    ])
}

/// Rows (3) at the given angles of a circle, for any components and chain.
#[must_use]
pub fn radial_system(
    kinematics: &Kinematics,
    components: &[ModelComponent],
    place: &Place,
    angles_rad: &[f64],
) -> RadialSystem {
    let scale = scale(components, place);
    let mut entries: Vec<f64> = Vec::new();
    for angle_rad in angles_rad {
        let positions = place.on_circle_mm(*angle_rad);
        let (sin, cos) = angle_rad.sin_cos();
        for model in components {
            let lever = sensitivity(
                kinematics,
                &positions,
                &place.tool_offset_mm,
                model.component,
            );
            let [u, v] = in_plane(place.plane, &lever);
            let begin = entries.len();
            model
                .basis
                .values(positions[model.component.of], &mut entries);
            for entry in &mut entries[begin..] {
                *entry *= cos * u + sin * v;
            }
        }
    }
    let mut design = DMatrix::from_row_slice(angles_rad.len(), scale.len(), &entries);
    for (mut column, scale) in design.column_iter_mut().zip(&scale) {
        column *= *scale;
    }
    RadialSystem {
        components: components.to_vec(),
        design,
        scale,
    }
}

/// The equations and radial errors of a recorded circle, for the 14 unknowns of its plane; `None` where it is
/// no circle about a centre.
#[must_use]
pub fn of_recording(
    kinematics: &Kinematics,
    recording: &Recording,
) -> Option<(RadialSystem, Vec<f64>)> {
    let components = fourteen_unknowns(&recording.place)?;
    if !recording.place.is_round() {
        return None;
    }
    let (angles_rad, radial_mm): (Vec<f64>, Vec<f64>) =
        measured_trace(recording).into_iter().unzip();
    let system = radial_system(kinematics, &components, &recording.place, &angles_rad);
    Some((system, radial_mm))
}

fn scale(components: &[ModelComponent], place: &Place) -> Vec<f64> {
    let greatest = PerAxis::from_fn(|axis| {
        let centre = if axis.is_linear() {
            place.centre_mm[axis.index()]
        } else {
            0.0
        };
        centre.abs() + place.radius_mm
    });
    let of = components.iter().flat_map(|model| {
        let edge = greatest[model.component.of];
        let arm = if model.component.is_angular() {
            edge
        } else {
            1.0
        };
        (0..model.basis.len()).map(move |idx| 1.0 / (arm * model.basis.reach(idx, (-edge, edge))))
    });
    of.collect()
}

/// (4) with the Moore–Penrose inverse of XᵀX; `arbitrary_mm` is U.
///
/// Missing entries of U count as zero.
#[must_use]
pub fn solve(system: &RadialSystem, radial_mm: &[f64], arbitrary_mm: &[f64]) -> PublishedSolution {
    let x = &system.design;
    let (n, p) = x.shape();
    let y = DVector::from_fn(n, |i, _| radial_mm.get(i).copied().unwrap_or(0.0));
    let u = DVector::from_fn(p, |j, _| arbitrary_mm.get(j).copied().unwrap_or(0.0));
    let gram = x.transpose() * x;
    let (g, rank) = generalised_inverse(&gram);
    let beta_mm = &g * x.transpose() * &y + (DMatrix::identity(p, p) - &g * &gram) * u; // (4)
    let trace_mm = x * &beta_mm;
    let left = n.saturating_sub(rank).max(1) as f64;
    let cofactors = g.diagonal();
    let variance_mm2 = (y - &trace_mm).norm_squared() / left; // (5)
    PublishedSolution {
        coefficients: beta_mm
            .iter()
            .zip(&system.scale)
            .map(|(b, s)| b * s)
            .collect(),
        standard_uncertainty_mm: { cofactors.iter() }
            .map(|cofactor| (variance_mm2 * cofactor).max(0.0).sqrt())
            .collect(),
        trace_mm,
        beta_mm,
        rank,
    }
}

/// The equations of the stations `idx` alone; stations that do not exist are left out.
#[must_use]
pub fn any_stations(
    system: &RadialSystem,
    radial_mm: &[f64],
    idx: &[usize],
) -> (RadialSystem, Vec<f64>) {
    let there: Vec<usize> = idx
        .iter()
        .copied()
        .filter(|i| *i < system.design.nrows())
        .collect();
    let chosen = RadialSystem {
        components: system.components.clone(),
        design: system.design.select_rows(&there),
        scale: system.scale.clone(),
    };
    let radial = there
        .iter()
        .filter_map(|i| radial_mm.get(*i).copied())
        .collect();
    (chosen, radial)
}

/// ΔR that coefficients predict at the stations of `system`, mm.
#[must_use]
pub fn trace_mm(system: &RadialSystem, solution: &PublishedSolution) -> DVector<f64> {
    &system.design * &solution.beta_mm
}

fn generalised_inverse(gram: &DMatrix<f64>) -> (DMatrix<f64>, usize) {
    let eigen = gram.clone().symmetric_eigen();
    let limit = NO_EIGENVALUE * eigen.eigenvalues.max();
    let counts = |e: f64| e > limit;
    let inverse = eigen
        .eigenvalues
        .map(|e| if counts(e) { 1.0 / e } else { 0.0 });
    let v = &eigen.eigenvectors;
    let g = v * DMatrix::from_diagonal(&inverse) * v.transpose();
    (g, eigen.eigenvalues.iter().filter(|e| counts(**e)).count())
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::sample::TestPlane;
    use nalgebra::Vector3;

    const R_MM: f64 = 50.0;

    fn angles() -> Vec<f64> {
        (0..360).map(|k| f64::from(k).to_radians()).collect()
    }

    fn system(chain: &str) -> RadialSystem {
        let kinematics = Kinematics::of_chain(chain.parse().unwrap(), PerAxis::default());
        let place = Place::circle(TestPlane::Xy, Vector3::zeros(), R_MM, 360);
        let components = fourteen_unknowns(&place).unwrap();
        radial_system(&kinematics, &components, &place, &angles())
    }

    fn table() -> RadialSystem {
        system("[w X' Y' b Z t]")
    }

    /// A machine with one error only, EXX of 10 µm/100 mm: ΔR = 0.1e-3 x²/R.
    fn scale_error_of_x_mm() -> Vec<f64> {
        angles()
            .iter()
            .map(|a| 1e-4 * R_MM * a.cos().powi(2))
            .collect()
    }

    #[test]
    fn eq2_fourteen_unknowns_are_named_as_in_the_module() {
        let names: Vec<_> = table()
            .components
            .iter()
            .map(|m| m.component.to_string())
            .collect();
        assert_eq!(names, ["EXX", "EYY", "EXY", "EYX", "EC0Y", "ECY"]);
        assert_eq!(table().design.ncols(), 14);
    }

    #[test]
    fn eq3_columns_are_those_of_the_derived_formula() {
        let system = table();
        for (i, a) in angles().into_iter().enumerate() {
            let (s, c) = a.sin_cos();
            // Signs after ISO 230-1, unknowns in mm at R: cos·C_x + sin·C_y.
            let expected = [
                c * c,
                c * c.powi(2),
                c * c.powi(3),
                s * s,
                s * s.powi(2),
                s * s.powi(3),
                c * s.powi(2),
                c * s.powi(3),
                s * c.powi(2),
                s * c.powi(3),
                -c * s,
                -c * s * s,
                -c * s * s.powi(2),
                -c * s * s.powi(3),
            ];
            for (j, expected) in expected.into_iter().enumerate() {
                let found = system.design[(i, j)];
                assert!(
                    (found - expected).abs() < 1e-12,
                    "{i} {j}: {found} {expected}"
                );
            }
        }
    }

    #[test]
    fn val_numpy_eq5_off_the_origin_the_turn_is_known_three_hundred_times_worse() {
        // numpy: pinv and singular values of the columns of `eq3_columns_are_those_of_the_derived_formula` at 360 stations of
        // a circle of 50 mm, for a trace of 1 µm cos 7θ; the tenth singular value is 1.22e-4 of the first off the origin.
        let kinematics =
            Kinematics::of_chain("[w X' Y' b Z t]".parse().unwrap(), PerAxis::default());
        let radial: Vec<f64> = angles().iter().map(|a| 1e-3 * (7.0 * a).cos()).collect();
        for (y_mm, in_order) in [
            (0.0, [(0, 0.2327), (10, 0.1075), (13, 1.1926)]),
            (-150.0, [(0, 0.5256), (10, 92.1385), (13, 305.2978)]),
        ] {
            let place = Place::circle(TestPlane::Xy, Vector3::new(0.0, y_mm, 0.0), R_MM, 360);
            let components = fourteen_unknowns(&place).unwrap();
            let system = radial_system(&kinematics, &components, &place, &angles());
            let solution = solve(&system, &radial, &[]);
            assert_eq!(solution.rank, 10);
            for (j, per_s) in in_order {
                let u_mm = solution.standard_uncertainty_mm[j];
                let expected_mm = 0.717_137_2e-3 * per_s;
                assert!(
                    (u_mm / expected_mm - 1.0).abs() < 1e-3,
                    "{y_mm} {j}: {u_mm}"
                );
            }
        }
    }

    #[test]
    fn eq4_fits_the_trace_for_every_choice() {
        let (system, radial) = (table(), scale_error_of_x_mm());
        for choice in 0..4_usize {
            let u: Vec<f64> = (0..14)
                .map(|j| 0.01 * ((j * 5 + choice) % 7) as f64)
                .collect();
            let stations: Vec<usize> = (0..14).map(|k| (k * 25 + 7 * choice) % 360).collect();
            let (chosen, of_chosen) = any_stations(&system, &radial, &stations);
            for solution in [solve(&system, &radial, &u), solve(&chosen, &of_chosen, &u)] {
                assert_eq!(solution.rank, 10);
                let trace = trace_mm(&system, &solution);
                for (found, expected) in trace.iter().zip(&radial) {
                    assert!((found - expected).abs() < 1e-10, "{found} {expected}");
                }
            }
        }
    }

    #[test]
    fn single_errors_depend_on_what_the_caller_chose() {
        let (system, radial) = (table(), scale_error_of_x_mm());
        let none = solve(&system, &radial, &[]);
        let squareness = solve(
            &system,
            &radial,
            &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.02],
        );
        // EXX1 is 5 µm at the radius and nothing else is there. With U = 0 the method gives part of it to
        // EXX3 and to the scale of Y; with a squareness in U it also prints squareness.
        assert!(
            (none.beta_mm[0] - 0.005).abs() > 0.5e-3,
            "EXX1 {}",
            none.beta_mm[0]
        );
        assert!(none.beta_mm[2].abs() > 0.5e-3, "EXX3 {}", none.beta_mm[2]);
        assert!(none.beta_mm[10].abs() < 1e-9);
        assert!(
            squareness.beta_mm[10].abs() > 1e-3,
            "EC0Y {}",
            squareness.beta_mm[10]
        );
        assert!((squareness.trace_mm - none.trace_mm).amax() < 1e-10);
    }

    #[test]
    fn fourteen_stations_give_other_single_errors_when_the_members_scatter() {
        let system = table();
        // 0.1 µm of an error that 14 unknowns cannot describe: five lobes and more.
        let radial: Vec<f64> = scale_error_of_x_mm()
            .iter()
            .zip(angles())
            .map(|(r, a)| r + 1e-4 * (7.0 * a).sin())
            .collect();
        let single = |begin: usize| {
            let stations: Vec<usize> = (0..14).map(|k| begin + k * 25).collect();
            let (chosen, of_chosen) = any_stations(&system, &radial, &stations);
            solve(&chosen, &of_chosen, &[]).beta_mm
        };
        let apart = (single(0) - single(9)).amax();
        assert!(apart > 1e-4, "{apart}");
    }

    #[test]
    fn the_tool_side_chain_has_another_yaw() {
        let (tool, table) = (system("[w b X Y Z t]"), table());
        assert!((tool.design.column(11) - table.design.column(11)).amax() > 0.1);
    }
}
