//! Heat along a ball screw with a moving nut, and how far the warm screw carries the nut.
//!
//! ```text
//!   rho c S dT/dt = k S d2T/dx2 + h pi D (T_air - T) + q(x, t)            (1)
//!   e(x) = integral from the fixed bearing to x of alpha (T - T_ref)       (2)
//!   u(x) = e(x) - (x / L) min(e(L), stretch)                               (3)
//! ```
//!
//! The screw is cut into cells of equal volume; (1) is stepped by backward Euler, which is stable for
//! any step and conserves heat to rounding. The nut's friction heat enters where the nut rubbed
//! during the step, and nut and screw exchange heat where the nut stood, both smeared over the nut's
//! length; so a short stroke leaves a hot zone with curved expansion beyond it. The fixed bearing is a
//! capacity at the screw's held end; the far end is insulated. A stretched screw (3) first relaxes
//! between two rigid bearings and grows freely once the stretch is used up.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | S, D | section, `diameter_mm` | m², m |
//! | q | friction heat and exchange with the nut, per length | W/m |
//! | u | growth of the nut's position away from the fixed bearing | mm |
//!
//! # Holds when
//! The screw is slender (one temperature per section). Radiation is in the convection coefficient.

use std::f64::consts::PI;

use super::error::{PlantError, require, require_finite, require_not_negative, require_positive};
use super::file::{ScrewEnd, ScrewEntry};

/// Cells along a screw.
pub(super) const CELLS: usize = 48;

/// A screw with nut and fixed bearing.
#[derive(Clone, Debug)]
pub(super) struct Screw {
    low_mm: f64,
    cells_per_mm: f64,
    cell_mm: f64,
    fixed_low: bool,
    expansion_per_k: f64,
    reference_degc: f64,
    stretch_mm: f64,
    nut_half_cells: usize,
    cell_capacity_j_per_k: f64,
    cell_to_cell_w_per_k: f64,
    cell_to_air_w_per_k: f64,
    nut_w_per_mm_s: f64,
    bearing_w_per_mm_s: f64,
    nut_share_to_screw: f64,
    nut: Lump,
    bearing: Lump,
    motor_loss_w_per_kn2: f64,
    temp_degc: [f64; CELLS],
    /// Position of the nut against its cold one, at cell borders, mm in the axis' direction.
    growth_mm: [f64; CELLS + 1],
    /// Path of the nut over each cell since the last heat step, mm.
    path_mm: [f64; CELLS],
    /// Time of the nut over each cell since the last heat step, s.
    dwell_s: [f64; CELLS],
    motor_j: f64,
}

/// A lumped capacity that touches the screw on one side and a casting on the other.
#[derive(Clone, Copy, Debug)]
struct Lump {
    capacity_j_per_k: f64,
    to_screw_w_per_k: f64,
    to_place_w_per_k: f64,
    temp_degc: f64,
}

/// Heat that leaves a screw into the castings during a step, W.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Outflow {
    pub(super) into_nut_place_w: f64,
    pub(super) into_bearing_place_w: f64,
    pub(super) into_air_w: f64,
}

/// Temperatures around a screw, °C.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Surroundings {
    pub(super) air_degc: f64,
    pub(super) nut_place_degc: f64,
    pub(super) bearing_place_degc: f64,
}

