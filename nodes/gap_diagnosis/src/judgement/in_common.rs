//! Whether effects that were found are one cause which every axis shows alike.
//!
//! # Model
//!
//! A unit of length or of time that is wrong for the whole recording shows as the same relative length, or the same delay, on
//! every axis. Three effects of one kind, on three axes, whose sizes agree within
//!
//! ```text
//!   |a - b| <= 2 sqrt(u_a^2 + u_b^2),   u <= a / 4                        (1)
//! ```
//!
//! are such a unit sooner than three machine elements that came out equal by chance, and what else of the set has
//! that size makes up for it elsewhere (a plate that is read by the same wrong unit). Of either sign: what a
//! recording blames on an axis another may blame on its reference.
//!
//! # Holds when
//! The catalogue's own common causes (a wavelength, a clock) were searched as well: they take the place of the three
//! where they can, for one size costs less than three.

use std::collections::{BTreeMap, BTreeSet};

use twin::effects::Role;

use crate::search::refit::Estimate;
use crate::search::signature::Instance;

/// Ends of the names of parameters that tell a relative length or a delay.
const OF_A_UNIT: [&str; 2] = ["_um_per_m", "_ms"];
/// Members of one kind beyond which they are one cause.
pub const MAX_OF_ONE_KIND: usize = 2;
/// Standard uncertainties of a difference within which sizes agree.
const AGREE: f64 = 2.0;
/// A size that is less sure, by its standard uncertainty over it, agrees with too much.
const LEAST_SURE: f64 = 0.25;
/// Half a 95 % interval over its standard uncertainty.
const OF_HALF: f64 = 1.96;

/// A size of a member, by its magnitude.
struct Size {
    member: usize,
    unit: usize,
    value: f64,
    uncertainty: f64,
}

impl Size {
    fn agrees(&self, other: &Self) -> bool {
        let uncertainty = self.uncertainty.hypot(other.uncertainty);
        self.unit == other.unit && (self.value - other.value).abs() <= AGREE * uncertainty
    }
}

/// Of each member that has a size of a unit, how many of one kind have that size, by (1): more than [`MAX_OF_ONE_KIND`] are one cause.
pub fn alike(members: &[(usize, &Instance, &Estimate)]) -> BTreeMap<usize, usize> {
    let sizes: Vec<Size> = members
        .iter()
        .enumerate()
        .flat_map(|(member, (_, instance, estimate))| sizes(member, instance, estimate))
        .collect();
    let mut found = BTreeMap::new();
    for size in &sizes {
        let alike: BTreeSet<usize> = sizes
            .iter()
            .filter(|other| size.agrees(other))
            .map(|other| other.member)
            .collect();
        let kind = members[size.member].1.kind.id;
        let of_kind = alike
            .iter()
            .filter(|member| members[**member].1.kind.id == kind);
        let n = of_kind.count();
        for member in &alike {
            let most = found.entry(members[*member].0).or_insert(n);
            *most = n.max(*most);
        }
    }
    found
}

fn sizes(member: usize, instance: &Instance, estimate: &Estimate) -> Vec<Size> {
    let own = instance.kind.parameters.iter().enumerate();
    own.filter(|(place, parameter)| {
        parameter.role == Role::Amplitude && estimate.active.contains(place)
    })
    .filter_map(|(place, parameter)| {
        let unit = OF_A_UNIT
            .iter()
            .position(|unit| parameter.name.ends_with(unit))?;
        let value = estimate.values[place].abs();
        let uncertainty = 0.5 * (estimate.high[place] - estimate.low[place]) / OF_HALF;
        (value > 0.0 && uncertainty <= LEAST_SURE * value).then_some(Size {
            member,
            unit,
            value,
            uncertainty,
        })
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use metrology::Axis;
    use twin::effects::{CATALOGUE, Target};

    use super::*;

    fn instance(id: &str, target: Target) -> Instance {
        let kind = CATALOGUE.iter().find(|kind| kind.id == id).unwrap();
        Instance {
            kind,
            target,
            begins: None,
        }
    }

    fn estimate(instance: &Instance, sizes: &[f64], u: f64) -> Estimate {
        let mut values = vec![0.0; instance.kind.parameters.len() + instance.kind.free.len()];
        values[..sizes.len()].copy_from_slice(sizes);
        Estimate {
            whole: None,
            low: values.iter().map(|v| v - OF_HALF * u).collect(),
            high: values.iter().map(|v| v + OF_HALF * u).collect(),
            at_bound: vec![false; values.len()],
            active: (0..sizes.len()).collect(),
            values,
            d: 20.0,
        }
    }

    fn found(scales: [f64; 3], u: f64) -> BTreeSet<usize> {
        let axes = [Axis::X, Axis::Y, Axis::Z];
        let mut all: Vec<(Instance, Estimate)> = axes
            .into_iter()
            .zip(scales)
            .map(|(axis, size)| {
                let own = instance("scale_error", Target::Axis(axis));
                let estimate = estimate(&own, &[size], u);
                (own, estimate)
            })
            .collect();
        let plate = instance("plate_error", Target::Machine);
        let of_plate = estimate(&plate, &[25.1, 24.1, 0.6], 1.4);
        all.push((plate, of_plate));
        let play = instance("backlash", Target::Axis(Axis::X));
        let of_play = estimate(&play, &[23.5], 0.5);
        all.push((play, of_play));
        let members: Vec<(usize, &Instance, &Estimate)> = all
            .iter()
            .enumerate()
            .map(|(place, (own, estimate))| (10 + place, own, estimate))
            .collect();
        let alike = alike(&members).into_iter();
        let in_common = alike.filter(|(_, n)| *n > MAX_OF_ONE_KIND);
        in_common.map(|(place, _)| place).collect()
    }

    #[test]
    fn three_equal_scales_and_what_makes_up_for_them_are_one_cause() {
        let all = found([-23.9, -23.3, -23.7], 0.9);
        assert_eq!(all, BTreeSet::from([10, 11, 12, 13]));
    }

    #[test]
    fn scales_of_their_own_and_unsure_ones_are_not() {
        for (scales, u) in [([-23.9, -23.3, -9.0], 0.9), ([8.0, 14.0, 20.0], 6.0)] {
            assert!(found(scales, u).is_empty(), "{scales:?}");
        }
    }
}
