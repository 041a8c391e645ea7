//! How a circle was read, as far as it is stated: by the entry of the budget for its own instrument and no other.

use iso230::breakdown::{Instrument as Errors, ReferenceLength};
use iso230::budget::{DeviceUncertainty, drift_mm};

use super::budget::Budget;
use super::circles::Instrument;
use super::correction::{Correction, MeasuredCircle};
use super::test_conditions::Thermometers;

/// A calibrated length of which nothing is stated.
const NO_LENGTH: DeviceUncertainty = DeviceUncertainty {
    expanded_uncertainty_mm: 0.0,
    expanded_uncertainty_per_length: 0.0,
    coverage_factor: 2.0,
};

/// How a circle was read.
#[derive(Clone, Debug, PartialEq)]
pub struct CircleReading {
    /// Uncertainties, and what makes its radii those at 20 °C.
    pub measured: MeasuredCircle,
    /// What read it.
    pub instrument: Instrument,
    /// Why no figure has an uncertainty; none: they have.
    pub unstated: Option<&'static str>,
    /// Standard uncertainty of the angle between the plate's axes, rad, where it is stated.
    pub plate_squareness_rad: Option<f64>,
    /// Whether F and D, which are lengths, have one: a ballbar reads changes of a calibrated length.
    has_length: bool,
}

impl CircleReading {
    /// Of circles that `instrument` read while `read` was the temperature.
    #[must_use]
    pub fn of(budget: Option<&Budget>, read: &Thermometers, instrument: Instrument) -> Self {
        match instrument {
            Instrument::GridEncoder => Self {
                measured: MeasuredCircle::by_plate(budget, read),
                instrument,
                unstated: budget.is_none().then_some(NO_BUDGET),
                plate_squareness_rad: budget.and_then(Budget::plate_squareness_rad),
                has_length: budget.is_some(),
            },
            Instrument::Ballbar => Self::by_ballbar(budget, read),
        }
    }

    fn by_ballbar(budget: Option<&Budget>, read: &Thermometers) -> Self {
        let own = budget.and_then(Budget::of_ballbar);
        let length = budget.and_then(Budget::ballbar_length);
        let mut measured = MeasuredCircle::of(own.as_ref(), read);
        measured.budget.length = Some(length.unwrap_or(NO_LENGTH));
        let missing = |reason: &str| Correction::Missing {
            reason: reason.to_owned(),
        };
        let unstated = match (budget, &own) {
            (None, _) => Some(NO_BUDGET),
            (Some(_), None) => Some(NO_BALLBAR),
            (Some(_), Some(_)) => None,
        };
        if budget.is_some() && length.is_none() {
            measured.correction = missing(NO_CALIBRATED_LENGTH);
        } else if budget.is_some_and(|budget| !budget.has_ballbar_body()) {
            measured.correction = missing(NO_BODY);
        }
        Self {
            measured,
            instrument: Instrument::Ballbar,
            unstated,
            plate_squareness_rad: None,
            has_length: length.is_some(),
        }
    }

    /// Whether nothing at all is stated.
    #[must_use]
    pub fn has_no_budget(&self) -> bool {
        self.unstated == Some(NO_BUDGET)
    }

    /// Whether G and H have an uncertainty.
    #[must_use]
    pub const fn is_stated(&self) -> bool {
        self.unstated.is_none()
    }

    /// Whether F and D have one.
    #[must_use]
    pub const fn are_radii_stated(&self) -> bool {
        self.is_stated() && self.has_length
    }

    /// Why nothing is decided of F and D; none: they are the radii at 20 °C.
    #[must_use]
    pub fn no_verdict_on_radii(&self) -> Option<String> {
        if self.instrument == Instrument::Ballbar && !self.has_length {
            return Some(NO_CALIBRATED_LENGTH.to_owned());
        }
        self.measured.correction.lacks()
    }