impl Screw {
    pub(super) fn new(
        place: &str,
        entry: &ScrewEntry,
        lead_mm: f64,
        reference_degc: f64,
        start_degc: f64,
    ) -> Result<Self, PlantError> {
        check(place, entry)?;
        let length_m = (entry.ends_mm[1] - entry.ends_mm[0]) / 1e3;
        let cell_m = length_m / CELLS as f64;
        let section_m2 = PI / 4.0 * (entry.diameter_mm / 1e3).powi(2);
        let rad_per_mm = 2.0 * PI / lead_mm;
        let lump = |capacity_j_per_k, to_screw_w_per_k, to_place_w_per_k| Lump {
            capacity_j_per_k,
            to_screw_w_per_k,
            to_place_w_per_k,
            temp_degc: start_degc,
        };
        let half_nut = 0.5 * entry.nut_length_mm / (cell_m * 1e3);
        let mut screw = Self {
            low_mm: entry.ends_mm[0],
            cells_per_mm: 1.0 / (cell_m * 1e3),
            cell_mm: cell_m * 1e3,
            fixed_low: entry.fixed_end == ScrewEnd::Low,
            expansion_per_k: entry.expansion_um_per_m_k * 1e-6,
            reference_degc,
            stretch_mm: entry.pretension_um / 1e3,
            nut_half_cells: half_nut as usize,
            cell_capacity_j_per_k: entry.heat_capacity_mj_per_m3_k * 1e6 * section_m2 * cell_m,
            cell_to_cell_w_per_k: entry.conductivity_w_per_m_k * section_m2 / cell_m,
            cell_to_air_w_per_k: entry.convection_w_per_m2_k
                * PI
                * (entry.diameter_mm / 1e3)
                * cell_m,
            nut_w_per_mm_s: entry.nut_torque_n_m * rad_per_mm,
            bearing_w_per_mm_s: entry.bearing_torque_n_m * rad_per_mm,
            nut_share_to_screw: entry.nut_heat_share_to_screw,
            nut: lump(
                entry.nut_heat_capacity_j_per_k,
                entry.nut_to_screw_w_per_k,
                entry.nut_to_place_w_per_k,
            ),
            bearing: lump(
                entry.bearing_heat_capacity_j_per_k,
                entry.bearing_to_screw_w_per_k,
                entry.bearing_to_place_w_per_k,
            ),
            motor_loss_w_per_kn2: entry.motor_loss_w_per_kn2,
            temp_degc: [start_degc; CELLS],
            growth_mm: [0.0; CELLS + 1],
            path_mm: [0.0; CELLS],
            dwell_s: [0.0; CELLS],
            motor_j: 0.0,
        };
        screw.integrate_growth();
        Ok(screw)
    }

    /// Books one servo period: nut position, how far it moved, and the motor's force.
    #[inline]
    pub(super) fn rub(&mut self, nut_mm: f64, path_mm: f64, force_kn: f64, period_s: f64) {
        let cell = ((nut_mm - self.low_mm) * self.cells_per_mm) as usize;
        let cell = cell.min(CELLS - 1);
        self.path_mm[cell] += path_mm;
        self.dwell_s[cell] += period_s;
        self.motor_j += self.motor_loss_w_per_kn2 * force_kn * force_kn * period_s;
    }

    /// How far the nut at `nut_mm` is from its cold place, mm, in the axis' direction.
    #[inline]
    pub(super) fn growth_mm(&self, nut_mm: f64) -> f64 {
        let at = (nut_mm - self.low_mm) * self.cells_per_mm;
        let cell = (at as usize).min(CELLS - 1);
        let share = at - cell as f64;
        self.growth_mm[cell] + share * (self.growth_mm[cell + 1] - self.growth_mm[cell])
    }

    pub(super) fn nut_degc(&self) -> f64 {
        self.nut.temp_degc
    }

    /// Heat stored above 0 °C, J.
    #[cfg(test)]
    fn stored_j(&self) -> f64 {
        self.temp_degc.iter().sum::<f64>() * self.cell_capacity_j_per_k
            + self.nut.temp_degc * self.nut.capacity_j_per_k
            + self.bearing.temp_degc * self.bearing.capacity_j_per_k
    }

