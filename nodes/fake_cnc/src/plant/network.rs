//! Lumped thermal network of the machine's castings, stepped exactly.
//!
//! ```text
//!   C_i dT_i/dt = sum_j G_ij (T_j - T_i) + G_i (T_air - T_i) + Q_i        (1)
//!   T[k+1] = P T[k] + R [Q; T_air],   exp([A B; 0 0] dt) = [P R; 0 1]      (2)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | C_i | `heat_capacity_j_per_k` | J/K |
//! | G_ij, G_i | `conductance_w_per_k`, `to_air_w_per_k` | W/K |
//! | Q_i | heat into a place, constant within the step | W |
//!
//! # Holds when
//! Each place is nearly isothermal (Biot number below 0.1). Not modelled: radiation, coolant.
//!
//! # References
//! \[1\] C. F. Van Loan, IEEE Trans. Autom. Control 23(3), 1978, doi:10.1109/TAC.1978.1101743, for (2).

use nalgebra::{DMatrix, DVector};

use super::error::{PlantError, require_not_negative, require_positive};
use super::file::{HeatEntry, Place};

const N: usize = Place::COUNT;

/// The network with its temperatures.
#[derive(Clone, Debug)]
pub(super) struct Network {
    /// Row i: effect of each temperature, of each heat, and of the air on place i after a step.
    advance: [[f64; 2 * N + 1]; N],
    temp_degc: [f64; N],
}

impl Network {
    pub(super) fn new(heat: &HeatEntry, step_s: f64) -> Result<Self, PlantError> {
        let (capacity_j_per_k, rates) = balance(heat)?;
        let mut generator = DMatrix::<f64>::zeros(2 * N + 1, 2 * N + 1);
        for i in 0..N {
            for j in 0..N {
                generator[(i, j)] = rates[i][j] / capacity_j_per_k[i] * step_s;
            }
            generator[(i, N + i)] = step_s / capacity_j_per_k[i];
            generator[(i, 2 * N)] = rates[i][N] / capacity_j_per_k[i] * step_s;
        }
        let exponential = generator.exp(); // (2)
        Ok(Self {
            advance: std::array::from_fn(|i| std::array::from_fn(|j| exponential[(i, j)])),
            temp_degc: [heat.shop_air.start_temp_degc; N],
        })
    }

    /// Temperature of a place, °C.
    pub(super) fn temp_degc(&self, place: Place) -> f64 {
        self.temp_degc[place as usize]
    }

    /// All places at one temperature, for tests of what follows from temperatures.
    #[cfg(test)]
    pub(super) fn soaked(temp_degc: f64) -> Self {
        Self {
            advance: [[0.0; 2 * N + 1]; N],
            temp_degc: [temp_degc; N],
        }
    }

    /// Sets one temperature, for tests of what follows from temperatures.
    #[cfg(test)]
    pub(super) fn set_degc(&mut self, place: Place, temp_degc: f64) {
        self.temp_degc[place as usize] = temp_degc;
    }

    /// Where each place settles under constant heat (W) and air temperature, °C; `None` where heat cannot leave.
    pub(super) fn settled_degc(
        heat: &HeatEntry,
        heat_w: &[f64; N],
        air_degc: f64,
    ) -> Result<Option<[f64; N]>, PlantError> {
        let (_, rates) = balance(heat)?;
        let losses = DMatrix::from_fn(N, N, |i, j| -rates[i][j]);
        let sources = DVector::from_fn(N, |i, _| heat_w[i] + rates[i][N] * air_degc);
        let settled = losses.lu().solve(&sources);
        Ok(settled.map(|settled| std::array::from_fn(|i| settled[i])))
    }

