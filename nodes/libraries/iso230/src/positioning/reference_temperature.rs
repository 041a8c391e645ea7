//! Deviations as they are at 20 °C, the temperature at which lengths are defined (ISO 1).
//!
//! # Model
//!
//! The slide of a warm machine moves too far, and a warm device counts too little. With the temperatures θ and the
//! coefficients α of the machine's positioning system (m) and of the device (d):
//!
//! ```text
//!   ε = α_m (θ_m − 20 °C) − α_d (θ_d − 20 °C)     nominal differential expansion      (1)
//!   x_ij at 20 °C = x_ij − ε (P_i − P_0)                                              (2)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | ε | [`PositioningBudget::differential_expansion`](super::budget::PositioningBudget::differential_expansion) | mm/mm |
//! | P_0 | `zero_mm`, where the device was set to zero | mm |
//!
//! An interferometer whose wavelength is corrected for the air has α_d = 0. One with material compensation on has (2) in its
//! readings already, and ε is 0 for them.
//!
//! # Holds when
//! Each body has one temperature over the measured length. Products of two expansions are left out: 0.2 nm over
//! 400 mm at 22 °C.
//!
//! # Agreement
//! `val_iso230_2_at_20_degc_numpy`: a scale and a step gauge of exact expansion, below 1 nm over 960 mm.
//!
//! # References
//! \[1\] ISO 230-2:2014, test conditions, nominal differential expansion, and ISO/TR 16015:2003; from the literature,
//! the texts were not at hand. \[2\] ISO 1:2016.

use super::PositioningRuns;

impl PositioningRuns {
    /// The runs at 20 °C, by (2); `differential_expansion` is (1), mm/mm.
    #[must_use]
    pub fn corrected_to_20_degc(mut self, differential_expansion: f64) -> Self {
        let (targets_mm, zero_mm) = (&self.targets_mm, self.zero_mm);
        for run in self.up_mm.iter_mut().chain(&mut self.down_mm) {
            for (deviation_mm, target_mm) in run.iter_mut().zip(targets_mm) {
                *deviation_mm -= differential_expansion * (target_mm - zero_mm);
            }
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq2_takes_8_8_um_out_of_400_mm_at_22_degc_by_hand() {
        // 11 µm/(m K), 2 K, 0.4 m: 8.8 µm; a true deviation of 0.05 µm at the far end.
        let runs = PositioningRuns {
            targets_mm: vec![-200.0, 0.0, 200.0],
            up_mm: vec![vec![0.0, 0.004_4, 0.008_85]],
            down_mm: vec![vec![0.001, 0.005_4, 0.009_85]],
            zero_mm: -200.0,
            periods_mm: vec![],
        };
        let at_20 = runs.corrected_to_20_degc(11e-6 * 2.0);
        for (found, by_hand) in [(&at_20.up_mm[0], 0.0), (&at_20.down_mm[0], 0.001)] {
            let expected = [by_hand, by_hand, by_hand + 0.000_05];
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-12, "{found}");
            }
        }
    }
}