    /// Advances all heat by `step_s` with what was booked since the last call.
    pub(super) fn step(&mut self, around: &Surroundings, step_s: f64) -> Outflow {
        let rubbed_mm = self.smear(&self.path_mm);
        let stood_s = self.smear(&self.dwell_s);
        let total_path_mm: f64 = self.path_mm.iter().sum();
        let total_dwell_s: f64 = self.dwell_s.iter().sum();
        let per_dwell = if total_dwell_s > 0.0 {
            1.0 / total_dwell_s
        } else {
            0.0
        };
        let fixed = if self.fixed_low { 0 } else { CELLS - 1 };
        let mut into_cell_w = [0.0; CELLS];
        let mut to_lumps_w_per_k = [0.0; CELLS];
        for cell in 0..CELLS {
            let nut_w_per_k = self.nut.to_screw_w_per_k * stood_s[cell] * per_dwell;
            to_lumps_w_per_k[cell] = nut_w_per_k;
            into_cell_w[cell] = self.nut_w_per_mm_s * self.nut_share_to_screw * rubbed_mm[cell]
                / step_s
                + nut_w_per_k * self.nut.temp_degc
                + self.cell_to_air_w_per_k * around.air_degc;
        }
        into_cell_w[fixed] += self.bearing.to_screw_w_per_k * self.bearing.temp_degc;
        let from_nut = to_lumps_w_per_k;
        to_lumps_w_per_k[fixed] += self.bearing.to_screw_w_per_k;
        self.conduct(&into_cell_w, &to_lumps_w_per_k, step_s);

        let nut_to_screw_w: f64 = (0..CELLS)
            .map(|cell| from_nut[cell] * (self.nut.temp_degc - self.temp_degc[cell]))
            .sum();
        let bearing_to_screw_w =
            self.bearing.to_screw_w_per_k * (self.bearing.temp_degc - self.temp_degc[fixed]);
        let nut_w = self.nut_w_per_mm_s * (1.0 - self.nut_share_to_screw) * total_path_mm / step_s;
        let bearing_w = (self.bearing_w_per_mm_s * total_path_mm + self.motor_j) / step_s;
        let outflow = Outflow {
            into_nut_place_w: self
                .nut
                .step(nut_w - nut_to_screw_w, around.nut_place_degc, step_s),
            into_bearing_place_w: self.bearing.step(
                bearing_w - bearing_to_screw_w,
                around.bearing_place_degc,
                step_s,
            ),
            into_air_w: self.cell_to_air_w_per_k
                * (self.temp_degc.iter().sum::<f64>() - CELLS as f64 * around.air_degc),
        };
        self.path_mm = [0.0; CELLS];
        self.dwell_s = [0.0; CELLS];
        self.motor_j = 0.0;
        self.integrate_growth();
        outflow
    }

    /// Spreads what happened at the nut's middle over the nut's length; keeps the sum.
    fn smear(&self, at_middle: &[f64; CELLS]) -> [f64; CELLS] {
        let mut spread = [0.0; CELLS];
        for (cell, &amount) in at_middle.iter().enumerate() {
            if amount > 0.0 {
                let from = cell.saturating_sub(self.nut_half_cells);
                let to = (cell + self.nut_half_cells).min(CELLS - 1);
                let part = amount / (to - from + 1) as f64;
                for value in &mut spread[from..=to] {
                    *value += part;
                }
            }
        }
        spread
    }

    /// Backward Euler of (1): a tridiagonal system, solved by elimination (Thomas).
    fn conduct(
        &mut self,
        into_cell_w: &[f64; CELLS],
        to_lumps_w_per_k: &[f64; CELLS],
        step_s: f64,
    ) {
        let inertia = self.cell_capacity_j_per_k / step_s;
        let link = self.cell_to_cell_w_per_k;
        let mut upper = [0.0; CELLS];
        let mut value = [0.0; CELLS];
        for cell in 0..CELLS {
            let (left, right) = (cell > 0, cell + 1 < CELLS);
            let links = f64::from(u8::from(left) + u8::from(right));
            let mut diagonal =
                inertia + self.cell_to_air_w_per_k + to_lumps_w_per_k[cell] + links * link;
            let mut source = inertia * self.temp_degc[cell] + into_cell_w[cell];
            if left {
                diagonal -= link * upper[cell - 1];
                source += link * value[cell - 1];
            }
            upper[cell] = if right { link / diagonal } else { 0.0 };
            value[cell] = source / diagonal;
        }
        let mut next = 0.0;
        for cell in (0..CELLS).rev() {
            next = value[cell] + upper[cell] * next;
            self.temp_degc[cell] = next;
        }
    }