    /// One step under constant heat (W) and air temperature.
    pub(super) fn step(&mut self, heat_w: &[f64; N], air_degc: f64) {
        let before = self.temp_degc;
        for (after, row) in self.temp_degc.iter_mut().zip(&self.advance) {
            let (from_temp, rest) = row.split_at(N);
            let (from_heat, from_air) = rest.split_at(N);
            *after = dot(from_temp, &before) + dot(from_heat, heat_w) + from_air[0] * air_degc;
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Capacities, and conductance matrix of (1) with the air as its last column.
type Balance = ([f64; N], [[f64; N + 1]; N]);

fn balance(heat: &HeatEntry) -> Result<Balance, PlantError> {
    let mut capacity_j_per_k = [0.0; N];
    let mut rates = [[0.0; N + 1]; N];
    for place in Place::ALL {
        let entry = heat
            .places
            .get(&place)
            .ok_or(PlantError::PlaceMissing { place })?;
        let at = |key: &str| format!("heat.places.{place}.{key}");
        require_positive(at("heat_capacity_j_per_k"), entry.heat_capacity_j_per_k)?;
        require_not_negative(at("to_air_w_per_k"), entry.to_air_w_per_k)?;
        let i = place as usize;
        capacity_j_per_k[i] = entry.heat_capacity_j_per_k;
        rates[i][i] -= entry.to_air_w_per_k;
        rates[i][N] = entry.to_air_w_per_k;
    }
    for (index, link) in heat.links.iter().enumerate() {
        let (i, j) = (link.from as usize, link.to as usize);
        if i == j || rates[i][j] > 0.0 {
            return Err(PlantError::Link {
                index,
                from: link.from,
                to: link.to,
            });
        }
        let place = format!("heat.links[{index}].conductance_w_per_k");
        require_positive(place, link.conductance_w_per_k)?;
        rates[i][j] = link.conductance_w_per_k;
        rates[j][i] = link.conductance_w_per_k;
        rates[i][i] -= link.conductance_w_per_k;
        rates[j][j] -= link.conductance_w_per_k;
    }
    Ok((capacity_j_per_k, rates))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::*;
    use crate::plant::file::{LinkEntry, PlaceEntry, ShopAirEntry, SpindleLossEntry};

    fn heat(capacity: &[f64; N], to_air: &[f64; N], links: Vec<LinkEntry>) -> HeatEntry {
        let entry = |place: Place| PlaceEntry {
            heat_capacity_j_per_k: capacity[place as usize],
            to_air_w_per_k: to_air[place as usize],
        };
        HeatEntry {
            reference_temp_degc: 20.0,
            shop_air: ShopAirEntry {
                start_temp_degc: 20.0,
                day_amplitude_k: 0.0,
                day_phase_deg: 0.0,
                draught_k: 0.0,
                draught_time_s: 1.0,
            },
            places: Place::ALL
                .into_iter()
                .map(|place| (place, entry(place)))
                .collect(),
            links,
            standing_heat_w: BTreeMap::new(),
            spindle: SpindleLossEntry {
                front_bearing_w_at_1000_rpm: 0.0,
                rear_bearing_w_at_1000_rpm: 0.0,
                bearing_exponent: 1.0,
                motor_w_at_1000_rpm: 0.0,
                motor_exponent: 1.0,
            },
            screws: BTreeMap::new(),
        }
    }

    #[test]
    fn val_single_capacity_cools_by_the_exponential_law() {
        let mut network = Network::new(&heat(&[500.0; N], &[2.0; N], vec![]), 1.0).unwrap();
        for _ in 0..600 {
            network.step(&[0.0; N], 30.0);
        }
        let expected = 30.0 - 10.0 * (-2.0_f64 * 600.0 / 500.0).exp();
        assert!((network.temp_degc(Place::Bed) - expected).abs() < 1e-9);
    }

    #[test]
    fn val_two_linked_capacities_relax_with_their_reduced_time_constant() {
        let link = LinkEntry {
            from: Place::Bed,
            to: Place::Table,
            conductance_w_per_k: 3.0,
        };
        let mut capacity = [1e3; N];
        capacity[Place::Table as usize] = 4e3;
        let mut network = Network::new(&heat(&capacity, &[0.0; N], vec![link]), 1.0).unwrap();
        let mut pulse = [0.0; N];
        pulse[Place::Bed as usize] = 5e3;
        network.step(&pulse, 0.0);
        let difference_k =
            |network: &Network| network.temp_degc(Place::Bed) - network.temp_degc(Place::Table);
        let before_k = difference_k(&network);
        for _ in 0..300 {
            network.step(&[0.0; N], 0.0);
        }
        let rate_per_s = 3.0 * (1.0 / 1e3 + 1.0 / 4e3);
        let expected = before_k * (-rate_per_s * 300.0_f64).exp();
        assert!((difference_k(&network) - expected).abs() < 1e-9 * before_k);
    }

    #[test]
    fn a_link_given_twice_is_refused_with_its_index() {
        let link = |from, to| LinkEntry {
            from,
            to,
            conductance_w_per_k: 1.0,
        };
        let links = vec![
            link(Place::Bed, Place::Table),
            link(Place::Table, Place::Bed),
        ];
        let told = Network::new(&heat(&[1.0; N], &[1.0; N], links), 1.0)
            .unwrap_err()
            .to_string();
        assert!(told.starts_with("heat.links[1]: table to bed"), "{told}");
    }

    fn any_link() -> impl Strategy<Value = LinkEntry> {
        (0..N, 1..N, 0.1..100.0_f64).prop_map(|(from, ahead, conductance_w_per_k)| LinkEntry {
            from: Place::ALL[from],
            to: Place::ALL[(from + ahead) % N],
            conductance_w_per_k,
        })
    }

    fn once_each(links: Vec<LinkEntry>) -> Vec<LinkEntry> {
        let pair = |link: &LinkEntry| (link.from.min(link.to), link.from.max(link.to));
        let by_pair: BTreeMap<_, _> = links.into_iter().map(|link| (pair(&link), link)).collect();
        by_pair.into_values().collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn prop_eq1_an_insulated_network_keeps_every_joule(
            capacity in prop::array::uniform14(1e3..1e6_f64),
            links in prop::collection::vec(any_link(), 0..20),
            power in prop::array::uniform14(-100.0..100.0_f64),
        ) {
            let file = heat(&capacity, &[0.0; N], once_each(links));
            let mut network = Network::new(&file, 1.0).unwrap();
            for _ in 0..50 {
                network.step(&power, 35.0);
            }
            let stored: f64 = (0..N).map(|i| capacity[i] * (network.temp_degc[i] - 20.0)).sum();
            let given: f64 = power.iter().sum::<f64>() * 50.0;
            let scale: f64 = capacity.iter().sum::<f64>() * 20.0;
            prop_assert!((stored - given).abs() < 1e-10 * scale, "{stored} {given}");
        }

        #[test]
        fn prop_eq1_in_the_end_the_air_takes_what_the_sources_give(
            to_air in prop::array::uniform14(1.0..20.0_f64),
            links in prop::collection::vec(any_link(), 0..20),
            power in prop::array::uniform14(0.0..100.0_f64),
        ) {
            let file = heat(&[100.0; N], &to_air, once_each(links));
            let mut network = Network::new(&file, 1.0).unwrap();
            for _ in 0..6000 {
                network.step(&power, 25.0);
            }
            let taken: f64 = (0..N).map(|i| to_air[i] * (network.temp_degc[i] - 25.0)).sum();
            let given: f64 = power.iter().sum();
            prop_assert!((taken - given).abs() < 1e-6 * (1.0 + given), "{taken} {given}");
        }
    }
}