    /// What its errors make of the causes of a circle; none where they are not stated.
    #[must_use]
    pub fn errors(&self) -> Option<Errors> {
        let budget = &self.measured.budget;
        let drift_mm = drift_mm(budget.environmental_drift_mm);
        self.is_stated().then(|| match self.instrument {
            Instrument::GridEncoder => Errors::Plate {
                certificate: budget.displacement,
                squareness_rad: self.plate_squareness_rad.unwrap_or(0.0),
                drift_mm,
            },
            Instrument::Ballbar => Errors::Ballbar {
                reading_mm: budget.displacement.standard_mm(0.0),
                drift_mm,
            },
        })
    }

    /// Whether radii of the causes are lengths. What a plate is off by is in [`Self::errors`].
    #[must_use]
    pub fn reference(&self, radius_mm: f64) -> ReferenceLength {
        let of_length = self.measured.budget.length;
        if !self.are_radii_stated() {
            return ReferenceLength::Free;
        }
        ReferenceLength::Calibrated {
            standard_uncertainty_mm: of_length.map_or(0.0, |one| one.standard_mm(radius_mm)),
        }
    }
}

const NO_BUDGET: &str = "no budget was given (--budget)";
const NO_BALLBAR: &str = "no uncertainty of the ballbar is stated (ballbar of the budget file), and no other instrument's counts for it";
const NO_CALIBRATED_LENGTH: &str =
    "the calibrated length of the ballbar is not stated (ballbar.length of the budget file)";
const NO_BODY: &str =
    "the budget file states no ballbar.body (temperature and expansion of the ballbar)";

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;
    use std::path::Path;

    use iso230::circular::{CircularTest, CircularTrace, evaluate};

    use super::*;

    const BUDGET: &str = "