    fn integrate_growth(&mut self) {
        let per_cell = self.expansion_per_k * self.cell_mm;
        let mut border = [0.0; CELLS + 1];
        for cell in 0..CELLS {
            border[cell + 1] =
                border[cell] + per_cell * (self.temp_degc[cell] - self.reference_degc);
        }
        let total = border[CELLS];
        let relaxed = total.min(self.stretch_mm);
        for (index, growth) in self.growth_mm.iter_mut().enumerate() {
            let share = index as f64 / CELLS as f64;
            *growth = if self.fixed_low {
                border[index] - share * relaxed // (2), (3)
            } else {
                border[index] - total + (1.0 - share) * relaxed
            };
        }
    }
}

impl Lump {
    /// Takes `net_w` up, passes heat on to its casting, and gives how much it passed on.
    fn step(&mut self, net_w: f64, place_degc: f64, step_s: f64) -> f64 {
        let inertia = self.capacity_j_per_k / step_s;
        let warm = (inertia * self.temp_degc + net_w + self.to_place_w_per_k * place_degc)
            / (inertia + self.to_place_w_per_k);
        self.temp_degc = warm;
        self.to_place_w_per_k * (warm - place_degc)
    }
}

fn check(place: &str, entry: &ScrewEntry) -> Result<(), PlantError> {
    let at = |key: &str| format!("{place}.{key}");
    require_finite(at("ends_mm[0]"), entry.ends_mm[0])?;
    require(
        entry.ends_mm[1] > entry.ends_mm[0] && entry.ends_mm[1].is_finite(),
        at("ends_mm[1]"),
        entry.ends_mm[1],
        "finite and above ends_mm[0]",
    )?;
    for (key, value) in [
        ("diameter_mm", entry.diameter_mm),
        ("conductivity_w_per_m_k", entry.conductivity_w_per_m_k),
        ("heat_capacity_mj_per_m3_k", entry.heat_capacity_mj_per_m3_k),
        ("nut_length_mm", entry.nut_length_mm),
        ("nut_heat_capacity_j_per_k", entry.nut_heat_capacity_j_per_k),
        (
            "bearing_heat_capacity_j_per_k",
            entry.bearing_heat_capacity_j_per_k,
        ),
    ] {
        require_positive(at(key), value)?;
    }
    for (key, value) in [
        ("expansion_um_per_m_k", entry.expansion_um_per_m_k),
        ("convection_w_per_m2_k", entry.convection_w_per_m2_k),
        ("pretension_um", entry.pretension_um),
        ("nut_torque_n_m", entry.nut_torque_n_m),
        ("nut_to_place_w_per_k", entry.nut_to_place_w_per_k),
        ("bearing_torque_n_m", entry.bearing_torque_n_m),
        ("bearing_to_place_w_per_k", entry.bearing_to_place_w_per_k),
        ("motor_loss_w_per_kn2", entry.motor_loss_w_per_kn2),
    ] {
        require_not_negative(at(key), value)?;
    }
    let share = entry.nut_heat_share_to_screw;
    require(
        (0.0..=1.0).contains(&share),
        at("nut_heat_share_to_screw"),
        share,
        "from 0 to 1",
    )?;
    check_exchange(place, entry)
}

/// The lumps see the screw's new temperature but give their old one: stable while the exchange of
/// one heat step is small against their capacity.
fn check_exchange(place: &str, entry: &ScrewEntry) -> Result<(), PlantError> {
    for (key, conductance, capacity) in [
        (
            "nut_to_screw_w_per_k",
            entry.nut_to_screw_w_per_k,
            entry.nut_heat_capacity_j_per_k,
        ),
        (
            "bearing_to_screw_w_per_k",
            entry.bearing_to_screw_w_per_k,
            entry.bearing_heat_capacity_j_per_k,
        ),
    ] {
        let holds = conductance >= 0.0 && conductance <= 0.5 * capacity;
        let limit = "from 0 to half the lump's capacity per second";
        require(holds, format!("{place}.{key}"), conductance, limit)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::plant::file::Place;

    fn entry() -> ScrewEntry {
        ScrewEntry {
            ends_mm: [-400.0, 400.0],
            fixed_end: ScrewEnd::Low,
            diameter_mm: 40.0,
            conductivity_w_per_m_k: 46.0,
            heat_capacity_mj_per_m3_k: 3.6,
            expansion_um_per_m_k: 11.6,
            convection_w_per_m2_k: 15.0,
            pretension_um: 0.0,
            nut_length_mm: 100.0,
            nut_torque_n_m: 0.8,
            nut_heat_share_to_screw: 0.5,
            nut_heat_capacity_j_per_k: 1900.0,
            nut_to_screw_w_per_k: 5.0,
            nut_to_place_w_per_k: 6.0,
            nut_place: Place::Table,
            bearing_torque_n_m: 0.2,
            bearing_heat_capacity_j_per_k: 3500.0,
            bearing_to_screw_w_per_k: 3.0,
            bearing_to_place_w_per_k: 6.0,
            bearing_place: Place::Bed,
            motor_loss_w_per_kn2: 6.0,
        }
    }

    fn screw(entry: &ScrewEntry) -> Screw {
        Screw::new("heat.screws.X", entry, 10.0, 20.0, 20.0).unwrap()
    }

    const AROUND: Surroundings = Surroundings {
        air_degc: 20.0,
        nut_place_degc: 20.0,
        bearing_place_degc: 20.0,
    };

    #[test]
    fn val_heated_end_reaches_the_fin_solution() {
        for fixed_end in [ScrewEnd::Low, ScrewEnd::High] {
            let entry = ScrewEntry {
                fixed_end,
                ..entry()
            };
            let mut screw = screw(&entry);
            screw.bearing.capacity_j_per_k = 1e12;
            screw.bearing.temp_degc = 60.0;
            for _ in 0..60_000 {
                screw.step(&AROUND, 1.0);
            }
            // theta(x) = q cosh(m (L - x)) / (k S m sinh(m L)), m^2 = h pi D / (k S)
            let (length_m, section_m2) = (0.8, PI / 4.0 * 0.04_f64.powi(2));
            let ks = 46.0 * section_m2;
            let m = (15.0 * PI * 0.04 / ks).sqrt();
            let fixed = if fixed_end == ScrewEnd::Low {
                0
            } else {
                CELLS - 1
            };
            let q_w = 3.0 * (screw.bearing.temp_degc - screw.temp_degc[fixed]);
            for cell in 0..CELLS {
                let from_fixed = if fixed_end == ScrewEnd::Low {
                    cell
                } else {
                    CELLS - 1 - cell
                };
                let x_m = (from_fixed as f64 + 0.5) * length_m / CELLS as f64;
                let fin_k = q_w * (m * (length_m - x_m)).cosh() / (ks * m * (m * length_m).sinh());
                let seen_k = screw.temp_degc[cell] - 20.0;
                assert!(
                    (seen_k / fin_k - 1.0).abs() < 2e-3,
                    "cell {cell}: {seen_k} {fin_k}"
                );
            }
            // All heat leaves through the surface, so the whole growth is alpha q / (h pi D).
            let whole_mm = 1e3 * 11.6e-6 * q_w / (15.0 * PI * 0.04);
            let (far_mm, sign) = if fixed_end == ScrewEnd::Low {
                (400.0, 1.0)
            } else {
                (-400.0, -1.0)
            };
            let seen_mm = sign * screw.growth_mm(far_mm);
            assert!(
                (seen_mm / whole_mm - 1.0).abs() < 1e-6,
                "{seen_mm} {whole_mm}"
            );
            assert!(screw.growth_mm(-far_mm).abs() < 1e-12);
        }
    }

    #[test]
    fn val_first_mode_decays_as_the_heat_equation_says() {
        let entry = ScrewEntry {
            convection_w_per_m2_k: 0.0,
            nut_to_screw_w_per_k: 0.0,
            bearing_to_screw_w_per_k: 0.0,
            ..entry()
        };
        let mut screw = screw(&entry);
        let mode = |cell: usize| (PI * (cell as f64 + 0.5) / CELLS as f64).cos();
        for (cell, temp_degc) in screw.temp_degc.iter_mut().enumerate() {
            *temp_degc = 20.0 + 5.0 * mode(cell);
        }
        for _ in 0..3600 {
            screw.step(&AROUND, 1.0);
        }
        let diffusivity = 46.0 / 3.6e6;
        let expected = 5.0 * (-diffusivity * (PI / 0.8_f64).powi(2) * 3600.0).exp();
        for cell in 0..CELLS {
            let seen = screw.temp_degc[cell] - 20.0;
            assert!((seen - expected * mode(cell)).abs() < 2e-3 * expected);
        }
    }

    #[test]
    fn a_short_stroke_makes_a_hot_zone_with_curved_growth() {
        let mut screw = screw(&entry());
        for _ in 0..3600 {
            for nut_mm in [60.0, 90.0, 120.0, 150.0] {
                screw.rub(nut_mm, 40.0, 0.0, 0.25);
            }
            screw.step(&AROUND, 1.0);
        }
        let slope = |a: f64, b: f64| (screw.growth_mm(b) - screw.growth_mm(a)) / (b - a);
        let (hot, near_bearing, far) = (
            slope(60.0, 150.0),
            slope(-300.0, -210.0),
            slope(300.0, 390.0),
        );
        assert!(
            hot > 3.0 * near_bearing && hot > 1.5 * far,
            "{hot} {near_bearing} {far}"
        );
    }

    #[test]
    fn eq3_a_stretched_screw_grows_only_between_its_bearings_until_the_stretch_is_used_up() {
        let mut screw = screw(&ScrewEntry {
            pretension_um: 30.0,
            ..entry()
        });
        let warm_by = |screw: &mut Screw, kelvin: f64| {
            screw.temp_degc = std::array::from_fn(|cell| {
                20.0 + kelvin * if cell < CELLS / 2 { 2.0 } else { 0.0 }
            });
            screw.integrate_growth();
        };
        warm_by(&mut screw, 2.0);
        assert!(
            screw.growth_mm(400.0).abs() < 1e-12,
            "the far bearing holds"
        );
        // Half of e(L) = 11.6e-6 * 800 * 2 is lost to the relaxation at mid-screw.
        assert!((screw.growth_mm(0.0) - 0.5 * 11.6e-6 * 800.0 * 2.0).abs() < 1e-9);
        warm_by(&mut screw, 10.0);
        let free_mm = 11.6e-6 * 800.0 * 10.0;
        assert!((screw.growth_mm(400.0) - (free_mm - 0.03)).abs() < 1e-9);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn prop_eq1_screw_nut_and_bearing_keep_every_joule(
            rubs in prop::collection::vec((-400.0..400.0_f64, 0.0..300.0_f64, 0.0..5.0_f64), 1..40),
            air_degc in 15.0..30.0_f64,
            bearing_place_degc in 15.0..30.0_f64,
            nut_place_degc in 15.0..30.0_f64,
        ) {
            let mut screw = screw(&entry());
            let around = Surroundings { air_degc, nut_place_degc, bearing_place_degc };
            let before_j = screw.stored_j();
            let mut net_j = 0.0;
            for (nut_mm, path_mm, force_kn) in rubs {
                screw.rub(nut_mm, path_mm, force_kn, 1.0);
                let angle_rad = path_mm * 2.0 * PI / 10.0;
                net_j += (0.8 + 0.2) * angle_rad + 6.0 * force_kn * force_kn;
                let out = screw.step(&around, 1.0);
                net_j -= out.into_air_w + out.into_bearing_place_w + out.into_nut_place_w;
            }
            let stored_j = screw.stored_j() - before_j;
            prop_assert!((stored_j - net_j).abs() < 1e-9 * before_j, "{stored_j} {net_j}");
        }
    }
}