grid_encoder: {expanded_uncertainty_um: 0.4, expanded_uncertainty_um_per_m: 2.0, coverage_factor: 2.0}
length_reference: {expanded_uncertainty_um: 0.1, expanded_uncertainty_um_per_m: 0.5, coverage_factor: 2.0}
machine: {temperature_deviation_k: 2.0, temperature_half_width_k: 0.0, expansion_um_per_m_k: 11.0, expansion_half_width_um_per_m_k: 0.0}
device: {temperature_deviation_k: 0.0, temperature_half_width_k: 0.0, expansion_um_per_m_k: 0.0, expansion_half_width_um_per_m_k: 0.0}
misalignment_mm: 0.1
environmental_drift_um: 0.0
length_corrected_by_instrument: true
";
    const BALLBAR: &str =
        "expanded_uncertainty_um: 1.0, expanded_uncertainty_um_per_m: 0.0, coverage_factor: 2.0";
    const LENGTH: &str = "length: {expanded_uncertainty_um: 1.5, expanded_uncertainty_um_per_m: 5.0, coverage_factor: 2.0}";
    const BODY: &str = "body: {temperature_deviation_k: 1.0, temperature_half_width_k: 0.0, expansion_um_per_m_k: 2.0, expansion_half_width_um_per_m_k: 0.0}";

    fn by_ballbar(entry: &str) -> CircleReading {
        let text = format!("{BUDGET}{entry}\n");
        let budget = Budget::read(&text, Path::new("budget.yaml")).unwrap();
        CircleReading::of(Some(&budget), &Thermometers::new(), Instrument::Ballbar)
    }

    /// U of G of one sense, F max, G of both, D and H of a circle of 100 mm, µm.
    fn expanded_um(reading: &CircleReading) -> [f64; 5] {
        let points = || {
            let angles = (0..360).map(|k| TAU * f64::from(k) / 360.0);
            CircularTrace::PointsMm(angles.map(|a| [100.0 * a.cos(), 100.0 * a.sin()]).collect())
        };
        let test = CircularTest {
            nominal_radius_mm: 100.0,
            clockwise: Some(points()),
            counter_clockwise: Some(points()),
        };
        let found = evaluate(&test, &reading.measured.budget).unwrap();
        let (one, both) = (found.clockwise.unwrap(), found.both.unwrap());
        [
            one.circular_error,
            one.greatest_radial_deviation,
            both.circular_error,
            both.mean_radial_deviation,
            both.hysteresis_1996,
        ]
        .map(|figure| 1e3 * figure.expanded_uncertainty_mm)
    }

    #[test]
    fn eq11_a_ballbar_has_its_own_uncertainty_by_hand() {
        let reading = by_ballbar(&format!("ballbar: {{{BALLBAR}, {LENGTH}, {BODY}}}"));
        assert!(reading.are_radii_stated());
        // U₀ = 1 µm: 2 √2 U₀/2 = 1.414 µm of a difference of two readings; over 100 mm the length has 1.5 + 0.5 = 2 µm, with
        // the reading √(1² + 2²) = 2.236 µm.
        let [apart, radius] = [2.0_f64.sqrt(), 5.0_f64.sqrt()];
        let by_hand = [apart, radius, apart, radius, apart];
        for (found, by_hand) in expanded_um(&reading).into_iter().zip(by_hand) {
            assert!((found - by_hand).abs() < 1e-9, "{found} {by_hand}");
        }
        // 11 µm/(m K) 2 K less 2 µm/(m K) 1 K of the ballbar: 20 µm/m. The laser corrects itself, the ballbar does not.
        let expansion = reading.measured.correction.differential_expansion();
        assert!((expansion - 20e-6).abs() < 1e-15, "{expansion}");
        assert_eq!(reading.no_verdict_on_radii(), None);
        assert_eq!(
            reading.reference(100.0),
            ReferenceLength::Calibrated {
                standard_uncertainty_mm: 1e-3
            }
        );
    }

    #[test]
    fn without_a_calibrated_length_only_g_and_h_are_stated() {
        let reading = by_ballbar(&format!("ballbar: {{{BALLBAR}}}"));
        assert!(reading.is_stated() && !reading.are_radii_stated());
        let g_um = expanded_um(&reading)[0];
        assert!((g_um - 2.0_f64.sqrt()).abs() < 1e-9, "{g_um}");
        let why = reading.measured.correction.lacks().unwrap();
        assert!(why.contains("calibrated length of the ballbar"), "{why}");
        assert_eq!(reading.reference(100.0), ReferenceLength::Free);
        let with_length = by_ballbar(&format!("ballbar: {{{BALLBAR}, {LENGTH}}}"));
        let why = with_length.measured.correction.lacks().unwrap();
        assert!(why.contains("ballbar.body"), "{why}");
    }

    #[test]
    fn no_other_instruments_entry_counts_for_a_ballbar() {
        let reading = by_ballbar("");
        assert!(!reading.is_stated() && reading.errors().is_none());
        let why = reading.unstated.unwrap();
        assert!(
            why.contains("no uncertainty of the ballbar is stated"),
            "{why}"
        );
        assert!(expanded_um(&reading)[0].abs() < 1e-12);
    }

    #[test]
    fn a_plate_has_its_squareness_where_the_budget_states_it() {
        let of = |more: &str| {
            let text = format!("{BUDGET}{more}");
            let budget = Budget::read(&text, Path::new("budget.yaml")).unwrap();
            CircleReading::of(Some(&budget), &Thermometers::new(), Instrument::GridEncoder)
        };
        let Some(Errors::Plate {
            squareness_rad,
            certificate,
            ..
        }) = of("plate_squareness_urad: 2.0\n").errors()
        else {
            panic!("no plate");
        };
        // k = 2.
        assert!((squareness_rad - 1e-6).abs() < 1e-18);
        assert!((certificate.standard_mm(0.0) - 2e-4).abs() < 1e-15);
        assert_eq!(of("").plate_squareness_rad, None);
        let none = CircleReading::of(None, &Thermometers::new(), Instrument::GridEncoder);
        assert_eq!((none.errors(), none.is_stated()), (None, false));
    }
}
